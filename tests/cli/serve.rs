//! `terrane view --serve`: what is sent and what is not, clients that mean no good, and its end.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::cli_support::{Place, json};

/// A server of a folder of tests, while it lasts.
struct Served {
    child: Child,
    port: u16,
    told: serde_json::Value,
}

impl Served {
    fn new(place: &Place, args: &[&str]) -> Self {
        let args = [&["view"], args, &["--serve", "--json"]].concat();
        let mut command = place.command(&args);
        std::fs::create_dir_all(place.path("temp")).unwrap();
        command.env("TMPDIR", place.path("temp")).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let (mut text, mut byte) = (String::new(), [0]);
        let out = child.stdout.as_mut().unwrap();
        while !text.ends_with("\n}\n") {
            assert_eq!(out.read(&mut byte).unwrap(), 1, "{args:?}: {text}");
            text.push(char::from(byte[0]));
        }
        let told = json(&text);
        Self { child, port: told["port"].as_u64().unwrap() as u16, told }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Sends what may be no request at all; the head and the body that come back.
    fn raw(&self, request: &[u8]) -> (String, Vec<u8>) {
        let mut stream = self.connect();
        stream.write_all(request).unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        parts(&all)
    }

    fn ask(&self, method: &str, target: &str) -> (String, Vec<u8>) {
        let port = self.port;
        let head = format!(
            "{method} {target} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
        );
        self.raw(head.as_bytes())
    }

    fn status(&self, method: &str, target: &str) -> u16 {
        status(&self.ask(method, target).0)
    }

    fn stop(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        assert!(std::process::Command::new("kill").arg(&id).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn parts(all: &[u8]) -> (String, Vec<u8>) {
    let end = all.windows(4).position(|four| four == b"\r\n\r\n").map_or(all.len(), |at| at + 4);
    (String::from_utf8(all[..end].to_vec()).unwrap(), all[end..].to_vec())
}

fn status(head: &str) -> u16 {
    head.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_else(|| panic!("{head:?}"))
}

/// Tiles of both formats, in the folders `set` and `three`.
fn tiles() -> Place {
    let place = crate::tiles::place(100);
    place.ok(&["tiles", "dem.asc", "set", "-q"]);
    place.ok(&["tiles", "dem.asc", "three", "-q", "--format", "3dtiles"]);
    place
}

#[test]
fn the_page_and_the_tiles_are_sent() {
    let place = tiles();
    let served = Served::new(&place, &["set"]);
    assert_eq!(served.told["url"], format!("http://127.0.0.1:{}/", served.port));
    assert_eq!(
        (&served.told["page"], &served.told["output"]),
        (&"tiles".into(), &served.told["url"])
    );
    let (head, page) = served.ask("GET", "/");
    let page = String::from_utf8(page).unwrap();
    assert!(
        head.starts_with("HTTP/1.1 200 ") && head.contains("Content-Type: text/html"),
        "{head}"
    );
    assert!(page.contains("connect-src 'self';") && page.contains("<title>set</title>"));
    for word in ["http:", "https:", "src=", "href="] {
        assert!(!page.contains(word), "{word}");
    }
    let files = crate::tiles::walk(&place, "set");
    assert!(files.len() > 10);
    for name in &files {
        let (head, body) = served.ask("GET", &format!("/{name}?v=1.0.0"));
        assert_eq!(body, place.bytes(&format!("set/{name}")), "{name}");
        assert!(head.contains(&format!("Content-Length: {}\r\n", body.len())), "{head}");
        let is_tile = name.ends_with(".terrain");
        assert_eq!(head.contains("Content-Encoding: gzip\r\n"), is_tile, "{name}: {head}");
        let kind = if is_tile { "application/vnd.quantized-mesh" } else { "application/json" };
        assert!(head.contains(&format!("Content-Type: {kind}\r\n")), "{head}");
        assert!(head.contains("default-src 'none'") && head.contains("nosniff"), "{head}");
        assert!(head.contains("Cross-Origin-Resource-Policy: same-origin"), "{head}");
        assert!(!head.to_lowercase().contains("access-control"), "{head}");
    }
    let (asked, body) = served.ask("HEAD", "/layer.json");
    let (got, whole) = served.ask("GET", "/layer.json");
    assert!(body.is_empty() && asked == got && !whole.is_empty());
    // What the client has need not be sent again.
    let tag = got.split("ETag: ").nth(1).unwrap().lines().next().unwrap();
    let again = format!(
        "GET /layer.json HTTP/1.1\r\nHost: LOCALHOST:{}\r\nIf-None-Match: {tag}\r\nConnection: close\r\n\r\n",
        served.port
    );
    let (head, body) = served.raw(again.as_bytes());
    assert!(status(&head) == 304 && body.is_empty(), "{head}");
    assert_eq!(served.status("GET", "/favicon.ico"), 204);
}

#[test]
fn tiles_of_3d_tiles_are_sent_too() {
    let place = tiles();
    let served = Served::new(&place, &["three"]);
    let count = |set: &Served| (set.told["tiles"].clone(), set.told["levels"].clone());
    assert_eq!(count(&served), count(&Served::new(&place, &["set"])));
    for name in crate::tiles::walk(&place, "three") {
        let (head, body) = served.ask("GET", &format!("/{name}"));
        assert_eq!(body, place.bytes(&format!("three/{name}")), "{name}");
        let kind = match name.rsplit_once('.').unwrap().1 {
            "glb" => "model/gltf-binary",
            "json" => "application/json",
            _ => "application/octet-stream",
        };
        assert!(head.contains(&format!("Content-Type: {kind}\r\n")), "{head}");
        assert_eq!(head.contains("Content-Encoding: gzip"), !name.ends_with("json"), "{head}");
    }
}

#[test]
fn nothing_outside_the_folder_is_sent() {
    let place = tiles();
    place.write("secret.json", "{}").write("set/mine.txt", "mine").write("set/.hidden.json", "{}");
    std::fs::create_dir(place.path("set/folder.json")).unwrap();
    #[cfg(unix)]
    {
        let link = |to: &str, from: &str| std::os::unix::fs::symlink(to, place.path(from)).unwrap();
        link("../secret.json", "set/link.json");
        link("..", "set/up");
        link("layer.json", "set/inside.json");
        let made = std::process::Command::new("mkfifo").arg(place.path("set/pipe.json")).status();
        assert!(made.unwrap().success());
    }
    let served = Served::new(&place, &["set"]);
    let whole = place.path("secret.json").display().to_string();
    for target in [
        "/../secret.json",
        "/%2e%2e/secret.json",
        "/.%2e/secret.json",
        "/..%2fsecret.json",
        "/..%2Fsecret.json",
        "/%2e%2e%2fsecret.json",
        "/..%5csecret.json",
        "/..\\secret.json",
        "/0/../../secret.json",
        "/0/%2e%2e/%2e%2e/secret.json",
        "/%252e%252e/secret.json",
        "/./layer.json",
        "//layer.json",
        &whole,
        &format!("/{whole}"),
        "/link.json",
        "/up/secret.json",
        "/up/set/layer.json",
        "/pipe.json",
        "/mine.txt",
        "/.hidden.json",
        "/folder.json",
        "/0",
        "/layer.json/",
        "/layer.json%00.terrain",
        "/LAYER.JSON",
        "/page.html",
    ] {
        assert_eq!(served.status("GET", target), 404, "{target}");
    }
    assert_eq!(served.status("GET", "/inside.json"), 200, "a link that stays inside");
    for target in ["secret.json", "http://127.0.0.1/layer.json", "*", "/%zz", "/a b"] {
        assert_eq!(served.status("GET", target), 400, "{target}");
    }
    assert_eq!(served.status("GET", &format!("/{}", "a".repeat(2000))), 414);
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "get"] {
        let (head, _) = served.ask(method, "/layer.json");
        assert!(status(&head) == 405 && head.contains("Allow: GET, HEAD\r\n"), "{method}: {head}");
    }
    let port = served.port;
    for (host, code) in [
        ("Host: evil.example".to_owned(), 421),
        (format!("Host: evil.example:{port}"), 421),
        ("Host: 127.0.0.1".to_owned(), 421),
        (format!("Host: 127.0.0.1:{}", port ^ 1), 421),
        ("Accept: */*".to_owned(), 400),
        (format!("Host: 127.0.0.1:{port}\r\nHost: evil.example"), 400),
        (format!("Host: 127.0.0.1:{port}\r\nContent-Length: 4"), 413),
        (format!("Host: 127.0.0.1:{port}\r\nTransfer-Encoding: chunked"), 413),
        (format!("Host: 127.0.0.1:{port}\r\nX: {}", "y".repeat(9000)), 431),
    ] {
        let (head, _) = served.raw(format!("GET / HTTP/1.1\r\n{host}\r\n\r\n").as_bytes());
        assert_eq!(status(&head), code, "{host:.60}");
    }
    for odd in [
        &b"\x16\x03\x01\x02\x00\r\n\r\n"[..],
        b"GET /\r\n\r\n",
        b"\r\n\r\n",
        b"GET / HTTP/1.1\r\nHo",
    ] {
        let mut stream = served.connect();
        stream.write_all(odd).unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        assert_eq!(status(&parts(&all).0), 400, "{odd:?}");
    }
    assert_eq!(served.status("GET", "/"), 200, "and it goes on");
    // It listens on that one address.
    assert!(TcpStream::connect(("127.0.0.2", port)).is_err());
    assert!(TcpStream::connect(("::1", port)).is_err());
}

#[test]
fn clients_that_wait_keep_nobody_out() {
    let place = tiles();
    let served = Served::new(&place, &["set"]);
    // One connection, many requests, two of them at once.
    let mut stream = served.connect();
    let port = served.port;
    let ask = format!("HEAD /layer.json HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
    stream.write_all(ask.repeat(40).as_bytes()).unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    let mut all = String::new();
    stream.read_to_string(&mut all).unwrap();
    assert_eq!(all.matches("HTTP/1.1 200 OK").count(), 40);
    // More clients than there may be that send half of a request, or read no answer.
    let started = Instant::now();
    let slow: Vec<TcpStream> = (0..200)
        .map(|i| {
            let mut stream = served.connect();
            let half = format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n");
            let _ = stream.write_all(&half.as_bytes()[..half.len() - i % 20]);
            if i % 3 == 0 {
                let _ = stream.write_all(format!("\r\n{ask}").repeat(2).as_bytes());
            }
            stream
        })
        .collect();
    for _ in 0..20 {
        assert_eq!(served.status("GET", "/layer.json"), 200);
    }
    // The first of them are cut off by now.
    for mut stream in &slow[..100] {
        stream.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
        let mut rest = Vec::new();
        if let Err(e) = stream.read_to_end(&mut rest) {
            assert_eq!(e.kind(), std::io::ErrorKind::ConnectionReset);
        }
    }
    assert!(started.elapsed() < Duration::from_secs(8), "{:?}", started.elapsed());
    // The last of them had their time.
    for mut stream in slow {
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
    }
    assert!(started.elapsed() < Duration::from_secs(18), "{:?}", started.elapsed());
    // Many that are quick.
    std::thread::scope(|scope| {
        let ask = || (0..25).all(|_| served.status("GET", "/0/0/0.terrain") == 200);
        let all: Vec<_> = (0..16).map(|_| scope.spawn(ask)).collect();
        assert!(all.into_iter().all(|one| one.join().unwrap()));
    });
}

#[test]
#[cfg(unix)]
fn it_ends_at_once_when_it_is_told_to_and_leaves_nothing() {
    let place = tiles();
    let served = Served::new(&place, &["set"]);
    let waiting = served.connect();
    assert_eq!(std::fs::read_dir(place.path("temp")).unwrap().count(), 1, "the page");
    let started = Instant::now();
    assert_eq!(served.stop(), Some(0));
    assert!(started.elapsed() < Duration::from_secs(3), "{:?}", started.elapsed());
    assert_eq!(std::fs::read_dir(place.path("temp")).unwrap().count(), 0);
    drop(waiting);
}

#[test]
fn other_inputs_are_served_as_the_page_that_they_are() {
    let place = Place::new();
    place.ok(&["synth", "rough,size=65,seed=5", "dem.tif"]);
    place.ok(&["tin", "dem.tif", "mesh.ply", "--max-error", "5"]);
    place.ok(&["synth", "coverage,vertices=200,features=6", "areas.fgb"]);
    for args in [
        &["dem.tif"][..],
        &["mesh.ply", "--against", "dem.tif", "--edges"],
        &["areas.fgb"],
        &["dem.tif", "--insertion"],
    ] {
        place.ok(&[&["view"], args, &["--html", "page.html", "--overwrite"]].concat());
        let served = Served::new(&place, args);
        assert_eq!(served.ask("GET", "/").1, place.bytes("page.html"), "{args:?}");
        assert_eq!(served.status("GET", "/dem.tif"), 404, "no folder is served");
        assert_eq!(served.status("GET", "/layer.json"), 404);
    }
}

#[test]
fn what_cannot_be_served_is_refused_by_name() {
    let place = tiles();
    place.fails(&["view", "set", "-o", "a.png"], 2, &["set", "--serve"]);
    place.fails(&["view", "set", "--html", "a.html"], 2, &["set", "--serve"]);
    for option in
        [&["--insertion"][..], &["--bounds", "0,0,1,1"], &["--band", "1"], &["--layer", "a"]]
    {
        place.fails(&[&["view", "set", "--serve"], option].concat(), 2, &[option[0], "tiles"]);
    }
    place.fails(&["view", "gone", "--serve"], 65, &["gone"]);
    let served = Served::new(&place, &["set"]);
    let port = served.port.to_string();
    place.fails(&["view", "set", "--serve", "--port", &port], 74, &[&port, "--port"]);
    for args in [
        &["view", "set", "--port", "8000"][..],
        &["view", "synth:rough,size=40", "-o", "a.png", "--port", "8000"],
        &["view", "synth:rough,size=40", "--html", "a.html", "--port", "8000"],
        &["view", "set", "--serve", "--port", "0"],
        &["view", "set", "--serve", "-o", "a.png"],
        &["view", "set", "--serve", "--html", "a.html"],
        &["view", "set", "--serve", "--width", "100"],
    ] {
        assert_eq!(place.run(args).code, 2, "{args:?}");
    }
    let text = String::from_utf8(place.bytes("set/layer.json")).unwrap();
    place.write("set/layer.json", text.replace("quantized-mesh-1.0", "heightmap-1.0"));
    place.fails(&["view", "set", "--serve"], 65, &["heightmap-1.0", "quantized-mesh"]);
}
