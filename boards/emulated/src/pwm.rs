//! Computes from the registers of TIM1 which waveform the timer puts on each of its four output pins.
//!
//! This is the simple model of the timer. The model needs no events while no register is written, because a waveform is
//! a constant level or a number of high ticks in each period. Section numbers are those of RM0090. The timer of the
//! STM32H743 (RM0433, chapter 38) works in the same way.

pub(crate) const CHANNELS: usize = 4;

const NANOS: u128 = 1_000_000_000;

/// Waveform of a pin until a register is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The pin stays high (true) or low.
    Level(bool),
    /// The pin is high for this number of timer ticks from the beginning of each period.
    Pulse(u32),
}

/// The periods of a running counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Time at which the first period began, ns.
    pub epoch: u64,
    /// Ticks of a period.
    pub ticks: u32,
    /// Ticks per second.
    pub hz: u64,
}

impl Grid {
    /// Returns the tick within a period at the time `at` (ns).
    fn tick(&self, at: u64) -> u32 {
        let ticks = u128::from(at.saturating_sub(self.epoch)) * u128::from(self.hz) / NANOS;
        (ticks % u128::from(self.ticks)) as u32
    }

    /// Returns the time in ns at which the first period after `at` begins.
    fn next_boundary(&self, at: u64) -> u64 {
        let per_boundary = u128::from(self.ticks) * NANOS;
        let passed = u128::from(at.saturating_sub(self.epoch)) * u128::from(self.hz) / per_boundary;
        self.epoch + ((passed + 1) * per_boundary / u128::from(self.hz)) as u64
    }

    /// Returns the length of a period, s.
    pub(crate) fn seconds(&self) -> f64 {
        f64::from(self.ticks) / self.hz as f64
    }
}

/// The registers of the timer that determine its waveforms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registers {
    pub(crate) cr1: u32,
    pub(crate) psc: u32,
    pub(crate) arr: u32,
    pub(crate) bdtr: u32,
    pub(crate) ccer: u32,
    pub(crate) ccmr: [u32; 2],
    pub(crate) ccr: [u32; CHANNELS],
}

impl Registers {
    /// Reads the registers by a function that returns the register at an offset (17.4.21).
    pub(crate) fn read(mut register: impl FnMut(u64) -> u32) -> Self {
        Self {
            cr1: register(0x00),
            psc: register(0x28),
            arr: register(0x2C),
            bdtr: register(0x44),
            ccer: register(0x20),
            ccmr: [0x18, 0x1C].map(&mut register),
            ccr: [0x34, 0x38, 0x3C, 0x40].map(&mut register),
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    mode: u32,
    shadow: u32,
    /// Level of the channel's reference when the mode became "frozen".
    frozen: bool,
}

/// The state of the timer besides its registers: the values in use until the next update event.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timer {
    channels: [Channel; CHANNELS],
    reload: u32,
    /// The periods of the counter. `None` while it does not run.
    pub(crate) running: Option<Grid>,
    /// Time in ns at which the preloaded values take effect.
    pub(crate) update_at: Option<u64>,
}

/// Output compare modes (17.4.7, OCxM).
const FROZEN: u32 = 0;
const FORCE_LOW: u32 = 4;
const PWM_1: u32 = 6;

impl Timer {
    /// Processes the write of a register at the time `at` (ns). `update` is true if the write has set EGR.UG. `hz` is the timer's
    /// clock.
    pub(crate) fn written(&mut self, at: u64, update: bool, registers: &Registers, hz: u64) {
        let was = self.levels(at, registers);
        let control = registers.cr1;
        let buffered_reload = control & (1 << 7) != 0;
        let prescaler = registers.psc + 1;
        if update || !buffered_reload {
            self.reload = registers.arr;
        }
        let ticks = (self.reload + 1) * prescaler;
        let counting = control & 1 != 0;
        if counting && (update || self.running.is_none_or(|grid| grid.ticks != ticks)) {
            self.running = Some(Grid { epoch: at, ticks, hz });
        } else if !counting {
            self.running = None;
        }
        let mut pending = self.reload != registers.arr;
        for (index, (channel, was)) in self.channels.iter_mut().zip(was).enumerate() {
            let (mode, buffered) = output_mode(index, registers);
            let compare = registers.ccr[index];
            if update || !buffered {
                channel.shadow = compare;
            }
            pending |= channel.shadow != compare;
            if mode == FROZEN && channel.mode != FROZEN {
                channel.frozen = was;
            }
            channel.mode = mode;
        }
        self.update_at = self.running.filter(|_| pending).map(|grid| grid.next_boundary(at));
    }

    /// Processes the update event at the time `at` (ns): preloaded values take effect (17.3.2).
    pub(crate) fn update(&mut self, at: u64, registers: &Registers, hz: u64) {
        for (index, channel) in self.channels.iter_mut().enumerate() {
            channel.shadow = registers.ccr[index];
        }
        let reload = registers.arr;
        self.update_at = None;
        if reload != self.reload {
            self.reload = reload;
            let ticks = (reload + 1) * (registers.psc + 1);
            self.running = Some(Grid { epoch: at, ticks, hz });
        }
    }

    /// Returns the level of each channel's reference at the time `at` (ns).
    fn levels(&self, at: u64, registers: &Registers) -> [bool; CHANNELS] {
        core::array::from_fn(|index| match self.output(index, registers) {
            Output::Level(high) => high,
            Output::Pulse(high) => self.running.is_some_and(|grid| grid.tick(at) < high),
        })
    }

    /// Returns the waveform on the pin of the channel `index`, 0 to 3.
    pub(crate) fn output(&self, index: usize, registers: &Registers) -> Output {
        let enables = registers.ccer >> (4 * index);
        let main_output = registers.bdtr & (1 << 15) != 0;
        if !main_output || enables & 1 == 0 {
            // The output is off or has its idle level. The firmware leaves the idle level low (17.4.9, OSSI).
            return Output::Level(false);
        }
        assert!(enables & 2 == 0, "the firmware inverts no output");
        let channel = &self.channels[index];
        match channel.mode {
            FROZEN => Output::Level(channel.frozen),
            FORCE_LOW => Output::Level(false),
            PWM_1 if self.running.is_none() || channel.shadow == 0 => Output::Level(channel.shadow > 0),
            PWM_1 if channel.shadow > self.reload => Output::Level(true),
            PWM_1 => Output::Pulse(channel.shadow * (registers.psc + 1)),
            mode => unreachable!("the firmware uses no output compare mode {mode}"),
        }
    }
}

/// Returns OCxM, the output compare mode of a channel, and OCxPE, its preload enable.
const fn output_mode(index: usize, registers: &Registers) -> (u32, bool) {
    let bits = registers.ccmr[index / 2] >> (8 * (index % 2));
    (bits >> 4 & 0b111, bits >> 3 & 1 != 0)
}
