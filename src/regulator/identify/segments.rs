//! Divides a motion into segments, over which the motor's equation holds for mean values.
//!
//! A segment lasts some 40 ms or longer. The fit uses the mean values of a segment: the speed w, the position P, the
//! running integral F of the voltage, and the time G. Two successive segments obey the motor's equation exactly, also
//! if the voltage has changed within them. Primes mark the second segment; b is the acceleration per volt, q the decay,
//! c the friction in V, and load the acceleration by the load:
//!
//! ```text
//! w' - w = b (F' - F) - q (P' - P) - (c b sign(w) - load) (G' - G)
//! ```

use super::super::observer::SAMPLE_S;
use crate::motion::Reading;
use crate::units::Micros;

/// A segment is used if the motor moved by more than this distance, in counts.
const LEAST_COUNTS: f32 = 2.0;

/// A segment: its start, and its integrals up to its end or, while the segment runs, up to the last sample.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Position at the start, in counts.
    start: i32,
    /// Position within the count at the start, 0 to 1.
    start_fraction: f32,
    /// Time since the start, in s.
    seconds: f32,
    /// Integral of the voltage since the start, in V s.
    volt_seconds: f32,
    /// Integral of `volt_seconds`, in V s².
    volt_seconds_integral: f32,
    /// Integral of the distance from the start, in counts s.
    count_seconds: f32,
}

impl Segment {
    const fn new(start: i32, start_fraction: f32) -> Self {
        Self {
            start,
            start_fraction,
            seconds: 0.0,
            volt_seconds: 0.0,
            volt_seconds_integral: 0.0,
            count_seconds: 0.0,
        }
    }

    /// Whole counts from the start of this segment to the start of the `next`, negative in the backward direction.
    fn moved(&self, next: &Self) -> f32 {
        next.start.wrapping_sub(self.start) as f32
    }

    /// Mean speed of this segment, which ends where the `next` starts, in counts/s.
    fn speed(&self, next: &Self) -> f32 {
        (self.moved(next) + next.start_fraction - self.start_fraction) / self.seconds
    }
}

/// Divides the samples of a motion into segments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segments {
    /// Position of the first sample, in counts.
    origin: i32,
    /// Last sample.
    last: Reading,
    /// Direction of the last count, -1 or 1; 0 before the first count.
    direction: f32,
    /// Time of the last motion; before the first motion, time of the first sample. A single count in the other
    /// direction is no motion, because an encoder with one broken wire toggles by one count.
    moved_at: Micros,
    /// Voltage across the motor, in V.
    voltage: f32,
    running: Segment,
    /// The segment before the running segment; `None` in the first segment.
    before: Option<Segment>,
}

impl Segments {
    /// Begins the first segment with a sample.
    pub(super) const fn new(reading: Reading) -> Self {
        Self {
            origin: reading.position,
            last: reading,
            direction: 0.0,
            moved_at: reading.at,
            voltage: 0.0,
            running: Segment::new(reading.position, 0.5),
            before: None,
        }
    }

    /// Sets the voltage in V that the bridge applies from now on.
    pub(super) const fn set_voltage(&mut self, voltage: f32) {
        self.voltage = voltage;
    }

    /// Counts since the first sample.
    pub(super) const fn moved(&self) -> i32 {
        self.last.position.wrapping_sub(self.origin)
    }

    /// The time of the last sample.
    pub(super) const fn now(&self) -> Micros {
        self.last.at
    }

    /// Duration in s and counts of the running segment.
    pub(super) const fn running(&self) -> (f32, i32) {
        (self.running.seconds, self.last.position.wrapping_sub(self.running.start))
    }

    /// Time since the last motion in ms; before the first motion, time since the first sample.
    pub(super) fn still_ms(&self) -> f32 {
        self.last.at.since(self.moved_at) as f32 / 1000.0
    }

    /// Takes a sample into the running segment.
    pub(super) fn sample(&mut self, reading: Reading) {
        let seconds = reading.at.since(self.last.at) as f32 * 1e-6;
        let Segment { start, .. } = self.running;
        let [from, to] = [self.last, reading].map(|reading| reading.position.wrapping_sub(start) as f32);
        self.running.count_seconds += (from + to) / 2.0 * seconds;
        self.running.volt_seconds_integral +=
            (self.running.volt_seconds + self.voltage * seconds / 2.0) * seconds;
        self.running.volt_seconds += self.voltage * seconds;
        self.running.seconds += seconds;
        let counts = to - from;
        if counts != 0.0 {
            if counts != -self.direction {
                self.moved_at = reading.edge_at;
            }
            self.direction = 1.0f32.copysign(counts);
        }
        self.last = reading;
    }

    /// Ends the running segment, and begins the next. Returns the change from the segment before to the ended
    /// segment. `None` for the first segment, and unless the motor moved enough in both segments, in one direction.
    pub(super) fn end(&mut self) -> Option<Change> {
        let ended = self.running;
        let counts = self.last.position.wrapping_sub(ended.start) as f32;
        let rough = counts / ended.seconds;
        // The speed at the segment's end differs from its mean by half of the change since the segment before.
        let ahead = self.before.map_or(0.0, |before| (rough - before.speed(&ended)) / 2.0);
        let next = Segment::new(self.last.position, self.fraction(rough + ahead));
        let change = self.before.and_then(|before| change(&before, &ended, &next, self.origin));
        (self.before, self.running) = (Some(ended), next);
        change
    }

    /// Position within the present count, 0 to 1, by the time since the last edge and the speed in counts/s.
    fn fraction(&self, speed: f32) -> f32 {
        let since = self.last.since_edge_us() as f32 * 1e-6;
        let speed = speed.abs();
        let passed = (speed * since + (speed * SAMPLE_S).min(1.0) / 2.0).min(1.0);
        if self.direction > 0.0 {
            passed
        } else if self.direction < 0.0 {
            1.0 - passed
        } else {
            0.5
        }
    }
}

/// Change of the motion from one segment to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// Change of the mean speed, in counts/s.
    pub(super) speed: f32,
    /// Change of the mean integral of the voltage, in V s.
    pub(super) volt_seconds: f32,
    /// Change of the mean position, in counts.
    pub(super) distance: f32,
    /// Mean position of both segments, in counts from the first sample.
    pub(super) position: f32,
    /// Time between the middles of the segments, in s.
    pub(super) seconds: f32,
    /// Duration of the shorter segment, in s. Because the encoder shows only whole counts, the change of speed has an
    /// error of some 0.7 counts divided by this duration.
    pub(super) shorter_s: f32,
    /// Direction of motion: 1 forward, -1 backward.
    pub(super) side: f32,
}

/// The change from the segment `a` to the segment `b`, which ends where the `next` starts; `None` unless the motor moved
/// enough in both segments, in one direction.
fn change(a: &Segment, b: &Segment, next: &Segment, origin: i32) -> Option<Change> {
    let (moved, speed_a, speed_b) = (a.moved(b), a.speed(b), b.speed(next));
    if !(moved.abs() > LEAST_COUNTS && b.moved(next).abs() > LEAST_COUNTS && speed_a * speed_b > 0.0) {
        return None;
    }
    let [before, after] = [a, b].map(|segment| segment.count_seconds / segment.seconds);
    let start = b.start.wrapping_sub(origin) as f32;
    Some(Change {
        speed: speed_b - speed_a,
        volt_seconds: a.volt_seconds - a.volt_seconds_integral / a.seconds
            + b.volt_seconds_integral / b.seconds,
        distance: moved - before + after,
        position: start + f32::midpoint(before - moved, after),
        seconds: f32::midpoint(a.seconds, b.seconds),
        shorter_s: a.seconds.min(b.seconds),
        side: 1.0f32.copysign(speed_b),
    })
}
