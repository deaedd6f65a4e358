//! What a campaign is made of, before any effect: place, instrument, runs, channels.

use super::draw::Draw;
use super::run_view::Arrival;
use super::signal::{Channel, Course};

/// Fastest turning of the index, °/s.
const TURN_DEG_S: f64 = 25.0;

/// A campaign without its recordings.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) latitude_deg: f64,
    pub(super) arw_deg_per_sqrt_h: f64,
    pub(super) instability_deg_h: f64,
    pub(super) scale_ppm: f64,
    pub(super) declination_deg: f64,
    pub(super) has_temperature: bool,
    pub(super) has_level: bool,
    /// Noise density of the level sensors, µg/√Hz.
    pub(super) level_noise: f64,
    pub(super) channels: Vec<Channel>,
    pub(super) runs: Vec<RunPlan>,
    /// For each run, what the channels truly do, in standard deviations from their mean over the campaign.
    pub(super) standard: Vec<Vec<Course>>,
}

/// One run without its recording.
#[derive(Debug, Clone)]
pub(super) struct RunPlan {
    pub(super) seed: u64,
    pub(super) azimuth_deg: f64,
    pub(super) may_learn: bool,
    /// The surveyor's error; `None`: not surveyed.
    pub(super) survey_error_deg: Option<f64>,
    pub(super) survey_sigma_deg: f64,
    pub(super) bias_deg_h: f64,
    pub(super) tilt_deg: [f64; 2],
    /// Index angles and times at them, s.
    pub(super) dwells: Vec<(f64, usize)>,
    /// The index goes evenly to each angle in the time that stands beside it, and does not rest.
    pub(super) rotates: bool,
    /// What the channels do, in the order of [`Plan::channels`].
    pub(super) courses: Vec<Course>,
}

/// Runs that somebody proposes.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposed {
    pub order_deg: Vec<f64>,
    pub headings_deg: Vec<f64>,
    /// Time at each position.
    pub dwell_s: usize,
    /// Time at the first position before its own.
    pub warm_up_s: usize,
    /// By how much the mount leans more than in the first run: pitch and roll, degrees.
    pub lean_deg: [f64; 2],
}

/// How large an effect is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measure {
    /// Spread of the dwells' mean rates within a run, in the noise of a dwell.
    Dwells,
    /// Spread of the rows' rates, in the noise of a row.
    Rows,
    /// Spread of the runs' mean rates, in the noise of a dwell.
    Runs,
    /// The coefficients are in standard deviations of one azimuth as they are drawn.
    Azimuth,
}

/// What a family needs of a campaign in order to be possible at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Needs {
    pub(super) channels: usize,
    pub(super) level: bool,
    /// Seen only against surveyed headings.
    pub(super) survey: bool,
    /// Channels that have a rate of change at all times.
    pub(super) smooth: bool,
    /// Channels whose readings are mostly noise.
    pub(super) noisy: bool,
    /// Channels whose readings have coarse steps.
    pub(super) coarse: bool,
    /// A mount that leans by degrees.
    pub(super) tilted: bool,
    /// Campaigns of more kinds: few and many runs, unequal runs, rotation, a poor survey, many idle channels.
    pub(super) outside: bool,
}

impl Needs {
    /// Nothing.
    pub(super) const NONE: Self = Self {
        channels: 0,
        level: false,
        survey: false,
        smooth: false,
        noisy: false,
        coarse: false,
        tilted: false,
        outside: false,
    };
}

impl Plan {
    pub(super) fn new(draw: &mut Draw, needs: Needs) -> Self {
        let has_temperature = draw.chance(0.85);
        let has_level = needs.level || draw.chance(0.75);
        let mut channels = Vec::new();
        if has_temperature {
            channels.push(Channel::temperature(draw));
        }
        let most = if needs.outside && draw.chance(0.25) { 10 } else { 4 };
        let extra = draw.whole(0, most).max(needs.channels.saturating_sub(channels.len()));
        for _ in 0..extra {
            let channel = Channel::any(draw, &channels);
            channels.push(channel);
        }
        if needs.smooth {
            channels.iter_mut().for_each(Channel::without_jumps);
        }
        if needs.noisy {
            channels.iter_mut().for_each(|channel| channel.drown(draw));
        }
        if needs.coarse {
            channels.iter_mut().for_each(|channel| channel.coarsen(draw));
        }
        let mut plan = Self {
            latitude_deg: draw.sign() * draw.uniform(10.0, 65.0),
            arw_deg_per_sqrt_h: draw.log_uniform(0.0005, 0.004),
            instability_deg_h: 0.0,
            scale_ppm: 300.0 * draw.normal(),
            declination_deg: draw.uniform(-20.0, 20.0),
            has_temperature,
            has_level,
            level_noise: if needs.level { draw.log_uniform(0.3, 3.0) } else { 22.5 },
            channels,
            runs: Vec::new(),
            standard: Vec::new(),
        };
        plan.add_runs(draw, needs);
        plan.standard = plan.standard_courses(plan.runs.len());
        // Flicker that a fix does not notice: a quarter of the noise of a dwell at most.
        plan.instability_deg_h = draw.uniform(0.0, 0.25) * plan.dwell_noise_deg_h();
        plan
    }

    /// Standard deviation of the mean rate over a dwell from white noise, °/h.
    pub(super) fn dwell_noise_deg_h(&self) -> f64 {
        let seconds = self.runs.iter().flat_map(|run| run.dwells.iter().map(|&(_, seconds)| seconds as f64));
        let count = self.runs.iter().map(|run| run.dwells.len()).sum::<usize>() as f64;
        60.0 * self.arw_deg_per_sqrt_h / (seconds.sum::<f64>() / count).sqrt()
    }

    /// About the standard deviation of one azimuth from white noise, degrees: √2 σ / (h √n) for n dwells.
    pub(super) fn azimuth_noise_deg(&self, earth_rate_deg_h: f64) -> f64 {
        let north_deg_h = earth_rate_deg_h * self.latitude_deg.to_radians().cos();
        let dwells = self.runs.iter().map(|run| run.dwells.len()).sum::<usize>() as f64 / self.runs.len() as f64;
        (2.0_f64.sqrt() * self.dwell_noise_deg_h() / (north_deg_h * dwells.sqrt())).to_degrees()
    }

    fn add_runs(&mut self, draw: &mut Draw, needs: Needs) {
        let count = if needs.outside {
            draw.pick(&[6, 8, 12, 12, 16, 24, 36, 60])
        } else {
            draw.pick(&[8, 12, 12, 16, 24, 36])
        };
        let [unequal, poor_survey, rotates] = [0.25, 0.25, 0.08].map(|share| needs.outside && draw.chance(share));
        let order = order(draw);
        let one_order = draw.chance(0.7);
        let dwell_s = draw.whole(15, 45);
        let surveyed = draw.chance(if needs.survey { 0.9 } else { 0.7 });
        let survey_sigma_deg = if poor_survey { draw.log_uniform(0.03, 0.2) } else { draw.log_uniform(0.001, 0.01) };
        let headings = headings(draw, count);
        let bias_deg_h = draw.uniform(-0.5, 0.5);
        let spread_deg_h = draw.log_uniform(0.002, 0.05);
        let level_deg = match (needs.tilted, self.has_level) {
            (true, _) => 1.0,
            (false, true) => 0.1,
            (false, false) => 0.001,
        };
        let mut roles: Vec<bool> = (0..count).map(|run| matches!(run % 5, 0 | 2 | 3)).collect();
        draw.shuffle(&mut roles);
        for (azimuth_deg, may_learn) in headings.into_iter().zip(roles) {
            let angles = if one_order { order.clone() } else { self::order(draw) };
            let dwells: Vec<_> = if rotates {
                // Slow enough for seconds to be short against a turn: 0.3 to 0.4 degrees a second.
                (1..=8).map(|eighth| (45.0 * f64::from(eighth), 110 + dwell_s)).collect()
            } else {
                angles
                    .into_iter()
                    .map(|index_deg| (index_deg, if unequal { draw.whole(12, 3 * dwell_s) } else { dwell_s }))
                    .collect()
            };
            let survey_error_deg = (surveyed && draw.chance(0.95)).then(|| survey_sigma_deg * draw.normal());
            let mut run = RunPlan {
                seed: draw.seed(),
                azimuth_deg,
                may_learn,
                survey_error_deg,
                survey_sigma_deg,
                bias_deg_h: bias_deg_h + spread_deg_h * draw.normal(),
                tilt_deg: [level_deg * draw.normal(), level_deg * draw.normal()],
                dwells,
                rotates,
                courses: Vec::new(),
            };
            let seconds = run.seconds();
            run.courses = self.channels.iter().map(|channel| channel.course(draw, seconds)).collect();
            self.runs.push(run);
        }
    }

    /// Runs in this order, one at each heading, after some time of warming up: surveyed, and to be learned from.
    pub(super) fn add_proposed(&mut self, draw: &mut Draw, proposed: &Proposed) {
        let first = self.runs.len();
        let Some(like) = self.runs.first().cloned() else { return };
        for &azimuth_deg in &proposed.headings_deg {
            let mut dwells: Vec<(f64, usize)> =
                proposed.order_deg.iter().map(|&index_deg| (index_deg, proposed.dwell_s)).collect();
            if let Some(dwell) = dwells.first_mut() {
                dwell.1 += proposed.warm_up_s;
            }
            let mut run = RunPlan {
                seed: draw.seed(),
                azimuth_deg,
                may_learn: true,
                survey_error_deg: Some(like.survey_sigma_deg * draw.normal()),
                tilt_deg: [0, 1].map(|axis| like.tilt_deg[axis] + proposed.lean_deg[axis]),
                dwells,
                rotates: false,
                ..like.clone()
            };
            let seconds = run.seconds();
            run.courses = self.channels.iter().map(|channel| channel.course(draw, seconds)).collect();
            self.runs.push(run);
        }
        self.standard = self.standard_courses(first);
    }

    /// What the channels do in deviations from the first runs' mean, in units of their spread.
    fn standard_courses(&self, first: usize) -> Vec<Vec<Course>> {
        let mut standard: Vec<Vec<Course>> = self.runs.iter().map(|run| run.courses.clone()).collect();
        for channel in 0..self.channels.len() {
            let values: Vec<f64> =
                self.runs[..first].iter().flat_map(|run| run.courses[channel].truth.iter().copied()).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
            for courses in &mut standard {
                for value in &mut courses[channel].truth {
                    *value = (*value - mean) / variance.sqrt().max(f64::MIN_POSITIVE);
                }
            }
        }
        standard
    }
}

impl RunPlan {
    /// Whole seconds of turning from one dwell to the next.
    pub(super) fn turn_seconds(&self, travel_deg: f64) -> usize {
        if travel_deg == 0.0 || self.rotates { 0 } else { ((travel_deg.abs() / TURN_DEG_S).ceil() as usize).max(2) }
    }

    /// Length, s.
    pub(super) fn seconds(&self) -> usize {
        let mut at_deg = 0.0;
        self.dwells
            .iter()
            .map(|&(index_deg, seconds)| {
                let turn = self.turn_seconds(index_deg - at_deg);
                at_deg = index_deg;
                turn + seconds
            })
            .sum()
    }

    /// Index angle in the middle of every second, degrees.
    pub(super) fn index_deg(&self) -> Vec<f64> {
        let mut at_deg = 0.0;
        let mut all = Vec::with_capacity(self.seconds());
        for &(index_deg, seconds) in &self.dwells {
            let travel_deg = index_deg - at_deg;
            let turning = if self.rotates { seconds } else { self.turn_seconds(travel_deg) };
            all.extend((0..turning).map(|second| at_deg + travel_deg * (second as f64 + 0.5) / turning as f64));
            if !self.rotates {
                all.extend(std::iter::repeat_n(index_deg, seconds));
            }
            at_deg = index_deg;
        }
        all
    }

    /// The ends of its moves.
    pub(super) fn arrivals(&self) -> Vec<Arrival> {
        if self.rotates {
            return Vec::new();
        }
        let (mut t_s, mut at_deg) = (0, 0.0);
        let mut arrivals = Vec::new();
        for &(index_deg, seconds) in &self.dwells {
            let travel_deg = index_deg - at_deg;
            if travel_deg != 0.0 {
                t_s += self.turn_seconds(travel_deg);
                arrivals.push(Arrival { t_s: t_s as f64, travel_deg, index_deg });
            }
            t_s += seconds;
            at_deg = index_deg;
        }
        arrivals
    }
}

/// Index angles in the order of their visits, degrees.
fn order(draw: &mut Draw) -> Vec<f64> {
    const PLAIN: [f64; 4] = [0.0, 90.0, 180.0, 270.0];
    match draw.whole(0, 9) {
        0..=2 => vec![0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0],
        3 | 4 => PLAIN.to_vec(),
        5 => vec![90.0, 180.0, 270.0, 360.0],
        6 => (0..8).map(|dwell| 45.0 * f64::from(dwell)).collect(),
        7 => {
            let mut twice = [PLAIN, PLAIN].concat();
            draw.shuffle(&mut twice);
            twice
        }
        8 => (0..6).map(|dwell| -60.0 * f64::from(dwell)).collect(),
        _ => (0..6).map(|_| draw.uniform(-180.0, 180.0).round()).collect(),
    }
}

/// Azimuths of the mark, degrees.
fn headings(draw: &mut Draw, count: usize) -> Vec<f64> {
    let first = draw.uniform(0.0, 360.0);
    let even: Vec<f64> = (0..count).map(|run| (first + 360.0 * run as f64 / count as f64).rem_euclid(360.0)).collect();
    match draw.whole(0, 9) {
        0..=4 => (0..count).map(|_| draw.uniform(0.0, 360.0)).collect(),
        5..=8 => {
            let mut shuffled = even;
            draw.shuffle(&mut shuffled);
            shuffled
        }
        _ => {
            let few = [first, draw.uniform(0.0, 360.0), draw.uniform(0.0, 360.0)];
            (0..count).map(|_| draw.pick(&few)).collect()
        }
    }
}
