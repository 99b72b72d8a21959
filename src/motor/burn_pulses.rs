//! Braking that returns no energy to the bus. Two pulses alternate, each some milliseconds long:
//!
//! * **Short:** a full short of the winding. All energy heats the winding, and the motor brakes more than requested.
//! * **Drive:** the motor is driven a little beyond its back EMF. The bridge draws from the bus what the winding returns when
//!   the short ends, and the motor brakes less than requested.
//!
//! ```text
//!             surplus > +1.5 ms x e, and no other motor ends its short now
//!     +-------+ ------------------------------------------------> +-------+
//!     | Short |                                                   | Drive |
//!     +-------+ <------------------------------------------------ +-------+
//!             surplus < -1.5 ms x e
//! ```
//!
//! `surplus` is the integral of requested less applied voltage, signed in the direction of motion: the volt seconds by which
//! the motor was braked too much. On the mean the motor therefore brakes as requested.
//!
//! Nothing else returns no energy: proportional braking returns what it does not dissipate, and so does a bridge that opens.
//! Reverse driving returns nothing, but brakes more than a short does.

use crate::units::Micros;
use crate::units::single::{at_least, at_most};
use libm::sqrtf;

/// Time in us for which a pulse at the whole back EMF may accumulate surplus. Long enough for the energy of a winding to be
/// small, and for a bridge to change its mode; short enough for the speed not to waver.
const PULSE_MICROS: f32 = 1_500.0;

/// Largest surplus in pulses. More, which accumulates while the motor may not end its short, is forgotten.
const LARGEST_SURPLUS: f32 = 4.0;

/// What the bridge does to a motor now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pulse {
    Short,
    Drive,
}

/// The pulses of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct BurnPulses {
    /// Time until which `surplus` is accounted.
    until: Micros,
    /// Volts times microseconds by which the motor was braked too much.
    surplus: f32,
    /// Voltages since `until`.
    voltages: Voltages,
    /// The present pulse; `None` while the motor has the requested voltage. The surplus is kept meanwhile.
    pulse: Option<Pulse>,
    /// Voltage of the last [`Pulse::Drive`].
    drive_volts: f32,
}

/// Voltages of a motor during a pulse, in V.
#[derive(Clone, Copy, Debug)]
pub(super) struct Voltages {
    /// The voltage that a tick requested.
    pub(super) requested: f32,
    /// The voltage that the pulse makes instead.
    pub(super) applied: f32,
    pub(super) emf: f32,
}

impl Voltages {
    const NONE: Self = Self { requested: 0.0, applied: 0.0, emf: 0.0 };
}

impl BurnPulses {
    /// No pulse, and no surplus.
    pub(super) const NONE: Self =
        Self { until: Micros::new(0), surplus: 0.0, voltages: Voltages::NONE, pulse: None, drive_volts: 0.0 };

    /// True during a [`Pulse::Drive`].
    pub(super) fn drives(&self) -> bool {
        self.pulse == Some(Pulse::Drive)
    }

    /// True while pulses replace the requested voltage.
    pub(super) const fn are_active(&self) -> bool {
        self.pulse.is_some()
    }

    /// The motor has the requested voltage from now on; the surplus is kept.
    pub(super) fn pause(&mut self, now: Micros) {
        self.account(now);
        (self.voltages, self.pulse) = (Voltages::NONE, None);
    }

    /// The motor is not to brake: the surplus is forgotten.
    pub(super) const fn stop(&mut self) {
        *self = Self::NONE;
    }

    /// Accounts the present voltages until now.
    pub(super) fn account(&mut self, now: Micros) {
        let passed = now.since(self.until) as u32;
        self.until = self.until.max(now);
        let Voltages { requested, applied, emf } = self.voltages;
        self.surplus += along(requested - applied, emf) * passed as f32;
    }

    /// The next pulse of a motor with this back EMF in V. A motor may end its short only in its turn.
    pub(super) fn next(&mut self, emf: f32, turn: bool) -> Pulse {
        let most = PULSE_MICROS * emf.abs();
        self.surplus = at_most(at_least(self.surplus, -LARGEST_SURPLUS * most), LARGEST_SURPLUS * most);
        match self.pulse {
            None | Some(Pulse::Short) if turn && self.surplus > most => Pulse::Drive,
            Some(Pulse::Drive) if self.surplus >= -most => Pulse::Drive,
            _ => Pulse::Short,
        }
    }

    /// Begins a pulse, or goes on with it. The bridge is open for `change_us` microseconds when the pulse changes.
    pub(super) fn apply(&mut self, pulse: Pulse, voltages: Voltages, change_us: u16) {
        if pulse != self.pulse.unwrap_or(Pulse::Short) {
            self.surplus += along(voltages.applied - voltages.emf, voltages.emf) * f32::from(change_us);
        }
        if pulse == Pulse::Drive {
            self.drive_volts = voltages.applied;
        }
        (self.voltages, self.pulse) = (voltages, Some(pulse));
    }

    /// The voltage beyond the back EMF, in V, whose current heats the winding as much as the pulses do. The pulses heat more
    /// than their mean current.
    pub(super) fn heating(&self) -> f32 {
        let Voltages { requested, emf, .. } = self.voltages;
        let driven = self.drive_volts / emf;
        // At standstill `driven` is infinite or not a number, and nothing heats.
        let share =
            if driven > 1.0 && driven.is_finite() { at_most(requested / emf / driven, 1.0) } else { 0.0 };
        emf.abs() * sqrtf(1.0 - share + share * (driven - 1.0) * (driven - 1.0))
    }
}

/// Volts in the direction in which a motor turns.
fn along(volts: f32, emf: f32) -> f32 {
    if emf < 0.0 { -volts } else { volts }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEYOND: f32 = 1.15;

    /// Returns the mean voltage of a motor, and the mean square of its voltage beyond the back EMF, with a step every
    /// millisecond. A change of mode opens the bridge for `change_us`.
    fn run(emf: f32, wanted: f32, change_us: u16) -> (f32, f32) {
        const MS: u16 = 2_000;
        let mut pulses = BurnPulses::NONE;
        let (mut before, mut mean, mut square) = (Pulse::Short, 0.0, 0.0);
        for ms in 0..MS {
            pulses.account(Micros::new(1_000 * u64::from(ms)));
            let pulse = pulses.next(emf, true);
            let given = if pulse == Pulse::Drive { BEYOND * emf } else { 0.0 };
            pulses.apply(pulse, Voltages { requested: wanted, applied: given, emf }, change_us);
            let open = if pulse == before { 0.0 } else { f32::from(change_us) / 1_000.0 };
            before = pulse;
            mean += (given * (1.0 - open) + emf * open) / f32::from(MS);
            square += (given - emf) * (given - emf) * (1.0 - open) / f32::from(MS);
        }
        assert!((pulses.heating() / square.sqrt() - 1.0).abs() < 0.1 || change_us > 0);
        (mean, square)
    }

    #[test]
    fn on_the_mean_a_motor_has_the_requested_voltage() {
        for emf in [0.5, 5.0, -9.0] {
            for share in [0.02, 0.3, 0.5, 0.8, 0.95] {
                for change_us in [0, 600] {
                    let (mean, _) = run(emf, share * emf, change_us);
                    let miss = (mean - share * emf).abs() / emf.abs();
                    assert!(miss < 0.01, "{emf} V, {share}, {change_us} us: {miss}");
                }
            }
        }
    }

    #[test]
    fn a_pulse_lasts_for_milliseconds() {
        let mut pulses = BurnPulses::NONE;
        let (mut changes, mut before) = (0, Pulse::Short);
        for ms in 0..1_000 {
            pulses.account(Micros::new(1_000 * ms));
            let pulse = pulses.next(6.0, true);
            let given = if pulse == Pulse::Drive { BEYOND * 6.0 } else { 0.0 };
            pulses.apply(pulse, Voltages { requested: 3.0, applied: given, emf: 6.0 }, 0);
            changes += u32::from(pulse != before);
            before = pulse;
        }
        assert!((100..250).contains(&changes), "{changes} in a second");
    }

    #[test]
    fn a_short_ends_only_in_its_turn_and_its_surplus_is_made_up_for() {
        let mut pulses = BurnPulses::NONE;
        let mut look = |ms: u64, turn| {
            pulses.account(Micros::new(1_000 * ms));
            let pulse = pulses.next(6.0, turn);
            let given = if pulse == Pulse::Drive { BEYOND * 6.0 } else { 0.0 };
            pulses.apply(pulse, Voltages { requested: 3.0, applied: given, emf: 6.0 }, 0);
            pulse
        };
        assert!((0..8).all(|ms| look(ms, false) == Pulse::Short));
        let driven = (8..40).take_while(|ms| look(*ms, true) == Pulse::Drive).count();
        assert!((8..12).contains(&driven), "for {driven} ms");
    }
}
