//! What a debug probe can read of the chip: symbols, memory, registers, and when the core reaches an instruction.

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

use rigless::emulator::{Hit, Watch};
use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::soc::st::tim::Channel;
use rigless::time::VirtualNanos;

use super::Bench;
use crate::elf;

impl Bench {
    /// Returns the content of a peripheral's register at this address.
    pub fn register(&mut self, address: u64) -> u32 {
        self.at_stop(move |surroundings, session, _| {
            let value = session.mcu().read(VirtualNanos(surroundings.now), address, Width::W32);
            value.unwrap_or_else(|fault| panic!("{address:#x}: {fault}")) as u32
        })
    }

    /// Writes a peripheral's register at this address, as a disturbance of the chip may do.
    pub fn write_register(&mut self, address: u64, value: u32) {
        self.at_stop(move |surroundings, session, _| {
            let at = VirtualNanos(surroundings.now);
            let written = session.mcu().write(at, address, Width::W32, value.into());
            written.unwrap_or_else(|fault| panic!("{address:#x}: {fault}"));
        });
    }

    /// Returns the pulse that the emulator's own TIM1 puts on a pin: high time and period in ns. `None` without
    /// [`full_timer`](super::Setup::full_timer), or while the level of the pin is constant.
    pub fn emulated_pulse(&mut self, motor: usize) -> Option<(u64, u64)> {
        self.at_stop(move |_, session, _| {
            let channel = Channel::new(u8::try_from(motor + 1).ok()?)?;
            session.board_mut().chip.pulse(channel)
        })
    }

    /// Returns the address of the only symbol with this name; see [`elf::find`].
    pub fn address(&self, name: &str) -> u64 {
        elf::find(&self.symbols, name).unwrap_or_else(|| panic!("no symbol, or several: {name}"))
    }

    /// Returns the image's symbols in the order of their addresses.
    pub fn symbols(&self) -> &[elf::Symbol] {
        &self.symbols
    }

    /// Notes each execution of these instructions from now on.
    pub fn watch(&mut self, addresses: Vec<u64>) {
        self.post(move |_, session, _| {
            for address in addresses {
                session.watch(Watch::Instruction(address));
            }
        });
    }

    /// Runs for this time, and returns how often each instruction ran, by address.
    pub fn profile(&mut self, time: Duration) -> BTreeMap<u64, u64> {
        // Every even address may be the beginning of an instruction.
        let code = self.symbols().iter().filter(|s| (0x0800_0000..0x0810_0000).contains(&s.address));
        self.watch(code.flat_map(|s| (s.address..s.address + s.size).step_by(2)).collect());
        self.take_hits();
        self.run(time);
        let mut counts = BTreeMap::new();
        for Hit { address, .. } in self.take_hits() {
            *counts.entry(address).or_default() += 1;
        }
        counts
    }

    /// Removes and returns the noted executions.
    pub fn take_hits(&mut self) -> Vec<Hit> {
        self.at_stop(|surroundings, _, _| std::mem::take(&mut surroundings.hits))
    }

    /// Reads words of the chip's memory.
    pub fn read_words(&mut self, address: u64, count: usize) -> Vec<u32> {
        self.at_stop(move |_, _, host| {
            (0..count as u64)
                .map(|index| host.read(address + 4 * index, Width::W32).expect("memory") as u32)
                .collect()
        })
    }

    /// Returns the content of the flash, for [`Setup::flash`](super::Setup) of another bench.
    pub fn flash(&mut self) -> Vec<u8> {
        self.bytes(self.board.flash())
    }

    /// Returns the content of the memory for settings, for [`Setup::stored`](super::Setup) of another bench.
    pub fn stored(&mut self) -> Vec<u8> {
        self.bytes(self.board.store())
    }

    fn bytes(&mut self, Range { start, end }: Range<u64>) -> Vec<u8> {
        self.read_words(start, (end - start) as usize / 4).into_iter().flat_map(u32::to_le_bytes).collect()
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
