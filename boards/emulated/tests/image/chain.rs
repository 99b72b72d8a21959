//! Two chips on one chain line, each with motors of its own: the parent on the board of the test, the child on the other board.

use std::time::Duration;

use crate::common::{
    am60, board, expect_open_within, expect_speed, ms, on, other_board, setup, too_low, with_host,
};
use emulated::host_link::{HostLink, Line};
use emulated::{Bench, Board, ChainBench, LineFault, Setup};
use motor_hub::chain::ChainReport;
use motor_hub::extension::HubFunction;
use motor_hub::protocol::requests::Standard;
use motor_hub::protocol::{Address, BROADCAST, Reply};

/// The address of every board after its first start.
const CHILD: u8 = Address::DEFAULT.get();
/// The address that the parent gets.
const PARENT: u8 = 9;

/// Returns two hubs that were powered on 300 ms ago, and their host.
fn booted_pair(motors: usize) -> (ChainBench, HostLink) {
    let hub = |board| Setup { board, ..setup(vec![am60(); motors]) };
    let mut chain = ChainBench::new(vec![hub(board()), hub(other_board())]);
    chain.run(ms(300));
    (chain, HostLink::default())
}

/// Returns a [`booted_pair`] whose hubs have different addresses.
fn pair(motors: usize) -> (ChainBench, HostLink) {
    let (mut chain, mut host) = booted_pair(motors);
    set_address(&mut chain, &mut host, CHILD, PARENT);
    (chain, host)
}

/// Gives a hub another address. If two hubs have the address `from`, only the parent gets the new address.
pub(crate) fn set_address(chain: &mut ChainBench, host: &mut HostLink, from: u8, to: u8) {
    host.to(from).command(chain, Standard::SetAddress { address: Address::new(to).expect("an address") });
}

/// Returns a parent and a child, whose motors all turn at 1000 counts/s.
fn turning(motors: usize) -> (ChainBench, HostLink) {
    let (mut chain, mut host) = pair(motors);
    for address in [PARENT, CHILD] {
        (0..motors as u8).for_each(|motor| host.to(address).velocity(&mut chain, motor, 1000));
    }
    chain.run(ms(700));
    chain.hubs.iter_mut().for_each(|hub| expect_speed(hub, 0..motors, 100.0));
    (chain, host)
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn two_hubs_with_one_address_are_reported_and_both_obey_after_set_address() {
    let (mut chain, mut host) = booted_pair(1);
    host.to(BROADCAST).send(&mut chain, Standard::Discovery);
    // A discovery takes 254 requests of 11 bytes, with 2 ms for each answer. The client waits for 650 ms.
    chain.run(ms(630));
    let found: Vec<u8> = host.arrivals(chain.first()).iter().map(|arrival| arrival.packet.source).collect();
    assert_eq!(found, [CHILD], "the parent alone");
    let ChainReport { discovering, duplicate, .. } = host.to(CHILD).read(&mut chain, HubFunction::Chain);
    assert!(!discovering);
    assert_eq!(duplicate.iter().collect::<Vec<_>>(), [CHILD]);
    set_address(&mut chain, &mut host, CHILD, PARENT);
    // Now the discovery finds the child, whose address is the second one that the parent tries.
    host.to(BROADCAST).send(&mut chain, Standard::Discovery);
    chain.run(ms(30));
    let found: Vec<_> = host.arrivals(chain.first()).into_iter().map(|arrival| arrival.packet).collect();
    let found: Vec<_> = found.iter().map(|packet| (packet.source, &packet.payload[..])).collect();
    assert_eq!(found, [(PARENT, &[1][..]), (CHILD, &[0])]);
    for address in [PARENT, CHILD] {
        host.to(address).keep_alive(&mut chain);
    }
    let report: ChainReport = host.to(PARENT).read(&mut chain, HubFunction::Chain);
    assert_eq!(report.duplicate.iter().count(), 0);
    chain.hubs.iter_mut().for_each(Bench::assert_sound);
}

#[test]
pub(crate) fn both_motors_turn_and_the_parent_answers_in_time_whatever_the_line_does() {
    let (mut chain, mut host) = turning(1);
    for fault in [LineFault::Cut, LineFault::Shorted, LineFault::Noise, LineFault::Babble] {
        chain.set_fault(Some(fault));
        let mut slowest = Duration::ZERO;
        for _ in 0..12 {
            // The host sends to the child without waiting for its answer, and sends again in the next round.
            host.to(CHILD).send(&mut chain, Standard::Status { clear: false });
            let answer = host.to(PARENT).timed(&mut chain, Standard::KeepAlive);
            let (_, time) = answer.unwrap_or_else(|| panic!("{fault:?}"));
            slowest = slowest.max(time);
            chain.run(ms(4));
        }
        println!("{fault:?}: the parent answers within {slowest:?}");
        assert!(slowest <= ms(2), "{fault:?}: {slowest:?}");
        chain.set_fault(None);
        chain.run(ms(20));
        // The child answers again immediately after the fault, and its motor has not stopped.
        host.to(CHILD).keep_alive(&mut chain);
        chain.hubs.iter_mut().for_each(|hub| expect_speed(hub, [0], 100.0));
    }
    chain.hubs.iter_mut().for_each(Bench::assert_sound);
}

#[test]
fn a_stop_to_all_opens_every_bridge_within_fifty_milliseconds() {
    let (mut chain, mut host) = turning(1);
    // Requests to a hub that does not exist wait for the line.
    for _ in 0..8 {
        host.to(77).send(&mut chain, Standard::KeepAlive);
    }
    let sent = host.to(BROADCAST).send(&mut chain, Standard::FailSafe);
    chain.run(ms(60));
    chain.hubs.iter_mut().for_each(|hub| expect_open_within(hub, sent, ms(50)));
}

#[test]
fn a_hub_drives_the_line_for_its_own_bytes_and_a_byte_longer_at_most() {
    let (mut chain, mut host) = pair(1);
    for _ in 0..4 {
        host.to(CHILD).keep_alive(&mut chain);
        // The answer has several bytes.
        host.bulk(&mut chain);
    }
    chain.run(ms(2));
    for (hub, board) in [board(), other_board()].into_iter().enumerate() {
        let sent = chain.sent(hub);
        assert!(sent.len() > 80, "{board}: {} bytes", sent.len());
        if board == Board::NucleoH743zi2 {
            // The USART drives the pin DE without software, one bit before and after its bytes: CR1 has DEAT and DEDT
            // in sixteenths of a bit, CR3 has DEM (RM0433 48.8.1, 48.8.3). PC8 belongs to the USART.
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
        expect_driven(&sent, &sending);
    }
}

/// Expects that a transceiver drives the line for each byte from its beginning to its end.
#[track_caller]
fn expect_driven(sent: &[(Duration, Duration)], sending: &[(Duration, Duration)]) {
    for (begin, end) in sent {
        let drives = sending.iter().any(|(from, to)| from <= begin && end <= to);
        assert!(drives, "the byte from {begin:?} to {end:?} is not driven");
    }
}

/// UART4_CR1, and its bits TXEIE and TCIE (RM0090 30.6.4).
const UART4_CR1: u64 = 0x4000_4C0C;
const TXEIE: u32 = 1 << 7;
const TCIE: u32 = 1 << 6;
/// Bit of PC12 in GPIOC_ODR (RM0090 8.4.6).
const GPIOC_ODR: u64 = 0x4002_0814;
const DRIVES_LINE: u32 = 1 << 12;

/// Returns an F429 with a transceiver and without another hub. It asks a hub that does not exist, when its host does.
fn alone_with_transceiver() -> (ChainBench, HostLink) {
    let mut chain = ChainBench::new(vec![Setup { transceiver: true, ..setup(vec![]) }]);
    chain.run(ms(300));
    let mut host = HostLink::default();
    host.keep_alive(&mut chain);
    (chain, host)
}

#[test]
fn a_fault_in_the_middle_of_a_packet_releases_the_line_at_once() {
    on(Board::NucleoF429zi, || {
        let (mut chain, mut host) = alone_with_transceiver();
        host.to(77).send(&mut chain, Standard::KeepAlive);
        let hub = chain.first();
        let drives = |hub: &mut Bench| hub.register(GPIOC_ODR) & DRIVES_LINE != 0;
        assert!(hub.run_while(Duration::from_micros(50), ms(5), drives), "the hub sends");
        hub.set_rail(too_low());
        hub.run(Duration::from_micros(20));
        assert!(!drives(hub), "the transceiver still drives the line");
    });
}

#[test]
fn a_packet_is_driven_to_its_end_though_an_interrupt_comes_late_at_the_end_of_embassy_s_ring_buffer() {
    on(Board::NucleoF429zi, || {
        let (mut chain, mut host) = alone_with_transceiver();
        // Twelve packets of 11 bytes pass the end of the buffer of 128 bytes.
        for _ in 0..14 {
            host.to(77).send(&mut chain, Standard::KeepAlive);
            let hub = chain.first();
            let ends = |hub: &mut Bench| hub.register(UART4_CR1) & TCIE != 0;
            assert!(hub.run_while(Duration::from_micros(5), ms(5), ends), "the interrupt of TC is enabled");
            // The interrupts of the USART come two bytes late.
            let control = hub.register(UART4_CR1);
            hub.write_register(UART4_CR1, control & !(TXEIE | TCIE));
            hub.run(Duration::from_micros(60));
            hub.write_register(UART4_CR1, control);
            // The hub waits 10 ms for an answer.
            chain.run(ms(15));
        }
        let sent = chain.sent(0);
        assert_eq!(sent.len(), 14 * 11);
        expect_driven(&sent, &chain.sending(0));
        assert_eq!(chain.first().register(GPIOC_ODR) & DRIVES_LINE, 0, "the line is released");
    });
}

#[test]
fn without_a_transceiver_a_hub_has_no_chain_line() {
    let (mut bench, mut host) = with_host(vec![]);
    let reply = host.request(&mut bench, HubFunction::Chain);
    assert!(matches!(reply, Reply::Nack { .. }), "{reply:?}");
}
