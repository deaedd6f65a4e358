//! The longest settings that are valid: what record and frame must hold.

use calibration::accelerometer::AccelerometerCalibration;
use heapless::Vec;

use crate::effects::basis::curve::Curve;
use crate::effects::basis::curve::function::Function;
use crate::effects::basis::curve::signal::Signal;
use crate::effects::doubt::{Kernel, MAX_DIRECTIONS, Process};
use crate::effects::dynamics::Thermostat;
use crate::effects::effect::Port;
use crate::effects::factor::Factor;
use crate::effects::rate_term::DeadZoneForm;
use crate::effects::shape::{Bump, Sharp, Smooth};
use crate::effects::signal::WeightedDifference;
use crate::effects::{
    BaseMotion, Basis, ChannelName, EarthField, Effect, ErrorModel, IndexError, MAX_EFFECTS, MAX_PRODUCTS,
    MAX_RATE_TERMS, MAX_TERMS, MAX_WINDOWS, Plausible, RateTerm, Sinusoid, Term,
};
use crate::fix::heading::settings::BlockSettings;
use crate::sequence::order::{MAX_POSITIONS, Order};
use crate::settings::access::PublicKey;
use crate::settings::analogue::InputSettings;
use crate::settings::{AnalogueSettings, Settings};

/// Every number needs all its bytes, every list is full, every effect is of the longest kind.
pub fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.level.seconds = u16::MAX;
    settings.index.microsteps_per_turn = u32::MAX;
    settings.disturbance.seconds = u16::MAX;
    settings.jitter.seconds = u16::MAX;
    settings.sequence.dwell_s = u16::MAX;
    settings.sequence.coarse_dwell_s = u16::MAX;
    settings.gyro.repairable_frames = u16::MAX;

    let mut angles = Vec::new();
    angles.resize(MAX_POSITIONS, 1.1).unwrap();
    settings.sequence.order = Order::Custom(angles);
    settings.model = Some(of_effects());
    settings.accelerometer = Some(AccelerometerCalibration { bias_g: [1.1; 3], matrix: [1.1; 6] });
    settings.block = Some(BlockSettings {
        arw_deg_per_sqrt_h: Some(1.1),
        bias_deg_h: Some(1.1),
        scale_ppm: Some(1.1),
        range_deg_s: Some(1.1),
        ..BlockSettings::default()
    });
    let input = |name| Some(InputSettings { name: ChannelName::new(name).unwrap(), zero_v: 1.1, per_v: 1.1 });
    settings.analogue = AnalogueSettings {
        first: input("a_name_of_twenty_four_by"),
        second: input("b_name_of_twenty_four_by"),
        third: input("c_name_of_twenty_four_by"),
        fourth: input("d_name_of_twenty_four_by"),
        ..AnalogueSettings::default()
    };
    settings.link.key = Some(PublicKey([0xFF; 32]));
    settings
}

/// The longest valid model of effects: five curves of sixteen functions, two of six and one of four, each times two bumps, reach the limits of factors and
/// weights; all are of the weighted difference of two channels behind two dynamics.
fn of_effects() -> ErrorModel {
    let name = |text| ChannelName::new(text).unwrap();
    let difference = WeightedDifference {
        plus: name("a_name_of_twenty_four_by"),
        minus: name("b_name_of_twenty_four_by"),
        ratio: 1.1,
        reference: 1.1,
    };
    let dynamics = [Thermostat { centre: 1.1, half_width: 1.1, from_above: true }.into(); 2];
    let of = |shape| Factor::new(difference.into(), &dynamics, shape);
    let mut model = ErrorModel { scale_error: 0.01, bias_deg_h: 1.1, level_drift_arcsec: 1.1, ..Default::default() };
    for i in 0..MAX_EFFECTS {
        let smooth = |count| Smooth { low: 1.1, high: 2.2, count }.into();
        let curve = match i {
            0..5 => Sharp { low: 1.1, high: 2.2 }.into(),
            5 | 6 => smooth(6),
            _ => smooth(4),
        };
        let bump = || of(Bump { centre: 1.1, width: 1.1, circular: true }.into());
        let mut effect = Effect::new(Port::Forward, &[of(curve), bump(), bump()]);
        effect.weights.iter_mut().for_each(|weight| *weight = 1.1);
        assert!(model.effects.push(effect).is_ok());
    }
    with_the_rest(&mut model);
    model
}

/// The longest valid model of terms: twelve tables of four knots reach the limits of knots and coefficients, four of them in products.
/// All follow one channel.
pub fn of_terms(channel: &str) -> ErrorModel {
    let signal = Signal::Rate { samples: 30, curved: true, low_pass_s: 1.1 };
    let channel = ChannelName::new(channel).unwrap();
    let of = |function| Basis::Curve(Curve { channel, signal, function });
    let table = || of(Function::Table([1.1, 2.2, 3.3, 4.4].into_iter().collect()));
    let mut model = ErrorModel { scale_error: 0.01, bias_deg_h: 1.1, ..Default::default() };
    for i in 0..MAX_TERMS {
        let straight = of(Function::Powers { reference: 1.1, degree: 1 });
        let term = if i < MAX_PRODUCTS { Term::product(table(), straight) } else { Term::scaling(table()) };
        model.add(term).unwrap();
    }
    for _ in 0..MAX_RATE_TERMS {
        let form = DeadZoneForm::Lock;
        model
            .add_rate_term(RateTerm::DeadZone { centre_deg_h: 1.1, depth_deg_h: 0.0, width_deg_h: 1.1, form })
            .unwrap();
    }
    with_the_rest(&mut model);
    model
}

/// What else a model has.
fn with_the_rest(model: &mut ErrorModel) {
    let channel = ChannelName::new("a_name_of_twenty_four_by").unwrap();
    model.plausible.resize(MAX_WINDOWS, Plausible { channel, low: 1.1, high: 2.2 }).unwrap();
    model.index_error = Some(IndexError { offset_deg: 0.0, cos_deg: 0.0, sin_deg: 0.0 });
    model.earth_field = Some(EarthField { east_deg_h: 0.0, north_deg_h: 0.0 });
    model.base_motion = Some(BaseMotion { velocity: true, lag_s: 1.1 });
    model.sinusoid = Some(Sinusoid { period_s: 1.1, amplitude_deg_h: 1.1 });
    let of_terms: usize = model.terms.iter().map(|term| term.coefficients.len()).sum();
    let number = of_terms + model.effects.iter().map(Effect::count).sum::<usize>();
    let direction: Vec<f32, _> = core::iter::repeat_n(1.1, number).collect();
    model.doubt.directions.resize(MAX_DIRECTIONS, direction).unwrap();
    model.doubt.azimuth_sigma_deg = 1.1;
    let kernel = Kernel::DampedCosine { period_s: 1.1 };
    model.doubt.process = Some(Process { port: Port::Left, kernel, sigma_deg_h: 1.1, time_s: 1.1 });
    model.validate().unwrap();
}
