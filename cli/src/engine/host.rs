//! The fix in this process: the firmware's drivers and its `Instrument` around the simulated devices.

use std::sync::atomic::{AtomicBool, Ordering};

use hal_sim::World;
use simulated::{RequestLine, Tap, Wired};

use super::{EngineError, FixWanted, Observer, Outcome, Person, PowerOff, Setup};

/// Powers the instrument up, starts a fix and goes on until it ends.
///
/// `observe` sees every report. `stop` is looked at in every tick.
/// Errors: the settings do not fit the flash.
pub fn run(setup: &Setup, stop: &AtomicBool, observe: &mut Observer<'_>) -> Result<Outcome, EngineError> {
    run_tapped(setup, stop, observe, &mut |_, _| ())
}

/// The same, with a look at what enters the instrument at every tick.
pub fn run_tapped(
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
    tap: &mut Tap<'_>,
) -> Result<Outcome, EngineError> {
    let world = super::world(setup)?;
    let mut wanted = FixWanted::new(&world, observe);
    let off = serve(&world, super::limit_ticks(setup), &mut wanted, stop, tap)?;
    Ok(wanted.outcome(off))
}

/// Powers the instrument of a world up, and lets a person work with it for at most that many ticks.
pub fn serve(
    world: &World,
    limit_ticks: u64,
    person: &mut dyn Person,
    stop: &AtomicBool,
    tap: &mut Tap<'_>,
) -> Result<PowerOff, EngineError> {
    let mut wired = Wired::power_up(world);
    let mut requests = RequestLine::default();
    for tick in 0..limit_ticks {
        if let Some(request) = person.request(tick) {
            requests.send(&request)?;
        }
        let mut heard = false;
        wired.tick(&requests.tick(), tap, &mut |report| heard |= person.hear(&report));
        if heard {
            return Ok(PowerOff::Received);
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(PowerOff::Interrupted);
        }
    }
    Ok(PowerOff::TimeLimit)
}
