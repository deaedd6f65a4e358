//! A rate that goes to and fro between two levels, at times of each run's own: what runs share of it, and the ways that one run may have
//! gone, with their probabilities.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use super::columns::from_columns;
use super::levels::Switching;
use super::seen::Seen;
use super::tie::AMPLITUDE_SIGMA;

/// Cells that a run is looked at in: seconds of one dwell together where it is long.
const CELLS: usize = 160;
/// Ways that are followed at once, and log odds below the likeliest at which one is given up.
const MOST_WAYS: usize = 256;
const UNLIKELY: f64 = 16.0;
/// Cells after which it no longer matters when the last switch was.
const RECENT: usize = 8;
/// Ways that are given, and log odds below the likeliest of the last.
const MOST_GIVEN: usize = 16;
const GIVEN: f64 = 7.0;
/// Prior standard deviations of a run's own unknowns: of the rates along the index, in horizontal rates; of the bias, in the run's rates.
const OF_HORIZONTAL: f64 = 3.0;
const OF_BIAS: f64 = 10.0;
/// Variance of a share that may be any.
const OF_SHARE: f64 = 1.0 / 12.0;

/// One way that a run may have gone.
#[derive(Clone, Debug)]
pub struct Way {
    pub log_probability: f64,
    /// Log of the prior probability that, with this way's likelihood, makes the evidence of all ways together.
    pub log_prior: f64,
    pub switches: usize,
    /// What it does over the samples, °/h, and columns of a factor of the covariance of that.
    pub mean: DVector<f64>,
    pub factor: DMatrix<f64>,
}

/// Expected statistics of one run, from which the numbers that runs share are estimated.
#[derive(Clone, Copy, Debug, Default)]
pub struct Statistics {
    /// Expected seconds at each level, and switches away from it.
    pub spent_s: [f64; 2],
    pub left: [f64; 2],
    /// By how much the levels differ, and the variance of that, °/h.
    pub step_deg_h: f64,
    pub variance: f64,
}

/// Seconds of one dwell together.
struct Cell {
    dwell: usize,
    middle_s: f64,
    seconds: Vec<usize>,
    row: [f64; 2],
    rate_deg_h: f64,
    variance: f64,
}

/// A way so far: beside it, what is known of the rates along the index, the bias and the levels' difference.
#[derive(Clone)]
struct Follower {
    /// Log of its probability with the rates so far, with that of ways that are no longer told from it; of its own; and of the switches alone.
    log_weight: f64,
    log_own: f64,
    log_prior: f64,
    upper: bool,
    began_upper: bool,
    /// Cell of the last switch and the one before, in the list of all switches.
    last: Option<usize>,
    /// Levels at the dwells' beginnings.
    signature: u128,
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

/// A switch and the one before it.
#[derive(Clone, Copy)]
struct Switch {
    cell: usize,
    before: Option<usize>,
}

impl Follower {
    /// Takes a rate in: its row, its variance.
    fn observe(&mut self, row: Vector4<f64>, value: f64, variance: f64) {
        let gain = self.covariance * row;
        let of_rate = row.dot(&gain) + variance;
        let missed = value - row.dot(&self.mean);
        let log_likelihood = -0.5 * (missed * missed / of_rate + of_rate.ln());
        self.log_weight += log_likelihood;
        self.log_own += log_likelihood;
        self.mean += gain * (missed / of_rate);
        self.covariance -= gain * gain.transpose() / of_rate;
    }

    /// What it is expected to do, or not.
    fn expect(&mut self, log_probability: f64) {
        self.log_weight += log_probability;
        self.log_own += log_probability;
        self.log_prior += log_probability;
    }

    /// Takes a cell in; one in which a switch happens has a share of the upper level that may be any.
    fn see(&mut self, cell: &Cell, switched: bool) {
        let share = if switched { 0.5 } else { f64::from(u8::from(self.upper)) };
        let of_share = OF_SHARE * (self.mean[3] * self.mean[3] + self.covariance[(3, 3)]);
        let variance = cell.variance + if switched { of_share } else { 0.0 };
        self.observe(Vector4::new(cell.row[0], cell.row[1], 1.0, share), cell.rate_deg_h, variance);
    }

    /// The horizontal rate is Ω cos φ.
    fn tie_amplitude(&mut self, north_deg_h: f64) {
        let amplitude = self.mean[0].hypot(self.mean[1]);
        let along = Vector4::new(self.mean[0], self.mean[1], 0.0, 0.0) / amplitude.max(f64::MIN_POSITIVE);
        self.observe(along, north_deg_h, (AMPLITUDE_SIGMA * north_deg_h).powi(2));
    }
}

impl Switching {
    fn begin(&self, run: &Seen<'_>, cells: &[Cell]) -> Vec<Follower> {
        let north_deg_h = run.sheet.recording.north_deg_h;
        let largest = cells.iter().map(|cell| cell.rate_deg_h.abs()).fold(north_deg_h, f64::max);
        let along = (OF_HORIZONTAL * north_deg_h).powi(2);
        let covariance =
            Matrix4::from_diagonal(&Vector4::new(along, along, (OF_BIAS * largest).powi(2), self.spread_deg_h.powi(2)));
        let levels: &[bool] = if self.is_of_each_run() { &[false] } else { &[false, true] };
        let of_level = |&upper: &bool| {
            let share = if upper { self.upper() } else { 1.0 - self.upper() };
            let mut follower = Follower {
                log_weight: 0.0,
                log_own: 0.0,
                log_prior: 0.0,
                upper,
                began_upper: upper,
                last: None,
                signature: u128::from(upper),
                mean: Vector4::new(0.0, 0.0, 0.0, self.step_deg_h),
                covariance,
            };
            follower.expect(if self.is_of_each_run() { 0.0 } else { share.ln() });
            // An amplitude alone says nothing before there is a direction.
            for tie in run.ties.iter().filter(|_| run.ties.len() > 1) {
                follower.observe(Vector4::new(tie.row[0], tie.row[1], tie.row[2], 0.0), tie.value, 1.0);
            }
            follower
        };
        levels.iter().map(of_level).collect()
    }

    /// All ways that remain possible, the likeliest first, and their switches.
    fn follow(&self, run: &Seen<'_>, cells: &[Cell]) -> (Vec<Follower>, Vec<Switch>) {
        let mut ways = self.begin(run, cells);
        let mut switches: Vec<Switch> = Vec::new();
        for (number, cell) in cells.iter().enumerate() {
            let before = number.checked_sub(1).map(|before| &cells[before]);
            let same_dwell = before.is_none_or(|before| before.dwell == cell.dwell);
            let mut next: Vec<Follower> = Vec::with_capacity(2 * ways.len());
            for way in ways {
                let changes = before.map_or(0.0, |before| self.changes(way.upper, cell.middle_s - before.middle_s));
                if changes > 0.0 {
                    let mut other = way.clone();
                    other.expect(changes.ln());
                    other.upper = !way.upper;
                    switches.push(Switch { cell: number, before: way.last });
                    other.last = Some(switches.len() - 1);
                    other.see(cell, same_dwell);
                    next.push(other);
                }
                let mut same = way;
                same.expect((-changes).ln_1p());
                same.see(cell, false);
                next.push(same);
            }
            if !same_dwell {
                next.iter_mut().for_each(|way| way.signature = (way.signature << 1) | u128::from(way.upper));
            }
            ways = fewer(next, &switches, number);
        }
        if run.ties.len() < 2 {
            ways.iter_mut().for_each(|way| way.tie_amplitude(run.sheet.recording.north_deg_h));
        }
        ways.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
        (ways, switches)
    }

    /// The ways that a run may have gone beside what is known of it, the likeliest first.
    pub fn ways(&self, run: &Seen<'_>, residual: &DVector<f64>) -> Vec<Way> {
        let cells = cells(run, residual);
        let (followers, switches) = self.follow(run, &cells);
        let Some(most) = followers.first().map(|first| first.log_weight) else { return Vec::new() };
        let all = log_sum(&followers);
        let given = followers.iter().take(MOST_GIVEN).filter(|each| each.log_weight > most - GIVEN);
        given
            .map(|each| {
                let (mean, factor) = self.over_samples(run, &cells, each, &switches);
                let log_prior = each.log_prior + all - each.log_own;
                Way {
                    log_probability: each.log_weight - all,
                    log_prior,
                    switches: switched(each, &switches).len(),
                    mean,
                    factor,
                }
            })
            .collect()
    }

    /// What a way does over the samples, and a factor of its covariance: of the levels' difference, and of when in a cell each switch was.
    fn over_samples(
        &self,
        run: &Seen<'_>,
        cells: &[Cell],
        way: &Follower,
        switches: &[Switch],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let seconds = run.sheet.recording.len();
        let (mut share, mut unsure): (Vec<f64>, Vec<Vec<f64>>) = (vec![0.0; seconds], Vec::new());
        let size_deg_h = self.step_deg_h.hypot(self.spread_deg_h);
        for (number, (cell, (upper, switches))) in cells.iter().zip(levels(way, switches, cells.len())).enumerate() {
            let within = switches && number > 0 && cells[number - 1].dwell == cell.dwell;
            let value = if within { 0.5 } else { f64::from(u8::from(upper)) };
            cell.seconds.iter().for_each(|&i| share[i] = value);
            if within {
                let mut column = vec![0.0; seconds];
                cell.seconds.iter().for_each(|&i| column[i] = OF_SHARE.sqrt() * size_deg_h);
                unsure.push(column);
            }
        }
        let means = |series: &[f64]| run.sheet.samples.means(series.iter().copied());
        let share = DVector::from_vec(means(&share));
        let columns = std::iter::once((&share * self.spread_deg_h).as_slice().to_vec());
        let factor = from_columns(share.len(), columns.chain(unsure.iter().map(|column| means(column))));
        (share * self.step_deg_h, factor)
    }

    /// What a run tells of the numbers.
    pub fn statistics(&self, run: &Seen<'_>, residual: &DVector<f64>) -> Statistics {
        let cells = cells(run, residual);
        let (followers, switches) = self.follow(run, &cells);
        let mut statistics = Statistics::default();
        let all = log_sum(&followers);
        let mut square = 0.0;
        for way in &followers {
            let weight = (way.log_weight - all).exp();
            // The upper level is the one of the higher rate.
            let turned = way.mean[3] < 0.0;
            for (number, (cell, (upper, switches))) in cells.iter().zip(levels(way, &switches, cells.len())).enumerate()
            {
                if switches {
                    statistics.left[usize::from(upper == turned)] += weight;
                }
                let before_s = number.checked_sub(1).map_or(cell.middle_s, |before| cells[before].middle_s);
                statistics.spent_s[usize::from(upper != turned)] += weight * (cell.middle_s - before_s);
            }
            let step = if turned { -way.mean[3] } else { way.mean[3] };
            statistics.step_deg_h += weight * step;
            square += weight * (step * step + way.covariance[(3, 3)]);
        }
        statistics.variance = square - statistics.step_deg_h.powi(2);
        statistics
    }
}

/// Logarithm of the sum of the weights of all ways.
fn log_sum(ways: &[Follower]) -> f64 {
    let most = ways.iter().map(|way| way.log_weight).fold(f64::NEG_INFINITY, f64::max);
    most + ways.iter().map(|way| (way.log_weight - most).exp()).sum::<f64>().ln()
}

/// Of every cell whether a way is at the upper level in it, and whether it has switched since the one before.
fn levels(way: &Follower, switches: &[Switch], cells: usize) -> Vec<(bool, bool)> {
    let at = switched(way, switches);
    let (mut upper, mut next) = (way.began_upper, at.iter().peekable());
    let of_cell = |cell: usize| {
        let switches = next.next_if(|at| **at == cell).is_some();
        upper ^= switches;
        (upper, switches)
    };
    (0..cells).map(of_cell).collect()
}

/// Cells of a way's switches, in order.
fn switched(way: &Follower, switches: &[Switch]) -> Vec<usize> {
    let mut at = Vec::new();
    let mut last = way.last;
    while let Some(place) = last {
        at.push(switches[place].cell);
        last = switches[place].before;
    }
    at.reverse();
    at
}

/// Ways that differ only in when switches of long ago were are one; of the others the likeliest.
fn fewer(mut ways: Vec<Follower>, switches: &[Switch], now: usize) -> Vec<Follower> {
    let recent = |way: &Follower| {
        way.last.map(|last| switches[last].cell).filter(|cell| cell + RECENT > now).unwrap_or(usize::MAX)
    };
    let key = |way: &Follower| (way.signature, way.upper, recent(way));
    ways.sort_by(|a, b| key(a).cmp(&key(b)).then(b.log_weight.total_cmp(&a.log_weight)));
    let mut kept: Vec<Follower> = Vec::with_capacity(ways.len());
    let mut last = None;
    for way in ways {
        let of_way = key(&way);
        match kept.last_mut().filter(|_| last == Some(of_way)) {
            Some(likeliest) => likeliest.log_weight += (way.log_weight - likeliest.log_weight).exp().ln_1p(),
            None => kept.push(way),
        }
        last = Some(of_way);
    }
    kept.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    kept.truncate(MOST_WAYS);
    if let Some(most) = kept.first().map(|first| first.log_weight) {
        kept.retain(|way| way.log_weight > most - UNLIKELY);
    }
    kept
}

/// Seconds of a run together, less what effects do in them.
fn cells(run: &Seen<'_>, residual: &DVector<f64>) -> Vec<Cell> {
    let (recording, samples) = (run.sheet.recording, &run.sheet.samples);
    let of_samples = samples.means(recording.rate_deg_h.iter().copied());
    let effects: Vec<f64> = of_samples.iter().zip(residual.iter()).map(|(rate, left)| rate - left).collect();
    let effects = samples.by_second(&effects);
    let entering: Vec<usize> = (0..recording.len()).filter(|&i| samples.weight_of(i).is_some()).collect();
    let together = entering.len().div_ceil(CELLS).max(1);
    let mut all: Vec<Vec<usize>> = Vec::new();
    for &i in &entering {
        match all.last_mut().filter(|last| last.len() < together && recording.dwell[last[0]] == recording.dwell[i]) {
            Some(last) => last.push(i),
            None => all.push(vec![i]),
        }
    }
    all.into_iter()
        .map(|seconds| {
            let weights: Vec<f64> = seconds.iter().filter_map(|&i| samples.weight_of(i)).collect();
            let total: f64 = weights.iter().sum();
            let mean = |of: &dyn Fn(usize) -> f64| {
                seconds.iter().zip(&weights).map(|(&i, weight)| weight * of(i)).sum::<f64>() / total
            };
            Cell {
                dwell: recording.dwell[seconds[0]],
                middle_s: mean(&|i| recording.t_s[i]),
                row: [mean(&|i| recording.design[i].cos), mean(&|i| recording.design[i].sin)],
                rate_deg_h: mean(&|i| recording.rate_deg_h[i] - effects[i]),
                variance: 1.0 / total,
                seconds,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a variance of 4 a rate of 3 with one of 1 beside it makes 3 · 4/5 and a variance of 4/5; its density is that of variance 5.
    #[test]
    fn a_rate_is_taken_in_by_hand() {
        let mut way = Follower {
            log_weight: 0.0,
            log_own: 0.0,
            log_prior: 0.0,
            upper: false,
            began_upper: false,
            last: None,
            signature: 0,
            mean: Vector4::zeros(),
            covariance: Matrix4::identity() * 4.0,
        };
        way.observe(Vector4::new(0.0, 0.0, 1.0, 0.0), 3.0, 1.0);
        assert!((way.mean[2] - 2.4).abs() < 1e-12 && (way.covariance[(2, 2)] - 0.8).abs() < 1e-12);
        assert!((way.log_weight + 0.5 * (9.0 / 5.0 + 5f64.ln())).abs() < 1e-12);
        // The horizontal rate of 3 and 4 is 5: along it nothing is missed.
        way.mean = Vector4::new(3.0, 4.0, 0.0, 0.0);
        way.tie_amplitude(5.0);
        assert!((way.mean[0] - 3.0).abs() < 1e-12 && way.covariance[(0, 0)] < 4.0);
    }
}
