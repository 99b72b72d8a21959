//! Axes: a linear map from data to pixels, with marks at round numbers.

/// A linear axis, which maps data from `low` to `high` to pixels from `start` to `end`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
    /// Distance of two marks, in data units.
    step: f64,
}

/// One mark of an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// Position of the mark, in data units.
    pub value: f64,
    /// Text beside the mark.
    pub label: String,
}

impl Scale {
    /// Creates an axis from `low` to `high` with about `marks` marks at most. An empty or non-finite range is replaced by a range
    /// of width 1.
    pub(super) fn exact((low, high): (f64, f64), (start, end): (f64, f64), marks: usize) -> Self {
        let usable = low.is_finite() && high.is_finite() && low < high;
        let (low, high) = match (usable, low.is_finite()) {
            (true, _) => (low, high),
            (false, true) => (low - 0.5, low + 0.5),
            (false, false) => (0.0, 1.0),
        };
        Self { low, high, start, end, step: round_step((high - low) / marks.max(1) as f64) }
    }

    /// Creates an axis whose ends are round numbers around `range`.
    pub(super) fn rounded(range: (f64, f64), pixels: (f64, f64), marks: usize) -> Self {
        let Self { low, high, start, end, step } = Self::exact(range, pixels, marks);
        // The tolerance is larger than rounding errors. Without it, data that ends at a mark could get an empty step beyond it.
        let low = step * (low / step + 1e-6).floor();
        let high = step * (high / step - 1e-6).ceil();
        Self { low, high, start, end, step }
    }

    /// Returns the pixel of a value.
    pub(super) fn pixel(&self, value: f64) -> f64 {
        self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)
    }

    /// Returns the lowest and the highest value of the axis, in data units.
    pub(super) fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Returns the marks of the axis, at round numbers.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        let step = self.step;
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-6).ceil() as i64;
        let last = (self.high / step + 1e-6).floor() as i64;
        (first..=last)
            .map(|n| {
                let value = n as f64 * step;
                Tick { value, label: format!("{value:.digits$}").replace('-', "\u{2212}") }
            })
            .collect()
    }
}

/// Returns the smallest number that is 1, 2 or 5 times a power of ten and at least `least`. `least` must be above 0.
fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= least * 0.999).unwrap_or(10.0);
    factor * power
}
