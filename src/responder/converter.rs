//! Channels of the converter. This hub's converter measures the battery, and on some boards the motors' currents. The other
//! channels have nominal or modelled values.
//!
//! | channel | value |
//! |---|---|
//! | 0 to 3, analog inputs | 0 mV: the hub has none |
//! | 4, 5, 6: currents of digital pins, I2C, servos | 0 mA: the hub feeds none |
//! | 7, battery current | *modelled*: the sum over all bridges; negative while more is returned than drawn |
//! | 8 to 11, current of motor 0 to 3 | magnitude: measured, or *modelled* by motor constants, speed and bridge command |
//! | 12, 5 V rail | 5000 mV: *nominal* |
//! | 13, battery | measured; 0 if unknown |
//! | 14, temperature | 25.0 degrees: *nominal* |
//!
//! Currents are of the last control tick, clamped to 16 bits. Raw counts are of a converter of 12 bits with [`RAW_COUNT`] units
//! in a count, on every channel.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::protocol::requests::AdcChannel;
//! use motor_hub::responder::converter;
//!
//! let rail = AdcChannel::new(12).expect("0 to 14");
//! let settings = [Settings::new(Winding::NEVEREST_60); 4];
//! assert_eq!(converter::read(rail, false, &Snapshot::<4>::INITIAL, settings.iter()), 5_000);
//! assert_eq!(converter::read(rail, true, &Snapshot::<4>::INITIAL, settings.iter()), 625);
//! ```

use super::report::magnitude;
use crate::hub::Snapshot;
use crate::motor::{Report, Settings};
use crate::protocol::CHANNELS;
use crate::protocol::requests::{AdcChannel, BATTERY, BATTERY_CURRENT, FIRST_CURRENT, RAIL, TEMPERATURE};
use crate::units::Milliamperes;

/// Millivolts, milliamperes or 0.1 degrees in a raw count: 16 bits of an answer in 12 bits of a raw count.
pub const RAW_COUNT: i32 = 8;

/// Nominal voltage of the 5 V rail in millivolts, which the hub does not measure.
const RAIL_MV: i32 = 5_000;

/// Nominal temperature in 0.1 degrees Celsius, which the hub does not measure.
const ROOM_TEMPERATURE: i32 = 250;

/// The value of a channel by the table above, with the settings of all motors.
pub fn read<'a, const N: usize>(
    channel: AdcChannel,
    raw: bool,
    snapshot: &Snapshot<N>,
    settings: impl Iterator<Item = &'a Settings>,
) -> i16 {
    let value = match channel {
        BATTERY_CURRENT => {
            let battery = snapshot.battery.unwrap_or_default();
            let drawn =
                settings.zip(&snapshot.motors).map(|(settings, report)| report.drawn(settings, battery));
            drawn.fold(0, |sum: i32, drawn| sum.saturating_add(drawn.get()))
        }
        RAIL => RAIL_MV,
        // An unknown voltage reads 0.
        BATTERY => snapshot.battery.unwrap_or_default().get().into(),
        TEMPERATURE => ROOM_TEMPERATURE,
        _ => current_of(channel, &snapshot.motors).map_or(0, |current| magnitude(current).into()),
    };
    let value = value.clamp(i16::MIN.into(), i16::MAX.into());
    (if raw { value / RAW_COUNT } else { value }) as i16
}

/// The current of the motor that the channel belongs to; `None` for other channels.
fn current_of(channel: AdcChannel, motors: &[Report]) -> Option<Milliamperes> {
    let motor = channel.get().checked_sub(FIRST_CURRENT.get())?;
    motors.iter().take(CHANNELS).nth(motor.into()).map(Report::best_current)
}
