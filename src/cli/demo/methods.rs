//! `terrane demo --methods`: a small terrain by several methods at the same largest error, with verified meshes
//! in one picture.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{DemoArgs, mesh, name_of, picture, prove, size, terrain};
use crate::cli::shared::{VerbOutcome, output, report, text};
use terrane_base::error::{Error, Result};
use terrane_baselines::{METHODS, TriangulationRule};
use terrane_engine::proof::ProofVerdict;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic;
use terrane_terrain::convert;
use terrane_terrain::tin::{TextbookMethod, TinGoal, TinJob};
use terrane_viewer::view::{ContactSheetJob, PicturePanel, run_contact_sheet};

/// Terrain small enough for methods that hold it in memory and for visible edges, and the error bound in
/// metres.
const TERRAIN: &str = "synth:rough,size=129,seed=7";
const TOLERANCE: f64 = 2.0;

/// A mesh method: the engine's own, or a textbook method by name.
struct DemoMethod {
    label: &'static str,
    file: &'static str,
    method: Option<&'static str>,
    fit_heights: bool,
}

const fn textbook(name: &'static str, file: &'static str) -> DemoMethod {
    DemoMethod { label: name, file, method: Some(name), fit_heights: false }
}

/// Compared methods, in the order of the picture.
const COMPARED: [DemoMethod; 6] = [
    DemoMethod { label: "greedy", file: "greedy.ply", method: None, fit_heights: false },
    DemoMethod {
        label: "greedy --fit-heights",
        file: "greedy-fit.ply",
        method: None,
        fit_heights: true,
    },
    textbook("collapse", "collapse.ply"),
    textbook("kdtree", "kdtree.ply"),
    textbook("rtin", "rtin.ply"),
    textbook("vip", "vip.ply"),
];
/// Panels per row, and width of a panel in pixels.
const COLUMNS: usize = 3;
const PANEL: u32 = 480;

/// Results of a mesh.
#[derive(Serialize)]
struct DemoMeshRow {
    method: &'static str,
    mesh: String,
    vertices: u64,
    triangles: u64,
    /// Measured by the verification.
    max_error: Option<f64>,
    rmse: Option<f64>,
    /// Time without the verification.
    wall_seconds: f64,
    #[serde(flatten)]
    verdict: ProofVerdict,
    #[serde(skip)]
    vertical_unit: String,
}

#[derive(Serialize)]
struct MethodComparison {
    terrain: String,
    width: u32,
    height: u32,
    tolerance: f64,
    vertical_unit: String,
    picture: String,
    methods: Vec<DemoMeshRow>,
}

pub(super) fn run(args: &DemoArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let folder = args.dir.join("methods");
    atomic::create_folders(&folder)?;
    let [grid, drawn, report_file] =
        ["terrain.tif", "methods.png", "report.json"].map(|name| folder.join(name));
    let (resources, progress) = (args.resources.0.clone(), args.show.progress());
    let progress = progress.as_ref();
    let copied = convert::run(&terrain(TERRAIN, &grid, &resources), progress, cancel)?;
    let mut methods = Vec::new();
    for method in &COMPARED {
        let mut job = mesh(&grid, &folder.join(method.file), &resources)?;
        job.refinement.fit_heights = method.fit_heights;
        let job = TinJob { goal: TinGoal::MaxError(TOLERANCE), ..job };
        methods.push(row(method, &job, progress, cancel)?);
    }
    run_contact_sheet(&contact_sheet(&methods, &drawn, &resources), progress, cancel)?;
    let comparison = MethodComparison {
        terrain: name_of(&grid)?,
        width: copied.width,
        height: copied.height,
        tolerance: TOLERANCE,
        vertical_unit: methods[0].vertical_unit.clone(),
        picture: name_of(&drawn)?,
        methods,
    };
    report::write(&report_file, true, &comparison)?;
    if args.show.json {
        output::json(&comparison)?;
    } else if !args.show.quiet {
        output::result(&summary(&comparison, [&grid, &drawn, &report_file])?)?;
    }
    let passed = comparison.methods.iter().all(|row| row.verdict.passed);
    let judged = comparison.methods.iter().all(|row| row.verdict.judged);
    Ok(VerbOutcome::of(passed, judged))
}

/// Makes and verifies a mesh.
fn row(
    method: &DemoMethod,
    job: &TinJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<DemoMeshRow> {
    let made = match method.method {
        None => terrane_terrain::tin::run(job, progress, cancel)?,
        Some(name) => terrane_terrain::tin::run_by(job, &by_name(name)?, progress, cancel)?,
    };
    let checked = prove(job, &made, progress, cancel)?;
    Ok(DemoMeshRow {
        method: method.label,
        mesh: made.output,
        vertices: made.vertices,
        triangles: made.triangles,
        max_error: checked.max_error,
        rmse: checked.rmse,
        wall_seconds: made.run.wall_seconds,
        verdict: checked.verdict,
        vertical_unit: made.vertical_unit,
    })
}

fn by_name(name: &str) -> Result<TextbookMethod> {
    let method = METHODS
        .iter()
        .find(|method| method.name == name)
        .ok_or_else(|| Error::usage(format!("unknown method {name}")).remedy("report this bug"));
    Ok(TextbookMethod { method: method?, triangulation: TriangulationRule::default() })
}

fn contact_sheet(rows: &[DemoMeshRow], output: &Path, resources: &Resources) -> ContactSheetJob {
    let panels = rows.iter().map(|row| PicturePanel {
        mesh: row.mesh.clone(),
        lines: vec![
            row.method.to_owned(),
            format!("{} vertices, error {}", text::count(row.vertices), error(row)),
        ],
    });
    let mut each = picture(Path::new(""), output, resources);
    each.options.width = Some(PANEL);
    ContactSheetJob { panels: panels.collect(), columns: COLUMNS, each }
}

fn error(row: &DemoMeshRow) -> String {
    row.max_error.map_or("-".to_owned(), text::bound)
}

fn summary(comparison: &MethodComparison, [grid, drawn, report]: [&PathBuf; 3]) -> Result<String> {
    let MethodComparison { tolerance, vertical_unit: unit, methods, .. } = comparison;
    let all_proved = methods.iter().all(|row| row.verdict.passed);
    let verdict = if all_proved { "proved for every mesh" } else { "NOT kept by every mesh" };
    let samples = u64::from(comparison.width) * u64::from(comparison.height);
    let files = text::table(&[
        ("terrain", format!("{}, {} samples", size(grid)?, text::count(samples))),
        ("picture", size(drawn)?),
        ("report", size(report)?),
        ("bound", format!("at most {} {unit}, {verdict}", text::number(*tolerance))),
    ]);
    let heading = ["method", "vertices", "of samples", "triangles", "largest error", "time"];
    let mut rows = vec![heading.map(str::to_owned)];
    rows.extend(methods.iter().map(|row| {
        [
            row.method.to_owned(),
            text::count(row.vertices),
            text::percent(row.vertices as f64 / samples as f64),
            text::count(row.triangles),
            error(row),
            text::seconds(row.wall_seconds),
        ]
    }));
    Ok(format!("{files}\n{}", columns(&rows)))
}

/// Aligned rows of cells: the first column left, the others right.
fn columns<const N: usize>(rows: &[[String; N]]) -> String {
    let widths: [usize; N] = std::array::from_fn(|col| {
        rows.iter().map(|row| row[col].chars().count()).max().unwrap_or(0)
    });
    let mut text = String::new();
    for row in rows {
        text += &format!("  {:w$}", row[0], w = widths[0]);
        for (cell, width) in row.iter().zip(widths).skip(1) {
            text += &format!("  {cell:>width$}");
        }
        text += "\n";
    }
    text
}
