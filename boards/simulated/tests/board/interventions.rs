//! Interventions in the battery and the motors of a served hub.

use crate::host::Served;
use motor_hub::extension::Request;
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::payload::Field;
use motor_hub::protocol::requests::{AdcChannel, BATTERY, ToHub};
use motor_hub::supply::Limits;
use simulated::encoder::{Encoder, Wire as EncoderWire};
use simulated::scenario::{Attached, Bus, Scenario, Timed};
use simulated::serve::interventions::{Interventions, OnMotor};

/// Serves a hub for this time with the interventions of each millisecond, and returns its answer to a request.
fn answer<A: Field>(
    scenario: &Scenario,
    interventions: impl Fn(u32) -> Interventions + 'static,
    time_ms: u32,
    request: impl Into<Request>,
) -> A {
    let mut hub = Served::new(scenario.clone(), &[2], interventions);
    hub.pass(time_ms);
    hub.value(request, 2)
}

#[test]
fn a_loose_encoder_of_an_intervention_loses_counts() {
    let counts = |encoder| {
        let motors = [OnMotor { torque_nm: Some(1.0), encoder, ..OnMotor::default() }; 4];
        let interventions = Interventions { motors, ..Interventions::default() };
        let counts: i32 =
            answer(&Scenario::to_serve(), move |_| interventions, 2_000, ToMotor::Encoder.to(0));
        f64::from(counts)
    };
    let sound = counts(None);
    let loose = counts(Some(Encoder::Loose { wire: EncoderWire::A }));
    // The wire has no contact for 30 of 130 ms on average.
    assert!((0.6..0.9).contains(&(loose / sound)), "{loose} of {sound}");
}

#[test]
fn a_restart_closes_the_contactor_and_disconnects_what_was_not_connected_at_the_start() {
    let mut scenario = Scenario::to_serve();
    scenario.bus =
        Some(Bus { capacitance_f: 0.001, one_way: false, opens_at_s: Some(0.5), limits: Limits::default() });
    let attached = Attached { analog_v: vec![2.0], ..Attached::default() };
    scenario.attached_over_time = vec![Timed { at_s: 0.5, value: attached }];
    let lower = Interventions { emf_v: Some(9.0), ..Interventions::default() };
    let restarted = Interventions { restarts: 1, ..lower };
    let reading = |channel: AdcChannel, later: Interventions| {
        let interventions = move |ms| if ms < 600 { Interventions::default() } else { later };
        let request = ToHub::Adc { channel, raw: false };
        answer::<i16>(&scenario, interventions, 1_000, request)
    };
    let first = AdcChannel::new(0).expect("in range");
    let [battery, input] = [BATTERY, first].map(|channel| reading(channel, lower));
    assert!(battery > 12_000 && input > 1_900, "{battery} mV, {input} mV");
    let [battery, input] = [BATTERY, first].map(|channel| reading(channel, restarted));
    assert!((8_900..9_100).contains(&battery) && input == 0, "{battery} mV, {input} mV");
}
