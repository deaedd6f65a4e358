//! QEMU as a child process that never outlives its user: it is killed when dropped and when it is silent for too long,
//! and its image ends by itself when this process dies, since its standard input closes then.

use std::io::{self, BufReader, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::QemuError;
use super::wire::Ask;

/// Longest silence; a tick takes a fraction of a millisecond, but a machine can be busy, and firmware that hangs runs on until its watchdog bites: some
/// seconds of a busy processor.
const PATIENCE_S: u64 = 60;
/// The watchdog looks this often in that time: a suspended process must not find QEMU guilty when it goes on.
const LOOKS: u32 = 4;

pub struct Qemu {
    child: Arc<Mutex<Child>>,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    errors: ChildStderr,
    message: Vec<u8>,
    /// Rises by one when a wait begins and when it ends: while it is odd, QEMU is awaited.
    waits: Arc<AtomicU64>,
    /// Closing it ends the watchdog, which gives whether it had to bite.
    watchdog: Option<(mpsc::Sender<()>, JoinHandle<bool>)>,
}

impl Qemu {
    /// Starts the image with the exchange on standard input and output, QEMU's further options, and words for the firmware.
    pub fn start(image: &Path, options: &[String], arguments: &[&str]) -> Result<Self, QemuError> {
        let arguments: String = arguments.iter().map(|word| format!(",arg={word}")).collect();
        let mut command = Command::new("qemu-system-arm");
        command
            .args(["-machine", "mps2-an386", "-nodefaults", "-nic", "none", "-display", "none"])
            .args(["-semihosting-config", &format!("enable=on,target=native,arg=firmware{arguments}")])
            .args(options)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // A terminal's interrupt is for this process, which then ends QEMU in good order.
            .process_group(0);
        let mut child = command.spawn().map_err(QemuError::NotStarted)?;
        let (Some(to), Some(from), Some(errors)) = (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(QemuError::Died(": it has no pipes".into()));
        };
        let child = Arc::new(Mutex::new(child));
        let waits = Arc::new(AtomicU64::new(0));
        let watchdog = Some(watch(Arc::clone(&child), Arc::clone(&waits)));
        Ok(Self { child, to, from: BufReader::new(from), errors, message: Vec::new(), waits, watchdog })
    }

    /// Waits for the next request.
    pub fn receive(&mut self) -> Result<Ask<'_>, QemuError> {
        self.waits.fetch_add(1, Ordering::Relaxed);
        let received = self.read_message();
        self.waits.fetch_add(1, Ordering::Relaxed);
        match received {
            Ok(()) => Ask::decode(&self.message),
            Err(_) => Err(self.post_mortem()),
        }
    }

    fn read_message(&mut self) -> io::Result<()> {
        let mut length = [0; 2];
        self.from.read_exact(&mut length)?;
        self.message.resize(u16::from_le_bytes(length).into(), 0);
        self.from.read_exact(&mut self.message)
    }

    /// Answers the request.
    pub fn reply(&mut self, payload: &[u8]) -> Result<(), QemuError> {
        let mut reply = (payload.len() as u16).to_le_bytes().to_vec();
        reply.extend(payload);
        self.to.write_all(&reply).map_err(|_| self.post_mortem())
    }

    /// Why QEMU is gone.
    fn post_mortem(&mut self) -> QemuError {
        if self.stop() {
            return QemuError::Hung(PATIENCE_S);
        }
        let mut said = String::new();
        let _ = self.errors.read_to_string(&mut said);
        // The machine's network card, which nobody uses, is said to have no peer.
        let said: Vec<&str> = said.lines().filter(|line| !line.contains("warning: nic")).collect();
        QemuError::Died(if said.is_empty() { String::new() } else { format!(": {}", said.join("; ")) })
    }

    /// Kills QEMU and waits until it is gone; gives whether the watchdog did.
    fn stop(&mut self) -> bool {
        {
            let mut child = lock(&self.child);
            let _ = child.kill();
            let _ = child.wait();
        }
        self.watchdog.take().is_some_and(|(end, thread)| {
            drop(end);
            thread.join().unwrap_or(false)
        })
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.stop();
    }
}

fn watch(child: Arc<Mutex<Child>>, waits: Arc<AtomicU64>) -> (mpsc::Sender<()>, JoinHandle<bool>) {
    let (end, ended) = mpsc::channel();
    let thread = std::thread::spawn(move || {
        let pause = Duration::from_secs(PATIENCE_S) / LOOKS;
        let (mut last, mut silent) = (0, 0);
        while ended.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
            let now = waits.load(Ordering::Relaxed);
            silent = if now == last && !now.is_multiple_of(2) { silent + 1 } else { 0 };
            last = now;
            if silent == LOOKS {
                let _ = lock(&child).kill();
                return true;
            }
        }
        false
    });
    (end, thread)
}

fn lock(child: &Mutex<Child>) -> MutexGuard<'_, Child> {
    child.lock().unwrap_or_else(PoisonError::into_inner)
}
