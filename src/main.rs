//! The firmware: a gyro sample every 2.5 ms, an azimuth at the end.
//!
//! | task | priority | runs when | does |
//! |---|---|---|---|
//! | `sample` | 5 | 2.5 ms have passed | tells the gyro to sample, takes what came on the lines, commands the motor |
//! | `step` | 5 | a slot of the turning motor begins | perhaps a step |
//! | `gyro_line` | 5 | a byte of the gyro is damaged | counts it |
//! | `host_line` | 5 | a byte of the host is damaged, or reports are out | counts it, tells `report` |
//! | `read` | 4 | `sample` has run | reads the sensors that are due |
//! | `solve` | 3 | `read` has readings | bytes and readings into the instrument; reports, motor commands and work out |
//! | `report` | 2 | `solve` has reports | sends them to the host, from where they are |
//! | `work` | 1 | `solve` has a second for it | does the work on it, up to the azimuth, for as long as that takes |
//! | `calibrate` | 1 | `solve` has attitudes for it | solves the accelerometers' calibration, for as long as that takes |
//! | `idle` | – | otherwise | sleeps |

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is the firmware: it runs on a board. To run it in QEMU: make find. To flash it: make flash.");
    std::process::exit(2);
}

#[cfg(target_os = "none")]
#[rtic::app(device = crate::board::pac, dispatchers = [UART4, UART5])]
mod app {
    use core::mem::MaybeUninit;
    use core::sync::atomic::{AtomicBool, Ordering};

    use heapless::spsc::{Consumer, Producer, Queue};
    use rtic_sync::channel::{Receiver, Sender};
    use rtic_sync::signal::{SignalReader, SignalWriter};
    use rtic_sync::{make_channel, make_signal};

    use crate::board::report_queue::{FRAMES, ReportSender};
    use crate::board::{self, Board, crash, memory};
    use north_finder::drivers::analogue::Scan;
    use north_finder::drivers::intake::{Intake, Received, one_more};
    use north_finder::drivers::sensors::Sensors;
    use north_finder::drivers::step_motor::StepMotor;
    use north_finder::event::identity::Identity;
    use north_finder::event::restart::Crash;
    use north_finder::event::{Event, Report};
    use north_finder::instrument::guard::{Guard, Task, Verdict};
    use north_finder::instrument::self_test::BoardFacts;
    use north_finder::instrument::workspace::Workspace;
    use north_finder::instrument::{self, Readings};
    use north_finder::sensing::index::MotorCommand;
    use north_finder::sequence::work::SecondWork;

    /// Room for as many ticks as `solve` may lag behind: 40 ms.
    const READINGS: usize = 16;
    const MOTOR_COMMANDS: usize = 4;
    /// Calibrations, and seconds, that are handed over at a time.
    const WORK: usize = 1;

    /// Who is alive.
    static GUARD: Guard = Guard::new();
    /// What the board leaves for the instrument.
    static INTAKE: Intake = Intake::new();
    /// Other settings are in flash: start anew as soon as all reports are out.
    static RESTART: AtomicBool = AtomicBool::new(false);
    /// The accelerometer shall do its own test.
    static TEST_ACCELEROMETER: AtomicBool = AtomicBool::new(false);

    type Instrument = instrument::Instrument<&'static mut SecondWork, &'static mut Workspace>;
    type Reported = SignalReader<'static, ()>;

    /// A tick: its number, whether the motor turns and the limit input is open, and what had come.
    #[derive(Clone, Copy, Default)]
    pub struct Moment {
        tick: u64,
        turning: bool,
        limit_open: bool,
        heard: Received,
    }

    #[shared]
    struct Shared {
        moment: Moment,
        #[lock_free]
        motor: StepMotor<board::Step, board::Direction, board::Enable>,
        #[lock_free]
        slots: board::Slots,
    }

    #[local]
    struct Local {
        // sample
        ticker: board::Ticker,
        watchdog: board::Watchdog,
        motor_out: Consumer<'static, MotorCommand>,
        limit: board::Limit,
        // gyro_line
        gyro: board::GyroLine,
        // host_line
        host: board::HostLine,
        sent: SignalWriter<'static, ()>,
        // read
        sensors: Sensors<board::Accelerometer, board::Encoder, board::Block>,
        scan: Scan<board::Converter>,
        readings_in: Producer<'static, Readings>,
        // solve
        readings_out: Consumer<'static, Readings>,
        instrument: &'static mut Instrument,
        motor_in: Producer<'static, MotorCommand>,
        reports: ReportSender,
        gyro_port: board::GyroPort,
        seconds_in: Sender<'static, &'static mut SecondWork, WORK>,
        seconds_done: Receiver<'static, &'static mut SecondWork, WORK>,
        problems_in: Sender<'static, &'static mut Workspace, WORK>,
        answers_out: Receiver<'static, &'static mut Workspace, WORK>,
        flash: board::Flash,
        crash: Option<Crash>,
        program: u32,
        sweep: crash::StackSweep,
        // report
        report_port: board::ReportPort,
        // work
        worked_in: Sender<'static, &'static mut SecondWork, WORK>,
        // calibrate
        answers_in: Sender<'static, &'static mut Workspace, WORK>,
    }

    #[init(local = [
        readings: Queue<Readings, { READINGS + 1 }> = Queue::new(),
        motor_commands: Queue<MotorCommand, MOTOR_COMMANDS> = Queue::new(),
        place: MaybeUninit<Instrument> = MaybeUninit::uninit(),
        work: MaybeUninit<SecondWork> = MaybeUninit::uninit(),
        workspace: MaybeUninit<Workspace> = MaybeUninit::uninit(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        // Before anything that may take longer than it should.
        let mut watchdog = board::Watchdog::start();
        let wrong_words = memory::test();
        let crash = crash::take().or_else(|| board::reset_cause().map(Crash::new));
        let mut board: Board = board::init(cx.device, &INTAKE);
        let program = crash::program();
        let identity = Identity::new(board::BOARD, program, board::serial());
        let instrument = make(cx.local.place, cx.local.work, cx.local.workspace, identity);
        power_up(instrument, &mut board.flash, &mut watchdog);
        instrument.updates_go_to(board::slots());
        if let Some(crash) = &crash {
            instrument.log_crash(crash, &mut board.flash);
        }
        let (analogue, crystal, entropy) = (board::analogue_calibration(), board.crystal, board.entropy);
        let cause = crash.map(|crash| crash.cause);
        instrument.board_is(BoardFacts { wrong_words, crash: cause, crystal, analogue, entropy });

        let (motor_in, motor_out) = cx.local.motor_commands.split();
        let (readings_in, readings_out) = cx.local.readings.split();
        let (sent, done) = make_signal!(());
        let (told, telling) = make_signal!(());
        let (seconds_in, seconds_out) = make_channel!(&'static mut SecondWork, WORK);
        let (worked_in, seconds_done) = make_channel!(&'static mut SecondWork, WORK);
        let (problems_in, problems_out) = make_channel!(&'static mut Workspace, WORK);
        let (answers_in, answers_out) = make_channel!(&'static mut Workspace, WORK);
        // Spawning for the first time cannot fail.
        let _ = report::spawn(telling, done);
        let _ = work::spawn(seconds_out);
        let _ = calibrate::spawn(problems_out);

        let shared = Shared {
            moment: Moment::default(),
            motor: StepMotor::new(board.step, board.direction, board.enable, &instrument.index_settings()),
            slots: board.slots,
        };
        let nmea = instrument.speaks_nmea();
        watchdog.feed();
        let local = Local {
            ticker: board.ticker.start(),
            watchdog,
            motor_out,
            limit: board.limit,
            gyro: board.gyro,
            host: board.host,
            sent,
            sensors: Sensors::new(board.accelerometer, board.encoder, instrument.has_block().then_some(board.block)),
            scan: Scan::new(board.converter),
            readings_in,
            readings_out,
            instrument,
            motor_in,
            reports: ReportSender::new(told, nmea, &INTAKE.reports_refused),
            gyro_port: board.gyro_port,
            seconds_in,
            seconds_done,
            problems_in,
            answers_out,
            flash: board.flash,
            crash,
            program,
            sweep: crash::StackSweep::default(),
            report_port: board.reports,
            worked_in,
            answers_in,
        };
        (shared, local)
    }

    /// Makes the instrument where it is kept.
    ///
    /// Never inlined, as the other one: what it takes of the stack is free again for what sets the instrument up.
    #[inline(never)]
    fn make(
        place: &'static mut MaybeUninit<Instrument>,
        work: &'static mut MaybeUninit<SecondWork>,
        workspace: &'static mut MaybeUninit<Workspace>,
        identity: Identity,
    ) -> &'static mut Instrument {
        place.write(Instrument::empty(identity, work.write(SecondWork::empty()), workspace.write(Workspace::default())))
    }

    /// Takes what the flash holds.
    ///
    /// Never inlined: what this takes of the stack is free again for the tasks.
    #[inline(never)]
    fn power_up(instrument: &mut Instrument, flash: &mut board::Flash, watchdog: &mut board::Watchdog) {
        instrument.set_up(flash, &mut || watchdog.feed());
        match instrument.refusal() {
            None => defmt::info!("boot: ready"),
            Some(fault) => defmt::error!("boot: no fix can be started: {}", fault),
        }
    }

    #[task(
        binds = TIM2, priority = 5, local = [ticker, watchdog, motor_out, limit, tick: u64 = 0], shared = [moment, motor, slots],
    )]
    fn sample(cx: sample::Context) {
        let (local, mut shared) = (cx.local, cx.shared);
        // Ticks that the processor stood still through are lost, and not made of the time after them.
        *local.tick += u64::from(local.ticker.sync());
        let heard = INTAKE.heard();
        while let Some(command) = local.motor_out.dequeue() {
            shared.motor.command(command);
        }
        let limit_open = local.limit.is_open();
        shared.motor.limit(limit_open);
        let turning = shared.motor.is_turning();
        if turning {
            shared.slots.start();
        }
        // One that `read` has not come to yet is lost, and counted by the gap in the numbers.
        shared.moment.lock(|moment| *moment = Moment { tick: *local.tick, turning, limit_open, heard });
        rtic::pend(board::pac::Interrupt::SPI1);
        match GUARD.tick(*local.tick) {
            Verdict::Wait => {}
            Verdict::Feed => local.watchdog.feed(),
            Verdict::Late(task) => crash::late(task.name()),
        }
        *local.tick += 1;
    }

    #[task(binds = TIM3, priority = 5, shared = [motor, slots])]
    fn step(cx: step::Context) {
        cx.shared.slots.acknowledge();
        cx.shared.motor.slot();
        if !cx.shared.motor.is_turning() {
            cx.shared.slots.stop();
        }
    }

    #[task(binds = USART1, priority = 5, local = [gyro])]
    fn gyro_line(cx: gyro_line::Context) {
        cx.local.gyro.serve(&INTAKE.gyro);
    }

    #[task(binds = USART2, priority = 5, local = [host, sent])]
    fn host_line(cx: host_line::Context) {
        if cx.local.host.serve(&INTAKE.host) {
            cx.local.sent.write(());
        }
    }

    /// Steps of the motor need not wait for the sensors' buses.
    #[task(binds = SPI1, priority = 4, local = [sensors, scan, readings_in], shared = [moment])]
    fn read(mut cx: read::Context) {
        let local = cx.local;
        let Moment { tick, turning, limit_open, heard } = cx.shared.moment.lock(|moment| *moment);
        if TEST_ACCELEROMETER.swap(false, Ordering::Relaxed) {
            local.sensors.test_accelerometer();
        }
        let (sensors, analogue) = (local.sensors.read(tick), local.scan.tick(tick));
        if local.readings_in.enqueue(Readings { tick, sensors, analogue, turning, limit_open, heard }).is_err() {
            one_more(&INTAKE.readings_refused);
        }
        rtic::pend(board::pac::Interrupt::SPI2);
    }

    #[task(
        binds = SPI2, priority = 3,
        local = [
            readings_out, instrument, motor_in, reports, gyro_port, seconds_in, seconds_done, problems_in, answers_out, flash, crash, program, sweep,
        ],
    )]
    fn solve(cx: solve::Context) {
        let local = cx.local;
        if let Some(crash) = local.crash.take() {
            defmt::error!("boot: after a {}", crash.cause);
            local.reports.send(&Report { t_s: 0.0, event: Event::Crash(crash) });
        }
        // Used where they are: copies of them are a good part of what a tick costs.
        while let Some(readings) = local.readings_out.peek() {
            GUARD.check_in(Task::Solve);
            if local.instrument.is_solving()
                && let Ok(workspace) = local.answers_out.try_recv()
            {
                local.instrument.solved(workspace);
            }
            if local.instrument.is_worked_on()
                && let Ok(work) = local.seconds_done.try_recv()
            {
                local.instrument.worked_on(work);
            }
            let mut report = |report| local.reports.send(&report);
            let orders = local.instrument.step(readings, &INTAKE, local.flash, &mut report);
            // While one is being worked on, or solved, there is no second one.
            if let Some(work) = local.instrument.second_to_work_on() {
                let _ = local.seconds_in.try_send(work);
            }
            if let Some(problem) = local.instrument.posed() {
                let _ = local.problems_in.try_send(problem);
            }
            if let Some(command) = orders.motor {
                // `sample` empties the queue at every tick.
                let _ = local.motor_in.enqueue(command);
            }
            if let Some(byte) = orders.gyro {
                local.gyro_port.send(byte);
            }
            if orders.restart {
                RESTART.store(true, Ordering::Release); // `report` has frames to send, and looks at it afterwards
            }
            if orders.test_accelerometer {
                TEST_ACCELEROMETER.store(true, Ordering::Relaxed);
            }
            if let Some(how) = orders.provoke {
                crash::provoke(how);
            }
            if GUARD.done(readings.tick, board::passed_permille()) {
                one_more(&INTAKE.ticks_late);
            }
            if let Some(stack_bytes) = local.sweep.tick(readings.tick) {
                let load_permille = GUARD.load_permille();
                let event = Event::Vitals { program: *local.program, stack_bytes, load_permille };
                local.reports.send(&Report { t_s: readings.t_s(), event });
            }
            let _ = local.readings_out.dequeue();
        }
    }

    #[task(priority = 2, local = [report_port])]
    async fn report(cx: report::Context, mut telling: Reported, mut done: Reported) {
        loop {
            // Looked at first: the reports that lead to it are put before it.
            let (restart, frames) = (RESTART.load(Ordering::Acquire), FRAMES.waiting());
            if frames.is_empty() {
                if restart {
                    board::restart();
                }
                telling.wait().await;
                continue;
            }
            GUARD.sending(true);
            let _ = done.try_read(); // what the line's start has told
            cx.local.report_port.start(frames);
            done.wait().await;
            FRAMES.free(frames.len());
            crash::hang_if_provoked().await;
            GUARD.sending(false);
        }
    }

    #[task(priority = 1, local = [worked_in])]
    async fn work(cx: work::Context, mut seconds_out: Receiver<'static, &'static mut SecondWork, WORK>) {
        while let Ok(second) = seconds_out.recv().await {
            second.run();
            let _ = cx.local.worked_in.try_send(second);
        }
    }

    #[task(priority = 1, local = [answers_in])]
    async fn calibrate(cx: calibrate::Context, mut problems_out: Receiver<'static, &'static mut Workspace, WORK>) {
        while let Ok(problem) = problems_out.recv().await {
            problem.solve();
            let _ = cx.local.answers_in.try_send(problem);
        }
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            GUARD.check_in(Task::Idle);
            board::sleep();
        }
    }
}
