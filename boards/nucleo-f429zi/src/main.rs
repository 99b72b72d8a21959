//! A motor hub for four motors on a NUCLEO-F429ZI: pins and peripherals.
//!
//! All decisions are in `motor_hub`. `motor_hub_stm32` has the program and the drivers. Wiring, sizes and flashing are in the
//! README.
#![no_std]
#![no_main]

use defmt::unwrap;
use embassy_executor::Spawner;
use embassy_stm32::flash::{self, Async, Bank2Region1, Flash};
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt::typelevel;
use embassy_stm32::peripherals::{I2C1, I2C2, I2C3, UART4, USART3, USART6};
use embassy_stm32::usart::BufferedInterruptHandler;
use embassy_stm32::{bind_interrupts, pac};
use motor_hub::tasks::store::Keeper;
use motor_hub_stm32::bridge_faults::{DiagLines, line};
use motor_hub_stm32::chip::adc::BatteryAdc;
use motor_hub_stm32::chip::current::CurrentLines;
use motor_hub_stm32::chip::{self, analog, i2c};
use motor_hub_stm32::connectors::Connectors;
use motor_hub_stm32::encoders::{Counter, QuadratureCounters};
use motor_hub_stm32::i2c_bus::Bus;
use motor_hub_stm32::lamp::Lamp;
use motor_hub_stm32::pins::{DigitalLines, low};
use motor_hub_stm32::servo::Servo;
use motor_hub_stm32::vnh5019::{Pwm, Vnh5019};
use motor_hub_stm32::{channels, early_start, pins, serial};
use static_cell::ConstStaticCell;

/// Range of the stored settings, in bytes from the start of the second bank: its first two sectors. The code is in the
/// first bank, so it continues to run while these sectors are written or erased (RM0090 3.6.5).
const STORE: core::ops::Range<u32> = 0..32 * 1024;

motor_hub_stm32::hub! {
    motors: 4,
    pins: 8,
    servos: 6,
    i2c: [i2c::Bus; 3],
    pwm: TIM1, tim1en,
    // PC12 switches the transceiver of the chain line to sending. A hub with a fault must release the line for the other hubs.
    directions: { GPIOD: 0..8, GPIOC: 12..13 },
    encoders: [TIM2, TIM3, TIM4, TIM8],
    watchdog: IWDG,
    detector: PVD, cr1,
    battery: BatteryAdc,
    sensors: CurrentLines<4>,
    slot: None,
    store: Bank2Region1<'static, Async>,
    chain: serial::Line,
}

motor_hub_stm32::transmission_ends! {
    ST_LINK: USART3;
    ADAPTER: USART6;
    CHAIN: UART4, GPIOC 12;
}

bind_interrupts!(struct Irqs {
    FLASH => flash::InterruptHandler;
    USART3 => TransmissionHandler<typelevel::USART3>, BufferedInterruptHandler<USART3>;
    USART6 => TransmissionHandler<typelevel::USART6>, BufferedInterruptHandler<USART6>;
    UART4 => TransmissionHandler<typelevel::UART4>, BufferedInterruptHandler<UART4>;
});

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    pac::RCC.ahb1enr().modify(|w| w.set_gpioben(true));
    // PB14 is the red lamp.
    early_start::before_clocks(pac::IWDG, pac::GPIOB, 14);
    let mut p = embassy_stm32::init(chip::clocks());
    chip::set_up();
    // `before_clocks` has started the watchdog. Its time-out is set here, while all bridges are still open.
    let watchdog = begin(p.IWDG);

    static BUFFERS: ConstStaticCell<[serial::Buffers; 3]> = ConstStaticCell::new([serial::Buffers::EMPTY; 3]);
    let [first, second, third] = BUFFERS.take();
    let pwm = Pwm::new(p.TIM1);
    let bridges = [
        pwm.bridge(p.PE9, low(p.PD0), low(p.PD1)),
        pwm.bridge(p.PE11, low(p.PD2), low(p.PD3)),
        pwm.bridge(p.PE13, low(p.PD4), low(p.PD5)),
        pwm.bridge(p.PE14, low(p.PD6), low(p.PD7)),
    ];
    // The transceiver drives nothing until the first transmission.
    core::mem::forget(low(p.PC12));
    let region = Flash::new(p.FLASH, Irqs).into_regions().bank2_region1;
    let parts = Parts {
        watchdog,
        bridges: Vnh5019::new(pwm, bridges),
        encoders: QuadratureCounters((
            Counter::new(p.TIM2, p.PA15, p.PB3),
            Counter::new(p.TIM3, p.PB4, p.PB5),
            Counter::new(p.TIM4, p.PD12, p.PD13),
            Counter::new(p.TIM8, p.PC6, p.PC7),
        )),
        battery: unwrap!(BatteryAdc::new(p.ADC1, p.PA3, p.PC2)),
        sensors: CurrentLines::new(
            p.ADC3,
            channels!(p.PC0, p.PC3, p.PF3, p.PF5),
            DiagLines([line(p.PE2), line(p.PE4), line(p.PE3), line(p.PE6)]),
        ),
        link: serial::host_link(
            unwrap!(serial::open(p.USART3, p.PD8, p.PD9, Irqs, first, Some(ST_LINK))),
            Some(unwrap!(serial::open(p.USART6, p.PG14, p.PG9, Irqs, second, Some(ADAPTER)))),
        ),
        chain: serial::has_transceiver(p.PC11.reborrow())
            .then(|| unwrap!(serial::open(p.UART4, p.PC10, p.PC11, Irqs, third, Some(CHAIN)))),
        lamp: Lamp { red: low(p.PB14), green: low(p.PB0), blue: low(p.PB7) },
        connectors: Connectors {
            digital: DigitalLines::new(pins!(p.PF14, p.PF15, p.PE7, p.PE8, p.PE10, p.PE12, p.PE15, p.PE0)),
            servos: [
                Servo::new(p.TIM10, p.PF6),
                Servo::new(p.TIM11, p.PF7),
                Servo::new(p.TIM13, p.PF8),
                Servo::new(p.TIM14, p.PF9),
                Servo::new(p.TIM12, p.PB15),
                Servo::new(p.TIM9, p.PE5),
            ],
            analog: Some(analog::set_up(p.ADC2, channels!(p.PA4, p.PA5, p.PA6, p.PA0), p.PB1)),
            i2c: 3,
        },
        buses: [
            Bus::new::<I2C1>(i2c::i2c1(), p.PB8, p.PB9),
            Bus::new::<I2C2>(i2c::i2c2(), p.PF1, p.PF0),
            Bus::new::<I2C3>(i2c::i2c3(), p.PA8, p.PC9),
        ],
        button: Input::new(p.PC13, Pull::Down),
        store: Keeper::new(region, STORE).filter(|_| chip::reads_second_bank()),
    };
    start(spawner, parts);
}
