//! The published difference formulas, of six certain positions.
//!
//! i1 = (N4 − N5)/2ωc; i2 = (N1 − N2)/2ωc; i3 = (N1 − N3)/2ωs; bias of y and z from (N2 + N3)/2, of x from (N5 + N6)/2,
//! with ωc = Ω cos φ, ωs = Ω sin φ. In each of the two sums the inputs cancel for all three gyros.

use quantities::earth::{LatitudeError, earth_rate};

use super::axes::{Axes, AxesError};

/// Where x, y, z point in positions 1 to 6.
pub const AXES: [&str; 6] = ["ENU", "WSU", "WND", "NED", "SWD", "NWU"];

/// What the formulas give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// °/h, of x, y, z.
    pub bias_deg_h: [f64; 3],
    /// Row: gyro; column: axis of rotation.
    pub matrix: [[f64; 3]; 3],
}

/// The axes of the six positions.
pub fn axes() -> Result<[Axes; 6], AxesError> {
    let [one, two, three, four, five, six] = AXES.map(Axes::parse);
    Ok([one?, two?, three?, four?, five?, six?])
}

/// From the mean rates of the six positions in the order of [`AXES`], each x, y, z in °/h.
///
/// At the equator the vertical part vanishes: its column is infinite or not a number there.
pub fn differences(rates_deg_h: &[[f64; 3]; 6], latitude_deg: f64) -> Result<Published, LatitudeError> {
    let earth = earth_rate(latitude_deg)?;
    let [one, two, three, four, five, six] = rates_deg_h;
    let over = |a: &[f64; 3], b: &[f64; 3], by: f64| {
        let ([ax, ay, az], [bx, by_, bz]) = (a, b);
        [(ax - bx) / by, (ay - by_) / by, (az - bz) / by]
    };
    let [i1x, i1y, i1z] = over(four, five, 2.0 * earth.north_deg_h);
    let [i2x, i2y, i2z] = over(one, two, 2.0 * earth.north_deg_h);
    let [i3x, i3y, i3z] = over(one, three, 2.0 * earth.up_deg_h);
    let ([x5, _, _], [x6, _, _]) = (five, six);
    let ([_, y2, z2], [_, y3, z3]) = (two, three);
    Ok(Published {
        bias_deg_h: [0.5 * (x5 + x6), 0.5 * (y2 + y3), 0.5 * (z2 + z3)],
        matrix: [[i1x, i2x, i3x], [i1y, i2y, i3y], [i1z, i2z, i3z]],
    })
}
