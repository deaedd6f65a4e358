//! What is stored in the flash of a scenario's instrument.

use hal_sim::Scenario;
use hal_sim::scenario::GyroFormat as SimulatedFormat;
use north_finder::settings::{AccelerometerCalibration, GyroFormat, Settings};
use serde::Deserialize as _;
use serde::de::Error as _;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

/// The defaults at a scenario's latitude, with its gyro's frame format.
pub fn default_settings(scenario: &Scenario) -> Settings {
    let accelerometer = scenario.accelerometer.factory_calibrated.then_some(AccelerometerCalibration::UNIT);
    let mut settings = Settings { latitude_deg: scenario.site.latitude_deg, accelerometer, ..Settings::default() };
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
    let [base, over] = [toml::to_string(&default_settings(scenario)), toml::to_string(&scenario.instrument)]
        .map(|text| text.map_err(toml::de::Error::custom));
    let (base, over) = (base?, over?);
    let mut merged = DeTable::parse(&base)?;
    lay_over(merged.get_mut(), DeTable::parse(&over)?.into_inner());
    Settings::deserialize(Deserializer::from(merged))
}

/// Declares the gyro's angle random walk (°/√h), and raises the gates' thresholds as far as such a gyro at rest needs.
pub fn declare_noise(settings: &mut Settings, arw_deg_per_sqrt_h: f64) {
    settings.gyro.arw_deg_per_sqrt_h = arw_deg_per_sqrt_h;
    let noise_deg_h = settings.gyro.noise_deg_h();
    let disturbance = &mut settings.disturbance.threshold_deg_h;
    *disturbance = disturbance.max(settings.gyro.bias_limit_deg_h + 6.0 * noise_deg_h);
    let jitter = &mut settings.jitter.threshold_deg_h;
    *jitter = jitter.max(6.0 * std::f64::consts::SQRT_2 * noise_deg_h);
}

/// Replaces in `base` what `over` says; tables are merged, everything else is replaced: also a choice with values, a table of one name,
/// by another choice.
pub fn lay_over<'a>(base: &mut DeTable<'a>, over: DeTable<'a>) {
    for (key, value) in over {
        if let Some(DeValue::Table(below)) = base.get_mut(key.get_ref().as_ref()).map(Spanned::get_mut)
            && let DeValue::Table(above) = value.get_ref()
            && !(below.len() == 1 && above.len() == 1 && below.keys().next() != above.keys().next())
        {
            if let DeValue::Table(table) = value.into_inner() {
                lay_over(below, table);
            }
            continue;
        }
        base.remove(key.get_ref().as_ref());
        base.insert(key, value);
    }
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
