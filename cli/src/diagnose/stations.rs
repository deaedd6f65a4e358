//! Runs of one station share one heading: how far apart their azimuths are, where nobody surveyed it.

use north_finder::units::wrap_180_deg;

use super::statistics::rms;
use crate::run_data::RunData;

/// Every run's azimuth less the mean of its station's, degrees, times √(n/(n − 1)) of n runs: what it would miss a surveyed heading by. `None` for
/// a run with a reference, without an azimuth, or alone.
pub fn apart_deg(runs: &[RunData], azimuths_deg: &[Option<f64>]) -> Vec<Option<f64>> {
    let of_run = |(run, own): (&RunData, &Option<f64>)| {
        let station = run.station.as_ref().filter(|_| run.reference_deg.is_none())?;
        let own_deg = (*own)?;
        let others: Vec<f64> = runs
            .iter()
            .zip(azimuths_deg)
            .filter(|(other, _)| other.station.as_ref() == Some(station))
            .filter_map(|(_, azimuth)| Some(wrap_180_deg((*azimuth)? - own_deg)))
            .collect();
        let count = others.len() as f64;
        (count > 1.0).then(|| -others.iter().sum::<f64>() / count * (count / (count - 1.0)).sqrt())
    };
    runs.iter().zip(azimuths_deg).map(of_run).collect()
}

/// Root mean square of that; `None` where no two runs were made at one station.
pub fn spread_deg(runs: &[RunData], azimuths_deg: &[Option<f64>]) -> Option<f64> {
    let apart: Vec<f64> = apart_deg(runs, azimuths_deg).into_iter().flatten().collect();
    (!apart.is_empty()).then(|| rms(&apart))
}

/// By how much every run misses its reference, or the others of its station, degrees.
pub fn misses_deg(runs: &[RunData], azimuths_deg: &[Option<f64>]) -> Vec<Option<f64>> {
    let of_reference = |(run, own): (&RunData, &Option<f64>)| Some(wrap_180_deg((*own)? - run.reference_deg?));
    let apart = apart_deg(runs, azimuths_deg);
    runs.iter().zip(azimuths_deg).map(of_reference).zip(apart).map(|(miss, apart)| miss.or(apart)).collect()
}
