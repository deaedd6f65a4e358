//! The diagnosis on hidden effects: a small part of `north bench diagnose`, with a fixed seed; in `make test` few
//! campaigns, in `make proofs` all.

use std::ops::Range;

use north::diagnose::{Options, diagnose};
use north::settings_file::declare_noise;
use proofs::composed;
use proofs::hidden::{Campaign, Family};
use proofs::judge::{Attribution, Verdict, consult, judge, write};

const SEED: u64 = 20;

fn verdict(family: Family, number: u64) -> Verdict {
    let generated = Campaign::draw(family, SEED, number);
    let folder = tempfile::tempdir().unwrap();
    let campaign = write(&generated, folder.path()).unwrap();
    let mut options = Options::default();
    declare_noise(&mut options.settings, generated.arw_deg_per_sqrt_h);
    let diagnosis = diagnose(&campaign, &options).map_err(|refusal| refusal.to_string());
    judge(&generated, number, &diagnosis, &consult(&generated, &options.settings))
}

/// Sums of squared errors of the check runs before, after and by the oracle, in noise variances; and their number.
fn squares(verdicts: &[Verdict]) -> [f64; 4] {
    verdicts.iter().flat_map(|verdict| &verdict.errors).fold([0.0; 4], |[before, after, oracle, count], errors| {
        [before + errors.before.powi(2), after + errors.after.powi(2), oracle + errors.oracle.powi(2), count + 1.0]
    })
}

fn verdicts(family: Family, campaigns: u64) -> Vec<Verdict> {
    (0..campaigns).map(|number| verdict(family, number)).collect()
}

fn are_named_and_taken_out(family: Family, campaigns: u64) {
    let verdicts = verdicts(family, campaigns);
    for verdict in verdicts.iter().filter(|verdict| verdict.visible) {
        let named = matches!(verdict.attribution, Attribution::Right | Attribution::Ambiguous);
        assert!(named, "{}: {:?}", verdict.hidden, verdict.found);
    }
    // What a campaign cannot tell apart it cannot be asked to take out as one who knows.
    let named: Vec<Verdict> =
        verdicts.into_iter().filter(|verdict| verdict.attribution == Attribution::Right).collect();
    let [before, after, oracle, count] = squares(&named);
    if count == 0.0 {
        return;
    }
    // Both solve the same noise, so that their ratio scatters less than that of independent rms values, whose
    // relative standard deviation is 1/√n: three of those beyond the aim of 1.2.
    let limit = 1.2 * (1.0 + 3.0 / count.sqrt());
    assert!((after / oracle).sqrt() < limit, "{}: {before} {after} {oracle} of {count}", family.name());
    assert!(after < 1.1 * before, "{}: {before} {after}", family.name());
}

fn are_unexplained_or_covered(family: Family, campaigns: u64) {
    let silent: Vec<_> = verdicts(family, campaigns).into_iter().filter(|verdict| !verdict.unexplained).collect();
    let errors: Vec<_> = silent.iter().flat_map(|verdict| &verdict.errors).collect();
    let covered = errors.iter().filter(|errors| errors.after.abs() <= 1.96 * errors.sigma_after).count();
    // No family may hold less than 85 % of its check runs in 95 % intervals; three binomial sigmas of so few runs below.
    let number = errors.len() as f64;
    let least = 0.85 * number - 3.0 * (0.85 * 0.15 * number).sqrt();
    assert!(covered as f64 >= least, "{}: {covered} of {number}", family.name());
    // And better than before, wherever it is not said to be unexplained.
    let [before, after, ..] = squares(&silent);
    assert!(silent.is_empty() || after < before, "{}: {before} {after}", family.name());
}

/// The first campaign of two families: of nothing, and of one with a name.
#[test]
#[ignore = "a long search: make proofs"]
fn one_campaign_of_a_kind() {
    let nothing = verdict(Family::Nothing, 0);
    assert!(nothing.false_effects == 0 && nothing.refusal.is_none());
    are_named_and_taken_out(Family::ChannelValue, 1);
}

#[test]
#[ignore = "a long search: make proofs"]
fn a_campaign_of_an_effect_without_a_name() {
    are_unexplained_or_covered(Family::TwoChannels, 1);
}

#[test]
#[ignore = "twelve campaigns: make proofs"]
fn campaigns_with_nothing_in_them_yield_nothing() {
    let verdicts = verdicts(Family::Nothing, 12);
    // At one false discovery in twenty, four or more of twelve happen once in 450 times.
    let named = verdicts.iter().filter(|verdict| verdict.false_effects > 0).count();
    assert!(named < 4, "{named} of 12");
    assert!(verdicts.iter().all(|verdict| verdict.refusal.is_none()));
}

#[test]
#[ignore = "five campaigns of every family: make proofs"]
fn effects_are_named_and_taken_out_as_by_an_oracle() {
    // Nothing cannot be named; a step between runs is a bias, which every run has anyway. Curves with a sharp bend miss the
    // aim in a few campaigns, as docs/hidden-effects.md says.
    let left_out = [Family::Nothing, Family::StepBetween, Family::ChannelCurve];
    for family in Family::BASIC.into_iter().filter(|family| !family.is_foreign() && !left_out.contains(family)) {
        are_named_and_taken_out(family, 5);
    }
}

#[test]
#[ignore = "five campaigns of every family: make proofs"]
fn foreign_effects_are_said_to_be_unexplained_or_taken_out_with_a_sigma_that_holds() {
    for family in Family::BASIC.into_iter().filter(|family| family.is_foreign()) {
        are_unexplained_or_covered(family, 5);
    }
}

/// Azimuth and sigma of every check run by the model's file are those that were reported, with all digits.
fn the_written_model_is_the_reported_one(numbers: Range<u64>) {
    for number in numbers {
        let kind = [composed::Kind::Inside, composed::Kind::Outside, composed::Kind::Empty][(number % 3) as usize];
        let folder = tempfile::tempdir().unwrap();
        composed::Campaign::draw(SEED, number, kind).write(folder.path()).unwrap();
        let verdict = composed::judge::judge(folder.path(), number).unwrap();
        assert_eq!(verdict.refusal, None, "{kind:?} {number}: {:?}", verdict.found);
        let [by_model, reported] =
            [verdict.model, verdict.reported].map(|azimuths| azimuths.map(|each| (each.errors_deg, each.sigmas_deg)));
        assert_eq!(by_model, reported, "{kind:?} {number}: {:?}", verdict.found);
    }
}

/// One that is searched quickly.
#[test]
fn the_written_model_is_the_reported_one_in_a_campaign() {
    the_written_model_is_the_reported_one(45..46);
}

#[test]
#[ignore = "a hundred campaigns: make proofs"]
fn the_written_model_is_the_reported_one_in_a_hundred_campaigns() {
    the_written_model_is_the_reported_one(0..100);
}
