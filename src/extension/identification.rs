//! The state of an identification in a payload: a code, and then fields that depend on the code.

use crate::protocol::Nack;
use crate::protocol::payload::{ByteIn, Field, Fields, Payload, codes, fields_in_order};
use crate::regulator::Dynamics;
use crate::regulator::identify::{Identification, Identified, Refusal};

codes!(Refusal {
    0 = Stopped,
    1 = Interrupted,
    2 = NotAtRest,
    3 = TravelLimit,
    4 = Battery,
    5 = TooFar,
    6 = NoCounts,
    7 = Backwards,
    8 = Load,
    9 = Spring,
    10 = PoorFit,
    11 = Inaccurate,
    12 = Implausible,
    13 = HeldAtLowVoltage
});

impl Field for Identification {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(match ByteIn::<0, 3>::read(fields)?.get() {
            0 => Self::None,
            1 => Self::Running(ByteIn::<0, 99>::read(fields)?.get()),
            2 => Self::Found(Identified::read(fields)?),
            _ => Self::Refused(Refusal::read(fields)?),
        })
    }

    fn write(&self, payload: &mut Payload) {
        match self {
            Self::None => 0u8.write(payload),
            Self::Running(percent) => [1, *percent].write(payload),
            Self::Found(found) => {
                2u8.write(payload);
                found.write(payload);
            }
            Self::Refused(why) => {
                3u8.write(payload);
                why.write(payload);
            }
        }
    }
}

fields_in_order!(Dynamics { gain, decay, friction });

fields_in_order!(Identified {
    dynamics,
    emf,
    emf_is_configured,
    gain_error,
    decay_error,
    emf_error,
    friction_error,
    residual
});
