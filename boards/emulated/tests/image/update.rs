//! New firmware without a probe, on the emulated H743: the bootloader and the hub behind it, as they are flashed.

use std::time::{Duration, Instant};

use crate::common::{am60, ms, on, setup};
use emulated::talk::Talk;
use emulated::{Bench, Board, Setup};
use motor_hub::protocol::answers::Reply;
use motor_hub::protocol::fields::Text;
use motor_hub::protocol::requests::ToHub;
use motor_hub::protocol::update::{ToUpdate, UpdateReport};
use motor_hub::protocol::{Nack, Request};
use motor_hub::update::{Booted, CHUNK, Crc32, Outcome, Phase};

const BOARD: Board = Board::NucleoH743zi2;

fn powered_on() -> (Bench, Talk) {
    let mut bench = on(BOARD, || Bench::new(Setup { bootloader: true, ..setup(vec![am60()]) }));
    bench.run(ms(300));
    (bench, Talk::default())
}

fn state(bench: &mut Bench, talk: &mut Talk) -> UpdateReport {
    talk.question(bench, ToUpdate::State)
}

fn version(bench: &mut Bench, talk: &mut Talk) -> String {
    let text: Text = talk.question(bench, ToHub::VersionText);
    String::from_utf8_lossy(text.bytes()).into_owned()
}

/// An order that may have to wait until the hub has written what was before.
fn persist(bench: &mut Bench, talk: &mut Talk, request: &ToUpdate) {
    let request = Request::from(request.clone());
    let end = bench.now() + ms(10_000);
    loop {
        match talk.ask(bench, request.id(), &request.payload()) {
            Reply::Ack { .. } => return,
            Reply::Nack(Nack::UPDATE_AT_WORK) if bench.now() < end => bench.run(ms(20)),
            reply => panic!("{request:?}: {reply:?}"),
        }
    }
}

/// Sends an image, and has it checked and started.
fn update(bench: &mut Bench, talk: &mut Talk, image: &[u8]) {
    let mut crc = Crc32::new();
    crc.add(image);
    let version = Text::new(b"a test").expect("short");
    talk.order(bench, ToUpdate::Begin { length: image.len() as u32, crc: crc.get(), version });
    for (offset, bytes) in (0..).step_by(CHUNK).zip(image.chunks(CHUNK)) {
        let bytes = Text::new(bytes).expect("short");
        persist(bench, talk, &ToUpdate::Chunk { offset, bytes });
    }
    persist(bench, talk, &ToUpdate::Finish);
    let end = bench.now() + ms(10_000);
    let report = loop {
        let report = state(bench, talk);
        if report.phase != Phase::Checking || bench.now() > end {
            break report;
        }
        bench.run(ms(20));
    };
    assert_eq!((report.phase, report.outcome), (Phase::Armed, Outcome::Done));
    talk.order(bench, ToUpdate::Restart);
}

/// Code that never gets anywhere: its stack, its entry, and a branch to itself (ARMv7-M ARM A7.7.12, B1.5.3).
fn hangs(origin: u32) -> Vec<u8> {
    let words = [0x2002_0000, origin + 9, 0xE7FE_E7FE];
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

#[test]
fn the_bootloader_starts_the_hub_and_firmware_that_hangs_is_rolled_back() {
    let began = Instant::now();
    let (mut bench, mut talk) = powered_on();
    let before = version(&mut bench, &mut talk);
    let report = state(&mut bench, &mut talk);
    assert_eq!(
        (report.booted, report.phase, report.origin),
        (Booted::Confirmed, Phase::Nothing, 0x0802_0000)
    );
    update(&mut bench, &mut talk, &hangs(report.origin));
    let started = bench.now();
    // Swapped in, reset by the bootloader's watchdog, swapped back: 16 sectors of the flash are erased.
    let back = bench.run_while(ms(500), ms(90_000), |bench| {
        let packet = talk.packet(ToUpdate::State.number() + 0x4D00, &[]);
        bench.send(&packet);
        bench.run(ms(20));
        !talk.arrivals(bench).is_empty()
    });
    assert!(back, "nobody answers");
    println!(
        "hung, and rolled back after {:?}; {:?} of this machine's time",
        bench.now() - started,
        began.elapsed()
    );
    bench.run(Duration::from_secs(1));
    talk.arrivals(&mut bench);
    assert_eq!(state(&mut bench, &mut talk).booted, Booted::WentBack);
    assert_eq!(version(&mut bench, &mut talk), before);
    let causes: Vec<_> = bench.resets().into_iter().map(|reset| reset.cause).collect();
    println!("{causes:?}");
    bench.assert_sound();
}
