//! What is connected for the host: servos, analog inputs, I2C devices, and their faults.

use std::time::Duration;

use rigless::time::VirtualNanos;

use super::{Bench, nanos};
use crate::chip::ServoPulse;
use crate::register_device::RegisterDevice;
use crate::wiring;

impl Bench {
    /// Returns the pulses on the pin of a servo so far, without a pulse that has not ended.
    ///
    /// # Panics
    /// Panics if the chip does not connect the pin to the timer of the servo.
    pub fn servo_pulses(&mut self, servo: usize) -> Vec<ServoPulse> {
        let (port, pin) = wiring::SERVOS[servo];
        let (pulses, driven) = self.at_stop(move |_, session, _| {
            let board = session.board_mut();
            (board.chip.servo(servo).to_vec(), board.port(port).is_function(pin))
        });
        assert!(driven || pulses.is_empty(), "the pin of servo {servo} is not its timer's");
        pulses
    }

    /// Sets the voltage in mV on an analog input of the host, 0 to 3. An input without a wire has 0 V, because of its pull-down.
    pub fn set_analog(&mut self, input: usize, millivolts: u32) {
        let input = wiring::analog(self.board)[input];
        self.post(move |_, session, _| session.board_mut().chip.set_input(input, millivolts));
    }

    /// Sets the voltage of the 5 V rail in mV. A divider puts half of it on the chip's pin.
    pub fn set_five_volts(&mut self, millivolts: u32) {
        self.set_analog(4, millivolts / 2);
    }

    /// Sets the chip's temperature in degrees Celsius.
    pub fn set_temperature(&mut self, celsius: i32) {
        self.post(move |_, session, _| session.board_mut().chip.set_temperature(100 * celsius));
    }

    /// Connects a device to an I2C bus. The first device of a bus has the number 0.
    pub fn attach(&mut self, bus: usize, device: RegisterDevice) {
        self.post(move |_, session, _| session.board_mut().chip.attach_device(bus, device));
    }

    /// Runs a function with the device of an I2C bus that has the number `nth`.
    pub fn device<T: Send + 'static>(
        &mut self,
        bus: usize,
        nth: usize,
        act: impl FnOnce(&mut RegisterDevice) -> T + Send + 'static,
    ) -> T {
        self.at_stop(move |_, session, _| act(session.board_mut().chip.device(bus, nth).expect("a device")))
    }

    /// Makes a device hold SCL of an I2C bus low for this time.
    pub fn hold_scl(&mut self, bus: usize, time: Duration) {
        self.post(move |surroundings, session, _| {
            surroundings.hold_line(session, bus, 0, true);
            let end = surroundings.now + nanos(time);
            surroundings.plan(end, move |surroundings, session, _| {
                surroundings.hold_line(session, bus, 0, false);
            });
        });
    }

    /// Makes a device hold SDA of an I2C bus low until SCL has had this number of pulses. A device whose transfer was
    /// cut off in the middle of a byte behaves in this way.
    pub fn hold_sda(&mut self, bus: usize, clocks: u8) {
        self.post(move |surroundings, session, _| {
            surroundings.stuck = Some((bus, clocks, true));
            surroundings.hold_line(session, bus, 1, true);
        });
    }

    /// Returns the levels of SCL and SDA of an I2C bus.
    pub fn bus_levels(&mut self, bus: usize) -> [bool; 2] {
        self.at_stop(move |_, session, _| wiring::BUSES[bus].map(|pin| session.board_mut().is_high(pin)))
    }
}

impl super::Surroundings {
    /// Makes a device hold SCL (line 0) or SDA (line 1) low, or release it. Resistors pull released lines up.
    pub(crate) fn hold_line(
        &mut self,
        session: &mut super::Session<super::Nucleo>,
        bus: usize,
        line: usize,
        low: bool,
    ) {
        let board = session.board_mut();
        board.drive_pin(self.now, wiring::BUSES[bus][line], Some(!low));
        board.chip.hold_line(VirtualNanos(self.now), bus, line, low);
    }
}
