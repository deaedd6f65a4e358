//! The two serial lines of the microcontroller: in the exchange's messages, or over QEMU's emulated UARTs.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::{QemuError, wire};

/// How the lines' bytes go.
pub enum Lines {
    /// With the answer to a tick.
    Exchange,
    /// Over sockets that QEMU connects to its UARTs.
    Uarts { host: TcpStream, gyro: TcpStream },
}

impl Lines {
    /// What the firmware has sent over its UART since the last call.
    pub fn receive(&mut self) -> Result<Vec<u8>, QemuError> {
        let Self::Uarts { host, .. } = self else { return Ok(Vec::new()) };
        let mut received = Vec::new();
        let mut bytes = [0; 1024];
        loop {
            match host.read(&mut bytes) {
                Ok(count @ 1..) => received.extend(bytes.iter().take(count)),
                Ok(0) => return Ok(received),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(received),
                Err(error) => return Err(QemuError::Uart(error)),
            }
        }
    }

    /// Sends bytes on both lines; gives the answer to the tick.
    pub fn send(
        &mut self,
        limit_open: bool,
        code: u16,
        from_gyro: &[u8],
        from_host: &[u8],
    ) -> Result<Vec<u8>, QemuError> {
        match self {
            Self::Exchange => Ok(wire::tick_reply(limit_open, code, from_gyro, from_host)),
            Self::Uarts { host, gyro } => {
                gyro.write_all(from_gyro).and_then(|()| host.write_all(from_host)).map_err(QemuError::Uart)?;
                Ok(wire::tick_reply(limit_open, code, &[], &[]))
            }
        }
    }
}

/// Sockets that wait for QEMU.
pub struct Uarts {
    host: TcpListener,
    gyro: TcpListener,
}

impl Uarts {
    pub fn listen() -> io::Result<Self> {
        let listen = || {
            let listener = TcpListener::bind(("127.0.0.1", 0))?;
            listener.set_nonblocking(true)?;
            io::Result::Ok(listener)
        };
        Ok(Self { host: listen()?, gyro: listen()? })
    }

    /// What QEMU needs to be told: UART0 is the host's line, UART1 the gyro's.
    pub fn options(&self) -> io::Result<Vec<String>> {
        let mut options = Vec::new();
        for (name, listener) in [("host", &self.host), ("gyro", &self.gyro)] {
            let port = listener.local_addr()?.port();
            options.push("-chardev".into());
            options.push(format!("socket,id={name},host=127.0.0.1,port={port}"));
            options.push("-serial".into());
            options.push(format!("chardev:{name}"));
        }
        Ok(options)
    }

    /// Waits until QEMU has connected both.
    pub fn accept(self) -> io::Result<Lines> {
        let (host, gyro) = (accept(&self.host)?, accept(&self.gyro)?);
        host.set_nonblocking(true)?;
        gyro.set_nonblocking(false)?;
        Ok(Lines::Uarts { host, gyro })
    }
}

fn accept(listener: &TcpListener) -> io::Result<TcpStream> {
    const PATIENCE: Duration = Duration::from_secs(10);
    let began = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock && began.elapsed() < PATIENCE => {
                sleep(Duration::from_millis(5));
            }
            Err(error) => return Err(error),
        }
    }
}
