//! Reads the heading of a BNO055, an inertial sensor with fusion (data sheet 1.4).
//!
//! The crate `bno055` waits for the bus and for pauses of the sensor inside its functions, which would stop all other
//! tasks. This driver only says which transfer comes next, and takes the answers.
//!
//! ```text
//!                          id is A0              not in IMU mode           configured
//! SelectPage --> Identify ----------> CheckMode ------------------> Configure -------> Measure
//!     ^                                   |  already in IMU mode                      ^   |
//!     |                                   '-------------------------------------------'   |
//!     '---------------- from every state after a failure, after RETRY_US -----------------'
//! ```
//!
//! The driver begins again after a wrong answer, and after an access that failed. There is one exception: while the
//! sensor measures, up to `ERRORS` - 1 accesses in a row may fail.
//!
//! The IMU mode fuses accelerometer and gyro, and ignores the magnetometer, which motors would disturb. The driver
//! never resets the sensor, and does not configure a sensor that is in the IMU mode already. The sensor must lie flat,
//! with its chip upward.
//!
//! ```
//! use motor_hub::devices::bno055::Bno055;
//! use motor_hub::units::Micros;
//!
//! let mut sensor = Bno055::default();
//! let mut now = Micros::new(0);
//! // A sensor in the IMU mode that has turned left by 90 degrees. Its quaternion has the parts w, x, y and z.
//! let answers: [&[u8]; 4] = [&[], &[0xA0], &[0x08], &[0x41, 0x2D, 0, 0, 0, 0, 0x41, 0x2D]];
//! let mut heading = None;
//! for answer in answers {
//!     let transfer = sensor.next(now).expect("nothing to wait for");
//!     assert_eq!(usize::from(transfer.read), answer.len());
//!     heading = sensor.receive(now, Some(answer));
//! }
//! assert!((heading.expect("measured") - 90.0).abs() < 0.01);
//! ```

use super::I2cTransfer;
use crate::units::Micros;
use core::f32::consts::PI;
use heapless::Vec;

/// Address of the sensor on its bus.
const ADDRESS: u8 = 0x28;

/// Register with the number of the register page.
const PAGE_ID: u8 = 0x07;
/// Register with the kind of chip.
const CHIP_ID: u8 = 0x00;
/// Register with the mode of operation.
const OPR_MODE: u8 = 0x3D;
/// Register with the power mode.
const PWR_MODE: u8 = 0x3E;
/// First of the eight registers of the quaternion.
const QUATERNION: u8 = 0x20;

/// Value of [`CHIP_ID`] of a BNO055.
const IDENTIFICATION: u8 = 0xA0;
/// Mode in which the sensor can be configured.
const CONFIGURATION_MODE: u8 = 0x00;
/// Power mode without pauses of the sensor.
const NORMAL_POWER: u8 = 0x00;
/// Mode with fusion of accelerometer and gyro.
const IMU_MODE: u8 = 0x08;

/// Writes that set the sensor to the IMU mode, each with the time that the sensor needs afterwards, in microseconds. A
/// change to the configuration mode takes 19 ms, and a change to another mode 7 ms (data sheet, table 3-6). The times
/// have a margin.
const CONFIGURATION: [(&[u8], u64); 3] = [
    (&[OPR_MODE, CONFIGURATION_MODE], 25_000),
    (&[PWR_MODE, NORMAL_POWER], 0),
    (&[OPR_MODE, IMU_MODE], 15_000),
];

/// Time after which the driver begins again with a sensor that does not work, in microseconds.
const RETRY_US: u64 = 1_000_000;
/// Longest time from the IMU mode to the first quaternion, in microseconds. REV's host software waits as long.
const FIRST_QUATERNION_US: u64 = 500_000;
/// Number of successive failed accesses after which a sensor that measures counts as lost.
const ERRORS: u8 = 5;
/// Square of the length of a rotation's quaternion, in the sensor's unit of 1/16384.
const UNIT_SQUARED: f32 = 16_384.0 * 16_384.0;

/// The next access.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    /// Selects register page 0.
    #[default]
    SelectPage,
    Identify,
    CheckMode,
    /// The write with this index in [`CONFIGURATION`].
    Configure(usize),
    /// Reads the quaternion since this time, until a valid quaternion is read.
    Start(Micros),
    /// Reads the quaternion.
    Measure,
}

/// The driver of one sensor.
#[derive(Clone, Debug, Default)]
pub struct Bno055 {
    step: Step,
    /// Earliest time of the next access.
    due: Micros,
    /// Number of successive failed accesses.
    errors: u8,
}

impl Bno055 {
    /// Returns the next access. `None` while the sensor needs time.
    pub fn next(&self, now: Micros) -> Option<I2cTransfer> {
        if now < self.due {
            return None;
        }
        match self.step {
            Step::SelectPage => transfer(&[PAGE_ID, 0], 0),
            Step::Identify => transfer(&[CHIP_ID], 1),
            Step::CheckMode => transfer(&[OPR_MODE], 1),
            Step::Configure(index) => transfer(CONFIGURATION.get(index)?.0, 0),
            Step::Start(_) | Step::Measure => transfer(&[QUATERNION], 8),
        }
    }

    /// Takes the answer to the access of [`next`](Self::next): the bytes that were read, or `None` after an error of
    /// the bus. Returns the angle by which the sensor has turned left since its start, in degrees from -180 to 180.
    /// `None` without a measurement.
    pub fn receive(&mut self, now: Micros, answer: Option<&[u8]>) -> Option<f32> {
        let Some(answer) = answer else {
            self.errors = self.errors.saturating_add(1);
            if self.errors >= ERRORS || !self.is_measuring() {
                self.begin_again(now);
            }
            return None;
        };
        self.errors = 0;
        match (self.step, answer) {
            (Step::SelectPage, _) => self.step = Step::Identify,
            (Step::Identify, &[IDENTIFICATION]) => self.step = Step::CheckMode,
            (Step::CheckMode, &[mode]) if mode & 0x0F == IMU_MODE => self.step = Step::Start(now),
            (Step::CheckMode, _) => self.step = Step::Configure(0),
            (Step::Configure(index), _) => {
                let pause = CONFIGURATION.get(index).map_or(0, |(_, pause)| *pause);
                self.due = Micros::new(now.get().saturating_add(pause));
                let next = index + 1;
                self.step = if next < CONFIGURATION.len() { Step::Configure(next) } else { Step::Start(now) };
            }
            (step @ (Step::Start(_) | Step::Measure), &[w0, w1, x0, x1, y0, y1, z0, z1]) => {
                let quaternion = [[w0, w1], [x0, x1], [y0, y1], [z0, z1]].map(i16::from_le_bytes);
                let heading = heading_degrees(quaternion);
                match step {
                    _ if heading.is_some() => self.step = Step::Measure,
                    Step::Start(since) if now.since(since) <= FIRST_QUATERNION_US => (),
                    // The sensor has lost its supply, or something else answers.
                    _ => self.begin_again(now),
                }
                return heading;
            }
            (Step::Identify | Step::Start(_) | Step::Measure, _) => self.begin_again(now),
        }
        None
    }

    /// True from the first measurement until the sensor counts as lost.
    pub const fn is_measuring(&self) -> bool {
        matches!(self.step, Step::Measure)
    }

    const fn begin_again(&mut self, now: Micros) {
        *self =
            Self { step: Step::SelectPage, due: Micros::new(now.get().saturating_add(RETRY_US)), errors: 0 };
    }
}

/// The register at which a host's next read of the sensor begins: the register that the host has written last (data
/// sheet, section 4.6). The driver writes other registers in between.
///
/// ```
/// use motor_hub::devices::I2cTransfer;
/// use motor_hub::devices::bno055::HostRegister;
///
/// let transfer = |write: &[u8], read| {
///     I2cTransfer { address: 0x28, fast: false, write: write.iter().copied().collect(), read }
/// };
/// let mut register = HostRegister::default();
/// register.prepare(transfer(&[0x1A], 0));
/// assert_eq!(register.prepare(transfer(&[], 6)), transfer(&[], 6));
/// register.note_driver_access();
/// assert_eq!(register.prepare(transfer(&[], 6)), transfer(&[0x1A], 6));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct HostRegister {
    /// Register of the host's last write. 0 before the first write, as in the sensor.
    register: u8,
    /// True if the driver has accessed the sensor since the host's last write.
    is_moved: bool,
}

impl HostRegister {
    /// Notes an access of the driver.
    pub const fn note_driver_access(&mut self) {
        self.is_moved = true;
    }

    /// Returns a transfer of the host as the bus shall run it. If the driver has accessed the sensor, a read without a
    /// write first writes the host's register. A transfer with another device is unchanged.
    #[must_use]
    pub fn prepare(&mut self, mut transfer: I2cTransfer) -> I2cTransfer {
        if transfer.address != ADDRESS {
            return transfer;
        }
        if let Some(register) = transfer.write.first() {
            *self = Self { register: *register, is_moved: false };
        } else if self.is_moved {
            // An empty write has room for a byte.
            let _ = transfer.write.push(self.register);
        }
        transfer
    }
}

/// Returns a transfer with the sensor, which reads `read` bytes after the write. Each write of this driver fits into a
/// transfer.
fn transfer(write: &[u8], read: u8) -> Option<I2cTransfer> {
    Vec::from_slice(write).ok().map(|write| I2cTransfer { address: ADDRESS, fast: true, write, read })
}

/// Returns the heading of a quaternion with the parts w, x, y and z in 1/16384. `None` if the length of the quaternion
/// is not 1 within 10 %, as for the zeros of a sensor that does not measure.
fn heading_degrees(quaternion: [i16; 4]) -> Option<f32> {
    let [w, x, y, z] = quaternion.map(f32::from);
    let square = w * w + x * x + y * y + z * z;
    let is_rotation = (0.81 * UNIT_SQUARED..1.21 * UNIT_SQUARED).contains(&square);
    let radians = libm::atan2f(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    is_rotation.then_some(radians * (180.0 / PI))
}
