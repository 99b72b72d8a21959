//! A motor hub for four motors on a NUCLEO-F429ZI: the pins, the peripherals, and one line per task.
//!
//! All decisions are in `motor_hub`; this crate is what its traits mean on this board. Wiring, sizes
//! and how to flash are in the README beside it.
#![no_std]
#![no_main]

mod adc;
mod bridges;
mod demo;
mod encoders;
mod faults;
mod host;
mod status;
mod watchdog;

use adc::BatteryAdc;
use bridges::Vnh5019;
use defmt::{info, unwrap};
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, Pull, Speed};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{BufferedUartRx, BufferedUartTx};
use embassy_stm32::{Peri, rcc};
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use encoders::QuadratureCounters;
use host::{Lamp, serial};
use motor_hub::braking::Winding;
use motor_hub::hub::Hub;
use motor_hub::motor::Settings;
use motor_hub::protocol::Address;
use motor_hub::responder::Responder;
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::{self, Health, Task};
use motor_hub::units::Period;
use watchdog::IndependentWatchdog;

/// Motors on this board.
const MOTORS: usize = 4;

/// Divider from the battery to PA3: 18 V, the highest plausible battery, makes 3.16 V.
const DIVIDER_OHMS: (u32, u32) = (47_000, 10_000);

/// The control period: 50 ms, or what `CONTROL_PERIOD_MS` says when this is built, 1 to 100.
const PERIOD: Period = {
    let ms = match option_env!("CONTROL_PERIOD_MS") {
        None => 50,
        Some(text) => match u32::from_str_radix(text, 10) {
            Ok(ms) => ms,
            Err(_) => panic!("CONTROL_PERIOD_MS must be a whole number of milliseconds"),
        },
    };
    match Period::from_millis(ms) {
        Ok(period) => period,
        Err(_) => panic!("CONTROL_PERIOD_MS must be 1 to 100"),
    }
};

/// Every task runs in the one executor in thread mode, so no channel needs to mask interrupts.
type Wires = tasks::Wires<ThreadModeRawMutex, MOTORS>;

static WIRES: Wires = Wires::new();
static HEALTH: Health = Health::new().expecting(Task::Responder);

/// 168 MHz from the 8 MHz that the ST-LINK puts on OSC_IN; timers on APB2 run at 168 MHz too.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(rcc::Hse { freq: Hertz(8_000_000), mode: rcc::HseMode::Bypass });
    config.rcc.pll_src = rcc::PllSource::HSE;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: None,
        divr: None,
    });
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let p = embassy_stm32::init(clocks());
    info!("motor-hub {=str} on nucleo-f429zi", env!("CARGO_PKG_VERSION"));
    // Before anything else that could hang, and before a bridge can be anything but open.
    let watchdog = IndependentWatchdog::start(p.IWDG);
    info!(
        "{=u32} Hz, {} motors every {=u32} ms",
        rcc::frequency::<embassy_stm32::peripherals::TIM1>().0,
        MOTORS,
        PERIOD.as_millis()
    );
    status::log_reset_cause();

    let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
    let bridges = Vnh5019::new(
        p.TIM1,
        (p.PE9, p.PE11, p.PE13, p.PE14),
        [
            low(p.PD0.into()),
            low(p.PD1.into()),
            low(p.PD2.into()),
            low(p.PD3.into()),
            low(p.PD4.into()),
            low(p.PD5.into()),
            low(p.PD6.into()),
            low(p.PD7.into()),
        ],
    );
    let encoders = QuadratureCounters::new(
        (p.TIM2, p.PA15, p.PB3),
        (p.TIM3, p.PB4, p.PB5),
        (p.TIM4, p.PD12, p.PD13),
        (p.TIM8, p.PC6, p.PC7),
    );
    let adc = unwrap!(BatteryAdc::new(p.ADC1, p.PA3, DIVIDER_OHMS));
    let settings = Settings::new(Winding::NEVEREST_60);

    spawner.spawn(unwrap!(output(bridges)));
    spawner.spawn(unwrap!(capture(encoders)));
    spawner.spawn(unwrap!(supply(adc, Supply::new(Limits::default()))));
    spawner.spawn(unwrap!(control(settings)));
    spawner.spawn(unwrap!(health(watchdog)));
    spawner.spawn(unwrap!(report()));
    let (tx, rx) = unwrap!(serial(p.USART3, p.PD8, p.PD9));
    let lamp = Lamp { red: low(p.PB14.into()), green: low(p.PB0.into()), blue: low(p.PB7.into()) };
    spawner.spawn(unwrap!(responder(rx, tx, lamp, settings)));
    spawner.spawn(unwrap!(button(Input::new(p.PC13, Pull::None))));
}

#[embassy_executor::task]
async fn capture(encoders: QuadratureCounters) -> ! {
    tasks::capture::run(encoders, &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn supply(adc: BatteryAdc, supply: Supply) -> ! {
    tasks::supply::run(adc, supply, &WIRES, &HEALTH).await
}

/// Makes the hub itself: as an argument of two nested futures it would take twice the RAM.
#[embassy_executor::task]
async fn control(settings: Settings) -> ! {
    tasks::control::run(&mut Hub::new([settings; MOTORS], PERIOD), &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn output(bridges: Vnh5019) -> ! {
    tasks::output::run(bridges, PERIOD, &WIRES, &HEALTH).await
}

#[embassy_executor::task]
async fn health(watchdog: IndependentWatchdog) -> ! {
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
    tx: BufferedUartTx<'static>,
    mut lamp: Lamp,
    settings: Settings,
) {
    let mut responder = Responder::new(Address::DEFAULT, [settings; MOTORS]);
    // The lamp is shown at least every 100 ms, whatever the line does.
    let show = |colour| {
        lamp.show(colour);
        HEALTH.check_in(Task::Responder);
    };
    tasks::responder::run(rx, tx, &mut responder, &WIRES, show).await;
}

#[embassy_executor::task]
async fn button(button: Input<'static>) -> ! {
    demo::run(button, &WIRES).await
}
