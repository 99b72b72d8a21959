//! Values of the ADC channels of REV's protocol. The hub refuses a channel that the board does not measure, except for
//! currents that follow from the motors' constants.
//!
//! | channel | value |
//! |---|---|
//! | 0 to 3, analog inputs | measured |
//! | 4, 5, 6: currents of digital pins, I2C, servos | measured |
//! | 7, battery current | *modelled* from currents and speeds; negative while motors return more than they draw |
//! | 8 to 11, current of motor 0 to 3 | magnitude: measured, or else *modelled* from speed and bridge command |
//! | 12, 5 V rail | measured |
//! | 13, battery | measured; 0 if unknown |
//! | 14, temperature | measured |
//!
//! Battery voltage, battery current and motor currents are from the last control tick. All other values are at most 20
//! ms old. Values are clamped to 16 bits. A host may request *raw counts* instead. The raw count of an analog input is
//! the converter's reading. On all other channels one raw count is [`RAW_COUNT`] units.

use super::Responder;
use crate::devices::{ANALOG_INPUTS, AnalogReading};
use crate::hub::Snapshot;
use crate::protocol::requests::{
    AdcChannel, BATTERY, BATTERY_CURRENT, FIRST_CURRENT, FIRST_SUPPLY_CURRENT, RAIL, TEMPERATURE,
};
use crate::protocol::{CHANNELS, Nack};
use crate::units::Milliamperes;

/// Number of units in one raw count. The unit is a millivolt, a milliampere or 0.1 degrees. With 8 units the values 0
/// to 32 767 become 0 to 4095 raw counts, like the readings of a converter with 12 bits.
const RAW_COUNT: i32 = 8;

impl<const N: usize> Responder<N> {
    /// Returns the voltages of the analog inputs in millivolts. 0 for an input without a reading.
    pub(super) fn analog_mv(&self) -> [i16; ANALOG_INPUTS] {
        self.readings.inputs.map(|input| clamped(input.map_or(0, |input| input.voltage.get().into())))
    }

    /// Returns the value of a channel according to the table of the module.
    ///
    /// # Errors
    /// [`Nack::UNSUPPORTED`] for a channel that the board does not have, [`Nack::NOT_MEASURED`] for a channel without a
    /// reading.
    pub(super) fn adc(&self, channel: AdcChannel, raw: bool, snapshot: &Snapshot<N>) -> Result<i16, Nack> {
        let (readings, equipment) = (&self.readings, &self.outputs.equipment);
        let number = usize::from(channel.get());
        let after = |first: AdcChannel| number.checked_sub(first.get().into());
        // `None` for a channel that the board does not have, and a reading of `None` for a channel without a reading.
        let reading = match channel {
            BATTERY_CURRENT => {
                let battery = snapshot.battery.unwrap_or_default();
                let motors = self.channels.iter().zip(&snapshot.motors);
                let drawn =
                    motors.map(|(channel, report)| report.bus_current(&channel.settings().motor, battery));
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
                    let supply = after(FIRST_SUPPLY_CURRENT).zip(readings.supply_currents.as_ref());
                    supply
                        .and_then(|(supply, all)| all.get(supply))
                        .map(|current| current.map(Milliamperes::get))
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
