//! Simulated voyages of a ship, written as recordings for `north track`: the block, and what aids it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use clap::ValueEnum;
use hal_sim::vessel::block::{Block, BlockClass};
use hal_sim::vessel::electrostatic::{Electrostatic, EsgClass, Orientation};
use hal_sim::vessel::globe;
use hal_sim::vessel::satellites::{Antennas, Receivers};
use hal_sim::vessel::ship::{Instant, Leg, Modulation, Passage, Voyage, Waves};
use hal_sim::vessel::water::{WaterClass, WaterInstruments};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::block_csv::{COLUMNS, REFERENCES, TURN};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::track::installation::{ElectrostaticGyro, Installation};

/// Voyages at 60° north.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum VoyageName {
    /// 40 min at a mooring, the block turned to and fro by 180°: satellites, phases over a baseline of 2 m
    Harbour,
    /// 40 min of zigzag in a seaway: satellites with 1 % outliers, lost from 20 to 25 min; heading of a baseline; log
    Coast,
    /// 20 min at the surface, then 40 min at 100 m: satellites and phases above, log, depth gauge, acoustic fixes and an
    /// electrostatic gyro below
    Dive,
}

/// Times of the dive, and of the loss of satellites off the coast, s.
const SURFACE_S: f64 = 1200.0;
const LOST_S: std::ops::Range<f64> = 1200.0..1500.0;
/// Share of satellite positions off the coast that are wrong.
const OUTLIERS: f64 = 0.01;
/// Intervals of the readings, rows of the block at 10 Hz.
const SECOND: usize = 10;
const MINUTE: usize = 600;
const ACOUSTIC: usize = 3000;
const LATITUDE_DEG: f64 = 60.0;
const HEADING_DEG: f64 = 40.0;
/// How far the rotor is off its order, degrees.
const OFF_DEG: f64 = 0.5;
const GYRO: EsgClass = EsgClass::TYPICAL;

impl VoyageName {
    /// As `--class` has it, and as it is simulated.
    fn block(self) -> (&'static str, BlockClass) {
        match self {
            Self::Harbour | Self::Coast => ("source-fog", BlockClass::FOG),
            Self::Dive => ("modern-mems", BlockClass::STIM300),
        }
    }

    fn sail(self) -> Passage {
        let amplitude_deg = if self == Self::Harbour { 180.0 } else { 0.0 };
        let modulation = Modulation { mean_deg: 90.0, ..Modulation::harmonic(amplitude_deg) };
        let hours = if self == Self::Dive { 1.0 } else { 2.0 / 3.0 };
        let moored = Voyage::moored(LATITUDE_DEG, hours, &[HEADING_DEG], 1.0);
        let under_way = |leg_s: f64, speed_m_s: f64, dive: bool| {
            (0..(hours * 3600.0 / leg_s) as u32).map(move |leg| Leg {
                until_s: f64::from(leg + 1) * leg_s,
                heading_deg: HEADING_DEG + if leg % 2 == 0 { 0.0 } else { 60.0 },
                speed_m_s,
                depth_m: if dive && f64::from(leg) * leg_s >= SURFACE_S { 100.0 } else { 0.0 },
            })
        };
        let current_m_s = [0.2, -0.1];
        match self {
            Self::Harbour => Voyage { modulation, ..moored },
            Self::Coast => {
                let legs = under_way(300.0, 4.0, false).collect();
                Voyage { legs, waves: Waves::SEA, modulation, current_m_s, ..moored }
            }
            Self::Dive => {
                let legs = under_way(600.0, 3.0, true).collect();
                let waves = Waves { roll_deg: 2.0, pitch_deg: 1.0, yaw_deg: 0.5, heave_m: 0.3, period_s: 8.0 };
                Voyage { legs, waves, modulation, current_m_s, ..moored }
            }
        }
        .sail()
    }
}

/// A file of readings in the making.
struct Readings {
    name: &'static str,
    text: String,
}

impl Readings {
    fn new(name: &'static str, columns: &str) -> Self {
        Self { name, text: format!("t_s,{columns}\n") }
    }

    fn row(&mut self, t_s: f64, values: &[f64]) {
        let _ = write!(self.text, "{}", rounded(t_s));
        for value in values {
            let _ = write!(self.text, ",{value}");
        }
        self.text.push('\n');
    }
}

/// What lies beyond microseconds comes from the arithmetic.
fn rounded(t_s: f64) -> f64 {
    (1e6 * t_s).round() / 1e6
}

/// Writes the voyage into a new or empty folder; says how it is read.
///
/// Errors: a folder with something in it, or that cannot be written.
pub fn write(name: VoyageName, seed: u64, folder: &Path) -> Result<String, Failure> {
    let failed = |error: std::io::Error| FileError::whole(folder, error);
    fs::create_dir_all(folder).map_err(failed)?;
    if fs::read_dir(folder).map_err(failed)?.next().is_some() {
        return Err(FileError::whole(folder, Problem::FolderNotEmpty).into());
    }
    let passage = name.sail();
    let antennas = Antennas {
        antenna_m: Vector3::new(0.5, 2.0, 8.0),
        baseline_m: Vector3::new(2.0, 0.0, 0.0),
        velocity_m_s: 0.1,
        position_m: 5.0,
        phase_m: 0.003,
    };
    let rotor = Electrostatic::new(GYRO, Orientation::Polar, 0.0, OFF_DEG, seed);
    let installation = installation(name, &antennas, &rotor, seed);
    let mut files = readings(name, &passage, antennas, rotor, seed);
    files.insert(0, block(name, &passage, seed));
    for Readings { name, text } in &files {
        let path = folder.join(name);
        crate::output::write(&path, text).map_err(|error| FileError::whole(&path, error))?;
    }
    let path = folder.join("installation.toml");
    let text = toml::to_string(&installation).map_err(|error| Failure::Refused(error.to_string()))?;
    crate::output::write(&path, text).map_err(|error| FileError::whole(&path, error))?;
    Ok(command(name, folder, &files))
}

/// How the voyage is tracked.
fn command(name: VoyageName, folder: &Path, files: &[Readings]) -> String {
    let folder = folder.display();
    let aid: String = files.iter().skip(1).map(|file| format!(" --aid {folder}/{}", file.name)).collect();
    let mode = if name == VoyageName::Dive { " --mode aided --mode submerged@1200" } else { "" };
    format!(
        "north track {folder}/block.csv --latitude {LATITUDE_DEG} --heading {HEADING_DEG} --heading-sigma 3 --align 60 \\\n  --class {} \
         --installation {folder}/installation.toml{mode} \\\n {aid} \\\n  --out {folder}/track.csv --report {folder}/track.html",
        name.block().0
    )
}

fn block(name: VoyageName, passage: &Passage, seed: u64) -> Readings {
    let mut block = Block::new(name.block().1, seed);
    let mut file = Readings::new("block.csv", &[&COLUMNS[1..], &[TURN], &REFERENCES].concat().join(","));
    for step in &passage.steps {
        let (angle_rad, velocity_m_s) = block.read(step, passage.interval_s);
        let [gx, gy, gz] = angle_rad.map(|angle| angle.to_degrees() * 3600.0);
        let [ax, ay, az] = velocity_m_s.map(|velocity| velocity / passage.interval_s);
        let (latitude, longitude, _) = globe::geodetic(&step.end.position_m);
        let turn_deg = step.end.turn_rad.to_degrees() - 90.0;
        let heading_deg = step.end.heading_deg().rem_euclid(360.0);
        file.row(step.end.t_s, &[gx, gy, gz, ax, ay, az, turn_deg, heading_deg, latitude, longitude]);
    }
    file
}

fn installation(name: VoyageName, antennas: &Antennas, rotor: &Electrostatic, seed: u64) -> Installation {
    let forward_left_up = |hull: Vector3<f64>| [hull.y, -hull.x, hull.z];
    let [x, y, z, unbalance_deg_h, stiffness_deg_h] = rotor.coefficients_deg_h(EsgClass::CALIBRATED_DEG_H, seed);
    let gyro = ElectrostaticGyro {
        declination_deg: 90.0,
        hour_angle_deg: 0.0,
        direction_sigma_deg: OFF_DEG,
        pick_off_arcsec: GYRO.pick_off_arcsec,
        reading_arcsec: GYRO.reading_arcsec,
        drift_deg_h: GYRO.drift_deg_h,
        drift_growth_deg_h_per_sqrt_h: GYRO.drift_growth_deg_h_per_sqrt_h,
        // A polar rotor was calibrated in the axes of this block.
        block_deg_h: [x, y, z],
        unbalance_deg_h,
        stiffness_deg_h,
        coefficient_sigma_deg_h: EsgClass::CALIBRATED_DEG_H,
    };
    Installation {
        antenna_m: forward_left_up(antennas.antenna_m),
        baseline_m: forward_left_up(antennas.baseline_m),
        electrostatic_gyro: (name == VoyageName::Dive).then_some(gyro),
        ..Installation::default()
    }
}

fn readings(
    name: VoyageName,
    passage: &Passage,
    antennas: Antennas,
    mut rotor: Electrostatic,
    seed: u64,
) -> Vec<Readings> {
    let phase = |n: u32| format!("phase{n}_m,phase{n}_east,phase{n}_north,phase{n}_up,phase{n}_pair");
    let mut satellites = Readings::new("satellites.csv", "ve_m_s,vn_m_s,vu_m_s,lat_deg,lon_deg,height_m");
    let mut phases = Readings::new("phases.csv", &[1, 2, 3, 4].map(phase).join(","));
    let mut baseline = Readings::new("baseline.csv", "baseline_heading_deg");
    let mut log = Readings::new("log.csv", "log_m_s,log_starboard_m_s");
    let mut depth = Readings::new("depth.csv", "depth_m,sigma_depth_m");
    let mut acoustic = Readings::new("acoustic.csv", "acoustic_lat_deg,acoustic_lon_deg");
    let mut esg = Readings::new("esg.csv", "esg_x,esg_y,esg_z,esg_sensor");

    let mut receivers = Receivers::new(antennas, seed);
    let mut water = WaterInstruments::new(WaterClass { acoustic_outliers: 0.0, ..WaterClass::USUAL }, seed);
    let mut random = ChaCha8Rng::seed_from_u64(!seed);
    let mut last = passage.start;
    for (number, step) in (1..).zip(&passage.steps) {
        let at = &step.end;
        rotor.advance(step, passage.interval_s);
        let second = number % SECOND == 0;
        let below = name == VoyageName::Dive && at.t_s > SURFACE_S;
        let lost = below || name == VoyageName::Coast && LOST_S.contains(&at.t_s);
        if !lost && name != VoyageName::Coast {
            let values: Vec<f64> = receivers
                .phases(at)
                .iter()
                .flat_map(|line| {
                    [line.phase_m, line.direction.x, line.direction.y, line.direction.z, f64::from(line.pair)]
                })
                .collect();
            phases.row(at.t_s, &values);
        }
        if second {
            let velocity = receivers.velocity_m_s(&last, at);
            let (latitude, longitude, mut height_m) = receivers.position(at);
            last = *at;
            if name == VoyageName::Coast && random.random::<f64>() < OUTLIERS {
                height_m += 300.0;
            }
            if !lost {
                satellites.row(at.t_s, &[velocity.x, velocity.y, velocity.z, latitude, longitude, height_m]);
                baseline.row(at.t_s, &[baseline_heading_deg(at, &antennas, &mut water)]);
            }
            let [starboard, forward] = water.log_m_s(at);
            log.row(at.t_s, &[forward, starboard]);
            // At the surface the sea is the gauge, its heave the noise.
            let (depth_m, sigma_m) = if below { (-water.height_m(at), 0.3) } else { (0.0, 0.5) };
            depth.row(at.t_s, &[depth_m, sigma_m]);
        }
        if number % MINUTE == 0 {
            let (direction, sensor) = rotor.read(at);
            esg.row(at.t_s, &[direction.x, direction.y, direction.z, f64::from(sensor)]);
        }
        if below && number % ACOUSTIC == 0 {
            let (latitude, longitude) = water.acoustic_fix(at);
            acoustic.row(at.t_s, &[latitude, longitude]);
        }
    }
    match name {
        VoyageName::Harbour => vec![satellites, phases],
        VoyageName::Coast => vec![satellites, baseline, log],
        VoyageName::Dive => vec![satellites, phases, log, depth, acoustic, esg],
    }
}

/// Of the second antenna from the first, with the noise of a heading.
fn baseline_heading_deg(at: &Instant, antennas: &Antennas, water: &mut WaterInstruments) -> f64 {
    let baseline = at.attitude() * antennas.baseline_m;
    let noise_deg = water.heading_deg(at) - at.heading_deg();
    (baseline.x.atan2(baseline.y).to_degrees() + noise_deg).rem_euclid(360.0)
}
