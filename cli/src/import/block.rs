//! A foreign recording of a triad to one of a three-axis block, as `north align` and `north track` read it.

use std::io::Write;
use std::path::Path;

use north_finder::units::STANDARD_GRAVITY_M_S2;

use super::checks::{check_rate, refuse_dead};
use super::plausible::Means;
use super::{BREATH, Format, Map, Summary, open};
use crate::block_csv::COLUMNS;
use crate::campaign::doubt_of_clock;
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::output;

/// Writes the recording `file` to the new file `out`, a row a sample; what is missing is a gap in time. `breath` as for
/// [`super::import`].
///
/// Errors: a mapping without three gyros and three accelerometers; whatever is wrong with either file; samples that do not come at the
/// declared rate; a recording that holds none; a file that is there. After an error nothing is left at `out`.
pub fn block(
    map: &Map,
    file: &Path,
    format: Format,
    out: &Path,
    breath: &mut dyn FnMut(u64) -> bool,
) -> Result<Summary, Failure> {
    let forces = map.accelerometer.as_ref().map_or(0, |accelerometer| accelerometer.columns.len());
    if (map.gyro.columns.len(), forces) != (3, 3) {
        let problem = format!(
            "a block has three gyros and three accelerometers; this mapping names {} and {forces}",
            map.gyro.columns.len()
        );
        return Err(Failure::Refused(problem));
    }
    let mut sampler = open(map, file, format)?;
    let whole = |error: std::io::Error| FileError::whole(out, error);
    let mut csv = output::create(out).map_err(whole)?;
    writeln!(csv, "{}", COLUMNS.join(",")).map_err(whole)?;
    let (mut rows, mut means, mut summary) = (0u64, Means::default(), Summary::default());
    while let Some(sample) = sampler.next_sample()? {
        means.push(sample);
        let [gx, gy, gz] = sample.gyro_arcsec;
        let [ax, ay, az] = sample.acceleration_g.unwrap_or([f64::NAN; 3]).map(|g| g * STANDARD_GRAVITY_M_S2);
        // No clock tells more than nanoseconds; what lies beyond comes from the arithmetic.
        let t_s = (1e9 * sample.end_s).round() / 1e9;
        writeln!(csv, "{t_s},{gx},{gy},{gz},{ax},{ay},{az}").map_err(whole)?;
        rows += 1;
        if rows.is_multiple_of(BREATH) && !breath(sampler.bytes_read()) {
            return Err(Failure::Interrupted);
        }
    }
    refuse_dead(&sampler, file)?;
    if rows == 0 {
        return Err(FileError::whole(file, Problem::NoRows).into());
    }
    check_rate(map, format, &mut summary, &sampler, file)?;
    csv.finish().map_err(whole)?;
    summary.doubts.extend(means.doubts(map));
    summary.doubts.extend(doubt_of_clock(sampler.end_s() / rows as f64, sampler.end_s()));
    Ok(Summary { samples: sampler.due(), losses: sampler.losses(), ..summary })
}
