//! Two levels that a rate goes to and fro between: what runs share of them.

/// Log evidence that the four numbers cost beside other ways to explain the runs.
pub const COST: f64 = 12.0;

/// What runs share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switching {
    /// Mean times at the lower and at the upper level, seconds.
    pub mean_s: [f64; 2],
    /// By how much the levels differ: mean and standard deviation over the runs, °/h. A mean of 0: by anything, up or down.
    pub step_deg_h: f64,
    pub spread_deg_h: f64,
}

impl Switching {
    /// Rates of leaving each level, a second.
    fn rates(&self) -> [f64; 2] {
        self.mean_s.map(|mean_s| 1.0 / mean_s)
    }

    /// Share of the time at the upper level.
    pub fn upper(&self) -> f64 {
        self.mean_s[1] / (self.mean_s[0] + self.mean_s[1])
    }

    /// Probability that a level is another one after a time.
    pub fn changes(&self, upper: bool, after_s: f64) -> f64 {
        let [up, down] = self.rates();
        let other = if upper { 1.0 - self.upper() } else { self.upper() };
        other * -(-(up + down) * after_s).exp_m1()
    }

    /// Levels that differ by anything have no upper one.
    pub fn is_of_each_run(&self) -> bool {
        self.step_deg_h == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 60 s and 20 s at the levels a quarter of the time is at the upper one; after a second of 60 s one in sixty has gone up.
    #[test]
    fn changes_by_hand() {
        let switching = Switching { mean_s: [60.0, 20.0], step_deg_h: 1.0, spread_deg_h: 0.1 };
        assert!((switching.changes(false, 1e6) - 0.25).abs() < 1e-12);
        assert!((switching.changes(true, 1e6) - 0.75).abs() < 1e-12);
        assert!((switching.changes(false, 1e-3) - 1e-3 / 60.0).abs() < 1e-8);
        assert!((switching.changes(true, 1e-3) - 1e-3 / 20.0).abs() < 1e-8);
        // Two steps of a second are one of two: no change twice, or there and back.
        let remains = |upper: bool, s: f64| 1.0 - switching.changes(upper, s);
        let both = remains(false, 1.0).powi(2) + switching.changes(false, 1.0) * switching.changes(true, 1.0);
        assert!((both - remains(false, 2.0)).abs() < 1e-12);
    }
}
