//! Remote files (HTTP, S3, Google Cloud Storage, Azure), read by range requests.
//!
//! ```text
//! read ── pages in the disk cache ──[missing]── merged runs of pages ── parallel requests ── disk cache
//! ```
//!
//! Opening requests the first bytes; the response states length and version (ETag) of the file. Each later response is
//! compared with both: a file that changes is an error. The disk cache (`page_store`) serves all processes, so the tasks of
//! a plan and later runs do not request the same bytes again. Memory is a buffer for each request.

mod address;
mod page_store;
mod request;
mod signature;

use std::collections::HashMap;
use std::ffi::OsString;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use address::RemoteUrl;
use page_store::{PAGE, PageStore};
use request::{DOWNLOAD, ObjectVersion, RemoteRequests};
use terrane_base::byte_size;
use terrane_base::error::{Error, ErrorKind, Result};

use crate::{lock, wait};

/// Bytes of the first request: headers, and the tables of most files.
const FIRST_REQUEST_BYTES: u64 = 1 << 16;
/// Most bytes of a request.
const MAX_REQUEST_BYTES: u64 = 4 << 20;
/// Parallel requests of a thread.
const PARALLEL_REQUESTS: usize = 8;
/// Missing pages are requested together if at most so many pages lie between them.
const MERGED_GAP_PAGES: u64 = 2;
/// Largest file of a server without range requests.
const MAX_WHOLE: u64 = 1 << 30;
/// Attempts to read pages that other processes may evict.
const MAX_READ_ATTEMPTS: usize = 4;
/// Variables with the folder and the size of the cache.
const FOLDER: &str = "TERRANE_CACHE";
const SIZE: &str = "TERRANE_CACHE_SIZE";
const MAX_SIZE: u64 = 4 << 30;
/// Smallest size: what is read ahead has to stay until it is used.
const MIN_SIZE: u64 = 64 << 20;
/// Bytes written between checks of the size of the cache, at most.
const TRIM_INTERVAL_BYTES: u64 = 256 << 20;
/// How long a failed opening is remembered.
const FAILED_OPEN_TIME: Duration = Duration::from_secs(5);

/// A remote file.
#[derive(Debug)]
pub(crate) struct RemoteFile {
    path: PathBuf,
    requests: RemoteRequests,
    state: ObjectVersion,
    /// Whether the server supports range requests. If not, the whole file is requested.
    has_ranges: bool,
    store: PageStore,
    folder: CacheFolder,
    /// Runs of pages that are being requested.
    in_flight: Mutex<Vec<Range<u64>>>,
    /// Signalled when a request has ended.
    arrived: Condvar,
    /// The first permanent failure: later requests are not made.
    failed: Mutex<Option<Error>>,
}

/// Whether a path is a URL that can be read.
pub(crate) fn is_remote(path: &Path) -> bool {
    RemoteUrl::is_supported(path)
}

/// The file at a URL, which is opened once in a process.
///
/// # Errors
/// Files that cannot be read, and servers that cannot be reached.
pub(crate) fn open(path: &Path) -> Result<Arc<RemoteFile>> {
    // Paths are compared as texts: to servers, a//b and a/b are two files.
    static OPEN: Mutex<Option<HashMap<OsString, OpenedFile>>> = Mutex::new(None);
    match lock(&OPEN).get_or_insert_default().get(path.as_os_str()) {
        Some(Ok(file)) if file.failure().is_none() => return Ok(file.clone()),
        Some(Err((since, error))) if since.elapsed() < FAILED_OPEN_TIME => {
            return Err(error.again());
        }
        _ => {}
    }
    // Outside the lock: two threads may ask for the head of one file.
    let file = RemoteFile::ask(path).map(Arc::new);
    let opened = match &file {
        Ok(file) => Ok(file.clone()),
        Err(error) => Err((Instant::now(), error.again())),
    };
    lock(&OPEN).get_or_insert_default().insert(path.as_os_str().to_owned(), opened);
    file
}

/// An opened file, or why it could not be opened, and when.
type OpenedFile = std::result::Result<Arc<RemoteFile>, (Instant, Error)>;

impl RemoteFile {
    fn ask(path: &Path) -> Result<Self> {
        let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let address = RemoteUrl::parse(path, &variable)?;
        let folder = CacheFolder::of(&variable).map_err(|e| e.in_file(path))?;
        let (requests, mut head) = (RemoteRequests { address }, Vec::new());
        let mut keep = |_, bytes: &[u8]| {
            head.extend_from_slice(bytes);
            Ok(())
        };
        let (state, has_ranges) =
            requests.get(0, FIRST_REQUEST_BYTES, None, &mut keep).map_err(|e| e.in_file(path))?;
        if state.bytes == 0 {
            return Err(Error::bad_input("file is empty").in_file(path).remedy("copy it again"));
        }
        if !has_ranges && state.bytes > MAX_WHOLE {
            return Err(Error::unsupported(format!(
                "the server supports no range requests, and the file is larger than {} MiB",
                MAX_WHOLE >> 20
            ))
            .in_file(path)
            .remedy(DOWNLOAD));
        }
        // Without a version, pages are those of this run alone.
        let of_run = || {
            let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            format!("{} {}", std::process::id(), since.as_nanos())
        };
        let version = state.strong_tag().map_or_else(of_run, str::to_owned);
        let identity = format!("{}\n{}\n{version}", requests.address.url, state.bytes);
        let store = PageStore::new(&folder.path, &identity, state.bytes);
        let (in_flight, arrived) = (Mutex::default(), Condvar::new());
        let path = path.to_owned();
        let failed = Mutex::default();
        let file =
            Self { path, requests, state, has_ranges, store, folder, in_flight, arrived, failed };
        file.in_store(|| file.store.open()?.note_use())?;
        let mut writer = PageWriter::new(&file, 0)?;
        writer.take(0, &head)?;
        file.trim_if_due(head.len() as u64)?;
        Ok(file)
    }

    /// Length in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.state.bytes
    }

    /// What tells its contents from others of the same length, if the server says.
    pub(crate) fn version(&self) -> Option<&str> {
        self.state.strong_tag()
    }

    /// Fills `out` from the byte `at` on. If some are missing, `ahead` more bytes are requested with them.
    ///
    /// # Errors
    /// Those of requests, and of the folder of pages.
    pub(crate) fn read_at(&self, at: u64, out: &mut [u8], ahead: u64) -> Result<()> {
        for _ in 0..MAX_READ_ATTEMPTS {
            let missing = self.in_store(|| self.store.open()?.read(at, out))?;
            let Some(last) = missing.last() else { return Ok(()) };
            let end = self.store.bytes(last.clone()).end;
            let ahead = self.store.pages(end..end.saturating_add(ahead).min(self.bytes()));
            let ahead = self.in_store(|| self.store.open()?.missing(ahead))?;
            self.fetch([missing, ahead].concat())?;
        }
        Err(Error::new(ErrorKind::Io, "cached data was evicted while it was being read")
            .in_file(&self.path)
            .remedy(format!("increase {SIZE}")))
    }

    /// Requests what is missing of the `needed` ranges, in parallel; if anything was, also of those `ahead`.
    ///
    /// # Errors
    /// As [`read_at`](Self::read_at).
    pub(crate) fn prefetch(&self, needed: &[Range<u64>], ahead: &[Range<u64>]) -> Result<()> {
        let missing = self.in_store(|| {
            let (open, mut missing) = (self.store.open()?, Vec::new());
            for ranges in [needed, ahead] {
                for range in ranges {
                    let range = range.start.min(self.bytes())..range.end.min(self.bytes());
                    missing.extend(open.missing(self.store.pages(range))?);
                }
                if missing.is_empty() {
                    break;
                }
            }
            Ok(missing)
        })?;
        if missing.is_empty() { Ok(()) } else { self.fetch(missing) }
    }

    /// Requests runs of pages, unless another thread does, and waits until they have arrived or failed.
    fn fetch(&self, runs: Vec<Range<u64>>) -> Result<()> {
        let runs = match self.has_ranges {
            true => joined(runs, MERGED_GAP_PAGES),
            false => std::iter::once(0..self.store.count()).collect(),
        };
        let (claim, others) = self.claim(&runs);
        let most = if self.has_ranges { MAX_REQUEST_BYTES / PAGE } else { u64::MAX };
        let runs = claim.runs.iter().cloned();
        let pieces: Vec<Range<u64>> = runs.flat_map(|run| pieces(run, most)).collect();
        let threads = pieces.len().min(PARALLEL_REQUESTS);
        if threads <= 1 {
            pieces.into_iter().try_for_each(|piece| self.get(piece))?;
        } else {
            let next = AtomicU64::new(0);
            let work = || {
                while let Some(piece) = pieces.get(next.fetch_add(1, Ordering::Relaxed) as usize) {
                    self.get(piece.clone())?;
                }
                Ok(())
            };
            std::thread::scope(|scope| {
                let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
                let mut ends = threads.into_iter().map(|thread| thread.join());
                ends.try_for_each(|end| {
                    end.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                })
            })?;
        }
        drop(claim);
        let mut asked = lock(&self.in_flight);
        let is_there = |asked: &[Range<u64>]| {
            others.iter().any(|run| asked.iter().any(|other| overlap(run, other)))
        };
        while is_there(&asked) {
            asked = wait(&self.arrived, asked);
        }
        Ok(())
    }

    /// Claims what no other thread is requesting; returns the runs of others, too.
    fn claim(&self, runs: &[Range<u64>]) -> (PageClaim<'_>, Vec<Range<u64>>) {
        let mut asked = lock(&self.in_flight);
        let (mut own, mut others) = (Vec::new(), Vec::new());
        for run in runs {
            let mut left = vec![run.clone()];
            for other in asked.iter().filter(|other| overlap(run, other)) {
                others.push(run.start.max(other.start)..run.end.min(other.end));
                left = left.into_iter().flat_map(|run| without(run, other)).collect();
            }
            own.extend(left);
        }
        asked.extend(own.iter().cloned());
        (PageClaim { file: self, runs: own }, others)
    }

    /// Why a request has failed.
    fn failure(&self) -> Option<Error> {
        lock(&self.failed).as_ref().map(Error::again)
    }

    /// Requests pages and stores them.
    fn get(&self, pages: Range<u64>) -> Result<()> {
        self.failure().map_or(Ok(()), Err)?;
        self.try_get(pages).inspect_err(|error| {
            lock(&self.failed).get_or_insert_with(|| error.again());
        })
    }

    fn try_get(&self, pages: Range<u64>) -> Result<()> {
        let bytes = self.store.bytes(pages.clone());
        let mut writer = PageWriter::new(self, pages.start)?;
        let mut keep = |at, some: &[u8]| writer.take(at, some);
        let known = Some(&self.state);
        let got = self.requests.get(bytes.start, bytes.end, known, &mut keep);
        got.map_err(|e| e.in_file(&self.path))?;
        self.trim_if_due(bytes.end - bytes.start)
    }

    fn in_store<T>(&self, act: impl FnOnce() -> std::io::Result<T>) -> Result<T> {
        act().map_err(|error| {
            let error = Error::write(&self.folder.path, error);
            error.remedy(format!("set {FOLDER} to a writable folder with free space"))
        })
    }

    /// Checks the size of the cache from time to time.
    fn trim_if_due(&self, bytes: u64) -> Result<()> {
        static WRITTEN: AtomicU64 = AtomicU64::new(TRIM_INTERVAL_BYTES);
        if WRITTEN.fetch_add(bytes, Ordering::Relaxed) + bytes
            < TRIM_INTERVAL_BYTES.min(self.folder.bytes / 8)
        {
            return Ok(());
        }
        WRITTEN.store(0, Ordering::Relaxed);
        self.in_store(|| page_store::trim(&self.folder.path, self.folder.bytes))
    }
}

/// Runs of pages that one thread requests.
struct PageClaim<'a> {
    file: &'a RemoteFile,
    runs: Vec<Range<u64>>,
}

impl Drop for PageClaim<'_> {
    fn drop(&mut self) {
        let mut asked = lock(&self.file.in_flight);
        for run in &self.runs {
            if let Some(at) = asked.iter().position(|other| other == run) {
                asked.swap_remove(at);
            }
        }
        drop(asked);
        self.file.arrived.notify_all();
    }
}

/// Makes pages of bytes that arrive in order.
struct PageWriter<'a> {
    file: &'a RemoteFile,
    open: page_store::OpenPages<'a>,
    page: u64,
    bytes: Vec<u8>,
}

impl<'a> PageWriter<'a> {
    fn new(file: &'a RemoteFile, page: u64) -> Result<Self> {
        let open = file.in_store(|| file.store.open())?;
        Ok(Self { file, open, page, bytes: Vec::new() })
    }

    /// Takes the bytes from `at` on, which follow those before.
    fn take(&mut self, at: u64, mut some: &[u8]) -> Result<()> {
        debug_assert_eq!(at, self.page * PAGE + self.bytes.len() as u64);
        while !some.is_empty() {
            let place = self.file.store.bytes(self.page..self.page + 1);
            let size = (place.end - place.start) as usize;
            let (now, later) = some.split_at(some.len().min(size - self.bytes.len()));
            self.bytes.extend_from_slice(now);
            some = later;
            if self.bytes.len() == size {
                self.file.in_store(|| self.open.write(self.page, &self.bytes))?;
                self.bytes.clear();
                self.page += 1;
            }
        }
        Ok(())
    }
}

/// The folder of the cache.
#[derive(Debug)]
struct CacheFolder {
    path: PathBuf,
    /// Bytes that it may take.
    bytes: u64,
}

impl CacheFolder {
    /// The folder that the environment names.
    fn of(variable: &dyn Fn(&str) -> Option<String>) -> Result<Self> {
        let path = match variable(FOLDER) {
            Some(path) => PathBuf::from(path),
            None => {
                let cache = variable("XDG_CACHE_HOME").or_else(|| variable("LOCALAPPDATA"));
                let home = || Some(PathBuf::from(variable("HOME")?).join(".cache"));
                let cache = cache.map(PathBuf::from).or_else(home).ok_or_else(|| {
                    Error::usage("no cache folder for remote files: HOME is not set")
                        .remedy(format!("set {FOLDER} to a folder"))
                })?;
                cache.join("terrane")
            }
        };
        let bytes = match variable(SIZE) {
            None => MAX_SIZE,
            Some(text) => byte_size::parse(&text).ok_or_else(|| {
                Error::usage(format!("{SIZE} is {text:?}, not a size"))
                    .remedy("set it to bytes, or to a size such as 4G")
            })?,
        };
        match bytes < MIN_SIZE {
            false => Ok(Self { path, bytes }),
            true => Err(Error::usage(format!("{SIZE} is less than {} MiB", MIN_SIZE >> 20))
                .remedy("set it to 64M or more")),
        }
    }
}

fn overlap(a: &Range<u64>, b: &Range<u64>) -> bool {
    a.start < b.end && b.start < a.end
}

/// What is left of a run without another.
fn without(run: Range<u64>, other: &Range<u64>) -> Vec<Range<u64>> {
    let parts = [run.start..run.end.min(other.start), run.start.max(other.end)..run.end];
    parts.into_iter().filter(|part| !part.is_empty()).collect()
}

/// Runs in order, where those that are at most `gap` apart are one.
fn joined(mut runs: Vec<Range<u64>>, gap: u64) -> Vec<Range<u64>> {
    runs.retain(|run| !run.is_empty());
    runs.sort_by_key(|run| (run.start, run.end));
    let mut joined: Vec<Range<u64>> = Vec::new();
    for run in runs {
        match joined.last_mut().filter(|last| run.start <= last.end + gap) {
            Some(last) => last.end = last.end.max(run.end),
            None => joined.push(run),
        }
    }
    joined
}

/// A run in pieces of about the same size, at most `most`.
fn pieces(run: Range<u64>, most: u64) -> impl Iterator<Item = Range<u64>> {
    let (pages, count) = (run.end - run.start, (run.end - run.start).div_ceil(most));
    (0..count).map(move |i| run.start + pages * i / count..run.start + pages * (i + 1) / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn runs_are_joined_and_cut() {
        assert_eq!(joined(vec![9..12, 0..3, 5..6, 3..3], 2), [0..6, 9..12]);
        assert_eq!(joined(vec![0..4, 2..9, 30..31], 0), [0..9, 30..31]);
        assert_eq!(pieces(10..20, 4).collect::<Vec<_>>(), [10..13, 13..16, 16..20]);
        assert_eq!(without(0..9, &(3..5)), [0..3, 5..9]);
        assert_eq!(without(3..5, &(0..9)), []);
    }

    proptest! {
        #[test]
        fn runs_keep_their_pages(runs in prop::collection::vec((0_u64..60, 0_u64..9), 0..12), most in 1_u64..9) {
            let runs: Vec<_> = runs.iter().map(|(start, pages)| *start..start + pages).collect();
            let has = |runs: &[Range<u64>], page| runs.iter().any(|run| run.contains(&page));
            let whole = joined(runs.clone(), 0);
            let cut: Vec<_> = whole.iter().cloned().flat_map(|run| pieces(run, most)).collect();
            for page in 0..80 {
                prop_assert_eq!(has(&runs, page), has(&whole, page));
                prop_assert_eq!(cut.iter().filter(|run| run.contains(&page)).count(), usize::from(has(&runs, page)));
            }
            prop_assert!(cut.iter().all(|run| run.end - run.start <= most));
        }
    }
}
