//! Several files as one input of the real binary.

use crate::cli_support::Place;

/// A grid of 40 x 30 samples of one hill, cut into four files that butt, and whole.
fn place() -> Place {
    let place = Place::new();
    let height = |col: i32, row: i32| 100 - (col - 20).pow(2) / 4 - (row - 15).pow(2) / 3;
    let cut = |name: &str, cols: std::ops::Range<i32>, rows: std::ops::Range<i32>| {
        let mut text = format!(
            "ncols {}\nnrows {}\nxllcorner {}\nyllcorner {}\ncellsize 10\n",
            cols.len(),
            rows.len(),
            cols.start * 10,
            -rows.end * 10
        );
        for row in rows {
            let line: Vec<String> = cols.clone().map(|col| height(col, row).to_string()).collect();
            text += &(line.join(" ") + "\n");
        }
        place.write(name, text);
    };
    std::fs::create_dir(place.path("d")).unwrap();
    cut("d/a.asc", 0..25, 0..10);
    cut("d/b.asc", 25..40, 0..10);
    cut("d/c.asc", 0..25, 10..30);
    cut("d/d.asc", 25..40, 10..30);
    cut("whole.asc", 0..40, 0..30);
    place
}

const ALL: [&str; 4] = ["d/a.asc", "d/b.asc", "d/c.asc", "d/d.asc"];

/// The body of a PLY: everything behind its comments.
fn body(place: &Place, name: &str) -> Vec<u8> {
    let bytes = std::fs::read(place.path(name)).unwrap();
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).unwrap();
    bytes[at..].to_vec()
}

#[test]
fn a_mesh_of_many_files_is_that_of_the_whole() {
    let place = place();
    place.ok(&["tin", "whole.asc", "whole.ply", "--max-error", "1"]);
    let inputs = [&ALL[..], &["d"], &["d/*.asc"]];
    for (i, input) in inputs.iter().enumerate() {
        let mesh = format!("m{i}.ply");
        let goal = [mesh.as_str(), "--max-error", "1", "--verify"];
        place.ok(&[&["tin"], *input, &goal[..]].concat());
        assert_eq!(body(&place, &mesh), body(&place, "whole.ply"), "{input:?}");
        place.ok(&[&["verify", "whole.ply"], *input].concat());
    }
    let told = place.ok(&[&["info", "--mosaic", "--stats", "--json"], &ALL[..]].concat()).out;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!((&told["width"], &told["height"]), (&40.into(), &30.into()));
    assert_eq!(told["stats"]["valid"], 1200);
    assert_eq!(told["file"], "d/a.asc and 3 more");
    assert_eq!(place.ok(&[&["info", "--json"], &ALL[..]].concat()).out.lines().count(), 4);
    place.ok(&[&["convert"], &ALL[..], &["s.tif"]].concat());
    place.ok(&["verify", "whole.ply", "s.tif"]);
    place.ok(&[&["view"], &ALL[..], &["-o", "v.png", "--width", "100"]].concat());
}

#[test]
fn an_output_is_no_input() {
    let place = place();
    place.ok(&["convert", "whole.asc", "d/e.tif"]);
    place.fails(&["convert", "d", "d/e.tif", "--overwrite"], 2, &["d/e.tif", "also an input"]);
    place.fails(
        &["convert", "d/a.asc", "d/e.tif", "d/./e.tif", "--overwrite"],
        2,
        &["also an input"],
    );
    place.fails(
        &["tin", "d/a.asc", "--max-error", "1"],
        2,
        &["output file missing", "the input, then the output"],
    );
    place.fails(&["tin", "d", "whole.ply", "d/x.ply", "--max-error", "1"], 65, &["whole.ply"]);
}

#[test]
fn a_vrt_may_be_trusted_with_other_folders() {
    let place = place();
    let source = "<SimpleSource><SourceFilename relativeToVRT=\"1\">../whole.asc</SourceFilename>\
                  <SourceBand>1</SourceBand></SimpleSource>";
    let vrt = format!(
        "<VRTDataset rasterXSize=\"40\" rasterYSize=\"30\"><VRTRasterBand dataType=\"Int16\">\
         {source}</VRTRasterBand></VRTDataset>"
    );
    place.write("d/m.vrt", vrt);
    place.fails(&["info", "d/m.vrt"], 65, &["TERRANE_VRT_ALLOW_OUTSIDE=1"]);
    let mut trusted = place.command(&["info", "d/m.vrt", "--stats"]);
    let output = trusted.env("TERRANE_VRT_ALLOW_OUTSIDE", "1").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && text.contains("1,200, 100.00 %"), "{text}");
}
