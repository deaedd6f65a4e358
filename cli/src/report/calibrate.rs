//! The pages of `north calibrate … --report`: what the readings differ from the calibration by, and its parameters with their sigmas.

use std::path::Path;

use calibration::ellipsoid::{Correction, Role};
use calibration::six_position;
use north_finder::earth::{EarthRate, earth_rate};

use super::{Axis, Canvas, Legend, Plot, Side, escape, figure, head, number, page, short, table, tile, with_sigma};
use crate::calibrate::{ellipsoid, known_attitudes, six_position as positions};
use crate::count::counted;

const AXES: [&str; 3] = ["x", "y", "z"];
const HEIGHT: f64 = 230.0;

/// What one attitude shows: its name, and the norm of its specific force less gravity, before and after.
struct Norm {
    name: String,
    before: Option<f64>,
    after: f64,
    learned: bool,
}

/// An accelerometer triad in many attitudes.
pub fn ellipsoid(path: &Path, outcome: &ellipsoid::Outcome, gravity: f64) -> String {
    let calibration = &outcome.calibration;
    let [fitted, judged] = [Role::Fit, Role::Check].map(|role| outcome.count(role));
    let norms: Vec<Norm> = outcome
        .dwells
        .iter()
        .zip(&outcome.roles)
        .filter(|(_, role)| **role != Role::Invalid)
        .map(|(dwell, role)| Norm {
            name: short(dwell.number),
            before: Some(outcome.nominal.norm(dwell.attitude.mean) - gravity),
            after: calibration.correction.norm(dwell.attitude.mean) - gravity,
            learned: *role == Role::Fit,
        })
        .collect();
    let title = format!("Calibration of accelerometers: {}", path.display());
    let result = format!(
        "Norm at rest less gravity: {} rms before, {} after",
        number(outcome.norm_rms_before, 3),
        number(calibration.check_norm_rms.unwrap_or(calibration.norm_rms), 3)
    );
    let body = [
        head(&title, &[format!("{fitted} attitudes learned from, {judged} only judged")], &result),
        "<div class=\"tiles\">\n".to_owned(),
        tile(
            "Coverage of the sphere",
            &number(calibration.coverage, 3),
            "1: attitudes evenly all around; 1/64: the least that calibrates",
        ),
        tile(
            "Learned from, rms",
            &number(calibration.norm_rms, 3),
            &format!("in units of gravity = {}", short(gravity)),
        ),
        "</div>\n".to_owned(),
        norms_figure(&norms),
        correction(&calibration.correction, &calibration.sigma_bias, &calibration.sigma_matrix),
        rejected(&outcome.rejected),
    ];
    page(&title, &body.concat())
}

/// An accelerometer triad on its faces.
pub fn faces(path: &Path, outcome: &known_attitudes::Outcome, gravity: f64) -> String {
    let calibration = &outcome.calibration;
    let norms: Vec<Norm> = outcome
        .laid
        .iter()
        .map(|(dwell, face)| Norm {
            name: face.name().replace('-', "−"),
            before: None,
            after: outcome.correction.norm(dwell.attitude.mean) - gravity,
            learned: true,
        })
        .collect();
    let title = format!("Calibration of accelerometers: {}", path.display());
    let result = match calibration.closure.rms {
        Some(rms) => format!("{} closures: {} rms", calibration.closure.count, number(rms, 3)),
        None => "As many readings as parameters: nothing checks them".to_owned(),
    };
    let widened = match calibration.closure.widened {
        1.0 => "what is left is as large as the noise of the readings has it".to_owned(),
        factor => format!("more is left than noise and angles explain: sigmas are {factor:.1} times as wide for it"),
    };
    let body = [
        head(&title, &[format!("{} attitudes", outcome.laid.len())], &result),
        format!("<p>{}.</p>\n", escape(&capital(&widened))),
        norms_figure(&norms),
        correction(&outcome.correction, &calibration.sigma_bias, &outcome.sigma_matrix),
        rejected(&outcome.rejected),
    ];
    page(&title, &body.concat())
}

/// A gyro triad in known positions.
pub fn six_position(path: &Path, outcome: &positions::Outcome) -> String {
    let calibration = &outcome.calibration;
    let title = format!("Calibration of gyros: {}", path.display());
    let closure = &calibration.closure;
    let result = match (closure.rms_deg_h, closure.p_value) {
        (Some(rms), Some(p)) => format!("{} closures: {} °/h rms, probability {p:.3}", closure.count, number(rms, 3)),
        _ => "As many measurements as parameters: nothing checks them".to_owned(),
    };
    let body = [
        head(&title, &[format!("{} positions", outcome.visits.len())], &result),
        earth_rate(outcome.latitude_deg).map_or(String::new(), |earth| residuals(calibration, &outcome.visits, &earth)),
        biases(calibration, outcome),
        format!(
            "<h2>Output per true rate about x, y, z</h2>\n{}",
            matrix(&calibration.matrix, &calibration.sigma_matrix)
        ),
    ];
    page(&title, &body.concat())
}

/// Rates of every position less what the calibration makes of the Earth's.
fn residuals(calibration: &six_position::Calibration, visits: &[positions::Visit], earth: &EarthRate) -> String {
    let off = |visit: &positions::Visit, axis: usize| {
        let input = visit.position.axes.input_deg_h(earth);
        let expected: f64 = calibration.matrix[axis].iter().zip(input).map(|(gain, rate)| gain * rate).sum();
        let dwell = &visit.position.dwell;
        (dwell.rate_deg_h[axis] - calibration.bias_deg_h[axis] - expected, dwell.variance[axis].sqrt())
    };
    let draw = |canvas: Canvas| {
        (0..3)
            .map(|axis| {
                let points: Vec<(f64, f64, f64)> = (1..)
                    .zip(visits)
                    .map(|(number, visit)| {
                        let (off, sigma) = off(visit, axis);
                        (f64::from(number), off, sigma)
                    })
                    .collect();
                let ends = points.iter().flat_map(|(_, off, sigma)| [off - sigma, off + sigma]);
                let x = Axis::exact("position", 0.5, visits.len() as f64 + 0.5);
                let y = Axis::linear(format!("gyro {}, °/h", AXES[axis]), ends.chain([0.0]));
                let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
                plot.x_ticks((1..=visits.len()).map(|number| (number as f64, number.to_string())).collect());
                plot.level("zero", 0.0);
                plot.bars("bar after", points.iter().map(|(x, off, sigma)| (*x, off - sigma, off + sigma)));
                plot.dots(Side::After, points.iter().map(|(x, off, _)| (*x, *off)));
                plot
            })
            .collect()
    };
    let names: Vec<String> =
        (1..).zip(visits).map(|(number, visit)| format!("{number} {}", escape(&visit.name))).collect();
    let caption = format!(
        "Measured mean rate less that of the calibration; bars are ± 1 sigma of white noise. Positions: {}.",
        names.join(", ")
    );
    figure(Legend::None, "rates of the positions less the calibration", &caption, draw)
}

fn biases(calibration: &six_position::Calibration, outcome: &positions::Outcome) -> String {
    let rows: Vec<Vec<String>> = (0..3)
        .map(|axis| {
            vec![
                AXES[axis].to_owned(),
                with_sigma(calibration.bias_deg_h[axis], Some(calibration.sigma_bias_deg_h[axis])),
                outcome.published.map_or("–".into(), |by| number(by.bias_deg_h[axis], 5)),
            ]
        })
        .collect();
    let head = [("gyro", false), ("bias by least squares, °/h", true), ("by differences, °/h", true)];
    format!("<h2>Biases</h2>\n{}", table(&head, &rows))
}

fn norms_figure(norms: &[Norm]) -> String {
    let draw = |canvas: Canvas| {
        let values: Vec<(f64, &Norm)> = (1..).map(f64::from).zip(norms).collect();
        let mut plots = Vec::new();
        let both = values.iter().flat_map(|(_, norm)| [norm.before, Some(norm.after)]).flatten();
        let sides: &[bool] = if norms.iter().any(|norm| norm.before.is_some()) { &[true, false] } else { &[false] };
        for &with_before in sides {
            let after = values.iter().map(|(_, norm)| norm.after);
            let y: Vec<f64> = if with_before { both.clone().collect() } else { after.collect() };
            let x = Axis::exact("attitude", 0.2, norms.len() as f64 + 0.8);
            let mut plot =
                Plot::new(canvas.width, HEIGHT, x, Axis::linear("norm less gravity", y.into_iter().chain([0.0])));
            let every = norms.len().div_ceil(if canvas.narrow { 6 } else { 16 }).max(1);
            plot.x_ticks(values.iter().step_by(every).map(|(at, norm)| (*at, norm.name.clone())).collect());
            plot.level("zero", 0.0);
            if with_before {
                plot.dots(Side::Before, values.iter().filter_map(|(at, norm)| Some((*at, norm.before?))));
            } else if sides.len() > 1 {
                plot.corner("after, enlarged");
            }
            plot.dots(Side::After, values.iter().map(|(at, norm)| (*at, norm.after)));
            plots.push(plot);
        }
        plots
    };
    let judged: Vec<&str> = norms.iter().filter(|norm| !norm.learned).map(|norm| norm.name.as_str()).collect();
    let mut caption = "Norm of the specific force at rest less gravity, attitude by attitude.".to_owned();
    if !judged.is_empty() {
        caption += &format!(" Only judged, not learned from: {}.", judged.join(", "));
    }
    let legend = if norms.iter().any(|norm| norm.before.is_some()) {
        Legend::Marks(&[
            (Side::Before, "by one scale factor and bias an axis, from the ranges"),
            (Side::After, "calibrated"),
        ])
    } else {
        Legend::None
    };
    figure(legend, "norm of specific force less gravity", &caption, draw)
}

fn correction(correction: &Correction, sigma_bias: &[f64; 3], sigma_matrix: &[[f64; 3]; 3]) -> String {
    let rows: Vec<Vec<String>> = (0..3)
        .map(|axis| vec![AXES[axis].to_owned(), with_sigma(correction.bias[axis], Some(sigma_bias[axis]))])
        .collect();
    format!(
        "<h2>Biases</h2>\n{}<h2>Specific force per reading less bias</h2>\n{}",
        table(&[("axis", false), ("bias, readings", true)], &rows),
        matrix(&correction.matrix, sigma_matrix)
    )
}

fn matrix(values: &[[f64; 3]; 3], sigmas: &[[f64; 3]; 3]) -> String {
    let rows: Vec<Vec<String>> = (0..3)
        .map(|row| {
            let cells = values[row].iter().zip(sigmas[row]).map(|(value, sigma)| match sigma > 0.0 {
                true => with_sigma(*value, Some(sigma)),
                false => number(*value, 6),
            });
            std::iter::once(AXES[row].to_owned()).chain(cells).collect()
        })
        .collect();
    table(&[("", false), ("x", true), ("y", true), ("z", true)], &rows)
}

fn rejected(rejected: &[crate::calibrate::attitudes::Rejected]) -> String {
    if rejected.is_empty() {
        return String::new();
    }
    let items: String = rejected
        .iter()
        .map(|each| {
            let readings = counted(each.readings, "reading");
            format!("<li>attitude {}, {readings}: {}</li>", short(each.attitude), escape(each.why))
        })
        .collect();
    format!("<div class=\"note\"><p>Left out:</p><ul>{items}</ul></div>\n")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
