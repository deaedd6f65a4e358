//! Time stamps that are dates with times, ISO 8601 as RFC 3339 has it.

use toml::value::{Datetime, Offset};

/// Seconds from the beginning of 1970 to a date with a time; without an offset it counts as universal time. `None`: it is none.
pub fn seconds(text: &str) -> Option<f64> {
    let Datetime { date: Some(date), time: Some(time), offset } = text.parse().ok()? else { return None };
    let offset_min = match offset {
        Some(Offset::Custom { minutes }) => i64::from(minutes),
        Some(Offset::Z) | None => 0,
    };
    let days = days(i64::from(date.year), i64::from(date.month), i64::from(date.day));
    let minutes = (24 * days + i64::from(time.hour)) * 60 + i64::from(time.minute) - offset_min;
    let second = f64::from(time.second.unwrap_or(0)) + 1e-9 * f64::from(time.nanosecond.unwrap_or(0));
    Some(60.0 * minutes as f64 + second)
}

/// Days from 1970-01-01 in the Gregorian calendar. The year is counted from March, so that the day which leap years have is its last.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // 719,468 days lie between 0000-03-01 and 1970-01-01; (153 m + 2)/5 is the length of m months from March.
    365 * year + leap_days + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_by_hand() {
        assert_eq!(seconds("1970-01-01T00:00:00Z"), Some(0.0));
        // 30 years with 7 leap days, then 59 days and a leap day of 2000: 1 March 2000 is day 10957 + 60.
        assert_eq!(seconds("2000-03-01T00:00:01.5Z"), Some(11_017.0 * 86_400.0 + 1.5));
        assert_eq!(seconds("2000-03-01 01:00:00+01:00"), Some(11_017.0 * 86_400.0));
        assert_eq!(seconds("2000-02-29T23:59:59").unwrap() + 1.0, 11_017.0 * 86_400.0);
        for none in ["2000-03-01", "09:00:00", "2000", "12.5", "2000-13-01T00:00:00Z", ""] {
            assert_eq!(seconds(none), None, "{none}");
        }
    }
}
