//! The serial port between a host and a board: reports come in, requests go out.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use north_finder::event::identity::Identity;
use north_finder::event::{Event, Report};
use north_finder::health::Refusal;
use north_finder::link::{Ask, BAUD, BadFrame, ReportDecoder, Request, encode_request};
use north_finder::sequence::Command;
use north_finder::settings::Settings;
use north_finder::settings::pieces::{Incoming, Outgoing};
use serialport::SerialPort;

use crate::interrupt;

/// How long one look for bytes waits: an interrupt is heeded as soon.
const PATIENCE: Duration = Duration::from_millis(50);
/// A request that is not answered within this time was lost, or its answer was; storing settings takes half of it.
const ANSWER: Duration = Duration::from_millis(1500);
/// How often it is sent.
const TRIES: u32 = 3;
/// A board reports each second.
pub const SILENCE: Duration = Duration::from_secs(10);

/// Why a port cannot be used, or what was asked is not done.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    #[error("{port}: {error}")]
    Open { port: String, error: serialport::Error },
    #[error("no serial port was found: name it with --port")]
    None,
    #[error("which port? {0}")]
    Several(String),
    #[error("{port}: {error}")]
    Io { port: String, error: io::Error },
    #[error("{port}: the other side is gone")]
    Gone { port: String },
    #[error("{port}: nothing was heard for {seconds} s: is the board powered, is it the right port?")]
    Silent { port: String, seconds: u64 },
    #[error("{port}: no answer{}", if *.other_version { ": what comes is of another version of the link" } else { "" })]
    NoAnswer { port: String, other_version: bool },
    #[error("{port}: the settings are too long")]
    TooLong { port: String },
    #[error("{port}: refused: {}: {}{}. To do: {}", .refusal.name(), .refusal.meaning(),
        .violations.iter().map(|line| format!("\n  {line}")).collect::<String>(), .refusal.remedy())]
    Refused { port: String, refusal: Refusal, violations: Vec<String> },
    #[error("interrupted")]
    Interrupted,
}

/// An open port.
pub struct Port {
    name: String,
    line: Box<dyn SerialPort>,
    decoder: ReportDecoder,
    received: VecDeque<u8>,
    bytes: u64,
    bad_frames: u64,
    other_version: bool,
    number: u8,
}

impl Port {
    /// Opens the port, or, unnamed, the only one that a board answers on.
    ///
    /// Errors: none, or several, to choose from; the port cannot be opened.
    pub fn open(name: Option<&str>) -> Result<Self, PortError> {
        match name {
            Some(name) => Self::open_named(name),
            None => {
                let ports = serialport::available_ports().unwrap_or_default();
                Self::the_only_one(ports.into_iter().map(|port| port.port_name).collect())
            }
        }
    }

    /// Over a line that is open.
    ///
    /// Errors: the line takes no time-out.
    pub fn over(name: &str, mut line: Box<dyn SerialPort>) -> Result<Self, PortError> {
        line.set_timeout(PATIENCE).map_err(|error| PortError::Open { port: name.to_owned(), error })?;
        Ok(Self {
            name: name.to_owned(),
            line,
            decoder: ReportDecoder::new(),
            received: VecDeque::new(),
            bytes: 0,
            bad_frames: 0,
            other_version: false,
            number: 0,
        })
    }

    fn open_named(name: &str) -> Result<Self, PortError> {
        match serialport::new(name, BAUD).timeout(PATIENCE).open() {
            Ok(line) => Self::over(name, line),
            Err(error) => Err(PortError::Open { port: name.to_owned(), error }),
        }
    }

    /// The only one of several ports, or of them the only one on which a board answers.
    fn the_only_one(names: Vec<String>) -> Result<Self, PortError> {
        match names.as_slice() {
            [] => return Err(PortError::None),
            [name] => return Self::open_named(name),
            _ => {}
        }
        let opened = names.iter().filter_map(|name| Self::open_named(name).ok());
        let answering: Result<Vec<Self>, PortError> = opened
            .filter_map(|mut port| match port.try_ask(Ask::Identify, 1, &mut |_| ()) {
                Ok(()) => Some(Ok(port)),
                Err(PortError::Interrupted) => Some(Err(PortError::Interrupted)),
                Err(_) => None,
            })
            .collect();
        let mut answering = answering?;
        match (answering.pop(), answering.is_empty()) {
            (Some(port), true) => Ok(port),
            _ => Err(PortError::Several(names.join(", "))),
        }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes that have come.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Frames that were dropped: cut off, damaged, or of another version.
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }

    /// From here on: what came damaged until now was of another's stream.
    pub fn count_bad_frames_anew(&mut self) {
        self.bad_frames = 0;
    }

    /// The next report.
    ///
    /// Errors: nothing comes for `patience`; the line breaks; an interrupt.
    pub fn report(&mut self, patience: Duration) -> Result<Report, PortError> {
        let start = Instant::now();
        loop {
            // A stream always brings another one.
            if interrupt::requested() {
                return Err(PortError::Interrupted);
            }
            if let Some(report) = self.poll()? {
                return Ok(report);
            }
            if start.elapsed() > patience {
                return Err(PortError::Silent { port: self.name.clone(), seconds: patience.as_secs() });
            }
        }
    }

    /// A report, if one comes within a twentieth of a second.
    ///
    /// Errors: the line breaks; an interrupt.
    pub fn poll(&mut self) -> Result<Option<Report>, PortError> {
        if self.received.is_empty() {
            self.receive()?;
        }
        while let Some(byte) = self.received.pop_front() {
            match self.decoder.feed(byte) {
                Some(Ok(report)) => return Ok(Some(report)),
                Some(Err(bad)) => {
                    self.bad_frames += 1;
                    self.other_version |= bad == BadFrame::OtherVersion;
                }
                None => {}
            }
        }
        if interrupt::requested() { Err(PortError::Interrupted) } else { Ok(None) }
    }

    /// Asks, and waits for the answer; `told` hears what comes meanwhile.
    ///
    /// Errors: a refusal; no answer; the line breaks; an interrupt.
    pub fn ask(&mut self, ask: Ask, told: &mut dyn FnMut(&Report)) -> Result<(), PortError> {
        self.try_ask(ask, TRIES, told)
    }

    /// The same for what is good for one try: it is not sent again.
    ///
    /// Errors: as of [`Self::ask`].
    pub fn ask_once(&mut self, ask: Ask, told: &mut dyn FnMut(&Report)) -> Result<(), PortError> {
        self.try_ask(ask, 1, told)
    }

    fn try_ask(&mut self, ask: Ask, tries: u32, told: &mut dyn FnMut(&Report)) -> Result<(), PortError> {
        self.number = self.number % u8::MAX + 1;
        let request = Request { number: self.number, ask };
        let mut violations = Vec::new();
        for _ in 0..tries {
            self.send(&request)?;
            let start = Instant::now();
            while start.elapsed() < ANSWER {
                let Some(report) = self.poll()? else { continue };
                match report.event {
                    Event::Answer { number, refusal: None } if number == request.number => return Ok(()),
                    Event::Answer { number, refusal: Some(refusal) } if number == request.number => {
                        return Err(PortError::Refused { port: self.name.clone(), refusal, violations });
                    }
                    Event::Answer { .. } => {}
                    Event::Violation { field, value } => violations.push(format!("{} = {value}", field.as_str())),
                    _ => told(&report),
                }
            }
        }
        Err(PortError::NoAnswer { port: self.name.clone(), other_version: self.other_version })
    }

    /// A command to fix or calibration.
    pub fn command(&mut self, command: Command, told: &mut dyn FnMut(&Report)) -> Result<(), PortError> {
        self.ask(Ask::Command(command), told)
    }

    /// Which firmware is at the other end.
    pub fn identity(&mut self) -> Result<Identity, PortError> {
        let mut identity = None;
        self.ask(Ask::Identify, &mut |report| {
            if let Event::Identity(told) = report.event {
                identity = Some(told);
            }
        })?;
        identity.ok_or_else(|| PortError::NoAnswer { port: self.name.clone(), other_version: false })
    }

    /// The settings in flash; `None`: there are none.
    pub fn settings(&mut self) -> Result<Option<Settings>, PortError> {
        let refused = |port: &str, refusal| PortError::Refused { port: port.into(), refusal, violations: Vec::new() };
        let (mut incoming, mut offset) = (Incoming::default(), 0);
        loop {
            let mut piece = None;
            let asked = self.ask(Ask::ReadSettings { offset }, &mut |report| {
                if let Event::Settings(told) = report.event {
                    piece = Some(told);
                }
            });
            match asked {
                Err(PortError::Refused { refusal: Refusal::NoSettings, .. }) => return Ok(None),
                asked => asked?,
            }
            let piece = piece.ok_or_else(|| PortError::NoAnswer { port: self.name.clone(), other_version: false })?;
            if incoming.take(&piece).map_err(|refusal| refused(&self.name, refusal))? {
                let mut settings = Settings::default();
                incoming.read(&mut settings).map_err(|refusal| refused(&self.name, refusal))?;
                return Ok(Some(settings));
            }
            offset = piece.offset.saturating_add(piece.bytes.as_slice().len() as u16);
        }
    }

    /// The log of fixes, record by record in the order of writing.
    pub fn log(&mut self, taken: &mut dyn FnMut(&[u8])) -> Result<(), PortError> {
        let mut from = 0;
        loop {
            let mut records = None;
            self.ask(Ask::ReadLog { from }, &mut |report| {
                if let Event::Log { next, bytes } = report.event {
                    records = Some((next, bytes));
                }
            })?;
            let (next, bytes) =
                records.ok_or_else(|| PortError::NoAnswer { port: self.name.clone(), other_version: false })?;
            if bytes.as_slice().is_empty() || next <= from {
                return Ok(());
            }
            taken(bytes.as_slice());
            from = next;
        }
    }

    /// Stores settings; the instrument starts anew with them.
    pub fn store(&mut self, settings: &Settings) -> Result<(), PortError> {
        let pieces = Outgoing::new(settings).ok_or_else(|| PortError::TooLong { port: self.name.clone() })?;
        for piece in pieces {
            self.ask(Ask::WriteSettings(piece), &mut |_| ())?;
        }
        Ok(())
    }

    fn send(&mut self, request: &Request) -> Result<(), PortError> {
        let frame = encode_request(request).map_err(|_| PortError::TooLong { port: self.name.clone() })?;
        let sent = self.line.write_all(&frame).and_then(|()| self.line.flush());
        sent.map_err(|error| PortError::Io { port: self.name.clone(), error })
    }

    fn receive(&mut self) -> Result<(), PortError> {
        let mut bytes = [0; 4096];
        match self.line.read(&mut bytes) {
            Ok(0) => Err(PortError::Gone { port: self.name.clone() }),
            Ok(count) => {
                self.received.extend(&bytes[..count]);
                self.bytes += count as u64;
                Ok(())
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(()),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(PortError::Gone { port: self.name.clone() }),
            Err(error) => Err(PortError::Io { port: self.name.clone(), error }),
        }
    }
}

/// The port that a command talks to.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct PortOption {
    /// The serial port of the board; the only one on which a board answers, if it is not named
    #[arg(long, value_name = "PORT")]
    pub port: Option<String>,
}

impl PortOption {
    pub fn open(&self) -> Result<Port, PortError> {
        Port::open(self.port.as_deref())
    }
}
