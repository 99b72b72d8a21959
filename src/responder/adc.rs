//! Channels of the converter. This hub's has the battery alone; of the rest hosts are told what is known without one.
//!
//! | channel | what is answered |
//! |---|---|
//! | 0 to 3, analog inputs | 0 mV: there are none |
//! | 4, 5, 6: currents of digital pins, I2C, servos | 0 mA: nothing is fed |
//! | 7, battery current | *modelled*: the sum over all bridges; negative while more is returned than drawn |
//! | 8 to 11, current of motor 0 to 3 | its magnitude: measured, where a board does; else *modelled*, without a sense line: by the motor's constants, its speed, and what its bridge is told |
//! | 12, 5 V rail | 5000 mV: *nominal* |
//! | 13, battery | measured; 0 while it is not known |
//! | 14, temperature | 25.0 degrees: *nominal* |
//!
//! Currents are those of the last control tick. Beyond 16 bits stands their end. Raw counts are of a converter of 12 bits
//! whose counts are [`RAW_COUNT`] units each, on every channel.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::protocol::requests::AdcChannel;
//! use motor_hub::responder::adc;
//!
//! let rail = AdcChannel::new(12).expect("0 to 14");
//! let settings = [Settings::new(Winding::NEVEREST_60); 4];
//! assert_eq!(adc::read(rail, false, &Snapshot::<4>::INITIAL, settings.iter()), 5_000);
//! assert_eq!(adc::read(rail, true, &Snapshot::<4>::INITIAL, settings.iter()), 625);
//! ```

use super::setup::magnitude;
use crate::hub::Snapshot;
use crate::motor::{Report, Settings};
use crate::protocol::CHANNELS;
use crate::protocol::requests::{AdcChannel, BATTERY, BATTERY_CURRENT, FIRST_CURRENT, RAIL, TEMPERATURE};
use crate::units::Milliamperes;

/// Millivolts, milliamperes or 0.1 degrees in a raw count: 12 bits are all that an answer can say.
pub const RAW_COUNT: i32 = 8;

/// Nobody measures it.
const RAIL_MV: i32 = 5_000;

/// Nobody measures it: 0.1 degrees.
const ROOM_TEMPERATURE: i32 = 250;

/// What a channel is answered: see the table above. `settings` are the motors'.
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
                settings.zip(&snapshot.motors).map(|(settings, report)| settings.drawn(report, battery));
            drawn.fold(0, |sum: i32, drawn| sum.saturating_add(drawn.get()))
        }
        RAIL => RAIL_MV,
        // Unknown reads 0, which no battery does that a hub runs from.
        BATTERY => snapshot.battery.unwrap_or_default().get().into(),
        TEMPERATURE => ROOM_TEMPERATURE,
        _ => current_of(channel, &snapshot.motors).map_or(0, |current| magnitude(current).into()),
    };
    let value = value.clamp(i16::MIN.into(), i16::MAX.into());
    (if raw { value / RAW_COUNT } else { value }) as i16
}

/// Of the motor whose channel it is, if it is one.
fn current_of(channel: AdcChannel, motors: &[Report]) -> Option<Milliamperes> {
    let motor = channel.get().checked_sub(FIRST_CURRENT.get())?;
    motors.iter().take(CHANNELS).nth(motor.into()).map(Report::best_current)
}
