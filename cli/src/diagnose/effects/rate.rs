//! What the gyro makes of the rate itself, beyond a scale factor.

use north_finder::effects::RateTerm;
use north_finder::effects::rate_term::DeadZoneForm;

use super::{Candidate, RunData, geometric};
use crate::diagnose::candidate::Part;
use crate::diagnose::statistics::median;

pub fn candidates(list: &mut Vec<Candidate>, runs: &[&RunData]) {
    // What is distorted may be the rate alone, or with the gyro's bias.
    let usual_deg_h = median(runs.iter().filter_map(|run| Some(run.before?.bias_deg_h)).collect());
    let mut add = |term: RateTerm, grid| list.push(Candidate::new(term.to_string(), "scale", Part::Rate(term), grid));
    for centre_deg_h in [0.0, usual_deg_h] {
        for power in [2, 3] {
            add(RateTerm::Power { centre_deg_h, power, coefficient: 0.0 }, vec![]);
        }
        for form in DeadZoneForm::ALL {
            let zone = RateTerm::DeadZone { centre_deg_h, depth_deg_h: 0.0, width_deg_h: 1.0, form };
            add(zone, geometric(0.4, 10.0, 8));
        }
    }
}
