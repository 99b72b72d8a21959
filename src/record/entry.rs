//! What an entry of the record says, and how it lies in memory. Numbers are little-endian.

use super::Fault;
use crate::bridge::{Drive, Mode};
use crate::motor::Report;
use crate::units::{Control, Duty, Millivolts};

/// Bytes of a [`Head`], and of a [`Tick`].
pub(super) const HEAD: usize = 32;
pub(super) const TICK: usize = 8;

/// No motor in particular.
pub(crate) const NOBODY: u8 = u8::MAX;

/// One thing that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Head {
    /// Counts entries, from 1; wraps.
    pub number: u16,
    /// What it was.
    pub fault: Fault,
    /// How often in a row: in one run, or at the end of runs that had no tick. 255 is that or more.
    pub times: u8,
    /// In which run since the record began, from 1; wraps. A fault that ended a run is of that run.
    pub run: u16,
    /// The control tick that it was seen at, or the last one before the run ended: milliseconds since that run began.
    pub uptime_ms: u32,
    /// The battery then; `None` if it was unknown.
    pub battery: Option<Millivolts>,
    /// The motor at fault, or of a fault of the hub the one that was driven most.
    pub motor: Option<u8>,
    /// What that motor's bridge was told last before.
    pub drive: Drive,
    /// Of a hard fault where it was and where that was called from; of a stack overflow how far down the stack had come;
    /// of a panic line and column; of an interrupt its number. Otherwise 0.
    pub detail: [u32; 2],
    /// Ticks of that motor up to then that are kept, 0 to 64.
    pub ticks: u8,
}

/// A control tick of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tick {
    /// The lower 16 bits of its position, counts.
    pub position: u16,
    /// Its speed, counts/s, to the end of 16 bits.
    pub velocity: i16,
    /// The control value.
    pub control: Control,
    /// What its bridge is told; the duty in steps of 2^-13.
    pub drive: Drive,
}

/// FNV-1a: any single byte that is wrong shows, anything else but for one time in 2^32.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811C_9DC5, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

impl Tick {
    pub(super) fn of(report: &Report) -> Self {
        Self {
            position: report.position as u16,
            velocity: report.velocity.round_to_i16(),
            control: report.control,
            drive: report.drive,
        }
    }

    pub(super) fn to_bytes(self) -> [u8; TICK] {
        let [p, q] = self.position.to_le_bytes();
        let [v, w] = self.velocity.to_le_bytes();
        let [c, d] = self.control.get().to_le_bytes();
        let [m, n] = drive_bits(self.drive).to_le_bytes();
        [p, q, v, w, c, d, m, n]
    }

    /// Any bytes are a tick.
    pub(super) fn from_bytes([p, q, v, w, c, d, m, n]: [u8; TICK]) -> Self {
        Self {
            position: u16::from_le_bytes([p, q]),
            velocity: i16::from_le_bytes([v, w]),
            control: Control::new(i16::from_le_bytes([c, d])),
            drive: drive_of(u16::from_le_bytes([m, n])),
        }
    }
}

/// Bits 14 and 15 are the mode, the others the duty in steps of 2^-13.
pub(crate) const fn drive_bits(drive: Drive) -> u16 {
    let mode = match drive.mode {
        Mode::Brake50 => 0,
        Mode::Cw98 => 1,
        Mode::Ccw62 => 2,
    };
    mode << 14 | drive.duty.to_bits() >> 2
}

/// Of a mode that there is not, coasting.
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
    /// With the checksum of its ticks, and ended by its own.
    pub(super) fn to_bytes(self, of_ticks: u32) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        let [first, second] = self.detail;
        let fields: [&[u8]; 10] = [
            &self.number.to_le_bytes(),
            &[self.fault.number(), self.times],
            &self.uptime_ms.to_le_bytes(),
            &self.run.to_le_bytes(),
            &self.battery.map_or(0, Millivolts::get).to_le_bytes(),
            &[self.motor.unwrap_or(NOBODY), self.ticks],
            &drive_bits(self.drive).to_le_bytes(),
            &first.to_le_bytes(),
            &second.to_le_bytes(),
            &of_ticks.to_le_bytes(),
        ];
        bytes.iter_mut().zip(fields.iter().copied().flatten()).for_each(|(byte, field)| *byte = *field);
        if let Some((body, sum)) = bytes.split_last_chunk_mut::<4>() {
            *sum = checksum(body).to_le_bytes();
        }
        bytes
    }

    /// With the checksum of its ticks. `None` if it is not whole, or of a fault that this firmware does not know.
    pub(super) fn from_bytes(bytes: &[u8; HEAD]) -> Option<(Self, u32)> {
        let (body, sum) = bytes.split_last_chunk::<4>()?;
        if checksum(body) != u32::from_le_bytes(*sum) {
            return None;
        }
        let mut words = body.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair));
        let mut word = || words.next().unwrap_or_default();
        let (number, what) = (word(), word().to_le_bytes());
        let mut long = || u32::from(word()) | u32::from(word()) << 16;
        let uptime_ms = long();
        let (run, battery_mv, whose, drive) = (word(), word(), word().to_le_bytes(), drive_of(word()));
        let mut long = || u32::from(word()) | u32::from(word()) << 16;
        let (detail, of_ticks) = ([long(), long()], long());
        let ([fault, times], [motor, ticks]) = (what, whose);
        let head = Self {
            number,
            fault: Fault::from_number(fault)?,
            times,
            run,
            uptime_ms,
            battery: Some(Millivolts::new(battery_mv)).filter(|known| known.get() != 0),
            motor: Some(motor).filter(|motor| *motor != NOBODY),
            drive,
            detail,
            ticks,
        };
        Some((head, of_ticks))
    }
}
