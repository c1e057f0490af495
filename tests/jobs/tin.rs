//! The grid-to-TIN pipeline on grids in memory: seamless, within the tolerance, and the same bytes
//! whatever the threads, the memory and the order of work.

mod support;

use support::{
    Capture, FunctionGrid, Mesh, check_followed, check_kept, hills, largest_crossing, noise,
    non_delaunay_edges, thin, validate,
};
use terrane_base::bound::ErrorBound;
use terrane_base::{ErrorKind, Result};
use terrane_engine::breaklines::Breaklines;
use terrane_engine::constraints::GridConstraints;
use terrane_engine::{Cancel, Silent};
use terrane_terrain::tin::{MeshFlaws, TinOutcome, TinSettings, run_on};
use terrane_tin::{MinimumAngle, TinSpec};

struct Run {
    tolerance: f64,
    bound: ErrorBound,
    fit: bool,
    data_dependent: bool,
    /// In degrees.
    min_angle: Option<f64>,
    kept: GridConstraints,
    tile: u32,
    threads: usize,
    mesh_bytes: u64,
    order_seed: Option<u64>,
    sink: Capture,
    cancel: Cancel,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            tolerance: 2.0,
            bound: ErrorBound::Samples,
            fit: false,
            data_dependent: false,
            min_angle: None,
            kept: GridConstraints::default(),
            tile: 16,
            threads: 1,
            mesh_bytes: 1 << 30,
            order_seed: None,
            sink: Capture::default(),
            cancel: Cancel::default(),
        }
    }
}

impl Run {
    fn on(&self, grid: &FunctionGrid) -> Result<(Mesh, TinOutcome)> {
        let folder = tempfile::tempdir().unwrap();
        let settings = TinSettings {
            spec: TinSpec {
                tolerance: self.tolerance,
                bound: self.bound,
                strict: false,
                drop: true,
                fit_heights: self.fit,
                data_dependent: self.data_dependent,
                min_angle: self
                    .min_angle
                    .map(|least| MinimumAngle::new(least, [1.0, 0.0], [0.0, -1.0])),
                single_precision: None,
                measure: true,
            },
            tile: self.tile,
            constraints: &self.kept,
            threads: self.threads,
            mesh_bytes: self.mesh_bytes,
            temp_dir: folder.path(),
            order_seed: self.order_seed,
            progress: &Silent,
            cancel: &self.cancel,
        };
        let outcome = run_on(grid, Box::new(self.sink.clone()), &settings)?;
        let mesh = Mesh { fitted: self.fit, ..self.sink.take() };
        assert!(mesh.finished);
        if self.bound == ErrorBound::Surface {
            let most = largest_crossing(&mesh, grid);
            assert!(most <= self.tolerance + 1e-9, "off by {most} between samples");
        }
        Ok((mesh, outcome))
    }
}

/// Salt and a round hole.
fn holes(col: u32, row: u32) -> f64 {
    let (x, y) = (f64::from(col) - 40.0, f64::from(row) - 33.0);
    if x * x + y * y < 300.0 || noise(col, row) > 0.98 { f64::NAN } else { hills(col, row) }
}

fn flat_sea(col: u32, row: u32) -> f64 {
    (hills(col, row) - 20.0).max(0.0)
}

/// Heights that f32 cannot hold.
fn fine(col: u32, row: u32) -> f64 {
    1e8 + hills(col, row) + noise(row, col) * 0.1
}

/// Heights free or not, triangles others than Delaunay ones or not.
const WAYS: [(bool, bool); 4] = [(false, false), (true, false), (false, true), (true, true)];

fn both_bounds(tolerance: f64) -> [(f64, ErrorBound); 2] {
    ErrorBound::ALL.map(|bound| (tolerance, bound))
}

#[test]
fn grids_of_all_sizes_become_seamless_surfaces() {
    let sizes = [(2, 2), (3, 700), (700, 3), (17, 17), (16, 16), (18, 18), (33, 31), (32, 34)];
    for (width, height) in sizes.into_iter().chain([(129, 2), (2, 129), (100, 90)]) {
        for surface in [hills, holes, flat_sea] {
            for (tolerance, bound) in [0.0, 2.0, 1e6].into_iter().flat_map(both_bounds) {
                let grid = FunctionGrid::new(width, height, surface);
                for (fit, data_dependent) in WAYS {
                    let run = Run { tolerance, bound, fit, data_dependent, ..Run::default() };
                    let (mesh, outcome) = run.on(&grid).unwrap();
                    validate(&mesh, &grid, tolerance);
                    assert_eq!(outcome.vertices, mesh.vertices.len() as u64);
                    assert_eq!(outcome.triangles, mesh.triangles.len() as u64);
                    assert!(outcome.max_error <= tolerance * (1.0 + 1e-6));
                }
            }
        }
    }
}

#[test]
fn full_size_tiles_meet_without_cracks() {
    for (width, height, surface) in [
        (513, 513, hills as fn(u32, u32) -> f64),
        (1025, 2, hills),
        (700, 600, flat_sea),
        (1026, 515, holes),
    ] {
        let grid = FunctionGrid::new(width, height, surface);
        for bound in ErrorBound::ALL {
            for data_dependent in [false, true] {
                let run = Run { tile: 512, threads: 2, bound, data_dependent, ..Run::default() };
                validate(&run.on(&grid).unwrap().0, &grid, run.tolerance);
            }
        }
    }
}

#[test]
fn bytes_do_not_depend_on_threads_memory_or_order() {
    type Kind = (fn(u32, u32) -> f64, ErrorBound, (bool, bool));
    let kinds: [Kind; 5] = [
        (hills, ErrorBound::Samples, WAYS[0]),
        (holes, ErrorBound::Surface, WAYS[2]),
        (flat_sea, ErrorBound::Samples, WAYS[1]),
        (hills, ErrorBound::Surface, WAYS[1]),
        (hills, ErrorBound::Samples, WAYS[3]),
    ];
    let lines =
        Breaklines::of(vec![[[3, 149], [130, 11]], [[130, 11], [0, 16]], [[40, 0], [33, 140]]]);
    for (surface, bound, (fit, data_dependent)) in kinds {
        let kept = GridConstraints::default().with(lines.clone());
        let usual = || Run { bound, fit, data_dependent, kept: kept.clone(), ..Run::default() };
        let grid = FunctionGrid::new(131, 150, surface);
        let (mesh, alone) = usual().on(&grid).unwrap();
        for threads in [1, 2, 8] {
            for mesh_bytes in [0, 20_000, 1 << 30] {
                for order_seed in [None, Some(1), Some(2)] {
                    let run = Run { threads, mesh_bytes, order_seed, ..usual() };
                    let (again, outcome) = run.on(&grid).unwrap();
                    assert!(again == mesh, "{threads} threads, {mesh_bytes} bytes, {order_seed:?}");
                    assert_eq!(outcome.square_sum, alone.square_sum);
                    let is_tight = outcome.spilled_bytes > 0;
                    assert!(is_tight == (mesh_bytes == 0) || mesh_bytes == 20_000);
                }
            }
        }
    }
}

#[test]
fn heights_wider_than_f32_come_out_exact() {
    let mut grid = FunctionGrid::new(60, 50, fine);
    grid.info.sample_type = terrane_raster::SampleType::F64;
    for (fit, data_dependent) in WAYS {
        for tolerance in [0.2, 2.0, 10.0] {
            let run = Run { fit, data_dependent, tolerance, ..Run::default() };
            validate(&run.on(&grid).unwrap().0, &grid, tolerance * (1.0 + 1e-6));
        }
    }
}

#[test]
fn a_south_up_grid_is_counter_clockwise_too() {
    let mut grid = FunctionGrid::new(40, 40, hills);
    grid.info.transform.e = 2.0;
    validate(&Run::default().on(&grid).unwrap().0, &grid, 2.0);
}

#[test]
fn corners_are_the_positions_of_the_ids() {
    let grid = FunctionGrid::new(50, 40, holes);
    let sink = Capture { with_corners: true, ..Capture::default() };
    let (mesh, _) = Run { sink, ..Run::default() }.on(&grid).unwrap();
    let corners = mesh.triangles.iter().map(|ids| ids.map(|id| mesh.vertices[id as usize]));
    assert_eq!(corners.collect::<Vec<_>>(), mesh.corners);
}

#[test]
fn the_square_sum_counts_every_sample_once() {
    let grid = FunctionGrid::new(97, 80, hills);
    let (_, tiled) = Run { tolerance: 1e6, ..Run::default() }.on(&grid).unwrap();
    let (_, whole) = Run { tolerance: 1e6, tile: 128, ..Run::default() }.on(&grid).unwrap();
    assert_eq!((tiled.valid, whole.valid), (97 * 80, 97 * 80));
    assert!(tiled.square_sum > 0.0 && whole.square_sum > 0.0);
}

#[test]
fn nothing_to_triangulate_is_bad_input() {
    let error = |grid: FunctionGrid| {
        let run = Run::default();
        let error = run.on(&grid).unwrap_err();
        assert!(!run.sink.take().finished);
        assert_eq!(error.kind(), ErrorKind::BadInput);
        error.to_string()
    };
    let at_least = "a surface needs at least 2 x 2 samples";
    for (width, height) in [(1, 1), (1, 50), (50, 1)] {
        assert!(error(FunctionGrid::new(width, height, hills)).starts_with(at_least));
    }
    let all_void = FunctionGrid::new(40, 40, |_, _| f64::NAN);
    assert!(error(all_void).starts_with("the grid has no valid sample; check its nodata value"));
    let sparse = FunctionGrid::new(40, 40, |col, _| if col % 2 == 0 { 1.0 } else { f64::NAN });
    assert!(error(sparse).starts_with("the grid has no cell with four valid samples"));
}

#[test]
fn isolated_samples_are_counted() {
    let grid = FunctionGrid::new(40, 40, |col, row| match (col, row) {
        (16, 16) => 1.0,
        (20..=30, 20..=30) => 5.0,
        _ => f64::NAN,
    });
    let (mesh, outcome) = Run::default().on(&grid).unwrap();
    validate(&mesh, &grid, 2.0);
    assert_eq!((outcome.valid, outcome.isolated), (122, 1));
}

#[test]
fn cancelling_and_a_full_sink_stop_the_run() {
    let grid = FunctionGrid::new(300, 300, hills);
    for threads in [1, 4] {
        let run = Run { threads, ..Run::default() };
        run.cancel.cancel();
        assert_eq!(run.on(&grid).unwrap_err().kind(), ErrorKind::Interrupted);
        assert!(!run.sink.take().finished);
        let sink = Capture { most: Some(100), ..Capture::default() };
        let run = Run { threads, sink, ..Run::default() };
        assert!(run.on(&grid).unwrap_err().to_string().ends_with("the sink is full"));
        assert!(!run.sink.take().finished);
    }
}

#[test]
fn tiles_out_of_range_are_refused() {
    let grid = FunctionGrid::new(300, 300, hills);
    for tile in [0, 15, 8193] {
        let error = Run { tile, ..Run::default() }.on(&grid).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
}

#[test]
fn seams_leave_a_delaunay_mesh_of_about_the_untiled_size() {
    let grid = FunctionGrid::new(500, 400, hills);
    // Tiles of 128 cells begin with four times as many vertices as the tile that holds all.
    for (tolerance, most) in [(1.0, 1.05), (3.0, 1.083)] {
        let (mesh, tiled) = Run { tile: 128, tolerance, ..Run::default() }.on(&grid).unwrap();
        let (_, whole) = Run { tile: 512, tolerance, ..Run::default() }.on(&grid).unwrap();
        assert_eq!(non_delaunay_edges(&mesh, &grid), 0);
        let share = tiled.vertices as f64 / whole.vertices as f64;
        assert!(share <= most, "{share}");
    }
}

/// Lands that are hard on seams: a name, and the height at a place for a seed.
type Land = fn(u64, u32, u32) -> f64;

/// A fixed pseudo-random number in 0..1 for a seed and a place.
fn dice(seed: u64, col: u32, row: u32) -> f64 {
    noise(
        (seed as u32).wrapping_mul(7919).wrapping_add(col),
        (seed as u32 ^ 0x5bd1).wrapping_add(row),
    )
}

/// How high a place stands out of a sea: round islands of all sizes, rough above the water.
fn islands(seed: u64, col: u32, row: u32, grain: f64) -> f64 {
    let island = |i: u32| {
        let [x, y, r] = [0, 1, 2].map(|k| dice(seed, 3 * i + k, 77));
        let (x, y, r) = (x * 200.0, y * 200.0, 2.0 + r * r * 30.0);
        let (dx, dy) = (f64::from(col) - x, f64::from(row) - y);
        2.0 * (r - dx.hypot(dy))
    };
    let land = (0..5).map(island).fold(0.0, f64::max);
    if land > 0.0 { (land + grain * dice(seed, col, row)).round() } else { 0.0 }
}

/// No triangle has what is asked for here: all samples become vertices, and all triangles are told.
#[test]
fn triangles_that_stay_thin_are_counted_and_the_first_is_told() {
    let grid = FunctionGrid::new(60, 50, holes);
    let run = Run { min_angle: Some(50.0), ..Run::default() };
    let (mesh, outcome) = run.on(&grid).unwrap();
    assert_eq!(outcome.vertices, outcome.valid - outcome.isolated);
    let all = mesh.triangles.len() as u64;
    assert_eq!((thin(&mesh, 50.0), outcome.thin.count), (all, all));
    // A corner of its triangle, in the first row.
    let [row, col] = outcome.thin.first.unwrap();
    assert!(row == 0 && col < 3, "{row}, {col}");
    let wide = Run { min_angle: Some(20.0), ..run };
    assert_eq!(wide.on(&grid).unwrap().1.thin, MeshFlaws::default());
}

/// Of half of two cells, in degrees: what may be asked for at most.
const SMALLEST: f64 = 26.565;

const LANDS: [(&str, Land); 8] = [
    ("islands", |seed, col, row| islands(seed, col, row, 4.0)),
    ("smooth islands", |seed, col, row| islands(seed, col, row, 0.0)),
    ("whole numbers", |seed, col, row| (dice(seed, col, row) * 6.0).floor()),
    ("holes in a sea", |seed, col, row| {
        let hole = dice(seed ^ 9, col / 7, row / 5) > 0.8 || dice(seed, col, row) > 0.995;
        if hole { f64::NAN } else { islands(seed, col, row, 3.0) }
    }),
    ("holes in hills", |seed, col, row| {
        let hole = dice(seed ^ 9, col / 19, row / 23) > 0.7;
        if hole { f64::NAN } else { hills(col + seed as u32 * 31, row).round() }
    }),
    ("spikes", |seed, col, row| if dice(seed, col, row) > 0.9985 { 50.0 } else { 0.0 }),
    ("steep", |seed, col, row| {
        let fold = (col + 3 * row + (seed as u32 % 17)) % 29;
        f64::from(fold * fold) + 20.0 * dice(seed, col / 3, row / 3)
    }),
    ("hills", |seed, col, row| hills(col + seed as u32 * 31, row + seed as u32 * 17)),
];

#[test]
fn every_edge_is_delaunay_whatever_the_land_and_the_tiles() {
    let rounds = std::env::var("TERRANE_MESHES").map_or(60, |n| n.parse().unwrap());
    let (mut wrong, mut void) = (Vec::new(), 0);
    // Tiles without posts inside go wrong at these two.
    for seed in [141, 349].into_iter().chain(0..rounds) {
        let draw = |k: u32| dice(seed, k, 4242);
        let (name, land) = LANDS[seed as usize % LANDS.len()];
        let tiles = [16, 17, 23, 32, 40, 64];
        let tile = tiles[(draw(0) * tiles.len() as f64) as usize];
        let tolerances = [0.0, 0.4, 1.0, 2.0, 7.5, 30.0];
        let tolerance = tolerances[(draw(1) * tolerances.len() as f64) as usize];
        let [width, height] = [2, 3].map(|k| 2 + (draw(k) * 230.0) as u32);
        let grid =
            FunctionGrid::new(
                width,
                height,
                move |col, row| f64::from(land(seed, col, row) as f32),
            );
        let bound = ErrorBound::ALL[usize::from(draw(4) < 0.5)];
        let fit = draw(5) < 0.4;
        let one_in = if draw(6) < 0.4 { 2.0 + 200.0 * draw(7).powi(2) } else { f64::INFINITY };
        let samples = (0..height).flat_map(|row| (0..width).map(move |col| [col, row]));
        let is_kept = |[col, row]: &[u32; 2]| dice(seed, 8 + col, *row) * one_in < 1.0;
        let kept = GridConstraints::of(samples.filter(is_kept).collect());
        let min_angle = (draw(8) < 0.4).then(|| draw(9) * SMALLEST);
        // A walk of some steps, and some long lines.
        let lines =
            if min_angle.is_none() && draw(10) < 0.6 { 1 + (draw(11) * 30.0) as u32 } else { 0 };
        let [mut col, mut row] = [12, 13].map(|k| draw(k) * 200.0);
        let segments: Vec<_> = (0..lines)
            .map(|line| {
                let place = |col: f64, row: f64| {
                    [(col, width), (row, height)]
                        .map(|(at, side)| at.clamp(0.0, f64::from(side - 1)) as u32)
                };
                let from = place(col, row);
                let far = if line % 7 == 0 { 300.0 } else { 20.0 };
                (col, row) =
                    (col + far * (draw(20 + line) - 0.5), row + far * (draw(60 + line) - 0.5));
                [from, place(col, row)]
            })
            .collect();
        let kept = kept.with(Breaklines::of(segments.clone()));
        let run = Run { tolerance, bound, fit, min_angle, kept, tile, ..Run::default() };
        let checked = |run: &Run| -> Result<(Mesh, TinOutcome)> {
            let (mesh, outcome) = run.on(&grid)?;
            validate(&mesh, &grid, tolerance);
            check_kept(&run.kept, &mesh, &grid, outcome.kept);
            check_followed(&segments, &mesh, &grid);
            assert_eq!(outcome.apart, MeshFlaws::default(), "{name} (seed {seed})");
            let thin = min_angle.map_or(0, |least| thin(&mesh, least));
            assert_eq!(thin, outcome.thin.count, "{name} (seed {seed})");
            // There are settings where some are left: then as many are told. None of these is one.
            assert_eq!(thin, 0, "{name} (seed {seed}): {min_angle:?} degrees, tile {tile}");
            Ok((mesh, outcome))
        };
        let (mesh, outcome) = match checked(&run) {
            Ok(made) => made,
            // No land is valid.
            Err(error) if error.kind() == ErrorKind::BadInput => {
                void += 1;
                continue;
            }
            Err(error) => panic!("{name} (seed {seed}): {error}"),
        };
        let (_, reduced) = checked(&Run { data_dependent: true, ..run }).unwrap();
        assert!(reduced.vertices <= outcome.vertices, "{name} (seed {seed})");
        let edges = non_delaunay_edges(&mesh, &grid);
        if edges > 0 {
            wrong.push(format!(
                "{name} (seed {seed}): {edges} of {} vertices, tile {tile}, {width} x {height}, tolerance {tolerance}, {bound}, fit {fit}, one in {one_in} kept", outcome.vertices
            ));
        }
    }
    assert!(4 * void < rounds, "{void} of {rounds} grids hold nothing");
    assert!(wrong.is_empty(), "{} meshes are not Delaunay:\n{}", wrong.len(), wrong.join("\n"));
}
