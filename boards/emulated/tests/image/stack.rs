//! The depth of the stack, and its end. The stack is filled with a pattern before the first instruction, and the pattern is read
//! after the busiest actions of the firmware. A test of `record` uses the whole stack up.

use crate::common::{COUNTER, board, four_loads, ms, setup};
use emulated::host_link::HostLink;
use emulated::{Bench, Encoder};
use motor_hub::protocol::Reply;

const PAINT: u32 = 0xA5C3_5A3C;

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_stack_stays_below_nine_of_its_24_kilobytes() {
    let mut bench = Bench::new(setup(four_loads()));
    let stack = board().stack();
    let words = usize::try_from((stack.end - stack.start) / 4).expect("fits");
    bench.write_words(stack.start, vec![PAINT; words]);

    // The run has motors that are configured and regulated on a busy line, a fault of a motor, a bus error with its log
    // line, and a watchdog reset.
    let mut host = HostLink::default();
    bench.run(ms(300));
    for motor in 0..4 {
        // An AM 60 A, Scheme B, linear current.
        let setup = [motor, 0x5F, 0xCA, 0x3F, 0, 0xE4, 0x0C, 0xB6, 2, 2, 0, 0, 1];
        assert_eq!(host.request_raw(&mut bench, 0x4D00, &setup), Reply::Ack { attention: true });
        host.velocity(&mut bench, motor, 1500);
    }
    for _ in 0..100 {
        host.keep_alive(&mut bench);
        bench.run(ms(10));
    }
    bench.set_encoder(0, Encoder::Unplugged);
    bench.run(ms(500));
    bench.fail_next_access(COUNTER);
    bench.run(ms(1500));

    let untouched =
        bench.read_words(stack.start, words).into_iter().take_while(|&word| word == PAINT).count();
    let (deepest, size) = (4 * (words - untouched), 4 * words);
    println!("worst stack seen: {deepest} of {size} bytes");
    assert!(!bench.resets().is_empty(), "the run includes a restart");
    assert!(deepest < 9_000 && size == 24 * 1024, "{deepest} of {size} bytes");
}
