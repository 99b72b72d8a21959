//! One motor at one speed on one battery: points and duties that the firmware's core computes.
//!
//! ```
//! use motor_hub::braking::Scheme;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::units::Control;
//! use studies::points::OperatingReport;
//!
//! let report = OperatingReport::new(characterised("AM 60 A")?, Scheme::B, 1000, 12_000)?;
//! let placed = report.place(Control::new(-5000));
//! assert_eq!((placed.linear_duty.regime, placed.linear_duty.mode), ("braking", "5/0"));
//! # Ok::<(), studies::StudyError>(())
//! ```

use crate::StudyError;
use chart::{Figure, Panel, Point, Series, Style, colour};
use motor_hub::braking::{self, LinearCurrent, OperatingPoint, Points, Scheme};
use motor_hub::bridge::Drive;
use motor_hub::model::catalogue::Motor;
use motor_hub::units::{Control, CountsPerSecond, Millivolts};
use serde::Serialize;
use simulated::hardware::{BRIDGE, winding};
use simulated::scheme::{self, SchemeWords};

/// An operating point with its points S, T, Z and G.
#[derive(Debug, Serialize)]
pub struct OperatingReport {
    motor: &'static str,
    #[serde(flatten)]
    scheme: SchemeWords,
    speed_cps: i32,
    battery_mv: u16,
    /// Back EMF as the core computes it, in millivolts.
    emf_mv: f64,
    /// "V" for Scheme A, "A" for the others.
    y_unit: &'static str,
    /// The points in the order S, T, Z, G.
    pub points: [PointReport; 4],
    #[serde(skip)]
    at: OperatingPoint,
    #[serde(skip)]
    current: LinearCurrent,
}

/// One of the points S, T, Z and G.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PointReport {
    /// "S", "T", "Z" or "G".
    pub name: &'static str,
    /// UnboundedControl in steps; may lie outside the control range.
    pub control: f64,
    /// Ordinate in the scheme's unit.
    pub y: f64,
}

/// Regime, mode and duty of a control value by both duty rules.
#[derive(Debug, PartialEq, Serialize)]
pub struct Placed {
    /// Control value in steps.
    pub control: i16,
    /// Regime, mode and duty linear between the points.
    #[serde(flatten)]
    pub linear_duty: PlacedDrive,
    /// Regime, mode and duty that make the mean current linear, on this board's bridge.
    pub linear_current: PlacedDrive,
}

/// The bridge's command, and its regime.
#[derive(Debug, PartialEq, Serialize)]
pub struct PlacedDrive {
    /// The regime, relative to the motion.
    pub regime: &'static str,
    /// The mode of the bridge: "9/8", "6/2" or "5/0".
    pub mode: &'static str,
    /// Duty of the mode's first state, 0 to 1.
    pub duty: f64,
}

impl PlacedDrive {
    fn new(at: OperatingPoint, drive: Drive) -> Self {
        Self { regime: at.regime(drive).name(), mode: drive.mode.name(), duty: drive.duty.to_f64() }
    }
}

impl OperatingReport {
    /// Computes the points; speed in counts per second, battery in millivolts.
    ///
    /// For counter-clockwise motion the points are the mirror image: control values and ordinates are negated.
    ///
    /// # Errors
    /// If the firmware cannot represent the motor, its back EMF or the battery.
    pub fn new(motor: Motor, scheme: Scheme, speed_cps: i32, battery_mv: u16) -> Result<Self, StudyError> {
        let winding = winding(&motor)?;
        let emf = winding.emf.emf_within_range(CountsPerSecond::new(speed_cps))?;
        let at = OperatingPoint::new(emf, Millivolts::new(battery_mv)).ok_or(StudyError::NoBattery)?;
        let side = if at.counter_clockwise() { -1.0 } else { 1.0 };
        let Points { s, t, z, g } = Points::new(scheme, at);
        let (v, e) = (f64::from(battery_mv) * 1e-3, emf.to_f64().abs() * 1e-3);
        let volts = scheme == Scheme::A;
        // Ordinates are equivalent voltages in Scheme A. In other schemes they are currents: voltage minus back EMF,
        // divided by the resistance.
        let y = |volt: f64| side * if volts { volt } else { (volt - e) / motor.r.0 } + 0.0;
        let point = |name, x: braking::UnboundedControl, volt| PointReport {
            name,
            control: side * x.to_f64() + 0.0,
            y: y(volt),
        };
        Ok(Self {
            motor: motor.name,
            scheme: SchemeWords(scheme),
            speed_cps,
            battery_mv,
            emf_mv: emf.to_f64(),
            y_unit: if volts { "V" } else { "A" },
            points: [point("S", s, -v), point("T", t, 0.0), point("Z", z, e), point("G", g, v)],
            at,
            current: LinearCurrent::new(&winding, &BRIDGE),
        })
    }

    /// Regime, mode and duty of a control value.
    pub fn place(&self, control: Control) -> Placed {
        let linear_current = braking::linear_current(&self.current, self.scheme.0, self.at, control);
        Placed {
            control: control.get(),
            linear_duty: PlacedDrive::new(self.at, braking::linear_duty(self.scheme.0, self.at, control)),
            linear_current: PlacedDrive::new(self.at, linear_current),
        }
    }

    /// The quantity of the ordinate, with its unit.
    pub fn ordinate(&self) -> &'static str {
        if self.y_unit == "V" { "equivalent voltage, V" } else { "current, A" }
    }

    /// One line on the operating point.
    pub fn heading(&self) -> String {
        format!(
            "{} at {} counts/s on {:.3} V, {}: back EMF {:.3} V",
            self.motor,
            self.speed_cps,
            f64::from(self.battery_mv) * 1e-3,
            scheme::describe(self.scheme.0),
            self.emf_mv * 1e-3
        )
    }

    /// The points and the lines between them within the control range.
    pub fn figure(&self) -> Figure {
        let points = self.points.map(|p| Point {
            at: (p.control / f64::from(Control::MAX.get()), p.y),
            name: p.name.into(),
            colour: colour::INK,
        });
        let look = Look {
            counter_clockwise: self.at.counter_clockwise(),
            jump: self.scheme.0 == Scheme::ForwardReverse,
            height: 480.0,
        };
        Figure {
            title: "Control values and their regimes".into(),
            subtitle: self.heading(),
            x_label: "control".into(),
            x_range: Some(CONTROL_RANGE),
            panels: vec![panel(self.ordinate().into(), points, look)],
        }
    }
}

/// Full scale of control values in charts.
pub(crate) const FULL_SCALE: f64 = 1.0;
/// The axis of control values in charts: full scale and a margin.
pub(crate) const CONTROL_RANGE: (f64, f64) = (-1.08, 1.08);

/// A control value as a fraction of full scale, -1 to 1.
pub(crate) fn fraction(steps: i16) -> f64 {
    f64::from(steps) / f64::from(Control::MAX.get())
}

/// How the points of a motor are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// True if the motor turns counter-clockwise. Then the labels 9/8 and 6/2 are exchanged. The colours of the regimes
    /// are not exchanged.
    pub(crate) counter_clockwise: bool,
    /// True if there is no braking regime between T and Z.
    pub(crate) jump: bool,
    /// Height of the panel in pixels.
    pub(crate) height: f64,
}

/// Draws the lines from S via T and Z to G within the control range. `points` are in this order.
pub(crate) fn panel(y_label: String, points: [Point; 4], look: Look) -> Panel {
    let [s, t, z, g] = &points;
    let [forward, reverse] = if look.counter_clockwise { ["6/2", "9/8"] } else { ["9/8", "6/2"] };
    let line = |name: String, colour, from: &Point, to: &Point| {
        Series::new(name, colour, Style::Line, within_reach(from.at, to.at))
    };
    let between = if look.jump {
        line("a jump".into(), colour::GREY, t, z)
    } else {
        line("braking (5/0)".into(), colour::BRAKING, t, z)
    };
    let mut series = vec![
        line(format!("reverse ({reverse})"), colour::REVERSE, s, t),
        between,
        line(format!("forward ({forward})"), colour::FORWARD, z, g),
    ];
    series.retain(|line| !line.data.is_empty());
    let largest = series.iter().flat_map(|s| &s.data).map(|p| p.1.abs()).fold(0.0, f64::max);
    let y_range = Some((-1.15 * largest, 1.15 * largest));
    Panel { y_range, points: points.into(), ..Panel::new(y_label, look.height, series) }
}

/// The part of a line from `a` to `b` that lies within the control range, ascending.
fn within_reach(a: (f64, f64), b: (f64, f64)) -> Vec<(f64, f64)> {
    let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
    let (low, high) = (a.0.max(-FULL_SCALE), b.0.min(FULL_SCALE));
    if low > high {
        return Vec::new();
    }
    if a.0 == b.0 {
        return vec![a, b];
    }
    let y = |x: f64| a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0);
    vec![(low, y(low)), (high, y(high))]
}
