//! SI quantities as types: the compiler rejects a resistance where a voltage is expected.
//!
//! Each type wraps one public `f64`. Formulas use the inner number.
//!
//! ```
//! use motor_hub::model::si::{Amps, Ohms, Volts};
//!
//! let (current, resistance) = (Amps(2.0), Ohms(3.0));
//! assert_eq!(Volts(current.0 * resistance.0).to_string(), "6 V");
//! ```

macro_rules! quantities {
    ($($(#[$doc:meta])+ $name:ident, $unit:literal;)+) => {$(
        $(#[$doc])+
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f64);

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    )+};
}

quantities! {
    /// Potential difference, V.
    Volts, "V";
    /// Current, A.
    Amps, "A";
    /// Resistance, ohm.
    Ohms, "ohm";
    /// Inductance, H.
    Henries, "H";
    /// Time, s.
    Seconds, "s";
    /// Frequency, Hz.
    Hertz, "Hz";
    /// Angular speed, rad/s.
    RadPerSec, "rad/s";
    /// Torque, N m.
    NewtonMetres, "N m";
    /// Moment of inertia, kg m².
    KgM2, "kg m2";
    /// Viscous drag, N m s/rad.
    Drag, "N m s/rad";
    /// Back-EMF constant, V s/rad.
    EmfConstant, "V s/rad";
    /// Torque constant, N m/A.
    TorqueConstant, "N m/A";
    /// Energy, J.
    Joules, "J";
    /// Charge, C.
    Coulombs, "C";
    /// Mass, kg.
    Kilograms, "kg";
    /// Length, m.
    Metres, "m";
}
