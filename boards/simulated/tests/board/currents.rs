//! Currents of simulated motors, as a scenario's current-sense lines show them.

use motor_hub::motor::{Report, SenseLine};
use simulated::scenario::Scenario;
use simulated::without_tasks;

/// Last report of an AM 60 A after a second of driving a heavy flywheel, which hardly moves.
fn driving(motor: &str) -> Report {
    let text = format!(
        "name = \"currents\"\nduration_s = 1.5\n[battery]\nemf_v = 12\nresistance_ohm = 0.05\n[[motors]]\n\
         label = \"one\"\nmotor = \"AM 60 A\"\nload = {{ inertia_kg_m2 = 50.0 }}\n\
         setpoints = [{{ at_s = 0.5, power = 0.5 }}]\n{motor}"
    );
    let scenario = Scenario::parse("currents.toml", &text).unwrap_or_else(|error| panic!("{error}"));
    let mut last = Report::INITIAL;
    without_tasks::run(&scenario, |moment| last = moment.snapshot.motors[0]).expect("it runs");
    last
}

fn measured(report: &Report) -> Option<f64> {
    report.measured.map(|current| f64::from(current.get()))
}

#[test]
fn a_sound_line_shows_the_current_also_of_a_wrongly_configured_motor() {
    let truth = driving("current_line = \"sound\"");
    let flows = f64::from(truth.current.get());
    let shown = measured(&truth).expect("it is measured");
    assert!(flows > 1_500.0 && (shown - flows).abs() < 0.03 * flows, "{shown} mA of {flows}");
    let wrongly = driving("current_line = \"sound\"\nconfigured = { resistance = 2.0 }");
    let shown = measured(&wrongly).expect("it is measured");
    assert!((shown - flows).abs() < 0.03 * flows, "{shown} mA of {flows}");
    assert!(f64::from(wrongly.current.get()) < 0.6 * flows, "{:?}", wrongly.current);
    assert_eq!((truth.sense_line, wrongly.sense_line), (SenseLine::Sound, SenseLine::Sound));
}

#[test]
fn a_broken_line_is_reported_and_the_modelled_current_is_used() {
    for (line, is) in
        [("absent", SenseLine::Absent), ("stuck-low", SenseLine::NoCurrent), ("stuck-high", SenseLine::Stuck)]
    {
        let report = driving(&format!("current_line = \"{line}\""));
        assert_eq!((report.sense_line, report.measured), (is, None), "{line}");
        assert!(report.best_current() == report.current && report.current.get() > 1_500, "{line}");
    }
}
