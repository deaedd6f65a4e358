//! Readings that cannot be: a sensor that fails for a moment, as a thermometer does that loses its power or whose line is disturbed.

use north_finder::effects::channel::{FORWARD, LEFT};
use north_finder::effects::{ChannelName, ErrorModel, Plausible};

use super::Warning;
use crate::count::counted;
use crate::run_data::RunData;

/// Takes readings that cannot be out of the runs, says so, and tells the model what can be, so that a fix does the same: the reading before holds.
pub fn hold(runs: &mut [RunData], base: &mut ErrorModel, warnings: &mut Vec<Warning>) {
    let mut names: Vec<String> = runs.iter().flat_map(RunData::channel_names).collect();
    names.sort();
    names.dedup();
    let is_known = |name: &String| base.plausible.iter().any(|each| each.channel.as_str() == name);
    names.retain(|name| !matches!(name.as_str(), FORWARD | LEFT) && !is_known(name));
    for name in &names {
        let of_runs: Vec<Vec<f64>> = runs.iter().filter_map(|run| run.channel(name)).collect();
        let Some((low, high, faults)) = plausible(&of_runs) else { continue };
        let Some(channel) = ChannelName::new(name) else { continue };
        if base.plausible.push(Plausible { channel, low, high }).is_ok() {
            warnings.push(Warning::of_campaign(format!(
                "column `{name}` has {}, of at most three rows each time, further from all others than these lie apart (below {low:.4} or above {high:.4}): they are taken for faults of the sensor, and the reading before holds",
                counted(faults, "reading")
            )));
        }
    }
    runs.iter_mut().for_each(|run| run.hold_readings(&base.plausible));
}

/// The interval of a channel's readings in all runs that can be, and how many are outside it: as far again to both sides as those lie apart that are no further
/// from the middle 96 % than these are wide. `None` where none is outside, more than one in fifty, or more than three in a row: what lasts is no fault.
fn plausible(of_runs: &[Vec<f64>]) -> Option<(f64, f64, usize)> {
    let mut all = of_runs.concat();
    all.sort_by(f64::total_cmp);
    let quantile = |share: f64| all.get((share * all.len().saturating_sub(1) as f64) as usize).copied();
    let (from, to) = (quantile(0.02)?, quantile(0.98)?);
    let near = all.iter().filter(|value| (from - (to - from)..=to + (to - from)).contains(*value));
    let (least, most) = near.fold((to, from), |(least, most), value| (value.min(least), value.max(most)));
    let (low, high) = (least - (most - least), most + (most - least));
    let is_fault = |value: &f64| !(low..=high).contains(value);
    let faults = all.iter().filter(|value| is_fault(value)).count();
    let lasts = |values: &Vec<f64>| values.windows(4).any(|rows| rows.iter().all(is_fault));
    let are_faults = low < high && faults > 0 && 50 * faults <= all.len() && !of_runs.iter().any(lasts);
    are_faults.then_some((low, high, faults))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 20 to 29.9 in a run of a hundred rows and back in another one, with 85 twice in a row and −127 once: apart by 9.9, so that 10.1 to 39.8 can be.
    #[test]
    fn faults_of_a_thermometer_by_hand() {
        let mut runs =
            [0, 1].map(|run| (0..100).map(|i| 20.0 + 0.1 * f64::from(if run == 0 { i } else { 99 - i })).collect());
        assert_eq!(plausible(&runs), None);
        let set = |runs: &mut [Vec<f64>; 2], run: usize, rows: std::ops::Range<usize>, value: f64| {
            runs[run][rows].fill(value)
        };
        set(&mut runs, 0, 40..42, 85.0);
        set(&mut runs, 1, 70..71, -127.0);
        let (low, high, faults) = plausible(&runs).unwrap();
        assert!((low - 10.1).abs() < 1e-9 && (high - 39.8).abs() < 1e-9 && faults == 3, "{low} {high} {faults}");
        // What lasts is no fault, and neither is what is frequent.
        set(&mut runs, 0, 40..44, 85.0);
        assert_eq!(plausible(&runs), None);
        assert_eq!(plausible(&[vec![5.0; 100]]), None);
    }
}
