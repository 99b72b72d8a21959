//! Finds a reversed encoder: the motor turns in the wrong direction against full control, and does not slow down.
//!
//! The speed is compared in two spans of time, *early* and *late*. A late span that is slower ends the check. In a
//! scheme whose control range may end before full reverse, the check is repeated in full reverse: it *insists*.

use super::{EXPECTED_COUNTS, EncoderFault, Evidence, Finding};
use crate::units::{Control, CountsPerSecond};
use libm::sqrtf;

/// Limits of the check for a runaway.
struct RunawayLimits {
    /// Length of the early span, in ms.
    early_ms: i64,
    /// Extension of the early span plus one tick, in ms: a tick of 10 ms extends the span by 40 ms. A springy stop throws
    /// a motor back for that long. Schemes C and D have no extension.
    extension_ms: i64,
    /// Length of the late span before a fault, in ms.
    late_ms: i64,
    /// Length of the late span before full reverse, in ms. It applies to Schemes C and D.
    hint_ms: i64,
    /// Fewest counts in 50 ms of the early span: 160 counts/s.
    counts_in_50_ms: i64,
    /// Drive voltage at which a slow motor's time for [`EXPECTED_COUNTS`] is computed, in volts.
    drive_volts: f32,
    /// Time for [`EXPECTED_COUNTS`] above which a motor is slow, in ms. The spans of a slow motor are longer by that
    /// time.
    slow_ms: i64,
    /// Longest extension of the spans of a slow motor, in ms.
    longest_ms: i64,
}

const LIMITS: RunawayLimits = RunawayLimits {
    early_ms: 50,
    extension_ms: 50,
    late_ms: 100,
    hint_ms: 50,
    counts_in_50_ms: 8,
    drive_volts: 6.0,
    slow_ms: 150,
    longest_ms: 2_000,
};

/// A span of time, and the counts in it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Span {
    /// Length in ms.
    pub(super) ms: i64,
    /// Counts in the direction of motion.
    pub(super) counts: i64,
}

impl Span {
    /// The sum of two spans.
    fn plus(self, other: Self) -> Self {
        Self { ms: self.ms + other.ms, counts: self.counts + other.counts }
    }

    /// True if the mean speed of this span is below the mean speed of the other.
    fn is_slower_than(self, other: Self) -> bool {
        self.counts * other.ms < other.counts * self.ms
    }
}

/// The check of one motor for a reversed encoder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Runaway {
    /// True if the motor turns clockwise.
    clockwise: bool,
    early: Span,
    late: Span,
    /// True while the bridge is put in full reverse.
    insisting: bool,
}

impl Runaway {
    /// True if the check has taken a tick.
    pub(super) const fn has_begun(&self) -> bool {
        self.early.ms != 0
    }

    /// Takes a tick in which the motor ran away.
    pub(super) fn step(&mut self, tick: Span, evidence: &Evidence) -> Finding {
        // A motor that reversed has followed its drive, even if it swings back later.
        let clockwise = evidence.velocity >= CountsPerSecond::ZERO;
        if clockwise != self.clockwise {
            *self = Self { clockwise, ..Self::default() };
        }
        let slow_ms = slow_ms(evidence.gain);
        let control = evidence.order.control;
        let insist = Finding::Insist(if control < Control::ZERO { Control::MIN } else { Control::MAX });
        let extension_ms = if evidence.gentle { 0 } else { (LIMITS.extension_ms - tick.ms).max(0) };
        if self.early.ms < LIMITS.early_ms + extension_ms + slow_ms {
            self.early = self.early.plus(tick);
            return Finding::Sound;
        }
        self.late = self.late.plus(tick);
        let undecided = evidence.gentle && !self.insisting;
        if self.late.ms < slow_ms + if undecided { LIMITS.hint_ms } else { LIMITS.late_ms } {
            return if self.insisting { insist } else { Finding::Sound };
        }
        if 50 * self.early.counts < LIMITS.counts_in_50_ms * self.early.ms
            || self.late.is_slower_than(self.early)
        {
            *self = Self::default();
            Finding::Sound
        } else if undecided {
            *self =
                Self { early: self.early.plus(self.late), late: Span::default(), insisting: true, clockwise };
            insist
        } else {
            Finding::Fault(EncoderFault::Reversed)
        }
    }
}

/// Extension of each span for a slow motor, in ms: the time from rest for [`EXPECTED_COUNTS`],
/// `sqrt(2 counts / acceleration)`. It is 0 for other motors and for unknown ones.
fn slow_ms(gain: Option<f32>) -> i64 {
    let Some(gain) = gain else { return 0 };
    let ms = (1_000.0 * sqrtf(2.0 * EXPECTED_COUNTS / (LIMITS.drive_volts * gain))) as i64;
    if ms > LIMITS.slow_ms { ms.min(LIMITS.longest_ms) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::super::Order;
    use super::*;
    use crate::braking::{Regime, Winding};
    use crate::units::Voltage;

    /// The first finding other than [`Finding::Sound`], for these speeds in full reverse, one each 50 ms.
    fn finding_of(speeds: impl Iterator<Item = i32>) -> Finding {
        let mut runaway = Runaway::default();
        let step = |speed: i32| {
            let velocity = CountsPerSecond::new(speed);
            let order = Order {
                target: CountsPerSecond::ZERO,
                control: if speed > 0 { Control::MIN } else { Control::MAX },
                regime: Regime::Reverse,
                push: Voltage::from_volts(if speed > 0 { -12.0 } else { 12.0 }),
                velocity,
            };
            let evidence = Evidence {
                order,
                moved: speed / 20,
                velocity,
                battery: 12.0,
                gain: None,
                volt: 1_500.0,
                emf: Winding::NEVEREST_60.emf,
                gentle: false,
                probing: true,
            };
            runaway.step(Span { ms: 50, counts: i64::from(speed.abs() / 20) }, &evidence)
        };
        speeds.map(step).find(|finding| *finding != Finding::Sound).unwrap_or(Finding::Sound)
    }

    #[test]
    fn a_motor_that_does_not_slow_down_in_full_reverse_has_a_reversed_encoder() {
        for speed in [400, -400] {
            assert_eq!(finding_of([speed; 8].into_iter()), Finding::Fault(EncoderFault::Reversed));
        }
    }

    #[test]
    fn a_motor_that_swings_to_and_fro_in_full_reverse_is_sound() {
        assert_eq!(finding_of([400, 420, -400, -420].into_iter().cycle().take(80)), Finding::Sound);
    }
}
