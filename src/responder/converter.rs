//! Values of the ADC channels of REV's protocol. The hub refuses a channel that the board does not measure, except for currents that
//! follow from the motors' constants.
//!
//! | channel | value |
//! |---|---|
//! | 0 to 3, analog inputs | measured |
//! | 4, 5, 6: currents of digital pins, I2C, servos | measured |
//! | 7, battery current | *modelled* from the motors' currents and speeds; negative while motors return more than they draw |
//! | 8 to 11, current of motor 0 to 3 | magnitude: measured, or else *modelled* from speed and bridge command |
//! | 12, 5 V rail | measured |
//! | 13, battery | measured; 0 if unknown |
//! | 14, temperature | measured |
//!
//! Currents and battery are those of the last control tick, all other values at most 20 ms old. Values are clamped to 16 bits. A
//! host may request *raw counts* instead: of an analog input the converter's reading, and of all other channels [`RAW_COUNT`] units
//! in one count.
//!
//! ```
//! use motor_hub::devices::{AnalogReadings, Equipment};
//! use motor_hub::braking::Winding;
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::protocol::Nack;
//! use motor_hub::protocol::requests::RAIL;
//! use motor_hub::responder::converter::Converter;
//! use motor_hub::units::Millivolts;
//!
//! let settings = [Settings::new(Winding::NEVEREST_60); 4];
//! let snapshot = Snapshot::<4>::INITIAL;
//! let mut converter = Converter::default();
//! let mut equipment = Equipment::default();
//! assert_eq!(converter.read(RAIL, false, &equipment, &snapshot, settings.iter()), Err(Nack::UNSUPPORTED));
//! equipment.rail = true;
//! assert_eq!(converter.read(RAIL, false, &equipment, &snapshot, settings.iter()), Err(Nack::NOT_MEASURED));
//! converter.readings = AnalogReadings { rail: Some(Millivolts::new(5_016)), ..AnalogReadings::default() };
//! assert_eq!(converter.read(RAIL, false, &equipment, &snapshot, settings.iter()), Ok(5_016));
//! assert_eq!(converter.read(RAIL, true, &equipment, &snapshot, settings.iter()), Ok(627));
//! ```

use crate::devices::{ANALOG_INPUTS, AnalogReading, AnalogReadings, Equipment};
use crate::hub::Snapshot;
use crate::motor::Settings;
use crate::protocol::requests::{
    AdcChannel, BATTERY, BATTERY_CURRENT, FIRST_CURRENT, FIRST_SUPPLY_CURRENT, RAIL, TEMPERATURE,
};
use crate::protocol::{CHANNELS, Nack};
use crate::units::Milliamperes;

/// Units in one raw count: millivolts, milliamperes or 0.1 degrees. With 8 units, positive 16-bit values give 12-bit raw counts.
pub const RAW_COUNT: i32 = 8;

/// The board's converters for hosts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Converter {
    /// The newest readings.
    pub readings: AnalogReadings,
    /// Currents of the supplies for digital pins, I2C buses and servos. `None` on a board that does not measure them.
    pub supply_currents: Option<[Milliamperes; 3]>,
}

impl Converter {
    /// Returns the voltages of the analog inputs in millivolts. 0 for an input without a reading.
    pub fn analog_mv(&self) -> [i16; ANALOG_INPUTS] {
        self.readings.inputs.map(|input| clamped(input.map_or(0, |input| input.voltage.get().into())))
    }

    /// Returns the value of a channel according to the table above. `equipment` is what the board has, `settings` are the settings of all motors in their order.
    ///
    /// # Errors
    /// [`Nack::UNSUPPORTED`] for a channel that the board does not have, [`Nack::NOT_MEASURED`] for a channel without a reading.
    pub fn read<'a, const N: usize>(
        &self,
        channel: AdcChannel,
        raw: bool,
        equipment: &Equipment,
        snapshot: &Snapshot<N>,
        settings: impl Iterator<Item = &'a Settings>,
    ) -> Result<i16, Nack> {
        let Self { readings, supply_currents } = self;
        let number = usize::from(channel.get());
        let after = |first: AdcChannel| number.checked_sub(first.get().into());
        // `None` for a channel that the board does not have, and a reading of `None` for a channel without a reading.
        let reading = match channel {
            BATTERY_CURRENT => {
                let battery = snapshot.battery.unwrap_or_default();
                let drawn =
                    settings.zip(&snapshot.motors).map(|(settings, report)| report.drawn(settings, battery));
                Some(Some(drawn.fold(0, |sum: i32, drawn| sum.saturating_add(drawn.get()))))
            }
            RAIL => equipment.rail.then_some(readings.rail.map(|rail| rail.get().into())),
            // An unknown voltage reads 0.
            BATTERY => Some(Some(snapshot.battery.unwrap_or_default().get().into())),
            TEMPERATURE => equipment.temperature.then_some(readings.temperature_decidegrees.map(i32::from)),
            _ => {
                if let Some(input) = readings.inputs.get(number) {
                    let counts = |input: AnalogReading| i32::from(input.counts) * RAW_COUNT;
                    let millivolts = |input: AnalogReading| input.voltage.get().into();
                    let reading = if raw { input.map(counts) } else { input.map(millivolts) };
                    (channel.get() < equipment.analog).then_some(reading)
                } else if let Some(motor) = after(FIRST_CURRENT) {
                    let report = snapshot.motors.iter().take(CHANNELS).nth(motor);
                    report.map(|report| Some(report.best_current().magnitude().into()))
                } else {
                    let supply = after(FIRST_SUPPLY_CURRENT).zip(supply_currents.as_ref());
                    supply.and_then(|(supply, all)| all.get(supply)).map(|current| Some(current.get()))
                }
            }
        };
        let value = clamped(reading.ok_or(Nack::UNSUPPORTED)?.ok_or(Nack::NOT_MEASURED)?);
        Ok(if raw { value / RAW_COUNT as i16 } else { value })
    }
}

fn clamped(value: i32) -> i16 {
    value.clamp(i16::MIN.into(), i16::MAX.into()) as i16
}
