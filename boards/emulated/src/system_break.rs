//! System breaks of the STM32H743: the chip switches the outputs of TIM1 off if its core locks up or its supply falls, without any
//! code.
//!
//! The emulator has neither the register that connects these sources with TIM1, SYSCFG_CFGR (RM0433 12.3.6), nor the
//! connections. Real chips before revision V ignore the connections (ES0392 2.2.2).

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rigless::emulator::{Access, AccessKind, CoreBus};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

/// Address of SYSCFG_CFGR.
const CONNECTIONS: u64 = 0x5800_0418;
/// Address of DBGMCU_IDC, whose upper half is the revision.
pub(crate) const IDENTITY: u64 = 0x5C00_1000;
/// REV_ID of revision V.
const REVISION_V: u32 = 0x2003;
/// Address of BDTR of TIM1 (RM0433 38.4.20).
pub(crate) const OUTPUTS: u64 = 0x4001_0044;
/// Bit MOE of BDTR.
const MAIN_OUTPUT: u32 = 1 << 15;
/// Bit BKE of BDTR.
const BREAK_ENABLED: u32 = 1 << 12;

/// A source that can switch the outputs of TIM1 off, with its bit in SYSCFG_CFGR.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source {
    /// The voltage detector, bit PVDL.
    Detector = 1 << 2,
    /// A lock-up of the core, bit CM7L.
    LockUp = 1 << 6,
}

/// The register SYSCFG_CFGR of one chip, which its core and its peripherals share.
#[derive(Clone, Debug, Default)]
pub(crate) struct Connections(Arc<AtomicU32>);

impl Connections {
    /// Removes all connections, as a reset of the chip does.
    pub(crate) fn reset(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// Answers an access to the register. Returns `None` if the access is to another register. A connection stays until a reset.
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

    /// Returns BDTR after a break by this source. `None` if the source does not switch the outputs off.
    pub(crate) fn broken(&self, source: Source, identity: u32, outputs: u32) -> Option<u32> {
        let connected = self.0.load(Ordering::Relaxed) & source as u32 != 0;
        let breaks = connected && identity >> 16 >= REVISION_V && outputs & BREAK_ENABLED != 0;
        breaks.then_some(outputs & !MAIN_OUTPUT)
    }

    /// Processes a lock-up of the core after this number of instructions.
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
