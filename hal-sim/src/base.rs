//! Motion of the base: creep, sway, wind, rocking, shocks, levelling. All of it is motion in angle; the gyro feels the
//! difference of attitudes and the accelerometers the attitude itself.

use crate::geometry::{ARCSEC_PER_RAD, BaseAngles};
use crate::noise::{GaussMarkov, Source, Stream};
use crate::scenario::{self, BaseAngle, Relevel, Rocking, Shock, Sway, Wind};
use std::f64::consts::TAU;

/// Time over which motions that begin or end fade in or out, s.
const FADE_S: f64 = 0.5;
/// Longest step in which elastic supports are integrated, s.
const SUPPORT_STEP_S: f64 = 0.0025;

/// The base in motion.
#[derive(Debug, Clone)]
pub struct BaseMotion {
    base: scenario::Base,
    azimuth_deg: f64,
    wind: Option<[WindOnAxis; 3]>,
    rocking: Option<Load>,
    moves: bool,
    /// Turned by hand since power-up.
    turns: Vec<Turned>,
    t_s: f64,
    angles: BaseAngles,
    stream: Stream,
}

/// Somebody turns the instrument about the vertical.
#[derive(Debug, Clone, Copy)]
struct Turned {
    at_s: f64,
    duration_s: f64,
    /// Clockwise from above, degrees.
    by_deg: f64,
}

impl BaseMotion {
    /// The base at time 0.
    pub fn new(base: &scenario::Base, azimuth_deg: f64, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Source::Base);
        let wind = WindOnAxis::three(&base.wind, &mut stream);
        let rocking = Load::new(&base.rocking, &mut stream);
        let moves = wind.is_some()
            || rocking.is_some()
            || base.creep_arcsec != [0.0; 3]
            || base.creep_arcsec_s != [0.0; 3]
            || !base.sway.is_empty()
            || !base.shocks.is_empty()
            || !base.relevel.is_empty();
        let mut motion = Self {
            base: base.clone(),
            azimuth_deg,
            wind,
            rocking,
            moves,
            turns: Vec::new(),
            t_s: 0.0,
            angles: BaseAngles::default(),
            stream,
        };
        motion.angles = motion.angles_now();
        motion
    }

    /// Moves on to `t_s` (which must not go back).
    pub fn advance_to(&mut self, t_s: f64) {
        if !self.moves {
            self.t_s = t_s;
            return;
        }
        if self.wind.is_some() || self.rocking.is_some() {
            let steps = ((t_s - self.t_s) / SUPPORT_STEP_S - 1e-6).ceil().max(1.0);
            let step_s = (t_s - self.t_s) / steps;
            for step in 1..=steps as u32 {
                let now_s = self.t_s + f64::from(step) * step_s;
                for axis in self.wind.iter_mut().flatten() {
                    axis.advance(step_s, &mut self.stream);
                }
                if let Some(load) = &mut self.rocking {
                    load.advance(now_s, step_s, &self.base.rocking, &mut self.stream);
                }
            }
        }
        self.t_s = t_s;
        self.angles = self.angles_now();
    }

    /// Somebody strikes it.
    pub fn shock(&mut self, shock: Shock) {
        self.base.shocks.push(shock);
        self.moves = true;
    }

    /// Somebody levels it, or tilts it; the last one begun must have ended.
    pub fn relevel(&mut self, relevel: Relevel) {
        self.base.relevel.push(relevel);
        self.moves = true;
    }

    /// Somebody turns it, clockwise from above.
    pub fn turn(&mut self, at_s: f64, duration_s: f64, by_deg: f64) {
        self.turns.push(Turned { at_s, duration_s, by_deg });
        self.moves = true;
    }

    /// How the base stands now.
    pub fn angles(&self) -> BaseAngles {
        self.angles
    }

    fn angles_now(&self) -> BaseAngles {
        let t_s = self.t_s;
        let base = &self.base;
        let mut arcsec = [0.0; 3];
        for (axis, sum) in arcsec.iter_mut().enumerate() {
            *sum +=
                base.creep_arcsec[axis] * -(-t_s / base.creep_tau_s[axis]).exp_m1() + base.creep_arcsec_s[axis] * t_s;
            *sum += base.shocks.iter().map(|shock| shock_arcsec(shock, axis, t_s)).sum::<f64>();
        }
        for sway in &base.sway {
            arcsec[axis_of(sway.angle)] += sway_arcsec(sway, t_s);
        }
        if let Some(wind) = &self.wind {
            let gain = fade(t_s, base.wind.from_s, base.wind.to_s);
            for (sum, axis) in arcsec.iter_mut().zip(wind) {
                *sum += gain * axis.support.x;
            }
        }
        if let Some(load) = &self.rocking {
            for (sum, support) in arcsec.iter_mut().zip(&load.supports) {
                *sum += support.x;
            }
        }
        let [pitch_deg, roll_deg] = level_deg(&base.relevel, [base.pitch_deg, base.roll_deg], t_s);
        let turned_deg: f64 =
            self.turns.iter().map(|turned| eased(turned.at_s, turned.duration_s, t_s) * turned.by_deg).sum();
        BaseAngles {
            pitch_rad: pitch_deg.to_radians() + arcsec[0] / ARCSEC_PER_RAD,
            roll_rad: roll_deg.to_radians() + arcsec[1] / ARCSEC_PER_RAD,
            azimuth_rad: (self.azimuth_deg + turned_deg).to_radians() + arcsec[2] / ARCSEC_PER_RAD,
        }
    }
}

fn axis_of(angle: BaseAngle) -> usize {
    match angle {
        BaseAngle::Pitch => 0,
        BaseAngle::Roll => 1,
        BaseAngle::Azimuth => 2,
    }
}

/// 0 outside the window, 1 inside, a raised cosine between. A window that begins at 0 is in force from the start.
fn fade(t_s: f64, from_s: f64, to_s: Option<f64>) -> f64 {
    let rise = if from_s <= 0.0 { 1.0 } else { ((t_s - from_s) / FADE_S).clamp(0.0, 1.0) };
    let fall = to_s.map_or(1.0, |to_s| ((to_s - t_s) / FADE_S).clamp(0.0, 1.0));
    0.25 * (1.0 - (TAU / 2.0 * rise).cos()) * (1.0 - (TAU / 2.0 * fall).cos())
}

fn sway_arcsec(sway: &Sway, t_s: f64) -> f64 {
    let phase = TAU * sway.frequency_hz * t_s + sway.phase_deg.to_radians();
    sway.amplitude_arcsec * fade(t_s, sway.from_s, sway.to_s) * phase.sin()
}

/// A damped oscillation that begins at zero, and a change that stays and takes the same time to come.
fn shock_arcsec(shock: &Shock, axis: usize, t_s: f64) -> f64 {
    let since_s = t_s - shock.at_s;
    if since_s <= 0.0 {
        return 0.0;
    }
    let left = (-since_s / shock.decay_s).exp();
    shock.swing_arcsec[axis] * left * (TAU * shock.frequency_hz * since_s).sin()
        + shock.permanent_arcsec[axis] * (1.0 - left)
}

/// 0 before, 1 after, a raised cosine between.
fn eased(at_s: f64, duration_s: f64, t_s: f64) -> f64 {
    let done = ((t_s - at_s) / duration_s).clamp(0.0, 1.0);
    0.5 * (1.0 - (TAU / 2.0 * done).cos())
}

/// Pitch and roll after the operator's levelling so far: a raised cosine from one state to the next.
fn level_deg(relevel: &[Relevel], start_deg: [f64; 2], t_s: f64) -> [f64; 2] {
    relevel.iter().fold(start_deg, |[pitch_deg, roll_deg], step| {
        let weight = eased(step.at_s, step.duration_s, t_s);
        [pitch_deg + weight * (step.pitch_deg - pitch_deg), roll_deg + weight * (step.roll_deg - roll_deg)]
    })
}

/// A mass on an elastic, damped support.
#[derive(Debug, Clone)]
struct Support {
    omega: f64,
    damping: f64,
    x: f64,
    v: f64,
}

impl Support {
    fn new(frequency_hz: f64, damping: f64) -> Self {
        Self { omega: TAU * frequency_hz, damping, x: 0.0, v: 0.0 }
    }

    /// Semi-implicit Euler: stable while omega · dt < 2.
    fn advance(&mut self, rest: f64, dt_s: f64) {
        let pull = self.omega * self.omega * (rest - self.x);
        self.v = (self.v + pull * dt_s) / (1.0 + 2.0 * self.damping * self.omega * dt_s);
        self.x += self.v * dt_s;
    }
}

#[derive(Debug, Clone)]
struct WindOnAxis {
    gust: GaussMarkov,
    support: Support,
}

impl WindOnAxis {
    /// Pitch, roll and azimuth; nothing if there is no wind.
    fn three(wind: &Wind, stream: &mut Stream) -> Option<[Self; 3]> {
        let rms = [wind.pitch_rms_arcsec, wind.roll_rms_arcsec, wind.azimuth_rms_arcsec];
        (rms != [0.0; 3]).then(|| {
            rms.map(|rms| {
                let mut gust = GaussMarkov::new(rms, wind.gust_s, stream);
                let mut support = Support::new(wind.support_hz, wind.support_damping);
                support.x = gust.advance(0.0, stream);
                Self { gust, support }
            })
        })
    }

    fn advance(&mut self, dt_s: f64, stream: &mut Stream) {
        let rest = self.gust.advance(dt_s, stream);
        self.support.advance(rest, dt_s);
    }
}

/// A load that shifts at random times.
#[derive(Debug, Clone)]
struct Load {
    rest_arcsec: [f64; 2],
    next_s: f64,
    supports: [Support; 2],
}

impl Load {
    fn new(rocking: &Rocking, stream: &mut Stream) -> Option<Self> {
        let moves = rocking.pitch_rms_arcsec > 0.0 || rocking.roll_rms_arcsec > 0.0;
        moves.then(|| Self {
            rest_arcsec: [0.0; 2],
            next_s: rocking.from_s + rocking.mean_interval_s * stream.exponential(),
            supports: [(); 2].map(|()| Support::new(rocking.suspension_hz, rocking.suspension_damping)),
        })
    }

    fn advance(&mut self, t_s: f64, dt_s: f64, rocking: &Rocking, stream: &mut Stream) {
        while t_s >= self.next_s && rocking.to_s.is_none_or(|to_s| self.next_s < to_s) {
            self.rest_arcsec = [rocking.pitch_rms_arcsec * stream.normal(), rocking.roll_rms_arcsec * stream.normal()];
            self.next_s += rocking.mean_interval_s * stream.exponential();
        }
        for (support, rest) in self.supports.iter_mut().zip(self.rest_arcsec) {
            support.advance(rest, dt_s);
        }
    }
}
