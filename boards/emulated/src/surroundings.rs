//! Connects the chip to what surrounds it: its pins to the plants, the plants to the encoder lines, the battery to the
//! converter, the button, the serial lines, and the log. [`Surroundings`] is the *driver* of the emulator. The emulator
//! calls its driver when the chip writes a register, and at the times that the driver asks for.

use std::collections::VecDeque;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use rigless::device::Level;
use rigless::emulator::{Access, AccessKind, Driver, Hit, Host, Settled, Stop};
use rigless::mcu::Operate;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::st::tim::Channel;
use rigless::time::VirtualNanos;
use simulated::current_line::CurrentLine;
use simulated::encoder::{Disturbances, Encoder, Wire};

use crate::board::Board;
use crate::bridge_lines::{Lines, Transition};
use crate::chip::Nucleo;
use crate::pwm::Timer;
use crate::rtt::Rtt;
use crate::serial::Terminal;
use crate::shafts::Shafts;
use crate::wiring;

/// Connection of an encoder, the time since which it exists (ns), and the wire that is disturbed at present.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Connection {
    encoder: Encoder,
    since: u64,
    disturbed: Option<Wire>,
}

/// A function that runs while the chip is stopped.
pub(crate) type BenchTask = Box<dyn FnOnce(&mut Surroundings, &mut Session<Nucleo>, &mut dyn Host) + Send>;

/// Everything that is connected to the chip.
pub(crate) struct Surroundings {
    board: Board,
    pub(crate) shafts: Shafts,
    /// Lines of all bridges, and their changes so far.
    pub(crate) lines: [Lines; wiring::BRIDGES],
    pub(crate) transitions: Vec<Transition>,
    encoders: Vec<Connection>,
    /// Current-sense lines in the order of the motors.
    pub(crate) current_lines: Vec<CurrentLine>,
    pub(crate) rtt: Rtt,
    /// True if a transceiver connects the chip to the chain line.
    pub(crate) transceiver: bool,
    /// Times in ns at which the transceiver was switched to sending (true) or receiving. Only the F427 shows them.
    pub(crate) directions: Vec<(u64, bool)>,
    /// True if digital pins 0 and 1 are connected to each other.
    pub(crate) wired: bool,
    /// An I2C bus whose SDA a device holds low, the clocks after which the device releases SDA, and the level of SCL.
    pub(crate) stuck: Option<(usize, u8, bool)>,
    /// Executions of watched instructions.
    pub(crate) hits: Vec<Hit>,
    pub(crate) now: u64,
    pub(crate) instructions: u64,
    pub(crate) timer: Timer,
    resets: usize,
    /// Time in ns before which the log is not read, because the start-up code has not initialised its ring yet.
    quiet_until: u64,
    /// Time up to which the chip runs before the next command of the bench, ns.
    pub(crate) target: u64,
    commands: Receiver<BenchTask>,
    /// Functions that run at a later time, in the order of their times in ns.
    pub(crate) planned: VecDeque<(u64, BenchTask)>,
}

/// Time from a reset until the start-up code has initialised the log's ring, ns.
const START_UP: u64 = 500_000;

impl Surroundings {
    pub(crate) fn new(board: Board, shafts: Shafts, rtt: Option<u64>, commands: Receiver<BenchTask>) -> Self {
        Self {
            board,
            encoders: vec![Connection::default(); shafts.len()],
            current_lines: vec![CurrentLine::Sound; shafts.len()],
            shafts,
            lines: [Lines::FLOATING; wiring::BRIDGES],
            transitions: Vec::new(),
            rtt: Rtt::new(rtt),
            transceiver: false,
            directions: Vec::new(),
            wired: false,
            stuck: None,
            hits: Vec::new(),
            now: 0,
            instructions: 0,
            timer: Timer::default(),
            resets: 0,
            quiet_until: START_UP,
            target: 0,
            commands,
            planned: VecDeque::new(),
        }
    }

    /// Plans a function for a later time, ns.
    pub(crate) fn plan(
        &mut self,
        at: u64,
        task: impl FnOnce(&mut Self, &mut Session<Nucleo>, &mut dyn Host) + Send + 'static,
    ) {
        let place = self.planned.partition_point(|&(other, _)| other <= at);
        self.planned.insert(place, (at, Box::new(task)));
    }

    /// Returns the next time at which something must be done, ns.
    fn next_instant(&self) -> u64 {
        let mut next = self.target.min(self.shafts.cell_end);
        for at in [self.shafts.next_edge(), self.timer.update_at, self.planned.front().map(|&(at, _)| at)] {
            next = next.min(at.unwrap_or(u64::MAX));
        }
        next
    }

    /// Updates the bridges after the chip may have changed its pins at the time `at`, ns.
    pub(crate) fn follow_pins(&mut self, session: &mut Session<Nucleo>, at: u64, by_reset: bool) {
        let board = session.board_mut();
        let [pwm, direction] = [wiring::PWM_PORT, wiring::LINE_PORT].map(|port| board.port(port));
        let registers = board.pwm();
        for bridge in 0..wiring::BRIDGES {
            let mut lines = Lines::FLOATING;
            if pwm.is_function(wiring::PWM_PINS[bridge]) {
                lines.pwm = self.timer.output(bridge, &registers);
            }
            let (ina, inb) = wiring::LINE_PINS[bridge];
            [lines.ina, lines.inb] = [ina, inb].map(|line| direction.drives(line) == Some(true));
            let old = std::mem::replace(&mut self.lines[bridge], lines);
            if old == lines {
                continue;
            }
            let (at_time, motor) = (Duration::from_nanos(at), bridge);
            self.transitions.push(Transition { at: at_time, motor, old, lines, by_reset });
            if bridge < self.shafts.len() {
                self.shafts.command(bridge, at, lines);
            }
        }
    }

    /// Updates the PWM timer and the bridges after the chip has written a register of the timer.
    fn timer_written(&mut self, session: &mut Session<Nucleo>, at: u64, access: &Access) {
        let board = session.board_mut();
        let (registers, hz) = (board.pwm(), board.chip.pwm_hz());
        let update = access.address == wiring::PWM_TIMER + wiring::EGR && access.value & 1 != 0;
        let before = self.timer.running;
        self.timer.written(at, update, &registers, hz);
        if let Some(grid) = self.timer.running
            && before != Some(grid)
        {
            self.shafts.set_grid(at, grid);
        }
        self.follow_pins(session, at, false);
    }

    /// Drives the encoder lines for all edges up to the time `at`, ns.
    fn show_edges(&mut self, session: &mut Session<Nucleo>, at: u64) {
        while let Some(motor) = self.shafts.take_edge(at) {
            self.show(session, motor, at);
        }
    }

    /// Drives the encoder lines of one motor to where its shaft is.
    fn show(&self, session: &mut Session<Nucleo>, motor: usize, at: u64) {
        let Connection { encoder, disturbed, .. } = self.encoders[motor];
        let [a, b] = encoder.levels(self.shafts.shown(motor), disturbed);
        for (channel, high) in [(1, a), (2, b)] {
            let (channel, level) = (Channel::new(channel).expect("1 or 2"), Level::from(high));
            session.board_mut().chip.drive_encoder(VirtualNanos(at), motor, channel, level);
        }
    }

    /// Connects an encoder differently, from now on.
    pub(crate) fn connect(&mut self, session: &mut Session<Nucleo>, motor: usize, encoder: Encoder) {
        let since = self.now;
        self.encoders[motor] = Connection { encoder, since, disturbed: None };
        self.show(session, motor, since);
        self.plan_disturbance(motor, since, encoder.disturbances(motor as u64));
    }

    /// Plans the next disturbance of an encoder whose connection exists since the time `since`, ns.
    fn plan_disturbance(&mut self, motor: usize, since: u64, mut rest: Disturbances) {
        let Some((after, wire)) = rest.next() else { return };
        self.plan(since + after, move |surroundings, session, _| {
            // The encoder may have been connected differently meanwhile.
            if surroundings.encoders[motor].since == since {
                surroundings.encoders[motor].disturbed = wire;
                surroundings.show(session, motor, surroundings.now);
                surroundings.plan_disturbance(motor, since, rest);
            }
        });
    }

    /// Notes a change of the transceiver's direction.
    fn follow_transceiver(&mut self, session: &mut Session<Nucleo>, at: u64) {
        let (port, pin) = wiring::CHAIN_DIRECTION;
        let sends = session.board_mut().port(port).drives(pin) == Some(true);
        if self.directions.last().is_some_and(|&(_, sent)| sent) != sends {
            self.directions.push((at, sends));
        }
    }

    /// Puts the level of each end of the wire between digital pins 0 and 1 on the other end.
    pub(crate) fn follow_wire(&self, session: &mut Session<Nucleo>, at: u64) {
        if !self.wired {
            return;
        }
        let [first, second, ..] = wiring::DIGITAL;
        let board = session.board_mut();
        for (from, to) in [(first, second), (second, first)] {
            let level = board.port(from.0).drives(from.1);
            board.drive_pin(at, to, level);
        }
    }

    /// Counts a pulse on SCL of the bus whose SDA is held low, and releases SDA after the last one.
    fn follow_clock(&mut self, session: &mut Session<Nucleo>) {
        let Some((bus, clocks, was_high)) = self.stuck else { return };
        let (port, pin) = wiring::BUSES[bus][0];
        let high = session.board_mut().port(port).drives(pin) != Some(false);
        let left = clocks.saturating_sub((high && !was_high).into());
        self.stuck = Some((bus, left, high));
        if left == 0 {
            self.stuck = None;
            self.hold_line(session, bus, 1, false);
        }
    }

    /// Puts the battery's voltage and the voltages of the current-sense lines on the converters' pins. A pin without a current-sense
    /// line has 0 V. An open battery pin keeps its voltage.
    fn show_voltages(&self, session: &mut Session<Nucleo>) {
        let chip = &mut session.board_mut().chip;
        if !chip.faults().battery_open {
            let millivolts = self.shafts.voltage * 1000.0 * wiring::DIVIDER;
            chip.set_input(wiring::battery(self.board), millivolts.round() as u32);
        }
        let lines = self.current_lines.iter().zip(wiring::currents(self.board));
        for (motor, (line, pin)) in lines.enumerate() {
            let volts = line.volts(self.shafts.sensed(motor)).unwrap_or(0.0);
            chip.set_input(pin, (1e3 * volts).round() as u32);
        }
    }

    /// Updates what follows the chip's outputs after a reset. The levels on the chip's inputs stay.
    fn after_reset(&mut self, session: &mut Session<Nucleo>, at: u64) {
        self.timer = Timer::default();
        self.follow_pins(session, at, true);
        session.board_mut().chip.follow_detector(VirtualNanos(at));
        self.rtt.reset();
        self.quiet_until = at + START_UP;
        self.follow_wire(session, at);
        self.follow_transceiver(session, at);
        for motor in 0..self.shafts.len() {
            self.show(session, motor, at);
        }
    }

    fn look_for_reset(&mut self, session: &mut Session<Nucleo>) {
        let resets = session.resets();
        if resets.len() > self.resets {
            self.resets = resets.len();
            let at = resets.last().map_or(self.now, |reset| reset.at.0);
            self.after_reset(session, at);
        }
    }

    /// Does everything whose time has come.
    fn catch_up(&mut self, session: &mut Session<Nucleo>, host: &mut dyn Host) {
        let now = self.now;
        self.show_edges(session, now);
        if self.timer.update_at.is_some_and(|at| at <= now) {
            let board = session.board_mut();
            let (registers, hz) = (board.pwm(), board.chip.pwm_hz());
            self.timer.update(now, &registers, hz);
            self.follow_pins(session, now, false);
        }
        while self.shafts.cell_end <= now {
            self.shafts.next_cell();
            self.show_voltages(session);
            if now >= self.quiet_until {
                self.rtt.drain(now, host).expect("the log's ring is in memory");
            }
        }
        self.show_edges(session, now);
        while self.planned.front().is_some_and(|&(at, _)| at <= now) {
            if let Some((_, task)) = self.planned.pop_front() {
                task(self, session, host);
            }
        }
    }
}

impl Driver<Nucleo> for Surroundings {
    fn on_settled(&mut self, session: &mut Session<Nucleo>, _host: &mut dyn Host, settled: Settled) {
        match settled {
            Settled::Access { access, .. } if access.kind == AccessKind::Write => {
                let at = access.virtual_time.0;
                let block = access.address & !0x3FF;
                let is_port = |port| block == wiring::port_at(self.board, port);
                if block == wiring::PWM_TIMER {
                    self.now = at;
                    self.show_edges(session, at);
                    self.timer_written(session, at, &access);
                } else if is_port(wiring::LINE_PORT) || is_port(wiring::PWM_PORT) {
                    self.now = at;
                    self.show_edges(session, at);
                    self.follow_pins(session, at, false);
                } else if self.stuck.is_some_and(|(bus, ..)| is_port(wiring::BUSES[bus][0].0)) {
                    self.now = at;
                    self.follow_clock(session);
                    // The port of the bus may also have the digital pins.
                    self.follow_wire(session, at);
                } else if self.transceiver && is_port(wiring::CHAIN_DIRECTION.0) {
                    self.follow_transceiver(session, at);
                } else if is_port(wiring::DIGITAL[0].0) {
                    self.follow_wire(session, at);
                } else if access.address == wiring::power_at(self.board) {
                    session.board_mut().chip.follow_detector(access.virtual_time);
                } else if access.address == wiring::TIME_DRIVER + wiring::EGR && access.value & 1 != 0 {
                    // On a software update of a stopped timer the emulator also sets the compare flags, which the chip
                    // does not do. Embassy's time driver would take CC1IF for the end of half a period.
                    let sr = wiring::TIME_DRIVER + wiring::SR;
                    session
                        .mcu()
                        .write(access.virtual_time, sr, Width::W32, 0xFFFF_FFE1)
                        .expect("a status register");
                } else {
                    return;
                }
                session.run_until(VirtualNanos(self.next_instant().max(at + 1)));
            }
            Settled::Stop(stop) => {
                self.now = stop.at.0;
                self.instructions = stop.instruction_count;
                self.look_for_reset(session);
            }
            Settled::Hit(hit) => self.hits.push(hit),
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Nucleo>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        self.now = stop.at.0;
        self.instructions = stop.instruction_count;
        self.look_for_reset(session);
        self.catch_up(session, host);
        while self.now >= self.target {
            // The run ends when the bench is gone.
            let task = self.commands.recv().ok()?;
            task(self, session, host);
        }
        Some(VirtualNanos(self.next_instant().max(self.now + 1)))
    }
}

/// Returns the far end of a serial line.
pub(crate) fn terminal(session: &mut Session<Nucleo>, line: usize) -> &mut Terminal {
    session.board_mut().chip.terminal(line).expect("the terminal is attached")
}
