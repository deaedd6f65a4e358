//! An error model of one's own: a bias that follows a lagging temperature, and what it does to a second.
//!
//! `cargo run --example own_effect --no-default-features`
//!
//! An effect is a product of one to three factors at a port; a factor is a shape of a signal behind dynamics. Every signal, dynamics and shape is
//! a file in `src/effects`, with a line in the list beside it: a new one is written like these.

use north_finder::effects::channel::TEMPERATURE;
use north_finder::effects::dynamics::LowPass;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::Linear;
use north_finder::effects::signal::Channel;
use north_finder::effects::{ChannelName, Conditions, ErrorModel, Evaluator};
use north_finder::sensing::index::Direction;

/// Seconds that the bias lags behind the temperature.
const LAG_S: f32 = 120.0;

fn main() {
    let name = ChannelName::new(TEMPERATURE).expect("the name of a channel");
    // Nothing at 20 °C, and one at a degree more.
    let warmer = Linear { reference: 20.0, scale: 1.0 };
    let factor = Factor::new(Channel { name }.into(), &[LowPass { tau_s: LAG_S }.into()], warmer.into());
    let mut effect = Effect::new(Port::Rate, &[factor]);
    // 0.02 °/h for every degree: one weight for every product of functions, here one.
    effect.weights.fill(0.02);
    println!("{effect}: {} weight", effect.count());

    let mut model = ErrorModel::default();
    if model.effects.push(effect).is_err() {
        println!("a model has no room for more effects");
        return;
    }
    model.validate().expect("weights and constants in their ranges");
    // The temperature jumps from 20 to 25 °C after a minute: the bias follows with 0.1 °/h (1 − e^(−t/120 s)).
    let mut evaluator = Evaluator::new(model);
    for second in 0..420 {
        let temp_c = if second < 60 { 20.0 } else { 25.0 };
        let conditions = Conditions {
            t_s: f64::from(second) + 0.5,
            raw_rate_deg_h: 7.52,
            index: Some(Direction::of_deg(0.0)),
            temp_c: Some(temp_c),
            ..Conditions::default()
        };
        let correction = evaluator.second(&conditions);
        if second % 60 == 59 {
            let true_deg_h = correction.apply(conditions.raw_rate_deg_h, 1.0);
            println!("{:4} s  bias {:.4} °/h  true rate {true_deg_h:.4} °/h", second + 1, correction.bias_deg_h);
        }
    }
}
