//! Connected clients: their number is limited, and the one idle for longest is dropped for a new one.

use std::collections::BTreeMap;
use std::net::{Shutdown, TcpStream};
use std::sync::Mutex;
use std::time::Instant;

use terrane_files::lock;

/// Maximum number of clients. A browser opens six connections for a page.
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

/// A client, and the start of its idle time.
#[derive(Debug)]
struct WaitingClient {
    stream: TcpStream,
    since: Instant,
}

/// An admitted client; removed from the list when dropped.
#[derive(Debug)]
pub(crate) struct Client<'a> {
    clients: &'a Clients,
    number: u64,
}

impl Clients {
    /// Admits a client. Beyond [`MAX_CLIENTS`] the one idle for longest is disconnected.
    /// `None` after [`dismiss`](Self::dismiss), and if the system is out of handles.
    pub(crate) fn admit(&self, stream: &TcpStream) -> Option<Client<'_>> {
        let stream = stream.try_clone().ok()?;
        let mut list = lock(&self.0);
        if list.is_over {
            return None;
        }
        while list.by_number.len() >= MAX_CLIENTS {
            let slowest = list.by_number.iter().min_by_key(|(_, waiting)| waiting.since);
            let slowest = slowest.map(|(number, _)| *number)?;
            list.by_number.remove(&slowest).iter().for_each(cut_off);
        }
        let number = list.next;
        list.next += 1;
        list.by_number.insert(number, WaitingClient { stream, since: Instant::now() });
        Some(Client { clients: self, number })
    }

    /// Disconnects all clients and admits no others.
    pub(crate) fn dismiss(&self) {
        let mut list = lock(&self.0);
        list.is_over = true;
        list.by_number.values().for_each(cut_off);
    }
}

/// Ends the client's stream: its thread reads an end or gets an error.
fn cut_off(waiting: &WaitingClient) {
    let _ = waiting.stream.shutdown(Shutdown::Both);
}

impl Client<'_> {
    pub(crate) fn reset_idle_time(&self) {
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
