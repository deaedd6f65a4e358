//! A run of seconds as the engine takes it, and the samples that its algebra works on.

use north_finder::fix::DesignRow;
use north_finder::level::Specific;

use super::differences;

/// Samples of a run: enough for what changes within a dwell, few enough for dense algebra.
const SAMPLES: usize = 48;
/// Fewest samples of a dwell.
const LEAST_OF_DWELL: usize = 2;
/// How much shorter than the rest the first samples of a dwell are: boundaries at n (i/m) to this power. Decays after a move
/// are steepest there.
const GRADING: f64 = 1.4;
/// Half the width of the running median that shocks are told by, seconds, and how many of its deviations they stand out.
const MEDIAN_REACH: usize = 4;
const SHOCK: f64 = 6.0;
/// Share of a dwell's seconds above which what stands out is no shock.
const MOST_SHOCKS: f64 = 0.25;
/// Share of differences that are nothing above which the gyro's quantum is coarse: they say little then, the scatter more.
const COARSE: f64 = 0.1;
/// Ratio of median to root mean square of the differences below which their tails are heavy, a normal distribution's being 1.
const HEAVY: f64 = 0.7;
/// Seconds that are averaged to look for noise of the angle, whose slow part is smaller than the differences say.
const LONGER: usize = 4;
/// Share of the variance that the longer means must undercut.
const ANGLE_NOISE: f64 = 0.6;
/// How far a run's noise may differ from the campaign's, in standard deviations of its estimate, and still count as the same.
const SAME_NOISE: f64 = 3.0;
/// Seconds of a stretch whose noise is looked at by itself.
const STRETCH: usize = 16;

/// A surveyed azimuth.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    pub azimuth_rad: f64,
    pub sigma_rad: f64,
}

/// One run by the second; all series have the same length. Channels stand in the order of the campaign's names.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Horizontal component of the Earth rate, °/h.
    pub north_deg_h: f64,
    /// Middle and length of every second.
    pub t_s: Vec<f64>,
    pub interval_s: Vec<f64>,
    /// Number of the dwell, from 0.
    pub dwell: Vec<usize>,
    /// Whether the index turns.
    pub moving: Vec<bool>,
    /// Whether it may enter a solution.
    pub enters: Vec<bool>,
    /// Rows of the equations, the vertical rate taken out of the measured rate.
    pub design: Vec<DesignRow>,
    /// Rate without what is known already, °/h.
    pub rate_deg_h: Vec<f64>,
    /// Level accelerometers, g.
    pub tilt_g: Option<Vec<Specific>>,
    pub channels: Vec<Vec<f64>>,
    pub reference: Option<Reference>,
    /// The index turns all the time.
    pub rotation: bool,
    /// Noise of a one-second rate where it is known beforehand, °/h: of a run that has not been made.
    pub noise_deg_h: Option<f64>,
}

/// What a second's place in the sequence of dwells is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    /// Time since the index came to rest, seconds.
    pub since_s: f64,
    /// The last move, degrees, counter-clockwise positive; 0 before the first.
    pub travel_deg: f64,
    /// Moves made so far.
    pub moves: f64,
}

/// A move of the index.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    pub ended_s: f64,
    /// Counter-clockwise positive.
    pub travel_deg: f64,
    /// From 1.
    pub number: f64,
    /// Direction that it led to.
    pub to: DesignRow,
}

/// Turning of the index below which it rests, degrees.
const REST_DEG: f64 = 2.0;

impl Recording {
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Index angle from that of the first second, turns counted, degrees: where rows are missing, the shorter way.
    pub fn wound_deg(&self) -> Vec<f64> {
        let mut wound_deg: Vec<f64> = Vec::with_capacity(self.len());
        for row in &self.design {
            let at_deg = row.sin.atan2(row.cos).to_degrees();
            let before_deg = wound_deg.last().copied().unwrap_or(0.0);
            wound_deg.push(before_deg + (at_deg - before_deg + 180.0).rem_euclid(360.0) - 180.0);
        }
        wound_deg
    }

    /// Place of every second, and the moves.
    pub fn places(&self) -> (Vec<Place>, Vec<Move>) {
        let mut place = Place::default();
        let wound_deg = self.wound_deg();
        let (mut ended_s, mut was_moving) = (self.start_s(), false);
        let mut rest_deg = self.begins_turning(&wound_deg);
        let (mut places, mut moves) = (Vec::with_capacity(self.len()), Vec::new());
        for (i, wound_deg) in wound_deg.into_iter().enumerate() {
            let moving = self.moving[i] && !self.rotation;
            if moving {
                ended_s = self.t_s[i] + 0.5 * self.interval_s[i];
            } else {
                let travel_deg = rest_deg.map_or(0.0, |rest_deg| wound_deg - rest_deg);
                if !self.rotation && travel_deg.abs() > REST_DEG {
                    if !was_moving {
                        ended_s = self.t_s[i] - 0.5 * self.interval_s[i];
                    }
                    place.travel_deg = travel_deg;
                    place.moves += 1.0;
                    moves.push(Move { ended_s, travel_deg, number: place.moves, to: self.design[i] });
                    rest_deg = None;
                }
                rest_deg = rest_deg.or(Some(wound_deg));
            }
            was_moving = moving;
            place.since_s = (self.t_s[i] - ended_s).max(0.0);
            places.push(place);
        }
        (places, moves)
    }

    /// Index angle that a run begins to turn from, degrees: half a second's way before the first second's middle. `None` of a run that
    /// begins at rest.
    fn begins_turning(&self, wound_deg: &[f64]) -> Option<f64> {
        let turns = !self.rotation && self.moving.first().is_some_and(|moving| *moving);
        let [first, second, ..] = wound_deg else { return None };
        turns.then_some(1.5 * first - 0.5 * second)
    }

    pub fn start_s(&self) -> f64 {
        self.t_s.first().zip(self.interval_s.first()).map_or(0.0, |(t, interval)| t - 0.5 * interval)
    }

    /// Chains of seconds that follow one another in the same dwell and all enter.
    fn chains(&self, enters: &[bool]) -> Vec<Vec<usize>> {
        let mut chains: Vec<Vec<usize>> = Vec::new();
        for i in (0..self.len()).filter(|&i| enters[i]) {
            let follows =
                |last: usize| last + 1 == i && self.dwell[last] == self.dwell[i] && (self.rotation || !self.moving[i]);
            match chains.last_mut().filter(|chain| chain.last().is_some_and(|&last| follows(last))) {
                Some(chain) => chain.push(i),
                None => chains.push(vec![i]),
            }
        }
        chains
    }

    /// Seconds that enter, shocks left out: those that stand out of the running median of their dwell.
    pub fn without_shocks(&self) -> Vec<bool> {
        let mut enters = self.enters.clone();
        if self.rotation {
            return enters;
        }
        for seconds in self.dwells() {
            let rates: Vec<f64> = seconds.iter().map(|&i| self.rate_deg_h[i]).collect();
            if rates.len() < 2 * MEDIAN_REACH + 1 {
                continue;
            }
            let deviations: Vec<f64> = (0..rates.len())
                .map(|i| {
                    let (low, high) = (i.saturating_sub(MEDIAN_REACH), (i + MEDIAN_REACH + 1).min(rates.len()));
                    rates[i] - median(rates[low..high].to_vec())
                })
                .collect();
            let spread = 1.4826 * median(deviations.iter().map(|each| each.abs()).collect());
            let limit = SHOCK * spread;
            let shocks: Vec<usize> = (0..rates.len()).filter(|&i| deviations[i].abs() > limit).collect();
            if spread > 0.0 && (shocks.len() as f64) < MOST_SHOCKS * rates.len() as f64 {
                shocks.iter().for_each(|&i| enters[seconds[i]] = false);
            }
        }
        enters
    }

    /// The seconds that enter, dwell by dwell; a rotation is one.
    fn dwells(&self) -> Vec<Vec<usize>> {
        let mut dwells: Vec<Vec<usize>> = Vec::new();
        for i in (0..self.len()).filter(|&i| self.enters[i]) {
            match dwells.last_mut() {
                Some(last) if self.rotation || last.last().is_some_and(|&j| self.dwell[j] == self.dwell[i]) => {
                    last.push(i)
                }
                _ => dwells.push(vec![i]),
            }
        }
        dwells
    }

    /// Noise of a one-second rate from differences within dwells, °/h; with the number of differences.
    pub fn noise(&self, enters: &[bool]) -> Option<(f64, usize)> {
        if let Some(known) = self.noise_deg_h {
            return Some((known, self.len()));
        }
        let rate = self.beside_rotation();
        let differences: Vec<f64> =
            differences::quiet(&rate, &self.interval_s, &self.chains(enters)).into_iter().map(|each| each.1).collect();
        if differences.len() < 8 {
            return None;
        }
        let rms = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
        let by_median = median(differences.iter().map(|d| d.abs()).collect()) / 0.6745;
        let nothing = differences.iter().filter(|d| d.abs() < 1e-3 * rms).count() as f64;
        let mut sigma =
            if nothing > COARSE * differences.len() as f64 || by_median > HEAVY * rms { rms } else { by_median };
        let longer = self.longer_noise(&rate, enters);
        if let Some(longer) = longer.filter(|each| each * each < ANGLE_NOISE * sigma * sigma) {
            sigma = longer;
        }
        (sigma > 0.0).then_some((sigma, differences.len()))
    }

    /// The same from differences of means over several seconds.
    fn longer_noise(&self, rate: &[f64], enters: &[bool]) -> Option<f64> {
        let (mut squares, mut count) = (0.0, 0.0);
        let mut means: Vec<(usize, f64, f64)> = Vec::new();
        let (mut sum, mut seconds, mut number, mut dwell) = (0.0, 0.0, 0, usize::MAX);
        for i in (0..self.len()).filter(|&i| enters[i]) {
            if self.dwell[i] != dwell {
                (sum, seconds, number, dwell) = (0.0, 0.0, 0, self.dwell[i]);
            }
            sum += rate[i] * self.interval_s[i];
            seconds += self.interval_s[i];
            number += 1;
            if number == LONGER {
                means.push((dwell, sum / seconds, seconds));
                (sum, seconds, number) = (0.0, 0.0, 0);
            }
        }
        for pair in means.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            squares += (pair[1].1 - pair[0].1).powi(2) / (1.0 / pair[0].2 + 1.0 / pair[1].2);
            count += 1.0;
        }
        (count >= 20.0).then(|| (squares / count).sqrt())
    }

    /// Rates; of a rotation what a sinusoid of the index angle leaves.
    fn beside_rotation(&self) -> Vec<f64> {
        if !self.rotation {
            return self.rate_deg_h.clone();
        }
        let mut normal = nalgebra::Matrix3::<f64>::zeros();
        let mut right = nalgebra::Vector3::<f64>::zeros();
        for i in (0..self.len()).filter(|&i| self.enters[i]) {
            let row = nalgebra::Vector3::new(self.design[i].cos, self.design[i].sin, 1.0);
            normal += row * row.transpose();
            right += row * self.rate_deg_h[i];
        }
        let found = normal.cholesky().map_or(nalgebra::Vector3::zeros(), |factor| factor.solve(&right));
        let of = |i: usize| self.design[i].cos * found[0] + self.design[i].sin * found[1] + found[2];
        (0..self.len()).map(|i| self.rate_deg_h[i] - of(i)).collect()
    }
}

/// The samples of a run: means over some seconds of one dwell, weighted by their noise.
#[derive(Clone, Debug)]
pub struct Samples {
    /// Sample of every second; `None` where it does not enter.
    of_second: Vec<Option<usize>>,
    /// Weight of every second: one over the variance of its rate.
    weight: Vec<f64>,
    /// Weight of every sample.
    pub weights: Vec<f64>,
    /// Where each begins and ends, seconds.
    pub spans: Vec<[f64; 2]>,
}

impl Samples {
    /// `None` where too little enters.
    pub fn new(recording: &Recording, noise_deg_h: f64, enters: &[bool]) -> Option<Self> {
        let variance = recording.variances(noise_deg_h, enters);
        let mut of_second = vec![None; recording.len()];
        let dwells: Vec<Vec<usize>> =
            recording.dwells().into_iter().map(|dwell| dwell.into_iter().filter(|&i| enters[i]).collect()).collect();
        let all: usize = dwells.iter().map(Vec::len).sum();
        let mut spans = Vec::new();
        for dwell in dwells.iter().filter(|dwell| !dwell.is_empty()) {
            let share = (SAMPLES * dwell.len()).div_ceil(all.max(1)).max(LEAST_OF_DWELL).min(dwell.len());
            let grading = if recording.rotation { 1.0 } else { GRADING };
            let mut begun = None;
            for (place, &i) in dwell.iter().enumerate() {
                // The number of boundaries n (j/m)^p at or below the place.
                let at = ((place as f64 + 0.5) / dwell.len() as f64).powf(1.0 / grading);
                let number = (at * share as f64) as usize;
                if begun != Some(number) {
                    begun = Some(number);
                    spans.push([recording.t_s[i] - 0.5 * recording.interval_s[i], 0.0]);
                }
                if let Some(last) = spans.last_mut() {
                    last[1] = recording.t_s[i] + 0.5 * recording.interval_s[i];
                }
                of_second[i] = Some(spans.len() - 1);
            }
        }
        let mut weights = vec![0.0; spans.len()];
        let weight: Vec<f64> = variance.iter().map(|variance| 1.0 / variance).collect();
        for (sample, weight) in of_second.iter().zip(&weight) {
            if let Some(sample) = sample {
                weights[*sample] += weight;
            }
        }
        (spans.len() > 4).then_some(Self { of_second, weight, weights, spans })
    }

    pub fn len(&self) -> usize {
        self.spans.len()
    }

    /// Weight of a second; `None` where it does not enter.
    pub fn weight_of(&self, second: usize) -> Option<f64> {
        self.of_second[second].map(|_| self.weight[second])
    }

    /// A value of every sample, by the second; 0 where it does not enter.
    pub fn by_second(&self, of_samples: &[f64]) -> Vec<f64> {
        self.of_second.iter().map(|sample| sample.map_or(0.0, |sample| of_samples[sample])).collect()
    }

    /// The same spans and weights.
    pub fn is_alike(&self, other: &Self) -> bool {
        self.spans == other.spans && self.weights == other.weights
    }

    /// Means of a series by the second.
    pub fn means(&self, values: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut means = vec![0.0; self.len()];
        for ((sample, weight), value) in self.of_second.iter().zip(&self.weight).zip(values) {
            if let Some(sample) = sample {
                means[*sample] += weight * value;
            }
        }
        means.iter_mut().zip(&self.weights).for_each(|(mean, weight)| *mean /= weight);
        means
    }
}

impl Recording {
    /// Variance of every second's rate, °²/h²: the run's, or its stretches' own where these differ beyond chance, shrunk by
    /// what their scatter says.
    fn variances(&self, noise_deg_h: f64, enters: &[bool]) -> Vec<f64> {
        let usual = noise_deg_h * noise_deg_h;
        let plain = || self.interval_s.iter().map(|interval| usual / interval).collect();
        // Of a run that has not been made there are no differences.
        if self.rotation || self.noise_deg_h.is_some() {
            return plain();
        }
        let differences: Vec<(usize, f64)> =
            differences::quiet(&self.rate_deg_h, &self.interval_s, &self.chains(enters))
                .into_iter()
                .map(|(i, difference)| (i, difference * difference))
                .collect();
        let mean = differences.iter().map(|each| each.1).sum::<f64>() / differences.len().max(1) as f64;
        let nothing = differences.iter().filter(|each| each.1 < 1e-6 * mean).count();
        if !(mean > 0.0) || differences.len() < 4 * STRETCH || nothing as f64 > COARSE * differences.len() as f64 {
            return plain();
        }
        // Logarithms of the stretches' variances; that of n differences, correlated with their neighbours, scatters by 3/n.
        let stretches: Vec<(f64, f64)> = differences
            .chunks(STRETCH)
            .filter(|chunk| chunk.len() >= STRETCH / 2)
            .map(|chunk| {
                let square = chunk.iter().map(|each| each.1).sum::<f64>() / chunk.len() as f64;
                let middle = chunk[chunk.len() / 2].0 as f64;
                (middle, square.max(0.05 * mean).ln())
            })
            .collect();
        let middle = median(stretches.iter().map(|each| each.1).collect());
        let own = stretches.iter().map(|each| (each.1 - middle).powi(2)).sum::<f64>() / stretches.len() as f64;
        let chance = 3.0 / STRETCH as f64;
        if own < 3.0 * chance {
            return plain();
        }
        let shrink = (own - chance) / own;
        // The level stays the run's: the mean of the stretches is what the run's noise is the root of.
        let shrunk: Vec<(f64, f64)> = stretches.iter().map(|each| (each.0, (each.1 - middle) * shrink)).collect();
        let level = shrunk.iter().map(|each| each.1.exp()).sum::<f64>() / shrunk.len() as f64;
        let at = |i: usize| {
            let after = shrunk.partition_point(|each| each.0 < i as f64);
            match (after.checked_sub(1).map(|before| shrunk[before]), shrunk.get(after)) {
                (Some(before), Some(after)) => {
                    before.1 + (after.1 - before.1) * (i as f64 - before.0) / (after.0 - before.0).max(1.0)
                }
                (Some(only), None) => only.1,
                (None, Some(only)) => only.1,
                (None, None) => 0.0,
            }
        };
        let level = if level > 0.0 { usual.max(mean) / usual / level } else { 1.0 };
        (0..self.len()).map(|i| usual * level * at(i).exp() / self.interval_s[i]).collect()
    }
}

/// Noise of every run, those that do not differ from the campaign's beyond chance taking its.
pub fn shared_noise(noises: &[Option<(f64, usize)>]) -> Vec<Option<f64>> {
    let known: Vec<(f64, usize)> = noises.iter().flatten().copied().collect();
    let total: f64 = known.iter().map(|each| each.1 as f64).sum();
    let pooled = (known.iter().map(|each| each.0.powi(2) * each.1 as f64).sum::<f64>() / total.max(1.0)).sqrt();
    let usual = median(known.iter().map(|each| each.0).collect());
    let usual = if (pooled / usual).ln().abs() < 0.1 { pooled } else { usual };
    noises
        .iter()
        .map(|each| {
            each.map(|(sigma, number)| {
                // A median of n differences scatters by about 1.3/√n of itself, correlation counted.
                let same = (sigma / usual).ln().abs() < SAME_NOISE * 1.3 / (number as f64).sqrt();
                if same { usual } else { sigma }
            })
        })
        .collect()
}

/// The middle one; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
