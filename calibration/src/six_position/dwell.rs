//! A dwell at one position of the table, boiled down to what the solution needs of it.

use core::ops::Range;

use quantities::median::median;
use quantities::units::ARCSEC_PER_RAD;

use crate::statistics::SIGMA_PER_MEDIAN_DEVIATION;

/// Fewest quiet rows that a mean and its scatter are taken of.
pub const LEAST_ROWS: usize = 16;
/// A row further than this from the dwell's level, in standard deviations, was not quiet.
const LIMIT_SIGMAS: f64 = 6.0;
/// Parts of a dwell whose means are compared, to see whether the rate wandered.
const PARTS: usize = 8;
/// Degrees of freedom of that comparison.
pub const WANDER_FREEDOM: u32 = PARTS as u32 - 1;
/// Noise that every gyro is granted, °/h: far below any that there is.
const LEAST_NOISE_DEG_H: f64 = 1e-4;
/// A turn between two rests that changes no rate by more than this part of what their difference is known to does not matter.
const HARMLESS: f64 = 0.25;
/// A turn that would change a rate by so many times what the difference is known to would show in it.
const WOULD_SHOW: f64 = 6.0;
/// Rates of two rests that differ by no more than this, in standard deviations of their difference, agree.
const AGREE: f64 = 3.0;

/// Mean rates of a dwell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dwell {
    /// Mean output of the gyros x, y, z, °/h.
    pub rate_deg_h: [f64; 3],
    /// Variance of these means, (°/h)², if successive rows are independent.
    pub variance: [f64; 3],
    /// Scatter of the means of eighths of the dwell over what independent rows would give: a chi-square with
    /// [`WANDER_FREEDOM`] degrees of freedom where the rate did not wander.
    pub wander: [f64; 3],
    /// Rows that entered, and rows that were left out because the table moved or the triad was struck.
    pub rows: usize,
    pub left_out: usize,
    /// Of those left out: rests at another attitude.
    pub turned: Option<Turned>,
}

/// Rests at another attitude than the one that counts: after a shock that left the triad turned, or before the table came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turned {
    pub rows: usize,
    /// The greatest turn between them and the rest that counts, about any one axis, arcsec.
    pub arcsec: f64,
}

/// Why a dwell says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DwellError {
    /// Fewer than [`LEAST_ROWS`].
    TooShort { rows: usize },
    /// Not half of the rows belong to one level of rate.
    Moving { quiet: usize, rows: usize },
    /// Not a number, or infinite.
    NotFinite { row: usize },
}

impl core::fmt::Display for DwellError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooShort { rows } => {
                write!(f, "{rows} intervals of rest and motion; at least {LEAST_ROWS} are needed")
            }
            Self::Moving { quiet, rows } => {
                write!(f, "the triad was at rest for only {quiet} of {rows} intervals; at least half are needed")
            }
            Self::NotFinite { row } => write!(f, "the mean number {row} is not a finite number"),
        }
    }
}

/// One gyro's level and how far a quiet row may be from it, °/h.
#[derive(Clone, Copy, Default)]
struct Band {
    level: f64,
    half_width: f64,
}

impl Dwell {
    /// Of mean rates over successive intervals of `row_s`, about a second: x, y, z in °/h. `scratch` has room for as many
    /// numbers as there are rows.
    ///
    /// The noise is taken from the changes between successive rows. A change of more than six standard deviations parts
    /// the dwell; the longest part gives the level, and rows further than six standard deviations from it, with their
    /// neighbours, are left out. What these add up to is the angle by which the triad turned meanwhile. Rests that are turned
    /// against the longest one are left out too, unless the turn is too small to matter, or so large that it would show in
    /// the rates and does not: then the rows were wrong, and the triad did not turn.
    pub fn of(rates: &[[f64; 3]], row_s: f64, scratch: &mut [f64]) -> Result<Self, DwellError> {
        if rates.len() < LEAST_ROWS {
            return Err(DwellError::TooShort { rows: rates.len() });
        }
        if let Some(row) = rates.iter().position(|rate| !rate.iter().all(|part| part.is_finite())) {
            return Err(DwellError::NotFinite { row });
        }
        let jumps = AXES.map(|axis| jump(rates, axis, scratch));
        let longest = rates.get(longest_part(rates, jumps)).unwrap_or(rates);
        let bands = AXES.map(|axis| Band {
            level: median_of(longest.iter().map(axis), scratch),
            half_width: jump(rates, axis, scratch) / core::f64::consts::SQRT_2,
        });
        let quiet = (0..rates.len()).filter(|row| is_quiet(rates, &bands, *row)).count();
        let turned = mark(rates, &bands, row_s, scratch);
        let marked = || rates.iter().zip(&*scratch).filter(|(_, mark)| **mark > 0.0).map(|(rate, _)| rate);
        let rows = marked().count();
        if rows < LEAST_ROWS || 2 * quiet < rates.len() {
            return Err(DwellError::Moving { quiet, rows: rates.len() });
        }
        let statistics = AXES.map(|axis| Statistics::of(rows, || marked().map(axis)));
        Ok(Self {
            rate_deg_h: statistics.map(|axis| axis.mean),
            variance: statistics.map(|axis| axis.variance),
            wander: statistics.map(|axis| axis.wander),
            rows,
            left_out: rates.len() - rows,
            turned,
        })
    }
}

type Axis = fn(&[f64; 3]) -> f64;
const AXES: [Axis; 3] = [|[x, _, _]| *x, |[_, y, _]| *y, |[_, _, z]| *z];

/// Change between successive rows that noise does not make, °/h.
fn jump(rates: &[[f64; 3]], axis: Axis, scratch: &mut [f64]) -> f64 {
    let changes = || {
        rates.windows(2).map(move |pair| match pair {
            [a, b] => (axis(b) - axis(a)).abs(),
            _ => 0.0,
        })
    };
    let (mut least, mut nonzero) = (f64::INFINITY, 0_usize);
    for change in changes().filter(|change| *change > 0.0) {
        least = least.min(change);
        nonzero += 1;
    }
    // Readings in coarse steps: most changes may be zero, and one step is still noise.
    let step = if 50 * nonzero > rates.len() { 0.5 * core::f64::consts::SQRT_2 * least } else { 0.0 };
    let sigma = SIGMA_PER_MEDIAN_DEVIATION * median_of(changes(), scratch);
    LIMIT_SIGMAS * sigma.max(step).max(LEAST_NOISE_DEG_H)
}

fn median_of(values: impl Iterator<Item = f64>, scratch: &mut [f64]) -> f64 {
    let mut count = 0;
    for (place, value) in scratch.iter_mut().zip(values) {
        *place = value;
        count += 1;
    }
    scratch.get_mut(..count).and_then(median).unwrap_or(0.0)
}

/// The longest run of rows without a jump in between.
fn longest_part(rates: &[[f64; 3]], jumps: [f64; 3]) -> Range<usize> {
    let (mut longest, mut start) = (0..0, 0);
    for (i, pair) in rates.windows(2).enumerate() {
        let jumped = match pair {
            [a, b] => AXES.iter().zip(jumps).any(|(axis, jump)| (axis(b) - axis(a)).abs() > jump),
            _ => false,
        };
        if jumped {
            start = i + 1;
        }
        if i + 2 - start > longest.len() {
            longest = start..i + 2;
        }
    }
    longest
}

/// Whether a row lies in the bands, and its neighbours do.
fn is_quiet(rates: &[[f64; 3]], bands: &[Band; 3], row: usize) -> bool {
    let inside =
        |rate: &[f64; 3]| AXES.iter().zip(bands).all(|(axis, band)| (axis(rate) - band.level).abs() <= band.half_width);
    rates.get(row.saturating_sub(1)..(row + 2).min(rates.len())).is_some_and(|near| near.iter().all(inside))
}

/// The rests: runs of quiet rows.
fn rests<'a>(rates: &'a [[f64; 3]], bands: &'a [Band; 3]) -> impl Iterator<Item = Range<usize>> + use<'a> {
    let mut row = 0;
    core::iter::from_fn(move || {
        while row < rates.len() && !is_quiet(rates, bands, row) {
            row += 1;
        }
        let start = row;
        while row < rates.len() && is_quiet(rates, bands, row) {
            row += 1;
        }
        (start < row).then_some(start..row)
    })
}

/// Marks with 1 the rows of the longest rest, and of rests at the same attitude; all others with 0.
fn mark(rates: &[[f64; 3]], bands: &[Band; 3], row_s: f64, marks: &mut [f64]) -> Option<Turned> {
    marks.fill(0.0);
    let longest = rests(rates, bands).max_by_key(Range::len)?;
    let mut turned = Turned { rows: 0, arcsec: 0.0 };
    for rest in rests(rates, bands) {
        let between = longest.end.min(rest.end)..longest.start.max(rest.start);
        let disturbed = || between.clone().filter(|row| !is_quiet(rates, bands, *row)).filter_map(|row| rates.get(row));
        let mut turn_arcsec = [0.0; 3];
        for ((turn, axis), band) in turn_arcsec.iter_mut().zip(AXES).zip(bands) {
            *turn = disturbed().map(|rate| (axis(rate) - band.level) * row_s).sum();
        }
        let [here, there] = [&rest, &longest].map(|rows| rates.get(rows.clone()).unwrap_or_default());
        if rest == longest || is_same_attitude(here, there, bands, turn_arcsec) {
            marks.get_mut(rest).unwrap_or_default().fill(1.0);
        } else {
            turned.rows += rest.len();
            turned.arcsec = turn_arcsec.iter().fold(turned.arcsec, |most, turn| most.max(turn.abs()));
        }
    }
    (turned.rows > 0).then_some(turned)
}

/// Whether two rests are one attitude as far as the rates can tell, with that turn between them. A triad that turns by δ feels
/// rates that differ by δ × ω.
fn is_same_attitude(here: &[[f64; 3]], there: &[[f64; 3]], bands: &[Band; 3], turn_arcsec: [f64; 3]) -> bool {
    let [dx, dy, dz] = turn_arcsec.map(|turn| turn / ARCSEC_PER_RAD);
    let [x, y, z] = bands.map(|band| band.level);
    let expected = [dy * z - dz * y, dz * x - dx * z, dx * y - dy * x];
    let number = |rates: &[[f64; 3]]| rates.len() as f64;
    let (mut of_expected, mut of_observed) = (0.0, 0.0);
    for ((axis, expected), band) in AXES.iter().zip(expected).zip(bands) {
        let mean = |rates: &[[f64; 3]]| rates.iter().map(axis).sum::<f64>() / number(rates);
        let sigma = band.half_width / LIMIT_SIGMAS * libm::sqrt(1.0 / number(here) + 1.0 / number(there));
        of_expected = f64::max(of_expected, expected.abs() / sigma);
        of_observed = f64::max(of_observed, (mean(here) - mean(there)).abs() / sigma);
    }
    of_expected <= HARMLESS || (of_expected >= WOULD_SHOW && of_observed <= AGREE)
}

#[derive(Clone, Copy)]
struct Statistics {
    mean: f64,
    variance: f64,
    wander: f64,
}

impl Statistics {
    /// Of `count` values, at least [`LEAST_ROWS`].
    fn of<V: Iterator<Item = f64>>(count: usize, values: impl Fn() -> V) -> Self {
        let number = count as f64;
        let mean = values().sum::<f64>() / number;
        let of_row = values().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (number - 1.0);
        let each = count / PARTS;
        let scatter = (0..PARTS)
            .map(|part| {
                let rows = if part + 1 == PARTS { count - each * part } else { each };
                let away = values().skip(each * part).take(rows).sum::<f64>() / rows as f64 - mean;
                rows as f64 * away * away
            })
            .sum::<f64>();
        Self { mean, variance: of_row / number, wander: if of_row > 0.0 { scatter / of_row } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// A level with a rough ±0.1 on it, whose mean over four rows is zero and which does not wander.
    fn rough(level: f64) -> Vec<[f64; 3]> {
        [0.1, -0.1, -0.1, 0.1].iter().cycle().take(64).map(|away| [level + away, -level - away, away + 0.0]).collect()
    }

    fn dwell(rates: &[[f64; 3]]) -> Result<Dwell, DwellError> {
        let mut scratch: Vec<f64> = rates.iter().map(|_| 0.0).collect();
        Dwell::of(rates, 1.0, &mut scratch)
    }

    #[test]
    fn mean_and_variance_by_hand() {
        let dwell = dwell(&rough(5.0)).unwrap();
        assert_eq!((dwell.rows, dwell.left_out), (64, 0));
        let [x, y, z] = dwell.rate_deg_h;
        assert!((x - 5.0).abs() < 1e-12 && (y + 5.0).abs() < 1e-12 && z.abs() < 1e-12);
        // 64 squares of 0.1 over 63 degrees of freedom, over 64 rows.
        assert!((dwell.variance[0] - 0.01 / 63.0).abs() < 1e-12);
        assert!(dwell.wander.iter().all(|wander| *wander < 1e-9));
    }

    #[test]
    fn a_shock_is_left_out_with_its_neighbours() {
        // 45″: at 5 °/h a change by 0.001 °/h.
        let mut rates = rough(5.0);
        rates[20][1] = 40.0;
        let dwell = dwell(&rates).unwrap();
        assert_eq!((dwell.rows, dwell.left_out, dwell.turned), (61, 3, None));
        assert!((dwell.rate_deg_h[1] + 5.0).abs() < 0.01);
    }

    #[test]
    fn the_table_turning_in_and_away_is_left_out() {
        let mut rates: Vec<_> = [[20_000.0, 0.0, 0.0]; 5].to_vec();
        rates.extend(rough(5.0));
        rates.extend([[-3000.0, 500.0, 0.0]; 3]);
        rates.extend(rough(-7.0).into_iter().take(20));
        let dwell = dwell(&rates).unwrap();
        assert!((dwell.rate_deg_h[0] - 5.0).abs() < 0.01, "{dwell:?}");
        assert_eq!(dwell.rows, 62);
    }

    #[test]
    fn a_rest_that_is_turned_is_left_out() {
        // 64 rows, then 32 after a turn about z by 9000″ = 0.0436: x and y at ±5 °/h change by 0.218 °/h, more than the scatter
        // of 0.1 lets two means differ.
        let mut rates = rough(5.0);
        rates.extend(rough(5.0).into_iter().take(32).map(|[x, y, z]| [x - 0.218, y - 0.218, z]));
        rates[66][2] = 9000.0;
        let turned = dwell(&rates).unwrap();
        assert_eq!((turned.rows, turned.left_out), (65, 31));
        let Some(Turned { rows: 28, arcsec }) = turned.turned else { panic!("{turned:?}") };
        assert!((arcsec - 9000.0).abs() < 0.5, "{arcsec}");
        // To and fro.
        rates[67][2] = -9000.0;
        assert_eq!(dwell(&rates).unwrap().turned, None);
        // The other way round: the longer rest is the later one.
        rates[67][2] = 0.0;
        rates.reverse();
        assert_eq!(dwell(&rates).unwrap().turned.map(|turned| turned.rows), Some(28));
    }

    #[test]
    fn a_wrong_row_is_no_turn() {
        // 20,000″ that would show in the rates, and do not; and what no triad turns by in a second.
        for wrong in [20_000.0, 1e7] {
            let mut rates = rough(5.0);
            rates[20][2] = wrong;
            let dwell = dwell(&rates).unwrap();
            assert_eq!((dwell.rows, dwell.left_out, dwell.turned), (61, 3, None));
        }
    }

    #[test]
    fn a_wandering_rate_shows() {
        let rates: Vec<_> =
            rough(5.0).iter().zip(0..).map(|(rate, i)| rate.map(|x| x + 0.005 * f64::from(i))).collect();
        assert!(dwell(&rates).unwrap().wander.iter().all(|wander| *wander > 20.0));
    }

    #[test]
    fn coarse_steps_are_not_shocks() {
        // One row in ten reads a step of 0.1 more.
        let rates: Vec<_> = (0..100).map(|i| [if i % 10 == 3 { 0.1 } else { 0.0 }; 3]).collect();
        assert_eq!(dwell(&rates).unwrap().left_out, 0);
    }

    #[test]
    fn constant_rows_with_a_shock() {
        let mut rates = [[1.0, 2.0, 3.0]; 100].to_vec();
        rates[50] = [9.0, 2.0, 3.0];
        let dwell = dwell(&rates).unwrap();
        assert_eq!((dwell.left_out, dwell.rate_deg_h), (3, [1.0, 2.0, 3.0]));
    }

    #[test]
    fn what_says_nothing_is_refused() {
        assert_eq!(dwell(&rough(1.0)[..15]), Err(DwellError::TooShort { rows: 15 }));
        let mut rates = rough(1.0);
        rates[3][2] = f64::NAN;
        assert_eq!(dwell(&rates), Err(DwellError::NotFinite { row: 3 }));
        let sweep: Vec<_> = (0..100).map(|i| [f64::from(i * i), 0.0, 0.0]).collect();
        assert!(matches!(dwell(&sweep), Err(DwellError::Moving { .. })));
    }
}
