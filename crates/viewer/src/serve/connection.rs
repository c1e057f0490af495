//! One client: its requests in order, each within a time limit, and their answers.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use crate::serve::clients::Client;
use crate::serve::folder::{ServedFile, ServedFolder};
use crate::serve::request::{
    self, BAD, HttpRequest, MAX_HEAD, NOT_ALLOWED, NOT_FOUND, RequestRefusal,
};

/// Time limit for the head of a request, and for each block sent.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time limit for reading on after the last answer.
const FAREWELL: Duration = Duration::from_secs(1);
/// Bytes of a file sent at once.
const BLOCK: usize = 64 << 10;
/// End of the head of a request.
const END: &[u8] = b"\r\n\r\n";
/// Headers of every response: access by this origin only, no type sniffing.
const GUARDS: &str = "X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
                      Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
                      Cache-Control: no-cache\r\n";
/// Content security policy of a file opened by itself. The page declares its own, as it alone has a script.
const NOTHING: &str = "default-src 'none'; frame-ancestors 'none'; sandbox";
const NO_FRAMES: &str = "frame-ancestors 'none'";
/// Paths that browsers request by themselves.
const ICON: &str = "favicon.ico";

/// The connection of a client.
pub(crate) struct ServerConnection<'a> {
    stream: &'a TcpStream,
    client: &'a Client<'a>,
    port: u16,
    /// Bytes received after this request.
    ahead: Vec<u8>,
}

impl<'a> ServerConnection<'a> {
    pub(crate) fn new(stream: &'a TcpStream, client: &'a Client<'a>, port: u16) -> Self {
        Self { stream, client, port, ahead: Vec::new() }
    }

    /// Answers until the client closes, is too slow, or sends an invalid request.
    pub(crate) fn attend(mut self, folder: &ServedFolder) {
        let _ = self.stream.set_nodelay(true);
        loop {
            match self.answer(folder) {
                Ok(true) => self.client.reset_idle_time(),
                Ok(false) => return self.close().unwrap_or_default(),
                Err(_) => return,
            }
        }
    }

    /// Closes the sending side and discards what the client still sends: with unread bytes, the system may drop the
    /// answer.
    fn close(&self) -> io::Result<()> {
        self.stream.shutdown(Shutdown::Write)?;
        let (mut stream, mut block) = (self.stream, [0; 2048]);
        let end = Instant::now() + FAREWELL;
        loop {
            stream.set_read_timeout(Some(left(end)?))?;
            if stream.read(&mut block)? == 0 {
                return Ok(());
            }
        }
    }

    /// Answers one request; whether there may be another.
    fn answer(&mut self, folder: &ServedFolder) -> io::Result<bool> {
        let head = match self.head()? {
            Ok(Some(head)) => head,
            Ok(None) => return Ok(false),
            Err(refusal) => return self.refuse(refusal, false, false),
        };
        self.client.reset_idle_time();
        let request = match HttpRequest::read(&head, self.port) {
            Ok(request) => request,
            // HEAD has no body in its answer, even if the request is refused.
            Err(refusal) => return self.refuse(refusal, head.starts_with(b"HEAD "), false),
        };
        let HttpRequest { is_head, stays, .. } = request;
        if request.name == [ICON] {
            return self.send("HTTP/1.1 204 No Content\r\n", "", stays).map(|()| stays);
        }
        match folder.find(&request.name) {
            Some(file) => self.send_file(file, &request).map(|()| stays),
            None => self.refuse(NOT_FOUND, is_head, stays),
        }
    }

    /// The next head, without the empty line; `None` when the client has gone.
    fn head(&mut self) -> io::Result<Result<Option<Vec<u8>>, RequestRefusal>> {
        let end = Instant::now() + PATIENCE;
        let mut block = [0; 2048];
        loop {
            if let Some(at) = self.ahead.windows(END.len()).position(|four| four == END) {
                let rest = self.ahead.split_off(at + END.len());
                let mut head = std::mem::replace(&mut self.ahead, rest);
                head.truncate(at);
                return Ok(if at > MAX_HEAD { Err(request::TOO_LARGE) } else { Ok(Some(head)) });
            }
            if self.ahead.len() > MAX_HEAD + END.len() {
                return Ok(Err(request::TOO_LARGE));
            }
            self.stream.set_read_timeout(Some(left(end)?))?;
            let mut stream = self.stream;
            match stream.read(&mut block)? {
                0 if self.ahead.is_empty() => return Ok(Ok(None)),
                0 => return Ok(Err(BAD)),
                count => self.ahead.extend(&block[..count]),
            }
        }
    }

    fn send_file(&self, served: ServedFile, request: &HttpRequest) -> io::Result<()> {
        let ServedFile { mut file, size, kind, is_gzip, is_page, tag } = served;
        let policy = if is_page { NO_FRAMES } else { NOTHING };
        let headers = format!("ETag: {tag}\r\nContent-Security-Policy: {policy}\r\n");
        if request.has.as_ref().is_some_and(|has| *has == tag) {
            return self.send("HTTP/1.1 304 Not Modified\r\n", &headers, request.stays);
        }
        let encoding = if is_gzip { "Content-Encoding: gzip\r\n" } else { "" };
        let headers =
            format!("{headers}Content-Type: {kind}\r\nContent-Length: {size}\r\n{encoding}");
        self.send("HTTP/1.1 200 OK\r\n", &headers, request.stays)?;
        if request.is_head {
            return Ok(());
        }
        let (mut block, mut rest) = (vec![0; BLOCK.min(size as usize)], size);
        while rest > 0 {
            let count = block.len().min(rest as usize);
            // The length is announced: the only way to report a file that became shorter is to close.
            file.read_exact(&mut block[..count])?;
            self.write(&block[..count])?;
            rest -= count as u64;
        }
        Ok(())
    }

    /// Answers with a refusal; whether there may be another request.
    fn refuse(&self, refusal: RequestRefusal, is_head: bool, stays: bool) -> io::Result<bool> {
        let RequestRefusal { status, reason } = refusal;
        let allow = if refusal == NOT_ALLOWED { "Allow: GET, HEAD\r\n" } else { "" };
        let headers = format!(
            "{allow}Content-Security-Policy: {NOTHING}\r\nContent-Type: text/plain; charset=utf-8\r\n\
             Content-Length: {}\r\n",
            reason.len() + 1
        );
        self.send(&format!("HTTP/1.1 {status}\r\n"), &headers, stays)?;
        if !is_head {
            self.write(format!("{reason}\n").as_bytes())?;
        }
        Ok(stays)
    }

    /// Sends the head of an answer.
    fn send(&self, status: &str, headers: &str, stays: bool) -> io::Result<()> {
        let stays = if stays { "keep-alive" } else { "close" };
        self.write(format!("{status}{headers}{GUARDS}Connection: {stays}\r\n\r\n").as_bytes())
    }

    fn write(&self, bytes: &[u8]) -> io::Result<()> {
        let (mut stream, end) = (self.stream, Instant::now() + PATIENCE);
        let mut rest = bytes;
        while !rest.is_empty() {
            stream.set_write_timeout(Some(left(end)?))?;
            match stream.write(rest)? {
                0 => return Err(io::ErrorKind::WriteZero.into()),
                count => rest = &rest[count..],
            }
        }
        self.client.reset_idle_time();
        Ok(())
    }
}

/// The time until `end`; an error when it has passed.
fn left(end: Instant) -> io::Result<Duration> {
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() { Err(io::ErrorKind::TimedOut.into()) } else { Ok(left) }
}
