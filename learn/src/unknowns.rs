//! What a run's own unknowns take away of what it says of an effect: azimuth, amplitude and bias change its rates, too.

use nalgebra::{Matrix2, SymmetricEigen};

use super::problem::dot;
use super::rows::UNKNOWNS;

/// Directions in which the unknowns change the independent rows of a run.
pub struct Unknowns(Vec<Direction>);

struct Direction {
    /// Of unit size.
    rows: Vec<f32>,
    /// Share of a column's part in this direction that is taken out. What is left has 1/(1 + γ) of the information, where γ is what the rows know of
    /// the unknown by what is known beforehand: 1 of the bias, of which nothing is known beforehand.
    share: f32,
}

impl Unknowns {
    /// From what one sigma of azimuth, amplitude and bias adds to the rows, which are independent of each other and have unit variance.
    pub fn new([mut azimuth, mut amplitude, mut bias]: [Vec<f64>; UNKNOWNS]) -> Self {
        let size = dot(&bias, &bias).sqrt();
        bias.iter_mut().for_each(|row| *row /= size);
        for column in [&mut azimuth, &mut amplitude] {
            let share = dot(column, &bias);
            column.iter_mut().zip(&bias).for_each(|(row, bias)| *row -= share * bias);
        }
        let across = dot(&azimuth, &amplitude);
        let known = Matrix2::new(dot(&azimuth, &azimuth), across, across, dot(&amplitude, &amplitude));
        let eigen = SymmetricEigen::new(known);
        let mut directions = vec![Direction { rows: bias.iter().map(|row| *row as f32).collect(), share: 1.0 }];
        for (gamma, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *gamma > f64::EPSILON {
                let row = |(a, b): (&f64, &f64)| ((vector[0] * a + vector[1] * b) / gamma.sqrt()) as f32;
                let rows = azimuth.iter().zip(&amplitude).map(row).collect();
                directions.push(Direction { rows, share: (1.0 - 1.0 / (1.0 + gamma).sqrt()) as f32 });
            }
        }
        Self(directions)
    }

    /// Takes out of independent rows what the unknowns may have made: the squares of what is left add up to what the run says.
    pub fn take_out(&self, rows: &mut [f32]) {
        for direction in &self.0 {
            let part = dot(rows, &direction.rows);
            rows.iter_mut().zip(&direction.rows).for_each(|(row, own)| *row -= direction.share * part * own);
        }
    }

    /// Rows by whose squared inner products with independent rows the unknowns diminish what these say.
    pub fn diminishing(&self) -> impl Iterator<Item = Vec<f32>> {
        self.0.iter().map(|Direction { rows, share }| {
            let root = (1.0 - (1.0 - share).powi(2)).sqrt();
            rows.iter().map(|row| root * row).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four rows. The azimuth adds 1, −1, 0, 0 by one sigma, and the amplitude nothing to speak of: a column 2, 0, 1, 1 has the mean 1 and then 1, −1, 0, 0,
    /// with a square of 2; γ = 2, so that a third of it is left: 2/3. Of 0, 0, 1, −1 all is left.
    #[test]
    fn by_hand() {
        let unknowns = Unknowns::new([vec![1.0, -1.0, 0.0, 0.0], vec![0.0; 4], vec![1e3; 4]]);
        let said = |column: [f32; 4]| {
            let mut left = column;
            unknowns.take_out(&mut left);
            let squares: f32 = column.iter().map(|row| row * row).sum();
            let taken = unknowns.diminishing().map(|rows| rows.iter().zip(&column).map(|(a, b)| a * b).sum::<f32>());
            (left.iter().map(|row| row * row).sum::<f32>(), squares - taken.map(|each| each * each).sum::<f32>())
        };
        for (column, expected) in [([2.0, 0.0, 1.0, 1.0], 2.0 / 3.0), ([0.0, 0.0, 1.0, -1.0], 2.0), ([3.0; 4], 0.0)] {
            let (by_rows, by_products) = said(column);
            assert!(
                (by_rows - expected).abs() < 1e-5 && (by_products - expected).abs() < 1e-5,
                "{by_rows} {by_products}"
            );
        }
    }
}
