//! Two chips on one chain line, each with motors of its own: the parent on the board of the test, the child on the other board.

use std::time::Duration;

use crate::common::{am60, board, by_board, expect_speed, ms, open_since, setup};
use emulated::{Bench, Board, ChainBench, Encoder, LineFault, Setup, Wire};
use motor_hub::chain::ChainReport;
use motor_hub::extension::report::HubReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::protocol::motor::{ChannelMode, RunMode, ToMotor};
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::{Standard, ToHub};
use motor_hub::protocol::{Address, BROADCAST, Reply};

/// The address of every board after its first start.
const CHILD: u8 = Address::DEFAULT.get();
/// The address that the parent gets.
const PARENT: u8 = 9;

/// Two hubs that were powered on 300 ms ago.
fn booted_pair(motors: usize) -> ChainBench {
    let child = by_board(Board::NucleoH743zi2, Board::NucleoF429zi);
    let hub = |board| Setup { board, ..setup(vec![am60(); motors]) };
    let mut chain = ChainBench::new(vec![hub(board()), hub(child)]);
    chain.run(ms(300));
    chain
}

/// The same with different addresses.
fn pair(motors: usize) -> ChainBench {
    let mut chain = booted_pair(motors);
    readdress(&mut chain);
    chain
}

fn readdress(chain: &mut ChainBench) {
    obeys(chain, Standard::SetAddress { address: Address::new(PARENT).expect("an address") }, CHILD);
}

#[track_caller]
fn obeys(chain: &mut ChainBench, request: impl Into<Request>, address: u8) {
    let request = request.into();
    let (answer, _) = chain.ask(request.clone(), address).unwrap_or_else(|| panic!("{address}: {request:?}"));
    assert!(
        matches!(Reply::read(&answer, request.id()), Some(Reply::Ack { .. })),
        "{request:?}: {answer:02x?}"
    );
}

/// Has a motor turn at 1000 counts/s.
fn turn(chain: &mut ChainBench, address: u8, motor: u8) {
    let mode = ChannelMode { mode: RunMode::Velocity, floats: false };
    obeys(chain, ToMotor::SetMode { mode }.to(motor), address);
    obeys(chain, ToMotor::SetVelocity { cps: 1000 }.to(motor), address);
    obeys(chain, ToMotor::SetEnable { on: true }.to(motor), address);
}

/// A parent and a child, whose motors all turn at 1000 counts/s.
fn turning(motors: usize) -> ChainBench {
    let mut chain = pair(motors);
    for address in [PARENT, CHILD] {
        (0..motors as u8).for_each(|motor| turn(&mut chain, address, motor));
    }
    chain.run(ms(700));
    chain.hubs.iter_mut().for_each(|hub| expect_speed(hub, 0..motors, 100.0));
    chain
}

fn report(chain: &mut ChainBench, parent: u8) -> ChainReport {
    let (answer, _) = chain.ask(HubFunction::Chain, parent).expect("an answer");
    ChainReport::read(&mut Fields::new(&answer.payload)).expect("a report")
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn two_hubs_with_one_address_are_told_and_both_obey_after_set_address() {
    let mut chain = booted_pair(1);
    chain.send(Standard::Discovery, BROADCAST);
    // 254 questions of 11 bytes, and 2 ms for each answer. The client waits for 650 ms.
    chain.run(ms(630));
    let found: Vec<u8> = chain.arrivals().iter().map(|arrival| arrival.packet.source).collect();
    assert_eq!(found, [CHILD], "the parent alone");
    let ChainReport { discovering, clashing, .. } = report(&mut chain, CHILD);
    assert!(!discovering);
    assert_eq!(clashing.iter().collect::<Vec<_>>(), [CHILD]);
    readdress(&mut chain);
    // Now a discovery finds the child, the second address that the parent asks.
    chain.send(Standard::Discovery, BROADCAST);
    chain.run(ms(30));
    let found: Vec<_> = chain.arrivals().into_iter().map(|arrival| arrival.packet).collect();
    let found: Vec<_> = found.iter().map(|packet| (packet.source, &packet.payload[..])).collect();
    assert_eq!(found, [(PARENT, &[1][..]), (CHILD, &[0])]);
    for address in [PARENT, CHILD] {
        obeys(&mut chain, Standard::KeepAlive, address);
    }
    assert_eq!(report(&mut chain, PARENT).clashing.iter().count(), 0);
    chain.hubs.iter_mut().for_each(Bench::assert_sound);
}

#[test]
pub(crate) fn both_motors_turn_and_the_parent_answers_in_time_whatever_the_line_does() {
    let mut chain = turning(1);
    for fault in [LineFault::Cut, LineFault::Shorted, LineFault::Noise, LineFault::Babble] {
        chain.set_fault(Some(fault));
        let mut slowest = Duration::ZERO;
        for _ in 0..12 {
            // The host neither waits for the child nor gives the child up.
            chain.send(Standard::Status { clear: false }, CHILD);
            let (_, time) = chain.ask(Standard::KeepAlive, PARENT).unwrap_or_else(|| panic!("{fault:?}"));
            slowest = slowest.max(time);
            chain.run(ms(4));
        }
        println!("{fault:?}: the parent answers within {slowest:?}");
        assert!(slowest <= ms(2), "{fault:?}: {slowest:?}");
        chain.set_fault(None);
        chain.run(ms(20));
        // The child is there again at once, and its motor has not stopped.
        obeys(&mut chain, Standard::KeepAlive, CHILD);
        chain.hubs.iter_mut().for_each(|hub| expect_speed(hub, [0], 100.0));
    }
    chain.hubs.iter_mut().for_each(Bench::assert_sound);
}

/// A fault of one hub must not reach the other. The limits are those of the fault matrix.
#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn faults_of_one_hub_end_as_in_the_matrix_and_leave_the_other_turning() {
    let mut chain = turning(4);
    // Faults of motors, in both hubs at once. Motor 3 goes on.
    let at = chain.now();
    for hub in &mut chain.hubs {
        hub.set_encoder(0, Encoder::Unplugged);
        hub.set_encoder(1, Encoder::Stuck { wire: Wire::A, high: true });
        hub.pull_diag(2, true);
    }
    chain.run(ms(260));
    for hub in &mut chain.hubs {
        let transitions = hub.transitions();
        for (motor, within) in [(0, ms(250)), (1, ms(250)), (2, ms(85))] {
            let opened = open_since(&transitions, motor, at).expect("the bridge is open") - at;
            assert!(opened <= within, "motor {motor}: {opened:?}");
        }
        expect_speed(hub, [3], 100.0);
        hub.pull_diag(2, false);
    }
    for address in [PARENT, CHILD] {
        let (answer, _) = chain.ask(HubFunction::Report, address).expect("an answer");
        let report = HubReport::read(&mut Fields::new(&answer.payload)).expect("a report");
        let faults: Vec<_> =
            report.motors.iter().map(|motor| (motor.faults.encoder.is_some(), motor.faults.bridge)).collect();
        assert_eq!(faults, [(true, false), (true, false), (false, true), (false, false)], "hub {address}");
    }
    // The child's converter fails.
    let at = chain.now();
    chain.hubs[1].kill_adc(true);
    chain.run(ms(170));
    let opened = open_since(&chain.hubs[1].transitions(), 3, at).expect("the bridge is open") - at;
    assert!(opened <= ms(165), "{opened:?}");
    expect_speed(&mut chain.hubs[0], [3], 100.0);
    chain.hubs[1].kill_adc(false);
    // The child is reset. Nobody has asked for a motion since.
    let at = chain.now() + ms(1);
    chain.hubs[1].pull_reset(at);
    for _ in 0..3 {
        let (_, time) = chain.ask(Standard::KeepAlive, PARENT).expect("an answer");
        assert!(time <= ms(2), "{time:?}");
        chain.run(ms(100));
    }
    let transitions = chain.hubs[1].transitions();
    assert_eq!(open_since(&transitions, 3, at), Some(at), "the child's bridges open with the reset");
    expect_speed(&mut chain.hubs[0], [3], 100.0);
    // The child is back at once, and turns while its parent is reset. The H743 has stored its address.
    turn(&mut chain, CHILD, 3);
    chain.run(ms(400));
    let at = chain.now() + ms(1);
    chain.hubs[0].pull_reset(at);
    chain.run(ms(300));
    assert_eq!(open_since(&chain.hubs[0].transitions(), 3, at), Some(at));
    if board() == Board::NucleoF429zi {
        readdress(&mut chain);
    }
    obeys(&mut chain, Standard::KeepAlive, CHILD);
    expect_speed(&mut chain.hubs[1], [3], 100.0);
}

#[test]
fn a_stop_to_all_opens_every_bridge_within_fifty_milliseconds() {
    let mut chain = turning(1);
    // Requests to a hub that does not exist wait for the line.
    for _ in 0..8 {
        chain.send(Standard::KeepAlive, 77);
    }
    let (_, sent) = chain.send(Standard::FailSafe, BROADCAST);
    chain.run(ms(60));
    for hub in &mut chain.hubs {
        let stopped = open_since(&hub.transitions(), 0, sent).expect("the bridge is open") - sent;
        println!("{stopped:?} after the stop the bridge is open");
        assert!(stopped <= ms(50), "{stopped:?}");
    }
}

#[test]
fn a_hub_drives_the_line_for_its_own_bytes_and_a_byte_longer_at_most() {
    let mut chain = pair(1);
    for _ in 0..4 {
        obeys(&mut chain, Standard::KeepAlive, CHILD);
        chain.ask(ToHub::Bulk, CHILD).expect("an answer of several bytes");
    }
    chain.run(ms(2));
    for (hub, board) in [board(), by_board(Board::NucleoH743zi2, Board::NucleoF429zi)].into_iter().enumerate()
    {
        let sent = chain.sent(hub);
        assert!(sent.len() > 80, "{board}: {} bytes", sent.len());
        if board == Board::NucleoH743zi2 {
            // The USART drives the pin DE by itself, a bit longer than its bytes: CR1 has DEAT and DEDT in sixteenths of a bit,
            // CR3 has DEM (RM0433 48.8.1, 48.8.3). PC8 belongs to the USART.
            let [cr1, cr3, moder] =
                [0x4000_5000, 0x4000_5008, 0x5802_0800].map(|at| chain.hubs[hub].register(at));
            assert_eq!((cr1 >> 21 & 31, cr1 >> 16 & 31, cr3 >> 14 & 1, moder >> 16 & 3), (16, 16, 1, 2));
            continue;
        }
        let byte = Duration::from_nanos(21_702);
        let sending = chain.sending(hub);
        for &(begin, end) in &sending {
            let last = sent.iter().filter(|(_, at)| *at <= end).map(|&(_, at)| at).max().expect("a byte");
            assert!(begin < last && end - last <= byte, "{begin:?} to {end:?}, last byte at {last:?}");
        }
        for (begin, end) in sent {
            let drives = sending.iter().any(|(from, to)| *from <= begin && end <= *to);
            assert!(drives, "the byte from {begin:?} to {end:?} is not driven");
        }
    }
}

#[test]
fn without_a_transceiver_a_hub_has_no_chain_line() {
    let mut bench = crate::common::booted(vec![]);
    let mut host = emulated::host_link::HostLink::default();
    let request = Request::from(HubFunction::Chain);
    let reply = host.ask(&mut bench, request.id(), &request.payload());
    assert!(matches!(reply, Reply::Nack { .. }), "{reply:?}");
}
