//! What is handed to the search: the seconds of a recorded run, as the firmware's replay makes them.

use north_finder::earth::EarthRate;
use north_finder::effects::now::RunFacts;
use north_finder::fix::DesignRow;
use north_finder::sensing::level::Specific;

/// A second of a run, or a longer row, by the replay with the model that the run was made with.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Middle, and length.
    pub t_s: f64,
    pub seconds: f64,
    /// Mean rate with the model applied, °/h.
    pub rate_deg_h: f64,
    /// Direction of the index.
    pub cos: f64,
    pub sin: f64,
    /// Its row of the fix's equations.
    pub design: DesignRow,
    pub temp_c: Option<f64>,
    pub level: Option<Specific>,
    pub moving: bool,
    /// It is in no dwell: nothing is learned from it.
    pub left_out: bool,
    /// Number of the dwell, from 0; of the next one for what is in none.
    pub dwell: usize,
    /// Line of the file that it begins with.
    pub line: u64,
}

impl Sample {
    /// Whether it is learned from: at rest, or in a continuous rotation always.
    pub fn enters(&self, rotation: bool) -> bool {
        !self.left_out && (rotation || !self.moving)
    }
}

/// One recorded run.
#[derive(Clone, Debug)]
pub struct Recording {
    pub file: String,
    /// Surveyed azimuth and its sigma, degrees; a sigma of 0 is none stated.
    pub reference_deg: Option<f64>,
    pub reference_sigma_deg: f64,
    /// Where it was made; runs of one station share one heading.
    pub station: Option<String>,
    /// What its fix says without the effects that are looked for, degrees.
    pub fix_deg: Option<f64>,
    pub earth: EarthRate,
    /// What is known of it as a whole.
    pub facts: RunFacts,
    pub samples: Vec<Sample>,
    /// Names of the extra channels and their values by the sample.
    pub names: Vec<String>,
    pub channels: Vec<Vec<f64>>,
    /// Noise of a one-second rate where it is known beforehand, °/h.
    pub noise_deg_h: Option<f64>,
    /// The index is at one position throughout.
    pub still: bool,
    /// Most of the time the index turns.
    pub rotation: bool,
}
