//! The parent's end of the chain line.

use motor_hub::chain::{ANSWER_MICROS, Chain};
use motor_hub::protocol::requests::FAIL_SAFE;
use motor_hub::protocol::{Address, BROADCAST, HOST, Packet};
use motor_hub::units::Micros;

#[test]
fn after_a_stop_to_all_no_request_that_waited_is_sent() {
    let mut chain = Chain::default();
    for number in 1..=8 {
        chain.request(Packet { destination: 5, number, id: 0x100F, ..Packet::default() });
    }
    let stop = Packet { destination: BROADCAST, number: 99, id: FAIL_SAFE, ..Packet::default() };
    chain.stop(stop.clone());
    assert_eq!(chain.next(Micros::new(0)), Some(stop));
    chain.sent(Micros::new(0));
    assert_eq!(chain.next(Micros::new(ANSWER_MICROS)), None);
}

#[test]
fn a_late_answer_reaches_the_host_and_does_not_end_the_wait_for_the_next_answer() {
    let own = Address::new(2).expect("an address");
    let mut chain = Chain::default();
    for number in [1, 2, 3] {
        chain.request(Packet { destination: 5, number, id: 0x100F, ..Packet::default() });
    }
    let answer = |reference| Packet { destination: HOST, source: 5, reference, ..Packet::default() };
    let number = |packet: Option<Packet>| packet.map(|packet| packet.number);
    assert_eq!(number(chain.next(Micros::new(0))), Some(1));
    chain.sent(Micros::new(0));
    let late = Micros::new(ANSWER_MICROS);
    assert_eq!(number(chain.next(late)), Some(2));
    chain.sent(late);
    assert_eq!(chain.receive(answer(1), own), Some(answer(1)));
    assert_eq!(chain.next(late), None);
    assert_eq!(chain.receive(answer(2), own), Some(answer(2)));
    assert_eq!(number(chain.next(late)), Some(3));
}
