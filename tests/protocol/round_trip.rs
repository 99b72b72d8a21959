//! What one end writes, the other reads: every request and every answer. Random values are read from random bytes.

use crate::host::largest;
use crate::random::{any_settings, bytes};
use motor_hub::board::Equipment;
use motor_hub::braking::Winding;
use motor_hub::chain::ChainReport;
use motor_hub::extension::base::OdometryReport;
use motor_hub::extension::group::GroupState;
use motor_hub::extension::record::{Entries, Ticks};
use motor_hub::extension::report::{BusReport, Commands, Condition, HubReport, MotorReport};
use motor_hub::extension::settings::{Form, Group, MotorSettings, Values};
use motor_hub::extension::state::{StoreReport, UpdateReport};
use motor_hub::extension::{FIRST_FUNCTION, HubFunction, MotorFunction, Request};
use motor_hub::motor::Settings;
use motor_hub::protocol::answers::{Bulk, Functions, I2cRead, I2cWritten, Status, Version};
use motor_hub::protocol::led::LedPattern;
use motor_hub::protocol::motor::{ChannelMode, LoopCoefficients, Target, ToMotor};
use motor_hub::protocol::payload::{Field, Fields, PAYLOAD_KEPT, Payload, Text};
use motor_hub::protocol::pins::ToPin;
use motor_hub::protocol::requests::{self, Standard, ToHub};
use motor_hub::protocol::{Address, CHANNELS, Colour, Decoder, Nack, Packet, Reply, frame};
use motor_hub::regulator::identify::Identification;
use motor_hub::supply::BusState;
use motor_hub::units::{Coefficient, Control, Micros, Millivolts};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::Union;
use proptest::test_runner::TestRunner;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

/// A request, and the sizes of its fields.
type Case = (Request, Vec<usize>);

/// Size of a field with as many bytes as the byte before the field says.
const BYTES: usize = usize::MAX;
/// Size of a field that ends with a zero byte.
const NAME: usize = usize::MAX - 1;

/// Sizes of fields as the protocol defines them, each with the numbers of the requests that have such fields.
type Sizes = &'static [(&'static [usize], &'static [u16])];

const STANDARD: Sizes = &[
    (&[], &[0x7F04, 0x7F05, 0x7F0B, 0x7F0D, 0x7F0F]),
    // A pattern of the LED, 0x7F0C, may end behind its first byte.
    (&[1], &[0x7F03, 0x7F06, 0x7F0C]),
    (&[1, 1], &[0x7F0E]),
    (&[1, 1, 1], &[0x7F0A]),
    (&[NAME], &[0x7F07]),
];

const TO_HUB: Sizes =
    &[(&[], &[0, 45, 48, 50, 57]), (&[1], &[44, 49]), (&[1, 1], &[7]), (&[1, BYTES], &[46])];

const TO_PIN: Sizes = &[
    (&[], &[6]),
    (&[1], &[2, 4, 5, 32, 34, 36, 41, 42, 47]),
    (&[1, 1], &[1, 3, 35, 39, 43]),
    (&[1, 2], &[31, 33]),
    (&[1, 1, 1], &[37, 40]),
    (&[1, 1, 1, BYTES], &[38]),
    (&[1, 1, 1, 1], &[52]),
];

const TO_MOTOR: Sizes = &[
    (&[1], &[9, 11, 13, 14, 16, 18, 20, 21, 22]),
    (&[1, 1], &[10, 24, 53]),
    (&[1, 2], &[12, 15, 17]),
    (&[1, 1, 1], &[8]),
    (&[1, 4, 2], &[19]),
    (&[1, 1, 4, 4, 4], &[23]),
    (&[1, 1, 4, 4, 4, 4, 1], &[51]),
];

/// The groups of settings are not in this list: see [`group_rows`].
const EXTENSION: Sizes = &[
    (&[], &[13, 14, 15, 16, 17, 20, 23, 24, 25, 26, 31, 32, 35, 36]),
    (&[1], &[5, 7, 10]),
    (&[1, 4], &[4]),
    (&[1, 1, 1, 4, 4, 4, 4, 4, 4, 2, 2, 1], &[6]),
    (&[1, 1], &[18]),
    (&[2, 1], &[33]),
    (&[4, 4, 1, BYTES], &[21]),
    (&[4, 1, BYTES], &[22]),
    (&[1; 96], &[27]),
    (&[1, 4, 2], &[30]),
    (&[1, 1, 4, 4, 4, 4, 1], &[34]),
];

/// The packet type of each request in a table, with the sizes of its fields.
fn rows(first: u16, table: Sizes) -> impl Iterator<Item = (u16, Vec<usize>)> {
    table
        .iter()
        .flat_map(move |(sizes, numbers)| numbers.iter().map(move |number| (first + number, sizes.to_vec())))
}

/// The packet types of the requests for groups of settings, with the sizes of the fields that a request cannot lack.
fn group_rows() -> impl Iterator<Item = (u16, Vec<usize>)> {
    let groups = Group::ALL.into_iter().filter(|group| group.set_id() >= FIRST_FUNCTION);
    groups.flat_map(|group| {
        let fields = group.fields().iter().filter(|field| field.since.is_none()).map(|field| field.size);
        [(group.set_id(), std::iter::once(1).chain(fields).collect()), (group.get_id(), vec![1])]
    })
}

#[test]
fn these_tests_leave_out_no_request() {
    let numbers = |table| rows(0, table).map(|(number, _)| number).collect::<BTreeSet<u16>>();
    let defined = |numbers: &[&[u16]]| numbers.concat().into_iter().collect::<BTreeSet<u16>>();
    assert_eq!(numbers(STANDARD), defined(&[Standard::NUMBERS]));
    assert_eq!(numbers(TO_HUB), defined(&[ToHub::NUMBERS]));
    assert_eq!(numbers(TO_PIN), defined(&[ToPin::NUMBERS]));
    assert_eq!(numbers(TO_MOTOR), defined(&[ToMotor::NUMBERS]));
    assert_eq!(numbers(EXTENSION), defined(&[MotorFunction::NUMBERS, HubFunction::NUMBERS]));
    let groups = group_rows().map(|(id, _)| id - FIRST_FUNCTION);
    // Only firmware 0.1.0 has function 19.
    let all = numbers(EXTENSION).into_iter().chain(groups).collect::<BTreeSet<u16>>();
    assert_eq!(all, (0..37).filter(|number| *number != 19).collect());
}

/// A value, as read from random bytes.
fn read_from_bytes<T: Field + std::fmt::Debug>(length: usize) -> impl Strategy<Value = T> {
    bytes(length).prop_filter_map("fields in range", |bytes| T::read(&mut Fields::new(&bytes)).ok())
}

/// A request of this type, as read from random bytes.
fn of_type(id: u16, sizes: Vec<usize>) -> BoxedStrategy<Case> {
    let fixed: usize = sizes.iter().filter(|size| **size < NAME).sum();
    bytes(PAYLOAD_KEPT.min(fixed + 104))
        .prop_filter_map("fields in range", move |bytes| {
            let payload = Payload::from_slice(&bytes).ok()?;
            let request = Request::read(&Packet { id, payload, ..Packet::default() }, CHANNELS).ok()?;
            let (payload, mut at) = (request.payload(), 0);
            let sizes = sizes.iter().map(|size| {
                let size = match *size {
                    BYTES => payload[at - 1].into(),
                    NAME => payload.iter().position(|byte| *byte == 0).expect("an end") + 1,
                    size => size,
                };
                at += size;
                size
            });
            let sizes = sizes.collect();
            Some((request, sizes))
        })
        .boxed()
}

fn request() -> impl Strategy<Value = Case> {
    let of_rev = [TO_HUB, TO_PIN, TO_MOTOR].map(|table| rows(requests::FIRST_FUNCTION, table));
    let of_hub = rows(FIRST_FUNCTION, EXTENSION).chain(group_rows());
    let all = of_rev.into_iter().flatten().chain(rows(0, STANDARD)).chain(of_hub);
    Union::new(all.map(|(id, sizes)| of_type(id, sizes)))
}

fn address() -> impl Strategy<Value = Address> {
    (1u8..=254).prop_map(|address| Address::new(address).expect("in range"))
}

/// A report of a motor. Some of its values may be unknown.
fn motor_report() -> impl Strategy<Value = MotorReport> {
    let report = read_from_bytes::<MotorReport>(36).prop_filter("written by a hub", |report| {
        // The most negative 16-bit number stands for an unknown load, and for no current.
        report.current.get() > i32::from(i16::MIN)
    });
    (report, any::<[bool; 3]>()).prop_map(|(report, [current, load, points])| MotorReport {
        measured_ma: report.measured_ma.filter(|_| current),
        load: report.load.filter(|_| load),
        points: report.points.filter(|_| points),
        ..report
    })
}

fn hub_report() -> impl Strategy<Value = HubReport> {
    let numbers = any::<(u32, Option<u16>, u16, Option<(u32, u32)>)>();
    (numbers, read_from_bytes::<BusState>(1), vec(motor_report(), 0..=CHANNELS)).prop_map(
        |((at_ms, mv, dissipate, commands), bus, motors)| HubReport {
            at_ms,
            battery: mv.filter(|mv| *mv != 0).map(Millivolts::new),
            bus,
            dissipate,
            motors: motors.into_iter().collect(),
            commands: commands.map(|(included, newest)| Commands { included, newest }),
        },
    )
}

/// Returns the packet that the other end decodes.
fn over_the_line(packet: &Packet) -> Packet {
    Decoder::new().next(&mut &*frame::encode(packet), Micros::new(0)).expect("a whole frame")
}

/// Writes an answer to a packet, and reads the packet. Bytes that are left over are an error.
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

/// Reads each type of answer from random bytes, and reads it again after it was written. Each type must fit some of the bytes.
macro_rules! assert_read_back {
    ($($answer:ty),+ $(,)?) => {
        let read: RefCell<BTreeMap<&str, u32>> = RefCell::default();
        let config = ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() };
        let result = TestRunner::new(config).run(&(0..=PAYLOAD_KEPT).prop_flat_map(bytes), |bytes| {
            $(
                if let Ok(answer) = <$answer>::read(&mut Fields::new(&bytes)) {
                    let again = read_back(&answer);
                    prop_assert_eq!(again.as_ref(), Ok(&answer));
                    *read.borrow_mut().entry(stringify!($answer)).or_default() += 1;
                }
            )+
            Ok(())
        });
        result.unwrap_or_else(|error| panic!("{error}"));
        for answer in [$(stringify!($answer)),+] {
            let read = read.borrow().get(answer).copied().unwrap_or_default();
            assert!(read > 20, "{answer}: read {read} times");
        }
    };
}

#[test]
fn an_answer_is_read_as_it_was_written() {
    assert_read_back![
        bool,
        u16,
        i16,
        i32,
        Control,
        Text,
        Colour,
        LedPattern,
        Bulk,
        Status,
        Version,
        Functions,
        I2cRead,
        I2cWritten,
        Equipment,
        ChainReport,
        OdometryReport,
        ChannelMode,
        Target,
        LoopCoefficients,
        [Coefficient; 3],
        Condition,
        BusReport,
        Identification,
        GroupState,
        StoreReport,
        UpdateReport,
        Entries,
        Ticks,
    ];
}

#[test]
fn a_setting_takes_each_of_its_words_and_both_ends_of_its_range() {
    let fields = || Group::ALL.into_iter().flat_map(Group::fields);
    // With their largest values all settings are configured, also those on which others depend.
    let mut all = MotorSettings::new(Settings::new(Winding::NEVEREST_60));
    for field in fields() {
        assert_eq!(field.set(&mut all, largest(field)), Some(()), "{}", field.name);
    }
    for field in fields() {
        let raws = match field.form {
            Form::Words(words) => (0..words.len() as i64).collect(),
            Form::Steps(_) => vec![field.raw_of(field.range().0).expect("in range"), largest(field)],
        };
        for raw in raws {
            let mut settings = all;
            assert_eq!(field.set(&mut settings, raw), Some(()), "{} {raw}", field.name);
            assert_eq!(field.get(&settings), raw, "{}", field.name);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 4000, max_local_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn a_request_is_read_as_it_was_written((request, _) in request(), to in address(), number: u8) {
        let packet = request.packet(to.get(), number, request.id());
        let received = over_the_line(&packet);
        prop_assert_eq!(&received, &packet);
        prop_assert_eq!(Request::read(&received, CHANNELS), Ok(request.clone()));
        // Surplus bytes make no difference.
        let mut longer = packet;
        longer.payload.extend([0xA5; 4]);
        prop_assert_eq!(Request::read(&longer, CHANNELS), Ok(request));
    }

    #[test]
    fn a_request_cut_short_is_refused_for_its_first_missing_field((request, sizes) in request()) {
        let mut packet = request.packet(2, 1, request.id());
        let ends: Vec<usize> = sizes.iter().scan(0, |end, size| { *end += size; Some(*end) }).collect();
        for length in (0..ends.last().copied().unwrap_or(0)).rev() {
            packet.payload.truncate(length);
            let missing = ends.iter().take_while(|end| **end <= length).count();
            prop_assert_eq!(Request::read(&packet, CHANNELS), Err(Nack::parameter(missing as u8)), "{} bytes", length);
        }
    }

    #[test]
    fn a_motor_that_a_hub_lacks_is_out_of_range((request, _) in request(), motors in 0..CHANNELS) {
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
    fn settings_are_put_as_they_were_read(settings in any_settings()) {
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
    fn a_hub_report_is_read_as_it_was_written_and_fits_a_frame(report in hub_report(), more in 0u8..4) {
        prop_assert_eq!(read_back(&report), Ok(report.clone()));
        // A newer hub reports more fields of each motor, and more fields after the motors.
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
