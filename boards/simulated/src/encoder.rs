//! Quadrature encoders and their two wires, A and B. An encoder turns counts of a shaft into levels of the wires; a
//! decoder turns the levels back into counts, as a timer does.
//!
//! ```
//! use simulated::encoder::{Decoder, Encoder, Wire};
//! use std::num::NonZeroU32;
//!
//! let turn = |encoder: Encoder| {
//!     let mut decoder = Decoder::default();
//!     (0..=28).for_each(|count| decoder.update(encoder.levels(count, None)));
//!     decoder.count
//! };
//! assert_eq!(turn(Encoder::Sound), 28);
//! // The count changes by one and back, and does not grow.
//! assert_eq!(turn(Encoder::Stuck { wire: Wire::A, high: false }), 0);
//! // One of seven slots is missing.
//! assert_eq!(turn(Encoder::MissingSlot { of: NonZeroU32::MIN.saturating_add(6) }), 24);
//! ```

use std::num::NonZeroU32;

/// Levels of A and B; true is high.
pub type Levels = [bool; 2];

/// Counts per slot of the encoder's disc.
const SLOT: i64 = 4;
/// Shortest and longest duration of a glitch in nanoseconds.
const GLITCH_NS: (u64, u64) = (200, 500);
/// Shortest and longest time in nanoseconds in which a loose wire has no contact.
const BROKEN_NS: (u64, u64) = (1_000_000, 60_000_000);
/// Shortest and longest time in nanoseconds in which a loose wire has contact.
const MADE_NS: (u64, u64) = (1_000_000, 200_000_000);
/// One second in nanoseconds.
const SECOND_NS: u64 = 1_000_000_000;

/// One of the two wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    /// Leads while the count goes up.
    A,
    /// Follows A while the count goes up.
    B,
}

/// Condition of an encoder and its wires. A line that is not driven is pulled up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoder {
    /// Encoder and wires work.
    #[default]
    Sound,
    /// A and B are swapped.
    Reversed,
    /// No wire is connected.
    Unplugged,
    /// One wire is stuck at a level.
    Stuck {
        /// The wire.
        wire: Wire,
        /// True if the wire is stuck high.
        high: bool,
    },
    /// A wire has contact for 1 to 200 ms, then no contact for 1 to 60 ms, and so on at random.
    Loose {
        /// The wire.
        wire: Wire,
    },
    /// Either wire has the wrong level for 200 to 500 ns, at random.
    Glitches {
        /// Mean number of glitches per second.
        per_second: NonZeroU32,
    },
    /// One slot of the wheel is missing, with its counts.
    MissingSlot {
        /// Number of slots per turn.
        of: NonZeroU32,
    },
}

impl Encoder {
    /// Returns the levels of the wires at a count of the shaft. The `disturbed` wire has no contact, or a glitch.
    pub fn levels(self, count: i64, disturbed: Option<Wire>) -> Levels {
        // The levels of ascending counts are 00, 10, 11, 01.
        let phase = count.rem_euclid(SLOT);
        let [a, b] = [phase == 1 || phase == 2, phase >= 2];
        let with = |wire, level| if wire == Wire::A { [level, b] } else { [a, level] };
        match (self, disturbed) {
            (Self::Reversed, _) => [b, a],
            (Self::Unplugged, _) => [true; 2],
            (Self::Stuck { wire, high }, _) => with(wire, high),
            (Self::Loose { .. }, Some(wire)) => with(wire, true),
            (Self::Glitches { .. }, Some(Wire::A)) => [!a, b],
            (Self::Glitches { .. }, Some(Wire::B)) => [a, !b],
            (Self::MissingSlot { of }, _) => {
                let missing = count.div_euclid(SLOT).rem_euclid(of.get().into()) == 0;
                [a && !missing, b && !missing]
            }
            (Self::Sound | Self::Loose { .. } | Self::Glitches { .. }, _) => [a, b],
        }
    }

    /// Returns random disturbances of the wires, from a time in nanoseconds on.
    pub fn disturbances(self, seed: u64) -> Disturbances {
        Disturbances { encoder: self, random: fastrand::Rng::with_seed(seed), disturbed: None, at_ns: 0 }
    }
}

/// Iterates over ascending times in nanoseconds, each with the wire that is disturbed from this time on. The
/// disturbances of loose wires and glitches never end. Other encoders have no disturbances.
#[derive(Clone, Debug)]
pub struct Disturbances {
    encoder: Encoder,
    random: fastrand::Rng,
    disturbed: Option<Wire>,
    at_ns: u64,
}

impl Iterator for Disturbances {
    type Item = (u64, Option<Wire>);

    fn next(&mut self) -> Option<Self::Item> {
        let begins = self.disturbed.is_none();
        let ((least, most), wire) = match self.encoder {
            Encoder::Loose { wire } => (if begins { MADE_NS } else { BROKEN_NS }, wire),
            Encoder::Glitches { per_second } => {
                let mean = SECOND_NS / u64::from(per_second.get());
                let wire = if self.random.bool() { Wire::A } else { Wire::B };
                (if begins { (mean / 2, mean / 2 * 3) } else { GLITCH_NS }, wire)
            }
            _ => return None,
        };
        self.at_ns += self.random.u64(least..=most).max(1);
        self.disturbed = begins.then_some(wire);
        Some((self.at_ns, self.disturbed))
    }
}

/// A timer in encoder mode without a filter: it counts every edge of both wires.
#[derive(Clone, Copy, Debug, Default)]
pub struct Decoder {
    levels: Levels,
    /// Count since the start.
    pub count: i64,
}

impl Decoder {
    /// Updates the count from the new levels of the wires. If both wires change together, the direction is unknown, and
    /// nothing is counted.
    pub fn update(&mut self, levels: Levels) {
        let place = |[a, b]: Levels| match (a, b) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3_i64,
        };
        match (place(levels) - place(self.levels)).rem_euclid(SLOT) {
            1 => self.count += 1,
            3 => self.count -= 1,
            _ => {}
        }
        self.levels = levels;
    }
}

/// An encoder on a shaft, with the timer that counts it.
#[derive(Clone, Debug)]
pub(crate) struct Counter {
    encoder: Encoder,
    to_come: std::iter::Peekable<Disturbances>,
    /// Time of the last change of condition. Disturbances have times since this time.
    since_ns: u64,
    disturbed: Option<Wire>,
    decoder: Decoder,
    /// Count of the shaft at the time `now_ns`.
    shaft: i64,
    now_ns: u64,
    seed: u64,
}

impl Counter {
    /// A sound encoder at count 0.
    pub(crate) fn new(seed: u64) -> Self {
        let to_come = Encoder::Sound.disturbances(seed).peekable();
        let decoder = Decoder::default();
        Self {
            encoder: Encoder::Sound,
            to_come,
            since_ns: 0,
            disturbed: None,
            decoder,
            shaft: 0,
            now_ns: 0,
            seed,
        }
    }

    /// Changes the condition of the encoder.
    pub(crate) fn connect(&mut self, encoder: Encoder) {
        if encoder != self.encoder {
            self.encoder = encoder;
            self.to_come = encoder.disturbances(self.seed).peekable();
            (self.since_ns, self.disturbed) = (self.now_ns, None);
            self.show();
        }
    }

    /// Turns the shaft evenly to a count, within a time in nanoseconds.
    pub(crate) fn turn(&mut self, shaft: i64, ns: u64) {
        let (from, way) = (self.shaft, shaft - self.shaft);
        let end = self.now_ns + ns;
        let since = self.since_ns;
        while let Some((at, wire)) = self.to_come.next_if(|(at, _)| since + at <= end) {
            let passed = (since + at).saturating_sub(self.now_ns) as f64 / ns.max(1) as f64;
            self.turn_to(from + (way as f64 * passed) as i64);
            self.disturbed = wire;
            self.show();
        }
        self.turn_to(shaft);
        self.now_ns = end;
    }

    fn turn_to(&mut self, shaft: i64) {
        while self.shaft != shaft {
            self.shaft += (shaft - self.shaft).signum();
            self.show();
        }
    }

    fn show(&mut self) {
        self.decoder.update(self.encoder.levels(self.shaft, self.disturbed));
    }

    pub(crate) const fn count(&self) -> i64 {
        self.decoder.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of a timer while a shaft turns by one count per millisecond for ten seconds.
    fn counted(encoder: Encoder) -> i64 {
        let mut counter = Counter::new(1);
        counter.connect(encoder);
        (1..=10_000).for_each(|count| counter.turn(count, 1_000_000));
        counter.count()
    }

    #[test]
    fn a_sound_encoder_counts_both_ways() {
        let mut counter = Counter::new(1);
        for (shaft, ns) in [(5, 1_000_000), (-3, 1_000_000), (40_000, 1_000_000), (0, 7)] {
            counter.turn(shaft, ns);
            assert_eq!(counter.count(), shaft);
        }
    }

    #[test]
    fn a_broken_encoder_counts_as_its_fault_makes_it() {
        let stuck = |wire, high| Encoder::Stuck { wire, high };
        for (encoder, counts) in [
            (Encoder::Reversed, -10_000..=-10_000),
            (Encoder::Unplugged, -1..=1),
            (stuck(Wire::A, false), -1..=1),
            (stuck(Wire::A, true), -1..=1),
            (stuck(Wire::B, false), -1..=1),
            (stuck(Wire::B, true), -1..=1),
            // The wire has no contact for 30 of 130 ms on average.
            (Encoder::Loose { wire: Wire::B }, 6_000..=8_999),
        ] {
            let counted = counted(encoder);
            assert!(counts.contains(&counted), "{encoder:?}: {counted}");
        }
    }

    #[test]
    fn glitches_come_as_often_as_wanted_and_each_is_a_count_and_back() {
        for rate in [20, 200] {
            let glitches = Encoder::Glitches { per_second: NonZeroU32::new(rate).expect("some") };
            let begun = glitches.disturbances(1).take_while(|(at, _)| *at < 10 * SECOND_NS);
            let begun = begun.filter(|(_, wire)| wire.is_some()).count() as f64 / 10.0;
            assert!((begun / f64::from(rate) - 1.0).abs() < 0.1, "{begun} a second");
            // The last sample may fall into a glitch; then the count is off by one.
            assert!((counted(glitches) - 10_000).abs() <= 1);
        }
    }

    #[test]
    fn an_encoder_that_is_repaired_counts_on_from_where_it_is() {
        let mut counter = Counter::new(1);
        counter.turn(100, 1_000_000);
        counter.connect(Encoder::Unplugged);
        counter.turn(200, 1_000_000);
        let lost = counter.count();
        counter.connect(Encoder::Sound);
        counter.turn(300, 1_000_000);
        assert!((lost - 100).abs() <= 2 && (counter.count() - lost - 100).abs() <= 2);
    }
}
