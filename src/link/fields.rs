//! Reading a payload field by field, and what a refused command is answered.

/// Why a command was refused; nothing was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Nack {
    /// The payload's parameter with this number, 0 to 9, is out of range or missing.
    Parameter(u8),
    /// Motor without a target for its mode.
    NotConfigured,
    /// Not in the motor's present mode.
    WrongMode,
    /// The battery is below [`super::state::LOW_BATTERY`], or its voltage is not known.
    BatteryLow,
    /// A known command for something that this hub does not have.
    Unsupported,
    /// Not a command.
    Unknown,
}

impl Nack {
    /// The protocol's number for it.
    pub const fn code(self) -> u8 {
        match self {
            // 10 and above mean other things.
            Self::Parameter(index) if index > 9 => 9,
            Self::Parameter(index) => index,
            Self::NotConfigured => 50,
            Self::WrongMode => 51,
            Self::BatteryLow => 52,
            Self::Unsupported => 253,
            Self::Unknown => 255,
        }
    }
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

    fn bytes<const LEN: usize>(&mut self) -> Result<[u8; LEN], Nack> {
        let (field, rest) = self.rest.split_first_chunk().ok_or(Nack::Parameter(self.index))?;
        self.rest = rest;
        self.index = self.index.saturating_add(1);
        Ok(*field)
    }

    /// The field just read is out of range.
    const fn refused(&self) -> Nack {
        Nack::Parameter(self.index.saturating_sub(1))
    }

    /// The next field made into something else; refused if that fails.
    fn checked<const LEN: usize, T>(&mut self, make: impl FnOnce([u8; LEN]) -> Option<T>) -> Result<T, Nack> {
        let bytes = self.bytes()?;
        make(bytes).ok_or(self.refused())
    }

    /// 0 to 255.
    pub fn u8(&mut self) -> Result<u8, Nack> {
        self.checked(|[byte]| Some(byte))
    }

    /// A byte within `range`.
    pub fn u8_in(&mut self, range: core::ops::RangeInclusive<u8>) -> Result<u8, Nack> {
        self.checked(|[byte]| range.contains(&byte).then_some(byte))
    }

    /// A byte that stands for something.
    pub fn u8_as<T>(&mut self, make: impl FnOnce(u8) -> Option<T>) -> Result<T, Nack> {
        self.checked(|[byte]| make(byte))
    }

    /// 0 or 1.
    pub fn flag(&mut self) -> Result<bool, Nack> {
        self.u8_in(0..=1).map(|byte| byte == 1)
    }

    /// 0 to `count` - 1.
    pub fn index(&mut self, count: usize) -> Result<usize, Nack> {
        self.checked(|[byte]| Some(usize::from(byte)).filter(|index| *index < count))
    }

    /// 0 to 65 535.
    pub fn u16(&mut self) -> Result<u16, Nack> {
        self.u16_from(0)
    }

    /// `least` to 65 535.
    pub fn u16_from(&mut self, least: u16) -> Result<u16, Nack> {
        self.u16_as(|value| Some(value).filter(|value| *value >= least))
    }

    /// 16 bits that stand for something.
    pub fn u16_as<T>(&mut self, make: impl FnOnce(u16) -> Option<T>) -> Result<T, Nack> {
        self.checked(|bytes| make(u16::from_le_bytes(bytes)))
    }

    /// -32768 to 32767.
    pub fn i16(&mut self) -> Result<i16, Nack> {
        self.checked(|bytes| Some(i16::from_le_bytes(bytes)))
    }

    /// All 32 bits.
    pub fn i32(&mut self) -> Result<i32, Nack> {
        self.i32_as(Some)
    }

    /// 32 bits that stand for something.
    pub fn i32_as<T>(&mut self, make: impl FnOnce(i32) -> Option<T>) -> Result<T, Nack> {
        self.checked(|bytes| make(i32::from_le_bytes(bytes)))
    }

    /// So many bytes as one field.
    pub fn slice(&mut self, length: usize) -> Result<&'a [u8], Nack> {
        let (field, rest) = self.rest.split_at_checked(length).ok_or(Nack::Parameter(self.index))?;
        self.rest = rest;
        self.index = self.index.saturating_add(1);
        Ok(field)
    }

    /// The bytes before the next zero, as one field; the zero is read too.
    pub fn zero_terminated(&mut self) -> Result<&'a [u8], Nack> {
        let length = self.rest.iter().position(|byte| *byte == 0).ok_or(Nack::Parameter(self.index))?;
        let text = self.slice(length)?;
        // The zero.
        self.rest = self.rest.get(1..).unwrap_or_default();
        Ok(text)
    }

    /// True if nothing is left.
    pub const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}
