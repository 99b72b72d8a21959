//! Tables of requests.

/// An enum of requests from a table: number, name, fields. It is what says how each is read and written.
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
        #[expect(missing_docs, reason = "each is named as the protocol names it")]
        pub enum $name {
            $($(#[$says])* $request $({ $($field: $type),+ })?,)+
        }

        impl $name {
            /// The numbers of these requests.
            pub const NUMBERS: &[u16] = &[$($number),+];

            /// Its number.
            pub const fn number(&self) -> u16 {
                match self {
                    $(Self::$request { .. } => $number,)+
                }
            }
        }

        impl $name {
            /// The request with this number, its fields those that come next.
            pub(super) fn read(
                number: u16,
                fields: &mut $crate::protocol::fields::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                // Nobody reads from them where no request has any.
                let _ = &fields;
                Ok(match number {
                    $($number => Self::$request $({
                        $($field: <$type as $crate::protocol::fields::Field>::read(fields)?),+
                    })?,)+
                    _ => return Err($crate::protocol::Nack::UNSUPPORTED),
                })
            }

            /// Appends the fields.
            pub(super) fn write(&self, payload: &mut $crate::protocol::fields::Payload) {
                let _ = &payload;
                match self {
                    $(Self::$request $({ $($field),+ })? => {
                        $($($crate::protocol::fields::Field::write($field, payload);)+)?
                    })+
                }
            }
        }
    };
}
pub(super) use requests;
