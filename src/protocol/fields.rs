//! Payloads, field by field: each type says in one place how it is read and how it is written. Numbers
//! are little-endian.
//!
//! ```
//! use motor_hub::protocol::Nack;
//! use motor_hub::protocol::fields::{ByteIn, Field, Fields, Payload};
//!
//! let mut payload = Payload::new();
//! true.write(&mut payload);
//! (-2i16).write(&mut payload);
//! assert_eq!(*payload, [1, 0xFE, 0xFF]);
//!
//! let mut fields = Fields::new(&payload);
//! assert_eq!(bool::read(&mut fields), Ok(true));
//! // The second field is no motor 0 to 3, and there is no third one whole.
//! assert_eq!(ByteIn::<0, 3>::read(&mut fields), Err(Nack::parameter(1)));
//! assert_eq!(u16::read(&mut fields), Err(Nack::parameter(2)));
//! ```

use super::nack::Nack;
use crate::motor::ZeroPower;
use crate::units::{Coefficient, Control};
use heapless::Vec;

/// Payload bytes that are kept of a packet. The longest request has 101, the longest answer 164; what
/// comes beyond a request's fields is to be ignored.
pub const PAYLOAD_KEPT: usize = 168;

/// What a packet says.
pub type Payload = Vec<u8, PAYLOAD_KEPT>;

/// A value that stands in payloads.
pub trait Field: Sized {
    /// The next field or fields.
    ///
    /// # Errors
    /// The number of the first that is missing or out of range.
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack>;

    /// Appends it. What would go beyond [`PAYLOAD_KEPT`] is left out, which no layout needs.
    fn write(&self, payload: &mut Payload);
}

/// A payload being read from its front. The fields are counted, so that a refusal can name the one
/// that is wrong or missing. What follows the last field that is asked for is ignored.
#[derive(Clone, Debug)]
pub struct Fields<'a> {
    rest: &'a [u8],
    index: u8,
}

impl<'a> Fields<'a> {
    /// Before the first field.
    pub const fn new(payload: &'a [u8]) -> Self {
        Self { rest: payload, index: 0 }
    }

    /// The next field made into something else; refused if that fails.
    pub(super) fn checked<F: Field, T>(&mut self, make: impl FnOnce(F) -> Option<T>) -> Result<T, Nack> {
        let index = self.index;
        make(F::read(self)?).ok_or(Nack::parameter(index))
    }

    /// So many bytes as one field.
    pub(super) fn slice(&mut self, length: usize) -> Result<&'a [u8], Nack> {
        let (field, rest) = self.rest.split_at_checked(length).ok_or(Nack::parameter(self.index))?;
        self.rest = rest;
        self.index = self.index.saturating_add(1);
        Ok(field)
    }

    /// The bytes before the next zero, as one field; the zero is read too.
    pub(super) fn zero_terminated(&mut self) -> Result<&'a [u8], Nack> {
        let length = self.rest.iter().position(|byte| *byte == 0).ok_or(Nack::parameter(self.index))?;
        let text = self.slice(length)?;
        // The zero.
        self.rest = self.rest.get(1..).unwrap_or_default();
        Ok(text)
    }

    /// True if nothing is left.
    pub(super) const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}

/// Appends as many bytes as there is room for.
pub(super) fn append(payload: &mut Payload, bytes: &[u8]) {
    for &byte in bytes {
        let _ = payload.push(byte);
    }
}

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

/// 0 or 1.
impl Field for bool {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(|byte: ByteIn<0, 1>| Some(byte.get() == 1))
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

/// A byte from `LEAST` to `MOST`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ByteIn<const LEAST: u8, const MOST: u8>(u8);

impl<const LEAST: u8, const MOST: u8> ByteIn<LEAST, MOST> {
    /// `None` if it is outside.
    pub const fn new(byte: u8) -> Option<Self> {
        if byte < LEAST || byte > MOST { None } else { Some(Self(byte)) }
    }

    /// `LEAST` to `MOST`.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl<const LEAST: u8, const MOST: u8> Field for ByteIn<LEAST, MOST> {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(Self::new)
    }

    fn write(&self, payload: &mut Payload) {
        self.0.write(payload);
    }
}

/// 16 bits from `LEAST` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WordFrom<const LEAST: u16>(u16);

impl<const LEAST: u16> WordFrom<LEAST> {
    /// `None` if it is less.
    pub const fn new(word: u16) -> Option<Self> {
        if word < LEAST { None } else { Some(Self(word)) }
    }

    /// `LEAST` to 65 535.
    pub const fn get(self) -> u16 {
        self.0
    }
}

impl<const LEAST: u16> Field for WordFrom<LEAST> {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(Self::new)
    }

    fn write(&self, payload: &mut Payload) {
        self.0.write(payload);
    }
}

/// The most bytes of a [`Text`].
pub const TEXT: usize = 100;

/// A length and so many bytes, up to [`TEXT`], in what encoding the protocol does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Text(Vec<u8, TEXT>);

impl Text {
    /// `None` if it is too long.
    pub fn new(bytes: &[u8]) -> Option<Self> {
        Vec::from_slice(bytes).ok().map(Self)
    }

    /// Without its length.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl Field for Text {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let length = ByteIn::<0, { TEXT as u8 }>::read(fields)?;
        let bytes = fields.slice(length.get().into())?;
        Ok(Self(bytes.iter().copied().collect()))
    }

    fn write(&self, payload: &mut Payload) {
        (self.0.len() as u8).write(payload);
        append(payload, &self.0);
    }
}

/// Signed Q16.16.
impl Field for Coefficient {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        i32::read(fields).map(Self::from_bits)
    }

    fn write(&self, payload: &mut Payload) {
        self.to_bits().write(payload);
    }
}

/// Share of full duty; -32768 means -32767.
impl Field for Control {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        i16::read(fields).map(Self::new)
    }

    fn write(&self, payload: &mut Payload) {
        self.get().write(payload);
    }
}

/// Values of an enum as the bytes that stand for them.
macro_rules! codes {
    ($type:ty { $($code:literal = $value:ident),+ }) => {
        impl $crate::protocol::fields::Field for $type {
            fn read(
                fields: &mut $crate::protocol::fields::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                fields.checked(|code: u8| match code {
                    $($code => Some(Self::$value),)+
                    _ => None,
                })
            }

            fn write(&self, payload: &mut $crate::protocol::fields::Payload) {
                let code: u8 = match self {
                    $(Self::$value => $code,)+
                };
                code.write(payload);
            }
        }
    };
}
pub(super) use codes;

/// A struct as its fields, one after the other.
macro_rules! in_turn {
    ($type:ty { $($field:ident),+ }) => {
        impl $crate::protocol::fields::Field for $type {
            fn read(
                fields: &mut $crate::protocol::fields::Fields<'_>,
            ) -> Result<Self, $crate::protocol::Nack> {
                Ok(Self { $($field: $crate::protocol::fields::Field::read(fields)?),+ })
            }

            fn write(&self, payload: &mut $crate::protocol::fields::Payload) {
                $($crate::protocol::fields::Field::write(&self.$field, payload);)+
            }
        }
    };
}
pub(super) use in_turn;

/// Any byte: 0 brakes and 1 floats, and so does whatever else hosts send for it.
impl Field for ZeroPower {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(if u8::read(fields)? == 0 { Self::Brake } else { Self::Float })
    }

    fn write(&self, payload: &mut Payload) {
        u8::from(*self == Self::Float).write(payload);
    }
}
