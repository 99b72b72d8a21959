//! The pins to which motors, encoders and devices are connected. They are the same on both boards where no function says
//! otherwise. The boards' READMEs have the same tables.
//!
//! Peripherals are numbers in the emulator's lists, or addresses (RM0090 2.3, RM0433 2.3).

use crate::board::Board;

pub(crate) const BRIDGES: usize = 4;

/// Address of TIM1, which makes the PWM.
pub(crate) const PWM_TIMER: u64 = 0x4001_0000;
/// Port E, which has the PWM and the DIAG pins.
pub(crate) const PWM_PORT: usize = 4;
/// PE9, PE11, PE13, PE14: TIM1 CH1 to CH4.
pub(crate) const PWM_PINS: [u8; BRIDGES] = [9, 11, 13, 14];

/// DIAG by bridge, on the same port: PE2, PE4, PE3, PE6.
pub(crate) const DIAG_PINS: [u8; BRIDGES] = [2, 4, 3, 6];

/// Port D, which has INA and INB of all bridges.
pub(crate) const LINE_PORT: usize = 3;
/// Pins of INA and INB of each bridge.
pub(crate) const LINE_PINS: [(u8, u8); BRIDGES] = [(0, 1), (2, 3), (4, 5), (6, 7)];

/// Number of TIM8 among TIM1 and TIM8. TIM8 counts the edges of the last motor's encoder. The first motors have TIM2, TIM3 and TIM4.
pub(crate) const LAST_COUNTER: usize = 1;

/// Address of TIM5, from which embassy takes the time.
pub(crate) const TIME_DRIVER: u64 = 0x4000_0C00;

/// Returns the address of a port's registers.
pub(crate) const fn port_at(board: Board, port: usize) -> u64 {
    let first = match board {
        Board::NucleoF429zi => 0x4002_0000,
        Board::NucleoH743zi2 => 0x5802_0000,
    };
    first + 0x400 * port as u64
}

/// Returns the address of PWR, whose first register switches the voltage detector on.
pub(crate) const fn power_at(board: Board) -> u64 {
    match board {
        Board::NucleoF429zi => 0x4000_7000,
        Board::NucleoH743zi2 => 0x5802_4800,
    }
}

/// Returns the address of RCC_APB2ENR, which switches the clock of TIM1 on (RM0090 6.3.14, RM0433 8.7.44).
pub(crate) const fn pwm_clock_at(board: Board) -> u64 {
    match board {
        Board::NucleoF429zi => 0x4002_3844,
        Board::NucleoH743zi2 => 0x5802_44F0,
    }
}

/// Offset of a port's register IDR.
pub(crate) const IDR: u64 = 0x10;
/// Offset of a port's register ODR.
pub(crate) const ODR: u64 = 0x14;

/// Offset of a timer's status register.
pub(crate) const SR: u64 = 0x10;
/// Offset of a timer's event generation register.
pub(crate) const EGR: u64 = 0x14;

/// Port and pin of button B1: PC13.
pub(crate) const BUTTON: (usize, u8) = (2, 13);

// Numbers of ports.
const A: usize = 0;
const B: usize = 1;
const C: usize = 2;
const E: usize = 4;
const F: usize = 5;

/// Digital pins 0 to 7 of the protocol: port and pin.
pub(crate) const DIGITAL: [(usize, u8); 8] =
    [(F, 14), (F, 15), (E, 7), (E, 8), (E, 10), (E, 12), (E, 15), (E, 0)];

/// Servos 0 to 5: port and pin.
pub(crate) const SERVOS: [(usize, u8); 6] = [(F, 6), (F, 7), (F, 8), (F, 9), (B, 15), (E, 5)];

/// SCL and SDA of I2C buses 0 to 3, which are I2C1 to I2C4. The NUCLEO-F429ZI has the first three.
pub(crate) const BUSES: [[(usize, u8); 2]; 4] =
    [[(B, 8), (B, 9)], [(F, 1), (F, 0)], [(A, 8), (C, 9)], [(B, 6), (B, 7)]];

/// Returns the numbers of three lines in the emulator's list: USART3 and USART6, the host's lines, and the UART of the chain line.
pub(crate) const fn lines(board: Board) -> [usize; 3] {
    match board {
        Board::NucleoF429zi => [2, 3, 6],
        Board::NucleoH743zi2 => [2, 5, 4],
    }
}

/// Index of the chain line in [`lines`].
pub(crate) const CHAIN: usize = 2;

/// Returns port and pin of the input RX of the chain line, which its transceiver drives.
pub(crate) const fn chain_input(board: Board) -> (usize, u8) {
    match board {
        Board::NucleoF429zi => (C, 11),
        Board::NucleoH743zi2 => (B, 12),
    }
}

/// Port and pin with which the F427 switches the transceiver of the chain line to sending. The H743 uses the pin DE of its USART
/// instead, which the emulator does not drive.
pub(crate) const CHAIN_DIRECTION: (usize, u8) = (C, 12);

/// A pin that a converter measures: the number of the converter, and its channel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnalogInput {
    pub(crate) adc: usize,
    pub(crate) channel: u8,
}

/// Returns the pin of the battery's divider: PA3.
pub(crate) const fn battery(board: Board) -> AnalogInput {
    match board {
        Board::NucleoF429zi => AnalogInput { adc: 1, channel: 3 },
        Board::NucleoH743zi2 => AnalogInput { adc: 1, channel: 15 },
    }
}

/// Returns the pins of the current-sense lines by motor: PC0, PC3, PF3 and PF5 of the F427, or PC0, PB1, PA6 and PA5 of the H743.
pub(crate) fn currents(board: Board) -> [AnalogInput; BRIDGES] {
    let (adc, channels) = match board {
        Board::NucleoF429zi => (3, [10, 13, 9, 15]),
        Board::NucleoH743zi2 => (2, [10, 5, 3, 19]),
    };
    channels.map(|channel| AnalogInput { adc, channel })
}

/// Returns the pins of the host's analog inputs, and of the divider of the 5 V rail: PA4, PA5, PA6, PA0 and PB1 of the F427, or PF3,
/// PF4, PF5, PF10 and PC2_C of the H743.
pub(crate) fn analog(board: Board) -> [AnalogInput; 5] {
    let (adc, channels) = match board {
        Board::NucleoF429zi => (2, [4, 5, 6, 0, 9]),
        Board::NucleoH743zi2 => (3, [5, 9, 4, 6, 0]),
    };
    channels.map(|channel| AnalogInput { adc, channel })
}

/// Voltage at the battery's pin divided by the battery voltage. The divider has 82 kohm to the battery and 10 kohm to ground.
pub(crate) const DIVIDER: f64 = 10.0 / 92.0;
