//! The way of a group: one progress along it, and from that a reference for each member.
//!
//! All members are on one straight line in the space of their positions, so their references are in
//! proportion to a count at any time. Progress and positions are whole numbers of 2^-16 counts and a path
//! without an end begins anew each time it has come round, so nothing adds up, however long it goes on.
//!
//! A path that is left for another one is left at the speed at which it was followed. What of that does not
//! lie along the new path, the *drift*, is braked to 0 while progress along the new one begins; the new path
//! starts where the drift will have come to rest.

use super::Reference;
use crate::units::{Acceleration, CountsPerSecond};
use libm::{roundf, sqrtf};

/// Steps in a count.
const COUNT: f32 = 65_536.0;
/// So near to its end, in steps, a path is at its end.
const AT_END: i64 = 64;

/// Where a path goes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Way<const N: usize> {
    /// To these positions, at this speed of the member that moves most, in counts/s.
    To([i32; N], f32),
    /// On and on at these speeds.
    On([CountsPerSecond; N]),
}

/// Of which all is in arrays by motor; what is no member has 0 everywhere.
#[derive(Clone, Debug)]
pub(super) struct Path<const N: usize> {
    /// Where it begins, or began to come round, in 2^-16 counts.
    base: [i64; N],
    /// What each moves while progress covers `length`, in counts.
    share: [i32; N],
    /// What each start is beyond a whole count, in 2^-16 counts; given up on the way.
    beyond: [i32; N],
    /// The largest share, at least 1.
    length: i64,
    endless: bool,
    /// In 2^-16 counts of the member that moves most.
    progress: i64,
    /// Of the progress, counts/s.
    speed: f32,
    /// The speed that it should have.
    limit: f32,
    /// Counts/s², of the member that moves most.
    acceleration: f32,
    /// At which each loses its drift, counts/s².
    braking: [f32; N],
    /// Seconds for which there is drift.
    drifting: f32,
    /// A group that stops has all its acceleration for that.
    stopping: bool,
}

impl<const N: usize> Path<N> {
    /// Nowhere, from these positions at these speeds.
    pub(super) fn new(positions: [i32; N], speeds: [f32; N], acceleration: Acceleration) -> Self {
        let mut path = Self {
            base: positions.map(|position| i64::from(position) << 16),
            share: [0; N],
            beyond: [0; N],
            length: 1,
            endless: true,
            progress: 0,
            speed: 0.0,
            limit: 0.0,
            acceleration: acceleration.get() as f32,
            braking: [0.0; N],
            drifting: 0.0,
            stopping: false,
        };
        path.drift(speeds);
        path
    }

    /// Goes another way from here, from the present speeds. `step` is a tick in seconds.
    pub(super) fn turn(&mut self, way: Way<N>, acceleration: Acceleration, step: f32) {
        let speeds = self.speeds();
        let references = self.references();
        self.acceleration = acceleration.get() as f32;
        self.base = references;
        (self.progress, self.speed, self.beyond) = (0, 0.0, [0; N]);
        match way {
            Way::On(rates) => {
                self.endless = true;
                self.share = rates.map(CountsPerSecond::to_bits);
                self.measure();
                self.limit = if self.is_still() { 0.0 } else { self.length as f32 / 256.0 };
                let direction = self.share.map(|share| share as f32 / self.length as f32);
                let (along, across) = split(&speeds, &direction);
                self.speed = along;
                self.stopping = self.is_still();
                self.drift(across);
            }
            Way::To(targets, speed) => {
                (self.endless, self.limit, self.stopping) = (false, speed.abs(), false);
                self.head_for(&targets);
                let direction = self.share.map(|share| share as f32 / self.length as f32);
                let (along, across) = split(&speeds, &direction);
                let stoppable = along * along <= 2.0 * self.acceleration * self.length as f32;
                // A drift that is no more than part of what a tick may change is none.
                if along == 0.0 || !stoppable || largest(&across) > self.acceleration * step / 4.0 {
                    self.drift(speeds);
                    self.head_for(&targets);
                } else {
                    self.drift([0.0; N]);
                    self.speed = along;
                }
            }
        }
    }

    /// From the base to these positions, the short way round.
    fn head_for(&mut self, targets: &[i32; N]) {
        let starts = self.base.iter().zip(&mut self.share).zip(&mut self.beyond);
        for (((base, share), beyond), target) in starts.zip(targets) {
            let whole = base.wrapping_add(1 << 15) >> 16;
            *beyond = base.wrapping_sub(whole << 16) as i32;
            *share = target.wrapping_sub(whole as i32);
        }
        self.measure();
    }

    fn measure(&mut self) {
        let longest = self.share.iter().map(|share| share.unsigned_abs()).max();
        self.length = i64::from(longest.unwrap_or_default().max(1));
    }

    fn is_still(&self) -> bool {
        self.share == [0; N]
    }

    /// Drifts from the base at these speeds, and moves the base to where that ends.
    fn drift(&mut self, speeds: [f32; N]) {
        self.drifting = largest(&speeds) / self.brakes();
        let braking = if self.drifting > 0.0 { 1.0 / self.drifting } else { 0.0 };
        self.braking = speeds.map(|speed| speed * braking);
        let drifts = self.drifts();
        for (base, drift) in self.base.iter_mut().zip(drifts) {
            *base = base.wrapping_add(drift);
        }
    }

    /// What of the acceleration is for losing drift; what is left is for progress.
    fn brakes(&self) -> f32 {
        if self.stopping { self.acceleration } else { self.acceleration / 2.0 }
    }

    /// How far each still drifts, in 2^-16 counts.
    fn drifts(&self) -> [i64; N] {
        let each = COUNT * self.drifting * self.drifting / 2.0;
        self.braking.map(|braking| roundf(braking * each) as i64)
    }

    /// True if it has come to its end.
    pub(super) fn is_at_end(&self) -> bool {
        let at_end = if self.endless { self.is_still() } else { self.progress == self.length << 16 };
        at_end && self.drifting <= 0.0
    }

    /// Where each should be, in 2^-16 counts.
    pub(super) fn references(&self) -> [i64; N] {
        let (whole, part) = (self.progress >> 16, self.progress & 0xFFFF);
        let mut references = self.base;
        let ways = self.share.iter().zip(&self.beyond).zip(self.drifts());
        for (reference, ((share, beyond), drift)) in references.iter_mut().zip(ways) {
            let share = i64::from(*share);
            // 62 bits and 48 bits at the most; the length is at least 1.
            let moved = share * whole;
            let counts = moved.checked_div(self.length).unwrap_or_default();
            let rest = ((moved - counts * self.length) << 16) + share * part - i64::from(*beyond) * whole;
            let rest = rest.checked_div(self.length).unwrap_or_default();
            *reference = reference.wrapping_add((counts << 16) + rest - drift);
        }
        references
    }

    /// How fast each should be, in counts/s.
    pub(super) fn speeds(&self) -> [f32; N] {
        let each = self.speed / self.length as f32;
        let mut speeds = self.braking.map(|braking| braking * self.drifting);
        for (speed, share) in speeds.iter_mut().zip(&self.share) {
            *speed += *share as f32 * each;
        }
        speeds
    }

    /// Goes on for so many seconds.
    pub(super) fn step(&mut self, seconds: f32) {
        let acceleration = if self.drifting > 0.0 { self.acceleration / 2.0 } else { self.acceleration };
        self.drifting = (self.drifting - seconds).max(0.0);
        let before = self.speed;
        let gained = acceleration * seconds;
        let end = self.length << 16;
        let mut wanted = self.limit;
        if !self.endless {
            // Of the rest of the way a part is covered in this step.
            let rest = (end - self.progress) as f32 / COUNT - before * seconds / 2.0;
            let lost = gained / 2.0;
            let stoppable = sqrtf(lost * lost + 2.0 * acceleration * rest.max(0.0)) - lost;
            wanted = wanted.min(stoppable);
        }
        self.speed = wanted.min(before + gained).max(before - gained);
        self.progress += roundf(COUNT * seconds * (before + self.speed) / 2.0) as i64;
        if self.endless {
            self.come_round();
        } else if end - self.progress < AT_END {
            (self.progress, self.speed) = (end, 0.0);
        }
    }

    /// Once its length is covered, each has moved by its share exactly, and the path begins anew.
    fn come_round(&mut self) {
        let rounds = self.progress.checked_div_euclid(self.length << 16).unwrap_or_default();
        if rounds != 0 {
            for (base, share) in self.base.iter_mut().zip(&self.share) {
                *base = base.wrapping_add((i64::from(*share) * rounds) << 16);
            }
            self.progress -= rounds * (self.length << 16);
        }
    }
}

/// A reference from where to be and how fast now and at the next tick.
pub(super) fn reference(steps: i64, now: f32, next: f32) -> Reference {
    Reference {
        // Positions wrap.
        position: (steps >> 16) as i32,
        fraction: steps as u16,
        speed: CountsPerSecond::from_f32(now),
        next: CountsPerSecond::from_f32(next),
    }
}

fn largest<const N: usize>(values: &[f32; N]) -> f32 {
    values.iter().fold(0.0, |most, value| value.abs().max(most))
}

/// How fast that is along a direction, and what is left.
fn split<const N: usize>(speeds: &[f32; N], direction: &[f32; N]) -> (f32, [f32; N]) {
    let product = |a: &[f32; N]| a.iter().zip(direction).map(|(a, b)| a * b).sum::<f32>();
    let square = product(direction);
    let along = if square > 0.0 { product(speeds) / square } else { 0.0 };
    let mut across = *speeds;
    for (speed, direction) in across.iter_mut().zip(direction) {
        *speed -= along * direction;
    }
    (along, across)
}
