//! How deep the stack goes: all RAM above the statics is painted before the first instruction, and
//! looked at after the busiest things that the firmware does.

use crate::common::{COUNTER, board, four_loads, ms, setup};
use emulated::talk::Talk;
use emulated::{Bench, Encoder};
use motor_hub::protocol::Reply;

const PAINT: u32 = 0xA5C3_5A3C;

#[test]
fn the_stack_stays_below_nine_kilobytes_and_a_tenth_of_what_is_free() {
    let mut bench = Bench::new(setup(four_loads()));
    let ram = board().ram();
    let statics = bench.symbols().iter().filter(|s| ram.contains(&s.address)).map(|s| s.address + s.size);
    let bottom = statics.max().expect("statics").next_multiple_of(8);
    let words = usize::try_from((ram.end - bottom) / 4).expect("fits");
    bench.write_words(bottom, vec![PAINT; words]);

    // Motors set up and regulated on a busy line, a fault, a bus error with its log line, and a watchdog reset.
    let mut talk = Talk::default();
    bench.run(ms(300));
    for motor in 0..4 {
        // An AM 60 A, Scheme B, linear current.
        let setup = [motor, 0x5F, 0xCA, 0x3F, 0, 0xE4, 0x0C, 0xB6, 2, 2, 0, 0, 1];
        assert_eq!(talk.ask(&mut bench, 0x4D00, &setup), Reply::Ack { attention: true });
        talk.velocity(&mut bench, motor, 1500);
    }
    for _ in 0..100 {
        talk.keep_alive(&mut bench);
        bench.run(ms(10));
    }
    bench.set_encoder(0, Encoder::Unplugged);
    bench.run(ms(500));
    bench.fail_next_access(COUNTER);
    bench.run(ms(1500));

    let untouched = bench.read_words(bottom, words).into_iter().take_while(|&word| word == PAINT).count();
    let (deepest, free) = (4 * (words - untouched), 4 * words);
    println!("worst stack seen: {deepest} of {free} bytes");
    assert!(!bench.resets().is_empty(), "the story includes a restart");
    assert!(deepest < 9_000 && 10 * deepest < free, "{deepest} of {free} bytes");
}
