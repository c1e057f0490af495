//! `terrane color-relief`: pixels of every format, the same bytes however they are made, refused by name.

use crate::cli_support::{Place, json};
use crate::relief::values;

const COLOURS: &str =
    "# sea to snow\n0 0 64 128\n25%:0:160,60\n600\torange 200\n100% white\nnv 1 2 3 0\n";

/// Bytes of a band.
fn band(place: &Place, name: &str, band: &str) -> Vec<f64> {
    let one = format!("{name}.{band}.tif");
    let wide = ["--type", "float32", "--out-nodata", "-1"];
    place.ok(&[&["convert", name, &one, "--band", band, "--overwrite", "-q"][..], &wide].concat());
    values(place, &one).1
}

#[test]
fn pixels_are_the_colours_of_heights_in_every_format() {
    let place = Place::new();
    place.write("c.txt", COLOURS);
    place.ok(&["synth", "salt,size=150,voids=0.01,seed=5", "dem.tif", "-q"]);
    // As they are stored, not as they are written as text.
    let heights: Vec<f64> =
        values(&place, "dem.tif").1.iter().map(|z| f64::from(*z as f32)).collect();
    let valid = || heights.iter().filter(|z| !z.is_nan());
    let (low, high) = valid().fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(*z), b.max(*z)));
    let mut entries = [
        (0.0, [0.0, 64.0, 128.0, 255.0]),
        (low + 0.25 * (high - low), [0.0, 160.0, 60.0, 255.0]),
        (600.0, [255.0, 127.0, 0.0, 200.0]),
        (high, [255.0; 4]),
    ];
    entries.sort_by(|a, b| a.0.total_cmp(&b.0));
    let colour = |z: f64| -> [f64; 4] {
        if z.is_nan() {
            return [1.0, 2.0, 3.0, 0.0];
        }
        let after = entries.iter().position(|entry| entry.0 >= z).unwrap_or(entries.len());
        if after == 0 || after == entries.len() {
            return entries[after.min(entries.len() - 1)].1;
        }
        let ((z0, a), (z1, b)) = (entries[after - 1], entries[after]);
        [0, 1, 2, 3].map(|i| (a[i] + (z - z0) / (z1 - z0) * (b[i] - a[i]) + 0.45).floor())
    };
    for (name, more) in [
        ("o.tif", &["--alpha"][..]),
        ("c.tif", &["--alpha", "-f", "COG", "--co", "OVERVIEWS=NONE"]),
        ("r.tif", &["--co", "COMPRESS=DEFLATE", "--co", "TILED=YES"]),
    ] {
        place.ok(&[&["color-relief", "dem.tif", "c.txt", name, "-q"][..], more].concat());
        let bands = if more[0] == "--alpha" { 4 } else { 3 };
        let info = json(&place.ok(&["info", name, "--json"]).out);
        assert_eq!(
            (info["bands"].as_u64(), info["sample_type"].as_str()),
            (Some(bands), Some("uint8")),
            "{info}"
        );
        let found: Vec<_> = (1..=bands).map(|b| band(&place, name, &b.to_string())).collect();
        for (i, z) in heights.iter().enumerate() {
            let expected = colour(*z);
            for (b, found) in found.iter().enumerate() {
                // A picture's pixels that cannot be seen are voids to readers.
                let is_it = (found[i] - expected[b]).abs() < 0.5
                    || found[i].is_nan() && bands == 4 && expected[3] == 0.0;
                assert!(is_it, "{name} {i} {b}: {}, not {}, of {z}", found[i], expected[b]);
            }
        }
    }
    // The same pixels in a PNG, and where they lie.
    place.ok(&["color-relief", "dem.tif", "c.txt", "p.png", "--alpha", "-q"]);
    assert_eq!(pixels(&place.bytes("p.png"), 4).len(), heights.len());
    for (pixel, z) in pixels(&place.bytes("p.png"), 4).iter().zip(&heights) {
        assert_eq!(pixel[..], colour(*z).map(|part| part as u8), "{z}");
    }
    place.ok(&["color-relief", "dem.tif", "c.txt", "q.png", "-q"]);
    for (pixel, z) in pixels(&place.bytes("q.png"), 3).iter().zip(&heights) {
        assert_eq!(pixel[..], colour(*z).map(|part| part as u8)[..3], "{z}");
    }
    assert!(place.path("p.pgw").is_file() && place.path("p.prj").is_file());
    for (how, other) in [("--nearest", 255.0), ("--exact", 0.0)] {
        place.write("two.txt", "0 black\n1000 white\n");
        place.ok(&[
            "color-relief",
            "synth:rough,size=40",
            "two.txt",
            "n.tif",
            how,
            "--overwrite",
            "-q",
        ]);
        assert!(
            band(&place, "n.tif", "2").iter().all(|byte| *byte == 0.0 || *byte == other),
            "{how}"
        );
    }
}

fn pixels(bytes: &[u8], channels: usize) -> Vec<Vec<u8>> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut out = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut out).unwrap();
    out.truncate(info.buffer_size());
    out.chunks(channels).map(<[u8]>::to_vec).collect()
}

#[test]
fn threads_and_memory_leave_no_trace() {
    let place = Place::new();
    place.write("c.txt", COLOURS);
    for name in ["o.tif", "o.png"] {
        let make = |more: &[&str]| {
            let asked = ["color-relief", "synth:salt,size=900", "c.txt", name, "--overwrite", "-q"];
            place.ok(&[&asked[..], more].concat());
            place.bytes(name)
        };
        assert!(
            make(&["--threads", "1"]) == make(&["--threads", "2", "--memory", "32M"]),
            "{name}"
        );
    }
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let place = Place::new();
    let dem = "synth:rough,size=60";
    place.write("c.txt", COLOURS).write("bad.txt", "0 red\n10 mauve\n").write("none.txt", "#\n");
    let fails = |names: &[&str], code: i32, words: &[&str]| {
        place.fails(&[&["color-relief"][..], names].concat(), code, words);
    };
    fails(&[dem, "o.tif"], 2, &["COLORS"]);
    fails(&[dem, "no.txt", "o.tif"], 65, &["no.txt"]);
    fails(&[dem, "bad.txt", "o.tif"], 65, &["bad.txt", "line 2", "mauve"]);
    fails(&[dem, "none.txt", "o.tif"], 65, &["none.txt", "the colour table is empty"]);
    fails(&[dem, "c.txt", "o.asc"], 2, &["does not support colours", "GTiff"]);
    fails(&[dem, "c.txt", "o.tif", "-f", "store"], 2, &["does not support colours"]);
    fails(&[dem, "c.txt", "o.png", "--co", "ENCODING=TERRARIUM"], 2, &["ENCODING"]);
    fails(&[dem, "c.txt", "c.txt", "-f", "GTiff"], 2, &["c.txt"]);
    fails(&[dem, "c.txt", "o.tif", "--nearest", "--exact"], 2, &["--exact"]);
    place.ok(&["color-relief", dem, "c.txt", "o.tif", "-q"]);
    fails(&[dem, "c.txt", "o.tif"], 2, &["exists"]);
}
