//! The paper's figures, and figures of the currents that a control value gives with linear duty and with linear
//! current.

use crate::points::{self, CONTROL_RANGE, FULL_SCALE, Look, fraction};
use crate::{NamedFigure, StudyError};
use chart::{Figure, Panel, Point, Series, Style, colour};
use motor_hub::braking::{DutyRule, Modulator, OperatingPoint, Scheme};
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::model::load::Load;
use motor_hub::model::paper::{self, Points};
use motor_hub::model::response::{Applied, GearedMotor};
use motor_hub::model::si::{Hertz, Kilograms, Metres, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
use motor_hub::units::{Control, CountsPerSecond, EmfConstant, Millivolts};
use simulated::hardware::{self, winding};

/// The bridge of the paper's section 1.2 as an SVG document: where the current flows in both states of each mode, by the
/// direction in which the motor turns. The picture depends on no number, so it is a file.
pub const CIRCUITS: &str = include_str!("../../../docs/pictures/circuits.svg");

/// Battery voltage in figures, in volts.
const BATTERY: f64 = 12.0;
const BRIDGE: Bridge = Bridge::new(hardware::BRIDGE);
/// The duty rules in figures, with name and colour.
const RULES: [(&str, &str, DutyRule); 2] = [
    ("linear duty", colour::RED, DutyRule::LinearDuty),
    ("linear current", colour::BLUE, DutyRule::LinearCurrent),
];

/// All figures except the circuits, for the motor of the paper's examples.
///
/// # Errors
/// If the catalogue lacks the motor.
pub fn all() -> Result<Vec<NamedFigure>, StudyError> {
    let motor = &characterised("AM 60 A")?;
    let scheme = |title, scheme, unit| scheme_figure(motor, title, |_| scheme, unit);
    let figures = [
        ("1-structure", structure()),
        ("2-drop-to-back-emf", drop_figure(motor, false)),
        ("3-drop-to-mean-zero-current", drop_figure(motor, true)),
        ("4-scheme-a", scheme("Scheme A", paper::Scheme::A, "equivalent DC voltage, V")),
        ("5-scheme-b", scheme("Scheme B", paper::Scheme::B, "current, A")),
        ("6-scheme-c", scheme("Scheme C", paper::Scheme::C, "current, A")),
        ("7-scheme-d", scheme("Scheme D, blend 1/4", QUARTER, "current, A")),
        (
            "8-scheme-d-automatic",
            scheme_figure(motor, "Scheme D, automatic blend", automatic_blend, "current, A"),
        ),
        ("9-points-over-speed", over_speed(motor)),
        ("10-current-at-10-percent", currents(motor, 0.1)?),
        ("11-current-at-50-percent", currents(motor, 0.5)?),
        ("12-current-at-90-percent", currents(motor, 0.9)?),
        ("13-deviation-by-frequency", by_frequency(motor)?),
    ];
    Ok(figures.map(|(name, figure)| (name.to_owned(), figure)).into())
}

const QUARTER: paper::Scheme = paper::Scheme::D { blend: 0.25 };

/// Scheme D with the automatic blend, at a back EMF that is this share of the battery voltage.
fn automatic_blend(u: f64) -> paper::Scheme {
    paper::Scheme::D { blend: paper::blend_keeping_t_in_range(u) }
}

fn line(name: &str, colour: &'static str, data: Vec<(f64, f64)>) -> Series {
    Series::new(name, colour, Style::Line, data)
}

/// The points with their names, and the lines between them.
fn points_panel(points: &Points, y_label: String, height: f64) -> Panel {
    let corners = [("S", points.s), ("T", points.t), ("Z", points.z), ("G", points.g)];
    // Room for the names.
    let reach = 1.3 * corners.iter().map(|(_, p)| p.y.abs()).fold(0.0, f64::max);
    let named = corners.map(|(name, p)| Point { at: (p.x, p.y), name: name.to_owned(), colour: colour::INK });
    let look = Look { counter_clockwise: false, jump: false, height };
    Panel { y_range: Some((-reach, reach)), ..points::panel(y_label, named, look) }
}

fn structure() -> Figure {
    let at = |x: f64, y: f64| paper::Point { x, y };
    let points = Points {
        s: at(-1.0, -100.0),
        t: at(-0.5, -70.0),
        z: at(0.25, 30.0),
        g: at(1.0, 92.0),
        u: 0.0,
        valid: true,
    };
    Figure {
        title: "Relative structure of the points".to_owned(),
        subtitle: "paper, section 1.3".to_owned(),
        x_label: "control".to_owned(),
        x_range: Some(CONTROL_RANGE),
        panels: vec![points_panel(&points, "y".to_owned(), 420.0)],
    }
}

/// Current after the applied voltage drops from the voltage that keeps 1 rad/s at the output.
fn drop_figure(motor: &Motor, mean_zero: bool) -> Figure {
    let geared = GearedMotor::new(motor, &Load::flywheel(Kilograms(10.0), Metres(0.1)));
    let drop = geared.voltage_drop(RadPerSec(motor.gear_ratio), Seconds(0.05));
    let to = if mean_zero { drop.mean_zero_voltage } else { drop.emf };
    let start = geared.steady(Applied::voltage(drop.before));
    let data: Vec<(f64, f64)> = (0..=2000)
        .map(|n| 0.025 * f64::from(n))
        .map(|ms| (ms, geared.after(start, Applied::voltage(to), Seconds(1e-3 * ms)).current.0))
        .collect();
    let panel = |y_label: &str, y_range| {
        let current = line("current", colour::BLUE, data.clone());
        Panel { y_range, ..Panel::new(y_label, 300.0, vec![current]) }
    };
    let mut panels = vec![panel("motor current, A", None)];
    if !mean_zero {
        panels.push(panel("motor current, A: the same, enlarged", Some((0.0, 0.005))));
    }
    let goal = if mean_zero { "the voltage of zero mean current" } else { "the back EMF" };
    Figure {
        title: format!("Current after the voltage drops to {goal}"),
        subtitle: format!(
            "NeveRest 60, 10 kg flywheel, from 1 rad/s at the output: {:.4} V to {:.4} V",
            drop.before.0, to.0
        ),
        x_label: "time, ms".to_owned(),
        x_range: Some((0.0, 50.0)),
        panels,
    }
}

/// Back EMF of a motor at a share of its free speed, in volts.
fn emf_at(motor: &Motor, share: f64) -> f64 {
    let free = GearedMotor::new(motor, &Load::NONE).steady(Applied::voltage(Volts(BATTERY)));
    share * motor.ke.0 * free.speed.0
}

fn model_points(motor: &Motor, scheme: paper::Scheme, emf: f64) -> Points {
    let at = Conditions { battery: Volts(BATTERY), emf: Volts(emf) };
    scheme.points(FULL_SCALE, motor.r, at)
}

fn scheme_figure(motor: &Motor, title: &str, scheme: impl Fn(f64) -> paper::Scheme, unit: &str) -> Figure {
    let panel = |share: f64| {
        let emf = emf_at(motor, share);
        let points = model_points(motor, scheme(emf / BATTERY), emf);
        points_panel(&points, format!("{unit}, at {:.0} % of free speed", 100.0 * share), 240.0)
    };
    Figure {
        title: title.to_owned(),
        subtitle: "NeveRest 60 on 12 V at 10, 50 and 90 % of its free speed".to_owned(),
        x_label: "control".to_owned(),
        x_range: Some(CONTROL_RANGE),
        panels: [0.1, 0.5, 0.9].into_iter().map(panel).collect(),
    }
}

fn over_speed(motor: &Motor) -> Figure {
    let curve = |scheme: &dyn Fn(f64) -> paper::Scheme, of: fn(&Points) -> f64| -> Vec<(f64, f64)> {
        let shares = (0..=220).map(|n| 0.005 * f64::from(n));
        shares
            .map(|share| {
                let emf = emf_at(motor, share);
                let points = model_points(motor, scheme(emf / BATTERY), emf);
                let x = of(&points);
                (100.0 * share, if points.valid && x.abs() <= 1.22 { x } else { f64::NAN })
            })
            .collect()
    };
    let t = |points: &Points| points.t.x;
    let series = vec![
        line("Z of scheme A", colour::GREEN, curve(&|_| paper::Scheme::A, |points| points.z.x)),
        line("T of scheme B", colour::BLUE, curve(&|_| paper::Scheme::B, t)),
        line("T of scheme C", colour::RED, curve(&|_| paper::Scheme::C, t)),
        line("T of D, blend 1/4", colour::PURPLE, curve(&|_| QUARTER, t)),
        line("T of D, automatic", colour::INK, curve(&automatic_blend, t)),
    ];
    Figure {
        title: "Where braking begins and ends, over speed".to_owned(),
        subtitle: "NeveRest 60 on 12 V; the control range ends at +-1".to_owned(),
        x_label: "speed, % of free speed".to_owned(),
        x_range: Some((0.0, 110.0)),
        panels: vec![Panel { y_range: Some((-1.22, 1.22)), ..Panel::new("control", 460.0, series) }],
    }
}

/// Mean current of the event-exact bridge in amperes, for every 64th control value with a duty rule.
fn measured(
    motor: &Motor,
    scheme: Scheme,
    rule: DutyRule,
    emf: f64,
    hertz: f64,
) -> Result<Vec<(f64, f64)>, StudyError> {
    let bridge =
        BridgeConstants::new(hardware::BRIDGE.diode_mv(), hardware::BRIDGE.switch_mohm(), hertz as u32);
    let winding = winding(motor)?;
    let modulator = Modulator::new(&winding, &bridge?, scheme, rule);
    let constant = EmfConstant::from_bits(1 << 20)?;
    let speed = CountsPerSecond::saturating_from_bits((emf * 256e3).round() as i64);
    let point = OperatingPoint::new(constant.emf(speed), Millivolts::new((1e3 * BATTERY) as u16))
        .ok_or(StudyError::NoBattery)?;
    let circuit = Circuit::new(motor, BRIDGE);
    let at = Conditions { battery: Volts(BATTERY), emf: Volts(emf) };
    let current = |control: i16| {
        let drive = modulator.for_control(point, Control::new(control)).drive;
        let pwm = Pwm::new(drive.mode, drive.duty.to_f64(), Hertz(hertz));
        (fraction(control), circuit.steady(pwm, at).mean.0)
    };
    Ok((-511..=511).map(|n| current(64 * n)).collect())
}

/// The current in amperes that Scheme A or B requests.
fn requested(motor: &Motor, scheme: Scheme, emf: f64, control: f64) -> f64 {
    let c = control / FULL_SCALE;
    let volts = match scheme {
        Scheme::A => c * BATTERY - emf,
        _ => c * if c > 0.0 { BATTERY - emf } else { BATTERY + emf },
    };
    volts / (motor.r.0 + 2.0 * BRIDGE.ron.0)
}

/// Deviation of a control value's current from the requested current, in percent of Vbat/R.
fn deviation(motor: &Motor, scheme: Scheme, emf: f64, (control, current): (f64, f64)) -> f64 {
    100.0 * (current - requested(motor, scheme, emf, control)) / (BATTERY / motor.r.0)
}

fn worst(deviations: impl Iterator<Item = f64>) -> f64 {
    deviations.map(f64::abs).fold(0.0, f64::max)
}

fn currents(motor: &Motor, share: f64) -> Result<Figure, StudyError> {
    let hertz = f64::from(hardware::BRIDGE.pwm_hz());
    let emf = emf_at(motor, share);
    let mut panels = Vec::new();
    for (name, scheme) in [("A", Scheme::A), ("B", Scheme::B)] {
        let straight = (-511..=511).map(|n| fraction(64 * n)).map(|c| (c, requested(motor, scheme, emf, c)));
        let straight = line("asked for", colour::INK, straight.collect());
        let mut series = vec![Series { style: Style::Dashed, ..straight }];
        for (rule_name, colour, rule) in RULES {
            let data = measured(motor, scheme, rule, emf, hertz)?;
            let worst = worst(data.iter().map(|&at| deviation(motor, scheme, emf, at)));
            series.push(line(&format!("{rule_name}: {worst:.1} % off"), colour, data));
        }
        panels.push(Panel::new(format!("mean motor current, A: scheme {name}"), 320.0, series));
    }
    Ok(Figure {
        title: format!("What a control value becomes at {:.0} % of free speed", 100.0 * share),
        subtitle: format!(
            "NeveRest 60 on {BATTERY} V, {} kHz, Vd {} V, Ron {} mohm; worst deviation in % of Vbat/R",
            hertz / 1e3,
            BRIDGE.vd.0,
            hardware::BRIDGE.switch_mohm(),
        ),
        x_label: "control".to_owned(),
        x_range: Some((-1.01, 1.01)),
        panels,
    })
}

fn by_frequency(motor: &Motor) -> Result<Figure, StudyError> {
    let emf = emf_at(motor, 0.5);
    let mut panels = Vec::new();
    for hertz in [1_000.0, 8_000.0, 20_000.0] {
        let mut series = Vec::new();
        for (name, colour, rule) in RULES {
            let data = measured(motor, Scheme::B, rule, emf, hertz)?;
            let off: Vec<_> =
                data.into_iter().map(|at| (at.0, deviation(motor, Scheme::B, emf, at))).collect();
            let worst = worst(off.iter().map(|(_, deviation)| *deviation));
            series.push(line(&format!("{name}: {worst:.1} %"), colour, off));
        }
        let label = format!("deviation from the line, % of Vbat/R, at {:.0} kHz", hertz / 1e3);
        panels.push(Panel { y_range: Some((-30.0, 30.0)), ..Panel::new(label, 220.0, series) });
    }
    Ok(Figure {
        title: "Deviation from the line asked for, by PWM frequency".to_owned(),
        subtitle: "NeveRest 60 on 12 V at 50 % of free speed, scheme B, event-exact bridge".to_owned(),
        x_label: "control".to_owned(),
        x_range: Some((-1.01, 1.01)),
        panels,
    })
}
