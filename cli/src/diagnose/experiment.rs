//! The next experiment: which orders, headings and durations tell ambiguous effects apart, by the design matrix.

use north_finder::units::wrap_360_deg;

use super::block::Block;
use super::candidate::Candidate;
use super::data::{Cell, RunData};
use super::result::Experiment;
use super::statistics::{dot, orthonormalise};

/// Seconds of a move.
const MOVE_S: usize = 5;

/// Orders that are weighed against each other.
const ORDERS: [(&str, &[f64]); 4] = [
    ("the mirrored order", &[0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0]),
    ("the plain order", &[0.0, 90.0, 180.0, 270.0]),
    ("eight positions out of order", &[0.0, 135.0, 270.0, 45.0, 180.0, 315.0, 90.0, 225.0]),
    ("six positions there and back", &[0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 240.0, 120.0, 0.0, 180.0]),
];

/// Proposes runs that separate `effect` (its candidate and constant) from its `rivals` best; `None` where no rival is known.
pub fn propose(
    like: &RunData,
    runs: &[&RunData],
    effect: (&Candidate, f64),
    rivals: &[(&Candidate, f64)],
) -> Option<Experiment> {
    if rivals.is_empty() {
        return None;
    }
    let now = separation(runs, effect, rivals);
    let length_s = like.cells.last().map_or(240.0, |cell| cell.t_s).max(60.0);
    let mut best: Option<(f64, &str, &[f64], usize, f64)> = None;
    for (name, order) in ORDERS {
        for headings in [1, 4, 8] {
            for stretch in [1.0, 3.0] {
                let dwell_s = (stretch * length_s / order.len() as f64 - MOVE_S as f64).max(10.0).round();
                let designed: Vec<RunData> = (0..headings)
                    .map(|i| design(like, order, dwell_s, 22.5 + 360.0 * i as f64 / headings as f64))
                    .collect();
                let found = separation(&designed.iter().collect::<Vec<_>>(), effect, rivals);
                // Longer and more must pay for itself.
                let price = 0.01 * (headings as f64).ln() + 0.02 * (stretch - 1.0);
                if best.is_none_or(|(merit, ..)| found - price > merit) {
                    best = Some((found - price, name, order, headings, dwell_s));
                }
            }
        }
    }
    let (_, name, order, headings, dwell_s) = best?;
    let headings_deg: Vec<f64> =
        (0..headings).map(|i| wrap_360_deg(22.5 + 360.0 * i as f64 / headings as f64)).collect();
    let designed: Vec<RunData> = headings_deg.iter().map(|&each| design(like, order, dwell_s, each)).collect();
    let then = separation(&designed.iter().collect::<Vec<_>>(), effect, rivals);
    let separates: Vec<String> =
        std::iter::once(effect.0).chain(rivals.iter().map(|rival| rival.0)).map(|each| each.name.clone()).collect();
    let surveyed = if headings > 1 { "surveyed headings" } else { "heading (surveyed)" };
    Some(Experiment {
        description: format!(
            "{name} ({}), {dwell_s:.0} s at each position, at {headings} {surveyed}: {}; it separates {} (share of the \
             effect that the others cannot imitate: {:.0} % instead of {:.0} %)",
            order.iter().map(|angle| format!("{angle:.0}")).collect::<Vec<_>>().join("-"),
            headings_deg.iter().map(|angle| format!("{angle:.1}")).collect::<Vec<_>>().join(", "),
            separates.join(" from "),
            100.0 * then,
            100.0 * now
        ),
        order_deg: order.to_vec(),
        headings_deg,
        dwell_s,
        separates,
        separation_now: now,
        separation_then: then,
    })
}

/// A run that has not been made: the order, seconds, the channels as they went in the run that it is like.
fn design(like: &RunData, order: &[f64], dwell_s: f64, heading_deg: f64) -> RunData {
    let mut run = like.clone();
    run.reference_deg = Some(heading_deg);
    run.noise_deg_h = Some(1.0);
    run.rotation = false;
    run.cells.clear();
    run.channels.iter_mut().for_each(Vec::clear);
    let usual = like.cells.len().max(1);
    let (psi, north) = (heading_deg.to_radians(), like.earth.north_deg_h);
    let mut t_s = 0.0;
    for (stay, angle) in order.iter().enumerate() {
        t_s += MOVE_S as f64;
        let (sin, cos) = angle.to_radians().sin_cos();
        for _ in 0..dwell_s as usize {
            let Some(source) = like.cells.get((t_s as usize).min(usual - 1)) else { continue };
            let raw_deg_h = north * (psi.cos() * cos + psi.sin() * sin);
            t_s += 1.0;
            let place =
                Cell { t_s: t_s - 0.5, seconds: 1.0, raw_deg_h, cos, sin, moving: false, stay, ..source.clone() };
            run.cells.push(place);
            for (channel, values) in run.channels.iter_mut().zip(&like.channels) {
                channel.push(values[(t_s as usize).min(values.len() - 1)]);
            }
        }
    }
    run
}

/// Share of the effect's columns, beside every run's own azimuth and bias, that no rival can imitate; the smallest over
/// the rivals.
fn separation(runs: &[&RunData], effect: (&Candidate, f64), rivals: &[(&Candidate, f64)]) -> f64 {
    let blocks: Vec<Block> = runs.iter().filter_map(|run| Block::new(run, true, None)).collect();
    let problem = super::problem::Problem::new(blocks);
    let own = problem.projected(effect.0, effect.1);
    let whole: f64 = own.iter().map(|column| dot(column, column)).sum();
    let seen: f64 = problem.weighted(effect.0, effect.1).iter().map(|column| dot(column, column)).sum();
    // An effect of which the azimuth and the bias take all but nothing is not seen at all.
    if !(whole > 1e-6 * seen) {
        return 0.0;
    }
    rivals
        .iter()
        .map(|(rival, constant)| {
            let basis = orthonormalise(&[], problem.projected(rival, *constant));
            let imitated: f64 =
                own.iter().map(|column| basis.iter().map(|each| dot(column, each).powi(2)).sum::<f64>()).sum();
            (1.0 - imitated / whole).max(0.0)
        })
        .fold(1.0, f64::min)
}
