//! The newest readings of analog inputs, 5 V rail and temperature sensor, as a chip's converters give them.
//!
//! The task that measures the battery starts a *sequence* of all channels every 10 ms. A sequence takes some tenths of a
//! millisecond. Its readings are collected at the next start, or when a host asks for them, whichever comes first.

use crate::supply::FactoryWord;
use core::cell::Cell;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_time::{Duration, Instant};
use motor_hub::board::{ANALOG_INPUTS, AnalogReading, AnalogReadings};
use motor_hub::supply::{Thermometer, VrefintCalibration, VrefintScale};

/// Resistances of the divider of the 5 V rail, to the rail and to ground. 5 V give 2.5 V at the pin.
const RAIL_OHMS: (u32, u32) = (10_000, 10_000);

/// Age beyond which readings are not used.
const STALE: Duration = Duration::from_millis(20);

/// The readings of one sequence, right-aligned.
#[derive(Clone, Copy)]
pub struct Sequence {
    /// The inputs of the host.
    pub inputs: [u16; ANALOG_INPUTS],
    /// The divider of the 5 V rail.
    pub rail: u16,
    /// The temperature sensor.
    pub temperature: u16,
    /// The internal reference.
    pub vrefint: u16,
}

/// The factory's readings of a chip.
#[derive(Clone, Copy)]
pub struct Factory {
    /// Of the internal reference.
    pub reference: VrefintCalibration,
    /// Of the temperature sensor.
    pub thermometer: Thermometer,
}

impl Factory {
    /// Reads the words of the reference, and of the sensor at 30 and at 110 degrees. Only those of this chip can be read.
    pub fn read(reference: FactoryWord, sensor: [FactoryWord; 2]) -> Self {
        let readings = sensor.map(|word| word.read().reading);
        Self { reference: reference.read(), thermometer: Thermometer { readings } }
    }

    fn convert(self, sequence: Sequence) -> AnalogReadings {
        let Self { reference, thermometer } = self;
        let vrefint = sequence.vrefint;
        let at_pin = VrefintScale::at_pin(reference).ok();
        let rail = VrefintScale::new(RAIL_OHMS.0, RAIL_OHMS.1, reference).ok();
        AnalogReadings {
            inputs: sequence.inputs.map(|reading| {
                let voltage = at_pin?.battery(reading, vrefint)?;
                Some(AnalogReading { voltage, counts: reading >> reference.bits.saturating_sub(12) })
            }),
            rail: rail.and_then(|scale| scale.battery(sequence.rail, vrefint)),
            temperature_decidegrees: thermometer.decidegrees(sequence.temperature, vrefint, reference),
        }
    }
}

#[derive(Clone, Copy)]
struct Measured {
    at: Instant,
    sequence: Sequence,
}

/// The newest readings, and when the last sequence was started. Used by tasks only.
pub struct Newest {
    started: Mutex<ThreadModeRawMutex, Cell<Instant>>,
    measured: Mutex<ThreadModeRawMutex, Cell<Option<Measured>>>,
}

impl Newest {
    /// No readings yet.
    pub const fn new() -> Self {
        Self { started: Mutex::new(Cell::new(Instant::MIN)), measured: Mutex::new(Cell::new(None)) }
    }

    /// A sequence has been started.
    pub fn started(&self) {
        self.started.lock(|at| at.set(Instant::now()));
    }

    /// The sequence that was started last has ended.
    pub fn ended(&self, sequence: Sequence) {
        let at = self.started.lock(Cell::get);
        self.measured.lock(|measured| measured.set(Some(Measured { at, sequence })));
    }

    fn get(&self) -> Option<Sequence> {
        let measured = self.measured.lock(Cell::get);
        let measured =
            measured.filter(|measured| Instant::now().saturating_duration_since(measured.at) <= STALE);
        measured.map(|measured| measured.sequence)
    }

    /// Returns the newest readings, unless they are too old.
    pub fn readings(&self, factory: Factory) -> AnalogReadings {
        self.get().map_or_else(AnalogReadings::default, |sequence| factory.convert(sequence))
    }

    /// Returns the newest reading of the internal reference, unless it is too old.
    pub fn vrefint(&self) -> Option<u16> {
        self.get().map(|sequence| sequence.vrefint)
    }
}

impl Default for Newest {
    fn default() -> Self {
        Self::new()
    }
}
