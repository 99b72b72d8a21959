//! A motor hub for four motors on a NUCLEO-G474RE: pins and peripherals.
//!
//! All decisions are in `motor_hub`. `motor_hub_stm32` has the program and the drivers. Wiring, sizes and flashing are in the
//! README.
#![no_std]
#![no_main]

use defmt::unwrap;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::peripherals::LPUART1;
use embassy_stm32::usart::BufferedInterruptHandler;
use embassy_stm32::{bind_interrupts, pac};
use motor_hub_stm32::bridge_faults::{DiagLines, line};
use motor_hub_stm32::chip;
use motor_hub_stm32::chip::adc::{self, BatteryAdc};
use motor_hub_stm32::connectors::Connectors;
use motor_hub_stm32::encoders::{Counter, QuadratureCounters};
use motor_hub_stm32::lamp::Lamp;
use motor_hub_stm32::pins::{DigitalLines, low};
use motor_hub_stm32::vnh5019::{Pwm, Vnh5019};
use motor_hub_stm32::{early_start, pins, serial};
use static_cell::ConstStaticCell;

motor_hub_stm32::hub! {
    motors: 4,
    pins: 2,
    servos: 0,
    pwm: TIM1, tim1en,
    directions: { GPIOB: [0, 1, 2, 10], GPIOC: 0..4 },
    encoders: [TIM2, TIM3, TIM4, TIM8],
    watchdog: IWDG,
    detector: PVD_PVM, cr2,
    battery: BatteryAdc,
    sensors: DiagLines<4>,
    slot: None,
}

bind_interrupts!(struct Irqs {
    LPUART1 => BufferedInterruptHandler<LPUART1>;
});

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    pac::RCC.ahb2enr().modify(|w| w.set_gpiocen(true));
    // PC10 is the red lamp.
    early_start::before_clocks(pac::IWDG, pac::GPIOC, 10);
    let p = embassy_stm32::init(chip::clocks());
    chip::set_up();
    // `before_clocks` has started the watchdog. Its time-out is set here, while all bridges are still open.
    let watchdog = begin(p.IWDG);

    static BUFFERS: ConstStaticCell<serial::Buffers> = ConstStaticCell::new(serial::Buffers::EMPTY);
    let pwm = Pwm::new(p.TIM1);
    chip::break_pwm();
    let bridges = [
        pwm.bridge(p.PA8, low(p.PC0), low(p.PC1)),
        pwm.bridge(p.PA9, low(p.PC2), low(p.PC3)),
        pwm.bridge(p.PA10, low(p.PB0), low(p.PB1)),
        pwm.bridge(p.PA11, low(p.PB2), low(p.PB10)),
    ];
    let line_to_host = unwrap!(serial::open(p.LPUART1, p.PA2, p.PA3, Irqs, BUFFERS.take(), None));
    let parts = Parts {
        watchdog,
        bridges: Vnh5019::new(pwm, bridges),
        encoders: QuadratureCounters((
            Counter::new(p.TIM2, p.PA15, p.PB3),
            Counter::new(p.TIM3, p.PB4, p.PB5),
            Counter::new(p.TIM4, p.PB6, p.PB7),
            Counter::new(p.TIM8, p.PC6, p.PC7),
        )),
        sensors: DiagLines([line(p.PB11), line(p.PB12), line(p.PB13), line(p.PB14)]),
        battery: unwrap!(adc::battery((p.ADC1, p.ADC3), p.PA0)),
        link: serial::host_link(line_to_host, None),
        lamp: Lamp { red: low(p.PC10), green: low(p.PA5), blue: low(p.PC11) },
        connectors: Connectors {
            digital: DigitalLines::new(pins!(p.PC8, p.PC9)),
            servos: [],
            analog: None,
            i2c: 0,
        },
        button: Input::new(p.PC13, Pull::Down),
    };
    start(spawner, parts);
}
