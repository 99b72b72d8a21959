//! The bridge in one state, and through one PWM period, with its diodes: exact between events.
//!
//! While a current of one sign flows in one state the terminal voltage is constant but for the
//! switches' resistance, so at constant back EMF
//! `L i' + (R + n Ron) i + e = b Vbat + d Vd` has an exponential as its solution, and the time when
//! the current reaches zero is a logarithm. At zero the terminal voltages decide whether current
//! starts in either direction, or none does: discontinuous conduction.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::si::{Amps, Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Circuit, Conditions, Integrals, Pwm};
//!
//! // One period from rest at a tenth of the duty: a pulse, which has died away by its end.
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
use super::si::{Amps, Henries, Hertz, Ohms, Seconds, Volts};
use crate::bridge::{BridgeConstants, Mode, State};

/// What the switches and diodes cost, and how fast they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Drop of a conducting catch diode, at least 0.
    pub vd: Volts,
    /// Resistance of one closed switch, at least 0.
    pub ron: Ohms,
    /// What switching takes.
    pub edges: Edges,
}

/// What switching takes. During an edge the voltage across the motor goes in a straight line from that of one state to
/// that of the other, as far as the current allows; the switch that does so gets the heat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    /// From the PWM line's rise to the state of the duty, s.
    pub turn_on: Seconds,
    /// From the PWM line's fall to the other state, s.
    pub turn_off: Seconds,
    /// For which the bridge is open when its mode changes, s.
    pub change: Seconds,
}

impl Edges {
    /// At once.
    pub const NONE: Self = Self { turn_on: Seconds(0.0), turn_off: Seconds(0.0), change: Seconds(0.0) };

    /// True if the PWM line's edges take any time.
    pub(super) fn are_slow(&self) -> bool {
        self.turn_on.0 > 0.0 || self.turn_off.0 > 0.0
    }
}

impl Bridge {
    /// No losses.
    pub const IDEAL: Self = Self::lossy(Volts(0.0), Ohms(0.0));

    /// Fast switches with this diode drop and on-resistance.
    #[must_use]
    pub const fn lossy(vd: Volts, ron: Ohms) -> Self {
        Self { vd, ron, edges: Edges::NONE }
    }

    /// The bridge that the firmware is told of.
    #[must_use]
    pub const fn new(constants: BridgeConstants) -> Self {
        let timing = constants.timing();
        let edges = Edges {
            turn_on: Seconds(timing.turn_on_ns as f64 / 1e9),
            turn_off: Seconds(timing.turn_off_ns as f64 / 1e9),
            change: Seconds(timing.change_us as f64 / 1e6),
        };
        let (vd, ron) = (constants.diode_mv() as f64 / 1e3, constants.switch_mohm() as f64 / 1e3);
        Self { edges, ..Self::lossy(Volts(vd), Ohms(ron)) }
    }
}

impl From<BridgeConstants> for Bridge {
    fn from(constants: BridgeConstants) -> Self {
        Self::new(constants)
    }
}

/// The battery's voltage and the motor's back EMF, both constant for the while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Voltage at the bridge's supply.
    pub battery: Volts,
    /// Back EMF, positive when turning clockwise.
    pub emf: Volts,
}

/// Two states that alternate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pwm {
    /// The state during the duty, which comes first.
    pub on: State,
    /// The state during the rest of the period.
    pub off: State,
    /// Share of the period spent in `on`, 0 to 1.
    pub duty: f64,
    /// Periods per second.
    pub frequency: Hertz,
}

impl Pwm {
    /// The two states of a mode.
    #[must_use]
    pub const fn new(mode: Mode, duty: f64, frequency: Hertz) -> Self {
        Self { on: mode.on(), off: mode.off(), duty, frequency }
    }
}

/// Integrals over some time of what flowed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrals {
    /// Motor current, A s.
    pub current: f64,
    /// Square of the motor current, A² s.
    pub square: f64,
    /// Charge that left the battery, C, at least 0.
    pub from_battery: f64,
    /// Charge that went back into the battery, C, at least 0.
    pub to_battery: f64,
    /// Heat in winding, switches and diodes, J.
    pub heat: f64,
    /// Time without current, s.
    pub idle: f64,
}

impl Integrals {
    /// Net charge that left the battery, C.
    #[must_use]
    pub fn battery(&self) -> f64 {
        self.from_battery - self.to_battery
    }
}

/// A winding behind a bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circuit {
    /// Winding resistance, above 0.
    pub r: Ohms,
    /// Winding inductance, above 0.
    pub l: Henries,
    /// The bridge.
    pub bridge: Bridge,
}

/// A part of a PWM period, in seconds from its beginning.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) on: State,
    pub(super) off: State,
    /// The end of the duty.
    pub(super) on_s: f64,
    pub(super) period_s: f64,
    pub(super) from_s: f64,
    pub(super) window_s: f64,
}

/// Steps in which an edge is followed.
const EDGE_STEPS: usize = 8;

/// On the way between two states, or in one of them.
#[derive(Clone, Copy)]
struct Between {
    on: State,
    off: State,
    /// Of the first: 0 to 1.
    share: f64,
}

impl Between {
    const fn in_state(state: State) -> Self {
        Self { on: state, off: state, share: 1.0 }
    }
}

/// The circuit that a current of one sign sees in one state.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// Current that would be reached if the path lasted.
    pub target: f64,
    /// Time constant.
    pub tau: f64,
    resistance: f64,
    battery: f64,
    /// Voltage lost in diodes per positive current; negative where the current is.
    drop: f64,
}

impl Circuit {
    /// The winding of `motor` behind `bridge`.
    #[must_use]
    pub const fn new(motor: &Motor, bridge: Bridge) -> Self {
        Self { r: motor.r, l: motor.l, bridge }
    }

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

    /// The voltage across the motor is as far on its way as the edge; the battery sees the state of the duty, for it is
    /// its switch that gives way.
    fn path_between(&self, between: Between, sign: CurrentSign, at: Conditions) -> Path {
        let Between { on, off, share } = between;
        let on = self.path(on, sign, at);
        if share >= 1.0 {
            return on;
        }
        let off = self.path(off, sign, at);
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

    /// Which way current starts to flow from zero, or `None` if it does not.
    #[must_use]
    pub fn starts(&self, state: State, at: Conditions) -> Option<CurrentSign> {
        self.starts_between(Between::in_state(state), at)
    }

    fn starts_between(&self, between: Between, at: Conditions) -> Option<CurrentSign> {
        // Diodes oppose what flows, so at most one of the two holds.
        if self.path_between(between, CurrentSign::Positive, at).target > 0.0 {
            Some(CurrentSign::Positive)
        } else if self.path_between(between, CurrentSign::Negative, at).target < 0.0 {
            Some(CurrentSign::Negative)
        } else {
            None
        }
    }

    /// Stays in `state` for `time` from current `start`: adds to `sums`, returns the final current.
    pub fn dwell(
        &self,
        state: State,
        start: Amps,
        at: Conditions,
        time: Seconds,
        sums: &mut Integrals,
    ) -> Amps {
        self.dwell_between(Between::in_state(state), start, at, time, sums)
    }

    fn dwell_between(
        &self,
        between: Between,
        start: Amps,
        at: Conditions,
        time: Seconds,
        sums: &mut Integrals,
    ) -> Amps {
        let mut current = start.0;
        let mut left = time.0;
        // At most one zero crossing: a current that starts from zero has its own sign as target.
        while left > 0.0 {
            let sign = if current > 0.0 {
                CurrentSign::Positive
            } else if current < 0.0 {
                CurrentSign::Negative
            } else if let Some(sign) = self.starts_between(between, at) {
                sign
            } else {
                sums.idle += left;
                return Amps(0.0);
            };
            let path = self.path_between(between, sign, at);
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

    /// One period of `pwm` from current `start`: adds to `sums`, returns the final current.
    pub fn period(&self, pwm: Pwm, start: Amps, at: Conditions, sums: &mut Integrals) -> Amps {
        let period = 1.0 / pwm.frequency.0;
        let on = pwm.duty.clamp(0.0, 1.0) * period;
        self.part_of_period(
            Part { on: pwm.on, off: pwm.off, on_s: on, period_s: period, from_s: 0.0, window_s: period },
            start,
            at,
            sums,
        )
    }

    /// A part of a period: adds to `sums`, returns the final current.
    pub(super) fn part_of_period(
        &self,
        part: Part,
        start: Amps,
        at: Conditions,
        sums: &mut Integrals,
    ) -> Amps {
        let Part { on, off, on_s, period_s, from_s, window_s } = part;
        // A line that does not move has no edges.
        if !self.bridge.edges.are_slow() || on_s <= 0.0 || on_s >= period_s {
            let high_s = (on_s - from_s).clamp(0.0, window_s);
            let turn = self.dwell(on, start, at, Seconds(high_s), sums);
            return self.dwell(off, turn, at, Seconds(window_s - high_s), sums);
        }
        let to_s = from_s + window_s;
        let Edges { turn_on, turn_off, .. } = self.bridge.edges;
        // An edge that the other one overtakes ends there.
        let (risen_s, fallen_s) = (turn_on.0.min(on_s), (on_s + turn_off.0).min(period_s));
        let top = if turn_on.0 > 0.0 { risen_s / turn_on.0 } else { 1.0 };
        let step = |n: usize, length: f64| length * n as f64 / EDGE_STEPS as f64;
        let mut current = start;
        let mut begin_s = 0.0;
        let mut until = |end_s: f64, share: f64, sums: &mut Integrals| {
            let (from, to) = (f64::max(begin_s, from_s), f64::min(end_s, to_s));
            if to > from {
                current =
                    self.dwell_between(Between { on, off, share }, current, at, Seconds(to - from), sums);
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

impl Path {
    /// Adds the integrals over `span`, in which the current went the share `travelled` of the way
    /// from `start` to the target.
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
