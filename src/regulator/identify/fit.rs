//! Least squares, one row at a time: plane rotations turn each row into a triangle of sums (a QR decomposition).
//!
//! Normal equations, which are sums of products, have the square of the condition number. The triangle keeps the
//! condition number, so single precision is enough. The triangle also gives the solution for the first few unknowns
//! alone.

use libm::sqrtf;

/// Largest number of unknowns.
pub(super) const UNKNOWNS: usize = 5;
/// Least diagonal element of the triangle with which its unknown can be solved. With a smaller element, the weights of
/// this unknown are nearly a combination of the weights of the unknowns before.
const LEAST_PIVOT: f32 = 1e-4;

/// Number of elements of the triangle, with the right sides.
const TRIANGLE: usize = UNKNOWNS * (UNKNOWNS + 3) / 2;

/// The rows so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fit {
    /// Upper triangle of the decomposition, with the rotated right sides, without the zeros: row n begins with its
    /// diagonal element, and has 6 - n elements.
    triangle: [f32; TRIANGLE],
    /// Sum of the squared residuals with all unknowns.
    residual_squares: f32,
    /// Sum of the squared right sides.
    right_squares: f32,
    /// Number of rows.
    rows: u16,
}

impl Fit {
    /// Adds a row, which is one equation: the weight of each unknown, then the right side. Returns the innovation of
    /// the row: the part of the right side that the earlier rows do not predict.
    pub(super) fn add(&mut self, mut row: [f32; UNKNOWNS + 1]) -> f32 {
        let [.., right] = row;
        self.right_squares += right * right;
        self.rows = self.rows.saturating_add(1);
        let mut triangle = self.triangle.as_mut_slice();
        for n in 0..UNKNOWNS {
            let rest = row.get_mut(n..).unwrap_or_default();
            let Some((pivot, below)) = triangle.split_at_mut_checked(rest.len()) else { break };
            let (Some(&a), Some(&b)) = (pivot.first(), rest.first()) else { break };
            let length = sqrtf(a * a + b * b);
            if length > 0.0 {
                let (cos, sin) = (a / length, b / length);
                for (p, r) in pivot.iter_mut().zip(rest) {
                    (*p, *r) = (cos * *p + sin * *r, cos * *r - sin * *p);
                }
            }
            triangle = below;
        }
        let [.., innovation] = row;
        self.residual_squares += innovation * innovation;
        innovation
    }

    /// Number of rows.
    pub(super) const fn rows(&self) -> u16 {
        self.rows
    }

    /// Root mean square of the right sides.
    pub(super) fn right_rms(&self) -> f32 {
        sqrtf(self.right_squares / f32::from(self.rows.max(1)))
    }

    /// Solves for the first `unknowns` unknowns, with all other unknowns at 0; `None` if the rows do not determine
    /// the solution.
    pub(super) fn solve(&self, unknowns: usize) -> Option<Solution> {
        let right_side = |n| self.row(n).last().copied().unwrap_or_default();
        let values = self.substitute(unknowns, right_side)?;
        let mut inverse = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (of, column) in inverse.iter_mut().enumerate().take(unknowns) {
            *column = self.substitute(unknowns, |n| if n == of { 1.0 } else { 0.0 })?;
        }
        let others: f32 = (unknowns..UNKNOWNS).map(|n| right_side(n) * right_side(n)).sum();
        let freedom = usize::from(self.rows).saturating_sub(unknowns).max(1);
        let residual = sqrtf((self.residual_squares + others) / freedom as f32);
        Some(Solution { values, inverse, residual })
    }

    /// Solves the triangle's first rows with these right sides by back substitution.
    fn substitute(&self, unknowns: usize, right: impl Fn(usize) -> f32) -> Option<[f32; UNKNOWNS]> {
        let mut values = [0.0; UNKNOWNS];
        for n in (0..unknowns).rev() {
            let row = self.row(n);
            let solved: f32 = row.iter().zip(values.get(n..)?).map(|(weight, value)| weight * value).sum();
            let pivot = *row.first()?;
            if pivot < LEAST_PIVOT {
                return None;
            }
            *values.get_mut(n)? = (right(n) - solved) / pivot;
        }
        Some(values)
    }

    /// The row of the triangle with this index, from its diagonal element to its right side.
    fn row(&self, n: usize) -> &[f32] {
        // The rows before have 6, 5, 4, ... elements.
        let start = n * (2 * UNKNOWNS + 3 - n) / 2;
        self.triangle.get(start..start + UNKNOWNS + 1 - n).unwrap_or_default()
    }
}

/// A solution of the rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution {
    /// Values of the unknowns.
    pub(super) values: [f32; UNKNOWNS],
    /// Inverse of the triangle, by columns.
    inverse: [[f32; UNKNOWNS]; UNKNOWNS],
    /// Root mean square of the rows' residuals.
    pub(super) residual: f32,
}

impl Solution {
    /// Standard error of a weighted sum of the unknowns, for residuals that do not correlate.
    pub(super) fn error(&self, weights: [f32; UNKNOWNS]) -> f32 {
        let squares: f32 = self
            .inverse
            .iter()
            .map(|column| {
                let sum: f32 = column.iter().zip(&weights).map(|(element, weight)| element * weight).sum();
                sum * sum
            })
            .sum();
        self.residual * sqrtf(squares)
    }
}
