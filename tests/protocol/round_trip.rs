//! What one end writes, the other reads: every request and every answer.

use crate::schemes::any_scheme;
use core::num::NonZeroU16;
use motor_hub::board::Equipment;
use motor_hub::braking::{DutyRule, Regime, Winding};
use motor_hub::bridge::{Drive, Mode, Timing};
use motor_hub::chain::{Addresses, ChainReport};
use motor_hub::extension::group::{GroupCourse, GroupState};
use motor_hub::extension::record::{Entries, Ticks};
use motor_hub::extension::report::{
    BusReport, Commands, Condition, HubReport, MotorReport, ReportedSetpoint,
};
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{HubFunction, INTERFACE, MotorFunction, Request};
use motor_hub::group::{GroupCommand, Halt};
use motor_hub::motor::EncoderFault;
use motor_hub::motor::{Faults, OnFault, SenseLine, Settings, ThermalLimit};
use motor_hub::protocol::answers::{Bulk, Functions, I2cRead, I2cStatus, I2cWritten, Status, Version};
use motor_hub::protocol::led::{LedPattern, STEPS, Step};
use motor_hub::protocol::motor::{ChannelMode, Coefficients, Loop, RunMode, Target, Terms, ToMotor};
use motor_hub::protocol::payload::{ByteIn, Field, Fields, Payload, Text, WordFrom};
use motor_hub::protocol::pins::ToPin;
use motor_hub::protocol::requests::{InterfaceName, MOTOR_INTERFACE, Standard, ToHub};
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
    vec(any::<u8>(), 0..=100).prop_map(|bytes| Text::from_slice(&bytes).expect("short"))
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

fn floats() -> impl Strategy<Value = bool> {
    any::<bool>()
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
    let terms = prop_oneof![Just(Terms::Pid), Just(Terms::Pidf)];
    (four, terms).prop_map(|([p, i, d, f], terms)| Coefficients { p, i, d, f, terms })
}

fn target() -> impl Strategy<Value = Target> {
    any::<(i32, u16)>().prop_map(|(counts, tolerance)| Target { counts, tolerance })
}

/// Any settings of the groups of the extension.
fn settings() -> impl Strategy<Value = MotorSettings> {
    let of_motor = (1i32..1 << 25, 1..=u16::MAX, any::<u16>(), any_scheme(u16::MAX.into()), any::<bool>());
    let of_load = (1u32.., any::<(u32, u16, u32, bool)>());
    let limits = (any::<bool>(), any::<u16>(), [1..=u16::MAX, 1..=u16::MAX]);
    (of_motor, of_load, limits, any::<[u16; 5]>()).prop_map(
        |(
            (emf, mohm, uh, scheme, linear),
            (gain, (decay, friction, limit, known)),
            (brakes, ma, [winding_s, case_s]),
            times,
        )| {
            let winding = Winding {
                emf: EmfConstant::from_bits(emf).expect("in range"),
                resistance: Resistance::from_milliohms(mohm).expect("in range"),
                inductance: Inductance::from_microhenries(uh).ok(),
            };
            let [least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us] = times;
            let timing = Timing { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us };
            let settings = Settings::for_scheme(winding, scheme);
            let dynamics = Dynamics {
                gain: AccelerationPerVolt::from_bits(gain).expect("above 0"),
                decay: DecayRate::from_bits(decay),
                friction: Millivolts::new(friction),
            };
            MotorSettings::new(Settings {
                bridge: settings.bridge.with_timing(timing),
                duty: if linear { DutyRule::LinearCurrent } else { DutyRule::LinearDuty },
                on_fault: if brakes { OnFault::Brake } else { OnFault::Coast },
                thermal: ThermalLimit::new(ma, winding_s, case_s).ok(),
                current_limit: NonZeroU16::new(ma / 2),
                dynamics: known.then_some(dynamics),
                acceleration: Acceleration::new(limit).ok(),
                ..settings
            })
        },
    )
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
        Just(BusState::Dissipating),
        Just(BusState::TooHigh),
    ];
    (state, any::<(Option<u16>, u16, u32, u32)>()).prop_map(
        |(state, (mv, dissipate, returned_mj, dissipated_mj))| {
            let measured = mv.map(Millivolts::new);
            BusReport { state, measured, dissipate, returned_mj, dissipated_mj }
        },
    )
}

fn setpoint() -> impl Strategy<Value = ReportedSetpoint> {
    prop_oneof![
        Just(ReportedSetpoint::Off),
        Just(ReportedSetpoint::FailSafe),
        control().prop_map(ReportedSetpoint::Power),
        any::<i32>().prop_map(ReportedSetpoint::Velocity),
        any::<i32>().prop_map(ReportedSetpoint::Position),
        any::<i32>().prop_map(ReportedSetpoint::Together),
        any::<u32>().prop_map(ReportedSetpoint::Identify),
        any::<i32>().prop_map(|ma| ReportedSetpoint::Current(Milliamperes::new(ma))),
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
    let of_motion = (setpoint(), any::<(i32, i16)>(), regulator, control(), regime, drive);
    let of_current =
        (amperes(), proptest::option::of(0u16..u16::MAX), proptest::option::of(amperes()), any::<u16>());
    // All of them 0 is how unknown ones are written.
    let points = proptest::option::of(
        ([control(), control(), control()], 1i16..).prop_map(|([s, t, z], g)| [s, t, z, Control::new(g)]),
    );
    (of_motion, of_current, any::<[bool; 5]>(), faults(), points).prop_map(
        |(motion, (current, measured_ma, load, heat), flags, faults, points)| {
            let (setpoint, (position, velocity), regulator, control, regime, drive) = motion;
            let [enabled, settled, stalled, derated, current_limited] = flags;
            MotorReport {
                setpoint,
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
                current_limited,
                faults,
                points,
            }
        },
    )
}

fn hub_report() -> impl Strategy<Value = HubReport> {
    (any::<(u32, u16, u16)>(), bus_report(), vec(motor_report(), 0..=CHANNELS), any::<Option<(u32, u32)>>())
        .prop_map(|((at_ms, mv, dissipate), BusReport { state, .. }, motors, commands)| HubReport {
            at_ms,
            battery: (mv != 0).then_some(Millivolts::new(mv)),
            bus: state,
            dissipate,
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
                (emf_is_configured, [of_gain, of_decay, of_emf, residual]),
            )| {
                Identified {
                    dynamics: Dynamics {
                        gain: AccelerationPerVolt::from_bits(gain).expect("above 0"),
                        decay: DecayRate::from_bits(decay),
                        friction: Millivolts::new(friction),
                    },
                    emf: EmfConstant::from_bits(emf).expect("in range"),
                    emf_is_configured,
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
    let name = select(vec![MOTOR_INTERFACE, INTERFACE, b""]);
    vec![
        with(&[1], any::<bool>(), |clear| Standard::Status { clear }),
        plain(Standard::KeepAlive),
        plain(Standard::FailSafe),
        with(&[1], address(), |address| Standard::SetAddress { address }),
        name.prop_map(|name| {
            let request = Standard::QueryInterface { name: InterfaceName::from_slice(name).expect("short") };
            (request.into(), vec![name.len() + 1])
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
                let sizes = vec![1, text.len()];
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
    let flag = any::<bool>();
    vec![
        with(&[1, 1], (byte_in(), flag), |(pin, high)| ToPin::SetOutput { pin, high }),
        with(&[1], any::<u8>(), |levels| ToPin::SetOutputs { levels }),
        with(&[1, 1], (byte_in(), flag), |(pin, output)| ToPin::SetDirection { pin, output }),
        with(&[1], byte_in(), |pin| ToPin::Direction { pin }),
        with(&[1], byte_in(), |pin| ToPin::Input { pin }),
        plain(ToPin::Inputs),
        with(&[1, 2], (byte_in(), word_from()), |(servo, period)| ToPin::SetServoPeriod { servo, period }),
        with(&[1], byte_in(), |servo| ToPin::ServoPeriod { servo }),
        with(&[1, 2], (byte_in(), word_from()), |(servo, width)| ToPin::SetServoWidth { servo, width }),
        with(&[1], byte_in(), |servo| ToPin::ServoWidth { servo }),
        with(&[1, 1], (byte_in(), flag), |(servo, on)| ToPin::SetServoEnable { servo, on }),
        with(&[1], byte_in(), |servo| ToPin::ServoEnable { servo }),
        with(&[1, 1, 1], (byte_in(), byte_in(), any::<u8>()), |(bus, address, byte)| ToPin::WriteI2cByte {
            bus,
            address,
            byte,
        }),
        (byte_in(), byte_in(), text())
            .prop_map(|(bus, address, bytes)| {
                let sizes = vec![1, 1, 1, bytes.len()];
                (ToPin::WriteI2c { bus, address, bytes }.into(), sizes)
            })
            .boxed(),
        with(&[1, 1], (byte_in(), byte_in()), |(bus, address)| ToPin::ReadI2cByte { bus, address }),
        with(&[1, 1, 1], (byte_in(), byte_in(), byte_in()), |(bus, address, count)| ToPin::ReadI2c {
            bus,
            address,
            count,
        }),
        with(
            &[1, 1, 1, 1],
            (byte_in(), byte_in(), byte_in(), any::<u8>()),
            |(bus, address, count, register)| ToPin::ReadI2cRegister { bus, address, count, register },
        ),
        with(&[1], byte_in(), |bus| ToPin::PollI2cRead { bus }),
        with(&[1], byte_in(), |bus| ToPin::PollI2cWrite { bus }),
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
        with(&[1, 1, 1], (motor(), run_mode(), floats()), |(motor, mode, floats)| {
            ToMotor::SetMode { mode: ChannelMode { mode, floats } }.to(motor)
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

/// The groups that are functions of the extension, with the sizes of their fields.
const GROUPS: [(Group, &[usize]); 5] = [
    (Group::SetUp, &[1, 4, 2, 2, 1, 2, 1]),
    (Group::Timing, &[1, 2, 2, 2, 2, 2]),
    (Group::Protection, &[1, 1, 2, 2, 2]),
    (Group::CurrentLimit, &[1, 2]),
    (Group::Motion, &[1, 4, 4, 2, 4]),
];

fn of_settings() -> Vec<BoxedStrategy<Case>> {
    let set = GROUPS.map(|(group, sizes)| {
        with(sizes, (motor(), settings()), move |(motor, settings)| {
            Request::Set(motor, Values::of(group, &settings))
        })
    });
    let get = GROUPS.map(|(group, _)| with(&[1], motor(), move |motor| Request::Get(motor, group)));
    set.into_iter().chain(get).collect()
}

fn motor_functions() -> Vec<BoxedStrategy<Case>> {
    let mut all = group_functions();
    all.extend([
        with(&[1, 4], (motor(), any::<u32>()), |(motor, travel_limit)| {
            MotorFunction::Identify { travel_limit }.to(motor)
        }),
        with(&[1, 4, 2], (motor(), any::<(i32, u16)>()), |(motor, (current_ma, speed_limit_cps))| {
            MotorFunction::Current { current_ma, speed_limit_cps }.to(motor)
        }),
        with(&[1], motor(), |motor| MotorFunction::Identification.to(motor)),
        with(&[1], motor(), |motor| MotorFunction::Condition.to(motor)),
    ]);
    all
}

fn group_functions() -> Vec<BoxedStrategy<Case>> {
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
        GroupCommand { course, speed, acceleration, lag, tolerance, halt }
    });
    vec![
        with(&[1, 1, 1, 4, 4, 4, 4, 4, 4, 2, 2, 1], (motor(), wanted), |(motor, wanted)| {
            MotorFunction::Move { wanted }.to(motor)
        }),
        with(&[1], motor(), |motor| MotorFunction::Group.to(motor)),
    ]
}

fn hub_functions() -> Vec<BoxedStrategy<Case>> {
    let mut all = update_functions();
    all.extend([
        plain(HubFunction::Chain),
        plain(HubFunction::Equipment),
        with(&[1, 1], any::<(u8, bool)>(), |(from, clear)| HubFunction::Entries { from, clear }),
        with(&[2, 1], any::<(u16, u8)>(), |(number, from)| HubFunction::Ticks { number, from }),
    ]);
    use HubFunction::{Bus, Load, Report, Reset, Save, Stored};
    all.extend([Save, Load, Reset, Stored, Bus, Report].map(plain));
    all
}

fn store_report() -> impl Strategy<Value = StoreReport> {
    use Outcome::{Done, Lost, NeedsErase, Refused};
    use Stored::{Damaged, Later, Nothing, OneCopy, Whole};
    let stored = select(vec![Nothing, Whole, OneCopy, Later, Damaged]);
    let outcome = select(vec![Outcome::None, Done, NeedsErase, Refused, Lost]);
    let flags = any::<(u8, u32, bool, bool, u8, u8, u8)>();
    (stored, outcome, flags).prop_map(
        |(stored, outcome, (version, number, at_work, differs, unknown, refused, coefficients))| {
            StoreReport { stored, version, number, at_work, outcome, differs, unknown, refused, coefficients }
        },
    )
}

fn drive() -> impl Strategy<Value = Drive> {
    let mode = prop_oneof![Just(Mode::Cw98), Just(Mode::Ccw62), Just(Mode::Brake50)];
    // The steps of the 16 bits on the line.
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
    (any::<(u16, i16, i16)>(), drive()).prop_map(|((position, velocity, millivolts), drive)| Tick {
        position,
        velocity,
        millivolts,
        drive,
    })
}

fn update_functions() -> Vec<BoxedStrategy<Case>> {
    vec![
        (any::<u32>(), any::<u32>(), text())
            .prop_map(|(length, crc, version)| {
                let sizes = vec![4, 4, 1, version.len()];
                (HubFunction::BeginUpdate { length, crc, version }.into(), sizes)
            })
            .boxed(),
        (any::<u32>(), text())
            .prop_map(|(offset, bytes)| {
                let sizes = vec![4, 1, bytes.len()];
                (HubFunction::Chunk { offset, bytes }.into(), sizes)
            })
            .boxed(),
        plain(HubFunction::FinishUpdate),
        plain(HubFunction::Restart),
        plain(HubFunction::AbandonUpdate),
        plain(HubFunction::Update),
        with(&[1; 96], (any::<[u8; 32]>(), any::<[u8; 64]>()), |(key, signature)| HubFunction::Sign {
            key,
            signature,
        }),
    ]
}

fn any_request() -> impl Strategy<Value = Case> {
    let of_rev = [standard(), to_hub(), to_pin(), to_motor()];
    let of_extension = [of_settings(), motor_functions(), hub_functions()];
    Union::new([of_rev.concat(), of_extension.concat()].concat())
}

#[test]
fn these_tests_leave_out_no_request() {
    let mut runner = TestRunner::deterministic();
    let mut tried = |strategies: Vec<BoxedStrategy<Case>>| -> BTreeSet<u16> {
        strategies.iter().map(|s| s.new_tree(&mut runner).unwrap().current().0.number()).collect()
    };
    for (strategies, numbers) in [
        (standard(), Standard::NUMBERS),
        (to_hub(), ToHub::NUMBERS),
        (to_pin(), ToPin::NUMBERS),
        (to_motor(), ToMotor::NUMBERS),
        (motor_functions(), MotorFunction::NUMBERS),
        (hub_functions(), HubFunction::NUMBERS),
    ] {
        assert_eq!(tried(strategies), numbers.iter().copied().collect());
    }
    let extension = [of_settings(), motor_functions(), hub_functions()].concat();
    assert_eq!(tried(extension), (0..33).collect());
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
            Request::ToMotor(motor, _)
            | Request::Set(motor, _)
            | Request::Get(motor, _)
            | Request::Motor(motor, _)
                if usize::from(motor) >= motors =>
            {
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
        let written = I2cWritten { status: I2cStatus { bits: digital }, count: minor };
        prop_assert_eq!(read_back(&written), Ok(written));
        let equipment = Equipment {
            digital, servos: minor, analog: major, i2c: hardware_minor, rail: flag, temperature: !flag,
        };
        prop_assert_eq!(read_back(&equipment), Ok(equipment));
        let mut addresses = [Addresses::default(); 2];
        addresses[0].set(digital, flag);
        addresses[1].set(minor, true);
        let [heard, clashing] = addresses;
        let chain = ChainReport { discovering: flag, heard, clashing };
        prop_assert_eq!(read_back(&chain), Ok(chain));
        prop_assert_eq!(read_back(&half), Ok(half));
        prop_assert_eq!(read_back(&word), Ok(word));
        prop_assert_eq!(read_back(&words.0), Ok(words.0));
        prop_assert_eq!(read_back(&flag), Ok(flag));
    }

    #[test]
    fn an_answer_about_a_motor_or_the_led_is_read_as_it_was_written(
        mode in run_mode(), floats in floats(), control in control(), target in target(),
        coefficients in coefficients(), condition in condition(), bus in bus_report(), identification in identification(),
        colour in colour(), pattern in pattern(),
        text in text(),
    ) {
        let mode = ChannelMode { mode, floats };
        prop_assert_eq!(read_back(&mode), Ok(mode));
        prop_assert_eq!(read_back(&bus), Ok(bus));
        prop_assert_eq!(read_back(&control), Ok(control));
        prop_assert_eq!(read_back(&target), Ok(target));
        prop_assert_eq!(read_back(&coefficients), Ok(coefficients));
        let Coefficients { p, i, d, .. } = coefficients;
        prop_assert_eq!(read_back(&[p, i, d]), Ok([p, i, d]));
        prop_assert_eq!(read_back(&condition), Ok(condition));
        prop_assert_eq!(read_back(&identification), Ok(identification));
        prop_assert_eq!(read_back(&colour), Ok(colour));
        prop_assert_eq!(read_back(&pattern), Ok(pattern));
        let read = I2cRead { status: I2cStatus { bits: 9 }, bytes: text.clone() };
        prop_assert_eq!(read_back(&read), Ok(read.clone()));
        prop_assert_eq!(read_back(&text), Ok(text.clone()));
    }

    #[test]
    fn settings_are_put_as_they_were_read(settings in settings(), alert: u16, both in [coefficients(), coefficients()]) {
        let [velocity, position] = both;
        let mut settings = MotorSettings { current_alert_ma: alert, ..settings };
        settings.set_coefficients(Loop::Velocity, velocity);
        settings.set_coefficients(Loop::Position, position);
        settings.set_channel_mode(ChannelMode { mode: RunMode::Position, floats: true });
        let mut put = MotorSettings::new(Settings::new(Winding::NEVEREST_60));
        for group in Group::ALL {
            let values = Values::of(group, &settings);
            let mut payload = Payload::new();
            values.write(&mut payload);
            prop_assert_eq!(Values::read(group, &mut Fields::new(&payload)), Ok(values));
            put = values.apply_to(&put).expect("values that go together");
        }
        prop_assert_eq!(put, settings);
    }

    #[test]
    fn a_store_report_is_read_as_it_was_written(report in store_report()) {
        prop_assert_eq!(read_back(&report), Ok(report));
    }

    #[test]
    fn entries_and_ticks_are_read_as_they_were_written(
        run: u32, count: u8, heads in vec(head(), 0..=3), ticks in vec(tick(), 0..=8),
    ) {
        let entries = Entries { run, count, heads: heads.into_iter().collect() };
        prop_assert_eq!(read_back(&entries), Ok(entries.clone()));
        let ticks = Ticks { count, ticks: ticks.into_iter().collect() };
        prop_assert_eq!(read_back(&ticks), Ok(ticks.clone()));
    }

    #[test]
    fn a_hub_report_is_read_as_it_was_written_and_fits_a_frame(report in hub_report(), more in 0u8..4) {
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
fn a_group_state_is_read_as_it_was_written() {
    for state in [GroupState::Alone, GroupState::Moving, GroupState::Settled] {
        assert_eq!(read_back(&state), Ok(state));
    }
}
