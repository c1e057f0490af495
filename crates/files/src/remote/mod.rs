//! Files of web servers and object stores, read by ranges of bytes.
//!
//! ```text
//! read ── pages on disk ──[those that are missing]── runs of pages ── requests, several at once ── pages on disk
//! ```
//!
//! Opening asks for the first bytes, which tell the length and the version of a file. Each answer is compared with both:
//! a file that changes is an error. Pages are kept in one folder for all processes (`page_store`), so the tasks of a plan
//! and later runs do not ask again. Memory is that of a buffer for each request.

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

use address::RemoteAddress;
use page_store::{PAGE, PageStore};
use request::{RemoteRequests, RemoteState};
use terrane_base::error::{Error, Result};

use crate::{lock, wait};

/// Bytes that are asked for at opening: headers, and the tables of most files.
const HEAD: u64 = 1 << 16;
/// Most bytes of a request.
const REQUEST: u64 = 4 << 20;
/// Requests made at once by one thread.
const AT_ONCE: usize = 8;
/// Missing pages this near to each other are asked for together.
const GAP: u64 = 2;
/// Bytes that a server without ranges may send.
const MAX_WHOLE: u64 = 1 << 30;
/// Times that pages are read before another process that takes them away is the fault.
const READS: usize = 4;
/// Folder of the pages, and bytes that they may take.
const FOLDER: &str = "TERRANE_CACHE";
const SIZE: &str = "TERRANE_CACHE_SIZE";
const MAX_SIZE: u64 = 4 << 30;
/// Least of these: what threads ask for ahead has to stay until it is read.
const MIN_SIZE: u64 = 64 << 20;
/// Most bytes written between two looks at the size of the folder.
const LOOK: u64 = 256 << 20;
/// How long a file that could not be opened is not asked for again.
const REMEMBERED: Duration = Duration::from_secs(5);

/// A remote file.
#[derive(Debug)]
pub(crate) struct RemoteFile {
    path: PathBuf,
    requests: RemoteRequests,
    state: RemoteState,
    /// Whether the server supports ranges of bytes. If not, the whole file is asked for.
    has_ranges: bool,
    store: PageStore,
    folder: PageFolder,
    /// Runs of pages that are asked for.
    asked: Mutex<Vec<Range<u64>>>,
    /// Signalled when some have come.
    come: Condvar,
    /// Why a request has failed for good: later ones are not made.
    failed: Mutex<Option<Error>>,
}

/// Whether a path is an address that can be read.
pub(crate) fn is_remote(path: &Path) -> bool {
    RemoteAddress::is_one(path)
}

/// The file at an address, which is opened once.
///
/// # Errors
/// Files that cannot be read, and servers that cannot be reached.
pub(crate) fn open(path: &Path) -> Result<Arc<RemoteFile>> {
    // Paths are compared as texts: to servers, a//b and a/b are two files.
    static OPEN: Mutex<Option<HashMap<OsString, OpenedFile>>> = Mutex::new(None);
    match lock(&OPEN).get_or_insert_default().get(path.as_os_str()) {
        Some(Ok(file)) if file.failure().is_none() => return Ok(file.clone()),
        Some(Err((since, error))) if since.elapsed() < REMEMBERED => return Err(error.again()),
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
        let address = RemoteAddress::of(path, &variable)?;
        let folder = PageFolder::of(&variable).map_err(|e| e.in_file(path))?;
        let (requests, mut head) = (RemoteRequests { address }, Vec::new());
        let mut keep = |_, bytes: &[u8]| {
            head.extend_from_slice(bytes);
            Ok(())
        };
        let (state, has_ranges) = requests.get(path, 0, HEAD, None, &mut keep)?;
        if state.bytes == 0 {
            return Err(Error::bad_input("file is empty").in_file(path).remedy("copy it again"));
        }
        if !has_ranges && state.bytes > MAX_WHOLE {
            return Err(Error::unsupported(format!(
                "the server supports no ranges of bytes, and the file is larger than {} MiB",
                MAX_WHOLE >> 20
            ))
            .in_file(path)
            .remedy("download the file (curl -LO URL) and pass the local copy"));
        }
        // Without a version, pages are those of this run alone.
        let of_run = || {
            let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            format!("{} {}", std::process::id(), since.as_nanos())
        };
        let version = state.strong_version().map_or_else(of_run, str::to_owned);
        let identity = format!("{}\n{}\n{version}", requests.address.url, state.bytes);
        let store = PageStore::new(&folder.path, &identity, state.bytes);
        let (asked, come) = (Mutex::default(), Condvar::new());
        let path = path.to_owned();
        let failed = Mutex::default();
        let file = Self { path, requests, state, has_ranges, store, folder, asked, come, failed };
        file.in_store(|| file.store.open()?.note_use())?;
        let mut writer = PageWriter::new(&file, 0)?;
        writer.take(0, &head)?;
        file.note_written(head.len() as u64)?;
        Ok(file)
    }

    /// Length in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.state.bytes
    }

    /// What tells its contents from others of the same length, if the server says.
    pub(crate) fn version(&self) -> Option<&str> {
        self.state.strong_version()
    }

    /// Fills `out` from the byte `at` on; `ahead` more bytes are asked for with those that are missing.
    ///
    /// # Errors
    /// Those of requests, and of the folder of pages.
    pub(crate) fn read_at(&self, at: u64, out: &mut [u8], ahead: u64) -> Result<()> {
        for _ in 0..READS {
            let missing = self.in_store(|| self.store.open()?.read(at, out))?;
            let Some(last) = missing.last() else { return Ok(()) };
            let end = self.store.bytes(last.clone()).end;
            let ahead = self.store.pages(end..end.saturating_add(ahead).min(self.bytes()));
            let ahead = self.in_store(|| self.store.open()?.missing(ahead))?;
            self.fetch([missing, ahead].concat())?;
        }
        Err(Error::bad_input("its pages on disk disappear while they are read")
            .in_file(&self.path)
            .remedy(format!("set {SIZE} to a larger size")))
    }

    /// Asks for all ranges of bytes that are missing, at once; for those `ahead` only if some were.
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

    /// Asks for runs of pages, unless another thread does, and waits until they have come or failed.
    fn fetch(&self, runs: Vec<Range<u64>>) -> Result<()> {
        let runs = match self.has_ranges {
            true => joined(runs, GAP),
            false => std::iter::once(0..self.store.count()).collect(),
        };
        let (claim, others) = self.claim(&runs);
        let most = if self.has_ranges { REQUEST / PAGE } else { u64::MAX };
        let runs = claim.runs.iter().cloned();
        let pieces: Vec<Range<u64>> = runs.flat_map(|run| pieces(run, most)).collect();
        let threads = pieces.len().min(AT_ONCE);
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
        let mut asked = lock(&self.asked);
        let is_there = |asked: &[Range<u64>]| {
            others.iter().any(|run| asked.iter().any(|other| overlap(run, other)))
        };
        while is_there(&asked) {
            asked = wait(&self.come, asked);
        }
        Ok(())
    }

    /// Claims what no other thread asks for; returns the runs of others, too.
    fn claim(&self, runs: &[Range<u64>]) -> (PageClaim<'_>, Vec<Range<u64>>) {
        let mut asked = lock(&self.asked);
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

    /// Asks for pages, and keeps them.
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
        self.requests.get(&self.path, bytes.start, bytes.end, known, &mut keep)?;
        self.note_written(bytes.end - bytes.start)
    }

    fn in_store<T>(&self, act: impl FnOnce() -> std::io::Result<T>) -> Result<T> {
        act().map_err(|error| {
            let error = Error::write(&self.folder.path, error);
            error.remedy(format!("set {FOLDER} to a folder with space"))
        })
    }

    /// Looks at the size of the folder from time to time.
    fn note_written(&self, bytes: u64) -> Result<()> {
        static WRITTEN: AtomicU64 = AtomicU64::new(LOOK);
        if WRITTEN.fetch_add(bytes, Ordering::Relaxed) + bytes < LOOK.min(self.folder.bytes / 8) {
            return Ok(());
        }
        WRITTEN.store(0, Ordering::Relaxed);
        self.in_store(|| page_store::trim(&self.folder.path, self.folder.bytes))
    }
}

/// Runs of pages that one thread asks for.
struct PageClaim<'a> {
    file: &'a RemoteFile,
    runs: Vec<Range<u64>>,
}

impl Drop for PageClaim<'_> {
    fn drop(&mut self) {
        let mut asked = lock(&self.file.asked);
        for run in &self.runs {
            if let Some(at) = asked.iter().position(|other| other == run) {
                asked.swap_remove(at);
            }
        }
        drop(asked);
        self.file.come.notify_all();
    }
}

/// Makes pages of bytes that come in order.
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

/// The folder of the pages.
#[derive(Debug)]
struct PageFolder {
    path: PathBuf,
    /// Bytes that it may take.
    bytes: u64,
}

impl PageFolder {
    /// The folder that the environment names.
    fn of(variable: &dyn Fn(&str) -> Option<String>) -> Result<Self> {
        let path = match variable(FOLDER) {
            Some(path) => PathBuf::from(path),
            None => {
                let cache = variable("XDG_CACHE_HOME").or_else(|| variable("LOCALAPPDATA"));
                let home = || Some(PathBuf::from(variable("HOME")?).join(".cache"));
                let cache = cache.map(PathBuf::from).or_else(home).ok_or_else(|| {
                    Error::usage("there is no folder for what is read of remote files")
                        .remedy(format!("set {FOLDER} to a folder"))
                })?;
                cache.join("terrane")
            }
        };
        let bytes = variable(SIZE).map_or(Ok(MAX_SIZE), |text| size_of(&text))?;
        match bytes < MIN_SIZE {
            false => Ok(Self { path, bytes }),
            true => Err(Error::usage(format!("{SIZE} is less than {} MiB", MIN_SIZE >> 20))
                .remedy("set it to 64M or more")),
        }
    }
}

/// Bytes of "4G", "512M" or a plain number.
fn size_of(text: &str) -> Result<u64> {
    let text = text.trim();
    let unit = text.chars().last().and_then(|last| "KMGT".find(last));
    let digits = if unit.is_some() { &text[..text.len() - 1] } else { text };
    let shift = unit.map_or(0, |place| 10 * (place + 1));
    let bytes = digits.parse::<u64>().ok().and_then(|count| count.checked_mul(1 << shift));
    bytes.ok_or_else(|| {
        Error::usage(format!("{SIZE} is {text:?}, not a size"))
            .remedy("set it to bytes, or to a size such as 4G")
    })
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
    fn sizes_have_units() {
        for (text, bytes) in [("7", 7), ("3K", 3 << 10), (" 512M ", 512 << 20), ("2T", 2 << 40)] {
            assert_eq!(size_of(text).unwrap(), bytes);
        }
        for text in ["", "G", "-1", "1.5G", "99999999999T", "4 GB"] {
            assert!(size_of(text).unwrap_err().to_string().contains(SIZE), "{text}");
        }
    }

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
