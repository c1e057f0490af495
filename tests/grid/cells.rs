//! `terrane grid`: every statistic against a naive twin, the same bytes whatever the order, threads,
//! memory and division, and the conventions of cells.

use crate::support::{Memory, cells, frame, job, near, plain, points, read, run};
use tempfile::tempdir;
use terrane_base::geom::{Point, PointFrame};
use terrane_engine::Resources;
use terrane_gridding::{Statistic, parse_list};
use terrane_lidar::grid::{Compat, GridJob, Placement};
use terrane_raster::SampleType;

const OWN: &str = "count,density,min,max,range,mean,std,std:ddof=1,median,p95,p0,p100";
const ALL: &str = "count,min,max,mean,std,median,idw,idw:radius=2.5,power=2,nearest";

/// A frame in centimetres, far from the origin of the coordinates.
const FAR: PointFrame = PointFrame { scale: [0.01; 3], offset: [200_000.0, 5_000_000.0, 100.0] };

/// One job in `f64`.
fn wide(path: &std::path::Path, stats: &str, cell: f64) -> GridJob {
    GridJob { sample_type: SampleType::F64, ..job(path, stats, cell) }
}

#[test]
fn statistics_of_own_points_agree_with_a_naive_twin() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for (cell, count) in [(1.0, 5000), (0.25, 300), (7.0, 5000), (0.37, 2000)] {
        let points = points(count, 3000, (cell * 100.0) as i32, 7);
        let source = Memory::new(FAR, &points, 999);
        let job = GridJob { overwrite: true, ..wide(&path, OWN, cell) };
        let report = run(&source, &job);
        assert_eq!((report.points.kept, report.outside_grid), (count as u64, 0));
        let cells = cells(&FAR, &points, cell);
        for (band, asked) in (1..).zip(&job.stats) {
            let found = read(&path, band);
            let [west, north] = found.corner.map(|v| (v / cell).round() as i64);
            let mut valid = 0;
            for (i, value) in found.values.iter().enumerate() {
                let (col, row) = ((i % found.width) as i64, (i / found.width) as i64);
                let heights = cells.get(&[west + col, north - 1 - row]);
                let heights = heights.map_or(&[][..], Vec::as_slice);
                let expected = plain(asked.statistic, heights, cell * cell);
                assert!(near(*value, expected, 1e-7), "{}: {value} {expected}", asked.label);
                valid += u64::from(!value.is_nan() && !heights.is_empty());
            }
            assert_eq!(report.bands[band as usize - 1].valid, valid, "{}", asked.label);
        }
    }
}

/// Value of a cell centred at (`x`, `y`): by all points, one by one.
fn around(statistic: Statistic, points: &[Point], frame: &PointFrame, [x, y]: [f64; 2]) -> f64 {
    let radius = statistic.parameter("radius").unwrap();
    let near = points.iter().map(|point| (point, frame.world(*point)));
    let near =
        near.map(|(point, [px, py, z])| (((px - x).powi(2) + (py - y).powi(2)).sqrt(), point, z));
    let near: Vec<_> = near.filter(|(distance, ..)| *distance < radius - 1e-9).collect();
    let hit = near.iter().filter(|(distance, ..)| *distance < 1e-9).map(|(.., z)| *z);
    match statistic.name() {
        "idw" => hit.reduce(f64::min).unwrap_or_else(|| {
            let weight = |d: f64| d.powf(-statistic.parameter("power").unwrap_or(1.0));
            let sum: f64 = near.iter().map(|(d, _, z)| weight(*d) * z).sum();
            sum / near.iter().map(|(d, ..)| weight(*d)).sum::<f64>()
        }),
        _ => {
            let order = |(d, point, _): &&(f64, &Point, f64)| ((d * 1e6).round() as i64, **point);
            near.iter().min_by_key(order).map_or(f64::NAN, |(.., z)| *z)
        }
    }
}

#[test]
fn statistics_around_centres_agree_with_brute_force() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let stats = "idw:radius=1.4,idw:radius=1.4,power=2,idw:radius=5.3,power=1.5,idw:radius=2,power=4,\
                 idw:radius=3,power=0.7,nearest:radius=1.4,nearest:radius=4";
    for (cell, count) in [(1.0, 600), (1.7, 300), (0.333, 100)] {
        // Every third point on a centre where half a cell is a whole number of steps.
        let mut points = points(count, 800, (cell * 100.0) as i32, 3);
        points.iter_mut().step_by(3).for_each(|p| (p.x, p.y) = (p.x + 50, p.y + 50));
        points.push(points[0]);
        points.push(Point { z: points[0].z - 1, ..points[0] });
        let source = Memory::new(FAR, &points, 100);
        let job = GridJob { overwrite: true, ..wide(&path, stats, cell) };
        run(&source, &job);
        for (band, asked) in (1..).zip(&job.stats) {
            let found = read(&path, band);
            for (i, value) in found.values.iter().enumerate() {
                let at = [(i % found.width) as f64 + 0.5, -((i / found.width) as f64 + 0.5)];
                let at = [0, 1].map(|axis| found.corner[axis] + at[axis] * cell);
                let expected = around(asked.statistic, &points, &FAR, at);
                assert!(near(*value, expected, 1e-6), "{} {at:?}: {value} {expected}", asked.label);
            }
        }
    }
}

/// No point is handed to another cell for them, and cells take them with all others.
#[test]
fn circles_within_cells_hold_their_points() {
    let folder = tempdir().unwrap();
    let [own, wider] = ["own.tif", "wider.tif"].map(|name| folder.path().join(name));
    let source = Memory::new(FAR, &points(5000, 1000, 100, 11), 1000);
    for (bands, stats) in [
        (1, "idw:radius=0.45"),
        (1, "nearest:radius=0.3"),
        (3, "mean,idw:radius=0.45,nearest:radius=0.3"),
    ] {
        let [own, wider] = [&own, &wider];
        let job = |path, stats: &str| GridJob { overwrite: true, ..wide(path, stats, 1.0) };
        run(&source, &job(own, stats));
        run(&source, &job(wider, &format!("{stats},idw:radius=3")));
        for band in 1..=bands {
            let [found, expected] = [own, wider].map(|path| read(path, band).values);
            let void = found.iter().filter(|value| value.is_nan()).count();
            assert!(void * 2 < found.len(), "{void} of {} in band {band}", found.len());
            assert!(found.iter().zip(&expected).all(|(a, b)| near(*a, *b, 0.0)), "{stats} {band}");
        }
    }
}

/// Points nearer to the centre (x, y) than `radius`, by their squared distances: all in whole numbers
/// of 10^-6, `scale` of them to a step.
fn within(points: &[Point], scale: [i64; 2], centre: [i64; 2], radius: i64) -> Vec<(i128, Point)> {
    let square = |point: &Point| {
        let steps = [point.x, point.y].map(i64::from);
        [0, 1].map(|axis| i128::from(steps[axis] * scale[axis] - centre[axis]).pow(2)).iter().sum()
    };
    let all = points.iter().map(|point| (square(point), *point));
    all.filter(|(square, _): &(i128, Point)| *square < i128::from(radius).pow(2)).collect()
}

#[test]
fn nearest_and_radius_are_decided_in_whole_steps() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let (mut ties, mut on_radius) = (0, 0);
    // Steps, sides of cells and radii in 10^-6; those of a step of x and y may differ, and cells need
    // be no whole number of steps.
    for (scale, cell, radius) in [
        ([10_000, 10_000], 50_000, 50_000),
        ([10_000, 10_000], 100_000, 250_000),
        ([10_000, 10_000], 70_000, 130_000),
        ([1_000, 1_000], 6_000, 25_000),
        ([10_000, 20_000], 40_000, 100_000),
        ([10_000, 10_000], 15_000, 50_000),
        ([10_000, 10_000], 33_300, 65_000),
        ([30_000, 10_000], 70_000, 130_000),
    ] {
        let world = |units: i64| format!("{units}e-6").parse::<f64>().unwrap();
        let frame =
            PointFrame { scale: [world(scale[0]), world(scale[1]), 0.01], offset: [0.0; 3] };
        let side = (12 * cell / scale[0]) as u32;
        let points = points(90, side, (cell / scale[0]) as i32, cell as u64);
        let source = Memory::new(frame, &points, 40);
        let stats = format!("nearest:radius={0},idw:radius={0}", world(radius));
        let job = GridJob { overwrite: true, ..wide(&path, &stats, world(cell)) };
        run(&source, &job);
        let [nearest, idw] = [1, 2].map(|band| read(&path, band));
        let corner = nearest.corner.map(|v| (v / world(cell)).round() as i64 * cell);
        for (i, value) in nearest.values.iter().enumerate() {
            let (col, row) = ((i % nearest.width) as i64, (i / nearest.width) as i64);
            let centre = [corner[0] + col * cell + cell / 2, corner[1] - row * cell - cell / 2];
            let mut near = within(&points, scale, centre, radius);
            near.sort();
            let expected = near.first().map_or(f64::NAN, |(_, point)| f64::from(point.z) * 0.01);
            let told = format!("{scale:?} {cell} {centre:?}: {value} {expected} {near:?}");
            let is_right = near.is_empty() || (value - expected).abs() < 1e-9;
            assert!(is_right && value.is_nan() == near.is_empty(), "{told}");
            assert_eq!(idw.values[i].is_nan(), near.is_empty(), "{told}");
            ties +=
                usize::from(near.len() > 1 && near[0].0 == near[1].0 && near[0].1.x != near[1].1.x);
            let beyond = within(&points, scale, centre, radius + 1);
            on_radius += usize::from(near.is_empty() && !beyond.is_empty());
        }
    }
    assert!(ties > 20 && on_radius > 5, "{ties} ties, {on_radius} on the radius");
}

#[test]
fn borders_of_cells_of_any_size_are_decided_exactly() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    // Steps and cells in 10^-6.
    for (scale, cell) in
        [(10_000_i64, 33_300_i64), (10_000, 15_000), (1_000, 2_100), (30_000, 70_000)]
    {
        let world = |units: i64| format!("{units}e-6").parse::<f64>().unwrap();
        let frame = frame(world(scale), [0.0; 3]);
        let line = |i: i32| Point::new(i, 3 * i, i);
        let points: Vec<Point> = (-1000..1000).map(line).collect();
        let source = Memory::new(frame, &points, 999);
        run(&source, &GridJob { overwrite: true, ..wide(&path, "count", world(cell)) });
        let found = read(&path, 1);
        let [west, north] = found.corner.map(|v| (v / world(cell)).round() as i64);
        let mut expected = vec![0.0; found.values.len()];
        for point in &points {
            let index = |steps: i32| (i64::from(steps) * scale).div_euclid(cell);
            let at = (index(point.x) - west, north - 1 - index(point.y));
            expected[at.1 as usize * found.width + at.0 as usize] += 1.0;
        }
        assert!(found.values == expected, "{scale} {cell}");
    }
}

#[test]
fn order_parts_threads_and_memory_leave_no_trace() {
    let folder = tempdir().unwrap();
    let mut points = points(60_000, 40_000, 100, 11);
    let run_as = |points: &[Point], part: usize, threads: usize, memory: u64| {
        let path = folder.path().join(format!("{part}-{threads}-{memory}.tif"));
        let source = Memory::new(frame(0.01, [0.0; 3]), points, part);
        let resources = Resources { threads, memory, temp_dir: None };
        let job = GridJob { resources, fill: 2, overwrite: true, ..job(&path, ALL, 1.0) };
        (run(&source, &job), std::fs::read(&path).unwrap())
    };
    let (report, expected) = run_as(&points, 60_000, 1, 4 << 30);
    assert_eq!(report.run.spilled_bytes, Some(0));
    let (report, bytes) = run_as(&points, 1000, 1, 41 << 20);
    assert!(
        report.run.spilled_bytes > Some(0) && bytes == expected,
        "{:?} spilled",
        report.run.spilled_bytes
    );
    points.sort();
    assert!(run_as(&points, 777, 3, 4 << 30).1 == expected);
    points.reverse();
    let (report, bytes) = run_as(&points, 5000, 2, 60 << 20);
    assert!(report.run.spilled_bytes > Some(0) && bytes == expected);
}

#[test]
fn quarters_are_what_the_whole_is() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let points = points(4000, 3000, 50, 5);
    for (cell, stats) in [(1.0, ALL), (0.71, "mean,idw,nearest")] {
        let source = Memory::new(FAR, &points, 500);
        for fill in [0, 3] {
            let make = |extent: Option<[f64; 4]>, bands: u32| {
                let placement = Placement { extent, ..Placement::new([cell; 2]) };
                let job = GridJob { placement, fill, overwrite: true, ..wide(&path, stats, cell) };
                let outside = run(&source, &job).outside_grid;
                ((1..=bands).map(|band| read(&path, band)).collect::<Vec<_>>(), outside)
            };
            let bands = parse_list(stats).unwrap().len() as u32;
            let (whole, _) = make(None, bands);
            let height = whole[0].values.len() / whole[0].width;
            let [west, north] = whole[0].corner;
            let (right, down) = (whole[0].width / 2, height / 3);
            let mut inside = 0;
            for (cols, rows) in [
                (0..right, 0..down),
                (right..whole[0].width, 0..down),
                (0..right, down..height),
                (right..whole[0].width, down..height),
            ] {
                let x = |col: usize| west + col as f64 * cell;
                let y = |row: usize| north - row as f64 * cell;
                let bbox = [x(cols.start), y(rows.end), x(cols.end), y(rows.start)];
                let (part, outside) = make(Some(bbox), bands);
                inside += points.len() as u64 - outside;
                for (part, whole) in part.iter().zip(&whole) {
                    assert_eq!(
                        (part.width, part.values.len() / part.width),
                        (cols.len(), rows.len())
                    );
                    for (i, value) in part.values.iter().enumerate() {
                        let (col, row) = (cols.start + i % part.width, rows.start + i / part.width);
                        let other = whole.values[row * whole.width + col];
                        assert_eq!(value.to_bits(), other.to_bits(), "{col} {row}");
                    }
                }
            }
            assert_eq!(inside, points.len() as u64, "each point is in one quarter");
        }
    }
}

/// Values of one band, row by row, voids as -1.
fn values(source: &Memory, job: &GridJob) -> (usize, Vec<f64>, [f64; 2]) {
    run(source, job);
    let found = read(&job.output, 1);
    let values = found.values.iter().map(|v| if v.is_nan() { -1.0 } else { *v });
    (found.width, values.collect(), found.corner)
}

#[test]
fn borders_belong_to_cells_by_convention() {
    let folder = tempdir().unwrap();
    // On a corner, a western border, a southern border, inside.
    let points =
        [[0, 0, 1], [0, 5, 2], [5, 10, 4], [15, 5, 8]].map(|[x, y, z]| Point::new(x, y, z));
    let source = Memory::new(frame(0.1, [10.0, 20.0, 0.0]), &points, 9);
    let path = folder.path().join("a.tif");
    let base = GridJob { overwrite: true, ..wide(&path, "count", 1.0) };
    let (width, counts, corner) = values(&source, &base);
    assert_eq!((width, counts, corner), (2, vec![1.0, 0.0, 2.0, 1.0], [10.0, 22.0]));
    let lasr = GridJob { compat: Compat::Lasr, ..base.clone() };
    let (width, counts, corner) = values(&source, &lasr);
    assert_eq!((width, counts, corner), (2, vec![2.0, 1.0, 1.0, 0.0], [10.0, 21.0]));
    let align = Placement { align: Some([0.5, 0.25]), ..Placement::new([1.0; 2]) };
    let aligned = GridJob { placement: align, ..base };
    assert_eq!(values(&source, &aligned).2, [9.5, 21.25]);
}

#[test]
fn pdal_takes_all_points_within_the_radius_and_fills_by_chebyshev_distance() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.tif");
    // The lowest x and y are 0.2; cells of 1 have centres at 0.7, 1.7, 2.7 ...
    let points =
        [[2, 2, 10], [12, 2, 20], [17, 7, 40], [52, 2, 90]].map(|[x, y, z]| Point::new(x, y, z));
    let source = Memory::new(frame(0.1, [0.0; 3]), &points, 9);
    let pdal = |stats, fill| GridJob {
        compat: Compat::Pdal,
        radius: Some(1.0),
        fill,
        overwrite: true,
        ..wide(&path, stats, 1.0)
    };
    // Cell 0: z 1 and 2 lie at sqrt(0.5) each. The third lies on the centre of cell 1 and at 1 from
    // that of cells 0 and 2, which is not within the radius; the second at sqrt(0.5) from cell 1 too.
    let (width, counts, corner) = values(&source, &pdal("count", 0));
    assert_eq!((width, counts), (6, vec![2.0, 2.0, 0.0, 0.0, 1.0, 1.0]));
    assert!(near(corner[0], 0.2, 1e-12) && near(corner[1], 1.2, 1e-12), "{corner:?}");
    let close = |stats, fill, expected: [f64; 6]| {
        let found = values(&source, &pdal(stats, fill)).1;
        let close = found.iter().zip(expected).all(|(a, b)| near(*a, b, 1e-9));
        assert!(close, "{stats} {found:?} {expected:?}");
    };
    close("mean", 0, [1.5, 3.0, -1.0, -1.0, 9.0, 9.0]);
    close("std", 0, [0.5, 1.0, -1.0, -1.0, 0.0, 0.0]);
    close("idw", 0, [1.5, 4.0, -1.0, -1.0, 9.0, 9.0]);
    // Cell 2: cells 0, 1 and 4 at 2, 1 and 2 columns; cell 3: cells 1, 4 and 5 at 2, 1 and 2.
    let [two, three] = [(0.75 + 3.0 + 4.5) / 2.0, (1.5 + 9.0 + 4.5) / 2.0];
    close("mean", 2, [1.5, 3.0, two, three, 9.0, 9.0]);
    close("count", 0, [2.0, 2.0, 0.0, 0.0, 1.0, 1.0]);
    // Without a radius it is the side of a cell times the root of 2: the diagonal itself is beyond.
    let usual = GridJob { radius: None, ..pdal("count", 0) };
    assert_eq!(run(&source, &usual).radius, Some(2.0_f64.sqrt()));
}

#[test]
fn several_bands_in_every_layout_and_format() {
    let folder = tempdir().unwrap();
    let points = points(30_000, 40_000, 100, 2);
    let source = Memory::new(frame(0.01, [0.0; 3]), &points, 10_000);
    let layouts: [(&str, &[(&str, &str)]); 4] = [
        ("GTiff", &[]),
        ("GTiff", &[("TILED", "NO"), ("COMPRESS", "ZSTD")]),
        ("COG", &[("BLOCKSIZE", "128")]),
        ("COG", &[("OVERVIEWS", "NONE"), ("COMPRESS", "NONE")]),
    ];
    let mut first: Option<Vec<Vec<u64>>> = None;
    for (format, creation) in layouts {
        let path = folder.path().join("a.tif");
        let creation = creation.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        let format = Some(format.to_owned());
        let job =
            GridJob { format, creation, overwrite: true, ..job(&path, "count,mean,max", 1.0) };
        run(&source, &job);
        let bits = |band| read(&path, band).values.iter().map(|v| v.to_bits()).collect();
        let bands: Vec<Vec<u64>> = (1..=3).map(bits).collect();
        assert!(bands[0] != bands[1] && bands[1] != bands[2]);
        assert!(first.get_or_insert_with(|| bands.clone()) == &bands, "{:?}", job.creation);
        let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
        for line in
            ["sample=\"0\" role=\"description\">count<", "sample=\"2\" role=\"description\">max<"]
        {
            assert!(text.contains(line), "{line}");
        }
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_remedy() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let source = Memory::new(frame(0.01, [0.0; 3]), &points(10, 1000, 100, 1), 9);
    let fails = |job: &GridJob, part: &str| {
        let told = terrane_lidar::grid::grid(
            &source,
            job,
            &terrane_engine::Silent,
            &terrane_engine::Cancel::default(),
        );
        let told = told.unwrap_err().to_string();
        assert!(told.contains(part), "{told}");
        assert!(!job.output.exists());
    };
    fails(&job(&path("a.asc"), "mean,max", 1.0), "AAIGrid does not support several bands");
    let little = Resources { threads: 1, memory: 8 << 20, temp_dir: None };
    fails(
        &GridJob { resources: little, ..job(&path("a.tif"), "mean", 1.0) },
        "MiB of memory are needed",
    );
    let typed = GridJob { sample_type: SampleType::I16, ..job(&path("a.tif"), "mean", 1.0) };
    fails(&typed, "int16");
    fails(&job(&path("a.tif"), "mean", 1e-9), "exceeds the limit");
    let align = Placement { align: Some([0.0; 2]), ..Placement::new([1.0; 2]) };
    let pdal =
        GridJob { placement: align, compat: Compat::Pdal, ..job(&path("a.tif"), "mean", 1.0) };
    fails(&pdal, "‹compat› pdal sets the grid origin");
    let like = Placement { like: Some("x.tif".into()), ..Placement::new([1.0; 2]) };
    fails(
        &GridJob { placement: like, ..job(&path("a.tif"), "mean", 1.0) },
        "‹like› and ‹cell› both",
    );
}

#[test]
fn cells_may_be_those_of_another_grid() {
    let folder = tempdir().unwrap();
    let [a, b] = ["a.tif", "b.tif"].map(|name| folder.path().join(name));
    let points = points(3000, 2000, 70, 9);
    let source = Memory::new(FAR, &points, 500);
    let placement = Placement {
        extent: Some([199_990.0, 4_999_990.0, 200_005.0, 5_000_004.0]),
        ..Placement::new([0.7; 2])
    };
    run(&source, &GridJob { placement, ..wide(&a, ALL, 0.7) });
    let like = Placement {
        cell: None,
        like: Some(a.display().to_string()),
        align: None,
        extent: None,
        is_chosen: false,
    };
    run(&source, &GridJob { placement: like, ..wide(&b, ALL, 0.7) });
    let [a, b] =
        [a, b].map(|path| (1..=9).map(|band| read(&path, band).values).collect::<Vec<_>>());
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!(near(*a, *b, 1e-6), "{a} {b}");
    }
}
