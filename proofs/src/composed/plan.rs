//! A campaign before anything is hidden in it: place, gyro, channels, runs with their orders, headings and times.

use crate::hidden::draw::Draw;

use super::channel::{Channel, Course};

/// Rate of the Earth, °/h: 7.292115e-5 rad/s.
pub(super) const EARTH_DEG_H: f64 = 15.041_067;

#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) latitude_deg: f64,
    pub(super) arw_deg_per_sqrt_h: f64,
    pub(super) scale_ppm: f64,
    pub(super) encoder_noise_deg: f64,
    /// Standard deviation of a level reading, g, where there are level accelerometers.
    pub(super) level_noise_g: Option<f64>,
    pub(super) has_temperature: bool,
    /// Whether the file says when a run began.
    pub(super) has_started: bool,
    pub(super) channels: Vec<Channel>,
    pub(super) runs: Vec<RunPlan>,
}

#[derive(Debug, Clone)]
pub(super) struct RunPlan {
    pub(super) seed: u64,
    pub(super) is_fit: bool,
    pub(super) azimuth_deg: f64,
    /// What the survey says, degrees, and its sigma.
    pub(super) reference_deg: Option<(f64, f64)>,
    pub(super) bias_deg_h: f64,
    /// Pitch (nose up) and roll (left side up), rad.
    pub(super) tilt_rad: [f64; 2],
    /// Beginning, s since 1970, and the time since the end of the run before, s.
    pub(super) started_s: u64,
    pub(super) rest_s: f64,
    /// Index angle in the middle of each second, degrees, and whether it rests then.
    pub(super) index_deg: Vec<f64>,
    pub(super) rests: Vec<bool>,
    pub(super) moves: Vec<Move>,
    pub(super) courses: Vec<Course>,
}

/// The index went by `travel_deg` and came to rest at `end_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Move {
    pub(super) end_s: usize,
    pub(super) travel_deg: f64,
}

impl Plan {
    pub(super) fn new(draw: &mut Draw) -> Self {
        let has_temperature = draw.chance(0.8);
        let count = if draw.chance(0.2) { 1 } else { draw.whole(2, 8) };
        let channels = Channel::several(draw, has_temperature, count);
        let has_level = draw.chance(0.7);
        let mut plan = Self {
            latitude_deg: draw.sign() * draw.uniform(8.0, 68.0),
            arw_deg_per_sqrt_h: draw.log_uniform(0.0005, 0.02),
            scale_ppm: 300.0 * draw.normal(),
            encoder_noise_deg: draw.log_uniform(1e-4, 3e-3),
            level_noise_g: has_level.then(|| draw.log_uniform(3e-7, 3e-5)),
            has_temperature,
            has_started: draw.chance(0.85),
            channels,
            runs: Vec::new(),
        };
        let (fits, checks) = (draw.whole(8, 36), draw.whole(4, 12));
        plan.add_runs(draw, fits, checks);
        plan
    }

    /// So many runs that may be learned from, and such that are only judged.
    pub(super) fn add_runs(&mut self, draw: &mut Draw, fits: usize, checks: usize) {
        let mut roles: Vec<bool> = (0..fits + checks).map(|run| run < fits).collect();
        draw.shuffle(&mut roles);
        let headings = headings(draw, roles.len());
        let survey_sigma_deg = if draw.chance(0.85) { draw.log_uniform(0.0005, 0.03) } else { f64::NAN };
        let bias_deg_h = 0.5 * draw.normal();
        let bias_spread_deg_h = draw.log_uniform(0.001, 0.05);
        let tilt_deg = if self.level_noise_g.is_some() { draw.log_uniform(0.01, 2.0) } else { 0.0 };
        let one_order = draw.chance(0.7).then(|| order(draw));
        let dwell_s = draw.log_uniform(15.0, 120.0);
        let turn_deg_s = draw.log_uniform(5.0, 60.0);
        let uneven = draw.chance(0.3);
        let longest_rest_h = draw.log_uniform(0.2, 20.0);
        // Some time in the years 2024 and 2025.
        let mut now_s = 1_704_067_200.0 + draw.uniform(0.0, 2.0 * 365.0 * 86_400.0).floor();
        for (is_fit, azimuth_deg) in roles.into_iter().zip(headings) {
            let order = one_order.clone().unwrap_or_else(|| order(draw));
            let dwells = order.into_iter().map(|index_deg| {
                let longer = if uneven { draw.log_uniform(0.5, 2.0) } else { 1.0 };
                (index_deg, (dwell_s * longer).round() as usize)
            });
            let (index_deg, rests, moves) = course_of_index(dwells.collect(), turn_deg_s);
            let rest_s = (3600.0 * draw.log_uniform(0.02, longest_rest_h)).floor();
            now_s += rest_s;
            let courses = self.channels.iter().map(|channel| channel.course(draw, index_deg.len())).collect();
            let surveyed = survey_sigma_deg.is_finite() && draw.chance(0.97);
            let survey_deg = azimuth_deg + survey_sigma_deg * draw.normal();
            let seconds = index_deg.len() as f64;
            self.runs.push(RunPlan {
                seed: draw.seed(),
                is_fit,
                azimuth_deg,
                reference_deg: surveyed.then(|| (survey_deg.rem_euclid(360.0), survey_sigma_deg)),
                bias_deg_h: bias_deg_h + bias_spread_deg_h * draw.normal(),
                tilt_rad: [0, 1].map(|_| (tilt_deg * draw.normal()).to_radians()),
                started_s: now_s as u64,
                rest_s,
                index_deg,
                rests,
                moves,
                courses,
            });
            now_s += seconds;
        }
    }
}

impl RunPlan {
    pub(super) fn seconds(&self) -> usize {
        self.index_deg.len()
    }
}

/// Index angle in the middle of each second, whether it rests, and the moves.
pub(super) fn course_of_index(dwells: Vec<(f64, usize)>, turn_deg_s: f64) -> (Vec<f64>, Vec<bool>, Vec<Move>) {
    let (mut index_deg, mut rests, mut moves) = (Vec::new(), Vec::new(), Vec::new());
    let mut at_deg = 0.0;
    for (to_deg, seconds) in dwells {
        let travel_deg: f64 = to_deg - at_deg;
        if travel_deg != 0.0 {
            let turning = ((travel_deg.abs() / turn_deg_s).ceil() as usize).max(2);
            index_deg.extend((0..turning).map(|second| at_deg + travel_deg * (second as f64 + 0.5) / turning as f64));
            rests.extend(std::iter::repeat_n(false, turning));
            moves.push(Move { end_s: index_deg.len(), travel_deg });
        }
        index_deg.extend(std::iter::repeat_n(to_deg, seconds));
        rests.extend(std::iter::repeat_n(true, seconds));
        at_deg = to_deg;
    }
    (index_deg, rests, moves)
}

/// Index angles in the order of their visits, degrees.
fn order(draw: &mut Draw) -> Vec<f64> {
    let quarter = [0.0, 90.0, 180.0, 270.0];
    let mut order: Vec<f64> = match draw.whole(0, 7) {
        0 => quarter.to_vec(),
        1 => [quarter.to_vec(), quarter.into_iter().rev().collect()].concat(),
        // Coarse, then the two sides twice: east, west, west, east if the mark is near north.
        2 => {
            let side_deg = draw.uniform(0.0, 180.0).round();
            let sides = [side_deg, side_deg + 180.0, side_deg + 180.0, side_deg];
            [quarter.to_vec(), sides.to_vec()].concat()
        }
        3 => (0..draw.whole(5, 9)).map(|_| draw.uniform(-180.0, 360.0).round()).collect(),
        // On over 360 degrees: a second turn.
        4 => (0..8).map(|dwell| 90.0 * f64::from(dwell)).collect(),
        5 => {
            let mut twice = [quarter, quarter].concat();
            draw.shuffle(&mut twice);
            twice
        }
        6 => {
            let parts = draw.whole(3, 10);
            (0..parts).map(|part| (360.0 * part as f64 / parts as f64).round()).collect()
        }
        _ => quarter.into_iter().rev().chain(quarter).collect(),
    };
    let first_deg = if draw.chance(0.2) { draw.uniform(0.0, 90.0).round() } else { 0.0 };
    let sense = if draw.chance(0.2) { -1.0 } else { 1.0 };
    order.iter_mut().for_each(|angle_deg| *angle_deg = sense * (*angle_deg + first_deg));
    // Three directions at 30 degrees from each other at least determine the azimuth.
    let apart = |a: f64, b: f64| ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs() >= 30.0;
    let mut distinct: Vec<f64> = Vec::new();
    for &angle_deg in &order {
        if distinct.iter().all(|&other| apart(angle_deg, other)) {
            distinct.push(angle_deg);
        }
    }
    if distinct.len() < 3 { quarter.to_vec() } else { order }
}

/// Azimuths of the mark, degrees.
fn headings(draw: &mut Draw, count: usize) -> Vec<f64> {
    let first_deg = draw.uniform(0.0, 360.0);
    let mut even: Vec<f64> =
        (0..count).map(|run| (first_deg + 360.0 * run as f64 / count as f64).rem_euclid(360.0)).collect();
    match draw.whole(0, 4) {
        0 | 1 => (0..count).map(|_| draw.uniform(0.0, 360.0)).collect(),
        2 | 3 => {
            draw.shuffle(&mut even);
            even
        }
        _ => {
            let pillars: Vec<f64> = (0..draw.whole(3, 6)).map(|_| draw.uniform(0.0, 360.0)).collect();
            (0..count).map(|_| draw.pick(&pillars)).collect()
        }
    }
}
