//! The readings of one attitude at rest: mean and spread, outliers dropped.

use quantities::median::median;

use crate::statistics::SIGMA_PER_MEDIAN_DEVIATION;

/// Fewest readings that an attitude has; the source takes ten.
pub const LEAST_READINGS: usize = 3;
/// The preset limit: a reading further than this from the median of its attitude, in robust standard deviations, is an
/// outlier.
pub const OUTLIER_SIGMAS: f64 = 6.0;

/// Mean readings of an attitude, in the unit of the readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attitude {
    /// Mean of x, y, z.
    pub mean: [f64; 3],
    /// Sums of squared deviations of x, y, z from it.
    pub squares: [f32; 3],
    /// Readings that entered.
    pub readings: u16,
    /// Readings that were dropped as outliers.
    pub dropped: u16,
}

impl Attitude {
    /// Of readings x, y, z. `granted`: standard deviation that a reading is granted even if the others lie closer together:
    /// its known noise, the smallest step of the converter, or 0. `scratch` has room for as many numbers as there are
    /// readings.
    ///
    /// `None` where fewer than [`LEAST_READINGS`] are left, or most are outliers of each other.
    pub fn of(readings: &[[f64; 3]], granted: f64, scratch: &mut [f64]) -> Option<Self> {
        let bands = AXES.map(|axis| band(readings.iter().map(axis), granted, scratch));
        let kept = || {
            readings.iter().filter(|reading| {
                AXES.iter().zip(bands).all(|(axis, (middle, limit))| (axis(reading) - middle).abs() <= limit)
            })
        };
        let count = kept().count();
        if count < LEAST_READINGS || 2 * count < readings.len() {
            return None;
        }
        let number = count as f64;
        let mean = AXES.map(|axis| kept().map(axis).sum::<f64>() / number);
        let mut squares = [0.0; 3];
        for ((square, axis), mean) in squares.iter_mut().zip(AXES).zip(mean) {
            *square = kept().map(|reading| (axis(reading) - mean) * (axis(reading) - mean)).sum::<f64>() as f32;
        }
        Some(Self {
            mean,
            squares,
            readings: u16::try_from(count).unwrap_or(u16::MAX),
            dropped: u16::try_from(readings.len() - count).unwrap_or(u16::MAX),
        })
    }

    /// Standard deviation of a reading over the three axes, in the unit of the readings.
    pub fn spread(&self) -> f64 {
        let freedom = 3.0 * (f64::from(self.readings) - 1.0).max(1.0);
        libm::sqrt(self.squares.iter().copied().map(f64::from).sum::<f64>() / freedom)
    }
}

type Axis = fn(&[f64; 3]) -> f64;
const AXES: [Axis; 3] = [|[x, _, _]| *x, |[_, y, _]| *y, |[_, _, z]| *z];

/// Median, and how far from it a reading may be.
fn band(values: impl Iterator<Item = f64>, granted: f64, scratch: &mut [f64]) -> (f64, f64) {
    let mut count = 0;
    for (place, value) in scratch.iter_mut().zip(values.filter(|value| value.is_finite())) {
        *place = value;
        count += 1;
    }
    let Some(values) = scratch.get_mut(..count) else { return (0.0, -1.0) };
    let Some(middle) = median(values) else { return (0.0, -1.0) };
    values.iter_mut().for_each(|value| *value = (*value - middle).abs());
    let deviation = SIGMA_PER_MEDIAN_DEVIATION * median(values).unwrap_or(0.0);
    (middle, OUTLIER_SIGMAS * deviation.max(granted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_spread_by_hand() {
        let readings = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        let attitude = Attitude::of(&readings, 0.0, &mut [0.0; 3]).unwrap();
        assert_eq!((attitude.mean, attitude.squares), ([2.0, 0.0, 0.0], [2.0, 0.0, 0.0]));
        assert!((attitude.spread() - (2.0_f64 / 6.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn an_outlier_is_dropped() {
        let mut readings = [0.9, 1.1, 1.0, 0.9, 1.1, 1.0, 0.9, 1.1, 1.0, 1.0].map(|x| [x, -x, 5.0 * x]);
        readings[4][1] = 7.0;
        let attitude = Attitude::of(&readings, 0.0, &mut [0.0; 10]).unwrap();
        assert_eq!((attitude.readings, attitude.dropped), (9, 1));
        assert!((attitude.mean[1] + 0.98889).abs() < 1e-5);
        readings[4][1] = f64::NAN;
        assert_eq!(Attitude::of(&readings, 0.0, &mut [0.0; 10]).unwrap().dropped, 1);
    }

    #[test]
    fn one_step_of_the_converter_is_no_outlier() {
        let mut readings = [[7.0, 7.0, 7.0]; 10];
        readings[3][0] = 8.0;
        assert_eq!(Attitude::of(&readings, 1.0, &mut [0.0; 10]).unwrap().dropped, 0);
        assert_eq!(Attitude::of(&readings, 0.0, &mut [0.0; 10]).unwrap().dropped, 1);
    }

    #[test]
    fn too_few_readings_are_no_attitude() {
        assert_eq!(Attitude::of(&[[1.0; 3]; 2], 0.0, &mut [0.0; 2]), None);
        assert_eq!(Attitude::of(&[], 0.0, &mut []), None);
    }
}
