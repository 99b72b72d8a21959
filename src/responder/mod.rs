//! The hub's end of the host's protocol: what it remembers and what it decides, so that host software
//! written for a REV Expansion Hub runs motors of this hub. Where the published facts leave a behaviour
//! open, the choice made is documented here.
//!
//! ```text
//!              Packet +-----------+ Packet
//! protocol ---------> | Responder | ---------> protocol
//! control --Snapshot->|           | --hub::Command--> control
//!                     +-----------+ --Colour--> status LED
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`Responder`] | all of these together: the hub as the host sees it |
//! | [`motor`] | what the hub remembers of one motor, and what that makes the motor do |
//! | [`adc`] | what the converter's channels are answered |
//! | [`alive`] | keep-alive timer, status word, attention |
//! | [`led`] | the status LED |
//! | [`button`] | what a button on the board may do until a host has spoken |
//! | [`pins`] | digital pins; PWM and servo outputs, which this hub only remembers |
//! | `store` | settings that outlast power: which, and when they are written |
//! | `update` | new firmware: what whoever has its slot is to do |
//!
//! While the battery is low ([`Snapshot::battery_low`]) motors cannot be enabled, and status word and LED say so;
//! those that run go on with what the supply allows.
//!
//! A refused command changes nothing. No packet enables a motor but a valid *set enable*. Pure: no clock,
//! no await, no hardware. `tasks::responder` is the shell.
//!
//! ```
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::protocol::requests::{DISCOVERY, Request, Standard};
//! use motor_hub::protocol::{Address, BROADCAST};
//! use motor_hub::responder::Responder;
//! use motor_hub::braking::Winding;
//! use motor_hub::units::Micros;
//!
//! // A hub with two motors at address 2, of which nothing is known yet.
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut responder = Responder::new(Address::DEFAULT, [settings; 2]);
//! let snapshot = Snapshot::INITIAL;
//!
//! // A host looks for hubs and is told that this is one, directly on its line.
//! let discovery = Request::from(Standard::Discovery).packet(BROADCAST, 1, DISCOVERY);
//! let reply = responder.receive(&discovery, Micros::new(0), &snapshot).unwrap();
//! assert_eq!((reply.source, reply.payload.as_slice()), (2, &[1][..]));
//! ```

pub mod adc;
pub mod alive;
mod answer;
pub mod button;
mod group;
pub mod led;
pub mod motor;
pub mod pins;
mod report;
pub mod setup;
mod store;
mod update;

pub use answer::Answer;

use crate::hub::{Action, Bus, Command, Snapshot};
use crate::motor::{Report, Setpoint, Settings};
use crate::protocol::answers::{Bulk, Status, Version};
use crate::protocol::bus::BusReport;
use crate::protocol::fields::Text;
use crate::protocol::group::{GroupMove, GroupState, ToGroup};
use crate::protocol::motor::ToMotor;
use crate::protocol::record::{Entries, Ticks, ToRecord};
use crate::protocol::report::{Commands, HubReport};
use crate::protocol::requests::{DISCOVERY, Request, Standard, ToHub};
use crate::protocol::{Address, BROADCAST, CHANNELS, Colour, Nack, Packet, Reply};
use crate::record::Record;
use crate::supply::Seen;
use crate::units::{Microjoules, Micros, Share};
use alive::Alive;
use group::Courses;
use led::Led;
use motor::MotorChannel;
use pins::{DigitalLines, PinMemory};
use store::Keeping;
use update::Updating;

/// What the version commands say: first the version of the interface, for hosts that read from these numbers what they may
/// ask for, and the hardware that they take it for; then this firmware's own.
const VERSION_TEXT: &[u8] =
    without_last(concat!("HW: 20, Maj: 1, Min: 8, Eng: 2, mh", env!("CARGO_PKG_VERSION"), "\0").as_bytes());
const _: () = assert!(VERSION_TEXT.len() <= LONGEST_VERSION);

/// In the image a zero ends it, by which a host finds it there.
const fn without_last(text: &[u8]) -> &[u8] {
    match text.split_last() {
        Some((_, text)) => text,
        None => text,
    }
}

/// Hosts have room for so many bytes.
const LONGEST_VERSION: usize = 39;

/// The same in numbers, with the type of hub whose interface this one offers.
const VERSION: Version = Version {
    engineering: 2,
    minor: 8,
    major: 1,
    hardware_minor: 0,
    hardware_major: 2,
    hardware: 0x0031_1153,
};

/// A request is to a motor that the hub does not have.
const NO_MOTOR: Nack = Nack::parameter(0);

/// Everything that the hub keeps for the host.
#[derive(Clone, Debug)]
pub struct Responder<const N: usize> {
    address: Address,
    /// Of the last reply.
    number: u8,
    alive: Alive,
    channels: [MotorChannel; N],
    /// What the hub has without what is stored.
    factory_address: Address,
    factory: [Settings; N],
    /// Something may have been set since power-on.
    changed: bool,
    /// Something does, and will say so.
    expects_store: bool,
    /// `None` where nothing outlasts power.
    keeping: Option<Keeping>,
    /// `None` without a bootloader.
    updating: Option<Updating>,
    courses: Courses<N>,
    /// Number of the newest command that was sent, while no snapshot includes that command.
    awaited: Option<u32>,
    pins: PinMemory,
    bus: Seen,
    led: Led,
    phone_charge: bool,
    ftdi_reset: bool,
}

impl<const N: usize> Responder<N> {
    /// After a reset. `settings` are those that the motors start with: the coefficients that a host
    /// reads before it has set any.
    pub fn new(address: Address, settings: [Settings; N]) -> Self {
        Self {
            address,
            number: 0,
            alive: Alive::new(),
            channels: settings.map(MotorChannel::new),
            factory_address: address,
            factory: settings,
            changed: false,
            expects_store: false,
            keeping: None,
            updating: None,
            courses: Courses::NONE,
            awaited: None,
            pins: PinMemory::default(),
            bus: Seen::NOTHING,
            led: Led::default(),
            phone_charge: false,
            ftdi_reset: false,
        }
    }

    /// The address in force.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// By motor: is it enabled?
    pub fn enabled(&self) -> [bool; N] {
        self.channels.each_ref().map(MotorChannel::enabled)
    }

    /// A host has spoken since reset.
    pub const fn host_spoke(&self) -> bool {
        self.alive.host_spoke()
    }

    /// What is to be done to digital pins.
    pub const fn digital_lines(&self) -> DigitalLines {
        self.pins.lines()
    }

    /// The levels of digital pins, as they are now: bit i is pin i. Until this is told they are all 1.
    pub const fn sense_pins(&mut self, levels: u8) {
        self.pins.sense(levels);
    }

    /// The bus, as it was seen last.
    pub const fn sense_bus(&mut self, seen: Seen) {
        self.bus = seen;
    }

    /// What the status LED shows.
    pub fn led(&self, now: Micros) -> Colour {
        self.led.at(now, self.alive.sign())
    }

    /// When [`tick`](Self::tick) has something to do, at the latest.
    pub const fn deadline(&self) -> Option<Micros> {
        self.alive.deadline()
    }

    /// Time passes. If the host has fallen silent, this is where fail-safe sets in.
    pub fn tick(&mut self, now: Micros, snapshot: &Snapshot<N>) {
        self.alive.battery(snapshot.battery_low());
        self.awaited.take_if(|number| snapshot.includes(*number));
        self.channels.iter_mut().for_each(|channel| channel.note_snapshot(snapshot.commands));
        if self.alive.ran_out(now) {
            self.channels.iter_mut().for_each(MotorChannel::abandon);
            self.let_go_of_the_rest();
        }
    }

    /// A packet came. `None` means that there is nothing to say to it: it is for another hub, or for
    /// all hubs and no discovery. Whatever is answered, even a refusal, shows that the host is there.
    pub fn receive(&mut self, packet: &Packet, now: Micros, snapshot: &Snapshot<N>) -> Option<Packet> {
        self.receive_with(packet, now, snapshot, None)
    }

    /// The same of a hub that keeps a record of what happened.
    pub fn receive_with(
        &mut self,
        packet: &Packet,
        now: Micros,
        snapshot: &Snapshot<N>,
        record: Option<&mut Record<'_>>,
    ) -> Option<Packet> {
        self.tick(now, snapshot);
        let address = self.address.get();
        let discovery = packet.destination == BROADCAST && packet.id == DISCOVERY;
        if packet.destination != address && !discovery {
            return None;
        }
        self.alive.heard(now);
        let answer = Request::read(packet, N.min(CHANNELS))
            .and_then(|request| self.answer(request, now, snapshot, record));
        let reply = match answer {
            Ok(Answer::Ack) => Reply::Ack { attention: self.alive.attention() },
            Ok(Answer::Data(payload)) => Reply::Data(payload),
            Err(nack) => Reply::Nack(nack),
        };
        self.number = self.number.checked_add(1).unwrap_or(1);
        // From the address that was asked, even if it has just been changed.
        Some(reply.packet(packet, address, self.number))
    }

    /// The next command to the motors; [`sent`](Self::sent) when it has been sent. Commands that release motors come first,
    /// courses of groups last.
    pub fn pending(&self) -> Option<Command> {
        if let Some(motor) = self.next_channel() {
            let action = self.channels.get(motor)?.pending()?;
            return Some(Command { motor, action });
        }
        self.courses.next().map(|(motor, together)| Command { motor, action: Action::Lead(together) })
    }

    /// Notes that the command in [`pending`](Self::pending) has been sent with this number. The numbers are those of
    /// [`Snapshot::commands`].
    pub fn sent(&mut self, number: u32) {
        self.awaited = Some(number);
        if let Some(channel) = self.next_channel().and_then(|motor| self.channels.get_mut(motor)) {
            channel.sent(number);
        } else if let Some(together) = self.courses.sent() {
            for (channel, member) in self.channels.iter_mut().zip(together.course.members()) {
                if member {
                    channel.course_sent(number);
                }
            }
        }
    }

    /// True while no snapshot includes a motor's newest set-point or course.
    fn awaits_snapshot(&self, motor: usize) -> bool {
        self.courses.concern(motor) || self.channels.get(motor).is_some_and(MotorChannel::awaits_snapshot)
    }

    /// Number of the newest command that follows from the requests until now. A command that is not sent yet will have a
    /// higher number than all that are.
    fn newest_command(&self, snapshot: &Snapshot<N>) -> u32 {
        let sent = self.awaited.unwrap_or(snapshot.commands);
        if self.pending().is_some() { sent.wrapping_add(1) } else { sent }
    }

    fn next_channel(&self) -> Option<usize> {
        let urgent = self.channels.iter().position(MotorChannel::urgent);
        urgent.or_else(|| self.channels.iter().position(|channel| channel.pending().is_some()))
    }

    fn disable(&mut self) {
        self.channels.iter_mut().for_each(MotorChannel::disable);
        self.let_go_of_the_rest();
    }

    fn let_go_of_the_rest(&mut self) {
        self.courses.clear();
        self.pins.disable();
    }

    fn answer(
        &mut self,
        request: Request,
        now: Micros,
        snapshot: &Snapshot<N>,
        record: Option<&mut Record<'_>>,
    ) -> Result<Answer, Nack> {
        self.changed |= matches!(
            request,
            Request::Motor(..) | Request::Setup(..) | Request::Standard(Standard::SetAddress { .. })
        );
        match request {
            Request::Standard(request) => Ok(self.standard(request, now, snapshot)),
            Request::Hub(request) => self.hub(request, snapshot),
            Request::Pin(request) => self.pins.receive(&request),
            Request::Motor(motor, request) => self.motor(motor, request, snapshot),
            Request::Group(motor, ToGroup::Move { wanted }) => self.lead(motor, wanted, snapshot),
            Request::Group(motor, ToGroup::State) => self.group(motor, snapshot),
            Request::Record(request) => recall(request, record),
            Request::Bus => Ok(Answer::data(&self.bus_report(now, &snapshot.bus))),
            Request::Store(request) => self.receive_store(request, snapshot),
            Request::Report => Ok(Answer::data(&self.report(now, snapshot))),
            Request::Update(request) => self.receive_update(request, snapshot),
            Request::Setup(motor, request) => {
                let motor = usize::from(motor);
                let report = snapshot.motors.get(motor).ok_or(NO_MOTOR)?;
                let channel = self.channels.get_mut(motor).ok_or(NO_MOTOR)?;
                let battery = snapshot.good_battery();
                channel.receive_setup(request, report, battery)
            }
        }
    }

    fn standard(&mut self, request: Standard, now: Micros, snapshot: &Snapshot<N>) -> Answer {
        match request {
            // There is nothing to be verbose about.
            Standard::KeepAlive | Standard::DebugLevel { .. } => (),
            Standard::FailSafe => {
                self.disable();
                self.alive.fail_safe();
            }
            Standard::SetAddress { address } => {
                self.address = address;
                self.keep_address();
            }
            Standard::SetLedColour { colour } => self.led.set_colour(colour),
            Standard::SetLedPattern { pattern } => self.led.set_pattern(pattern, now),
            Standard::Status { clear } => {
                let motor_alerts = motor_alerts(&snapshot.motors);
                let answer = Answer::data(&Status { status: self.alive.status(), motor_alerts });
                if clear {
                    self.alive.clear();
                }
                return answer;
            }
            Standard::QueryInterface { interface } => return Answer::data(&interface.functions()),
            Standard::LedColour => return Answer::data(&self.led.colour()),
            Standard::LedPattern => return Answer::data(self.led.pattern()),
            // There is no hub between this one and the host.
            Standard::Discovery => return Answer::data(&true),
        }
        Answer::Ack
    }

    fn hub(&mut self, request: ToHub, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        match request {
            ToHub::SetPhoneCharge { on } => self.phone_charge = on,
            ToHub::SetFtdiReset { on } => self.ftdi_reset = on,
            // Taken and forgotten.
            ToHub::LogHint { .. } => (),
            ToHub::Bulk => return Ok(Answer::data(&self.bulk(snapshot))),
            ToHub::Adc { channel, raw } => {
                let settings = self.channels.iter().map(MotorChannel::settings);
                return Ok(Answer::data(&adc::read(channel, raw, snapshot, settings)));
            }
            ToHub::PhoneCharge => return Ok(Answer::data(&self.phone_charge)),
            ToHub::FtdiReset => return Ok(Answer::data(&self.ftdi_reset)),
            ToHub::VersionText => return Ok(Answer::data(&Text::new(VERSION_TEXT).unwrap_or_default())),
            ToHub::Version => return Ok(Answer::data(&VERSION)),
        }
        Ok(Answer::Ack)
    }

    fn motor(&mut self, motor: u8, request: ToMotor, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        let motor = usize::from(motor);
        let report = snapshot.motors.get(motor).ok_or(NO_MOTOR)?;
        let channel = self.channels.get_mut(motor).ok_or(NO_MOTOR)?;
        let battery_good = snapshot.good_battery().is_some();
        let answer = channel.receive(request, report, battery_good);
        if channel.has_new_target() {
            self.courses.forget(motor);
        }
        answer
    }

    /// A group is sent somewhere.
    fn lead(&mut self, motor: u8, wanted: GroupMove, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        let leader = usize::from(motor);
        let goal = |motor: usize, counts: i32| {
            let of = self.channels.get(motor).zip(snapshot.motors.get(motor));
            of.map_or(counts, |(channel, report)| channel.goal(counts, report.position))
        };
        let together = group::together(wanted, goal);
        let members = together.course.members();
        let mut others = members.iter().skip(N);
        if members.get(leader) != Some(&true) || others.any(|member| *member) {
            return Err(Nack::parameter(2));
        }
        let of_group = |channels: &[MotorChannel; N]| {
            channels.iter().zip(members).all(|(channel, member)| !member || channel.enabled())
        };
        if !of_group(&self.channels) {
            return Err(Nack::WRONG_MODE);
        }
        for (channel, member) in self.channels.iter_mut().zip(members) {
            if member {
                channel.join();
            }
        }
        self.courses.put(leader, together);
        Ok(Answer::Ack)
    }

    fn group(&self, motor: u8, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        let motor = usize::from(motor);
        let report = snapshot.motors.get(motor).ok_or(NO_MOTOR)?;
        let channel = self.channels.get(motor).ok_or(NO_MOTOR)?;
        let state = match (self.awaits_snapshot(motor), report.setpoint) {
            (true, _) if channel.in_group() => GroupState::Moving,
            (true, _) => GroupState::Alone,
            (false, Setpoint::Together(_)) if report.settled => GroupState::Settled,
            (false, Setpoint::Together(_)) => GroupState::Moving,
            (false, _) => GroupState::Alone,
        };
        Ok(Answer::data(&state))
    }

    fn bus_report(&self, now: Micros, bus: &Bus) -> BusReport {
        let Seen { measured, state, .. } = self.bus.by(now);
        let millijoules = |energy: Microjoules| u32::try_from(energy.get() / 1_000).unwrap_or(u32::MAX);
        BusReport {
            state,
            measured,
            burning: per_mille(bus.burn),
            returned_mj: millijoules(bus.returned),
            burnt_mj: millijoules(bus.burnt),
        }
    }

    /// What all motors do.
    fn report(&self, now: Micros, snapshot: &Snapshot<N>) -> HubReport {
        let battery = snapshot.battery;
        let motors = self.channels.iter().zip(&snapshot.motors).take(CHANNELS).enumerate();
        let motors = motors.map(|(motor, (channel, report))| {
            report::of_motor(channel, report, !self.awaits_snapshot(motor), battery)
        });
        HubReport {
            at_ms: (snapshot.at.get() / 1_000) as u32,
            battery,
            bus: self.bus.by(now).state,
            burning: per_mille(snapshot.bus.burn),
            motors: motors.collect(),
            commands: Some(Commands { included: snapshot.commands, newest: self.newest_command(snapshot) }),
        }
    }

    /// Without analog inputs, which read 0.
    fn bulk(&self, snapshot: &Snapshot<N>) -> Bulk {
        let (digital, attention) = (self.pins.inputs(), Some(self.alive.attention()));
        let mut bulk = Bulk { digital, attention, ..Bulk::default() };
        let motors = self.channels.iter().zip(&snapshot.motors);
        let answers = bulk.encoders.iter_mut().zip(&mut bulk.velocities).zip(&mut bulk.within_tolerance);
        for ((channel, report), ((encoder, velocity), within_tolerance)) in motors.zip(answers) {
            *encoder = channel.counts(report);
            *velocity = report.velocity.round_to_i16();
            *within_tolerance = channel.within_tolerance(report);
        }
        for ((channel, report), over) in
            self.channels.iter().zip(&snapshot.motors).zip(&mut bulk.over_current)
        {
            *over = channel.is_over_current(report);
        }
        bulk
    }
}

/// What is on record.
#[inline(never)]
fn recall(request: ToRecord, record: Option<&mut Record<'_>>) -> Result<Answer, Nack> {
    match (request, record) {
        (ToRecord::Entries { .. }, None) => Ok(Answer::data(&Entries::default())),
        (ToRecord::Entries { from, clear }, Some(record)) => {
            let answer = Answer::data(&Entries::of(record, from));
            if clear {
                record.clear();
            }
            Ok(answer)
        }
        (ToRecord::Ticks { number, from }, record) => {
            let ticks = record.and_then(|record| Ticks::of(record, number, from));
            ticks.map(|ticks| Answer::data(&ticks)).ok_or(Nack::parameter(0))
        }
    }
}

fn per_mille(share: Share) -> u16 {
    (1_000.0 * share.to_f32()) as u16
}

/// Bits 0 to 3: the encoder of motor 0 to 3 is not to be trusted. Bits 4 to 7: its bridge has switched itself off.
fn motor_alerts(motors: &[Report]) -> u8 {
    let bits = motors.iter().take(CHANNELS).enumerate();
    bits.fold(0, |alerts, (index, motor)| {
        let lost = motor.faults.encoder_stale || motor.faults.encoder.is_some();
        alerts | u8::from(lost) << index | u8::from(motor.faults.bridge) << (index + CHANNELS)
    })
}
