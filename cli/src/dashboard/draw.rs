//! A [`Dashboard`] on a terminal of 80 columns and 24 lines, or more.

use std::ffi::OsStr;

use north_finder::event::{Fix, State};
use north_finder::units::RAD_PER_DEG;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Block, Chart, Dataset, Gauge, GraphType, Paragraph, Wrap};

use super::Dashboard;
use crate::present::{Directions, place};

/// Points of the fitted sinusoid.
const CURVE: u32 = 120;

/// Draws everything.
pub fn draw(frame: &mut Frame, board: &Dashboard, directions: &Directions) {
    let paint = Paint::asked_for(std::env::var_os("NO_COLOR").as_deref());
    let [head, bar, charts, bottom] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Fill(3), Constraint::Length(11)])
            .areas(frame.area());
    let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(charts);
    let [result, log] = Layout::horizontal([Constraint::Length(38), Constraint::Fill(1)]).areas(bottom);

    let state = board.state.map_or("waiting", State::name);
    let positions = board.lines.dwells_s().len();
    let place = match board.state {
        Some(State::Indexing | State::Settling | State::Collecting) => {
            format!(", {}", place(board.position, positions))
        }
        _ => String::new(),
    };
    let title = format!("{}  {:.0} s  {state}{place}   keys: s start, a abort, q quit", board.port, board.t_s);
    frame.render_widget(Paragraph::new(title).style(paint.of_state(board)), head);
    let gauge = Gauge::default().ratio(board.progress()).gauge_style(paint.style(Color::Cyan));
    frame.render_widget(gauge, bar);
    rates(frame, left, board, paint);
    sinusoid(frame, right, board, paint);
    let text: Vec<Line> = summary(board, directions, paint);
    frame.render_widget(Paragraph::new(text).block(Block::bordered().title("fix")).wrap(Wrap { trim: false }), result);
    let room = usize::from(log.height.saturating_sub(2));
    let lines: Vec<Line> = board.log.iter().rev().take(room).rev().map(|line| Line::raw(line.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("events")), log);
}

/// Colours, where they are wanted.
#[derive(Clone, Copy)]
struct Paint {
    coloured: bool,
}

impl Paint {
    /// By the variable NO_COLOR: no colours where it is there and not empty.
    fn asked_for(no_color: Option<&OsStr>) -> Self {
        Self { coloured: no_color.is_none_or(OsStr::is_empty) }
    }

    fn style(self, colour: Color) -> Style {
        if self.coloured { Style::new().fg(colour) } else { Style::new() }
    }

    fn of_state(self, board: &Dashboard) -> Style {
        match (board.state, board.second.and_then(|second| second.waited_at)) {
            (Some(State::Failed), _) => self.style(Color::Red),
            (_, Some(_)) => self.style(Color::Yellow),
            (Some(State::Finished), _) => self.style(Color::Green),
            _ => Style::new(),
        }
    }
}

fn bounds(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if low > high { [-1.0, 1.0] } else { [low - 0.05 * (high - low) - 0.01, high + 0.05 * (high - low) + 0.01] }
}

fn axis<'a>(limits: [f64; 2], decimals: usize) -> Axis<'a> {
    Axis::default().bounds(limits).labels(limits.map(|limit| format!("{limit:.decimals$}")))
}

fn rates(frame: &mut Frame, area: Rect, board: &Dashboard, paint: Paint) {
    let points: Vec<(f64, f64)> = board.rates.iter().copied().collect();
    let end = points.last().map_or(0.0, |point| point.0);
    let data = Dataset::default()
        .data(&points)
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(paint.style(Color::Cyan));
    let chart = Chart::new(vec![data])
        .block(Block::bordered().title("rate, °/h, against time, s"))
        .x_axis(axis([end - super::RATES as f64, end], 0))
        .y_axis(axis(bounds(points.iter().map(|point| point.1)), 2));
    frame.render_widget(chart, area);
}

/// The rates of the collected seconds against the index angle, and the rate that the solution so far gives there.
fn sinusoid(frame: &mut Frame, area: Rect, board: &Dashboard, paint: Paint) {
    let fitted: Vec<(f64, f64)> = board.fix.or(board.so_far).map(|fix| curve(&fix)).unwrap_or_default();
    let values = board.points.iter().chain(&fitted).map(|point| point.1);
    let limits = bounds(values);
    let line = Dataset::default()
        .data(&fitted)
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(paint.style(Color::Green));
    let points = Dataset::default().data(&board.points).marker(Marker::Dot).graph_type(GraphType::Scatter);
    let chart = Chart::new(vec![line, points])
        .block(Block::bordered().title("rate, °/h, against index, °, and its fit"))
        .x_axis(axis([0.0, 360.0], 0))
        .y_axis(axis(limits, 2));
    frame.render_widget(chart, area);
}

/// The level instrument's rate at every index angle, of what the fix found.
fn curve(fix: &Fix) -> Vec<(f64, f64)> {
    let rate =
        |index_deg: f64| fix.bias_deg_h + fix.amplitude_deg_h * ((fix.azimuth_deg - index_deg) * RAD_PER_DEG).cos();
    (0..=CURVE).map(|n| f64::from(n) * 360.0 / f64::from(CURVE)).map(|index_deg| (index_deg, rate(index_deg))).collect()
}

fn summary<'a>(board: &Dashboard, directions: &Directions, paint: Paint) -> Vec<Line<'a>> {
    let mut lines = Vec::new();
    match (board.fix, board.so_far) {
        (Some(fix), _) => {
            let colour = if fix.flags.is_empty() { Color::Green } else { Color::Yellow };
            written(directions, &fix).into_iter().for_each(|line| lines.push(Line::styled(line, paint.style(colour))));
            fix.flags
                .iter()
                .for_each(|flag| lines.push(Line::styled(format!("flag {}", flag.name()), paint.style(Color::Yellow))));
        }
        (None, Some(fix)) => {
            written(directions, &fix).into_iter().for_each(|line| lines.push(Line::raw(format!("{line} so far"))))
        }
        (None, None) => lines.push(Line::raw("no azimuth yet")),
    }
    if let Some(fault) = board.fault {
        lines.push(Line::styled(format!("{}: {}", fault.name(), fault.remedy()), paint.style(Color::Red)));
    }
    if let Some(heading) = board.heading {
        lines.push(Line::raw(format!("heading {:.3}° ± {:.3}°", heading.heading_deg, heading.sigma_deg)));
    }
    if let Some(second) = board.second {
        let index = second.index_deg.map_or("none".to_owned(), |index_deg| format!("{index_deg:.3}°"));
        lines.push(Line::raw(format!("rate {:+.4} °/h  index {index}", second.rate_deg_h)));
        if let Some(level) = second.level {
            let tilt = level.mean.tilt();
            lines.push(Line::raw(format!("pitch {:+.3}°  roll {:+.3}°", tilt.pitch_deg, tilt.roll_deg)));
        }
        if let Some(temp_c) = second.temp_c {
            lines.push(Line::raw(format!("gyro {temp_c:.2} °C")));
        }
        let gate = second
            .waited_at
            .map_or("gates  open".to_owned(), |gate| format!("gates  waiting: {gate:?}").to_lowercase());
        lines.push(Line::raw(gate));
    }
    let counters = &board.counters;
    lines.push(Line::raw(format!("frames lost {}, bad {}", counters.frames_lost, counters.frames_bad_crc)));
    lines
}

fn written(directions: &Directions, fix: &Fix) -> Vec<String> {
    let mut text = Vec::new();
    // Writing to memory does not fail.
    let _ = directions.write(&mut text, fix.azimuth_deg, fix.sigma_deg);
    String::from_utf8_lossy(&text).lines().map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use hal_sim::Scenario;
    use north_finder::settings::Settings;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;
    use crate::engine::{Setup, host};
    use crate::settings_file::scenario_settings;

    fn screen(board: &Dashboard, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, board, &Directions::default())).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn no_color_is_obeyed() {
        let colour = |variable: Option<&str>| Paint::asked_for(variable.map(OsStr::new)).style(Color::Red).fg;
        assert_eq!([None, Some(""), Some("1")].map(colour), [Some(Color::Red), Some(Color::Red), None]);
    }

    #[test]
    fn a_whole_fix_is_shown_and_small_terminals_do_no_harm() {
        let scenario = Scenario::named("calm-bench").unwrap();
        let settings = Settings { ..scenario_settings(&scenario, None).unwrap() };
        let mut board = Dashboard::new("/dev/pts/5", Some(settings.clone()));
        assert!(screen(&board, 80, 24).contains("no azimuth yet"));
        let setup = Setup { scenario, seed: 1, settings: Some(settings) };
        let mut half_way = None;
        host::run(&setup, &AtomicBool::new(false), &mut |report| {
            board.report(report);
            if board.so_far.is_some() && half_way.is_none() {
                half_way = Some(screen(&board, 80, 24));
            }
        })
        .unwrap();
        assert!(
            half_way.is_some_and(|text| text.contains("so far") && text.contains("position")),
            "no solution on the way"
        );
        let text = screen(&board, 100, 30);
        for part in ["finished", "azimuth    ", "pitch ", "against index", "gates  open", "/dev/pts/5"] {
            assert!(text.contains(part), "{part}:\n{text}");
        }
        for (width, height) in [(1, 1), (20, 5), (38, 12), (300, 100)] {
            screen(&board, width, height);
        }
    }
}
