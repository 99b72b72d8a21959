//! A motor hub for four motors on a NUCLEO-H743ZI2: the pins, the peripherals, and one line per task.
//!
//! All decisions are in `motor_hub`, all drivers that other STM32 share in `motor_hub_stm32`. Wiring, sizes and
//! how to flash are in the README beside it.
#![no_std]
#![no_main]

mod adc;
mod chip;
mod current;

use adc::BatteryAdc;
use boot_h743zi2::{Bank, layout};
use core::ops::Range;
use current::CurrentLines;
use defmt::{info, unwrap};
use defmt_rtt as _;
use embassy_embedded_hal::flash::partition::Partition;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{AnyPin, Flex, Input, Level, Output, Pull, Speed};
use embassy_stm32::peripherals::{IWDG1, TIM1, TIM2, TIM3, TIM4, TIM8, USART3};
use embassy_stm32::usart::{BufferedInterruptHandler, BufferedUartRx};
use embassy_stm32::{Peri, bind_interrupts, interrupt, pac, rcc};
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Timer};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeConstants, SenseScale};
use motor_hub::hub::Hub;
use motor_hub::motor::Settings;
use motor_hub::protocol::Address;
use motor_hub::record::Fault;
use motor_hub::responder::Responder;
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::store::Keeper;
use motor_hub::tasks::update::Slots;
use motor_hub::tasks::{self, Health, Task};
use motor_hub::units::Period;
use motor_hub::update::Slot;
use motor_hub_stm32::diag::DiagLines;
use motor_hub_stm32::encoders::{Counter, QuadratureCounters};
use motor_hub_stm32::faults::End;
use motor_hub_stm32::lamp::Lamp;
use motor_hub_stm32::pins::DigitalLines;
use motor_hub_stm32::vnh5019::{Pwm, Vnh5019};
use motor_hub_stm32::watchdog::IndependentWatchdog;
use motor_hub_stm32::{demo, record, serial, status};
use static_cell::StaticCell;

/// Motors on this board.
const MOTORS: usize = 4;

/// Digital pins for a host.
const PINS: usize = 2;

/// Divider from the battery to PA3: 24 V, the highest that the bridges take, makes 2.61 V, and 30.3 V the full 3.3 V.
const DIVIDER_OHMS: (u32, u32) = (82_000, 10_000);

/// A part of a bank.
type Part = Partition<'static, ThreadModeRawMutex, Bank<Timer>>;

/// How often the end of an operation of the flash is looked for: a word takes 0.1 to 0.3 ms.
const FLASH_PAUSE: Duration = Duration::from_micros(200);

/// A bootloader starts this image, and others like it.
const HAS_BOOTLOADER: bool = cfg!(feature = "bootloader");

/// Where it starts them from.
const SLOT: Slot = Slot {
    origin: layout::ORIGIN,
    length: layout::ACTIVE.end - layout::ACTIVE.start,
    ram: (layout::RAM.start, layout::RAM.end),
    signer: SIGNER,
};

/// Who signs images, if they must be signed.
#[cfg(not(feature = "signed"))]
const SIGNER: Option<[u8; 32]> = None;
#[cfg(feature = "signed")]
const SIGNER: Option<[u8; 32]> = match motor_hub::update::public_key(include_bytes!(env!("UPDATE_KEY"))) {
    None => panic!("UPDATE_KEY is no public key of Ed25519 in DER: openssl pkey -pubout -outform DER"),
    key => key,
};

/// The control period: 50 ms, or what `CONTROL_PERIOD_MS` says when this is built, 1 to 100.
const PERIOD: Period = motor_hub_stm32::period(option_env!("CONTROL_PERIOD_MS"));

/// Every task runs in the one executor in thread mode, so no channel needs to mask interrupts.
type Wires = tasks::Wires<ThreadModeRawMutex, MOTORS>;

static WIRES: Wires = Wires::new();
static HEALTH: Health = Health::new().expecting(Task::Responder).expecting(Task::Bridges);

type Encoders = QuadratureCounters<(Counter<TIM2>, Counter<TIM3>, Counter<TIM4>, Counter<TIM8>)>;

bind_interrupts!(struct Irqs {
    USART3 => BufferedInterruptHandler<USART3>;
});

const END: End = End { open: open_all_bridges, say: |fault, detail| WIRES.report_crash(fault, detail) };

motor_hub_stm32::end_faults_with!(END);

/// Opens all bridges for good, from any context: PWM low first, then all direction lines, PD0 to PD7.
///
/// PWM stays off until a reset, whatever is applied afterwards.
fn open_all_bridges() {
    // Without its clock it drives nothing, and an access would be a fault of its own.
    if pac::RCC.apb2enr().read().tim1en() {
        pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    }
    pac::GPIOD.bsrr().write(|w| (0..8).for_each(|pin| w.set_br(pin, true)));
}

#[interrupt]
fn PVD_AVD() {
    END.supply_fell()
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let p = embassy_stm32::init(chip::clocks());
    chip::set_up();
    info!("motor-hub {=str} on nucleo-h743zi2", env!("CARGO_PKG_VERSION"));
    // Before anything else that could hang, and before a bridge can be anything but open.
    let watchdog = IndependentWatchdog::start(p.IWDG1);
    info!("{=u32} Hz, {} motors every {=u32} ms", rcc::frequency::<TIM1>().0, MOTORS, PERIOD.as_millis());
    let cause = chip::reset_cause();
    let memory = unwrap!(record::memory());
    if cause == Fault::PowerOn {
        // RAM has an error code here, which is of nothing until it is written: better not read.
        memory.fill(0);
    }
    WIRES.open_record(memory, cause);
    chip::watch_supply();

    let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
    let pwm = Pwm::new(p.TIM1);
    let bridges = [
        pwm.bridge(p.PE9, low(p.PD0.into()), low(p.PD1.into())),
        pwm.bridge(p.PE11, low(p.PD2.into()), low(p.PD3.into())),
        pwm.bridge(p.PE13, low(p.PD4.into()), low(p.PD5.into())),
        pwm.bridge(p.PE14, low(p.PD6.into()), low(p.PD7.into())),
    ];
    let bridges = Vnh5019::new(pwm, bridges);
    let encoders = QuadratureCounters((
        Counter::new(p.TIM2, p.PA15, p.PB3),
        Counter::new(p.TIM3, p.PB4, p.PB5),
        Counter::new(p.TIM4, p.PD12, p.PD13),
        Counter::new(p.TIM8, p.PC6, p.PC7),
    ));
    let diag = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let diag = DiagLines([diag(p.PE2.into()), diag(p.PE4.into()), diag(p.PE5.into()), diag(p.PE6.into())]);
    let adc = unwrap!(BatteryAdc::new(p.ADC1, p.ADC3, p.PA3, DIVIDER_OHMS));
    let lines = CurrentLines::new(p.ADC2, (p.PC0, p.PB1, p.PA6, p.PA5), SenseScale::VNH5019_CARRIER);
    // These bridges are real.
    let settings = Settings { bridge: BridgeConstants::VNH5019, ..Settings::new(Winding::NEVEREST_60) };

    spawner.spawn(unwrap!(output(bridges)));
    spawner.spawn(unwrap!(listen(diag, lines)));
    spawner.spawn(unwrap!(capture(encoders)));
    spawner.spawn(unwrap!(supply(adc, Supply::new(Limits::default()))));
    spawner.spawn(unwrap!(control(settings)));
    spawner.spawn(unwrap!(health(watchdog)));
    spawner.spawn(unwrap!(report()));
    static BUFFERS: StaticCell<serial::Buffers> = StaticCell::new();
    let buffers = BUFFERS.init(serial::Buffers::new());
    let (tx, rx) = unwrap!(serial::open(p.USART3, p.PD8, p.PD9, Irqs, buffers));
    let lamp = Lamp { red: low(p.PB14.into()), green: low(p.PB0.into()), blue: low(p.PE1.into()) };
    let pins = DigitalLines::new([Flex::new(p.PF14), Flex::new(p.PF15)]);
    static BANKS: StaticCell<[Mutex<ThreadModeRawMutex, Bank<Timer>>; 2]> = StaticCell::new();
    let [first, second] = BANKS.init(Bank::both(p.FLASH, || Timer::after(FLASH_PAUSE)).map(Mutex::new));
    let part = |at: Range<u32>| Part::new(second, at.start, at.end - at.start);
    let keeper = Keeper::new(part(layout::STORE), 0..layout::STORE.end - layout::STORE.start);
    let has_store = keeper.is_some();
    if let Some(keeper) = keeper {
        spawner.spawn(unwrap!(store(keeper)));
    }
    let booted = Part::new(first, layout::ACTIVE.start, layout::ACTIVE.end - layout::ACTIVE.start);
    let slots = Slots::new(booted, part(layout::DOWNLOAD), part(layout::STATE));
    if HAS_BOOTLOADER && let Some(slots) = slots {
        spawner.spawn(unwrap!(update(slots)));
    }
    spawner.spawn(unwrap!(responder(rx, tx, pins, lamp, settings, has_store)));
    spawner.spawn(unwrap!(button(Input::new(p.PC13, Pull::None))));
}

#[embassy_executor::task]
async fn capture(encoders: Encoders) -> ! {
    tasks::capture::run(encoders, &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn listen(diag: DiagLines<MOTORS>, lines: CurrentLines) -> ! {
    lines.calibrate().await;
    tasks::bridges::run(diag, lines, &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn supply(adc: BatteryAdc, supply: Supply) -> ! {
    adc.calibrate().await;
    tasks::supply::run(adc, supply, &WIRES, &HEALTH).await
}

/// Makes the hub itself: as an argument of two nested futures it would take twice the RAM.
#[embassy_executor::task]
async fn control(settings: Settings) -> ! {
    tasks::control::run(&mut Hub::new([settings; MOTORS], PERIOD), &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn output(bridges: Vnh5019<TIM1, MOTORS>) -> ! {
    tasks::output::run(bridges, PERIOD, &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn health(watchdog: IndependentWatchdog<IWDG1>) -> ! {
    tasks::health::run(watchdog, &HEALTH).await
}

#[embassy_executor::task]
async fn report() -> ! {
    status::run(&WIRES).await
}

/// Ends only if the serial line does, which it never does.
#[embassy_executor::task]
async fn responder(
    rx: BufferedUartRx<'static>,
    tx: serial::Sender,
    pins: DigitalLines<PINS>,
    mut lamp: Lamp,
    settings: Settings,
    has_store: bool,
) {
    let mut responder = Responder::new(Address::DEFAULT, [settings; MOTORS]);
    if has_store {
        responder = responder.expecting_store();
    }
    if HAS_BOOTLOADER {
        responder = responder.with_slot(SLOT);
    }
    // The lamp is shown at least every 100 ms, whatever the line does.
    let show = |colour| {
        lamp.show(colour);
        HEALTH.check_in(Task::Responder);
    };
    tasks::responder::run(rx, tx, pins, &mut responder, &WIRES, show).await;
}

#[embassy_executor::task]
async fn store(keeper: Keeper<Part>) -> ! {
    tasks::store::run(keeper, &WIRES).await
}

#[embassy_executor::task]
async fn update(slots: Slots<Part, Part, Part>) -> ! {
    tasks::update::run(slots, &WIRES, &HEALTH, || cortex_m::peripheral::SCB::sys_reset()).await
}

#[embassy_executor::task]
async fn button(button: Input<'static>) -> ! {
    demo::run(button, &WIRES).await
}
