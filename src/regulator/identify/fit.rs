//! Least squares, one row at a time: plane rotations turn each row into a triangle of sums (a QR decomposition).
//!
//! Normal equations, which are sums of products, have the square of the condition number. The triangle keeps the
//! condition number, so single precision is enough. The triangle also gives the solution for the first few unknowns
//! alone.

use libm::sqrtf;

/// Largest number of unknowns.
pub(super) const UNKNOWNS: usize = 5;
/// Least diagonal element of the triangle with which its unknown can be solved. The element is the part of the
/// unknown's weights in all rows that the unknowns before do not explain.
const LEAST_PIVOT: f32 = 1e-4;

/// One equation: the weight of each unknown, then the right side.
pub(super) type Row = [f32; UNKNOWNS + 1];

/// The rows so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fit {
    /// Upper triangle of the decomposition, with the rotated right sides.
    triangle: [Row; UNKNOWNS],
    /// Sum of the squared residuals with all unknowns.
    residual_squares: f32,
    /// Sum of the squared right sides.
    right_squares: f32,
    /// Number of rows.
    rows: u16,
}

impl Fit {
    /// Adds a row. Returns the innovation of the row: the part of the right side that the earlier rows do not
    /// predict.
    pub(super) fn add(&mut self, mut row: Row) -> f32 {
        let [.., right] = row;
        self.right_squares += right * right;
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
        let values = self.substitute(unknowns, |_, [.., sum]| *sum)?;
        let mut inverse = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (of, column) in inverse.iter_mut().enumerate().take(unknowns) {
            *column = self.substitute(unknowns, |n, _| if n == of { 1.0 } else { 0.0 })?;
        }
        let others: f32 = self.triangle.iter().skip(unknowns).map(|[.., sum]| sum * sum).sum();
        let freedom = usize::from(self.rows).saturating_sub(unknowns).max(1);
        let residual = sqrtf((self.residual_squares + others) / freedom as f32);
        Some(Solution { values, inverse, residual })
    }

    /// Solves the triangle's first rows with these right sides by back substitution.
    fn substitute(&self, unknowns: usize, right: impl Fn(usize, &Row) -> f32) -> Option<[f32; UNKNOWNS]> {
        let mut values = [0.0; UNKNOWNS];
        for (n, row) in self.triangle.iter().enumerate().take(unknowns).rev() {
            let solved: f32 = row.iter().zip(&values).map(|(weight, value)| weight * value).sum();
            let pivot = *row.get(n)?;
            if pivot < LEAST_PIVOT {
                return None;
            }
            *values.get_mut(n)? = (right(n, row) - solved) / pivot;
        }
        Some(values)
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
