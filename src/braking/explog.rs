//! Exponential and logarithm in fixed point, in the two forms that the current of a motor winding
//! needs, both free of cancellation for small arguments.

/// One, in steps of 2^-24.
pub(super) const ONE: u32 = 1 << 24;

/// Largest argument: 254, so that one more still fits.
pub(super) const MAX: u32 = 254 << 24;

/// `exp(-x)` in three forms, each in steps of 2^-24.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Decay {
    /// `exp(-x)`.
    pub(super) rest: u32,
    /// `1 - exp(-x)`, about x.
    pub(super) gone: u32,
    /// `x - 1 + exp(-x)`, about x^2/2.
    pub(super) lag: u32,
}

impl Decay {
    /// For x in steps of 2^-24, up to [`MAX`]. Errors below 2e-7, and below 1e-4 of `lag` while that
    /// is 100 steps or more.
    pub(super) const fn new(x: u32) -> Self {
        // Below 1/16 three terms of the series do, and keep the small quantity exact.
        let lag = if x < ONE >> 4 {
            let square = mul(x, x);
            let cube = mul(square, x);
            square / 2 - cube / 6 + mul(square, square) / 24
        } else {
            x + exp_minus(x) - ONE
        };
        let gone = x - lag;
        Self { rest: ONE - gone, gone, lag }
    }
}

/// `exp(-x)`; x in steps of 2^-24 up to [`MAX`].
const fn exp_minus(x: u32) -> u32 {
    /// log2(e) in steps of 2^-31.
    const LOG2_E: u64 = 3_098_164_009;
    let powers = (x as u64 * LOG2_E) >> 31;
    let whole = (powers >> 24) as u32;
    if whole > 24 {
        return 0;
    }
    let f = (powers as u32) & (ONE - 1);
    // 2^-f on [0, 1], minimax of degree 5 (error 6e-8), coefficients in steps of 2^-24.
    let p = 928_060 - mul(f, 154_827 - mul(f, 16_006));
    let p = ONE - mul(f, 11_629_034 - mul(f, 4_029_664 - mul(f, p)));
    p >> whole
}

/// `1 - ln(1 + z) / z`, about z/2; z and result in steps of 2^-24, z up to [`MAX`].
///
/// Error below 3e-6.
pub(super) const fn log_defect(z: u32) -> u32 {
    if z <= 2 * ONE {
        // With p = z / (2 + z), ln(1 + z) = 2 artanh(p), and no term cancels another.
        let p = ratio_q20(z >> 4, (z + 2 * ONE) >> 4) << 4;
        let square = mul(p, p);
        p - mul(ONE - p, mul(square, artanh_tail(square)))
    } else {
        // Above 2, z has at most six leading zeros.
        let shift = 10 - z.leading_zeros();
        ONE - (ratio_q20(ln(z + ONE) >> shift, z >> shift) << 4)
    }
}

/// `ln(w)` in steps of 2^-24; w in steps of 2^-24, at least 1.
const fn ln(w: u32) -> u32 {
    /// ln 2 in steps of 2^-24.
    const LN_2: u32 = 11_629_080;
    let whole = 7 - w.leading_zeros();
    // In [0, 1).
    let z = ((w >> whole) - ONE) >> 4;
    let p = ratio_q20(z, z + (ONE >> 3)) << 4;
    let square = mul(p, p);
    whole * LN_2 + 2 * (p + mul(p, mul(square, artanh_tail(square))))
}

/// `(artanh(p) / p - 1) / p^2 = 1/3 + p^2/5 + p^4/7 + ...` as a function of p^2 up to 1/4: minimax of
/// degree 3 (error 5e-6), coefficients in steps of 2^-24.
const fn artanh_tail(square: u32) -> u32 {
    5_592_321 + mul(square, 3_365_587 + mul(square, 2_207_308 + mul(square, 2_943_982)))
}

/// Product of two numbers in steps of 2^-24.
pub(super) const fn mul(a: u32, b: u32) -> u32 {
    ((a as u64 * b as u64) >> 24) as u32
}

/// `part / whole` in steps of 2^-20, rounded down, by two 32-bit divisions: `part` below 2^22, `whole`
/// above 0 and at most 2^22, their quotient below 4096.
pub(super) const fn ratio_q20(part: u32, whole: u32) -> u32 {
    let part = part << 10;
    let (high, rest) = (part / whole, part % whole);
    (high << 10) + (rest << 10) / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(value: f64) -> f64 {
        value * f64::from(ONE)
    }

    /// Arguments from 0 to 254, dense where the functions are small.
    fn arguments() -> impl Iterator<Item = u32> {
        (0..2_000).chain((0..=MAX >> 12).map(|n| n << 12)).chain((0..1 << 20).map(|n| n * 61))
    }

    #[test]
    fn decay_is_exponential_and_keeps_small_lags_exact() {
        for x in arguments() {
            let decay = Decay::new(x);
            let t = f64::from(x) / f64::from(ONE);
            let rest = steps((-t).exp());
            assert!((f64::from(decay.rest) - rest).abs() < 3.5, "rest at {t}: {decay:?}");
            assert_eq!(decay.rest + decay.gone, ONE);
            assert_eq!(decay.gone + decay.lag, x);
            let lag = steps(t + (-t).exp_m1());
            assert!((f64::from(decay.lag) - lag).abs() < 2.0 + 1e-4 * lag, "lag at {t}: {decay:?}");
        }
    }

    #[test]
    fn the_defect_of_the_logarithm_is_right_from_0_to_254() {
        let mut worst = 0.0f64;
        for z in arguments() {
            let t = f64::from(z) / f64::from(ONE);
            let defect = if z == 0 { 0.0 } else { steps(1.0 - t.ln_1p() / t) };
            // Near 0 the reference cancels; the function does not.
            let defect = if t < 1e-4 { steps(t / 2.0 - t * t / 3.0) } else { defect };
            worst = worst.max((f64::from(log_defect(z)) - defect).abs());
        }
        assert!(worst < steps(3e-6), "{worst} steps");
    }
}
