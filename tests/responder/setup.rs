//! Settings of a motor, and the reports of the extension.

use crate::host::{Answer, TestHost, WITHOUT_COMMAND, responder_with, settings};
use motor_hub::braking::{Blend, BlendFraction, DutyRule, OperatingPoint, Points, Regime, Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive, Mode};
use motor_hub::extension::FIRST_FUNCTION;
use motor_hub::hub::Command;
use motor_hub::motor::{
    EncoderFault, Faults, OnFault, Report, SenseLine, Setpoint, Settings, ThermalLimit, ZeroPower,
};
use motor_hub::regulator::identify::{Identification, Identified, Refusal, travel};
use motor_hub::regulator::{Dynamics, Kind};
use motor_hub::supply::{BusReading, BusState, DrawStage};
use motor_hub::units::{
    AccelerationPerVolt, Control, CountsPerSecond, DecayRate, Duty, EmfConstant, Inductance, Microjoules,
    Micros, Milliamperes, Millivolts, Resistance, Share,
};

/// An AM 40 C: 3.12 mV s/count.
const KE: i32 = 3_271_557;

/// Code and blend of a scheme in a packet, and the scheme of the library.
fn schemes() -> [(u8, u16, Scheme); 8] {
    let blend = |bits| Scheme::D(Blend::Fixed(BlendFraction::from_bits(bits).expect("in range")));
    [
        (0, 0, Scheme::ForwardReverse),
        (1, 0, Scheme::A),
        (2, 0, Scheme::B),
        (3, 0, Scheme::C),
        (4, 0, Scheme::D(Blend::Automatic)),
        (5, 0, blend(0)),
        (5, 0x8000, blend(0x8000)),
        (5, 0xFFFF, blend(0xFFFF)),
    ]
}

fn fields(ke: i32, mohm: u16, uh: u16, code: u8, blend: u16, rule: u8) -> Vec<u8> {
    let winding = [mohm, uh].map(u16::to_le_bytes);
    [&ke.to_le_bytes(), winding.as_flattened(), &[code], &blend.to_le_bytes(), &[rule]].concat()
}

fn set_up(host: &mut TestHost, motor: u8, fields: &[u8]) {
    assert_eq!(host.ask(FIRST_FUNCTION, &[&[motor], fields].concat()), Answer::Ack(0));
}

#[test]
fn the_interface_is_found_by_its_name() {
    let mut host = TestHost::settled();
    assert_eq!(host.ask(0x7F07, b"MOTOR_HUB\0"), Answer::Data(vec![0x00, 0x4D, 37, 0]));
}

#[test]
fn a_motor_is_set_up_with_the_coefficients_that_go_with_it() {
    for (code, blend, scheme) in schemes() {
        for (rule, uh) in [(0, 700), (1, 700), (1, 0)] {
            let mut host = TestHost::settled();
            // The behaviour at power 0 is not part of the set-up, so it is set separately.
            host.do_all(&[(8, &[2, 1, 1])]);
            host.new_commands();
            let fields = fields(KE, 4_200, uh, code, blend, rule);
            set_up(&mut host, 2, &fields);

            let duty = if rule == 0 { DutyRule::LinearDuty } else { DutyRule::LinearCurrent };
            let emf = EmfConstant::from_bits(KE).expect("in range");
            let winding = Winding {
                emf,
                resistance: Resistance::from_milliohms(4_200).expect("in range"),
                inductance: Inductance::from_microhenries(uh).ok(),
            };
            let settings =
                Settings { duty, zero_power: ZeroPower::Float, ..Settings::for_scheme(winding, scheme) };
            assert_eq!(host.new_commands(), [Command::Configure { motor: 2, settings }]);

            assert_eq!(host.group(FIRST_FUNCTION + 1, 2), fields);
        }
    }
}

#[test]
fn choosing_linear_duty_forgets_neither_winding_nor_bridge() {
    let bridge = BridgeConstants::new(900, 80, 10_000).expect("in range");
    let started = Settings { bridge, ..settings() };
    let mut host = TestHost { responder: responder_with(started), ..TestHost::new() };
    assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![2, 0]));

    // With a resistance of 0 only the back EMF of the winding changes.
    let (ke, mohm) = (KE, started.winding.resistance.as_milliohms());
    let uh = started.winding.inductance.expect("known").as_microhenries();
    set_up(&mut host, 0, &fields(ke, 0, 0, 2, 0, 0));
    assert_eq!(host.group(FIRST_FUNCTION + 1, 0), fields(ke, mohm, uh, 2, 0, 0));
    set_up(&mut host, 0, &fields(ke, mohm, uh, 1, 0, 1));

    let emf = EmfConstant::from_bits(ke).expect("in range");
    let settings = host.new_settings();
    let again = Settings { bridge, ..Settings::new(Winding { emf, ..started.winding }) };
    assert_eq!(settings.last(), Some(&again));
    assert!(settings.iter().all(|one| one.bridge == bridge), "{settings:?}");
}

#[test]
fn setting_up_enables_nothing_and_stops_nothing() {
    let mut host = TestHost::settled();
    let fields = fields(KE, 4_200, 0, 1, 0, 1);
    set_up(&mut host, 0, &fields);
    assert_eq!(host.call(11, &[0]), Answer::Data(vec![0]));
    host.do_all(&[(15, &[0, 0, 64]), (10, &[0, 1])]);
    set_up(&mut host, 0, &fields);
    assert_eq!(host.call(11, &[0]), Answer::Data(vec![1]));
}

/// Creates a host at a hub whose motor 1 is enabled at a constant power of 0.
fn standing() -> TestHost {
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[1, 0, 0]), (15, &[1, 0, 0]), (10, &[1, 1])]);
    host.new_commands();
    host
}

fn learn(host: &mut TestHost, limit: u32) -> Answer {
    host.ask(FIRST_FUNCTION + 4, &[&[1][..], &limit.to_le_bytes()].concat())
}

#[test]
fn an_enabled_motor_at_rest_is_identified_and_its_travel_announced() {
    for limit in [500, u32::MAX] {
        let mut host = standing();
        let counts = travel(settings().winding.emf, Millivolts::new(12_345), limit);
        assert_eq!(learn(&mut host, limit), Answer::Data(counts.to_le_bytes().to_vec()));
        // The motor may turn no further than announced, also a hot motor, whose back EMF constant in force is lower.
        let setpoint = Setpoint::Identify { travel_limit: counts };
        assert_eq!(host.new_commands(), [Command::Set { motor: 1, setpoint }]);
    }
}

#[test]
fn a_repeated_identification_goes_on_although_the_battery_voltage_has_changed() {
    let mut host = standing();
    let announced = learn(&mut host, u32::MAX);
    host.new_commands();
    host.tick();
    host.snapshot.motors[1].identification = Identification::Running(10);
    host.set_battery(Some(11_800), DrawStage::Full);
    assert_eq!(learn(&mut host, u32::MAX), announced);
    assert_eq!(host.new_commands(), []);
    // A smaller limit, or a request after the end of the identification, starts an identification.
    learn(&mut host, 500);
    assert_eq!(host.new_commands().len(), 1);
    host.snapshot.motors[1].identification = Identification::Refused(Refusal::NotAtRest);
    host.tick();
    learn(&mut host, 500);
    assert_eq!(host.new_commands().len(), 1);
}

#[test]
fn a_motor_that_is_driven_is_not_identified() {
    let nothing_but_disabled: &[(u16, &[u8])] = &[(10, &[1, 0])];
    let driven: &[(u16, &[u8])] = &[(15, &[1, 0, 16])];
    let regulated: &[(u16, &[u8])] = &[(17, &[1, 0, 0]), (8, &[1, 1, 0])];
    for calls in [nothing_but_disabled, driven, regulated] {
        let mut host = standing();
        host.do_all(calls);
        host.new_commands();
        assert_eq!(learn(&mut host, 500), Answer::Nack(51), "{calls:?}");
        assert_eq!(host.new_commands(), []);
    }
    for (battery, stage) in [(None, DrawStage::Cutoff), (Some(6_900), DrawStage::Derated)] {
        let mut host = standing();
        host.set_battery(battery, stage);
        assert_eq!(learn(&mut host, 500), Answer::Nack(52));
    }
}

#[test]
fn any_other_target_or_disabling_ends_an_identification() {
    let brake = Setpoint::ConstantPower(Control::ZERO);
    let cases: [(u16, &[u8], Setpoint); 2] = [(15, &[1, 0, 0], brake), (10, &[1, 0], Setpoint::Disabled)];
    for (function, payload, setpoint) in cases {
        let mut host = standing();
        learn(&mut host, 500);
        host.new_commands();
        host.do_all(&[(function, payload)]);
        assert_eq!(host.new_commands(), [Command::Set { motor: 1, setpoint }]);
        host.do_all(&[(10, &[1, 1])]);
        // Enabled again, the motor has the target of its mode.
        let again = Command::Set { motor: 1, setpoint: brake };
        assert!(host.new_commands().iter().all(|command| *command == again));
    }
}

#[test]
fn an_identification_and_a_constant_current_go_on_after_requests_that_command_nothing() {
    let current = [&[1][..], &800i32.to_le_bytes(), &500u16.to_le_bytes()].concat();
    for (function, payload) in [(4, vec![1, 0xF4, 1, 0, 0]), (30, current)] {
        let mut host = standing();
        assert!(!matches!(host.ask(FIRST_FUNCTION + function, &payload), Answer::Nack(_)));
        host.new_commands();
        host.do_all(&WITHOUT_COMMAND);
        // Reset encoder.
        host.do_all(&[(14, &[1])]);
        assert_eq!(host.new_commands(), [], "function {function}");
    }
}

#[test]
fn an_identification_is_reported_as_the_motor_reports_it() {
    let mut host = TestHost::settled();
    let mut ask = |identification| {
        host.snapshot.motors[2].identification = identification;
        host.ask(FIRST_FUNCTION + 5, &[2])
    };
    assert_eq!(ask(Identification::None), Answer::Data(vec![0]));
    assert_eq!(ask(Identification::Running(42)), Answer::Data(vec![1, 42]));
    assert_eq!(ask(Identification::Refused(Refusal::Load)), Answer::Data(vec![3, 8]));
    let found = Identified {
        dynamics: Dynamics {
            gain: AccelerationPerVolt::from_bits(0x0403_0201).expect("above 0"),
            decay: DecayRate::from_bits(0x0807_0605),
            friction: Millivolts::new(0x0A09),
        },
        emf: EmfConstant::from_bits(0x010D_0C0B).expect("in range"),
        emf_is_configured: true,
        gain_error: 0x100F,
        decay_error: 0x1211,
        emf_error: 0x1413,
        friction_error: Millivolts::new(0x1615),
        residual: 0x1817,
    };
    let bytes: Vec<u8> =
        [&[2][..], &(1..=13).collect::<Vec<u8>>(), &[1, 1], &(15..=24).collect::<Vec<u8>>()].concat();
    assert_eq!(ask(Identification::Found(found)), Answer::Data(bytes));
}

#[test]
fn an_old_identification_is_not_reported_as_the_new_one() {
    let mut host = standing();
    host.tick();
    host.snapshot.motors[1].identification = Identification::Refused(Refusal::Load);
    learn(&mut host, 500);
    let identification = |host: &mut TestHost| host.ask(FIRST_FUNCTION + 5, &[1]);
    host.expect_until_included(identification, Answer::Data(vec![1, 0]));
    assert_eq!(identification(&mut host), Answer::Data(vec![3, 8]));
}

#[test]
fn a_protection_and_a_bridge_timing_read_back_and_outlast_a_set_up() {
    let protection =
        Settings { on_fault: OnFault::Brake, thermal: ThermalLimit::new(1_200, 20, 600).ok(), ..settings() };
    let timed = Settings { bridge: BridgeConstants::VNH5019, ..settings() };
    // Brake, 1.2 A, 20 s, 600 s. Then 6 us, 2.4 us, 1.2 us, 1 us, 600 us.
    let cases: [(u16, &[u8], Settings); 2] = [
        (8, &[1, 0xB0, 4, 20, 0, 0x58, 2], protection),
        (11, &[0x70, 0x17, 0x60, 9, 0xB0, 4, 0xE8, 3, 0x58, 2], timed),
    ];
    for (function, bytes, settings) in cases {
        let mut host = TestHost::settled();
        let (set, get) = (FIRST_FUNCTION + function, FIRST_FUNCTION + function + 1);
        let none = vec![0; bytes.len()];
        assert_eq!(host.group(get, 1), none);
        assert_eq!(host.ask(set, &[&[1], bytes].concat()), Answer::Ack(0));
        assert_eq!(host.new_commands(), [Command::Configure { motor: 1, settings }]);
        set_up(&mut host, 1, &fields(KE, 4_200, 0, 1, 0, 1));
        assert_eq!((host.group(get, 1), host.group(get, 0)), (bytes.to_vec(), none));
    }
    // The hub refuses an action at a fault that is neither coast nor brake, and a limit without a time constant.
    let mut host = TestHost::settled();
    assert_eq!(host.ask(FIRST_FUNCTION + 8, &[1, 2, 0, 0, 0, 0, 0, 0]), Answer::Nack(1));
    assert_eq!(host.ask(FIRST_FUNCTION + 8, &[1, 0, 0xB0, 4, 20, 0, 0, 0]), Answer::Nack(4));
}

#[test]
fn the_condition_of_motor_and_bridge_is_that_of_the_last_tick() {
    let mut host = TestHost::settled();
    assert_eq!(host.ask(FIRST_FUNCTION + 10, &[2]), Answer::Data(vec![0; 13]));
    host.snapshot.motors[2] = Report {
        current: Milliamperes::new(-1_200),
        measured: Some(Milliamperes::new(1_150)),
        sense_line: SenseLine::Excessive,
        heat: 1_050,
        derated: true,
        emf_constant: Some(Winding::NEVEREST_60.emf),
        faults: Faults { overheated: true, bridge: true, ..Faults::default() },
        ..Report::INITIAL
    };
    let answer = [0x50, 0xFB, 0xFF, 0xFF, 1, 0x7E, 4, 0x1A, 4, 1, 1, 1, 4, 0x0F, 0xCA, 0x3F, 0];
    assert_eq!(host.ask(FIRST_FUNCTION + 10, &[2]), Answer::Data(answer.to_vec()));
}

#[test]
fn the_bus_is_reported_as_measured_last_until_the_measurement_is_too_old() {
    let mut host = TestHost::settled();
    let ask = |host: &mut TestHost| host.ask(FIRST_FUNCTION + 13, &[]);
    assert_eq!(ask(&mut host), Answer::Data(vec![0; 14]), "nothing is measured");
    host.snapshot.dissipate = Share::from_f32(0.5);
    host.snapshot.returned = Microjoules::ZERO.plus(2_500_000);
    host.snapshot.dissipated = Microjoules::ZERO.plus(70_000_000);
    let at = host.now;
    for (mv, state, code) in
        [(19_000, BusState::TooHigh, 6), (14_600, BusState::Dissipating, 5), (4_500, BusState::TooLow, 1)]
    {
        host.responder.bus = BusReading { measured: Some(Millivolts::new(mv)), state, at };
        let energies = [0xC4, 9, 0, 0, 0x70, 0x11, 1, 0];
        let answer = [&[code, 1], &mv.to_le_bytes()[..], &[0xF4, 1], &energies].concat();
        assert_eq!(ask(&mut host), Answer::Data(answer), "{state:?}");
    }
    host.now = Micros::new(at.get() + 100_001);
    assert_eq!(ask(&mut host).data()[..4], [0; 4], "nothing new is measured");
}

#[test]
fn all_motors_are_reported_in_one_answer() {
    let mut host = TestHost::settled();
    host.do_all(&[(17, &[1, 0xE8, 3]), (8, &[1, 1, 0]), (10, &[1, 1])]);
    host.snapshot.at = Micros::new(50_000);
    host.snapshot.battery = Some(Millivolts::new(12_000));
    host.snapshot.motors[1] = Report {
        setpoint: Setpoint::Velocity(CountsPerSecond::new(1_000)),
        position: 70_000,
        velocity: CountsPerSecond::new(-1_505),
        regulator: Kind::Model,
        current: Milliamperes::new(-1_200),
        measured: Some(Milliamperes::new(1_150)),
        load: Some(Milliamperes::new(-40_000)),
        heat: 800,
        requested: Some(Control::new(20_000)),
        regime: Some(Regime::Reverse),
        drive: Drive { mode: Mode::Cw98, duty: Duty::from_bits(0x4000) },
        stalled: true,
        faults: Faults { encoder_stale: true, encoder: Some(EncoderFault::Reversed), ..Faults::default() },
        ..Report::INITIAL
    };
    let answer = host.ask(FIRST_FUNCTION + 20, &[]).data();
    // Version 2, 4 motors with 36 bytes each, 50 ms, 12 V, bus not measured, nothing dissipated.
    assert_eq!(answer[..12], [2, 4, 36, 50, 0, 0, 0, 0xE0, 0x2E, 0, 0, 0]);
    // After the motors: the report includes command 0. The newest command has number 1 and waits to be sent.
    assert_eq!(answer[12 + 4 * 36..], [0, 0, 0, 0, 1, 0, 0, 0]);
    let motor = &answer[12 + 36..][..36];
    // Set-point: velocity, 1000 counts/s. Position 70 000 counts, speed -1505 counts/s, model, control value 20 000,
    // regime reverse, mode 9/8, half duty. Then the modelled current, measured current and load, the heat, the flags
    // enabled and stalled, and the faults of a silent and a reversed encoder.
    let expected = [
        3, 0xE8, 3, 0, 0, 0x70, 0x11, 1, 0, 0x1F, 0xFA, 0, 0x20, 0x4E, 1, 0, 0, 0x40, 0x50, 0xFB, 0x7E, 4, 1,
        0x80, 0x20, 3, 0b0101, 0b1010,
    ];
    assert_eq!(motor[..28], expected);
    // Scheme A at half speed, backwards: S and T at their places, Z at half of the range, G at its end.
    let points: Vec<i16> =
        motor[28..].chunks(2).map(|point| i16::from_le_bytes([point[0], point[1]])).collect();
    let mirrored = Points::new(
        settings().scheme,
        OperatingPoint::new(settings().winding.emf.emf(CountsPerSecond::new(1_505)), Millivolts::new(12_000))
            .expect("a battery"),
    );
    let expected = [mirrored.s, mirrored.t, mirrored.z, mirrored.g]
        .map(|point| (-point.to_f64().round()).clamp(-32_767.0, 32_767.0) as i16);
    assert_eq!(points, expected);

    // Positions in the report are in the host's counts.
    host.snapshot.motors[1].setpoint =
        Setpoint::Position { target: 70_005, tolerance: 5, speed_limit: CountsPerSecond::new(100) };
    host.do_all(&[(14, &[1])]);
    let answer = host.ask(FIRST_FUNCTION + 20, &[]).data();
    assert_eq!(answer[12 + 36..][..9], [4, 5, 0, 0, 0, 0, 0, 0, 0]);

    host.snapshot.battery = None;
    let answer = host.ask(FIRST_FUNCTION + 20, &[]).data();
    assert_eq!(
        (&answer[7..9], &answer[12 + 36 + 28..][..8]),
        (&[0; 2][..], &[0; 8][..]),
        "nothing without a battery"
    );
}
