//! The record of a hub after a reset, and the depth of the stack.

use crate::common::{COUNTER, board, expect_open_within, four_loads, log, ms, setup, turning, turning_as};
use emulated::host_link::HostLink;
use emulated::{Bench, Encoder, FaultyCode, Setup};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::extension::HubFunction;
use motor_hub::extension::record::{Entries, Ticks};
use motor_hub::protocol::Reply;
use motor_hub::record::{Fault, Head, Tick};

fn entries(bench: &mut Bench) -> Vec<Head> {
    let mut host = HostLink::default();
    let all: Entries = host.read(bench, HubFunction::Entries { from: 0, clear: false });
    assert_eq!(usize::from(all.count), all.heads.len(), "no more than an answer holds");
    all.heads.to_vec()
}

fn ticks(bench: &mut Bench, of: &Head) -> Vec<Tick> {
    let mut host = HostLink::default();
    let mut all = Vec::new();
    while all.len() < usize::from(of.ticks) {
        let request = HubFunction::Ticks { number: of.number, from: all.len() as u8 };
        all.extend(host.read::<Ticks>(bench, request).ticks);
    }
    all
}

/// Runs four motors at 1000 counts/s. Then `happens` stops the firmware, so that the watchdog resets the chip. Returns
/// the only entry of the record.
fn after(setup: Setup, happens: impl FnOnce(&mut Bench)) -> (Bench, Head) {
    let mut bench = turning_as(setup);
    let at = bench.now();
    happens(&mut bench);
    bench.run(ms(1500));
    assert_eq!(bench.resets().len(), 1);
    let all = entries(&mut bench);
    let [head] = all[..] else { panic!("one entry: {all:?}") };
    let said = format!("on record: fault {} in run 1", head.fault.number());
    assert!(log(&mut bench).contains(&said), "{}", log(&mut bench));
    let seconds = f64::from(head.uptime_ms) / 1e3;
    println!("{head:?}");
    // The emulated clock is exact. The last tick before the fault was up to 50 ms earlier.
    assert!((at.as_secs_f64() - 0.06..at.as_secs_f64() + 0.06).contains(&seconds), "{at:?}: {head:?}");
    let volts = f64::from(head.battery.expect("a battery").get()) / 1e3;
    assert!((11.0..12.2).contains(&volts), "{head:?}");
    let motor = head.motor.expect("a motor was driven");
    let all = ticks(&mut bench, &head);
    // Motors have turned for 1.5 s: some 29 ticks of 50 ms.
    assert!((25..64).contains(&all.len()), "{} ticks", all.len());
    let last = all.last().expect("ticks");
    assert!((900..1100).contains(&last.velocity), "motor {motor}: {last:?}");
    assert_eq!(last.drive, head.drive);
    assert_eq!((head.run, head.times), (1, 1));
    (bench, head)
}

#[test]
fn a_task_that_hung_is_a_watchdog_reset_on_record() {
    let (_, head) = after(setup(four_loads()), |bench| bench.divert("capture", FaultyCode::Loops));
    assert_eq!((head.fault, head.detail), (Fault::Watchdog, [0; 2]));
}

#[test]
fn a_bus_error_is_a_hard_fault_on_record_with_the_place_in_the_code() {
    let (bench, head) = after(setup(four_loads()), |bench| bench.fail_next_access(COUNTER));
    assert_eq!(head.fault, Fault::HardFault);
    let place = u64::from(head.detail[0]);
    let function = bench.symbols().iter().find(|s| (s.address..s.address + s.size).contains(&place));
    let name = &function.expect("a function").name;
    assert!(name.contains("capture"), "{name}");
}

#[test]
pub(crate) fn a_panic_is_on_record_with_its_line() {
    let (_, head) = after(setup(four_loads()), |bench| bench.divert("capture", FaultyCode::Panics));
    assert_eq!((head.fault, head.detail), (Fault::Panic, [77, 7]));
}

#[test]
fn a_stack_overflow_opens_all_bridges_and_is_on_record_with_how_far_it_went() {
    let (_, head) = after(Setup { full_mpu: true, ..setup(four_loads()) }, |bench| {
        let at = bench.now();
        bench.divert("capture", FaultyCode::Overflows);
        bench.run(ms(50));
        // The task is polled up to a millisecond after the fault.
        expect_open_within(bench, at, ms(2));
        assert!(log(bench).contains("stack overflow"), "{}", log(bench));
    });
    assert_eq!(head.fault, Fault::StackOverflow);
    // The stack pointer is one exception frame below the end of the guard, 0x2000_2000.
    assert!((0x2000_1F00..0x2000_2000).contains(&head.detail[0]), "{head:?}");
}

#[test]
fn an_unplugged_encoder_is_on_record_with_the_ticks_before_also_after_a_reset() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.set_encoder(1, Encoder::Unplugged);
    bench.run(ms(600));
    let before = entries(&mut bench);
    let [head] = before[..] else { panic!("one entry: {before:?}") };
    assert_eq!((head.fault, head.motor), (Fault::EncoderStuck, Some(1)));
    let seconds = f64::from(head.uptime_ms) / 1e3 - at.as_secs_f64();
    assert!((0.0..0.35).contains(&seconds), "{seconds} s after it was unplugged");
    bench.pull_reset(bench.now() + ms(10));
    bench.run(ms(500));
    let after = entries(&mut bench);
    let [newest, same] = after[..] else { panic!("two entries: {after:?}") };
    assert_eq!((newest.fault, newest.run), (Fault::ResetPin, 1));
    assert_eq!(same, head);
    // The motor turned until its counts stopped. The hub then braked it, drove it in the other direction, and released
    // it.
    let ticks = ticks(&mut bench, &head);
    let stopped =
        ticks.windows(2).rposition(|pair| pair[0].position != pair[1].position).expect("it turned") + 1;
    assert!((ticks.len() - 8..=ticks.len() - 3).contains(&stopped), "{ticks:?}");
    let since = &ticks[stopped + 1..];
    let released = since.iter().position(|tick| tick.drive == Drive::BRAKE).expect("it was braked");
    let driven_back =
        since.iter().position(|tick| tick.drive.mode == Mode::Ccw62).expect("it was driven back");
    assert!(released < driven_back && driven_back + 1 < since.len(), "{ticks:?}");
    assert_eq!(ticks.last().expect("ticks").drive, Drive::COAST);
}

#[test]
pub(crate) fn the_record_is_empty_after_power_on_whatever_the_memory_holds() {
    let mut bench = Bench::new(setup(four_loads()));
    let bytes = 4096;
    let words = (0..bytes / 4).map(|n: u32| n.wrapping_mul(0x9E37_79B9) ^ 0x5A5A_0F0F);
    bench.write_words(board().ram().end - u64::from(bytes), words.collect());
    bench.run(ms(400));
    assert_eq!(entries(&mut bench), []);
}

/// First address of the stack above its guard, and its words (`boards/stm32/src/stack.rs`, and the boards' memory maps).
const STACK: u64 = 0x2000_2000;
const STACK_WORDS: usize = 24 * 1024 / 4;

/// A word that fills the stack before the first instruction.
const PAINT: u32 = 0xA5C3_5A3C;

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_stack_stays_below_nine_of_its_24_kilobytes() {
    let mut bench = Bench::new(setup(four_loads()));
    bench.write_words(STACK, vec![PAINT; STACK_WORDS]);

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

    let stack = bench.read_words(STACK, STACK_WORDS);
    let deepest = 4 * (STACK_WORDS - stack.into_iter().take_while(|&word| word == PAINT).count());
    println!("worst stack seen: {deepest} of {} bytes", 4 * STACK_WORDS);
    assert!(!bench.resets().is_empty(), "the run includes a restart");
    assert!(deepest < 9_000, "{deepest} bytes");
}
