//! Basis functions of groups, as means over a run's samples.

use nalgebra::DMatrix;
use north_finder::fix::DesignRow;
use north_finder::level::Specific;

use super::columns::{Columns, from_columns, side_by_side};
use super::dynamics::{low_pass, low_pass_from, play, relay, smoothed};
use super::group::{Base, Group, PLAY_WIDTHS, TIMES_S};
use super::heading;
use super::recording::{Move, Place, Recording, Reference, Samples};
use super::sheet::Sheet;

/// Time constants, seconds.
pub const MEMORY_S: [f64; 7] = [5.0, 15.0, 40.0, 100.0, 250.0, 600.0, 1500.0];
const HEAT_S: [f64; 4] = [10.0, 40.0, 150.0, 600.0];
const BACKLASH: [f64; 5] = [0.1, 0.2, 0.35, 0.55, 0.8];
const COARSE_PLAY: [f64; 2] = [0.15, 0.4];
pub const DECAYS_S: [f64; 4] = [4.0, 9.0, 20.0, 45.0];
/// Of decays by travel, and of what creeps.
pub const TRAVEL_S: [f64; 4] = [4.0, 9.0, 20.0, 60.0];
const CREEP_S: [f64; 6] = [1.0, 3.0, 8.0, 20.0, 50.0, 120.0];
/// Of what is smooth in a channel.
const SMOOTHED_S: [f64; 4] = [3.0, 10.0, 30.0, 90.0];
pub const WARM_UP_S: [f64; 4] = [15.0, 45.0, 150.0, 500.0];
pub const RELAXATION_S: [f64; 7] = [2.0, 6.0, 18.0, 54.0, 160.0, 480.0, 1440.0];
const CHANGE_S: f64 = 12.0;
/// Places and widths of many relays in a channel, half ranges.
const RELAYS: [f64; 7] = [-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75];
const RELAY_WIDTHS: [f64; 3] = [0.1, 0.4, 0.8];
/// Length of a combination of channels that is its range.
const RIDGE_RANGE: f64 = 1.25;
/// Half lengths of the windows in which tilt rates are slopes, seconds.
const SLOPE_S: [usize; 3] = [5, 20, 100];
/// Curves go on at their ends beyond this many half ranges; what lies beyond makes the answer uncertain.
pub const RANGE: f64 = 1.2;
/// Directions of a base below this share of its greatest variance are left out.
const LEAST_VARIANCE: f64 = 1e-6;
const ARCSEC_PER_RAD: f64 = 206_264.806;

/// Whitened radial basis functions: a Gaussian process whose correlation has a width, on a grid of centres.
#[derive(Clone, Debug)]
struct Curve {
    centres: Vec<f64>,
    width: f64,
    whitening: DMatrix<f64>,
}

impl Curve {
    fn new(from: f64, to: f64, number: usize, width: f64) -> Self {
        let centres: Vec<f64> = (0..number).map(|i| from + (to - from) * i as f64 / (number - 1) as f64).collect();
        let correlation = DMatrix::from_fn(number, number, |i, j| bump((centres[i] - centres[j]) / width))
            + DMatrix::identity(number, number) * 1e-8;
        let eigen = correlation.symmetric_eigen();
        let roots = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(1e-12).powf(-0.5)));
        let whitening = &eigen.eigenvectors * roots * eigen.eigenvectors.transpose();
        Self { centres, width, whitening }
    }

    fn columns(&self, samples: &Samples, values: &[f64]) -> Columns {
        let of = |centre: &f64| samples.means(values.iter().map(|value| bump((value - centre) / self.width)));
        from_columns(samples.len(), self.centres.iter().map(of)) * &self.whitening
    }
}

fn bump(x: f64) -> f64 {
    (-0.5 * x * x).exp()
}

/// What the learned runs say of scales, and the directions that bases are reduced to.
#[derive(Clone, Debug)]
pub struct Scales {
    /// Middle and half range of every channel.
    pub channels: Vec<[f64; 2]>,
    /// Surveyed headings.
    headings_deg: Vec<f64>,
    /// The longest run, seconds; most moves; greatest tilt along the axis, g.
    pub longest_s: f64,
    pub most_moves: f64,
    pub most_tilt: f64,
    most_wound_deg: f64,
    /// Principal components of all channels within runs.
    components: DMatrix<f64>,
    smooth: Curve,
    sharp: Curve,
    narrow_play: Curve,
    coarse_play: Curve,
    of_time: Curve,
    of_rate: Curve,
    of_tilt: Curve,
    of_winding: Curve,
    /// Mean and directions of the bases that are reduced.
    reduced: Vec<(Base, Vec<f64>, DMatrix<f64>)>,
}

impl Scales {
    /// From the runs that are learned from, whose channels are all there. `None` for a channel in `constant` order.
    pub fn new(sheets: &[Sheet], bases: &[Base]) -> Self {
        let number = sheets.first().map_or(0, |sheet| sheet.recording.channels.len());
        let channels = (0..number).map(|channel| range(sheets, channel)).collect();
        let surveyed = sheets.iter().filter_map(|sheet| sheet.recording.reference);
        let headings_deg = surveyed.map(|reference| reference.azimuth_rad.to_degrees()).collect();
        let most = |of: &dyn Fn(&Sheet) -> f64| sheets.iter().map(of).fold(0.0, f64::max);
        let mut scales = Self {
            channels,
            headings_deg,
            longest_s: most(&|sheet| sheet.recording.t_s.last().copied().unwrap_or(1.0)),
            most_moves: most(&|sheet| sheet.places.last().map_or(0.0, |place| place.moves)).max(1.0),
            most_tilt: most(&|sheet| sheet.tilt().into_iter().fold(0.0, |most: f64, tilt| most.max(tilt.abs())))
                .max(1e-9),
            most_wound_deg: most(&|sheet| sheet.wound_deg.iter().fold(0.0, |most: f64, wound| most.max(wound.abs())))
                .max(1.0),
            components: DMatrix::zeros(number, 0),
            smooth: Curve::new(-1.1, 1.1, 8, 0.45),
            sharp: Curve::new(-1.05, 1.05, 18, 0.13),
            narrow_play: Curve::new(-1.1, 1.1, 14, 0.17),
            coarse_play: Curve::new(-1.1, 1.1, 6, 0.4),
            of_time: Curve::new(-0.05, 1.05, 12, 0.12),
            of_rate: Curve::new(-1.05, 1.05, 10, 0.2),
            of_tilt: Curve::new(-1.1, 1.1, 7, 0.4),
            of_winding: Curve::new(-1.05, 1.05, 14, 0.17),
            reduced: Vec::new(),
        };
        scales.components = scales.principal(sheets);
        for &base in bases {
            let raw: Vec<Columns> = sheets.iter().map(|sheet| scales.raw_base(sheet, base, 0.0)).collect();
            if let Some((mean, directions)) = main_directions(&raw, kept(base)) {
                scales.reduced.push((base, mean, directions));
            }
        }
        scales
    }

    /// A channel in half ranges about its middle.
    fn scaled(&self, sheet: &Sheet, channel: usize) -> Vec<f64> {
        let [middle, half] = self.channels[channel];
        sheet.recording.channels[channel].iter().map(|value| (value - middle) / half).collect()
    }

    fn clipped(&self, sheet: &Sheet, channel: usize) -> Vec<f64> {
        self.scaled(sheet, channel).into_iter().map(|value| value.clamp(-RANGE, RANGE)).collect()
    }

    /// Means over the samples of how far a channel lies outside the learned range, half ranges.
    pub fn excess(&self, sheet: &Sheet, channel: usize) -> Vec<f64> {
        let scaled = self.scaled(sheet, channel);
        sheet.samples.means(scaled.iter().map(|value| value - value.clamp(-1.1, 1.1)))
    }

    /// Probability that a heading lies in a sector, by the surveyed headings but the run's own.
    pub fn share_of_sector(&self, sector: [f64; 2], azimuth_rad: f64, own: Option<Reference>) -> f64 {
        let mut others_deg = self.headings_deg.clone();
        let own_deg = own.map(|own| own.azimuth_rad.to_degrees());
        if let Some(place) = others_deg.iter().position(|heading_deg| Some(*heading_deg) == own_deg) {
            others_deg.swap_remove(place);
        }
        heading::share_of_sector(&others_deg, sector, azimuth_rad.to_degrees())
    }

    /// Directions of all channels within runs (what differs between runs only is a part of the bias).
    fn principal(&self, sheets: &[Sheet]) -> DMatrix<f64> {
        let number = self.channels.len();
        let mut covariance = DMatrix::<f64>::zeros(number, number);
        let mut rows = 0.0;
        for sheet in sheets {
            let mut columns = from_columns(
                sheet.samples.len(),
                (0..number).map(|channel| sheet.samples.means(self.scaled(sheet, channel))),
            );
            centre(&mut columns);
            covariance += columns.transpose() * &columns;
            rows += columns.nrows() as f64;
        }
        if number == 0 || rows == 0.0 {
            return DMatrix::zeros(number, 0);
        }
        let eigen = (covariance / rows).symmetric_eigen();
        let most = eigen.eigenvalues.max();
        let kept: Vec<usize> = (0..number).filter(|&i| eigen.eigenvalues[i] > 1e-7 * most).collect();
        DMatrix::from_fn(number, kept.len(), |i, j| {
            eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()
        })
    }

    /// A base reduced to its main directions.
    fn base(&self, sheet: &Sheet, base: Base, azimuth_rad: f64, known: &mut Vec<(Base, Columns)>) -> Columns {
        if let Some((_, columns)) = known.iter().find(|each| each.0 == base) {
            return columns.clone();
        }
        let columns = self.reduced_base(sheet, base, azimuth_rad);
        known.push((base, columns.clone()));
        columns
    }

    fn reduced_base(&self, sheet: &Sheet, base: Base, azimuth_rad: f64) -> Columns {
        let mut raw = self.raw_base(sheet, base, azimuth_rad);
        match self.reduced.iter().find(|each| each.0 == base) {
            Some((_, mean, directions)) => {
                for (mut column, mean) in raw.column_iter_mut().zip(mean) {
                    column.add_scalar_mut(-mean);
                }
                raw * directions
            }
            None => raw,
        }
    }

    fn raw_base(&self, sheet: &Sheet, base: Base, azimuth_rad: f64) -> Columns {
        let samples = &sheet.samples;
        let rows = samples.len();
        let interval = &sheet.recording.interval_s;
        match base {
            Base::Value(channel) => self.smooth.columns(samples, &self.clipped(sheet, channel)),
            Base::Memory(channel) => {
                let value = self.scaled(sheet, channel);
                from_columns(rows, TIMES_S.map(|time_s| lacking(samples, &value, &low_pass(&value, interval, time_s))))
            }
            Base::Play(channel) => {
                let value = self.scaled(sheet, channel);
                beside(COARSE_PLAY.map(|width| self.coarse_play.columns(samples, &clip(play(&value, width)))))
            }
            Base::Harmonic(order) => {
                let angle = |i: usize| f64::from(order) * sheet.sin[i].atan2(sheet.cos[i]);
                match order {
                    1 => from_columns(rows, [sheet.cos.clone(), sheet.sin.clone()]),
                    _ => from_columns(
                        rows,
                        [
                            (0..rows).map(|i| angle(i).cos()).collect(),
                            (0..rows).map(|i| angle(i).sin()).collect::<Vec<_>>(),
                        ],
                    ),
                }
            }
            Base::Rate => from_columns(rows, [heading::along(sheet, azimuth_rad)]),
            Base::Settling => from_columns(rows, DECAYS_S.map(|time_s| sheet.settling(time_s, |_| 1.0))),
            Base::Travel => {
                let sizes: [fn(&Move) -> f64; 2] =
                    [|each| each.travel_deg.abs() / 180.0, |each| each.travel_deg / 180.0];
                from_columns(
                    rows,
                    sizes.into_iter().flat_map(|size| TRAVEL_S.map(|time_s| sheet.settling(time_s, size))),
                )
            }
            Base::Time => {
                let t = &sheet.recording.t_s;
                let curve: Vec<f64> = t.iter().map(|t| t / self.longest_s).collect();
                let decays = WARM_UP_S.map(|time_s| sheet.column(|i| (-t[i].max(0.0) / time_s).exp()));
                beside([self.of_time.columns(samples, &curve), from_columns(rows, decays)])
            }
            Base::Heading => heading::bumps(sheet, azimuth_rad),
            Base::Tilt => {
                let tilt: Vec<f64> = sheet.tilt().into_iter().map(|tilt| tilt / self.most_tilt).collect();
                let curve = self.of_tilt.columns(samples, &clip(tilt.clone()));
                beside([from_columns(rows, [samples.means(tilt)]), curve])
            }
            Base::Turn => {
                let odd = sheet.column(|i| 1.0 - 2.0 * (sheet.places[i].moves.rem_euclid(2.0)));
                let direction = sheet.column(|i| sign(sheet.places[i].travel_deg));
                from_columns(rows, [odd, direction])
            }
        }
    }

    /// Columns of a group over a run's samples, at an azimuth where they depend on it. Not yet scaled.
    pub fn columns(&self, sheet: &Sheet, group: &Group, azimuth_rad: f64) -> Columns {
        self.columns_with(sheet, group, azimuth_rad, &mut Vec::new())
    }

    /// The same of one group after the other; `known` are the bases of products so far.
    pub fn columns_with(
        &self,
        sheet: &Sheet,
        group: &Group,
        azimuth_rad: f64,
        known: &mut Vec<(Base, Columns)>,
    ) -> Columns {
        let samples = &sheet.samples;
        let rows = samples.len();
        let interval = &sheet.recording.interval_s;
        let scaled = |channel: usize| self.scaled(sheet, channel);
        let value = |channel: usize| samples.means(self.scaled(sheet, channel));
        let angle = |i: usize| sheet.sin[i].atan2(sheet.cos[i]);
        let harmonics = |orders: std::ops::RangeInclusive<u8>, angle: &dyn Fn(usize) -> f64| {
            let of = |order: u8| {
                let at = |i: usize| f64::from(order) * angle(i);
                [(0..rows).map(|i| at(i).cos()).collect::<Vec<_>>(), (0..rows).map(|i| at(i).sin()).collect()]
            };
            from_columns(rows, orders.flat_map(of))
        };
        match group {
            Group::Base(base) => self.raw_base(sheet, *base, azimuth_rad),
            Group::Linear(channel) => from_columns(rows, [value(*channel)]),
            Group::Quadratic(channel) => {
                let scaled = scaled(*channel);
                from_columns(rows, [value(*channel), samples.means(scaled.iter().map(|z| z * z))])
            }
            Group::Change(channel) => {
                let scaled = scaled(*channel);
                let mut change = lacking(samples, &scaled, &low_pass(&scaled, interval, CHANGE_S));
                change.iter_mut().for_each(|value| *value /= CHANGE_S);
                from_columns(rows, [change])
            }
            Group::SharpCurve(channel) => self.sharp.columns(samples, &self.clipped(sheet, *channel)),
            Group::LongMemory(channel) => {
                let scaled = scaled(*channel);
                let lacking = MEMORY_S.map(|time_s| lacking(samples, &scaled, &low_pass(&scaled, interval, time_s)));
                from_columns(rows, lacking)
            }
            Group::Backlash(channel) => {
                let scaled = scaled(*channel);
                from_columns(rows, BACKLASH.map(|width| lacking(samples, &scaled, &play(&scaled, width))))
            }
            Group::Hysteresis(channel, width) => {
                self.narrow_play.columns(samples, &clip(play(&scaled(*channel), PLAY_WIDTHS[*width])))
            }
            Group::MemoryOfCurve(channel) => self.memory_of_curve(sheet, *channel),
            Group::CurveOfMemory(channel, time) => {
                let smoothed = low_pass(&scaled(*channel), interval, TIMES_S[*time]);
                self.smooth.columns(samples, &clip(smoothed))
            }
            Group::MemoryOfChange(channel) => {
                let scaled = scaled(*channel);
                let slow = low_pass(&scaled, interval, CHANGE_S);
                let change: Vec<f64> = scaled.iter().zip(&slow).map(|(z, slow)| 4.0 * (z - slow)).collect();
                let forms: [fn(f64) -> f64; 3] = [|x| x, f64::abs, |x| x * x];
                let of = |form: fn(f64) -> f64| {
                    let formed: Vec<f64> = change.iter().map(|&x| form(x)).collect();
                    HEAT_S.map(|time_s| samples.means(low_pass_from(0.0, &formed, interval, time_s)))
                };
                from_columns(rows, forms.into_iter().flat_map(of))
            }
            Group::HighHarmonics => harmonics(3..=6, &angle),
            Group::AxisHarmonics => harmonics(2..=4, &|i| azimuth_rad - angle(i)),
            Group::AxisHarmonic(order) => harmonics(*order..=*order, &|i| azimuth_rad - angle(i)),
            Group::EarthField => {
                let (sin, cos) = azimuth_rad.sin_cos();
                from_columns(rows, [(0..rows).map(|i| sin * sheet.cos[i] - cos * sheet.sin[i]).collect::<Vec<_>>()])
            }
            Group::RateCurve => {
                let rate = heading::along(sheet, azimuth_rad);
                let of = |centre: &f64| rate.iter().map(|x| bump((x - centre) / self.of_rate.width)).collect();
                from_columns(rows, self.of_rate.centres.iter().map(of)) * &self.of_rate.whitening
            }
            Group::Drift => from_columns(rows, [sheet.column(|i| sheet.recording.t_s[i] / self.longest_s)]),
            Group::SettlingByCount => {
                from_columns(rows, DECAYS_S.map(|time_s| sheet.settling(time_s, |each| each.number / self.most_moves)))
            }
            Group::SettlingEveryDwell => {
                let start_s = sheet.recording.start_s();
                let first = |time_s: f64| {
                    let since_s = sheet.recording.t_s.iter().map(|t_s| t_s - start_s);
                    samples.means(since_s.map(|since_s| (-since_s / time_s).exp()))
                };
                let both = |time_s: f64| {
                    let moves = sheet.settling(time_s, |_| 1.0);
                    moves.iter().zip(first(time_s)).map(|(moves, first)| moves + first).collect::<Vec<_>>()
                };
                from_columns(rows, DECAYS_S.map(both))
            }
            Group::SettlingByPosition => {
                let parts: [fn(&Move) -> f64; 2] = [|each| each.to.cos, |each| each.to.sin];
                from_columns(
                    rows,
                    DECAYS_S.into_iter().flat_map(|time_s| parts.map(|part| sheet.settling(time_s, part))),
                )
            }
            Group::SettlingByCurve => {
                let of = |power: i32| {
                    let size = move |each: &Move| (each.travel_deg.abs() / 180.0).powi(power);
                    DECAYS_S.map(|time_s| sheet.settling(time_s, size))
                };
                from_columns(rows, (0..4).flat_map(of))
            }
            Group::Creep => self.creep(sheet, |place| sign(place.travel_deg)),
            Group::Alternating => self.creep(sheet, |place| 1.0 - 2.0 * place.moves.rem_euclid(2.0)),
            Group::Winding => {
                let wound: Vec<f64> = sheet.wound_deg.iter().map(|wound| wound / self.most_wound_deg).collect();
                self.of_winding.columns(samples, &wound)
            }
            Group::AxisCurve => heading::axis_curve(sheet, azimuth_rad),
            Group::BroadAxisCurve => heading::broad_axis_curve(sheet, azimuth_rad),
            Group::IndexCurve => {
                let (sin, cos) = azimuth_rad.sin_cos();
                let field: Vec<f64> = (0..rows).map(|i| sin * sheet.cos[i] - cos * sheet.sin[i]).collect();
                let field = from_columns(rows, [field]);
                beside([field.clone(), product(&field, &harmonics(1..=4, &angle))])
            }
            Group::Tuned(channel, tuned) => tuned.columns(samples, &scaled(*channel), interval),
            Group::Gated { channel, by, at } => {
                let open: Vec<f64> = scaled(*by).iter().map(|value| f64::from(u8::from(value > at))).collect();
                let through = scaled(*channel).into_iter().zip(&open).map(|(value, open)| value * open);
                let through = samples.means(through);
                from_columns(rows, [through, samples.means(open)])
            }
            Group::OfTwo([first, second], of_two) => {
                of_two.columns(samples, [&self.clipped(sheet, *first), &self.clipped(sheet, *second)])
            }
            Group::Ridge { direction, sharp } => {
                let mut along = vec![0.0; sheet.recording.len()];
                for (channel, share) in direction.iter().enumerate().filter(|each| *each.1 != 0.0) {
                    along.iter_mut().zip(scaled(channel)).for_each(|(sum, value)| *sum += share / RIDGE_RANGE * value);
                }
                let curve = if *sharp { &self.sharp } else { &self.smooth };
                curve.columns(samples, &clip(along))
            }
            Group::Gear(order) => {
                let (sin, cos) = azimuth_rad.sin_cos();
                let of = |part: fn(f64) -> f64| {
                    let turned = sheet.column(|i| part(order * sheet.wound_deg[i].to_radians()));
                    let field = (0..rows).map(|i| sin * sheet.cos[i] - cos * sheet.sin[i]);
                    field.zip(turned).map(|(field, turned)| field * turned).collect::<Vec<_>>()
                };
                from_columns(rows, [of(f64::cos), of(f64::sin)])
            }
            Group::Sector([from_deg, width_deg]) => {
                let share =
                    heading::share_of_sector(&self.headings_deg, [*from_deg, *width_deg], azimuth_rad.to_degrees());
                self.raw_base(sheet, Base::Harmonic(1), 0.0) * share
            }
            Group::Relaxation => {
                let t = &sheet.recording.t_s;
                from_columns(rows, RELAXATION_S.map(|time_s| sheet.column(|i| (-t[i].max(0.0) / time_s).exp())))
            }
            Group::Rhythm(rhythm) => rhythm.columns(sheet, sheet.phase),
            Group::Smoothed(channel) => {
                let scaled = scaled(*channel);
                let smooth = SMOOTHED_S.map(|time_s| samples.means(smoothed(&scaled, time_s)));
                from_columns(rows, std::iter::once(value(*channel)).chain(smooth))
            }
            Group::TiltLinear => from_columns(rows, [samples.means(sheet.tilt()), samples.means(sheet.tilt_across())]),
            Group::TiltSquare => {
                let along: Vec<f64> = sheet.tilt().into_iter().map(|tilt| tilt / self.most_tilt).collect();
                from_columns(rows, [samples.means(along.iter().copied()), samples.means(along.iter().map(|z| z * z))])
            }
            Group::TiltQuadratic => {
                let of = |tilt: Vec<f64>| tilt.into_iter().map(|tilt| tilt / self.most_tilt).collect();
                let [along, across]: [Vec<f64>; 2] = [of(sheet.tilt()), of(sheet.tilt_across())];
                let times = |a: &[f64], b: &[f64]| samples.means(a.iter().zip(b).map(|(a, b)| a * b));
                let first = [samples.means(along.iter().copied()), samples.means(across.iter().copied())];
                let second = [times(&along, &along), times(&along, &across), times(&across, &across)];
                from_columns(rows, first.into_iter().chain(second))
            }
            Group::Relays(channel) => {
                let scaled = scaled(*channel);
                let of = |at: f64| RELAY_WIDTHS.map(|width| relay(&scaled, [at - 0.5 * width, at + 0.5 * width], 0.0));
                from_columns(rows, RELAYS.into_iter().flat_map(of).map(|state| samples.means(state)))
            }
            Group::SettlingTime { channel, time_s, slope } => {
                let scaled = scaled(*channel);
                let time_of = |each: &Move| {
                    let at = sheet.recording.t_s.partition_point(|t_s| *t_s < each.ended_s).min(scaled.len() - 1);
                    time_s * (slope * scaled[at].clamp(-RANGE, RANGE)).exp()
                };
                let sizes: [fn(&Move) -> f64; 3] =
                    [|_| 1.0, |each| each.travel_deg.abs() / 180.0, |each| each.travel_deg / 180.0];
                from_columns(rows, sizes.map(|size| sheet.settling_each(time_of, size)))
            }
            Group::TiltRate => {
                from_columns(rows, SLOPE_S.map(|reach| samples.means(tilt_rate(sheet.recording, reach))))
            }
            Group::AllChannels => self.all_channels(sheet),
            Group::AllMemory => self.all_memory(sheet),
            Group::Product(first, second) if first == second => {
                let base = self.base(sheet, *first, azimuth_rad, known);
                let pairs = (0..base.ncols()).flat_map(|i| (0..=i).map(move |j| (i, j)));
                let of = |(i, j): (usize, usize)| (0..rows).map(|row| base[(row, i)] * base[(row, j)]).collect();
                from_columns(rows, pairs.map(of))
            }
            Group::Product(first, second) => {
                let bases = [first, second].map(|base| self.base(sheet, *base, azimuth_rad, known));
                self.about_harmonic(sheet, &[*first, *second], product(&bases[0], &bases[1]))
            }
            Group::Bilinear(first, second) => {
                let (first, second) = (scaled(*first), scaled(*second));
                from_columns(rows, [samples.means(first.iter().zip(&second).map(|(a, b)| a * b))])
            }
            Group::Bicubic(first, second) => {
                let (first, second) = (scaled(*first), scaled(*second));
                let forms: [fn(f64, f64) -> f64; 5] =
                    [|a, _| a, |_, b| b, |a, b| a * b, |a, b| a * a * b, |a, b| a * b * b];
                let of =
                    |form: fn(f64, f64) -> f64| samples.means(first.iter().zip(&second).map(|(&a, &b)| form(a, b)));
                from_columns(rows, forms.map(of))
            }
            Group::LinearTimes(channel, base) => {
                let both =
                    product(&from_columns(rows, [value(*channel)]), &self.base(sheet, *base, azimuth_rad, known));
                self.about_harmonic(sheet, &[*base], both)
            }
            Group::Triple(first, second, base) => {
                let (first, second) = (scaled(*first), scaled(*second));
                let both = from_columns(rows, [samples.means(first.iter().zip(&second).map(|(a, b)| a * b))]);
                product(&both, &self.base(sheet, *base, azimuth_rad, known))
            }
            Group::Extended { parent, weights, base } => {
                let found = self.columns_with(sheet, parent, azimuth_rad, known)
                    * DMatrix::from_column_slice(weights.len(), 1, weights);
                product(&found, &self.base(sheet, *base, azimuth_rad, known))
            }
        }
    }

    /// A product with the first harmonic of the index angle, with that harmonic itself: where the other factor has its zero nobody
    /// knows; without surveyed headings only amplitudes show it, for in one run such a harmonic is another azimuth.
    fn about_harmonic(&self, sheet: &Sheet, factors: &[Base], columns: Columns) -> Columns {
        let harmonic = Base::Harmonic(1);
        if factors.contains(&harmonic) { beside([self.raw_base(sheet, harmonic, 0.0), columns]) } else { columns }
    }

    /// What grows or dies away since the last move, times a sign.
    fn creep(&self, sheet: &Sheet, sign: impl Fn(&Place) -> f64) -> Columns {
        let of = |time_s: f64| sheet.column(|i| sign(&sheet.places[i]) * (-sheet.places[i].since_s / time_s).exp());
        let steady = sheet.column(|i| sign(&sheet.places[i]));
        from_columns(sheet.samples.len(), std::iter::once(steady).chain(CREEP_S.map(of)))
    }

    /// A curve in the channel, low-passed; with what its unknown state at the beginning leaves.
    fn memory_of_curve(&self, sheet: &Sheet, channel: usize) -> Columns {
        let rows = sheet.samples.len();
        let scaled = self.scaled(sheet, channel);
        let forms: [fn(f64) -> f64; 4] = [|z| z, |z| z * z, |z| z.abs(), |z| (1.5 * z).sin()];
        let columns = forms.into_iter().flat_map(|form| {
            let formed: Vec<f64> = scaled.iter().map(|&z| form(z)).collect();
            let start = formed.first().copied().unwrap_or_default();
            HEAT_S
                .into_iter()
                .flat_map(move |time_s| {
                    let after = low_pass_from(start, &formed, &sheet.recording.interval_s, time_s);
                    let first = sheet.column(|i| start * (-sheet.recording.t_s[i].max(0.0) / time_s).exp());
                    [sheet.samples.means(after), first]
                })
                .collect::<Vec<_>>()
        });
        from_columns(rows, columns)
    }

    fn all_channels(&self, sheet: &Sheet) -> Columns {
        let number = self.channels.len();
        let all = (0..number).map(|channel| sheet.samples.means(self.scaled(sheet, channel)));
        from_columns(sheet.samples.len(), all) * &self.components
    }

    fn all_memory(&self, sheet: &Sheet) -> Columns {
        let interval = &sheet.recording.interval_s;
        let memories: Vec<Columns> = [8.0, 30.0, 100.0, 300.0]
            .into_iter()
            .map(|time_s| {
                let lacking = (0..self.channels.len()).map(|channel| {
                    let scaled = self.scaled(sheet, channel);
                    lacking(&sheet.samples, &scaled, &low_pass(&scaled, interval, time_s))
                });
                from_columns(sheet.samples.len(), lacking) * &self.components
            })
            .collect();
        beside(memories)
    }
}

fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

fn clip(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|value| value.clamp(-RANGE, RANGE)).collect()
}

/// Means of what the second lacks to the first.
fn lacking(samples: &Samples, first: &[f64], second: &[f64]) -> Vec<f64> {
    samples.means(first.iter().zip(second).map(|(first, second)| first - second))
}

fn beside(parts: impl IntoIterator<Item = Columns>) -> Columns {
    let parts: Vec<Columns> = parts.into_iter().collect();
    let rows = parts.first().map_or(0, DMatrix::nrows);
    side_by_side(rows, &parts)
}

/// All products of a column of the first with one of the second.
fn product(first: &Columns, second: &Columns) -> Columns {
    let columns = first.column_iter().flat_map(|a| {
        second.column_iter().map(move |b| a.iter().zip(b.iter()).map(|(a, b)| a * b).collect::<Vec<_>>())
    });
    from_columns(first.nrows(), columns.collect::<Vec<_>>())
}

pub fn centre(columns: &mut Columns) {
    for mut column in columns.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
}

/// Most directions of a base in products; 0 where it stays as it is.
fn kept(base: Base) -> usize {
    match base {
        Base::Value(_) | Base::Play(_) | Base::Time => 5,
        Base::Memory(_) => 3,
        Base::Tilt | Base::Travel | Base::Settling => 4,
        Base::Harmonic(_) | Base::Rate | Base::Heading | Base::Turn => 0,
    }
}

/// Mean of the columns and their main directions, whose variances fall off as the root of what they were.
fn main_directions(raw: &[Columns], most: usize) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let width = raw.first()?.ncols();
    let rows: usize = raw.iter().map(DMatrix::nrows).sum();
    if most == 0 || rows == 0 {
        return None;
    }
    let mean: Vec<f64> =
        (0..width).map(|j| raw.iter().map(|columns| columns.column(j).sum()).sum::<f64>() / rows as f64).collect();
    let mut covariance = DMatrix::<f64>::zeros(width, width);
    for columns in raw {
        let mut columns = columns.clone();
        for (mut column, mean) in columns.column_iter_mut().zip(&mean) {
            column.add_scalar_mut(-mean);
        }
        covariance += columns.transpose() * columns;
    }
    let eigen = (covariance / rows as f64).symmetric_eigen();
    let mut order: Vec<usize> = (0..width).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let greatest = eigen.eigenvalues[order[0]];
    if greatest <= 0.0 {
        return None;
    }
    order.retain(|&i| eigen.eigenvalues[i] > LEAST_VARIANCE * greatest);
    order.truncate(most);
    let factor = |i: usize| eigen.eigenvalues[i].powf(-0.5) * (eigen.eigenvalues[i] / greatest).powf(0.25);
    let directions = DMatrix::from_fn(width, order.len(), |i, j| eigen.eigenvectors[(i, order[j])] * factor(order[j]));
    Some((mean, directions))
}

/// Middle and half of the range that a channel's values lie in, 1 % left out.
fn range(sheets: &[Sheet], channel: usize) -> [f64; 2] {
    let mut values: Vec<f64> =
        sheets.iter().flat_map(|sheet| sheet.recording.channels[channel].iter().copied()).collect();
    if values.is_empty() {
        return [0.0, 1.0];
    }
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    let (low, high) = (at(0.005), at(0.995));
    let half = 0.5 * (high - low);
    [0.5 * (high + low), if half > 1e-12 * high.abs().max(1.0) { half } else { f64::INFINITY }]
}

/// What the gyro feels of the base's tilt rates, °/h: cos θ · dr/dt − sin θ · dp/dt, as slopes within dwells.
fn tilt_rate(recording: &Recording, reach: usize) -> Vec<f64> {
    let mut rate = vec![0.0; recording.len()];
    let Some(tilt) = &recording.tilt_g else { return rate };
    let mut first = 0;
    while first < recording.len() {
        let dwell = recording.dwell[first];
        let end = (first..recording.len()).find(|&i| recording.dwell[i] != dwell).unwrap_or(recording.len());
        let inside: Vec<usize> = (first..end).filter(|&i| recording.enters[i]).collect();
        first = end;
        if inside.len() < 5 {
            continue;
        }
        let reach = reach.min((inside.len() - 1) / 2).max(2);
        for (place, &i) in inside.iter().enumerate() {
            let window = &inside[place.saturating_sub(reach)..(place + reach + 1).min(inside.len())];
            let slope = |axis: fn(&Specific) -> f64| {
                let count = window.len() as f64;
                let t = window.iter().map(|&j| recording.t_s[j]).sum::<f64>() / count;
                let (mut across, mut squares) = (0.0, 0.0);
                for &j in window {
                    across += (recording.t_s[j] - t) * axis(&tilt[j]);
                    squares += (recording.t_s[j] - t).powi(2);
                }
                if squares > 0.0 { across / squares } else { 0.0 }
            };
            let DesignRow { cos, sin, .. } = recording.design[i];
            rate[i] = ARCSEC_PER_RAD * (cos * slope(|tilt| tilt.left) - sin * slope(|tilt| tilt.forward));
        }
    }
    rate
}
