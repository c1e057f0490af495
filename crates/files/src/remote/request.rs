//! Range requests, tried again after transient failures.

use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use ureq::http::Response;
use ureq::tls::{PemItem, RootCerts, TlsConfig, parse_pem};
use ureq::{Agent, Body};

use super::address::RemoteUrl;
use terrane_base::error::{Error, ErrorKind, Result};

/// How often a request is tried, and the wait before the second attempt, which doubles.
const MAX_ATTEMPTS: u32 = 5;
const BACKOFF: Duration = Duration::from_millis(200);
/// Longest wait that a server may ask for by `Retry-After`.
const MAX_BACKOFF: Duration = Duration::from_secs(30);
const CONNECT_TIMEOUT: Duration = Duration::from_secs(15);
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(20);
/// Slower bodies time out.
const MIN_BYTES_PER_SECOND: u64 = 1 << 16;
const MAX_REDIRECTS: u32 = 10;
/// Bytes after whose arrival the attempts are counted anew.
const PROGRESS: u64 = 1 << 18;
/// Connections that stay open to a host.
const MAX_IDLE_CONNECTIONS: usize = 16;
/// Variable with the name of a PEM file of CA certificates, in place of those of Mozilla.
const CA_FILE: &str = "SSL_CERT_FILE";
/// Largest length that is believed.
const MAX_BYTES: u64 = 1 << 53;
/// Remedy for servers that cannot be read by ranges.
pub(super) const DOWNLOAD: &str = "download the file (curl -LO URL) and pass the local copy";

/// Length and version of a file, as the server states them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ObjectVersion {
    pub(super) bytes: u64,
    /// The ETag, or else Last-Modified.
    pub(super) version: Option<String>,
}

impl ObjectVersion {
    /// The version, unless it is a weak ETag, which files with different bytes may share.
    pub(super) fn strong_tag(&self) -> Option<&str> {
        self.version.as_deref().filter(|tag| !tag.starts_with("W/"))
    }
}

/// A response with bytes of the file.
struct RangeResponse {
    body: ureq::BodyReader<'static>,
    /// Offset of its first byte.
    first: u64,
    state: ObjectVersion,
    /// Offset after its last byte.
    end: u64,
    /// Whether ranges are supported.
    is_range: bool,
}

/// Why a request has failed.
enum RequestError {
    /// It may succeed if it is tried again, after this time.
    Transient(String, Option<Duration>),
    Permanent(Error),
}

impl RequestError {
    /// A failure of the server or the connection.
    fn of_server(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Permanent(Error::new(ErrorKind::Io, what).remedy(remedy))
    }
}

/// Takes bytes in order, with the offset of the first.
pub(super) type Receive<'a> = dyn FnMut(u64, &[u8]) -> Result<()> + 'a;

/// Requests for one file.
#[derive(Debug)]
pub(super) struct RemoteRequests {
    pub(super) address: RemoteUrl,
}

impl RemoteRequests {
    /// Passes on the bytes from `first` to `end` of a file in a known state, or in any state; returns the state and whether
    /// the server supports ranges. One that does not sends all bytes before `end`.
    ///
    /// # Errors
    /// A file that is missing, not accessible or has changed; transient failures that go on; those of `receive`.
    pub(super) fn get(
        &self,
        first: u64,
        end: u64,
        known: Option<&ObjectVersion>,
        receive: &mut Receive<'_>,
    ) -> Result<(ObjectVersion, bool)> {
        let (mut at, mut tries, mut state) = (first, 0, known.cloned());
        let mut arrived = 0;
        loop {
            let failure = match self.ask(at, end, state.as_ref()) {
                Ok(answer) => {
                    let (is_range, found) = (answer.is_range, answer.state.clone());
                    let end = end.min(found.bytes);
                    state = Some(found.clone());
                    match stream_body(answer, &mut at, end, &mut arrived, receive)? {
                        None if at < end => continue,
                        None => return Ok((found, is_range)),
                        Some(failure) => failure,
                    }
                }
                Err(failure) => failure,
            };
            let (what, wait) = match failure {
                RequestError::Permanent(error) => return Err(error),
                RequestError::Transient(what, wait) => (what, wait),
            };
            if arrived >= PROGRESS {
                (tries, arrived) = (0, 0);
            }
            tries += 1;
            if tries == MAX_ATTEMPTS {
                return Err(Error::new(ErrorKind::Io, format!("cannot read: {what}"))
                    .at(format_args!("bytes {at} to {end}, {MAX_ATTEMPTS} attempts"))
                    .remedy("check the connection and the server, and run again"));
            }
            std::thread::sleep(wait.unwrap_or(BACKOFF * 2_u32.pow(tries - 1)).min(MAX_BACKOFF));
        }
    }

    fn ask(
        &self,
        at: u64,
        end: u64,
        known: Option<&ObjectVersion>,
    ) -> std::result::Result<RangeResponse, RequestError> {
        let agent = agent().map_err(|what| {
            RequestError::Permanent(Error::usage(what).remedy(format!("correct {CA_FILE}")))
        })?;
        let last = end.max(at + 1) - 1;
        let time = RESPONSE_TIMEOUT + Duration::from_secs((last - at) / MIN_BYTES_PER_SECOND);
        let (mut url, mut authorization) = (self.address.url.clone(), self.address.headers());
        for _ in 0..MAX_REDIRECTS {
            let request = agent.get(&url).header("range", format!("bytes={at}-{last}"));
            // Ranges are those of what is sent.
            let request = request.header("accept-encoding", "identity");
            let mut request = request.config().timeout_recv_body(Some(time)).build();
            // Not for the targets of redirects.
            for (name, value) in std::mem::take(&mut authorization) {
                request = request.header(name, value);
            }
            let answer = request.call().map_err(|error| transport_error(&error))?;
            match answer.status().as_u16() {
                206 | 200 => return checked_response(answer, at, known),
                status @ (301..=303 | 307 | 308) => match redirect_target(&url, &answer) {
                    Some(next) => url = next,
                    None => return Err(status_error(&url, status, &answer)),
                },
                status => return Err(status_error(&url, status, &answer)),
            }
        }
        Err(RequestError::of_server(
            format!("more than {MAX_REDIRECTS} redirects"),
            "check the URL",
        ))
    }
}

/// The target of a redirect; `None` without one, and from https to http.
fn redirect_target(from: &str, answer: &Response<Body>) -> Option<String> {
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

/// A response with bytes, checked against what is known.
fn checked_response(
    answer: Response<Body>,
    at: u64,
    known: Option<&ObjectVersion>,
) -> std::result::Result<RangeResponse, RequestError> {
    let is_range = answer.status().as_u16() == 206;
    let header = |name: &str| answer.headers().get(name)?.to_str().ok();
    if let Some(coding) = header("content-encoding").filter(|coding| *coding != "identity") {
        return Err(RequestError::of_server(
            format!("the server ignores Accept-Encoding: identity (Content-Encoding: {coding})"),
            "download the file, unpacked, and pass the local copy",
        ));
    }
    let (first, end, bytes) = match is_range {
        true => {
            let range =
                header("content-range").and_then(content_range).filter(|(first, ..)| *first == at);
            range.ok_or_else(|| {
                let found = header("content-range").unwrap_or("none");
                let what = format!("unexpected Content-Range ({found}), requested bytes from {at}");
                RequestError::of_server(what, DOWNLOAD)
            })?
        }
        false => {
            let length =
                answer.body().content_length().or_else(|| header("content-length")?.parse().ok());
            let length = length.or(known.map(|known| known.bytes));
            let length = length.ok_or_else(|| {
                let what = "the server supports no range requests and sends no Content-Length";
                RequestError::of_server(what, DOWNLOAD)
            })?;
            (0, length, length)
        }
    };
    let version = header("etag").or_else(|| header("last-modified")).map(str::to_owned);
    let state = ObjectVersion { bytes, version };
    if let Some(known) = known.filter(|known| **known != state) {
        let what = match known.bytes == state.bytes {
            true => "changed on the server while it was read".to_owned(),
            false => format!(
                "changed on the server while it was read: from {} to {} bytes",
                known.bytes, state.bytes
            ),
        };
        return Err(RequestError::of_server(what, "run again when it does not change"));
    }
    if bytes > MAX_BYTES {
        return Err(RequestError::of_server(format!("the server states {bytes} bytes"), DOWNLOAD));
    }
    Ok(RangeResponse { body: answer.into_body().into_reader(), first, state, end, is_range })
}

/// Passes on the bytes of a response from `at` on, up to `end` or the end of the response; returns a failure if it ends
/// before.
fn stream_body(
    mut answer: RangeResponse,
    at: &mut u64,
    end: u64,
    arrived: &mut u64,
    receive: &mut Receive<'_>,
) -> Result<Option<RequestError>> {
    let (mut place, mut buffer) = (answer.first, vec![0; 1 << 16]);
    let is_whole = end >= answer.end;
    let end = end.min(answer.end);
    while place < end {
        let most = (buffer.len() as u64).min(end - place) as usize;
        let count = match answer.body.read(&mut buffer[..most]) {
            Ok(0) => {
                let what = format!("the response ends at byte {place} of {end}");
                return Ok(Some(RequestError::Transient(what, None)));
            }
            Ok(count) => count,
            Err(error) => return Ok(Some(RequestError::Transient(error.to_string(), None))),
        };
        // A server without range requests begins at the first byte again.
        let skipped = at.saturating_sub(place).min(count as u64) as usize;
        place += count as u64;
        if skipped < count {
            receive(*at, &buffer[skipped..count])?;
            *arrived += (count - skipped) as u64;
            *at = place;
        }
    }
    if is_whole {
        // Only a body that is read to its end returns its connection.
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

/// The failure of a response by its status.
fn status_error(url: &str, status: u16, answer: &Response<Body>) -> RequestError {
    let said = format!("HTTP status {status}");
    let header = |name: &str| answer.headers().get(name)?.to_str().ok();
    match status {
        404 | 410 => {
            let error = Error::not_found(format!("no such file ({said})"));
            RequestError::Permanent(error.remedy("check the URL"))
        }
        401 | 403 => {
            let what = format!("access denied ({said})");
            RequestError::of_server(what, format!("check the URL and {}", credentials_of(url)))
        }
        301 if let Some(region) = header("x-amz-bucket-region") => {
            let what = format!("the bucket is in another region ({region})");
            RequestError::of_server(what, format!("set AWS_REGION={region}"))
        }
        408 | 425 | 429 | 500..=599 => {
            let wait = header("retry-after").and_then(|text| text.trim().parse().ok());
            RequestError::Transient(said, wait.map(Duration::from_secs))
        }
        416 => {
            RequestError::of_server(format!("is empty or became shorter ({said})"), "check the URL")
        }
        _ => RequestError::of_server(said, "check the URL and the credentials"),
    }
}

/// What access to a host depends on.
fn credentials_of(url: &str) -> &'static str {
    let host = url.split('/').nth(2).unwrap_or_default();
    match host {
        _ if host.ends_with(".amazonaws.com") => "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
        "storage.googleapis.com" => "GOOGLE_OAUTH_ACCESS_TOKEN",
        _ if host.ends_with(".blob.core.windows.net") => "AZURE_STORAGE_SAS_TOKEN",
        _ => "the credentials; presigned URLs expire",
    }
}

/// The failure of a request without a response.
fn transport_error(error: &ureq::Error) -> RequestError {
    let what = error.to_string();
    if what.contains("certificate") {
        let remedy = format!("set {CA_FILE} to a PEM file with the CA certificates");
        return RequestError::of_server(format!("cannot read: {what}"), remedy);
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
        true => {
            let what = format!("cannot read: {what}");
            RequestError::of_server(what, "check the URL and the connection")
        }
        false => RequestError::Transient(what, None),
    }
}

/// The connections of all requests.
fn agent() -> std::result::Result<&'static Agent, String> {
    static AGENT: OnceLock<std::result::Result<Agent, String>> = OnceLock::new();
    let agent = AGENT.get_or_init(|| {
        let mut config = Agent::config_builder()
            .http_status_as_error(false)
            // S3 redirects without Location, and names the region of the bucket.
            .max_redirects(0)
            .timeout_connect(Some(CONNECT_TIMEOUT))
            .timeout_recv_response(Some(RESPONSE_TIMEOUT))
            .max_idle_connections(MAX_IDLE_CONNECTIONS)
            .max_idle_connections_per_host(MAX_IDLE_CONNECTIONS)
            .user_agent(concat!("terrane/", env!("CARGO_PKG_VERSION")));
        if let Some(file) = std::env::var_os(CA_FILE).filter(|file| !file.is_empty()) {
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
            redirect_target(from, &answer.body(Body::builder().data(Vec::new())).unwrap()).unwrap()
        };
        for (from, to, expected) in [
            ("https://h:1/a/b?x=/y", "c", "https://h:1/a/c"),
            ("https://h:1/a/b", "/c?z=1", "https://h:1/c?z=1"),
            ("https://h/a", "//g/c", "https://g/c"),
            ("http://h", "https://g/c", "https://g/c"),
            ("http://h/a/b?x", "?y=http://z", "http://h/a/b?y=http://z"),
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
