//! Exponential and logarithm in fixed point, in the two forms that the current of a motor winding
//! needs. Both go to 0 with their argument, and neither takes a small difference of large numbers.

/// A time in winding time constants, or a ratio, in steps of 2^-28.
pub(super) type Q28 = i64;

/// One.
pub(super) const ONE: Q28 = 1 << 28;

/// `a b`, to nearest; below 2^63 steps of 2^-56.
pub(super) const fn mul(a: Q28, b: Q28) -> Q28 {
    (a * b + ONE / 2) >> 28
}

/// `a / b`, rounded down; `a` from 0 to 2^35 steps of whatever `b`, above 0, has.
pub(super) const fn div(a: i64, b: i64) -> Q28 {
    scale(a, ONE, b)
}

/// `a b / c`, rounded down; all at least 0, `c` above it, and `a b` below 2^63.
pub(super) const fn scale(a: i64, b: i64, c: i64) -> i64 {
    // An unsigned division is the shorter one.
    ((a * b).unsigned_abs() / c.unsigned_abs()) as i64
}

/// What an exponential decay has done by the time x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Decay {
    /// `1 - exp(-x)`, about x.
    pub(super) gone: Q28,
    /// `x - 1 + exp(-x)`, about x^2/2.
    pub(super) lag: Q28,
}

impl Decay {
    /// For x from 0 to 2^7. Errors below 2e-8 + 3e-7 x.
    pub(super) const fn new(x: Q28) -> Self {
        // Below 1/16 three terms of the series do.
        let mut halvings = 0;
        while x >> halvings >= ONE / 16 {
            halvings += 1;
        }
        let x = x >> halvings;
        let square = mul(x, x);
        let lag = mul(square, ONE / 2 - mul(x, ONE / 6 - mul(x, ONE / 24)));
        let mut decay = Self { gone: x - lag, lag };
        while halvings > 0 {
            decay = decay.at_twice_the_time();
            halvings -= 1;
        }
        decay
    }

    /// From `exp(-2x) = exp(-x)^2`.
    const fn at_twice_the_time(self) -> Self {
        let square = mul(self.gone, self.gone);
        Self { gone: 2 * self.gone - square, lag: 2 * self.lag + square }
    }
}

/// What becomes of `1 + z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Logarithm {
    /// `1 - ln(1 + z) / z`, about z/2, within 3e-6.
    pub(super) defect: Q28,
    /// `1 / (1 + z)`, within 0.4 %: enough for a slope.
    pub(super) inverse: Q28,
}

impl Logarithm {
    /// For z from 0 to 2^12.
    pub(super) const fn new(z: Q28) -> Self {
        /// ln 2.
        const LN_2: Q28 = 186_065_279;
        // 1 + z = 2^n (1 + y) with y from 0 to 1, and 1 + y = (1 + p) / (1 - p), so ln(1 + y) = 2 artanh(p).
        let n = (1 + (z >> 28)).ilog2();
        let y = ((ONE + z) >> n) - ONE;
        let p = div(y, 2 * ONE + y);
        // artanh(p) / p - 1 = p^2/3 + p^4/5 + ..., where p^2 is at most 1/9.
        let s = mul(p, p);
        let tail = mul(s, ONE / 3 + mul(s, ONE / 5 + mul(s, ONE / 7 + mul(s, ONE / 9))));
        let defect = if n == 0 {
            // With z = 2p / (1 - p) what cancels is gone.
            p - mul(ONE - p, tail)
        } else {
            ONE - div(n as i64 * LN_2 + 2 * (p + mul(p, tail)), z)
        };
        // 1 / (1 + p) = 1 - p + p^2 - p^3 + p^4
        let alternating = ONE - p + mul(s, ONE - p + s);
        Self { defect, inverse: mul(ONE - p, alternating) >> n }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn real(value: Q28) -> f64 {
        value as f64 / ONE as f64
    }

    /// Arguments from 0 to `end`, dense where the functions are small.
    fn arguments(end: i64) -> impl Iterator<Item = Q28> {
        (0..2_000).chain((0..=1 << 15).map(move |n| n * (end << 13))).chain((0..1 << 20).map(|n| n * 997))
    }

    #[test]
    fn a_decay_is_exponential_and_keeps_small_lags() {
        for x in arguments(1 << 7) {
            let Decay { gone, lag } = Decay::new(x);
            let t = real(x);
            let error = 2e-8 + 3e-7 * t;
            assert!((real(gone) + (-t).exp_m1()).abs() < error, "gone at {t}: {gone}");
            assert!((real(lag) - (t + (-t).exp_m1())).abs() < error, "lag at {t}: {lag}");
        }
    }

    #[test]
    fn logarithm_and_inverse_are_right_from_0_to_4096() {
        let mut worst = 0.0f64;
        for z in arguments(1 << 12) {
            let t = real(z);
            // Near 0 the reference cancels; the function does not.
            let defect = if t < 1e-4 { t / 2.0 - t * t / 3.0 } else { 1.0 - t.ln_1p() / t };
            let log = Logarithm::new(z);
            worst = worst.max((real(log.defect) - defect).abs());
            assert!((real(log.inverse) * (1.0 + t) - 1.0).abs() < 0.0045, "{} at {t}", real(log.inverse));
        }
        assert!(worst < 3e-6, "{worst}");
    }
}
