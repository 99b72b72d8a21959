//! Clock by which sessions measure time-outs: the clock of the operating system. A browser has no such clock, so a
//! program for browsers provides the time by `set`.

#[cfg(not(target_arch = "wasm32"))]
pub use std::time::Instant;

#[cfg(target_arch = "wasm32")]
pub use browser::{Instant, set};

#[cfg(target_arch = "wasm32")]
mod browser {
    use std::ops::Add;
    use std::sync::OnceLock;
    use std::time::Duration;

    static CLOCK: OnceLock<fn() -> Duration> = OnceLock::new();

    /// Sets the function that returns the time since any fixed instant. Only the first call counts.
    pub fn set(clock: fn() -> Duration) {
        let _ = CLOCK.set(clock);
    }

    /// Instant of the clock, with the methods of [`std::time::Instant`] that this crate uses.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub struct Instant(Duration);

    impl Instant {
        /// Returns the present time; 0 until [`set`] has been called.
        #[must_use]
        pub fn now() -> Self {
            Self(CLOCK.get().map_or(Duration::ZERO, |clock| clock()))
        }

        /// Returns the time that has passed since this instant.
        #[must_use]
        pub fn elapsed(self) -> Duration {
            Self::now().saturating_duration_since(self)
        }

        /// Returns the time from `earlier` to this instant; 0 if `earlier` is later.
        #[must_use]
        pub fn saturating_duration_since(self, earlier: Self) -> Duration {
            self.0.saturating_sub(earlier.0)
        }
    }

    impl Add<Duration> for Instant {
        type Output = Self;

        fn add(self, duration: Duration) -> Self {
            Self(self.0.saturating_add(duration))
        }
    }
}
