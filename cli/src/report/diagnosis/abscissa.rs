//! What a residual is drawn against, to show the effect that was found in it.

use north_finder::units::{ARCSEC_PER_RAD, sin_cos_deg, wrap_180_deg};

use crate::diagnose::{Effect, RunSeries};

/// The index has moved when it differs by more than this, degrees.
const MOVED_DEG: f64 = 0.5;
/// Rates of change are taken over so many seconds on either side.
const SLOPE_S: f64 = 5.0;

/// Points of one run: what it is drawn against, the residual before, the residual after.
pub type Points = Vec<[f64; 3]>;

/// What a residual is drawn against.
#[derive(Clone, Debug, PartialEq)]
pub enum Abscissa {
    Channel(String),
    ChannelRate(String),
    /// Tilt rate about the gyro's axis, dwell by dwell.
    TiltRate,
    Index,
    SinceMove,
    Time,
}

impl Abscissa {
    /// For an effect; `None` where no residual of a run can show it (a constant error of the azimuth).
    pub fn of(effect: &Effect) -> Option<Self> {
        let name = effect.name.as_str();
        Some(match (&effect.channel, effect.kind) {
            (_, "base-motion" | "level-drift") => Self::TiltRate,
            (_, "azimuth") => return None,
            (Some(channel), _) if name.contains("-rate") => Self::ChannelRate(channel.clone()),
            (Some(channel), _) => Self::Channel(channel.clone()),
            (None, "index" | "scale") => Self::Index,
            _ if name.contains("harmonic") => Self::Index,
            _ if name.starts_with("settling") => Self::SinceMove,
            _ => Self::Time,
        })
    }

    /// The axis' label, with its unit as far as a column's name tells it.
    pub fn label(&self) -> String {
        match self {
            Self::Channel(channel) => unit_of(channel).map_or(channel.clone(), |unit| format!("{channel}, {unit}")),
            Self::ChannelRate(channel) => match unit_of(channel) {
                Some(unit) => format!("rate of change of {channel}, {unit}/s"),
                None => format!("rate of change of {channel}, per second"),
            },
            Self::TiltRate => "tilt rate about the gyro's axis, °/h".into(),
            Self::Index => "index angle, °".into(),
            Self::SinceMove => "time since the index moved, s".into(),
            Self::Time => "time since the run's start, s".into(),
        }
    }

    /// Points of a run; none if it lacks the channel.
    pub fn points(&self, run: &RunSeries) -> Points {
        match self {
            Self::Channel(channel) => run.channels.get(channel).map_or_else(Vec::new, |values| join(values, run)),
            Self::ChannelRate(channel) => {
                run.channels.get(channel).map_or_else(Vec::new, |values| join(&slopes(&run.t_s, values), run))
            }
            Self::TiltRate => tilt_rates(run),
            Self::Index => join(&run.index_deg.iter().map(|angle| angle.rem_euclid(360.0)).collect::<Vec<_>>(), run),
            Self::SinceMove => join(&since_moves(run), run),
            Self::Time => join(&run.t_s, run),
        }
    }
}

/// The unit that the end of a column's name tells.
fn unit_of(channel: &str) -> Option<&'static str> {
    let (_, suffix) = channel.rsplit_once('_')?;
    Some(match suffix {
        "c" => "°C",
        "g" => "g",
        "v" => "V",
        "a" => "A",
        "w" => "W",
        "hz" => "Hz",
        "nt" => "nT",
        "ut" => "µT",
        "hpa" => "hPa",
        "deg" => "°",
        _ => return None,
    })
}

fn join(values: &[f64], run: &RunSeries) -> Points {
    let residuals = run.residual_before_deg_h.iter().zip(&run.residual_after_deg_h);
    values.iter().zip(residuals).map(|(&x, (&before, &after))| [x, before, after]).filter(finite).collect()
}

fn finite(point: &[f64; 3]) -> bool {
    point.iter().all(|value| value.is_finite())
}

/// Slope of the least-squares line.
fn slope(t_s: &[f64], values: &[f64]) -> Option<f64> {
    let count = t_s.len().min(values.len()) as f64;
    let (mean_t, mean_v) = (t_s.iter().sum::<f64>() / count, values.iter().sum::<f64>() / count);
    let (mut above, mut below) = (0.0, 0.0);
    for (t, value) in t_s.iter().zip(values) {
        above += (t - mean_t) * (value - mean_v);
        below += (t - mean_t) * (t - mean_t);
    }
    (below > 0.0).then(|| above / below)
}

/// Rates of change by the line through the neighbours.
fn slopes(t_s: &[f64], values: &[f64]) -> Vec<f64> {
    let (mut first, mut last) = (0, 0);
    t_s.iter()
        .map(|&t| {
            while t_s.get(first).is_some_and(|&earlier| earlier < t - SLOPE_S) {
                first += 1;
            }
            while t_s.get(last).is_some_and(|&later| later <= t + SLOPE_S) {
                last += 1;
            }
            let (times, values) = (t_s.get(first..last), values.get(first..last));
            times.zip(values).and_then(|(times, values)| slope(times, values)).unwrap_or(f64::NAN)
        })
        .collect()
}

/// Ranges of rows in which the index dwells.
fn dwells(run: &RunSeries) -> Vec<std::ops::Range<usize>> {
    let mut dwells = Vec::new();
    let mut start = 0;
    for (i, pair) in run.index_deg.windows(2).enumerate() {
        if let [here, next] = pair
            && wrap_180_deg(next - here).abs() > MOVED_DEG
        {
            dwells.push(start..i + 1);
            start = i + 1;
        }
    }
    dwells.push(start..run.index_deg.len());
    dwells
}

fn since_moves(run: &RunSeries) -> Vec<f64> {
    let mut since = Vec::with_capacity(run.t_s.len());
    for dwell in dwells(run) {
        let times = run.t_s.get(dwell).unwrap_or_default();
        let start = times.first().copied().unwrap_or_default();
        since.extend(times.iter().map(|t| t - start));
    }
    since
}

/// One point a dwell: a base that tilts adds cos θ · dr/dt − sin θ · dp/dt to what the gyro reads; with small angles
/// pitch is ax and roll is ay.
fn tilt_rates(run: &RunSeries) -> Points {
    let (Some(forward), Some(left)) = (run.channels.get("ax_g"), run.channels.get("ay_g")) else { return Vec::new() };
    // A second that was left out has no residual.
    let mean = |values: &[f64]| {
        let kept = values.iter().filter(|value| value.is_finite());
        kept.clone().sum::<f64>() / kept.count() as f64
    };
    let point = |dwell: std::ops::Range<usize>| {
        let times = run.t_s.get(dwell.clone())?;
        let pitch_rate = slope(times, forward.get(dwell.clone())?)?;
        let roll_rate = slope(times, left.get(dwell.clone())?)?;
        let (sin, cos) = sin_cos_deg(*run.index_deg.get(dwell.start)?);
        // rad/s to arcsec/s, which is °/h.
        let tilt_rate = (cos * roll_rate - sin * pitch_rate) * ARCSEC_PER_RAD;
        let before = mean(run.residual_before_deg_h.get(dwell.clone())?);
        let after = mean(run.residual_after_deg_h.get(dwell)?);
        Some([tilt_rate, before, after]).filter(finite)
    };
    dwells(run).into_iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> RunSeries {
        let t_s: Vec<f64> = (0..20).map(f64::from).collect();
        let channel = |f: &dyn Fn(f64) -> f64| t_s.iter().map(|&t| f(t)).collect::<Vec<f64>>();
        RunSeries {
            file: "runs/001.csv".into(),
            seconds: vec![1.0; 20],
            index_deg: t_s.iter().map(|&t| if t < 10.0 { 0.0 } else { 90.0 }).collect(),
            residual_before_deg_h: vec![1.0; 20],
            residual_after_deg_h: vec![0.0; 20],
            // Rolling by 1 µrad/s, pitching by 2 µrad/s.
            channels: [
                ("ax_g".to_owned(), channel(&|t| 2e-6 * t)),
                ("ay_g".to_owned(), channel(&|t| 1e-6 * t)),
                ("supply_v".to_owned(), channel(&|t| 5.0 - 0.1 * t)),
            ]
            .into(),
            t_s,
        }
    }

    #[test]
    fn tilt_rates_have_the_sign_of_the_conventions() {
        let points = Abscissa::TiltRate.points(&run());
        // 1 µrad/s is 0.206265 arcsec/s.
        let [at_0, at_90] = points[..] else { panic!("{points:?}") };
        assert!((at_0[0] - 0.206265).abs() < 1e-6 && (at_90[0] + 2.0 * 0.206265).abs() < 1e-6, "{points:?}");
    }

    #[test]
    fn times_since_moves_and_rates_of_change() {
        assert_eq!(Abscissa::SinceMove.points(&run())[12][0], 2.0);
        let rates = Abscissa::ChannelRate("supply_v".into()).points(&run());
        assert!(rates.iter().all(|point| (point[0] + 0.1).abs() < 1e-12));
        assert!(Abscissa::Channel("other".into()).points(&run()).is_empty());
    }
}
