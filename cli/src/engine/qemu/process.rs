//! QEMU as a child process that never outlives its user: it is killed when dropped and when it is silent for too long,
//! and its image ends by itself when this process dies, since its standard input closes then.

use std::io::{BufReader, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::wire::Ask;
use super::{INSTRUCTION_NS, QemuError};

/// Longest silence; a tick takes a fraction of a millisecond, and a machine can be busy.
const PATIENCE_S: u64 = 20;

pub struct Qemu {
    child: Arc<Mutex<Child>>,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    errors: ChildStderr,
    message: Vec<u8>,
    /// Messages so far: the watchdog looks whether it rises.
    heard: Arc<AtomicU64>,
    /// Closing it ends the watchdog, which gives whether it had to bite.
    watchdog: Option<(mpsc::Sender<()>, JoinHandle<bool>)>,
}

impl Qemu {
    /// Starts the image with the exchange on standard input and output.
    pub fn start(image: &Path, more: &[&str]) -> Result<Self, QemuError> {
        let shift = INSTRUCTION_NS.trailing_zeros();
        let mut command = Command::new("qemu-system-arm");
        command
            .args(["-machine", "mps2-an386", "-nodefaults", "-nic", "none", "-display", "none"])
            .args(["-icount", &format!("shift={shift},sleep=off")])
            .args(["-semihosting-config", "enable=on,target=native,arg=firmware"])
            .args(more)
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
        let heard = Arc::new(AtomicU64::new(0));
        let watchdog = Some(watch(Arc::clone(&child), Arc::clone(&heard)));
        Ok(Self { child, to, from: BufReader::new(from), errors, message: Vec::new(), heard, watchdog })
    }

    /// Waits for the next request.
    pub fn receive(&mut self) -> Result<Ask<'_>, QemuError> {
        let mut length = [0; 2];
        if self.from.read_exact(&mut length).is_err() {
            return Err(self.post_mortem());
        }
        self.message.resize(u16::from_le_bytes(length).into(), 0);
        if self.from.read_exact(&mut self.message).is_err() {
            return Err(self.post_mortem());
        }
        self.heard.fetch_add(1, Ordering::Relaxed);
        Ask::decode(&self.message)
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
        let said = said.trim();
        QemuError::Died(if said.is_empty() { String::new() } else { format!(": {said}") })
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

fn watch(child: Arc<Mutex<Child>>, heard: Arc<AtomicU64>) -> (mpsc::Sender<()>, JoinHandle<bool>) {
    let (end, ended) = mpsc::channel();
    let thread = std::thread::spawn(move || {
        let mut last = heard.load(Ordering::Relaxed);
        while ended.recv_timeout(Duration::from_secs(PATIENCE_S)) == Err(RecvTimeoutError::Timeout) {
            let now = heard.load(Ordering::Relaxed);
            if now == last {
                let _ = lock(&child).kill();
                return true;
            }
            last = now;
        }
        false
    });
    (end, thread)
}

fn lock(child: &Mutex<Child>) -> MutexGuard<'_, Child> {
    child.lock().unwrap_or_else(PoisonError::into_inner)
}
