//! TIM1 seen from outside: which waveform its registers put on each of its four output pins.
//!
//! This is the light model of the timer. It needs no events while nothing is written: a waveform is a level, or a
//! number of high ticks in each period. RM0090 section numbers are given where a rule comes from; the timer of RM0433
//! chapter 38 does the same with them.

/// Channels of the timer.
pub(crate) const CHANNELS: usize = 4;

const NANOS: u128 = 1_000_000_000;

/// What a pin does until something is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// It stays high or low.
    Level(bool),
    /// High timer ticks from the beginning of each period.
    Pulse(u32),
}

/// The periods of a running counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// When the counter was 0 for the first time, ns.
    pub epoch: u64,
    /// Ticks of a period.
    pub ticks: u32,
    /// Ticks per second.
    pub hz: u64,
}

impl Grid {
    /// The tick of its period in which `at` lies.
    pub(crate) fn tick(&self, at: u64) -> u32 {
        let ticks = u128::from(at.saturating_sub(self.epoch)) * u128::from(self.hz) / NANOS;
        (ticks % u128::from(self.ticks)) as u32
    }

    /// The first beginning of a period after `at`, ns.
    pub(crate) fn next_boundary(&self, at: u64) -> u64 {
        let per_boundary = u128::from(self.ticks) * NANOS;
        let passed = u128::from(at.saturating_sub(self.epoch)) * u128::from(self.hz) / per_boundary;
        self.epoch + ((passed + 1) * per_boundary / u128::from(self.hz)) as u64
    }

    /// Length of a period, s.
    pub(crate) fn seconds(&self) -> f64 {
        f64::from(self.ticks) / self.hz as f64
    }
}

/// What of the timer's registers shapes the waveforms.
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

#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    mode: u32,
    shadow: u32,
    /// The reference's level when the mode became "frozen".
    frozen: bool,
}

/// The timer's state beside its registers: what is in force until the next update event.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timer {
    channels: [Channel; CHANNELS],
    reload: u32,
    running: Option<Grid>,
    /// When the preloaded values take over.
    pub(crate) update_at: Option<u64>,
}

/// Output compare modes (17.4.7, OCxM).
const FROZEN: u32 = 0;
const FORCE_LOW: u32 = 4;
const FORCE_HIGH: u32 = 5;
const PWM_1: u32 = 6;

impl Timer {
    /// The counter's periods, if it runs.
    pub(crate) const fn grid(&self) -> Option<Grid> {
        self.running
    }

    /// Something was written at `at`; `update` if it was EGR.UG. `hz` is the timer's clock.
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

    /// The update event at `at`: preloaded values take over (17.3.2).
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

    /// The level of every channel's reference at `at`.
    fn levels(&self, at: u64, registers: &Registers) -> [bool; CHANNELS] {
        core::array::from_fn(|index| level(self.output(index, registers), self.running, at))
    }

    /// What the timer puts on the pin of channel `index`.
    pub(crate) fn output(&self, index: usize, registers: &Registers) -> Output {
        let enables = registers.ccer >> (4 * index);
        let main_output = registers.bdtr & (1 << 15) != 0;
        if !main_output || enables & 1 == 0 {
            // Off, or idle at its idle level, which the firmware leaves low (17.4.9, OSSI).
            return Output::Level(false);
        }
        let channel = &self.channels[index];
        let reference = match channel.mode {
            FROZEN => Output::Level(channel.frozen),
            FORCE_LOW => Output::Level(false),
            FORCE_HIGH => Output::Level(true),
            PWM_1 if self.running.is_none() || channel.shadow == 0 => Output::Level(channel.shadow > 0),
            PWM_1 if channel.shadow > self.reload => Output::Level(true),
            PWM_1 => Output::Pulse(channel.shadow * self.prescaler()),
            mode => unreachable!("the firmware uses no output compare mode {mode}"),
        };
        match reference {
            Output::Level(high) if enables & 2 != 0 => Output::Level(!high),
            Output::Pulse(_) if enables & 2 != 0 => unreachable!("the firmware inverts no output"),
            output => output,
        }
    }

    fn prescaler(&self) -> u32 {
        self.running.map_or(1, |grid| grid.ticks / (self.reload + 1))
    }
}

/// Whether a pin is high at `at`.
pub(crate) fn level(output: Output, grid: Option<Grid>, at: u64) -> bool {
    match output {
        Output::Level(high) => high,
        Output::Pulse(high) => grid.is_some_and(|grid| grid.tick(at) < high),
    }
}

/// OCxM and OCxPE of a channel.
const fn output_mode(index: usize, registers: &Registers) -> (u32, bool) {
    let bits = registers.ccmr[index / 2] >> (8 * (index % 2));
    (bits >> 4 & 0b111, bits >> 3 & 1 != 0)
}
