//! Decides when the current-sense line of a bridge shows the motor's current, and whether the line works.
//!
//! A bridge of the VNH5019 kind senses in its high-side switches (data sheet Doc ID 15701, tables 9 and 11). In 9/8 and
//! 6/2 one of the high-side switches is closed throughout the PWM period, during the duty and while freewheeling. The
//! line then shows the motor's current all the time, and the mean of the line is the motor's mean current. In 5/0 no
//! high-side switch is closed, and the line shows no current. The hub then uses the modelled current. At 3 A the line
//! shows 0.7 to 1.5 times the current, depending on the chip.
//!
//! ```text
//! Absent ──a sample──▶ Sound ◀──4 contradictions in a row──▶ NoCurrent, Stuck, Excessive
//!    ▲                                                              │
//!    └──────────── from every state: the converter does not answer ─┘
//! ```

use crate::bridge::Mode;
use crate::units::Milliamperes;

/// Condition of a motor's current-sense line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum SenseLine {
    /// There is no line, or its converter does not answer.
    #[default]
    Absent,
    /// The line works; its current is used.
    Sound,
    /// The line shows no current while the modelled current is at least 1 A: the line or a lead of the motor is
    /// broken. The line is not used.
    #[cfg_attr(feature = "serde", serde(rename = "silent"))]
    NoCurrent,
    /// The line shows a current in 5/0, in which a bridge shows no current. The line is not used.
    Stuck,
    /// The line shows far more than the modelled current: the configured constants are wrong for this motor, or the
    /// winding is shorted. The line is used.
    Excessive,
}

/// Number of successive samples that must contradict the condition of a line before the condition changes. Samples in
/// 5/0 are counted apart from samples in 9/8 and 6/2.
const CONFIRMATIONS: u8 = 4;

/// A line that shows less than this current, in mA, shows no current. The value is above a converter's offset, and
/// below the current of any motor that turns.
const NOTHING_MA: u32 = 50;
/// Least modelled current, in mA, at which a line must show a current.
const DUE_MA: u32 = 1_000;
/// Largest leakage current, in mA, that the line of a bridge in 5/0 shows.
const LEAKAGE_MA: u32 = 300;

/// Largest plausible current on the line for a modelled current, both in mA. The motor may draw twice the modelled
/// current, and the line may show 1.5 times the motor's current. 2 A are added as a margin.
const fn largest_plausible(modelled_ma: u32) -> u32 {
    modelled_ma.saturating_mul(3).saturating_add(2_000)
}

/// State of one motor's line.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SenseLineMonitor {
    condition: SenseLine,
    /// Samples in 9/8 or 6/2 in a row that contradict the condition.
    driving_contradictions: u8,
    /// Samples in 5/0 in a row that contradict the condition.
    braking_contradictions: u8,
    /// Mode of the bridge at the last sample; `None` during burn pulses.
    mode: Option<Mode>,
    /// Current that the last sample shows; `None` if the sample is no measurement of the motor's current.
    shown: Option<Milliamperes>,
    /// Samples in 9/8 or 6/2 that have shown a current, up to [`CONFIRMATIONS`]. With fewer samples the line may be
    /// shorted to ground, so that a sample without a current is no measurement.
    current_shown_count: u8,
}

impl SenseLineMonitor {
    /// Takes a sample. `shown` is `None` if the converter does not answer. `mode` is the mode of the bridge; `None`
    /// during burn pulses, because the mode then changes within milliseconds. `modelled` is the current by the motor's
    /// constants; `None` if the speed is unknown.
    pub(super) fn step(
        &mut self,
        shown: Option<Milliamperes>,
        mode: Option<Mode>,
        modelled: Option<Milliamperes>,
    ) {
        // A mode that has changed since the last sample may have changed within this sample. Such a sample is not used.
        let settled = mode.filter(|_| mode == self.mode);
        (self.mode, self.shown) = (mode, None);
        let Some(current) = shown else {
            self.change_condition(SenseLine::Absent);
            self.current_shown_count = 0;
            return;
        };
        if self.condition == SenseLine::Absent {
            self.condition = SenseLine::Sound;
        }
        let Some(mode) = settled else { return };
        let magnitude = current.get().unsigned_abs();
        let found = if mode == Mode::Brake50 {
            Some(in_braking(magnitude))
        } else {
            let shows = magnitude >= NOTHING_MA;
            self.current_shown_count = CONFIRMATIONS.min(self.current_shown_count + u8::from(shows));
            self.shown = shown.filter(|_| shows || self.current_shown_count == CONFIRMATIONS);
            modelled.and_then(|modelled| in_driving(magnitude, modelled.get().unsigned_abs()))
        };
        if let Some(found) = found {
            self.judge(found, mode == Mode::Brake50);
        }
    }

    /// The condition of the line.
    pub(super) const fn condition(&self) -> SenseLine {
        self.condition
    }

    /// Magnitude of the motor's mean current while the bridge is in this mode. `None` if the last sample was taken in
    /// another mode or is no measurement, or if the line is not used.
    pub(super) fn measured(&self, mode: Mode) -> Option<Milliamperes> {
        let used = matches!(self.condition, SenseLine::Sound | SenseLine::Excessive);
        self.shown.filter(|_| used && self.mode == Some(mode))
    }

    /// Takes the condition `found` by a sample. Changes the condition of the line after [`CONFIRMATIONS`] samples in a
    /// row that contradict the present condition. Samples in 5/0 (`braking`) end every condition if they show a stuck
    /// line, and otherwise only Stuck. Samples in 9/8 or 6/2 do not end Stuck. Samples in 5/0 are counted apart from
    /// other samples, because a motor may change between braking and driving before it has four samples of one mode.
    fn judge(&mut self, found: SenseLine, braking: bool) {
        let proves = match self.condition {
            SenseLine::Stuck => braking,
            SenseLine::NoCurrent | SenseLine::Excessive => !braking || found == SenseLine::Stuck,
            SenseLine::Absent | SenseLine::Sound => true,
        };
        let contradictions =
            if braking { &mut self.braking_contradictions } else { &mut self.driving_contradictions };
        if found == self.condition || !proves {
            *contradictions = 0;
            return;
        }
        *contradictions += 1;
        if *contradictions >= CONFIRMATIONS {
            self.change_condition(found);
            if matches!(found, SenseLine::NoCurrent | SenseLine::Stuck) {
                self.current_shown_count = 0;
            }
        }
    }

    const fn change_condition(&mut self, condition: SenseLine) {
        self.condition = condition;
        (self.driving_contradictions, self.braking_contradictions) = (0, 0);
    }
}

/// Condition of a line that shows this current in 5/0, in mA.
const fn in_braking(ma: u32) -> SenseLine {
    if ma > LEAKAGE_MA { SenseLine::Stuck } else { SenseLine::Sound }
}

/// Condition of a line that shows this current in 9/8 or 6/2, in mA. `None` if the line shows no current, and the
/// modelled current is too small for a current to be due. A line that shows less than the modelled current works: the
/// motor may be another motor than configured.
const fn in_driving(ma: u32, modelled_ma: u32) -> Option<SenseLine> {
    match (ma < NOTHING_MA, modelled_ma >= DUE_MA) {
        (true, true) => Some(SenseLine::NoCurrent),
        (true, false) => None,
        (false, _) if ma > largest_plausible(modelled_ma) => Some(SenseLine::Excessive),
        (false, _) => Some(SenseLine::Sound),
    }
}
