//! What one end writes, the other reads: every request and every answer.

use motor_hub::braking::{Blend, BlendFraction, DutyRule, Regime, Scheme};
use motor_hub::bridge::{Drive, Mode, Timing};
use motor_hub::group::Halt;
use motor_hub::motion::{EncoderFault, Pidf};
use motor_hub::motor::{Faults, OnFault, SenseLine, ThermalLimit, ZeroPower};
use motor_hub::protocol::answers::{Bulk, Functions, Status, Version};
use motor_hub::protocol::bus::{self, BusReport};
use motor_hub::protocol::fields::{ByteIn, Field, Fields, Payload, Text, WordFrom};
use motor_hub::protocol::group::{GroupCourse, GroupMove, GroupState, ToGroup};
use motor_hub::protocol::led::{LedPattern, STEPS, Step};
use motor_hub::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode, Target, ToMotor};
use motor_hub::protocol::pins::ToPin;
use motor_hub::protocol::record::{Entries, Ticks, ToRecord};
use motor_hub::protocol::report::{self, Commands, HubReport, MotorReport, Told};
use motor_hub::protocol::requests::{Interface, Request, Standard, ToHub};
use motor_hub::protocol::setup::{Condition, Motion, Protection, Setup, ToSetup};
use motor_hub::protocol::store::{StoreReport, ToStore};
use motor_hub::protocol::update::ToUpdate;
use motor_hub::protocol::{Address, CHANNELS, Colour, Decoder, Nack, Packet, Reply, frame};
use motor_hub::record::{Fault, Head, Tick};
use motor_hub::regulator::identify::{Identification, Identified, Refusal};
use motor_hub::regulator::{Dynamics, Kind};
use motor_hub::store::{Outcome, Stored};
use motor_hub::supply::BusState;
use motor_hub::units::{
    Acceleration, AccelerationPerVolt, Coefficient, Control, CountsPerSecond, DecayRate, Duty, EmfConstant,
    Inductance, Micros, Milliamperes, Millivolts, Resistance,
};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::strategy::{Union, ValueTree};
use proptest::test_runner::TestRunner;
use std::collections::BTreeSet;
use std::fmt::Debug;

/// A request, and the sizes of its fields as the protocol's facts have them.
type Case = (Request, Vec<usize>);

fn byte_in<const A: u8, const B: u8>() -> impl Strategy<Value = ByteIn<A, B>> + Clone {
    (A..=B).prop_map(|byte| ByteIn::new(byte).expect("in range"))
}

fn word_from<const A: u16>() -> impl Strategy<Value = WordFrom<A>> {
    (A..).prop_map(|word| WordFrom::new(word).expect("in range"))
}

fn address() -> impl Strategy<Value = Address> {
    (1u8..=254).prop_map(|address| Address::new(address).expect("in range"))
}

fn text() -> impl Strategy<Value = Text> {
    vec(any::<u8>(), 0..=100).prop_map(|bytes| Text::new(&bytes).expect("short"))
}

fn colour() -> impl Strategy<Value = Colour> {
    any::<[u8; 3]>().prop_map(|[red, green, blue]| Colour { red, green, blue })
}

fn pattern() -> impl Strategy<Value = LedPattern> {
    let step = (any::<u8>(), colour()).prop_map(|(duration, colour)| Step { duration, colour });
    vec(step, 0..=STEPS).prop_map(|steps| LedPattern::new(&steps))
}

fn run_mode() -> impl Strategy<Value = RunMode> {
    prop_oneof![Just(RunMode::Power), Just(RunMode::Velocity), Just(RunMode::Position)]
}

fn zero_power() -> impl Strategy<Value = ZeroPower> {
    prop_oneof![Just(ZeroPower::Brake), Just(ZeroPower::Float)]
}

fn of() -> impl Strategy<Value = Loop> {
    prop_oneof![Just(Loop::Velocity), Just(Loop::Position)]
}

fn control() -> impl Strategy<Value = Control> {
    any::<i16>().prop_map(Control::new)
}

fn coefficient() -> impl Strategy<Value = Coefficient> {
    any::<i32>().prop_map(Coefficient::from_bits)
}

fn coefficients() -> impl Strategy<Value = Coefficients> {
    let four = [coefficient(), coefficient(), coefficient(), coefficient()];
    let algorithm = prop_oneof![Just(Algorithm::Legacy), Just(Algorithm::Pidf)];
    (four, algorithm)
        .prop_map(|([p, i, d, f], algorithm)| Coefficients { pidf: Pidf { p, i, d, f }, algorithm })
}

fn target() -> impl Strategy<Value = Target> {
    any::<(i32, u16)>().prop_map(|(counts, tolerance)| Target { counts, tolerance })
}

fn setup() -> impl Strategy<Value = Setup> {
    let fixed = |bits: u16| Scheme::D(Blend::Fixed(BlendFraction::from_bits(bits.into()).expect("in range")));
    let scheme = prop_oneof![
        Just(Scheme::ForwardReverse),
        Just(Scheme::A),
        Just(Scheme::B),
        Just(Scheme::C),
        Just(Scheme::D(Blend::Automatic)),
        any::<u16>().prop_map(fixed),
    ];
    (1i32..1 << 25, any::<(u16, u16)>(), scheme, any::<bool>()).prop_map(
        |(emf, (mohm, uh), scheme, linear)| {
            Setup {
                emf: EmfConstant::from_bits(emf).expect("in range"),
                // Current cannot be linear in an unknown resistance.
                resistance: Resistance::from_milliohms(if linear { mohm.max(1) } else { mohm }).ok(),
                inductance: Inductance::from_microhenries(uh).ok(),
                scheme,
                duty: if linear { DutyRule::LinearCurrent } else { DutyRule::LinearDuty },
            }
        },
    )
}

fn motion() -> impl Strategy<Value = Motion> {
    (1u32.., any::<u32>(), any::<u16>(), any::<u32>(), any::<bool>()).prop_map(
        |(gain, decay, friction, acceleration, known)| {
            let dynamics = Dynamics {
                gain: AccelerationPerVolt::from_bits(gain).expect("above 0"),
                decay: DecayRate::from_bits(decay),
                friction: Millivolts::new(friction),
            };
            Motion { dynamics: known.then_some(dynamics), acceleration: Acceleration::new(acceleration).ok() }
        },
    )
}

fn protection() -> impl Strategy<Value = Protection> {
    let on_fault = prop_oneof![Just(OnFault::Coast), Just(OnFault::Brake)];
    (on_fault, any::<(u16, u16, u16)>()).prop_map(|(on_fault, (ma, winding_s, case_s))| {
        let thermal = ThermalLimit::new(ma, winding_s.max(1), case_s.max(1)).ok();
        Protection { on_fault, thermal }
    })
}

fn timing() -> impl Strategy<Value = Timing> {
    any::<[u16; 5]>().prop_map(|[least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us]| Timing {
        least_off_ns,
        least_on_ns,
        turn_on_ns,
        turn_off_ns,
        change_us,
    })
}

fn condition() -> impl Strategy<Value = Condition> {
    let line = prop_oneof![
        Just(SenseLine::Absent),
        Just(SenseLine::Sound),
        Just(SenseLine::Silent),
        Just(SenseLine::Stuck),
        Just(SenseLine::Excessive)
    ];
    (any::<(i32, Option<u16>, u16, [bool; 3])>(), line).prop_map(
        |((ma, measured_ma, heat, [derated, overheated, bridge_fault]), sense_line)| {
            let current = Milliamperes::new(ma);
            Condition { current, measured_ma, heat, derated, overheated, bridge_fault, sense_line }
        },
    )
}

fn bus_report() -> impl Strategy<Value = BusReport> {
    let state = prop_oneof![
        Just(BusState::Silent),
        Just(BusState::TooLow),
        Just(BusState::Cut),
        Just(BusState::Derated),
        Just(BusState::Quiet),
        Just(BusState::Burning),
        Just(BusState::TooHigh),
    ];
    (state, any::<(Option<u16>, u16, u32, u32)>()).prop_map(
        |(state, (mv, burning, returned_mj, burnt_mj))| {
            let measured = mv.map(Millivolts::new);
            BusReport { state, measured, burning, returned_mj, burnt_mj }
        },
    )
}

fn told() -> impl Strategy<Value = Told> {
    prop_oneof![
        Just(Told::Off),
        Just(Told::FailSafe),
        control().prop_map(Told::Power),
        any::<i32>().prop_map(Told::Velocity),
        any::<i32>().prop_map(Told::Position),
        any::<i32>().prop_map(Told::Together),
        any::<u32>().prop_map(Told::Identify),
    ]
}

fn faults() -> impl Strategy<Value = Faults> {
    let encoder =
        prop_oneof![Just(None), Just(Some(EncoderFault::Stuck)), Just(Some(EncoderFault::Reversed))];
    (encoder, any::<[bool; 4]>()).prop_map(
        |(encoder, [battery_unknown, encoder_stale, overheated, bridge])| Faults {
            battery_unknown,
            encoder_stale,
            encoder,
            overheated,
            bridge,
        },
    )
}

fn motor_report() -> impl Strategy<Value = MotorReport> {
    let regime = prop_oneof![
        Just(None),
        Just(Some(Regime::Reverse)),
        Just(Some(Regime::Braking)),
        Just(Some(Regime::Forward)),
    ];
    let mode = prop_oneof![Just(Mode::Cw98), Just(Mode::Ccw62), Just(Mode::Brake50)];
    let drive = (mode, 0u16..=1 << 15).prop_map(|(mode, duty)| Drive { mode, duty: Duty::from_bits(duty) });
    let regulator = prop_oneof![Just(Kind::Model), Just(Kind::Pid)];
    let amperes = || (-i32::from(i16::MAX)..=i16::MAX.into()).prop_map(Milliamperes::new);
    let of_motion = (told(), any::<(i32, i16)>(), regulator, control(), regime, drive);
    let of_current =
        (amperes(), proptest::option::of(0u16..u16::MAX), proptest::option::of(amperes()), any::<u16>());
    // All of them 0 is how unknown ones are written.
    let points = proptest::option::of(
        ([control(), control(), control()], 1i16..).prop_map(|([s, t, z], g)| [s, t, z, Control::new(g)]),
    );
    (of_motion, of_current, any::<[bool; 4]>(), faults(), points).prop_map(
        |(motion, (current, measured_ma, load, heat), flags, faults, points)| {
            let (told, (position, velocity), regulator, control, regime, drive) = motion;
            let [enabled, settled, stalled, derated] = flags;
            MotorReport {
                told,
                position,
                velocity,
                regulator,
                control,
                regime,
                drive,
                current,
                measured_ma,
                load,
                heat,
                enabled,
                settled,
                stalled,
                derated,
                faults,
                points,
            }
        },
    )
}

fn hub_report() -> impl Strategy<Value = HubReport> {
    (any::<(u32, u16, u16)>(), bus_report(), vec(motor_report(), 0..=CHANNELS), any::<Option<(u32, u32)>>())
        .prop_map(|((at_ms, mv, burning), BusReport { state, .. }, motors, commands)| HubReport {
            at_ms,
            battery: (mv != 0).then_some(Millivolts::new(mv)),
            bus: state,
            burning,
            motors: motors.into_iter().collect(),
            commands: commands.map(|(included, newest)| Commands { included, newest }),
        })
}

fn identification() -> impl Strategy<Value = Identification> {
    let found = (1u32.., any::<u32>(), any::<(u16, u16)>(), 1i32..1 << 25, any::<(bool, [u16; 4])>())
        .prop_map(
            |(
                gain,
                decay,
                (friction, friction_error),
                emf,
                (emf_is_told, [of_gain, of_decay, of_emf, residual]),
            )| {
                Identified {
                    dynamics: Dynamics {
                        gain: AccelerationPerVolt::from_bits(gain).expect("above 0"),
                        decay: DecayRate::from_bits(decay),
                        friction: Millivolts::new(friction),
                    },
                    emf: EmfConstant::from_bits(emf).expect("in range"),
                    emf_is_told,
                    gain_error: of_gain,
                    decay_error: of_decay,
                    emf_error: of_emf,
                    friction_error: Millivolts::new(friction_error),
                    residual,
                }
            },
        );
    let refused = [
        Refusal::Stopped,
        Refusal::Interrupted,
        Refusal::NotAtRest,
        Refusal::TravelLimit,
        Refusal::Battery,
        Refusal::TooFar,
        Refusal::NoCounts,
        Refusal::Backwards,
        Refusal::Load,
        Refusal::Spring,
        Refusal::Uneven,
        Refusal::Unsure,
        Refusal::Implausible,
    ];
    prop_oneof![
        Just(Identification::None),
        (0u8..100).prop_map(Identification::Running),
        found.prop_map(Identification::Found),
        select(refused.to_vec()).prop_map(Identification::Refused),
    ]
}

fn plain<R: Into<Request> + Clone + Debug + 'static>(request: R) -> BoxedStrategy<Case> {
    Just((request.into(), Vec::new())).boxed()
}

fn with<T: Debug, R: Into<Request> + 'static>(
    sizes: &'static [usize],
    fields: impl Strategy<Value = T> + 'static,
    make: impl Fn(T) -> R + 'static,
) -> BoxedStrategy<Case> {
    fields.prop_map(move |fields| (make(fields).into(), sizes.to_vec())).boxed()
}

fn standard() -> Vec<BoxedStrategy<Case>> {
    let interface = prop_oneof![Just(Interface::Motors), Just(Interface::Setup)];
    vec![
        with(&[1], any::<bool>(), |clear| Standard::Status { clear }),
        plain(Standard::KeepAlive),
        plain(Standard::FailSafe),
        with(&[1], address(), |address| Standard::SetAddress { address }),
        interface
            .prop_map(|interface| {
                (Standard::QueryInterface { interface }.into(), vec![interface.name().len() + 1])
            })
            .boxed(),
        with(&[1, 1, 1], colour(), |colour| Standard::SetLedColour { colour }),
        plain(Standard::LedColour),
        // Where it may end beyond its first byte is its own affair.
        with(&[1], pattern(), |pattern| Standard::SetLedPattern { pattern }),
        plain(Standard::LedPattern),
        with(&[1, 1], (byte_in(), byte_in()), |(group, verbosity)| Standard::DebugLevel { group, verbosity }),
        plain(Standard::Discovery),
    ]
}

fn to_hub() -> Vec<BoxedStrategy<Case>> {
    vec![
        plain(ToHub::Bulk),
        with(&[1, 1], (byte_in(), any::<bool>()), |(channel, raw)| ToHub::Adc { channel, raw }),
        with(&[1], any::<bool>(), |on| ToHub::SetPhoneCharge { on }),
        plain(ToHub::PhoneCharge),
        text()
            .prop_map(|text| {
                let sizes = vec![1, text.bytes().len()];
                (ToHub::LogHint { text }.into(), sizes)
            })
            .boxed(),
        plain(ToHub::VersionText),
        with(&[1], any::<bool>(), |on| ToHub::SetFtdiReset { on }),
        plain(ToHub::FtdiReset),
        plain(ToHub::Version),
    ]
}

fn to_pin() -> Vec<BoxedStrategy<Case>> {
    let (flag, word) = (any::<bool>(), any::<u16>());
    vec![
        with(&[1, 1], (byte_in(), flag), |(pin, high)| ToPin::SetOutput { pin, high }),
        with(&[1], any::<u8>(), |levels| ToPin::SetOutputs { levels }),
        with(&[1, 1], (byte_in(), flag), |(pin, output)| ToPin::SetDirection { pin, output }),
        with(&[1], byte_in(), |pin| ToPin::Direction { pin }),
        with(&[1], byte_in(), |pin| ToPin::Input { pin }),
        plain(ToPin::Inputs),
        with(&[1, 2], (byte_in(), word), |(pwm, period)| ToPin::SetPwmPeriod { pwm, period }),
        with(&[1], byte_in(), |pwm| ToPin::PwmPeriod { pwm }),
        with(&[1, 2], (byte_in(), word), |(pwm, width)| ToPin::SetPwmWidth { pwm, width }),
        with(&[1], byte_in(), |pwm| ToPin::PwmWidth { pwm }),
        with(&[1, 1], (byte_in(), flag), |(pwm, on)| ToPin::SetPwmEnable { pwm, on }),
        with(&[1], byte_in(), |pwm| ToPin::PwmEnable { pwm }),
        with(&[1, 2], (byte_in(), word_from()), |(servo, period)| ToPin::SetServoPeriod { servo, period }),
        with(&[1], byte_in(), |servo| ToPin::ServoPeriod { servo }),
        with(&[1, 2], (byte_in(), word_from()), |(servo, width)| ToPin::SetServoWidth { servo, width }),
        with(&[1], byte_in(), |servo| ToPin::ServoWidth { servo }),
        with(&[1, 1], (byte_in(), flag), |(servo, on)| ToPin::SetServoEnable { servo, on }),
        with(&[1], byte_in(), |servo| ToPin::ServoEnable { servo }),
        with(&[1, 1], (byte_in(), flag), |(bus, fast)| ToPin::SetI2cSpeed { bus, fast }),
        with(&[1], byte_in(), |bus| ToPin::I2cSpeed { bus }),
    ]
}

fn motor() -> std::ops::Range<u8> {
    0..CHANNELS as u8
}

/// Without fields but the motor.
fn of_motor(request: ToMotor) -> BoxedStrategy<Case> {
    with(&[1], motor(), move |motor| request.clone().to(motor))
}

fn to_motor() -> Vec<BoxedStrategy<Case>> {
    let pid = (of(), [coefficient(), coefficient(), coefficient()]);
    vec![
        with(&[1, 1, 1], (motor(), run_mode(), zero_power()), |(motor, mode, zero_power)| {
            ToMotor::SetMode { mode, zero_power }.to(motor)
        }),
        of_motor(ToMotor::Mode),
        with(&[1, 1], (motor(), any::<bool>()), |(motor, on)| ToMotor::SetEnable { on }.to(motor)),
        of_motor(ToMotor::Enable),
        with(&[1, 2], (motor(), any::<u16>()), |(motor, milliamperes)| {
            ToMotor::SetCurrentAlert { milliamperes }.to(motor)
        }),
        of_motor(ToMotor::CurrentAlert),
        of_motor(ToMotor::ResetEncoder),
        with(&[1, 2], (motor(), control()), |(motor, power)| ToMotor::SetPower { power }.to(motor)),
        of_motor(ToMotor::Power),
        with(&[1, 2], (motor(), any::<i16>()), |(motor, cps)| ToMotor::SetVelocity { cps }.to(motor)),
        of_motor(ToMotor::Velocity),
        with(&[1, 4, 2], (motor(), target()), |(motor, target)| ToMotor::SetPosition { target }.to(motor)),
        of_motor(ToMotor::Position),
        of_motor(ToMotor::AtTarget),
        of_motor(ToMotor::Encoder),
        with(&[1, 1, 4, 4, 4], (motor(), pid), |(motor, (of, [p, i, d]))| {
            ToMotor::SetPid { of, p, i, d }.to(motor)
        }),
        with(&[1, 1], (motor(), of()), |(motor, of)| ToMotor::Pid { of }.to(motor)),
        with(&[1, 1, 4, 4, 4, 4, 1], (motor(), of(), coefficients()), |(motor, of, coefficients)| {
            ToMotor::SetPidf { of, coefficients }.to(motor)
        }),
        with(&[1, 1], (motor(), of()), |(motor, of)| ToMotor::Pidf { of }.to(motor)),
    ]
}

fn to_setup() -> Vec<BoxedStrategy<Case>> {
    vec![
        with(&[1, 4, 2, 2, 1, 2, 1], (motor(), setup()), |(motor, setup)| ToSetup::SetUp { setup }.to(motor)),
        with(&[1], motor(), |motor| ToSetup::Setup.to(motor)),
        with(&[1, 4, 4, 2, 4], (motor(), motion()), |(motor, motion)| {
            ToSetup::SetMotion { motion }.to(motor)
        }),
        with(&[1], motor(), |motor| ToSetup::Motion.to(motor)),
        with(&[1, 4], (motor(), any::<u32>()), |(motor, travel_limit)| {
            ToSetup::Identify { travel_limit }.to(motor)
        }),
        with(&[1], motor(), |motor| ToSetup::Identification.to(motor)),
        with(&[1, 1, 2, 2, 2], (motor(), protection()), |(motor, protection)| {
            ToSetup::SetProtection { protection }.to(motor)
        }),
        with(&[1], motor(), |motor| ToSetup::Protection.to(motor)),
        with(&[1], motor(), |motor| ToSetup::Condition.to(motor)),
        with(&[1, 2, 2, 2, 2, 2], (motor(), timing()), |(motor, timing)| {
            ToSetup::SetTiming { timing }.to(motor)
        }),
        with(&[1], motor(), |motor| ToSetup::Timing.to(motor)),
    ]
}

fn to_group() -> Vec<BoxedStrategy<Case>> {
    let members = any::<[Option<i32>; 4]>;
    let course = prop_oneof![
        members().prop_map(GroupCourse::To),
        members().prop_map(|bits| GroupCourse::On(bits.map(|bits| bits.map(CountsPerSecond::from_bits)))),
    ];
    let halt = prop_oneof![Just(Halt::Stop), Just(Halt::Coast)];
    let limits = (any::<i32>(), 1..=u32::MAX, any::<u16>(), any::<u16>());
    let wanted = (course, limits, halt).prop_map(|(course, (speed, acceleration, lag, tolerance), halt)| {
        let speed = CountsPerSecond::from_bits(speed);
        let acceleration = Acceleration::new(acceleration).expect("above 0");
        GroupMove { course, speed, acceleration, lag, tolerance, halt }
    });
    vec![
        with(&[1, 1, 1, 4, 4, 4, 4, 4, 4, 2, 2, 1], (motor(), wanted), |(motor, wanted)| {
            ToGroup::Move { wanted }.to(motor)
        }),
        with(&[1], motor(), |motor| ToGroup::State.to(motor)),
    ]
}

fn to_record() -> Vec<BoxedStrategy<Case>> {
    vec![
        with(&[1, 1], any::<(u8, bool)>(), |(from, clear)| Request::from(ToRecord::Entries { from, clear })),
        with(&[2, 1], any::<(u16, u8)>(), |(number, from)| Request::from(ToRecord::Ticks { number, from })),
    ]
}

fn to_store() -> Vec<BoxedStrategy<Case>> {
    [ToStore::Save, ToStore::Load, ToStore::Reset, ToStore::State].map(plain).into()
}

fn store_report() -> impl Strategy<Value = StoreReport> {
    use Outcome::{Done, Lost, NeedsErase, Refused};
    use Stored::{Damaged, Later, Nothing, OneCopy, Whole};
    let stored = select(vec![Nothing, Whole, OneCopy, Later, Damaged]);
    let outcome = select(vec![Outcome::None, Done, NeedsErase, Refused, Lost]);
    let told = any::<(u8, u32, bool, bool, u8, u8, u8)>();
    (stored, outcome, told).prop_map(
        |(stored, outcome, (version, number, at_work, differs, unknown, refused, coefficients))| {
            StoreReport { stored, version, number, at_work, outcome, differs, unknown, refused, coefficients }
        },
    )
}

fn drive() -> impl Strategy<Value = Drive> {
    let mode = prop_oneof![Just(Mode::Cw98), Just(Mode::Ccw62), Just(Mode::Brake50)];
    // As fine as it is told.
    (mode, 0..=8192u16).prop_map(|(mode, duty)| Drive { mode, duty: Duty::from_bits(4 * duty) })
}

fn head() -> impl Strategy<Value = Head> {
    let fault = select(Fault::ALL);
    let battery = proptest::option::of((1..=u16::MAX).prop_map(Millivolts::new));
    let motor = proptest::option::of(0..u8::MAX);
    let numbers = any::<(u16, u8, u16, u32, [u32; 2], u8)>();
    (fault, battery, motor, drive(), numbers).prop_map(
        |(fault, battery, motor, drive, (number, times, run, uptime_ms, detail, ticks))| Head {
            number,
            fault,
            times,
            run,
            uptime_ms,
            battery,
            motor,
            drive,
            detail,
            ticks,
        },
    )
}

fn tick() -> impl Strategy<Value = Tick> {
    (any::<(u16, i16)>(), control(), drive()).prop_map(|((position, velocity), control, drive)| Tick {
        position,
        velocity,
        control,
        drive,
    })
}

fn to_update() -> Vec<BoxedStrategy<Case>> {
    vec![
        (any::<u32>(), any::<u32>(), text())
            .prop_map(|(length, crc, version)| {
                let sizes = vec![4, 4, 1, version.bytes().len()];
                (ToUpdate::Begin { length, crc, version }.into(), sizes)
            })
            .boxed(),
        (any::<u32>(), text())
            .prop_map(|(offset, bytes)| {
                let sizes = vec![4, 1, bytes.bytes().len()];
                (ToUpdate::Chunk { offset, bytes }.into(), sizes)
            })
            .boxed(),
        plain(ToUpdate::Finish),
        plain(ToUpdate::Restart),
        plain(ToUpdate::Abandon),
        plain(ToUpdate::State),
        with(&[1; 96], (any::<[u8; 32]>(), any::<[u8; 64]>()), |(key, signature)| ToUpdate::Sign {
            key,
            signature,
        }),
    ]
}

fn any_request() -> impl Strategy<Value = Case> {
    Union::new(
        [
            standard(),
            to_hub(),
            to_pin(),
            to_motor(),
            to_setup(),
            to_group(),
            to_record(),
            to_store(),
            to_update(),
            vec![plain(Request::Bus), plain(Request::Report)],
        ]
        .concat(),
    )
}

#[test]
fn no_request_is_left_out_of_these_tests() {
    let mut runner = TestRunner::deterministic();
    for (strategies, numbers) in [
        (standard(), Standard::NUMBERS),
        (to_hub(), ToHub::NUMBERS),
        (to_pin(), ToPin::NUMBERS),
        (to_motor(), ToMotor::NUMBERS),
        (to_setup(), ToSetup::NUMBERS),
        (to_group(), ToGroup::NUMBERS),
        (to_record(), ToRecord::NUMBERS),
        (to_store(), ToStore::NUMBERS),
        (to_update(), ToUpdate::NUMBERS),
        (vec![plain(Request::Bus)], &[bus::FUNCTION]),
        (vec![plain(Request::Report)], &[report::FUNCTION]),
    ] {
        let tried = strategies.iter().map(|s| s.new_tree(&mut runner).unwrap().current().0.number());
        assert_eq!(tried.collect::<BTreeSet<_>>(), numbers.iter().copied().collect());
    }
}

/// What the other end finds.
fn over_the_line(packet: &Packet) -> Packet {
    Decoder::new().next(&mut &*frame::encode(packet), Micros::new(0)).expect("a whole frame")
}

/// What is read of what was written, if nothing is left.
fn read_back<T: Field>(answer: &T) -> Result<T, Nack> {
    let asked = Packet { id: 0x1000, number: 9, ..Packet::default() };
    let packet = over_the_line(&Reply::data(answer).packet(&asked, 2, 1));
    let Some(Reply::Data(payload)) = Reply::read(&packet, asked.id) else { panic!("{packet:?}") };
    let mut again = Payload::new();
    let read = T::read(&mut Fields::new(&payload))?;
    read.write(&mut again);
    assert_eq!(again, payload);
    Ok(read)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_request_is_read_as_it_was_written((request, _) in any_request(), to in address(), number: u8) {
        let packet = request.packet(to.get(), number, request.id());
        let heard = over_the_line(&packet);
        prop_assert_eq!(&heard, &packet);
        prop_assert_eq!(Request::read(&heard, CHANNELS), Ok(request));
    }

    #[test]
    fn a_request_cut_short_is_refused_for_its_first_missing_field((request, sizes) in any_request()) {
        let mut packet = request.packet(2, 1, request.id());
        let ends: Vec<usize> = sizes.iter().scan(0, |end, size| { *end += size; Some(*end) }).collect();
        for length in (0..ends.last().copied().unwrap_or(0)).rev() {
            packet.payload.truncate(length);
            let missing = ends.iter().take_while(|end| **end <= length).count();
            prop_assert_eq!(Request::read(&packet, CHANNELS), Err(Nack::parameter(missing as u8)), "{} bytes", length);
        }
    }

    #[test]
    fn a_motor_that_a_hub_lacks_is_out_of_range((request, _) in any_request(), motors in 0..CHANNELS) {
        let packet = request.packet(2, 1, request.id());
        let read = Request::read(&packet, motors);
        match request {
            Request::Motor(motor, _) | Request::Setup(motor, _) | Request::Group(motor, _) if usize::from(motor) >= motors => {
                prop_assert_eq!(read, Err(Nack::parameter(0)));
            }
            request => prop_assert_eq!(read, Ok(request)),
        }
    }

    #[test]
    fn an_answer_is_read_as_it_was_written(
        bytes: [u8; 5], words: (u16, u16), half: i16, word: i32, flag: bool, hardware: u32,
        encoders: [i32; CHANNELS], velocities: [i16; CHANNELS], analog: [i16; CHANNELS],
        over_current: [bool; CHANNELS], within_tolerance: [bool; CHANNELS], attention: Option<bool>,
    ) {
        let [digital, status, motor_alerts, engineering, minor] = bytes;
        let bulk = Bulk { digital, encoders, over_current, within_tolerance, velocities, analog, attention };
        prop_assert_eq!(read_back(&bulk), Ok(bulk));
        let status = Status { status, motor_alerts };
        prop_assert_eq!(read_back(&status), Ok(status));
        let [major, hardware_minor, hardware_major] = [digital, minor, engineering];
        let version = Version { engineering, minor, major, hardware_minor, hardware_major, hardware };
        prop_assert_eq!(read_back(&version), Ok(version));
        let functions = Functions { first: words.0, count: words.1 };
        prop_assert_eq!(read_back(&functions), Ok(functions));
        prop_assert_eq!(read_back(&half), Ok(half));
        prop_assert_eq!(read_back(&word), Ok(word));
        prop_assert_eq!(read_back(&words.0), Ok(words.0));
        prop_assert_eq!(read_back(&flag), Ok(flag));
    }

    #[test]
    fn an_answer_about_a_motor_or_the_led_is_read_as_it_was_written(
        mode in run_mode(), zero_power in zero_power(), control in control(), target in target(),
        coefficients in coefficients(), setup in setup(), motion in motion(), protection in protection(), condition in condition(), bus in bus_report(), timing in timing(), identification in identification(),
        colour in colour(), pattern in pattern(),
        text in text(),
    ) {
        let mode = ChannelMode { mode, zero_power };
        prop_assert_eq!(read_back(&mode), Ok(mode));
        prop_assert_eq!(read_back(&bus), Ok(bus));
        prop_assert_eq!(read_back(&control), Ok(control));
        prop_assert_eq!(read_back(&target), Ok(target));
        prop_assert_eq!(read_back(&coefficients), Ok(coefficients));
        let Pidf { p, i, d, .. } = coefficients.pidf;
        prop_assert_eq!(read_back(&[p, i, d]), Ok([p, i, d]));
        prop_assert_eq!(read_back(&setup), Ok(setup));
        prop_assert_eq!(read_back(&motion), Ok(motion));
        prop_assert_eq!(read_back(&protection), Ok(protection));
        prop_assert_eq!(read_back(&condition), Ok(condition));
        prop_assert_eq!(read_back(&timing), Ok(timing));
        prop_assert_eq!(read_back(&identification), Ok(identification));
        prop_assert_eq!(read_back(&colour), Ok(colour));
        prop_assert_eq!(read_back(&pattern), Ok(pattern));
        prop_assert_eq!(read_back(&text), Ok(text.clone()));
    }

    #[test]
    fn what_is_stored_is_read_as_it_was_written(report in store_report()) {
        prop_assert_eq!(read_back(&report), Ok(report));
    }

    #[test]
    fn what_happened_is_read_as_it_was_written(
        run: u32, count: u8, heads in vec(head(), 0..=3), ticks in vec(tick(), 0..=8),
    ) {
        let entries = Entries { run, count, heads: heads.into_iter().collect() };
        prop_assert_eq!(read_back(&entries), Ok(entries.clone()));
        let ticks = Ticks { count, ticks: ticks.into_iter().collect() };
        prop_assert_eq!(read_back(&ticks), Ok(ticks.clone()));
    }

    #[test]
    fn what_all_motors_do_is_read_as_it_was_written_and_fits_a_frame(report in hub_report(), more in 0u8..4) {
        prop_assert_eq!(read_back(&report), Ok(report.clone()));
        // A newer hub tells more of each motor, and more behind them.
        let mut payload = Payload::new();
        report.write(&mut payload);
        let (head, rest) = payload.split_at(12);
        let stride = usize::from(head[2]);
        let (motors, commands) = rest.split_at(stride * report.motors.len());
        prop_assert_eq!((head[0], commands.len()), if report.commands.is_some() { (2, 8) } else { (1, 0) });
        let mut longer = head.to_vec();
        if report.commands.is_some() {
            longer[0] += 1;
        }
        longer[2] += more;
        for motor in motors.chunks(stride) {
            longer.extend(motor);
            longer.extend(vec![0xA5; more.into()]);
        }
        longer.extend(commands);
        longer.extend([1, 2, 3]);
        prop_assert_eq!(HubReport::read(&mut Fields::new(&longer)), Ok(report));
    }

    #[test]
    fn an_acknowledgement_and_a_refusal_are_read_as_they_were_written(attention: bool, code: u8, id in 0u16..0x7F00) {
        let asked = Packet { source: 0, id, number: 7, ..Packet::default() };
        for reply in [Reply::Ack { attention }, Reply::Nack(Nack(code))] {
            let packet = over_the_line(&reply.clone().packet(&asked, 2, 1));
            prop_assert_eq!((packet.destination, packet.source, packet.reference), (0, 2, 7));
            prop_assert_eq!(Reply::read(&packet, id), Some(reply));
        }
    }
}

#[test]
fn how_far_a_group_is_reads_back() {
    for state in [GroupState::Alone, GroupState::Moving, GroupState::Settled] {
        assert_eq!(read_back(&state), Ok(state));
    }
}
