//! Pages of clouds and pictures from above: what they hold, what is refused, and the same bytes whatever the threads.

use crate::cli_support::{Place, json};

/// A cloud in two halves, as LAZ and as text.
fn place() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,width=60,height=60,seed=4", "all.laz"]);
    place.ok(&["points", "all.laz", "west.las", "--bounds", "0,0,500029.99,9000000"]);
    place.ok(&["points", "all.laz", "east.copc.laz", "--bounds", "500030,0,9000000,9000000"]);
    place.ok(&["points", "all.laz", "all.csv"]);
    place
}

fn view(place: &Place, inputs: &[&str], page: &str, more: &[&str]) -> serde_json::Value {
    let args = [&["view"], inputs, &["--html", page, "--json", "--overwrite"], more].concat();
    json(&place.ok(&args).out)
}

/// The packed array of a name.
fn array<'a>(page: &'a str, name: &str) -> &'a str {
    let block = page.split(&format!("<script id=\"array-{name}\"")).nth(1).unwrap();
    block.split_once('>').unwrap().1.split("</script>").next().unwrap()
}

#[test]
fn a_page_of_a_cloud_is_the_same_whatever_threads_files_and_format() {
    let place = place();
    for more in [&[][..], &["--points", "5000"]] {
        let first = view(&place, &["all.laz"], "a.html", &[more, &["--threads", "1"]].concat());
        let bytes = place.bytes("a.html");
        let again = view(&place, &["all.laz"], "a.html", &[more, &["--threads", "3"]].concat());
        assert_eq!(bytes, place.bytes("a.html"), "{more:?}: the same bytes");
        assert_eq!((&first["points"], &first["rounding"]), (&again["points"], &0.0.into()));
        let text = String::from_utf8(bytes).unwrap();
        for word in ["http:", "https:", "src=", "href="] {
            assert!(!text.contains(word), "{word}");
        }
        let two = view(&place, &["west.las", "east.copc.laz"], "b.html", more);
        assert_eq!(two["points"], first["points"]);
        let other = String::from_utf8(place.bytes("b.html")).unwrap();
        for name in ["x", "y", "z", "marks", "intensity"] {
            assert_eq!(array(&text, name), array(&other, name), "{more:?}: {name}");
        }
    }
}

#[test]
fn what_is_not_shown_is_told() {
    let place = place();
    let all = view(&place, &["all.laz"], "a.html", &[]);
    let (kept, shown) = (all["census"]["kept"].as_u64().unwrap(), all["points"].as_u64().unwrap());
    assert_eq!(kept, shown);
    let few = view(&place, &["all.laz"], "b.html", &["--points", "1000"]);
    assert_eq!((&few["points"], &few["census"]), (&1000.into(), &all["census"]));
    let text = String::from_utf8(place.bytes("b.html")).unwrap();
    assert!(text.contains(&format!("1000 of {kept} points are shown")));
    let told = place.ok(&["view", "all.laz", "--html", "c.html", "--points", "1000"]).out;
    assert!(told.contains("1,000 of") && told.contains("chosen evenly"), "{told}");
    let ground = view(&place, &["all.laz"], "d.html", &["--class", "2", "--return", "last"]);
    assert!(ground["points"].as_u64().unwrap() < shown);
    let text = String::from_utf8(place.bytes("d.html")).unwrap();
    assert!(text.contains("\"name\":\"ground\"") && !text.contains("high vegetation"));
    let lines = view(&place, &["cloud:all.csv"], "e.html", &[]);
    assert_eq!(lines["census"]["read"], all["census"]["read"]);
    assert!(!String::from_utf8(place.bytes("e.html")).unwrap().contains("array-colour"));
}

#[test]
fn nothing_that_is_read_becomes_a_picture_or_a_page() {
    let place = Place::new();
    let text = "0 0 1\n0 4 2\n5 1 3\n5 5 4\n";
    for name in ["c.png", "c.html", "c.xyz"] {
        place.write(name, text);
    }
    for picture in ["c.png", "./c.png"] {
        let args = ["info", "cloud:c.png", "--picture", picture, "--overwrite"];
        place.fails(&args, 2, &["c.png"]);
    }
    place.fails(&["view", "cloud:c.html", "--html", "c.html", "--overwrite"], 2, &["c.html"]);
    assert_eq!(place.bytes("c.png"), text.as_bytes());
    assert_eq!(place.bytes("c.html"), text.as_bytes());
    // Who reads a page has no options.
    place.ok(&["view", "cloud:c.xyz", "--html", "page.html"]);
    let page = String::from_utf8(place.bytes("page.html")).unwrap();
    assert!(page.contains("CRS is missing") && !page.contains('‹'), "{page}");
}

#[test]
fn what_a_page_of_a_cloud_cannot_do_is_refused() {
    let place = place();
    place.ok(&["synth", "rough,size=33", "dem.tif"]);
    let cases: [(&[&str], &[&str]); 11] = [
        (&["all.laz", "-o", "a.png"], &["all.laz", "--html"]),
        (&["all.laz", "--html", "a.html", "--band", "2"], &["--band"]),
        (&["all.laz", "--html", "a.html", "--edges"], &["--edges", "clouds"]),
        (&["all.laz", "--html", "a.html", "--azimuth", "3"], &["--azimuth", "clouds"]),
        (&["all.laz", "--html", "a.html", "--layer", "x"], &["--layer", "clouds"]),
        (&["all.laz", "--html", "a.html", "--insertion"], &["--insertion", "clouds"]),
        (&["all.laz", "--html", "a.html", "--points", "0"], &["--points"]),
        (&["all.laz", "--html", "a.html", "--points", "16777217"], &["--points"]),
        (&["all.laz", "dem.tif", "--html", "a.html"], &["cannot be mixed"]),
        (&["dem.tif", "--html", "a.html", "--points", "9"], &["--points", "clouds"]),
        (&["dem.tif", "--html", "a.html", "--class", "2"], &["--class", "clouds"]),
    ];
    for (args, told) in cases {
        place.fails(&[&["view"], args].concat(), 2, told);
    }
    let page = ["view", "all.laz", "--html", "a.html"];
    let with = |more: &[&'static str]| [&page[..], more].concat();
    place.fails(&with(&["--class", "77"]), 65, &["all.laz", "no point"]);
    place.fails(&with(&["--bounds", "0,0,1,1"]), 65, &["no point"]);
    place.fails(&with(&["--memory", "20M"]), 75, &["--memory", "--points"]);
    place.fails(&["view", "gone.laz", "--html", "a.html"], 65, &["gone.laz"]);
    assert!(!place.path("a.html").exists());
}

#[test]
fn statistics_have_a_histogram_of_heights() {
    let place = place();
    let told = json(&place.ok(&["info", "all.laz", "--stats", "--json"]).out);
    let (stats, heights) = (&told["stats"], &told["stats"]["heights"]);
    let bars = heights["histogram"].as_array().unwrap();
    let sum: u64 = bars.iter().map(|bar| bar["points"].as_u64().unwrap()).sum();
    assert_eq!(sum, stats["kept"].as_u64().unwrap());
    let [low, high] = [0, 1].map(|end| stats["bounds"][end][2].as_f64().unwrap());
    assert!(bars[0]["low"].as_f64().unwrap() <= low);
    assert!(bars[bars.len() - 1]["high"].as_f64().unwrap() > high);
    assert!((low..high).contains(&heights["mean"].as_f64().unwrap()));
    for threads in ["1", "3"] {
        let again = place.ok(&[
            "info",
            "west.las",
            "east.copc.laz",
            "--mosaic",
            "--stats",
            "--json",
            "--threads",
            threads,
        ]);
        assert_eq!(
            &json(&again.out)["stats"]["heights"],
            heights,
            "of parts, in {threads} threads"
        );
    }
    let text = place.ok(&["info", "all.laz", "--stats"]).out;
    assert!(text.contains("mean height") && text.contains("########"), "{text}");
}

#[test]
fn pictures_from_above_are_the_same_whatever_the_threads_and_files() {
    let place = place();
    for what in ["density", "voids", "height", "class"] {
        let draw = |inputs: &[&str], threads: &str| {
            let args = [
                "--picture",
                "a.png",
                "--picture-of",
                what,
                "--cell",
                "1",
                "--overwrite",
                "--json",
            ];
            let all = [&["info"], inputs, &args, &["--mosaic", "--threads", threads]].concat();
            let told = json(&place.ok(&all).out);
            (place.bytes("a.png"), told["picture"].clone())
        };
        let (first, told) = draw(&["all.laz"], "1");
        let picture = png(&first);
        assert_eq!(
            (&told["columns"], &told["rows"], &told["cell"]),
            (&60.into(), &60.into(), &1.0.into())
        );
        assert!(picture.0 >= 480 && picture.1 > 600, "{picture:?}");
        assert!(first == draw(&["all.laz"], "3").0, "{what}: the same bytes");
        assert!(first == draw(&["west.las", "east.copc.laz"], "2").0, "{what}: of two files");
    }
}

/// Columns and rows of a PNG.
fn png(bytes: &[u8]) -> (u32, u32) {
    let word = |at: usize| u32::from_be_bytes(std::array::from_fn(|i| bytes[at + i]));
    (word(16), word(20))
}

#[test]
fn counts_and_voids_are_those_of_the_points() {
    let place = Place::new();
    // A square of 5 x 5 points, one to a cell, without two of them inside and one at a corner.
    let is_there = |(x, y): (u32, u32)| ![(1, 1), (1, 2), (4, 4)].contains(&(x, y));
    let points = (0..25).map(|i| (i % 5, i / 5)).filter(|place| is_there(*place));
    let lines: String = points.map(|(x, y)| format!("{}.5,{}.5,{}.25\n", x, y, x + y)).collect();
    place.write("points.csv", format!("x,y,z\n{lines}0.75,0.75,9.00\n"));
    let draw = |more: &[&str]| {
        let args = ["info", "cloud:points.csv", "--picture", "a.png", "--overwrite", "--json"];
        json(&place.ok(&[&args[..], more].concat()).out)["picture"].clone()
    };
    let told = draw(&["--cell", "1"]);
    assert_eq!(
        (&told["points"], &told["filled"], &told["densest"]),
        (&23.into(), &22.into(), &2.0.into())
    );
    assert_eq!(told["bounds"], serde_json::json!([0.0, 0.0, 5.0, 5.0]));
    let voids = &told["voids"];
    assert_eq!((&voids["cells"], &voids["largest_area"]), (&2.into(), &2.0.into()));
    assert_eq!(voids["largest_bounds"], serde_json::json!([1.0, 1.0, 2.0, 3.0]));
    assert!(draw(&[])["cell"].as_f64().unwrap() > 1.0, "some points to a cell");
    let fails = |more: &[&str], code, told: &[&str]| {
        let args = ["info", "cloud:points.csv", "--picture", "b.png"];
        place.fails(&[&args[..], more].concat(), code, told);
    };
    fails(&["--cell", "0.001"], 2, &["below the coordinate scale"]);
    fails(&["--cell", "0.01", "--memory", "16M"], 75, &["--memory", "--cell"]);
    fails(&["--class", "9"], 65, &["no point"]);
    fails(&["--picture-of", "colour"], 2, &["density"]);
    place.fails(&["info", "cloud:points.csv", "--picture", "a.png"], 2, &["a.png"]);
    place.fails(&["info", "cloud:points.csv", "--picture", "a.txt"], 2, &[".png"]);
    place.fails(&["info", "cloud:points.csv", "--cell", "1"], 2, &["--picture"]);
    place.ok(&["synth", "rough,size=33", "dem.tif"]);
    place.fails(&["info", "dem.tif", "--picture", "b.png"], 2, &["dem.tif", "--picture"]);
    place.fails(&["info", "dem.tif", "cloud:points.csv", "--picture", "b.png"], 2, &["--mosaic"]);
    assert!(!place.path("b.png").exists());
}
