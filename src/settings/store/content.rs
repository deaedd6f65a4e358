//! The settings of a record, read where they stay.
//!
//! They are in the order in which [`Settings`] is written, and nothing is between them. What is derived for reading them would
//! copy them once for every level of nesting: tens of kilobytes of a board's stack.

use heapless::Vec;
use postcard::Deserializer;
use postcard::de_flavors::Slice;
use serde::Deserialize;

use crate::effects::doubt::{Kernel, Process};
use crate::effects::effect::Port;
use crate::effects::{Doubt, ErrorModel};
use crate::sensing::sample::GyroSettings;
use crate::settings::{AnalogueSettings, IndexSettings, LevelSettings, LinkSettings, Settings};

type Content<'a> = Deserializer<'a, Slice<'a>>;

/// Reads settings of a version. `None`, and `settings` may be anything, where the content is not theirs.
pub fn read(content: &[u8], version: u16, settings: &mut Settings) -> Option<()> {
    let mut content = Content::from_bytes(content);
    let from = &mut content;
    let Settings {
        latitude_deg,
        gyro,
        level,
        disturbance,
        jitter,
        index,
        sequence,
        time_limit_s,
        model,
        accelerometer,
        block,
        link,
        analogue,
    } = settings;
    set(from, latitude_deg)?;
    read_gyro(from, version, gyro)?;
    read_level(from, version, level)?;
    set(from, disturbance)?;
    set(from, jitter)?;
    read_index(from, version, index)?;
    set(from, sequence)?;
    set(from, time_limit_s)?;
    *model = None;
    if next(from)? {
        read_model(from, version, model.insert(ErrorModel::default()))?;
    }
    set(from, accelerometer)?;
    set(from, block)?;
    *link = if version < 9 { LinkSettings::default() } else { next(from)? };
    *analogue = if version < 9 { AnalogueSettings::default() } else { next(from)? };
    content.finalize().is_ok_and(<[u8]>::is_empty).then_some(())
}

/// Before version 9 without the noise of the angle, and taken as it was set by hand.
fn read_gyro(from: &mut Content<'_>, version: u16, gyro: &mut GyroSettings) -> Option<()> {
    let GyroSettings {
        format,
        arw_deg_per_sqrt_h,
        angle_noise_arcsec,
        bias_instability_deg_h,
        drift_deg_h_per_h,
        bias_limit_deg_h,
        range_deg_h,
        repairable_frames,
        configure,
    } = gyro;
    set(from, format)?;
    set(from, arw_deg_per_sqrt_h)?;
    *angle_noise_arcsec = if version < 9 { 0.0 } else { next(from)? };
    set(from, bias_instability_deg_h)?;
    set(from, drift_deg_h_per_h)?;
    set(from, bias_limit_deg_h)?;
    set(from, range_deg_h)?;
    set(from, repairable_frames)?;
    *configure = version >= 9 && next(from)?;
    Some(())
}

/// Before version 7 without what the readings drift by.
fn read_level(from: &mut Content<'_>, version: u16, level: &mut LevelSettings) -> Option<()> {
    let LevelSettings { limit_deg, sigma_deg, seconds, timeout_s, drift_mg_per_k, wander_mg_per_sqrt_h } = level;
    set(from, limit_deg)?;
    set(from, sigma_deg)?;
    set(from, seconds)?;
    set(from, timeout_s)?;
    if version < 7 {
        let standard = LevelSettings::default();
        (*drift_mg_per_k, *wander_mg_per_sqrt_h) = (standard.drift_mg_per_k, standard.wander_mg_per_sqrt_h);
        return Some(());
    }
    set(from, drift_mg_per_k)?;
    set(from, wander_mg_per_sqrt_h)
}

/// Before version 8 without the motor's microsteps and the slip ring, before version 9 without the travel and the limit switch.
fn read_index(from: &mut Content<'_>, version: u16, index: &mut IndexSettings) -> Option<()> {
    let IndexSettings {
        tolerance_deg,
        sigma_deg,
        retries,
        speed_deg_s,
        acceleration_deg_s2,
        hold_current,
        microsteps_per_turn,
        slip_ring,
        travel_from_deg,
        travel_deg,
        limit_switch,
    } = index;
    set(from, tolerance_deg)?;
    set(from, sigma_deg)?;
    set(from, retries)?;
    set(from, speed_deg_s)?;
    set(from, acceleration_deg_s2)?;
    set(from, hold_current)?;
    let standard = IndexSettings::default();
    (*microsteps_per_turn, *slip_ring) = (standard.microsteps_per_turn, standard.slip_ring);
    (*travel_from_deg, *travel_deg) = (standard.travel_from_deg, standard.travel_deg);
    if version >= 8 {
        set(from, microsteps_per_turn)?;
        set(from, slip_ring)?;
    }
    *limit_switch = standard.limit_switch;
    if version >= 9 {
        set(from, travel_from_deg)?;
        set(from, travel_deg)?;
        set(from, limit_switch)?;
    }
    Some(())
}

/// Before version 10 without what the levels change by themselves; before version 11 without readings that
/// can be, and a process was in the rate.
fn read_model(from: &mut Content<'_>, version: u16, model: &mut ErrorModel) -> Option<()> {
    let ErrorModel {
        scale_error,
        bias_deg_h,
        level_drift_arcsec,
        plausible,
        terms,
        rate_terms,
        index_error,
        earth_field,
        base_motion,
        sinusoid,
        effects,
        doubt: Doubt { azimuth_sigma_deg, directions, process },
    } = model;
    set(from, scale_error)?;
    set(from, bias_deg_h)?;
    *level_drift_arcsec = if version < 10 { 0.0 } else { next(from)? };
    plausible.clear();
    if version >= 11 {
        list(from, plausible)?;
    }
    list(from, terms)?;
    list(from, rate_terms)?;
    set(from, index_error)?;
    set(from, earth_field)?;
    set(from, base_motion)?;
    set(from, sinusoid)?;
    list(from, effects)?;
    set(from, azimuth_sigma_deg)?;
    list(from, directions)?;
    if version < 11 {
        let of_rate = |(kernel, sigma_deg_h, time_s)| Process { port: Port::Rate, kernel, sigma_deg_h, time_s };
        *process = next::<Option<(Kernel, f64, f64)>>(from)?.map(of_rate);
        return Some(());
    }
    set(from, process)
}

fn next<'a, T: Deserialize<'a>>(from: &mut Content<'a>) -> Option<T> {
    T::deserialize(from).ok()
}

/// Never inlined: what a value takes of the stack while it is read is free again for the next one.
#[inline(never)]
fn set<'a, T: Deserialize<'a>>(from: &mut Content<'a>, place: &mut T) -> Option<()> {
    *place = next(from)?;
    Some(())
}

fn list<'a, T: Deserialize<'a>, const N: usize>(from: &mut Content<'a>, list: &mut Vec<T, N>) -> Option<()> {
    list.clear();
    for _ in 0..next::<usize>(from)? {
        list.push(next(from)?).ok()?;
    }
    Some(())
}
