//! Means of the velocity over blocks of equal length, in constant memory.

use heapless::Vec;
use nalgebra::Vector3;

/// Most blocks; when they are full, two become one of twice the length.
const MOST: usize = 512;
/// Length of the first ones, s.
const FIRST_S: f64 = 1.0;
/// (1, −3, 3, −1): the variance of a third difference of white noise is 20 times its own.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Fewest blocks that a window is left with when they are made longer.
const LEAST: usize = 25;
/// Third differences that grow more than so many times from one length of the blocks to twice that are those of a slow sway, or
/// of the rate's noise, which loses little by longer blocks.
const SMOOTH: f64 = 4.0;
/// Share of the mean variance that no block is below: four differences do not tell a variance well.
const FLOOR: f64 = 0.1;

/// One value a block.
pub(super) type BlockList<T> = Vec<T, MOST>;

/// Mean velocities, one after the other without a gap.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    means_m_s: BlockList<Vector3<f64>>,
    length_s: f64,
    /// Since the start, at the end of the last whole block.
    end_s: f64,
    /// Of the block in the making: its seconds, and the integral of velocity.
    open_s: f64,
    open_m: Vector3<f64>,
}

impl Default for Blocks {
    fn default() -> Self {
        Self { means_m_s: Vec::new(), length_s: FIRST_S, end_s: 0.0, open_s: 0.0, open_m: Vector3::zeros() }
    }
}

impl Blocks {
    /// `dt_s` with the mean velocity.
    pub(super) fn push(&mut self, dt_s: f64, mean_m_s: &Vector3<f64>) {
        self.open_s += dt_s;
        self.open_m += mean_m_s * dt_s;
        if self.open_s < self.length_s - 0.5 * dt_s {
            return;
        }
        self.end_s += self.open_s;
        let mean = self.open_m / self.open_s;
        (self.open_s, self.open_m) = (0.0, Vector3::zeros());
        // There is room: a full list is halved at once.
        if self.means_m_s.push(mean).is_ok() && self.means_m_s.is_full() {
            self.halve();
        }
    }

    /// Two become one.
    fn halve(&mut self) {
        // An odd one at the end is left out.
        self.end_s -= self.step_s() * (self.count() % 2) as f64;
        self.means_m_s = self.means_m_s.chunks_exact(2).map(|pair| pair.iter().sum::<Vector3<f64>>() / 2.0).collect();
        self.length_s *= 2.0;
    }

    /// Blocks so long that a slow sway is as good as white in them: from one length to the next its third differences grow up to
    /// 64 times, those of white rate noise 8 times, of white force twice.
    pub(super) fn whitened(&self, up: &Vector3<f64>) -> Self {
        let (mut whitened, mut longer) = (self.clone(), self.clone());
        while longer.count() >= 2 * LEAST {
            let before = longer.mean_variance(up);
            longer.halve();
            if longer.mean_variance(up) > SMOOTH * before {
                whitened.clone_from(&longer);
            }
        }
        whitened
    }

    /// Mean of the velocity's variance in a block along each axis across `up` by third differences, (m/s)².
    pub(super) fn mean_variance(&self, up: &Vector3<f64>) -> f64 {
        let sums = self.third_differences(up).fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        (sums.0 / f64::max(sums.1, 1.0)).max(f64::MIN_POSITIVE)
    }

    fn third_differences(&self, up: &Vector3<f64>) -> impl Iterator<Item = f64> {
        let fours = self.means_m_s.windows(4).filter_map(|four| <&[Vector3<f64>; 4]>::try_from(four).ok());
        fours.map(|[a, b, c, d]| {
            let third = d - a + (b - c) * 3.0;
            0.5 * (third.norm_squared() - square(third.dot(up))) / THIRD_DIFFERENCE
        })
    }

    pub(super) fn count(&self) -> usize {
        self.means_m_s.len()
    }

    /// Time between blocks, s.
    pub(super) fn step_s(&self) -> f64 {
        self.end_s / self.count().max(1) as f64
    }

    /// Middle of a block and its mean velocity.
    pub(super) fn iter(&self) -> impl Iterator<Item = (f64, Vector3<f64>)> {
        let step_s = self.step_s();
        self.means_m_s.iter().enumerate().map(move |(number, mean)| ((number as f64 + 0.5) * step_s, *mean))
    }

    /// Specific force by the first two blocks and by the last two, m/s².
    pub(super) fn first_and_last_force(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let force = |pair: &[Vector3<f64>]| Some((pair.last()? - pair.first()?) / self.step_s());
        Some((force(self.means_m_s.get(..2)?)?, force(self.means_m_s.get(self.count().checked_sub(2)?..)?)?))
    }

    /// The same for each block by the differences around it: a vehicle rocks for seconds and is quiet for minutes.
    pub(super) fn local_variances(&self, up: &Vector3<f64>) -> BlockList<f64> {
        let squares: BlockList<f64> = self.third_differences(up).collect();
        let floor = FLOOR * self.mean_variance(up);
        (0..self.count())
            .map(|block| {
                let around = squares.get(block.saturating_sub(3)..squares.len().min(block + 1)).unwrap_or_default();
                floor + around.iter().sum::<f64>() / around.len().max(1) as f64
            })
            .collect()
    }
}

fn square(value: f64) -> f64 {
    value * value
}
