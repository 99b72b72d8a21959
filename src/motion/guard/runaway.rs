//! A motor that turns the wrong way against all that control can do: does it slow down?

use super::{DUE_COUNTS, EncoderFault, Evidence, Finding};
use crate::units::{Control, CountsPerSecond};
use libm::sqrtf;

/// Whether a runaway slows down is told from two times that follow each other: this,
const RUNAWAY_EARLY_MS: i64 = 50;
/// (longer by what a shorter tick leaves of the time that there is: a springy stop that throws a motor back takes so
/// long),
const LONGER_BY_MS: i64 = 50;
/// and this, enough to be sure,
const RUNAWAY_LATE_MS: i64 = 100;
/// or this, enough to insist on full reverse.
const RUNAWAY_HINT_MS: i64 = 50;
/// Counts in 50 ms of the first, at least, if that is to be told: 160 counts/s.
const RUNAWAY_COUNTS: i64 = 8;
/// At this voltage [`DUE_COUNTS`] are due; a motor for which that takes longer than [`QUICK_MS`] is given so much more
/// time.
const DUE_VOLTS: f32 = 6.0;
const QUICK_MS: i64 = 150;
/// But never more.
const LONGEST_MS: i64 = 2_000;

/// Counts in a time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Span {
    pub(super) ms: i64,
    pub(super) counts: i64,
}

impl Span {
    fn plus(self, other: Self) -> Self {
        Self { ms: self.ms + other.ms, counts: self.counts + other.counts }
    }

    /// Fewer counts a millisecond.
    fn is_slower_than(self, other: Self) -> bool {
        self.counts * other.ms < other.counts * self.ms
    }
}

/// A motor that turns the wrong way against full effort: does it slow down?
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Runaway {
    clockwise: bool,
    early: Span,
    /// While the bridge is in full reverse, if that is insisted on.
    late: Span,
    insisting: bool,
}

impl Runaway {
    /// There was a tick of it.
    pub(super) const fn has_begun(&self) -> bool {
        self.early.ms != 0
    }

    /// Another tick of it.
    pub(super) fn step(&mut self, tick: Span, evidence: &Evidence) -> Finding {
        // What turns round has obeyed, even if it swings, and goes the wrong way again.
        let clockwise = evidence.velocity >= CountsPerSecond::ZERO;
        if clockwise != self.clockwise {
            *self = Self { clockwise, ..Self::default() };
        }
        let more_ms = slowness(evidence.gain);
        let control = evidence.order.control;
        let insist = Finding::Insist(if control < Control::ZERO { Control::MIN } else { Control::MAX });
        let longer_ms = if evidence.gentle { 0 } else { (LONGER_BY_MS - tick.ms).max(0) };
        if self.early.ms < RUNAWAY_EARLY_MS + longer_ms + more_ms {
            self.early = self.early.plus(tick);
            return Finding::Sound;
        }
        self.late = self.late.plus(tick);
        let in_doubt = evidence.gentle && !self.insisting;
        if self.late.ms < more_ms + if in_doubt { RUNAWAY_HINT_MS } else { RUNAWAY_LATE_MS } {
            return if self.insisting { insist } else { Finding::Sound };
        }
        if 50 * self.early.counts < RUNAWAY_COUNTS * self.early.ms || self.late.is_slower_than(self.early) {
            *self = Self::default();
            Finding::Sound
        } else if in_doubt {
            *self =
                Self { early: self.early.plus(self.late), late: Span::default(), insisting: true, clockwise };
            insist
        } else {
            Finding::Fault(EncoderFault::Reversed)
        }
    }
}

/// What is added to each time for a motor that is so slow to answer: `sqrt(2 counts / acceleration)`, from rest.
fn slowness(gain: Option<f32>) -> i64 {
    let Some(gain) = gain else { return 0 };
    let ms = (1_000.0 * sqrtf(2.0 * DUE_COUNTS / (DUE_VOLTS * gain))) as i64;
    if ms > QUICK_MS { ms.min(LONGEST_MS) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::super::Order;
    use super::*;
    use crate::braking::{Regime, Winding};
    use crate::units::Voltage;

    /// What comes of full reverse against these speeds, a tick of 50 ms each.
    fn judged(speeds: impl Iterator<Item = i32>) -> Finding {
        let mut runaway = Runaway::default();
        let judge = |speed: i32| {
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
        speeds.map(judge).find(|finding| *finding != Finding::Sound).unwrap_or(Finding::Sound)
    }

    #[test]
    fn what_does_not_slow_down_has_a_reversed_encoder() {
        for speed in [400, -400] {
            assert_eq!(judged([speed; 8].into_iter()), Finding::Fault(EncoderFault::Reversed));
        }
    }

    #[test]
    fn what_swings_to_and_fro_by_full_reverse_obeys_it() {
        assert_eq!(judged([400, 420, -400, -420].into_iter().cycle().take(80)), Finding::Sound);
    }
}
