//! What a number of every fix is expected to be: a level that wanders, plus what every switch-on adds anew, plus the noise of a fix.

/// The level, filtered along a signal: yₜ = bₜ + oₜ + vₜ with vₜ ~ N(0, r), bₜ = bₜ₋₁ + wₜ, wₜ ~ N(0, q), and oₜ drawn anew from N(0, s) at
/// every switch-on. All variances are in those of a fix, r.
#[derive(Clone, Debug)]
pub struct Level {
    /// q / r and s / r.
    pub wander: f64,
    pub switch: f64,
    /// Level and what the last switch-on added to it; their variances and covariance.
    mean: [f64; 2],
    variances: [f64; 2],
    covariance: f64,
}

/// What a fix was off by from what was expected.
#[derive(Clone, Copy, Debug)]
pub struct Innovation {
    pub value: f64,
    /// Its variance in those of a fix.
    pub variance: f64,
    pub gain: Gain,
}

/// Shares of an innovation by which the estimates of level and of the switch-on's part move, the latter beginning anew or not. What changes leave in
/// innovations is followed in single precision: it is a hundred times as much to do as for the level itself.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    shares: [f32; 2],
    anew: bool,
}

/// What the estimates have of a change so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Followed([f32; 2]);

impl Followed {
    /// What an innovation shows of a change that has reached `now`.
    pub fn seen(&mut self, now: f32, gain: Gain) -> f32 {
        let Self([level, switch]) = self;
        if gain.anew {
            *switch = 0.0;
        }
        let seen = now - *level - *switch;
        let [level_share, switch_share] = gain.shares;
        *level += level_share * seen;
        *switch += switch_share * seen;
        seen
    }
}

impl Level {
    /// After a first fix, before which nothing was known of the level.
    pub fn new(wander: f64, switch: f64, first: f64) -> Self {
        let (variances, covariance) = ([1.0 + switch, switch], -switch);
        Self { wander, switch, mean: [first, 0.0], variances, covariance }
    }

    /// A level that is known, and stays what it is.
    pub fn known(mean: f64) -> Self {
        Self { wander: 0.0, switch: 0.0, mean: [mean, 0.0], variances: [0.0; 2], covariance: 0.0 }
    }

    pub fn next(&mut self, value: f64, switched: bool) -> Innovation {
        let [level, offset] = &mut self.mean;
        let [level_variance, offset_variance] = &mut self.variances;
        *level_variance += self.wander;
        if switched {
            (*offset, *offset_variance, self.covariance) = (0.0, self.switch, 0.0);
        }
        let along = [*level_variance + self.covariance, *offset_variance + self.covariance];
        let [level_along, offset_along] = along;
        let variance = level_along + offset_along + 1.0;
        let shares = along.map(|along| along / variance);
        let [level_share, offset_share] = shares;
        let innovation = value - *level - *offset;
        *level += level_share * innovation;
        *offset += offset_share * innovation;
        *level_variance -= level_share * level_along;
        *offset_variance -= offset_share * offset_along;
        self.covariance -= level_share * offset_along;
        Innovation {
            value: innovation,
            variance,
            gain: Gain { shares: shares.map(|share| share as f32), anew: switched },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: a level that does not wander, first 1, then 3: its variance is 1, innovation 2 with variance 2, gain 1/2, and 1/2 is left.
    #[test]
    fn a_level_follows_by_its_gain() {
        let mut level = Level::new(0.0, 0.0, 1.0);
        let innovation = level.next(3.0, false);
        assert_eq!((innovation.value, innovation.variance, innovation.gain.shares), (2.0, 2.0, [0.5, 0.0]));
        assert_eq!((level.mean, level.variances), ([2.0, 0.0], [0.5, 0.0]));
        // Switched on, and an offset of variance 2.5 with it: 0.5 + 2.5 + 1 = 4, of which level and offset take 1/8 and 5/8.
        let mut level = Level { switch: 2.5, ..level };
        let innovation = level.next(6.0, true);
        assert_eq!((innovation.value, innovation.variance, innovation.gain.shares), (4.0, 4.0, [0.125, 0.625]));
        assert_eq!((level.mean, level.variances, level.covariance), ([2.5, 2.5], [0.4375, 0.9375], -0.3125));
    }

    #[test]
    fn a_known_level_takes_nothing_of_what_it_sees() {
        let mut level = Level::known(1.0);
        for value in [4.0, 4.0] {
            let innovation = level.next(value, true);
            assert_eq!((innovation.value, innovation.variance), (3.0, 1.0));
        }
    }
}
