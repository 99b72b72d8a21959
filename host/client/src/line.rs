//! The line to a hub: a serial port or a TCP connection, as bytes with timeouts.

use serialport::{SerialPort, SerialPortInfo, SerialPortType};
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Bits per second; 8 data bits, no parity, 1 stop bit, no flow control.
pub const BAUD_RATE: u32 = 460_800;

/// The longest that a read waits for a byte; what is longer is for the session to decide.
pub const POLL: Duration = Duration::from_millis(5);

/// Bytes to and from a hub. A read without bytes fails within [`POLL`] as `TimedOut` or `WouldBlock`.
#[derive(Debug)]
pub enum Line {
    /// A serial port or pseudo-terminal.
    Serial(Box<dyn SerialPort>),
    /// A TCP connection.
    Tcp(TcpStream),
}

impl Line {
    /// Opens a serial port, for this process alone.
    ///
    /// # Errors
    /// No such port, or somebody else has it.
    pub fn serial(path: &str) -> io::Result<Self> {
        let port = serialport::new(path, BAUD_RATE).timeout(POLL).open().map_err(|error| {
            // What the system says of it is not what it means.
            let told = error.to_string();
            let means = match &*told {
                "Not a typewriter" => "is not a serial port",
                _ if told.contains("exclusive lock") => "another program has it open",
                _ => return error.into(),
            };
            io::Error::other(means)
        })?;
        Ok(Self::Serial(port))
    }

    /// Connects to `host:port` within `timeout`.
    ///
    /// # Errors
    /// No such host, or nobody listens there.
    pub fn tcp(address: &str, timeout: Duration) -> io::Result<Self> {
        let mut failure = io::Error::new(io::ErrorKind::NotFound, "no such host");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, timeout) {
                Ok(stream) => {
                    stream.set_read_timeout(Some(POLL))?;
                    stream.set_write_timeout(Some(timeout))?;
                    // A request is one small write that should go now.
                    stream.set_nodelay(true)?;
                    return Ok(Self::Tcp(stream));
                }
                Err(e) => failure = e,
            }
        }
        Err(failure)
    }
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.read(buffer),
            Self::Tcp(stream) => stream.read(buffer),
        }
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.write(bytes),
            Self::Tcp(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.flush(),
            Self::Tcp(stream) => stream.flush(),
        }
    }
}

/// A serial port of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// What to open it by.
    pub path: String,
    /// Kind and, for USB, who made it.
    pub description: String,
}

/// The serial ports of this machine, by path.
///
/// # Errors
/// The system does not tell.
pub fn ports() -> io::Result<Vec<Port>> {
    let mut ports: Vec<Port> = serialport::available_ports()?.into_iter().map(Port::from).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

impl From<SerialPortInfo> for Port {
    fn from(info: SerialPortInfo) -> Self {
        let description = match info.port_type {
            SerialPortType::UsbPort(usb) => {
                let texts = [usb.manufacturer, usb.product, usb.serial_number];
                let texts: Vec<String> = texts.into_iter().flatten().collect();
                format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, texts.join(" ")).trim_end().to_owned()
            }
            SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
            SerialPortType::PciPort => "built in".to_owned(),
            SerialPortType::Unknown => String::new(),
        };
        Self { path: info.port_name, description }
    }
}
