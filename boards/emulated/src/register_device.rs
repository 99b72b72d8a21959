//! A device with registers on an I2C bus of the emulated chip, and the simulation of a BNO055 orientation sensor.

use rigless::chip::Timeline;
use rigless::chip::i2c::Peer;
use rigless::snapshot::Store;
use simulated::bno055::Bno055;
use simulated::i2c::{ByteMemory, IMU_ADDRESS};

#[derive(Debug)]
enum Kind {
    Memory(Box<ByteMemory>),
    /// A BNO055 that stands still, and the time up to which it has been simulated, ns.
    Sensor(Box<Bno055>, u64),
}

/// A device with 256 registers of one byte each, or a BNO055. Its address is that of a BNO055.
#[derive(Debug)]
pub struct RegisterDevice {
    kind: Kind,
    /// The bytes of a write that has not ended.
    written: Vec<u8>,
    /// True if the device is disconnected from the bus.
    pub absent: bool,
}

impl RegisterDevice {
    const fn of(kind: Kind) -> Self {
        Self { kind, written: Vec::new(), absent: false }
    }

    /// Creates a device with these registers.
    pub fn new(registers: [u8; 256]) -> Self {
        Self::of(Kind::Memory(Box::new(ByteMemory::new(registers))))
    }

    /// Creates a BNO055 that has been on for a second, and does not turn.
    pub fn bno055() -> Self {
        let mut sensor = Bno055::default();
        sensor.run(1.0, 0.0, 0.0);
        Self::of(Kind::Sensor(Box::new(sensor), 0))
    }

    /// Returns the content of a register, or 0 for a BNO055.
    pub fn register(&self, number: u8) -> u8 {
        match &self.kind {
            Kind::Memory(memory) => memory.byte(number),
            Kind::Sensor(..) => 0,
        }
    }

    /// Stores the bytes of a write that has ended.
    fn store(&mut self) {
        let written = std::mem::take(&mut self.written);
        match &mut self.kind {
            Kind::Memory(memory) => memory.write(&written),
            Kind::Sensor(sensor, _) => sensor.write(&written),
        }
    }
}

impl Store for RegisterDevice {}

impl Peer for RegisterDevice {
    fn start(&mut self, address: u8, _: bool, context: &mut Timeline<'_, '_>) -> bool {
        self.store();
        let mut answers = !self.absent;
        if let Kind::Sensor(sensor, until) = &mut self.kind {
            let now = context.now().0;
            sensor.run(now.saturating_sub(*until) as f64 / 1e9, 0.0, 0.0);
            *until = now;
            sensor.start();
            answers &= sensor.answers();
        }
        answers && address == IMU_ADDRESS
    }

    fn write(&mut self, byte: u8, _: &mut Timeline<'_, '_>) -> bool {
        self.written.push(byte);
        !self.absent
    }

    fn read(&mut self, _: bool, _: &mut Timeline<'_, '_>) -> u8 {
        let mut byte = [0];
        match &mut self.kind {
            Kind::Memory(memory) => memory.read(&mut byte),
            Kind::Sensor(sensor, _) => sensor.read(&mut byte),
        }
        byte[0]
    }

    fn stop(&mut self, _: &mut Timeline<'_, '_>) {
        self.store();
    }
}
