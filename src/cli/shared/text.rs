//! Numbers, sizes and durations as text.

use std::fmt::Write;

use serde_json::Value;

use terrane_engine::bands::MeshBandReport;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::constraints::RequiredPointsReport;
use terrane_engine::local_frame::StorageScale;
use terrane_raster::WaterReport;

/// "1,234,567".
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Up to six significant digits, without trailing zeros.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { value.to_string() };
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-5..=14).contains(&magnitude) {
        return powers(&format!("{value:.5e}"));
    }
    trimmed(&format!("{value:.*}", (5 - magnitude).max(0) as usize))
}

/// As [`number`], but never below the non-negative value.
pub(crate) fn bound(value: f64) -> String {
    let text = number(value);
    if text.parse::<f64>().is_ok_and(|shown| shown < value) {
        let half_a_digit = 10_f64.powi(value.log10().floor() as i32 - 5) / 2.0;
        return number(value + half_a_digit);
    }
    text
}

/// A height, or a dash if not measured.
pub(crate) fn height(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), number)
}

/// A coordinate to nine decimals, shortest form; tiny and huge ones in powers of ten.
pub(crate) fn position(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-6..1e15).contains(&value.abs()) {
        return format!("{value:e}");
    }
    trimmed(&format!("{value:.9}"))
}

/// Digits without trailing zeros.
fn trimmed(text: &str) -> String {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    }
}

/// A number in powers of ten without trailing zeros: "1.50000e-9" becomes "1.5e-9".
fn powers(text: &str) -> String {
    text.split_once('e')
        .map_or(text.to_owned(), |(digits, power)| format!("{}e{power}", trimmed(digits)))
}

/// "12.3 MiB".
pub(crate) fn bytes(n: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if n < 1024 {
        return format!("{n} bytes");
    }
    let mut value = n as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1023.95 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

/// "0.42 s", "3 min 20 s", "2 h 05 min".
pub(crate) fn seconds(s: f64) -> String {
    if s < 10.0 {
        return format!("{s:.2} s");
    }
    let rounded = s.round() as u64;
    match rounded {
        0..=59 => format!("{s:.1} s"),
        60..=3599 => format!("{} min {:02} s", rounded / 60, rounded % 60),
        _ => format!("{} h {:02} min", rounded / 3600, rounded % 3600 / 60),
    }
}

/// "12.3 M samples/s".
pub(crate) fn rate(per_second: f64, what: &str) -> String {
    let (value, prefix) = match per_second {
        r if r >= 1e9 => (r / 1e9, "G "),
        r if r >= 1e6 => (r / 1e6, "M "),
        r if r >= 1e3 => (r / 1e3, "k "),
        r => (r, ""),
    };
    format!("{value:.1} {prefix}{what}/s")
}

/// "1.23 %"; small shares keep two significant digits.
pub(crate) fn percent(share: f64) -> String {
    let value = share * 100.0;
    if value >= 0.1 || value == 0.0 {
        return format!("{value:.2} %");
    }
    let rounded = format!("{value:.1e}").parse().unwrap_or(value);
    format!("{} %", number(rounded))
}

/// Aligned "name  value" lines, each indented by two.
pub(crate) fn table(rows: &[(impl AsRef<str>, String)]) -> String {
    let width = rows.iter().map(|(name, _)| name.as_ref().chars().count()).max().unwrap_or(0);
    rows.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "  {:width$}  {value}", name.as_ref());
        text
    })
}

/// The plain values of a report as rows: keys become words, numbers become readable.
pub(crate) fn rows(report: &Value) -> Vec<(String, String)> {
    let entries = report.as_object().into_iter().flatten();
    entries.filter_map(|(key, value)| Some((key.replace('_', " "), plain(key, value)?))).collect()
}

fn plain(key: &str, value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Bool(yes) => Some(if *yes { "yes" } else { "no" }.to_owned()),
        Value::Number(n) => Some(match (key, n.as_u64(), n.as_f64()) {
            (k, Some(n), _) if k.ends_with("bytes") || k.contains("memory") => bytes(n),
            (k, _, Some(s)) if k.ends_with("seconds") => seconds(s),
            (k, _, Some(r)) if k.ends_with("per_second") => {
                rate(r, k.trim_end_matches("_per_second"))
            }
            (_, Some(n), _) => count(n),
            (_, _, x) => number(x?),
        }),
        _ => None,
    }
}

/// Summary of kept points: "1,230 vertices at 1,240 points of a.csv; 4 points are outside of the grid".
pub(crate) fn required_points(kept: &RequiredPointsReport, of: &str) -> String {
    let [vertices, points] = [kept.vertices, kept.points].map(count);
    let outside = also(kept.outside, &format!("points are outside of the {of}"));
    let void = also(kept.without_surface, "samples have no surface");
    format!("{vertices} vertices at {points} points of {}{outside}{void}", kept.file)
}

/// "; 4 points are outside of the grid", or nothing for none.
fn also(n: u64, what: &str) -> String {
    if n == 0 { String::new() } else { format!("; {} {what}", count(n)) }
}

/// The error in a band: "2 (weight 0.5): at most 19.5, RMSE 4.1".
pub(crate) fn band(r: &MeshBandReport) -> String {
    let [max, rmse] = [r.max_error.map(bound), r.rmse.map(number)].map(Option::unwrap_or_default);
    format!("{} (weight {}): at most {max}, RMSE {rmse}", r.band, number(r.weight))
}

/// Summary of breaklines: "1,230 segments of a.shp, followed; 4 are outside of the grid".
pub(crate) fn breaklines(lines: &BreaklinesReport, of: &str) -> String {
    let outside = match lines.outside {
        0 => String::new(),
        n => format!("; {} are outside of the {of}", count(n)),
    };
    let followed = if lines.apart == 0 { "followed" } else { "NOT followed by all edges" };
    format!("{} of {}, {followed}{outside}", plural(lines.segments, "segment"), lines.file)
}

/// "1 lake", "1,200 lakes".
fn plural(n: u64, noun: &str) -> String {
    format!("{} {noun}{}", count(n), if n == 1 { "" } else { "s" })
}

/// Summary of water: "3 lakes and 1 river of a.shp, level from 10.5 to 84".
pub(crate) fn water(water: &WaterReport) -> String {
    let mut line = format!(
        "{} and {} of {}",
        plural(water.lakes, "lake"),
        plural(water.rivers, "river"),
        water.file
    );
    if let Some([low, high]) = water.levels.map(|levels| levels.map(number)) {
        line += &format!(", level from {low} to {high}");
    }
    if water.dug > 0.0 {
        let dug = number(water.dug);
        line += &format!("; up to {dug} below the lowest bank, as banks are lower upstream");
    }
    if water.without_bank > 0 {
        line += &format!("; {} without a bank of their own", count(water.without_bank));
    }
    if water.outside > 0 {
        line += &format!("; {} outside of the grid", count(water.outside));
    }
    line
}

/// Scale of a mesh in its file: "in metres; 1 x 1 x 2 per unit of x, y and z".
pub(crate) fn placed(placed: &StorageScale) -> String {
    let scale = placed.scale.map(number).join(" x ");
    let unit = placed.unit.as_ref().map(|unit| format!("in {unit}s; ")).unwrap_or_default();
    format!("{unit}{scale} per unit of x, y and z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(count(0), "0");
        assert_eq!(count(1234567), "1,234,567");
        assert_eq!(number(4.998046875), "4.99805");
        assert_eq!(number(1200.0), "1200");
        assert_eq!(number(-0.000833333), "-0.000833333");
        assert_eq!(number(6.4e-9), "6.4e-9");
        assert_eq!(number(1e-9), "1e-9");
        assert_eq!(number(-1.23456789e300), "-1.23457e300");
        assert_eq!(number(9.999999e15), "1e16");
        assert_eq!((bound(0.0), bound(0.5), bound(2.0)), ("0".into(), "0.5".into(), "2".into()));
        assert_eq!((bound(0.123_456_1), bound(9.999_991)), ("0.123457".into(), "10".into()));
        assert_eq!((bound(1.000_001e-9), bound(1234.561)), ("1.00001e-9".into(), "1234.57".into()));
        assert_eq!(bytes(1023), "1023 bytes");
        assert_eq!(bytes(1 << 20), "1.0 MiB");
        assert_eq!(seconds(0.4217), "0.42 s");
        assert_eq!(seconds(200.0), "3 min 20 s");
        assert_eq!(seconds(7500.0), "2 h 05 min");
        assert_eq!(rate(123_456_789.0, "samples"), "123.5 M samples/s");
        assert_eq!(percent(0.0123), "1.23 %");
        assert_eq!(percent(0.000_01), "0.001 %");
        assert_eq!(percent(1e-9), "1e-7 %");
        assert_eq!((percent(0.0), percent(1.0)), ("0.00 %".into(), "100.00 %".into()));
    }

    #[test]
    fn positions_keep_their_digits_and_no_more() {
        assert_eq!(position(30.0), "30");
        assert_eq!(position(-124.000138889), "-124.000138889");
        assert_eq!(position(4_000_000.5), "4000000.5");
        assert_eq!((position(0.0), position(-0.0)), ("0".to_owned(), "0".to_owned()));
        assert_eq!(position(1e-9), "1e-9");
        assert_eq!(position(-2.5e-12), "-2.5e-12");
        assert_eq!(position(1e300), "1e300");
        assert_eq!(position(499_999.999_5), "499999.9995");
    }

    #[test]
    fn reports_become_rows() {
        let report = serde_json::json!({ "output_bytes": 2048, "wall_seconds": 1.5, "passed": true,
            "samples": 12345, "list": [], "none": null });
        let rows = rows(&report);
        assert!(rows.contains(&("output bytes".into(), "2.0 KiB".into())));
        assert!(rows.contains(&("samples".into(), "12,345".into())));
        assert_eq!(rows.len(), 4);
    }
}
