//! The log of an instrument's fixes, `LOG.csv`: a row each, in the order in which they were made.

use std::ops::RangeInclusive;
use std::path::Path;

use north_finder::event::Fix;
use north_finder::health::Flag;
use serde::Serialize;

use crate::campaign::Run;
use crate::count::counted;
use crate::file_error::{FileError, Problem};
use crate::output;
use crate::table_csv::TableCsv;

/// No fix knows its azimuth better, nor without an error.
const LEAST_SIGMA_DEG: f64 = 1e-9;

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

/// Flags of a log that have no name here: a newer program may have given them, and no signal is made of flags.
#[derive(Default)]
struct UnknownFlags {
    fixes: usize,
    /// The first, with its place.
    first: Option<FileError>,
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
    /// Reads logs that follow each other, as one. Columns in any order; those that are not known are passed over. Fixes of a board that two logs have are
    /// taken once; the runs of a campaign after those of another are counted on.
    ///
    /// Errors: a file that cannot be read, without fix and boot, with a column twice, with a field that is no number or beyond what a fix can give, with
    /// fixes that do not follow each other.
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
        let logs_before = self.fixes.len();
        let mut taken_before = 0;
        // What the counts go on from where a campaign's log counts its runs from the first.
        let (mut fixes_before, mut boots_before) = (0, 0);
        let mut is_first = true;
        let mut unknown = UnknownFlags::default();
        while table.next_row()? {
            let mut row = read_row(&table)?;
            unknown.see(&table, &row.flags);
            if let Some(known) = self.fixes.get_mut(..logs_before).and_then(|known| same(known, &row)) {
                known.check_deg = row.check_deg.or(known.check_deg);
                taken_before += 1;
                is_first = false;
                continue;
            }
            if let Some(before) = self.fixes.last() {
                if is_first && row.fix <= before.fix && row.goes_on_from(before) {
                    self.warnings.push(format!(
                        "{}: its fixes are counted from {} anew; here they go on from {}",
                        path.display(),
                        row.fix,
                        before.fix + 1
                    ));
                    (fixes_before, boots_before) =
                        (before.fix + 1 - row.fix, (before.boot + 1).saturating_sub(row.boot));
                }
                (row.fix, row.boot) = (row.fix + fixes_before, row.boot + boots_before);
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
            is_first = false;
            self.fixes.push(row);
        }
        self.warnings.extend(unknown.doubt());
        if taken_before > 0 {
            let fixes = counted(taken_before, "fix");
            self.warnings.push(format!("{}: taken once: {fixes} that the logs before have, too", path.display()));
        }
        Ok(())
    }
}

impl Logged {
    /// Whether it may be the first of a log of its own that follows: such logs are those of campaigns, without firmware; a board counts all its life.
    fn goes_on_from(&self, before: &Self) -> bool {
        let in_time = self.utc.is_empty() || before.utc.is_empty() || before.utc < self.utc;
        in_time && self.firmware.is_empty() && before.firmware.is_empty()
    }
}

impl UnknownFlags {
    fn see(&mut self, table: &TableCsv, flags: &str) {
        let is_known = |name: &str| Flag::ALL.iter().any(|flag| flag.name() == name);
        let unknown = flags.split_whitespace().find(|name| !is_known(name));
        let Some((name, column)) = unknown.zip(table.find("flags")) else { return };
        self.fixes += 1;
        let problem = || Problem::Syntax(format!("no flag is called {name:?} here: a newer program may have given it"));
        self.first.get_or_insert_with(|| table.error(column, problem()));
    }

    fn doubt(&self) -> Option<String> {
        let first = self.first.as_ref()?;
        Some(format!("{first}; the first of {} with such a flag", counted(self.fixes, "fix")))
    }
}

/// The fix among those that are known, whose numbers rise; it may have been marked with a surveyed azimuth since.
fn same<'a>(known: &'a mut [Logged], row: &Logged) -> Option<&'a mut Logged> {
    let at = known.binary_search_by_key(&row.fix, |fix| fix.fix).ok()?;
    let found = known.get_mut(at)?;
    (Logged { check_deg: None, ..found.clone() } == Logged { check_deg: None, ..row.clone() }).then_some(found)
}

/// The row of a table. No number may be beyond what a fix can give.
fn read_row(table: &TableCsv) -> Result<Logged, FileError> {
    let whole = |name| {
        let column = table.column(name)?;
        let number = table.number_within(column, &(0.0..=1e15))?;
        if number.fract() != 0.0 {
            return Err(table.error(column, Problem::not_allowed(table.text(column), "a whole number")));
        }
        Ok(number as u64)
    };
    let text = |name| Ok::<_, FileError>(table.find_one(name)?.map_or_else(String::new, |column| table.text(column)));
    let number = |name, allowed: RangeInclusive<f64>| {
        let given = table.find_one(name)?.filter(|&column| !table.is_empty(column));
        given.map(|column| table.number_within(column, &allowed)).transpose()
    };
    Ok(Logged {
        fix: whole("fix")?,
        boot: whole("boot")?,
        t_s: number("t_s", 0.0..=1e10)?,
        utc: text("utc")?,
        azimuth_deg: number("azimuth_deg", -360.0..=360.0)?,
        sigma_deg: number("sigma_deg", LEAST_SIGMA_DEG..=360.0)?,
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
        flags: text("flags")?,
        firmware: text("firmware")?,
        model: text("model")?,
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
        let none = error("fix,boot,sigma_deg\n1,1,0.04\n2,1,0\n");
        assert!(none.contains("line 3, column 3 (sigma_deg): \"0\" is not allowed"), "{none}");
        let bias = error("fix,boot,bias_deg_h\n1,1,1\n2,1,1e30\n");
        assert!(bias.contains("line 3") && bias.contains("bias_deg_h") && bias.contains("1e30"), "{bias}");
        let half = error("fix,boot\n1,1\n1.5,1\n");
        assert!(half.contains("line 3") && half.contains("1.5") && half.contains("a whole number"), "{half}");
        let twice = error("fix,boot,bias_deg_h,bias_deg_h\n1,1,1,2\n");
        assert!(twice.contains("line 1") && twice.contains("\"bias_deg_h\" appears twice"), "{twice}");
        std::fs::write(&path, "fix,boot\n1,41\n2,42\n3,1\n").unwrap();
        let [warning] = Log::read(&[&path]).unwrap().warnings.try_into().unwrap();
        assert!(
            warning.contains("line 4") && warning.contains("boot") && warning.contains("after number 42"),
            "{warning}"
        );
    }

    /// A newer program may have flags that this one does not know.
    #[test]
    fn flags_without_a_name_here_are_doubted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.csv");
        let warnings = |rows: &str| {
            std::fs::write(&path, format!("fix,boot,flags\n{rows}")).unwrap();
            Log::read(&[&path]).unwrap().warnings
        };
        let all = Flag::ALL.iter().map(|flag| flag.name()).collect::<Vec<_>>().join(" ");
        assert_eq!(warnings(&format!("1,1,\n2,1,{all}\n")), [""; 0]);
        let [warning] = warnings("1,1,misfit\n2,1,misfit frobbed\n3,1,other\n").try_into().unwrap();
        assert!(warning.contains("line 3, column 3 (flags): no flag is called \"frobbed\" here"), "{warning}");
        assert!(warning.ends_with("the first of 2 fixes with such a flag"), "{warning}");
    }

    /// The log of a campaign counts its runs from the first, whatever was logged before; that of a board has what it had when it was read before.
    #[test]
    fn logs_of_campaigns_are_counted_on_and_those_of_a_board_overlap() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["2025.csv", "2026.csv"].map(|name| folder.path().join(name));
        let read = |texts: [&str; 2]| {
            paths.iter().zip(texts).for_each(|(path, text)| std::fs::write(path, text).unwrap());
            Log::read(&paths)
        };
        let numbers = |log: &Log| log.fixes.iter().map(|fix| (fix.fix, fix.boot)).collect::<Vec<_>>();
        let log = read(["fix,boot,bias_deg_h\n1,1,0.1\n2,2,0.2\n", "fix,boot,bias_deg_h\n1,1,0.3\n3,3,0.4\n"]).unwrap();
        assert_eq!(numbers(&log), [(1, 1), (2, 2), (3, 3), (5, 5)]);
        let [warning] = log.warnings.try_into().unwrap();
        assert!(warning.contains("2026.csv") && warning.contains("go on from 3"), "{warning}");

        let header = "fix,boot,bias_deg_h,firmware,check_deg\n";
        let first = format!("{header}7,1,0.1,beef,\n8,1,0.2,beef,\n");
        let second = format!("{header}8,1,0.2,beef,40\n9,2,0.3,beef,\n");
        let log = read([&first, &second]).unwrap();
        assert_eq!((numbers(&log), log.fixes[1].check_deg), (vec![(7, 1), (8, 1), (9, 2)], Some(40.0)));
        assert!(log.warnings[0].contains("1 fix that the logs before have"), "{:?}", log.warnings);
        // In the wrong order they do not follow each other.
        let error = read([&second, &first]).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("after number 9"), "{error}");
        let dated = |utc: &str| format!("fix,boot,utc\n1,1,{utc}\n");
        let error = read([&dated("2026-01-01T00:00:00Z"), &dated("2025-01-01T00:00:00Z")]).unwrap_err().to_string();
        assert!(error.contains("2026.csv, line 2"), "{error}");
    }
}
