//! A server of files on this machine that misbehaves as it is told.
#![allow(dead_code, unreachable_pub)]

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A request: its path, the range of bytes asked for, and its other headers in lower case.
#[derive(Clone, Debug)]
pub struct Request {
    pub path: String,
    pub range: Option<[u64; 2]>,
    pub headers: Vec<String>,
    /// Bytes of the answer.
    pub sent: u64,
}

/// Serves the files of a folder. The first part of a path is how: see [`answer`].
pub struct FileServer {
    pub port: u16,
    log: Arc<Mutex<Vec<Request>>>,
    connections: Arc<AtomicU64>,
}

impl FileServer {
    pub fn new(folder: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let log = Arc::new(Mutex::new(Vec::new()));
        let (folder, seen) = (folder.to_owned(), log.clone());
        let connections = Arc::new(AtomicU64::new(0));
        let count = connections.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                count.fetch_add(1, Ordering::Relaxed);
                let (folder, seen) = (folder.clone(), seen.clone());
                std::thread::spawn(move || {
                    let _ended_by_the_client = serve(stream, &folder, &seen);
                });
            }
        });
        Self { port, log, connections }
    }

    /// The address of a file that is served in a way.
    pub fn url(&self, way: &str, file: &str) -> String {
        format!("http://127.0.0.1:{}/{way}/{file}", self.port)
    }

    /// The connections since the last call.
    pub fn connections(&self) -> u64 {
        self.connections.swap(0, Ordering::Relaxed)
    }

    /// The requests since the last call.
    pub fn requests(&self) -> Vec<Request> {
        std::mem::take(&mut *self.log.lock().unwrap())
    }
}

fn serve(stream: TcpStream, folder: &Path, log: &Mutex<Vec<Request>>) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    loop {
        let mut lines = Vec::new();
        loop {
            let mut line = String::new();
            if reader.read_line(&mut line)? == 0 {
                return Ok(());
            }
            let line = line.trim_end().to_owned();
            if line.is_empty() {
                break;
            }
            lines.push(line);
        }
        let path = lines[0].split(' ').nth(1).unwrap_or("/").to_owned();
        let headers: Vec<String> = lines[1..].iter().map(|line| line.to_lowercase()).collect();
        let range = headers.iter().find_map(|line| line.strip_prefix("range: bytes="));
        let range = range.and_then(|range| range.split_once('-'));
        let range = range.map(|(first, last)| [first, last].map(|n| n.parse().unwrap()));
        let before = {
            let mut log = log.lock().unwrap();
            let before = log.iter().filter(|other| other.path == path).count();
            log.push(Request { path: path.clone(), range, headers, sent: 0 });
            before
        };
        let is_open = answer(&stream, folder, &path, range, before, &mut |bytes| {
            let mut log = log.lock().unwrap();
            log.iter_mut().rev().find(|other| other.path == path).unwrap().sent += bytes;
        })?;
        if !is_open {
            return Ok(());
        }
    }
}

/// Answers a request as its path says; `before` is the number of requests for it before. Returns whether the connection
/// stays open.
fn answer(
    mut stream: &TcpStream,
    folder: &Path,
    path: &str,
    range: Option<[u64; 2]>,
    before: usize,
    sent: &mut dyn FnMut(u64),
) -> std::io::Result<bool> {
    let path = path.split('?').next().unwrap_or_default();
    let (way, file) = path.trim_start_matches('/').split_once('/').unwrap_or(("", ""));
    let mut status = |status: &str, more: &str| {
        write!(stream, "HTTP/1.1 {status}\r\n{more}content-length: 0\r\n\r\n").map(|()| true)
    };
    let file: PathBuf = folder.join(file);
    let Ok(bytes) = std::fs::read(&file) else { return status("404 Not Found", "") };
    match way {
        "denied" => return status("403 Forbidden", ""),
        "busy" if before % 3 != 2 => {
            return status("503 Service Unavailable", "retry-after: 0\r\n");
        }
        "down" => return status("500 Internal Server Error", "retry-after: 0\r\n"),
        "moved" => {
            let name = file.file_name().unwrap().to_string_lossy();
            return status("302 Found", &format!("location: /plain/{name}\r\n"));
        }
        "region" => {
            let more = "x-amz-bucket-region: eu-north-1\r\n";
            return status("301 Moved Permanently", more);
        }
        "gone" if before > 0 => return status("404 Not Found", ""),
        "closes" if before.is_multiple_of(2) => return Ok(false),
        "slow" => std::thread::sleep(Duration::from_millis(30)),
        _ => {}
    }
    let length = bytes.len() as u64;
    if length == 0 {
        return status("416 Range Not Satisfiable", "");
    }
    let has_ranges = !matches!(way, "whole" | "chunked");
    let [first, last] = match range.filter(|_| has_ranges) {
        Some([first, last]) if way == "capped" => [first, last.min(first + 20_000).min(length - 1)],
        Some([first, last]) => [first, last.min(length - 1)],
        None => [0, length - 1],
    };
    if first >= length {
        return status("416 Range Not Satisfiable", "");
    }
    let stated = match way {
        "grows" => length + before as u64,
        "lies" => length / 2,
        _ => length,
    };
    let tag = match way {
        "changes" => format!("\"{before}\""),
        _ => format!("\"{length}\""),
    };
    let (status, place) = match range.filter(|_| has_ranges) {
        Some(_) => {
            let first = if way == "shifted" { first + 1 } else { first };
            ("206 Partial Content", format!("content-range: bytes {first}-{last}/{stated}\r\n"))
        }
        None => ("200 OK", String::new()),
    };
    let tag = match way {
        "untagged" => String::new(),
        "weak" => format!("etag: W/{tag}\r\n"),
        "packed" => format!("etag: {tag}\r\ncontent-encoding: gzip\r\n"),
        _ => format!("etag: {tag}\r\n"),
    };
    let body = &bytes[first as usize..=last as usize];
    let size = match way {
        "chunked" => "transfer-encoding: chunked\r\n".to_owned(),
        _ => format!("content-length: {}\r\n", body.len()),
    };
    write!(stream, "HTTP/1.1 {status}\r\n{place}{tag}{size}\r\n")?;
    if way == "chunked" {
        write!(stream, "{:x}\r\n", body.len())?;
    }
    // A third of the answer, and then no more.
    let body =
        if way == "short" && !before.is_multiple_of(3) { &body[..body.len() / 3] } else { body };
    sent(body.len() as u64);
    stream.write_all(body)?;
    if way == "chunked" {
        write!(stream, "\r\n0\r\n\r\n")?;
    }
    Ok(way != "short")
}
