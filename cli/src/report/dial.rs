//! A dial: directions seen from above, north upwards.

use std::fmt::Write;

use super::html::escape;

/// Half the width of the drawing, pixels, and the radius of the dial.
const HALF: f64 = 160.0;
const RADIUS: f64 = 122.0;

/// A direction on the dial.
pub struct Hand<'a> {
    /// "after" for what was found, "reference" for what else is shown.
    pub class: &'static str,
    pub name: &'a str,
    /// Clockwise from north, degrees.
    pub azimuth_deg: f64,
}

/// The dial as a figure.
pub fn dial(hands: &[Hand<'_>], caption: &str) -> String {
    let mut svg = format!(
        "<svg class=\"dial\" viewBox=\"{low} {low} {size} {size}\" role=\"img\" aria-label=\"directions from above\">\
         <circle class=\"zero\" r=\"{RADIUS}\"/>",
        low = -HALF,
        size = 2.0 * HALF
    );
    for azimuth in (0..360).step_by(10) {
        let inner = RADIUS - if azimuth % 90 == 0 { 14.0 } else { 6.0 };
        let ([x0, y0], [x1, y1]) = (at(azimuth.into(), inner), at(azimuth.into(), RADIUS));
        let _ = write!(svg, "<path class=\"zero\" d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\"/>");
    }
    for (azimuth_deg, letter) in [(0.0, "N"), (90.0, "E"), (180.0, "S"), (270.0, "W")] {
        let [x, y] = at(azimuth_deg, RADIUS - 26.0);
        let _ = write!(
            svg,
            "<text class=\"axis\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{letter}</text>",
            y + 4.0
        );
    }
    for Hand { class, name, azimuth_deg } in hands {
        let [x, y] = at(*azimuth_deg, RADIUS);
        let [tx, ty] = at(*azimuth_deg, RADIUS + 12.0);
        let anchor = match tx / RADIUS {
            side if side > 0.3 => "start",
            side if side < -0.3 => "end",
            _ => "middle",
        };
        let _ = write!(
            svg,
            "<path class=\"line {class}\" d=\"M0 0L{x:.1} {y:.1}\"/>\
             <circle class=\"dot {class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>\
             <text class=\"axis\" x=\"{tx:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
            ty + 4.0,
            escape(name)
        );
    }
    format!("<figure class=\"dial\">\n{svg}</svg>\n<figcaption>{caption}</figcaption>\n</figure>\n")
}

/// Right and down from the centre.
fn at(azimuth_deg: f64, radius: f64) -> [f64; 2] {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    [radius * sin, -radius * cos]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn east_is_to_the_right_and_south_is_down() {
        let [[ex, ey], [sx, sy]] = [at(90.0, 2.0), at(180.0, 2.0)];
        assert!((ex - 2.0).abs() < 1e-12 && ey.abs() < 1e-12, "{ex} {ey}");
        assert!(sx.abs() < 1e-12 && (sy - 2.0).abs() < 1e-12, "{sx} {sy}");
    }
}
