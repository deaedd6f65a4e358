//! The kinds of faults, and the reasons for which an instrument that has them may refuse.

use std::f64::consts::TAU;

use hal_sim::flash::SECTOR;
use hal_sim::scenario::{
    BaseAngle, GyroFault, GyroFaultKind, Harmonic, LinkFault, LinkFaultKind, Relevel, SensorFault, SensorFaultKind,
    Shock, Sway,
};
use north_finder::health::Fault::{self, *};
use north_finder::sequence::Command;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Act, BUSY_S, Trial};

/// A kind of fault.
pub struct Kind {
    /// Name, stable: lower-case words with hyphens.
    pub name: &'static str,
    /// What an instrument that has it may rightly refuse for.
    pub refusals: &'static [Fault],
    pub(super) blind: Blind,
    pub(super) inject: fn(&mut ChaCha8Rng, &mut Trial),
}

/// Whether a single fix can see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blind {
    No,
    Always,
    InPlainOrder,
    /// Where the encoder slipped before the power came on, or within the seconds in which its first angle is learned.
    BeforePower,
}

impl Kind {
    /// All of them.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        KINDS.iter()
    }
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for Kind {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(self.name)
    }
}

const fn kind(name: &'static str, refusals: &'static [Fault], inject: fn(&mut ChaCha8Rng, &mut Trial)) -> Kind {
    Kind { name, refusals, blind: Blind::No, inject }
}

const fn blind(name: &'static str, blind: Blind, inject: fn(&mut ChaCha8Rng, &mut Trial)) -> Kind {
    Kind { name, refusals: &[Unsolvable], blind, inject }
}

/// What a gyro that is not heard looks like.
const UNHEARD: &[Fault] = &[GyroSilent, GyroClock, LinkPoor, GyroInvalid, OutOfTime];
/// What a base that moves looks like.
const MOVED: &[Fault] = &[Disturbed, Jitter, LevelLost, NotLevel, GyroSaturated, Unsolvable, OutOfTime];
/// What a drive that does not follow looks like.
const UNDRIVEN: &[Fault] = &[MotorStall, WrongAngle, Jitter, OutOfTime];

pub(super) const KINDS: &[Kind] = &[
    kind("gyro-silent", UNHEARD, |random, trial| gyro(random, trial, GyroFaultKind::Silent)),
    kind("gyro-invalid", UNHEARD, |random, trial| gyro(random, trial, GyroFaultKind::Invalid)),
    kind("gyro-saturated", &[GyroSaturated, Disturbed, Jitter, LinkPoor], |random, trial| {
        gyro(random, trial, GyroFaultKind::Saturated);
    }),
    kind("gyro-stuck", &[GyroStuck, Disturbed, Jitter, Unsolvable], |random, trial| {
        gyro(random, trial, GyroFaultKind::Stuck);
    }),
    kind("gyro-temperature", &[], |random, trial| gyro(random, trial, GyroFaultKind::TemperatureInvalid)),
    kind("gyro-clock", UNHEARD, |random, trial| trial.scenario.gyro.frames_per_tick = random.random_range(0.9..1.1)),
    kind("gyro-late", &[GyroSilent], |random, trial| trial.scenario.gyro.startup_s = random.random_range(0.5..30.0)),
    kind("bytes-dropped", UNHEARD, |random, trial| link(random, trial, LinkFaultKind::Drop)),
    kind("bytes-flipped", UNHEARD, |random, trial| link(random, trial, LinkFaultKind::Flip)),
    kind("bytes-doubled", UNHEARD, |random, trial| link(random, trial, LinkFaultKind::Duplicate)),
    kind("bytes-late", UNHEARD, |random, trial| link(random, trial, LinkFaultKind::Delay)),
    kind("bytes-burst", UNHEARD, |random, trial| link(random, trial, LinkFaultKind::Burst)),
    kind("gyro-bias", &[Disturbed, Unsolvable], |random, trial| {
        trial.scenario.gyro.bias_deg_h = sign(random) * random.random_range(0.5..8.0);
    }),
    blind("gyro-drift", Blind::InPlainOrder, |random, trial| {
        trial.scenario.gyro.drift_deg_h_per_h = sign(random) * log_uniform(random, 0.5, 50.0);
    }),
    kind("gyro-scale", &[Unsolvable], |random, trial| {
        trial.scenario.gyro.scale_ppm = sign(random) * log_uniform(random, 1000.0, 90_000.0);
    }),
    kind("gyro-noise", &[Jitter, Disturbed, Unsolvable], |random, trial| {
        trial.scenario.gyro.arw_deg_per_sqrt_h = log_uniform(random, 0.002, 0.03);
    }),
    kind("interference", &[Jitter, Disturbed, Unsolvable], |random, trial| {
        trial.scenario.gyro.interference_deg_h = log_uniform(random, 0.05, 20.0);
        trial.scenario.gyro.interference_hz = log_uniform(random, 0.01, 190.0);
    }),
    kind("comes-and-goes", &[Jitter, Disturbed, Unsolvable], |random, trial| {
        trial.scenario.gyro.intermittent_deg_h = sign(random) * log_uniform(random, 0.1, 5.0);
    }),
    blind("bias-step", Blind::InPlainOrder, |random, trial| {
        trial.scenario.gyro.supply_deg_h_per_v = sign(random) * log_uniform(random, 0.1, 2.0);
        trial.scenario.supply.step_v = -1.0;
        trial.scenario.supply.step_at_s = at_s(random);
    }),
    blind("magnet", Blind::Always, |random, trial| harmonic(random, trial, 1)),
    kind("second-harmonic", &[Unsolvable], |random, trial| harmonic(random, trial, 2)),
    blind("third-harmonic", Blind::Always, |random, trial| harmonic(random, trial, 3)),
    blind("earth-field", Blind::Always, |random, trial| {
        trial.scenario.gyro.magnetic_transverse_deg_h = log_uniform(random, 0.05, 0.5);
    }),
    blind("gravity", Blind::Always, |random, trial| {
        trial.scenario.gyro.g_sensitivity_deg_h_per_g = log_uniform(random, 0.5, 50.0);
    }),
    blind("non-linearity", Blind::Always, |random, trial| {
        trial.scenario.gyro.dead_zone_deg_h = log_uniform(random, 0.05, 0.5);
    }),
    kind("accelerometer-stuck", &[AccelerometerFailed], |random, trial| {
        accelerometer(random, trial, SensorFaultKind::Stuck);
    }),
    kind("accelerometer-bus", &[AccelerometerFailed, NotLevel, LevelLost], |random, trial| {
        let level = if random.random() { SensorFaultKind::BusHigh } else { SensorFaultKind::BusLow };
        accelerometer(random, trial, level);
    }),
    kind("encoder-stuck", &[EncoderFailed, MotorStall, WrongAngle], |random, trial| {
        encoder(random, trial, SensorFaultKind::Stuck);
    }),
    kind("encoder-bus", &[EncoderFailed, MotorStall, WrongAngle], |random, trial| {
        let level = if random.random() { SensorFaultKind::BusHigh } else { SensorFaultKind::BusLow };
        encoder(random, trial, level);
    }),
    Kind {
        name: "encoder-slip",
        refusals: &[WrongAngle, MotorStall, EncoderFailed, Unsolvable],
        blind: Blind::BeforePower,
        inject: |random, trial| {
            trial.scenario.encoder.slip_deg = sign(random) * log_uniform(random, 0.1, 30.0);
            trial.scenario.encoder.slip_at_s = at_s(random);
        },
    },
    kind("encoder-weak", &[EncoderFailed], |_, trial| trial.scenario.encoder.weak_magnet = true),
    kind("motor-stall", UNDRIVEN, |random, trial| {
        let (from_s, to_s) = window(random);
        (trial.scenario.motor.stall_from_s, trial.scenario.motor.stall_to_s) = (Some(from_s), to_s);
    }),
    kind("motor-loses-steps", UNDRIVEN, |random, trial| trial.scenario.motor.lose_every = random.random_range(2..2000)),
    kind("hard-stop", UNDRIVEN, |random, trial| {
        trial.scenario.motor.hard_stop_deg = Some(random.random_range(20.0..350.0));
    }),
    kind("backlash", UNDRIVEN, |random, trial| trial.scenario.motor.backlash_deg = log_uniform(random, 0.05, 5.0)),
    kind("hunting", UNDRIVEN, |random, trial| trial.scenario.motor.hunting_deg = log_uniform(random, 0.0005, 0.5)),
    kind("kick", UNDRIVEN, |random, trial| trial.scenario.motor.kick_deg_s = log_uniform(random, 0.5, 50.0)),
    kind("shock", MOVED, |random, trial| {
        let size = log_uniform(random, 3.0, 3000.0);
        trial.scenario.base.shocks.push(Shock {
            at_s: at_s(random),
            swing_arcsec: [(); 3].map(|()| size * random.random_range(-1.0..1.0)),
            permanent_arcsec: [size * random.random_range(-0.3..0.3), size * random.random_range(-0.3..0.3), 0.0],
            ..Shock::default()
        });
    }),
    kind("tilted", MOVED, |random, trial| {
        trial.scenario.base.relevel.push(Relevel {
            at_s: at_s(random),
            duration_s: random.random_range(0.5..20.0),
            pitch_deg: random.random_range(-2.0..2.0),
            roll_deg: random.random_range(-2.0..2.0),
        });
    }),
    kind("sway", MOVED, |random, trial| {
        trial.scenario.base.sway.push(Sway {
            angle: if random.random() { BaseAngle::Roll } else { BaseAngle::Pitch },
            amplitude_arcsec: log_uniform(random, 0.3, 300.0),
            frequency_hz: log_uniform(random, 0.01, 5.0),
            phase_deg: random.random_range(0.0..360.0),
            ..Sway::default()
        });
    }),
    kind("wind", MOVED, |random, trial| {
        let size = log_uniform(random, 0.3, 30.0);
        (trial.scenario.base.wind.pitch_rms_arcsec, trial.scenario.base.wind.roll_rms_arcsec) = (size, size);
    }),
    kind("rocking", MOVED, |random, trial| {
        let size = log_uniform(random, 1.0, 200.0);
        (trial.scenario.base.rocking.pitch_rms_arcsec, trial.scenario.base.rocking.roll_rms_arcsec) = (size, size);
    }),
    kind("creep", MOVED, |random, trial| {
        let size = log_uniform(random, 1.0, 300.0);
        let angle: f64 = random.random_range(0.0..TAU);
        trial.scenario.base.creep_arcsec = [size * angle.cos(), size * angle.sin(), 0.0];
        trial.scenario.base.creep_tau_s = [log_uniform(random, 20.0, 300.0); 3];
    }),
    blind("twist", Blind::Always, |random, trial| {
        trial.scenario.base.creep_arcsec_s[2] = sign(random) * log_uniform(random, 0.02, 5.0);
    }),
    kind("wrong-latitude", &[Unsolvable, Disturbed], |random, trial| {
        if let Some(settings) = &mut trial.settings {
            let off_deg = sign(random) * log_uniform(random, 0.5, 60.0);
            settings.latitude_deg = (settings.latitude_deg + off_deg).clamp(-88.0, 88.0);
        }
    }),
    kind("settings-missing", &[SettingsMissing], |_, trial| trial.settings = None),
    kind("flash-bits", &[SettingsCorrupt, SettingsMissing], |random, trial| {
        let count = random.random_range(1..=8);
        // Where settings lie: the beginning of both sectors.
        trial.flipped_bits =
            (0..count).map(|_| 8 * SECTOR * random.random_range(0..2) + random.random_range(0..8 * 300)).collect();
    }),
    kind("power-cut", &[], |random, trial| trial.acts.push((at_s(random), Act::PowerCut))),
    kind("power-cut-while-storing", &[], |random, trial| {
        let Some(mut settings) = trial.settings.clone() else { return };
        settings.time_limit_s += 1.0;
        let bytes = random.random_range(0..700);
        trial.acts.push((at_s(random), Act::StoreAndFail(Box::new(settings), bytes)));
    }),
    kind("settings-while-measuring", &[], |random, trial| {
        let Some(mut settings) = trial.settings.clone() else { return };
        settings.time_limit_s += 1.0;
        trial.acts.push((at_s(random), Act::Store(Box::new(settings))));
    }),
    kind("bad-settings-while-measuring", &[], |random, trial| {
        let Some(mut settings) = trial.settings.clone() else { return };
        settings.time_limit_s = if random.random() { f64::NAN } else { -1.0 };
        trial.acts.push((at_s(random), Act::Store(Box::new(settings))));
    }),
    kind("start-again", &[], |random, trial| trial.acts.push((at_s(random), Act::Command(Command::Start)))),
    kind("abort", &[Aborted], |random, trial| trial.acts.push((at_s(random), Act::Command(Command::Abort)))),
    kind("calibrate-meanwhile", &[Aborted], |random, trial| {
        trial.acts.push((at_s(random), Act::Command(Command::CalibrateAccelerometers)));
    }),
];

fn sign(random: &mut ChaCha8Rng) -> f64 {
    if random.random() { 1.0 } else { -1.0 }
}

fn log_uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    random.random_range(low.ln()..high.ln()).exp()
}

/// Some time during the fix, s.
fn at_s(random: &mut ChaCha8Rng) -> f64 {
    random.random_range(0.0..BUSY_S)
}

/// From some time on, for a while or for ever.
fn window(random: &mut ChaCha8Rng) -> (f64, Option<f64>) {
    let from_s = at_s(random);
    let to_s = if random.random() { Some(from_s + log_uniform(random, 0.05, 60.0)) } else { None };
    (from_s, to_s)
}

fn gyro(random: &mut ChaCha8Rng, trial: &mut Trial, kind: GyroFaultKind) {
    let (from_s, to_s) = window(random);
    trial.scenario.gyro.faults.push(GyroFault { kind, from_s, to_s });
}

fn link(random: &mut ChaCha8Rng, trial: &mut Trial, kind: LinkFaultKind) {
    let (from_s, to_s) = window(random);
    trial.scenario.link.faults.push(LinkFault {
        kind,
        probability: log_uniform(random, 1e-6, 0.05),
        bytes: random.random_range(1..200),
        delay_s: log_uniform(random, 0.001, 1.0),
        from_s,
        to_s,
    });
}

fn accelerometer(random: &mut ChaCha8Rng, trial: &mut Trial, kind: SensorFaultKind) {
    let (from_s, to_s) = window(random);
    trial.scenario.accelerometer.faults.push(SensorFault { kind, from_s, to_s });
}

fn encoder(random: &mut ChaCha8Rng, trial: &mut Trial, kind: SensorFaultKind) {
    let (from_s, to_s) = window(random);
    trial.scenario.encoder.faults.push(SensorFault { kind, from_s, to_s });
}

fn harmonic(random: &mut ChaCha8Rng, trial: &mut Trial, order: u32) {
    let (amplitude_deg_h, phase_deg) = (log_uniform(random, 0.05, 2.0), random.random_range(0.0..360.0));
    trial.scenario.gyro.harmonics.push(Harmonic { order, amplitude_deg_h, phase_deg });
}
