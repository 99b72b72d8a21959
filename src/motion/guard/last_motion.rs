//! When a motor was last heard turning, which way, how fast, and under which load: sample by sample, by ways that one wire
//! alone does not make.
//!
//! A shaft on an edge trembles by a count, and so does an encoder with one broken wire, wherever its shaft goes. What
//! goes beyond that is heard.

use crate::motion::Reading;

/// So often, in microseconds, it is listened to: at every sample nothing more would be known.
const HEARS_US: u32 = 4_000;
/// A motor that is heard so long, in microseconds, with no longer gap, turns by itself and was not thrown.
const STEADY_US: u32 = 200_000;
const GAP_US: u32 = 50_000;
/// The pace is taken over so many counts and so long, at least.
const PACE_COUNTS: u32 = 4;
const PACE_US: u32 = 48_000;

/// A motor that is about to stop becomes slower by more than this from one pace to the next.
const EVEN: f32 = 0.75;

/// What was heard of a motor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heard {
    /// In the middle of where it may tremble.
    centre: i32,
    /// Times in microseconds, of which the low bits are enough: of the newest sample,
    newest: u32,
    /// of the last one in which it was heard,
    at: u32,
    /// since when it was heard the same way without a gap,
    since: u32,
    /// and since when the counts are counted that the next pace will be of.
    counted_since: u32,
    counted: u32,
    /// Counts/s before that, and before that.
    pace: f32,
    pace_before: f32,
    clockwise: Option<bool>,
    /// What was thought to accelerate it besides the bridge when its paces were taken, in counts/s².
    load: f32,
    load_before: f32,
    /// Since somebody asked last.
    lately: bool,
}

/// How a motor turned that is silent now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turned {
    /// Counts/s, the slower of what is known.
    pub(super) pace: f32,
    /// What accelerated it that way besides the bridge, in counts/s².
    pub(super) load: f32,
    /// What the bridge made of it then, in volts that way.
    pub(super) push: f32,
}

impl Heard {
    /// Takes a sample; asks for the load that is thought of then only now and then.
    pub(super) fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.newest = reading.at.get() as u32;
        if self.silent_us() < HEARS_US {
            return;
        }
        let away = reading.position.wrapping_sub(self.centre);
        if !(-1..=1).contains(&away) {
            self.centre = reading.position.wrapping_sub(away.signum());
            self.hear(away > 0, away.unsigned_abs() - 1, load);
        }
    }

    fn hear(&mut self, clockwise: bool, counts: u32, load: impl FnOnce() -> f32) {
        if self.clockwise != Some(clockwise) || self.silent_us() > GAP_US {
            (self.since, self.counted_since, self.counted) = (self.newest, self.newest, 0);
            (self.clockwise, self.pace_before, self.pace) = (Some(clockwise), 0.0, 0.0);
        } else {
            // A wild sample makes a wild pace, once.
            self.counted = self.counted.wrapping_add(counts);
            let took = self.newest.wrapping_sub(self.counted_since);
            if self.counted >= PACE_COUNTS && took >= PACE_US {
                (self.pace_before, self.pace) = (self.pace, per_second(self.counted, took));
                (self.counted_since, self.counted) = (self.newest, 0);
                (self.load_before, self.load) = (self.load, load());
            }
        }
        self.at = self.newest;
        self.lately = true;
    }

    /// Whether it was heard since this was asked last.
    pub(super) const fn lately(&mut self) -> bool {
        core::mem::replace(&mut self.lately, false)
    }

    /// For how many microseconds it has been silent, or nothing has been due.
    pub(super) const fn silent_us(&self) -> u32 {
        self.newest.wrapping_sub(self.at)
    }

    /// Which way it turned last.
    pub(super) const fn clockwise(&self) -> Option<bool> {
        self.clockwise
    }

    /// How it turned this way before it fell silent, when it was pushed by so many volts: if it did so for long, and was not about to stop.
    pub(super) fn turned(&self, clockwise: bool, push: f32) -> Option<Turned> {
        if self.clockwise != Some(clockwise) || self.at.wrapping_sub(self.since) < STEADY_US {
            return None;
        }
        // It may have become slower since its pace was taken, but for what trembles when a wire breaks.
        let took = self.at.wrapping_sub(self.counted_since).saturating_sub(2 * HEARS_US);
        let slower = self.counted > 0 && took > 0;
        let pace =
            if slower { self.pace.min(per_second(self.counted.saturating_add(1), took)) } else { self.pace };
        let along = |value: f32| if clockwise { value } else { -value };
        // What is thought of the load just after a wire has broken is wrong.
        let turned = Turned { pace, load: along(self.load_before), push: along(push) };
        (pace >= EVEN * self.pace_before).then_some(turned)
    }

    /// What it did says nothing any more of what it should do.
    pub(super) const fn forget(&mut self) {
        (self.since, self.at) = (self.newest, self.newest);
    }
}

fn per_second(counts: u32, micros: u32) -> f32 {
    1e6 * counts as f32 / micros as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Micros;

    /// A motor that is at these counts, millisecond by millisecond.
    fn heard(counts: impl Iterator<Item = i32>) -> Heard {
        let mut heard = Heard::default();
        for (at, position) in (1u64..).map(|ms| Micros::new(1_000 * ms)).zip(counts) {
            heard.sample(&Reading { position, edge_at: at, at }, || 0.0);
        }
        heard
    }

    /// At this many counts/s until so many milliseconds before the end, and then between two counts.
    fn silent(cps: f64, ms: i32) -> Heard {
        let turning = (0..1_000).map(move |ms| (cps * f64::from(ms) / 1e3) as i32);
        let last = (cps * 0.999) as i32;
        heard(turning.chain((0..ms).map(move |ms| last - ms % 2)))
    }

    #[test]
    fn a_count_to_and_fro_is_not_heard() {
        let mut trembles = heard([0, 1, 0, -1].into_iter().cycle().take(500));
        assert!(!trembles.lately());
        assert_eq!(trembles.clockwise(), None);
    }

    #[test]
    fn what_turned_evenly_and_fell_silent_is_known_by_its_pace() {
        for cps in [60.0, -60.0, 1_000.0, -5_000.0] {
            let heard = silent(cps, 80);
            let pace = f64::from(heard.turned(cps > 0.0, 0.0).map_or(0.0, |turned| turned.pace));
            assert!((pace / cps.abs() - 1.0).abs() < 0.2, "{pace} of {cps}");
            assert!(heard.turned(cps < 0.0, 0.0).is_none());
            // The last count may have come some time before, and the first of the trembling may be heard.
            let silent_ms = heard.silent_us() / 1_000;
            assert!((74..=82 + (1e3 / cps.abs()) as u32).contains(&silent_ms), "{silent_ms} ms of {cps}");
        }
    }

    #[test]
    fn what_was_about_to_stop_or_has_just_begun_says_nothing_of_what_it_should_do() {
        // From 400 counts/s to rest within a tenth of a second.
        let braked = |ms: i32| {
            let t = f64::from(ms.clamp(500, 600) - 500) / 1e3;
            (0.4 * f64::from(ms.min(500)) + 400.0 * (t - 5.0 * t * t)) as i32
        };
        assert!(heard((0..700).map(braked)).turned(true, 0.0).is_none());
        assert!(heard((0..300).map(|ms| ms.clamp(100, 200))).turned(true, 0.0).is_none());
    }
}
