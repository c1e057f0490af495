//! Pages of remote files, kept on disk for all processes.
//!
//! A file has two files in the folder: its pages where they are in the file, and a checksum of each, which is zero where
//! there is no page. Both are sparse. Every page is checked as it is read, so processes write without locks, a page that
//! was half written is one that is not there, and pages may be taken away at any time.

use std::fs::{File, OpenOptions};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::position::{read_exact_at, write_all_at};

/// Bytes of a page.
pub(super) const PAGE: u64 = 1 << 14;
/// Bytes of a checksum.
const SUM: u64 = 8;
/// Digits of a name.
const NAME: usize = 32;
/// Endings of the two files.
const PAGES: &str = "pages";
const SUMS: &str = "sums";

/// The pages of one file.
#[derive(Debug)]
pub(super) struct PageStore {
    folder: PathBuf,
    /// Name without an ending.
    name: String,
    /// Bytes of the remote file.
    bytes: u64,
}

/// The open files of a store.
pub(super) struct OpenPages<'a> {
    store: &'a PageStore,
    pages: File,
    sums: File,
}

impl PageStore {
    /// The pages of a file of `bytes` bytes; `identity` tells it from all others.
    pub(super) fn new(folder: &Path, identity: &str, bytes: u64) -> Self {
        let name = blake3::hash(identity.as_bytes()).to_hex()[..NAME].to_owned();
        Self { folder: folder.to_owned(), name, bytes }
    }

    /// Number of pages.
    pub(super) fn count(&self) -> u64 {
        self.bytes.div_ceil(PAGE)
    }

    /// The pages with these bytes.
    pub(super) fn pages(&self, bytes: Range<u64>) -> Range<u64> {
        let end = bytes.end.div_ceil(PAGE).min(self.count());
        (bytes.start / PAGE).min(end)..end
    }

    /// The bytes of some pages.
    pub(super) fn bytes(&self, pages: Range<u64>) -> Range<u64> {
        pages.start * PAGE..(pages.end * PAGE).min(self.bytes)
    }

    /// Opens its files, which are made if necessary.
    pub(super) fn open(&self) -> io::Result<OpenPages<'_>> {
        private_folder(&self.folder)?;
        let open = |ending| {
            let path = self.folder.join(&self.name).with_extension(ending);
            let mut options = OpenOptions::new();
            options.create(true).truncate(false).read(true).write(true);
            // What was read with credentials is not for others.
            #[cfg(unix)]
            std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
            options.open(path)
        };
        let (pages, sums) = (open(PAGES)?, open(SUMS)?);
        for (file, bytes) in [(&pages, self.bytes), (&sums, self.count() * SUM)] {
            if file.metadata()?.len() != bytes {
                file.set_len(bytes)?;
            }
        }
        Ok(OpenPages { store: self, pages, sums })
    }
}

impl OpenPages<'_> {
    /// Fills `out` from the byte `at` on if all of its pages are there; otherwise returns those that are not, in runs.
    pub(super) fn read(&self, at: u64, out: &mut [u8]) -> io::Result<Vec<Range<u64>>> {
        let end = at + out.len() as u64;
        let mut missing: Vec<Range<u64>> = Vec::new();
        let mut page_bytes = Vec::new();
        let pages = self.store.pages(at..end);
        let sums = self.sums(pages.clone())?;
        for (page, sum) in pages.zip(sums) {
            let bytes = self.store.bytes(page..page + 1);
            page_bytes.resize((bytes.end - bytes.start) as usize, 0);
            let is_there = sum != 0
                && read_exact_at(&self.pages, &mut page_bytes, bytes.start).is_ok()
                && checksum(&page_bytes) == sum;
            if !is_there {
                push_page(&mut missing, page);
                continue;
            }
            let [from, to] = [at.max(bytes.start), end.min(bytes.end)];
            let found = &page_bytes[(from - bytes.start) as usize..(to - bytes.start) as usize];
            out[(from - at) as usize..(to - at) as usize].copy_from_slice(found);
        }
        Ok(missing)
    }

    /// The pages of a run that were never written, in runs; those that are damaged are not found.
    pub(super) fn missing(&self, pages: Range<u64>) -> io::Result<Vec<Range<u64>>> {
        let mut missing: Vec<Range<u64>> = Vec::new();
        for (page, _) in pages.clone().zip(self.sums(pages)?).filter(|(_, sum)| *sum == 0) {
            push_page(&mut missing, page);
        }
        Ok(missing)
    }

    fn sums(&self, pages: Range<u64>) -> io::Result<Vec<u64>> {
        let mut bytes = vec![0; ((pages.end - pages.start) * SUM) as usize];
        // Another process may have cut the file, and makes it long again.
        if read_exact_at(&self.sums, &mut bytes, pages.start * SUM).is_err() {
            bytes.fill(0);
        }
        let (sums, _) = bytes.as_chunks();
        Ok(sums.iter().map(|sum| u64::from_le_bytes(*sum)).collect())
    }

    /// Notes that the pages are in use, so that others go first.
    pub(super) fn note_use(&self) -> io::Result<()> {
        let now = SystemTime::now();
        self.pages.set_modified(now)?;
        self.sums.set_modified(now)
    }

    /// Writes a page, whole.
    pub(super) fn write(&self, page: u64, bytes: &[u8]) -> io::Result<()> {
        write_all_at(&self.pages, bytes, page * PAGE)?;
        write_all_at(&self.sums, &checksum(bytes).to_le_bytes(), page * SUM)
    }
}

/// Appends a page to runs in order.
fn push_page(runs: &mut Vec<Range<u64>>, page: u64) {
    match runs.last_mut().filter(|run| run.end == page) {
        Some(run) => run.end += 1,
        None => runs.push(page..page + 1),
    }
}

/// Makes a folder for this user alone, unless it is there.
fn private_folder(path: &Path) -> io::Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path)
}

/// The checksum of a page; never zero.
fn checksum(bytes: &[u8]) -> u64 {
    let digest = *blake3::hash(bytes).as_bytes();
    u64::from_le_bytes(std::array::from_fn(|i| digest[i])).max(1)
}

/// Removes the files of a folder that were used least recently, until they take at most `most` bytes.
pub(super) fn trim(folder: &Path, most: u64) -> io::Result<()> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let meta = path.symlink_metadata().ok().filter(std::fs::Metadata::is_file);
        if let (true, Some(meta)) = (is_own(&path), meta) {
            let used = meta.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            all.push((used, disk_usage(&meta), path));
        }
    }
    all.sort();
    let mut sum: u64 = all.iter().map(|(_, bytes, _)| bytes).sum();
    for (_, bytes, path) in all {
        if sum <= most {
            break;
        }
        // Of both files of a pair, either may go first: a page without its sum is not there.
        std::fs::remove_file(path).or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => Ok(()),
            _ => Err(error),
        })?;
        sum -= bytes;
    }
    Ok(())
}

/// Whether a file is one of pages, by its name.
fn is_own(path: &Path) -> bool {
    let is_ending = path.extension().is_some_and(|ending| ending == PAGES || ending == SUMS);
    let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
    is_ending && name.len() == NAME && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Bytes on disk.
#[cfg(unix)]
fn disk_usage(meta: &std::fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::blocks(meta) * 512
}

#[cfg(not(unix))]
fn disk_usage(meta: &std::fs::Metadata) -> u64 {
    meta.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(run: Range<u64>) -> Vec<Range<u64>> {
        vec![run]
    }

    fn page_of(number: u64, bytes: u64) -> Vec<u8> {
        (0..bytes).map(|i| (i * 7 + number * 31) as u8).collect()
    }

    #[test]
    fn pages_are_found_again_and_damaged_ones_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = 3 * PAGE + 100;
        let store = PageStore::new(folder.path(), "a", bytes);
        let open = store.open().unwrap();
        let mut out = vec![0; 200];
        assert_eq!(open.read(PAGE - 100, &mut out).unwrap(), one(0..2));
        for page in [0, 1, 3] {
            let size = store.bytes(page..page + 1);
            open.write(page, &page_of(page, size.end - size.start)).unwrap();
        }
        assert_eq!(open.missing(0..4).unwrap(), one(2..3));
        let again = PageStore::new(folder.path(), "a", bytes);
        let again = again.open().unwrap();
        assert!(again.read(PAGE - 100, &mut out).unwrap().is_empty());
        assert_eq!(out[..100], page_of(0, PAGE)[PAGE as usize - 100..]);
        assert_eq!(out[100..], page_of(1, PAGE)[..100]);
        let mut last = vec![0; 100];
        assert!(again.read(3 * PAGE, &mut last).unwrap().is_empty());
        assert_eq!(last, page_of(3, 100));
        write_all_at(&again.pages, &[1, 2, 3], PAGE + 5).unwrap();
        assert_eq!(again.read(0, &mut vec![0; bytes as usize]).unwrap(), one(1..3));
        let other = PageStore::new(folder.path(), "b", bytes);
        assert_eq!(other.open().unwrap().missing(0..4).unwrap(), one(0..4));
        // Cut by another process.
        again.sums.set_len(0).unwrap();
        assert_eq!(again.missing(0..4).unwrap(), one(0..4));
    }

    #[test]
    fn the_oldest_files_go_first() {
        let folder = tempfile::tempdir().unwrap();
        for (age, name) in ["new", "old", "older"].iter().enumerate() {
            let store = PageStore::new(folder.path(), name, 4 * PAGE);
            let open = store.open().unwrap();
            (0..4).for_each(|page| open.write(page, &page_of(page, PAGE)).unwrap());
            let time = SystemTime::now() - std::time::Duration::from_secs(100 * age as u64);
            [&open.pages, &open.sums].iter().for_each(|file| file.set_modified(time).unwrap());
        }
        let others = ["other", "thesis.pages", "0123.sums"];
        for name in others {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        std::fs::create_dir(folder.path().join(format!("{}.pages", "a".repeat(NAME)))).unwrap();
        trim(folder.path(), 9 * PAGE).unwrap();
        let left = |name: &str| {
            let store = PageStore::new(folder.path(), name, 4 * PAGE);
            store.open().unwrap().missing(0..4).unwrap().is_empty()
        };
        assert!(left("new") && !left("older"));
        trim(folder.path(), 0).unwrap();
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        let own = std::fs::read_dir(folder.path()).unwrap().flatten();
        let own = own.filter(|entry| is_own(&entry.path()) && entry.path().is_file());
        assert_eq!(own.map(|entry| disk_usage(&entry.metadata().unwrap())).sum::<u64>(), 0);
    }
}
