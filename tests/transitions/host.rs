//! Coefficients that hosts send while the motor runs.

use crate::common::velocity;
use crate::flywheel::{Knowledge, Subject};
use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::motion::Pidf;
use motor_hub::regulator::Coefficients;
use motor_hub::units::{Coefficient, Period};

fn coefficients(values: [f64; 4]) -> Coefficients {
    let [p, i, d, f] = values.map(|value| Coefficient::from_bits((65_536.0 * value) as i32));
    Coefficients { velocity: Pidf { p, i, d, f }, position: Pidf::default() }
}

/// Mean current of this number of milliseconds in A.
fn mean(subject: &mut Subject, ms: u32) -> f64 {
    let ticks = (ms / subject.period_ms()).max(1);
    (0..ticks).map(|_| subject.tick()).sum::<f64>() / f64::from(ticks)
}

#[test]
fn a_motor_that_is_given_other_coefficients_while_it_runs_goes_on_as_it_was() {
    let sets = [[1.2, 0.12, 0.0, 12.0], [10.0, 3.0, 0.0, 0.0], [2.0, 0.5, 0.1, 11.1], [10.0, 3.0, 0.1, 11.1]];
    for scheme in Scheme::ALL {
        for duty in DutyRule::ALL {
            for ms in [1, 10, 50, 100] {
                let period = Period::from_millis(ms).expect("in range");
                let mut subject = Subject::new(Knowledge::Configured, scheme, period, 0.0, 0.0);
                let speed = subject.free_speed / 2.0;
                subject.configure(|settings| settings.duty = duty);
                subject.bench.set(0, velocity(speed as i32));
                mean(&mut subject, 3_000);
                for set in sets {
                    let before = mean(&mut subject, 200);
                    subject.configure(|settings| settings.coefficients = Some(coefficients(set)));
                    let after = mean(&mut subject, 20);
                    let step = (after - before) / subject.stall_current;
                    assert!(
                        step.abs() < 0.1,
                        "{step} of the stall current: {scheme:?}, {duty:?}, {ms} ms, {set:?}"
                    );
                    mean(&mut subject, 6_000);
                    let off = subject.speed() / speed - 1.0;
                    assert!(off.abs() < 0.02, "off by {off}: {scheme:?}, {duty:?}, {ms} ms, {set:?}");
                }
            }
        }
    }
}
