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
use motor_hub::supply::VrefintScale;

/// Resistances in ohm of the voltage divider of the 5 V rail, to the rail and to ground. The divider makes 2.5 V at the pin.
const RAIL_OHMS: (u32, u32) = (10_000, 10_000);

/// Age beyond which readings are not used.
const STALE: Duration = Duration::from_millis(20);

/// The readings of one sequence, right-aligned.
#[derive(Clone, Copy)]
pub(crate) struct Sequence {
    /// The inputs of the host.
    pub(crate) inputs: [u16; ANALOG_INPUTS],
    /// The divider of the 5 V rail.
    pub(crate) rail: u16,
    /// The temperature sensor.
    pub(crate) temperature: u16,
    /// The internal reference.
    pub(crate) vrefint: u16,
}

#[derive(Clone, Copy)]
struct Measured {
    at: Instant,
    sequence: Sequence,
}

/// The newest readings, and the time at which the last sequence was started. Only tasks may use it, not interrupts.
pub(crate) struct Newest {
    started: Mutex<ThreadModeRawMutex, Cell<Instant>>,
    measured: Mutex<ThreadModeRawMutex, Cell<Option<Measured>>>,
}

impl Newest {
    /// Creates the state before the first readings.
    pub(crate) const fn new() -> Self {
        Self { started: Mutex::new(Cell::new(Instant::MIN)), measured: Mutex::new(Cell::new(None)) }
    }

    /// Notes that a sequence has been started now.
    pub(crate) fn started(&self) {
        self.started.lock(|at| at.set(Instant::now()));
    }

    /// Stores the readings of the sequence that was started last.
    pub(crate) fn ended(&self, sequence: Sequence) {
        let at = self.started.lock(Cell::get);
        self.measured.lock(|measured| measured.set(Some(Measured { at, sequence })));
    }

    /// Returns the newest readings. `None` if they are older than 20 ms.
    pub(crate) fn get(&self) -> Option<Sequence> {
        let measured = self.measured.lock(Cell::get);
        let measured =
            measured.filter(|measured| Instant::now().saturating_duration_since(measured.at) <= STALE);
        measured.map(|measured| measured.sequence)
    }

    /// Returns the newest readings as a host gets them. All are `None` if they are older than 20 ms. The words are the
    /// factory's readings of VREFINT, and of the temperature sensor at 30 and at 110 degrees Celsius. They must be those of
    /// the chip that runs this code.
    pub(crate) fn readings(
        &self,
        vrefint_word: FactoryWord,
        sensor_words: [FactoryWord; 2],
    ) -> AnalogReadings {
        let reference = vrefint_word.read();
        let sensor = sensor_words.map(|word| word.read().reading);
        let Some(Sequence { inputs, rail, temperature, vrefint }) = self.get() else {
            return AnalogReadings::default();
        };
        let at_pin = VrefintScale::at_pin(reference).ok();
        let rail_scale = VrefintScale::new(RAIL_OHMS.0, RAIL_OHMS.1, reference).ok();
        AnalogReadings {
            inputs: inputs.map(|reading| {
                let voltage = at_pin?.battery(reading, vrefint)?;
                Some(AnalogReading { voltage, counts: reading >> reference.bits.saturating_sub(12) })
            }),
            rail: rail_scale.and_then(|scale| scale.battery(rail, vrefint)),
            temperature_decidegrees: reference.decidegrees(sensor, temperature, vrefint),
            supply_currents: None,
        }
    }
}
