//! A plot as SVG: frame, grid, ticks, labels, and marks of the two kinds that every figure compares.

use std::fmt::Write;

use super::axis::Axis;
use super::html::escape;

/// Before or after the model learned the effects: colour and shape of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Before,
    After,
}

impl Side {
    pub const BOTH: [Self; 2] = [Self::Before, Self::After];

    pub fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
        }
    }
}

/// Space around the frame, pixels.
const TOP: f64 = 26.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 44.0;
/// Width of a digit of the ticks, pixels.
const DIGIT: f64 = 7.2;
/// Room for so many at least, so that plots below each other have one left edge.
const LEAST_DIGITS: usize = 4;
/// Baseline of what stands above the frame.
const HEAD: f64 = TOP - 9.0;
/// From one tick to the next, pixels, at least about this.
const TICK_X: f64 = 78.0;
const TICK_Y: f64 = 38.0;

/// Specks of one side that lie upon each other in a frame.
const MANY_SPECKS: usize = 1500;

/// A plot being drawn. Marks outside of its ranges are cut off at the frame.
pub struct Plot {
    x: Axis,
    y: Axis,
    width: f64,
    height: f64,
    left: f64,
    y_ticks: Vec<(f64, String)>,
    x_ticks: Vec<(f64, String)>,
    marks: String,
    over: String,
}

impl Plot {
    /// `width` and `height` are those of the whole, pixels.
    pub fn new(width: f64, height: f64, x: Axis, y: Axis) -> Self {
        let y_ticks = y.ticks(((height - TOP - BOTTOM) / TICK_Y) as usize);
        let x_ticks = x.ticks((width / TICK_X) as usize);
        let longest = y_ticks.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(1).max(LEAST_DIGITS);
        let left = 14.0 + DIGIT * longest as f64;
        Self { x, y, width, height, left, y_ticks, x_ticks, marks: String::new(), over: String::new() }
    }

    /// Other ticks at the x axis than its own.
    pub fn x_ticks(&mut self, ticks: Vec<(f64, String)>) {
        self.x_ticks = ticks;
    }

    /// Other ticks at the y axis than its own.
    pub fn y_ticks(&mut self, ticks: Vec<(f64, String)>) {
        self.y_ticks = ticks;
    }

    /// Width of the frame, pixels.
    pub fn frame_width(&self) -> f64 {
        self.width - self.left - RIGHT
    }

    fn frame_height(&self) -> f64 {
        self.height - TOP - BOTTOM
    }

    /// Inside the frame, pixels from its upper left corner.
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        // Far outside is as good as outside, and keeps the numbers short.
        let place = |place: f64, size: f64| (place * size).clamp(-2.0 * size, 3.0 * size);
        (place(self.x.place(x), self.frame_width()), place(1.0 - self.y.place(y), self.frame_height()))
    }

    /// A dot for every point: hollow before, filled after.
    pub fn dots(&mut self, side: Side, points: impl IntoIterator<Item = (f64, f64)>) {
        for (x, y) in points {
            let (x, y) = self.at(x, y);
            let _ = write!(self.marks, "<circle class=\"dot {}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\"/>", side.name());
        }
    }

    /// Small specks, for many points: faint where there are so many that they lie upon each other.
    pub fn specks(&mut self, side: Side, points: impl IntoIterator<Item = (f64, f64)>) {
        let (mut path, mut number) = (String::new(), 0);
        for (x, y) in points {
            let (x, y) = self.at(x, y);
            let _ = write!(path, "M{:.0} {:.0}h2.4v2.4h-2.4z", x - 1.2, y - 1.2);
            number += 1;
        }
        let density = if number < MANY_SPECKS { "sparse " } else { "" };
        let _ = write!(self.marks, "<path class=\"speck {density}{}\" d=\"{path}\"/>", side.name());
    }

    /// Vertical bars at x from the lower to the upper value.
    pub fn bars(&mut self, class: &str, bars: impl IntoIterator<Item = (f64, f64, f64)>) {
        let mut path = String::new();
        for (x, low, high) in bars {
            let (px, below) = self.at(x, low);
            let (_, above) = self.at(x, high);
            let _ = write!(path, "M{px:.1} {below:.1}V{above:.1}");
        }
        let _ = write!(self.marks, "<path class=\"{class}\" d=\"{path}\"/>");
    }

    /// A line through the points; it breaks where one is not a number.
    pub fn line(&mut self, class: &str, points: impl IntoIterator<Item = (f64, f64)>) {
        let (mut path, mut pen_down) = (String::new(), false);
        for (x, y) in points {
            let (px, py) = self.at(x, y);
            if !(px.is_finite() && py.is_finite()) {
                pen_down = false;
                continue;
            }
            let _ = write!(path, "{}{px:.1} {py:.1}", if pen_down { 'L' } else { 'M' });
            pen_down = true;
        }
        let _ = write!(self.marks, "<path class=\"{class}\" d=\"{path}\"/>");
    }

    /// A level line across the frame.
    pub fn level(&mut self, class: &str, y: f64) {
        self.line(class, [(self.x.low, y), (self.x.high, y)]);
    }

    /// An upright line across the frame.
    pub fn upright(&mut self, class: &str, x: f64) {
        self.line(class, [(x, self.y.low), (x, self.y.high)]);
    }

    /// A word in the upper right corner of the frame.
    pub fn corner(&mut self, text: &str) {
        let _ = write!(
            self.over,
            "<text class=\"axis\" x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\">{}</text>",
            self.left + self.frame_width() - 2.0,
            HEAD,
            escape(text)
        );
    }

    /// The finished SVG; `class` is "wide" or "narrow", `about` says to people who do not see it what it shows.
    pub fn finish(self, class: &str, about: &str) -> String {
        let (width, height, left) = (self.width, self.height, self.left);
        let (inner, tall) = (self.frame_width(), self.frame_height());
        let mut svg = format!(
            "<svg class=\"plot {class}\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{}\">",
            escape(about)
        );
        for (value, text) in &self.y_ticks {
            let y = TOP + tall * (1.0 - self.y.place(*value));
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{left:.1} {y:.1}h{inner:.1}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                left - 6.0,
                y + 4.0
            );
        }
        let base = TOP + tall;
        for (value, text) in &self.x_ticks {
            let x = left + inner * self.x.place(*value);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {TOP:.1}v{tall:.1}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                base + 17.0,
                escape(text)
            );
        }
        let _ = writeln!(
            svg,
            "<rect class=\"frame\" x=\"{left:.1}\" y=\"{TOP:.1}\" width=\"{inner:.1}\" height=\"{tall:.1}\"/>\
             <svg x=\"{left:.1}\" y=\"{TOP:.1}\" width=\"{inner:.1}\" height=\"{tall:.1}\">{}</svg>{}\
             <text class=\"axis\" x=\"0\" y=\"{HEAD}\">{}</text>\
             <text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text></svg>",
            self.marks,
            self.over,
            escape(&self.y.label),
            left + 0.5 * inner,
            height - 6.0,
            escape(&self.x.label)
        );
        svg
    }
}
