//! QEMU's STM32F405 with the flashable image in it, one tick at a time.
//!
//! QEMU's timers and serial lines know nothing of each other, and its model of the timer fires without pause once it has run
//! out. So the test is the clock: through QEMU's debugger interface it stops the timer at its first interrupt, holds the
//! processor wherever the image is about to sleep, puts bytes on the lines until the image has taken them, and raises the 2.5 ms
//! timer's interrupt itself. Every run is the same.

use std::io::{self, Read, Write};
use std::mem::offset_of;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use north_finder::intake::Intake;
use object::{Object, ObjectSection, ObjectSymbol};

const MACHINE: &str = "netduinoplus2";
/// The sectors of the flash that hold settings.
const SETTINGS: u32 = 0x0800_4000;
const SECTOR: usize = 16 * 1024;
/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(60);
/// A tick's work takes less; a task that takes longer hangs, and is interrupted.
const HANGS_AFTER: Duration = Duration::from_millis(5);

/// Interrupt of TIM2 (RM0090, table 61), and the registers that raise interrupts by software and take them back (ARMv7-M,
/// B3.4.4 and B3.4.5).
const TIM2: u32 = 28;
const INTERRUPT_SET_PENDING: u32 = 0xE000_E200;
const INTERRUPT_CLEAR_PENDING: u32 = 0xE000_E280;
/// Control register of TIM2 and its interrupts' enabling (RM0090, 18.4.1 and 18.4.4).
const TIM2_CONTROL: u32 = 0x4000_0000;
const TIM2_INTERRUPT_ENABLE: u32 = 0x4000_000C;
/// Thumb instruction "wait for interrupt".
const WFI: [u8; 2] = [0x30, 0xBF];
const PC: u32 = 15;
/// What interrupts an image that runs.
const INTERRUPT: u8 = 3;
/// Memory that the machine has beyond the chip's, for instructions of the test: what a debugger writes does not reach devices.
const SPARE: u32 = 0x2002_0000;
/// Waits until the word at r2 is what r1 says.
const AWAIT: u32 = SPARE;
const AWAIT_CODE: [u16; 4] = [
    0x6810, // ldr r0, [r2]
    0x4288, // cmp r0, r1
    0xD1FC, // bne, to the beginning
    0xBF00, // nop: it is held here
];
const AWAIT_END: u32 = SPARE + 6;
/// Stores r1 where r0 says.
const STORE: u32 = SPARE + 0x10;
const STORE_CODE: [u16; 1] = [0x6001];
/// Raises the timer's interrupt and goes on behind the sleep.
const TICK: u32 = SPARE + 0x20;
const TICK_CODE: [u16; 6] = [
    0x4802, // ldr r0, [pc, #8]
    0x4903, // ldr r1, [pc, #12]
    0x6001, // str r1, [r0]
    0x4A03, // ldr r2, [pc, #12]
    0x4710, // bx r2
    0xBF00, // nop
];

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
    addresses: Addresses,
    /// What QEMU reads the settings from, at every reset.
    _stored: tempfile::NamedTempFile,
}

impl Drop for Chip {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

impl Chip {
    /// Powers the chip up, with this in the first of the flash's sectors for settings and the second one erased, and waits until the
    /// image has nothing left to do.
    pub fn start(image: &Path, settings: &[u8]) -> Self {
        let listen = || TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let lines = [listen(), listen(), listen()];
        let socket = |line: &TcpListener| format!("socket,host=127.0.0.1,port={}", line.local_addr().unwrap().port());
        let [gyro, host, debugger] = &lines;
        let mut stored = tempfile::NamedTempFile::new().unwrap();
        let sectors = settings.iter().copied().chain(std::iter::repeat(0xFF)).take(2 * SECTOR);
        stored.write_all(&sectors.collect::<Vec<u8>>()).unwrap();
        let qemu = Command::new("qemu-system-arm")
            .args(["-machine", MACHINE, "-nodefaults", "-display", "none", "-S"])
            .args(["-chardev", &format!("{},id=gyro,nodelay=on", socket(gyro)), "-serial", "chardev:gyro"])
            .args(["-chardev", &format!("{},id=host,nodelay=on", socket(host)), "-serial", "chardev:host"])
            .args(["-chardev", &format!("{},id=debugger,nodelay=on", socket(debugger)), "-gdb", "chardev:debugger"])
            .args(["-device", &format!("loader,file={},addr={SETTINGS:#x},force-raw=on", stored.path().display())])
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
        let mut chip = Self { qemu, debugger, gyro, host, addresses: Addresses::of(image), _stored: stored };
        // QEMU writes single registers only for those who have asked which there are.
        chip.ask("qXfer:features:read:target.xml:0,fff");
        let behind_sleep = chip.addresses.wfi + 2;
        let constants = [INTERRUPT_SET_PENDING, 1 << TIM2, behind_sleep | 1].map(u32::to_le_bytes);
        for (place, code) in [(AWAIT, &AWAIT_CODE[..]), (STORE, &STORE_CODE), (TICK, &TICK_CODE)] {
            let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
            chip.write_memory(place, &bytes);
        }
        chip.write_memory(TICK + 2 * TICK_CODE.len() as u32, constants.as_flattened());
        // From now on it is held wherever it is about to sleep, and where it has waited for bytes.
        chip.ask(&format!("Z0,{:x},2", chip.addresses.wfi));
        chip.ask(&format!("Z0,{AWAIT_END:x},2"));
        chip.boot();
        chip
    }

    /// Lets the image start, from a reset to its first sleep, with the timer stopped before or at its first interrupt: that is
    /// tick 0.
    fn boot(&mut self) {
        let handler = self.addresses.tick;
        self.ask(&format!("Z0,{handler:x},2"));
        self.go_on();
        self.ask(&format!("z0,{handler:x},2"));
        for (register, value) in [(TIM2_CONTROL, 0), (TIM2_INTERRUPT_ENABLE, 0), (INTERRUPT_CLEAR_PENDING, 1 << TIM2)] {
            self.poke(register, value);
        }
        if self.register(PC) == handler {
            self.go_on();
        } else {
            self.raise_tick();
        }
    }

    /// What the image has sent to the host.
    pub fn sent(&mut self) -> Vec<u8> {
        let mut sent = Vec::new();
        match self.host.read_to_end(&mut sent) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => sent,
            end => panic!("QEMU is gone: {end:?}"),
        }
    }

    /// A tick of 2.5 ms: the bytes come on both lines, the timer's interrupt comes, all that follows is done. Gives what the
    /// image sent to the host.
    pub fn tick(&mut self, from_gyro: &[u8], from_host: &[u8]) -> Vec<u8> {
        self.receive(from_gyro, from_host);
        self.raise_tick();
        self.sent()
    }

    /// A request that makes the image start anew, and that start. Whatever hangs, the timer's interrupt goes on.
    pub fn crash(&mut self, from_host: &[u8]) {
        self.receive(&[], from_host);
        let reset = self.addresses.reset;
        self.ask(&format!("Z0,{reset:x},2"));
        let mut at = self.addresses.wfi;
        for _ in 0..1000 {
            if at == self.addresses.wfi {
                self.set_register(PC, TICK);
            } else {
                self.poke(INTERRUPT_SET_PENDING, 1 << TIM2);
            }
            self.send("c");
            at = self.stopped_within(HANGS_AFTER);
            if at == reset {
                self.ask(&format!("z0,{reset:x},2"));
                return self.boot();
            }
        }
        panic!("no reset in 1000 ticks");
    }

    /// Where the processor is when it is held; or, where it is not in that time, where it then is.
    fn stopped_within(&mut self, time: Duration) -> u32 {
        let mut first = [0];
        // The acknowledgement comes at once, the answer when it is held.
        self.debugger.read_exact(&mut first).unwrap();
        self.debugger.set_read_timeout(Some(time)).unwrap();
        if self.debugger.peek(&mut first).is_err() {
            self.debugger.write_all(&[INTERRUPT]).unwrap();
        }
        self.debugger.set_read_timeout(Some(PATIENCE)).unwrap();
        self.answer("c");
        self.register(PC)
    }

    fn receive(&mut self, from_gyro: &[u8], from_host: &[u8]) {
        let [gyro, host] = self.addresses.received;
        self.gyro.write_all(from_gyro).unwrap();
        self.take(gyro, from_gyro.len());
        self.host.write_all(from_host).unwrap();
        self.take(host, from_host.len());
    }

    /// Lets the image take so many bytes, which it counts: it waits for them where it would sleep.
    fn take(&mut self, received: u32, bytes: usize) {
        if bytes > 0 {
            let end = self.word(received).wrapping_add(bytes as u32);
            self.set_register(1, end);
            self.set_register(2, received);
            self.set_register(PC, AWAIT);
            self.go_on();
        }
    }

    /// The timer's interrupt and all that follows, until the image is about to sleep again. It goes on behind the sleep, so that
    /// what is pending comes first and is never waited for.
    fn raise_tick(&mut self) {
        self.set_register(PC, TICK);
        self.go_on();
    }

    /// Lets the image go on to the next place where it is held.
    fn go_on(&mut self) {
        self.ask("c");
    }

    fn write_memory(&mut self, address: u32, bytes: &[u8]) {
        self.ask(&format!("M{address:x},{:x}:{}", bytes.len(), hex(bytes)));
    }

    fn register(&mut self, number: u32) -> u32 {
        let answer = self.ask(&format!("p{number:x}"));
        word(&answer)
    }

    fn set_register(&mut self, number: u32, value: u32) {
        self.ask(&format!("P{number:x}={}", hex(&value.to_le_bytes())));
    }

    /// Writes a register of a device, by the processor.
    fn poke(&mut self, address: u32, value: u32) {
        let kept = [0, 1, PC].map(|number| (number, self.register(number)));
        for (number, value) in [(0, address), (1, value), (PC, STORE)] {
            self.set_register(number, value);
        }
        self.ask("s");
        kept.into_iter().for_each(|(number, value)| self.set_register(number, value));
    }

    fn word(&mut self, address: u32) -> u32 {
        let answer = self.ask(&format!("m{address:x},4"));
        word(&answer)
    }

    /// One exchange of GDB's remote protocol: `$request#sum`, answered by `+` and `$answer#sum`.
    fn ask(&mut self, request: &str) -> String {
        self.send(request);
        self.answer(request)
    }

    fn send(&mut self, request: &str) {
        let sum = request.bytes().fold(0_u8, u8::wrapping_add);
        self.debugger.write_all(format!("${request}#{sum:02x}").as_bytes()).unwrap();
    }

    fn answer(&mut self, request: &str) -> String {
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

fn word(answer: &str) -> u32 {
    let byte = |at: usize| u8::from_str_radix(&answer[2 * at..2 * at + 2], 16).unwrap();
    u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Where the image can be held.
struct Addresses {
    /// The instruction by which `sleep` waits.
    wfi: u32,
    /// The handler of the timer's interrupt, and of a reset.
    tick: u32,
    reset: u32,
    /// Where the bytes from gyro and host are counted.
    received: [u32; 2],
}

impl Addresses {
    fn of(image: &Path) -> Self {
        let bytes = std::fs::read(image).unwrap();
        let file = object::File::parse(bytes.as_slice()).unwrap();
        let function =
            |wanted: fn(&str) -> bool| file.symbols().find(|symbol| symbol.name().is_ok_and(wanted)).unwrap();
        let sleep = function(|name| name.contains("board4f4055sleep"));
        let at = sleep.address() & !1;
        let code = file.section_by_name(".text").unwrap().data_range(at, sleep.size()).unwrap().unwrap();
        let wfi = at + 2 * code.chunks(2).position(|half| half == WFI).unwrap() as u64;
        let intake = function(|name| name.contains("INTAKE")).address() as u32;
        Self {
            wfi: wfi as u32,
            tick: function(|name| name == "TIM2").address() as u32 & !1,
            reset: function(|name| name == "Reset").address() as u32 & !1,
            received: [offset_of!(Intake, gyro), offset_of!(Intake, host)].map(|line| intake + line as u32),
        }
    }
}
