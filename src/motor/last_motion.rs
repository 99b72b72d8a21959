//! Records the last motion of a shaft: its time, its direction, and the estimate of speed and load at that time.
//!
//! * *Dead band*: the positions up to one count to either side of a centre.
//! * *Motion*: a sample outside of the dead band. The centre then follows, so that the sample is at the edge of the
//!   dead band. The next single count in the same direction is another motion, but a count back is not.
//! * *Toggle*: a change of the position within the dead band. A shaft that rests on an edge of the encoder toggles,
//!   and an encoder with one broken wire toggles at any position.
//! * *Run*: a series of motions in one direction without a long gap.
//! * *Silence*: the time since the last motion, or since the last call of [`LastMotion::forget`], whichever is later.
//!
//! The estimated speed follows the encoder, so it is wrong once the encoder is at fault. The fault may have begun
//! before the last motion. The record therefore keeps the estimate of the motion before the last motion. Of the drive
//! voltages of both motions it uses the larger one.

use super::Command;
use crate::motion::Reading;
use crate::regulator::Regulator;

/// The last motion of a shaft, and the run to which the motion belongs.
///
/// Times are the low 32 bits of microseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LastMotion {
    /// Centre of the dead band, in counts.
    centre: i32,
    /// Time of the newest sample.
    sampled_at: u32,
    /// Time of the last motion.
    moved_at: u32,
    /// Time at which the present run began.
    run_began_at: u32,
    /// Direction of the last motion; `None` before the first motion.
    clockwise: Option<bool>,
    /// Run at the last motion. Its values are positive clockwise.
    run: Run,
    /// Run at the motion before the last motion.
    run_before: Run,
    /// Position at the newest sample, in counts.
    position: i32,
    /// Samples in the silence.
    samples: u16,
    /// Samples in the silence at which the position has changed.
    toggles: u16,
    /// True if there was a motion since the last call of [`take_moved`](Self::take_moved).
    moved: bool,
}

/// Limits of a run.
impl LastMotion {
    /// Time after a motion in which samples are ignored, in µs. The pause saves processor time.
    const PAUSE_US: u32 = 4_000;
    /// Longest time between two successive motions of one run, in µs.
    const GAP_US: u32 = 50_000;
    /// Shortest duration of a steady run, in µs. A motor that its load has pushed back turns for a shorter time.
    const STEADY_US: u32 = 200_000;
    /// Most toggles in a silence of a heavy motor that begins to move: one forward, one back in a probe, and one
    /// because of vibration.
    const CREEPING_TOGGLES: u16 = 3;
    /// Fewest samples in a silence from which creeping is concluded. In fewer samples, as with one sample a tick,
    /// every encoder toggles only a few times.
    const CREEPING_SAMPLES: u16 = 50;
}

/// Speed and load of a run at one of its motions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    /// Estimated speed in counts/s.
    pub(super) speed_cps: f32,
    /// Estimated disturbance in counts/s²: the acceleration by everything but the bridge.
    pub(super) disturbance_cps2: f32,
    /// Drive voltage in volts.
    pub(super) drive_volts: f32,
}

impl LastMotion {
    /// Takes a sample of the encoder. Must be called at each tick; the record is best with a sample every millisecond.
    /// The regulator must take each sample first. `command` is the command of the bridge; `None` for an open bridge.
    pub(super) fn sample(&mut self, reading: &Reading, regulator: &Regulator, command: Option<&Command>) {
        self.sampled_at = reading.at.get() as u32;
        if self.silent_us() < Self::PAUSE_US {
            return;
        }
        let away = reading.position.wrapping_sub(self.centre);
        if (-1..=1).contains(&away) {
            self.samples = self.samples.saturating_add(1);
            self.toggles = self.toggles.saturating_add(u16::from(reading.position != self.position));
            self.position = reading.position;
            return;
        }
        let clockwise = away > 0;
        if self.clockwise != Some(clockwise) || self.silent_us() > Self::GAP_US {
            self.run_began_at = self.sampled_at;
        }
        *self = Self {
            centre: reading.position.wrapping_sub(away.signum()),
            moved_at: self.sampled_at,
            clockwise: Some(clockwise),
            run: Run {
                speed_cps: regulator.speed_cps(),
                disturbance_cps2: regulator.disturbance(),
                drive_volts: command.map_or(0.0, |command| command.limited.voltage.to_volts()),
            },
            run_before: self.run,
            position: reading.position,
            samples: 0,
            toggles: 0,
            moved: true,
            run_began_at: self.run_began_at,
            sampled_at: self.sampled_at,
        };
    }

    /// Returns true if there was a motion since the last call, and forgets this motion.
    pub(super) const fn take_moved(&mut self) -> bool {
        core::mem::replace(&mut self.moved, false)
    }

    /// Time from the last motion, or from [`forget`](Self::forget), to the newest sample, in µs.
    pub(super) const fn silent_us(&self) -> u32 {
        self.sampled_at.wrapping_sub(self.moved_at)
    }

    /// Direction of the last motion. Before the first motion the first direction of
    /// [`assume_driven`](Self::assume_driven), or `None`.
    pub(super) const fn clockwise(&self) -> Option<bool> {
        self.clockwise
    }

    /// Assumes that the voltage turns the motor in this direction, if there was no motion yet. A heavy motor may turn by
    /// less than a count before its direction is reversed.
    pub(super) const fn assume_driven(&mut self, clockwise: bool) {
        if self.clockwise.is_none() {
            self.clockwise = Some(clockwise);
        }
    }

    /// True if the shaft may *creep*: a heavy motor may be starting to move. The silence then has many samples and a
    /// few toggles. An encoder with one broken wire toggles more often on a turning shaft, and an unplugged encoder
    /// does not toggle.
    pub(super) fn may_creep(&self) -> bool {
        self.samples >= Self::CREEPING_SAMPLES && (1..=Self::CREEPING_TOGGLES).contains(&self.toggles)
    }

    /// The steady run before the silence, with values that are positive in the direction of motion. `None` if the run
    /// was in the other direction, was too short or has been forgotten. `None` also if the estimated speed was not in
    /// the direction of the run. The drive voltage is the larger one of the last two motions, because a motor with heavy
    /// friction starts and stops.
    pub(super) fn steady(&self, clockwise: bool) -> Option<Run> {
        let run_us = self.moved_at.wrapping_sub(self.run_began_at);
        let side = if clockwise { 1.0 } else { -1.0 };
        let run = Run {
            speed_cps: side * self.run_before.speed_cps,
            disturbance_cps2: side * self.run_before.disturbance_cps2,
            drive_volts: (side * self.run.drive_volts).max(side * self.run_before.drive_volts),
        };
        let steady = self.clockwise == Some(clockwise) && run_us >= Self::STEADY_US && run.speed_cps > 0.0;
        steady.then_some(run)
    }

    /// Ends the run and begins a silence at the newest sample, so that there is no steady run. Direction and dead
    /// band are kept.
    pub(super) const fn forget(&mut self) {
        (self.run_began_at, self.moved_at) = (self.sampled_at, self.sampled_at);
    }
}
