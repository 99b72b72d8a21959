//! Faults and inputs that a test applies to the chip and to what is connected to it: loads, supply, encoders, line errors,
//! bus errors, resets, a task that hangs.

use std::time::Duration;

use motor_hub::model::si::Volts;
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use simulated::current_line::CurrentLine;
use simulated::encoder::Encoder;

use super::{Bench, nanos};
use crate::chip::{ChipFaults, FlashFaults, H743};
use crate::faulty_code::FaultyCode;
use crate::wiring;

impl Bench {
    /// Damages bytes that the chip receives, at random: `per_million` of a million bytes. One half of the damaged bytes
    /// has noise, the other half a framing error. The line is the line of the host, or the chain line of a child.
    pub fn garble_serial(&mut self, per_million: u32) {
        let line = self.line;
        self.post(move |_, session, _| {
            let errors = session.board_mut().chip.line_errors(line);
            errors.seed = 7;
            for (rate, name) in [(&mut errors.noise, "noise"), (&mut errors.framing, "framing")] {
                rate.name = name;
                rate.per_million = per_million / 2;
            }
        });
    }

    /// Connects an encoder differently, from now on.
    pub fn set_encoder(&mut self, motor: usize, encoder: Encoder) {
        self.post(move |surroundings, session, _| surroundings.connect(session, motor, encoder));
    }

    /// Connects a current-sense line differently, from now on.
    pub fn set_current_line(&mut self, motor: usize, line: CurrentLine) {
        self.post(move |surroundings, _, _| surroundings.current_lines[motor] = line);
    }

    /// Makes the running or the next conversion of a converter take longer by this time. ADC2 (`number` 2) measures the currents, and
    /// ADC3 the reference and the analog inputs.
    /// A converter of the F427 has a data register for each current, so a late conversion has no effect.
    pub fn delay_conversion(&mut self, number: usize, time: Duration) {
        self.on_h743(move |chip, _| chip.converters[number - 1].next_is_late_by = Some(nanos(time)));
    }

    /// Makes a bridge pull its DIAG line low if `low` is true, like a bridge that has switched itself off. Otherwise
    /// the bridge releases the line.
    pub fn pull_diag(&mut self, motor: usize, low: bool) {
        self.drive_pin((wiring::PWM_PORT, wiring::DIAG_PINS[motor]), low.then_some(false));
    }

    /// Connects a digital pin, 0 to 7, to ground or to the supply, or to nothing.
    pub fn connect_pin(&mut self, pin: usize, level: Option<bool>) {
        self.drive_pin(wiring::DIGITAL[pin], level);
    }

    /// Connects digital pins 0 and 1 to each other, from now on.
    pub fn wire_pins(&mut self) {
        self.post(|surroundings, session, _| {
            surroundings.wired = true;
            surroundings.follow_wire(session, surroundings.now);
        });
    }

    /// Returns the level of a digital pin, 0 to 7: true if it is high.
    pub fn pin_level(&mut self, pin: usize) -> bool {
        self.at_stop(move |_, session, _| session.board_mut().is_high(wiring::DIGITAL[pin]))
    }

    /// Sets the external torque on an output shaft from now on, N m, positive CW.
    pub fn set_torque(&mut self, motor: usize, torque: f64) {
        self.post(move |surroundings, _, _| surroundings.shafts.set_torque(motor, surroundings.now, torque));
    }

    /// Sets the open-circuit voltage of the battery in V, from the next millisecond on.
    pub fn set_battery(&mut self, volts: f64) {
        self.post(move |surroundings, _, _| surroundings.shafts.battery.emf = Volts(volts));
    }

    /// Sets the chip's supply voltage from now on, in millivolts.
    pub fn set_rail(&mut self, millivolts: u32) {
        self.post(move |surroundings, session, _| {
            let at = surroundings.now;
            session.board_mut().chip.set_rail(VirtualNanos(at), millivolts);
            surroundings.follow_pins(session, at, false);
        });
    }

    /// If `gone` is true, the reader of the log switches the log to "wait while the buffer is full", as probe-rs does,
    /// and then reads nothing. Otherwise the reader reads again.
    pub fn set_log_abandoned(&mut self, gone: bool) {
        self.post(move |surroundings, _, _| surroundings.rtt.gone = gone);
    }

    /// Sets the faults of the chip from now on.
    pub fn set_chip_faults(&mut self, faults: ChipFaults) {
        self.post(move |_, session, _| *session.board_mut().chip.faults() = faults);
    }

    /// Sets the revision of an STM32H743, by its REV_ID. The chip has revision V otherwise.
    pub fn set_revision(&mut self, revision: u16) {
        self.on_h743(move |chip, now| chip.set_revision(VirtualNanos(now), revision));
    }

    /// Sets the faults of the flash from now on.
    pub fn set_flash_faults(&mut self, faults: FlashFaults) {
        self.on_h743(move |chip, _| chip.flash.faults = faults);
    }

    /// Makes the flash stay busy until the chip is reset.
    pub fn hold_flash(&mut self) {
        self.on_h743(|chip, _| chip.flash.never_ends = true);
    }

    /// Runs a function with the chip and the present virtual time in ns. Panics on another chip than the H743.
    fn on_h743(&mut self, act: impl FnOnce(&mut H743, u64) + Send + 'static) {
        self.at_stop(move |surroundings, session, _| {
            act(session.board_mut().chip.h743().expect("only the H743 has this"), surroundings.now);
        });
    }

    /// Makes the core's next access to this range fail with a bus error.
    pub fn fail_next_access(&mut self, addresses: std::ops::Range<u64>) {
        self.post(move |_, session, _| session.fail_next(addresses.start, addresses.end));
    }

    /// Pulls the reset pin at a later time.
    pub fn pull_reset(&mut self, at: Duration) {
        let at = nanos(at);
        self.post(move |surroundings, _, _| {
            surroundings.plan(at, |surroundings, session, host| {
                session.reset_by_pin(VirtualNanos(surroundings.now), surroundings.instructions, host);
            });
        });
    }

    /// Makes the core lock up. Its next access to this range fails with a bus error. The first access of the fault handler, which
    /// reads whether TIM1 has a clock, fails too.
    pub fn lock_up(&mut self, addresses: std::ops::Range<u64>) {
        let clocks = wiring::pwm_clock_at(self.board);
        self.fail_next_access(addresses);
        self.fail_next_access(clocks..clocks + 4);
    }

    /// Makes a task run faulty code when it is next polled: changes the address of the task's function in the executor's memory.
    pub fn divert(&mut self, task: &str, code: FaultyCode) {
        let pool = self.address(&format!("::{task}::POOL"));
        let pool = self.symbols.iter().find(|symbol| symbol.address == pool).expect("a symbol").clone();
        // Addresses of functions have the Thumb bit set.
        let poll = self.address(&format!("TaskStorage..{task}_task..::poll")) as u32 | 1;
        let to = code.address() | 1;
        self.at_stop(move |_, _, host| {
            let mut found = false;
            for at in (pool.address..pool.address + pool.size).step_by(4) {
                if host.read(at, Width::W32).expect("memory") as u32 == poll {
                    host.write(at, Width::W32, to).expect("memory");
                    found = true;
                }
            }
            assert!(found, "the task has not been spawned");
        });
    }
}
