//! Four rates at four index angles to an azimuth: the fix's mathematics alone.
//!
//! `cargo run --example solve_rows --no-default-features`

use north_finder::earth::earth_rate;
use north_finder::effects::ErrorModel;
use north_finder::fix::dwell::{DwellRows, DwellSummary, Row};
use north_finder::fix::{Declared, solve};
use north_finder::sensing::sample::GyroSettings;
use north_finder::units::sin_cos_deg;

/// Seconds at each position, and between two.
const DWELL_S: u32 = 60;
const MOVE_S: u32 = 5;

fn main() {
    let declared = Declared {
        earth: earth_rate(60.0).expect("a latitude that is not a pole's"),
        gyro: GyroSettings::default(),
        index_sigma_deg: 0.02,
        level_sigma_deg: 0.01,
        ..Declared::default()
    };
    // At 60° the horizontal rate is 7.520 °/h. The mark points to azimuth 30°, and the gyro has a bias of 0.5 °/h.
    let (azimuth_deg, bias_deg_h) = (30.0_f64, 0.5);
    let dwells: Vec<DwellSummary> =
        (0..4).filter_map(|position| dwell(position, azimuth_deg, bias_deg_h, declared.earth.north_deg_h)).collect();
    match solve(&dwells, &declared, &ErrorModel::default()) {
        Ok(fix) => {
            println!("azimuth {:.3}° ± {:.3}°", fix.azimuth_deg, fix.sigma_deg);
            println!("bias {:.3} °/h, amplitude {:.3} °/h", fix.bias_deg_h, fix.amplitude_deg_h);
            println!("flags: {}", fix.flags.iter().map(|flag| flag.name()).collect::<Vec<_>>().join(", "));
        }
        Err(refusal) => println!("no azimuth: {refusal}"),
    }
}

/// A dwell of rows of a second, with a scatter of 0.05 °/h to and fro.
fn dwell(position: u32, azimuth_deg: f64, bias_deg_h: f64, north_deg_h: f64) -> Option<DwellSummary> {
    let index_deg = 90.0 * f64::from(position);
    let (sin, cos) = sin_cos_deg(index_deg);
    let of_earth_deg_h = north_deg_h * (azimuth_deg - index_deg).to_radians().cos();
    let mut rows = DwellRows::default();
    for second in 0..DWELL_S {
        let scatter_deg_h = if second % 2 == 0 { 0.05 } else { -0.05 };
        let row = Row {
            t_s: f64::from(position * (DWELL_S + MOVE_S) + second) + 0.5,
            seconds: 1.0,
            cos,
            sin,
            rate_deg_h: of_earth_deg_h + bias_deg_h + scatter_deg_h,
            moment_arcsec_s: 0.0,
            level: None,
        };
        rows.push(row, 0.05);
    }
    rows.summary(0.05)
}
