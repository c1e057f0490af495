//! Summary of point statistics.

use crate::cli::shared::text;
use terrane_cloud::ReturnCounts;

/// Numbers of points read and left out, as text.
pub(crate) fn census(census: &ReturnCounts) -> String {
    let left_out = [
        (census.withheld, "withheld"),
        (census.filtered, "filtered out"),
        (census.outside, "outside the bounds of the header"),
        (census.lost, "lost"),
    ];
    let left_out = left_out.iter().filter(|(count, _)| *count > 0);
    let left_out: String =
        left_out.map(|(count, how)| format!(", {} {how}", text::count(*count))).collect();
    format!("{} of {}{left_out}", text::count(census.kept), text::count(census.read))
}
