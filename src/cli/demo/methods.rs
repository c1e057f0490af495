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

/// A mesh method: the engine's own, or one by name; `fit` as in `tin --fit-heights`.
struct DemoMethod {
    label: &'static str,
    file: &'static str,
    method: Option<&'static str>,
    fit: bool,
}

const fn textbook(name: &'static str, file: &'static str) -> DemoMethod {
    DemoMethod { label: name, file, method: Some(name), fit: false }
}

/// Compared methods, in the order of the picture.
const WAYS: [DemoMethod; 6] = [
    DemoMethod { label: "greedy", file: "greedy.ply", method: None, fit: false },
    DemoMethod { label: "greedy --fit-heights", file: "greedy-fit.ply", method: None, fit: true },
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
    let [grid, drawn, told] =
        ["terrain.tif", "methods.png", "report.json"].map(|name| folder.join(name));
    let (resources, progress) = (args.resources.0.clone(), args.show.progress());
    let progress = progress.as_ref();
    let copied = convert::run(&terrain(TERRAIN, &grid, &resources), progress, cancel)?;
    let made = |way: &DemoMethod| {
        let mut job = mesh(&grid, &folder.join(way.file), &resources)?;
        job.refinement.fit_heights = way.fit;
        let job = TinJob { goal: TinGoal::MaxError(TOLERANCE), ..job };
        row(way, &job, progress, cancel)
    };
    let methods = WAYS.iter().map(made).collect::<Result<Vec<DemoMeshRow>>>()?;
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
    report::write(&told, true, &comparison)?;
    if args.show.json {
        output::json(&comparison)?;
    } else if !args.show.quiet {
        output::result(&summary(&comparison, [&grid, &drawn, &told])?)?;
    }
    let verdicts = || comparison.methods.iter().map(|row| &row.verdict);
    Ok(VerbOutcome::of(verdicts().all(|v| v.passed), verdicts().all(|v| v.judged)))
}

/// Makes and verifies a mesh.
fn row(
    way: &DemoMethod,
    job: &TinJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<DemoMeshRow> {
    let made = match way.method {
        None => terrane_terrain::tin::run(job, progress, cancel)?,
        Some(name) => terrane_terrain::tin::run_by(job, &by_name(name)?, progress, cancel)?,
    };
    let checked = prove(job, &made, progress, cancel)?;
    Ok(DemoMeshRow {
        method: way.label,
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
    let found = METHODS.iter().find(|method| method.name == name);
    let method = found
        .ok_or_else(|| Error::usage(format!("unknown method {name}")).remedy("report this bug"));
    Ok(TextbookMethod { method: method?, triangulation: TriangulationRule::default() })
}

fn contact_sheet(rows: &[DemoMeshRow], output: &Path, resources: &Resources) -> ContactSheetJob {
    let panel = |row: &DemoMeshRow| PicturePanel {
        mesh: row.mesh.clone(),
        lines: vec![
            row.method.to_owned(),
            format!("{} vertices, error {}", text::count(row.vertices), error(row)),
        ],
    };
    let mut each = picture(Path::new(""), output, resources);
    each.options.width = PANEL;
    ContactSheetJob { panels: rows.iter().map(panel).collect(), columns: COLUMNS, each }
}

fn error(row: &DemoMeshRow) -> String {
    row.max_error.map_or("-".to_owned(), text::bound)
}

fn summary(told: &MethodComparison, [grid, drawn, report]: [&PathBuf; 3]) -> Result<String> {
    let MethodComparison { tolerance, vertical_unit: unit, methods, .. } = told;
    let all_proved = methods.iter().all(|row| row.verdict.passed);
    let verdict = if all_proved { "proved for every mesh" } else { "NOT kept by every mesh" };
    let samples = u64::from(told.width) * u64::from(told.height);
    let files = text::table(&[
        ("terrain", format!("{}, {} samples", size(grid)?, text::count(samples))),
        ("picture", size(drawn)?),
        ("report", size(report)?),
        ("bound", format!("at most {} {unit}, {verdict}", text::number(*tolerance))),
    ]);
    let heading = ["method", "vertices", "of samples", "triangles", "largest error", "time"];
    let cells = |row: &DemoMeshRow| {
        [
            row.method.to_owned(),
            text::count(row.vertices),
            text::percent(row.vertices as f64 / samples as f64),
            text::count(row.triangles),
            error(row),
            text::seconds(row.wall_seconds),
        ]
    };
    let rows: Vec<_> =
        [heading.map(str::to_owned)].into_iter().chain(methods.iter().map(cells)).collect();
    Ok(format!("{files}\n{}", columns(&rows)))
}

/// Aligned rows of cells: the first column left, the others right.
fn columns<const N: usize>(rows: &[[String; N]]) -> String {
    let width = |col: usize| rows.iter().map(|row| row[col].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |row: &[String; N]| {
        let first = format!("  {:w$}", row[0], w = widths[0]);
        let cell = |col: usize| format!("  {:>w$}", row[col], w = widths[col]);
        first + &(1..N).map(cell).collect::<String>() + "\n"
    };
    rows.iter().map(line).collect()
}
