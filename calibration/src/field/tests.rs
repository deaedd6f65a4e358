use super::guidance::Guidance;
use super::*;
use std::vec::Vec as StdVec;

/// A triad with zeros of 20, −30 and 10 mg, an x that reads 1 % too much and sees 0.02 of y; noise within ± 0.2 mg, by the
/// numbers of a linear congruential generator.
fn raw([x, y, z]: [f64; 3], noise: &mut u32) -> [f64; 3] {
    let mut noise = || {
        *noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        2e-4 * (f64::from(*noise) / f64::from(u32::MAX / 2) - 1.0)
    };
    [1.01 * x + 0.02 * y + 0.02 + noise(), y - 0.03 + noise(), z + 0.01 + noise()]
}

/// The firmware's session with an operator who obeys, and the one who solves and stores between the ticks.
struct Bench {
    session: Session,
    collection: Collection,
    events: StdVec<Event>,
    in_effect: Option<AccelerometerCalibration>,
    flash_works: bool,
    noise: u32,
}

impl Bench {
    fn new(in_use: Correction) -> Self {
        let mut events = StdVec::new();
        let (mut session, mut collection) = (Session::default(), Collection::default());
        session.start(&mut collection, in_use, &mut |event| events.push(event));
        Self { session, collection, events, in_effect: None, flash_works: true, noise: 1 }
    }

    fn reading(&mut self, reading_g: Option<[f64; 3]>) {
        let mut sink = |event| self.events.push(event);
        self.session.reading(&mut self.collection, reading_g.and_then(TriadCode::of_g), &mut sink);
        let in_effect = self.session.tick(&mut sink);
        self.in_effect = in_effect.or(self.in_effect);
        if self.session.is_posed() {
            self.session.solved(self.collection.solve());
        }
        if self.session.to_store().is_some() {
            self.session.stored(self.flash_works);
        }
    }

    /// Holds still for some hundredths of a second.
    fn hold(&mut self, up: [f64; 3], samples: usize) {
        for _ in 0..samples {
            let raw = raw(up, &mut self.noise);
            self.reading(Some(raw));
        }
    }

    /// Shakes for some hundredths of a second.
    fn shake(&mut self, samples: usize) {
        for i in 0..samples {
            self.reading(Some(if i % 2 == 0 { [0.9, 0.1, 0.3] } else { [0.2, -0.7, 0.5] }));
        }
    }

    fn guidance(&self) -> StdVec<Guidance> {
        let guidance = |event: &Event| if let Event::Guidance(guidance) = event { Some(*guidance) } else { None };
        self.events.iter().filter_map(guidance).collect()
    }

    fn steps(&self) -> StdVec<Step> {
        self.guidance().iter().map(|guidance| guidance.step).collect()
    }

    fn names(&self) -> StdVec<&'static str> {
        let name = |event: &Event| match event {
            Event::Started => "started",
            Event::Guidance(guidance) => guidance.step.name(),
            Event::Solved(_) => "solved",
            Event::Stored => "stored",
            Event::Failed(reason) => reason.why.name(),
        };
        self.events.iter().map(name).collect()
    }

    fn ended(&self) -> bool {
        matches!(self.events.last(), Some(Event::Stored | Event::Failed(_)))
    }

    fn verdict(&self) -> Event {
        self.events[self.events.len() - 1]
    }

    fn why(&self) -> Why {
        let Event::Failed(reason) = self.verdict() else { panic!("{:?}", self.verdict()) };
        reason.why
    }

    fn solved(&self) -> Solved {
        let solved = |event: &Event| if let Event::Solved(solved) = event { Some(*solved) } else { None };
        self.events.iter().find_map(solved).unwrap()
    }

    /// Does what is asked until the end.
    fn obey(&mut self) {
        while !self.ended() {
            let next = self.guidance().last().unwrap().next.unit();
            self.shake(50);
            self.hold(next, 260);
        }
    }
}

#[test]
fn an_attitude_is_held_and_accepted() {
    let mut bench = Bench::new(Correction::UNIT);
    assert_eq!(bench.names(), ["started", "turn"]);
    // The first reading does not count, ten more do: 220 samples.
    bench.hold([0.0, 0.0, 1.0], 219);
    assert_eq!(bench.steps(), [Step::Turn, Step::Hold]);
    bench.hold([0.0, 0.0, 1.0], 1);
    assert_eq!(bench.steps()[2..], [Step::Accepted, Step::Turn]);
    assert_eq!(bench.guidance()[2].attitudes, 1);
    // Lying on says no more; once moved it is known.
    bench.hold([0.0, 0.0, 1.0], 500);
    assert_eq!(bench.steps().len(), 4);
    bench.shake(50);
    bench.hold([0.1, 0.0, 0.995], 500);
    assert_eq!(bench.steps()[4..], [Step::Known]);
}

#[test]
fn an_attitude_with_a_shock_halfway_is_measured_again() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.hold([0.0, 1.0, 0.0], 150);
    bench.shake(50);
    assert_eq!(bench.steps(), [Step::Turn, Step::Hold, Step::Moved]);
    bench.hold([0.0, 0.995, 0.1], 260);
    assert_eq!(bench.steps()[3..], [Step::Hold, Step::Accepted, Step::Turn]);
}

#[test]
fn a_slow_turn_is_no_rest() {
    let mut bench = Bench::new(Correction::UNIT);
    // 90° in 20 s.
    for i in 0..2000 {
        let (sin, cos) = (f64::from(i) * 7.854e-4).sin_cos();
        bench.hold([sin, 0.0, cos], 1);
    }
    assert!(!bench.steps().contains(&Step::Accepted), "{:?}", bench.steps());
}

#[test]
fn what_is_not_gravity_is_told() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.hold([0.0, 0.0, 0.5], 260);
    assert_eq!(bench.steps(), [Step::Turn, Step::Hold, Step::NotGravity]);
}

#[test]
fn an_operator_who_obeys_gets_a_better_calibration() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.obey();
    let solved = bench.solved();
    assert_eq!(bench.names()[bench.events.len() - 3..], ["solving", "solved", "stored"]);
    assert!(solved.is_better() && solved.judged_before_g > 0.01 && solved.judged_after_g < 1e-4, "{solved:?}");
    assert!(solved.before_g > 0.01 && solved.after_g < 1e-4, "{solved:?}");
    assert_eq!((solved.attitudes, solved.judged, solved.left_out), (15, 5, 0));
    // What `raw` does, undone: x' = (x − 0.02) / 1.01 − 0.02 / 1.01 · (y + 0.03), y' = y + 0.03, z' = z − 0.01.
    let expected = [0.02, -0.03, 0.01].into_iter().chain([1.0 / 1.01, -0.02 / 1.01, 0.0, 1.0, 0.0, 1.0]);
    for (found, expected) in solved.calibration.bias_g.into_iter().chain(solved.calibration.matrix).zip(expected) {
        assert!((found - expected).abs() < 1e-4, "{solved:?}");
    }
    assert_eq!(bench.in_effect, Some(solved.calibration));
    // Coverage grows from nothing, as it is told; the operator saw it.
    let guidance = bench.guidance();
    assert!(guidance[0].coverage < 1e-4 && guidance.last().unwrap().coverage >= 0.5, "{guidance:?}");
}

#[test]
fn a_calibration_that_is_no_better_is_not_stored() {
    // The triad's own: the inverse of what `raw` does. Nothing can be better.
    let exact = [[1.0 / 1.01, -0.02 / 1.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut bench = Bench::new(Correction { bias: [0.02, -0.03, 0.01], matrix: exact });
    bench.obey();
    assert_eq!(bench.why(), Why::NotBetter);
    assert_eq!(bench.in_effect, None);
    // What is left in both is noise: 0.12 mg of a sample, 200 of them in an attitude.
    let solved = bench.solved();
    assert!(solved.judged_before_g < 5e-5 && solved.judged_after_g < 5e-5, "{solved:?}");
}

#[test]
fn moving_throughout_ends_it() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.shake(12_100);
    assert_eq!(bench.why(), Why::MovingThroughout);
}

#[test]
fn too_few_attitudes_end_it() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.hold([0.0, 0.0, 1.0], 260);
    bench.shake(50);
    bench.hold([0.0, 0.0, 1.0], 12_100);
    assert_eq!(bench.why(), Why::TooFew);
}

#[test]
fn attitudes_on_one_side_end_it_by_what_is_missing() {
    let mut bench = Bench::new(Correction::UNIT);
    // A spiral about +z, 60° wide at most: the few that are 15° apart are soon measured.
    for i in 0..100 {
        let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
        let lean = 0.87 * (f64::from(i % 50) / 50.0).sqrt();
        if !bench.ended() {
            bench.hold([lean * cos, lean * sin, (1.0 - lean * lean).sqrt()], 260);
            bench.shake(50);
        }
    }
    let Event::Failed(NoCalibration { why: Why::DirectionsMissing, missing: Some(missing) }) = bench.verdict() else {
        panic!("{:?}", bench.verdict())
    };
    assert!(missing.0[2] < 0, "{missing:?}");
}

#[test]
fn an_abort_works_at_any_time() {
    let mut complete = Bench::new(Correction::UNIT);
    complete.obey();
    for ticks in [0, 1, 100, 230, 3000] {
        let mut bench = Bench::new(Correction::UNIT);
        bench.hold([0.0, 0.0, 1.0], ticks);
        let events = &mut bench.events;
        bench.session.abort(&mut |event| events.push(event));
        assert_eq!(bench.why(), Why::Aborted);
        let events = bench.events.len();
        bench.hold([0.0, 0.0, 1.0], 500);
        assert_eq!(bench.events.len(), events);
    }
    // Without one under way nothing happens.
    let events = complete.events.len();
    complete.session.abort(&mut |event| panic!("{event:?}"));
    assert_eq!(complete.events.len(), events);
}

#[test]
fn an_answer_after_an_abort_is_dropped() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.obey();
    let solved = bench.solved();
    let mut session = Session::default();
    session.solved(Ok(solved));
    session.stored(true);
    assert_eq!(session.tick(&mut |event| panic!("{event:?}")), None);
    assert!(!session.is_posed() && session.to_store().is_none());
}

#[test]
fn a_flash_that_fails_is_told_and_nothing_is_in_effect() {
    let mut bench = Bench::new(Correction::UNIT);
    bench.flash_works = false;
    bench.obey();
    assert_eq!(bench.why(), Why::NotStored);
    assert_eq!(bench.in_effect, None);
}

#[test]
fn a_dead_accelerometer_ends_it() {
    let mut bench = Bench::new(Correction::UNIT);
    (0..99).for_each(|_| bench.reading(None));
    bench.hold([0.0, 0.0, 1.0], 1);
    assert!(!bench.ended());
    (0..100).for_each(|_| bench.reading(None));
    assert_eq!(bench.why(), Why::AccelerometerFailed);
}
