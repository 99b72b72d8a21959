//! Simulates the registers of a BNO055, an inertial sensor with sensor fusion (data sheet 1.4). The sensor lies flat on
//! a drive base and turns with the base.
//!
//! ```
//! use simulated::bno055::Bno055;
//!
//! let mut imu = Bno055::default();
//! imu.run(1.0, 0.0, 0.0);
//! imu.write(&[0x3D, 0x08]);
//! // The mode changes after 7 ms. The base then turns left by 90 degrees.
//! imu.run(0.01, 0.0, 0.0);
//! imu.run(0.01, std::f64::consts::FRAC_PI_2, 0.0);
//! let mut heading = [0; 2];
//! imu.write(&[0x1A]);
//! imu.read(&mut heading);
//! assert_eq!(i16::from_le_bytes(heading), 270 * 16, "headings grow clockwise, in 1/16 degree");
//! ```

use crate::scenario::numbers::{Drift, ScaleError, within};
use serde::Deserialize;
use std::f64::consts::TAU;

/// Numbers of registers. The number of a 16-bit register is the number of its first byte.
mod register {
    pub(super) const PAGE: u8 = 0x07;
    pub(super) const ACCELERATION: u8 = 0x08;
    pub(super) const GYRO: u8 = 0x14;
    pub(super) const EULER: u8 = 0x1A;
    pub(super) const QUATERNION: u8 = 0x20;
    pub(super) const GRAVITY: u8 = 0x2E;
    pub(super) const TEMPERATURE: u8 = 0x34;
    pub(super) const CALIBRATION: u8 = 0x35;
    pub(super) const STATUS: u8 = 0x39;
    pub(super) const UNITS: u8 = 0x3B;
    pub(super) const MODE: u8 = 0x3D;
    pub(super) const POWER: u8 = 0x3E;
    pub(super) const TRIGGER: u8 = 0x3F;
}

/// Mode in which the sensor is configured, and measures nothing.
const CONFIGURATION: u8 = 0;
/// Lowest mode with fusion.
const LOWEST_FUSION: u8 = 8;
/// Identification of chip, accelerometer, magnetometer and gyro.
const IDENTIFICATION: [u8; 4] = [0xA0, 0xFB, 0x32, 0x0F];
/// Time from a reset to the first answer, in seconds.
const RESET_S: f64 = 0.65;
/// Time of a change from the configuration mode to another mode, in seconds.
const LEAVE_CONFIGURATION_S: f64 = 0.007;
/// Time of a change to the configuration mode, in seconds.
const ENTER_CONFIGURATION_S: f64 = 0.019;
/// Gravity in the sensor's unit, 0.01 m/s².
const GRAVITY: i16 = 981;
/// Temperature in degrees Celsius.
const TEMPERATURE: u8 = 25;

/// Errors of the sensor's gyro.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroErrors {
    /// Angle by which a resting base seems to turn left, in degrees per minute.
    #[serde(deserialize_with = "within::<Drift, _, _>")]
    pub drift_degrees_per_min: f64,
    /// Share by which a turn seems larger than it is.
    #[serde(deserialize_with = "within::<ScaleError, _, _>")]
    pub scale_error: f64,
}

/// A simulated BNO055.
#[derive(Clone, Debug)]
pub struct Bno055 {
    /// Errors of the gyro.
    pub errors: GyroErrors,
    /// Registers of both pages that are stored as written.
    stored: [[u8; 128]; 2],
    page: usize,
    /// Register of the last write, at which the next transfer begins to read.
    first: u8,
    /// Register that is read next.
    next: u8,
    /// Mode in force. The mode in `stored` is the requested one.
    mode: u8,
    /// Time at which the requested mode is in force.
    mode_at_s: f64,
    /// Time at which the sensor answers, after a reset.
    answers_at_s: f64,
    now_s: f64,
    /// Measured angle at the last change of mode, in radians. The heading of the fusion starts at 0 there.
    start_rad: f64,
    /// Angle by which the base seems to have turned left, in radians.
    turned_rad: f64,
    /// Speed at which the base seems to turn left, in radians per second.
    rate_rad_s: f64,
}

impl Default for Bno055 {
    /// The sensor when its supply is switched on.
    fn default() -> Self {
        let mut stored = [[0; 128]; 2];
        stored[0][usize::from(register::UNITS)] = 0x80;
        stored[0][0x41] = 0x24;
        Self {
            errors: GyroErrors::default(),
            stored,
            page: 0,
            first: 0,
            next: 0,
            mode: CONFIGURATION,
            mode_at_s: 0.0,
            answers_at_s: RESET_S,
            now_s: 0.0,
            start_rad: 0.0,
            turned_rad: 0.0,
            rate_rad_s: 0.0,
        }
    }
}

impl Bno055 {
    /// Lets `time_s` seconds pass. After this time the base has turned left by `turned_rad` since the start, and turns
    /// at `rate_rad_s`.
    pub fn run(&mut self, time_s: f64, turned_rad: f64, rate_rad_s: f64) {
        self.now_s += time_s;
        let GyroErrors { drift_degrees_per_min, scale_error } = self.errors;
        let drift_rad_s = drift_degrees_per_min.to_radians() / 60.0;
        self.turned_rad = turned_rad * (1.0 + scale_error) + drift_rad_s * self.now_s;
        self.rate_rad_s = rate_rad_s * (1.0 + scale_error) + drift_rad_s;
        let requested = self.stored[0][usize::from(register::MODE)];
        if requested != self.mode && self.now_s >= self.mode_at_s {
            self.mode = requested;
            self.start_rad = self.turned_rad;
        }
    }

    /// True if the sensor acknowledges its address.
    pub fn answers(&self) -> bool {
        self.now_s >= self.answers_at_s
    }

    /// Begins a transfer, as a start condition on the bus does. The transfer reads from the register of the last write
    /// on (data sheet, section 4.6).
    pub const fn start(&mut self) {
        self.next = self.first;
    }

    /// Writes bytes. The first byte is the number of a register. The next bytes are written to this register and to the
    /// registers after it.
    pub fn write(&mut self, bytes: &[u8]) {
        let Some((register, contents)) = bytes.split_first() else { return };
        self.first = register & 0x7F;
        let mut register = self.first;
        for byte in contents {
            self.store(register, *byte);
            register = (register + 1) & 0x7F;
        }
        self.start();
    }

    /// Reads registers. The first register is the one after the last register that was read in the same transfer.
    pub fn read(&mut self, bytes: &mut [u8]) {
        let measured = self.measured();
        for byte in bytes {
            *byte = self.contents(self.next, &measured);
            self.next = (self.next + 1) & 0x7F;
        }
    }

    fn store(&mut self, register: u8, byte: u8) {
        let configures = self.mode == CONFIGURATION;
        match (self.page, register) {
            (_, register::PAGE) => self.page = usize::from(byte & 1),
            (0, register::TRIGGER) if byte & 0x20 != 0 => {
                let Self { now_s, errors, .. } = *self;
                let answers_at_s = now_s + RESET_S;
                *self = Self { errors, now_s, mode_at_s: now_s, answers_at_s, ..Self::default() };
            }
            (0, register::MODE) => {
                let leaves = byte & 0x0F != CONFIGURATION;
                let takes_s = if leaves { LEAVE_CONFIGURATION_S } else { ENTER_CONFIGURATION_S };
                self.mode_at_s = self.now_s + takes_s;
                self.stored[0][usize::from(register)] = byte & 0x0F;
            }
            // All other settings can be written in the configuration mode only.
            (0, register::UNITS | register::POWER | 0x41 | 0x42 | 0x55..=0x6A) | (1, 0x08..)
                if configures =>
            {
                self.stored[self.page][usize::from(register)] = byte;
            }
            _ => (),
        }
    }

    fn contents(&self, register: u8, measured: &[u8; 128]) -> u8 {
        match (self.page, register) {
            (_, register::PAGE) => self.page as u8,
            (0, 0..4) => IDENTIFICATION[usize::from(register)],
            (0, register::STATUS) => match self.mode {
                CONFIGURATION => 0,
                LOWEST_FUSION.. => 5,
                _ => 6,
            },
            (0, register::ACCELERATION..=register::CALIBRATION) => measured[usize::from(register)],
            (page, register) => self.stored[page][usize::from(register)],
        }
    }

    /// Returns the contents of all registers with measured values. All are 0 in the configuration mode, and results of
    /// the fusion are 0 in modes without fusion.
    fn measured(&self) -> [u8; 128] {
        let mut registers = [0; 128];
        if self.mode == CONFIGURATION {
            return registers;
        }
        let units = self.stored[0][usize::from(register::UNITS)];
        let per_radian = |radians: bool| if radians { 900.0 } else { 16.0 * 360.0 / TAU };
        let mut put = |register: u8, value: i16| {
            let at = usize::from(register);
            registers[at..at + 2].copy_from_slice(&value.to_le_bytes());
        };
        put(register::ACCELERATION + 4, GRAVITY);
        put(register::GYRO + 4, (self.rate_rad_s * per_radian(units & 2 != 0)).round() as i16);
        if self.mode >= LOWEST_FUSION {
            let turned_rad = self.turned_rad - self.start_rad;
            let per_turn = TAU * per_radian(units & 4 != 0);
            let heading = (-turned_rad).rem_euclid(TAU) / TAU * per_turn;
            put(register::EULER, (heading.round() % per_turn.round()) as i16);
            let half = 0.5 * turned_rad;
            put(register::QUATERNION, (16_384.0 * half.cos()).round() as i16);
            put(register::QUATERNION + 6, (16_384.0 * half.sin()).round() as i16);
            put(register::GRAVITY + 4, GRAVITY);
            registers[usize::from(register::CALIBRATION)] =
                if self.mode == LOWEST_FUSION { 0xFC } else { 0xFF };
        }
        registers[usize::from(register::TEMPERATURE)] = TEMPERATURE;
        registers
    }
}
