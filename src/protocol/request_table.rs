//! A macro that defines requests by a table.

/// Defines an enum of requests by a table. Each line has the number, the name and the fields of a request. The packet
/// type of a request is its number plus the value after `from`. The macro also defines functions that read and write
/// the requests.
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
            /// Numbers of all requests in the table.
            pub const NUMBERS: &[u16] = &[$($number),+];

            /// True if the table has a request with this packet type, on hubs of this project.
            pub fn has(id: u16) -> bool {
                Self::NUMBERS.contains(&id.wrapping_sub($first))
            }

            /// Returns the packet type, on hubs of this project.
            pub const fn id(&self) -> u16 {
                $first + self.number()
            }

            /// Returns the number of the request in the table.
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
                // If no request of a table has fields, the argument is not used otherwise.
                let _ = &fields;
                Ok(match id.wrapping_sub($first) {
                    $($number => Self::$request $({
                        $($field: <$type as $crate::protocol::payload::Field>::read(fields)?),+
                    })?,)+
                    _ => return Err($crate::protocol::Nack::UNSUPPORTED),
                })
            }

            /// Appends the fields of the request to a payload.
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
