//! The parent's end of the chain line.

use motor_hub::chain::{ANSWER_MICROS, Chain};
use motor_hub::protocol::requests::FAIL_SAFE;
use motor_hub::protocol::{BROADCAST, Packet};
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
