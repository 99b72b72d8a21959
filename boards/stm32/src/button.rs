//! The button that drives all motors while there is no host. [`motor_hub::responder::button`] decides which set-point a pressed
//! button commands.

use embassy_stm32::gpio::Input;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Ticker};
use motor_hub::responder::button::{Button, ButtonInputs};
use motor_hub::tasks::Wires;
use motor_hub::units::Micros;

const POLL: Duration = Duration::from_millis(10);

/// Polls the button and sends its commands. A pressed button pulls its pin high. The pin needs a pull-down: motors could turn if
/// an open pin read as high.
pub async fn run<M: RawMutex, const N: usize>(input: Input<'static>, wires: &Wires<M, N>) -> ! {
    let mut ticker = Ticker::every(POLL);
    let mut button = Button::default();
    loop {
        ticker.next().await;
        let down = input.is_high();
        // Reading a snapshot copies all of it, so the battery is checked only while the button is pressed.
        let battery_good =
            down && wires.snapshot.try_get().is_some_and(|snapshot| snapshot.good_battery().is_some());
        let wanted = button.step(ButtonInputs {
            down,
            permitted: wires.button_permitted.lock(|permitted| permitted.get()),
            battery_good,
            now: Micros::new(Instant::now().as_micros()),
        });
        // A set-point that finds no room in the queue is sent at the next poll.
        wires.try_send_by_button(wanted);
    }
}
