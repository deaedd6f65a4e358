//! A fix that is carried to another place by the whole instrument, drivers, settings, sequence, hold: in this process, and for proof as
//! the firmware image in QEMU.

use std::path::Path;

use hal_sim::Scenario;
use hal_sim::scenario::{Block, Carry};
use inertial::BlockClass;
use north::engine::qemu::{self, Pace};
use north::engine::{self, FixWanted, Setup, host};
use north::failure::Failure;
use north::interrupt;
use north::settings_file::scenario_settings;
use north_finder::event::Event;
use north_finder::fix::heading::settings::{BlockSettings, Class};
use north_finder::sequence::order::Order;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::statistics::azimuth_error_deg;

/// Measuring time at each of the four positions, s: short, so that many trials are possible.
pub const DWELL_S: u16 = 20;
/// Moments of a trial, in the order of [`carry`]'s result.
pub const MOMENTS: [&str; 4] = ["the fix", "before it is lifted", "set down", "set down for 30 s"];
/// Seconds of the report after the instrument is set down, s: the first whole second on the new place.
const FIRST_S: f64 = 1.1;

/// Heading error and sigma at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    pub error_deg: f64,
    pub sigma_deg: f64,
    pub refix: bool,
    /// Of the innovations up to then, where they are told: sum of squares over their variances, number.
    pub innovations: (f64, u32),
}

/// A block of this class, as it is simulated.
pub fn simulated(class: &BlockClass) -> Block {
    Block {
        arw_deg_per_sqrt_h: class.arw_deg_sqrt_h,
        run_to_run_deg_h: class.run_to_run_deg_h,
        markov_deg_h: class.markov_deg_h,
        markov_s: class.markov_s,
        scale_ppm: class.scale_ppm,
        misalignment_arcsec: class.misalignment_arcsec,
        accelerometer_m_s2: class.accelerometer_m_s2,
        vrw_m_s_per_sqrt_s: class.vrw_m_s_sqrt_s,
        saturation_deg_s: 1.02 * class.range_deg_s,
        ..Block::default()
    }
}

/// Any heading, a walk of 10 to 120 s with a turn; the block draws its errors.
fn trial(class: Class, seed: u64) -> Result<(Setup, Carry), Failure> {
    let block = BlockSettings { class, ..BlockSettings::default() };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let carry = Carry {
        turn_deg: random.random_range(-180.0..180.0),
        walk_s: random.random_range(10.0_f64..120.0).round(),
        set_down_deg: [random.random_range(-3.0..3.0), random.random_range(-3.0..3.0)],
        ..Carry::default()
    };
    let mut scenario = Scenario::named("carried")?;
    scenario.site.azimuth_deg = random.random_range(0.0..360.0);
    scenario.block = Some(simulated(&block.figures()));
    scenario.carry = Some(carry.clone());
    let mut settings = scenario_settings(&scenario, None)?;
    settings.sequence.order = Order::Mirrored;
    settings.block = Some(block);
    settings.sequence.dwell_s = DWELL_S;
    Ok((Setup { scenario, seed, settings: Some(settings) }, carry))
}

/// Runs a trial in this process and in QEMU: whether every report and the outcome are the same, bit for bit.
///
/// Errors: as [`carry`], and whatever keeps the image from running.
pub fn same_in_qemu(image: &Path, class: Class, seed: u64) -> Result<bool, Failure> {
    let (setup, _) = trial(class, seed)?;
    // Printed with all their digits, equal numbers are equal bits (and not-a-number equals itself).
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    let outcome = host::run(&setup, interrupt::flag(), &mut |report| expected.push(format!("{report:?}")))?;
    let (in_qemu, _) =
        qemu::run(Pace::LockStep, image, &setup, interrupt::flag(), &mut |report| found.push(format!("{report:?}")))?;
    if interrupt::requested() {
        return Err(Failure::Interrupted);
    }
    Ok(expected == found && format!("{outcome:?}") == format!("{in_qemu:?}"))
}

/// A trial in this process. `None`: there was no fix.
///
/// Errors: an interrupt; the scenario or its settings cannot be read.
pub fn carry(class: Class, seed: u64) -> Result<Option<[Moment; 4]>, Failure> {
    let (setup, carry) = trial(class, seed)?;
    let world = engine::world(&setup)?;
    let (mut fixed_s, mut moments) = (f64::NAN, [None; 4]);
    let mut observe = |report: &north_finder::event::Report| {
        let error_deg = |found_deg| azimuth_error_deg(found_deg, world.truth().azimuth_deg);
        match report.event {
            Event::Fix(fix) => {
                fixed_s = report.t_s;
                let error_deg = error_deg(fix.azimuth_deg);
                moments[0] = Some(Moment { error_deg, sigma_deg: fix.sigma_deg, refix: false, innovations: (0.0, 0) });
            }
            Event::Heading(heading) => {
                let since_s = report.t_s - fixed_s;
                let moment = if since_s < carry.wait_s {
                    1
                } else if since_s < carry.wait_s + carry.walk_s + FIRST_S {
                    2
                } else {
                    3
                };
                let error_deg = error_deg(heading.heading_deg);
                let (sigma_deg, refix) = (heading.sigma_deg, heading.refix);
                moments[moment] = Some(Moment { error_deg, sigma_deg, refix, innovations: (0.0, 0) });
            }
            _ => {}
        }
    };
    let mut person = FixWanted::new(&world, &mut observe);
    host::serve(&world, engine::limit_ticks(&setup), &mut person, interrupt::flag(), &mut |_, _| ())?;
    if interrupt::requested() {
        return Err(Failure::Interrupted);
    }
    Ok(match moments {
        [Some(fix), Some(before), Some(down), Some(stood)] => Some([fix, before, down, stood]),
        _ => None,
    })
}
