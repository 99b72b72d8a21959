//! What a probe could see of the chip: symbols, memory, registers, arrivals at instructions.

use std::collections::BTreeMap;
use std::time::Duration;

use rigless::emulator::Watch;
use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::soc::st::tim::Channel;
use rigless::time::VirtualNanos;

use super::Bench;
use crate::elf;

impl Bench {
    /// A peripheral's register, by its address.
    ///
    /// # Panics
    /// If there is none.
    pub fn register(&mut self, address: u64) -> u32 {
        self.at_stop(move |lab, session, _| {
            let value = session.mcu().read(VirtualNanos(lab.now), address, Width::W32);
            value.unwrap_or_else(|fault| panic!("{address:#x}: {fault}")) as u32
        })
    }

    /// The pulse that the emulator's own TIM1 puts on a pin: high time and period in ns. `None` with
    /// [`Registers`](crate::chip::Pwm::Registers), or while the pin has a level.
    pub fn emulated_pulse(&mut self, motor: usize) -> Option<(u64, u64)> {
        self.at_stop(move |_, session, _| {
            let channel = Channel::new(u8::try_from(motor + 1).ok()?)?;
            session.board_mut().chip.pulse(channel)
        })
    }

    /// The address of the only symbol with this name; see [`elf::find`].
    ///
    /// # Panics
    /// If there is none, or several.
    #[must_use]
    pub fn address(&self, name: &str) -> u64 {
        elf::find(&self.symbols, name).unwrap_or_else(|| panic!("not one symbol is {name}"))
    }

    /// The image's symbols, by address.
    #[must_use]
    pub fn symbols(&self) -> &[elf::Symbol] {
        &self.symbols
    }

    /// Notes every arrival at these instructions from now on.
    pub fn watch(&mut self, addresses: Vec<u64>) {
        self.at_stop(move |_, session, _| {
            for address in addresses {
                session.watch(Watch::Instruction(address));
            }
        });
    }

    /// The same for every instruction of the program.
    pub fn watch_all(&mut self) {
        // Every even address might be an instruction. The core arrives at instructions only.
        let code = self.symbols().iter().filter(|s| (0x0800_0000..0x0810_0000).contains(&s.address));
        let all = code.flat_map(|s| (s.address..s.address + s.size).step_by(2)).collect();
        self.watch(all);
    }

    /// Runs for this long and says how often each instruction ran, by address.
    pub fn profile(&mut self, time: Duration) -> BTreeMap<u64, u64> {
        self.watch_all();
        self.take_hits();
        self.run(time);
        let mut counts = BTreeMap::new();
        for (address, _) in self.take_hits() {
            *counts.entry(address).or_default() += 1;
        }
        counts
    }

    /// Takes the arrivals noted so far: address and instruction count.
    pub fn take_hits(&mut self) -> Vec<(u64, u64)> {
        self.at_stop(|lab, _, _| {
            std::mem::take(&mut lab.hits).into_iter().map(|(address, count, _)| (address, count)).collect()
        })
    }

    /// Reads words of the chip's memory.
    pub fn read_words(&mut self, address: u64, count: usize) -> Vec<u32> {
        self.at_stop(move |_, _, host| {
            (0..count as u64)
                .map(|index| host.read(address + 4 * index, Width::W32).expect("memory") as u32)
                .collect()
        })
    }

    /// What the flash holds, as the next one to be powered on may find it: [`Setup::flash`](super::Setup).
    pub fn flash(&mut self) -> Vec<u8> {
        let std::ops::Range { start, end } = self.board.flash();
        self.read_words(start, (end - start) as usize / 4).into_iter().flat_map(u32::to_le_bytes).collect()
    }

    /// What the memory for settings holds, as the next one to be powered on may find it: [`Setup::stored`](super::Setup).
    pub fn stored(&mut self) -> Vec<u8> {
        let std::ops::Range { start, end } = self.board.store();
        self.read_words(start, (end - start) as usize / 4).into_iter().flat_map(u32::to_le_bytes).collect()
    }

    /// The instants at which these instructions were arrived at so far.
    pub fn take_instants(&mut self) -> Vec<Duration> {
        self.at_stop(|lab, _, _| {
            std::mem::take(&mut lab.hits).into_iter().map(|(_, _, at)| Duration::from_nanos(at)).collect()
        })
    }

    /// Writes words of the chip's memory.
    pub fn write_words(&mut self, address: u64, words: Vec<u32>) {
        self.at_stop(move |_, _, host| {
            for (index, word) in words.into_iter().enumerate() {
                host.write(address + 4 * index as u64, Width::W32, u64::from(word)).expect("memory");
            }
        });
    }
}
