//! A motor hub for four motors on a NUCLEO-H743ZI2: pins and peripherals.
//!
//! All decisions are in `motor_hub`. `motor_hub_stm32` has the program and the drivers. Wiring, sizes and flashing are in the
//! README.
#![no_std]
#![no_main]

use boot_h743zi2::{Bank, SIGNER, execute_first_bank_only, layout};
use core::ops::Range;
use defmt::unwrap;
use embassy_embedded_hal::flash::partition::Partition;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Flex, Input, Pull};
use embassy_stm32::peripherals::{I2C1, I2C2, I2C3, I2C4, UART5, USART3, USART6};
use embassy_stm32::usart::BufferedInterruptHandler;
use embassy_stm32::{bind_interrupts, pac};
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Timer};
use motor_hub::tasks::store::Keeper;
use motor_hub::tasks::{self, update::Slots};
use motor_hub::update::Slot;
use motor_hub_stm32::bridge_faults::{DiagLines, line};
use motor_hub_stm32::chip::adc::{self, BatteryAdc};
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
use static_cell::{ConstStaticCell, StaticCell};

/// A part of a bank.
type Part = Partition<'static, ThreadModeRawMutex, Bank<Timer>>;

/// Time between two checks of a busy flash. The write of a word takes 0.1 to 0.3 ms.
const FLASH_PAUSE: Duration = Duration::from_micros(200);

/// The slot from which the bootloader starts this image. `None` without a bootloader.
const SLOT: Option<Slot> = if cfg!(feature = "bootloader") {
    Some(Slot {
        origin: layout::ORIGIN,
        length: layout::ACTIVE.end - layout::ACTIVE.start,
        ram: (layout::RAM.start, layout::RAM.end),
        signer: SIGNER,
    })
} else {
    None
};

motor_hub_stm32::hub! {
    motors: 4,
    pins: 8,
    servos: 6,
    i2c: [i2c::Bus; 4],
    pwm: TIM1, tim1en,
    directions: { GPIOD: 0..8 },
    encoders: [TIM2, TIM3, TIM4, TIM8],
    watchdog: IWDG1,
    detector: PVD_AVD, cr1,
    battery: BatteryAdc,
    sensors: CurrentLines<4>,
    slot: SLOT,
    store: Part,
    chain: serial::Line,
}

bind_interrupts!(struct Irqs {
    USART3 => BufferedInterruptHandler<USART3>;
    USART6 => BufferedInterruptHandler<USART6>;
    UART5 => BufferedInterruptHandler<UART5>;
});

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    pac::RCC.ahb4enr().modify(|w| w.set_gpioben(true));
    // PB14 is the red lamp.
    early_start::before_clocks(pac::IWDG1, pac::GPIOB, 14);
    let mut p = embassy_stm32::init(chip::clocks());
    chip::set_up(execute_first_bank_only);
    // `before_clocks` has started the watchdog. Its time-out is set here, while all bridges are still open.
    let watchdog = begin(p.IWDG1);

    static BUFFERS: ConstStaticCell<[serial::Buffers; 3]> = ConstStaticCell::new([serial::Buffers::EMPTY; 3]);
    let [first, second, third] = BUFFERS.take();
    let pwm = Pwm::new(p.TIM1);
    chip::break_pwm();
    let bridges = [
        pwm.bridge(p.PE9, low(p.PD0), low(p.PD1)),
        pwm.bridge(p.PE11, low(p.PD2), low(p.PD3)),
        pwm.bridge(p.PE13, low(p.PD4), low(p.PD5)),
        pwm.bridge(p.PE14, low(p.PD6), low(p.PD7)),
    ];
    static BANKS: StaticCell<[Mutex<ThreadModeRawMutex, Bank<Timer>>; 2]> = StaticCell::new();
    let [first_bank, second_bank] =
        BANKS.init(Bank::both(p.FLASH, || Timer::after(FLASH_PAUSE)).map(Mutex::new));
    let part = |at: Range<u32>| Part::new(second_bank, at.start, at.end - at.start);
    let booted = Part::new(first_bank, layout::ACTIVE.start, layout::ACTIVE.end - layout::ACTIVE.start);
    let analog_inputs =
        analog::Pins::new(channels!(p.PF3, p.PF4, p.PF5, p.PF10), (Flex::new(p.PC2), analog::PC2_C));
    let parts = Parts {
        watchdog,
        bridges: Vnh5019::new(pwm, bridges),
        encoders: QuadratureCounters((
            Counter::new(p.TIM2, p.PA15, p.PB3),
            Counter::new(p.TIM3, p.PB4, p.PB5),
            Counter::new(p.TIM4, p.PD12, p.PD13),
            Counter::new(p.TIM8, p.PC6, p.PC7),
        )),
        battery: unwrap!(adc::battery((p.ADC1, p.ADC3), p.PA3, analog_inputs)),
        sensors: CurrentLines::new(
            p.ADC2,
            channels!(p.PC0, p.PB1, p.PA6, p.PA5),
            DiagLines([line(p.PE2), line(p.PE4), line(p.PE3), line(p.PE6)]),
        ),
        link: serial::host_link(
            unwrap!(serial::open(p.USART3, p.PD8, p.PD9, Irqs, first, None)),
            Some(unwrap!(serial::open(p.USART6, p.PG14, p.PG9, Irqs, second, None))),
        ),
        chain: serial::has_transceiver(p.PB12.reborrow())
            .then(|| unwrap!(serial::open_with_driver_enable(p.UART5, p.PC12, p.PB12, p.PC8, Irqs, third))),
        lamp: Lamp { red: low(p.PB14), green: low(p.PB0), blue: low(p.PE1) },
        connectors: Connectors {
            digital: DigitalLines::new(pins!(p.PF14, p.PF15, p.PE7, p.PE8, p.PE10, p.PE12, p.PE15, p.PE0)),
            servos: [
                Servo::new(p.TIM16, p.PF6),
                Servo::new(p.TIM17, p.PF7),
                Servo::new(p.TIM13, p.PF8),
                Servo::new(p.TIM14, p.PF9),
                Servo::new(p.TIM12, p.PB15),
                Servo::new(p.TIM15, p.PE5),
            ],
            analog: Some(analog::read),
            i2c: 4,
        },
        buses: [
            Bus::new::<I2C1>(i2c::i2c1(), p.PB8, p.PB9),
            Bus::new::<I2C2>(i2c::i2c2(), p.PF1, p.PF0),
            Bus::new::<I2C3>(i2c::i2c3(), p.PA8, p.PC9),
            Bus::new::<I2C4>(i2c::i2c4(), p.PB6, p.PB7),
        ],
        button: Input::new(p.PC13, Pull::Down),
        store: Keeper::new(part(layout::STORE), 0..layout::STORE.end - layout::STORE.start),
    };
    let slots = Slots::new(booted, part(layout::DOWNLOAD), part(layout::STATE));
    if SLOT.is_some()
        && let Some(slots) = slots
    {
        spawner.spawn(unwrap!(update(slots)));
    }
    start(spawner, parts);
}

#[embassy_executor::task]
async fn update(slots: Slots<Part, Part, Part>) -> ! {
    tasks::update::run(slots, &WIRES, &HEALTH, || cortex_m::peripheral::SCB::sys_reset()).await
}
