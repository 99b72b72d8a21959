//! A device with registers on an I2C bus of the emulated chip, and the simulation of a BNO055 orientation sensor.

use rigless::chip::Timeline;
use rigless::chip::i2c::Peer;
use rigless::snapshot::Store;
use simulated::bno055::Bno055;

/// I2C address of a BNO055 whose pin COM3 is low.
const BNO055: u8 = 0x28;

/// The registers of a device.
#[derive(Debug)]
enum Memory {
    /// The first byte of a write is the number of a register. Further bytes are stored in this register and the following ones. A
    /// read begins where the last access ended.
    Registers(Box<[u8; 256]>),
    /// A BNO055 that stands still, and the time up to which it has been simulated, ns.
    Sensor(Box<Bno055>, u64),
}

/// A device with 256 registers of one byte each, or a BNO055.
#[derive(Debug)]
pub struct RegisterDevice {
    address: u8,
    memory: Memory,
    next: u8,
    /// The bytes of a write that has not ended.
    written: Vec<u8>,
    /// True if the device is disconnected from the bus.
    pub absent: bool,
}

impl RegisterDevice {
    const fn with(address: u8, memory: Memory) -> Self {
        Self { address, memory, next: 0, written: Vec::new(), absent: false }
    }

    /// Creates a device at this address with these registers.
    #[must_use]
    pub fn new(address: u8, registers: [u8; 256]) -> Self {
        Self::with(address, Memory::Registers(Box::new(registers)))
    }

    /// Creates a BNO055 that has been on for a second, and does not turn.
    #[must_use]
    pub fn bno055() -> Self {
        let mut sensor = Bno055::default();
        sensor.run(1.0, 0.0, 0.0);
        Self::with(BNO055, Memory::Sensor(Box::new(sensor), 0))
    }

    /// Returns the content of a register, or 0 for a BNO055.
    #[must_use]
    pub fn register(&self, number: u8) -> u8 {
        match &self.memory {
            Memory::Registers(registers) => registers[number as usize],
            Memory::Sensor(..) => 0,
        }
    }

    /// Stores the bytes of a write that has ended.
    fn store(&mut self) {
        let written = std::mem::take(&mut self.written);
        let Some((first, values)) = written.split_first() else { return };
        match &mut self.memory {
            Memory::Registers(registers) => {
                self.next = *first;
                for value in values {
                    registers[usize::from(self.next)] = *value;
                    self.next = self.next.wrapping_add(1);
                }
            }
            Memory::Sensor(sensor, _) => sensor.write(&written),
        }
    }
}

impl Store for RegisterDevice {}

impl Peer for RegisterDevice {
    fn start(&mut self, address: u8, _: bool, context: &mut Timeline<'_, '_>) -> bool {
        self.store();
        let mut answers = !self.absent;
        if let Memory::Sensor(sensor, until) = &mut self.memory {
            let now = context.now().0;
            sensor.run(now.saturating_sub(*until) as f64 / 1e9, 0.0, 0.0);
            *until = now;
            sensor.start();
            answers &= sensor.answers();
        }
        answers && address == self.address
    }

    fn write(&mut self, byte: u8, _: &mut Timeline<'_, '_>) -> bool {
        self.written.push(byte);
        !self.absent
    }

    fn read(&mut self, _: bool, _: &mut Timeline<'_, '_>) -> u8 {
        match &mut self.memory {
            Memory::Registers(registers) => {
                let byte = registers[usize::from(self.next)];
                self.next = self.next.wrapping_add(1);
                byte
            }
            Memory::Sensor(sensor, _) => {
                let mut byte = [0];
                sensor.read(&mut byte);
                byte[0]
            }
        }
    }

    fn stop(&mut self, _: &mut Timeline<'_, '_>) {
        self.store();
    }
}
