//! A board's log as the rows of a file.

use north_finder::event::restart::{Crash, WORDS};
use north_finder::event::service::record::{self, Context, CrashPart, LENGTH, More, Place, Record};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use super::Logged;

/// What has been read.
#[derive(Debug, Default)]
pub struct BoardLog {
    pub fixes: Vec<Logged>,
    /// Crashes, each with the number of the fix before it.
    pub crashes: Vec<(u32, Crash)>,
    /// Records that a power cut left.
    pub unreadable: usize,
    context: Context,
    /// Bytes of a crash of which not all parts have come.
    parts: Vec<u8>,
}

impl BoardLog {
    /// Takes records as the board sends them.
    pub fn take(&mut self, bytes: &[u8]) {
        for bytes in bytes.as_chunks::<LENGTH>().0 {
            match record::read(bytes) {
                Place::Holds(Record::Context(context)) => self.context = context,
                Place::Holds(Record::Fix(fix)) => self.fix(&fix),
                Place::Holds(Record::Check(azimuth_deg)) => {
                    if let Some(last) = self.fixes.last_mut() {
                        last.check_deg = Some(azimuth_deg);
                    }
                }
                Place::Holds(Record::Crash(part)) => self.crash(&part),
                Place::Holds(Record::More(more)) => self.more(&more),
                Place::Unreadable => self.unreadable += 1,
                Place::Blank => {}
            }
        }
    }

    fn more(&mut self, more: &More) {
        let Some(last) = self.fixes.last_mut() else { return };
        last.block_temp_c = more.block_temp_c.map(Into::into);
        [last.input_1, last.input_2, last.input_3, last.input_4] = more.inputs.map(|value| value.map(f64::from));
    }

    fn crash(&mut self, part: &CrashPart) {
        if part.number == 0 {
            self.parts.clear();
        }
        self.parts.extend(part.bytes);
        let mut words = [0; WORDS];
        if self.parts.len() < 4 * WORDS {
            return;
        }
        words.iter_mut().zip(self.parts.as_chunks().0).for_each(|(word, bytes)| *word = u32::from_le_bytes(*bytes));
        self.crashes.extend(Crash::of_words(&words).map(|crash| (self.context.fix, crash)));
    }

    fn fix(&mut self, fix: &record::Logged) {
        let Context { fix: number, boot, firmware, model, .. } = &mut self.context;
        *number = number.wrapping_add(1);
        *boot = boot.wrapping_add(fix.first.into());
        let utc = fix.utc_s.and_then(|utc_s| OffsetDateTime::from_unix_timestamp(utc_s.into()).ok());
        let flags: Vec<&str> = fix.flags.iter().map(|flag| flag.name()).collect();
        self.fixes.push(Logged {
            fix: (*number).into(),
            boot: (*boot).into(),
            t_s: Some(fix.t_s.into()),
            utc: utc.and_then(|utc| utc.format(&Rfc3339).ok()).unwrap_or_default(),
            azimuth_deg: Some(fix.azimuth_deg),
            sigma_deg: Some(fix.sigma_deg.into()),
            misfit: Some(fix.chi_square.into()),
            freedom: Some(fix.degrees_of_freedom.into()),
            bias_deg_h: Some(fix.bias_deg_h.into()),
            amplitude_deg_h: Some(fix.amplitude_deg_h.into()),
            drift_deg_h_per_h: Some(fix.drift_deg_h_per_h.into()),
            scatter_deg_h: Some(fix.scatter_deg_h.into()),
            temp_c: fix.temp_c.map(Into::into),
            supply_v: fix.supply_v.map(Into::into),
            chip_temp_c: fix.chip_temp_c.map(Into::into),
            flags: flags.join(" "),
            firmware: format!("{firmware:08x}"),
            model: if *model == 0 { String::new() } else { format!("{model:08x}") },
            ..Logged::default()
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_become_rows() {
        let fix = |first| {
            Record::Fix(record::Logged {
                first,
                utc_s: Some(1_767_225_600),
                azimuth_deg: 90.0,
                scatter_deg_h: 0.5,
                temp_c: Some(20.5),
                supply_v: Some(12.0),
                ..Default::default()
            })
        };
        let context = Context { sector: 4, fix: 100, boot: 7, firmware: 0xBEEF, model: 0xC0FFEE };
        let more = Record::More(More { block_temp_c: Some(30.5), inputs: [None, None, Some(0.25), None] });
        let records = [Record::Context(context), fix(true), more, Record::Check(90.25), fix(false)];
        let mut bytes: Vec<u8> = records.iter().flat_map(Record::bytes).collect();
        bytes.extend([0; LENGTH]);
        let mut log = BoardLog::default();
        log.take(&bytes);
        assert_eq!((log.fixes.len(), log.unreadable), (2, 1));
        let [one, two] = &log.fixes[..] else { panic!() };
        assert_eq!((one.fix, one.boot, two.fix, two.boot), (101, 8, 102, 8));
        assert_eq!((one.utc.as_str(), one.check_deg, two.check_deg), ("2026-01-01T00:00:00Z", Some(90.25), None));
        assert_eq!((one.scatter_deg_h, one.supply_v, two.supply_v), (Some(0.5), Some(12.0), Some(12.0)));
        assert_eq!((one.block_temp_c, one.input_3, two.input_3), (Some(30.5), Some(0.25), None));
        assert_eq!((one.model.as_str(), one.firmware.as_str(), one.temp_c), ("00c0ffee", "0000beef", Some(20.5)));
    }
}
