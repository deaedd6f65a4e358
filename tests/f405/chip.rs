//! QEMU's STM32F405 with the flashable image in it, one tick at a time.
//!
//! QEMU's timers and serial lines know nothing of each other, and its model of the timer fires without pause once it has run
//! out. So the test is the clock: through QEMU's debugger interface it holds the processor wherever the image goes to sleep,
//! puts bytes on the lines until the image has taken them, and raises the 2.5 ms timer's interrupt itself. Every run is the
//! same.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use object::{Object, ObjectSection, ObjectSymbol};

const MACHINE: &str = "netduinoplus2";
/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(30);

/// Interrupt of TIM2 (RM0090, table 61), and the register that raises interrupts by software (ARMv7-M, B3.4.4).
const TIM2: u32 = 28;
const INTERRUPT_SET_PENDING: u32 = 0xE000_E200;
const TIM2_INTERRUPT_ENABLE: u32 = 0x4000_000C;
/// USART status registers, and the bit that says that a byte waits (RM0090, 30.6.1).
const USART1_STATUS: u32 = 0x4001_1000;
const USART2_STATUS: u32 = 0x4000_4400;
const BYTE_WAITS: u32 = 1 << 5;
/// Thumb instruction "wait for interrupt".
const WFI: [u8; 2] = [0x30, 0xBF];
const PC: u32 = 15;

/// Whether there is a QEMU with the machine; says so where not.
pub fn is_there() -> bool {
    let machines = Command::new("qemu-system-arm").args(["-machine", "help"]).output();
    let there = machines.is_ok_and(|out| String::from_utf8_lossy(&out.stdout).contains(MACHINE));
    if !there {
        eprintln!("skipped: there is no qemu-system-arm with the machine {MACHINE}");
    }
    there
}

/// A running chip; it dies with this value.
pub struct Chip {
    qemu: Child,
    debugger: TcpStream,
    gyro: TcpStream,
    host: TcpStream,
    /// Where the image waits for an interrupt.
    wfi: u32,
    /// Of the gyro's bytes and of the host's.
    queues: [Queue; 2],
}

/// A queue of received bytes in the image.
#[derive(Clone, Copy)]
struct Queue {
    address: u32,
    capacity: usize,
}

impl Drop for Chip {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

impl Chip {
    /// Powers the chip up and waits until the image has nothing left to do.
    pub fn start(image: &Path) -> Self {
        let listen = || TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let lines = [listen(), listen(), listen()];
        let socket = |line: &TcpListener| format!("socket,host=127.0.0.1,port={}", line.local_addr().unwrap().port());
        let [gyro, host, debugger] = &lines;
        let qemu = Command::new("qemu-system-arm")
            .args(["-machine", MACHINE, "-nodefaults", "-display", "none", "-S"])
            .args(["-chardev", &format!("{},id=gyro,nodelay=on", socket(gyro)), "-serial", "chardev:gyro"])
            .args(["-chardev", &format!("{},id=host,nodelay=on", socket(host)), "-serial", "chardev:host"])
            .args(["-chardev", &format!("{},id=debugger,nodelay=on", socket(debugger)), "-gdb", "chardev:debugger"])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .spawn()
            .unwrap();
        let [gyro, host, debugger] = lines.map(|line| {
            line.set_nonblocking(true).unwrap();
            let began = Instant::now();
            loop {
                match line.accept() {
                    Ok((stream, _)) => {
                        stream.set_nonblocking(false).unwrap();
                        stream.set_nodelay(true).unwrap();
                        stream.set_read_timeout(Some(PATIENCE)).unwrap();
                        return stream;
                    }
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock && began.elapsed() < PATIENCE => {
                        std::thread::sleep(Duration::from_millis(2));
                    }
                    Err(error) => panic!("QEMU does not connect: {error}"),
                }
            }
        });
        host.set_nonblocking(true).unwrap();
        let addresses = Addresses::of(image);
        let mut chip = Self { qemu, debugger, gyro, host, wfi: addresses.wfi, queues: addresses.queues };
        // QEMU writes single registers only for those who have asked which there are.
        chip.ask("qXfer:features:read:target.xml:0,fff");
        // The timer's first interrupt is its last; that one is the tick before tick 0.
        chip.run_to(addresses.tick);
        chip.ask(&format!("M{TIM2_INTERRUPT_ENABLE:x},4:00000000"));
        chip.run_to(chip.wfi);
        // From now on it is held whenever it has waited.
        chip.ask(&format!("Z0,{:x},2", chip.wfi + 2));
        chip
    }

    /// A tick of 2.5 ms: the bytes come on both lines, the timer's interrupt comes, all that follows is done. Gives what the
    /// image sent to the host.
    pub fn tick(&mut self, from_gyro: &[u8], from_host: &[u8]) -> Vec<u8> {
        self.gyro.write_all(from_gyro).unwrap();
        self.host.write_all(from_host).unwrap();
        self.take(USART1_STATUS, self.queues[0], from_gyro.len());
        self.take(USART2_STATUS, self.queues[1], from_host.len());
        self.ask(&format!("M{INTERRUPT_SET_PENDING:x},4:{}", hex(&(1_u32 << TIM2).to_le_bytes())));
        self.run();
        let mut sent = Vec::new();
        match self.host.read_to_end(&mut sent) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => sent,
            end => panic!("QEMU is gone: {end:?}"),
        }
    }

    /// Lets the image take so many bytes from a receiver into its queue, which is empty after every tick.
    fn take(&mut self, status: u32, queue: Queue, bytes: usize) {
        let began = Instant::now();
        while self.queued(queue) < bytes {
            if self.word(status) & BYTE_WAITS != 0 {
                self.run();
            }
            assert!(began.elapsed() < PATIENCE, "no byte reaches the receiver");
        }
    }

    /// Bytes in a queue: its two counters are at its beginning, the one that is read from and the one that is written to.
    fn queued(&mut self, queue: Queue) -> usize {
        let [first, second] = [0, 4].map(|offset| self.word(queue.address + offset) as usize);
        let counts = [first + queue.capacity - second, second + queue.capacity - first];
        let [one, other] = counts.map(|count| count % queue.capacity);
        one.min(other)
    }

    fn run_to(&mut self, address: u32) {
        self.ask(&format!("Z0,{address:x},2"));
        self.ask("c");
        self.ask(&format!("z0,{address:x},2"));
    }

    /// Lets the image run until it sleeps again.
    fn run(&mut self) {
        // The breakpoint is behind the waiting: the image goes on by waiting again.
        self.ask(&format!("P{PC:x}={}", hex(&self.wfi.to_le_bytes())));
        self.ask("c");
    }

    fn word(&mut self, address: u32) -> u32 {
        let answer = self.ask(&format!("m{address:x},4"));
        let byte = |at: usize| u8::from_str_radix(&answer[2 * at..2 * at + 2], 16).unwrap();
        u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
    }

    /// One exchange of GDB's remote protocol: `$request#sum`, answered by `+` and `$answer#sum`.
    fn ask(&mut self, request: &str) -> String {
        let sum = request.bytes().fold(0_u8, u8::wrapping_add);
        self.debugger.write_all(format!("${request}#{sum:02x}").as_bytes()).unwrap();
        let mut answer = Vec::new();
        while answer.len() < 3 || answer[answer.len() - 3] != b'#' {
            let mut byte = [0];
            self.debugger.read_exact(&mut byte).unwrap_or_else(|error| panic!("{request}: {error}"));
            if !(answer.is_empty() && byte[0] == b'+') {
                answer.extend(byte);
            }
        }
        self.debugger.write_all(b"+").unwrap();
        let answer = String::from_utf8(answer).unwrap();
        let answer = answer[1..answer.len() - 3].to_owned();
        assert!(!answer.starts_with('E') && !answer.is_empty(), "{request}: {answer}");
        answer
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Where the image can be held.
struct Addresses {
    /// The instruction by which `sleep` waits.
    wfi: u32,
    /// The handler of the timer's interrupt.
    tick: u32,
    queues: [Queue; 2],
}

impl Addresses {
    fn of(image: &Path) -> Self {
        let bytes = std::fs::read(image).unwrap();
        let file = object::File::parse(bytes.as_slice()).unwrap();
        let function = |wanted: fn(&str) -> bool| file.symbols().find(|symbol| symbol.name().is_ok_and(wanted)).unwrap();
        let sleep = function(|name| name.contains("board4f4055sleep"));
        let at = sleep.address() & !1;
        let code = file.section_by_name(".text").unwrap().data_range(at, sleep.size()).unwrap().unwrap();
        let wfi = at + 2 * code.chunks(2).position(|half| half == WFI).unwrap() as u64;
        let queue = |symbol: object::Symbol<'_, '_>| Queue {
            address: symbol.address() as u32,
            capacity: symbol.size() as usize - 8,
        };
        Self {
            wfi: wfi as u32,
            tick: function(|name| name == "TIM2").address() as u32 & !1,
            queues: [
                queue(function(|name| name.contains("local_init_gyro_bytes"))),
                queue(function(|name| name.contains("local_init_requests"))),
            ],
        }
    }
}
