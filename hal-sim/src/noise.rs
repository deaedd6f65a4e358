//! Seeded random processes.
//!
//! Each part of the plant draws from its own stream of one ChaCha generator, so that reading a sensor more often does not
//! change what another does.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1, StandardNormal};

/// The parts that draw random numbers.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// White noise of the gyro.
    GyroWhite = 1,
    /// Slow processes of the gyro.
    GyroSlow = 2,
    /// Motion of the base.
    Base = 3,
    /// Accelerometer.
    Accelerometer = 4,
    /// Encoder.
    Encoder = 5,
    /// Serial line.
    Line = 6,
    /// Intermittent effects of the gyro.
    Intermittent = 7,
    /// The operator's hands.
    Operator = 8,
    /// Unevenness of the index drive.
    Drive = 9,
    /// Constants of a three-axis block.
    BlockConstants = 20,
    /// White noise of its gyros.
    BlockGyro = 21,
    /// Slow drift of its gyros.
    BlockSlow = 22,
    /// Noise of its accelerometers.
    BlockAccelerometer = 23,
    /// Satellite receivers.
    Satellites = 24,
    /// Carrier phases.
    Phases = 25,
    /// Log, depth gauge, acoustic fixes.
    Water = 26,
    /// Electrostatic gyro.
    Electrostatic = 27,
    /// A three-axis block that is carried by hand.
    CarriedBlock = 28,
}

/// One stream of random numbers.
#[derive(Debug, Clone)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of `source` for a seed. The same pair always gives the same numbers.
    pub fn new(seed: u64, source: Source) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(source as u64);
        Self(generator)
    }

    /// Gaussian, mean 0, variance 1.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Exponential, mean 1.
    pub fn exponential(&mut self) -> f64 {
        Exp1.sample(&mut self.0)
    }

    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.0.next_u32()
    }
}

/// First-order Gauss-Markov process with exact discretisation (A. Gelb, Applied Optimal Estimation, 1974).
#[derive(Debug, Clone)]
pub struct GaussMarkov {
    sigma: f64,
    tau_s: f64,
    value: f64,
}

impl GaussMarkov {
    /// Stationary from the start: the first value has standard deviation `sigma`.
    pub fn new(sigma: f64, tau_s: f64, stream: &mut Stream) -> Self {
        Self { sigma, tau_s, value: sigma * stream.normal() }
    }

    /// The value `dt_s` later.
    pub fn advance(&mut self, dt_s: f64, stream: &mut Stream) -> f64 {
        let kept = (-dt_s / self.tau_s).exp();
        self.value = self.value * kept + self.sigma * (1.0 - kept * kept).sqrt() * stream.normal();
        self.value
    }
}

/// Ratio of the time constants of neighbouring processes in [`SlowBias`].
const FLICKER_RATIO: f64 = 4.0;
/// Shortest time constant of the flicker noise, s; eight of them reach 4096 s.
const FLICKER_FIRST_S: f64 = 0.25;
const FLICKER_PROCESSES: i32 = 8;
/// The slow bias is stepped at this interval or longer, s.
const SLOW_STEP_S: f64 = 0.025;
/// … and in steps of at most this, s, of which the mean is taken.
const SLOW_STEP_MOST_S: f64 = 0.25;

/// Bias instability and rate random walk of a gyro, °/h.
///
/// Flicker noise is a sum of Gauss-Markov processes with time constants a factor r = 4 apart. Their two-sided densities
/// 2s²τ/(1 + (2πfτ)²) add up to s²/(2 ln r · f) between the corner frequencies. IEEE Std 952-1997 (annex C) writes
/// bias instability as B²/(2πf), with an Allan deviation of √(2 ln 2/π)·B = 0.664 B: so s = B·√(ln r/π). It is level
/// within 5 % from about 1 s to 1000 s.
///
/// Rate random walk K [°/h/√h] begins at zero and has a variance of K²·t.
#[derive(Debug, Clone)]
pub struct SlowBias {
    flicker: Vec<GaussMarkov>,
    walk_per_sqrt_s: f64,
    walk: f64,
    pending_s: f64,
    value: f64,
    stream: Stream,
}

impl SlowBias {
    /// `instability_deg_h` is B and `walk_deg_h_per_sqrt_h` K of IEEE Std 952.
    pub fn new(instability_deg_h: f64, walk_deg_h_per_sqrt_h: f64, mut stream: Stream) -> Self {
        let sigma = instability_deg_h * (FLICKER_RATIO.ln() / std::f64::consts::PI).sqrt();
        let processes = if instability_deg_h > 0.0 { FLICKER_PROCESSES } else { 0 };
        let flicker: Vec<_> = (0..processes)
            .map(|order| GaussMarkov::new(sigma, FLICKER_FIRST_S * FLICKER_RATIO.powi(order), &mut stream))
            .collect();
        let value = flicker.iter().map(|process| process.value).sum();
        Self {
            flicker,
            walk_per_sqrt_s: walk_deg_h_per_sqrt_h / 3600.0_f64.sqrt(),
            walk: 0.0,
            pending_s: 0.0,
            value,
            stream,
        }
    }

    /// Mean bias over the next `dt_s`, °/h.
    pub fn advance(&mut self, dt_s: f64) -> f64 {
        self.pending_s += dt_s;
        if self.pending_s >= SLOW_STEP_S {
            let steps = (self.pending_s / SLOW_STEP_MOST_S).ceil().max(1.0);
            let step_s = self.pending_s / steps;
            self.value = (0..steps as u32).map(|_| self.step(step_s)).sum::<f64>() / steps;
            self.pending_s = 0.0;
        }
        self.value
    }

    fn step(&mut self, dt_s: f64) -> f64 {
        if self.walk_per_sqrt_s > 0.0 {
            self.walk += self.walk_per_sqrt_s * dt_s.sqrt() * self.stream.normal();
        }
        let stream = &mut self.stream;
        self.walk + self.flicker.iter_mut().map(|process| process.advance(dt_s, stream)).sum::<f64>()
    }
}

/// A random telegraph: on and off for exponentially distributed times.
#[derive(Debug, Clone)]
pub struct Telegraph {
    mean_off_s: f64,
    mean_on_s: f64,
    on: bool,
    next_s: f64,
    stream: Stream,
}

impl Telegraph {
    /// Off at time 0.
    pub fn new(mean_off_s: f64, mean_on_s: f64, mut stream: Stream) -> Self {
        let next_s = mean_off_s * stream.exponential();
        Self { mean_off_s, mean_on_s, on: false, next_s, stream }
    }

    /// Whether it is on at `t_s`; times must not go back.
    pub fn is_on(&mut self, t_s: f64) -> bool {
        while t_s >= self.next_s {
            self.on = !self.on;
            let mean_s = if self.on { self.mean_on_s } else { self.mean_off_s };
            self.next_s += mean_s * self.stream.exponential();
        }
        self.on
    }
}
