//! System breaks of the STM32H743: a core that locks up, or a supply that falls, switches TIM1's outputs off without any code.
//!
//! The emulator has neither the register that connects them, SYSCFG_CFGR (RM0433 12.3.6), nor the connections. Before
//! revision V the chip itself ignores them (ES0392 2.2.2).

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rigless::emulator::{Access, AccessKind, CoreBus};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

/// SYSCFG_CFGR.
const CONNECTIONS: u64 = 0x5800_0418;
/// DBGMCU_IDC, whose upper half is the revision.
const IDENTITY: u64 = 0x5C00_1000;
/// REV_ID of revision V.
const REVISION_V: u32 = 0x2003;
/// BDTR of TIM1, with its bits MOE and BKE (RM0433 38.4.20).
const OUTPUTS: u64 = 0x4001_0044;
const MAIN_OUTPUT: u32 = 1 << 15;
const BREAK_ENABLED: u32 = 1 << 12;

/// What can break TIM1: a bit of SYSCFG_CFGR.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source {
    /// PVDL: the voltage detector.
    Detector = 1 << 2,
    /// CM7L: the core locks up.
    LockUp = 1 << 6,
}

/// SYSCFG_CFGR of one chip, as its core and its peripherals see the register.
#[derive(Clone, Debug, Default)]
pub(crate) struct Connections(Arc<AtomicU32>);

impl Connections {
    /// Takes all connections back, as a reset of the chip does.
    pub(crate) fn reset(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// Answers an access to the register; `None` if it is to another. What is connected stays connected until a reset.
    pub(crate) fn access(&self, access: &Access) -> Option<u64> {
        if access.address != CONNECTIONS {
            return None;
        }
        if access.kind == AccessKind::Write {
            self.0.fetch_or(access.value as u32, Ordering::Relaxed);
            return Some(access.value);
        }
        Some(self.0.load(Ordering::Relaxed).into())
    }

    /// BDTR after a break by this source. `None` if the source breaks nothing.
    pub(crate) fn broken(&self, source: Source, identity: u32, outputs: u32) -> Option<u32> {
        let connected = self.0.load(Ordering::Relaxed) & source as u32 != 0;
        let breaks = connected && identity >> 16 >= REVISION_V && outputs & BREAK_ENABLED != 0;
        breaks.then_some(outputs & !MAIN_OUTPUT)
    }

    /// The core has locked up after this many instructions.
    pub(crate) fn locked_up(&self, instructions: u64, bus: &mut dyn CoreBus) {
        let at = bus.time(instructions);
        let [Some(identity), Some(outputs)] = [IDENTITY, OUTPUTS].map(|address| read(bus, address, at))
        else {
            return;
        };
        if let Some(outputs) = self.broken(Source::LockUp, identity, outputs) {
            bus.access(access(AccessKind::Write, OUTPUTS, outputs.into(), at), false);
        }
    }
}

fn read(bus: &mut dyn CoreBus, address: u64, at: VirtualNanos) -> Option<u32> {
    bus.access(access(AccessKind::Read, address, 0, at), false).map(|value| value as u32)
}

fn access(kind: AccessKind, address: u64, value: u64, at: VirtualNanos) -> Access {
    let mut access = Access::new(kind, address, Width::W32, value);
    access.virtual_time = at;
    access
}
