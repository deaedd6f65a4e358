//! The board in QEMU: what a fix does not show. Needs QEMU and the thumb target, as `make setup` brings them.

use std::collections::VecDeque;
use std::sync::OnceLock;

use hal_sim::Scenario;
use north_finder::effects::basis::curve::Curve;
use north_finder::effects::basis::curve::function::Function;
use north_finder::effects::basis::curve::signal::Signal;
use north_finder::effects::{Basis, ChannelName, ErrorModel, MAX_TERMS, Term};
use north_finder::event::restart::{Cause, Crash, Provocation};
use north_finder::event::{Event, Report, Second, State};
use north_finder::health::Counters;
use north_finder::link::{self, Request};
use north_finder::sequence::Command;
use north_finder::sequence::order::Order;
use north_finder::settings::Settings;

use super::*;
use crate::engine::{End, limit_ticks, to_store};
use crate::settings_file::scenario_settings;

/// The image, built once.
fn image() -> &'static Path {
    static IMAGE: OnceLock<std::path::PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| image::build(image::Board::Mps2).unwrap())
}

fn setup(seconds: f64) -> Setup {
    let mut scenario = Scenario::named("calm-bench").unwrap();
    scenario.duration_limit_s = seconds;
    let settings = Some(scenario_settings(&scenario, None).unwrap());
    Setup { scenario, seed: 1, settings }
}

fn never() -> AtomicBool {
    AtomicBool::new(false)
}

#[test]
#[ignore = "in real time, for which the machine must be idle: make proofs"]
fn uarts_and_timers_in_real_time() {
    let (mut seconds, mut lost, mut refused) = (0, 0, 0);
    let (outcome, cost) = run(Pace::RealTime, image(), &setup(4.5), &never(), &mut |report| match report.event {
        Event::Second(second) => {
            seconds += 1;
            lost += second.lost_frames;
        }
        Event::Health(counters) => refused += counters.bytes_refused,
        _ => {}
    })
    .unwrap();
    assert_eq!(outcome.end, End::TimeLimit);
    assert_eq!((seconds, lost, refused), (4, 0, 0));
    assert!(cost.speed() < 1.1, "faster than real time: {}", cost.speed());
}

#[test]
fn an_interrupted_run_leaves_no_process() {
    let stop = never();
    let mut reports = 0;
    let (outcome, cost) = run(Pace::LockStep, image(), &setup(1000.0), &stop, &mut |_| {
        reports += 1;
        stop.store(reports >= 10, Ordering::Relaxed);
    })
    .unwrap();
    assert_eq!(outcome.end, End::Interrupted);
    assert!(cost.ticks < 20 * 400);
    // QEMU's exit was waited for: see `Qemu::drop`.
}

#[test]
fn settings_arrive_over_the_link_and_outlive_the_restart() {
    let settings = Settings { latitude_deg: 51.5, model: Some(longest_model()), ..setup(1.0).settings.unwrap() };
    let mut person = Loader { settings, upload: VecDeque::new(), stored: false, states: Vec::new() };
    let world = World::new(&setup(10.0).scenario, 1);
    let (off, _) = serve(Pace::LockStep, image(), &world, 4000, &mut person, &never()).unwrap();
    assert_eq!(off, PowerOff::TimeLimit);
    assert!(person.stored && person.states.contains(&State::Watching), "{:?}", person.states);
}

/// As many effects as a model can have, with as many knots and coefficients; none of them moves the rate.
fn longest_model() -> ErrorModel {
    let function = Function::Table([1.1, 2.2, 3.3, 4.4].into_iter().collect());
    let channel = ChannelName::new("temp_c").unwrap();
    let curve = Term::new(Basis::Curve(Curve { channel, signal: Signal::Value, function }));
    let mut model = ErrorModel { terms: std::iter::repeat_n(curve, MAX_TERMS).collect(), ..ErrorModel::default() };
    model.doubt.directions = std::iter::repeat_n(std::iter::repeat_n(0.0, 48).collect(), 3).collect();
    model
}

/// Loads settings into an empty instrument and then starts a fix.
struct Loader {
    settings: Settings,
    upload: VecDeque<Request>,
    stored: bool,
    states: Vec<State>,
}

impl Person for Loader {
    fn request(&mut self, tick: u64) -> Option<Request> {
        match tick {
            400 => self.upload = to_store(&self.settings),
            1200 => return Some(link::Ask::Command(Command::Start).into()),
            _ => {}
        }
        self.upload.pop_front()
    }

    fn hear(&mut self, report: &Report) -> bool {
        match report.event {
            Event::State(state) => self.states.push(state),
            Event::SettingsStored => self.stored = true,
            _ => {}
        }
        false
    }
}

/// Provokes a crash while the motor turns, and hears what the next start tells.
struct Saboteur<'a> {
    world: &'a World,
    how: Provocation,
    provoked: bool,
    turning: bool,
    crash: Option<Crash>,
    current_after: bool,
    seconds_after: usize,
}

impl Person for Saboteur<'_> {
    fn request(&mut self, tick: u64) -> Option<Request> {
        if self.turning && !self.provoked {
            self.provoked = true;
            return Some(link::Ask::Provoke(self.how).into());
        }
        (tick == 0).then(|| link::Ask::Command(Command::Start).into())
    }

    fn hear(&mut self, report: &Report) -> bool {
        match report.event {
            Event::Moving { .. } => self.turning = true,
            Event::Crash(crash) => self.crash = Some(crash),
            Event::Second(_) if self.crash.is_some() => {
                self.seconds_after += 1;
                self.current_after |= self.world.motor_has_current();
            }
            _ => {}
        }
        self.seconds_after >= 2
    }
}

/// The first turn comes after a second of levelling and a dwell of two.
fn turns_early(mut setup: Setup) -> Setup {
    let settings = setup.settings.as_mut().unwrap();
    settings.level.seconds = 1;
    (settings.sequence.order, settings.sequence.dwell_s) = (Order::Mirrored, 2);
    setup
}

/// What is told of a crash that is provoked while the motor turns.
fn crash_of(how: Provocation, pace: Pace) -> Crash {
    let setup = turns_early(setup(60.0));
    let world = crate::engine::world(&setup).unwrap();
    let mut person = Saboteur {
        world: &world,
        how,
        provoked: false,
        turning: false,
        crash: None,
        current_after: false,
        seconds_after: 0,
    };
    let (off, _) = serve(pace, image(), &world, limit_ticks(&setup), &mut person, &never())
        .unwrap_or_else(|error| panic!("{how:?}: {error}"));
    assert_eq!(off, PowerOff::Received, "{how:?}: {:?}", person.crash);
    assert!(person.provoked && !person.current_after, "{how:?}");
    person.crash.unwrap()
}

/// A panic, a hard fault, a stack overflow and a task that hangs: each is survived with the motor off, and told at the next
/// start. In lock-step no tick comes while a task hangs: there it is the watchdog that ends it.
#[test]
fn a_crash_is_survived_and_told() {
    let whole = std::fs::read(image()).unwrap();
    let causes = [
        (Provocation::Panic, Cause::Panic),
        (Provocation::HardFault, Cause::HardFault),
        (Provocation::StackOverflow, Cause::StackOverflow),
        (Provocation::Hang, Cause::Watchdog),
    ];
    let crashes = causes.map(|(how, cause)| {
        let crash = crash_of(how, Pace::LockStep);
        assert_eq!(crash.cause, cause);
        crash
    });
    let [panic, hard_fault, stack_overflow, hang] = crashes;
    assert_eq!((panic.file.as_str(), panic.message.as_str()), ("src/board/crash.rs", "provoked"));
    assert!(panic.line > 0);
    // In the program, by an instruction that is none (UNDEFINSTR, ARMv7-M B3.2.15).
    let in_program = |address: u32| (0x400..whole.len() as u32).contains(&address);
    assert!(in_program(hard_fault.program_counter) && hard_fault.fault_status == 1 << 16, "{hard_fault:?}");
    // Below the stack, 0x2000_0000, where there is nothing.
    assert!(stack_overflow.stack_pointer < 0x2000_0000, "{stack_overflow:?}");
    assert!(in_program(hang.program_counter), "{hang:?}");
    // One program, by its check sum.
    assert!(panic.program != 0 && crashes.iter().all(|crash| crash.program == panic.program));
}

/// Where ticks go on, the task that hangs is found and named.
#[test]
fn a_task_that_hangs_is_named() {
    for (how, name) in [(Provocation::Hang, "solve"), (Provocation::HangReport, "report")] {
        let crash = crash_of(how, Pace::FreeRunning);
        assert_eq!((crash.cause, crash.message.as_str()), (Cause::LateTask, name));
    }
}

/// Lets the work of a tick take many, at some ticks.
struct Laggard {
    fix: bool,
    /// Of these, every so many.
    every: u64,
    ticks: u8,
    /// When the counters are asked for.
    status_tick: u64,
    reports: Vec<Report>,
    counters: Counters,
}

impl Person for Laggard {
    fn request(&mut self, tick: u64) -> Option<Request> {
        match tick {
            0 if self.fix => Some(link::Ask::Command(Command::Start).into()),
            _ if tick == self.status_tick => Some(link::Ask::Status.into()),
            // In the middle of a second: no turn of the motor is decided then, which would begin later.
            _ if tick % self.every == 200 => Some(link::Ask::Provoke(Provocation::Lag { ticks: self.ticks }).into()),
            _ => None,
        }
    }

    fn hear(&mut self, report: &Report) -> bool {
        match report.event {
            Event::Health(counters) => self.counters = counters,
            event if event.is_of_board() => {}
            _ => self.reports.push(*report),
        }
        false
    }
}

/// What a free-running board and the instrument in this process tell, for so many seconds.
fn lagging(fix: bool, every: u64, ticks: u8, seconds: f64) -> [Laggard; 2] {
    let setup = turns_early(setup(seconds));
    let run = |free_running: bool| {
        let world = crate::engine::world(&setup).unwrap();
        let limit = limit_ticks(&setup);
        let (reports, counters) = (Vec::new(), Counters::default());
        let mut person = Laggard { fix, every, ticks, status_tick: limit - 100, reports, counters };
        let off = if free_running {
            serve(Pace::FreeRunning, image(), &world, limit, &mut person, &never()).unwrap().0
        } else {
            crate::engine::host::serve(&world, limit, &mut person, &never(), &mut |_, _| ()).unwrap()
        };
        assert_eq!(off, PowerOff::TimeLimit);
        person
    };
    [run(true), run(false)]
}

/// A solution that lags by six ticks and more, every second, in a fix with turns and dwells: every event is the one of an instrument
/// that never lags, with all digits.
#[test]
fn who_lags_shifts_nothing() {
    let [late, prompt] = lagging(true, 400, 6, 24.0);
    let Counters { ticks_late, ticks_lost, readings_refused, reports_refused, .. } = late.counters;
    assert_eq!((ticks_lost, readings_refused, reports_refused, prompt.counters.ticks_late), (0, 0, 0, 0));
    assert!(ticks_late >= 23 * 6, "{ticks_late}");
    let dwells = prompt.reports.iter().filter(|report| matches!(report.event, Event::Dwell(_)));
    assert!(dwells.count() >= 2);
    for (late, prompt) in late.reports.iter().zip(&prompt.reports) {
        assert_eq!(format!("{late:?}"), format!("{prompt:?}"));
    }
    // What the board has still to tell when its time is over.
    assert!(late.reports.len() + 3 > prompt.reports.len(), "{} {}", late.reports.len(), prompt.reports.len());
}

fn seconds(person: &Laggard) -> Vec<Second> {
    let second = |report: &Report| if let Event::Second(second) = report.event { Some(second) } else { None };
    person.reports.iter().filter_map(second).collect()
}

/// Beyond the queue of 16 ticks readings are lost, and counted; the gyro's frames are not, they wait in their ring. Where more of them
/// wait than the sampler has patience for (60 ticks), the second says so. No other second is touched.
#[test]
fn a_lag_beyond_the_queue_is_counted_and_stays_in_its_second() {
    for (ticks, frames_lost) in [(30, false), (100, true)] {
        let [late, prompt] = lagging(false, 4000, ticks, 4.0);
        let (late_seconds, prompt_seconds) = (seconds(&late), seconds(&prompt));
        let Counters { ticks_lost, readings_refused, .. } = late.counters;
        assert_eq!(ticks_lost, readings_refused);
        // What interrupts the lag makes it longer, by less than a fifth.
        let least = u32::from(ticks) - 16;
        assert!((least..=least + u32::from(ticks) / 5).contains(&ticks_lost), "{ticks_lost}");
        let mut touched = 0;
        for (late, prompt) in late_seconds.iter().zip(&prompt_seconds) {
            assert_eq!(late.t_s, prompt.t_s);
            if late == prompt {
                continue;
            }
            touched += 1;
            if frames_lost {
                assert!(late.lost_frames > 8, "{late:?}");
            } else {
                // The gyro's part has all digits; the means of the others lack some readings of a base at rest.
                assert_eq!((late.fog_arcsec, late.moment_arcsec_s), (prompt.fog_arcsec, prompt.moment_arcsec_s));
                let (late, prompt) = (late.level.unwrap().mean, prompt.level.unwrap().mean);
                assert!((late.forward - prompt.forward).abs() < 1e-4, "{late:?} {prompt:?}");
            }
        }
        assert_eq!(touched, 1);
    }
}

#[test]
fn a_missing_qemu_image_is_an_error() {
    let nothing = Path::new("no/such/image");
    let error = run(Pace::LockStep, nothing, &setup(1.0), &never(), &mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("no/such/image"), "{error}");
}

#[test]
fn an_answer_that_is_none_ends_the_board_and_it_says_so() {
    let (mut qemu, _) = start(Pace::LockStep, image()).unwrap();
    let error = loop {
        match qemu.receive() {
            Ok(Ask::ReadFlash { length, .. }) => {
                let erased = vec![0xFF; length.into()];
                qemu.reply(&erased).unwrap();
            }
            Ok(Ask::Panic { text }) => break text.to_owned(),
            Ok(Ask::Tick { .. }) => qemu.reply(&[0]).unwrap(),
            Ok(_) => {}
            Err(error) => panic!("{error}"),
        }
    };
    assert!(error.contains("too short"), "{error}");
    assert!(matches!(qemu.receive(), Err(QemuError::Died(_))));
}

/// Sends settings half a second after the motor began to turn by a quarter.
struct Impatient {
    settings: Settings,
    upload: VecDeque<Request>,
    moving: bool,
    ticks: u32,
    refused: Option<u32>,
}

impl Person for Impatient {
    fn request(&mut self, tick: u64) -> Option<Request> {
        self.ticks += u32::from(self.moving);
        if self.ticks == 200 && self.moving {
            self.upload = to_store(&self.settings);
        }
        if tick == 0 { Some(link::Ask::Command(Command::Start).into()) } else { self.upload.pop_front() }
    }

    fn hear(&mut self, report: &Report) -> bool {
        match report.event {
            Event::Moving { .. } => self.moving = true,
            Event::Health(counters) => self.refused = Some(counters.commands_bad),
            _ => {}
        }
        matches!(report.event, Event::State(State::Finished))
    }
}

#[test]
fn settings_are_refused_while_the_motor_turns() {
    let setup = turns_early(setup(1000.0));
    for qemu in [false, true] {
        let world = crate::engine::world(&setup).unwrap();
        let settings = setup.settings.clone().unwrap();
        let mut person = Impatient { settings, upload: VecDeque::new(), moving: false, ticks: 0, refused: None };
        let off = if qemu {
            serve(Pace::LockStep, image(), &world, limit_ticks(&setup), &mut person, &never()).unwrap().0
        } else {
            crate::engine::host::serve(&world, limit_ticks(&setup), &mut person, &never(), &mut |_, _| ()).unwrap()
        };
        // The fix went on to its end.
        assert_eq!((off, person.refused), (PowerOff::Received, Some(1)));
    }
}
