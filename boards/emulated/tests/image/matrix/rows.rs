//! All faults of the fault matrix, and the expected result in each mode.

use emulated::{Encoder, Wire};

use super::faults::{Fault, SLOT_MISSING, glitches, stuck};
use crate::common::{ERRORS, LATE};

/// A row of the fault matrix: a fault and its expected effects.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) fault: Fault,
    /// Expected reports of the hub itself, from its answers and its log.
    pub(crate) reports: &'static [&'static str],
    /// Expected effects on the motors, in the order of their modes.
    pub(crate) cells: [ExpectedEffect; 4],
}

impl Row {
    /// True if the hub loses some counts and does not notice. They teach an unknown motor wrong constants, which outlast the fault: an
    /// encoder that was unplugged next was noticed after 267 ms.
    pub(crate) const fn loses_counts(&self) -> bool {
        matches!(self.fault, Fault::Encoder(Encoder::Loose { .. }) | SLOT_MISSING)
    }
}

/// Expected effects of a fault in one mode.
#[derive(Clone, Copy)]
pub(crate) struct ExpectedEffect {
    pub(crate) during: During,
    /// Expected reports of the motor, from answers of the hub and its log.
    pub(crate) reports: &'static [&'static str],
    pub(crate) back: Recovery,
}

/// What the bridge does while the fault lasts.
#[derive(Clone, Copy)]
pub(crate) enum During {
    /// The motor follows its command.
    Works,
    /// The bridge drives or brakes, and the motor's speed at the end of the fault is in this range, in counts/s.
    Turns(f64, f64),
    /// The bridge drives or brakes, and the motor's mean speed is in this range, in counts/s.
    TurnsOnAverage(f64, f64),
    /// The bridge opens within this time, in ms, and stays open.
    Opens { within_ms: u64 },
    /// The bridge shorts the motor within this time, in ms, and continues to do so.
    Brakes { within_ms: u64 },
}

/// How the motor follows its command again after the fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Recovery {
    /// The motor was driven during the whole fault.
    WasDriven,
    /// The motor follows its command again without a request of the host.
    ByItself,
    /// The motor follows its command only after the host has disabled and enabled it.
    WhenEnabled,
}

impl Recovery {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::WasDriven => "",
            Self::ByItself => "by itself",
            Self::WhenEnabled => "enabled anew",
        }
    }
}

const WORKS: ExpectedEffect =
    ExpectedEffect { during: During::Works, reports: &[], back: Recovery::WasDriven };

const fn turns(least: f64, most: f64) -> ExpectedEffect {
    ExpectedEffect { during: During::Turns(least, most), ..WORKS }
}

const fn turns_on_average(least: f64, most: f64) -> ExpectedEffect {
    ExpectedEffect { during: During::TurnsOnAverage(least, most), ..WORKS }
}

/// Expects that the bridge opens, and that the fault is latched: only the host can enable the motor again.
const fn off(within_ms: u64, reports: &'static [&'static str]) -> ExpectedEffect {
    ExpectedEffect { during: During::Opens { within_ms }, reports, back: Recovery::WhenEnabled }
}

/// Expects that the bridge shorts the motor, and that the fault is latched: only the host can enable the motor again.
const fn brakes(within_ms: u64, reports: &'static [&'static str]) -> ExpectedEffect {
    ExpectedEffect { during: During::Brakes { within_ms }, reports, back: Recovery::WhenEnabled }
}

const fn row(
    name: &'static str,
    fault: Fault,
    reports: &'static [&'static str],
    cells: [ExpectedEffect; 4],
) -> Row {
    Row { name, fault, reports, cells }
}

const STUCK: &[&str] = &["lost counts", "log: stuck"];
const REVERSED: &[&str] = &["lost counts", "log: reversed"];

/// An encoder without counts is noticed in each mode, except in open loop, which needs no encoder.
const SILENT_ENCODER: [ExpectedEffect; 4] = [WORKS, off(250, STUCK), off(250, STUCK), off(250, STUCK)];
/// Counts in the wrong direction. The hub takes an unknown motor for a heavy one, which may take 2.2 s to slow down
/// after it has counted in the right direction.
const BACKWARDS: [ExpectedEffect; 4] =
    [WORKS, off(2_300, REVERSED), off(2_300, REVERSED), off(400, REVERSED)];
/// Some lost counts are not noticed: the motor seems to be slower, and is then driven faster. A loose wire has contact for 77 % of
/// the time on average. In a fault of 1.1 s it has contact for 60 to 90 % of the time, in 999 of 1000 faults. The hub keeps the
/// counted speed, so the motor turns at 1/0.9 to 1/0.6 times the requested speed. Its mean speed is less, because it must accelerate
/// first. When the wire has contact again after a pause, the hub sees a motor that is too fast, and may brake it fully for 50 ms. Seen:
/// mean speeds of 857 of 1000 counts/s, and of 228 of 300.
const SOME_COUNTS_LOST: [ExpectedEffect; 4] = [
    WORKS,
    turns_on_average(800.0, 1_650.0),
    turns_on_average(800.0, 1_650.0),
    turns_on_average(220.0, 495.0),
];
/// If one of seven slots of the encoder's wheel is missing, the motor turns at 7/6 of the requested speed on average. Within a turn
/// its speed swings. With one count per sample the hub may also take the slot for a sudden motion, and brake for a tick (decision 33):
/// on average 995 counts/s at a demanded speed and 1067 counts/s on the way to a position were seen. The swing also raises the
/// acceleration per volt (decision 30), and the hub then answers each slot later: 1266 counts/s were seen, and 1228 on the way to a
/// position.
const ONE_OF_SEVEN_LOST: [ExpectedEffect; 4] = [
    WORKS,
    turns_on_average(950.0, 1_300.0),
    turns_on_average(1_020.0, 1_300.0),
    turns_on_average(315.0, 385.0),
];
/// Without a battery voltage the bridge opens within the sum of 100 ms, a control period of 50 ms, and the time of a
/// tick.
const BLIND: [ExpectedEffect; 4] = [ExpectedEffect {
    during: During::Opens { within_ms: 165 },
    reports: &["log: battery unknown"],
    back: Recovery::ByItself,
}; 4];
const BRIDGE: &[&str] = &["bridge too hot", "bridge off"];

/// All rows that both boards have. Rows of lost counts come first: after an encoder fault an unknown motor begins with its initial
/// guess again, and lost counts then swing its speed farther (402 counts/s on average were seen where a slot is missing at 300).
pub(crate) static ROWS: [Row; 28] = [
    row(
        "A makes contact now and then",
        Fault::Encoder(Encoder::Loose { wire: Wire::A }),
        &[],
        SOME_COUNTS_LOST,
    ),
    row(
        "B makes contact now and then",
        Fault::Encoder(Encoder::Loose { wire: Wire::B }),
        &[],
        SOME_COUNTS_LOST,
    ),
    row("one slot of 7 missing", SLOT_MISSING, &[], ONE_OF_SEVEN_LOST),
    row("20 glitches/s", glitches(20), &[], [WORKS; 4]),
    row("200 glitches/s", glitches(200), &[], [WORKS; 4]),
    row("encoder unplugged", Fault::Encoder(Encoder::Unplugged), &[], SILENT_ENCODER),
    row("A low for ever", stuck(Wire::A, false), &[], SILENT_ENCODER),
    row("A high", stuck(Wire::A, true), &[], SILENT_ENCODER),
    row("B low", stuck(Wire::B, false), &[], SILENT_ENCODER),
    row("B high", stuck(Wire::B, true), &[], SILENT_ENCODER),
    row("A and B swapped", Fault::Encoder(Encoder::Reversed), &[], BACKWARDS),
    row("converter dead", Fault::ConverterDead, &["battery reads 0 V", "bus: silent"], BLIND),
    // In open loop the motor's voltage is a share of the battery voltage, so its speed changes with the battery.
    row("19 V", Fault::Battery(19.0), &["bus: too high"], [turns(1_350.0, 1_600.0), WORKS, WORKS, WORKS]),
    row("16 V", Fault::Battery(16.0), &["bus: too high"], [turns(1_150.0, 1_350.0), WORKS, WORKS, WORKS]),
    row("6.5 V", Fault::Battery(6.5), &["battery low"], [turns(450.0, 650.0), WORKS, WORKS, WORKS]),
    row("4.5 V", Fault::Battery(4.5), &["battery low", "battery reads 0 V", "bus: too low"], BLIND),
    // The hub reads the DIAG lines of the bridges every 25 ms.
    row("bridge switched itself off", Fault::BridgesOff, &[], [off(85, BRIDGE); 4]),
    row("host silent", Fault::HostSilent, &["keep-alive timeout"], [off(2_555, &[]); 4]),
    row("2 % of its words garbled", Fault::HostGarbled(20_000), &[], [WORKS; 4]),
    row("all garbled", Fault::HostGarbled(1_000_000), &["keep-alive timeout"], [off(2_555, &[]); 4]),
    row("nobody reads the log any more", Fault::LogAbandoned, &[], [WORKS; 4]),
    // The watchdog's time-out is 0.5 s at the emulated LSI of 32 kHz. The time since the last feeding is added.
    row(
        "a task hangs",
        Fault::TaskHangs("capture"),
        &["device reset", "log: started by the watchdog"],
        [off(515, &[]); 4],
    ),
    row(
        "bus error",
        Fault::BusError,
        &["device reset", "log: started by the watchdog", "log: HardFault"],
        [off(2, &[]); 4],
    ),
    row("reset", Fault::ResetPin, &["device reset"], [off(1, &[]); 4]),
    row(
        "nothing connected to the battery's pin",
        Fault::BatteryPinOpen,
        &["battery low", "battery reads 0 V", "bus: too low"],
        BLIND,
    ),
    row(
        "the chip's supply falls",
        Fault::SupplyFalls,
        &["device reset", "log: supply fell", "log: started by the watchdog"],
        [off(1, &[]); 4],
    ),
    // The tests in `h743` check that a break switches the PWM off earlier.
    row(
        "the core locks up",
        Fault::LockUp,
        &["device reset", "log: started by the watchdog"],
        [off(515, &[]); 4],
    ),
    row("reset, and the clocks do not start", Fault::ClocksDoNotStart, &["device reset"], [off(1, &[]); 4]),
];

/// Rows with other results on the H743, and rows that only the H743 has.
pub(crate) static ROWS_OF_H743: [Row; 3] = [
    // ADC1 converts only the battery's channel, so the open pin keeps its charge and its voltage.
    row("nothing connected to the battery's pin", Fault::BatteryPinOpen, &[], [WORKS; 4]),
    row(
        "settings are saved, and the flash shows errors that nobody made",
        Fault::FlashFaulty(ERRORS),
        &[],
        [WORKS; 4],
    ),
    row("settings are saved, and words arrive late", Fault::FlashFaulty(LATE), &[], [WORKS; 4]),
];

/// Names of the rows whose results differ, or may differ, for motors that are configured and brake at faults, and their
/// expected effects if they differ from those in [`ROWS`]. A motor cannot brake without a known battery voltage, without a
/// working bridge, or while the hub does not run.
pub(crate) const CONFIGURED_AND_BRAKE: [(&str, Option<[ExpectedEffect; 4]>); 9] = [
    ("encoder unplugged", Some([WORKS, brakes(250, STUCK), brakes(250, STUCK), brakes(250, STUCK)])),
    ("A and B swapped", Some([WORKS, brakes(300, REVERSED), brakes(300, REVERSED), brakes(300, REVERSED)])),
    ("A makes contact now and then", None),
    ("converter dead", None),
    ("16 V", None),
    ("6.5 V", None),
    ("bridge switched itself off", None),
    ("host silent", Some([brakes(2_555, &[]); 4])),
    ("a task hangs", None),
];
