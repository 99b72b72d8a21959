//! What hangs on the host's connectors: servos, analog inputs, I2C devices, and their faults.

use std::time::Duration;

use rigless::time::VirtualNanos;

use super::Bench;
use crate::register_device::RegisterDevice;
use crate::wiring;

/// A pulse on the pin of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoPulse {
    /// When it rose.
    pub at: Duration,
    /// For how long the pin was high.
    pub high: Duration,
}

impl Bench {
    /// The pulses on the pin of a servo so far, without a pulse that has not ended.
    ///
    /// # Panics
    /// If the pin is not its timer's.
    pub fn servo_pulses(&mut self, servo: usize) -> Vec<ServoPulse> {
        let (port, pin) = wiring::SERVOS[servo];
        let (edges, driven) = self.at_stop(move |_, session, _| {
            let chip = &session.board_mut().chip;
            (chip.servo(servo).to_vec(), chip.port(port).is_function(pin))
        });
        assert!(driven || edges.is_empty(), "the pin of servo {servo} is not its timer's");
        let pulses = edges.as_chunks().0.iter().map(|edges: &[_; 2]| {
            let [rise, fall] = edges.map(|(at, _)| Duration::from_nanos(at));
            ServoPulse { at: rise, high: fall - rise }
        });
        pulses.collect()
    }

    /// The voltage on an analog input of the host, 0 to 3, in mV. An input without a wire is at 0 V, by its pull-down.
    pub fn set_analog(&mut self, input: usize, millivolts: u32) {
        self.at_stop(move |_, session, _| session.board_mut().chip.set_analog(input, millivolts));
    }

    /// The 5 V rail, in mV. Half of it is on the chip's pin.
    pub fn set_five_volts(&mut self, millivolts: u32) {
        self.at_stop(move |_, session, _| session.board_mut().chip.set_analog(4, millivolts / 2));
    }

    /// The chip's temperature, in degrees Celsius.
    pub fn set_temperature(&mut self, celsius: i32) {
        self.at_stop(move |_, session, _| session.board_mut().chip.set_temperature(100 * celsius));
    }

    /// Connects a device to an I2C bus. The first device of a bus has the number 0.
    pub fn attach(&mut self, bus: usize, device: RegisterDevice) {
        self.at_stop(move |_, session, _| session.board_mut().chip.attach_device(bus, device));
    }

    /// Does something with the nth device of an I2C bus.
    ///
    /// # Panics
    /// If there is none.
    pub fn device<T: Send + 'static>(
        &mut self,
        bus: usize,
        nth: usize,
        act: impl FnOnce(&mut RegisterDevice) -> T + Send + 'static,
    ) -> T {
        self.at_stop(move |_, session, _| act(session.board_mut().chip.device(bus, nth).expect("a device")))
    }

    /// A device holds SCL of an I2C bus low for this time.
    pub fn hold_scl(&mut self, bus: usize, time: Duration) {
        self.at_stop(move |surroundings, session, _| {
            surroundings.hold_lines(session, bus, [true, false]);
            let end = surroundings.now + time.as_nanos() as u64;
            let release =
                move |surroundings: &mut super::Surroundings, session: &mut _, _: &mut dyn super::Host| {
                    surroundings.hold_lines(session, bus, [false, false]);
                };
            surroundings.plan(end, Box::new(release));
        });
    }

    /// A device holds SDA of an I2C bus low until SCL has been pulsed this often, as one does that was cut off in the middle of
    /// a byte.
    pub fn hold_sda(&mut self, bus: usize, clocks: u8) {
        self.at_stop(move |surroundings, session, _| surroundings.hold_sda(session, bus, clocks));
    }

    /// The levels of SCL and SDA of an I2C bus.
    pub fn bus_levels(&mut self, bus: usize) -> [bool; 2] {
        self.at_stop(move |_, session, _| {
            wiring::BUSES[bus].map(|(port, pin)| {
                let pin = rigless::soc::st::gpio::Pin::new(pin).expect("a pin of a port");
                session.board_mut().chip.pin_level(port, pin) == rigless::device::Level::High
            })
        })
    }
}

impl super::Surroundings {
    /// A device holds lines of a bus low, SCL and SDA, or releases them. Resistors pull both up.
    pub(crate) fn hold_lines(
        &mut self,
        session: &mut super::Session<super::Nucleo>,
        bus: usize,
        low: [bool; 2],
    ) {
        let at = VirtualNanos(self.now);
        let chip = &mut session.board_mut().chip;
        for ((port, pin), low) in wiring::BUSES[bus].into_iter().zip(low) {
            let pin = rigless::soc::st::gpio::Pin::new(pin).expect("a pin of a port");
            chip.drive_pin(at, port, pin, Some((!low).into()));
        }
        chip.hold_lines(at, bus, low);
    }
}
