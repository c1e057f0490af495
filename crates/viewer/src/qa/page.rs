//! The report as one HTML file without scripts, which loads nothing.

use std::fmt::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::picture::DrawnPicture;
use super::report::{QaDensity, QaOverlap, QaReport};
use super::tally::QaRange;
use crate::html::escape;
use terrane_base::frontend::Frontend;
use terrane_cloud::class_name;

/// Most rows of a table; the report in JSON has all.
const MAX_ROWS: usize = 2000;

const HEAD: &str = include_str!("../../web/qa.html");

/// The pictures of a report.
#[derive(Default)]
pub(super) struct QaPage {
    pub(super) density: Option<DrawnPicture>,
    pub(super) differences: Option<DrawnPicture>,
    /// Cells along the side of a pixel.
    pub(super) step: u64,
}

/// The folder of all files, as given, up to the name of each. The page shows names without it: those of a run in another
/// folder are the same.
fn common_folder(report: &QaReport) -> String {
    let mut names = report.file_list.iter().map(|file| file.file.as_str());
    let Some(first) = names.next() else { return String::new() };
    let folder = |text: &str| text.rfind(['/', '\\']).map_or(0, |at| at + 1);
    let mut length = folder(first);
    for name in names {
        let same = first[..length].chars().zip(name.chars()).take_while(|(a, b)| a == b);
        length = folder(&first[..same.map(|(c, _)| c.len_utf8()).sum()]);
    }
    first[..length].to_owned()
}

/// The files, in their order, however they were given.
fn subject(report: &QaReport, folder: &str) -> String {
    match report.file_list.as_slice() {
        [] => report.input.clone(),
        [only] => without_folder(&only.file, folder),
        [first, others @ ..] => {
            let more = count(others.len() as u64);
            format!("{} and {more} more", without_folder(&first.file, folder))
        }
    }
}

/// The name of a file without the common folder.
fn without_folder(name: &str, folder: &str) -> String {
    name.strip_prefix(folder).unwrap_or(name).to_owned()
}

/// A note without the folder of the files whose names begin a word.
fn short_note(note: &str, folder: &str) -> String {
    let (mut out, mut from) = (String::new(), 0);
    for (at, _) in note.match_indices(folder).filter(|_| !folder.is_empty()) {
        if at == 0 || note[..at].ends_with(' ') {
            out.push_str(&note[from..at]);
            from = at + folder.len();
        }
    }
    out + &note[from..]
}

/// A table under construction.
struct HtmlTable {
    out: String,
    rows: usize,
    left_out: usize,
}

impl HtmlTable {
    fn new(heads: &[&str]) -> Self {
        let heads: String = heads.iter().map(|head| format!("<th>{}</th>", escape(head))).collect();
        Self { out: format!("<table>\n<tr>{heads}</tr>\n"), rows: 0, left_out: 0 }
    }

    fn row(&mut self, cells: &[String]) {
        if self.rows == MAX_ROWS {
            self.left_out += 1;
            return;
        }
        self.rows += 1;
        let cells: String = cells.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect();
        self.out.push_str("<tr>");
        self.out.push_str(&cells);
        self.out.push_str("</tr>\n");
    }

    fn html(mut self) -> String {
        self.out.push_str("</table>\n");
        if self.left_out > 0 {
            let more = count(self.left_out as u64);
            self.out.push_str(&paragraph(&format!("{more} more rows are in the JSON report.")));
        }
        self.out
    }
}

impl QaPage {
    /// The whole page.
    pub(super) fn html(&self, report: &QaReport) -> String {
        let folder = common_folder(report);
        let title = format!("Quality of {}", subject(report, &folder));
        let mut out = HEAD.replace("{{title}}", &escape(&title));
        out.push_str(&summary(report, &folder));
        self.density(report, &mut out);
        voids(report, &mut out);
        lines(report, &mut out);
        self.overlaps(report, &mut out);
        contents(report, &mut out);
        headers(report, &folder, &mut out);
        out.push_str("</main>\n</body>\n</html>\n");
        out
    }

    fn density(&self, report: &QaReport, out: &mut String) {
        out.push_str("<h2>Density</h2>\n");
        let (Some(points), Some(pulses), Some(cell)) =
            (&report.density, &report.pulse_density, report.cell)
        else {
            out.push_str(&paragraph("There are no points."));
            requirement(report, out);
            return;
        };
        let unit = format!("square {}", report.area_unit);
        let text = format!(
            "Points and pulses (last returns) per {unit} in cells of {cell}, over the footprint: {} occupied cells and \
             {} empty cells that they enclose. Its area is {}. Withheld points are left out unless asked for. Cells at the \
             border are partly outside the survey.",
            count(report.occupied_cells),
            count(report.enclosed_cells),
            number(report.footprint_area),
        );
        out.push_str(&paragraph(&text));
        let mut table = HtmlTable::new(&["", "points", "pulses"]);
        let mut row = |name: &str, value: &dyn Fn(&QaDensity) -> String| {
            table.row(&[name.to_owned(), value(points), value(pulses)]);
        };
        row("count", &|it| count(it.points));
        row("mean", &|it| number(it.mean));
        row("lowest", &|it| number(it.lowest));
        for (at, (percent, _)) in points.percentiles.iter().enumerate() {
            let name = if *percent == 50 { "median".to_owned() } else { format!("{percent} %") };
            row(&name, &|it| number(it.percentiles[at].1));
        }
        row("highest", &|it| number(it.highest));
        out.push_str(&table.html());
        requirement(report, out);
        if let Some(picture) = &self.density {
            // Counts per cell to densities.
            let highest = picture.highest / report.cell_area.unwrap_or(1.0);
            self.figure(picture, "Points per unit of area", highest, out);
        }
    }

    fn overlaps(&self, report: &QaReport, out: &mut String) {
        out.push_str("<h2>Overlap of flight lines</h2>\n");
        let overlaps = &report.overlaps;
        if report.overlaps_left_out > 0 {
            out.push_str(&paragraph(&format!(
                "There are too many pairs of point source ids, which may not be flight lines: {} overlaps of other pairs, \
                 counted by cell, are left out.",
                count(report.overlaps_left_out)
            )));
        }
        let Some(rule) = report.comparison.filter(|_| !overlaps.is_empty()) else {
            out.push_str(&paragraph("No flight lines are compared."));
            return;
        };
        let text = format!(
            "Mean height of the last returns of the first line minus that of the second, in cells where each line has \
             {} last returns or more within {} of height.",
            rule.min_returns,
            number(rule.max_range)
        );
        out.push_str(&paragraph(&text));
        let mut table = HtmlTable::new(&[
            "lines",
            "area",
            "cells",
            "compared",
            "mean",
            "median",
            "RMSE",
            "95 % of |dz|",
            "largest |dz|",
        ]);
        for overlap in overlaps {
            table.row(&overlap_row(overlap));
        }
        out.push_str(&table.html());
        if let Some(picture) = &self.differences {
            self.figure(picture, "Largest |dz| of two lines", picture.highest, out);
        }
    }

    fn figure(&self, picture: &DrawnPicture, what: &str, highest: f64, out: &mut String) {
        let data = STANDARD.encode(&picture.png);
        let [width, height] = picture.size;
        let colours: Vec<String> =
            picture.colours.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
        let cells = if self.step == 1 {
            "a cell".to_owned()
        } else {
            format!("{0} x {0} cells", self.step)
        };
        let _ = writeln!(
            out,
            "<figure><img width=\"{width}\" height=\"{height}\" alt=\"{what}\" src=\"data:image/png;base64,{data}\">\n\
             <div class=\"bar\" style=\"background:linear-gradient(to right,{})\"></div>\n\
             <figcaption><span>0</span><span>{what}, north is up; a pixel is {cells}</span><span>{} and \
             more</span></figcaption></figure>",
            colours.join(","),
            number(highest)
        );
    }
}

fn requirement(report: &QaReport, out: &mut String) {
    let Some(required) = &report.min_density else { return };
    let class = match required.is_met {
        Some(true) => "met",
        Some(false) => "missed",
        None => "",
    };
    let _ = writeln!(
        out,
        "<p><b class=\"{class}\">{}</b>: mean density of pulses {}, required {}. {} % of the cells are below the \
         required density.</p>",
        required.verdict(),
        number(report.pulse_density.as_ref().map_or(0.0, |pulses| pulses.mean)),
        number(required.required),
        number(required.below * 100.0)
    );
}

fn overlap_row(overlap: &QaOverlap) -> Vec<String> {
    let optional = |value: Option<f64>| value.map_or("-".to_owned(), height);
    let QaOverlap { lines: [a, b], area, cells, compared, mean, median, rmse, p95, largest } =
        overlap;
    let mut row = vec![format!("{a}, {b}"), number(*area), count(*cells), count(*compared)];
    row.extend([mean, median, rmse, p95, largest].map(|value| optional(*value)));
    row
}

fn summary(report: &QaReport, folder: &str) -> String {
    let units = match &report.vertical_unit {
        Some(up) => format!("{}, heights in {up}", report.horizontal_unit),
        None => format!("{}, unit of heights unknown", report.horizontal_unit),
    };
    let filters = match report.filters.is_empty() {
        true => "none".to_owned(),
        false => {
            let all = report.filters.iter().map(|(name, value)| match value.as_str() {
                Some(path) if name == "clip" => format!("clip {}", file_name(path)),
                Some(text) => format!("{name} {text}"),
                None => format!("{name} {value}"),
            });
            all.collect::<Vec<_>>().join("; ")
        }
    };
    let mut table = HtmlTable::new(&["", ""]);
    for (name, value) in [
        ("files", format!("{} ({})", count(report.files), report.format)),
        ("points", count(report.contents.stats.census.kept)),
        ("CRS", report.crs.clone()),
        ("units", units),
        ("unit of areas", format!("square {}", report.area_unit)),
        ("filters", filters),
        ("index", report.index.as_deref().map_or_else(|| "none".to_owned(), file_name)),
        ("findings in headers", count(report.findings.len() as u64)),
    ] {
        table.row(&[name.to_owned(), value]);
    }
    let notes = report.notes.iter().map(|note| {
        let note = short_note(note, folder);
        let note = Frontend::CommandLine.spell(&note);
        paragraph(&format!("Note: {note}."))
    });
    table.html() + &notes.collect::<String>()
}

/// The last part of a path.
pub(super) fn file_name(path: &str) -> String {
    Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn voids(report: &QaReport, out: &mut String) {
    let Some(voids) = &report.voids else { return };
    out.push_str("<h2>Voids</h2>\n");
    let text = format!(
        "Groups of empty cells, connected by sides and enclosed by occupied cells, with an area of {} or more: {}, \
         together {}.",
        number(voids.min_area),
        count(voids.count),
        number(voids.area)
    );
    out.push_str(&paragraph(&text));
    if voids.largest.is_empty() {
        return;
    }
    let mut table = HtmlTable::new(&["area", "cells", "west", "south", "east", "north", "inside"]);
    for void in &voids.largest {
        let mut row = vec![number(void.area), count(void.cells)];
        row.extend(void.bounds.map(exact));
        row.push(void.inside.map(exact).join(", "));
        table.row(&row);
    }
    out.push_str(&table.html());
}

fn lines(report: &QaReport, out: &mut String) {
    out.push_str("<h2>Flight lines</h2>\n");
    let mut table = HtmlTable::new(&[
        "point source id",
        "points",
        "last returns",
        "area",
        "density",
        "pulses",
        "GPS time",
        "scan angle",
    ]);
    for line in &report.lines {
        table.row(&[
            line.line.to_string(),
            count(line.points),
            count(line.last_returns),
            number(line.area),
            number(line.density),
            number(line.pulse_density),
            range(line.gps_time),
            range(line.scan_angle),
        ]);
    }
    out.push_str(&table.html());
}

fn contents(report: &QaReport, out: &mut String) {
    let contents = &report.contents;
    let stats = &contents.stats;
    out.push_str("<h2>Contents</h2>\n");
    let share = |points: u64| {
        format!("{} %", number(points as f64 * 100.0 / stats.census.kept.max(1) as f64))
    };
    let mut table = HtmlTable::new(&["", "points", "share"]);
    for (number, points) in &stats.returns {
        table.row(&[format!("return {number}"), count(*points), share(*points)]);
    }
    table.row(&["last returns".to_owned(), count(stats.last), share(stats.last)]);
    for (class, points) in &stats.classes {
        let name = format!("class {class}, {}", class_name(*class));
        table.row(&[name, count(*points), share(*points)]);
    }
    for (flag, points) in &stats.flags {
        table.row(&[format!("flag {flag}"), count(*points), share(*points)]);
    }
    out.push_str(&table.html());
    let mut table = HtmlTable::new(&["", "range"]);
    for (name, value) in [
        ("intensity", contents.intensity),
        ("scan angle, degrees", contents.scan_angle),
        ("GPS time, seconds", contents.gps_time),
    ] {
        table.row(&[name.to_owned(), range(value)]);
    }
    if let Some([low, high]) = stats.bounds {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            table.row(&[name.to_owned(), format!("{} to {}", exact(low[axis]), exact(high[axis]))]);
        }
    }
    out.push_str(&table.html());
}

fn headers(report: &QaReport, folder: &str, out: &mut String) {
    out.push_str("<h2>Headers against contents</h2>\n");
    if !report.headers_compared {
        out.push_str(&paragraph(
            "Counts and bounds are not compared, because filters leave points out.",
        ));
    }
    if report.findings.is_empty() {
        out.push_str(&paragraph("No disagreement was found."));
    } else {
        let mut table = HtmlTable::new(&["file", "finding"]);
        for finding in &report.findings {
            table.row(&[without_folder(&finding.file, folder), finding.finding.clone()]);
        }
        out.push_str(&table.html());
    }
    out.push_str("<h2>Files</h2>\n");
    let heads =
        ["file", "points", "area", "density", "LAS", "point format", "created", "GPS time", "CRS"];
    let mut table = HtmlTable::new(&heads);
    for file in &report.file_list {
        table.row(&[
            without_folder(&file.file, folder),
            count(file.points),
            number(file.area),
            number(file.density),
            file.version.clone().unwrap_or_else(|| "-".to_owned()),
            file.point_format.map_or_else(|| "-".to_owned(), |format| format.to_string()),
            file.created.clone().unwrap_or_else(|| "-".to_owned()),
            range(file.gps_time),
            file.crs.clone(),
        ]);
    }
    out.push_str(&table.html());
}

fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escape(text))
}

fn range(range: Option<QaRange>) -> String {
    range.map_or("-".to_owned(), |QaRange { low, high }| {
        format!("{} to {}", exact(low), exact(high))
    })
}

/// A count with spaces between thousands.
fn count(value: u64) -> String {
    let digits = value.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join("\u{202f}")
}

/// A coordinate or a time, without the digits that binary fractions add.
pub(super) fn exact(value: f64) -> String {
    let text = format!("{value:.9}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// About four digits.
fn number(value: f64) -> String {
    if (1e4..1e15).contains(&value) {
        return count(value.round() as u64);
    }
    if value != 0.0 && !(1e-4..1e15).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let decimals = match value.abs() {
        100.0.. => 1,
        1.0.. => 2,
        _ => 4,
    };
    format!("{value:.decimals$}")
}

/// A difference of heights.
fn height(value: f64) -> String {
    // No negative zero.
    let text = format!("{value:.4}");
    if text == "-0.0000" { "0.0000".to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::{number, short_note};

    #[test]
    fn small_and_large_numbers_have_exponents() {
        let all = [0.0, 2.5e-5, -2.5e-9, 1e-4, 12.0, 1e15].map(number);
        assert_eq!(all, ["0.0000", "2.500e-5", "-2.500e-9", "0.0001", "12.00", "1.000e15"]);
    }

    #[test]
    fn notes_lose_the_folder_of_names_only() {
        assert_eq!(
            short_note("a/x.las: a/data/y.las is left out", "a/"),
            "x.las: data/y.las is left out"
        );
        assert_eq!(short_note("as it is", ""), "as it is");
    }
}
