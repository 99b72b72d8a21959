//! The checksum of an image.

/// CRC-32 as of Ethernet (IEEE 802.3, reflected polynomial 0xEDB8_8320), piece by piece.
///
/// ```
/// use motor_hub::update::Crc32;
///
/// let mut crc = Crc32::new();
/// crc.add(b"1234");
/// crc.add(b"56789");
/// // What every description of it gives for these nine digits.
/// assert_eq!(crc.get(), 0xCBF4_3926);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc32(u32);

const POLYNOMIAL: u32 = 0xEDB8_8320;

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc32 {
    /// Of nothing.
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Of what was before, and these bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 ^= u32::from(*byte);
            for _ in 0..8 {
                let out = self.0 & 1;
                self.0 = self.0 >> 1 ^ POLYNOMIAL & out.wrapping_neg();
            }
        }
    }

    /// The checksum so far.
    pub const fn get(self) -> u32 {
        !self.0
    }
}
