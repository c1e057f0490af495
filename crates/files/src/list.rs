//! Expands inputs to files: folders, text lists, wildcard patterns and file names.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result, is_address};
use terrane_base::limits;

use super::glob;
use super::in_memory::is_made;
use super::name::{is_file, is_remote, name_of, path_of, shown};

/// Prefix of the path of a text list.
const LIST_PREFIX: char = '@';
/// Extensions of text lists without the prefix; point clouds as text have them, too.
const LIST_ENDINGS: [&str; 2] = ["txt", "csv"];
/// Maximum line length of a list in bytes.
const MAX_LINE: u64 = 4096;

/// A kind of input files.
pub struct FileKind {
    /// Noun for error messages: "grid".
    pub what: &'static str,
    /// True for names in a folder that belong to the kind.
    pub is_member: fn(&Path) -> bool,
    /// The path in an input that has more parts.
    pub file_name: fn(&str) -> &str,
}

/// Kinds of input paths.
enum InputPathKind<'a> {
    File,
    Folder,
    List(Cow<'a, Path>),
    Pattern,
}

impl FileKind {
    fn kind<'a>(&self, input: &'a str) -> InputPathKind<'a> {
        if is_made(input) {
            return InputPathKind::File;
        }
        let path = path_of((self.file_name)(input));
        if path.is_dir() {
            return InputPathKind::Folder;
        }
        if path.exists() {
            return if is_list(&path) { InputPathKind::List(path) } else { InputPathKind::File };
        }
        match input.strip_prefix(LIST_PREFIX) {
            // Question marks in URLs are not wildcards.
            _ if is_address(&path) => InputPathKind::File,
            Some(list) => InputPathKind::List(path_of(list)),
            None if glob::is_pattern(input) => InputPathKind::Pattern,
            None => InputPathKind::File,
        }
    }

    /// True if `input` stands for other files: a folder, a list of files, or a pattern. A `.txt` or `.csv`
    /// file is a list if its first line (except empty lines and comments) names an existing file; the prefix
    /// `@` makes any file a list.
    pub fn is_collection(&self, input: &str) -> bool {
        !matches!(self.kind(input), InputPathKind::File)
    }

    /// The files that `inputs` stand for, in order; the files of a folder or pattern are sorted by name.
    ///
    /// # Errors
    /// Unreadable folders, lists or patterns, or ones without files; more than [`limits::MAX_MEMBERS`] files.
    pub fn files(&self, inputs: &[String]) -> Result<Vec<String>> {
        self.found(inputs, |folder| self.folder(folder))
    }

    /// As [`files`](Self::files), including subfolders; hidden names and links to folders are skipped.
    ///
    /// # Errors
    /// As [`files`](Self::files); inputs without a folder.
    pub fn files_below(&self, inputs: &[String]) -> Result<Vec<String>> {
        if !inputs.iter().any(|input| matches!(self.kind(input), InputPathKind::Folder)) {
            return Err(Error::usage("‹recursive› requires a folder as input")
                .remedy("omit ‹recursive›, or pass a folder"));
        }
        self.found(inputs, |folder| {
            let folders = glob::folders_below(folder)?;
            let found = folders.iter().map(|folder| self.folder(folder));
            Ok(found.collect::<Result<Vec<_>>>()?.concat())
        })
    }

    fn found(
        &self,
        inputs: &[String],
        in_folder: impl Fn(&Path) -> Result<Vec<PathBuf>>,
    ) -> Result<Vec<String>> {
        let mut files = Vec::new();
        for input in inputs {
            let path = &*path_of(input);
            match self.kind(input) {
                InputPathKind::File => files.push(input.clone()),
                InputPathKind::Folder => {
                    let nothing = format!("holds no {}", self.what);
                    files.extend(names(path, in_folder(path)?, &nothing)?);
                }
                InputPathKind::List(list) => files.extend(listed(&list)?),
                InputPathKind::Pattern => {
                    files.extend(names(path, self.matching(path)?, "matches no file")?);
                }
            }
            limits::check("number of files of one input", files.len() as u64, limits::MAX_MEMBERS)?;
        }
        Ok(files)
    }

    /// The files that match a pattern. A pattern that ends in `**` matches folders only, and gives their
    /// files.
    fn matching(&self, pattern: &Path) -> Result<Vec<PathBuf>> {
        let found = glob::expand(pattern)?;
        if !pattern.ends_with("**") {
            return Ok(found);
        }
        let found = found.iter().map(|folder| self.folder(folder));
        Ok(found.collect::<Result<Vec<_>>>()?.concat())
    }

    /// The matching files of a folder (not of its subfolders), sorted by name.
    fn folder(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let fail = |e| Error::read(folder, e);
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(fail)? {
            let path = entry.map_err(fail)?.path();
            if (self.is_member)(&path) && path.is_file() {
                files.push(path);
                limits::check(
                    "number of files of one input",
                    files.len() as u64,
                    limits::MAX_MEMBERS,
                )
                .map_err(|e| e.in_file(folder))?;
            }
        }
        files.sort();
        Ok(files)
    }
}

/// The names of the files found at `place`; an error with the message `nothing` if there are none.
fn names(place: &Path, found: Vec<PathBuf>, nothing: &str) -> Result<Vec<String>> {
    if found.is_empty() {
        let error =
            if place.exists() { Error::bad_input(nothing) } else { Error::not_found(nothing) };
        return Err(error.in_file(place).remedy("check the name"));
    }
    found.into_iter().map(name_of).collect()
}

/// True if the first line of a text file names a file.
fn is_list(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    LIST_ENDINGS.contains(&ending.as_str())
        && first_line(path).is_some_and(|line| is_file(&resolve(path, &line)))
}

fn first_line(list: &Path) -> Option<String> {
    let mut lines = BufReader::new(std::fs::File::open(list).ok()?).take(64 * MAX_LINE);
    loop {
        let line = next_line(&mut lines).ok()??;
        if is_entry(&line) {
            return Some(line);
        }
    }
}

/// The next line, trimmed; `None` after the last.
fn next_line(from: &mut impl BufRead) -> std::io::Result<Option<String>> {
    let mut line = Vec::new();
    let bytes = from.take(MAX_LINE).read_until(b'\n', &mut line)?;
    if line.contains(&0) {
        return Err(std::io::ErrorKind::InvalidData.into());
    }
    let text = name_of(path_from(line)).map_err(|_| std::io::ErrorKind::InvalidData)?;
    Ok((bytes > 0).then(|| text.trim().to_owned()))
}

/// The bytes of a line as a path.
#[cfg(unix)]
fn path_from(line: Vec<u8>) -> PathBuf {
    use std::os::unix::ffi::OsStringExt;
    std::ffi::OsString::from_vec(line).into()
}

#[cfg(not(unix))]
fn path_from(line: Vec<u8>) -> PathBuf {
    String::from_utf8_lossy(&line).into_owned().into()
}

fn is_entry(line: &str) -> bool {
    !line.is_empty() && !line.starts_with('#')
}

/// The file named in a line of a list, relative to the folder of the list or else to the current folder.
fn resolve(list: &Path, line: &str) -> PathBuf {
    let line = path_of(line);
    let beside = list.parent().unwrap_or(Path::new("")).join(&line);
    if beside.exists() { beside } else { line.into_owned() }
}

/// Error of a list that cannot be read.
fn unreadable(list: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        std::io::ErrorKind::InvalidData => {
            Error::bad_input("is not a list of files: not a text file").in_file(list)
        }
        _ => Error::read(list, error),
    }
}

/// The files of a text list, one per line.
fn listed(list: &Path) -> Result<Vec<String>> {
    if is_remote(list) {
        let error = Error::unsupported("remote lists are not supported").in_file(list);
        return Err(error.remedy("download the list (curl -LO URL) and pass the local copy"));
    }
    let mut lines = BufReader::new(std::fs::File::open(list).map_err(|e| unreadable(list, e))?);
    let (mut files, mut number) = (Vec::new(), 0_u64);
    while let Some(line) = next_line(&mut lines).map_err(|e| unreadable(list, e))? {
        number += 1;
        if !is_entry(&line) {
            continue;
        }
        let path = resolve(list, &line);
        if !is_file(&path) {
            let line: String = shown(&line).chars().take(200).collect();
            return Err(Error::bad_input(format!(
                "lists {line}, which does not exist or is not a file"
            ))
            .in_file(list)
            .at(format_args!("line {number}"))
            .remedy("use paths relative to the folder of the list or to the current folder"));
        }
        files.push(name_of(path)?);
        limits::check("number of files of one input", files.len() as u64, limits::MAX_MEMBERS)
            .map_err(|e| e.in_file(list))?;
    }
    if files.is_empty() {
        return Err(Error::bad_input("lists no files")
            .in_file(list)
            .remedy("write one path per line"));
    }
    Ok(files)
}
