//! The firmware's log: reads bytes from the ring buffer of RTT (real-time transfer), and decodes them with the format strings of
//! the ELF file.

use std::fmt;
use std::time::Duration;

use defmt_decoder::{DecodeError, Table};
use rigless::emulator::{Error, Host};
use rigless::soc::Width;

/// A decoded log line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// Time at which the line was read from the ring: up to 1 ms after it was written.
    pub at: Duration,
    /// Time stamp of the firmware, as printed.
    pub stamp: String,
    /// Level of the line, such as "info" or "warn".
    pub level: String,
    /// Text of the line.
    pub text: String,
    /// Number of resets before the line.
    pub boot: usize,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}] {:5} {}", self.stamp, self.level, self.text)
    }
}

/// Offsets in SEGGER's control block of RTT: the buffer's address, its size, the write offset, the read offset, and the
/// flags. Before them are 16 bytes of name, two counts, and the address of the channel's name.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITE: u64 = 36;
const READ: u64 = 40;
const FLAGS: u64 = 44;
/// Flag that makes the program wait while the buffer is full. A reader sets it when it connects.
const BLOCK_IF_FULL: u64 = 2;

/// Reads bytes from the ring, as a debug probe does.
#[derive(Debug, Default)]
pub(crate) struct Rtt {
    block: Option<u64>,
    /// True if the reader has set [`BLOCK_IF_FULL`] and gone away.
    pub(crate) gone: bool,
    /// For each boot the bytes and the times at which they were read, ns.
    pub(crate) taken: Vec<Vec<(u64, Vec<u8>)>>,
}

impl Rtt {
    pub(crate) fn new(block: Option<u64>) -> Self {
        Self { block, gone: false, taken: vec![Vec::new()] }
    }

    /// Begins the bytes of another boot.
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

/// Decodes the bytes that were read.
pub(crate) fn decode(table: &Table, taken: &[Vec<(u64, Vec<u8>)>]) -> Vec<LogLine> {
    let mut lines = Vec::new();
    for (boot, chunks) in taken.iter().enumerate() {
        let mut decoder = table.new_stream_decoder();
        for (at, bytes) in chunks {
            decoder.received(bytes);
            let at = Duration::from_nanos(*at);
            loop {
                lines.push(match decoder.decode() {
                    Ok(frame) => LogLine {
                        at,
                        stamp: frame.display_timestamp().map(|t| t.to_string()).unwrap_or_default(),
                        level: frame.level().map_or("print", |level| level.as_str()).to_owned(),
                        text: frame.display_message().to_string(),
                        boot,
                    },
                    Err(DecodeError::UnexpectedEof) => break,
                    Err(DecodeError::Malformed) => {
                        let (level, text) = ("error".to_owned(), "malformed log frame".to_owned());
                        LogLine { at, stamp: String::new(), level, text, boot }
                    }
                });
            }
        }
    }
    lines
}
