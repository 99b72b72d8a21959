//! Values of the ADC channels of REV's protocol. The hub measures the battery, and on some boards the currents of motors. All
//! other values are 0, *nominal* (a constant), or *modelled* (computed from the motors' constants).
//!
//! | channel | value |
//! |---|---|
//! | 0 to 3, analog inputs | 0 mV: the hub has none |
//! | 4, 5, 6: currents of digital pins, I2C, servos | 0 mA: the hub has no such supplies |
//! | 7, battery current | *modelled* from the motors' currents and speeds; negative while motors return more than they draw |
//! | 8 to 11, current of motor 0 to 3 | magnitude: measured, or else *modelled* from speed and bridge command |
//! | 12, 5 V rail | 5000 mV: *nominal* |
//! | 13, battery | measured; 0 if unknown |
//! | 14, temperature | 25.0 degrees Celsius: *nominal* |
//!
//! Values are those of the last control tick, clamped to 16 bits. A host may request *raw counts* instead. On every channel
//! one raw count is [`RAW_COUNT`] units.
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

use crate::hub::Snapshot;
use crate::motor::{Report, Settings};
use crate::protocol::CHANNELS;
use crate::protocol::requests::{AdcChannel, BATTERY, BATTERY_CURRENT, FIRST_CURRENT, RAIL, TEMPERATURE};
use crate::units::Milliamperes;

/// Units in one raw count: millivolts, milliamperes or 0.1 degrees. With 8 units, positive 16-bit values give 12-bit raw counts.
pub const RAW_COUNT: i32 = 8;

/// Nominal voltage of the 5 V rail in millivolts. The hub does not measure this voltage.
const RAIL_MV: i32 = 5_000;

/// Nominal temperature in 0.1 degrees Celsius. The hub does not measure its temperature.
const ROOM_TEMPERATURE: i32 = 250;

/// Returns the value of a channel according to the table above. `settings` are the settings of all motors in their order.
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
        _ => current_of(channel, &snapshot.motors).map_or(0, |current| current.magnitude().into()),
    };
    let value = value.clamp(i16::MIN.into(), i16::MAX.into());
    (if raw { value / RAW_COUNT } else { value }) as i16
}

/// Returns the current of the motor that the channel belongs to. `None` for a channel of no motor.
fn current_of(channel: AdcChannel, motors: &[Report]) -> Option<Milliamperes> {
    let motor = channel.get().checked_sub(FIRST_CURRENT.get())?;
    motors.iter().take(CHANNELS).nth(motor.into()).map(Report::best_current)
}
