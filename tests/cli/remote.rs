//! Files of servers: the same bytes as of files on disk, few requests, and servers that misbehave.

use crate::cli_support::Place;
use crate::file_server::{FileServer, Request};

/// Bytes asked for at opening.
const HEAD: u64 = 1 << 16;

/// A place with a grid of many blocks, a point cloud and polygons, and a server of its files.
fn served() -> (Place, FileServer) {
    let place = Place::new();
    place.ok(&["synth", "rough,size=1100", "plain.tif", "-q"]);
    place.ok(&["convert", "plain.tif", "g.tif", "-f", "cog", "--co", "BLOCKSIZE=128", "-q"]);
    place.ok(&["synth", "cloud,size=150,density=4", "c.laz", "-q"]);
    place.ok(&["points", "c.laz", "c.las", "-q"]);
    place.ok(&["points", "c.laz", "c.copc.laz", "-q"]);
    place.ok(&["synth", "coverage,size=40", "p.geojson", "-q"]);
    place.ok(&["simplify", "p.geojson", "p.fgb", "--tolerance", "0", "-q"]);
    let server = FileServer::new(&place.path(""));
    (place, server)
}

fn sent(requests: &[Request]) -> u64 {
    requests.iter().map(|request| request.sent).sum()
}

fn size(place: &Place, file: &str) -> u64 {
    std::fs::metadata(place.path(file)).unwrap().len()
}

#[test]
fn files_of_servers_are_read_as_those_on_disk() {
    let (place, server) = served();
    for (file, ending, args) in [
        ("g.tif", "ply", &["tin", "--max-error", "3"][..]),
        ("g.tif", "tif", &["convert"]),
        ("plain.tif", "tif", &["hillshade"]),
        ("g.tif", "wkt", &["contour", "--interval", "20"]),
        ("c.laz", "tif", &["grid", "--cell", "1", "--stat", "mean:attribute=intensity"]),
        ("c.las", "tif", &["grid", "--cell", "1", "--dtm"]),
        ("c.copc.laz", "las", &["points", "--bounds", "500020,4750020,500060,4750090"]),
        ("c.laz", "ply", &["tin", "--max-error", "0.2"]),
        ("p.fgb", "geojson", &["simplify", "--tolerance", "1"]),
        ("p.geojson", "fgb", &["simplify", "--tolerance", "1"]),
    ] {
        let run = |input: &str, output: &str| {
            let all = [&[args[0], input, output, "-q"][..], &args[1..]].concat();
            place.ok(&all);
            let bytes = std::fs::read(place.path(output)).unwrap();
            std::fs::remove_file(place.path(output)).unwrap();
            bytes
        };
        let output = format!("made.{ending}");
        let expected = run(file, &output);
        server.requests();
        assert!(run(&server.url("plain", file), &output) == expected, "{args:?} {file}");
        // Each byte once, but for the pages of the ends.
        let (asked, bytes) = (sent(&server.requests()), size(&place, file));
        assert!(asked <= bytes + bytes / 20 + HEAD, "{args:?} {file}: {asked} of {bytes}");
        assert!(run(&server.url("plain", file), &output) == expected, "{args:?} {file}");
        let again = server.requests();
        assert!(again.len() == 1 && sent(&again) <= HEAD, "{args:?} {file}: {again:?}");
    }
}

#[test]
fn mosaics_and_lists_may_lie_on_servers() {
    let (place, server) = served();
    place.ok(&["convert", "g.tif", "west.tif", "--bbox", "499995,4739005,504995,4750005", "-q"]);
    let west = ["info", "west.tif", "--json"];
    let told = place.ok(&west).out;
    place.write("list.txt", format!("{}\n", server.url("plain", "west.tif")));
    let found = place.ok(&["info", "@list.txt", "--json"]).out;
    let width = |text: &str| crate::cli_support::json(text)["width"].clone();
    assert_eq!(width(&told), width(&found));
    for name in ["a.ply", "a.3mf", "a.obj"] {
        place.ok(&["tin", "g.tif", name, "--max-error", "4", "-q"]);
        place.ok(&["verify", &server.url("plain", name), "g.tif", "--max-error", "4", "-q"]);
    }
    let vrt = r#"<VRTDataset rasterXSize="1100" rasterYSize="1100"><VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename relativeToVRT="1">g.tif</SourceFilename><SourceBand>1</SourceBand><SrcRect xOff="0" yOff="0" xSize="1100" ySize="1100"/><DstRect xOff="0" yOff="0" xSize="1100" ySize="1100"/></SimpleSource></VRTRasterBand></VRTDataset>"#;
    place.write("v.vrt", vrt);
    place.ok(&["tin", "v.vrt", "v.ply", "--max-error", "4", "-q"]);
    place.ok(&["tin", &server.url("plain", "v.vrt"), "w.ply", "--max-error", "4", "-q"]);
    assert!(place.bytes("v.ply") == place.bytes("w.ply"));
    // A local one may name a server only if its user says so.
    let far = vrt.replace("g.tif", &format!("/vsicurl/{}", server.url("plain", "g.tif")));
    // Meshes hold the name of their source.
    std::fs::create_dir(place.path("far")).unwrap();
    place.write("far/v.vrt", far);
    place.fails(
        &["tin", "far/v.vrt", "x.ply", "--max-error", "4"],
        65,
        &["outside the folder of the VRT"],
    );
    let args = ["tin", "far/v.vrt", "x.ply", "--max-error", "4", "-q"];
    let ran = place.command(&args).env("TERRANE_VRT_ALLOW_OUTSIDE", "1").output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(place.bytes("x.ply") == place.bytes("v.ply"));
}

#[test]
fn connections_are_used_again() {
    let (place, server) = served();
    server.connections();
    place.ok(&[
        "tin",
        &server.url("plain", "g.tif"),
        "o.ply",
        "--max-error",
        "4",
        "--threads",
        "1",
    ]);
    let requests = server.requests().len() as u64;
    assert!(server.connections() < requests.max(2), "{requests}");
}

#[test]
fn rows_of_blocks_are_asked_for_together() {
    let (place, server) = served();
    place.ok(&["convert", "g.tif", "g.asc", "-q"]);
    place.write("N46E007.hgt", vec![1; 2 * 1201 * 1201]);
    for file in ["plain.tif", "g.asc", "N46E007.hgt"] {
        server.requests();
        place.ok(&["convert", &server.url("plain", file), "o.tif", "-q", "--overwrite"]);
        let (requests, bytes) = (server.requests(), size(&place, file));
        assert!(requests.len() <= 10, "{file}: {}", requests.len());
        assert!(sent(&requests) <= bytes + HEAD + bytes / 20, "{file}");
    }
    // A narrow part of wide rows.
    server.requests();
    let bounds = "499996,4739006,500494,4750004";
    let args = ["convert", &server.url("plain", "plain.tif"), "w.tif", "--bbox", bounds, "-q"];
    place.ok(&args);
    let asked = sent(&server.requests());
    assert!(asked < size(&place, "plain.tif") / 2 + HEAD, "{asked}");
}

#[test]
fn files_without_versions_are_asked_for_by_each_run() {
    let (place, server) = served();
    place.ok(&["synth", "rough,size=1100,seed=9", "other.tif", "-q"]);
    for way in ["untagged", "weak"] {
        place.ok(&["synth", "rough,size=1100", "v.tif", "-q", "--overwrite"]);
        let url = server.url(way, "v.tif");
        place.ok(&["info", &url, "--stats", "--json"]);
        assert_eq!(size(&place, "v.tif"), size(&place, "other.tif"));
        place.write("v.tif", place.bytes("other.tif"));
        let stats = |input: &str| {
            let told = place.ok(&["info", input, "--stats", "--json"]).out;
            crate::cli_support::json(&told)["stats"].clone()
        };
        assert_eq!(stats(&url), stats("other.tif"), "{way}");
        place.fails(
            &["plan", "tin", &url, "-o", "work", "--max-error", "2"],
            65,
            &["no strong ETag or Last-Modified"],
        );
    }
}

#[test]
fn addresses_are_texts() {
    let (place, server) = served();
    std::fs::create_dir_all(place.path("a")).unwrap();
    place.ok(&["synth", "rough,size=90", "a/x.tif", "-q"]);
    // The server takes both for one file, and counts its requests by their text.
    let [one, other] = ["a/x.tif", "a//x.tif"].map(|file| server.url("plain", file));
    place.run(&["info", &one, &other]);
    let paths: std::collections::BTreeSet<_> =
        server.requests().into_iter().map(|request| request.path).collect();
    assert_eq!(paths.len(), 2, "{paths:?}");
}

#[test]
fn a_server_that_fails_is_no_bad_file() {
    let (place, server) = served();
    std::fs::create_dir(place.path("cache")).unwrap();
    let [good, down] = [server.url("plain", "g.tif"), server.url("down", "g.tif")];
    place.fails(&["convert", &good, &down, "o.tif", "--skip-bad"], 74, &["status 500", &down]);
    let denied = server.url("denied", "c.laz");
    place.fails(&["points", "c.las", &denied, "o.las", "--skip-bad"], 74, &["access denied"]);
    place.fails(&["points", &denied, "o.las", "--salvage"], 74, &["access denied"]);
    // All threads are told of the first failure.
    server.requests();
    let gone = server.url("gone", "g.tif");
    place.fails(
        &["tin", &gone, "o.ply", "--max-error", "1", "--threads", "8"],
        65,
        &["no such file"],
    );
    assert!(server.requests().len() <= 9);
}

#[test]
fn signatures_of_addresses_are_not_written() {
    let (place, server) = served();
    let [grid, cloud] = ["g.tif", "c.laz"].map(|file| server.url("plain", file) + "?sig=secret");
    place.ok(&["tin", &grid, "a.ply", "--max-error", "4", "-q"]);
    place.ok(&["tin", "g.tif", "b.ply", "--max-error", "4", "-q"]);
    assert!(place.bytes("a.ply") == place.bytes("b.ply"));
    place.ok(&["grid", &cloud, "c.tif", "--cell", "1", "-q"]);
    assert!(!String::from_utf8_lossy(&place.bytes("c.tif")).contains("secret"));
}

#[test]
fn only_the_blocks_of_a_window_are_asked_for() {
    let (place, server) = served();
    let url = server.url("plain", "g.tif");
    // Three by three blocks, where the grid has 81.
    let bounds = "501276,4744886,505114,4748724";
    let args = ["convert", &url, "w.tif", "--bbox", bounds, "-q"];
    place.ok(&args);
    let (requests, bytes) = (server.requests(), size(&place, "g.tif"));
    let share = sent(&requests) as f64 - HEAD as f64;
    assert!(share <= 1.1 * bytes as f64 * 9.0 / 81.0, "{share} of {bytes}");
    assert!(requests.len() <= 8, "{}", requests.len());
}

#[test]
fn servers_may_fail_for_a_while() {
    let (place, server) = served();
    let expected =
        ["g.tif", "c.laz"].map(|file| place.ok(&["info", file, "--stats", "--json"]).out);
    for way in ["busy", "short", "closes", "moved", "slow", "whole", "untagged", "capped"] {
        for (file, expected) in ["g.tif", "c.laz"].iter().zip(&expected) {
            let url = server.url(way, file);
            let told = place.ok(&["info", &url, "--stats", "--json"]).out;
            let same = |text: &str| text.replace(&url, file).replace("http:", "");
            let plain = |text: &str| crate::cli_support::json(&same(text))["stats"].clone();
            assert_eq!(plain(&told), plain(expected), "{way} {file}");
        }
    }
}

#[test]
fn what_a_server_does_wrong_is_an_error_with_the_address() {
    let (place, server) = served();
    std::fs::create_dir(place.path("cache")).unwrap();
    for (way, code, told) in [
        ("denied", 74, "access denied (HTTP status 403)"),
        ("down", 74, "HTTP status 500"),
        ("region", 74, "set AWS_REGION=eu-north-1"),
        ("gone", 65, "no such file"),
        ("changes", 74, "changed on the server while it was read"),
        ("grows", 74, "changed on the server while it was read"),
        ("lies", 65, ""),
        ("shifted", 74, "unexpected Content-Range"),
        ("chunked", 74, "supports no range requests"),
        ("packed", 74, "Content-Encoding: gzip"),
    ] {
        let url = server.url(way, "g.tif");
        place.fails(&["tin", &url, "o.ply", "--max-error", "1"], code, &[told, &url]);
    }
    let url = server.url("plain", "none.tif");
    place.fails(&["tin", &url, "o.ply", "--max-error", "1"], 65, &["no such file", &url]);
    place.write("empty.tif", "");
    let url = server.url("plain", "empty.tif");
    place.fails(&["tin", &url, "o.ply", "--max-error", "1"], 74, &[&url]);
    let closed = "http://127.0.0.1:1/a.tif";
    place.fails(&["info", closed], 74, &["cannot read", closed, "5 attempts"]);
    place.fails(&["info", "s3://bucket"], 2, &["s3://BUCKET/KEY"]);
}

#[test]
fn plans_of_remote_files_know_their_versions() {
    let (place, server) = served();
    place.ok(&["tin", "g.tif", "whole.ply", "--max-error", "2", "-q"]);
    let url = server.url("plain", "g.tif");
    place.ok(&["plan", "tin", &url, "-o", "work", "--max-error", "2", "--tile", "256", "-q"]);
    server.requests();
    place.ok(&["run", "work", "-o", "made.ply", "-q"]);
    assert!(sent(&server.requests()) <= size(&place, "g.tif") + HEAD);
    place.ok(&["verify", "made.ply", "g.tif", "-q"]);
    let other = [&place.bytes("g.tif")[..], b"more"].concat();
    place.write("g.tif", other);
    std::fs::remove_dir_all(place.path("work/objects")).unwrap();
    place.fails(&["run", "work"], 65, &["changed since the plan was made: on the server", &url]);
}

#[test]
fn objects_are_asked_for_with_signatures_and_tokens() {
    let (place, server) = served();
    let end = format!("http://127.0.0.1:{}", server.port);
    let run = |input: &str, set: &[(&str, &str)]| {
        let mut command = place.command(&["info", input]);
        command.env("AWS_ENDPOINT_URL", &end).envs(set.iter().copied());
        assert!(command.output().unwrap().status.success(), "{input}");
        server.requests()
    };
    let has = |requests: &[Request], name: &str| {
        requests.iter().all(|request| request.headers.iter().any(|line| line.starts_with(name)))
    };
    let keys =
        [("AWS_ACCESS_KEY_ID", "me"), ("AWS_SECRET_ACCESS_KEY", "s"), ("AWS_SESSION_TOKEN", "t")];
    let signed = run("s3://plain/g.tif", &keys);
    assert!(has(&signed, "authorization: aws4-hmac-sha256 credential=me/"), "{signed:?}");
    assert!(has(&signed, "x-amz-security-token: t"));
    let open = run("s3://plain/g.tif", &[&keys[..], &[("AWS_NO_SIGN_REQUEST", "YES")]].concat());
    assert!(!open.is_empty() && !has(&open, "authorization"));
}

#[test]
fn the_folder_of_pages_keeps_its_size() {
    let (place, server) = served();
    std::fs::create_dir(place.path("cache")).unwrap();
    let limited = |size: &str, args: &[&str]| {
        place.command(args).env("TERRANE_CACHE_SIZE", size).output().unwrap()
    };
    for name in ["one.tif", "two.tif"] {
        place.ok(&["synth", "rough,size=3200", name, "-q"]);
        let args = ["convert", &server.url("plain", name), "o.tif", "-q", "--overwrite"];
        assert!(limited("64M", &args).status.success());
        place.ok(&["convert", name, "expected.tif", "-q", "--overwrite"]);
        assert!(place.bytes("o.tif") == place.bytes("expected.tif"));
    }
    let blocks = |entry: std::fs::DirEntry| {
        std::os::unix::fs::MetadataExt::blocks(&entry.metadata().unwrap()) * 512
    };
    let taken: u64 = std::fs::read_dir(place.path("cache")).unwrap().flatten().map(blocks).sum();
    assert!(taken <= 80 << 20, "{taken}");
    for (size, told) in [("many", "not a size"), ("1M", "less than 64 MiB")] {
        let ran = limited(size, &["info", &server.url("plain", "c.laz")]);
        let error = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert!(!ran.status.success() && error.contains(told), "{error}");
    }
}
