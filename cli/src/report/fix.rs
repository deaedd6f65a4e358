//! The pages of `north find --report` and `north solve --report`: the azimuth, the dwells against the curve that the Earth's rate makes of the index angle, the
//! seconds that they are made of, and the azimuths of all runs.

use north_finder::earth::EarthRate;
use north_finder::event::{Dwell, Fix};
use north_finder::fix::DesignRow;
use north_finder::health::Flag;
use north_finder::sensing::index::Direction;
use north_finder::sensing::level::Specific;
use north_finder::units::{sin_cos_deg, wrap_180_deg, wrap_360_deg};

use super::dial::{Hand, dial};
use super::{Axis, Canvas, Legend, Plot, Side, escape, figure, head, number, page, table, tile, with_sigma};
use crate::campaign::{Own, Row};
use crate::count::counted;
use crate::present::{Directions, Reference};

const HEIGHT: f64 = 250.0;
/// Runs that are drawn one by one; the table has all.
const DRAWN: usize = 12;

/// A fix, and what is known beside it.
pub struct Shown<'a> {
    pub name: &'a str,
    pub fix: &'a Fix,
    pub dwells: &'a [Dwell],
    /// The Earth's rate at the site; `None` where the latitude is none to find north at.
    pub earth: Option<EarthRate>,
    pub reference: Option<Reference>,
}

/// The page about one fix with its seconds; `about` says of what it is.
pub fn one(shown: &Shown<'_>, rows: &[Row], directions: &Directions, about: &[String]) -> String {
    let title = format!("North found: {}", shown.name);
    let body = [
        head(&title, about, &result(shown.fix, directions)),
        tiles(shown, directions),
        rose(shown, directions),
        dwells(shown),
        seconds(rows),
        dwells_table(shown.dwells),
        flags(shown.fix),
    ];
    page(&title, &body.concat())
}

/// The page about all runs of a campaign; `refused` are the runs without an azimuth, with the reason.
pub fn all(title: &str, runs: &[Shown<'_>], refused: &[(String, String)], directions: &Directions) -> String {
    let result = format!("an azimuth in {} of {}", runs.len(), counted(runs.len() + refused.len(), "run"));
    let mut body = head(title, &[], &result);
    body += &azimuths(runs);
    body += &runs_table(runs, refused, directions);
    for shown in runs.iter().take(DRAWN) {
        body += &format!("<h2>{}</h2>\n", escape(shown.name));
        body += &tiles(shown, directions);
        body += &dwells(shown);
        body += &flags(shown.fix);
    }
    if runs.len() > DRAWN {
        body += &format!("<p class=\"soft\">The first {DRAWN} runs are drawn; the table above has all.</p>\n");
    }
    page(title, &body)
}

/// The azimuth in a sentence, as it was asked for.
pub fn result(fix: &Fix, directions: &Directions) -> String {
    let unit = directions.unit();
    format!("Azimuth of the mark {} ± {}", unit.azimuth(fix.azimuth_deg), unit.sigma(fix.sigma_deg))
}

/// The few numbers that carry the result.
fn tiles(shown: &Shown<'_>, directions: &Directions) -> String {
    let fix = shown.fix;
    let mut html = String::from("<div class=\"tiles\">\n");
    if let Some(Reference { name, azimuth_deg }) = shown.reference {
        let error_deg = wrap_180_deg(fix.azimuth_deg - azimuth_deg);
        let sigmas = error_deg.abs() / fix.sigma_deg;
        html += &tile(
            "Error of the azimuth",
            &format!("{}° ({sigmas:.1} sigma)", number(error_deg, 3)),
            &format!("{name} azimuth {}; 95 % of errors are below 1.96 sigma", directions.unit().azimuth(azimuth_deg)),
        );
    }
    let expected = shown
        .earth
        .map_or(String::new(), |earth| format!("; the Earth's here is {} °/h", number(earth.north_deg_h, 5)));
    html += &tile(
        "Horizontal rate found",
        &format!("{} °/h", number(fix.amplitude_deg_h, 5)),
        &format!("bias {} °/h{expected}", number(fix.bias_deg_h, 4)),
    );
    let closure = match (fix.closure_deg_h, fix.closure_sigma_deg_h) {
        (Some(closure), Some(sigma)) => format!("{} °/h", with_sigma(closure, Some(sigma))),
        _ => "none".into(),
    };
    let meaning = match fix.closure_deg_h {
        Some(_) => "by how much the directions contradict each other; 0 within its sigma when all is well",
        None => "by how much the directions contradict each other: too few of them differ to tell it",
    };
    html += &tile("Closure", &closure, meaning);
    html += &tile(
        "Fit of the dwells",
        &format!("χ² {:.1}", fix.chi_square),
        &format!("its mean is the number of degrees of freedom, {}", fix.degrees_of_freedom),
    );
    let flags: Vec<&str> = fix.flags.iter().map(Flag::name).collect();
    let flags = if flags.is_empty() { "none".to_owned() } else { flags.join(", ") };
    html += &tile("Flags", &escape(&flags), &format!("measured for {:.0} s", fix.seconds));
    html + "</div>\n"
}

/// The mark, the target and what is known to be true, from above.
pub fn rose(shown: &Shown<'_>, directions: &Directions) -> String {
    let mut hands = Vec::new();
    if let Some(Reference { name, azimuth_deg }) = shown.reference {
        hands.push(Hand { class: "reference", name, azimuth_deg });
    }
    if let Some(target_deg) = directions.target_azimuth_deg(shown.fix.azimuth_deg) {
        hands.push(Hand { class: "before", name: "target", azimuth_deg: target_deg });
    }
    hands.push(Hand { class: "after", name: "mark", azimuth_deg: shown.fix.azimuth_deg });
    // Of names that would be written over each other, the later one stays.
    for i in 1..hands.len() {
        for earlier in 0..i {
            if wrap_180_deg(hands[earlier].azimuth_deg - hands[i].azimuth_deg).abs() < 12.0 {
                hands[earlier].name = "";
            }
        }
    }
    dial(&hands, "Directions from above, true north upwards.")
}

/// What the fix makes of an index angle, °/h: by the same row as the solution.
fn predicted_deg_h(fix: &Fix, earth: Option<EarthRate>, index_deg: f64) -> f64 {
    let level = fix.tilt.map(|tilt| {
        let ((sin_pitch, cos_pitch), (sin_roll, _)) = (sin_cos_deg(tilt.pitch_deg), sin_cos_deg(tilt.roll_deg));
        Specific { forward: sin_pitch, left: sin_roll * cos_pitch }
    });
    let row = DesignRow::new(Direction::of_deg(index_deg), level, &earth.unwrap_or_default());
    let (sin, cos) = sin_cos_deg(fix.azimuth_deg);
    fix.amplitude_deg_h * (row.cos * cos + row.sin * sin) + row.vertical_deg_h + fix.bias_deg_h
}

/// Mean rates of the dwells over the index angle, with the curve, and what they differ from it by.
pub fn dwells(shown: &Shown<'_>) -> String {
    let (fix, earth) = (shown.fix, shown.earth);
    let dwells: Vec<(f64, &Dwell)> = shown.dwells.iter().map(|dwell| (wrap_360_deg(dwell.index_deg), dwell)).collect();
    let ticks = |canvas: Canvas| {
        let step = if canvas.narrow { 90 } else { 45 };
        (0..=360).step_by(step).map(|angle| (angle.into(), angle.to_string())).collect::<Vec<_>>()
    };
    let draw = |canvas: Canvas| {
        let curve = || (0..=180).map(|i| 2.0 * f64::from(i)).map(|angle| (angle, predicted_deg_h(fix, earth, angle)));
        let x = || Axis::exact("index angle of the gyro, °", -6.0, 366.0);
        let values = curve().map(|(_, rate)| rate).chain(dwells.iter().map(|(_, dwell)| dwell.rate_deg_h));
        let mut rates = Plot::new(canvas.width, HEIGHT, x(), Axis::linear("mean rate, °/h", values));
        rates.line("reference", curve());
        rates.dots(Side::After, dwells.iter().map(|(angle, dwell)| (*angle, dwell.rate_deg_h)));
        let off = |angle: f64, dwell: &Dwell| {
            (dwell.rate_deg_h - predicted_deg_h(fix, earth, angle), known(dwell.sigma_deg_h))
        };
        let ends = dwells.iter().flat_map(|(angle, dwell)| {
            let (off, sigma) = off(*angle, dwell);
            [off - sigma, off + sigma]
        });
        let mut residuals =
            Plot::new(canvas.width, HEIGHT, x(), Axis::linear("dwell less curve, °/h", ends.chain([0.0])));
        residuals.level("zero", 0.0);
        residuals.bars(
            "bar after",
            dwells.iter().map(|(angle, dwell)| {
                let (off, sigma) = off(*angle, dwell);
                (*angle, off - sigma, off + sigma)
            }),
        );
        residuals.dots(Side::After, dwells.iter().map(|(angle, dwell)| (*angle, off(*angle, dwell).0)));
        for plot in [&mut rates, &mut residuals] {
            plot.x_ticks(ticks(canvas));
        }
        vec![rates, residuals]
    };
    figure(
        Legend::Named(&[("line after", "mean of a dwell, ± 1 sigma of its seconds"), ("reference", "the fix")]),
        "mean rates of the dwells over the index angle",
        "Above: the Earth's rate turns with the index angle; the azimuth is where the curve is highest. Below: what the dwells differ from the curve by; \
         a drift within the fix shows here, too.",
        draw,
    )
}

/// A standard deviation that is known, or 0.
fn known(sigma: f64) -> f64 {
    if sigma.is_finite() { sigma } else { 0.0 }
}

/// All seconds of a fix over time.
fn seconds(rows: &[Row]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let in_dwell =
        |row: &&Row| matches!(row.own, Some(Own::Second { mark, .. } | Own::Raw { mark, .. }) if mark.dwell.is_some());
    let rate = |row: &Row| (row.t_s, row.fog_arcsec / row.interval_s);
    let draw = |canvas: Canvas| {
        let (from_s, to_s) = (rows[0].t_s, rows[rows.len() - 1].t_s);
        let time = || Axis::exact("time, s", from_s, to_s.max(from_s + 1.0));
        // What the gyro reads while it is turned is far out of the drawing.
        let kept = rows.iter().filter(in_dwell).map(|row| rate(row).1);
        let mut rates = Plot::new(canvas.width, HEIGHT, time(), Axis::linear("rate of a second, °/h", kept));
        rates.specks(Side::Before, rows.iter().filter(|row| !in_dwell(row)).map(rate));
        rates.specks(Side::After, rows.iter().filter(in_dwell).map(rate));
        let index = || rows.iter().map(|row| (row.t_s, row.index_deg));
        let mut angles =
            Plot::new(canvas.width, 190.0, time(), Axis::linear("index angle, °", index().map(|(_, angle)| angle)));
        angles.line("line after", index());
        vec![rates, angles]
    };
    figure(
        Legend::Marks(&[
            (Side::After, "seconds of a dwell"),
            (Side::Before, "other seconds: waiting, turning, settling"),
        ]),
        "rates and index angle over time",
        "The gyro's rate in every second before the error model, and the index angle below it.",
        draw,
    )
}

/// Azimuths of the runs less their references, or, without any, less the first.
fn azimuths(runs: &[Shown<'_>]) -> String {
    let Some(first) = runs.first() else { return String::new() };
    let compared = runs.iter().any(|shown| shown.reference.is_some());
    let error = |shown: &Shown<'_>| match (compared, shown.reference) {
        (true, Some(reference)) => Some(wrap_180_deg(shown.fix.azimuth_deg - reference.azimuth_deg)),
        (true, None) => None,
        (false, _) => Some(wrap_180_deg(shown.fix.azimuth_deg - first.fix.azimuth_deg)),
    };
    let points: Vec<(f64, f64, f64)> = (1..)
        .zip(runs)
        .filter_map(|(number, shown)| Some((f64::from(number), error(shown)?, shown.fix.sigma_deg)))
        .collect();
    let (label, caption) = match compared {
        true => ("azimuth error, °", "Azimuth less reference; bars are ± 1 sigma as each fix states it."),
        false => (
            "azimuth less the first, °",
            "No run has a reference: azimuths less that of the first; bars are ± 1 sigma as each fix states it.",
        ),
    };
    figure(Legend::None, "azimuths of the runs", caption, |canvas| {
        let ends = points.iter().flat_map(|(_, value, sigma)| [value - sigma, value + sigma]);
        let x = Axis::exact("run", 0.4, runs.len() as f64 + 0.6);
        let mut plot = Plot::new(canvas.width, HEIGHT, x, Axis::linear(label, ends.chain([0.0])));
        let every = runs.len().div_ceil(if canvas.narrow { 6 } else { 16 });
        plot.x_ticks((1..=runs.len()).step_by(every).map(|run| (run as f64, run.to_string())).collect());
        plot.level("zero", 0.0);
        plot.bars("bar after", points.iter().map(|(run, value, sigma)| (*run, value - sigma, value + sigma)));
        plot.dots(Side::After, points.iter().map(|(run, value, _)| (*run, *value)));
        vec![plot]
    })
}

fn runs_table(runs: &[Shown<'_>], refused: &[(String, String)], directions: &Directions) -> String {
    let unit = directions.unit();
    let solved = runs.iter().map(|shown| {
        let flags: Vec<&str> = shown.fix.flags.iter().map(Flag::name).collect();
        vec![
            escape(shown.name),
            format!("{} ± {}", unit.azimuth(shown.fix.azimuth_deg), unit.sigma(shown.fix.sigma_deg)),
            shown.reference.map_or("–".into(), |reference| unit.azimuth(reference.azimuth_deg)),
            escape(&flags.join(", ")),
        ]
    });
    let others = refused.iter().map(|(name, why)| vec![escape(name), "none".into(), "–".into(), escape(why)]);
    let rows: Vec<Vec<String>> = solved.chain(others).collect();
    table(
        &[("run", false), ("azimuth", true), ("reference", true), ("flags, or why there is no azimuth", false)],
        &rows,
    )
}

pub fn dwells_table(dwells: &[Dwell]) -> String {
    let rows: Vec<Vec<String>> = dwells
        .iter()
        .map(|dwell| {
            vec![
                (u32::from(dwell.position) + 1).to_string(),
                format!("{:.3}", dwell.index_deg),
                format!("{:.0}", dwell.seconds),
                format!("{:.5}", dwell.rate_deg_h).replace('-', "−"),
                if dwell.sigma_deg_h.is_finite() { format!("{:.5}", dwell.sigma_deg_h) } else { "–".into() },
            ]
        })
        .collect();
    let head = [
        ("position", false),
        ("index angle, °", true),
        ("seconds", true),
        ("mean rate, °/h", true),
        ("sigma, °/h", true),
    ];
    format!(
        "<details open><summary>The {} in numbers</summary>\n{}</details>\n",
        counted(rows.len(), "dwell"),
        table(&head, &rows)
    )
}

/// What limits the trust in the fix, with what to do about it.
pub fn flags(fix: &Fix) -> String {
    if fix.flags.is_empty() {
        return String::new();
    }
    let items: String = fix
        .flags
        .iter()
        .map(|flag| {
            format!(
                "<li><code>{}</code>: {}. To do: {}.</li>",
                flag.name(),
                escape(flag.meaning()),
                escape(flag.remedy())
            )
        })
        .collect();
    format!("<div class=\"note\"><p>What limits the trust in it:</p><ul>{items}</ul></div>\n")
}

#[cfg(test)]
mod tests {
    use north_finder::earth::earth_rate;
    use north_finder::event::Fix;
    use north_finder::health::Flags;
    use north_finder::sensing::level::Tilt;

    use super::*;

    /// Azimuth 0, level: at index 0 the gyro points north and reads h + bias, at 90 west and reads the bias. A pitch p turns the axis at index 0 up:
    /// h cos p + Ω sin φ sin p more.
    #[test]
    fn the_curve_by_hand() {
        let fix = |tilt| Fix {
            azimuth_deg: 0.0,
            sigma_deg: 0.01,
            closure_deg_h: None,
            closure_sigma_deg_h: None,
            chi_square: 0.0,
            degrees_of_freedom: 0,
            bias_deg_h: 0.5,
            amplitude_deg_h: 10.0,
            drift_deg_h_per_h: 0.0,
            tilt,
            seconds: 240.0,
            flags: Flags::default(),
        };
        let earth = earth_rate(30.0).ok();
        let at = |tilt, index| predicted_deg_h(&fix(tilt), earth, index);
        assert!((at(None, 0.0) - 10.5).abs() < 1e-12 && (at(None, 90.0) - 0.5).abs() < 1e-12);
        // sin 30° = 0.5: Ω sin φ = 7.5205335 °/h; pitch 30°.
        let tilted = at(Some(Tilt { pitch_deg: 30.0, roll_deg: 0.0 }), 0.0);
        assert!((tilted - (10.0 * 0.8660254 + 7.5205335 * 0.5 + 0.5)).abs() < 1e-6, "{tilted}");
    }
}
