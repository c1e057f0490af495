//! Reports on quality beside an obvious computation with all points in maps, and wrong headers, each of which is found.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde_json::Value;
use terrane::prelude::*;
use terrane::{QaOptions, QaReport};
use terrane_base::geom::wkt;
use terrane_engine::operation::Job;
use terrane_raster::Inputs;
use terrane_vector::{self as vector, PartRole, VectorOpenOptions};

use crate::cloud_support::{Made, Packing, Place, Random, raw};

/// Steps along a side of a cell.
const CELL: i32 = 100;

/// A point as the twin sees it.
struct TwinPoint {
    cell: [i32; 2],
    line: u16,
    is_last: bool,
    z: i32,
    is_withheld: bool,
}

/// Three flight lines with gaps, over a floor and a few trees.
pub(super) fn survey(format: u8, count: usize, seed: usize, corner: [i32; 2]) -> Made {
    let mut made = Made::new(format, Packing::Fixed(500), count);
    let mut random = Random::of(seed);
    for record in &mut made.records {
        let place = std::iter::repeat_with(|| [1500, 1200].map(|most| random.below(most) as i32))
            // Holes, one of them at a corner of another.
            .find(|[x, y]| {
                !matches!((x / CELL, y / CELL), (4..6, 3..5) | (6, 5) | (9, 8) | (12.., 9..))
            })
            .unwrap();
        let line = random.below(3) as u16;
        let tree = if random.below(9) == 0 { 3000 } else { 0 };
        let z = random.below(40) as i32 + 25 * i32::from(line) + tree;
        let xyz = [place[0] + corner[0], place[1] + corner[1], z];
        record[..12].copy_from_slice(xyz.map(i32::to_le_bytes).as_flattened());
        let [at, time] = if format < 6 { [18, 20] } else { [20, 22] };
        record[at..at + 2].copy_from_slice(&(line + 7).to_le_bytes());
        if format != 0 {
            let seconds = 1000.0 * f64::from(line) + random.below(100) as f64;
            record[time..time + 8].copy_from_slice(&seconds.to_le_bytes());
        }
    }
    made
}

fn twin_points(made: &Made) -> Vec<TwinPoint> {
    let of = |record: &Vec<u8>| {
        let [x, y, z] = raw(record);
        let is_new = made.format > 5;
        let (number, returns) = match is_new {
            true => (record[14] & 15, record[14] >> 4),
            false => (record[14] & 7, record[14] >> 3 & 7),
        };
        let at = if is_new { 20 } else { 18 };
        TwinPoint {
            cell: [y.div_euclid(CELL), x.div_euclid(CELL)],
            line: u16::from_le_bytes([record[at], record[at + 1]]),
            is_last: number >= returns,
            z,
            is_withheld: if is_new { record[15] & 4 > 0 } else { record[15] & 128 > 0 },
        }
    };
    made.records.iter().map(of).collect()
}

/// A file with a header that agrees with its points.
pub(super) fn sound(made: &Made) -> Vec<u8> {
    let mut made = made.clone();
    let text = wkt::of_srs("EPSG:32631").to_wkt().unwrap();
    if made.minor >= 4 {
        made.vlrs.push(("LASF_Projection", 2112, text.into_bytes()));
    }
    let mut bytes = made.bytes();
    bytes[90..92].copy_from_slice(&60_u16.to_le_bytes());
    bytes[92..94].copy_from_slice(&2020_u16.to_le_bytes());
    let bits = if made.format > 5 { 4 } else { 3 };
    let mut counts = [0_u64; 15];
    for record in &made.records {
        counts[usize::from(record[14] & ((1 << bits) - 1)) - 1] += 1;
    }
    for (i, count) in counts.into_iter().enumerate() {
        if made.format < 6 && i < 5 {
            bytes[111 + 4 * i..][..4].copy_from_slice(&(count as u32).to_le_bytes());
        }
        if made.minor >= 4 {
            bytes[255 + 8 * i..][..8].copy_from_slice(&count.to_le_bytes());
            bytes[6] = 16;
        }
    }
    bytes
}

pub(super) fn job(inputs: &[String]) -> Job<'static, QaOptions> {
    Job::new(Inputs::from(inputs.to_vec()), QaOptions::default()).overwrite(true)
}

/// The report without what differs from run to run.
fn lasting(report: &QaReport) -> Value {
    let mut all = serde_json::to_value(report).unwrap();
    for name in ["threads", "memory_budget", "peak_memory", "wall_seconds", "spilled_bytes"] {
        all.as_object_mut().unwrap().remove(name);
    }
    all
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-9 * expected.abs().max(1.0)
}

/// The sizes of groups of empty cells that occupied ones enclose.
fn enclosed(occupied: &BTreeSet<[i32; 2]>) -> Vec<u64> {
    let [low, high] = [[-2, -2], [40, 40]];
    let mut open: BTreeSet<[i32; 2]> = (low[0]..high[0])
        .flat_map(|row| (low[1]..high[1]).map(move |col| [row, col]))
        .filter(|cell| !occupied.contains(cell))
        .collect();
    let mut sizes = Vec::new();
    while let Some(start) = open.first().copied() {
        let (mut stack, mut size, is_outside) = (vec![start], 0, start == low);
        while let Some([row, col]) = stack.pop() {
            if open.remove(&[row, col]) {
                size += 1;
                stack.extend([[row + 1, col], [row - 1, col], [row, col + 1], [row, col - 1]]);
            }
        }
        sizes.extend((!is_outside).then_some(size));
    }
    sizes.sort_unstable();
    sizes
}

#[test]
fn a_report_says_what_a_walk_over_all_points_says() {
    let place = Place::new();
    for (seed, format, count) in [(1, 6, 900), (2, 1, 400), (3, 0, 150), (4, 7, 2500), (5, 6, 1)] {
        // The second file overlaps the first, and has points of two of its lines.
        let both = [[0, 0], [1000, 700]].map(|corner| survey(format, count, seed, corner));
        let names = ["a.laz", "b.laz"].map(|name| format!("{seed}{name}"));
        let files: Vec<String> =
            both.iter().zip(&names).map(|(made, name)| place.write(name, &sound(made))).collect();
        let index = place.path().join("index.geojson");
        let report = job(&files).cell(1.0).min_void(2.0).min_density(3.0).max_range(0.05);
        let report = report.index(&index).write(place.path().join("qa.html")).unwrap();
        let points: Vec<TwinPoint> =
            both.iter().flat_map(twin_points).filter(|point| !point.is_withheld).collect();

        let mut cells: BTreeMap<[i32; 2], [u64; 2]> = BTreeMap::new();
        for point in &points {
            let cell = cells.entry(point.cell).or_default();
            *cell = [cell[0] + 1, cell[1] + u64::from(point.is_last)];
        }
        let occupied: BTreeSet<[i32; 2]> = cells.keys().copied().collect();
        let voids = enclosed(&occupied);
        let empty: u64 = voids.iter().sum();
        assert_eq!((report.occupied_cells, report.enclosed_cells), (occupied.len() as u64, empty));
        for (density, which) in [(&report.density, 0), (&report.pulse_density, 1)] {
            let density = density.as_ref().unwrap();
            let mut counts: Vec<u64> = cells.values().map(|counts| counts[which]).collect();
            counts.extend(vec![0; empty as usize]);
            counts.sort_unstable();
            let total: u64 = counts.iter().sum();
            assert!(near(density.mean, total as f64 / counts.len() as f64));
            for (percent, value) in &density.percentiles {
                let rank = (counts.len() * *percent as usize).div_ceil(100).max(1);
                assert_eq!(*value, counts[rank - 1] as f64, "{percent} % of seed {seed}");
            }
            if let Some(below) = density.below {
                let few = counts.iter().filter(|n| **n < 3).count();
                assert!(near(below, few as f64 / counts.len() as f64));
            }
        }
        let required = report.min_density.unwrap();
        let kept = report.density.as_ref().unwrap().points;
        let is_judged = kept >= 4 * report.occupied_cells;
        let is_met = report.pulse_density.as_ref().unwrap().mean >= 3.0;
        assert_eq!(required.is_met, is_judged.then_some(is_met));
        let large: Vec<u64> = voids.into_iter().filter(|cells| *cells >= 2).collect();
        let found = report.voids.as_ref().unwrap();
        assert_eq!((found.count, found.cells), (large.len() as u64, large.iter().sum()));
        let mut listed: Vec<u64> = found.largest.iter().map(|void| void.cells).collect();
        listed.sort_unstable();
        assert_eq!(listed, large[large.len().saturating_sub(20)..]);
        overlaps(&report, &points);
        assert_eq!(footprints(&index, &both), 2, "seed {seed}");
        let time = report.lines[0].gps_time;
        assert_eq!(time.is_none(), format == 0);
        let findings = report.findings.iter().filter(|it| it.finding != "the CRS is missing");
        let only_crs: Vec<_> = findings.filter(|it| !it.finding.contains("is reserved")).collect();
        assert!(only_crs.is_empty(), "{only_crs:?}");
    }
}

/// Compares pairs of lines with those of all points.
fn overlaps(report: &QaReport, points: &[TwinPoint]) {
    let mut cells: HashMap<[i32; 2], BTreeMap<u16, Vec<i32>>> = HashMap::new();
    for point in points {
        let heights = cells.entry(point.cell).or_default().entry(point.line).or_default();
        heights.extend(point.is_last.then_some(point.z));
    }
    let mut pairs: BTreeMap<[u16; 2], (u64, Vec<f64>)> = BTreeMap::new();
    for lines in cells.values() {
        for (a, own) in lines {
            for (b, other) in lines.range(a + 1..) {
                let pair = pairs.entry([*a, *b]).or_default();
                pair.0 += 1;
                let is_flat = |heights: &Vec<i32>| {
                    heights.len() >= 3
                        && heights.iter().max().unwrap() - heights.iter().min().unwrap() <= 50
                };
                if is_flat(own) && is_flat(other) {
                    let mean = |heights: &Vec<i32>| {
                        heights.iter().map(|z| f64::from(*z)).sum::<f64>() / heights.len() as f64
                    };
                    pair.1.push((mean(own) - mean(other)) * 0.001);
                }
            }
        }
    }
    let found = &report.overlaps;
    assert_eq!(found.len(), pairs.len());
    for (overlap, (lines, (cells, mut all))) in found.iter().zip(pairs) {
        assert_eq!((overlap.lines, overlap.cells), (lines, cells));
        assert_eq!(overlap.compared, all.len() as u64);
        if all.is_empty() {
            assert_eq!((overlap.mean, overlap.p95), (None, None));
            continue;
        }
        let count = all.len() as f64;
        all.sort_by(f64::total_cmp);
        assert!(near(overlap.mean.unwrap(), all.iter().sum::<f64>() / count));
        let squares: f64 = all.iter().map(|it| it * it).sum();
        assert!(near(overlap.rmse.unwrap(), (squares / count).sqrt()));
        assert!(near(overlap.median.unwrap(), all[all.len().div_ceil(2) - 1]));
        let mut sizes: Vec<f64> = all.iter().map(|it| it.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        assert!(near(overlap.p95.unwrap(), sizes[(sizes.len() * 95).div_ceil(100) - 1]));
        assert!(near(overlap.largest.unwrap(), sizes[sizes.len() - 1]));
    }
}

/// Reads an index back: the centre of a cell is within the rings of its file if the cell has points. Returns the features.
fn footprints(index: &std::path::Path, files: &[Made]) -> usize {
    let mut source = vector::open(index, &VectorOpenOptions::default()).unwrap();
    let mut count = 0;
    while let Some(feature) = source.next().unwrap() {
        let points = twin_points(&files[count]);
        let points = points.iter().filter(|point| !point.is_withheld);
        let occupied: BTreeSet<[i32; 2]> = points.map(|point| point.cell).collect();
        let rings: Vec<Vec<[f64; 2]>> =
            feature.geometry.parts().map(|part| part.xy.to_vec()).collect();
        let area: f64 = rings.iter().map(|ring| signed_area(ring)).sum();
        assert!(near(area, occupied.len() as f64), "{area} of {}", occupied.len());
        for ring in &rings {
            let corners: BTreeSet<[i64; 2]> =
                ring.iter().map(|at| at.map(|value| value.round() as i64)).collect();
            assert_eq!(corners.len() + 1, ring.len(), "a ring touches itself: {ring:?}");
        }
        let mut outer: Vec<[f64; 2]> = Vec::new();
        for part in feature.geometry.parts() {
            assert_eq!(signed_area(part.xy) > 0.0, part.role == PartRole::Outer);
            if part.role == PartRole::Outer {
                outer = part.xy.to_vec();
            }
            // The cell north-east of the lowest corner.
            let low = part
                .xy
                .iter()
                .copied()
                .min_by(|a, b| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0])));
            assert!(is_within(low.unwrap().map(|at| at + 0.5), &outer));
        }
        for (row, col) in (-2..40).flat_map(|row| (-2..40).map(move |col| (row, col))) {
            let at = [1000.5 + f64::from(col), 2000.5 + f64::from(row)];
            let around = rings.iter().filter(|ring| is_within(at, ring)).count();
            assert_eq!(around % 2 == 1, occupied.contains(&[row, col]), "{row} {col}");
        }
        count += 1;
    }
    count
}

/// Whether a place is within a ring along the axes.
fn is_within(at: [f64; 2], ring: &[[f64; 2]]) -> bool {
    let crossings = ring
        .windows(2)
        .filter(|pair| (pair[0][1] > at[1]) != (pair[1][1] > at[1]) && pair[0][0] > at[0]);
    crossings.count() % 2 == 1
}

fn signed_area(ring: &[[f64; 2]]) -> f64 {
    // Relative to a corner, where products are exact.
    let at = |i: usize| [ring[i][0] - ring[0][0], ring[i][1] - ring[0][1]];
    let pairs = (0..ring.len() - 1).map(|i| (at(i), at(i + 1)));
    pairs.map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum()
}

#[test]
fn threads_memory_and_the_order_of_files_change_no_byte() {
    let place = Place::new();
    let mut both = [0, 1].map(|seed| survey(6, 300_000, seed, [0, 0]));
    // A cell for each point, so that cells are spilled.
    for (seed, made) in both.iter_mut().enumerate() {
        let mut random = Random::of(seed + 9);
        for record in &mut made.records {
            let place = [random.below(90_000), random.below(90_000), random.below(30)];
            record[..12]
                .copy_from_slice(place.map(|at| at as i32).map(i32::to_le_bytes).as_flattened());
        }
    }
    let mut files: Vec<String> = ["a.laz", "b.laz"]
        .iter()
        .zip(&both)
        .map(|(name, made)| place.write(name, &sound(made)))
        .collect();
    let mut first = None;
    for (threads, memory) in [(1, "1G"), (3, "1G"), (3, "90M"), (1, "90M")] {
        files.reverse();
        let [page, index] = ["qa.html", "index.fgb"].map(|name| place.path().join(name));
        let report = job(&files).cell(1.0).threads(threads).memory(memory).index(&index);
        let report = report.write(&page).unwrap();
        assert_eq!(report.run.spilled_bytes > Some(0), memory == "90M", "{:?}", report.run);
        let mut lasting = lasting(&report);
        lasting.as_object_mut().unwrap().remove("input");
        let html = std::fs::read_to_string(page).unwrap();
        let written = (lasting, html, std::fs::read(index).unwrap());
        let usual = first.get_or_insert_with(|| written.clone());
        assert!(*usual == written, "{threads} threads, {memory}");
    }
}

#[test]
fn wrong_headers_are_found() {
    let place = Place::new();
    let put = |at: usize, value: &'static [u8]| {
        move |bytes: &mut Vec<u8>| bytes[at..at + value.len()].copy_from_slice(value)
    };
    let point = |bytes: &[u8], field: usize| {
        u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize + field
    };
    type Change<'a> = Box<dyn Fn(&mut Vec<u8>) + 'a>;
    let in_point = |field: usize, value: Vec<u8>| -> Change<'_> {
        Box::new(move |bytes| {
            let at = point(bytes, field);
            bytes[at..at + value.len()].copy_from_slice(&value);
        })
    };
    let bound = |at: usize, by: f64| -> Change<'_> {
        Box::new(move |bytes| {
            let value = f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) + by;
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        })
    };
    let late = 5e8_f64.to_le_bytes().to_vec();
    let standard = |time: Vec<u8>| -> Change<'_> {
        Box::new(move |bytes| {
            bytes[6] |= 1;
            let at = point(bytes, 22);
            bytes[at..at + 8].copy_from_slice(&time);
        })
    };
    let cases: Vec<(u8, Change<'_>, &str)> = vec![
        (6, Box::new(put(90, &[0; 4])), "the creation date is missing"),
        (6, Box::new(put(90, &[255, 255])), "the creation date is invalid: day 65535 of 2020"),
        (6, Box::new(put(107, &[9])), "the legacy point count is 9, not 0"),
        (6, Box::new(put(111, &[9])), "the legacy counts by return are 9, not 0"),
        (1, Box::new(put(111, &[0, 0, 1, 0])), "counts by return are stated as 65536, "),
        (6, Box::new(put(255, &[255])), "counts by return are stated as 255, "),
        (6, bound(179, -5.0), "points lie outside the bounds in x: "),
        (6, bound(219, 1.0), "points lie outside the bounds in z: "),
        (6, bound(187, -1.0), "the bounds are wider than the points in x: "),
        (6, bound(195, 0.5), "the bounds are wider than the points in y: "),
        (6, in_point(22, (-1.0_f64).to_le_bytes().to_vec()), "GPS times are outside a week, "),
        (
            6,
            standard(f64::NAN.to_le_bytes().to_vec()),
            "GPS times are before the start of GPS time",
        ),
        (6, standard((-2e9_f64).to_le_bytes().to_vec()), "GPS times are before the start"),
        (6, standard(late), "GPS times are after the creation date: 1 points"),
        (6, in_point(16, vec![40]), "class 40 is reserved in point format 6: 1 points"),
        (1, in_point(15, vec![30]), "class 30 is reserved in point format 1: 1 points"),
        (6, in_point(14, vec![0x23]), "return numbers are 0 or above the number of returns: 1"),
        (6, in_point(18, vec![0, 128]), "scan angles are beyond 180 degrees: -196.608 to "),
        (1, in_point(16, vec![100]), "scan angles are beyond 90 degrees: "),
    ];
    for (format, change, finding) in cases {
        let mut made = survey(format, 300, 3, [0, 0]);
        made.packing = Packing::Plain;
        for record in &mut made.records {
            // Nothing else is to be found.
            match format {
                6 => record[16] = 2,
                _ => record[15] = 2,
            }
        }
        let mut bytes = sound(&made);
        let file = place.write("plain.las", &bytes);
        let page = place.path().join("qa.html");
        let usual = job(&[file]).write(&page).unwrap().findings;
        let expected = if format < 6 { vec!["the CRS is missing"] } else { Vec::new() };
        assert_eq!(usual.iter().map(|it| &it.finding).collect::<Vec<_>>(), expected, "{finding}");
        change(&mut bytes);
        let file = place.write("wrong.las", &bytes);
        let found = job(&[file]).write(&page).unwrap().findings;
        assert!(found.iter().any(|it| it.finding.starts_with(finding)), "{finding}: {found:?}");
        assert!(found.iter().all(|it| it.file.ends_with("wrong.las")));
        let html = std::fs::read_to_string(&page).unwrap();
        assert!(html.contains(&finding.replace('"', "&quot;")), "{finding}");
    }
    let other = place.write("other.las", &sound(&survey(7, 50, 1, [0, 0])));
    let one = place.write("one.las", &sound(&survey(6, 50, 1, [0, 0])));
    let found = job(&[one, other]).write(place.path().join("qa.html")).unwrap().findings;
    let expected = found.iter().any(|it| it.finding.starts_with("the point format is 7, that of "));
    assert!(expected, "{found:?}");
}

#[test]
fn odd_clouds_have_a_report() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let none =
        place.write("none.las", &sound(&Made { records: Vec::new(), ..survey(6, 1, 1, [0, 0]) }));
    let index = place.path().join("none.geojson");
    let report = job(&[none]).index(&index).write(&page).unwrap();
    assert!(std::fs::read_to_string(index).unwrap().contains(r#""geometry":null"#));
    assert_eq!((report.cell, report.density.is_none(), report.lines.len()), (None, true, 0));
    assert!(std::fs::read_to_string(&page).unwrap().contains("There are no points."));

    // Thousands of lines, each over the one before.
    let mut many = survey(6, 9000, 1, [0, 0]);
    for (i, record) in many.records.iter_mut().enumerate() {
        let place = [i as i32 / 3 * 50 + i as i32 % 3 * 20, 0, 0];
        record[..12].copy_from_slice(place.map(i32::to_le_bytes).as_flattened());
        record[20..22].copy_from_slice(&((i / 3) as u16).to_le_bytes());
    }
    let file = place.write("many.las", &sound(&many));
    let report = job(&[file]).cell(1.0).keep_withheld(true).write(&page).unwrap();
    assert_eq!((report.lines.len(), report.overlaps.len()), (3000, 1500));

    // Ids that are none of flight lines.
    for record in &mut many.records {
        record[..12].fill(0);
    }
    let file = place.write("ids.las", &sound(&many));
    let report = job(&[file]).cell(1.0).write(&page).unwrap();
    assert_eq!((report.overlaps.len(), report.overlaps_left_out > 1_000_000), (0, true));
    assert!(std::fs::read_to_string(&page).unwrap().contains("too many pairs"));

    // Degrees: areas are on the ground.
    let text: String = (0..400)
        .map(|i| {
            format!("{} {} 5\n", 7.0 + f64::from(i % 20) * 1e-4, 60.0 + f64::from(i / 20) * 1e-4)
        })
        .collect();
    let file = format!("cloud:{}", place.write("degrees.xyz", text.as_bytes()));
    let report = job(&[file]).crs("EPSG:4326").write(&page).unwrap();
    let (cell, area) = (report.cell.unwrap(), report.cell_area.unwrap());
    let expected = (cell * 111_412.0) * (cell * 55_800.0);
    assert!((area / expected - 1.0).abs() < 0.01, "{cell} {area} {expected}");
    assert_eq!(report.area_unit, "metre");

    // Filters are said, and damage is a finding.
    let mut made = survey(6, 3000, 2, [0, 0]);
    made.packing = Packing::Fixed(1000);
    let mut bytes = sound(&made);
    let end = bytes.len();
    bytes[end - 2500..end - 2000].fill(255);
    let file = place.write("damaged.laz", &bytes);
    assert!(job(std::slice::from_ref(&file)).write(&page).is_err());
    let report = job(std::slice::from_ref(&file)).salvage(true).write(&page).unwrap();
    assert!(report.findings.iter().any(|it| it.finding.ends_with("stated points are unreadable")));
    let report = job(&[file]).salvage(true).class(vec![2]).write(&page).unwrap();
    assert!(!report.headers_compared && report.filters["class"] == serde_json::json!([2]));
    assert!(std::fs::read_to_string(&page).unwrap().contains("class [2]"));
}

#[test]
fn a_virtual_point_cloud_has_the_fields_of_its_extensions() {
    let place = Place::new();
    let mut made = survey(6, 500, 1, [0, 0]);
    made.offset = [500_000.0, 4_000_000.0, 0.0];
    let file = place.write("a.las", &sound(&made));
    let index = place.path().join("all.vpc");
    job(&[file]).cell(1.0).index(&index).write(place.path().join("qa.html")).unwrap();
    let all: Value = serde_json::from_slice(&std::fs::read(&index).unwrap()).unwrap();
    assert_eq!((&all["type"], all.get("crs")), (&Value::from("FeatureCollection"), None));
    let item = &all["features"][0];
    assert_eq!(item["stac_version"], "1.0.0");
    assert_eq!(item["assets"]["data"]["href"], "./a.las");
    let properties = &item["properties"];
    assert_eq!(properties["pc:count"], 500);
    assert_eq!(properties["datetime"], "2020-02-29T00:00:00Z");
    assert_eq!(properties["proj:epsg"], 32631);
    assert!(properties["proj:wkt2"].as_str().unwrap().contains("UTM"));
    assert_eq!(properties["proj:bbox"].as_array().unwrap().len(), 6);
    assert_eq!(properties["proj:geometry"]["type"], "MultiPolygon");
    // The central meridian of zone 31 is 3 degrees east.
    let west = item["bbox"][0].as_f64().unwrap();
    assert!((west - 3.0).abs() < 1e-6, "{west}");
    assert!(item["bbox"].as_array().unwrap().len() == 6);
    let unknown = place.path().join("all.gpx");
    let file = place.path().join("a.las").to_str().unwrap().to_owned();
    let error = job(&[file]).index(unknown).write(place.path().join("b.html")).unwrap_err();
    assert!(error.to_string().contains("use .geojson"), "{error}");
}
