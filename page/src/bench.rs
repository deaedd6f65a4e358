//! A simulated instrument, and somebody who works with it.

use hal_sim::{Scenario, World};
use north_finder::event::{Event, Report};
use north_finder::link::Ask;
use north_finder::sequence::Command;
use north_finder::sequence::order::Order;
use north_finder::settings::store;
use serde::{Deserialize, Serialize};
use simulated::{RequestLine, Wired, declare_noise, settings};

use crate::report_json::Reported;

/// A shock takes the base along by this share of its swing for ever.
const LASTING: f64 = 0.05;
/// Time that a person takes to tilt the instrument, or to turn it by a right angle, s.
const BY_HAND_S: f64 = 3.0;
/// Most ticks of one request: a minute.
const MOST_TICKS: u32 = 24_000;

/// What a person does.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Act {
    /// Another instrument, which powers up.
    PowerUp(Box<Chosen>),
    /// The names of all scenarios, with what they are about.
    Scenarios,
    Start,
    Abort,
    /// Lets ticks of 2.5 ms pass.
    Wait(u32),
    /// Turns the instrument clockwise, degrees.
    Turn(f64),
    /// A shock of the base: arcseconds of its first swing.
    Shock(f64),
    /// Makes the air warmer, K.
    Warm(f64),
    /// Pitch and roll, degrees.
    Tilt([f64; 2]),
}

/// Which instrument, and where.
#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Chosen {
    pub scenario: String,
    pub seed: u64,
    /// What the scenario says, where these say nothing.
    pub latitude_deg: Option<f64>,
    pub azimuth_deg: Option<f64>,
    /// Angle random walk of the gyro, °/√h: its class. The gates' thresholds follow.
    pub arw_deg_per_sqrt_h: Option<f64>,
    pub order: Option<Order>,
}

impl Default for Chosen {
    fn default() -> Self {
        Self {
            scenario: "calm-bench".into(),
            seed: 1,
            latitude_deg: None,
            azimuth_deg: None,
            arw_deg_per_sqrt_h: None,
            order: None,
        }
    }
}

/// What comes of it.
#[derive(Debug, Default, Serialize)]
pub struct Answer {
    /// Why it was not done.
    pub error: Option<String>,
    /// What is really so, as far as the page shows it.
    pub truth: Option<Truth>,
    /// What the instrument said meanwhile.
    pub reports: Vec<Reported>,
    pub scenarios: Vec<[&'static str; 2]>,
}

/// What is really so.
#[derive(Debug, Serialize)]
pub struct Truth {
    #[serde(flatten)]
    pub of_world: hal_sim::Truth,
    pub latitude_deg: f64,
    /// Ω cos φ, °/h.
    pub north_deg_h: f64,
    /// Of the gates, °/h.
    pub thresholds_deg_h: [f64; 2],
}

/// The instrument under power.
#[derive(Default)]
pub struct Bench(Option<Powered>);

struct Powered {
    world: World,
    wired: Wired,
    requests: RequestLine,
    latitude_deg: f64,
    thresholds_deg_h: [f64; 2],
}

impl Bench {
    /// Does what a person wants.
    pub fn act(&mut self, act: Act) -> Answer {
        let mut answer = Answer::default();
        answer.error = self.try_to(act, &mut answer).err();
        answer.truth = self.0.as_ref().map(Powered::truth);
        answer
    }

    fn try_to(&mut self, act: Act, answer: &mut Answer) -> Result<(), String> {
        match act {
            Act::PowerUp(chosen) => self.0 = Some(Powered::up(&chosen)?),
            Act::Scenarios => answer.scenarios = Scenario::names().map(|(name, about)| [name, about]).collect(),
            _ => self.0.as_mut().ok_or("the instrument has no power")?.act(&act, &mut answer.reports)?,
        }
        Ok(())
    }
}

impl Powered {
    fn up(chosen: &Chosen) -> Result<Self, String> {
        let mut scenario = Scenario::named(&chosen.scenario).map_err(|error| error.to_string())?;
        scenario.site.latitude_deg = chosen.latitude_deg.unwrap_or(scenario.site.latitude_deg);
        scenario.site.azimuth_deg = chosen.azimuth_deg.unwrap_or(scenario.site.azimuth_deg);
        scenario.gyro.arw_deg_per_sqrt_h = chosen.arw_deg_per_sqrt_h.unwrap_or(scenario.gyro.arw_deg_per_sqrt_h);
        if let Some(violation) = scenario.violations().first() {
            return Err(format!("{} = {}: allowed is {}", violation.field(), violation.value, violation.allowed));
        }
        let mut settings = settings(&scenario).map_err(|error| error.to_string())?;
        if let Some(arw_deg_per_sqrt_h) = chosen.arw_deg_per_sqrt_h {
            declare_noise(&mut settings, arw_deg_per_sqrt_h);
        }
        if let Some(order) = &chosen.order {
            settings.sequence.order = order.clone();
        }
        settings.validate().map_err(|invalid| invalid.to_string())?;
        let world = World::new(&scenario, chosen.seed);
        store::save(&mut world.flash(), &settings).map_err(|error| format!("{error:?}"))?;
        Ok(Self {
            wired: Wired::power_up(&world),
            world,
            requests: RequestLine::default(),
            latitude_deg: scenario.site.latitude_deg,
            thresholds_deg_h: [settings.disturbance.threshold_deg_h, settings.jitter.threshold_deg_h],
        })
    }

    fn act(&mut self, act: &Act, reports: &mut Vec<Reported>) -> Result<(), String> {
        match *act {
            Act::Start => self.ask(Command::Start)?,
            Act::Abort => self.ask(Command::Abort)?,
            Act::Wait(ticks) => (0..ticks.min(MOST_TICKS)).for_each(|_| self.tick(reports)),
            Act::Turn(deg) => {
                self.world.turn(BY_HAND_S * (within(deg, 360.0)?.abs() / 90.0).max(0.2), deg);
            }
            Act::Shock(arcsec) => {
                let swing_arcsec = within(arcsec, 3600.0)?;
                let lasting_arcsec = LASTING * swing_arcsec;
                self.world
                    .shock([swing_arcsec, -0.7 * swing_arcsec, 0.3 * swing_arcsec], [lasting_arcsec, -lasting_arcsec]);
            }
            Act::Warm(kelvin) => self.world.warm_the_air(within(kelvin, 50.0)?),
            Act::Tilt([pitch_deg, roll_deg]) => {
                self.world.tilt(BY_HAND_S, within(pitch_deg, 20.0)?, within(roll_deg, 20.0)?);
            }
            Act::PowerUp(_) | Act::Scenarios => {}
        }
        Ok(())
    }

    fn ask(&mut self, command: Command) -> Result<(), String> {
        self.requests.send(&Ask::Command(command).into()).map_err(|_| "the request is too long".into())
    }

    fn tick(&mut self, reports: &mut Vec<Reported>) {
        let requests = self.requests.tick();
        self.wired.tick(&requests, &mut |_, _| (), &mut |report: Report| {
            if !matches!(report.event, Event::Raw(_) | Event::Settings(_) | Event::Answer { .. }) {
                reports.push(Reported::new(&report));
            }
        });
    }

    fn truth(&self) -> Truth {
        Truth {
            of_world: self.world.truth(),
            latitude_deg: self.latitude_deg,
            north_deg_h: north_finder::earth::earth_rate(self.latitude_deg).map_or(0.0, |rate| rate.north_deg_h),
            thresholds_deg_h: self.thresholds_deg_h,
        }
    }
}

fn within(value: f64, most: f64) -> Result<f64, String> {
    if value.abs() <= most { Ok(value) } else { Err(format!("{value}: allowed is -{most} to {most}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(bench: &mut Bench, act: Act) -> hal_sim::Truth {
        let answer = bench.act(act);
        assert_eq!(answer.error, None);
        answer.truth.unwrap().of_world
    }

    /// Ten seconds after somebody turned it by 30°, tilted it to 0.3° and −0.2°, and warmed the air by 10 K: of these a gyro of 900 s
    /// has taken 1 − exp(−10/900) = 0.01105, 0.1105 K.
    #[test]
    fn hands_do_what_they_say() {
        let mut bench = Bench::default();
        let before = truth(&mut bench, Act::PowerUp(Box::default()));
        for act in [Act::Turn(30.0), Act::Tilt([0.3, -0.2]), Act::Warm(10.0)] {
            truth(&mut bench, act);
        }
        let after = truth(&mut bench, Act::Wait(4000));
        assert!((after.azimuth_deg - before.azimuth_deg - 30.0).abs() < 1e-6, "{after:?}");
        assert!((after.pitch_deg - 0.3).abs() < 1e-9 && (after.roll_deg + 0.2).abs() < 1e-9, "{after:?}");
        assert!((after.temp_c - before.temp_c - 0.1105).abs() < 1e-3, "{after:?}");
    }

    #[test]
    fn what_cannot_be_is_refused_in_words() {
        let mut bench = Bench::default();
        let error = |bench: &mut Bench, act| bench.act(act).error.unwrap();
        assert_eq!(error(&mut bench, Act::Start), "the instrument has no power");
        let nowhere = Chosen { latitude_deg: Some(95.0), ..Chosen::default() };
        assert_eq!(
            error(&mut bench, Act::PowerUp(nowhere.into())),
            "site.latitude_deg = 95.0: allowed is -90.0 to 90.0"
        );
        let unknown = Chosen { scenario: "moon".into(), ..Chosen::default() };
        assert!(error(&mut bench, Act::PowerUp(unknown.into())).contains("moon"));
        truth(&mut bench, Act::PowerUp(Box::default()));
        assert_eq!(error(&mut bench, Act::Shock(1e9)), "1000000000: allowed is -3600 to 3600");
    }

    /// The settings of every scenario, merged here, are those that the host command stores.
    #[test]
    fn every_world_powers_up() {
        for (scenario, _) in Scenario::names() {
            let mut bench = Bench::default();
            truth(&mut bench, Act::PowerUp(Box::new(Chosen { scenario: scenario.into(), ..Chosen::default() })));
        }
    }
}
