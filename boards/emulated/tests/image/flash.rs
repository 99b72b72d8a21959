//! The flash of the H743 with faults of real chips: spurious error flags, words that arrive late, power cuts, and a debug probe
//! that writes the flash without the bootloader. Settings and firmware must survive these faults.

use std::sync::OnceLock;
use std::time::Duration;

use crate::common::{ERRORS, LATE, am60, booted, expect_speed, ms, on, setup};
use crate::store::{self, Pages};
use crate::supply;
use embassy_futures::block_on;
use emulated::host_link::HostLink;
use emulated::{Bench, Board, Setup};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::UpdateReport;
use motor_hub::store::{Outcome as Saved, Stored};
use motor_hub::tasks::update::Slots;
use motor_hub::update::{Booted, CHUNK, CRC, ImageSignature, Outcome};
use salty::{Keypair, Sha512};

const BOARD: Board = Board::NucleoH743zi2;

/// Offsets from the flash's start, in bytes (`boot_h743zi2::layout`): of the slot that is booted, of the other slot,
/// and of the bootloader's state. `ORIGIN` is the address of the slot that is booted, and `PAGE` is the number of bytes
/// of a sector.
const ACTIVE: usize = 0x2_0000;
const ORIGIN: u32 = 0x0802_0000;
const DOWNLOAD: usize = 0x10_0000;
const STATE: usize = 0x1A_0000;
const PAGE: usize = 0x2_0000;

/// Offset of the state's word that is 0 once the first step of a swap is done.
const FIRST_STEP: usize = STATE + 2 * 32;

/// Each byte of the bootloader's state while a swap is ordered (`SWAP_MAGIC` of embassy-boot).
const ORDERED: u8 = 0xF0;

/// Each byte of the bootloader's state once the firmware has confirmed itself (`embassy_boot::BOOT_MAGIC`).
const CONFIRMED: u8 = 0xD0;

/// Each byte of the bootloader's state if new firmware was refused (`REVERT_MAGIC` of embassy-boot).
const WENT_BACK: u8 = 0xC0;

#[test]
fn settings_are_saved_while_the_flash_shows_spurious_errors_or_words_arrive_late() {
    for flash_faults in [ERRORS, LATE] {
        let mut bench = on(BOARD, || booted(vec![am60(); 2]));
        bench.set_flash_faults(flash_faults);
        let mut host = HostLink::default();
        for number in 1..=3 {
            store::protect(&mut bench, &mut host, 1_000 + number as u16);
            let (report, _) = store::save(&mut bench, &mut host);
            let found = (report.outcome, report.stored, report.number);
            assert_eq!(found, (Saved::Done, Stored::Whole, number), "{flash_faults:?}");
        }
        bench.assert_sound();
    }
}

/// The flash of a board whose bootloader finds new firmware armed.
#[derive(Clone)]
struct Armed {
    flash: Vec<u8>,
    /// The image in the slot that is booted.
    before: Vec<u8>,
    /// The image that is armed.
    new: Vec<u8>,
}

fn armed() -> Armed {
    static ARMED: OnceLock<Armed> = OnceLock::new();
    ARMED.get_or_init(|| armed_with(setup(vec![am60()]), |_| None)).clone()
}

/// Returns an armed flash for another setup, with a signature that `sign` makes from the new image.
fn armed_with(setup: Setup, sign: impl FnOnce(&[u8]) -> Option<ImageSignature>) -> Armed {
    let setup = Setup { board: BOARD, bootloader: true, ..setup };
    let mut flash = Bench::new(setup).flash();
    let slot = &flash[ACTIVE..ACTIVE + 4 * PAGE];
    let end = slot.iter().rposition(|byte| *byte != 0xFF).expect("a hub");
    let before = slot[..(end + 1).next_multiple_of(CHUNK)].to_vec();
    // The new image is the same hub with unused bytes behind its code.
    let new = [&before[..], &[0x5A; CHUNK]].concat();
    let mut booted = Pages(flash[ACTIVE..ACTIVE + 4 * PAGE].to_vec());
    let mut download = Pages(vec![0xFF; 5 * PAGE]);
    let mut state = Pages(vec![0xFF; PAGE]);
    let mut slots = Slots::new(&mut booted, &mut download, &mut state).expect("words that fit");
    for (at, bytes) in (0..).step_by(CHUNK).zip(new.chunks(CHUNK)) {
        assert_eq!(block_on(slots.write(at, bytes)), Outcome::Done);
    }
    let crc = CRC.checksum(&new);
    let done = block_on(slots.arm(new.len() as u32, crc, sign(&new), std::future::ready(())));
    assert_eq!(done, Outcome::Done);
    flash[DOWNLOAD..DOWNLOAD + 5 * PAGE].copy_from_slice(&download.0);
    flash[STATE..STATE + PAGE].copy_from_slice(&state.0);
    Armed { flash, before, new }
}

fn powered_on(flash: Vec<u8>) -> Bench {
    on(BOARD, || Bench::new(Setup { flash, bootloader: true, ..setup(vec![am60()]) }))
}

/// True while the bootloader's state orders a swap. The order stays until firmware confirms itself.
fn is_ordered(bench: &mut Bench) -> bool {
    let at = BOARD.flash().start + STATE as u64;
    bench.read_words(at, 8) == [u32::from_le_bytes([ORDERED; 4]); 8]
}

/// Runs until the hub is no longer on trial. Returns the hub's report of how it was booted.
///
/// The bootloader's state alone does not show this. A confirmation first erases the order, and power may fail before
/// the new mark is written. Without an order the firmware counts as confirmed.
#[track_caller]
fn outcome(bench: &mut Bench) -> Booted {
    let begun = bench.now();
    bench.run(ms(500));
    let swapped = bench.run_while(ms(250), Duration::from_secs(60), |bench| !is_ordered(bench));
    assert!(swapped, "still ordered to swap; resets: {}", bench.resets().len());
    // The mark is written after an erasure. The hub writes it, or the bootloader if it discards a stale swap.
    bench.run(ms(3_000));
    let report: UpdateReport = HostLink::default().read(bench, HubFunction::Update);
    println!("{:?} after {:?}", report.booted, bench.now() - begun);
    report.booted
}

/// Runs until the hub's firmware is confirmed, and expects this firmware in the slot.
#[track_caller]
fn boots(bench: &mut Bench, expected: &[u8]) {
    assert_eq!(outcome(bench), Booted::Confirmed);
    assert!(bench.flash()[ACTIVE..].starts_with(expected), "other firmware than expected");
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_bootloader_swaps_while_the_flash_shows_spurious_errors_or_words_arrive_late() {
    for flash_faults in [ERRORS, LATE] {
        let Armed { flash, new, .. } = armed();
        let mut bench = powered_on(flash);
        bench.set_flash_faults(flash_faults);
        boots(&mut bench, &new);
        assert_eq!(bench.resets(), [], "{flash_faults:?}");
    }
}

/// Registers of the flash's interface (RM0433 2.3).
const INTERFACE: std::ops::Range<u64> = 0x5200_2000..0x5200_2200;

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_fault_in_the_middle_of_a_swap_is_a_reset_and_the_swap_goes_on() {
    let Armed { flash, new, .. } = armed();
    let mut bench = powered_on(flash);
    bench.run(ms(5_000));
    bench.fail_next_access(INTERFACE);
    boots(&mut bench, &new);
    assert_eq!(bench.resets().len(), 1);
}

#[test]
fn clocks_that_never_start_before_the_bootloader_leave_the_red_lamp_on_and_the_watchdog_tries_again() {
    on(BOARD, || supply::clocks_never_start(Setup { bootloader: true, ..setup(vec![am60()]) }));
}

/// ODR of GPIOB: PB14 is the red lamp.
const LAMPS: u64 = 0x5802_0414;

/// Time between two changes of the lamp on the emulated chip. The bootloader assumes a clock of 64 MHz, at which the
/// lamp changes every 250 ms. The emulated core runs at 400 MHz from the start.
const BLINKS_EVERY: Duration = Duration::from_millis(250 * 64 / 400);

#[test]
fn the_red_lamp_blinks_during_a_swap() {
    let mut bench = powered_on(armed().flash);
    let mut lit = Vec::new();
    bench.run_while(ms(4), 20 * BLINKS_EVERY, |bench| {
        lit.push(bench.register(LAMPS) >> 14 & 1 == 1);
        false
    });
    let changes = lit.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((19..=20).contains(&changes), "{changes} changes in {:?}", bench.now());
}

/// A reset switches JTAG's pull-ups on, and a pin takes the 5 V of an encoder only without a pull-up.
#[test]
fn encoders_find_no_pull_up_during_a_swap() {
    let mut bench = powered_on(armed().flash);
    bench.run(ms(1));
    // PUPDR of GPIOA and GPIOB.
    for (at, pin) in [(0x5802_000C, 15), (0x5802_040C, 4)] {
        assert_eq!(bench.register(at) >> (2 * pin) & 0b11, 0, "pull on pin {pin} at {at:#x}");
    }
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn an_operation_that_never_ends_in_a_swap_is_ended_by_the_watchdog_and_the_swap_goes_on() {
    let Armed { flash, new, .. } = armed();
    let mut bench = powered_on(flash);
    bench.run(ms(3_000));
    bench.hold_flash();
    assert!(bench.run_while(ms(500), ms(34_000), |bench| !bench.resets().is_empty()), "no watchdog reset");
    println!("reset after {:?}: {:?}", bench.now(), bench.resets());
    boots(&mut bench, &new);
    assert_eq!(bench.resets().len(), 1, "{:?}", bench.resets());
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn firmware_on_trial_drives_its_motors_while_the_flash_does_not_take_the_confirmation() {
    let mut bench = powered_on(armed().flash);
    assert!(bench.run_while(ms(100), ms(20_000), |bench| !bench.log().is_empty()), "nothing is swapped in");
    bench.hold_flash();
    // The confirmation is due after 2 s.
    bench.run(ms(4_000));
    let mut host = HostLink::default();
    host.velocity(&mut bench, 0, 1_000);
    bench.run(ms(1_500));
    let report: UpdateReport = host.read(&mut bench, HubFunction::Update);
    assert_eq!(report.booted, Booted::OnTrial);
    expect_speed(&mut bench, [0], 30.0);
    assert_eq!(bench.resets(), []);
}

/// The bootloader jumps to the reset vector of the slot, whatever address the vector has.
#[test]
fn no_code_is_executed_in_the_second_bank_and_in_the_system_memory() {
    const SPIN: [u8; 2] = 0xE7FE_u16.to_le_bytes();
    let handler = ORIGIN + 0x200;
    for entry in [0x0810_0000_u32, 0x1FF0_0000] {
        let mut flash = armed().flash;
        flash[STATE..STATE + PAGE].fill(0xFF);
        // The vectors are stack, reset, NMI and HardFault. The handler is an endless loop, and so is the code in the
        // second bank.
        let vectors = [0x2002_0000, entry + 1, handler + 1, handler + 1].map(u32::to_le_bytes);
        flash[ACTIVE..ACTIVE + 16].copy_from_slice(vectors.as_flattened());
        flash[ACTIVE + 0x200..ACTIVE + 0x202].copy_from_slice(&SPIN);
        flash[DOWNLOAD..DOWNLOAD + 2].copy_from_slice(&SPIN);
        let stand = Setup { board: BOARD, flash, bootloader: true, full_mpu: true, ..setup(vec![am60()]) };
        let mut bench = Bench::new(stand);
        bench.watch(vec![entry.into(), handler.into()]);
        bench.run(ms(20));
        let arrivals: Vec<u64> = bench.take_hits().into_iter().map(|hit| hit.address).take(2).collect();
        assert_eq!(arrivals.last(), Some(&handler.into()), "{entry:#x}: {arrivals:#x?}");
    }
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn firmware_that_a_probe_has_written_boots_although_other_firmware_is_armed() {
    let Armed { mut flash, new, .. } = armed();
    // The probe writes the same hub with other bytes behind its code.
    let probed = [&new[..new.len() - CHUNK], &[0xA5; CHUNK]].concat();
    flash[ACTIVE..ACTIVE + probed.len()].copy_from_slice(&probed);
    let mut bench = powered_on(flash);
    boots(&mut bench, &probed);
    assert_eq!(bench.resets(), []);
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_bootloader_with_a_key_begins_to_swap_only_what_the_key_has_signed() {
    let keys = Keypair::from(&[3; 32]);
    let key = keys.public.to_bytes();
    // The file of the public key as OpenSSL writes it.
    let head = [0x30, 0x2A, 0x30, 0x05, 0x06, 0x03, 0x2B, 0x65, 0x70, 0x03, 0x21, 0x00];
    let file = std::env::temp_dir().join(format!("motor-hub-{}.der", std::process::id()));
    std::fs::write(&file, [&head[..], &key].concat()).expect("a file for the key");
    let with_key = || Setup { bootloader_key: Some(file.clone()), ..setup(vec![am60()]) };
    let sign = |image: &[u8]| {
        let mut hash = Sha512::new();
        hash.update(image);
        Some(ImageSignature { key, bytes: keys.sign(&hash.finalize()).to_bytes() })
    };
    let (unsigned, signed) = (armed_with(with_key(), |_| None), armed_with(with_key(), sign));
    std::fs::remove_file(&file).expect("the file of the key");
    for (Armed { flash, .. }, swaps) in [(signed, true), (unsigned, false)] {
        let mut bench = powered_on(flash);
        // The first step of a swap erases a page and writes another.
        bench.run(ms(3_000));
        let left = bench.flash();
        assert_eq!(left[STATE], if swaps { ORDERED } else { WENT_BACK });
        assert_eq!(left[FIRST_STEP] == 0, swaps, "the first step of the swap");
        assert_eq!(bench.resets(), []);
    }
}

/// Time between two power cuts. The erasure of a page takes 1.1 s, and its write takes up to 0.53 s.
const BETWEEN_CUTS: Duration = Duration::from_millis(350);

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn power_that_goes_at_any_step_of_a_swap_leaves_whole_firmware_that_runs() {
    let Armed { flash, before, new } = armed();
    let mut bench = powered_on(flash);
    let mut cuts = 0;
    let mut restored = 0;
    loop {
        bench.run(BETWEEN_CUTS);
        let left = bench.flash();
        let is_over = left[STATE] == CONFIRMED;
        let is_on_trial = left[STATE] == ORDERED && left[ACTIVE..].starts_with(&new);
        let mut powered_on = powered_on(left);
        let booted = outcome(&mut powered_on);
        // A reset of firmware on trial restores the previous firmware, also if the reset is a loss of power.
        let expected = match booted {
            Booted::Reverted if is_on_trial => &before,
            _ => &new,
        };
        assert!(
            powered_on.flash()[ACTIVE..].starts_with(expected),
            "other firmware than expected: {booted:?}"
        );
        restored += u32::from(booted == Booted::Reverted);
        assert_eq!(booted == Booted::Reverted, expected == &before);
        cuts += 1;
        assert!(cuts < 200, "the swap does not end");
        if is_over {
            break;
        }
    }
    println!("{cuts} cuts, {restored} of them on trial");
    assert!(cuts > 16, "a swap has 16 steps: {cuts}");
    assert!(restored > 0, "no cut was on trial");
}
