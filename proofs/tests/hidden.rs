//! The generator of campaigns with hidden effects: repeatable, sensible, and with the signs that its words say.

use proofs::hidden::{Campaign, Family, Group, Part, Proposed, Row};
use std::collections::HashSet;

/// Earth's rotation, °/h.
const EARTH_DEG_H: f64 = 15.041_067;

/// Rows of the first run with one part of this size, and without.
fn pairs(campaign: &Campaign, size: f64, part: Part) -> Vec<(Row, Row)> {
    let with = campaign.run_with(0, &[(size, part)]).unwrap();
    let without = campaign.run_with(0, &[]).unwrap();
    with.rows.into_iter().zip(without.rows).collect()
}

/// A campaign in which nothing is hidden.
fn campaign() -> Campaign {
    Campaign::draw(Family::Nothing, 11, 0)
}

/// Whether the index rests in a row.
fn rests(rows: &[(Row, Row)], number: usize) -> bool {
    number > 0 && (rows[number].1.index_deg - rows[number - 1].1.index_deg).abs() < 0.1
}

#[test]
fn the_same_seed_gives_the_same_campaign() {
    for family in Family::all() {
        let first = Campaign::draw(family, 5, 2);
        let again = Campaign::draw(family, 5, 2);
        assert_eq!(first.runs, again.runs, "{}", family.name());
        assert_eq!(first.effect, again.effect);
        // The hidden effect is all that stands between a campaign and the same without it.
        assert_eq!(first.run_with(0, &first.effect.parts).as_ref(), first.runs.first());
    }
    let runs = |seed, number| Campaign::draw(Family::BASIC[0], seed, number).runs;
    assert_ne!(runs(5, 2), runs(5, 3));
    assert_ne!(runs(5, 2), runs(6, 2));
}

#[test]
fn campaigns_are_such_as_people_record() {
    for family in Family::BASIC {
        for number in 0..3 {
            let campaign = Campaign::draw(family, 3, number);
            assert!((8..=36).contains(&campaign.runs.len()));
            assert!((10.0..=65.0).contains(&campaign.latitude_deg.abs()));
            assert!(campaign.runs.iter().filter(|run| run.may_learn).count() >= 4);
            assert!(campaign.runs.iter().filter(|run| !run.may_learn).count() >= 3);
            let names: HashSet<&String> = campaign.channels.iter().collect();
            assert_eq!(names.len(), campaign.channels.len());
            for run in &campaign.runs {
                assert!((60..=420).contains(&run.rows.len()), "{}", run.rows.len());
                for (second, row) in (1..).zip(&run.rows) {
                    assert_eq!(row.t_s, f64::from(second));
                    assert!(row.fog_arcsec.is_finite() && row.channels.iter().all(|value| value.is_finite()));
                    assert_eq!(row.channels.len(), campaign.channels.len());
                }
            }
        }
    }
}

#[test]
fn hidden_effects_stand_out_of_the_noise_and_nothing_is_nothing() {
    let nothing = campaign();
    assert!(nothing.effect.parts.is_empty());
    assert_eq!(nothing.run_with(0, &[]).as_ref(), nothing.runs.first());
    for family in Family::all().into_iter().filter(|family| *family != Family::Nothing) {
        let hidden = Campaign::draw(family, 4, 1);
        assert!(hidden.effect.parts.iter().any(|(size, _)| size.abs() > 0.0), "{}", family.name());
        assert!(hidden.effect.parts.iter().all(|(size, _)| size.is_finite()));
    }
}

#[test]
fn a_channel_moves_the_rate_and_nothing_else() {
    let campaign = Campaign::draw(Family::ChannelValue, 8, 0);
    for (with, without) in pairs(&campaign, 0.5, Part::Drift) {
        // Half of t in hours, at the middle of the second.
        let expected = 0.5 * (with.t_s - 0.5) / 3600.0;
        assert!((with.fog_arcsec - without.fog_arcsec - expected).abs() < 1e-9);
        assert_eq!((with.index_deg, with.level_g), (without.index_deg, without.level_g));
        assert_eq!(with.channels, without.channels);
    }
}

#[test]
fn sensors_read_too_large_by_what_is_hidden() {
    let campaign = campaign();
    for (with, without) in pairs(&campaign, 0.3, Part::IndexZero) {
        assert!((with.index_deg - without.index_deg - 0.3).abs() < 1e-9);
        assert_eq!(with.fog_arcsec, without.fog_arcsec);
    }
    for (with, without) in pairs(&campaign, 2.0, Part::LevelBias { left: true }) {
        assert!((with.level_g[1] - without.level_g[1] - 0.002).abs() < 1e-9);
        assert_eq!(with.level_g[0], without.level_g[0]);
    }
    let rows = pairs(&campaign, 0.1, Part::Eccentricity { sine: true });
    for number in (0..rows.len()).filter(|&number| rests(&rows, number)) {
        let (with, without) = &rows[number];
        let expected = 0.1 * without.index_deg.to_radians().sin();
        assert!((with.index_deg - without.index_deg - expected).abs() < 1e-4);
    }
}

/// sin 3° = 0.05234 forward; to the left, with the pitch of 3°, sin 3° · cos 3° = 0.05226. The mount stands within 0.4° and the means within
/// 0.0001 g of that.
#[test]
fn a_proposed_run_leans_its_mount() {
    let order_deg = vec![0.0, 90.0, 180.0, 270.0];
    let proposed = Proposed { order_deg, headings_deg: vec![22.5], dwell_s: 30, warm_up_s: 0, lean_deg: [3.0; 2] };
    let followed = campaign().followed_by(&proposed, 1);
    let mean = |rows: &[Row], axis: usize| rows.iter().map(|row| row.level_g[axis]).sum::<f64>() / rows.len() as f64;
    let (usual, leaning) = (followed.runs.first().unwrap(), followed.runs.last().unwrap());
    for (axis, expected_g) in [0.05234, 0.05226].into_iter().enumerate() {
        let more_g = mean(&leaning.rows, axis) - mean(&usual.rows, axis);
        assert!((more_g - expected_g).abs() < 1.2e-4, "axis {axis}: {more_g}");
    }
    assert_eq!(leaning.azimuth_deg, 22.5);
}

#[test]
fn a_settling_base_is_felt_by_gyro_and_accelerometers() {
    // In run 0 the nose rises by 60 arcsec with a time constant of 50 s: at t it still rises at 60/50 · e^(−t/50) arcsec a
    // second, of which the gyro feels −sin θ.
    let rows = pairs(&campaign(), 60.0, Part::Creep { run: 0, roll: false, tau_s: 50.0 });
    for number in (0..rows.len()).filter(|&number| rests(&rows, number)) {
        let (with, without) = &rows[number];
        let rising = 60.0 / 50.0 * (-(with.t_s - 0.5) / 50.0).exp();
        let expected = -rising * without.index_deg.to_radians().sin();
        // The Earth's vertical rate on the tilted axis adds 15 °/h · 60 arcsec = 0.0044 °/h at most.
        assert!((with.fog_arcsec - without.fog_arcsec - expected).abs() < 0.005 + 1e-3 * rising);
        let risen_g = (60.0 * (1.0 - (-(with.t_s - 0.5) / 50.0).exp()) / 206_264.8).sin();
        // The mean of both ends of the second is off by an eighth of the bend: 60/50²/8 arcsec, 1.5e-8 g.
        assert!((with.level_g[0] - without.level_g[0] - risen_g).abs() < 2e-8);
    }
    // Another run's base is another base.
    let other = pairs(&campaign(), 60.0, Part::Creep { run: 1, roll: false, tau_s: 50.0 });
    assert!(other.iter().all(|(with, without)| with == without));
}

#[test]
fn the_cubic_follows_the_rate() {
    let campaign = campaign();
    let north = EARTH_DEG_H * campaign.latitude_deg.to_radians().cos();
    let rows = pairs(&campaign, 1.0, Part::Cubic);
    for number in (0..rows.len()).filter(|&number| rests(&rows, number)) {
        let (with, without) = &rows[number];
        let rate = north * (campaign.runs[0].azimuth_deg - without.index_deg).to_radians().cos();
        // Tilt of some arcminutes changes the rate by some thousandths of itself at most.
        let expected = 1e-4 * rate.powi(3);
        assert!((with.fog_arcsec - without.fog_arcsec - expected).abs() < 0.02 * 1e-4 * north.powi(3));
    }
}

#[test]
fn names_of_families_are_their_own() {
    for family in Family::all() {
        assert_eq!(Family::named(family.name()), Some(family));
    }
    assert_eq!(Family::named("no such"), None);
}

#[test]
fn at_least_forty_families_are_drawn_apart_from_the_lists() {
    assert!(Family::all().into_iter().filter(|family| family.group() == Group::Outside).count() >= 40);
}

#[test]
fn campaigns_of_outside_families_are_of_many_kinds() {
    let campaigns: Vec<Campaign> = Family::all()
        .into_iter()
        .filter(|family| family.group() == Group::Outside)
        .zip(0..)
        .map(|(family, number)| Campaign::draw(family, 12, number))
        .collect();
    let some = |is: &dyn Fn(&Campaign) -> bool| campaigns.iter().any(is);
    assert!(some(&|campaign| campaign.runs.len() >= 60) && some(&|campaign| campaign.runs.len() <= 6));
    assert!(some(&|campaign| campaign.channels.len() > 6));
    assert!(some(&|campaign| campaign.runs[0].reference_sigma_deg > 0.03));
    // A row of a rotation is elsewhere than the one before, but not far.
    let rotates = |campaign: &Campaign| {
        campaign.runs[0].rows.windows(2).all(|pair| {
            let step_deg = pair[1].index_deg - pair[0].index_deg;
            (0.1..0.6).contains(&step_deg)
        })
    };
    assert!(some(&rotates));
    // Every run has as many rows as its plan has seconds: shapes are added to all of them.
    assert!(campaigns.iter().all(|campaign| campaign.runs.iter().all(|run| run.rows.len() >= 60)));
}
