//! Requests for ranges of bytes, repeated when they fail for a while.

use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use ureq::http::Response;
use ureq::tls::{PemItem, RootCerts, TlsConfig, parse_pem};
use ureq::{Agent, Body};

use super::address::RemoteAddress;
use terrane_base::error::{Error, ErrorKind, Result};

/// How often a request is made that fails for a while, and the wait before the second time, which doubles.
const TRIES: u32 = 5;
const WAIT: Duration = Duration::from_millis(200);
/// Longest wait that a server may ask for.
const MAX_WAIT: Duration = Duration::from_secs(30);
const CONNECT: Duration = Duration::from_secs(15);
const ANSWER: Duration = Duration::from_secs(20);
/// Least bytes a second.
const SLOWEST: u64 = 1 << 16;
/// Most moves of a file to other addresses.
const MAX_MOVES: u32 = 10;
/// Bytes after whose arrival a request may fail as often again.
const PROGRESS: u64 = 1 << 18;
/// Connections that stay open to a host.
const CONNECTIONS: usize = 16;
/// File of certificates to trust, in place of those of Mozilla.
const CERTIFICATES: &str = "SSL_CERT_FILE";
/// Longest file: beyond, a length is not one.
const MAX_BYTES: u64 = 1 << 53;
/// What helps where a server is not up to it.
const DOWNLOAD: &str = "download the file (curl -LO URL) and pass the local copy";

/// What a server says of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RemoteState {
    pub(super) bytes: u64,
    /// Its entity tag, or else when it was last modified.
    pub(super) version: Option<String>,
}

impl RemoteState {
    /// The version, if files that have it have the same bytes: a weak tag is of files that mean the same.
    pub(super) fn strong_version(&self) -> Option<&str> {
        self.version.as_deref().filter(|tag| !tag.starts_with("W/"))
    }
}

/// An answer that has come, and the place of its first byte.
struct RangeAnswer {
    body: ureq::BodyReader<'static>,
    first: u64,
    state: RemoteState,
    /// Behind its last byte.
    end: u64,
    /// Whether ranges are supported.
    is_range: bool,
}

/// Why a request has failed.
enum RequestFailure {
    /// It may succeed if it is made again, after this time.
    ForAWhile(String, Option<Duration>),
    Final(Error),
}

/// Receives bytes in order, of which the first is at the offset.
pub(super) type Receive<'a> = dyn FnMut(u64, &[u8]) -> Result<()> + 'a;

/// Requests for one file.
#[derive(Debug)]
pub(super) struct RemoteRequests {
    pub(super) address: RemoteAddress,
}

impl RemoteRequests {
    /// Passes on the bytes from `first` to `end` of a file in a known state, or in any state; returns the state and whether
    /// the server supports ranges. One that does not sends all bytes before `end`.
    ///
    /// # Errors
    /// A file that is missing, locked away or in another state; failures that last; those of `receive`.
    pub(super) fn get(
        &self,
        path: &Path,
        first: u64,
        end: u64,
        known: Option<&RemoteState>,
        receive: &mut Receive<'_>,
    ) -> Result<(RemoteState, bool)> {
        let (mut at, mut tries, mut state) = (first, 0, known.cloned());
        let mut arrived = 0;
        loop {
            let failure = match self.ask(path, at, end, state.as_ref()) {
                Ok(answer) => {
                    let (is_range, found) = (answer.is_range, answer.state.clone());
                    let end = end.min(found.bytes);
                    state = Some(found.clone());
                    match pass_on(answer, &mut at, end, &mut arrived, receive)? {
                        None if at < end => continue,
                        None => return Ok((found, is_range)),
                        Some(failure) => failure,
                    }
                }
                Err(failure) => failure,
            };
            let (what, wait) = match failure {
                RequestFailure::Final(error) => return Err(error),
                RequestFailure::ForAWhile(what, wait) => (what, wait),
            };
            if arrived >= PROGRESS {
                (tries, arrived) = (0, 0);
            }
            tries += 1;
            if tries == TRIES {
                return Err(Error::new(ErrorKind::Io, format!("cannot read: {what}"))
                    .at(format_args!("bytes {at} to {end}, asked for {TRIES} times"))
                    .in_file(path)
                    .remedy("check the connection and the server, and run again"));
            }
            std::thread::sleep(wait.unwrap_or(WAIT * 2_u32.pow(tries - 1)).min(MAX_WAIT));
        }
    }

    fn ask(
        &self,
        path: &Path,
        at: u64,
        end: u64,
        known: Option<&RemoteState>,
    ) -> std::result::Result<RangeAnswer, RequestFailure> {
        let agent = agent().map_err(|what| {
            let error = Error::bad_input(what).in_file(path);
            RequestFailure::Final(error.remedy(format!("correct {CERTIFICATES}")))
        })?;
        let last = end.max(at + 1) - 1;
        let time = ANSWER + Duration::from_secs((last - at) / SLOWEST);
        let (mut url, mut authorization) = (self.address.url.clone(), self.address.headers());
        for _ in 0..MAX_MOVES {
            let request = agent.get(&url).header("range", format!("bytes={at}-{last}"));
            // Ranges are those of what is sent.
            let request = request.header("accept-encoding", "identity");
            let mut request = request.config().timeout_recv_body(Some(time)).build();
            // Not for the servers that the first one names.
            for (name, value) in std::mem::take(&mut authorization) {
                request = request.header(name, value);
            }
            let answer = request.call().map_err(|error| of_transport(path, &error))?;
            match answer.status().as_u16() {
                206 | 200 => return answered(path, answer, at, known),
                status @ (301..=303 | 307 | 308) => match location(&url, &answer) {
                    Some(next) => url = next,
                    None => return Err(of_status(path, status, &answer)),
                },
                status => return Err(of_status(path, status, &answer)),
            }
        }
        let error = Error::bad_input("the servers name each other without end").in_file(path);
        Err(RequestFailure::Final(error.remedy("check the address")))
    }
}

/// The address that a file has moved to.
fn location(from: &str, answer: &Response<Body>) -> Option<String> {
    let to = answer.headers().get("location")?.to_str().ok()?.trim();
    let (scheme, rest) = from.split_once("://")?;
    let place = rest.split(['?', '#']).next()?;
    let (host, path) = place.split_at(place.find('/').unwrap_or(place.len()));
    let folder = &path[..path.rfind('/').map_or(0, |at| at + 1)];
    let of_scheme = to.split(['/', '?', '#']).next().is_some_and(|start| start.ends_with(':'));
    if of_scheme && scheme == "https" && !to.starts_with("https:") {
        return None;
    }
    Some(match to {
        _ if of_scheme => to.to_owned(),
        _ if to.starts_with('?') => format!("{scheme}://{place}{to}"),
        _ if to.starts_with("//") => format!("{scheme}:{to}"),
        _ if to.starts_with('/') => format!("{scheme}://{host}{to}"),
        _ => format!("{scheme}://{host}{folder}{to}"),
    })
}

/// An answer with bytes, checked against what is known.
fn answered(
    path: &Path,
    answer: Response<Body>,
    at: u64,
    known: Option<&RemoteState>,
) -> std::result::Result<RangeAnswer, RequestFailure> {
    let is_range = answer.status().as_u16() == 206;
    let header = |name: &str| answer.headers().get(name)?.to_str().ok();
    if let Some(coding) = header("content-encoding").filter(|coding| *coding != "identity") {
        let error = Error::unsupported(format!("the server compresses what it sends ({coding})"));
        let remedy = "download the file, unpacked, and pass the local copy";
        return Err(RequestFailure::Final(error.in_file(path).remedy(remedy)));
    }
    let (first, end, bytes) = match is_range {
        true => {
            let range =
                header("content-range").and_then(content_range).filter(|(first, ..)| *first == at);
            range.ok_or_else(|| {
                let found = header("content-range").unwrap_or("none");
                let what = format!(
                    "the server answers with another range ({found}) than asked for ({at})"
                );
                let error = Error::bad_input(what).in_file(path);
                RequestFailure::Final(error.remedy(DOWNLOAD))
            })?
        }
        false => {
            let length =
                answer.body().content_length().or_else(|| header("content-length")?.parse().ok());
            let length = length.or(known.map(|known| known.bytes));
            let length = length.ok_or_else(|| no_ranges(path, "does not state its length"))?;
            (0, length, length)
        }
    };
    let version = header("etag").or_else(|| header("last-modified")).map(str::to_owned);
    let state = RemoteState { bytes, version };
    if let Some(known) = known.filter(|known| **known != state) {
        let what = match known.bytes == state.bytes {
            true => "changed on the server while it was read".to_owned(),
            false => format!(
                "changed on the server while it was read: from {} to {} bytes",
                known.bytes, state.bytes
            ),
        };
        let error = Error::new(ErrorKind::Io, what).in_file(path);
        return Err(RequestFailure::Final(error.remedy("run again when it does not change")));
    }
    if bytes > MAX_BYTES {
        let error = Error::bad_input(format!("the server states {bytes} bytes")).in_file(path);
        return Err(RequestFailure::Final(error.remedy(DOWNLOAD)));
    }
    Ok(RangeAnswer { body: answer.into_body().into_reader(), first, state, end, is_range })
}

/// Passes on what comes from the byte `at` on, until `end` or the end of the answer; returns a failure if it ends before.
fn pass_on(
    mut answer: RangeAnswer,
    at: &mut u64,
    end: u64,
    arrived: &mut u64,
    receive: &mut Receive<'_>,
) -> Result<Option<RequestFailure>> {
    let (mut place, mut buffer) = (answer.first, vec![0; 1 << 16]);
    let is_whole = end >= answer.end;
    let end = end.min(answer.end);
    while place < end {
        let most = (buffer.len() as u64).min(end - place) as usize;
        let count = match answer.body.read(&mut buffer[..most]) {
            Ok(0) => {
                let what = format!("the answer ends at byte {place} of {end}");
                return Ok(Some(RequestFailure::ForAWhile(what, None)));
            }
            Ok(count) => count,
            Err(error) => return Ok(Some(RequestFailure::ForAWhile(error.to_string(), None))),
        };
        // Of a server without ranges, what has come before comes again.
        let skipped = at.saturating_sub(place).min(count as u64) as usize;
        place += count as u64;
        if skipped < count {
            receive(*at, &buffer[skipped..count])?;
            *arrived += (count - skipped) as u64;
            *at = place;
        }
    }
    if is_whole {
        // Read to its end, an answer gives its connection back.
        let _ = answer.body.read(&mut buffer[..1]);
    }
    Ok(None)
}

/// First byte, end, and length of the file in "bytes 0-99/1234".
fn content_range(text: &str) -> Option<(u64, u64, u64)> {
    let (range, length) = text.trim().strip_prefix("bytes")?.trim().split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let (first, last): (u64, u64) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    let length = length.trim().parse().ok()?;
    (first <= last && last < length).then_some((first, last + 1, length))
}

fn no_ranges(path: &Path, what: &str) -> RequestFailure {
    let what = format!("the server supports no ranges of bytes and {what}");
    let error = Error::unsupported(what).in_file(path);
    RequestFailure::Final(error.remedy(DOWNLOAD))
}

/// The failure of a status that is not one of bytes.
fn of_status(path: &Path, status: u16, answer: &Response<Body>) -> RequestFailure {
    let said = format!("the server answers with status {status}");
    let header = |name: &str| answer.headers().get(name)?.to_str().ok();
    let error = match status {
        404 | 410 => Error::not_found("no such file").in_file(path).remedy("check the address"),
        401 | 403 => Error::new(ErrorKind::Io, format!("access is denied ({said})"))
            .in_file(path)
            .remedy("check the address and the credentials (AWS_ACCESS_KEY_ID, a signed address)"),
        416 => Error::bad_input(format!("is empty or became shorter ({said})"))
            .in_file(path)
            .remedy("check the address"),
        301 if let Some(region) = header("x-amz-bucket-region") => {
            Error::bad_input(format!("the bucket is in another region ({region})"))
                .in_file(path)
                .remedy(format!("set AWS_REGION={region}"))
        }
        408 | 425 | 429 | 500..=599 => {
            let wait = header("retry-after").and_then(|text| text.trim().parse().ok());
            return RequestFailure::ForAWhile(said, wait.map(Duration::from_secs));
        }
        _ => Error::bad_input(said).in_file(path).remedy("check the address"),
    };
    RequestFailure::Final(error)
}

/// The failure of a request without an answer.
fn of_transport(path: &Path, error: &ureq::Error) -> RequestFailure {
    let what = error.to_string();
    if what.contains("certificate") {
        let error = Error::new(ErrorKind::Io, format!("cannot read: {what}")).in_file(path);
        let remedy = format!("name a file of certificates to trust by {CERTIFICATES}");
        return RequestFailure::Final(error.remedy(remedy));
    }
    let is_final = matches!(
        error,
        ureq::Error::BadUri(_)
            | ureq::Error::Http(_)
            | ureq::Error::HostNotFound
            | ureq::Error::InvalidProxyUrl
            | ureq::Error::Tls(_)
            | ureq::Error::Rustls(_)
    );
    match is_final {
        true => RequestFailure::Final(
            Error::new(ErrorKind::Io, format!("cannot read: {what}"))
                .in_file(path)
                .remedy("check the address and the connection"),
        ),
        false => RequestFailure::ForAWhile(what, None),
    }
}

/// The connections of all requests.
fn agent() -> std::result::Result<&'static Agent, String> {
    static AGENT: OnceLock<std::result::Result<Agent, String>> = OnceLock::new();
    let agent = AGENT.get_or_init(|| {
        let mut config = Agent::config_builder()
            .http_status_as_error(false)
            // Those of object stores may lack the place, and name a region.
            .max_redirects(0)
            .timeout_connect(Some(CONNECT))
            .timeout_recv_response(Some(ANSWER))
            .max_idle_connections(CONNECTIONS)
            .max_idle_connections_per_host(CONNECTIONS)
            .user_agent(concat!("terrane/", env!("CARGO_PKG_VERSION")));
        if let Some(file) = std::env::var_os(CERTIFICATES).filter(|file| !file.is_empty()) {
            let file = Path::new(&file);
            let text =
                std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
            let certificates = parse_pem(&text).filter_map(|item| match item {
                Ok(PemItem::Certificate(certificate)) => Some(certificate),
                _ => None,
            });
            let certificates: Vec<_> = certificates.collect();
            if certificates.is_empty() {
                return Err(format!("{} holds no certificate", file.display()));
            }
            let roots = RootCerts::new_with_certs(&certificates);
            config = config.tls_config(TlsConfig::builder().root_certs(roots).build());
        }
        Ok(config.build().into())
    });
    agent.as_ref().map_err(Clone::clone)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_move_to_addresses_near_and_far() {
        let moved = |from: &str, to: &str| {
            let answer = Response::builder().header("location", to);
            location(from, &answer.body(Body::builder().data(Vec::new())).unwrap()).unwrap()
        };
        for (from, to, expected) in [
            ("https://h:1/a/b?x=/y", "c", "https://h:1/a/c"),
            ("https://h:1/a/b", "/c?z=1", "https://h:1/c?z=1"),
            ("https://h/a", "//g/c", "https://g/c"),
            ("http://h", "https://g/c", "https://g/c"),
            ("http://h/a/b?x", "?y=http://z", "http://h/a/b?y=http://z"),
            ("http://h/a/b?x", "/c?y=http://z", "http://h/c?y=http://z"),
        ] {
            assert_eq!(moved(from, to), expected);
        }
    }

    #[test]
    fn ranges_are_checked() {
        for (text, expected) in [
            ("bytes 0-99/1234", Some((0, 100, 1234))),
            ("bytes 5-5/6", Some((5, 6, 6))),
            ("bytes 5-6/6", None),
            ("bytes 9-5/60", None),
            ("bytes 0-99/*", None),
            ("bytes */60", None),
            ("0-99/1234", None),
            ("bytes 0-99/99999999999999999999999", None),
            ("", None),
        ] {
            assert_eq!(content_range(text), expected, "{text}");
        }
    }
}
