//! The log of an instrument's fixes, `LOG.csv`: a row each, in the order in which they were made.

use std::ops::RangeInclusive;
use std::path::Path;

use north_finder::event::Fix;
use serde::Serialize;

use crate::campaign::Run;
use crate::file_error::{FileError, Problem};
use crate::output;
use crate::table_csv::TableCsv;

/// What a fix left behind. What is not known is empty in the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Logged {
    /// Number of the fix, and how often the instrument had been switched on before it.
    pub fix: u64,
    pub boot: u64,
    /// Time since switch-on, s; time of day as the campaign or the host's clock has it.
    pub t_s: Option<f64>,
    pub utc: String,
    pub azimuth_deg: Option<f64>,
    pub sigma_deg: Option<f64>,
    /// Chi-square of the dwells, and its degrees of freedom.
    pub misfit: Option<f64>,
    pub freedom: Option<f64>,
    pub bias_deg_h: Option<f64>,
    pub amplitude_deg_h: Option<f64>,
    pub drift_deg_h_per_h: Option<f64>,
    /// Root mean square of a dwell's seconds about their mean, °/h.
    pub scatter_deg_h: Option<f64>,
    pub temp_c: Option<f64>,
    pub block_temp_c: Option<f64>,
    /// The analogue channels.
    pub input_1: Option<f64>,
    pub input_2: Option<f64>,
    pub input_3: Option<f64>,
    pub input_4: Option<f64>,
    pub supply_v: Option<f64>,
    pub chip_temp_c: Option<f64>,
    pub flags: String,
    /// CRC-32 of the program and of the error model that made it, hexadecimal.
    pub firmware: String,
    pub model: String,
    /// The azimuth at which the fix was made, where it is surveyed, degrees.
    pub check_deg: Option<f64>,
}

/// A log that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    pub fixes: Vec<Logged>,
    /// What is doubtful, with its place.
    pub warnings: Vec<String>,
}

impl Logged {
    /// A fix of a campaign's run, whose recording began with a switch-on.
    pub fn of_run(number: usize, run: &Run, fix: &Fix, temp_c: Option<f64>) -> Self {
        let flags: Vec<&str> = fix.flags.iter().map(|flag| flag.name()).collect();
        Self {
            fix: number as u64,
            boot: number as u64,
            utc: run.started.clone().unwrap_or_default(),
            azimuth_deg: Some(fix.azimuth_deg),
            sigma_deg: Some(fix.sigma_deg),
            misfit: Some(fix.chi_square),
            freedom: Some(fix.degrees_of_freedom.into()),
            bias_deg_h: Some(fix.bias_deg_h),
            amplitude_deg_h: Some(fix.amplitude_deg_h),
            drift_deg_h_per_h: Some(fix.drift_deg_h_per_h),
            temp_c,
            flags: flags.join(" "),
            check_deg: run.reference_azimuth_deg,
            ..Self::default()
        }
    }
}

impl Log {
    /// Reads logs that follow each other, as one. Columns in any order; those that are not known are passed over.
    ///
    /// Errors: a file that cannot be read, without fix and boot, with a field that is no number or beyond what a fix can give, with fixes that do not
    /// follow each other.
    pub fn read(paths: &[impl AsRef<Path>]) -> Result<Self, FileError> {
        let mut log = Self { fixes: Vec::new(), warnings: Vec::new() };
        for path in paths {
            log.read_one(path.as_ref())?;
        }
        Ok(log)
    }

    /// Whether the instrument was switched on between each fix and the one before.
    pub fn switched(&self) -> Vec<bool> {
        let boots = self.fixes.iter().map(|fix| Some(fix.boot));
        let before = std::iter::once(None).chain(boots.clone());
        boots.zip(before).map(|(boot, before)| before.is_some() && boot != before).collect()
    }

    /// The last fixes that were made with the same error model, and how many others there are before them.
    pub fn of_last_model(mut self) -> (Self, usize) {
        let model = |fix: &Logged| fix.model.clone();
        let last = self.fixes.last().map(model);
        let others = self.fixes.iter().rposition(|fix| Some(model(fix)) != last).map_or(0, |place| place + 1);
        self.fixes.drain(..others);
        (self, others)
    }

    /// Temperatures of the gyro, °C, where every fix has one.
    pub fn temperatures_c(&self) -> Option<Vec<f64>> {
        self.fixes.iter().map(|fix| fix.temp_c).collect()
    }

    fn read_one(&mut self, path: &Path) -> Result<(), FileError> {
        let mut table = TableCsv::open(path)?;
        let (fix, boot) = (table.column("fix")?, table.column("boot")?);
        while table.next_row()? {
            let row = read_row(&table)?;
            if let Some(before) = self.fixes.last() {
                if row.fix <= before.fix {
                    let allowed = format!("a fix after number {}: logs are given in their order", before.fix);
                    return Err(table.error(fix, Problem::not_allowed(row.fix.to_string(), allowed)));
                }
                if row.boot < before.boot {
                    let allowed = format!(
                        "a switch-on after number {}: the count began anew, as that of another instrument or of one whose flash was erased",
                        before.boot
                    );
                    let doubt = table.error(boot, Problem::not_allowed(row.boot.to_string(), allowed));
                    self.warnings.push(doubt.to_string());
                }
            }
            self.fixes.push(row);
        }
        Ok(())
    }
}

/// The row of a table. No number may be beyond what a fix can give.
fn read_row(table: &TableCsv) -> Result<Logged, FileError> {
    let whole = |name| table.number_within(table.column(name)?, &(0.0..=1e15)).map(|number| number as u64);
    let text = |name| table.find(name).map_or_else(String::new, |column| table.text(column));
    let number = |name, allowed: RangeInclusive<f64>| {
        let given = table.find(name).filter(|&column| !table.is_empty(column));
        given.map(|column| table.number_within(column, &allowed)).transpose()
    };
    Ok(Logged {
        fix: whole("fix")?,
        boot: whole("boot")?,
        t_s: number("t_s", 0.0..=1e10)?,
        utc: text("utc"),
        azimuth_deg: number("azimuth_deg", -360.0..=360.0)?,
        sigma_deg: number("sigma_deg", 0.0..=360.0)?,
        misfit: number("misfit", 0.0..=1e12)?,
        freedom: number("freedom", 0.0..=1e6)?,
        // No gyro of an index reads more: 1e7 °/h are the greatest range that can be declared.
        bias_deg_h: number("bias_deg_h", -1e7..=1e7)?,
        amplitude_deg_h: number("amplitude_deg_h", 0.0..=1e7)?,
        drift_deg_h_per_h: number("drift_deg_h_per_h", -1e9..=1e9)?,
        scatter_deg_h: number("scatter_deg_h", 0.0..=1e7)?,
        temp_c: number("temp_c", -273.15..=1000.0)?,
        block_temp_c: number("block_temp_c", -273.15..=1000.0)?,
        input_1: number("input_1", -1e12..=1e12)?,
        input_2: number("input_2", -1e12..=1e12)?,
        input_3: number("input_3", -1e12..=1e12)?,
        input_4: number("input_4", -1e12..=1e12)?,
        supply_v: number("supply_v", -1000.0..=1000.0)?,
        chip_temp_c: number("chip_temp_c", -273.15..=1000.0)?,
        flags: text("flags"),
        firmware: text("firmware"),
        model: text("model"),
        check_deg: number("check_deg", -360.0..=360.0)?,
    })
}

/// Writes fixes as a log. Errors: the file is there, or cannot be written.
pub fn write_log(path: &Path, fixes: &[Logged]) -> Result<(), FileError> {
    let write = || {
        let mut writer = csv::Writer::from_writer(output::create(path)?);
        fixes.iter().try_for_each(|fix| writer.serialize(fix))?;
        writer.into_inner().map_err(|error| error.into_error())?.finish()
    };
    write().map_err(|error| FileError::whole(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let fix = |number| Logged {
            fix: number,
            boot: number / 3,
            utc: "2026-03-01 07:00:00".into(),
            azimuth_deg: Some(0.1 + number as f64),
            bias_deg_h: Some(-1.0 / 3.0),
            flags: "misfit drift".into(),
            model: if number < 2 { String::new() } else { "00c0ffee".into() },
            ..Logged::default()
        };
        let logs = [vec![fix(1), fix(2)], vec![fix(3), fix(6)]];
        let paths = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
        for (path, log) in paths.iter().zip(&logs) {
            write_log(path, log).unwrap();
        }
        let read = Log::read(&paths).unwrap();
        assert_eq!(read.fixes, logs.concat());
        assert_eq!(read.switched(), [false, false, true, true]);
        assert_eq!(read.temperatures_c(), None);
        let (last, others) = read.of_last_model();
        assert_eq!((last.fixes.len(), others), (3, 1));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.csv");
        let error = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Log::read(&[&path]).unwrap_err().to_string()
        };
        assert!(error("fix,azimuth_deg\n1,2\n").contains("boot"));
        assert!(error("fix,boot,bias_deg_h\n1,1,2\n2,1,x\n").contains("line 3"));
        let order = error("fix,boot\n2,1\n2,1\n");
        assert!(order.contains("line 3") && order.contains("after number 2"), "{order}");
        let sigma = error("fix,boot,sigma_deg\n1,1,-1\n");
        assert!(sigma.contains("line 2") && sigma.contains("sigma_deg") && sigma.contains("-1"), "{sigma}");
        let bias = error("fix,boot,bias_deg_h\n1,1,1\n2,1,1e30\n");
        assert!(bias.contains("line 3") && bias.contains("bias_deg_h") && bias.contains("1e30"), "{bias}");
        std::fs::write(&path, "fix,boot\n1,41\n2,42\n3,1\n").unwrap();
        let [warning] = Log::read(&[&path]).unwrap().warnings.try_into().unwrap();
        assert!(
            warning.contains("line 4") && warning.contains("boot") && warning.contains("after number 42"),
            "{warning}"
        );
    }
}
