//! Moments: text after ISO 8601, and seconds since the start of 1970.

/// Days of 400 years.
const ERA: i64 = 146_097;

/// Days from 1970-01-01 to a day of the Gregorian calendar; years begin in March, so that leap days
/// come last.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let (era, within) = (year.div_euclid(400), year.rem_euclid(400));
    let day = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * ERA + within * 365 + within / 4 - within / 100 + day - 719_468
}

/// The day that is `days` after 1970-01-01.
fn date(days: i64) -> (i64, i64, i64) {
    let days = days + 719_468;
    let (era, within) = (days.div_euclid(ERA), days.rem_euclid(ERA));
    let year = (within - within / 1460 + within / 36_524 - within / 146_096) / 365;
    let day = within - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, later) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    (era * 400 + year + later, month, day)
}

/// Seconds of "2026-01-31T12:00:00.5Z", also with an offset, or without (UTC is meant).
pub(super) fn seconds(text: &str) -> Option<f64> {
    let (day, time) = text.trim().split_once(['T', ' '])?;
    let mut parts = day.splitn(3, '-').map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (parts.next()??, parts.next()??, parts.next()??);
    let zone = time.find(['Z', 'z', '+', '-']).unwrap_or(time.len());
    let (clock, zone) = time.split_at(zone);
    let mut parts = clock.splitn(3, ':');
    let hour: i64 = parts.next()?.parse().ok()?;
    let minute: i64 = parts.next()?.parse().ok()?;
    let second = crate::number::whole(parts.next().unwrap_or("0").as_bytes())?;
    let is_sound = (0..=9999).contains(&year)
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0..=24).contains(&hour)
        && (0..60).contains(&minute)
        && (0.0..61.0).contains(&second);
    let offset = offset(zone)?;
    let minutes = (days(year, month, day) * 24 + hour) * 60 + minute - offset;
    is_sound.then_some((minutes * 60) as f64 + second)
}

/// Minutes that a zone is ahead of UTC.
fn offset(zone: &str) -> Option<i64> {
    let sign = match zone.chars().next() {
        None | Some('Z' | 'z') => return Some(0),
        Some('-') => -1,
        _ => 1,
    };
    let (hours, minutes) = zone[1..].split_once(':').unwrap_or((&zone[1..], "0"));
    Some(sign * (hours.parse::<i64>().ok()? * 60 + minutes.parse::<i64>().ok()?))
}

/// The text of a moment, to the millisecond; `None` outside of the years 0 to 9999.
pub(super) fn text(seconds: f64) -> Option<String> {
    let milliseconds = (seconds * 1000.0).round();
    if !(-6.3e13..2.6e14).contains(&milliseconds) {
        return None;
    }
    let milliseconds = milliseconds as i64;
    let (days, within) = (milliseconds.div_euclid(86_400_000), milliseconds.rem_euclid(86_400_000));
    let (year, month, day) = date(days);
    let (second, rest) = (within / 1000, within % 1000);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    let fraction = if rest == 0 { String::new() } else { format!(".{rest:03}") };
    (0..=9999).contains(&year).then(|| {
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}{fraction}Z")
    })
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
        ] {
            assert_eq!(seconds(moment), Some(expected), "{moment}");
            assert_eq!(seconds(&text(expected).unwrap()), Some(expected), "{moment}");
        }
        assert_eq!(seconds("2020-01-01T02:00:00+02:00"), seconds("2020-01-01T00:00:00Z"));
        assert_eq!(text(951_825_600.25).unwrap(), "2000-02-29T12:00:00.250Z");
        for bad in ["", "2020-01-01", "2020-13-01T00:00:00Z", "xT1:2:3Z", "2020-01-01T00:00:00+é"]
        {
            assert_eq!(seconds(bad), None, "{bad}");
        }
        assert_eq!(text(f64::MAX), None);
        for day in (-100_000..100_000).step_by(97) {
            let (year, month, date) = date(day);
            assert_eq!(days(year, month, date), day);
        }
    }
}
