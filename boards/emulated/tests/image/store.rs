//! Settings that outlast power, in the emulated flash. The flash of the H743 can be written and erased. The flash of the F427
//! drops stores silently, which the hub must report.

use std::convert::Infallible;
use std::time::Duration;

use crate::common::{am60, booted_as, log, ms, on, setup, watch_samples, with_host, worst_sample};
use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use emulated::host_link::{HostLink, Line};
use emulated::{Bench, Board, Setup, elf};
use motor_hub::braking::Winding;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::motor::{OnFault, Settings, ThermalLimit};
use motor_hub::protocol::Address;
use motor_hub::protocol::Reply;
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::payload::Fields;
use motor_hub::protocol::requests::Standard;
use motor_hub::store::{Outcome, SettingsRecord, StoreRequest, Stored};
use motor_hub::tasks::store::Keeper;

const BOARD: Board = Board::NucleoH743zi2;

fn powered_on(stored: Vec<u8>) -> Bench {
    on(BOARD, || booted_as(Setup { stored, ..setup(vec![am60(); 2]) }))
}

fn protection(ma: u16) -> Values {
    let settings = Settings {
        on_fault: OnFault::Brake,
        thermal: ThermalLimit::new(ma, 20, 600).ok(),
        ..Settings::new(Winding::NEVEREST_60)
    };
    Values::of(Group::Protection, &MotorSettings::new(settings))
}

pub(crate) fn protect(bench: &mut Bench, host: &mut HostLink, ma: u16) {
    host.command(bench, Request::Set(1, protection(ma)));
}

fn protected(bench: &mut Bench, host: &mut HostLink) -> Values {
    let reply = host.request(bench, Request::Get(1, Group::Protection));
    let Reply::Data(payload) = reply else { panic!("{reply:?}") };
    Values::read(Group::Protection, &mut Fields::new(&payload)).expect("a protection")
}

fn state(line: &mut impl Line, host: &mut HostLink) -> StoreReport {
    host.read(line, HubFunction::Stored)
}

/// Saves the settings, and waits for the end. Returns the report and the time that the save took.
pub(crate) fn save(line: &mut impl Line, host: &mut HostLink) -> (StoreReport, Duration) {
    let begun = line.first().now();
    host.command(line, HubFunction::Save);
    loop {
        let (report, took) = (state(line, host), line.first().now() - begun);
        if !report.is_busy {
            return (report, took);
        }
        assert!(took < ms(6000), "{report:?}");
    }
}

#[test]
fn settings_are_there_again_after_the_power_was_gone() {
    let (mut bench, mut host) = (powered_on(Vec::new()), HostLink::default());
    assert_eq!(state(&mut bench, &mut host), StoreReport::default());
    protect(&mut bench, &mut host, 1_234);
    host.command(&mut bench, ToMotor::SetCurrentAlert { milliamperes: 777 }.to(0));
    let (report, took) = save(&mut bench, &mut host);
    println!("a save into blank flash took {took:?}");
    assert_eq!((report.stored, report.number, report.outcome), (Stored::Whole, 1, Outcome::Done));
    // The protocol's command for a new address stores only the address.
    protect(&mut bench, &mut host, 4_321);
    let address = Address::new(7).expect("an address");
    host.command(&mut bench, Standard::SetAddress { address });
    bench.run(ms(200));
    let stored = bench.stored();
    bench.assert_sound();
    drop(bench);

    let (mut bench, mut host) = (powered_on(stored), HostLink::default());
    host.to(address.get());
    let report = state(&mut bench, &mut host);
    assert_eq!((report.stored, report.number, report.differs), (Stored::Whole, 2, false));
    assert_eq!(protected(&mut bench, &mut host), protection(1_234));
    let alert: u16 = host.read(&mut bench, ToMotor::CurrentAlert.to(0));
    assert_eq!(alert, 777);
    bench.assert_sound();
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn power_that_goes_during_a_save_leaves_the_old_settings_or_the_new() {
    let (mut bench, mut host) = (powered_on(Vec::new()), HostLink::default());
    protect(&mut bench, &mut host, 1_000);
    save(&mut bench, &mut host);
    let mut seen = [0; 2];
    // During the save, copies of the flash are given to other hubs, which are then powered on.
    protect(&mut bench, &mut host, 2_000);
    host.command(&mut bench, HubFunction::Save);
    for cut in 0..5_u32 {
        let mut again = on(BOARD, || Bench::new(Setup { stored: bench.stored(), ..setup(vec![am60()]) }));
        again.run(ms(60));
        let found = protected(&mut again, &mut HostLink::default());
        let new = found == protection(2_000);
        assert!(new || found == protection(1_000), "cut {cut}: {found:?}");
        seen[usize::from(new)] += 1;
        again.assert_sound();
        bench.run(Duration::from_micros(1_300));
    }
    println!("old, new: {seen:?}");
    assert!(seen[0] >= 1 && seen[1] >= 1, "{seen:?}");
}

/// The flash of a board before power-on, which a test fills.
pub(crate) struct Pages(pub(crate) Vec<u8>);

impl ErrorType for &mut Pages {
    type Error = Infallible;
}

impl ReadNorFlash for &mut Pages {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for &mut Pages {
    const WRITE_SIZE: usize = 32;
    const ERASE_SIZE: usize = 128 * 1024;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        self.0[offset as usize..][..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

/// Returns a flash with both pages in use and without room for another save, and the number of the last save.
fn full() -> (Vec<u8>, u32) {
    let mut pages = Pages(vec![0xFF; 256 * 1024]);
    let save = |pages: &mut Pages, number| {
        let mut record = SettingsRecord::new(number);
        record.push(0x4D55, &[7; 100]).expect("room");
        let order = StoreRequest { record: Some(record), erase_first: false, may_erase: false };
        block_on(Keeper::new(pages, 0..256 * 1024).expect("two pages").carry_out(&order)).outcome
    };
    let mut before = Vec::new();
    for number in 1.. {
        before.clone_from(&pages.0);
        if save(&mut pages, number) == Outcome::NeedsErase {
            return (before, number - 1);
        }
    }
    unreachable!("a page is full at some time")
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_save_that_erases_waits_until_motors_are_off_and_delays_no_sample() {
    let (stored, number) = full();
    let image = elf::build(BOARD.name(), elf::Variant::Period(1));
    let mut bench = on(BOARD, || Bench::with_image(Setup { stored, ..setup(vec![am60()]) }, &image));
    bench.run(ms(500));
    let mut host = HostLink::default();
    assert_eq!(state(&mut bench, &mut host).number, number);
    // While a motor runs, the hub does not erase a page for the save.
    host.velocity(&mut bench, 0, 1000);
    watch_samples(&mut bench);
    let (report, _) = save(&mut bench, &mut host);
    assert_eq!((report.outcome, report.number), (Outcome::NeedsErase, number));
    host.enable(&mut bench, 0, false);
    bench.run(ms(100));
    let (report, took) = save(&mut bench, &mut host);
    assert_eq!((report.outcome, report.number, report.stored), (Outcome::Done, number + 1, Stored::Whole));
    let worst = worst_sample(&mut bench);
    println!("a save that erases took {took:?}; the latest sample came {worst:?} after the one before");
    assert!(took > ms(1000), "an erasure of 128 KB takes a second at least (DS12110 table 140): {took:?}");
    assert!(worst < Duration::from_micros(1_200), "{worst:?}");
    assert_eq!(bench.resets(), []);
    let log = log(&mut bench);
    assert!(
        log.contains("missed 0")
            && !log.lines().any(|line| line.contains("missed") && !line.contains("missed 0")),
        "{log}"
    );
    bench.assert_sound();
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn an_erasure_that_a_power_loss_has_cut_is_repeated_at_power_on_and_delays_no_tick() {
    let (mut stored, number) = full();
    // The second page is blank at its beginning, but not everywhere.
    stored[128 * 1024 + 4096..][..64].fill(0x5A);
    let mut bench = powered_on(stored);
    bench.run(ms(2_200));
    assert_eq!(bench.resets(), []);
    assert!(bench.stored()[128 * 1024..].iter().all(|byte| *byte == 0xFF));
    let report = state(&mut bench, &mut HostLink::default());
    assert_eq!((report.stored, report.number), (Stored::Whole, number));
    let log = log(&mut bench);
    assert!(log.contains("missed 0"), "{log}");
    bench.assert_sound();
}

#[test]
fn a_flash_that_drops_writes_is_reported() {
    let (mut bench, mut host) = on(Board::NucleoF429zi, || with_host(vec![am60()]));
    assert_eq!(state(&mut bench, &mut host), StoreReport::default());
    let (report, _) = save(&mut bench, &mut host);
    assert_eq!((report.stored, report.number), (Stored::Nothing, 0));
    assert!(matches!(report.outcome, Outcome::Refused | Outcome::Lost), "{report:?}");
    bench.assert_sound();
}
