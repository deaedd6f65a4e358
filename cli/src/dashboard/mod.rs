//! The live view of a board: what its reports say so far ([`Dashboard`]), and how that is drawn (`draw`).

mod draw;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use north_finder::event::{Event, Fix, Heading, Report, Second, State};
use north_finder::health::{Counters, Fault};
use north_finder::link::Ask;
use north_finder::sequence::Command;
use north_finder::settings::Settings;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, KeyCode, KeyEventKind, KeyModifiers};

use crate::failure::Failure;
use crate::port::{Port, PortError, SILENCE};
use crate::present::{Directions, Lines};
use crate::recorder::Recorder;
use crate::solve::solve_seconds;

/// Seconds of rates that are shown.
const RATES: usize = 120;
/// Lines that are kept.
const LINES: usize = 100;
/// How often it is drawn.
const FRAME: Duration = Duration::from_millis(100);

/// What is known of the board and its fix.
pub struct Dashboard {
    port: String,
    settings: Option<Settings>,
    lines: Lines,
    recorder: Recorder,
    t_s: f64,
    state: Option<State>,
    position: u8,
    /// Seconds collected at it.
    collected: u16,
    /// Time, rate.
    rates: VecDeque<(f64, f64)>,
    /// Index angle, rate: of the collected seconds of this fix.
    points: Vec<(f64, f64)>,
    second: Option<Second>,
    /// By the dwells so far, before the fix is out.
    so_far: Option<Fix>,
    fix: Option<Fix>,
    fault: Option<Fault>,
    heading: Option<Heading>,
    counters: Counters,
    log: VecDeque<String>,
    /// When an adaptive fix said how long it would go on, and how long.
    to_go: Option<(f64, f64)>,
}

impl Dashboard {
    /// Of a board with these settings; `None`: it has none.
    pub fn new(port: &str, settings: Option<Settings>) -> Self {
        Self {
            port: port.to_owned(),
            lines: Lines::new(settings.as_ref().unwrap_or(&Settings::default())),
            settings,
            recorder: Recorder::default(),
            t_s: 0.0,
            state: None,
            position: 0,
            collected: 0,
            rates: VecDeque::new(),
            points: Vec::new(),
            second: None,
            so_far: None,
            fix: None,
            fault: None,
            heading: None,
            counters: Counters::default(),
            log: VecDeque::new(),
            to_go: None,
        }
    }

    /// Takes a report.
    pub fn report(&mut self, report: &Report) {
        self.t_s = report.t_s;
        self.recorder.see(report);
        if let Some(line) = self.lines.line(report) {
            self.say(line);
        }
        match report.event {
            Event::State(state) => {
                if state == State::Levelling {
                    (self.so_far, self.fix, self.fault) = (None, None, None);
                    (self.position, self.collected, self.to_go) = (0, 0, None);
                    self.points.clear();
                }
                self.state = Some(state);
            }
            Event::Second(second) => self.take(second),
            Event::Moving { position, .. } => (self.position, self.collected) = (position, 0),
            Event::Dwell(dwell) => {
                self.position = dwell.position;
                let settings = self.settings.as_ref();
                self.so_far = settings.and_then(|settings| solve_seconds(settings, self.recorder.rows()).ok());
            }
            Event::Fix(fix) => self.fix = Some(fix),
            Event::Fault { fault, state } => {
                self.fault = Some(fault);
                self.say(format!("{:8.1} s  {} while {}", report.t_s, fault.name(), state.name()));
            }
            Event::Health(counters) => self.counters = counters,
            Event::Heading(heading) => self.heading = Some(heading),
            Event::ToGo { seconds } => self.to_go = Some((report.t_s, seconds)),
            _ => {}
        }
    }

    fn take(&mut self, second: Second) {
        if self.rates.len() == RATES {
            self.rates.pop_front();
        }
        self.rates.push_back((second.t_s, second.rate_deg_h));
        if let (true, Some(position), Some(index_deg)) = (second.collected, second.dwell, second.index_deg) {
            self.collected = if position == self.position { self.collected + 1 } else { 1 };
            self.position = position;
            self.points.push((index_deg, second.rate_deg_h));
        }
        self.second = Some(second);
    }

    fn say(&mut self, line: String) {
        if self.log.len() == LINES {
            self.log.pop_front();
        }
        self.log.push_back(line);
    }

    /// What is measured of what the order wants, 0 to 1.
    fn progress(&self) -> f64 {
        if let Some((at_s, seconds)) = self.to_go {
            let gone_s = self.t_s - at_s;
            return if self.fix.is_some() { 1.0 } else { (gone_s / seconds.max(1.0)).clamp(0.0, 1.0) };
        }
        let wanted: u32 = self.lines.dwells_s().iter().map(|&seconds| u32::from(seconds)).sum();
        match self.fix {
            Some(_) => 1.0,
            // Nobody knows yet how many there will be.
            None if wanted == 0 => 0.0,
            None => (self.points.len() as f64 / f64::from(wanted)).min(1.0),
        }
    }
}

/// Shows the board until a key or, with `once`, the end of the fix ends it.
pub fn run(
    port: &mut Port,
    settings: Option<Settings>,
    start: bool,
    once: bool,
    directions: &Directions,
) -> Result<(), Failure> {
    let mut dashboard = Dashboard::new(port.name(), settings);
    port.ask(Ask::Status, &mut |report| dashboard.report(report))?;
    if start {
        port.command(Command::Start, &mut |report| dashboard.report(report))?;
    }
    let mut terminal = ratatui::init();
    let shown = show(&mut terminal, port, &mut dashboard, once, directions);
    ratatui::restore();
    match (shown, dashboard.fault, dashboard.fix) {
        (Err(failure), ..) => Err(failure),
        (Ok(()), Some(fault), None) => Err(Failure::Refused(format!("{}: {}", fault.name(), fault.meaning()))),
        (Ok(()), _, Some(fix)) => Ok(directions.write(&mut crate::output::people(), fix.azimuth_deg, fix.sigma_deg)?),
        (Ok(()), None, None) => Ok(()),
    }
}

fn show(
    terminal: &mut DefaultTerminal,
    port: &mut Port,
    dashboard: &mut Dashboard,
    once: bool,
    directions: &Directions,
) -> Result<(), Failure> {
    let (mut heard, mut drawn) = (Instant::now(), None::<Instant>);
    loop {
        if let Some(report) = port.poll()? {
            heard = Instant::now();
            dashboard.report(&report);
            if once && matches!(report.event, Event::State(State::Finished | State::Failed)) {
                return Ok(());
            }
        }
        if heard.elapsed() > SILENCE {
            return Err(PortError::Silent { port: port.name().to_owned(), seconds: SILENCE.as_secs() }.into());
        }
        if drawn.is_some_and(|drawn| drawn.elapsed() < FRAME) {
            continue;
        }
        drawn = Some(Instant::now());
        terminal.draw(|frame| draw::draw(frame, dashboard, directions))?;
        let command = match key()? {
            Some(Key::Quit) => return Ok(()),
            Some(Key::Interrupt) => return Err(Failure::Interrupted),
            Some(Key::Command(command)) => command,
            None => continue,
        };
        if let Err(error) = port.command(command, &mut |report| dashboard.report(report)) {
            match error {
                PortError::Refused { refusal, .. } => dashboard.say(format!("refused: {}", refusal.meaning())),
                error => return Err(error.into()),
            }
        }
    }
}

/// What a person wants.
enum Key {
    Quit,
    Interrupt,
    Command(Command),
}

/// A key that was pressed, if one was.
fn key() -> std::io::Result<Option<Key>> {
    if !event::poll(Duration::ZERO)? {
        return Ok(None);
    }
    let event::Event::Key(key) = event::read()? else { return Ok(None) };
    if key.kind == KeyEventKind::Release {
        return Ok(None);
    }
    Ok(match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Key::Interrupt),
        KeyCode::Char('q') | KeyCode::Esc => Some(Key::Quit),
        KeyCode::Char('s') => Some(Key::Command(Command::Start)),
        KeyCode::Char('a') => Some(Key::Command(Command::Abort)),
        _ => None,
    })
}
