//! Least squares, a row at a time: each row is turned into a triangle of sums by plane rotations.
//!
//! Unlike sums of products this does not square how nearly dependent the unknowns are, so single
//! precision is enough, and the triangle has the answer for the first few unknowns as well as for all of
//! them.

use libm::sqrtf;

/// Unknowns, at most.
pub(super) const UNKNOWNS: usize = 5;
/// An unknown whose share of all rows is less than this, apart from what the others explain, is not known.
const LEAST_SHARE: f32 = 1e-4;

/// What one row has of each unknown, and last, what they make together.
pub(super) type Row = [f32; UNKNOWNS + 1];

/// What rows have said so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fit {
    triangle: [Row; UNKNOWNS],
    /// Sum of the squares that all unknowns leave,
    left: f32,
    /// and of what there was.
    seen: f32,
    rows: u16,
}

impl Fit {
    /// Takes a row; returns what the rows before it did not expect of it.
    pub(super) fn add(&mut self, mut row: Row) -> f32 {
        let [.., seen] = row;
        self.seen += seen * seen;
        self.rows = self.rows.saturating_add(1);
        for (n, pivot) in self.triangle.iter_mut().enumerate() {
            let (Some(&a), Some(&b)) = (pivot.get(n), row.get(n)) else { continue };
            let length = sqrtf(a * a + b * b);
            if length > 0.0 {
                let (cos, sin) = (a / length, b / length);
                for (p, r) in pivot.iter_mut().zip(&mut row) {
                    (*p, *r) = (cos * *p + sin * *r, cos * *r - sin * *p);
                }
            }
        }
        let [.., surprise] = row;
        self.left += surprise * surprise;
        surprise
    }

    /// How many rows there were.
    pub(super) const fn rows(&self) -> u16 {
        self.rows
    }

    /// Root mean square of what the rows made together.
    pub(super) fn seen(&self) -> f32 {
        sqrtf(self.seen / f32::from(self.rows.max(1)))
    }

    /// The first few unknowns, the others being 0; `None` if the rows do not say.
    pub(super) fn solve(&self, unknowns: usize) -> Option<Solution> {
        let values = self.backwards(unknowns, |_, [.., sum]| *sum)?;
        let mut spread = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (of, column) in spread.iter_mut().enumerate().take(unknowns) {
            *column = self.backwards(unknowns, |n, _| if n == of { 1.0 } else { 0.0 })?;
        }
        let others: f32 = self.triangle.iter().skip(unknowns).map(|[.., sum]| sum * sum).sum();
        let freedom = usize::from(self.rows).saturating_sub(unknowns).max(1);
        let residual = sqrtf((self.left + others) / freedom as f32);
        Some(Solution { values, spread, residual })
    }

    /// Of the triangle's first rows, with these right sides.
    fn backwards(&self, unknowns: usize, right: impl Fn(usize, &Row) -> f32) -> Option<[f32; UNKNOWNS]> {
        let mut values = [0.0; UNKNOWNS];
        for (n, row) in self.triangle.iter().enumerate().take(unknowns).rev() {
            let known: f32 = row.iter().zip(&values).map(|(share, value)| share * value).sum();
            let share = *row.get(n)?;
            if share < LEAST_SHARE {
                return None;
            }
            *values.get_mut(n)? = (right(n, row) - known) / share;
        }
        Some(values)
    }
}

/// What rows say.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution {
    /// The unknowns.
    pub(super) values: [f32; UNKNOWNS],
    /// The inverse triangle, by columns.
    spread: [[f32; UNKNOWNS]; UNKNOWNS],
    /// Root mean square of what is left of a row.
    pub(super) residual: f32,
}

impl Solution {
    /// Standard error of a weighted sum of the unknowns, as if what is left of one row had nothing to do
    /// with what is left of another.
    pub(super) fn error(&self, weights: [f32; UNKNOWNS]) -> f32 {
        let squares: f32 = self
            .spread
            .iter()
            .map(|column| {
                let sum: f32 = column.iter().zip(&weights).map(|(share, weight)| share * weight).sum();
                sum * sum
            })
            .sum();
        self.residual * sqrtf(squares)
    }
}
