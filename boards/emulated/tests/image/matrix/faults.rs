//! The rows of the fault matrix: how each fault begins and ends, and what is done meanwhile.

use std::num::NonZeroU32;
use std::time::Duration;

use emulated::{Bench, ChipFaults, Encoder, FaultyCode, FlashFaults, Wire};

use super::run::Run;
use crate::common::{COUNTER, ms, too_low};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    /// The encoders of all four motors have this fault.
    Encoder(Encoder),
    ConverterDead,
    /// The battery has this open-circuit voltage, V.
    Battery(f64),
    /// Each bridge reports on its DIAG line that it has switched itself off.
    BridgesOff,
    HostSilent,
    /// This number of bytes in a million is damaged on the line to the hub.
    HostGarbled(u32),
    LogAbandoned,
    /// This task never returns.
    TaskHangs(&'static str),
    BusError,
    ResetPin,
    /// Nothing is connected to the battery's pin.
    BatteryPinOpen,
    /// The chip's supply falls, and comes back.
    SupplyFalls,
    LockUp,
    /// A reset, after which the clocks do not start.
    ClocksDoNotStart,
    /// The host saves settings, while the flash has these faults.
    FlashFaulty(FlashFaults),
}

const NOMINAL: f64 = 12.0;
/// Sum of the time-out of the watchdog and the time in which the hub starts.
const UNTIL_STARTED: Duration = ms(700);
const REQUEST_INTERVAL: Duration = ms(20);

pub(crate) const fn glitches(per_second: u32) -> Fault {
    Fault::Encoder(Encoder::Glitches { per_second: NonZeroU32::new(per_second).expect("some") })
}

pub(crate) const fn stuck(wire: Wire, high: bool) -> Fault {
    Fault::Encoder(Encoder::Stuck { wire, high })
}

/// One of the seven slots of the encoder's wheel is missing.
pub(crate) const SLOT_MISSING: Fault =
    Fault::Encoder(Encoder::MissingSlot { of: NonZeroU32::new(7).expect("some") });

impl Fault {
    /// Begins the fault, or ends it. Some faults end without help.
    pub(crate) fn set(self, bench: &mut Bench, on: bool) {
        match self {
            Self::Encoder(fault) => {
                let encoder = if on { fault } else { Encoder::Sound };
                (0..4).for_each(|motor| bench.set_encoder(motor, encoder));
            }
            Self::ConverterDead => {
                bench.set_chip_faults(ChipFaults { converter_dead: on, ..Default::default() })
            }
            Self::Battery(volts) => bench.set_battery(if on { volts } else { NOMINAL }),
            Self::BridgesOff => (0..4).for_each(|motor| bench.pull_diag(motor, on)),
            Self::HostGarbled(per_million) => bench.garble_serial(if on { per_million } else { 0 }),
            Self::LogAbandoned => bench.set_log_abandoned(on),
            Self::BatteryPinOpen => {
                bench.set_chip_faults(ChipFaults { battery_open: on, ..Default::default() })
            }
            Self::SupplyFalls => bench.set_rail(if on { too_low() } else { 3_300 }),
            Self::ClocksDoNotStart => {
                bench.set_chip_faults(ChipFaults { power_dead: on, ..Default::default() });
                if on {
                    bench.pull_reset(bench.now());
                }
            }
            Self::FlashFaulty(faults) => {
                bench.set_flash_faults(if on { faults } else { FlashFaults::default() });
            }
            Self::TaskHangs(task) if on => bench.divert(task, FaultyCode::Loops),
            Self::BusError if on => bench.fail_next_access(COUNTER),
            Self::ResetPin if on => bench.pull_reset(bench.now()),
            Self::LockUp if on => bench.lock_up(COUNTER),
            Self::HostSilent | Self::TaskHangs(_) | Self::BusError | Self::ResetPin | Self::LockUp => {}
        }
    }

    /// Returns how long the fault lasts. The log reports faults once a second.
    const fn duration(self) -> Duration {
        match self {
            // The hub waits 2.5 s for its host. A second more shows that the effect stays.
            Self::HostSilent => ms(3_500),
            // This time is longer than the hub waits for its host, and longer than it takes to fill the log's buffer.
            Self::HostGarbled(_) | Self::LogAbandoned => ms(3_000),
            // The hub does not run meanwhile, or has been reset.
            Self::SupplyFalls | Self::LockUp => ms(600),
            // A core that waits for its clocks is slow to emulate. `supply` tests that the watchdog tries again.
            Self::ClocksDoNotStart => ms(150),
            // This is the time until the fault of a motor that brakes a load is noticed, and a second.
            Self::Encoder(Encoder::Unplugged | Encoder::Stuck { .. }) => ms(2_100),
            // This is the time until the fault of an unknown motor is noticed, and a second. The hub takes an unknown
            // motor for a heavy one.
            Self::Encoder(Encoder::Reversed) => ms(3_400),
            // A battery without readings counts as unknown after 0.1 s, and the log reports that within a second.
            _ => ms(1_200),
        }
    }

    /// Runs until the end of the fault.
    pub(crate) fn run(self, run: &mut Run) {
        let end = run.now() + self.duration();
        match self {
            Self::HostGarbled(_) => {
                // The host continues to send, whether or not it gets answers.
                let (mut requests, mut answers) = (0, 0);
                while run.now() < end {
                    answers += run.send_keep_alive();
                    requests += 1;
                    run.pass(REQUEST_INTERVAL);
                }
                // More answers than requests would show that the hub reads old bytes again, for example an old "enable".
                assert!(answers <= requests, "{answers} answers to {requests} requests");
            }
            // These faults last longer than the hub waits for its host, so the host must send keep-alives.
            Self::LogAbandoned | Self::Encoder(Encoder::Reversed) => {
                while run.now() < end {
                    run.keep_alive();
                    run.pass(ms(500));
                }
            }
            Self::FlashFaulty(_) => {
                run.save();
                run.pass(end.saturating_sub(run.now()));
            }
            _ => run.pass(end - run.now()),
        }
    }

    /// Returns how long the hub may need until it answers again after the end of the fault.
    pub(crate) const fn until_answers(self) -> Duration {
        match self {
            // The hub discards an incomplete packet after 50 ms.
            Self::HostGarbled(_) => ms(60),
            Self::SupplyFalls | Self::ClocksDoNotStart => UNTIL_STARTED,
            _ => Duration::ZERO,
        }
    }

    /// True if a request of the host does not change the effects of the fault.
    pub(crate) const fn host_can_ask(self) -> bool {
        !matches!(self, Self::HostSilent | Self::HostGarbled(_) | Self::SupplyFalls | Self::ClocksDoNotStart)
    }
}
