//! A figure of the page: legend, the drawing for wide and for narrow screens, caption.

use super::plot::{Plot, Side};

/// Widths of the drawings, pixels: what a desk and what a telephone shows at full size.
const WIDE: f64 = 818.0;
const NARROW: f64 = 344.0;

/// What a drawing may depend on.
#[derive(Clone, Copy, Debug)]
pub struct Canvas {
    pub width: f64,
    pub narrow: bool,
}

/// What the marks of a figure mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Legend<'a> {
    /// Dots with sigma bars.
    Dots,
    /// Lines, and a dashed one for what the text says.
    Lines(&'a str),
    /// Dots, each with its text.
    Marks(&'a [(Side, &'a str)]),
    /// Lines of any classes, each with its text.
    Named(&'a [(&'a str, &'a str)]),
    None,
}

impl Legend<'_> {
    fn html(self) -> String {
        let dot = |side: &str| {
            format!(
                "<span><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path class=\"bar {side}\" d=\"M13 0V12\"/>\
                 <circle class=\"dot {side}\" cx=\"13\" cy=\"6\" r=\"3.6\"/></svg>{side}</span>"
            )
        };
        let mark = |side: Side, text: &str| {
            let side = side.name();
            format!(
                "<span><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\">\
                 <circle class=\"dot {side}\" cx=\"13\" cy=\"6\" r=\"3.6\"/></svg>{text}</span>"
            )
        };
        let line = |class: &str, text: &str| {
            format!(
                "<span><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path class=\"{class}\" d=\"M0 6H26\"/></svg>{text}\
                 </span>"
            )
        };
        let inner = match self {
            Self::Dots => dot("before") + &dot("after"),
            Self::Lines(text) => {
                line("line before", "before") + &line("line after", "after") + &line("reference", text)
            }
            Self::Marks(marks) => marks.iter().map(|(side, text)| mark(*side, text)).collect(),
            Self::Named(lines) => lines.iter().map(|(class, text)| line(class, text)).collect(),
            Self::None => return String::new(),
        };
        format!("<div class=\"legend\">{inner}</div>\n")
    }
}

/// A figure of one drawing or several below each other.
pub fn figure(legend: Legend<'_>, about: &str, caption: &str, draw: impl Fn(Canvas) -> Vec<Plot>) -> String {
    let drawings = [(WIDE, "wide"), (NARROW, "narrow")].map(|(width, class)| {
        let plots = draw(Canvas { width, narrow: class == "narrow" });
        plots.into_iter().map(|plot| plot.finish(class, about)).collect::<String>()
    });
    format!("<figure>\n{}{}<figcaption>{caption}</figcaption>\n</figure>\n", legend.html(), drawings.concat())
}
