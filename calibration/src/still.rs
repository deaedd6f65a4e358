//! Rest and motion of an accelerometer triad, from its readings alone.
//!
//! Readings are taken together in short blocks. A triad rests while the readings scatter no more within a block than their
//! noise, and the means of the blocks stay where they are.

/// Part of the limit by which the mean of a block may differ from that of the rest so far.
const DRIFT: f64 = 0.5;

/// A block of readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Mean of x, y, z, in the unit of the readings.
    pub mean: [f64; 3],
    /// Standard deviation of a reading about it, over the three axes.
    pub spread: f64,
}

/// Collects readings to blocks.
#[derive(Clone, Debug)]
pub struct BlockMean {
    size: u16,
    count: u16,
    /// The first reading, from which the sums count: so that large offsets cost no digits.
    first: [f64; 3],
    sums: [f64; 3],
    squares: [f64; 3],
}

impl BlockMean {
    /// Blocks of `size` readings, at least two.
    pub fn new(size: u16) -> Self {
        Self { size: size.max(2), count: 0, first: [0.0; 3], sums: [0.0; 3], squares: [0.0; 3] }
    }

    /// Takes a reading; gives the block that it completes.
    pub fn push(&mut self, reading: [f64; 3]) -> Option<Block> {
        if self.count == 0 {
            *self = Self { first: reading, ..Self::new(self.size) };
        }
        self.count += 1;
        for (((sum, square), part), first) in self.sums.iter_mut().zip(&mut self.squares).zip(reading).zip(self.first) {
            *sum += part - first;
            *square += (part - first) * (part - first);
        }
        if self.count < self.size {
            return None;
        }
        self.count = 0;
        let number = f64::from(self.size);
        let scatter: f64 =
            self.sums.iter().zip(self.squares).map(|(sum, square)| (square - sum * sum / number).max(0.0)).sum();
        let mut mean = self.first;
        for (mean, sum) in mean.iter_mut().zip(self.sums) {
            *mean += sum / number;
        }
        Some(Block { mean, spread: libm::sqrt(scatter / (3.0 * (number - 1.0))) })
    }

    /// Forgets a block that is not complete.
    pub fn clear(&mut self) {
        self.count = 0;
    }
}

/// A rest so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    sums: [f64; 3],
    blocks: u32,
}

impl Rest {
    /// Whether a block continues the rest, by the largest `spread` that is still noise; then it is taken in.
    pub fn continues(&mut self, block: &Block, spread: f64) -> bool {
        let number = f64::from(self.blocks);
        let stays = self.blocks == 0
            || self.sums.iter().zip(block.mean).all(|(sum, mean)| (mean - sum / number).abs() <= DRIFT * spread);
        // Not-a-number continues nothing.
        if !(block.spread <= spread && stays && block.mean.iter().all(|mean| mean.is_finite())) {
            return false;
        }
        for (sum, mean) in self.sums.iter_mut().zip(block.mean) {
            *sum += mean;
        }
        self.blocks += 1;
        true
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.blocks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_spread_by_hand() {
        let mut blocks = BlockMean::new(3);
        assert_eq!(blocks.push([1e6 + 1.0, 0.0, 5.0]), None);
        assert_eq!(blocks.push([1e6 + 2.0, 0.0, 5.0]), None);
        let block = blocks.push([1e6 + 3.0, 0.0, 5.0]).unwrap();
        // Squares 1 + 0 + 1 over 3 axes and 2 degrees of freedom.
        assert_eq!(block.mean, [1e6 + 2.0, 0.0, 5.0]);
        assert!((block.spread - (2.0_f64 / 6.0).sqrt()).abs() < 1e-9);
        assert_eq!(blocks.push([7.0; 3]), None);
    }

    #[test]
    fn rest_ends_with_scatter_or_with_a_step() {
        let block = |x: f64, spread: f64| Block { mean: [x, 0.0, 1.0], spread };
        let mut rest = Rest::default();
        assert!(rest.continues(&block(0.0, 0.1), 0.3) && rest.continues(&block(0.1, 0.29), 0.3));
        assert!(!rest.continues(&block(0.1, 0.31), 0.3));
        assert!(!rest.continues(&block(0.25, 0.1), 0.3));
        assert!(!rest.continues(&block(f64::NAN, 0.1), 0.3));
        assert_eq!(rest.blocks(), 2);
    }
}
