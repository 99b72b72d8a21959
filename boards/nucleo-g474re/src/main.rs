//! A motor hub for four motors on a NUCLEO-G474RE: the pins, the peripherals, and one line per task.
//!
//! All decisions are in `motor_hub`, all drivers that other STM32 share in `motor_hub_stm32`. Wiring, sizes and
//! how to flash are in the README beside it.
#![no_std]
#![no_main]

mod adc;
mod chip;

use adc::BatteryAdc;
use defmt::{info, unwrap};
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{AnyPin, Flex, Input, Level, Output, Pull, Speed};
use embassy_stm32::peripherals::{IWDG, LPUART1, TIM1, TIM2, TIM3, TIM4, TIM8};
use embassy_stm32::usart::{BufferedInterruptHandler, BufferedUartRx};
use embassy_stm32::{Peri, bind_interrupts, interrupt, pac, rcc};
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use motor_hub::braking::Winding;
use motor_hub::bridge::BridgeConstants;
use motor_hub::hub::Hub;
use motor_hub::motor::Settings;
use motor_hub::protocol::Address;
use motor_hub::responder::Responder;
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::{self, Health, Task};
use motor_hub::units::Period;
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

/// Divider from the battery to PA0: 24 V, the highest that the bridges take, makes 2.61 V, and 30.3 V the full 3.3 V.
const DIVIDER_OHMS: (u32, u32) = (82_000, 10_000);

/// The control period: 50 ms, or what `CONTROL_PERIOD_MS` says when this is built, 1 to 100.
const PERIOD: Period = motor_hub_stm32::period(option_env!("CONTROL_PERIOD_MS"));

/// Every task runs in the one executor in thread mode, so no channel needs to mask interrupts.
type Wires = tasks::Wires<ThreadModeRawMutex, MOTORS>;

static WIRES: Wires = Wires::new();
static HEALTH: Health = Health::new().expecting(Task::Responder).expecting(Task::Bridges);

type Encoders = QuadratureCounters<(Counter<TIM2>, Counter<TIM3>, Counter<TIM4>, Counter<TIM8>)>;

bind_interrupts!(struct Irqs {
    LPUART1 => BufferedInterruptHandler<LPUART1>;
});

const END: End = End { open: open_all_bridges, say: |fault, detail| WIRES.report_crash(fault, detail) };

motor_hub_stm32::end_faults_with!(END);

/// Opens all bridges for good, from any context: PWM low first, then all direction lines, PB0 to PB2, PB10, and PC0 to
/// PC3.
///
/// PWM stays off until a reset, whatever is applied afterwards.
fn open_all_bridges() {
    // Without its clock it drives nothing, and an access would be a fault of its own.
    if pac::RCC.apb2enr().read().tim1en() {
        pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    }
    pac::GPIOB.bsrr().write(|w| [0, 1, 2, 10].into_iter().for_each(|pin| w.set_br(pin, true)));
    pac::GPIOC.bsrr().write(|w| (0..4).for_each(|pin| w.set_br(pin, true)));
}

#[interrupt]
fn PVD_PVM() {
    END.supply_fell()
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let p = embassy_stm32::init(chip::clocks());
    chip::set_up();
    info!("motor-hub {=str} on nucleo-g474re", env!("CARGO_PKG_VERSION"));
    // Before anything else that could hang, and before a bridge can be anything but open.
    let watchdog = IndependentWatchdog::start(p.IWDG);
    info!("{=u32} Hz, {} motors every {=u32} ms", rcc::frequency::<TIM1>().0, MOTORS, PERIOD.as_millis());
    let cause = chip::reset_cause();
    WIRES.open_record(unwrap!(record::memory()), cause);
    chip::watch_supply();

    let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
    let pwm = Pwm::new(p.TIM1);
    let bridges = [
        pwm.bridge(p.PA8, low(p.PC0.into()), low(p.PC1.into())),
        pwm.bridge(p.PA9, low(p.PC2.into()), low(p.PC3.into())),
        pwm.bridge(p.PA10, low(p.PB0.into()), low(p.PB1.into())),
        pwm.bridge(p.PA11, low(p.PB2.into()), low(p.PB10.into())),
    ];
    let bridges = Vnh5019::new(pwm, bridges);
    let encoders = QuadratureCounters((
        Counter::new(p.TIM2, p.PA15, p.PB3),
        Counter::new(p.TIM3, p.PB4, p.PB5),
        Counter::new(p.TIM4, p.PB6, p.PB7),
        Counter::new(p.TIM8, p.PC6, p.PC7),
    ));
    let diag = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let diag =
        DiagLines([diag(p.PB11.into()), diag(p.PB12.into()), diag(p.PB13.into()), diag(p.PB14.into())]);
    let adc = unwrap!(BatteryAdc::new(p.ADC1, p.ADC3, p.PA0, DIVIDER_OHMS));
    // These bridges are real.
    let settings = Settings { bridge: BridgeConstants::VNH5019, ..Settings::new(Winding::NEVEREST_60) };

    spawner.spawn(unwrap!(output(bridges)));
    spawner.spawn(unwrap!(listen(diag)));
    spawner.spawn(unwrap!(capture(encoders)));
    spawner.spawn(unwrap!(supply(adc, Supply::new(Limits::default()))));
    spawner.spawn(unwrap!(control(settings)));
    spawner.spawn(unwrap!(health(watchdog)));
    spawner.spawn(unwrap!(report()));
    static BUFFERS: StaticCell<serial::Buffers> = StaticCell::new();
    let buffers = BUFFERS.init(serial::Buffers::new());
    let (tx, rx) = unwrap!(serial::open(p.LPUART1, p.PA2, p.PA3, Irqs, buffers));
    let lamp = Lamp { red: low(p.PC10.into()), green: low(p.PA5.into()), blue: low(p.PC11.into()) };
    let pins = DigitalLines::new([Flex::new(p.PC8), Flex::new(p.PC9)]);
    spawner.spawn(unwrap!(responder(rx, tx, pins, lamp, settings)));
    spawner.spawn(unwrap!(button(Input::new(p.PC13, Pull::None))));
}

#[embassy_executor::task]
async fn capture(encoders: Encoders) -> ! {
    tasks::capture::run(encoders, &WIRES, &HEALTH).await
}

/// Faults only: the current-sense outputs are not connected here.
#[embassy_executor::task]
async fn listen(diag: DiagLines<MOTORS>) -> ! {
    tasks::bridges::run(diag, (), &WIRES, &HEALTH).await
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
async fn health(watchdog: IndependentWatchdog<IWDG>) -> ! {
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
) {
    let mut responder = Responder::new(Address::DEFAULT, [settings; MOTORS]);
    // The lamp is shown at least every 100 ms, whatever the line does.
    let show = |colour| {
        lamp.show(colour);
        HEALTH.check_in(Task::Responder);
    };
    tasks::responder::run(rx, tx, pins, &mut responder, &WIRES, show).await;
}

#[embassy_executor::task]
async fn button(button: Input<'static>) -> ! {
    demo::run(button, &WIRES).await
}
