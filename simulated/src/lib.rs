//! The north finder, simulated: the firmware's drivers and its [`Instrument`](north_finder::instrument::Instrument) around the simulated devices, in one process.
//!
//! The host command runs it natively, the page in a browser; both do the same things in the same order, bit for bit.

mod request_line;
mod settings;
mod stepper;

pub use request_line::RequestLine;
pub use settings::{declare_noise, default_settings, lay_over, settings};
pub use stepper::Stepper;

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, AnalogueInputs, BlockSpi, EncoderSpi, GyroLine, Pin, World};
use north_finder::drivers::analogue::{self, Input, Scan};
use north_finder::drivers::intake::Intake;
use north_finder::drivers::sensors::Sensors;
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::Report;
use north_finder::instrument::Readings;
use north_finder::sensing::index::MotorCommand;
use north_finder::sequence::work::Outcome;

/// Sees what enters the instrument at every tick: readings and gyro bytes.
pub type Tap<'a> = dyn FnMut(&Readings, &[u8]) + 'a;

/// The converter of the analogue inputs: done as soon as it begins.
struct Converter {
    inputs: AnalogueInputs,
    code: Option<u16>,
}

impl analogue::Converter for Converter {
    fn start(&mut self, input: Input) {
        self.code = Some(self.inputs.code(input as usize));
    }

    fn result(&mut self) -> Option<u16> {
        self.code
    }
}

/// The instrument and its devices, wired as on the board.
pub struct Wired {
    world: World,
    gyro: GyroLine,
    /// What the gyro sent in this tick.
    heard: Vec<u8>,
    sensors: Sensors<AccelerometerSpi, EncoderSpi, BlockSpi>,
    scan: Scan<Converter>,
    motor: StepMotor<Pin, Pin, Pin>,
    stepper: Stepper,
    intake: Box<Intake>,
    /// Decided by the last solve, carried out at the next tick.
    pending: Option<MotorCommand>,
    tick: u64,
}

impl Wired {
    /// The instrument of a world, with what its flash holds.
    pub fn power_up(world: &World) -> Self {
        let stepper = Stepper::power_up(&mut world.flash());
        let instrument = &stepper.instrument;
        let index = instrument.index_settings();
        Self {
            gyro: world.gyro(),
            heard: Vec::new(),
            sensors: Sensors::new(
                world.accelerometer(),
                world.encoder(),
                instrument.has_block().then(|| world.block()),
            ),
            scan: Scan::new(Converter { inputs: world.analogue(), code: None }),
            motor: StepMotor::new(world.step_pin(), world.dir_pin(), world.enable_pin(), &index),
            stepper,
            intake: Box::new(Intake::new()),
            pending: None,
            tick: 0,
            world: world.clone(),
        }
    }

    /// Lets the work on a second take so many ticks, by what came of it; else it takes none.
    pub fn let_work_take(&mut self, work_ticks: fn(&Outcome) -> u64) {
        self.stepper.work_ticks = work_ticks;
    }

    /// 2.5 ms, everything in the order in which the board does it. `requests`: what the host's line brings in it.
    pub fn tick(&mut self, requests: &[u8], tap: &mut Tap<'_>, report: &mut dyn FnMut(Report)) {
        for _ in 0..SLOTS_PER_TICK {
            self.motor.slot();
            self.world.advance_slot();
        }
        self.world.sample();
        self.hear_gyro();
        let (sensors, analogue) = (self.sensors.read(self.tick), self.scan.tick(self.tick));
        if let Some(command) = self.pending.take() {
            self.motor.command(command);
        }
        let limit_open = self.world.limit_is_open();
        self.motor.limit(limit_open);
        self.intake.gyro.put(&self.heard);
        self.intake.host.put(requests);
        let (turning, heard) = (self.motor.is_turning(), self.intake.heard());
        let readings = Readings { tick: self.tick, sensors, analogue, turning, limit_open, heard };
        tap(&readings, &self.heard);
        let orders = self.stepper.step(&readings, &self.intake, &mut self.world.flash(), report);
        self.pending = orders.motor;
        orders.gyro.into_iter().for_each(|byte| self.gyro.send(byte));
        if orders.test_accelerometer {
            self.sensors.test_accelerometer();
        }
        if let Some(mut workspace) = self.stepper.instrument.posed() {
            workspace.solve();
            self.stepper.instrument.solved(workspace);
        }
        self.tick += 1;
        if orders.restart {
            let work_ticks = self.stepper.work_ticks;
            *self = Self::power_up(&self.world);
            self.let_work_take(work_ticks);
        }
    }

    /// All bytes that the gyro has sent by now.
    fn hear_gyro(&mut self) {
        self.heard.clear();
        let mut bytes = [0; 64];
        while let Ok(count @ 1..) = self.gyro.read(&mut bytes) {
            self.heard.extend(bytes.iter().take(count));
        }
    }
}

#[cfg(test)]
mod tests {
    use hal_sim::Scenario;
    use north_finder::event::{Event, Fix, Report, State};
    use north_finder::health::{Flag, Refusal};
    use north_finder::instrument::EFFECT_TICKS;
    use north_finder::link::Ask;
    use north_finder::sequence::Command;
    use north_finder::sequence::order::Order;
    use north_finder::settings::{AccelerometerCalibration, Settings, store};

    use super::*;

    /// Ticks of a fix of calm-bench in the mirrored order, and of two seconds more.
    const TICKS: u64 = 400 * 130;
    const START: Ask = Ask::Command(Command::Start);

    /// Calm-bench, whose settings say of the accelerometers what they are calibrated by.
    fn calm(accelerometer: Option<AccelerometerCalibration>) -> World {
        let scenario = Scenario::named("calm-bench").unwrap();
        let world = World::new(&scenario, 1);
        let mut settings = Settings { accelerometer, ..settings(&scenario).unwrap() };
        (settings.sequence.order, settings.sequence.dwell_s) = (Order::Mirrored, 3);
        store::save(&mut world.flash(), &settings).unwrap();
        world
    }

    /// So many ticks, with what is asked in some of them, counted from the first of these; what is reported.
    fn run(wired: &mut Wired, ticks: u64, asks: &[(u64, Ask)]) -> Vec<Report> {
        let mut line = RequestLine::default();
        let mut reports = Vec::new();
        for tick in 0..ticks {
            for (_, ask) in asks.iter().filter(|(at, _)| *at == tick) {
                line.send(&(*ask).into()).unwrap();
            }
            wired.tick(&line.tick(), &mut |_, _| {}, &mut |report| reports.push(report));
        }
        reports
    }

    fn reports(work_ticks: fn(&Outcome) -> u64) -> Vec<Report> {
        let mut wired = Wired::power_up(&calm(Some(AccelerometerCalibration::UNIT)));
        wired.let_work_take(work_ticks);
        run(&mut wired, TICKS, &[(0, START)])
    }

    fn the_fix(reports: &[Report]) -> (f64, Fix) {
        let told = |report: &Report| if let Event::Fix(fix) = report.event { Some((report.t_s, fix)) } else { None };
        reports.iter().find_map(told).expect("a fix")
    }

    /// What became of what was asked.
    fn answers(reports: &[Report]) -> Vec<Option<Refusal>> {
        let told =
            |report: &Report| if let Event::Answer { refusal, .. } = report.event { Some(refusal) } else { None };
        reports.iter().filter_map(told).collect()
    }

    fn is_end(report: &Report) -> bool {
        matches!(report.event, Event::State(State::Finished | State::Failed))
    }

    fn is_fix(event: &Event) -> bool {
        matches!(event, Event::Fix(_))
    }

    /// Work that takes no tick, one, or as many as there are before the effect of a second: the same reports. An azimuth that takes 500
    /// ticks, longer than a second, is the same azimuth as of the same second, and the seconds after it are not lost.
    #[test]
    fn how_long_the_work_takes_changes_nothing() {
        let at_once = reports(|_| 0);
        assert!(at_once.iter().any(|report| is_fix(&report.event)));
        assert!(at_once == reports(|_| 1) && at_once == reports(|_| EFFECT_TICKS - 1));
        let late = reports(|outcome| if outcome.events.iter().any(is_fix) { 500 } else { 0 });
        // Counters are those of the tick at which they are reported.
        let until_end = |reports: &[Report]| {
            let fix = reports.split_inclusive(is_end).next().unwrap_or_default();
            fix.iter().filter(|report| !matches!(report.event, Event::Health(_))).copied().collect::<Vec<_>>()
        };
        assert_eq!(until_end(&at_once), until_end(&late));
        let seconds =
            |reports: &[Report]| reports.iter().filter(|report| matches!(report.event, Event::Second(_))).count();
        assert!(seconds(&at_once) == seconds(&late), "{} {}", seconds(&at_once), seconds(&late));
    }

    /// Whether accelerometers are calibrated is taken from the settings at power-up, and said of every fix.
    #[test]
    fn a_fix_says_where_accelerometers_are_not_calibrated() {
        let flagged = |accelerometer| {
            let mut wired = Wired::power_up(&calm(accelerometer));
            let (_, fix) = the_fix(&run(&mut wired, TICKS, &[(0, START)]));
            fix.flags.contains(Flag::LevelUncalibrated)
        };
        assert_eq!([None, Some(AccelerometerCalibration::UNIT)].map(flagged), [true, false]);
    }

    /// From the end of its second to its effect a fix is neither told nor logged: nothing that is asked meanwhile can be meant for it.
    #[test]
    fn a_check_waits_for_the_fix_to_be_told() {
        let world = || calm(Some(AccelerometerCalibration::UNIT));
        let (t_s, _) = the_fix(&run(&mut Wired::power_up(&world()), TICKS, &[(0, START)]));
        let ended = (t_s * 400.0).round() as u64;
        let check = Ask::CheckFix { azimuth_deg: 40.0 };
        // While the second before it waits for its effect, while it does so itself, and after its effect.
        let before = ended - 400 + EFFECT_TICKS / 2;
        let asks = [(0, START), (before, check), (ended + EFFECT_TICKS / 2, check), (ended + EFFECT_TICKS + 1, check)];
        let reports = run(&mut Wired::power_up(&world()), TICKS, &asks);
        assert_eq!(answers(&reports), [None, Some(Refusal::NoFixYet), Some(Refusal::Busy), None]);
    }

    /// A check behind a fix that the flash did not take would count for the one before it in the log.
    #[test]
    fn a_check_behind_a_fix_that_is_not_logged_is_refused() {
        let world = calm(Some(AccelerometerCalibration::UNIT));
        let mut wired = Wired::power_up(&world);
        let check = [(0, Ask::CheckFix { azimuth_deg: 40.0 })];
        world.flash().cut_power_after(0);
        the_fix(&run(&mut wired, TICKS, &[(0, START)]));
        world.flash().restore_power();
        assert_eq!(answers(&run(&mut wired, 1, &check)), [Some(Refusal::NotStored)]);
        the_fix(&run(&mut wired, TICKS, &[(0, START)]));
        assert_eq!(answers(&run(&mut wired, 1, &check)), [None]);
    }
}
