//! The macro that makes an enum of requests from a table.

/// Defines an enum of requests by a table of number, name and fields. Reading and writing follow from the table.
macro_rules! requests {
    (
        $(#[$about:meta])*
        pub enum $name:ident {
            $($(#[$says:meta])* $number:literal $request:ident $({ $($field:ident: $type:ty),+ })?,)+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[expect(missing_docs, reason = "the protocol's own names")]
        pub enum $name {
            $($(#[$says])* $request $({ $($field: $type),+ })?,)+
        }

        impl $name {
            /// The numbers of these requests.
            pub const NUMBERS: &[u16] = &[$($number),+];

            /// The number of the request.
            pub const fn number(&self) -> u16 {
                match self {
                    $(Self::$request { .. } => $number,)+
                }
            }

            /// Reads the fields of the request with this number.
            pub(crate) fn read(
                number: u16,
                fields: &mut $crate::protocol::payload::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                // In a table without fields the argument is not used otherwise.
                let _ = &fields;
                Ok(match number {
                    $($number => Self::$request $({
                        $($field: <$type as $crate::protocol::payload::Field>::read(fields)?),+
                    })?,)+
                    _ => return Err($crate::protocol::Nack::UNSUPPORTED),
                })
            }

            /// Appends the fields of the request.
            pub(crate) fn write(&self, payload: &mut $crate::protocol::payload::Payload) {
                let _ = &payload;
                match self {
                    $(Self::$request $({ $($field),+ })? => {
                        $($($crate::protocol::payload::Field::write($field, payload);)+)?
                    })+
                }
            }
        }
    };
}
pub(crate) use requests;
