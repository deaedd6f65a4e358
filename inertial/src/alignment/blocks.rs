//! Means of velocity and of what the gyros have turned over blocks of equal length, in constant memory.

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

/// Means over a block, or their integrals over an unfinished one.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    /// m/s.
    velocity: Vector3<f64>,
    /// Turn from the axes of the beginning as a rotation vector, rad.
    turn: Vector3<f64>,
}

/// Means, one after the other without a gap.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    means: BlockList<Mean>,
    length_s: f64,
    /// Since the start, at the end of the last whole block.
    end_s: f64,
    /// Of the block in the making: its seconds and its integrals.
    open_s: f64,
    open: Mean,
}

impl Default for Blocks {
    fn default() -> Self {
        Self { means: Vec::new(), length_s: FIRST_S, end_s: 0.0, open_s: 0.0, open: Mean::default() }
    }
}

impl Blocks {
    /// `dt_s` with the mean velocity and the mean turn.
    pub(super) fn push(&mut self, dt_s: f64, mean_m_s: &Vector3<f64>, turn_rad: &Vector3<f64>) {
        self.open_s += dt_s;
        self.open.velocity += mean_m_s * dt_s;
        self.open.turn += turn_rad * dt_s;
        if self.open_s < self.length_s - 0.5 * dt_s {
            return;
        }
        self.end_s += self.open_s;
        let mean = Mean { velocity: self.open.velocity / self.open_s, turn: self.open.turn / self.open_s };
        (self.open_s, self.open) = (0.0, Mean::default());
        // There is room: a full list is halved at once.
        if self.means.push(mean).is_ok() && self.means.is_full() {
            self.halve();
        }
    }

    /// Two become one.
    fn halve(&mut self) {
        // An odd one at the end is left out.
        self.end_s -= self.step_s() * (self.count() % 2) as f64;
        let halves = self.means.as_chunks::<2>().0.iter();
        self.means = halves
            .map(|[a, b]| Mean { velocity: (a.velocity + b.velocity) / 2.0, turn: (a.turn + b.turn) / 2.0 })
            .collect();
        self.length_s *= 2.0;
    }

    /// Blocks so long that a slow sway is as good as white in them: from one length to the next its third differences grow up to
    /// 64 times, those of white rate noise 8 times, of white force twice.
    pub(super) fn whitened(&self, up: &Vector3<f64>) -> Self {
        let (mut whitened, mut longer) = (self.clone(), self.clone());
        while longer.count() >= 2 * LEAST {
            let before = longer.velocity_variance(up);
            longer.halve();
            if longer.velocity_variance(up) > SMOOTH * before {
                whitened.clone_from(&longer);
            }
        }
        whitened
    }

    pub(super) fn count(&self) -> usize {
        self.means.len()
    }

    /// Time between blocks, s.
    pub(super) fn step_s(&self) -> f64 {
        self.end_s / self.count().max(1) as f64
    }

    /// Middle of a block, its mean velocity, and what the gyros have turned by then.
    pub(super) fn iter(&self) -> impl Iterator<Item = (f64, Vector3<f64>, Vector3<f64>)> {
        let step_s = self.step_s();
        self.means
            .iter()
            .enumerate()
            .map(move |(number, mean)| ((number as f64 + 0.5) * step_s, mean.velocity, mean.turn))
    }

    /// Specific force by the first two blocks, m/s².
    pub(super) fn first_force(&self) -> Option<Vector3<f64>> {
        let [first, second] = self.means.first_chunk::<2>()?;
        Some((second.velocity - first.velocity) / self.step_s())
    }

    fn velocity_variance(&self, up: &Vector3<f64>) -> f64 {
        mean_variance(&self.means.iter().map(|mean| mean.velocity).collect(), up)
    }
}

/// Mean of the blocks' variance along each axis across `up` by third differences.
pub(super) fn mean_variance(values: &BlockList<Vector3<f64>>, up: &Vector3<f64>) -> f64 {
    let sums = third_differences(values, up).fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    (sums.0 / f64::max(sums.1, 1.0)).max(f64::MIN_POSITIVE)
}

/// The same for each block by the differences around it: a vehicle rocks for seconds and is quiet for minutes.
pub(super) fn local_variances(values: &BlockList<Vector3<f64>>, up: &Vector3<f64>) -> BlockList<f64> {
    let squares: BlockList<f64> = third_differences(values, up).collect();
    let floor = FLOOR * mean_variance(values, up);
    (0..values.len())
        .map(|block| {
            let around = squares.get(block.saturating_sub(3)..squares.len().min(block + 1)).unwrap_or_default();
            floor + around.iter().sum::<f64>() / around.len().max(1) as f64
        })
        .collect()
}

fn third_differences(values: &[Vector3<f64>], up: &Vector3<f64>) -> impl Iterator<Item = f64> {
    let fours = values.windows(4).filter_map(|four| <&[Vector3<f64>; 4]>::try_from(four).ok());
    fours.map(|[a, b, c, d]| {
        let third = d - a + (b - c) * 3.0;
        0.5 * (third.norm_squared() - square(third.dot(up))) / THIRD_DIFFERENCE
    })
}

fn square(value: f64) -> f64 {
    value * value
}
