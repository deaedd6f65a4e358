//! The certificate of a fix: one page that prints well, with all that another needs to trust the azimuth, or not to.

use super::fix::{Shown, dwells_table, flags, rose};
use super::{escape, number, page, table, today, with_sigma};
use crate::count::counted;
use crate::present::{Directions, Reference};

/// What a certificate says beside the fix.
pub struct Made<'a> {
    /// Which instrument, with its firmware: a line each.
    pub instrument: &'a [(&'a str, String)],
    pub latitude_deg: f64,
    /// No instrument, but the simulator of one.
    pub simulated: bool,
}

/// 95 % of normal errors are less than so many standard deviations.
const SIGMAS_OF_95_PERCENT: f64 = 1.96;

/// The whole page.
pub fn html(shown: &Shown<'_>, made: &Made<'_>, directions: &Directions) -> String {
    let title = "Certificate of an azimuth";
    let body = [
        format!("<div class=\"certificate\">\n<h1>{title}</h1>\n"),
        if made.simulated {
            "<div class=\"note\"><p>Made by a simulated instrument: for instruction, not for survey.</p></div>\n".to_owned()
        } else {
            String::new()
        },
        azimuths(shown, directions),
        "<div class=\"columns\">\n".to_owned(),
        facts(shown, made, directions),
        rose(shown, directions),
        "</div>\n".to_owned(),
        flags(shown.fix),
        dwells_table(shown.dwells),
        "<p class=\"soft\">The azimuth is that of the index-zero mark, clockwise from true north, at the time of the measurement. It comes from the Earth's \
         rotation alone: weighted least squares over the mean rates of all dwells, with the amplitude free. Its sigma is that of the measured noise, never \
         less than the declared one, with bias instability, encoder and level errors added.</p>\n"
            .to_owned(),
        "<div class=\"signature\"><span>Place and date</span><span>Signature</span></div>\n</div>\n".to_owned(),
    ];
    page(title, &body.concat())
}

/// The azimuths that were asked for, each with its sigma and with the half width of its 95 % interval.
fn azimuths(shown: &Shown<'_>, directions: &Directions) -> String {
    let (unit, sigma_deg) = (directions.unit(), shown.fix.sigma_deg);
    let rows: Vec<Vec<String>> = directions
        .said_deg(shown.fix.azimuth_deg)
        .map(|(name, azimuth_deg)| {
            let of_what = match name {
                "grid" => "of the mark, from grid north",
                "target" => "of the target, from true north",
                "target grid" => "of the target, from grid north",
                _ => "of the mark, from true north",
            };
            vec![
                of_what.to_owned(),
                format!("<b>{}</b>", unit.azimuth(azimuth_deg)),
                unit.sigma(sigma_deg),
                format!("± {}", unit.sigma(SIGMAS_OF_95_PERCENT * sigma_deg)),
            ]
        })
        .collect();
    table(&[("direction", false), ("azimuth", true), ("one sigma", true), ("95 %", true)], &rows)
}

fn facts(shown: &Shown<'_>, made: &Made<'_>, directions: &Directions) -> String {
    let fix = shown.fix;
    let mut rows: Vec<(&str, String)> = made.instrument.iter().map(|(name, value)| (*name, escape(value))).collect();
    rows.push(("latitude", format!("{}°", number(made.latitude_deg, 6))));
    rows.push(("measured for", format!("{:.0} s in {}", fix.seconds, counted(shown.dwells.len(), "dwell"))));
    let expected =
        shown.earth.map_or(String::new(), |earth| format!(", expected {} °/h", number(earth.north_deg_h, 5)));
    rows.push(("horizontal rate", format!("{} °/h{expected}", number(fix.amplitude_deg_h, 5))));
    let closure = match (fix.closure_deg_h, fix.closure_sigma_deg_h) {
        (Some(closure), Some(sigma)) => format!("{} °/h", with_sigma(closure, Some(sigma))),
        _ => "not determined by these angles".into(),
    };
    rows.push(("closure", closure));
    rows.push(("chi-square", format!("{:.1}, {} degrees of freedom", fix.chi_square, fix.degrees_of_freedom)));
    if let Some(tilt) = fix.tilt {
        rows.push(("tilt", format!("pitch {}°, roll {}°", number(tilt.pitch_deg, 3), number(tilt.roll_deg, 3))));
    }
    if let Some(Reference { name, azimuth_deg }) = shown.reference {
        rows.push(("compared with", format!("{name} azimuth {}", directions.unit().azimuth(azimuth_deg))));
    }
    rows.push(("flags", if fix.flags.is_empty() { "none".into() } else { "see below".into() }));
    rows.push(("computed", format!("{}, north {}", today(), env!("CARGO_PKG_VERSION"))));
    let rows: Vec<Vec<String>> = rows.into_iter().map(|(name, value)| vec![name.to_owned(), value]).collect();
    table(&[("", false), ("", false)], &rows)
}
