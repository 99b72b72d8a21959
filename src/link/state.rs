//! The hub as the host sees it.

use super::alive::Alive;
use super::channel::Channel;
use super::command::{Address, DISCOVERY, Request, ToMotor};
use super::fields::Nack;
use super::frame::Packet;
use super::led::{Colour, Led};
use super::reply::{Answer, Bulk, Reply};
use super::{BROADCAST, CHANNELS, pins};
use crate::hub::{Command, Snapshot};
use crate::motor::{Report, Settings};
use crate::units::{Micros, Millivolts};

/// Below this the battery is low: motors cannot be enabled, and the status word and the LED say so.
/// Motors that run go on.
pub const LOW_BATTERY: Millivolts = Millivolts::new(7_000);

/// What the version commands say. Hosts read from it what a hub understands: from 1.8.2 on, PIDF.
const VERSION_TEXT: &[u8] = b"HW: 20, Maj: 1, Min: 8, Eng: 2";
/// Engineering, minor, major; hardware 2.0; and the type of hub whose interface this one offers.
const VERSION: [u8; 9] = [2, 8, 1, 0, 2, 0x53, 0x11, 0x31, 0x00];

/// Everything that the hub keeps for the host.
#[derive(Clone, Debug)]
pub struct Link<const N: usize> {
    address: Address,
    /// Of the last reply.
    number: u8,
    alive: Alive,
    channels: [Channel; N],
    pins: pins::Memory,
    led: Led,
    phone_charge: bool,
    ftdi_reset: bool,
}

impl<const N: usize> Link<N> {
    /// After a reset. `settings` are those that the motors start with: the coefficients that a host
    /// reads before it has set any.
    pub fn new(address: Address, settings: [Settings; N]) -> Self {
        Self {
            address,
            number: 0,
            alive: Alive::new(),
            channels: settings.map(Channel::new),
            pins: pins::Memory::default(),
            led: Led::default(),
            phone_charge: false,
            ftdi_reset: false,
        }
    }

    /// The address in force; whoever wants to keep it over a reset stores it.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// By motor: is it enabled?
    pub fn enabled(&self) -> [bool; N] {
        self.channels.each_ref().map(Channel::enabled)
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
        self.alive.battery(snapshot.battery.is_some_and(|battery| battery < LOW_BATTERY));
        if self.alive.ran_out(now) {
            self.disable();
        }
    }

    /// A packet came. `None` means that there is nothing to say to it: it is for another hub, or for
    /// all hubs and no discovery. Whatever is answered, even a refusal, shows that the host is there.
    pub fn receive(&mut self, packet: &Packet, now: Micros, snapshot: &Snapshot<N>) -> Option<Reply> {
        self.tick(now, snapshot);
        let address = self.address.get();
        let discovery = packet.destination == BROADCAST && packet.id == DISCOVERY;
        if packet.destination != address && !discovery {
            return None;
        }
        self.alive.heard(now);
        let answer =
            Request::read(packet, N.min(CHANNELS)).and_then(|request| self.answer(request, now, snapshot));
        self.number = self.number.checked_add(1).unwrap_or(1);
        // From the address that was asked, even if it has just been changed.
        Some(Reply::to(packet, address, self.number, self.alive.attention(), answer))
    }

    /// The next thing that the motors are to be told; [`told`](Self::told) when they have been. Those
    /// that let go come first.
    pub fn pending(&self) -> Option<Command> {
        let motor = self.next_channel()?;
        let action = self.channels.get(motor)?.pending()?;
        Some(Command { motor, action })
    }

    /// The motors have been told what [`pending`](Self::pending) says.
    pub fn told(&mut self) {
        if let Some(channel) = self.next_channel().and_then(|motor| self.channels.get_mut(motor)) {
            channel.told();
        }
    }

    fn next_channel(&self) -> Option<usize> {
        let urgent = self.channels.iter().position(Channel::urgent);
        urgent.or_else(|| self.channels.iter().position(|channel| channel.pending().is_some()))
    }

    fn disable(&mut self) {
        self.channels.iter_mut().for_each(Channel::disable);
        self.pins.disable();
    }

    fn answer(&mut self, request: Request, now: Micros, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        match request {
            Request::KeepAlive | Request::DebugLevel | Request::LogHint => (),
            Request::FailSafe => {
                self.disable();
                self.alive.fail_safe();
            }
            Request::SetAddress(address) => self.address = address,
            Request::SetLedColour(colour) => self.led.set_colour(colour),
            Request::SetLedPattern(pattern) => self.led.set_pattern(pattern, now),
            Request::SetPhoneCharge(on) => self.phone_charge = on,
            Request::SetFtdiReset(on) => self.ftdi_reset = on,
            Request::Motor(motor, request) => return self.motor(motor, request, snapshot),
            Request::Pins(request) => return self.pins.receive(request),
            Request::Status { clear } => {
                let answer = Answer::data(&[&[self.alive.status(), motor_alerts(&snapshot.motors)]]);
                if clear {
                    self.alive.clear();
                }
                return Ok(answer);
            }
            Request::QueryInterface { first, count } => {
                return Ok(Answer::data(&[&first.to_le_bytes(), &count.to_le_bytes()]));
            }
            Request::LedColour => {
                let Colour { red, green, blue } = self.led.colour();
                return Ok(Answer::data(&[&[red, green, blue]]));
            }
            Request::LedPattern => return Ok(Answer::data(&[self.led.pattern().bytes().as_flattened()])),
            // There is no hub between this one and the host.
            Request::Discovery => return Ok(Answer::data(&[&[1]])),
            Request::Bulk => return Ok(self.bulk(snapshot).answer()),
            Request::Battery => {
                // Unknown reads 0, which no battery does that a hub runs from.
                let mv = snapshot.battery.unwrap_or_default().get();
                return Ok(Answer::data(&[&i16::try_from(mv).unwrap_or(i16::MAX).to_le_bytes()]));
            }
            Request::PhoneCharge => return Ok(Answer::data(&[&[u8::from(self.phone_charge)]])),
            Request::FtdiReset => return Ok(Answer::data(&[&[u8::from(self.ftdi_reset)]])),
            Request::VersionText => {
                return Ok(Answer::data(&[&[VERSION_TEXT.len() as u8], VERSION_TEXT]));
            }
            Request::Version => return Ok(Answer::data(&[&VERSION])),
        }
        Ok(Answer::Ack)
    }

    fn motor(&mut self, motor: usize, request: ToMotor, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        let nobody = Nack::Parameter(0);
        let report = snapshot.motors.get(motor).ok_or(nobody)?;
        let channel = self.channels.get_mut(motor).ok_or(nobody)?;
        let battery_good = snapshot.battery.is_some_and(|battery| battery >= LOW_BATTERY);
        channel.receive(request, report, battery_good)
    }

    /// Without current sensors, and without inputs beside the encoders.
    fn bulk(&self, snapshot: &Snapshot<N>) -> Bulk {
        let mut bulk = Bulk { attention: self.alive.attention(), ..Bulk::default() };
        let motors = self.channels.iter().zip(&snapshot.motors);
        let answers = bulk.encoders.iter_mut().zip(&mut bulk.velocities);
        for (index, ((channel, report), (encoder, velocity))) in motors.zip(answers).enumerate() {
            *encoder = channel.counts(report);
            let cps = report.velocity.round();
            *velocity = cps.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
            bulk.motor_status |= u8::from(channel.at_target(report)) << (4 + index);
        }
        bulk
    }
}

/// Bits 0 to 3: the encoder of motor 0 to 3 is not to be trusted.
fn motor_alerts(motors: &[Report]) -> u8 {
    let bits = motors.iter().take(CHANNELS).enumerate();
    bits.fold(0, |alerts, (index, motor)| {
        let lost = motor.faults.encoder_stale || motor.faults.encoder.is_some();
        alerts | u8::from(lost) << index
    })
}
