//! Scenario files with mistakes are refused: the error gives the position, the value, and what is allowed.

use motor_hub::group::{Course, GroupCommand, Halt, TOLERANCE, usual_lag};
use motor_hub::hub::{Action, Command};
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::model::si::{NewtonMetres, Volts};
use motor_hub::units::CountsPerSecond;
use simulated::scenario::Scenario;
use simulated::scenario::expectation::{Bounds, Expectation, Expected, Quantity, Subject};

const SOUND: &str = r#"name = "test"
duration_s = 2.0
control_period_ms = 20
battery = { emf_v = 12.0, resistance_ohm = 0.1 }

[[motors]]
label = "one"
motor = "AM 60 A"
scheme = "D"
blend = 0.25
load = { inertia_kg_m2 = 0.05 }
coefficients.velocity = { p = 10.0, i = 20.0 }
setpoints = [
    { at_s = 0.0, velocity_cps = 1000 },
    { at_s = 1.0, position_counts = 10, tolerance_counts = 5, speed_limit_cps = 500 },
]
torques = [{ at_s = 0.5, torque_nm = 0.1 }]

[[expect]]
motor = "one"
from_s = 0.5
speed_between_cps = [-100, 1100]
"#;

#[test]
fn the_sound_scenario_is_accepted() {
    assert!(Scenario::parse("s.toml", SOUND).is_ok());
}

#[track_caller]
fn refused(from: &str, to: &str, says: &str) {
    refused_in(SOUND, from, to, says);
}

/// The scenario is refused once `to` stands in the place of `from`. The error is one line, and begins with its position.
#[track_caller]
fn refused_in(sound: &str, from: &str, to: &str, says: &str) {
    assert!(sound.contains(from), "{from:?} is not in the sound scenario");
    let error = Scenario::parse("s.toml", &sound.replacen(from, to, 1)).expect_err(to).to_string();
    assert!(error.starts_with("s.toml:") && error.contains(says), "{to:?}: {error}");
    assert!(!error.contains('\n'), "{to:?}: {error}");
}

/// An AM 60 A by its constants.
const CONSTANTS: &str = "constants = { ke_v_s_per_rad = 0.017766666666666667, counts_per_rev = 28, \
    resistance_ohm = 3.3, inductance_mh = 0.694, rotor_inertia_kg_m2 = 1.04e-5, gear_ratio = 60, efficiency = 0.9, \
    drag_nms_per_rad = 1.0185185185185186e-5 }";

#[test]
fn a_motor_may_be_given_by_its_constants_in_the_place_of_a_name() {
    let motor = |text: &str| {
        let scenario = Scenario::parse("s.toml", text).expect("sound");
        scenario.motors.first().expect("a motor").clone()
    };
    let given = motor(&SOUND.replace("motor = \"AM 60 A\"", CONSTANTS));
    let named = motor(SOUND);
    let settings = |of: &simulated::scenario::Motor| of.settings().expect("in range");
    assert_eq!(settings(&given), settings(&named));
    let aliased = motor(&SOUND.replace("AM 60 A", "NeveRest 60"));
    assert_eq!(aliased.constants, named.constants);

    let wrong = |from: &str, to: &str| CONSTANTS.replace(from, to);
    refused("motor = \"AM 60 A\"", &wrong("= 3.3", "= 0"), "allowed is 0.001 to 65.535");
    refused("motor = \"AM 60 A\"", &wrong("efficiency = 0.9", "efficiency = 90"), "allowed is 0.01 to 1");
    refused("motor = \"AM 60 A\"", &wrong("inductance_mh = 0.694,", ""), "`inductance_mh`");
    refused("motor = \"AM 60 A\"", &format!("{CONSTANTS}\nmotor = \"AM 60 A\""), "either");
    refused("motor = \"AM 60 A\"\n", "", "either");
}

#[test]
fn broken_toml_is_refused_where_it_breaks() {
    refused("name = \"test\"", "name = \"test", "s.toml:1:13: ");
    refused("duration_s = 2.0", "duration_s = ", "s.toml:2:14: ");
}

#[test]
fn a_wrong_value_is_refused_where_it_stands_with_its_key() {
    refused("emf_v = 12.0", "emf_v = inf", "s.toml:4:21: emf_v = inf is out of range; allowed is 1 to 60");
    refused("speed_limit_cps = 500", "speed_limit_cps = 0", "s.toml:15:81: speed_limit_cps = 0 is");
    refused("[-100, 1100]", "[\n    -100,\n    nan,\n]", "s.toml:24:5: speed_between_cps = NaN is");
    refused("load = {", "lod = {", "s.toml:11:1: unknown field `lod`");
}

#[test]
fn a_contradiction_is_refused_where_its_table_stands() {
    refused("velocity_cps = 1000", "", "s.toml:14:5: a set-point needs exactly one of");
    refused("motor = \"AM 60 A\"\n", "", "s.toml:6:1: a motor needs either");
    refused("from_s = 0.5", "from_s = 2.5", "s.toml:19:1: from_s = 2.5 is out of range; allowed is 0 to 2");
}

#[test]
fn unknown_and_missing_keys_name_the_known_ones() {
    refused("duration_s = 2.0", "duration_ms = 2000", "`duration_s`");
    refused("load = {", "lod = {", "`load`");
    refused("p = 10.0", "kp = 10.0", "`p`");
    refused("velocity_cps", "velocity", "`velocity_cps`");
    refused("duration_s = 2.0\n", "", "duration_s");
}

#[test]
fn an_unknown_motor_is_answered_with_the_known_ones() {
    refused("AM 60 A", "AM 61 A", "NeveRest 60, NeveRest 60-B");
    refused("AM 60 A", "Tetrix", "never characterised");
}

#[test]
fn numbers_out_of_range_name_the_range() {
    refused("duration_s = 2.0", "duration_s = 1e9", "0.001 to 300");
    refused("duration_s = 2.0", "duration_s = nan", "0.001 to 300");
    refused("control_period_ms = 20", "control_period_ms = 101", "1 to 100");
    refused("emf_v = 12.0", "emf_v = inf", "1 to 60");
    refused("0.05 }", "-0.05 }", "inertia_kg_m2 = -0.05");
    refused("p = 10.0", "p = -1.0", "0 to 32767");
    refused("velocity_cps = 1000", "velocity_cps = 2000000", "-1000000 to 1000000");
    refused("velocity_cps = 1000", "velocity_cps = 9e9", "velocity_cps = 9000000000 is out of range");
    refused("velocity_cps = 1000", "velocity_cps = 0.5", "expected a whole number");
    refused("velocity_cps = 1000", "velocity_cps = nan", "expected a whole number");
    refused("position_counts = 10", "position_counts = 3000000000", "-2147483648 to 2147483647");
    refused("tolerance_counts = 5", "tolerance_counts = -1", "0 to 65535");
    refused("velocity_cps = 1000", "power = 1.5", "-1 to 1");
    refused("speed_limit_cps = 500", "speed_limit_cps = 0", "1 to 1000000");
    refused("torque_nm = 0.1", "torque_nm = nan", "torque_nm");
    refused("load = {", "configured = { emf = 0.0 }\nload = {", "0.1 to 10");
    refused("0.1 }\n", "0.1, emf_over_time = [{ at_s = 1, emf_v = 0.5 }] }\n", "1 to 60");
    refused("blend = 0.25", "blend = 1.5", "0 (scheme B) to 1 (scheme C)");
    let rough = |table: &str, says: &str| refused("load = {", &format!("{table}\nload = {{"), says);
    rough("friction = { coulomb_percent = -1.0 }", "0 to 100");
    rough("friction = { coulomb_percent = nan }", "0 to 100");
    rough("friction = { coulomb_percent = 5.0, breakaway_percent = 4.0 }", "5 to 100");
    rough("friction = { breakaway_percent = 4.0 }", "`coulomb_percent`");
    rough("heat = [{ at_s = 1.0, winding_k = 201, magnets_k = 0 }]", "0 to 200");
    rough("heat = [{ at_s = 1.0, winding_k = 20 }]", "`magnets_k`");
    rough("cogging = { amplitude_percent = 101.0, per_turn = 6 }", "0 to 100");
    rough("cogging = { amplitude_percent = 1.0, per_turn = 0 }", "1 to 1000");
    rough("cogging = { amplitude_percent = 1.0 }", "`per_turn`");
}

#[test]
fn an_encoder_is_one_thing_at_a_time() {
    let encoder = |how: &str, says| {
        let with = format!("encoder = [{{ at_s = 1.0{how} }}]\nscheme = \"D\"");
        refused("scheme = \"D\"", &with, says);
    };
    encoder("", "exactly one of");
    encoder(", is = \"a-low\", glitches_per_s = 20", "exactly one of");
    encoder(", is = \"dirty\"", "`a-loose`");
    encoder(", glitches_per_s = 0", "1 to 100000");
    encoder(", slot_missing_of = 10001", "1 to 10000");
}

#[test]
fn contradictions_are_found() {
    refused("velocity_cps = 1000", "velocity_cps = 1000, power = 0.5", "exactly one of");
    refused("velocity_cps = 1000", "velocity_cps = 1000, current_a = 0.5", "exactly one of power, current_a");
    refused("velocity_cps = 1000", "current_a = -66", "-65.535 to 65.535");
    refused("velocity_cps = 1000", "current_a = 1, speed_limit_cps = 0", "1 to 1000000");
    refused("velocity_cps = 1000", "power = 1, speed_limit_cps = 9", "position_counts and current_a only");
    refused("velocity_cps = 1000", "", "exactly one of");
    refused("velocity_cps = 1000", "disable = false", "remove disable");
    refused("velocity_cps = 1000", "velocity_cps = 1000, tolerance_counts = 3", "position_counts only");
    refused(", tolerance_counts = 5", "", "needs tolerance_counts and speed_limit_cps");
    refused("scheme = \"D\"", "scheme = \"B\"", "scheme D only");
    refused("scheme = \"D\"", "scheme = \"E\"", "`none`, `A`, `B`, `C`, `D`");
}

#[test]
fn times_ascend_within_the_run() {
    refused("at_s = 1.0", "at_s = 0.0", "not after 0");
    refused("at_s = 1.0", "at_s = 2.5", "allowed is 0 to 2");
    refused("at_s = 0.0", "at_s = -1.0", "allowed is 0 to 2");
    refused("at_s = 0.5", "at_s = nan", "allowed is 0 to 2");
}

#[test]
fn an_expectation_is_of_somebody_at_some_time() {
    refused("motor = \"one\"", "motor = \"two\"", "no motor has the label \"two\"; labels are one");
    refused("motor = \"one\"", "motors = \"one\"", "`motor`");
    refused("from_s = 0.5", "from_s = 2.5", "0 to 2");
    refused("from_s = 0.5", "to_s = nan", "0 to 2");
    refused("from_s = 0.5", "from_s = 0.5\nto_s = 0.5", "from_s must be less than to_s");
    refused("from_s = 0.5", "bus_between_v = [0, 13]", "remove motor");
}

#[test]
fn an_expectation_says_something_that_a_run_can_miss() {
    let says = "speed_between_cps = [-100, 1100]";
    refused(says, "", "at least one key");
    refused(says, "never = []", "at least one key");
    refused(says, "speed_between_cps = [100, -100]", "low at most high");
    refused(says, "speed_between_cps = [0, nan]", "-1000000 to 1000000");
    refused(says, "speed_between_cps = [0]", "");
    refused(says, "settles_within_s = -1.0", "0 to 300");
    refused(says, "overshoot_below_percent = inf", "0 to 1000");
    refused(says, "current_step_below_a = -1.0", "0 to 1000");
    refused(says, "never = [\"coasts\"]", "`coast`");
    refused(says, "fault = \"broken\"", "`none`, `stuck`, `reversed`");
    refused("duration_s = 2.0", "duration_s = 2.0\nemulated = 1", "");
}

#[test]
fn an_expectation_of_no_motor_in_particular_is_of_each() {
    let second =
        "\n[[motors]]\nlabel = \"two\"\nmotor = \"AM 20 A\"\nsetpoints = [{ at_s = 0, power = 0.5 }]\n";
    let text = SOUND.replace("motor = \"one\"\n", "bus_between_v = [9, 13]\n") + second;
    let scenario = Scenario::parse("s.toml", &text).expect("it is valid");
    let bounds = |low, high| Bounds { low, high };
    let expectation = |subject, quantity, bounds| Expectation {
        subject,
        window_s: 0.5..2.0,
        expected: Expected::Quantity(quantity, bounds),
    };
    assert_eq!(
        scenario.expectations,
        [
            expectation(Subject::Motor(0), Quantity::Speed, bounds(-100.0, 1100.0)),
            expectation(Subject::Motor(1), Quantity::Speed, bounds(-100.0, 1100.0)),
            expectation(Subject::Battery, Quantity::Bus, bounds(9.0, 13.0)),
        ]
    );
}

#[test]
fn the_hub_is_configured_as_the_scenario_says_also_under_the_old_name_of_the_key() {
    let configured = |key: &str, factors: &str| {
        let text = SOUND.replace("scheme = \"D\"", &format!("{key} = {factors}\nscheme = \"D\""));
        let scenario = Scenario::parse("s.toml", &text).expect("it is valid");
        scenario.motors.first().expect("a motor").settings().expect("in range")
    };
    let [right, wrong] =
        ["{}", "{ resistance = 1.3, emf = 0.5 }"].map(|factors| configured("configured", factors));
    assert_eq!(configured("told", "{ resistance = 1.3, emf = 0.5 }"), wrong);
    assert!((2 * wrong.winding.emf.to_bits() - right.winding.emf.to_bits()).abs() <= 1);
    assert_ne!(wrong.winding.resistance, right.winding.resistance);
}

#[test]
fn the_hub_drives_one_to_four_differently_named_motors() {
    let motor = "[[motors]]\nlabel = \"n\"\nmotor = \"AM 20 A\"\nsetpoints = [{ at_s = 0, power = 0.5 }]\n";
    let with = |count: usize| {
        let more: String = (0..count).map(|n| motor.replace("\"n\"", &format!("\"{n}\""))).collect();
        Scenario::parse("s.toml", &format!("{SOUND}{more}"))
    };
    assert!(with(3).is_ok());
    assert!(with(4).expect_err("five motors").to_string().contains("5 motors; allowed are 1 to 4"));
    refused(SOUND.split_at(SOUND.find("[[motors]]").expect("a motor")).1, "motors = []", "0 motors");
    let twice = Scenario::parse("s.toml", &format!("{SOUND}{}", motor.replace("\"n\"", "\"one\"")));
    let twice = twice.expect_err("the same label twice").to_string();
    assert!(twice.contains("label \"one\" is used twice"), "{twice}");
    refused("label = \"one\"", "label = \" \"", "1 to 80 printable");
}

#[test]
fn the_friction_of_a_motor_is_configured_in_the_hub() {
    let friction = |keys: &str| {
        let text = SOUND.replacen("load = {", &format!("{keys}\nload = {{"), 1);
        let scenario = Scenario::parse("s.toml", &text).expect("it is valid");
        let settings = scenario.motors.first().map(|motor| motor.settings());
        let dynamics = settings.expect("a motor").expect("in range").dynamics;
        dynamics.expect("the dynamics are configured").friction.get()
    };
    assert_eq!(friction(""), 0);
    // 5 % of 12 V, less the voltage across two switches, balances the friction at rest.
    let friction = friction("friction = { coulomb_percent = 5.0 }");
    assert!((600..650).contains(&friction), "{friction} mV");
}

#[test]
fn friction_and_cogging_are_shares_of_the_stall_torque_and_stay_so_in_another_motor() {
    let rough =
        "friction = { coulomb_percent = 5.0 }\ncogging = { amplitude_percent = 2.0, per_turn = 6 }\nload = {";
    let scenario = Scenario::parse("s.toml", &SOUND.replacen("load = {", rough, 1)).expect("it is valid");
    let other = characterised("AM 3.7 B").expect("it is in the catalogue");
    for motor in scenario.motors.iter().flat_map(|motor| [motor.clone(), motor.with_constants(other)]) {
        let Motor { friction, cogging, name, .. } = motor.constants;
        let percent = |torque: NewtonMetres| 100.0 * torque.0 / motor.constants.stall_torque(Volts(12.0)).0;
        for (got, want) in [(friction.coulomb, 5.0), (friction.breakaway, 6.5), (cogging.amplitude, 2.0)] {
            assert!((percent(got) - want).abs() < 1e-12, "{name}: {got} instead of {want} %");
        }
        assert_eq!(cogging.per_turn, 6, "{name}");
    }
}

const TWO_WHEELS: &str = r#"
name = "test"
duration_s = 2.0
battery = { emf_v = 12.0, resistance_ohm = 0.1 }
[[motors]]
label = "left"
motor = "AM 60 A"
[[motors]]
label = "right"
motor = "AM 60 B"
[[groups]]
label = "base"
motors = ["left", "right"]
base = { wheel_diameter_mm = 90, track_mm = 300, counts_per_turn = [1680, -1680] }
courses = [
    { at_s = 0.0, straight_mm = 100, turn_degrees = 90, speed_cps = 1000, acceleration_cps2 = 4000 },
    { at_s = 1.0, on_cps = [-500, 300], acceleration_cps2 = 4000, lag_counts = 7, tolerance_counts = 0 },
]
[[expect]]
group = "base"
settles_within_s = 1.0
heading_error_below_degrees = 0.5
"#;

#[test]
fn a_group_is_sent_on_courses_by_the_wheels_of_its_base() {
    let scenario = Scenario::parse("g.toml", TWO_WHEELS).expect("it is valid");
    let group = scenario.groups.first().expect("a group");
    let courses: Vec<GroupCommand> = group.courses.iter().map(|course| course.value).collect();
    let [first, second]: [GroupCommand; 2] = courses.try_into().expect("two courses");
    // 100 mm less and more the 235.6 mm that a wheel goes in a quarter of a turn, the right one mirrored.
    assert_eq!(first.course, Course::by(&[(0, -806), (1, -1994)]).expect("two motors"));
    let usual = (usual_lag(CountsPerSecond::new(1_000)), TOLERANCE);
    assert_eq!(((first.lag, first.tolerance), first.halt), (usual, Halt::Stop));
    let on = [(0, CountsPerSecond::new(-500)), (1, CountsPerSecond::new(300))];
    assert_eq!(second.course, Course::on(&on).expect("two motors"));
    assert_eq!((second.lag, second.tolerance), (7, 0));
    let leads = scenario.commands().into_iter().map(|command| (command.at_s, command.value));
    let lead = |together| Command { motor: 0, action: Action::Lead(together) };
    assert_eq!(leads.collect::<Vec<_>>(), [(0.0, lead(first)), (1.0, lead(second))]);
    let subjects: Vec<Subject> = scenario.expectations.iter().map(|wanted| wanted.subject).collect();
    assert_eq!(subjects, [Subject::Group(0), Subject::Group(0)]);
}

#[test]
fn a_group_that_cannot_be_is_refused() {
    let refused = |from: &str, to: &str, says: &str| refused_in(TWO_WHEELS, from, to, says);
    let members = "motors = [\"left\", \"right\"]";
    refused(members, "motors = [\"left\", \"left\"]", "each named once");
    refused(members, "motors = [\"left\"]", "two motors or more");
    refused(members, "motors = [\"left\", \"back\"]", "labels are left, right");
    refused("[[groups]]", "[[motors]]\nlabel = \"third\"\nmotor = \"AM 60 A\"\n[[groups]]", "or a group");
    refused("duration_s = 2.0", "duration_s = 2.0\nemulated = true", "remove emulated");
    refused("[1680, -1680]", "[1680, 0.1]", "1 to 1000000, or -1000000 to -1");
    refused("track_mm = 300", "track_mm = 0", "1 to 1000000");
    refused("straight_mm = 100", "by_counts = [1, 2]", "exactly one of");
    refused("straight_mm = 100, turn_degrees = 90, ", "", "exactly one of");
    refused("straight_mm = 100, turn_degrees = 90", "to_counts = [1]", "1 numbers; it needs 2");
    refused("straight_mm = 100", "straight_mm = 2e6", "-1000000 to 1000000");
    refused("speed_cps = 1000, ", "", "needs speed_cps");
    refused("[-500, 300]", "[-500, 300], speed_cps = 5", "remove speed_cps");
    refused("[-500, 300]", "[-500, 2000000]", "-1000000 to 1000000");
    refused("acceleration_cps2 = 4000", "acceleration_cps2 = 0", "1 to 1000000000");
    refused("at_s = 1.0", "at_s = 0.0", "not after 0");
    refused(
        "base = { wheel_diameter_mm = 90, track_mm = 300, counts_per_turn = [1680, -1680] }",
        "",
        "need a base in the group",
    );
    refused("group = \"base\"", "group = \"bases\"", "no group has the label \"bases\"; labels are base");
    refused("group = \"base\"", "group = \"base\"\nmotor = \"left\"", "not both");
    refused("group = \"base\"\n", "", "needs a group with a base");
    refused(
        "settles_within_s = 1.0",
        "fault = \"none\"",
        "allows settles_within_s and heading_error_below_degrees only",
    );
}

#[test]
fn a_bus_that_makes_no_sense_is_refused_with_what_is_allowed() {
    let refused = |bus: &str, says: &str| refused("[[motors]]", &format!("[bus]\n{bus}\n[[motors]]"), says);
    refused("one_way = true", "capacitance_f");
    let unlimited = SOUND.replacen("resistance_ohm = ", "unlimited = true, resistance_ohm = ", 1);
    refused_in(&unlimited, "[[motors]]", "[bus]\ncapacitance_f = 0.001\n[[motors]]", "remove unlimited");
    refused("capacitance_f = 0", "capacitance_f = 0 is out of range; allowed is 0.00001 to 1");
    refused("capacitance_f = 0.001\nopens_at_s = 301", "opens_at_s = 301 is out of range");
    for between in ["[7.5, 15]", "[15, 15]", "[14, 24.1]", "[-1, 15]", "[14, nan]"] {
        let bus = format!("capacitance_f = 0.001\nburn_between_v = {between}");
        refused(&bus, "low above 7.5 V, below high, and high up to 24 V");
    }
}

#[test]
fn a_scheme_may_be_written_in_either_case() {
    let text = SOUND.replace("scheme = \"D\"", "scheme = \"d\"");
    let [upper, lower] = [SOUND, &text].map(|text| Scenario::parse("s.toml", text).expect("it is sound"));
    assert_eq!(upper.motors[0].scheme, lower.motors[0].scheme);
}

#[test]
fn a_train_without_a_load_or_on_the_emulated_chip_is_refused() {
    let text = |head: &str, load: &str| {
        format!(
            "name = \"gear\"\nduration_s = 2.0\n{head}battery = {{ emf_v = 12.0, resistance_ohm = 0.05 }}\n\
             [[motors]]\nlabel = \"one\"\nmotor = \"AM 60 A\"\n{load}\
             train = {{ backlash_degrees = 2.0, stiffness_nm_per_rad = 300.0 }}\n\
             setpoints = [{{ at_s = 0.5, velocity_cps = 1000 }}]\n"
        )
    };
    let load = "load = { inertia_kg_m2 = 0.01 }\n";
    let scenario = Scenario::parse("g.toml", &text("", load)).expect("it is valid");
    let train = scenario.motors[0].train.expect("a train");
    assert!(
        (train.backlash_after.to_degrees() - 2.0).abs() < 1e-9 && train.damping_after == 0.0,
        "{train:?}"
    );
    for (head, load, says) in [
        ("", "", "a train needs a load with inertia_kg_m2 above 0"),
        ("emulated = true\n", load, "a train does not run on the emulated chip"),
    ] {
        let error = Scenario::parse("g.toml", &text(head, load)).expect_err(says).to_string();
        assert!(error.starts_with("g.toml:") && error.contains(says), "{error}");
    }
}
