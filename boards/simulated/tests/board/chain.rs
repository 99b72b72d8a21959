//! A chain of simulated hubs, in virtual time: answers and reports that a host at the parent gets from the children.

use crate::host::Served;
use motor_hub::extension::Request;
use motor_hub::protocol::pins::{I2cAddress, I2cBus, I2cCount, ToPin};
use motor_hub::protocol::requests::{DISCOVERY, FAIL_SAFE, Standard};
use motor_hub::protocol::{Address, BROADCAST, Packet, frame};
use simulated::i2c::MEMORY_ADDRESS;
use simulated::scenario::Scenario;
use simulated::serve::LineFault;
use simulated::serve::interventions::Interventions;
use std::io::Write;

/// A chain of hubs whose motors can be enabled.
fn chain(addresses: &[u8]) -> Served {
    let mut served = Served::new(Scenario::to_serve(), addresses, |_| Interventions::default());
    served.pass(200);
    served
}

const PARENT: u8 = 2;

#[test]
fn a_discovery_finds_the_parent_at_once_and_every_child_within_a_second() {
    let mut chain = chain(&[PARENT, 1, 254, 130]);
    chain.send(Standard::Discovery, BROADCAST);
    let mut children: Vec<Packet> = chain.pass(600);
    let parent = children.remove(0);
    assert_eq!((parent.source, &*parent.payload), (PARENT, &[1][..]));
    let number = chain.number;
    assert!(children.iter().all(|packet| packet.reference == number && packet.id == DISCOVERY | 0x8000));
    assert_eq!(
        children.iter().map(|packet| (packet.source, packet.payload[0])).collect::<Vec<_>>(),
        [(1, 0), (130, 0), (254, 0)]
    );
    let report = chain.report(PARENT);
    assert!(!report.discovering);
    assert_eq!(report.answering.iter().collect::<Vec<_>>(), [1, 130, 254]);
    assert_eq!(report.duplicate.iter().count(), 0);
}

#[test]
fn a_child_obeys_like_a_hub_on_the_line_and_stops_by_its_own_keep_alive() {
    let mut chain = chain(&[PARENT, 3]);
    chain.drive(3);
    assert!(chain.is_enabled(3) && !chain.is_enabled(PARENT));
    // Packets to the parent do not keep the child alive.
    for _ in 0..26 {
        assert!(chain.obeys(Standard::KeepAlive, PARENT));
        chain.pass(99);
    }
    assert!(!chain.is_enabled(3));
    let (status, _) = chain.ask(Standard::Status { clear: false }, 3).expect("an answer");
    assert_eq!(status.payload[0] & 1, 1, "the keep-alive timer of the child has run out");
}

#[test]
fn the_parent_answers_within_two_milliseconds_whatever_its_child_does() {
    for fault in [
        None,
        Some(LineFault::Cut(1)),
        Some(LineFault::Babbles(1)),
        Some(LineFault::Late(1, 9)),
        Some(LineFault::Late(1, 60)),
    ] {
        let mut chain = chain(&[PARENT, 3, 4]);
        chain.line.set_fault(fault);
        chain.send(Standard::Discovery, BROADCAST);
        chain.pass(3);
        let mut answers_of_other_child = 0;
        for _ in 0..100 {
            // The host sends to the child without waiting for its answer, and sends again in the next round.
            chain.send(Standard::Status { clear: false }, 3);
            let (_, ms) = chain.ask(Standard::KeepAlive, PARENT).expect("an answer");
            assert!(ms <= 2, "{fault:?}: {ms} ms");
            answers_of_other_child +=
                u32::from(chain.ask(Standard::KeepAlive, 4).is_some_and(|(_, ms)| ms <= 30));
            chain.pass(10);
        }
        if fault != Some(LineFault::Babbles(1)) {
            assert!(answers_of_other_child >= 99, "{fault:?}: {answers_of_other_child} of 100");
        }
        // The child answers again immediately after the end of the fault.
        chain.line.set_fault(None);
        chain.pass(100);
        assert!(chain.ask(Standard::KeepAlive, 3).is_some(), "{fault:?}");
    }
}

#[test]
fn a_parent_that_waits_for_an_i2c_transfer_neither_hangs_nor_loses_the_answer_of_its_child() {
    let mut chain = chain(&[PARENT, 1]);
    let (bus, address) = (I2cBus::new(1).expect("1"), I2cAddress::new(MEMORY_ADDRESS).expect("in range"));
    // A transfer of 10 ms. The poll waits 5 ms for the end of the transfer. The child answers the discovery within the
    // first of these milliseconds, and its slot of 2 ms ends during the wait.
    chain.send(ToPin::ReadI2c { bus, address, count: I2cCount::new(100).expect("100") }, PARENT);
    let discovery = chain.send(Standard::Discovery, BROADCAST);
    let poll = chain.send(ToPin::PollI2cRead { bus }, PARENT);
    let answers = chain.pass(20);
    assert!(answers.iter().any(|packet| (packet.source, packet.reference) == (PARENT, poll)), "{answers:?}");
    assert!(answers.iter().any(|packet| (packet.source, packet.reference) == (1, discovery)), "{answers:?}");
    chain.pass(600);
    assert_eq!(chain.report(PARENT).answering.iter().collect::<Vec<_>>(), [1]);
}

#[test]
fn a_stop_to_all_reaches_every_hub_within_fifty_milliseconds_also_beside_a_lost_child() {
    let mut chain = chain(&[PARENT, 3, 4]);
    for address in [PARENT, 3, 4] {
        chain.drive(address);
    }
    chain.line.set_fault(Some(LineFault::Cut(1)));
    for _ in 0..8 {
        chain.send(Standard::KeepAlive, 3);
    }
    let stop = Request::from(Standard::FailSafe).packet(BROADCAST, 99, FAIL_SAFE);
    chain.host.write_all(&frame::encode(&stop)).expect("a queue");
    let answers = chain.pass(50);
    assert_eq!(answers.iter().map(|packet| packet.source).collect::<Vec<_>>(), [PARENT], "no child answers");
    assert!(!chain.is_enabled(PARENT));
    chain.pass(100);
    let (status, _) = chain.ask(Standard::Status { clear: false }, 4).expect("an answer");
    assert_eq!(status.payload[0] & 4, 4, "fail-safe");
    assert!(!chain.is_enabled(4));
}

#[test]
fn a_discovery_reports_hubs_with_the_same_address() {
    for (addresses, clashing) in [(&[PARENT, 7, 7][..], 7), (&[PARENT, PARENT, 5], PARENT)] {
        let mut chain = chain(addresses);
        chain.send(Standard::Discovery, BROADCAST);
        let found: Vec<u8> = chain.pass(600).iter().map(|packet| packet.source).collect();
        assert_eq!(chain.report(PARENT).duplicate.iter().collect::<Vec<_>>(), [clashing], "{addresses:?}");
        assert!(!found.contains(&7), "{found:?}");
    }
    // The parent gets another address, and the child can be used.
    let mut chain = chain(&[PARENT, PARENT]);
    assert!(chain.obeys(Standard::SetAddress { address: Address::new(9).expect("9") }, PARENT));
    assert!(chain.obeys(Standard::KeepAlive, PARENT) && chain.obeys(Standard::KeepAlive, 9));
}
