//! The content of an entry of the record, and its layout in memory. All numbers are little-endian.

use super::Fault;
use crate::bridge::{Drive, Mode};
use crate::motor::Report;
use crate::units::{Duty, Millivolts};

/// Size of a [`Head`] in memory, in bytes.
pub(super) const HEAD: usize = 32;
/// Size of a [`Tick`] in memory, in bytes.
pub(super) const TICK: usize = 8;

/// Motor index of an entry that describes no motor.
pub(crate) const NO_MOTOR: u8 = u8::MAX;

/// Description of one fault or reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Head {
    /// Number of the entry. The first entry has number 1, and 0 follows 65 535.
    pub number: u16,
    /// The fault or the reset cause.
    pub fault: Fault,
    /// Number of consecutive occurrences of the fault, with the same motor and detail; 255 means 255 or more. All other
    /// fields describe the first occurrence.
    ///
    /// A fault that repeats in the same run is counted in the entry. A fault that repeats in a later run is counted
    /// too, if the entry has no ticks and the later run has had no tick. An unknown battery counts once for all motors.
    pub times: u8,
    /// Number of the run in which the fault occurred, or which the reset ended. Runs are numbered from 1; the number
    /// wraps.
    pub run: u16,
    /// Time of the control tick at which the fault began, in ms since the run began. For a reset, the time of the run's
    /// last tick.
    pub uptime_ms: u32,
    /// Battery voltage at `uptime_ms`; `None` if the voltage was unknown.
    pub battery: Option<Millivolts>,
    /// Index of the motor that had the fault. For a fault of the hub or a reset, the motor that was driven with the
    /// largest duty, or else braked with the largest duty. `None` if all motors coasted.
    pub motor: Option<u8>,
    /// Last command to the bridge of `motor` before the fault. [`Drive::COAST`] if `motor` is `None`, or if the run had
    /// no earlier tick.
    pub drive: Drive,
    /// Two numbers that describe the fault; 0 if the fault has none.
    ///
    /// * Hard fault: address of the instruction, and the return address to its caller.
    /// * Stack overflow: lowest address that the stack pointer reached.
    /// * Panic: line and column.
    /// * Interrupt without a handler: number of the interrupt.
    pub detail: [u32; 2],
    /// Number of ticks of `motor` that the record still holds, 0 to 64. The last of these ticks is the tick at which
    /// the fault began, or the last tick of the run.
    pub ticks: u8,
}

/// State of one motor at one control tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tick {
    /// Lower 16 bits of the position, in counts.
    pub position: u16,
    /// Speed in counts/s, limited to 16 bits.
    pub velocity: i16,
    /// Mean voltage that the command applies, in millivolts, limited to 16 bits.
    pub millivolts: i16,
    /// Command to the motor's bridge. The duty has steps of 2^-13.
    pub drive: Drive,
}

/// Returns the FNV-1a checksum of `bytes`. The checksum detects every error in a single byte. Of other errors about one
/// in 2^32 is missed.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811C_9DC5, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

impl Tick {
    pub(super) fn of(report: &Report) -> Self {
        Self {
            position: report.position as u16,
            velocity: report.velocity.round_to_i16(),
            millivolts: report.voltage.to_millivolts(),
            drive: report.drive,
        }
    }

    pub(super) fn to_bytes(self) -> [u8; TICK] {
        let [p, q] = self.position.to_le_bytes();
        let [v, w] = self.velocity.to_le_bytes();
        let [x, y] = self.millivolts.to_le_bytes();
        let [m, n] = drive_bits(self.drive).to_le_bytes();
        [p, q, v, w, x, y, m, n]
    }

    /// Decodes a tick. Any 8 bytes decode to a tick. Damage is found by the checksum of the page.
    pub(super) fn from_bytes([p, q, v, w, x, y, m, n]: [u8; TICK]) -> Self {
        Self {
            position: u16::from_le_bytes([p, q]),
            velocity: i16::from_le_bytes([v, w]),
            millivolts: i16::from_le_bytes([x, y]),
            drive: drive_of(u16::from_le_bytes([m, n])),
        }
    }
}

/// Encodes the command to a bridge. Bits 14 and 15 are the mode, and bits 0 to 13 are the duty in steps of 2^-13.
pub(crate) const fn drive_bits(drive: Drive) -> u16 {
    let mode = match drive.mode {
        Mode::Brake50 => 0,
        Mode::Cw98 => 1,
        Mode::Ccw62 => 2,
    };
    mode << 14 | drive.duty.to_bits() >> 2
}

/// Decodes the command to a bridge. The mode number 3, which is not used, is decoded as [`Drive::COAST`].
pub(crate) const fn drive_of(bits: u16) -> Drive {
    let mode = match bits >> 14 {
        0 => Mode::Brake50,
        1 => Mode::Cw98,
        2 => Mode::Ccw62,
        _ => return Drive::COAST,
    };
    Drive { mode, duty: Duty::from_bits((bits & 0x3FFF) << 2) }
}

impl Head {
    /// Encodes the head with the checksum of its ticks. The last four bytes are the checksum of the head.
    pub(super) fn to_bytes(self, ticks_checksum: u32) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        let [first, second] = self.detail;
        let fields: [&[u8]; 10] = [
            &self.number.to_le_bytes(),
            &[self.fault.number(), self.times],
            &self.uptime_ms.to_le_bytes(),
            &self.run.to_le_bytes(),
            &self.battery.map_or(0, Millivolts::get).to_le_bytes(),
            &[self.motor.unwrap_or(NO_MOTOR), self.ticks],
            &drive_bits(self.drive).to_le_bytes(),
            &first.to_le_bytes(),
            &second.to_le_bytes(),
            &ticks_checksum.to_le_bytes(),
        ];
        bytes.iter_mut().zip(fields.iter().copied().flatten()).for_each(|(byte, field)| *byte = *field);
        if let Some((body, sum)) = bytes.split_last_chunk_mut::<4>() {
            *sum = checksum(body).to_le_bytes();
        }
        bytes
    }

    /// Decodes a head and the checksum of its ticks. `None` if the head is damaged, or if this firmware does not have
    /// its fault number.
    pub(super) fn from_bytes(bytes: &[u8; HEAD]) -> Option<(Self, u32)> {
        let (body, sum) = bytes.split_last_chunk::<4>()?;
        if checksum(body) != u32::from_le_bytes(*sum) {
            return None;
        }
        let mut words = body.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair));
        let mut word = || words.next().unwrap_or_default();
        let (number, [fault, times]) = (word(), word().to_le_bytes());
        let mut long = || u32::from(word()) | u32::from(word()) << 16;
        let uptime_ms = long();
        let (run, battery_mv, [motor, ticks]) = (word(), word(), word().to_le_bytes());
        let drive = drive_of(word());
        let mut long = || u32::from(word()) | u32::from(word()) << 16;
        let (detail, ticks_checksum) = ([long(), long()], long());
        let head = Self {
            number,
            fault: Fault::from_number(fault)?,
            times,
            run,
            uptime_ms,
            battery: Some(Millivolts::new(battery_mv)).filter(|known| known.get() != 0),
            motor: Some(motor).filter(|motor| *motor != NO_MOTOR),
            drive,
            detail,
            ticks,
        };
        Some((head, ticks_checksum))
    }
}
