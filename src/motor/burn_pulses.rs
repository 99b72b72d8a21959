//! Burn pulses: braking that returns no energy to the bus, for a supply that cannot take energy back.
//!
//! A motor that brakes less than with a shorted winding returns a part of its energy to the bus. Two alternating
//! pulses avoid this. Each pulse lasts some milliseconds:
//!
//! * **Short:** the bridge shorts the winding. The winding dissipates all energy, and the motor brakes more than
//!   requested. If the current of the short circuit exceeds the motor's current limit, the motor brakes with the
//!   current limit instead, and returns a part of its energy.
//! * **Forward:** the bridge drives the motor with 10 to 30 % more than its back EMF. At the end of a short circuit
//!   the winding returns energy, and the forward pulse draws this energy from the bus again. The motor brakes less
//!   than requested.
//!
//! ```text
//!             surplus > +1.5 ms x |e|, and the motor may end its short
//!     +-------+ ------------------------------------------------> +---------+
//!     | Short |                                                   | Forward |
//!     +-------+ <------------------------------------------------ +---------+
//!             surplus < -1.5 ms x |e|
//! ```
//!
//! * *e*: back EMF of the motor, in volts.
//! * *Requested voltage*: the mean voltage that the motor should have, between 0 and e.
//! * *Applied voltage*: the voltage of the present pulse.
//! * *Surplus*: the time integral of requested minus applied voltage, signed in the direction of motion. If the surplus
//!   is above 0, the motor was braked too much. The pulses keep the surplus near 0, so on average the motor brakes as
//!   requested.
//!
//! There is no single command that brakes less than a short circuit and returns no energy. Proportional braking returns
//! the energy that the winding does not dissipate. A bridge that opens returns the energy of the winding. Reverse
//! driving returns nothing, but brakes more than a short circuit.

use super::{Command, Motor};
use crate::braking::{Modulation, OperatingPoint};
use crate::supply::Battery;
use crate::units::single::{at_least, at_most};
use crate::units::{Micros, Share, Voltage};
use libm::sqrtf;

/// Magnitude of the surplus at which one pulse ends and the other begins, in us times the back EMF. A pulse then
/// lasts long enough for the bridge to change its mode, and for the energy of the winding to be small compared with the
/// energy of the pulse. A pulse is so short that the speed hardly changes within the pulse.
const PULSE_MICROS: f32 = 1_500.0;

/// Largest magnitude of the surplus that is kept, in multiples of [`PULSE_MICROS`] times the back EMF. A larger surplus
/// is reduced to this limit. The surplus exceeds the limit while the motor must stay in its short circuit, or when the
/// back EMF falls. A motor must stay in its short circuit if another motor ends a short circuit first, if the draw of
/// the supply is limited, or if the back EMF is near the battery voltage.
const LARGEST_SURPLUS: f32 = 4.0;
/// Share of the largest surplus from which on the surplus counts as at its limit. The limit rises with the back EMF,
/// and the surplus may follow a little later.
const AT_LIMIT_SHARE: f32 = 0.95;

/// Voltage of a [`Pulse::Forward`] beyond the back EMF, as a share of the back EMF, at the least dissipation. At the
/// end of a short circuit the winding returns energy to the bus. A forward pulse with this share draws about the same
/// energy from the bus. The share grows with the strength of dissipation, [`Battery::dissipate`].
const LEAST_FORWARD_SHARE: f32 = 0.1;
/// Voltage of a [`Pulse::Forward`] beyond the back EMF, as a share of the back EMF, at full dissipation.
///
/// A back EMF constant that is configured too low by 23 % or more puts the forward pulse below the real back EMF,
/// because 1.3 times 0.77 is 1. The pulse then draws nothing from the bus. A simulated NeveRest 60 at a back EMF of 8 V
/// returned no energy on balance with 30 % too little, and 0.02 W with 40 % too little.
const LARGEST_FORWARD_SHARE: f32 = 0.3;

/// A kind of pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pulse {
    /// The bridge shorts the winding.
    Short,
    /// The bridge drives the motor beyond its back EMF.
    Forward,
}

/// The pulses of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct BurnPulses {
    /// Time up to which the surplus is integrated.
    integrated_until: Micros,
    /// Surplus, in volts times microseconds.
    surplus_volt_us: f32,
    /// Requested voltage since `integrated_until`, in V.
    requested_volts: f32,
    /// Back EMF since `integrated_until`, in V.
    emf_volts: f32,
    /// Present pulse; `None` while the bridge applies the requested voltage without pulses, or the motor does not
    /// brake.
    pulse: Option<Pulse>,
    /// Applied voltage of the last [`Pulse::Forward`], in V.
    forward_volts: f32,
    /// Applied voltage of the last [`Pulse::Short`], in V: 0 unless the current limit reduces the current of the short
    /// circuit.
    short_volts: f32,
}

impl BurnPulses {
    /// No pulse, and no surplus.
    pub(super) const NONE: Self = Self {
        integrated_until: Micros::new(0),
        surplus_volt_us: 0.0,
        requested_volts: 0.0,
        emf_volts: 0.0,
        pulse: None,
        forward_volts: 0.0,
        short_volts: 0.0,
    };

    /// True during a [`Pulse::Forward`].
    pub(super) fn is_forward(&self) -> bool {
        self.pulse == Some(Pulse::Forward)
    }

    /// True while pulses replace the requested voltage.
    pub(super) const fn is_active(&self) -> bool {
        self.pulse.is_some()
    }

    /// Ends the pulses, because the bridge applies the requested voltage without pulses from now on. The surplus is
    /// kept.
    pub(super) fn pause(&mut self, now: Micros) {
        self.integrate(now);
        self.pulse = None;
    }

    /// Ends the pulses and discards the surplus, because the command within all limits returns no energy. The bridge is
    /// then open, shorts the winding all the time, or drives forward or in reverse.
    pub(super) const fn stop(&mut self) {
        *self = Self::NONE;
    }

    /// Integrates the surplus of the present pulse up to now. Without a pulse no surplus accumulates.
    fn integrate(&mut self, now: Micros) {
        let passed = now.since(self.integrated_until) as u32;
        self.integrated_until = self.integrated_until.max(now);
        let applied_volts = match self.pulse {
            Some(Pulse::Short) => self.short_volts,
            Some(Pulse::Forward) => self.forward_volts,
            None => return,
        };
        self.surplus_volt_us +=
            in_direction_of_motion(self.requested_volts - applied_volts, self.emf_volts) * passed as f32;
    }

    /// Limits the surplus, and returns the next pulse of a motor with this back EMF in V. `may_end_short` is
    /// true if the motor may end a short circuit now.
    fn choose_pulse(&mut self, emf_volts: f32, may_end_short: bool) -> Pulse {
        let threshold = PULSE_MICROS * emf_volts.abs();
        let largest = largest_surplus_volt_us(emf_volts);
        self.surplus_volt_us = at_most(at_least(self.surplus_volt_us, -largest), largest);
        match self.pulse {
            None | Some(Pulse::Short) if may_end_short && self.surplus_volt_us > threshold => Pulse::Forward,
            Some(Pulse::Forward) if self.surplus_volt_us >= -threshold => Pulse::Forward,
            _ => Pulse::Short,
        }
    }

    /// Begins a pulse with this applied voltage, or continues the present pulse. When the pulse changes, the
    /// bridge is open for `change_us` microseconds.
    fn set_pulse(
        &mut self,
        pulse: Pulse,
        applied_volts: f32,
        requested_volts: f32,
        emf_volts: f32,
        change_us: u16,
    ) {
        if pulse != self.pulse.unwrap_or(Pulse::Short) {
            self.surplus_volt_us +=
                in_direction_of_motion(applied_volts - emf_volts, emf_volts) * f32::from(change_us);
        }
        match pulse {
            Pulse::Forward => self.forward_volts = applied_volts,
            Pulse::Short => self.short_volts = applied_volts,
        }
        (self.requested_volts, self.emf_volts, self.pulse) = (requested_volts, emf_volts, Some(pulse));
    }

    /// True if the surplus is at its upper limit. The motor then must stay in its short circuit, and the mean voltage
    /// of the motor is no longer the requested voltage.
    fn stays_short(&self) -> bool {
        let is_at_limit = self.surplus_volt_us >= AT_LIMIT_SHARE * largest_surplus_volt_us(self.emf_volts);
        self.pulse == Some(Pulse::Short) && is_at_limit
    }

    /// Mean voltage of the motor during the pulses, in V: the requested voltage while the pulses alternate, and the
    /// voltage of the short circuit while the motor must stay in its short circuit.
    pub(super) fn mean_volts(&self) -> f32 {
        if self.stays_short() { self.short_volts } else { self.requested_volts }
    }

    /// Computes the constant voltage across the resistance, in V, that would heat the winding as much as the pulses do.
    /// The pulses heat the winding more than their mean current would.
    pub(super) fn heating_volts(&self) -> f32 {
        let (short, forward) = (self.short_volts - self.emf_volts, self.forward_volts - self.emf_volts);
        // Share of the time in which the pulse is forward. Before the first forward pulse the share is 0.
        let share = if in_direction_of_motion(forward, self.emf_volts) > 0.0 {
            let share = (self.mean_volts() - self.short_volts) / (self.forward_volts - self.short_volts);
            at_most(at_least(share, 0.0), 1.0)
        } else {
            0.0
        };
        sqrtf((1.0 - share) * short * short + share * forward * forward)
    }
}

impl Motor {
    /// Begins or continues a burn pulse, and replaces the command of the bridge by this pulse.
    pub(super) fn dissipate(
        &mut self,
        command: &mut Command,
        now: Micros,
        battery: &Battery,
        may_end_short: bool,
    ) {
        let velocity = self.regulator.velocity();
        let at = OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery.newest)
            .unwrap_or(command.request.at);
        let emf_volts = at.emf_volts();
        let forward_share =
            LEAST_FORWARD_SHARE + (LARGEST_FORWARD_SHARE - LEAST_FORWARD_SHARE) * battery.dissipate.to_f32();
        let headroom_volts = at.battery_volts() - emf_volts.abs();
        self.pulses.integrate(now);
        let mut pulse = self.pulses.choose_pulse(emf_volts, may_end_short);
        if battery.draw != Share::ALL || headroom_volts <= LEAST_FORWARD_SHARE * emf_volts.abs() {
            pulse = Pulse::Short;
        }
        let modulation = match pulse {
            Pulse::Forward => {
                let beyond_emf_volts = (forward_share * emf_volts.abs()).min(headroom_volts);
                let volts = emf_volts + beyond_emf_volts.copysign(emf_volts);
                self.modulator.for_voltage(at, Voltage::from_volts(volts))
            }
            Pulse::Short => Modulation::BRAKE,
        };
        command.bridge = self.within_limits(modulation, at, battery.draw);
        let [requested_volts, applied_volts] =
            [command.limited, command.bridge].map(|of| of.voltage.to_volts());
        let change_us = self.settings.bridge.timing.change_us;
        self.pulses.set_pulse(pulse, applied_volts, requested_volts, emf_volts, change_us);
    }
}

/// Returns the upper limit of the surplus at this back EMF, in volts times microseconds.
fn largest_surplus_volt_us(emf_volts: f32) -> f32 {
    LARGEST_SURPLUS * PULSE_MICROS * emf_volts.abs()
}

/// Returns `volts`, signed in the direction of motion.
fn in_direction_of_motion(volts: f32, emf_volts: f32) -> f32 {
    if emf_volts < 0.0 { -volts } else { volts }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::Range;

    /// Ratio of a forward pulse's voltage to the back EMF.
    const FORWARD_RATIO: f32 = 1.15;

    /// What the pulses do to a motor within 2 s.
    struct Simulated {
        /// Mean voltage of the motor, in V.
        mean_volts: f32,
        /// Root of the mean square of the voltage across the resistance, in V.
        effective_volts: f32,
        /// [`BurnPulses::heating_volts`] at the end.
        heating_volts: f32,
    }

    /// Steps the pulses once. Returns the pulse and its applied voltage in V.
    fn step(
        pulses: &mut BurnPulses,
        ms: u64,
        [requested_volts, emf_volts]: [f32; 2],
        change_us: u16,
        may_end_short: bool,
    ) -> (Pulse, f32) {
        pulses.integrate(Micros::new(1_000 * ms));
        let pulse = pulses.choose_pulse(emf_volts, may_end_short);
        let applied_volts = if pulse == Pulse::Forward { FORWARD_RATIO * emf_volts } else { 0.0 };
        pulses.set_pulse(pulse, applied_volts, requested_volts, emf_volts, change_us);
        (pulse, applied_volts)
    }

    /// Steps the pulses every millisecond for 2 s. A change of mode opens the bridge for `change_us` microseconds.
    fn simulate(emf: f32, requested: f32, change_us: u16) -> Simulated {
        const MS: u16 = 2_000;
        let mut pulses = BurnPulses::NONE;
        let (mut before, mut mean, mut square) = (Pulse::Short, 0.0, 0.0);
        for ms in 0..MS {
            let (pulse, applied) = step(&mut pulses, ms.into(), [requested, emf], change_us, true);
            let open = if pulse == before { 0.0 } else { f32::from(change_us) / 1_000.0 };
            before = pulse;
            mean += (applied * (1.0 - open) + emf * open) / f32::from(MS);
            square += (applied - emf) * (applied - emf) * (1.0 - open) / f32::from(MS);
        }
        Simulated { mean_volts: mean, effective_volts: square.sqrt(), heating_volts: pulses.heating_volts() }
    }

    #[test]
    fn mean_voltage_is_the_requested_voltage_and_heat_is_that_of_the_effective_voltage() {
        for emf in [0.5, 5.0, -9.0] {
            for share in [0.02, 0.3, 0.5, 0.8, 0.95] {
                for change_us in [0, 600] {
                    let simulated = simulate(emf, share * emf, change_us);
                    let miss = (simulated.mean_volts - share * emf).abs() / emf.abs();
                    assert!(miss < 0.01, "{emf} V, {share}, {change_us} us: {miss}");
                    // An open bridge does not heat the winding. The formula ignores this time.
                    let heat = simulated.heating_volts / simulated.effective_volts;
                    assert!((0.99..1.03).contains(&heat), "{emf} V, {share}, {change_us} us: {heat}");
                }
            }
        }
    }

    #[test]
    fn a_winding_that_stays_shorted_heats_as_in_a_short_circuit_until_pulses_alternate_again() {
        let volts @ [requested, emf] = [8.0, 10.0];
        let mut pulses = BurnPulses::NONE;
        let mut after = |milliseconds: Range<u64>, may_end_short| {
            for ms in milliseconds {
                step(&mut pulses, ms, volts, 0, may_end_short);
            }
            (pulses.heating_volts(), pulses.mean_volts())
        };
        let alternating = after(0..1_000, true);
        assert!(alternating.0 < 0.6 * emf && alternating.1 == requested, "{alternating:?}");
        assert_eq!(after(1_000..1_050, false), (emf, 0.0));
        assert_eq!(after(1_050..1_200, true), alternating);
    }

    #[test]
    fn a_short_circuit_ends_only_when_the_motor_may_end_it_and_its_surplus_is_compensated() {
        let mut pulses = BurnPulses::NONE;
        let mut pulse_at = |ms, may_end_short| step(&mut pulses, ms, [3.0, 6.0], 0, may_end_short).0;
        assert!((0..8).all(|ms| pulse_at(ms, false) == Pulse::Short));
        let forward = (8..40).take_while(|ms| pulse_at(*ms, true) == Pulse::Forward).count();
        assert!((8..12).contains(&forward), "forward for {forward} ms");
    }
}
