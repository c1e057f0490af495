//! Times: ISO 8601 text, and seconds since 1970-01-01.

use chrono::{DateTime, Datelike, SecondsFormat, Timelike};

/// Seconds since 1970-01-01 of "2026-01-31T12:00:00.5Z", with an optional UTC offset (default UTC).
pub(super) fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    let moment = DateTime::parse_from_rfc3339(text)
        .or_else(|_| DateTime::parse_from_rfc3339(&format!("{text}Z")))
        .ok()?
        .to_utc();
    // A leap second has a nanosecond part above 10^9.
    let nanoseconds = u64::from(moment.second()) * 1_000_000_000 + u64::from(moment.nanosecond());
    let minutes = moment.timestamp().div_euclid(60) * 60;
    Some(minutes as f64 + nanoseconds as f64 / 1e9)
}

/// ISO 8601 text with milliseconds; `None` outside the years 0 to 9999.
pub(super) fn text(seconds: f64) -> Option<String> {
    let moment = DateTime::from_timestamp_millis((seconds * 1000.0).round() as i64)?;
    let is_in = (0..=9999).contains(&moment.year());
    is_in.then(|| moment.to_rfc3339_opts(SecondsFormat::AutoSi, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_both_ways() {
        for (moment, expected) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2007-06-20T00:58:50Z", 1_182_301_130.0),
            ("2000-02-29T12:00:00.250Z", 951_825_600.25),
            ("1969-12-31T23:59:59Z", -1.0),
            ("0000-01-01T00:00:00Z", -62_167_219_200.0),
            ("9999-12-31T23:59:59.999Z", 253_402_300_799.999),
        ] {
            assert_eq!(seconds(moment), Some(expected), "{moment}");
            assert_eq!(seconds(&text(expected).unwrap()), Some(expected), "{moment}");
        }
        assert_eq!(seconds("2020-01-01T02:00:00+02:00"), seconds("2020-01-01T00:00:00Z"));
        assert_eq!(seconds("2020-01-01 02:00:00"), seconds("2020-01-01T02:00:00z"));
        assert_eq!(seconds("2016-12-31T23:59:60.5Z"), Some(1_483_228_800.5));
        assert_eq!(text(951_825_600.25).unwrap(), "2000-02-29T12:00:00.250Z");
        for bad in [
            "",
            "2020-01-01",
            "2020-13-01T00:00:00Z",
            "2021-02-29T00:00:00Z",
            "xT1:2:3Z",
            "2020-01-01T00:00:00+é",
        ] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
        assert_eq!(text(f64::MAX), None);
    }
}
