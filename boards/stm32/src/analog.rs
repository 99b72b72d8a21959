//! The newest readings of the analog inputs, the 5 V rail and the chip's temperature sensor.
//!
//! The task that measures the battery starts a *sequence* of all channels every 10 ms. A sequence takes less than
//! 0.1 ms. Its readings are collected at the next start, or when a host asks for them, whichever comes first.

use crate::supply::FactoryWord;
use core::cell::Cell;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_time::{Duration, Instant};
use motor_hub::board::{ANALOG_INPUTS, AnalogReading, AnalogReadings};
use motor_hub::supply::{Thermometer, VrefintCalibration, VrefintScale};

/// Resistances in ohm of the voltage divider of the 5 V rail, to the rail and to ground. The divider makes 2.5 V at the pin.
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

/// The factory's calibration of a chip.
#[derive(Clone, Copy)]
pub struct Factory {
    /// Calibration of the internal voltage reference, VREFINT.
    pub reference: VrefintCalibration,
    /// Calibration of the temperature sensor.
    pub thermometer: Thermometer,
}

impl Factory {
    /// Reads the calibration of the reference, and of the sensor at 30 and at 110 degrees Celsius. The words must be those of
    /// the chip that runs this code.
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
            supply_currents: None,
        }
    }
}

#[derive(Clone, Copy)]
struct Measured {
    at: Instant,
    sequence: Sequence,
}

/// The newest readings, and the time at which the last sequence was started. Only tasks may use it, not interrupts.
pub struct Newest {
    started: Mutex<ThreadModeRawMutex, Cell<Instant>>,
    measured: Mutex<ThreadModeRawMutex, Cell<Option<Measured>>>,
}

impl Newest {
    /// Creates the state before the first readings.
    pub const fn new() -> Self {
        Self { started: Mutex::new(Cell::new(Instant::MIN)), measured: Mutex::new(Cell::new(None)) }
    }

    /// Notes that a sequence has been started now.
    pub fn started(&self) {
        self.started.lock(|at| at.set(Instant::now()));
    }

    /// Stores the readings of the sequence that was started last.
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

    /// Returns the newest readings. All are `None` if they are older than 20 ms.
    pub fn readings(&self, factory: Factory) -> AnalogReadings {
        self.get().map_or_else(AnalogReadings::default, |sequence| factory.convert(sequence))
    }

    /// Returns the newest reading of the internal reference. `None` if it is older than 20 ms.
    pub fn vrefint(&self) -> Option<u16> {
        self.get().map(|sequence| sequence.vrefint)
    }
}

impl Default for Newest {
    fn default() -> Self {
        Self::new()
    }
}
