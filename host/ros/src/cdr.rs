//! CDR, the encoding of ROS messages: a header of 4 bytes, then the fields in their order, little-endian.
//!
//! A primitive value is aligned to its size; offsets are counted from the byte after the header. A string has its
//! length as u32, its text and a NUL; the length includes the NUL. A sequence has the number of its elements as u32,
//! and its elements.

const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Writes fields one after the other.
pub(crate) struct Writer(Vec<u8>);

impl Writer {
    pub(crate) fn new() -> Self {
        Self(HEADER.to_vec())
    }

    fn align(&mut self, size: usize) {
        let length = (self.0.len() - HEADER.len()).next_multiple_of(size) + HEADER.len();
        self.0.resize(length, 0);
    }

    pub(crate) fn u8(&mut self, value: u8) -> &mut Self {
        self.0.push(value);
        self
    }

    pub(crate) fn u32(&mut self, value: u32) -> &mut Self {
        self.align(4);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(crate) fn f32(&mut self, value: f32) -> &mut Self {
        self.u32(value.to_bits())
    }

    pub(crate) fn f64(&mut self, value: f64) -> &mut Self {
        self.align(8);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) -> &mut Self {
        values.iter().fold(self, |writer, value| writer.f64(*value))
    }

    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.count(text.len() + 1);
        self.0.extend(text.bytes());
        self.u8(0)
    }

    /// Writes the number of elements of a sequence. The caller then writes the elements.
    pub(crate) fn count(&mut self, count: usize) -> &mut Self {
        self.u32(u32::try_from(count).unwrap_or(u32::MAX))
    }

    pub(crate) fn finish(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.0)
    }
}

/// Reads fields one after the other. Each method returns `None` if the bytes end too early or are malformed.
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// Returns `None` if the message does not begin with the header of little-endian CDR.
    pub(crate) fn new(message: &'a [u8]) -> Option<Self> {
        Some(Self { bytes: message.strip_prefix(&HEADER)?, at: 0 })
    }

    fn take(&mut self, size: usize, align: usize) -> Option<&'a [u8]> {
        let from = self.at.next_multiple_of(align);
        let bytes = self.bytes.get(from..from.checked_add(size)?)?;
        self.at = from + size;
        Some(bytes)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.take(1, 1)?.first().copied()
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4, 4)?.try_into().ok()?))
    }

    pub(crate) fn f64(&mut self) -> Option<f64> {
        Some(f64::from_le_bytes(self.take(8, 8)?.try_into().ok()?))
    }

    pub(crate) fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        let (nul, text) = self.take(length, 1)?.split_last()?;
        (*nul == 0).then_some(())?;
        std::str::from_utf8(text).ok()
    }

    /// Reads a sequence. An element has at least `least_size` bytes, so a count that exceeds the remaining bytes is
    /// refused before memory is allocated.
    pub(crate) fn sequence<T>(
        &mut self,
        least_size: usize,
        mut element: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        let count = self.u32()? as usize;
        if count.checked_mul(least_size)? > self.bytes.len() - self.at {
            return None;
        }
        (0..count).map(|_| element(self)).collect()
    }

    /// Returns `None` if more than 3 bytes remain. Some writers add up to 3 bytes of padding.
    pub(crate) fn end(&self) -> Option<()> {
        (self.bytes.len() - self.at <= 3).then_some(())
    }
}
