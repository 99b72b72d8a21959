//! How the bus of battery and bridges is: a function of this hub's [own interface](super::setup), for which the protocol has
//! no words. A hub that is asked by a host that does not know of it never meets it.
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 13 tell how the bus is | | the fields of a [`BusReport`] |
//!
//! | field | |
//! |---|---|
//! | u8 | 0 nothing is measured, 1 below what is plausible, 2 nothing is drawn, 3 less is drawn, 4 all is as asked, 5 what braking motors return is burnt, 6 so it is, and something else lifts the bus |
//! | bool, u16 | it is measured; the newest sample, mV, plausible or not |
//! | u16 | how far it is burnt, in 1/1000 |
//! | u32, u32 | what braking motors returned, and what they burnt, since boot, mJ |
//!
//! ```
//! use motor_hub::protocol::Request;
//!
//! let request = Request::Bus;
//! assert_eq!((request.id(), request.payload().len()), (0x4D0D, 0));
//! ```

use super::fields::{Field, Fields, Payload, codes};
use super::nack::Nack;
use crate::supply::BusState;
use crate::units::Millivolts;

/// Its number.
pub const FUNCTION: u16 = 13;

codes!(BusState {
    0 = Silent,
    1 = TooLow,
    2 = Cut,
    3 = Derated,
    4 = Quiet,
    5 = Burning,
    6 = TooHigh
});

/// How the bus is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusReport {
    /// In which of its ranges.
    pub state: BusState,
    /// The newest sample, plausible or not; `None` if the converter does not answer.
    pub measured: Option<Millivolts>,
    /// How far braking motors burn what they would return, in 1/1000.
    pub burning: u16,
    /// What they have returned since boot, in millijoules.
    pub returned_mj: u32,
    /// What they have burnt since boot, in millijoules.
    pub burnt_mj: u32,
}

impl Field for BusReport {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let state = BusState::read(fields)?;
        let (is_measured, mv) = (bool::read(fields)?, u16::read(fields)?);
        let burning = u16::read(fields)?;
        let [returned_mj, burnt_mj] = Field::read(fields)?;
        let measured = is_measured.then_some(Millivolts::new(mv));
        Ok(Self { state, measured, burning, returned_mj, burnt_mj })
    }

    fn write(&self, payload: &mut Payload) {
        self.state.write(payload);
        self.measured.is_some().write(payload);
        [self.measured.map_or(0, Millivolts::get), self.burning].write(payload);
        [self.returned_mj, self.burnt_mj].write(payload);
    }
}
