//! Attributes from polygons, grids and pictures, beside formulas and searches of all polygons.

use terrane_engine::Resources;
use terrane_engine::Silent;
use terrane_lidar::points::plan::{PlanPointsJob, plan_points};
use terrane_lidar::points::{PointTiling, StageText, TranslateJob};

use crate::cloud_support::{Made, Packing, Place, Random, raw};
use crate::noise_plan::{files, planned};
use crate::translate::{job, run, whole};

/// Records at these places, in steps of 0.01, 0.01 and 0.001.
fn cloud(format: u8, places: &[[i32; 3]]) -> Made {
    let made = Made::new(format, Packing::Fixed(300), places.len());
    let mut made = Made { offset: [0.0; 3], ..made };
    for (record, at) in made.records.iter_mut().zip(places) {
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
    }
    made
}

fn places(count: usize) -> Vec<[i32; 3]> {
    let mut random = Random::of(3);
    (0..count).map(|_| [4000, 3000, 500].map(|most| random.below(most) as i32)).collect()
}

fn chain(job: TranslateJob, texts: &[&str]) -> TranslateJob {
    let stages = texts.iter().map(|text| text.parse::<StageText>().unwrap());
    stages.fold(job, |job, stage| job.stage(stage.stage().clone()))
}

/// The last value of a record, a double.
fn added(record: &[u8]) -> f64 {
    f64::from_le_bytes(*record.last_chunk().unwrap())
}

/// Whether a place is in a ring: crossings of a ray to the left, for places off its edges.
fn is_inside(ring: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut crossings = 0;
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        if (a[1] > y) != (b[1] > y) {
            let at = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            crossings += usize::from(at < x);
        }
    }
    crossings % 2 == 1
}

#[test]
fn the_last_polygon_around_a_point_counts() {
    let place = Place::new();
    // Corners between the points, whose coordinates are multiples of 0.01.
    let mut random = Random::of(8);
    let mut at = |most: usize| random.below(most * 100) as f64 / 100.0 + 0.005;
    let rings: Vec<Vec<[f64; 2]>> =
        (0..12).map(|_| (0..5).map(|_| [at(40), at(30)]).collect()).collect();
    let feature = |(number, ring): (usize, &Vec<[f64; 2]>)| {
        let closed: Vec<_> = ring.iter().chain(&ring[..1]).collect();
        // Some have no value: points of them keep theirs.
        let value = if number % 4 == 3 { "null".to_owned() } else { number.to_string() };
        format!(
            r#"{{"type":"Feature","properties":{{"n":{value},"name":"a"}},"geometry":{{"type":"Polygon","coordinates":[{closed:?}]}}}}"#
        )
    };
    let features: Vec<_> = rings.iter().enumerate().map(feature).collect();
    let text =
        format!(r#"{{"type":"FeatureCollection","crs":null,"features":[{}]}}"#, features.join(","));
    let polygons = place.write("parcels.geojson", text.as_bytes());
    let at = places(3000);
    let input = place.write("in.laz", &cloud(6, &at).bytes());
    let output = place.path().join("out.las");
    let value = |place: [i32; 3]| {
        let [x, y] = [0, 1].map(|axis| f64::from(place[axis]) / 100.0);
        rings.iter().rposition(|ring| is_inside(ring, [x, y]))
    };
    run(&chain(job(&[&input], &output), &[&format!("overlay:{polygons}:Parcel=n")])).unwrap();
    let (mut inside, mut outside) = (0, 0);
    for record in &whole(&output).records {
        match value(raw(record)).filter(|number| number % 4 != 3) {
            Some(number) => {
                assert_eq!(added(record), number as f64);
                inside += 1;
            }
            None => {
                assert!(added(record).is_nan());
                outside += 1;
            }
        }
    }
    assert!(inside > 500 && outside > 500, "{inside} {outside}");
    // A number for an attribute of LAS; other points keep theirs.
    let before = whole(std::path::Path::new(&input)).records;
    run(&chain(job(&[&input], &output), &[&format!("overlay:{polygons}:class=9")])).unwrap();
    for (record, before) in whole(&output).records.iter().zip(&before) {
        assert_eq!(record[16], if value(raw(record)).is_some() { 9 } else { before[16] });
    }
    for (stage, told) in [
        (format!("overlay:{polygons}:class=name"), "field \"name\" is \"a\", not a number"),
        (format!("overlay:{polygons}:class=none"), "no polygon has a number in a field \"none\""),
        (format!("overlay:{polygons}:class=300"), "300 does not fit into classification"),
        ("overlay:gone.shp:class=2".to_owned(), "gone.shp: no such file"),
        (format!("overlay:{polygons}:red=2"), "no attribute"),
    ] {
        let error = run(&chain(job(&[&input], &output), &[&stage])).unwrap_err().to_string();
        assert!(error.contains(told), "{stage}: {error}");
    }
}

/// The names of the extra bytes of a file, from their descriptions.
fn dimensions(path: &std::path::Path) -> Vec<String> {
    let vlrs = whole(path).vlrs;
    let about = vlrs.iter().find(|(user, number, _)| user == "LASF_Spec" && *number == 4);
    let about = about.map(|(_, _, data)| data.chunks(192)).into_iter().flatten();
    about
        .map(|about| String::from_utf8_lossy(&about[4..36]).trim_end_matches('\0').to_owned())
        .collect()
}

#[test]
fn each_name_is_one_dimension() {
    let place = Place::new();
    let area = place.write("area.wkt", b"POLYGON ((0.005 0.005, 99 0.005, 99 99, 0.005 0.005))");
    let all = place.write("all.wkt", b"POLYGON ((-1 -1, 99 -1, 99 99, -1 99, -1 -1))");
    let grid = place.write(
        "grid.asc",
        b"ncols 2\nnrows 2\nxllcorner -40\nyllcorner -40\ncellsize 80\n5 5\n5 5\n",
    );
    let mut made = cloud(6, &places(500));
    made.records.iter_mut().for_each(|record| record[16] = 2);
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    let [area, all, grid] = [("overlay", area), ("overlay", all), ("sample-grid", grid)]
        .map(|(stage, file)| format!("{stage}:{file}:"));
    let stages = |texts: &[&str]| {
        run(&chain(job(&[&input], &output), texts)).unwrap();
        (dimensions(&output), whole(&output).records)
    };
    let height = |record: &[u8]| i32::from_le_bytes(*record[30..].first_chunk().unwrap());
    let expected = stages(&["height-above-ground"]);
    // The stage that gives a type gives it to all.
    let found = stages(&[&format!("{all}HEIGHTaboveGROUND=0.777"), "height-above-ground"]);
    assert_eq!((found.0.len(), found.1), (1, expected.1));
    let texts = [
        "height-above-ground",
        &format!("{all}HeightAboveGround=0.777"),
        "where:heightaboveground = 0.777",
    ];
    let (names, records) = stages(&texts);
    assert!(names.len() == 1 && records.len() == 500 && height(&records[0]) == 777);
    for texts in [
        [&format!("{all}A=1"), &format!("{grid}a")],
        [&format!("{grid}A"), &format!("{area}A=4")],
        [&"dimension:A=z".to_owned(), &"dimension:a=5".to_owned()],
    ] {
        let (names, records) = stages(&texts.map(String::as_str));
        assert!(names.len() == 1 && records[0].len() == 38, "{texts:?} {names:?}");
        assert!(records.iter().all(|record| !added(record).is_nan()), "{texts:?}");
    }
    // A dimension that the files have is set, whatever its type; other points keep their values.
    stages(&["height-above-ground"]);
    let old = place.path().join("old.las");
    std::fs::rename(&output, &old).unwrap();
    let old = old.to_str().unwrap();
    run(&chain(job(&[old], &output), &[&format!("{area}heightaboveground=0.777")])).unwrap();
    let (before, after) = (whole(std::path::Path::new(old)).records, whole(&output).records);
    let mut counts = [0; 2];
    for (before, after) in before.iter().zip(&after) {
        let is_set = height(after) == 777;
        assert!(is_set || height(after) == height(before));
        counts[usize::from(is_set)] += 1;
    }
    assert!(counts.iter().all(|count| *count > 50) && dimensions(&output).len() == 1, "{counts:?}");
    // Flags are no dimensions, by any name.
    let (names, records) = stages(&[&format!("{all}KeyPoint=1"), &format!("{all}withheld=1")]);
    assert!(names.is_empty() && records.iter().all(|record| record[15] & 6 == 6));
    let error = "dimension:KeyPoint=1".parse::<StageText>().unwrap_err();
    assert!(error.contains("is an attribute of LAS"), "{error}");
}

#[test]
fn samples_of_a_grid_are_interpolated() {
    let place = Place::new();
    // A plane with a void, by columns 1.5 m apart and rows of as much; samples are in the middle of cells.
    let height = |x: f64, y: f64| 2.0 * x - 3.0 * y + 100.0;
    let mut text =
        "ncols 20\nnrows 15\nxllcorner 5\nyllcorner 4\ncellsize 1.5\nNODATA_value -1\n".to_owned();
    let centre = |col: usize, row: usize| [5.75 + 1.5 * col as f64, 4.75 + 1.5 * (14 - row) as f64];
    for row in 0..15 {
        for col in 0..20 {
            let [x, y] = centre(col, row);
            let value = if (col, row) == (7, 6) { -1.0 } else { height(x, y) };
            text += &format!("{value} ");
        }
        text.push('\n');
    }
    let grid = place.write("plane.asc", text.as_bytes());
    let mut at = places(4000);
    // On samples, also on the last ones.
    at.extend([[575, 475, 0], [3425, 2575, 0], [575, 2575, 0], [1625, 1675, 0]]);
    let input = place.write("in.laz", &cloud(6, &at).bytes());
    let output = place.path().join("out.las");
    let made = |stage: &str| {
        run(&chain(job(&[&input], &output), &[stage])).unwrap();
        whole(&output).records
    };
    let (mut valid, mut none) = (0, 0);
    let void = centre(7, 6);
    for record in made(&format!("sample-grid:{grid}:Ground")) {
        let [x, y] = [0, 1].map(|axis| f64::from(raw(&record)[axis]) / 100.0);
        let near_void = (x - void[0]).abs() < 1.5 && (y - void[1]).abs() < 1.5;
        let is_inside = (5.75..=34.25).contains(&x) && (4.75..=25.75).contains(&y);
        let found = added(&record);
        if is_inside && !near_void {
            assert!((found - height(x, y)).abs() < 1e-9, "{x} {y} {found}");
            valid += 1;
        } else {
            assert!(found.is_nan(), "{x} {y} {found}");
            none += 1;
        }
    }
    assert!(valid > 1000 && none > 1000);
    for record in made(&format!("sample-grid:{grid}:Ground:nearest")) {
        let [x, y] = [0, 1].map(|axis| f64::from(raw(&record)[axis]) / 100.0);
        let all = (0..20).flat_map(|col| (0..15).map(move |row| (col, row)));
        let near = |at: [f64; 2]| (x - at[0]).abs().max((y - at[1]).abs());
        let nearest = all.min_by(|a, b| near(centre(a.0, a.1)).total_cmp(&near(centre(b.0, b.1))));
        let (col, row) = nearest.unwrap();
        let [cx, cy] = centre(col, row);
        let found = added(&record);
        // Between cells it is that of either.
        let is_far = near([cx, cy]) > 0.75 + 1e-9;
        let is_on_border = (near([cx, cy]) - 0.75).abs() < 1e-9;
        if is_far || (col, row) == (7, 6) {
            assert!(found.is_nan() || is_on_border, "{x} {y} {found}");
        } else if !is_on_border {
            assert!((found - height(cx, cy)).abs() < 1e-9, "{x} {y} {found}");
        }
    }
    // Into an attribute, and then used.
    let texts =
        [&format!("sample-grid:{grid}:Ground"), "where:Ground > 100", "assign:intensity = Ground"];
    run(&chain(job(&[&input], &output), &texts)).unwrap();
    let kept = whole(&output).records;
    assert!(kept.len() > 100 && kept.len() < valid);
    for record in kept {
        let intensity = u16::from_le_bytes(*record[12..].first_chunk().unwrap());
        assert_eq!(f64::from(intensity), added(&record).round());
    }
    // A dimension of a formula has no value where the grid has none.
    let texts = [&format!("sample-grid:{grid}:Ground"), "dimension:Above = (z - Ground) / 2"];
    run(&chain(job(&[&input], &output), &texts)).unwrap();
    for record in whole(&output).records {
        let ground = f64::from_le_bytes(*record[record.len() - 16..].first_chunk().unwrap());
        let z = f64::from(raw(&record)[2]) / 1000.0;
        let (found, expected) = (added(&record), (z - ground) / 2.0);
        assert!(found == expected || found.is_nan() && ground.is_nan(), "{found} {expected}");
    }
    for (stage, told) in [
        (format!("sample-grid:{grid}:return_number"), "does not fit into return_number"),
        (format!("sample-grid:{grid}:Ground:band=2"), "band 2"),
        ("sample-grid:gone.tif:Ground".to_owned(), "gone.tif"),
    ] {
        let error = run(&chain(job(&[&input], &output), &[&stage])).unwrap_err().to_string();
        assert!(error.contains(told), "{stage}: {error}");
    }
}

#[test]
fn colours_are_those_of_the_pixel_and_plans_read_the_same() {
    let place = Place::new();
    let colour = |col: u32, row: u32| [col * 6, row * 8, 255 - col];
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 40, 30);
    encoder.set_color(png::ColorType::Rgb);
    let pixels = (0..40 * 30).flat_map(|i| colour(i % 40, i / 40)).map(|value| value as u8);
    encoder.write_header().unwrap().write_image_data(&pixels.collect::<Vec<_>>()).unwrap();
    let picture = place.write("photo.png", &bytes);
    // Pixels of 1 m; the world file tells of the middle of the first.
    place.write("photo.pgw", b"1\n0\n0\n-1\n0.5\n29.5\n");
    let input = place.write("in.laz", &cloud(7, &places(3000)).bytes());
    let texts = [format!("colour:{picture}"), format!("sample-grid:{picture}:Shade:nearest")];
    let texts = texts.each_ref().map(String::as_str);
    let output = place.path().join("out.las");
    run(&chain(job(&[&input], &output), &texts[..1])).unwrap();
    for record in whole(&output).records {
        let [x, y, _] = raw(&record);
        let expected =
            colour(x as u32 / 100, (2999 - y) as u32 / 100).map(|value| value as u16 * 257);
        let found = [30, 32, 34].map(|at| u16::from_le_bytes(*record[at..].first_chunk().unwrap()));
        assert_eq!(found, expected, "{x} {y}");
    }
    let plain = place.write("plain.laz", &cloud(6, &places(30)).bytes());
    let error = run(&chain(job(&[&plain], &output), &texts[..1])).unwrap_err().to_string();
    assert!(error.contains("no attribute \"red\"") && error.contains("point_format"), "{error}");

    // Tiles by plan, with relative names and in little memory, are those of a single run.
    let squares = PointTiling { side: 11.0, buffer: 1.0, flag: Default::default() };
    let folder = place.path().join("whole");
    let resources = Resources { threads: 2, memory: 256 << 20, temp_dir: None };
    let whole =
        TranslateJob { squares: Some((squares, true)), resources, ..job(&[&input], &folder) };
    let whole = chain(whole, &texts[..1]);
    run(&whole).unwrap();
    let work = place.path().join("work");
    planned(&whole, &work, 2);
    assert!(files(&work.join("points")) == files(&folder));
    // A plan notices that a file of its stages has changed.
    let other = place.path().join("other");
    let plan = PlanPointsJob { job: whole, folder: other.clone(), cut: Some(2), skipped: vec![] };
    plan_points(&plan, &Silent, &Default::default()).unwrap();
    place.write("photo.pgw", b"1\n0\n0\n-1\n0.5\n39.5\n");
    std::fs::write(&picture, b"something else").unwrap();
    let error = plan_points(&plan, &Silent, &Default::default()).unwrap_err().to_string();
    assert!(error.contains("photo.png"), "{error}");
}
