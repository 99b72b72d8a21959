//! A timer that makes the pulses of one servo: TIM9 to TIM14 of the STM32F427, which the emulator lacks, and TIM12 to TIM17
//! of the STM32H743, whose pins the emulator does not show.
//!
//! The model counts up, with its auto-reload and compare registers preloaded, in PWM mode 1 (RM0090 19.3, RM0433 40.3
//! and 41.3). Each pulse on the pin is noted with its time. A start of the timer without preloads or in another mode is
//! reported to the session as a gap of the emulator, and a gap fails the test.

use std::time::Duration;

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::RegisterSpec;
use rigless::time::{EventId, VirtualNanos};

use super::Row;

// Offsets of registers (RM0090 19.4.13 and 19.5.12).
const CR1: u32 = 0x00;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;
const BDTR: u32 = 0x44;

// CR1: counter enable, update disable, auto-reload preload.
const CEN: u64 = 1;
const UDIS: u64 = 1 << 1;
const ARPE: u64 = 1 << 7;
/// EGR: update generation.
const UG: u64 = 1;
/// BDTR: main output enable.
const MOE: u64 = 1 << 15;
/// CCMR1: OCxM = 110 is PWM mode 1, with OCxPE.
const PWM_MODE_1: u64 = 0b110 << 4 | 1 << 3;
const MODE_MASK: u64 = 0b111 << 4 | 1 << 3 | 0b11;

const SECOND: u128 = 1_000_000_000;

/// A pulse on the pin of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoPulse {
    /// Time at which the pin rose.
    pub at: Duration,
    /// Time for which the pin was high.
    pub high: Duration,
}

/// The timer of a servo, and the pulses on its pin.
#[derive(Debug)]
pub(super) struct ServoTimer<B> {
    /// Name of the timer on the emulator's bus.
    pub(super) name: &'static str,
    /// The bus from which the timer has its clock.
    pub(super) bus: B,
    /// Clock of the timer, Hz.
    pub(super) hz: u64,
    table: &'static [RegisterSpec],
    /// All pulses so far that have ended.
    pub(super) pulses: Vec<ServoPulse>,
    /// True if the pin belongs to channel 2, otherwise to channel 1.
    second_channel: bool,
    /// Prescaler, auto-reload and compare values in use.
    used: [u64; 3],
    /// Time at which the present period began, ns.
    frame: u64,
    next: Option<EventId>,
    /// True if the pin falls at the next event; otherwise a period ends.
    falls: bool,
    /// Time in ns at which the pin rose. `None` while the pin is low.
    rose: Option<u64>,
}

impl<B> ServoTimer<B> {
    /// Creates a timer with these registers. `channel` is the channel of the pin, 1 or 2.
    pub(super) const fn new(name: &'static str, bus: B, table: &'static [RegisterSpec], channel: u8) -> Self {
        Self {
            name,
            bus,
            hz: 0,
            table,
            pulses: Vec::new(),
            second_channel: channel == 2,
            used: [0; 3],
            frame: 0,
            next: None,
            falls: false,
            rose: None,
        }
    }

    /// Resets the timer at the time `at`, ns. A reset ends a pulse.
    pub(super) fn reset_at(&mut self, at: u64) {
        self.drive(at, false);
        Device::reset(self);
    }

    fn register(&self, offset: u32, registers: &RegisterFile) -> Option<u64> {
        let row = self.table.iter().position(|register| register.offset == offset)?;
        Some(registers.get(Row(row)))
    }

    fn get(&self, offset: u32, registers: &RegisterFile) -> u64 {
        self.register(offset, registers).unwrap_or_default()
    }

    /// True if the channel drives its pin. Timers with a BDTR also need its main output enabled.
    fn enabled(&self, registers: &RegisterFile) -> bool {
        let bit = if self.second_channel { 1 << 4 } else { 1 };
        self.get(CCER, registers) & bit != 0
            && self.register(BDTR, registers).is_none_or(|bdtr| bdtr & MOE != 0)
    }

    /// Returns the time in ns at which `ticks` of the present period have passed.
    fn after(&self, ticks: u64) -> u64 {
        let clocks = u128::from(ticks) * u128::from(self.used[0] + 1);
        self.frame + (clocks * SECOND / u128::from(self.hz.max(1))) as u64
    }

    fn drive(&mut self, at: u64, high: bool) {
        if high {
            self.rose.get_or_insert(at);
        } else if let Some(rose) = self.rose.take() {
            let [at, high] = [rose, at - rose].map(Duration::from_nanos);
            self.pulses.push(ServoPulse { at, high });
        }
    }

    fn load(&mut self, registers: &RegisterFile) {
        let compare = if self.second_channel { CCR2 } else { CCR1 };
        self.used = [PSC, ARR, compare].map(|offset| self.get(offset, registers));
    }

    /// Begins a period at this time, ns.
    fn begin(&mut self, at: u64, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        self.frame = at;
        let [_, reload, compare] = self.used;
        if self.get(CR1, registers) & CEN == 0 || reload == 0 {
            self.next = None;
            return;
        }
        let high = self.enabled(registers) && compare > 0;
        self.drive(at, high);
        self.falls = high && compare <= reload;
        let ticks = if self.falls { compare } else { reload + 1 };
        self.next = Some(context.schedule(VirtualNanos(self.after(ticks))));
    }
}

impl<B> Device for ServoTimer<B> {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }

    fn write(
        &mut self,
        Row(row): Row,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now().0;
        let running = self.next.is_some();
        match self.table[row].offset {
            EGR if value & UG != 0 => {
                self.load(registers);
                self.begin(now, registers, context);
            }
            CR1 if value & CEN != 0 && !running => {
                let mode = self.get(CCMR1, registers) >> if self.second_channel { 8 } else { 0 };
                if value & ARPE == 0 || mode & MODE_MASK != PWM_MODE_1 {
                    context.tell("CR1", "a servo's timer is modelled in PWM mode 1 with preloads only");
                }
                self.begin(now, registers, context);
            }
            CR1 if value & CEN == 0 => self.next = None,
            CCER | BDTR if !self.enabled(registers) => self.drive(now, false),
            _ => {}
        }
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.next != Some(event) {
            return;
        }
        let now = context.now().0;
        if self.falls {
            self.falls = false;
            self.drive(now, false);
            self.next = Some(context.schedule(VirtualNanos(self.after(self.used[1] + 1))));
            return;
        }
        let end = self.after(self.used[1] + 1);
        if self.get(CR1, registers) & UDIS == 0 {
            self.load(registers);
        }
        self.begin(end, registers, context);
    }

    fn reset(&mut self) {
        (self.used, self.next, self.falls) = ([0; 3], None, false);
    }
}
