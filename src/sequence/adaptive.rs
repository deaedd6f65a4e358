//! An adaptive fix: when it moves, and when it ends.
//!
//! Two coarse dwells, 90° apart, give a coarse azimuth, and the horizontal rate that is held against the Earth's. Then the axis points
//! east and west in turn, where the azimuth's sensitivity is greatest: a block of three dwells, ¼ ½ ¼ of the time, in which a linear
//! drift cancels, or of two where there is no time for that. After a block the solution's own sigma says whether there must be another; it
//! begins where the index stands, so that a drive that rings is turned once or twice for it.
//! A second counts as soon as it is quiet, whether its gate has passed or not: the gates still decide whether the fix goes on.
//!
//! Where the coarse rates are not the Earth's, or what follows contradicts them, the fix begins anew with the mirrored four positions;
//! where the index slipped they follow what was measured, so that dwells before and after tell what it was that slipped.

use crate::sensing::index::IndexSettings;
use crate::units::{DEG_PER_RAD, wrap_180_deg};

/// Least and most seconds of a coarse dwell: of three the scatter is known, and no noise that allows an azimuth asks for more than sixty.
const COARSE_S: [f64; 2] = [3.0, 60.0];
/// Length of a coarse dwell, as a share of the measuring time that the azimuth needs. With a(ccuracy) in radians that time is (σ/(h a))²,
/// so that the horizontal rate is known to 2a of itself: 0.14 % for 0.04°, which the flag `amplitude` sees from four times that on.
const COARSE_SHARE: f64 = 0.25;
/// The same where the time limit ends the fix, as a share of the time that is left: then the azimuth has it.
const COARSE_SHARE_OF_LIMIT: f64 = 0.05;
/// Noise may turn a coarse azimuth by so many radians, one sigma: 3°, with which the axis is east and west to 0.3 % of its sensitivity.
const COARSE_SIGMA: f64 = 0.05;
/// The bias turns a coarse azimuth by some degrees; what turns it farther than this is no bias.
const COARSE_AGREES_DEG: f64 = 30.0;
/// Dwells that a second which is not quiet may end before its gate has passed; then the gates are waited for.
const MOST_INTERRUPTIONS: u8 = 6;
/// Shortest measuring time for three dwells of a block, seconds: with a quarter of it a dwell is no longer than two moves.
const THREE_DWELLS_S: f64 = 75.0;
/// A block shorter than this is not worth its moves, seconds: what is missing after one is measured where the index stands, so long at least.
const LEAST_BLOCK_S: f64 = 15.0;
const LEAST_MORE_S: f64 = 3.0;
/// Where the levels moved during the coarse dwells, the base's path takes so much more time: `north bench orders --scenario creep`.
const FOR_MOTION: f64 = 1.3;
/// Newton's steps to the root of a cubic, from at most ten times its place.
const NEWTON_STEPS: usize = 8;
/// Blocks end after so many dwells at most, whatever sigma is.
const MOST_POSITIONS: u8 = 17;
/// What is planned is more than what is needed by this share: the noise that will be found may be greater than what was seen.
const MARGIN: f64 = 1.08;
/// From the last step of a move to the beginning of the next whole second and the one after, which is the first to be quiet.
const SETTLING_S: f64 = 1.7;
/// A dwell of four positions is no shorter, seconds, and its gate takes so long, after what rings.
const LEAST_DWELL_S: f64 = 10.0;
const GATE_S: f64 = 6.0;
/// Moves and dwells of the mirrored order.
const MIRRORED_MOVES: f64 = 7.0;
const MIRRORED_DWELLS: f64 = 8.0;
/// Measured seconds after which the noise is known well enough for a promise: its variance to 20 %.
const PROMISED_AFTER_S: f64 = 50.0;
/// Root mean square of what an angle departs from a line within a second, as a share of a second's noise in arcsec: of white noise 1/√15 (a random walk
/// about its line), and three times that once in 10⁵ seconds. Above it the drive still rings, where that falls from second to second …
const STILL: f64 = 0.775;
const FALLS: f64 = 0.95;
/// … and so many seconds are waited at most for a ringing that the gate lets pass.
const MOST_RINGING_S: u8 = 15;
/// A dwell that begins this much later than planned shows how long the gyro rings, seconds: more than whole seconds are rounded by.
const LATE_S: f64 = 1.0;

/// A fix that goes on until its sigma is small enough.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    accuracy_deg: f64,
    /// What is in sigma however long it measures, degrees.
    floor_deg: f64,
    /// It ends here at the latest, whatever its sigma is.
    limit_s: f64,
    /// Measuring time of the block under way that is left after this dwell, and of this dwell, seconds.
    later_s: f64,
    target_s: f64,
    /// Number of the last dwell of the block, and whether it has three.
    last: u8,
    three: bool,
    /// Moves of the block after the dwell under way.
    moves_left: u8,
    /// When the dwell under way was expected to begin, and must end.
    begin_s: f64,
    latest_s: f64,
    /// Seconds that the dwell under way has, and the fix.
    dwell_s: f64,
    measured_s: f64,
    /// Those of the coarse dwells.
    coarse_s: f64,
    /// From the last step of a move to the first second that counts, as it was after the last one.
    settling_s: f64,
    noise: Noise,
    /// When seconds to go are promised again.
    promise_at_s: Option<f64>,
    /// Where the gyro is turned to, degrees.
    pub target_deg: f64,
    /// The dwell under way has seconds of before its gate passed: how many.
    pub early: u16,
    interruptions: u8,
    /// At this position a second was not quiet: its gate is waited for.
    waits: bool,
    /// What the last second before the dwell rang with, arcsec, and how many were waited for that.
    rang_arcsec: f64,
    rang_s: u8,
    /// The index slipped, and the order has not changed for it.
    pub slipped: bool,
}

/// What the dwells so far show.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Noise of a second as the fix reckons with it, never below the declared one, and the horizontal Earth rate, °/h.
    pub noise_deg_h: f64,
    pub north_deg_h: f64,
    /// The levels changed, by more than their noise.
    pub base_moves: bool,
}

/// Scatter of the seconds about the means of their dwells.
#[derive(Clone, Copy, Debug, Default)]
struct Noise {
    count: f64,
    mean_deg_h: f64,
    squares: f64,
    freedom: f64,
}

impl Noise {
    /// The next second of a dwell (B. P. Welford, Technometrics 4, 1962, p. 419).
    fn push(&mut self, rate_deg_h: f64) {
        self.count += 1.0;
        let from_mean = rate_deg_h - self.mean_deg_h;
        self.mean_deg_h += from_mean / self.count;
        self.squares += from_mean * (rate_deg_h - self.mean_deg_h);
        self.freedom += if self.count > 1.0 { 1.0 } else { 0.0 };
    }

    fn end_dwell(&mut self) {
        (self.count, self.mean_deg_h) = (0.0, 0.0);
    }

    /// Variance of a second, (°/h)²; never below the declared one, which the fix's sigma is not either.
    fn variance(&self, declared_deg_h: f64) -> f64 {
        let declared = declared_deg_h * declared_deg_h;
        if self.freedom > 0.0 { declared.max(self.squares / self.freedom) } else { declared }
    }
}

impl Adaptive {
    /// For a standard deviation of the azimuth, degrees, of which `floor_deg` does not average out; it must end before `limit_s`.
    pub fn new(accuracy_deg: f64, floor_deg: f64, limit_s: f64) -> Self {
        Self {
            accuracy_deg,
            floor_deg,
            limit_s,
            later_s: 0.0,
            target_s: f64::INFINITY,
            last: 0,
            three: false,
            moves_left: 0,
            begin_s: 0.0,
            latest_s: f64::INFINITY,
            dwell_s: 0.0,
            measured_s: 0.0,
            coarse_s: 0.0,
            settling_s: SETTLING_S,
            noise: Noise::default(),
            promise_at_s: None,
            target_deg: 0.0,
            early: 0,
            interruptions: 0,
            waits: false,
            rang_arcsec: f64::INFINITY,
            rang_s: 0,
            slipped: false,
        }
    }

    /// A second may be taken before its gate has passed.
    pub fn takes_early(&self) -> bool {
        !self.waits && self.interruptions < MOST_INTERRUPTIONS
    }

    /// The gyro rings after its move: short dwells between seconds that are not quiet would hold a part of the ringing each.
    pub fn wait(&mut self) {
        self.waits = true;
    }

    /// Before the first second of a dwell whose gate waited for a ringing: this one, with so much ripple and this noise, still rings with what the gate lets
    /// pass. Its rates would scatter by more than the noise, so that the dwell would have to be longer by more than the wait.
    pub fn rings_down(&mut self, ripple_arcsec: f64, noise_deg_h: f64) -> bool {
        if !self.waits || self.dwell_s > 0.0 || self.rang_s >= MOST_RINGING_S {
            return false;
        }
        let falls = ripple_arcsec < FALLS * core::mem::replace(&mut self.rang_arcsec, ripple_arcsec);
        let rings = falls && ripple_arcsec > STILL * noise_deg_h;
        self.rang_s = self.rang_s.saturating_add(rings.into());
        rings
    }

    /// A second was not quiet. Whether a dwell was under way, which it ends.
    pub fn interrupted(&mut self) -> bool {
        let under_way = core::mem::take(&mut self.early) > 0;
        self.interruptions = self.interruptions.saturating_add(under_way.into());
        self.noise.end_dwell();
        under_way
    }

    /// A second of this rate, °/h, was collected; it ended at `t_s`.
    pub fn collected(&mut self, t_s: f64, rate_deg_h: f64, index: &IndexSettings) {
        if self.dwell_s == 0.0 && self.last > 0 {
            let late_s = t_s - 1.0 - self.begin_s;
            if late_s.abs() > LATE_S {
                self.settling_s = (self.settling_s + late_s).max(SETTLING_S);
                self.begin_s = t_s - 1.0;
            }
            let left_s = self.limit_s - self.begin_s - f64::from(self.moves_left) * self.turn_s(index);
            self.latest_s = self.begin_s + self.share() * left_s.max(0.0);
        }
        self.dwell_s += 1.0;
        self.measured_s += 1.0;
        self.coarse_s += if self.last > 0 { 0.0 } else { 1.0 };
        self.noise.push(rate_deg_h);
    }

    pub fn dwell_is_over(&self, t_s: f64) -> bool {
        self.dwell_s >= self.target_s || t_s >= self.latest_s
    }

    /// There is no time for more, whatever is under way.
    pub fn is_out_of_time(&self, t_s: f64) -> bool {
        t_s >= self.limit_s
    }

    /// A coarse dwell begins; the noise of a second and the horizontal Earth rate, °/h, say how long it is.
    pub fn begin_coarse(&mut self, t_s: f64, [noise_deg_h, north_deg_h]: [f64; 2]) {
        self.restart_dwell();
        let room_s = self.limit_s - t_s;
        let of_limit_s = COARSE_SHARE_OF_LIMIT * room_s;
        let share_s = match self.needed_s(noise_deg_h * noise_deg_h, north_deg_h) {
            Some(needed_s) if (1.0 + 2.0 * COARSE_SHARE) * needed_s < room_s => COARSE_SHARE * needed_s,
            _ => of_limit_s,
        };
        let [least_s, most_s] = COARSE_S;
        self.target_s = libm::ceil(share_s.clamp(least_s, most_s));
        self.latest_s = t_s + (0.25 * room_s).max(least_s);
    }

    /// The coarse dwell under way has what it was planned for, and the noise that was seen does not ask for more.
    pub fn coarse_is_over(&self, t_s: f64, rates_deg_h: [f64; 2]) -> bool {
        self.dwell_is_over(t_s)
            && (self.coarse_is_known(rates_deg_h) || self.dwell_s >= COARSE_S[1] || t_s >= self.latest_s)
    }

    /// The noise that was seen leaves a coarse azimuth.
    pub fn coarse_is_known(&self, [noise_deg_h, north_deg_h]: [f64; 2]) -> bool {
        let limit_deg_h = COARSE_SIGMA * north_deg_h;
        self.noise.variance(noise_deg_h) <= limit_deg_h * limit_deg_h * self.dwell_s
    }

    fn restart_dwell(&mut self) {
        (self.early, self.waits, self.dwell_s) = (0, false, 0.0);
        (self.rang_arcsec, self.rang_s) = (f64::INFINITY, 0);
        self.noise.end_dwell();
    }

    /// The azimuth of a block is not the coarse one, degrees, and no bias makes it so.
    pub fn contradicts(coarse_deg: f64, azimuth_deg: f64) -> bool {
        wrap_180_deg(azimuth_deg - coarse_deg).abs() > COARSE_AGREES_DEG
    }

    /// Seconds of each dwell, `dwell_s` at most, with which the mirrored order still ends in time; `None`: with none.
    pub fn mirrored_dwell_s(&self, t_s: f64, dwell_s: u16, index: &IndexSettings) -> Option<u16> {
        let moves_s = MIRRORED_MOVES * (move_s(90.0, index, self.settling_s) + GATE_S);
        let room_s = (self.limit_s - t_s - moves_s) / MIRRORED_DWELLS;
        (room_s >= LEAST_DWELL_S).then(|| dwell_s.min(libm::floor(room_s) as u16))
    }

    /// Plans the first block, from dwell `position` on, after a move of `way_deg`: as long as a gyro with this noise of a second,
    /// °/h, needs at this horizontal Earth rate, if its axis always points east or west; what was measured has half of its weight.
    /// `base_moves`: its path is to be told, too.
    pub fn begin(&mut self, position: u8, t_s: f64, way_deg: f64, index: &IndexSettings, seen: Seen) {
        let begin_s = t_s + move_s(way_deg, index, self.settling_s);
        self.block(position, begin_s, index, self.missing_s(seen).max(LEAST_BLOCK_S));
    }

    /// Measuring time that the noise still asks for, seconds, beyond what was measured and is worth half of its time in the coarse dwells.
    fn missing_s(&self, seen: Seen) -> f64 {
        let for_motion = if seen.base_moves { FOR_MOTION } else { 1.0 };
        for_motion * self.asked_s(seen) - self.worth_s()
    }

    /// Measuring time that the noise asks for in all, seconds; infinite where no time is enough.
    fn asked_s(&self, seen: Seen) -> f64 {
        self.needed_s(seen.noise_deg_h * seen.noise_deg_h, seen.north_deg_h).unwrap_or(f64::INFINITY)
    }

    fn worth_s(&self) -> f64 {
        self.measured_s - 0.5 * self.coarse_s
    }

    /// Measuring time by the variance of a second, (°/h)²; `None`: no time is enough.
    fn needed_s(&self, variance: f64, north_deg_h: f64) -> Option<f64> {
        let averaged = self.accuracy_deg * self.accuracy_deg - self.floor_deg * self.floor_deg;
        let ratio = DEG_PER_RAD / north_deg_h;
        (averaged > 0.0).then(|| MARGIN * ratio * ratio * variance / averaged)
    }

    /// The block is over, with this sigma: plans another, from dwell `position` on, where the index stands. `false`: sigma is small enough,
    /// or there is no time.
    pub fn go_on(&mut self, position: u8, t_s: f64, index: &IndexSettings, sigma_deg: Option<f64>, seen: Seen) -> bool {
        let room_s = self.limit_s - t_s - self.turn_s(index);
        if room_s < LEAST_BLOCK_S || position >= MOST_POSITIONS {
            return false;
        }
        let square = |deg: f64| deg * deg - self.floor_deg * self.floor_deg;
        let more_s = match sigma_deg {
            Some(sigma_deg) if sigma_deg <= self.accuracy_deg => return false,
            Some(sigma_deg) if square(self.accuracy_deg) > 0.0 => {
                let ratio = MARGIN * square(sigma_deg) / square(self.accuracy_deg);
                self.worth_s() * (longer(ratio, ratio.min(self.asked_s(seen) / self.worth_s())) - 1.0)
            }
            _ => room_s,
        };
        self.block(position, t_s, index, more_s.max(LEAST_MORE_S));
        true
    }

    /// A block of so much measuring whose first dwell begins at `begin_s`.
    fn block(&mut self, position: u8, begin_s: f64, index: &IndexSettings, measuring_s: f64) {
        let most_s = |moves: u8| (self.limit_s - begin_s - f64::from(moves) * self.turn_s(index)).max(0.0);
        let moves = moves(measuring_s.min(most_s(2)));
        self.later_s = measuring_s.min(most_s(moves));
        self.three = moves == 2;
        self.last = position.saturating_add(moves);
        self.begin_dwell(position, begin_s);
    }

    /// The dwell of this number begins after half a turn; `false`: the block is over. It and those that follow are longer than planned where the
    /// noise that was seen asks for it.
    pub fn next(&mut self, position: u8, t_s: f64, index: &IndexSettings, seen: Seen) -> bool {
        if position > self.last {
            return false;
        }
        let begin_s = t_s + self.turn_s(index);
        let moves_s = f64::from(self.last - position) * self.turn_s(index);
        self.later_s = self.missing_s(seen).min(self.limit_s - begin_s - moves_s).max(self.later_s);
        self.begin_dwell(position, begin_s);
        true
    }

    /// The dwell before the one of this number was the last of its block.
    pub fn is_block_over(&self, position: u8) -> bool {
        self.last > 0 && position > self.last
    }

    fn begin_dwell(&mut self, position: u8, begin_s: f64) {
        self.restart_dwell();
        self.moves_left = self.last.saturating_sub(position);
        (self.begin_s, self.latest_s) = (begin_s, self.limit_s);
        self.target_s = self.share() * self.later_s;
        self.later_s -= self.target_s;
    }

    /// The dwell's part of what is left: its own weight over those of it and its successors; the weights are 1, 2, 1 or 1, 1.
    fn share(&self) -> f64 {
        match self.moves_left {
            0 => 1.0,
            1 if self.three => 2.0 / 3.0,
            1 => 0.5,
            _ => 0.25,
        }
    }

    /// Seconds until the fix ends, by what is planned, where it is time to promise them: when the noise is known, at half time,
    /// and (`planned`) when another block begins.
    pub fn promise_s(&mut self, t_s: f64, index: &IndexSettings, planned: bool) -> Option<f64> {
        let due = self.promise_at_s.map_or(self.measured_s >= PROMISED_AFTER_S, |at_s| t_s >= at_s || planned);
        if !due || self.last == 0 {
            return None;
        }
        let left_s = (self.target_s - self.dwell_s).max(0.0) + self.later_s;
        // A block that follows another begins without a move.
        let is_there = self.dwell_s > 0.0 || self.begin_s <= t_s;
        let moves_left = f64::from(self.moves_left) + if is_there { 0.0 } else { 1.0 };
        let seconds = (left_s + moves_left * self.turn_s(index)).min(self.limit_s - t_s).max(0.0);
        // The second one at half time; after that the plan is the promise.
        self.promise_at_s = Some(if self.promise_at_s.is_none() { t_s + 0.5 * seconds } else { f64::INFINITY });
        Some(seconds)
    }

    fn turn_s(&self, index: &IndexSettings) -> f64 {
        move_s(180.0, index, self.settling_s)
    }
}

/// Moves within a block of so much measuring.
fn moves(measuring_s: f64) -> u8 {
    match measuring_s {
        LEAST_BLOCK_S..THREE_DWELLS_S => 1,
        THREE_DWELLS_S.. => 2,
        _ => 0,
    }
}

/// By how much the measuring time must grow where the square of sigma is `ratio` times too large, and noise makes `of_noise` of it: noise averages out
/// with the time, what else there is (the rate of a base that turns, or of a drift, told by readings along the time) with its third power.
/// The root of x³ − noise · x² − rest, to which Newton's steps come down from `ratio`.
fn longer(ratio: f64, of_noise: f64) -> f64 {
    let rest = ratio - of_noise;
    let mut x = ratio.max(1.0);
    for _ in 0..NEWTON_STEPS {
        x -= ((x - of_noise) * x * x - rest) / ((3.0 * x - 2.0 * of_noise) * x);
    }
    x
}

/// Duration of a move until the first second that counts.
fn move_s(way_deg: f64, index: &IndexSettings, settling_s: f64) -> f64 {
    let ramp_s = index.speed_deg_s / index.acceleration_deg_s2;
    way_deg.abs() / index.speed_deg_s + ramp_s + settling_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 30 °/s and 60 °/s²: half a turn takes 6 + 0.5 + 1.7 s.
    const TURN_S: f64 = 8.2;

    const SEEN: Seen = Seen { noise_deg_h: 0.09, north_deg_h: 12.0, base_moves: false };

    #[test]
    fn a_block_by_hand() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.03, 0.0, 1000.0);
        // 0.09 °/h over 12 °/h is 0.0075 rad, 0.4297°; over 0.03°, squared: 205.2 s, and 8 % more: 221.6 s.
        plan.begin(2, 20.0, 0.0, &index, SEEN);
        let measuring_s = 221.59;
        assert!((plan.target_s - 0.25 * measuring_s).abs() < 0.1 && (plan.begin_s - 22.2).abs() < 1e-9, "{plan:?}");
        plan.measured_s = 55.4;
        assert!(plan.next(3, 78.0, &index, SEEN) && (plan.target_s - 0.5 * measuring_s).abs() < 0.1, "{plan:?}");
        assert!((plan.begin_s - 78.0 - TURN_S).abs() < 1e-9, "{plan:?}");
        plan.measured_s = 166.2;
        assert!(plan.next(4, 197.0, &index, SEEN) && (plan.target_s - 0.25 * measuring_s).abs() < 0.1, "{plan:?}");
        assert!(!plan.next(5, 300.0, &index, SEEN));
        // Sigma is a fifth too large, its square with the margin 1.555 times, 221.6/220 = 1.007 of it by noise: 1.321³ − 1.007 · 1.321² = 0.548.
        plan.measured_s = 220.0;
        assert!(plan.go_on(5, 300.0, &index, Some(0.036), SEEN));
        assert!((plan.target_s - 0.5 * 0.321 * 220.0).abs() < 0.1 && plan.begin_s == 300.0, "{plan:?}");
        plan.measured_s = 320.0;
        assert!(!plan.go_on(7, 400.0, &index, Some(0.0299), SEEN) && !plan.go_on(7, 980.0, &index, None, SEEN));
        // A twentieth too large: 1.191, of which noise makes 0.692: 1.1024³ − 0.692 · 1.1024² = 0.498. 32.8 s, in two dwells.
        assert!(plan.go_on(7, 400.0, &index, Some(0.0315), SEEN) && (plan.target_s - 16.4).abs() < 0.1, "{plan:?}");
        plan.measured_s += 16.4;
        assert!(plan.next(8, 418.0, &index, SEEN) && !plan.next(9, 450.0, &index, SEEN));
        // A three-hundredth too large, all of it by noise: 0.087 · 150 = 13.1 s are measured where the index stands.
        plan.measured_s = 150.0;
        assert!(plan.go_on(9, 500.0, &index, Some(0.0301), SEEN) && plan.moves_left == 0, "{plan:?}");
        assert!((plan.target_s - 13.1).abs() < 0.1, "{plan:?}");
    }

    /// Twice the noise that was seen first: four times the time, less what is measured, in the two dwells that follow.
    #[test]
    fn dwells_grow_with_the_noise() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.03, 0.0, 2000.0);
        plan.begin(2, 20.0, 0.0, &index, SEEN);
        plan.measured_s = 55.0;
        assert!(plan.next(3, 78.0, &index, Seen { noise_deg_h: 0.18, ..SEEN }));
        assert!((plan.target_s + plan.later_s - (4.0 * 221.59 - 55.0)).abs() < 0.1, "{plan:?}");
    }

    /// 0.018° of 0.03° do not average out: 0.024° are left for the noise, and it takes (5/4)² of the time.
    #[test]
    fn what_does_not_average_out_takes_time() {
        let [without, with] = [0.0, 0.018].map(|floor_deg| {
            let mut plan = Adaptive::new(0.03, floor_deg, 1000.0);
            plan.begin(2, 20.0, 0.0, &IndexSettings::default(), SEEN);
            plan.target_s
        });
        assert!((with / without - 25.0 / 16.0).abs() < 1e-9, "{with} {without}");
    }

    #[test]
    fn the_limit_ends_it() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.001, 0.0, 60.0);
        plan.begin(2, 20.0, 0.0, &index, SEEN);
        // Two dwells: 60 − 22.2 − 8.2 = 29.6 s between them.
        assert!((plan.target_s - 14.8).abs() < 0.1 && plan.next(3, 37.0, &index, SEEN), "{plan:?}");
        assert!(plan.dwell_is_over(60.0) && !plan.dwell_is_over(59.0), "{plan:?}");
        assert!(!plan.go_on(4, 60.0, &index, Some(0.1), SEEN) && plan.is_out_of_time(60.0));
    }

    /// The first second that counts ends 21 s after a half turn where 9.2 s were planned: the drive rings 11.8 s, and will again.
    #[test]
    fn ringing_is_learnt() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.03, 0.0, 1000.0);
        plan.begin(2, 0.0, 180.0, &index, SEEN);
        plan.collected(21.0, 0.1, &index);
        assert!((plan.turn_s(&index) - TURN_S - 11.8).abs() < 1e-9, "{plan:?}");
    }

    /// White noise of 0.09 °/h in a second departs from a line by 0.023 arcsec rms: below three times that, 0.07, nothing rings.
    #[test]
    fn a_dwell_begins_when_the_ringing_is_over() {
        let ringing = || {
            let mut plan = Adaptive::new(0.03, 0.0, 1000.0);
            plan.begin(2, 0.0, 180.0, &IndexSettings::default(), SEEN);
            plan.wait();
            plan
        };
        let mut plan = ringing();
        // It falls by a fifth from second to second: 0.44, 0.35, … arcsec; the ninth is 0.074.
        let waited = (0..30).take_while(|second| plan.rings_down(0.44 * 0.8f64.powi(*second), 0.09)).count();
        assert_eq!(waited, 9);
        // What does not fall is not the drive, and what falls slowly is waited for so long at most.
        let mut plan = ringing();
        assert!(plan.rings_down(0.4, 0.09) && !plan.rings_down(0.4, 0.09));
        let mut plan = ringing();
        assert_eq!((0..100).take_while(|second| plan.rings_down(0.9f64.powi(*second), 0.09)).count(), 15);
        // In a dwell that has begun it is too late, and a base that sways rings after no move.
        let mut plan = ringing();
        plan.collected(9.0, 0.1, &IndexSettings::default());
        assert!(!plan.rings_down(0.4, 0.09));
        plan.begin(3, 0.0, 180.0, &IndexSettings::default(), SEEN);
        assert!(!plan.rings_down(0.4, 0.09));
    }

    /// 221.6 s are planned, of which 50 are over, and two moves; half of that later it is promised again.
    #[test]
    fn seconds_to_go_are_those_of_the_plan() {
        let index = IndexSettings::default();
        let mut plan = Adaptive::new(0.03, 0.0, 2000.0);
        plan.begin(2, 0.0, 180.0, &index, SEEN);
        for second in 0..50 {
            assert_eq!(plan.promise_s(9.0 + f64::from(second), &index, false), None);
            plan.collected(9.2 + f64::from(second), 0.1, &index);
        }
        let promised_s = plan.promise_s(59.0, &index, false).unwrap();
        assert!((promised_s - (221.59 - 50.0 + 2.0 * TURN_S)).abs() < 1.0, "{promised_s}");
        assert_eq!(plan.promise_s(60.0, &index, false), None);
        assert!(plan.promise_s(59.0 + 0.5 * promised_s, &index, false).is_some());
    }
}
