//! The firmware's log: bytes out of its RTT ring, decoded with the ELF's own format strings.

use std::fmt;
use std::time::Duration;

use defmt_decoder::{DecodeError, Table};
use rigless::emulator::{Error, Host};
use rigless::soc::Width;

/// A decoded log line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When it was taken out of the ring: up to 1 ms after it was written.
    pub at: Duration,
    /// The firmware's own time stamp, as printed.
    pub stamp: String,
    /// "info", "warn", ...
    pub level: String,
    /// What it says.
    pub text: String,
    /// How many resets came before.
    pub boot: usize,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}] {:5} {}", self.stamp, self.level, self.text)
    }
}

/// Offsets in SEGGER's control block with one up-channel, as `defmt-rtt` lays it out: sixteen bytes of
/// name, two counts, then name, buffer, size, write and read offset.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITE: u64 = 36;
const READ: u64 = 40;
const FLAGS: u64 = 44;
/// "Block the program while the buffer is full", which a reader asks for when it comes.
const BLOCK_IF_FULL: u64 = 2;

/// Takes bytes out of the ring, as a probe does.
#[derive(Debug, Default)]
pub(crate) struct Rtt {
    block: Option<u64>,
    /// The reader asked for a program that waits for it, and went away.
    pub(crate) gone: bool,
    /// By boot: bytes and when they were taken.
    pub(crate) taken: Vec<Vec<(u64, Vec<u8>)>>,
}

impl Rtt {
    pub(crate) fn new(block: Option<u64>) -> Self {
        Self { block, gone: false, taken: vec![Vec::new()] }
    }

    /// What comes from now on is another boot's.
    pub(crate) fn reset(&mut self) {
        self.taken.push(Vec::new());
    }

    pub(crate) fn drain(&mut self, now: u64, host: &mut dyn Host) -> Result<(), Error> {
        let Some(block) = self.block else {
            return Ok(());
        };
        if self.gone {
            return host.write(block + FLAGS, Width::W32, BLOCK_IF_FULL);
        }
        let mut word = |offset| host.read(block + offset, Width::W32);
        let (write, mut read) = (word(WRITE)?, word(READ)?);
        if write == read {
            return Ok(());
        }
        let (buffer, size) = (word(BUFFER)?, word(SIZE)?);
        if size == 0 || write >= size || read >= size {
            return Ok(());
        }
        let mut bytes = Vec::new();
        while read != write {
            bytes.push(host.read(buffer + read, Width::W8)?.to_le_bytes()[0]);
            read = (read + 1) % size;
        }
        host.write(block + READ, Width::W32, read)?;
        if let Some(boot) = self.taken.last_mut() {
            boot.push((now, bytes));
        }
        Ok(())
    }
}

/// Decodes what was taken.
pub(crate) fn decode(table: &Table, taken: &[Vec<(u64, Vec<u8>)>]) -> Vec<LogLine> {
    let mut lines = Vec::new();
    for (boot, chunks) in taken.iter().enumerate() {
        let mut decoder = table.new_stream_decoder();
        for (at, bytes) in chunks {
            decoder.received(bytes);
            loop {
                match decoder.decode() {
                    Ok(frame) => lines.push(LogLine {
                        at: Duration::from_nanos(*at),
                        stamp: frame.display_timestamp().map(|t| t.to_string()).unwrap_or_default(),
                        level: frame.level().map_or("print", |level| level.as_str()).to_owned(),
                        text: frame.display_message().to_string(),
                        boot,
                    }),
                    Err(DecodeError::UnexpectedEof) => break,
                    Err(DecodeError::Malformed) => lines.push(LogLine {
                        at: Duration::from_nanos(*at),
                        stamp: String::new(),
                        level: "error".to_owned(),
                        text: "malformed log frame".to_owned(),
                        boot,
                    }),
                }
            }
        }
    }
    lines
}
