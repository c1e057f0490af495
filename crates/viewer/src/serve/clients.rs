//! Connected clients: their number is limited, and the one idle for longest is dropped for a new one.

use std::collections::BTreeMap;
use std::net::{Shutdown, TcpStream};
use std::sync::Mutex;
use std::time::Instant;

use terrane_files::lock;

/// Most clients at once. A browser takes six connections for a page.
pub(crate) const MAX_CLIENTS: usize = 64;

/// All clients.
#[derive(Debug, Default)]
pub(crate) struct Clients(Mutex<ClientList>);

#[derive(Debug, Default)]
struct ClientList {
    next: u64,
    by_number: BTreeMap<u64, WaitingClient>,
    is_over: bool,
}

/// A client, and since when it is waited for.
#[derive(Debug)]
struct WaitingClient {
    stream: TcpStream,
    since: Instant,
}

/// One of them; it is forgotten with the value.
#[derive(Debug)]
pub(crate) struct Client<'a> {
    clients: &'a Clients,
    number: u64,
}

impl Clients {
    /// Takes another one in. Where there are as many as there may be, the one waited for longest is cut off.
    /// `None` after [`dismiss`](Self::dismiss), and where the system has no room for it.
    pub(crate) fn admit(&self, stream: &TcpStream) -> Option<Client<'_>> {
        let stream = stream.try_clone().ok()?;
        let mut held = lock(&self.0);
        if held.is_over {
            return None;
        }
        while held.by_number.len() >= MAX_CLIENTS {
            let slowest = held.by_number.iter().min_by_key(|(_, waiting)| waiting.since);
            let slowest = slowest.map(|(number, _)| *number)?;
            held.by_number.remove(&slowest).iter().for_each(cut_off);
        }
        let number = held.next;
        held.next += 1;
        held.by_number.insert(number, WaitingClient { stream, since: Instant::now() });
        Some(Client { clients: self, number })
    }

    /// Cuts all of them off, and lets nobody in.
    pub(crate) fn dismiss(&self) {
        let mut held = lock(&self.0);
        held.is_over = true;
        held.by_number.values().for_each(cut_off);
    }
}

/// Whoever reads or writes at the stream gets an end or an error.
fn cut_off(waiting: &WaitingClient) {
    let _ = waiting.stream.shutdown(Shutdown::Both);
}

impl Client<'_> {
    /// Tells that it went on.
    pub(crate) fn is_alive(&self) {
        if let Some(waiting) = lock(&self.clients.0).by_number.get_mut(&self.number) {
            waiting.since = Instant::now();
        }
    }
}

impl Drop for Client<'_> {
    fn drop(&mut self) {
        lock(&self.clients.0).by_number.remove(&self.number);
    }
}
