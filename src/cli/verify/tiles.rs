//! Summary of verified terrain tiles.

use crate::cli::shared::{report, text};
use crate::cli::verify::verdict;
use terrane_verify::tiles::{CheckReport, LevelProofReport, TilesVerifyReport};

/// Summary of a verification: verdict, failures, and figures.
pub(super) fn summary(r: &TilesVerifyReport) -> String {
    let verdict = verdict::in_words(&r.verdict);
    let failures: String = r.verdict.failures.iter().map(|f| format!("  - {f}\n")).collect();
    let sizes = [r.files, r.vertices, r.triangles].map(text::count);
    let mut rows = vec![(
        "tiles".to_owned(),
        format!("{}, {} vertices, {} triangles", sizes[0], sizes[1], sizes[2]),
    )];
    rows.extend(r.checks.iter().map(|check| (check.check.to_owned(), judged(check))));
    rows.extend(r.levels.iter().map(|level| (format!("level {}", level.level), of(level))));
    let rate = text::rate(r.samples_per_second, "samples");
    let took = report::took(&r.run, Some(rate), "");
    rows.extend(took.into_iter().chain(report::notes(&r.notes)).map(|(k, v)| (k.to_owned(), v)));
    format!("{verdict}\n{failures}{}", text::table(&rows))
}

fn judged(check: &CheckReport) -> String {
    let faults: u64 = check.faults.iter().map(|fault| fault.count).sum();
    let verdict = match faults {
        0 => "no faults".to_owned(),
        count => format!("{} faults", text::count(count)),
    };
    format!("{verdict}; {}", check.looked_at)
}

/// A level on one line.
fn of(level: &LevelProofReport) -> String {
    let [error, allowed] =
        [level.max_error.map_or("-".to_owned(), text::bound), text::number(level.tolerance)];
    let gap = match (level.coarser_gap, level.coarser_gap_allowed) {
        (Some(gap), Some(allowed)) => {
            format!(", gap {} of {} to the coarser level", text::bound(gap), text::number(allowed))
        }
        _ => String::new(),
    };
    format!(
        "{} tiles, error {error} of {allowed} m, RMSE {}; {} borders, {} differ, gap {}{gap}",
        text::count(level.tiles),
        text::height(level.rmse),
        text::count(level.borders),
        text::count(level.borders_differing),
        level.gap.map_or("-".to_owned(), text::bound)
    )
}
