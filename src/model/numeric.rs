//! Numerical functions that stay precise for small arguments, and a bracketing root finder.

/// Returns `(1 - exp(-x)) / x`: the mean of `exp(-s)` for `s` from 0 to `x`. The result is 1 at `x = 0`.
pub(super) fn phi1(x: f64) -> f64 {
    if x.abs() < 1e-8 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// Returns `(1 - phi1(x)) / x`: the mean of `1 - exp(-s)` for `s` from 0 to `x`, divided by `x`. At `x = 0` the result
/// is 1/2.
pub(super) fn phi2(x: f64) -> f64 {
    if x.abs() < 0.02 {
        // The truncation error is below x^6 / 40320, which is 2e-15 at x = 0.02.
        0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0 - x / 5040.0))))
    } else {
        (1.0 - phi1(x)) / x
    }
}

/// Returns `ln(1 + x) / x` for `x` of at least 0. The result is 1 at `x = 0`.
pub(super) fn ln_1p_over_x(x: f64) -> f64 {
    if x < 1e-8 { 1.0 - 0.5 * x } else { x.ln_1p() / x }
}

/// Finds a zero of the continuous function `f` between `a` and `b`, to a few rounding errors of `f64`.
///
/// The method is Chandrupatla's: bisection, or inverse quadratic interpolation where that is safe. If `f` does not
/// change sign between `a` and `b`, the function returns the end with the smaller `|f|`.
pub(super) fn bracketed_zero(a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (mut x1, mut x2) = (b, a);
    let (mut f1, mut f2) = (f(b), f(a));
    // If the sign does not change, or an end is a zero itself, the result is an end.
    if f1 == 0.0 || f2 == 0.0 || f1 * f2 > 0.0 {
        return if f1.abs() < f2.abs() { b } else { a };
    }
    let mut t = 0.5;
    // Bisection alone needs about 55 iterations, and this method fewer than twice as many.
    for _ in 0..120 {
        let x = x1 + t * (x2 - x1);
        let fx = f(x);
        let (x3, f3);
        if (fx > 0.0) == (f1 > 0.0) {
            (x3, f3) = (x1, f1);
        } else {
            (x3, f3) = (x2, f2);
            (x2, f2) = (x1, f1);
        }
        (x1, f1) = (x, fx);
        let (best, f_best) = if f1.abs() < f2.abs() { (x1, f1) } else { (x2, f2) };
        let tolerance = 2.0 * f64::EPSILON * best.abs() + 1e-17 * (b - a).abs();
        let limit = tolerance / (x2 - x1).abs();
        if limit > 0.5 || f_best == 0.0 {
            return best;
        }
        let xi = (x1 - x2) / (x3 - x2);
        let phi = (f1 - f2) / (f3 - f2);
        let interpolate = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
        t = if interpolate {
            f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        } else {
            0.5
        };
        t = t.clamp(limit, 1.0 - limit);
    }
    if f1.abs() < f2.abs() { x1 } else { x2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_and_closed_forms_agree_at_the_branch_limits() {
        for x in [1e-8, 0.02] {
            let below = x * (1.0 - 1e-9);
            let above = x * (1.0 + 1e-9);
            assert!((phi1(below) - phi1(above)).abs() < 1e-10);
            assert!((phi2(below) - phi2(above)).abs() < 1e-10);
            assert!((ln_1p_over_x(below) - ln_1p_over_x(above)).abs() < 1e-10);
        }
        assert!((phi2(0.02) - (0.02 + (-0.02_f64).exp_m1()) / 4e-4).abs() < 1e-12);
    }

    #[test]
    fn bracketed_zero_finds_smooth_and_kinked_zeros() {
        assert!((bracketed_zero(0.0, 3.0, |x| x * x - 2.0) - 2f64.sqrt()).abs() < 1e-15);
        let kinked = |x: f64| if x < 0.7 { 0.01 * (x - 0.7) } else { 100.0 * (x - 0.7) };
        assert!((bracketed_zero(0.0, 1.0, kinked) - 0.7).abs() < 1e-14);
    }

    #[test]
    fn a_zero_at_or_beyond_an_end_gives_that_end() {
        assert_eq!(bracketed_zero(0.0, 1.0, |x| x - 1.0), 1.0);
        assert_eq!(bracketed_zero(0.0, 1.0, |x| x), 0.0);
        assert_eq!(bracketed_zero(0.0, 1.0, |x| x - 2.0), 1.0);
        assert_eq!(bracketed_zero(0.0, 1.0, |x| x + 2.0), 0.0);
    }
}
