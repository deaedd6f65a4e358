//! The serial port between a host and a board: reports come in, requests go out.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use north_finder::event::Report;
use north_finder::link::{ReportDecoder, Request, encode_request};
use serialport::SerialPort;

use crate::interrupt;

/// Baud rate of the board's host line; a pseudo-terminal does not mind.
const BAUD: u32 = 115_200;
/// How long one look for bytes waits: an interrupt is heeded as soon.
const PATIENCE: Duration = Duration::from_millis(50);

/// Why a port cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    #[error("{port}: {error}")]
    Open { port: String, error: serialport::Error },
    #[error("no serial port was found: name it")]
    None,
    #[error("which port? {0}")]
    Several(String),
    #[error("{port}: {error}")]
    Io { port: String, error: io::Error },
    #[error("{port}: the other side is gone")]
    Gone { port: String },
    #[error("{port}: nothing was heard for {seconds} s: is the board powered, is it the right port?")]
    Silent { port: String, seconds: u64 },
    #[error("{port}: the request is too long for a frame")]
    TooLong { port: String },
    #[error("interrupted")]
    Interrupted,
}

/// An open port.
pub struct Port {
    name: String,
    line: Box<dyn SerialPort>,
    decoder: ReportDecoder,
    received: Vec<u8>,
    bad_frames: u64,
}

impl Port {
    /// Opens the port, or, unnamed, the only one that there is.
    ///
    /// Errors: none, or several, to choose from; the port cannot be opened.
    pub fn open(name: Option<&str>) -> Result<Self, PortError> {
        let name = name.map_or_else(the_only_one, |name| Ok(name.to_owned()))?;
        match serialport::new(&name, BAUD).timeout(PATIENCE).open() {
            Ok(line) => Ok(Self { name, line, decoder: ReportDecoder::new(), received: Vec::new(), bad_frames: 0 }),
            Err(error) => Err(PortError::Open { port: name, error }),
        }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Frames that were dropped: cut off, damaged, or of another version.
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }

    /// The next report.
    ///
    /// Errors: nothing comes for `patience`; the line breaks; an interrupt.
    pub fn report(&mut self, patience: Duration) -> Result<Report, PortError> {
        let start = Instant::now();
        loop {
            while !self.received.is_empty() {
                match self.decoder.feed(self.received.remove(0)) {
                    Some(Ok(report)) => return Ok(report),
                    Some(Err(_)) => self.bad_frames += 1,
                    None => {}
                }
            }
            if interrupt::requested() {
                return Err(PortError::Interrupted);
            }
            if start.elapsed() > patience {
                return Err(PortError::Silent { port: self.name.clone(), seconds: patience.as_secs() });
            }
            self.receive()?;
        }
    }

    /// Sends a request.
    pub fn send(&mut self, request: &Request) -> Result<(), PortError> {
        let frame = encode_request(request).map_err(|_| PortError::TooLong { port: self.name.clone() })?;
        let sent = self.line.write_all(&frame).and_then(|()| self.line.flush());
        sent.map_err(|error| PortError::Io { port: self.name.clone(), error })
    }

    fn receive(&mut self) -> Result<(), PortError> {
        let mut bytes = [0; 1024];
        match self.line.read(&mut bytes) {
            Ok(0) => Err(PortError::Gone { port: self.name.clone() }),
            Ok(count) => {
                self.received.extend(&bytes[..count]);
                Ok(())
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(()),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(PortError::Gone { port: self.name.clone() }),
            Err(error) => Err(PortError::Io { port: self.name.clone(), error }),
        }
    }
}

/// The name of the only serial port of this machine.
fn the_only_one() -> Result<String, PortError> {
    let ports = serialport::available_ports().unwrap_or_default();
    match ports.as_slice() {
        [] => Err(PortError::None),
        [port] => Ok(port.port_name.clone()),
        several => {
            Err(PortError::Several(several.iter().map(|port| port.port_name.as_str()).collect::<Vec<_>>().join(", ")))
        }
    }
}
