//! The macro that makes an enum of requests from a table.

/// Defines an enum of requests by a table of number, name and fields. Reading and writing follow from the table. The packet
/// types of the table's numbers begin at `from`.
macro_rules! requests {
    (
        $(#[$about:meta])*
        pub enum $name:ident from $first:expr => {
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

            /// True if a request of this table has this packet type, on hubs of this project.
            pub fn has(id: u16) -> bool {
                Self::NUMBERS.contains(&id.wrapping_sub($first))
            }

            /// The packet type, on hubs of this project.
            pub const fn id(&self) -> u16 {
                $first + self.number()
            }

            /// The number of the request.
            pub const fn number(&self) -> u16 {
                match self {
                    $(Self::$request { .. } => $number,)+
                }
            }

            /// Reads the fields of the request with this packet type.
            pub(crate) fn read(
                id: u16,
                fields: &mut $crate::protocol::payload::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                // In a table without fields the argument is not used otherwise.
                let _ = &fields;
                Ok(match id.wrapping_sub($first) {
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
