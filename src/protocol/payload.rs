//! Payloads of packets as sequences of fields. For each type of field, [`Field`] defines how it is read and written.
//! Numbers are little-endian.
//!
//! ```
//! use motor_hub::protocol::Nack;
//! use motor_hub::protocol::payload::{ByteIn, Field, Fields, Payload};
//!
//! let mut payload = Payload::new();
//! true.write(&mut payload);
//! (-2i16).write(&mut payload);
//! assert_eq!(*payload, [1, 0xFE, 0xFF]);
//!
//! let mut fields = Fields::new(&payload);
//! assert_eq!(bool::read(&mut fields), Ok(true));
//! // The second field is no motor 0 to 3, and the third field is not complete.
//! assert_eq!(ByteIn::<0, 3>::read(&mut fields), Err(Nack::parameter(1)));
//! assert_eq!(u16::read(&mut fields), Err(Nack::parameter(2)));
//! ```

use super::refusal::Nack;
use crate::units::{
    Acceleration, AccelerationPerVolt, Coefficient, Control, CountsPerSecond, DecayRate, Duty, EmfConstant,
    Milliamperes, Millivolts,
};
use heapless::Vec;

/// Number of payload bytes that a packet stores. Further bytes of a received packet are ignored. The longest payload of
/// this project has 164 bytes.
pub const PAYLOAD_KEPT: usize = 168;

/// The payload of a packet.
pub type Payload = Vec<u8, PAYLOAD_KEPT>;

/// A value in a payload. A value consists of one field, or of several fields in a fixed order.
pub trait Field: Sized {
    /// Reads the value from the next field or fields.
    ///
    /// # Errors
    /// Returns [`Nack::parameter`] with the number of the first field that is missing or out of range.
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack>;

    /// Appends the value to a payload. Bytes beyond [`PAYLOAD_KEPT`] are dropped, but no payload of this project is so
    /// long.
    fn write(&self, payload: &mut Payload);
}

/// Reads the fields of a payload in their order. Fields are counted, so that a refusal can state the number of a field.
#[derive(Clone, Debug)]
pub struct Fields<'a> {
    /// Bytes of the fields that have not been read.
    rest: &'a [u8],
    /// Number of the next field, from 0.
    index: u8,
}

impl<'a> Fields<'a> {
    /// Creates a reader of a payload. The first field is read next.
    pub const fn new(payload: &'a [u8]) -> Self {
        Self { rest: payload, index: 0 }
    }

    /// Returns the number of the next field.
    pub(crate) const fn index(&self) -> u8 {
        self.index
    }

    /// Reads a field and converts its value. If `convert` returns `None`, the field counts as out of range.
    pub(crate) fn checked<F: Field, T>(&mut self, convert: impl FnOnce(F) -> Option<T>) -> Result<T, Nack> {
        let index = self.index;
        convert(F::read(self)?).ok_or(Nack::parameter(index))
    }

    /// Reads the number of a motor. The number must be less than `motors`.
    pub(crate) fn motor(&mut self, motors: usize) -> Result<u8, Nack> {
        self.checked(|motor: u8| Some(motor).filter(|motor| usize::from(*motor) < motors))
    }

    /// Reads `length` bytes as one field.
    pub(crate) fn slice(&mut self, length: usize) -> Result<&'a [u8], Nack> {
        let (field, rest) = self.rest.split_at_checked(length).ok_or(Nack::parameter(self.index))?;
        self.rest = rest;
        self.index = self.index.saturating_add(1);
        Ok(field)
    }

    /// Reads a field that ends with a zero byte. Returns the bytes before the zero.
    pub(super) fn zero_terminated(&mut self) -> Result<&'a [u8], Nack> {
        let length = self.rest.iter().position(|byte| *byte == 0).ok_or(Nack::parameter(self.index))?;
        let text = self.slice(length)?;
        self.rest = self.rest.get(1..).unwrap_or_default();
        Ok(text)
    }

    /// True if no bytes are left.
    pub(crate) const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}

/// Appends as many bytes as fit in the payload.
// Copies of this loop in all writers of answers would take 2 kB of an image's flash.
#[inline(never)]
pub(super) fn append(payload: &mut Payload, bytes: &[u8]) {
    for &byte in bytes {
        let _ = payload.push(byte);
    }
}

/// Implements [`Field`] for integers.
macro_rules! numbers {
    ($($number:ty),+) => {$(
        impl Field for $number {
            fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
                let (field, rest) =
                    fields.rest.split_first_chunk().ok_or(Nack::parameter(fields.index))?;
                fields.rest = rest;
                fields.index = fields.index.saturating_add(1);
                Ok(Self::from_le_bytes(*field))
            }

            fn write(&self, payload: &mut Payload) {
                append(payload, &self.to_le_bytes());
            }
        }
    )+};
}

numbers!(u8, u16, u32, i16, i32);

/// Implements [`Field`] for quantities. Each line states the integer in the payload, and the functions that convert
/// from and to this integer.
macro_rules! quantities {
    ($($type:ident: $number:ty, $from:expr, $to:expr;)+) => {$(
        impl Field for $type {
            fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
                fields.checked($from)
            }

            fn write(&self, payload: &mut Payload) {
                let number: $number = $to(*self);
                number.write(payload);
            }
        }
    )+};
}

quantities! {
    Acceleration: u32, |number: u32| Self::new(number).ok(), Self::get;
    AccelerationPerVolt: u32, |bits: u32| Self::from_bits(bits).ok(), Self::to_bits;
    Coefficient: i32, |bits: i32| Some(Self::from_bits(bits)), Self::to_bits;
    // -32768 is read as -32767.
    Control: i16, |number: i16| Some(Self::new(number)), Self::get;
    CountsPerSecond: i32, |bits: i32| Some(Self::from_bits(bits)), Self::to_bits;
    DecayRate: u32, |bits: u32| Some(Self::from_bits(bits)), Self::to_bits;
    Duty: u16, |bits: u16| Some(Self::from_bits(bits)), Self::to_bits;
    EmfConstant: i32, |bits: i32| Self::from_bits(bits).ok(), Self::to_bits;
    Milliamperes: i32, |number: i32| Some(Self::new(number)), Self::get;
    Millivolts: u16, |number: u16| Some(Self::new(number)), Self::get;
}

/// One byte. Only 0 and 1 are in range.
impl Field for bool {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(|byte: u8| (byte < 2).then_some(byte == 1))
    }

    fn write(&self, payload: &mut Payload) {
        u8::from(*self).write(payload);
    }
}

impl<T: Field + Default + Copy, const N: usize> Field for [T; N] {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let mut all = [T::default(); N];
        for one in &mut all {
            *one = T::read(fields)?;
        }
        Ok(all)
    }

    fn write(&self, payload: &mut Payload) {
        self.iter().for_each(|one| one.write(payload));
    }
}

/// Defines an integer type with a limited range, and implements [`Field`] for the type.
macro_rules! limited {
    ($(#[$about:meta])* $name:ident: $number:ident, $($limit:ident),+; |$value:ident| $allowed:expr) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name<$(const $limit: $number),+>($number);

        impl<$(const $limit: $number),+> $name<$($limit),+> {
            /// Creates a value. `None` if the number is out of range.
            pub const fn new($value: $number) -> Option<Self> {
                if $allowed { Some(Self($value)) } else { None }
            }

            /// Returns the number.
            pub const fn get(self) -> $number {
                self.0
            }
        }

        impl<$(const $limit: $number),+> Field for $name<$($limit),+> {
            fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
                fields.checked(Self::new)
            }

            fn write(&self, payload: &mut Payload) {
                self.0.write(payload);
            }
        }
    };
}

limited! {
    /// An 8-bit integer from `LEAST` to `MOST`.
    ByteIn: u8, LEAST, MOST; |byte| byte >= LEAST && byte <= MOST
}

limited! {
    /// A 16-bit integer from `LEAST` to 65 535.
    WordFrom: u16, LEAST; |word| word >= LEAST
}

/// Largest number of bytes in a [`Text`].
pub const TEXT: usize = 100;

/// A text or other bytes of variable length. In a payload the length comes first. The protocol does not define an
/// encoding.
pub type Text = Vec<u8, TEXT>;

impl Field for Text {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let length = ByteIn::<0, { TEXT as u8 }>::read(fields)?;
        let bytes = fields.slice(length.get().into())?;
        Ok(bytes.iter().copied().collect())
    }

    fn write(&self, payload: &mut Payload) {
        (self.len() as u8).write(payload);
        append(payload, self);
    }
}

/// Implements [`Field`] for an enum. In a payload each value is one byte, its code.
macro_rules! codes {
    ($type:ty { $($code:literal = $value:ident $(($inner:path))?),+ $(,)? }) => {
        impl $crate::protocol::payload::Field for $type {
            fn read(
                fields: &mut $crate::protocol::payload::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                fields.checked(|code: u8| match code {
                    $($code => Some(Self::$value $(($inner))?),)+
                    _ => None,
                })
            }

            fn write(&self, payload: &mut $crate::protocol::payload::Payload) {
                let code: u8 = match self {
                    $(Self::$value $(($inner))? => $code,)+
                };
                code.write(payload);
            }
        }
    };
}
pub(crate) use codes;

/// Defines a *codec*: a module with functions that read and write a value as a field of another type.
macro_rules! codec {
    ($(#[$about:meta])* $name:ident: $value:ty as $field:ty, $from_field:expr, $to_field:expr) => {
        $(#[$about])*
        pub(crate) mod $name {
            #[allow(unused_imports, reason = "the conversions may need nothing of the module")]
            use super::*;

            pub(crate) fn read(
                fields: &mut $crate::protocol::payload::Fields<'_>,
            ) -> Result<$value, $crate::protocol::Nack> {
                let convert: fn($field) -> $value = $from_field;
                <$field as $crate::protocol::payload::Field>::read(fields).map(convert)
            }

            pub(crate) fn write(value: &$value, payload: &mut $crate::protocol::payload::Payload) {
                let convert: fn($value) -> $field = $to_field;
                $crate::protocol::payload::Field::write(&convert(*value), payload);
            }
        }
    };
}
pub(crate) use codec;

/// Implements [`Field`] for a struct, whose fields are read and written in the stated order.
///
/// A field whose type is not itself a [`Field`] states a [`codec`]. Bools in brackets are bits of one byte, beginning
/// with bit 0.
macro_rules! fields_in_order {
    ($type:ty { $($([$($bit:ident),+])? $($field:ident $(: $codec:ident)?)?),+ $(,)? }) => {
        impl $crate::protocol::payload::Field for $type {
            fn read(
                fields: &mut $crate::protocol::payload::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                $(
                    $(let [$($bit,)+ ..] = $crate::protocol::payload::bits(Field::read(fields)?);)?
                    $(let $field = $crate::protocol::payload::fields_in_order!(@read fields $($codec)?)?;)?
                )+
                Ok(Self { $($($($bit,)+)? $($field,)?)+ })
            }

            fn write(&self, payload: &mut $crate::protocol::payload::Payload) {
                $(
                    $($crate::protocol::payload::byte([$(self.$bit),+]).write(payload);)?
                    $($crate::protocol::payload::fields_in_order!(@write self.$field, payload, $($codec)?);)?
                )+
            }
        }
    };
    (@read $fields:ident) => { $crate::protocol::payload::Field::read($fields) };
    (@read $fields:ident $codec:ident) => { $codec::read($fields) };
    (@write $value:expr, $payload:ident,) => { $crate::protocol::payload::Field::write(&$value, $payload) };
    (@write $value:expr, $payload:ident, $codec:ident) => { $codec::write(&$value, $payload) };
}
pub(crate) use fields_in_order;

/// Defines a struct, and implements [`Field`] for the struct like [`fields_in_order`]. `as` states the codec of a
/// field.
macro_rules! payload {
    (
        $(#[$about:meta])*
        pub struct $name:ident { $($(#[$says:meta])* pub $field:ident: $type:ty $(as $codec:ident)?),+ $(,)? }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name {
            $($(#[$says])* pub $field: $type,)+
        }

        $crate::protocol::payload::fields_in_order!($name { $($field $(: $codec)?),+ });
    };
}
pub(crate) use payload;

codec! {
    /// Codec of a bool as one byte. True is written as 1 and false as 0. Every byte except 0 is read as true.
    flag: bool as u8, |byte| byte != 0, u8::from
}

/// Returns the bits of a byte, beginning with bit 0.
pub(crate) fn bits(byte: u8) -> [bool; 8] {
    core::array::from_fn(|bit| byte & 1 << bit != 0)
}

/// Returns the byte that has these bits, beginning with bit 0. Missing bits are 0. Bits after the eighth are ignored.
pub(crate) fn byte(bits: impl IntoIterator<Item = bool>) -> u8 {
    bits.into_iter().take(8).enumerate().fold(0, |byte, (index, bit)| byte | u8::from(bit) << index)
}
