//! Functions of the heading of a run, and of the azimuth in which its axis points.

use std::f64::consts::TAU;

use super::columns::{Columns, from_columns};
use super::sheet::Sheet;

/// Bumps in the heading, and their concentration.
const BUMPS: usize = 12;
const CONCENTRATION: f64 = 1.0 / 0.2;
/// The same in the axis's azimuth.
const AXIS_BUMPS: usize = 14;
const AXIS_CONCENTRATION: f64 = 1.0 / 0.2;
const BROAD_CONCENTRATION: f64 = 1.0;

/// Bumps all around in the heading.
pub fn bumps(sheet: &Sheet, azimuth_rad: f64) -> Columns {
    let rows = sheet.cos.len();
    let of = |bump: usize| {
        let centre = bump as f64 * TAU / BUMPS as f64;
        vec![(((azimuth_rad - centre).cos() - 1.0) * CONCENTRATION).exp(); rows]
    };
    from_columns(rows, (0..BUMPS).map(of))
}

/// Bumps all around in the axis's azimuth, and broad ones.
pub fn axis_curve(sheet: &Sheet, azimuth_rad: f64) -> Columns {
    bumps_in_axis(sheet, azimuth_rad, AXIS_CONCENTRATION)
}

pub fn broad_axis_curve(sheet: &Sheet, azimuth_rad: f64) -> Columns {
    bumps_in_axis(sheet, azimuth_rad, BROAD_CONCENTRATION)
}

/// cos α: the share of the horizontal Earth rate along the axis.
pub fn along(sheet: &Sheet, azimuth_rad: f64) -> Vec<f64> {
    let (sin, cos) = azimuth_rad.sin_cos();
    sheet.cos.iter().zip(&sheet.sin).map(|(c, s)| cos * c + sin * s).collect()
}

fn bumps_in_axis(sheet: &Sheet, azimuth_rad: f64, concentration: f64) -> Columns {
    let of = |i: usize, centre: f64| {
        let axis_rad = azimuth_rad - sheet.sin[i].atan2(sheet.cos[i]);
        (((axis_rad - centre).cos() - 1.0) * concentration).exp()
    };
    let bump = |number: usize| {
        let centre = number as f64 * TAU / AXIS_BUMPS as f64;
        (0..sheet.cos.len()).map(|i| of(i, centre)).collect::<Vec<_>>()
    };
    from_columns(sheet.cos.len(), (0..AXIS_BUMPS).map(bump))
}

/// Probability that a heading lies in a sector, of which is known only which of the surveyed headings lie inside: its borders may be
/// anywhere between two of these. All in degrees.
pub fn share_of_sector(surveyed_deg: &[f64], [from_deg, width_deg]: [f64; 2], heading_deg: f64) -> f64 {
    let inside = |heading_deg: f64| f64::from(u8::from((heading_deg - from_deg).rem_euclid(360.0) < width_deg));
    let ahead = |known_deg: &f64| (known_deg - heading_deg).rem_euclid(360.0);
    let next_deg = surveyed_deg.iter().min_by(|a, b| ahead(a).total_cmp(&ahead(b)));
    let last_deg = surveyed_deg.iter().max_by(|a, b| ahead(a).total_cmp(&ahead(b)));
    let (Some(next_deg), Some(last_deg)) = (next_deg, last_deg) else { return inside(heading_deg) };
    let (to_next, since_last) = (ahead(next_deg), 360.0 - ahead(last_deg));
    let share = since_last / (to_next + since_last);
    share * inside(*next_deg) + (1.0 - share) * inside(*last_deg)
}
