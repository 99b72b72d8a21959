//! Meaning of scenario files. Files with mistakes are refused: the error gives the position, the value, and the allowed
//! values.

use motor_hub::group::{Course, DEFAULT_TOLERANCE, GroupCommand, Halt, default_lag};
use motor_hub::hub::Command;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::model::si::{NewtonMetres, Volts};
use motor_hub::motor::{Report, SenseLine};
use motor_hub::units::CountsPerSecond;
use simulated::scenario::Scenario;
use simulated::scenario::expectation::{Expectation, Expected, Quantity, Subject};
use simulated::scheme::{BlendChoice, SchemeError};
use simulated::without_tasks;

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

const SPEED: &str = "speed_between_cps = [-100, 1100]";
const TRAIN: &str = "train = { backlash_degrees = 2.0, stiffness_nm_per_rad = 300.0 }";

/// A text of a sound scenario, the mistake that takes its place, and a part of the error.
type Mistake<'a> = (&'a str, &'a str, &'a str);

/// The sound scenario is accepted. Every mistake is refused by an error of one line that begins with its position.
#[track_caller]
fn refused(sound: &str, mistakes: &[Mistake<'_>]) {
    assert!(Scenario::parse("s.toml", sound).is_ok());
    for (from, to, says) in mistakes {
        assert!(sound.contains(from), "{from:?} is not in the sound scenario");
        let error = Scenario::parse("s.toml", &sound.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(error.starts_with("s.toml:") && error.contains(says), "{to:?}: {error}");
        assert!(!error.contains('\n'), "{to:?}: {error}");
    }
}

/// Mistakes in the sound scenario.
const MISTAKES: [Mistake<'_>; 65] = [
    // Broken TOML, a value out of range, and a contradiction in a table. Each error has the position of its mistake.
    ("name = \"test\"", "name = \"test", "s.toml:1:13: "),
    ("duration_s = 2.0", "duration_s = ", "s.toml:2:14: "),
    // The first missing key is named, and with it all keys that a scenario needs.
    (
        "duration_s = 2.0",
        "",
        "s.toml:1:1: missing field `duration_s`; a scenario needs name, duration_s, battery = { emf_v, resistance_ohm } and motors",
    ),
    ("emf_v = 12.0", "emf_v = inf", "s.toml:4:21: emf_v = inf is out of range; allowed is 1 to 60"),
    ("= 500", "= 0", "s.toml:15:81: speed_limit_cps = 0 is out of range; allowed is 1 to 1000000"),
    ("[-100, 1100]", "[\n    -100,\n    nan,\n]", "s.toml:24:5: speed_between_cps = NaN is out of range"),
    ("load = {", "lod = {", "s.toml:11:1: unknown field `lod`, expected one of `label`, `motor`"),
    ("velocity_cps = 1000", "", "s.toml:14:5: a set-point needs exactly one of"),
    ("motor = \"AM 60 A\"\n", "", "s.toml:6:1: a motor needs either"),
    ("from_s = 0.5", "from_s = 2.5", "s.toml:19:1: from_s = 2.5 is out of range; allowed is 0 to 2"),
    ("at_s = 1.0", "at_s = 2.5", "s.toml:15:5: at_s = 2.5 is outside the run; allowed is 0 to 2"),
    // Unknown and missing names.
    ("duration_s = 2.0", "duration_ms = 2000", "`duration_s`"),
    ("duration_s = 2.0\n", "", "duration_s"),
    ("p = 10.0", "kp = 10.0", "`p`"),
    ("velocity_cps", "velocity", "`velocity_cps`"),
    ("AM 60 A", "AM 61 A", "s.toml:8:9: the catalogue has no motor \"AM 61 A\"; use one of: "),
    ("AM 60 A", "Tetrix", "s.toml:8:9: motor \"Tetrix\" was never characterised"),
    ("scheme = \"D\"", "scheme = \"E\"", "`none`, `A`, `B`, `C`, `D`"),
    ("motor = \"one\"", "motor = \"two\"", "s.toml:20:9: no motor has the label \"two\"; labels are one"),
    (
        "motor = \"one\"",
        "group = \"z\"",
        "s.toml:20:9: no group has the label \"z\"; the scenario has no groups",
    ),
    ("motor = \"one\"", "motors = \"one\"", "`motor`"),
    (SPEED, "never = [\"coasts\"]", "`coast`"),
    (SPEED, "fault = \"broken\"", "`none`, `stuck`, `reversed`"),
    // Numbers out of range.
    ("duration_s = 2.0", "duration_s = 1e9", "0.001 to 300"),
    ("duration_s = 2.0", "duration_s = nan", "0.001 to 300"),
    ("control_period_ms = 20", "control_period_ms = 101", "1 to 100"),
    ("label = \"one\"", "label = \" \"", "1 to 80 printable"),
    ("= 1000 }", "= 9e300 }", "velocity_cps = 9e300 is out of range"),
    ("0.1 }\n", "0.1, emf_over_time = [{ at_s = 1, emf_v = 0.5 }] }\n", "1 to 60"),
    ("0.05 }", "-0.05 }", "inertia_kg_m2 = -0.05"),
    ("p = 10.0", "p = -1.0", "0 to 32767"),
    ("blend = 0.25", "blend = 1.5", "0 (scheme B) to 1 (scheme C)"),
    ("= 1000 }", "= 9e9 }", "velocity_cps = 9000000000 is out of range; allowed is -1000000 to 1000000"),
    ("velocity_cps = 1000", "velocity_cps = 0.5", "expected a whole number"),
    ("velocity_cps = 1000", "velocity_cps = nan", "expected a whole number"),
    ("velocity_cps = 1000", "power = 1.5", "-1 to 1"),
    ("velocity_cps = 1000", "current_a = -66", "-65.535 to 65.535"),
    ("velocity_cps = 1000", "current_a = 1, speed_limit_cps = 0", "1 to 1000000"),
    ("position_counts = 10", "position_counts = 3000000000", "-2147483648 to 2147483647"),
    ("tolerance_counts = 5", "tolerance_counts = -1", "0 to 65535"),
    ("torque_nm = 0.1", "torque_nm = nan", "-1000 to 1000"),
    ("from_s = 0.5", "to_s = nan", "0 to 2"),
    (SPEED, "settles_within_s = -1.0", "0 to 300"),
    (SPEED, "overshoot_below_percent = inf", "0 to 1000"),
    (SPEED, "current_step_below_a = -1.0", "0 to 1000"),
    // Contradictions.
    ("velocity_cps = 1000", "velocity_cps = 1000, power = 0.5", "exactly one of"),
    ("velocity_cps = 1000", "velocity_cps = 1, current_a = 0.5", "exactly one of power, current_a"),
    ("velocity_cps = 1000", "power = 1, speed_limit_cps = 9", "position_counts and current_a only"),
    ("velocity_cps = 1000", "velocity_cps = 1000, tolerance_counts = 3", "position_counts only"),
    ("velocity_cps = 1000", "disable = false", "remove disable"),
    (", tolerance_counts = 5", "", "needs tolerance_counts and speed_limit_cps"),
    ("scheme = \"D\"", "scheme = \"B\"", "scheme D only"),
    ("scheme = \"D\"\n", "", "scheme D only"),
    ("load = { inertia_kg_m2 = 0.05 }", TRAIN, "a train needs a load with inertia_kg_m2 above 0"),
    ("duration_s = 2.0", "duration_s = 2.0\nemulated = 1", "expected a boolean"),
    ("at_s = 1.0", "at_s = 0.0", "not after 0"),
    ("at_s = 0.0", "at_s = -1.0", "allowed is 0 to 2"),
    ("at_s = 0.5", "at_s = nan", "allowed is 0 to 2"),
    ("from_s = 0.5", "from_s = 0.5\nto_s = 0.5", "from_s must be less than to_s"),
    ("from_s = 0.5", "bus_between_v = [0, 13]", "remove motor"),
    (SPEED, "heading_error_below_degrees = 1", "needs a group with a base"),
    (SPEED, "", "at least one key"),
    (SPEED, "never = []", "at least one key"),
    (SPEED, "speed_between_cps = [100, -100]", "low at most high"),
    (SPEED, "speed_between_cps = [0]", "invalid length 1"),
];

/// Lines that are mistakes in the motor of the sound scenario.
const MISTAKES_OF_MOTORS: [(&str, &str); 17] = [
    ("friction = { breakaway_percent = 4.0 }", "`coulomb_percent`"),
    ("friction = { coulomb_percent = -1.0 }", "0 to 100"),
    ("friction = { coulomb_percent = nan }", "0 to 100"),
    ("friction = { coulomb_percent = 5, breakaway_percent = 4 }", "5 to 100"),
    ("heat = [{ at_s = 1.0, winding_k = 20 }]", "`magnets_k`"),
    ("heat = [{ at_s = 1.0, winding_k = 201, magnets_k = 0 }]", "0 to 200"),
    ("cogging = { amplitude_percent = 1.0 }", "`per_turn`"),
    ("cogging = { amplitude_percent = 101.0, per_turn = 6 }", "0 to 100"),
    ("cogging = { amplitude_percent = 1.0, per_turn = 0 }", "1 to 1000"),
    ("configured = { emf = 0.0 }", "0.1 to 10"),
    ("configured = \"everything\"", "expected \"nothing\" or a table of factors"),
    ("bridge = \"real\"", "`ideal`, `vnh5019`"),
    ("encoder = [{ at_s = 1.0, is = \"dirty\" }]", "`a-loose`"),
    ("encoder = [{ at_s = 1.0, glitches_per_s = 0 }]", "1 to 100000"),
    ("encoder = [{ at_s = 1.0, slot_missing_of = 10001 }]", "1 to 10000"),
    ("encoder = [{ at_s = 1.0 }]", "exactly one of"),
    ("encoder = [{ at_s = 1, is = \"a-low\", glitches_per_s = 20 }]", "exactly one of"),
];

/// Tables that are mistakes in the sound scenario.
const MISTAKEN_TABLES: [(&str, &str); 9] = [
    ("[attached]\nanalog_v = [3.4]", "3.4 is out of range; allowed is 0 to 3.3"),
    ("[attached]\nanalog_v = [0, 0, 0, 0, 0]", "analog_v has 5 entries; allowed are at most 4"),
    ("[attached]\nlow_pins = [8]", "8 is out of range; allowed is 0 to 7"),
    ("[attached]\ni2c_faults = [\"broken\"]", "unknown variant"),
    ("[gyro]\nscale_error = 0.2", "0.2 is out of range; allowed is -0.1 to 0.1"),
    ("[floor]\nslip_in_turns = 1.0", "1 is out of range; allowed is 0 to 0.9"),
    ("[bus]\none_way = true", "capacitance_f"),
    ("[bus]\ncapacitance_f = 0", "capacitance_f = 0 is out of range; allowed is 0.00001 to 1"),
    ("[bus]\ncapacitance_f = 0.001\nopens_at_s = 301", "opens_at_s = 301 is out of range"),
];

#[test]
fn a_label_has_at_most_80_characters_and_not_bytes() {
    let quoted = |characters| format!("\"{}\"", "\u{b5}".repeat(characters));
    let sound = SOUND.replace("\"one\"", &quoted(80));
    refused(&sound, &[(&quoted(80), &quoted(81), "1 to 80 printable")]);
}

#[test]
fn a_mistake_is_refused_with_its_position_and_what_is_allowed() {
    refused(SOUND, &MISTAKES);
    for (line, says) in MISTAKES_OF_MOTORS {
        refused(SOUND, &[("load = {", &format!("{line}\nload = {{"), says)]);
    }
    for (table, says) in MISTAKEN_TABLES {
        refused(SOUND, &[("[[motors]]", &format!("{table}\n[[motors]]"), says)]);
    }
    for between in ["[7.5, 15.0]", "[15.0, 15.0]", "[14.0, 24.1]", "[-1.0, 15.0]", "[14.0, NaN]"] {
        let bus = format!("[bus]\nburn_between_v = {}\ncapacitance_f = 0.001\n", between.to_lowercase());
        let says = format!(
            "s.toml:7:18: burn_between_v = {between} is out of range; it needs [low, high] with low above 7.5 V, below \
             high, and high up to 24 V"
        );
        refused(SOUND, &[("[[motors]]", &format!("{bus}[[motors]]"), &says)]);
    }
    let unlimited = SOUND.replacen("resistance_ohm = ", "unlimited = true, resistance_ohm = ", 1);
    refused(&unlimited, &[("[[motors]]", "[bus]\ncapacitance_f = 0.001\n[[motors]]", "remove unlimited")]);
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
    let by_constants = SOUND.replace("motor = \"AM 60 A\"", CONSTANTS);
    let (given, named) = (motor(&by_constants), motor(SOUND));
    let settings = |of: &simulated::scenario::Motor| of.settings().expect("in range");
    assert_eq!(settings(&given), settings(&named));
    let aliased = motor(&SOUND.replace("AM 60 A", "NeveRest 60"));
    assert_eq!(aliased.constants, named.constants);
    refused(
        &by_constants,
        &[
            ("= 3.3", "= 0", "allowed is 0.001 to 65.535"),
            ("efficiency = 0.9", "efficiency = 90", "allowed is 0.01 to 1"),
            ("inductance_mh = 0.694,", "", "`inductance_mh`"),
            ("constants", "motor = \"AM 60 A\"\nconstants", "either"),
        ],
    );
}

#[test]
fn a_scenario_for_the_emulated_board_has_only_parts_that_this_board_runs() {
    let emulated = |from: &str, to: &str| {
        let text = SOUND.replacen(from, to, 1);
        refused(&text, &[("duration_s = 2.0", "duration_s = 2.0\nemulated = true", "remove emulated")]);
    };
    emulated("[[motors]]", "[bus]\ncapacitance_f = 0.001\n[[motors]]");
    emulated("load = {", &format!("{TRAIN}\nload = {{"));
    emulated("[[motors]]", "[floor]\nslip_in_turns = 0.05\n[[motors]]");
    refused(TWO_WHEELS, &[("duration_s = 2.0", "duration_s = 2.0\nemulated = true", "does not run a group")]);
}

#[test]
fn a_train_has_no_damping_unless_the_scenario_says_so() {
    let text = SOUND.replacen("load = {", &format!("{TRAIN}\nload = {{"), 1);
    let train = Scenario::parse("s.toml", &text).expect("it is valid").motors[0].train.expect("a train");
    assert!((train.backlash_after.to_degrees() - 2.0).abs() < 1e-9, "{train:?}");
    assert_eq!(train.damping_after, 0.0);
}

#[test]
fn an_expectation_of_no_motor_in_particular_is_of_each() {
    let second =
        "\n[[motors]]\nlabel = \"two\"\nmotor = \"AM 20 A\"\nsetpoints = [{ at_s = 0, power = 0.5 }]\n";
    let text = SOUND.replace("motor = \"one\"\n", "bus_between_v = [9, 13]\n") + second;
    let scenario = Scenario::parse("s.toml", &text).expect("it is valid");
    let expectation = |subject, quantity, bounds| Expectation {
        subject,
        window_s: 0.5..2.0,
        expected: Expected::Quantity(quantity, bounds),
    };
    assert_eq!(
        scenario.expectations,
        [
            expectation(Subject::Motor(0), Quantity::Speed, [-100.0, 1100.0]),
            expectation(Subject::Motor(1), Quantity::Speed, [-100.0, 1100.0]),
            expectation(Subject::Battery, Quantity::Bus, [9.0, 13.0]),
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
    let head = SOUND.split_once("[[motors]]").expect("a motor").0;
    let none = Scenario::parse("s.toml", &format!("{head}motors = []"));
    assert!(none.expect_err("no motor").to_string().contains("0 motors; allowed are 1 to 4"));
    let twice = Scenario::parse("s.toml", &format!("{SOUND}{}", motor.replace("\"n\"", "\"one\"")));
    let twice = twice.expect_err("the same label twice").to_string();
    assert!(twice.contains("label \"one\" is used twice"), "{twice}");
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

#[test]
fn the_hub_reads_the_current_line_of_a_scenario() {
    for (line, state) in [
        ("absent", SenseLine::Absent),
        ("sound", SenseLine::Sound),
        ("stuck-low", SenseLine::NoCurrent),
        ("stuck-high", SenseLine::Stuck),
    ] {
        // The flywheel hardly moves, so the motor draws a constant current from 0.5 s to 1 s.
        let load = format!("load = {{ inertia_kg_m2 = 50 }}\ncurrent_line = \"{line}\"");
        let text =
            SOUND.replace("at_s = 0.0", "at_s = 0.5").replace("load = { inertia_kg_m2 = 0.05 }", &load);
        let scenario = Scenario::parse("s.toml", &text).expect("it is valid");
        let mut report = Report::INITIAL;
        without_tasks::run(&scenario, |moment| {
            if moment.ms == 900 {
                report = moment.snapshot.motors[0];
            }
        })
        .expect("it runs");
        assert_eq!(report.sense_line, state, "{line}");
        if let Some(measured) = report.measured {
            let error_ma = measured.get() - report.current.get();
            assert!(error_ma.abs() < 100, "{line}: {error_ma} mA");
        }
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

const MEMBERS: &str = "motors = [\"left\", \"right\"]";
const BASE: &str = "base = { wheel_diameter_mm = 90, track_mm = 300, counts_per_turn = [1680, -1680] }";
const GROUPS_ONLY: &str = "allows settles_within_s and heading_error_below_degrees only";

#[test]
fn a_group_is_sent_on_courses_by_the_wheels_of_its_base() {
    let scenario = Scenario::parse("g.toml", TWO_WHEELS).expect("it is valid");
    let group = scenario.groups.first().expect("a group");
    let courses: Vec<GroupCommand> = group.courses.iter().map(|course| course.value).collect();
    let [first, second]: [GroupCommand; 2] = courses.try_into().expect("two courses");
    // The left wheel travels 100 mm minus 235.6 mm, and the right wheel 100 mm plus 235.6 mm. 235.6 mm is the path of a
    // wheel in a quarter turn of the base. The counts of the right wheel are negative, because it is mirrored.
    assert_eq!(first.course, Course::distances(&[(0, -806), (1, -1994)]).expect("two motors"));
    let usual = (default_lag(CountsPerSecond::new(1_000)), DEFAULT_TOLERANCE);
    assert_eq!(((first.lag, first.tolerance), first.halt), (usual, Halt::Stop));
    let on = [(0, CountsPerSecond::new(-500)), (1, CountsPerSecond::new(300))];
    assert_eq!(second.course, Course::velocities(&on).expect("two motors"));
    assert_eq!((second.lag, second.tolerance), (7, 0));
    let leads = scenario.commands().into_iter().map(|command| (command.at_s, command.value));
    assert_eq!(
        leads.collect::<Vec<_>>(),
        [(0.0, Command::MoveGroup(first)), (1.0, Command::MoveGroup(second))]
    );
    let subjects: Vec<Subject> = scenario.expectations.iter().map(|wanted| wanted.subject).collect();
    assert_eq!(subjects, [Subject::Group(0), Subject::Group(0)]);
}

/// Mistakes in the scenario with two wheels.
const MISTAKES_OF_GROUPS: [Mistake<'_>; 23] = [
    (MEMBERS, "motors = [\"left\", \"left\"]", "each named once"),
    (MEMBERS, "motors = [\"left\"]", "two motors or more"),
    (
        MEMBERS,
        "motors = [\"left\", \"back\"]",
        "s.toml:13:19: no motor has the label \"back\"; labels are left, right",
    ),
    ("[[groups]]", "[[motors]]\nlabel = \"third\"\nmotor = \"AM 60 A\"\n[[groups]]", "or a group"),
    ("[1680, -1680]", "[1680, 0.1]", "1 to 1000000, or -1000000 to -1"),
    ("track_mm = 300", "track_mm = 0", "1 to 1000000"),
    (BASE, "", "need a base in the group"),
    ("straight_mm = 100", "by_counts = [1, 2]", "exactly one of"),
    ("straight_mm = 100, turn_degrees = 90, ", "", "exactly one of"),
    ("straight_mm = 100, turn_degrees = 90", "to_counts = [1]", "1 numbers; it needs 2"),
    ("straight_mm = 100", "straight_mm = 2e6", "-1000000 to 1000000"),
    ("speed_cps = 1000, ", "", "needs speed_cps"),
    ("[-500, 300]", "[-500, 300], speed_cps = 5", "remove speed_cps"),
    ("[-500, 300]", "[-500, 2000000]", "-1000000 to 1000000"),
    ("acceleration_cps2 = 4000", "acceleration_cps2 = 0", "1 to 1000000000"),
    ("at_s = 1.0", "at_s = 0.0", "not after 0"),
    // The simulated gyro stands on the base of the first two motors.
    (
        "\"left\", \"right\"]\nbase = {",
        "\"right\", \"left\"]\nbase = { use_gyro = true,",
        "use_gyro needs the first two motors of the file as wheels",
    ),
    ("track_mm = 300", "use_gyro = true, track_mm = 10001", "wheels and a track of 1 mm to 10 m"),
    // Expectations.
    ("group = \"base\"", "group = \"bases\"", "no group has the label \"bases\"; labels are base"),
    ("group = \"base\"", "group = \"base\"\nmotor = \"left\"", "not both"),
    ("group = \"base\"\n", "", "needs a group with a base"),
    ("settles_within_s = 1.0", "fault = \"none\"", GROUPS_ONLY),
    ("settles_within_s = 1.0", "bus_between_v = [0, 13]", GROUPS_ONLY),
];

#[test]
fn a_group_that_cannot_be_is_refused() {
    refused(TWO_WHEELS, &MISTAKES_OF_GROUPS);
}

#[test]
fn bases_with_a_gyro_must_be_alike() {
    let (head, tail) = TWO_WHEELS.split_once("[[groups]]").expect("a group");
    let (group, expect) = tail.split_once("[[expect]]").expect("an expectation");
    let group = group.replace("track_mm = 300", "track_mm = 300, use_gyro = true");
    let second = group.replace("label = \"base\"", "label = \"second\"");
    let parse = |second: &str| {
        Scenario::parse("s.toml", &format!("{head}[[groups]]{group}[[groups]]{second}[[expect]]{expect}"))
    };
    assert!(parse(&second).is_ok());
    assert!(parse(&second.replace("300, use_gyro = true", "150")).is_ok(), "without a gyro");
    let error =
        parse(&second.replace("track_mm = 300", "track_mm = 150")).expect_err("two bases").to_string();
    let says = "s.toml:19:1: the hub has one drive base with use_gyro, and the base of the group \"base\" is another";
    assert!(error.starts_with(says), "{error}");
}

#[test]
fn a_blend_lies_between_zero_and_one() {
    for wrong in ["-0.1", "1.01", "nan", "half", ""] {
        assert_eq!(wrong.parse::<BlendChoice>(), Err(SchemeError::OutOfRange), "{wrong:?}");
    }
}
