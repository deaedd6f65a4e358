//! `north bench blunders`: campaigns with one wrong reference, or two that are exchanged, and what the diagnosis makes of them.

use std::io::Write;

use clap::Args;
use north::campaign::{Campaign, Role};
use north::diagnose::{Diagnosis, Options, diagnose};
use north::failure::Failure;
use north::interrupt;
use north::progress;
use north::settings_file::declare_noise;
use north_finder::units::{wrap_180_deg, wrap_360_deg};
use serde::Serialize;

use super::Bench;
use crate::hidden::draw::Draw;
use crate::hidden::{Campaign as Generated, Family};
use crate::judge::write;
use crate::statistics::MISSING_DEG;

/// A wrong reference among right ones: is it named, is anything invented, and what does it cost?
///
/// By turns one reference of a training run is wrong by 8 to 40 sigmas (of the run's azimuth, the survey and the index together), or two that lie at
/// least so far apart are exchanged; by turns nothing else is in the campaign, or an effect that all runs see. Every campaign is diagnosed with and without
/// the blunder.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench blunders --campaigns 20 --seed 3")]
pub struct BlundersBench {
    /// How many campaigns, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    campaigns: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print every campaign
    #[arg(long)]
    verbose: bool,
}

/// Fewest training runs with a reference.
const LEAST_RUNS: usize = 8;
/// Least and most of a blunder, sigmas.
const SIGMAS: [f64; 2] = [8.0, 40.0];
/// One sigma of the index beside the survey, degrees: what the diagnosis allows for.
const INDEX_SIGMA_DEG: f64 = 0.01;
/// Effects that every run of a campaign sees.
const EFFECTS: [Family; 4] = [Family::ChannelValue, Family::Drift, Family::AfterMove, Family::BodyHarmonic];

/// What became of one campaign, or the sums over all.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    campaigns: usize,
    /// Diagnoses that name more effects than without the blunder.
    invented: usize,
    /// Wrong references, and those of them that are named (exchanged ones with each other).
    wrong: usize,
    named: usize,
    /// Right references, and those of them that are named.
    right: usize,
    named_falsely: usize,
    /// Sums of squared errors of the check runs with and without the blunder, in variances of the campaign's azimuth noise; both of all check runs.
    with: f64,
    without: f64,
}

impl Row {
    fn add(&mut self, other: &Self) {
        self.campaigns += other.campaigns;
        self.invented += other.invented;
        self.wrong += other.wrong;
        self.named += other.named;
        self.right += other.right;
        self.named_falsely += other.named_falsely;
        self.with += other.with;
        self.without += other.without;
    }
}

impl Bench for BlundersBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.campaigns, "campaigns");
        let mut rows = vec![Row::default(); 2];
        let mut number = 0;
        while rows.iter().map(|row| row.campaigns as u64).sum::<u64>() < self.campaigns {
            if interrupt::requested() {
                return Err(Failure::Interrupted);
            }
            if let Some(row) = self.one(number, out)? {
                rows[(number % 2) as usize].add(&row);
                bar.inc(1);
            }
            number += 1;
        }
        bar.finish_and_clear();
        writeln!(
            out,
            "| blunder | campaigns | effects invented | wrong references named | right ones named | azimuths with / without it, rms |"
        )?;
        writeln!(out, "|---|---|---|---|---|---|")?;
        for (name, row) in ["one wrong reference", "two exchanged"].into_iter().zip(&rows) {
            let Row { campaigns, invented, wrong, named, right, named_falsely, with, without } = row;
            let ratio = (with / without).sqrt();
            writeln!(
                out,
                "| {name} | {campaigns} | {invented} | {named} of {wrong} | {named_falsely} of {right} | {ratio:.2} |"
            )?;
        }
        Ok(rows)
    }
}

impl BlundersBench {
    /// `None` where the drawn campaign has too few surveyed runs, or no two headings that may be exchanged.
    fn one(&self, number: u64, out: &mut dyn Write) -> Result<Option<Row>, Failure> {
        let mut draw = Draw::new(self.seed, number << 32);
        let has_effect = number / 2 % 2 == 1;
        let family = if has_effect { EFFECTS[(number / 4) as usize % EFFECTS.len()] } else { Family::Nothing };
        let generated = Generated::draw(family, self.seed, number);
        let folder = tempfile::tempdir()?;
        let campaign = write(&generated, folder.path())?;
        let Some(blundered) = self.blundered(&generated, &campaign, number % 2 == 1, &mut draw) else {
            return Ok(None);
        };
        let mut options = Options::default();
        declare_noise(&mut options.settings, generated.arw_deg_per_sqrt_h);
        let of = |campaign: &Campaign| diagnose(campaign, &options);
        let (Ok(with), Ok(without)) = (of(&blundered), of(&campaign)) else { return Ok(None) };
        let is_wrong = |i: usize| blundered.runs[i].reference_azimuth_deg != campaign.runs[i].reference_azimuth_deg;
        let wrong: Vec<usize> = (0..campaign.runs.len()).filter(|&i| is_wrong(i)).collect();
        let named = |i: usize| {
            let missed = with.missed_references.iter().find(|each| each.file == campaign.runs[i].file)?;
            let other = wrong.iter().find(|&&other| other != i).map(|&other| campaign.runs[other].file.clone());
            Some(wrong.contains(&i) && missed.exchanged_with == other)
        };
        let surveyed = (0..campaign.runs.len())
            .filter(|&i| campaign.runs[i].role == Role::Fit && campaign.runs[i].reference_azimuth_deg.is_some());
        let right: Vec<usize> = surveyed.filter(|i| !wrong.contains(i)).collect();
        let noise_deg = generated.azimuth_noise_deg();
        let squares = |diagnosis: &Diagnosis| -> f64 {
            let of_run = |(run, truth): (&north::diagnose::RunDiagnosis, &crate::hidden::Run)| {
                let miss_deg = |azimuth_deg: f64| wrap_180_deg(azimuth_deg - truth.azimuth_deg);
                let error_deg = run.azimuth_after_deg.map_or(MISSING_DEG, miss_deg);
                (run.role != Role::Fit).then_some((error_deg / noise_deg).powi(2))
            };
            diagnosis.runs.iter().zip(&generated.runs).filter_map(of_run).sum()
        };
        let row = Row {
            campaigns: 1,
            invented: usize::from(with.effects.len() > without.effects.len()),
            named: wrong.iter().filter(|&&i| named(i) == Some(true)).count(),
            wrong: wrong.len(),
            named_falsely: right.iter().filter(|&&i| named(i).is_some()).count(),
            right: right.len(),
            with: squares(&with),
            without: squares(&without),
        };
        if self.verbose {
            writeln!(
                out,
                "{number} {}: wrong {wrong:?}, named {}, falsely {}, {:.1} for {:.1}\n    with it: {}\n    without: {}",
                family.name(),
                row.named,
                row.named_falsely,
                row.with,
                row.without,
                with.verdict,
                without.verdict
            )?;
        }
        Ok(Some(row))
    }

    fn blundered(
        &self,
        generated: &Generated,
        campaign: &Campaign,
        exchange: bool,
        draw: &mut Draw,
    ) -> Option<Campaign> {
        let surveyed: Vec<(usize, f64)> = campaign
            .runs
            .iter()
            .enumerate()
            .filter(|(_, run)| run.role == Role::Fit)
            .filter_map(|(i, run)| Some((i, run.reference_azimuth_deg?)))
            .collect();
        if surveyed.len() < LEAST_RUNS {
            return None;
        }
        let sigma_deg = |i: usize| {
            generated.azimuth_noise_deg().hypot(generated.runs[i].reference_sigma_deg).hypot(INDEX_SIGMA_DEG)
        };
        let mut blundered = campaign.clone();
        let (i, own_deg) = draw.pick(&surveyed);
        if exchange {
            let far = |&&(j, deg): &&(usize, f64)| {
                j != i && wrap_180_deg(deg - own_deg).abs() > SIGMAS[0] * sigma_deg(i).hypot(sigma_deg(j))
            };
            let others: Vec<(usize, f64)> = surveyed.iter().filter(far).copied().collect();
            if others.is_empty() {
                return None;
            }
            let (j, other_deg) = draw.pick(&others);
            blundered.runs[i].reference_azimuth_deg = Some(other_deg);
            blundered.runs[j].reference_azimuth_deg = Some(own_deg);
        } else {
            let wrong_deg = draw.sign() * draw.uniform(SIGMAS[0], SIGMAS[1]) * sigma_deg(i);
            blundered.runs[i].reference_azimuth_deg = Some(wrap_360_deg(own_deg + wrong_deg));
        }
        Some(blundered)
    }
}
