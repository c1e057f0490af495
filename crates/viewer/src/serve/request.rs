//! A client's request: its head is parsed strictly, and irregular requests are refused.

/// Maximum bytes of a request up to the empty line. Browsers send less than one thousand.
pub(crate) const MAX_HEAD: usize = 8 << 10;
/// Maximum bytes of a request target.
const MAX_TARGET: usize = 1 << 10;

/// A valid request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HttpRequest {
    /// Method HEAD: the answer has no body.
    pub(crate) is_head: bool,
    /// The parts of the name, none for the page.
    pub(crate) name: Vec<String>,
    /// The client keeps the connection.
    pub(crate) stays: bool,
    /// Entity tag that the client has cached.
    pub(crate) has: Option<String>,
}

/// Why a request is refused: the status and a reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestRefusal {
    pub(crate) status: &'static str,
    pub(crate) reason: &'static str,
}

const fn refusal(status: &'static str, reason: &'static str) -> RequestRefusal {
    RequestRefusal { status, reason }
}

pub(crate) const BAD: RequestRefusal = refusal("400 Bad Request", "not an HTTP/1.1 request");
pub(crate) const TOO_LARGE: RequestRefusal =
    refusal("431 Request Header Fields Too Large", "the request header exceeds 8,192 bytes");
pub(crate) const NOT_FOUND: RequestRefusal =
    refusal("404 Not Found", "no such file in the served folder");
pub(crate) const NOT_ALLOWED: RequestRefusal =
    refusal("405 Method Not Allowed", "only GET and HEAD are supported");
const TOO_LONG: RequestRefusal = refusal("414 URI Too Long", "the file name exceeds 1,024 bytes");
const BODY: RequestRefusal = refusal("413 Content Too Large", "request bodies are not supported");
const NOT_HERE: RequestRefusal = refusal(
    "421 Misdirected Request",
    "the host must be 127.0.0.1 or localhost with the port of this server",
);
const VERSION: RequestRefusal =
    refusal("505 HTTP Version Not Supported", "only HTTP/1.1 is supported");

impl HttpRequest {
    /// Parses a head, without the empty line at its end; `port` is the server's.
    ///
    /// The requested host has to be this server: another site can resolve its own name to 127.0.0.1 (DNS rebinding), and
    /// its pages would then read the served files.
    pub(crate) fn read(head: &[u8], port: u16) -> Result<Self, RequestRefusal> {
        let text = std::str::from_utf8(head).map_err(|_| BAD)?;
        let mut lines = text.split("\r\n");
        let [method, target, version] = words(lines.next().unwrap_or_default()).ok_or(BAD)?;
        let is_latest = match version {
            "HTTP/1.1" => true,
            "HTTP/1.0" => false,
            _ if version.starts_with("HTTP/") => return Err(VERSION),
            _ => return Err(BAD),
        };
        let fields = lines.map(field).collect::<Option<Vec<_>>>().ok_or(BAD)?;
        let host: Vec<&str> = values(&fields, "host").collect();
        match host[..] {
            [host] if is_here(host, port) => {}
            [_] => return Err(NOT_HERE),
            _ => return Err(BAD),
        }
        // An unread body would be parsed as the next request.
        let has_body = values(&fields, "transfer-encoding").next().is_some()
            || values(&fields, "content-length").any(|length| length != "0");
        if has_body {
            return Err(BODY);
        }
        let is_head = match method {
            "GET" => false,
            "HEAD" => true,
            _ => return Err(NOT_ALLOWED),
        };
        let closes = values(&fields, "connection")
            .flat_map(|value| value.split(','))
            .any(|token| token.trim().eq_ignore_ascii_case("close"));
        Ok(Self {
            is_head,
            name: name(target)?,
            stays: is_latest && !closes,
            has: values(&fields, "if-none-match").next().map(str::to_owned),
        })
    }
}

/// Values of the header fields called `name`.
fn values<'a>(fields: &'a [(String, &str)], name: &str) -> impl Iterator<Item = &'a str> {
    fields.iter().filter(move |(key, _)| key == name).map(|(_, value)| *value)
}

/// Three words with one space between them.
fn words(line: &str) -> Option<[&str; 3]> {
    let words: Vec<&str> = line.split(' ').collect();
    words.try_into().ok().filter(|words: &[&str; 3]| words.iter().all(|word| !word.is_empty()))
}

/// A field's name in small letters, and its value.
fn field(line: &str) -> Option<(String, &str)> {
    let (name, value) = line.split_once(':')?;
    let is_sound = !name.is_empty() && name.chars().all(is_token);
    let has_control = value.chars().any(|c| c.is_control() && c != '\t');
    (is_sound && !has_control).then(|| (name.to_ascii_lowercase(), value.trim()))
}

/// True for a character that names of fields may have.
fn is_token(c: char) -> bool {
    c.is_ascii_alphanumeric() || "!#$%&'*+-.^_`|~".contains(c)
}

fn is_here(host: &str, port: u16) -> bool {
    // Browsers leave the default port of HTTP out.
    let (name, of) = host.rsplit_once(':').unwrap_or((host, "80"));
    (name == "127.0.0.1" || name.eq_ignore_ascii_case("localhost")) && of == port.to_string()
}

/// The parts of a name: letters, digits, `_`, `-`, and points except at the beginning, so that no name leads up,
/// elsewhere, or to hidden files. The query after `?` is ignored.
fn name(target: &str) -> Result<Vec<String>, RequestRefusal> {
    if target.len() > MAX_TARGET {
        return Err(TOO_LONG);
    }
    let path = target.split('?').next().unwrap_or_default();
    let path = path.strip_prefix('/').ok_or(BAD)?;
    if path.is_empty() {
        return Ok(Vec::new());
    }
    let parts = path.split('/').map(|part| decoded(part).ok_or(BAD));
    let parts = parts.collect::<Result<Vec<_>, _>>()?;
    match parts.iter().all(|part| is_plain(part)) {
        true => Ok(parts.iter().map(|part| String::from_utf8_lossy(part).into_owned()).collect()),
        false => Err(NOT_FOUND),
    }
}

/// True for a part of allowed characters that cannot lead up or to hidden files.
fn is_plain(part: &[u8]) -> bool {
    part.first().is_some_and(|first| *first != b'.')
        && part.iter().all(|c| c.is_ascii_alphanumeric() || b"._-".contains(c))
}

/// A part with `%41` as `A`, once.
fn decoded(part: &str) -> Option<Vec<u8>> {
    let mut pieces = part.split('%');
    let mut out = pieces.next().unwrap_or_default().as_bytes().to_vec();
    for piece in pieces {
        let digits = piece.get(..2).filter(|d| d.bytes().all(|c| c.is_ascii_hexdigit()))?;
        out.push(u8::from_str_radix(digits, 16).ok()?);
        out.extend(&piece.as_bytes()[2..]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(head: &str) -> Result<HttpRequest, RequestRefusal> {
        HttpRequest::read(head.as_bytes(), 8000)
    }

    fn at(target: &str) -> Result<Vec<String>, RequestRefusal> {
        parse(&format!("GET {target} HTTP/1.1\r\nHost: 127.0.0.1:8000")).map(|asked| asked.name)
    }

    #[test]
    fn names_are_plain_however_they_are_spelt() {
        assert_eq!(at("/"), Ok(vec![]));
        assert_eq!(at("/?a=b"), Ok(vec![]));
        assert_eq!(
            at("/7/1/%32.terrain?v=1.0.0"),
            Ok(["7", "1", "2.terrain"].map(str::to_owned).to_vec())
        );
        for spelt in [
            "/..",
            "/../a.json",
            "/%2e%2e/a.json",
            "/.%2E/a.json",
            "/a/../../b.json",
            "/a/..%2fb.json",
            "/..%5cb.json",
            "/..\\b.json",
            "//etc/a.json",
            "/a//b.json",
            "/a/",
            "/%2fetc/a.json",
            "/a%00.json",
            "/%252e%252e/a.json",
            "/.git/config",
            "/c:/a.json",
            "/a b",
            "/~/a.json",
            "/\u{e9}.json",
            "/%c3%a9.json",
        ] {
            let found = at(spelt);
            assert!(found == Err(NOT_FOUND) || found == Err(BAD), "{spelt}: {found:?}");
        }
        for odd in ["/%", "/%4", "/%zz.json", "/%+1.json", "a.json", "http://127.0.0.1:8000/", "*"]
        {
            assert_eq!(at(odd), Err(BAD), "{odd}");
        }
        assert_eq!(at(&format!("/{}.json", "a".repeat(MAX_TARGET))), Err(TOO_LONG));
    }

    #[test]
    fn requests_are_for_this_server() {
        let of = |host: &str| parse(&format!("GET / HTTP/1.1\r\n{host}")).map(|_| ());
        for here in
            ["Host: 127.0.0.1:8000", "host:LocalHost:8000", "X: y\r\nHost:  localhost:8000 "]
        {
            assert_eq!(of(here), Ok(()), "{here}");
        }
        for other in [
            "Host: evil.example:8000",
            "Host: 127.0.0.1",
            "Host: localhost:80",
            "Host: ",
            "Host: 127.0.0.1:8000.evil.example",
            "Host: x@127.0.0.1:8000",
            "Host: [::1]:8000",
        ] {
            assert_eq!(of(other), Err(NOT_HERE), "{other}");
        }
        // Browsers leave the port of the scheme out.
        assert!(is_here("127.0.0.1", 80) && is_here("localhost:80", 80) && !is_here("evil", 80));
        for odd in [
            "X: y",
            "Host: 127.0.0.1:8000\r\nHost: evil.example",
            "Host 127.0.0.1:8000",
            "Host: 127.0.0.1:8000\r\n folded: x",
            "Host : 127.0.0.1:8000",
            "",
        ] {
            assert_eq!(of(odd), Err(BAD), "{odd}");
        }
    }

    #[test]
    fn methods_versions_and_bodies_are_refused_by_name() {
        let here = "Host: 127.0.0.1:8000";
        let line = |line: &str| parse(&format!("{line}\r\n{here}"));
        assert!(
            !line("GET / HTTP/1.1").unwrap().is_head && line("HEAD / HTTP/1.1").unwrap().is_head
        );
        for method in ["POST", "PUT", "DELETE", "OPTIONS", "get", "TRACE", "CONNECT"] {
            assert_eq!(line(&format!("{method} / HTTP/1.1")), Err(NOT_ALLOWED), "{method}");
        }
        assert_eq!(line("GET / HTTP/2.0"), Err(VERSION));
        for odd in ["GET /", "GET  / HTTP/1.1", "GET / HTTP/1.1 ", "", "GET / FTP"] {
            assert_eq!(line(odd), Err(BAD), "{odd}");
        }
        for body in ["Content-Length: 5", "Transfer-Encoding: chunked", "Content-Length: 0, 5"] {
            assert_eq!(parse(&format!("GET / HTTP/1.1\r\n{here}\r\n{body}")), Err(BODY), "{body}");
        }
        assert!(line("GET / HTTP/1.1").unwrap().stays && !line("GET / HTTP/1.0").unwrap().stays);
        let close = parse(&format!("GET / HTTP/1.1\r\n{here}\r\nConnection: x, Close")).unwrap();
        assert!(!close.stays);
    }
}
