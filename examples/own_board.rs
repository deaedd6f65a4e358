//! A board of one's own, in as few lines as it takes: ports, the instrument, a tick every 2.5 ms.
//!
//! `cargo run --example own_board --no-default-features`
//!
//! The ports are those of the simulated devices here; on a board they are its UART, its SPI devices and its pins. `src/board` holds two
//! boards, `src/main.rs` the tasks that tick them: there the work on a second goes to a task of low priority, here it is done at once.

use embedded_io::Read;
use hal_sim::{Scenario, World};
use north_finder::drivers::intake::Intake;
use north_finder::drivers::sensors::Sensors;
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::identity::Identity;
use north_finder::event::{Event, Report};
use north_finder::instrument::workspace::Workspace;
use north_finder::instrument::{Instrument, Readings};
use north_finder::link::{Ask, Request, encode_request};
use north_finder::sequence::Command;
use north_finder::sequence::work::SecondWork;
use north_finder::settings::{Settings, store};

/// Ticks after which a fix has to be over: ten minutes.
const MOST_TICKS: u64 = 240_000;

fn main() {
    let scenario = Scenario::named("calm-bench").expect("a built-in scenario");
    let world = World::new(&scenario, 1);
    // What `north settings push` does over the link: the latitude is the least that a fix needs.
    let settings = Settings { latitude_deg: scenario.site.latitude_deg, ..Settings::default() };
    store::save(&mut world.flash(), &settings).expect("a flash that can be written");

    let (mut gyro, mut flash) = (world.gyro(), world.flash());
    let mut instrument =
        Instrument::power_up(&mut flash, Identity::host(), Box::new(SecondWork::empty()), Box::<Workspace>::default());
    let block = instrument.has_block().then(|| world.block());
    let mut sensors = Sensors::new(world.accelerometer(), world.encoder(), block);
    let mut motor = StepMotor::new(world.step_pin(), world.dir_pin(), world.enable_pin(), &instrument.index_settings());
    let intake = Intake::new();
    // What `north find --port` sends: begin a fix.
    let start = Request { number: 1, ask: Ask::Command(Command::Start) };
    intake.host.put(&encode_request(&start).expect("a request that is short enough"));
    let mut over = false;
    for tick in 0..MOST_TICKS {
        // What happens between two ticks: the step generator of the motor runs, and bytes of the gyro arrive.
        for _ in 0..SLOTS_PER_TICK {
            motor.slot();
            world.advance_slot();
        }
        world.sample();
        let mut bytes = [0; 64];
        while let Ok(count @ 1..) = gyro.read(&mut bytes) {
            intake.gyro.put(&bytes[..count]);
        }
        let (turning, heard) = (motor.is_turning(), intake.heard());
        let readings =
            Readings { tick, sensors: sensors.read(tick), analogue: None, turning, limit_open: false, heard };
        let orders = instrument.step(&readings, &intake, &mut flash, &mut |report| over |= tell(&report));
        if let Some(mut second) = instrument.second_to_work_on() {
            second.run();
            instrument.worked_on(second);
        }
        if let Some(command) = orders.motor {
            motor.command(command);
        }
        if orders.test_accelerometer {
            sensors.test_accelerometer();
        }
        if over {
            return;
        }
    }
    println!("no azimuth in ten minutes");
}

/// What a person wants to read; whether that was the last.
fn tell(report: &Report) -> bool {
    match &report.event {
        Event::State(state) => println!("{:6.1} s  {state:?}", report.t_s),
        Event::Dwell(dwell) => println!("{:6.1} s  {dwell:?}", report.t_s),
        Event::Fix(fix) => {
            println!("{:6.1} s  azimuth {:.3}° ± {:.3}°", report.t_s, fix.azimuth_deg, fix.sigma_deg);
            return true;
        }
        Event::Fault { fault, .. } => {
            println!("{:6.1} s  {}: {}", report.t_s, fault.name(), fault.meaning());
            return true;
        }
        _ => {}
    }
    false
}
