//! Firmware updates over the host's line on the emulated H743, with the bootloader and the hub as they are flashed.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::boot::first_safe_output;
use crate::common::{am60, booted_as, expect_speed, ms, on, setup, watch_samples, worst_sample};
use emulated::host_link::HostLink;
use emulated::{Bench, Board, Setup, elf};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::UpdateReport;
use motor_hub::protocol::Nack;
use motor_hub::protocol::answers::Reply;
use motor_hub::protocol::payload::Text;
use motor_hub::protocol::requests::ToHub;
use motor_hub::update::{Booted, CHUNK, CRC, Outcome, Phase, public_key};

const BOARD: Board = Board::NucleoH743zi2;

/// A hub behind its bootloader, and its host.
fn powered_on() -> (Bench, HostLink) {
    let bench = on(BOARD, || booted_as(Setup { bootloader: true, ..setup(vec![am60()]) }));
    (bench, HostLink::default())
}

fn state(bench: &mut Bench, host: &mut HostLink) -> UpdateReport {
    host.read(bench, HubFunction::Update)
}

fn version(bench: &mut Bench, host: &mut HostLink) -> String {
    let text: Text = host.read(bench, ToHub::VersionText);
    String::from_utf8_lossy(&text).into_owned()
}

/// Repeats a request until the hub accepts it. The hub refuses the request until it has written the previous data.
fn persist(bench: &mut Bench, host: &mut HostLink, request: &HubFunction) {
    let end = bench.now() + ms(10_000);
    loop {
        match host.request(bench, request.clone()) {
            Reply::Ack { .. } => return,
            Reply::Nack(Nack::UPDATE_BUSY) if bench.now() < end => bench.run(ms(20)),
            reply => panic!("{request:?}: {reply:?}"),
        }
    }
}

/// Expects that the hub refuses a request for a reason.
#[track_caller]
fn refused(bench: &mut Bench, host: &mut HostLink, request: HubFunction, why: Nack) {
    assert_eq!(host.request(bench, request), Reply::Nack(why));
}

/// Announces an image.
fn begin(bench: &mut Bench, host: &mut HostLink, image: &[u8]) {
    let version = Text::from_slice(b"a test").expect("short");
    host.command(
        bench,
        HubFunction::BeginUpdate { length: image.len() as u32, crc: CRC.checksum(image), version },
    );
}

/// Sends an announced image, and expects that the hub arms it.
fn send(bench: &mut Bench, host: &mut HostLink, image: &[u8]) {
    let report = checked(bench, host, image);
    assert_eq!((report.phase, report.outcome), (Phase::Armed, Outcome::Done));
}

/// Sends an announced image, and returns the report after the check.
fn checked(bench: &mut Bench, host: &mut HostLink, image: &[u8]) -> UpdateReport {
    write(bench, host, image);
    settled(bench, host)
}

/// Sends all bytes of an announced image.
fn write(bench: &mut Bench, host: &mut HostLink, image: &[u8]) {
    for (offset, bytes) in (0..).step_by(CHUNK).zip(image.chunks(CHUNK)) {
        let bytes = Text::from_slice(bytes).expect("short");
        persist(bench, host, &HubFunction::Chunk { offset, bytes });
    }
    persist(bench, host, &HubFunction::FinishUpdate);
}

/// Waits until the hub has checked the image, and returns the report.
fn settled(bench: &mut Bench, host: &mut HostLink) -> UpdateReport {
    let end = bench.now() + ms(10_000);
    loop {
        let report = state(bench, host);
        if report.phase != Phase::Checking || bench.now() > end {
            return report;
        }
        bench.run(ms(20));
    }
}

/// Returns an image that hangs: initial stack pointer, reset vector, and a branch to itself (ARMv7-M ARM A7.7.12,
/// B1.5.3).
fn hangs(origin: u32) -> Vec<u8> {
    let words = [0x2002_0000, origin + 9, 0xE7FE_E7FE];
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_bootloader_starts_the_hub_and_firmware_that_hangs_is_rolled_back() {
    let began = Instant::now();
    let (mut bench, mut host) = powered_on();
    let before = version(&mut bench, &mut host);
    let report = state(&mut bench, &mut host);
    assert_eq!(
        (report.booted, report.phase, report.origin),
        (Booted::Confirmed, Phase::Nothing, 0x0802_0000)
    );
    let image = hangs(report.origin);
    begin(&mut bench, &mut host, &image);
    send(&mut bench, &mut host, &image);
    host.command(&mut bench, HubFunction::Restart);
    let started = bench.now();
    // The image is swapped in, the bootloader's watchdog resets, and the image is swapped back. 16 sectors are erased.
    let back = bench.run_while(ms(500), ms(90_000), |bench| {
        host.send(bench, HubFunction::Update);
        bench.run(ms(20));
        !host.arrivals(bench).is_empty()
    });
    assert!(back, "nobody answers");
    println!(
        "hung, and rolled back after {:?}; {:?} of this machine's time",
        bench.now() - started,
        began.elapsed()
    );
    bench.run(Duration::from_secs(1));
    host.arrivals(&mut bench);
    assert_eq!(state(&mut bench, &mut host).booted, Booted::Reverted);
    assert_eq!(version(&mut bench, &mut host), before);
    let causes: Vec<_> = bench.resets().into_iter().map(|reset| reset.cause).collect();
    println!("{causes:?}");
    bench.assert_sound();
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn behind_the_bootloader_pins_drive_their_idle_levels_within_milliseconds_of_reset() {
    let safe = on(BOARD, || {
        let mut bench = Bench::new(Setup { bootloader: true, ..setup(vec![am60()]) });
        let safe = first_safe_output(&mut bench);
        bench.run(ms(300));
        bench.assert_sound();
        safe
    });
    println!("first safe output behind the bootloader {:.3} ms after reset", safe.as_secs_f64() * 1e3);
    assert!(safe < ms(1), "{safe:?}");
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_motor_that_runs_is_not_held_up_by_an_update_and_holds_up_its_begin_and_its_restart() {
    let (mut bench, mut host) = powered_on();
    let image = hangs(0x0802_0000);
    host.velocity(&mut bench, 0, 1000);
    bench.run(ms(1000));
    let too_soon = HubFunction::BeginUpdate { length: 12, crc: 0, version: Text::default() };
    refused(&mut bench, &mut host, too_soon, Nack::MOTOR_ENABLED);
    host.enable(&mut bench, 0, false);
    bench.run(ms(300));
    begin(&mut bench, &mut host, &image);
    // Motors may run during an update. The first chunk erases a page, and arming erases the bootloader's state.
    host.velocity(&mut bench, 0, 1000);
    bench.run(ms(1000));
    watch_samples(&mut bench);
    let begun = bench.now();
    send(&mut bench, &mut host, &image);
    let took = bench.now() - begun;
    let worst = worst_sample(&mut bench);
    println!("written, checked and armed in {took:?}; the latest sample came {worst:?} after the one before");
    assert!(took > ms(2000), "two erasures of 128 kB take a second each at least: {took:?}");
    assert!(worst < Duration::from_micros(1_200), "{worst:?}");
    expect_speed(&mut bench, [0], 30.0);
    refused(&mut bench, &mut host, HubFunction::Restart, Nack::MOTOR_ENABLED);
    // The next reset does not start an abandoned image.
    host.command(&mut bench, HubFunction::AbandonUpdate);
    bench.run(ms(2_450));
    host.keep_alive(&mut bench);
    bench.run(ms(2_000));
    assert_eq!(state(&mut bench, &mut host).phase, Phase::Nothing);
    let at = bench.now() + ms(10);
    bench.pull_reset(at);
    bench.run(ms(400));
    let report = state(&mut bench, &mut host);
    assert_eq!((report.booted, report.phase), (Booted::Confirmed, Phase::Nothing));
    bench.assert_sound();
}

/// A public key. [`SIGNATURE`] is the signature of the image [`hangs`] with the secret key, made by OpenSSL.
const KEY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/update/signed/public.der");
const SIGNATURE: &[u8; 64] = include_bytes!("hangs.sig");

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_hub_with_a_signers_key_arms_what_that_one_has_signed_and_nothing_else() {
    let image = elf::build(BOARD.name(), elf::Variant::Signed(Path::new(KEY)));
    let mut bench =
        on(BOARD, || Bench::with_image(Setup { bootloader: true, ..setup(vec![am60()]) }, &image));
    bench.run(ms(300));
    let mut host = HostLink::default();
    let key = public_key(&std::fs::read(KEY).expect("a file")).expect("a key");
    let image = hangs(0x0802_0000);
    begin(&mut bench, &mut host, &image);
    let bytes = Text::from_slice(&image).expect("short");
    refused(&mut bench, &mut host, HubFunction::Chunk { offset: 0, bytes }, Nack::UPDATE_UNSIGNED);
    let other = HubFunction::Sign { key: [7; 32], signature: *SIGNATURE };
    refused(&mut bench, &mut host, other, Nack::UPDATE_OTHER_KEY);
    let sign = |bench: &mut Bench, host: &mut HostLink, turned| {
        begin(bench, host, &image);
        let mut signature = *SIGNATURE;
        signature[40] ^= turned;
        host.command(bench, HubFunction::Sign { key, signature });
    };
    let state_of = |report: &UpdateReport| (report.phase, report.outcome, report.booted);
    watch_samples(&mut bench);
    sign(&mut bench, &mut host, 1);
    let report = checked(&mut bench, &mut host, &image);
    assert_eq!(state_of(&report), (Phase::Nothing, Outcome::WrongSignature, Booted::Confirmed));
    let worst = worst_sample(&mut bench);
    println!("a signature was looked at, and a sample came {worst:?} after the one before");
    assert!(worst < ms(40), "the watchdog waits 480 ms at the least: {worst:?}");
    // While a motor runs, the check waits, and samples are not late.
    sign(&mut bench, &mut host, 0);
    host.velocity(&mut bench, 0, 1000);
    bench.run(ms(500));
    worst_sample(&mut bench);
    write(&mut bench, &mut host, &image);
    bench.run(ms(2_000));
    host.keep_alive(&mut bench);
    assert_eq!(state(&mut bench, &mut host).phase, Phase::Checking);
    let worst = worst_sample(&mut bench);
    assert!(worst < Duration::from_micros(1_200), "{worst:?}");
    host.enable(&mut bench, 0, false);
    let report = settled(&mut bench, &mut host);
    assert_eq!(state_of(&report), (Phase::Armed, Outcome::Done, Booted::Confirmed));
    assert_eq!(bench.resets(), []);
    bench.assert_sound();
}
