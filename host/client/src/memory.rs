//! A hub in this process's memory, for trying and testing host programs without hardware.
//!
//! The hub in memory runs the protocol code of this project's hubs. This hub keeps settings and answers requests, but
//! no motor turns: commands to motors are counted and dropped. Its clock stands still, so its keep-alive never disables
//! motors.
//!
//! ```
//! use motor_hub_client::Session;
//! use motor_hub_client::memory::MemoryHub;
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::motor_hub::units::Millivolts;
//! use std::time::Duration;
//!
//! let mut hub = MemoryHub::default();
//! hub.snapshot.battery = Some(Millivolts::new(12_345));
//! let mut session = Session::new(hub, Address::DEFAULT, Duration::from_secs(1));
//! assert_eq!(session.battery()?.get(), 12_345);
//! # Ok::<(), motor_hub_client::Error>(())
//! ```

use motor_hub::board::{ANALOG_INPUTS, Equipment, SERVOS};
use motor_hub::braking::Winding;
use motor_hub::hub::Snapshot;
use motor_hub::motor::Settings;
use motor_hub::protocol::{Address, Decoder, frame};
use motor_hub::responder::Responder;
use motor_hub::supply::DrawStage;
use motor_hub::units::Micros;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Result, Write};

/// A hub with four NeveRest 60, servos, digital pins and analog inputs at [`Address::DEFAULT`], and the line to it.
#[derive(Debug)]
pub struct MemoryHub {
    /// Battery and motor values that the hub answers with.
    pub snapshot: Snapshot<4>,
    responder: Responder<4>,
    decoder: Decoder,
    replies: VecDeque<u8>,
}

impl Default for MemoryHub {
    /// Returns the hub in its state after a reset. The battery voltage is unknown.
    fn default() -> Self {
        let settings = [Settings::new(Winding::NEVEREST_60); 4];
        let mut responder = Responder::new(Address::DEFAULT, settings);
        // The firmware performs I2C transfers in a task, which this hub does not have. The hub therefore has no I2C
        // bus.
        let (servos, analog) = (SERVOS as u8, ANALOG_INPUTS as u8);
        let equipment = Equipment { digital: u8::MAX, servos, analog, i2c: 0, rail: true, temperature: true };
        responder.outputs.equipment = equipment;
        // Once a program has set a battery voltage, motors can be enabled.
        let snapshot = Snapshot { draw_stage: DrawStage::Full, ..Snapshot::INITIAL };
        Self { snapshot, responder, decoder: Decoder::new(), replies: VecDeque::new() }
    }
}

impl Write for MemoryHub {
    fn write(&mut self, mut bytes: &[u8]) -> Result<usize> {
        let (count, now) = (bytes.len(), Micros::new(0));
        while let Some(packet) = self.decoder.next(&mut bytes, now) {
            if let Some(reply) = self.responder.receive(&packet, now, &self.snapshot) {
                self.replies.extend(&frame::encode(&reply));
            }
            while self.responder.pending().is_some() {
                self.snapshot.newest_command = self.snapshot.newest_command.wrapping_add(1);
                self.responder.sent(self.snapshot.newest_command);
            }
        }
        Ok(count)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

impl Read for MemoryHub {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        if self.replies.is_empty() { Err(ErrorKind::WouldBlock.into()) } else { self.replies.read(bytes) }
    }
}
