//! The image that is flashed, executed: on QEMU's STM32F405, over its serial lines, against the run in this process.
//!
//! What the machine lacks is said in docs/board.md. Skipped with a line where it is absent.

mod chip;

use chip::Chip;
use embedded_io::Read as _;
use hal_sim::{Scenario, World};
use north::engine::qemu::image;
use north_finder::event::{Event, Report, State};
use north_finder::health::Fault;
use north_finder::link::{ReportDecoder, Request, encode_request};
use north_finder::pipeline::{Pipeline, Readings};
use north_finder::sequence::Command;
use north_finder::settings::store::Loaded;

/// What the sensors of a chip give whose SPI buses hold nothing: at their ticks, failures.
fn readings(tick: u64) -> Readings {
    Readings {
        tick,
        acceleration_g: (tick % 4 == 0).then_some(None),
        index_deg: (tick % 4 == 2).then_some(None),
        turning: false,
        refused: Default::default(),
    }
}

#[test]
fn the_flashable_image_runs_as_the_pipeline_in_this_process() {
    if !chip::is_there() {
        return;
    }
    const TICKS: u64 = 1300;
    const START_AT: u64 = 500;
    let world = World::new(&Scenario::named("calm-bench").unwrap(), 1);
    let mut gyro = world.gyro();
    let mut chip = Chip::start(&image::build(image::Board::F405).unwrap());
    let mut pipeline = Pipeline::new(Loaded::Missing);
    let (mut decoder, mut reports, mut expected) = (ReportDecoder::new(), Vec::new(), Vec::new());
    let start = encode_request(&Request::Command(Command::Start)).unwrap();
    for tick in 0..TICKS {
        world.advance_slot();
        world.sample();
        let mut bytes = [0; 64];
        let count = gyro.read(&mut bytes).unwrap();
        let request = if tick == START_AT { &start[..] } else { &[] };
        let sent = chip.tick(&bytes[..count], request);
        reports.extend(sent.iter().filter_map(|&byte| decoder.feed(byte)).map(Result::unwrap));

        if tick == START_AT {
            pipeline.command(Command::Start);
        }
        pipeline.gyro_bytes(&bytes[..count]);
        let motor = pipeline.tick(&readings(tick), &mut |report: Report| expected.push(report));
        assert_eq!(motor, None);
    }
    assert_eq!(format!("{reports:#?}"), format!("{expected:#?}"));
    let events: Vec<Event> = reports.iter().map(|report| report.event).collect();
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Second(_))).count(), 3);
    assert!(events.contains(&Event::Fault { fault: Fault::SettingsMissing, state: State::Idle }));
}
