//! The line to a hub: a serial port or a TCP connection, read and written as bytes with time-outs.

use crate::error::OpenError;
#[cfg(feature = "serial")]
use motor_hub::protocol::BAUD;
#[cfg(feature = "serial")]
use serde::Serialize;
#[cfg(feature = "serial")]
use serialport::{ErrorKind, SerialPortInfo, SerialPortType};
use std::fmt::Debug;
#[cfg(feature = "serial")]
use std::io;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Longest time that one read waits for a byte. A [`Session`](crate::Session) repeats reads until its time-out.
pub const POLL: Duration = Duration::from_millis(5);

/// The line to a hub: anything that reads and writes bytes. A read without bytes must fail soon as `TimedOut` or
/// `WouldBlock`; on serial ports and TCP connections it fails within [`POLL`].
#[derive(Debug)]
pub struct Line(pub(crate) Box<dyn Bytes>);

/// Bytes to and from a hub.
pub(crate) trait Bytes: Read + Write + Send + Debug {}

impl<T: Read + Write + Send + Debug> Bytes for T {}

impl<T: Read + Write + Send + Debug + 'static> From<T> for Line {
    fn from(port: T) -> Self {
        Self(Box::new(port))
    }
}

impl Line {
    /// Opens a TCP connection if `place` is `HOST:PORT`, otherwise a serial port.
    ///
    /// # Errors
    /// The errors of [`tcp`](Self::tcp) and [`serial`](Self::serial).
    #[cfg(feature = "serial")]
    pub fn open(place: &str, timeout: Duration) -> Result<Self, OpenError> {
        if is_tcp(place) { Self::tcp(place, timeout) } else { Self::serial(place) }
    }

    /// Opens a serial port exclusively.
    ///
    /// # Errors
    /// The port does not exist, another program has it open, or the user has no permission.
    #[cfg(feature = "serial")]
    pub fn serial(path: &str) -> Result<Self, OpenError> {
        let port = serialport::new(path, BAUD).timeout(POLL).open().map_err(|error| {
            // The system's texts for these two errors mislead users.
            let text = error.to_string();
            match &*text {
                "Not a typewriter" => OpenError::NotASerialPort,
                _ if text.contains("exclusive lock") => OpenError::InUse,
                _ if error.kind == ErrorKind::Io(io::ErrorKind::PermissionDenied) => OpenError::Denied,
                _ => OpenError::System(error.into()),
            }
        })?;
        Ok(port.into())
    }

    /// Connects to `HOST:PORT`. A host with several network addresses gets one attempt for each address, each within
    /// `timeout`.
    ///
    /// # Errors
    /// The port is not 1 to 65535, the host does not exist, or no program listens at the port.
    pub fn tcp(address: &str, timeout: Duration) -> Result<Self, OpenError> {
        if tcp_port(address).is_none_or(|port| port == 0) {
            return Err(OpenError::NotATcpPort);
        }
        let mut failure = OpenError::NoSuchHost;
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, timeout) {
                Ok(stream) => {
                    stream.set_read_timeout(Some(POLL))?;
                    stream.set_write_timeout(Some(timeout))?;
                    // A request is one small write, which TCP must send without delay.
                    stream.set_nodelay(true)?;
                    return Ok(stream.into());
                }
                Err(error) => failure = error.into(),
            }
        }
        Err(failure)
    }
}

/// True for `HOST:PORT`, also if the port is out of range. No serial port has such a name.
#[must_use]
pub fn is_tcp(place: &str) -> bool {
    let parts = place.rsplit_once(':');
    let is_number = |port: &str| !port.is_empty() && port.bytes().all(|digit| digit.is_ascii_digit());
    parts.is_some_and(|(host, port)| !host.is_empty() && is_number(port))
}

/// Port of `HOST:PORT`, 0 to 65535; `None` if the text has no such port.
#[must_use]
pub fn tcp_port(address: &str) -> Option<u16> {
    address.rsplit_once(':').and_then(|(_, port)| port.parse().ok())
}

/// A serial port of this machine.
#[cfg(feature = "serial")]
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Port {
    /// Path by which [`Line::serial`] opens the port.
    pub path: String,
    /// Kind of port and, for USB, its identifiers, maker, product and serial number.
    pub description: String,
}

/// Returns the serial ports of this machine, sorted by path.
///
/// # Errors
/// The operating system does not list the ports.
#[cfg(feature = "serial")]
pub fn ports() -> io::Result<Vec<Port>> {
    let mut ports: Vec<Port> = serialport::available_ports()?.into_iter().map(Port::from).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

#[cfg(feature = "serial")]
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
