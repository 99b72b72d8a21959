//! The hub's side of both protocols: REV's protocol and the extension. A [`Responder`] keeps what hosts have set,
//! answers requests, and produces the commands to the motors.
//!
//! Programs that were written for a REV Expansion Hub can drive the motors of this hub. Where published host software
//! leaves a behaviour open, the documentation of the function states what this hub does.
//!
//! ```text
//!              Packet +-----------+ Packet
//! protocol ---------> | Responder | ---------> protocol
//! control --Snapshot->|           | --hub::Command--> control
//!                     +-----------+ --Colour--> status LED
//! ```
//!
//! * A *channel* holds the settings, the targets and the pending commands of one motor.
//! * A request that is refused changes neither settings nor motion.
//! * A motor is *enabled* by a valid *set enable* only. *Set enable* is refused while the battery is low or unknown,
//!   and while stored settings are being loaded. Motors that were enabled before continue to run within the limits of
//!   the supply.
//! * *Fail-safe* disables all motors and releases all outputs. Fail-safe begins when a host requests fail-safe, or 2.5
//!   s after the last packet for this hub. If a host has requested fail-safe, all motors coast. If the time has run
//!   out, each motor coasts or brakes according to its setting `on_fault`.
//!
//! The responder has no clock, no await and no hardware. `tasks::responder` is the task that calls the responder.
//!
//! ```
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::extension::Request;
//! use motor_hub::protocol::requests::{DISCOVERY, Standard};
//! use motor_hub::protocol::{Address, BROADCAST};
//! use motor_hub::responder::Responder;
//! use motor_hub::braking::Winding;
//! use motor_hub::units::Micros;
//!
//! // A hub with two motors at address 2, before its first control tick.
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut responder = Responder::new(Address::DEFAULT, [settings; 2]);
//! let snapshot = Snapshot::INITIAL;
//!
//! // A host looks for hubs. The hub answers that it is connected to the host directly.
//! let discovery = Request::from(Standard::Discovery).packet(BROADCAST, 1, DISCOVERY);
//! let reply = responder.receive(&discovery, Micros::new(0), &snapshot).unwrap();
//! assert_eq!((reply.source, reply.payload.as_slice()), (2, &[1][..]));
//! ```

mod base;
pub mod button;
mod converter;
mod group;
pub mod i2c;
pub mod keep_alive;
mod led;
mod motor;
pub mod outputs;
mod report;
mod store;
mod update;

use crate::chain::Chain;
use crate::devices::{AnalogReadings, I2C_BUSES};
use crate::extension::record::{Entries, Ticks};
use crate::extension::report::{BusReport, Commands, HubReport};
use crate::extension::settings::Values;
use crate::extension::{self, HubFunction, MotorFunction, Request};
use crate::group::{BaseSettings, GroupCommand};
use crate::hub::{Command, Snapshot};
use crate::motor::{Report, Settings};
use crate::protocol::answers::{Bulk, Status, Version};
use crate::protocol::motor::ToMotor;
use crate::protocol::payload::{Payload, Text, byte};
use crate::protocol::pins::ToPin;
use crate::protocol::requests::{
    DISCOVERY, FAIL_SAFE, InterfaceName, MOTOR_FUNCTIONS, MOTOR_INTERFACE, Standard, ToHub,
};
use crate::protocol::{Address, BROADCAST, CHANNELS, Colour, HOST, Nack, Packet, Reply};
use crate::record::Record;
use crate::supply::BusReading;
use crate::units::{CountsPerSecond, Microjoules, Micros, Milliamperes, Share};
use crate::update::Update;
use i2c::Transfers;
use keep_alive::KeepAlive;
use led::Led;
use motor::MotorChannel;
use outputs::Outputs;
use store::{Access, Memory};

/// The version text. It begins with the versions of REV's hardware and firmware that the hub is compatible with. Hosts
/// derive the available functions from these versions. The version of this firmware follows.
const VERSION_TEXT: &[u8] =
    without_zero(concat!("HW: 20, Maj: 1, Min: 8, Eng: 2, mh", env!("CARGO_PKG_VERSION"), "\0").as_bytes());
const _: () = assert!(VERSION_TEXT.len() <= LONGEST_VERSION);

/// Returns a text without the zero at its end. The zero marks the end of the version text in a firmware image, where
/// programs search for the text.
const fn without_zero(text: &[u8]) -> &[u8] {
    match text.split_last() {
        Some((_, text)) => text,
        None => text,
    }
}

/// Longest version text in bytes that REV's host software reads.
const LONGEST_VERSION: usize = 39;

/// The same versions of REV's hardware and firmware as in [`VERSION_TEXT`], and REV's number for its Expansion Hub.
const VERSION: Version = Version {
    engineering: 2,
    minor: 8,
    major: 1,
    hardware_minor: 0,
    hardware_major: 2,
    hardware: 0x0031_1153,
};

/// The refusal of a request to a motor that the hub does not have.
const NO_MOTOR: Nack = Nack::parameter(0);

/// The line that a packet arrived on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// The line to the host.
    Host,
    /// The line between the hubs of a chain.
    Chain,
}

/// State of the hub's side of the protocols, for a hub with N motors.
#[derive(Clone, Debug)]
pub struct Responder<const N: usize> {
    /// Address in force.
    address: Address,
    /// Message number of the last reply; 0 before the first reply.
    number: u8,
    keep_alive: KeepAlive,
    channels: [MotorChannel; N],
    /// Address that the firmware was built with. A stored address replaces it.
    factory_address: Address,
    /// Settings that the firmware was built with. Stored settings replace these settings.
    factory: [Settings; N],
    /// True if the board has a memory for settings, whose task will report the contents.
    expects_store: bool,
    /// The memory for settings. `None` until its task has reported the contents, and on a board without a memory.
    memory: Option<Memory>,
    /// True if the address in force must still be stored.
    address_due: bool,
    /// The firmware update. `None` on a board without a bootloader.
    update: Option<Update>,
    /// Version of the new firmware that a host has announced last. Empty before the first announcement.
    announced_version: Text,
    /// The hubs behind this hub, at the parent's end of the chain line. `None` on a board without a chain line.
    pub chain: Option<Chain>,
    /// Courses of groups that must still be sent. No motor is a member of two of them, so N elements are enough.
    courses: [Option<GroupCommand>; N],
    /// The newest configuration of the drive base. `None` until a host configures the base.
    base: Option<BaseSettings>,
    /// True if the configuration of the base must still be sent to control.
    base_due: bool,
    /// Number of the command that configures the base. `None` once a snapshot includes the command.
    base_awaited: Option<u32>,
    /// Number of the newest sent command. `None` before the first command, and once a snapshot includes the command.
    awaited: Option<u32>,
    /// Digital pins, servo outputs, and what the board has besides motors. A new responder has no equipment, and
    /// refuses requests to pins, outputs, analog inputs and I2C buses.
    pub outputs: Outputs,
    /// The newest readings of the board's converters.
    pub readings: AnalogReadings,
    /// The I2C buses, with the transfers for their tasks.
    pub i2c: [Transfers; I2C_BUSES],
    /// The newest reading of the bus that battery and bridges share.
    pub bus: BusReading,
    led: Led,
    phone_charge: bool,
    ftdi_reset: bool,
}

impl<const N: usize> Responder<N> {
    /// Creates the state after a reset. `settings` are the settings that the firmware was built with.
    pub fn new(address: Address, settings: [Settings; N]) -> Self {
        Self {
            address,
            number: 0,
            keep_alive: KeepAlive::new(),
            channels: settings.map(MotorChannel::new),
            factory_address: address,
            factory: settings,
            expects_store: false,
            memory: None,
            address_due: false,
            update: None,
            announced_version: Text::new(),
            chain: None,
            courses: [None; N],
            base: None,
            base_due: false,
            base_awaited: None,
            awaited: None,
            outputs: Outputs::default(),
            readings: AnalogReadings::default(),
            i2c: Default::default(),
            bus: BusReading::INITIAL,
            led: Led::default(),
            phone_charge: false,
            ftdi_reset: false,
        }
    }

    /// Returns the state with a chain line.
    #[must_use]
    pub fn with_chain(mut self) -> Self {
        self.chain = Some(Chain::default());
        self
    }

    /// Takes a packet from the chain line that is not a request to this hub. Returns the packet if the hub must pass it
    /// on to the host.
    pub fn pass_to_host(&mut self, packet: Packet) -> Option<Packet> {
        self.chain.as_mut()?.receive(packet, self.address)
    }

    /// Returns the address in force.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// Returns for each motor whether it is enabled.
    pub fn enabled(&self) -> [bool; N] {
        self.channels.each_ref().map(MotorChannel::enabled)
    }

    /// True while the board's button may drive motors: no packet for this hub and no fail-safe to all hubs has arrived
    /// since reset, and the hub does not wait for stored settings. While the hub waits, the memory may be erased, and
    /// no motor may run.
    pub const fn permits_button(&self) -> bool {
        !self.keep_alive.has_received_packet() && !self.awaits_store()
    }

    /// Returns the number of an I2C bus if the answer to a packet depends on the running transfer of the bus. `None`
    /// for all other packets.
    pub fn awaited_transfer(&self, packet: &Packet) -> Option<usize> {
        if packet.destination != self.address.get() || !self.i2c.iter().any(Transfers::is_running) {
            return None;
        }
        let Ok(Request::ToPin(request)) = Request::read(packet, N.min(CHANNELS)) else { return None };
        let sets_speed = matches!(request, ToPin::SetI2cSpeed { .. } | ToPin::I2cSpeed { .. });
        let bus = usize::from(i2c::bus_of(&request).filter(|_| !sets_speed)?.get());
        self.i2c.get(bus).filter(|transfers| transfers.is_running()).map(|_| bus)
    }

    /// Returns the colour of the status LED.
    pub fn led(&self, now: Micros) -> Colour {
        self.led.at(now, &self.keep_alive)
    }

    /// Returns the time at which the keep-alive timer runs out, when [`tick`](Self::tick) must be called. `None` if the
    /// timer does not run.
    pub const fn deadline(&self) -> Option<Micros> {
        self.keep_alive.deadline()
    }

    /// Updates battery state and keep-alive timer, and ends the wait for commands that the snapshot includes. When the
    /// timer runs out, the hub goes to fail-safe. A low battery disables all servo outputs.
    pub fn tick(&mut self, now: Micros, snapshot: &Snapshot<N>) {
        // While the voltage is unknown, such as below 5 V, a low battery stays low.
        if snapshot.battery.is_some() {
            self.keep_alive.battery(snapshot.battery_low());
        }
        self.awaited.take_if(|number| snapshot.includes(*number));
        self.channels.iter_mut().for_each(|channel| channel.note_snapshot(snapshot.newest_command));
        self.base_awaited.take_if(|number| snapshot.includes(*number));
        if self.keep_alive.ran_out(now) {
            self.channels.iter_mut().for_each(MotorChannel::fail_safe);
            self.release_groups_and_outputs();
        }
        if snapshot.battery_low() {
            self.outputs.disable_servos();
        }
    }

    /// Executes the request of a host's packet and returns the reply. Returns `None` for a packet that is not for this
    /// hub.
    ///
    /// A packet is for this hub if it has the hub's address, or if it is a discovery or a fail-safe to all hubs. A
    /// packet for this hub restarts the keep-alive timer, also if the hub refuses the request. On a hub with a chain
    /// line, packets to other addresses, discoveries, and fail-safes to all hubs go to the hubs behind this hub too.
    pub fn receive(&mut self, packet: &Packet, now: Micros, snapshot: &Snapshot<N>) -> Option<Packet> {
        self.receive_with(packet, Line::Host, now, snapshot, None)
    }

    /// Executes a request from either line, on a hub that may have a record of faults. Packets from the host's line are
    /// processed as by [`receive`](Self::receive).
    ///
    /// On the chain line, only the host's packets with the hub's own address are answered and restart the keep-alive
    /// timer. A fail-safe to all hubs is executed, but not answered.
    pub fn receive_with(
        &mut self,
        packet: &Packet,
        from: Line,
        now: Micros,
        snapshot: &Snapshot<N>,
        record: Option<&mut Record<'_>>,
    ) -> Option<Packet> {
        self.tick(now, snapshot);
        let address = self.address.get();
        let to_all = packet.destination == BROADCAST;
        let (stop, discovery) = (to_all && packet.id == FAIL_SAFE, to_all && packet.id == DISCOVERY);
        if from == Line::Chain {
            if stop {
                self.disable();
                self.keep_alive.fail_safe(now);
            }
            // If several children answered a packet to all hubs, their answers would collide. A packet from another hub
            // is an answer. If hubs answered answers, they would never stop.
            if packet.destination != address || packet.source != HOST {
                return None;
            }
        } else if packet.destination != address {
            match &mut self.chain {
                Some(chain) if discovery => chain.discover(packet),
                Some(chain) if stop => chain.stop(packet.clone()),
                Some(chain) if !to_all => chain.request(packet.clone()),
                _ => (),
            }
            if !discovery && !stop {
                return None;
            }
        }
        self.keep_alive.packet(now);
        let answer = Request::read(packet, N.min(CHANNELS))
            .and_then(|request| self.answer(request, from, now, snapshot, record));
        self.delete_courses(self.channels.each_ref().map(|channel| !channel.in_group()));
        let mut reply = answer.unwrap_or_else(Reply::Nack);
        if let Reply::Ack { attention } = &mut reply {
            *attention = self.keep_alive.attention();
        }
        self.number = self.number.checked_add(1).unwrap_or(1);
        // If the request has changed the address, the reply still has the old address.
        Some(reply.packet(packet, address, self.number))
    }

    /// Returns the next command to the motors. `None` if no command is pending. After sending the command, call
    /// [`sent`](Self::sent).
    ///
    /// Commands that disable motors come first, courses of groups last. A drive base is configured before courses are
    /// sent.
    pub fn pending(&self) -> Option<Command> {
        if let Some(motor) = self.next_channel() {
            return self.channels.get(motor)?.pending(motor);
        }
        if self.base_due {
            return Some(Command::SetBase(self.base));
        }
        self.courses.iter().flatten().next().map(|course| Command::MoveGroup(*course))
    }

    /// Removes the command that [`pending`](Self::pending) returns, because it was sent. `number` is the number of the
    /// command as in [`Snapshot::newest_command`].
    pub fn sent(&mut self, number: u32) {
        self.awaited = Some(number);
        if let Some(channel) = self.next_channel().and_then(|motor| self.channels.get_mut(motor)) {
            channel.sent(number);
        } else if self.base_due {
            (self.base_due, self.base_awaited) = (false, Some(number));
        } else if let Some(command) = self.courses.iter_mut().find_map(Option::take) {
            for (channel, member) in self.channels.iter_mut().zip(command.course.members()) {
                if member {
                    channel.course_sent(number);
                }
            }
        }
    }

    /// True until a snapshot includes the newest set-point of the motor and the newest course of its group.
    fn awaits_snapshot(&self, motor: usize) -> bool {
        let moves = |command: &GroupCommand| command.course.members().get(motor) == Some(&true);
        self.courses.iter().flatten().any(moves)
            || self.channels.get(motor).is_some_and(MotorChannel::awaits_snapshot)
    }

    /// Returns the number of the newest sent command. While a command is pending, returns this number plus 1, because
    /// no snapshot includes the pending command yet.
    fn newest_command(&self, snapshot: &Snapshot<N>) -> u32 {
        let sent = self.awaited.unwrap_or(snapshot.newest_command);
        if self.pending().is_some() { sent.wrapping_add(1) } else { sent }
    }

    /// Returns the motor whose command is the next to send.
    fn next_channel(&self) -> Option<usize> {
        let urgent = self.channels.iter().position(MotorChannel::urgent);
        urgent.or_else(|| self.channels.iter().position(MotorChannel::is_pending))
    }

    /// Disables all motors and outputs at a host's request.
    fn disable(&mut self) {
        self.channels.iter_mut().for_each(MotorChannel::disable);
        self.release_groups_and_outputs();
    }

    /// Deletes the pending courses of groups, and releases all outputs.
    fn release_groups_and_outputs(&mut self) {
        self.courses = [None; N];
        self.outputs.disable();
    }

    /// Executes a request, and returns the reply. The caller sets the flag `attention` of an acknowledgement.
    fn answer(
        &mut self,
        request: Request,
        from: Line,
        now: Micros,
        snapshot: &Snapshot<N>,
        record: Option<&mut Record<'_>>,
    ) -> Result<Reply, Nack> {
        match request {
            Request::Standard(request) => self.standard(request, from, now, snapshot),
            Request::ToHub(request) => self.hub(request, snapshot),
            Request::ToPin(request) => self.pin(&request, snapshot),
            Request::ToMotor(motor, request) => self.motor(motor, request, snapshot),
            Request::Set(motor, values) => {
                let channel = self.channels.get_mut(usize::from(motor)).ok_or(NO_MOTOR)?;
                channel.set(&values).map(|()| Reply::ACK)
            }
            Request::Get(motor, group) => {
                let channel = self.channels.get(usize::from(motor)).ok_or(NO_MOTOR)?;
                let mut payload = Payload::new();
                Values::of(group, channel.settings()).write(&mut payload);
                Ok(Reply::Data(payload))
            }
            Request::Motor(motor, function) => self.motor_function(motor, function, snapshot),
            Request::Hub(function) => self.hub_function(function, now, snapshot, record),
        }
    }

    fn motor_function(
        &mut self,
        motor: u8,
        function: MotorFunction,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        let index = usize::from(motor);
        let report = snapshot.motors.get(index).ok_or(NO_MOTOR)?;
        let channel = self.channels.get_mut(index).ok_or(NO_MOTOR)?;
        match function {
            MotorFunction::Identify { travel_limit } => {
                let travel = channel.identify(travel_limit, snapshot.good_battery(), report)?;
                Ok(Reply::data(&travel))
            }
            MotorFunction::Identification => Ok(Reply::data(&channel.identification(report))),
            MotorFunction::Condition => Ok(Reply::data(&report::condition(report))),
            MotorFunction::Move { wanted } => self.move_group(index, wanted, snapshot),
            MotorFunction::Group => self.group_state(index, snapshot),
            MotorFunction::Current { current_ma, speed_limit_cps } => {
                let speed_limit = CountsPerSecond::new(speed_limit_cps.into());
                channel.set_current(Milliamperes::new(current_ma), speed_limit)?;
                Ok(Reply::ACK)
            }
        }
    }

    fn hub_function(
        &mut self,
        function: HubFunction,
        now: Micros,
        snapshot: &Snapshot<N>,
        record: Option<&mut Record<'_>>,
    ) -> Result<Reply, Nack> {
        match function {
            HubFunction::Bus => Ok(Reply::data(&self.bus_report(now, snapshot))),
            HubFunction::Equipment => Ok(Reply::data(&self.outputs.equipment)),
            HubFunction::Report => Ok(Reply::data(&self.report(now, snapshot))),
            HubFunction::Chain => {
                self.chain.as_ref().map(|chain| Reply::data(&chain.report())).ok_or(Nack::UNSUPPORTED)
            }
            HubFunction::Stored => self.store_report().map(|report| Reply::data(&report)),
            HubFunction::Save => self.access_store(Access::SaveRequested, snapshot),
            HubFunction::Load => self.access_store(Access::LoadRequested, snapshot),
            HubFunction::Reset => self.access_store(Access::ResetRequested, snapshot),
            HubFunction::Entries { from, clear } => {
                let Some(record) = record else { return Ok(Reply::data(&Entries::default())) };
                let reply = Reply::data(&Entries::of(record, from));
                if clear {
                    record.clear();
                }
                Ok(reply)
            }
            HubFunction::Ticks { number, from } => {
                let ticks = record.and_then(|record| Ticks::of(record, number, from));
                ticks.map(|ticks| Reply::data(&ticks)).ok_or(Nack::parameter(0))
            }
            HubFunction::SetBase { base } => self.set_base(base),
            HubFunction::Base => self.base.map(|base| Reply::data(&base)).ok_or(Nack::NO_BASE),
            HubFunction::Odometry => self.odometry(snapshot).map(|report| Reply::data(&report)),
            function => self.receive_update(function, snapshot),
        }
    }

    fn standard(
        &mut self,
        request: Standard,
        from: Line,
        now: Micros,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        match request {
            // The hub sends no debug messages.
            Standard::KeepAlive | Standard::DebugLevel { .. } => (),
            // By this flag a host finds out whether it is connected to this hub, or to the parent of a chain.
            Standard::Discovery => return Ok(Reply::data(&(from == Line::Host))),
            Standard::FailSafe => {
                self.disable();
                self.keep_alive.fail_safe(now);
            }
            Standard::SetAddress { address } => {
                self.address = address;
                self.store_address();
            }
            Standard::SetLedColour { colour } => self.led.set_colour(colour),
            Standard::SetLedPattern { pattern } => self.led.set_pattern(pattern, now),
            Standard::Status { clear } => {
                let motor_alerts = self.motor_alerts(snapshot);
                let reply = Reply::data(&Status { status: self.keep_alive.status(), motor_alerts });
                if clear {
                    self.keep_alive.clear();
                }
                return Ok(reply);
            }
            Standard::QueryInterface { name } => return interface(&name),
            Standard::LedColour => return Ok(Reply::data(&self.led.colour())),
            Standard::LedPattern => return Ok(Reply::data(self.led.pattern())),
        }
        Ok(Reply::ACK)
    }

    fn hub(&mut self, request: ToHub, snapshot: &Snapshot<N>) -> Result<Reply, Nack> {
        match request {
            ToHub::SetPhoneCharge { on } => self.phone_charge = on,
            ToHub::SetFtdiReset { on } => self.ftdi_reset = on,
            // The hub has no log.
            ToHub::LogHint { .. } => (),
            ToHub::Bulk => return Ok(Reply::data(&self.bulk(snapshot))),
            ToHub::Adc { channel, raw } => {
                return self.adc(channel, raw, snapshot).map(|value| Reply::data(&value));
            }
            ToHub::PhoneCharge => return Ok(Reply::data(&self.phone_charge)),
            ToHub::FtdiReset => return Ok(Reply::data(&self.ftdi_reset)),
            ToHub::VersionText => {
                return Ok(Reply::data(&Text::from_slice(VERSION_TEXT).unwrap_or_default()));
            }
            ToHub::Version => return Ok(Reply::data(&VERSION)),
        }
        Ok(Reply::ACK)
    }

    fn pin(&mut self, request: &ToPin, snapshot: &Snapshot<N>) -> Result<Reply, Nack> {
        match i2c::bus_of(request) {
            Some(bus) if bus.get() >= self.outputs.equipment.i2c => Err(Nack::UNSUPPORTED),
            Some(bus) => self.i2c.get_mut(usize::from(bus.get())).ok_or(Nack::parameter(0))?.receive(request),
            None => self.outputs.receive(request, snapshot.good_battery().is_some()),
        }
    }

    fn motor(&mut self, motor: u8, request: ToMotor, snapshot: &Snapshot<N>) -> Result<Reply, Nack> {
        let motor = usize::from(motor);
        let report = snapshot.motors.get(motor).ok_or(NO_MOTOR)?;
        if request == (ToMotor::SetEnable { on: true }) && self.is_loading() {
            return Err(Nack::STORE_BUSY);
        }
        let channel = self.channels.get_mut(motor).ok_or(NO_MOTOR)?;
        channel.receive(request, report, snapshot.good_battery().is_some())
    }

    fn bus_report(&self, now: Micros, snapshot: &Snapshot<N>) -> BusReport {
        let BusReading { measured, state, .. } = self.bus.as_of(now);
        let millijoules = |energy: Microjoules| u32::try_from(energy.get() / 1_000).unwrap_or(u32::MAX);
        BusReport {
            state,
            measured,
            dissipate: per_mille(snapshot.dissipate),
            returned_mj: millijoules(snapshot.returned),
            dissipated_mj: millijoules(snapshot.dissipated),
        }
    }

    fn report(&self, now: Micros, snapshot: &Snapshot<N>) -> HubReport {
        let battery = snapshot.battery;
        let motors = self.channels.iter().zip(&snapshot.motors).take(CHANNELS).enumerate();
        let motors = motors.map(|(motor, (channel, report))| {
            report::of_motor(channel, report, !self.awaits_snapshot(motor), battery)
        });
        HubReport {
            at_ms: (snapshot.at.get() / 1_000) as u32,
            battery,
            bus: self.bus.as_of(now).state,
            dissipate: per_mille(snapshot.dissipate),
            motors: motors.collect(),
            commands: Some(Commands {
                included: snapshot.newest_command,
                newest: self.newest_command(snapshot),
            }),
        }
    }

    /// Returns all values of REV's bulk input. An analog input that is not measured reads 0. Velocities are limited to
    /// 16 bits.
    fn bulk(&self, snapshot: &Snapshot<N>) -> Bulk {
        Bulk {
            digital: self.outputs.inputs(),
            encoders: self.of_motors(snapshot, MotorChannel::counts),
            over_current: self.of_motors(snapshot, MotorChannel::is_over_current),
            within_tolerance: self.of_motors(snapshot, MotorChannel::within_tolerance),
            velocities: self.of_motors(snapshot, |_, report| report.velocity.round_to_i16()),
            analog: self.analog_mv(),
            attention: Some(self.keep_alive.attention()),
        }
    }

    /// Returns the motor alerts of REV's module status. Bit i is set if the encoder of motor i gives no reading, or has
    /// a fault. Bit 4 + i is set if the bridge of motor i has switched itself off.
    fn motor_alerts(&self, snapshot: &Snapshot<N>) -> u8 {
        let lost = |_: &_, report: &Report| report.faults.encoder_stale || report.faults.encoder.is_some();
        let off = |_: &_, report: &Report| report.faults.bridge;
        byte(self.of_motors(snapshot, lost).into_iter().chain(self.of_motors(snapshot, off)))
    }

    /// Returns a value of each motor of REV's protocol. A motor that the hub does not have has the default value.
    fn of_motors<T: Copy + Default>(
        &self,
        snapshot: &Snapshot<N>,
        value: impl Fn(&MotorChannel, &Report) -> T,
    ) -> [T; CHANNELS] {
        let mut all = [T::default(); CHANNELS];
        for (slot, (channel, report)) in all.iter_mut().zip(self.channels.iter().zip(&snapshot.motors)) {
            *slot = value(channel, report);
        }
        all
    }
}

fn interface(name: &InterfaceName) -> Result<Reply, Nack> {
    match name.as_slice() {
        MOTOR_INTERFACE => Ok(Reply::data(&MOTOR_FUNCTIONS)),
        extension::INTERFACE => Ok(Reply::data(&extension::FUNCTIONS)),
        _ => Err(Nack::UNKNOWN),
    }
}

fn per_mille(share: Share) -> u16 {
    (1_000.0 * share.to_f32()) as u16
}
