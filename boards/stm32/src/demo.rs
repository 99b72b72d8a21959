//! Something to try on the bench without a host: all motors turn while a button is held.
//!
//! Of button and host the last to speak is obeyed. Held: 1000 counts/s. Released: brought to standstill, and
//! the bridges are opened a second later.

use embassy_stm32::gpio::Input;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Ticker};
use motor_hub::hub::{Action, Command};
use motor_hub::motor::Setpoint;
use motor_hub::tasks::Wires;
use motor_hub::units::CountsPerSecond;

/// Polled: slower than the button bounces.
const POLL: Duration = Duration::from_millis(20);

/// A NeveRest 60 turns about 2700 counts/s at 12 V without load.
const SPEED_CPS: i32 = 1000;

/// From release until the bridges are opened.
const HOLD: Duration = Duration::from_secs(1);

/// Runs for ever. A button that is held pulls its pin high.
pub async fn run<M: RawMutex, const N: usize>(button: Input<'static>, wires: &Wires<M, N>) -> ! {
    let mut ticker = Ticker::every(POLL);
    let mut current = Setpoint::Disabled;
    let mut released_at = None;
    loop {
        ticker.next().await;
        let now = Instant::now();
        let wanted = if button.is_high() {
            released_at = Some(now);
            Setpoint::Velocity(CountsPerSecond::new(SPEED_CPS))
        } else if released_at.is_some_and(|at| now.saturating_duration_since(at) < HOLD) {
            Setpoint::Velocity(CountsPerSecond::ZERO)
        } else {
            Setpoint::Disabled
        };
        if wanted != current {
            current = wanted;
            for motor in 0..N {
                wires.commands.send(Command { motor, action: Action::Set(wanted) }).await;
            }
        }
    }
}
