//! Commands to the hub as a whole.

use super::state::{Bulk, Status};
use super::{Error, Session};
use motor_hub::link::command::INTERFACE;
use motor_hub::link::fields::Fields;
use motor_hub::link::{Address, Colour, Nack, setup};
use motor_hub::units::Millivolts;
use std::io::{Read, Write};

/// Channel of the hub's converter.
const BATTERY: u8 = 13;
/// In engineering units: millivolts.
const CONVERTED: u8 = 0;

impl<L: Read + Write> Session<L> {
    /// Module status; `clear` makes the hub forget what it says.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn status(&mut self, clear: bool) -> Result<Status, Error> {
        let what = "tell its status";
        let data = self.read(what, 0x7F03, &[u8::from(clear)])?;
        parse(what, &data, Status::read)
    }

    /// All motors off; modes, targets and encoders are kept.
    pub fn fail_safe(&mut self) -> Result<(), Error> {
        self.write("stop", 0x7F05, &[]).map(drop)
    }

    /// Gives the hub another address, at which this session goes on.
    pub fn set_address(&mut self, address: Address) -> Result<(), Error> {
        let before = self.address;
        let done = self.write("take another address", 0x7F06, &[address.get()]);
        self.address = address.get();
        match done {
            // The answer may be lost, or come from the new address: then the hub is there by now.
            Err(Error::Silent { .. }) if self.status(false).is_ok() => Ok(()),
            Err(error) => {
                self.address = before;
                Err(error)
            }
            Ok(_) => Ok(()),
        }
    }

    /// The colour last set for the status LED.
    pub fn led(&mut self) -> Result<Colour, Error> {
        let what = "tell its LED colour";
        let data = self.read(what, 0x7F0B, &[])?;
        parse(what, &data, Colour::read)
    }

    /// Sets the colour of the status LED.
    pub fn set_led(&mut self, Colour { red, green, blue }: Colour) -> Result<(), Error> {
        self.write("set its LED colour", 0x7F0A, &[red, green, blue]).map(drop)
    }

    /// Everything that changes while motors run.
    pub fn bulk(&mut self) -> Result<Bulk, Error> {
        let what = "tell its motors' state";
        let data = self.get(what, 0, &[])?;
        parse(what, &data, Bulk::read)
    }

    /// Battery voltage; 0 if the hub does not know it.
    pub fn battery(&mut self) -> Result<Millivolts, Error> {
        let what = "tell its battery voltage";
        let data = self.get(what, 7, &[BATTERY, CONVERTED])?;
        let mv = parse(what, &data, Fields::i16)?;
        Ok(Millivolts::new(u16::try_from(mv).unwrap_or_default()))
    }

    /// Hardware and firmware, in the hub's own words.
    pub fn version(&mut self) -> Result<String, Error> {
        let what = "tell its version";
        let data = self.get(what, 48, &[])?;
        let text = parse(what, &data, |fields| {
            let length = fields.u8()?;
            fields.slice(length.into())
        })?;
        // What a hub says may end in zeros, and goes to a terminal.
        let text = String::from_utf8_lossy(text);
        Ok(text.chars().filter(|c| !c.is_control()).collect())
    }

    /// A function of the motor interface that is answered with data.
    pub(super) fn get(&mut self, what: &str, function: u16, payload: &[u8]) -> Result<Vec<u8>, Error> {
        let id = self.function(what, function)?;
        self.read(what, id, payload)
    }

    /// A function of the motor interface that is acknowledged.
    pub(super) fn set(&mut self, what: &str, function: u16, payload: &[u8]) -> Result<(), Error> {
        let id = self.function(what, function)?;
        self.write(what, id, payload).map(drop)
    }

    /// The type of a function: hubs are free to number them.
    fn function(&mut self, what: &str, function: u16) -> Result<u16, Error> {
        let (first, count) = match self.interface {
            Some(interface) => interface,
            None => {
                let interface = self.query("number its motor functions", INTERFACE)?;
                *self.interface.insert(interface)
            }
        };
        number(what, first, count, function)
    }

    /// The type of a function of this hub's own interface.
    pub(super) fn own(&mut self, what: &str, function: u16) -> Result<u16, Error> {
        let (first, count) = self.query(what, setup::INTERFACE)?;
        number(what, first, count, function)
    }

    /// First type and number of functions of an interface.
    fn query(&mut self, what: &str, name: &[u8]) -> Result<(u16, u16), Error> {
        let data = self.read(what, 0x7F07, &[name, &[0]].concat())?;
        parse(what, &data, |fields| Ok((fields.u16()?, fields.u16()?)))
    }
}

fn number(what: &str, first: u16, count: u16, function: u16) -> Result<u16, Error> {
    let id = first.checked_add(function).filter(|_| function < count);
    id.ok_or_else(|| Error::TooOld { what: what.to_owned() })
}

/// The layout of an answer; what follows it is ignored.
pub(super) fn parse<'a, T>(
    what: &str,
    data: &'a [u8],
    read: impl FnOnce(&mut Fields<'a>) -> Result<T, Nack>,
) -> Result<T, Error> {
    read(&mut Fields::new(data)).map_err(|_| Error::Unexpected { what: what.to_owned() })
}
