//! The motor current in one state of the bridge, and through one PWM period, including the catch diodes.
//!
//! The back EMF `e` is constant. While a current `i` of one sign flows in one state, it follows `L i' + (R + n Ron) i +
//! e = b Vbat + d Vd`. `L` and `R` are inductance and resistance of the winding, `Ron` is the resistance of a closed
//! switch, `Vbat` the battery voltage, and `Vd` the voltage drop of a catch diode.
//!
//! | term | meaning |
//! |---|---|
//! | `n` | number of closed switches in the current's path, 0 to 2 |
//! | `b` | coefficient of the battery voltage across the motor: 1, 0 or -1 |
//! | `d` | coefficient of the diode drop across the motor, -2 to 2 |
//!
//! The solution is an exponential, and the time at which the current reaches zero is a logarithm. The result is exact
//! for a bridge that switches in no time. A bridge with slow edges is approximated by steps of constant voltage. At
//! zero current the voltages decide whether current starts in one direction. If no current starts, conduction is
//! *discontinuous*.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::si::{Amps, Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Circuit, Conditions, Integrals, Pwm};
//!
//! // One period from zero current at duty 0.1: a current pulse, which is back at zero at the end of the period.
//! let circuit = Circuit::new(&characterised("AM 60 A")?, Bridge::IDEAL);
//! let at = Conditions { battery: Volts(12.0), emf: Volts(6.0) };
//! let mut sums = Integrals::default();
//! let end = circuit.period(Pwm::new(Mode::Cw98, 0.1, Hertz(20_000.0)), Amps(0.0), at, &mut sums);
//! assert_eq!(end, Amps(0.0));
//! assert!(sums.current > 0.0 && sums.idle > 0.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::bridge_states::CurrentSign;
use super::catalogue::Motor;
use super::numeric::phi1;
use super::si::{Amps, Henries, Hertz, Ohms, Seconds, Volts};
use crate::bridge::{BridgeConstants, Mode, State};

/// Losses and switching times of a bridge.
///
/// While current flows during an edge, the voltage across the motor changes linearly from one state to the other. The
/// switch that makes the edge dissipates the difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Voltage drop of a conducting catch diode, at least 0.
    pub vd: Volts,
    /// Resistance of one closed switch, at least 0.
    pub ron: Ohms,
    /// Time from the rise of the PWM line until the bridge is in the on state, s.
    pub turn_on: Seconds,
    /// Time from the fall of the PWM line until the bridge is in the off state, s.
    pub turn_off: Seconds,
    /// Time for which the bridge is open when its mode changes, s.
    pub change: Seconds,
}

impl Bridge {
    /// A bridge without losses and without switching times.
    pub const IDEAL: Self = Self::lossy(Volts(0.0), Ohms(0.0));

    /// Creates a bridge with this diode drop and on-resistance, and without switching times.
    #[must_use]
    pub const fn lossy(vd: Volts, ron: Ohms) -> Self {
        let none = Seconds(0.0);
        Self { vd, ron, turn_on: none, turn_off: none, change: none }
    }

    /// Returns true if an edge of the PWM line takes time.
    pub(super) fn has_slow_edges(&self) -> bool {
        self.turn_on.0 > 0.0 || self.turn_off.0 > 0.0
    }

    /// Creates the bridge that the firmware is configured for.
    #[must_use]
    pub const fn new(constants: BridgeConstants) -> Self {
        let timing = constants.timing;
        Self {
            vd: Volts(constants.diode_mv() as f64 / 1e3),
            ron: Ohms(constants.switch_mohm() as f64 / 1e3),
            turn_on: Seconds(timing.turn_on_ns as f64 / 1e9),
            turn_off: Seconds(timing.turn_off_ns as f64 / 1e9),
            change: Seconds(timing.change_us as f64 / 1e6),
        }
    }
}

/// Battery voltage and back EMF, both constant during a calculation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Supply voltage of the bridge.
    pub battery: Volts,
    /// Back EMF, positive when the motor turns clockwise.
    pub emf: Volts,
}

/// Pulse-width modulation: two states of the bridge that alternate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pwm {
    /// State in the first part of each period.
    pub on: State,
    /// State in the rest of each period.
    pub off: State,
    /// Share of the period spent in `on`, 0 to 1.
    pub duty: f64,
    /// Number of periods per second.
    pub frequency: Hertz,
}

impl Pwm {
    /// Creates a modulation between the two states of a mode.
    #[must_use]
    pub const fn new(mode: Mode, duty: f64, frequency: Hertz) -> Self {
        Self { on: mode.on(), off: mode.off(), duty, frequency }
    }
}

/// Integrals of current, charge and heat over a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrals {
    /// Motor current, A s.
    pub current: f64,
    /// Square of the motor current, A² s.
    pub square: f64,
    /// Charge that left the battery, C, at least 0.
    pub from_battery: f64,
    /// Charge that returned to the battery, C, at least 0.
    pub to_battery: f64,
    /// Heat in winding, switches and diodes, J.
    pub heat: f64,
    /// Time without current, s.
    pub idle: f64,
}

impl Integrals {
    /// Returns the net charge that left the battery, C.
    #[must_use]
    pub fn battery(&self) -> f64 {
        self.from_battery - self.to_battery
    }
}

/// A motor winding with its bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circuit {
    /// Winding resistance, above 0.
    pub r: Ohms,
    /// Winding inductance, above 0.
    pub l: Henries,
    /// Bridge that drives the winding.
    pub bridge: Bridge,
}

/// Number of steps of constant voltage that approximate the linear change during an edge. Chosen: with any number the
/// steps keep the mean voltage of the edge. `tests/bridge_timing.rs` compares the heat of the edges with a formula.
const EDGE_STEPS: usize = 8;

/// The path of a current of one sign in one state: voltages and resistance in series.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// Current after infinite time on this path, A.
    pub target: f64,
    /// Electrical time constant, s.
    pub tau: f64,
    /// Resistance of winding and switches, ohm.
    resistance: f64,
    /// Coefficient of the battery voltage in the path: 1, 0 or -1.
    battery: f64,
    /// Voltage drop of diodes, and of a switch during its edge, with the sign of the current, V.
    drop: f64,
}

impl Circuit {
    /// Combines the winding of `motor` with `bridge`.
    #[must_use]
    pub const fn new(motor: &Motor, bridge: Bridge) -> Self {
        Self { r: motor.r, l: motor.l, bridge }
    }

    /// Returns the largest decrease of the mean current of a window of `window_s` seconds per volt of back EMF, 1/ohm.
    pub(super) fn admittance(&self, window_s: f64) -> f64 {
        (1.0 - phi1(window_s * self.r.0 / self.l.0)) / self.r.0
    }

    /// Returns the path of a current of this sign in `state`.
    pub(super) fn path(&self, state: State, sign: CurrentSign, at: Conditions) -> Path {
        let terminal = state.terminal(sign);
        let battery = f64::from(terminal.battery);
        let drop = -f64::from(terminal.diode) * self.bridge.vd.0;
        let resistance = self.r.0 + f64::from(terminal.switches) * self.bridge.ron.0;
        Path {
            target: (battery * at.battery.0 - drop - at.emf.0) / resistance,
            tau: self.l.0 / resistance,
            resistance,
            battery,
            drop,
        }
    }

    /// Returns the path of a current of this sign during an edge, with a share of 0 to 1 of the on state.
    ///
    /// Motor voltage and resistance are interpolated between the two states. The current flows through the battery as
    /// in the on state, because a switch of the on state opens or closes.
    fn edge_path(&self, pwm: Pwm, share: f64, sign: CurrentSign, at: Conditions) -> Path {
        let on = self.path(pwm.on, sign, at);
        if share >= 1.0 {
            return on;
        }
        let off = self.path(pwm.off, sign, at);
        if share <= 0.0 {
            return off;
        }
        let mix = |on: f64, off: f64| share * on + (1.0 - share) * off;
        let across = |path: &Path| path.battery * at.battery.0 - path.drop;
        let resistance = mix(on.resistance, off.resistance);
        let voltage = mix(across(&on), across(&off));
        Path {
            target: (voltage - at.emf.0) / resistance,
            tau: self.l.0 / resistance,
            resistance,
            battery: on.battery,
            drop: on.battery * at.battery.0 - voltage,
        }
    }

    /// Simulates `state` for `time` from the current `start`. Adds the integrals to `sums` and returns the final
    /// current.
    pub fn dwell(
        &self,
        state: State,
        start: Amps,
        at: Conditions,
        time: Seconds,
        sums: &mut Integrals,
    ) -> Amps {
        dwell(|sign| self.path(state, sign, at), start, time, sums)
    }

    /// Simulates one period of `pwm` from the current `start`. Adds the integrals to `sums` and returns the final
    /// current.
    pub fn period(&self, pwm: Pwm, start: Amps, at: Conditions, sums: &mut Integrals) -> Amps {
        self.part_of_period(pwm, 0.0, 1.0 / pwm.frequency.0, start, at, sums)
    }

    /// Simulates `window_s` seconds of a period, from `from_s` seconds after its beginning. Adds the integrals to
    /// `sums` and returns the final current.
    pub(super) fn part_of_period(
        &self,
        pwm: Pwm,
        from_s: f64,
        window_s: f64,
        start: Amps,
        at: Conditions,
        sums: &mut Integrals,
    ) -> Amps {
        let Pwm { on, off, duty, frequency } = pwm;
        let period_s = 1.0 / frequency.0;
        let on_s = duty.clamp(0.0, 1.0) * period_s;
        // At duty 0 or 1 the PWM line has no edges.
        if !self.bridge.has_slow_edges() || on_s <= 0.0 || on_s >= period_s {
            let high_s = (on_s - from_s).clamp(0.0, window_s);
            let at_switching = self.dwell(on, start, at, Seconds(high_s), sums);
            return self.dwell(off, at_switching, at, Seconds(window_s - high_s), sums);
        }
        let to_s = from_s + window_s;
        let Bridge { turn_on, turn_off, .. } = self.bridge;
        // An edge ends early if the next edge begins before it is complete.
        let (risen_s, fallen_s) = (turn_on.0.min(on_s), (on_s + turn_off.0).min(period_s));
        let top = if turn_on.0 > 0.0 { risen_s / turn_on.0 } else { 1.0 };
        let step = |n: usize, length: f64| length * n as f64 / EDGE_STEPS as f64;
        let mut current = start;
        let mut begin_s = 0.0;
        let mut until = |end_s: f64, share: f64, sums: &mut Integrals| {
            let (from, to) = (f64::max(begin_s, from_s), f64::min(end_s, to_s));
            if to > from {
                let path = |sign| self.edge_path(pwm, share, sign, at);
                current = dwell(path, current, Seconds(to - from), sums);
            }
            begin_s = end_s;
        };
        let middle = |n: usize| (n as f64 - 0.5) / EDGE_STEPS as f64;
        for n in 1..=EDGE_STEPS {
            until(step(n, risen_s), top * middle(n), sums);
        }
        until(on_s, top, sums);
        let falls_s = fallen_s - on_s;
        for n in 1..=EDGE_STEPS {
            let gone = if turn_off.0 > 0.0 { middle(n) * falls_s / turn_off.0 } else { 1.0 };
            until(on_s + step(n, falls_s), (top - gone).max(0.0), sums);
        }
        until(period_s, 0.0, sums);
        current
    }
}

/// Simulates one state of the bridge for `time` from the current `start`. Adds the integrals to `sums` and returns the
/// final current. `path` returns the path of a current of each sign.
fn dwell(path: impl Fn(CurrentSign) -> Path, start: Amps, time: Seconds, sums: &mut Integrals) -> Amps {
    let mut current = start.0;
    let mut left = time.0;
    // The loop runs at most twice: a current that starts from zero does not return to zero in one state.
    while left > 0.0 {
        // Diode drops oppose the current, so current can start from zero in one direction at most.
        let sign = if current > 0.0 {
            CurrentSign::Positive
        } else if current < 0.0 {
            CurrentSign::Negative
        } else if path(CurrentSign::Positive).target > 0.0 {
            CurrentSign::Positive
        } else if path(CurrentSign::Negative).target < 0.0 {
            CurrentSign::Negative
        } else {
            sums.idle += left;
            return Amps(0.0);
        };
        let path = path(sign);
        let mut span = left;
        let mut travelled = -(-left / path.tau).exp_m1();
        let mut end = current + (path.target - current) * travelled;
        if current * end < 0.0 {
            span = (path.tau * (-current / path.target).ln_1p()).min(left);
            travelled = current / (current - path.target);
            end = 0.0;
        }
        path.add(current, span, travelled, sums);
        current = end;
        left -= span;
    }
    Amps(current)
}

impl Path {
    /// Adds the integrals over `span` seconds to `sums`.
    ///
    /// `travelled` is the change of the current during `span` as a share of the difference between `start` and target.
    fn add(&self, start: f64, span: f64, travelled: f64, sums: &mut Integrals) {
        let Self { target, tau, .. } = *self;
        let away = start - target;
        let charge = target * span + away * tau * travelled;
        let square =
            target * target * span + away * tau * travelled * (2.0 * target + 0.5 * away * (2.0 - travelled));
        sums.current += charge;
        sums.square += square;
        let battery = self.battery * charge;
        if battery >= 0.0 {
            sums.from_battery += battery;
        } else {
            sums.to_battery -= battery;
        }
        sums.heat += self.resistance * square + self.drop * charge;
    }
}
