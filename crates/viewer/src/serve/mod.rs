//! A page, and the files of one folder beside it, for a browser on the same machine: HTTP/1.1 on 127.0.0.1.
//!
//! Only this machine can connect. Pages of other sites in the same browser can, too: so answers allow no other origin, and
//! a request has to name this server (`request`). Files are found by names
//! that cannot lead out of the folder (`folder`), and no client can block others (`clients`).
//!
//! Built on `std::net` with a thread for each client, without an HTTP library: the server needs little of HTTP, and a
//! library would have to be restricted to it.

mod clients;
mod connection;
mod folder;
mod request;

use std::io;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Scope};
use std::time::Duration;

use clients::Clients;
use connection::ServerConnection;
use folder::ServedFolder;
pub use folder::ServedSite;
use terrane_base::Cancel;
use terrane_base::error::{Error, ErrorKind, Result};

/// Interval of checks for cancellation.
const GLANCE: Duration = Duration::from_millis(50);
/// A client's thread holds a block of a file and little more.
const STACK: usize = 256 << 10;

/// A site that listens.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
    folder: ServedFolder,
}

impl Server {
    /// Listens on 127.0.0.1, on a free port that the system chooses where `port` is `None`.
    ///
    /// # Errors
    /// A port that is taken or not allowed; a folder that is not there.
    pub fn open(site: &ServedSite, port: Option<u16>) -> Result<Self> {
        let folder = ServedFolder::open(site)?;
        let address = (Ipv4Addr::LOCALHOST, port.unwrap_or(0));
        let listener = TcpListener::bind(address).map_err(|e| listen_error(port, e))?;
        let port = listener.local_addr().map_err(|e| listen_error(port, e))?.port();
        Ok(Self { listener, port, folder })
    }

    /// The port that it listens on.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Address of the page.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Serves until it is cancelled.
    pub fn run(&self, cancel: &Cancel) {
        let (clients, is_over) = (&Clients::default(), &AtomicBool::new(false));
        thread::scope(|scope| {
            let accepting = scope.spawn(move || self.accept(scope, clients, is_over));
            while cancel.check().is_ok() && !accepting.is_finished() {
                thread::sleep(GLANCE);
            }
            is_over.store(true, Ordering::Relaxed);
            // `accept` blocks: a connection wakes it up.
            let _ = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port));
            clients.dismiss();
        });
    }

    /// Gives each client a thread of its own.
    fn accept<'scope>(
        &'scope self,
        scope: &'scope Scope<'scope, '_>,
        clients: &'scope Clients,
        is_over: &'scope AtomicBool,
    ) {
        while !is_over.load(Ordering::Relaxed) {
            let Ok((stream, _)) = self.listener.accept() else {
                // Usually out of file handles: others will be closed.
                thread::sleep(GLANCE);
                continue;
            };
            let Some(client) = clients.admit(&stream) else { continue };
            if is_over.load(Ordering::Relaxed) {
                return;
            }
            // Without a thread for it, a client is refused: its stream is dropped with the closure.
            let _ = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || {
                ServerConnection::new(&stream, &client, self.port).attend(&self.folder);
            });
        }
    }
}

fn listen_error(port: Option<u16>, e: io::Error) -> Error {
    let action = match port {
        Some(port) => format!("listen on 127.0.0.1:{port}"),
        None => "listen on 127.0.0.1".to_owned(),
    };
    Error::io(ErrorKind::Io, &action, e).remedy("leave ‹port› out to use a free port")
}
