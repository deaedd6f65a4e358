//! A triad of accelerometers with a converter.

use crate::noise::{Source, Stream};
use nalgebra::{Matrix3, Vector3};

/// What the triad is like.
#[derive(Debug, Clone, PartialEq)]
pub struct AccelerometerTriad {
    /// Reading without specific force, in the unit of the readings.
    pub zero: [f64; 3],
    /// Readings per g of x, y, z.
    pub per_g: [f64; 3],
    /// Tilts of the sensitive axes: x towards y and z, y towards x and z, z towards x and y, arcsec.
    pub tilt_arcsec: [[f64; 2]; 3],
    /// Noise of a reading, standard deviation, in the unit of the readings.
    pub noise: f64,
    /// Part of the square of the specific force (g²) that is added, in g: what no ellipsoid has.
    pub quadratic: [f64; 3],
    /// Readings are whole numbers.
    pub counts: bool,
}

impl Default for AccelerometerTriad {
    /// Perfect, in g.
    fn default() -> Self {
        Self {
            zero: [0.0; 3],
            per_g: [1.0; 3],
            tilt_arcsec: [[0.0; 2]; 3],
            noise: 0.0,
            quadratic: [0.0; 3],
            counts: false,
        }
    }
}

impl AccelerometerTriad {
    /// Rows: sensitive axes in the case, of length one.
    fn axes(&self) -> Matrix3<f64> {
        let [x, y, z] = self.tilt_arcsec.map(|[a, b]| [a / 3600.0, b / 3600.0].map(f64::to_radians));
        let directions = [Vector3::new(1.0, x[0], x[1]), Vector3::new(y[0], 1.0, y[1]), Vector3::new(z[0], z[1], 1.0)];
        Matrix3::from_rows(&directions.map(|direction| direction.normalize().transpose()))
    }

    /// What undoes its linear errors: bias and M of f = M (raw − bias), M upper triangular; f is in a frame of the triad's own
    /// turned by its misalignments, since none of its readings shows that turn.
    pub fn correction(&self) -> ([f64; 3], [[f64; 3]; 3]) {
        let response = Matrix3::from_diagonal(&Vector3::from(self.per_g)) * self.axes();
        // MᵀM is the inverse of A Aᵀ for raw = bias + A f: its Cholesky factor.
        let squared = (response * response.transpose()).try_inverse().and_then(Matrix3::cholesky);
        let upper = squared.map_or(Matrix3::zeros(), |cholesky| cholesky.l().transpose());
        (self.zero, upper.transpose().into())
    }

    /// What is read without noise for a specific force along the axes of the case, g.
    pub fn ideal(&self, force_g: [f64; 3]) -> [f64; 3] {
        let felt = self.axes() * Vector3::from(force_g);
        let mut readings = self.zero;
        for (((reading, felt), per_g), quadratic) in
            readings.iter_mut().zip(felt.iter()).zip(self.per_g).zip(self.quadratic)
        {
            *reading += per_g * (felt + quadratic * felt * felt);
        }
        readings
    }

    /// A stream of noise for its readings.
    pub(super) fn stream(seed: u64) -> Stream {
        Stream::new(seed, Source::Accelerometer)
    }

    /// A reading.
    pub(super) fn read(&self, force_g: [f64; 3], stream: &mut Stream) -> [f64; 3] {
        self.ideal(force_g).map(|ideal| {
            let reading = ideal + self.noise * stream.normal();
            if self.counts { reading.round() } else { reading }
        })
    }
}
