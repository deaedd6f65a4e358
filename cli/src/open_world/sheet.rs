//! A run as functions are evaluated on it: its samples, its moves, its tilt.

use super::recording::{Move, Place, Recording, Samples};

/// One run with everything that its columns are made of.
#[derive(Clone, Debug)]
pub struct Sheet<'a> {
    pub recording: &'a Recording,
    pub samples: Samples,
    pub places: Vec<Place>,
    pub moves: Vec<Move>,
    pub wound_deg: Vec<f64>,
    /// Means of cosine and sine of the index angle over the samples.
    pub cos: Vec<f64>,
    pub sin: Vec<f64>,
    /// Phase of a rhythm in the middle of the run, in periods.
    pub phase: f64,
}

impl<'a> Sheet<'a> {
    pub fn new(recording: &'a Recording, samples: Samples) -> Self {
        let cos = samples.means(recording.design.iter().map(|row| row.cos));
        let sin = samples.means(recording.design.iter().map(|row| row.sin));
        let (places, moves) = recording.places();
        Self { recording, places, moves, wound_deg: recording.wound_deg(), samples, cos, sin, phase: 0.0 }
    }

    /// Tilt along the axis, g: the axis' upward component.
    pub fn tilt(&self) -> Vec<f64> {
        let Some(tilt) = &self.recording.tilt_g else { return vec![0.0; self.recording.len()] };
        tilt.iter()
            .zip(&self.recording.design)
            .map(|(tilt, row)| tilt.forward * row.cos + tilt.left * row.sin)
            .collect()
    }

    /// Tilt a quarter turn to the left of the axis, in the plane of the index, g.
    pub fn tilt_across(&self) -> Vec<f64> {
        let Some(tilt) = &self.recording.tilt_g else { return vec![0.0; self.recording.len()] };
        tilt.iter()
            .zip(&self.recording.design)
            .map(|(tilt, row)| tilt.left * row.cos - tilt.forward * row.sin)
            .collect()
    }

    /// What moves of these sizes leave, dying away and adding up.
    pub fn settling(&self, time_s: f64, size: impl Fn(&Move) -> f64) -> Vec<f64> {
        let mut moves = self.moves.iter().peekable();
        let (mut state, mut last_s) = (0.0, 0.0);
        let mut at = |t_s: f64| {
            while let Some(next) = moves.next_if(|next| next.ended_s <= t_s) {
                state = state * (-(next.ended_s - last_s) / time_s).exp() + size(next);
                last_s = next.ended_s;
            }
            if state == 0.0 { 0.0 } else { state * (-(t_s - last_s) / time_s).exp() }
        };
        self.samples.means(self.recording.t_s.iter().map(|&t_s| at(t_s)))
    }

    /// The same with a time constant of every move's own, seconds.
    pub fn settling_each(&self, time_s: impl Fn(&Move) -> f64, size: impl Fn(&Move) -> f64) -> Vec<f64> {
        let moves: Vec<(f64, f64, f64)> =
            self.moves.iter().map(|each| (each.ended_s, time_s(each), size(each))).collect();
        let at = |t_s: f64| {
            let past = moves.iter().take_while(|each| each.0 <= t_s);
            past.map(|(ended_s, time_s, size)| size * (-(t_s - ended_s) / time_s).exp()).sum::<f64>()
        };
        self.samples.means(self.recording.t_s.iter().map(|&t_s| at(t_s)))
    }

    /// Means over the samples of what every second has by its number.
    pub fn column(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        self.samples.means((0..self.recording.len()).map(of))
    }
}

#[cfg(test)]
mod tests {
    use north_finder::fix::DesignRow;
    use north_finder::level::Specific;

    use super::*;

    /// Ten seconds at each of three positions, a quarter turn to the left of one another, tilted by 0.1 g forward and 0.2 g to the left.
    fn recording() -> Recording {
        let mut recording = Recording::default();
        for i in 0..30 {
            let (sin, cos) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0)][i / 10];
            recording.t_s.push(i as f64 + 0.5);
            recording.interval_s.push(1.0);
            recording.dwell.push(i / 10);
            recording.moving.push(false);
            recording.enters.push(true);
            recording.design.push(DesignRow { cos, sin, vertical_deg_h: 0.0 });
            recording.rate_deg_h.push(0.0);
        }
        recording.tilt_g = Some(vec![Specific { forward: 0.1, left: 0.2 }; 30]);
        recording
    }

    /// Forward at first, then to the left, then backward; a quarter turn further to the left each.
    #[test]
    fn tilt_along_and_across_by_hand() {
        let recording = recording();
        let samples = Samples::new(&recording, 1.0, &recording.enters).unwrap();
        let sheet = Sheet::new(&recording, samples);
        for (found, expected) in [(sheet.tilt(), [0.1, 0.2, -0.1]), (sheet.tilt_across(), [0.2, -0.1, -0.2])] {
            for (second, expected) in [5, 15, 25].into_iter().zip(expected) {
                assert!((found[second] - expected).abs() < 1e-15, "{second}: {}", found[second]);
            }
        }
    }

    /// With one time constant it is the recursion's sum; with two, 1·e^(−t/4) from the tenth second and 2·e^(−t/8) from the twentieth on.
    #[test]
    fn every_move_may_have_a_time_constant_of_its_own() {
        let recording = recording();
        let samples = Samples::new(&recording, 1.0, &recording.enters).unwrap();
        let sheet = Sheet::new(&recording, samples);
        let size = |each: &Move| each.number;
        for (one, other) in sheet.settling(6.0, size).iter().zip(sheet.settling_each(|_| 6.0, size)) {
            assert!((one - other).abs() < 1e-12);
        }
        let found = sheet.samples.by_second(&sheet.settling_each(|each| 4.0 * each.number, size));
        let at = |second: usize| {
            let t_s = second as f64 + 0.5;
            let of = |from_s: f64, size: f64, time_s: f64| {
                if t_s > from_s { size * (-(t_s - from_s) / time_s).exp() } else { 0.0 }
            };
            of(10.0, 1.0, 4.0) + of(20.0, 2.0, 8.0)
        };
        let expected = sheet.samples.by_second(&sheet.samples.means((0..30).map(at)));
        assert!(found.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
    }
}
