//! What to do next where no designed runs would tell more: a survey, runs of one station, a channel, longer rests, another latitude. Never nothing where
//! something is confounded, unexplained or not determined, and always with what it is expected to gain.

use north_finder::effects::doubt::Process;
use north_finder::units::wrap_180_deg;

use super::experiment::{sentences, short};
use super::names::{self, LATITUDE};
use super::result::{Ask, Experiment};
use super::statistics::median;
use super::{Diagnosis, Effect};
use crate::campaign::Role;
use crate::run_data::RunData;

/// Fewest training runs of which effects are told from chance.
const LEAST_RUNS: usize = 4;
/// Runs that are asked for: of the random part of an azimuth half is left in the mean of four.
const MORE_RUNS: usize = 4;
/// Headings nearer to each other than this are one.
const NEAR_DEG: f64 = 20.0;
/// A process whose time is below this share of a rest averages out in it; of a slower one longer rests bring little.
const FAST: f64 = 1.0 / 3.0;
/// Rests that are asked for, as multiples of those so far.
const LONGER: f64 = 4.0;
/// Time at each position where no run has rests, seconds.
const USUAL_REST_S: f64 = 60.0;

/// What the campaign is like.
struct Situation<'a> {
    diagnosis: &'a Diagnosis,
    runs: &'a [RunData],
    like: &'a RunData,
    sigma_now_deg: f64,
    rest_s: f64,
}

/// The next experiment, if there is anything that one could tell.
pub fn of(diagnosis: &Diagnosis, runs: &[RunData]) -> Option<Experiment> {
    let like = runs.iter().find(|run| run.role == Role::Fit).or(runs.first())?;
    let sigmas: Vec<f64> = diagnosis.runs.iter().filter_map(|run| run.sigma_after_deg).collect();
    let sigma_now_deg = match (sigmas.is_empty(), diagnosis.rate_rms_after_deg_h) {
        (false, _) => median(sigmas),
        // Of a still recording: what such an error of the rate turns an azimuth by.
        (true, rate) => (rate.unwrap_or(like.earth.north_deg_h) / like.earth.north_deg_h).to_degrees(),
    };
    let situation = Situation { diagnosis, runs, like, sigma_now_deg, rest_s: rest_s(like) };
    situation.ask()
}

/// Usual time at a position of a run, seconds.
fn rest_s(run: &RunData) -> f64 {
    let last = run.samples.last().map_or(0, |sample| sample.dwell);
    let of = |dwell| -> f64 {
        run.samples
            .iter()
            .filter(|sample| sample.dwell == dwell && run.enters(sample))
            .map(|sample| sample.seconds)
            .sum()
    };
    let rests: Vec<f64> = (0..=last).map(of).filter(|seconds| *seconds > 0.0).collect();
    if rests.is_empty() { USUAL_REST_S } else { median(rests) }
}

impl Situation<'_> {
    fn ask(&self) -> Option<Experiment> {
        let Diagnosis { effects, inseparable, .. } = self.diagnosis;
        let confounded = |effect: &&Effect| !effect.ambiguous_with.is_empty();
        let process = self.diagnosis.model.doubt.process;
        if self.diagnosis.rate_rms_after_deg_h.is_some() {
            return self.of_still(effects.iter().any(|effect| confounded(&effect)));
        }
        let learned_from = self.runs.iter().filter(|run| run.role == Role::Fit).count();
        if learned_from < LEAST_RUNS {
            return Some(self.more_runs(LEAST_RUNS.max(MORE_RUNS) - learned_from.min(LEAST_RUNS - 1), learned_from));
        }
        if self.runs.iter().all(|run| run.reference_deg.is_none()) {
            return Some(self.headings());
        }
        if self.is_at_one_heading() {
            return Some(self.more_runs(MORE_RUNS, learned_from));
        }
        if inseparable.iter().any(|name| name == LATITUDE) {
            return Some(self.latitude_itself());
        }
        let of_latitude = |other: &String| inseparable.contains(other) && names::differs_by_latitude(other);
        if let Some(effect) = effects.iter().find(|effect| effect.ambiguous_with.iter().any(of_latitude)) {
            return Some(self.other_latitude(effect));
        }
        let is_same = |effect: &&Effect| effect.ambiguous_with.iter().all(|other| inseparable.contains(other));
        if let Some(effect) =
            effects.iter().filter(confounded).find(|effect| !effect.channels.is_empty() && is_same(effect))
        {
            return Some(self.other_values(effect));
        }
        if let Some(effect) = effects.iter().find(confounded) {
            return Some(self.longer_rests(Some(effect)));
        }
        match process {
            Some(process) if self.diagnosis.unexplained => Some(self.against(process)),
            _ if self.is_open() => Some(self.more_runs(MORE_RUNS, learned_from)),
            _ => None,
        }
    }

    /// Whether all surveyed headings lie near each other: what is fixed to the body, the Earth and the index looks the same then.
    fn is_at_one_heading(&self) -> bool {
        let mut headings = self.runs.iter().filter(|run| run.role == Role::Fit).filter_map(|run| run.reference_deg);
        let Some(first_deg) = headings.next() else { return false };
        headings.all(|heading_deg| wrap_180_deg(heading_deg - first_deg).abs() < NEAR_DEG)
    }

    /// Whether something remains that nothing explains, or that is not used.
    fn is_open(&self) -> bool {
        let Diagnosis { unexplained, withdrawn, noise, .. } = self.diagnosis;
        *unexplained || withdrawn.is_some() || noise.after.iter().any(|test| test.failed())
    }

    fn of_still(&self, confounded: bool) -> Option<Experiment> {
        let after_deg_h = self.diagnosis.rate_rms_after_deg_h.unwrap_or_default();
        let noise_deg_h = self.diagnosis.noise.noise_deg_h;
        let then_deg = (noise_deg_h / self.like.earth.north_deg_h).to_degrees();
        let gain = format!(
            "The rate of a second falls from {after_deg_h:.4} to {noise_deg_h:.4} deg/h rms if it tells everything"
        );
        if self.diagnosis.unexplained {
            return Some(self.experiment(Ask::Channel, then_deg, &[CHANNEL, &gain]));
        }
        let longer = format!(
            "Record again for {:.1} h, while each channel varies in turn",
            2.0 * self.like.samples.last().map_or(0.0, |sample| sample.t_s) / 3600.0
        );
        let half = format!("The sigmas of the weights then fall to {:.0} % of what they are now", 100.0 / 3_f64.sqrt());
        (confounded || self.is_open()).then(|| self.experiment(Ask::Runs, self.sigma_now_deg, &[&longer, &half]))
    }

    /// With `learned_from` runs so far the scatter of what is learned falls with their number.
    fn more_runs(&self, more: usize, learned_from: usize) -> Experiment {
        let then_deg = self.sigma_now_deg * (learned_from.max(1) as f64 / (learned_from.max(1) + more) as f64).sqrt();
        let runs = format!(
            "Make {more} more runs with the role fit, like {}, at surveyed headings {:.0} deg apart or at one station",
            self.like.file,
            360.0 / more as f64
        );
        let gain =
            format!("What is learned is then known to {then_deg:.4} deg in place of {:.4} deg", self.sigma_now_deg);
        let headings_deg = (0..more).map(|i| 360.0 * i as f64 / more as f64).collect();
        Experiment { headings_deg, ..self.experiment(Ask::Runs, then_deg, &[&runs, &gain]) }
    }

    /// Without a reference a turn of all azimuths is not seen at all.
    fn headings(&self) -> Experiment {
        let then_deg = self.sigma_now_deg / (MORE_RUNS as f64).sqrt();
        let gain = format!("An error that all azimuths share is not seen now, and is then known to {then_deg:.4} deg");
        match self.runs.iter().any(|run| run.station.is_some()) {
            true => self.experiment(
                Ask::Survey,
                then_deg,
                &[&format!("Survey the heading of {MORE_RUNS} runs to 0.01 deg"), &gain],
            ),
            false => {
                let stations = "Give runs that were made at one heading the same station, which shows their spread";
                let survey = format!("Survey the heading of {MORE_RUNS} runs to 0.01 deg");
                self.experiment(Ask::Stations, then_deg, &[&survey, stations, &gain])
            }
        }
    }

    fn latitude_itself(&self) -> Experiment {
        let look = format!("Look the latitude up: the campaign says {} deg", self.like.settings.latitude_deg);
        let gain = "With the other sign of the latitude the sensitivity to gravity disappears";
        self.experiment(Ask::Latitude, self.sigma_now_deg, &[&look, gain])
    }

    /// What turns every azimuth alike at one latitude does not at another: as cos φ, or as tan φ where the tilt enters.
    fn other_latitude(&self, effect: &Effect) -> Experiment {
        let own_deg = self.like.settings.latitude_deg;
        let other_deg = own_deg - own_deg.signum() * 15.0;
        let ratio = own_deg.to_radians().cos() / other_deg.to_radians().cos();
        let turned_deg = effect.parameters.get("offset_deg").map_or(self.sigma_now_deg, |turned| turned.abs());
        let apart = turned_deg * (1.0 - ratio).abs() / self.sigma_now_deg;
        let runs = format!(
            "Make {MORE_RUNS} runs with surveyed headings at another latitude, {other_deg:.0} deg or further away"
        );
        let [name, other] = names_of_pair(effect);
        let log_odds = 0.5 * MORE_RUNS as f64 * apart * apart;
        let gain = format!("That tells {name} from {other} by log odds of {log_odds:.1}; no run at this latitude does");
        self.experiment(Ask::Latitude, self.sigma_now_deg, &[&runs, &gain])
    }

    /// Functions that nothing tells apart at the values of a channel so far differ at others.
    fn other_values(&self, effect: &Effect) -> Experiment {
        let channels = effect.channels.join(" and ");
        let runs = format!(
            "Make {MORE_RUNS} more runs at surveyed headings in which {channels} takes other values than so far, between them and beyond"
        );
        let [name, other] = names_of_pair(effect);
        let gain = format!(
            "At those so far {name} and {other} differ by log odds below 1 whatever the order, heading or duration"
        );
        self.experiment(Ask::Runs, self.sigma_now_deg, &[&runs, &gain])
    }

    fn longer_rests(&self, confounded: Option<&Effect>) -> Experiment {
        let then_deg = self.sigma_now_deg / LONGER.sqrt();
        let rests = format!(
            "Rest {:.0} s at each position in place of {:.0} s, in runs at surveyed headings like {}",
            LONGER * self.rest_s,
            self.rest_s,
            self.like.file
        );
        let gain = self.falls_to(then_deg);
        let tells = confounded.map(|effect| {
            let [name, other] = names_of_pair(effect);
            format!("The log odds between {name} and {other} grow by a factor of {LONGER:.0}")
        });
        let said: Vec<&str> = [Some(rests.as_str()), tells.as_deref(), Some(&gain)].into_iter().flatten().collect();
        Experiment { dwell_s: LONGER * self.rest_s, ..self.experiment(Ask::LongerRests, then_deg, &said) }
    }

    /// A process that is fast averages out; a slow one has to be measured.
    fn against(&self, process: Process) -> Experiment {
        if process.time_s < FAST * self.rest_s {
            return self.longer_rests(None);
        }
        // White noise of one second through the fix alone: √2 · noise/(h √T).
        let rest: f64 =
            self.like.samples.iter().filter(|sample| self.like.enters(sample)).map(|sample| sample.seconds).sum();
        let white =
            2_f64.sqrt() * self.diagnosis.noise.noise_deg_h / (self.like.earth.north_deg_h * rest.max(1.0).sqrt());
        let then_deg = white.to_degrees().min(self.sigma_now_deg);
        let gain = format!("{} if it tells everything", self.falls_to(then_deg));
        self.experiment(Ask::Channel, then_deg, &[CHANNEL, &gain])
    }

    fn falls_to(&self, then_deg: f64) -> String {
        format!("The sigma of a usual azimuth falls from {:.4} to {then_deg:.4} deg", self.sigma_now_deg)
    }

    fn experiment(&self, asks: Ask, sigma_then_deg: f64, said: &[&str]) -> Experiment {
        Experiment {
            asks,
            description: sentences(said),
            order_deg: Vec::new(),
            headings_deg: Vec::new(),
            dwell_s: self.rest_s,
            warm_up_s: 0.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            like: self.like.file.clone(),
            separates: Vec::new(),
            expected_log_odds: None,
            sigma_now_deg: self.sigma_now_deg,
            sigma_then_deg,
        }
    }
}

/// Short names of an effect and of the first that it is confounded with.
fn names_of_pair(effect: &Effect) -> [String; 2] {
    let other = effect.ambiguous_with.first().map_or("the others", String::as_str);
    [short(&effect.full_name()), short(other)]
}

const CHANNEL: &str = "Record a channel that may be the cause, such as the coil's temperature, the supply voltage or a vibration, every second";

#[cfg(test)]
mod tests {
    use super::*;

    /// The sentences that do not depend on a campaign: at most 25 words each.
    #[test]
    fn what_is_asked_is_short() {
        assert!(CHANNEL.split_whitespace().count() <= 25);
        assert_eq!(short("product of two long names and more"), "product of two long …");
        assert_eq!(short("temperature-rate (temp_c)"), "temperature-rate (temp_c)");
    }
}
