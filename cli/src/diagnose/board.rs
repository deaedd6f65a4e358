//! What a board can run of a model, and what it lacks.

use north_finder::effects::signal::Signal;
use north_finder::effects::{ChannelName, Effect, ErrorModel};
use north_finder::settings::{BlockSettings, Settings};

use super::doubt;
use super::result::BoardLack;
use crate::run_data::RunData;

/// The channels that the board of these runs measures beyond those of every second, an inertial block's among them.
pub fn measured<'a>(mut runs: impl Iterator<Item = &'a RunData>) -> Vec<ChannelName> {
    let own = runs.next().map_or_else(Settings::default, |run| run.settings.clone());
    let with_block = Settings { block: own.block.or(Some(BlockSettings::default())), ..own };
    with_block.channels().iter().copied().collect()
}

/// What a model says of channels and of a run as a whole that such a board does not measure, by name and with why.
pub fn lacks(model: &ErrorModel, measured: &[ChannelName]) -> Vec<BoardLack> {
    let of_channel = |name: &ChannelName| {
        format!("the board does not measure channel `{}`: give an analogue input that name", name.as_str())
    };
    let missing = |name: &&ChannelName| !name.is_on_board(measured);
    let of_terms = model.terms.iter().filter_map(|term| {
        let why = of_channel(term.channels().find(missing)?);
        Some(BoardLack { effect: term.to_string(), why })
    });
    let of_effects = model.effects.iter().filter_map(|effect| {
        let clock = follows_clock(effect).then(|| "the board has no clock that says the time of day".to_owned());
        let why = effect.channels().find(missing).map(of_channel).or(clock)?;
        Some(BoardLack { effect: effect.to_string(), why })
    });
    of_terms.chain(of_effects).collect()
}

fn follows_clock(effect: &Effect) -> bool {
    effect.factors.iter().any(|factor| matches!(factor.signal, Signal::Hour | Signal::Rest))
}

/// The model without what a board lacks. What that does to the azimuths of the runs, root mean square, is in its sigma.
pub fn model(whole: &ErrorModel, runs: &[RunData]) -> ErrorModel {
    let measured = measured(runs.iter());
    let on_board = |name: &ChannelName| name.is_on_board(&measured);
    let mut kept = Vec::new();
    let mut model = whole.clone();
    model.terms.retain(|term| {
        let stays = term.channels().all(on_board);
        kept.extend(std::iter::repeat_n(stays, term.coefficients.len()));
        stays
    });
    model.effects.retain(|effect| {
        let stays = effect.channels().all(on_board) && !follows_clock(effect);
        kept.extend(std::iter::repeat_n(stays, effect.count()));
        stays
    });
    for direction in &mut model.doubt.directions {
        let numbers: Vec<f32> =
            direction.iter().zip(&kept).filter(|(_, stays)| **stays).map(|(number, _)| *number).collect();
        *direction = numbers.into_iter().collect();
    }
    model.doubt.directions.retain(|direction| direction.iter().any(|number| *number != 0.0));
    let lost_deg = doubt::turned_deg(runs, [whole, &model]);
    model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(lost_deg);
    model
}
