//! What is stored in the flash of a scenario's instrument.

use hal_sim::Scenario;
use hal_sim::scenario::GyroFormat as SimulatedFormat;
use north_finder::settings::{GyroFormat, Settings};
use serde::de::Error as _;
use toml::{Table, Value};

/// The defaults at a scenario's latitude, with its gyro's frame format.
pub fn default_settings(scenario: &Scenario) -> Settings {
    let mut settings = Settings { latitude_deg: scenario.site.latitude_deg, ..Settings::default() };
    settings.gyro.format = match scenario.gyro.format {
        SimulatedFormat::Compact => GyroFormat::Compact,
        SimulatedFormat::KvhA => GyroFormat::KvhA,
    };
    settings
}

/// The same, and over them the scenario's table `[instrument]`.
///
/// Errors: the table holds unknown fields or wrong types.
pub fn settings(scenario: &Scenario) -> Result<Settings, toml::de::Error> {
    let base = Table::try_from(default_settings(scenario)).map_err(toml::de::Error::custom)?;
    laid_over(base, &scenario.instrument).try_into()
}

/// Declares the gyro's angle random walk (°/√h), and raises the gates' thresholds as far as such a gyro at rest needs.
pub fn declare_noise(settings: &mut Settings, arw_deg_per_sqrt_h: f64) {
    let noise_deg_h = 60.0 * arw_deg_per_sqrt_h;
    settings.gyro.arw_deg_per_sqrt_h = arw_deg_per_sqrt_h;
    let disturbance = &mut settings.disturbance.threshold_deg_h;
    *disturbance = disturbance.max(settings.gyro.bias_limit_deg_h + 6.0 * noise_deg_h);
    let jitter = &mut settings.jitter.threshold_deg_h;
    *jitter = jitter.max(6.0 * std::f64::consts::SQRT_2 * noise_deg_h);
}

/// Tables are merged, everything else is replaced: also a choice with values, a table of one name, by another choice.
fn laid_over(mut base: Table, over: &Table) -> Table {
    for (key, value) in over {
        let merged = match (base.remove(key), value) {
            (Some(Value::Table(below)), Value::Table(above)) if !is_other_choice(&below, above) => {
                Value::Table(laid_over(below, above))
            }
            _ => value.clone(),
        };
        base.insert(key.clone(), merged);
    }
    base
}

fn is_other_choice(below: &Table, above: &Table) -> bool {
    below.len() == 1 && above.len() == 1 && below.keys().next() != above.keys().next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use north_finder::sequence::order::Order;

    #[test]
    fn a_scenario_says_what_differs_and_may_choose_another_order() {
        let mut scenario = Scenario::named("calm-bench").unwrap();
        let text = "[disturbance]\nseconds = 4\n[sequence]\norder = { custom = [0.0, 120.0, 240.0] }\n";
        scenario.instrument = text.parse().unwrap();
        let found = settings(&scenario).unwrap();
        let base = default_settings(&scenario);
        assert_eq!(found.disturbance.seconds, 4);
        assert_eq!(found.disturbance.threshold_deg_h, base.disturbance.threshold_deg_h);
        assert_eq!(found.sequence.order, Order::Custom([0.0, 120.0, 240.0].into_iter().collect()));
        assert_eq!(found.sequence.dwell_s, base.sequence.dwell_s);
    }
}
