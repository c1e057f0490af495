//! The error type: kind of failure, file, place and remedy.

use std::borrow::Cow;
use std::fmt::{self, Write};
use std::io;
use std::path::{Path, PathBuf};

use crate::frontend::Frontend;

/// Result of every fallible call in this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, coarse enough to choose an exit code by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A check completed and found a broken promise (exit 1).
    CheckFailed,
    /// The request is invalid (exit 2).
    Usage,
    /// The input is missing, damaged or of another type (exit 65).
    BadInput,
    /// The input is valid but uses an unsupported feature, which is named (exit 65).
    Unsupported,
    /// A value in a file is beyond a limit of [`crate::limits`] (exit 65).
    Limit,
    /// Another process is at work or a prerequisite is missing: try again later (exit 69).
    NotYet,
    /// The output cannot be created, or cannot hold the result (exit 73).
    CannotWrite,
    /// Reading or writing failed midway: disk full, device error (exit 74).
    Io,
    /// The machine lacks a resource, for example memory (exit 75).
    Resource,
    /// A caught fault of this program (exit 70).
    Internal,
    /// The user stopped the job (exit 130).
    Interrupted,
}

impl ErrorKind {
    /// The process exit code for this kind, after `sysexits.h`.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::CheckFailed => 1,
            Self::Usage => 2,
            Self::BadInput | Self::Unsupported | Self::Limit => 65,
            Self::NotYet => 69,
            Self::Internal => 70,
            Self::CannotWrite => 73,
            Self::Io => 74,
            Self::Resource => 75,
            Self::Interrupted => 130,
        }
    }
}

/// True for a remote path such as `https://host/file` or `/vsicurl/https://host/file`.
pub fn is_address(path: &Path) -> bool {
    let name = path.to_string_lossy();
    let scheme = name.split_once("://").map(|(scheme, _)| scheme).filter(|s| !s.is_empty());
    let is_scheme = scheme.is_some_and(|scheme| {
        scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    name.starts_with("/vsi") || is_scheme
}

/// An error with its file, place and remedy. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub struct Error {
    kind: ErrorKind,
    message: String,
    path: Option<PathBuf>,
    place: Option<String>,
    remedy: Option<String>,
    #[source]
    source: Option<io::Error>,
    several: Option<Box<SeveralErrors>>,
}

/// The failures behind an error that stands for several files.
#[derive(Debug)]
struct SeveralErrors {
    failures: Vec<Error>,
    /// Number of files in the request.
    of: usize,
}

impl Error {
    /// A new error of `kind`; `message` says what is wrong, without file or remedy.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        let (message, several) = (message.into(), None);
        Self { kind, message, path: None, place: None, remedy: None, source: None, several }
    }

    /// One error for all `failures` among `of` files. Only failures of files are combined; of other failures, and of
    /// a single one, the first is returned.
    ///
    /// # Panics
    /// If there is no failure.
    pub fn several(mut failures: Vec<Self>, of: usize) -> Self {
        let first = failures.iter().position(|failure| !failure.is_about_a_file()).unwrap_or(0);
        if failures.len() < 2 || !failures[first].is_about_a_file() {
            return failures.swap_remove(first);
        }
        let message = format!("{} of {of} files cannot be used", failures.len());
        let mut error = Self::new(failures[0].kind, message).remedy("repair or omit these files");
        error.several = Some(Box::new(SeveralErrors { failures, of }));
        error
    }

    /// True if the fault is in a file, not in the request, the machine or the program.
    pub fn is_about_a_file(&self) -> bool {
        use ErrorKind::{BadInput, Io, Limit, Unsupported};
        matches!(self.kind, BadInput | Unsupported | Limit | Io)
    }

    /// True for a missing input file.
    pub fn is_missing(&self) -> bool {
        let source = self.source.as_ref().map(io::Error::kind);
        self.kind == ErrorKind::BadInput && source == Some(io::ErrorKind::NotFound)
    }

    /// The message spelled for a front end, without the failures of single files.
    pub fn summary(&self, frontend: Frontend) -> String {
        let Self { kind, message, remedy, .. } = self;
        match (&self.several, remedy) {
            (Some(_), Some(remedy)) => {
                Self::new(*kind, message).remedy(remedy).spelled(frontend).to_string()
            }
            _ => self.spelled(frontend).to_string(),
        }
    }

    /// The failures of single files, where the error stands for several.
    pub fn each(&self) -> &[Self] {
        match &self.several {
            Some(several) => &several.failures,
            None => &[],
        }
    }

    /// True if only some of the inputs failed, so that the others can be processed without them.
    pub fn spares_some(&self) -> bool {
        // Failures of the parts of one file carry the name of that file.
        let is_of_inputs = self.path.is_none();
        is_of_inputs && self.several.as_ref().is_some_and(|all| all.failures.len() < all.of)
    }

    /// A copy for another caller of the same operation; the source is reduced to its kind.
    #[must_use]
    pub fn again(&self) -> Self {
        let Self { kind, message, path, place, remedy, source, several: _ } = self;
        Self {
            kind: *kind,
            message: message.clone(),
            path: path.clone(),
            place: place.clone(),
            remedy: remedy.clone(),
            source: source.as_ref().map(|source| source.kind().into()),
            several: None,
        }
    }

    /// Shorthand for [`ErrorKind::Usage`].
    pub fn usage(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Usage, message)
    }

    /// Shorthand for [`ErrorKind::BadInput`].
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::BadInput, message)
    }

    /// [`ErrorKind::BadInput`] of a missing file.
    pub fn not_found(message: impl Into<String>) -> Self {
        let mut error = Self::bad_input(message);
        error.source = Some(io::ErrorKind::NotFound.into());
        error
    }

    /// Shorthand for [`ErrorKind::Unsupported`].
    pub fn unsupported(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Unsupported, message)
    }

    /// Shorthand for [`ErrorKind::Limit`] with the name of the limit, the value found and the maximum.
    pub fn limit(name: &str, found: impl fmt::Display, max: impl fmt::Display) -> Self {
        Self::new(ErrorKind::Limit, format!("{name} ({found}) exceeds the limit of {max}"))
    }

    /// An input/output failure while doing `action` ("read", "write", "create", ...).
    pub fn io(kind: ErrorKind, action: &str, source: io::Error) -> Self {
        let mut error = Self::new(kind, format!("cannot {action}: {source}"));
        error.source = Some(source);
        error
    }

    /// A missing input file; for a URL the message says that its kind is not supported.
    pub fn missing(path: &Path) -> Self {
        match is_address(path) {
            true => Self::unsupported("URLs of this kind are not supported").remedy(
                "use https, s3, gs or az, or download the file (curl -LO URL) and pass the local copy",
            ),
            false => Self::not_found("no such file").remedy("check the name"),
        }
        .in_file(path)
    }

    /// Failure to open or read an input file.
    pub fn read(path: &Path, source: io::Error) -> Self {
        // Streams hand on errors of this type as those of reading.
        let source = match source.downcast::<Self>() {
            Ok(error) => return error,
            Err(source) => source,
        };
        if source.kind() == io::ErrorKind::NotFound && is_address(path) {
            return Self::missing(path);
        }
        let kind = match source.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::UnexpectedEof
            | io::ErrorKind::IsADirectory => ErrorKind::BadInput,
            _ => ErrorKind::Io,
        };
        let is_denied = source.kind() == io::ErrorKind::PermissionDenied;
        let error = Self::io(kind, "read", source).in_file(path);
        match is_denied {
            true => error.remedy("change its permissions, or copy it to a readable folder"),
            false => error,
        }
    }

    /// Failure to create or write an output file.
    pub fn write(path: &Path, source: io::Error) -> Self {
        let kind = match source.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::AlreadyExists
            | io::ErrorKind::ReadOnlyFilesystem => ErrorKind::CannotWrite,
            _ => ErrorKind::Io,
        };
        let remedy = match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                Some("free some space, or choose another folder")
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Some("choose a writable folder")
            }
            _ => None,
        };
        let error = Self::io(kind, "write", source).in_file(path);
        match remedy {
            Some(remedy) => error.remedy(remedy),
            None => error,
        }
    }

    /// Attaches the file, unless one is attached already.
    #[must_use]
    pub fn in_file(mut self, path: &Path) -> Self {
        self.path.get_or_insert_with(|| path.to_path_buf());
        self
    }

    /// Replaces the attached file, where the file was read through a copy with another name.
    #[must_use]
    pub fn renamed(mut self, path: &Path) -> Self {
        self.path = Some(path.to_path_buf());
        self
    }

    /// Replaces the attached file by the file that refers to it, and makes the former the place of the error: users
    /// know the first and may never have heard of the second.
    #[must_use]
    pub fn named_by(mut self, path: &Path) -> Self {
        let within = self.place.take().map(|place| format!(": {place}")).unwrap_or_default();
        let inner = self.path.replace(path.to_path_buf());
        self.place = inner.map(|inner| format!("source {}{within}", inner.display()));
        self
    }

    /// Attaches the place in the file or job ("tile 3,4", "block 17", "line 6"), unless one is attached.
    /// Interruptions get no place.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        if self.kind != ErrorKind::Interrupted {
            self.place.get_or_insert_with(|| place.to_string());
        }
        self
    }

    /// Attaches a remedy.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }

    /// Adds an alternative to the attached remedy.
    #[must_use]
    pub fn or(self, otherwise: &str) -> Self {
        let remedy = match &self.remedy {
            Some(remedy) => format!("{remedy}, or {otherwise}"),
            None => otherwise.to_owned(),
        };
        self.remedy(remedy)
    }

    /// The kind of failure.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The file, if any.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The place in the file or job, if any.
    pub fn place(&self) -> Option<&str> {
        self.place.as_deref()
    }

    /// What is wrong, without file, place and remedy.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The remedy, if any.
    pub fn remedy_text(&self) -> Option<&str> {
        self.remedy.as_deref()
    }
}

/// An error with its options spelled for a front end; names of files stay as they are.
pub struct SpelledError<'a> {
    error: &'a Error,
    frontend: Frontend,
}

impl fmt::Display for SpelledError<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.write_line(f, Some(self.frontend))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_line(f, None)
    }
}

impl Error {
    /// Spells the options of the message for a front end.
    pub fn spelled(&self, frontend: Frontend) -> SpelledError<'_> {
        SpelledError { error: self, frontend }
    }

    fn write_line(&self, f: &mut fmt::Formatter<'_>, frontend: Option<Frontend>) -> fmt::Result {
        let mut line = OneLine(f);
        if let Some(path) = &self.path {
            write!(line, "{}: ", path.display())?;
        }
        if let Some(place) = &self.place {
            write!(line, "{place}: ")?;
        }
        write!(line, "{}", spelled(&self.message, frontend))?;
        for (i, inner) in self.each().iter().enumerate() {
            line.write_str(if i == 0 { ": " } else { " | " })?;
            match frontend {
                Some(frontend) => write!(line, "{}", inner.spelled(frontend))?,
                None => write!(line, "{inner}")?,
            }
        }
        if let Some(remedy) = &self.remedy {
            write!(line, "; {}", spelled(remedy, frontend))?;
        }
        Ok(())
    }
}

fn spelled(text: &str, frontend: Option<Frontend>) -> Cow<'_, str> {
    frontend.map_or(Cow::Borrowed(text), |frontend| frontend.spell(text))
}

/// All values, or one error with all failures.
///
/// # Errors
/// All failures, combined by [`Error::several`].
pub fn all<T>(found: Vec<Result<T>>) -> Result<Vec<T>> {
    let (of, mut failures) = (found.len(), Vec::new());
    let values = found.into_iter().filter_map(|one| one.map_err(|e| failures.push(e)).ok());
    let values: Vec<T> = values.collect();
    if failures.is_empty() { Ok(values) } else { Err(Error::several(failures, of)) }
}

/// Escapes line breaks and other control characters, which texts and names of files may contain.
struct OneLine<'a, 'b>(&'a mut fmt::Formatter<'b>);

impl fmt::Write for OneLine<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|c| match c.is_control() {
            true => write!(self.0, "{}", c.escape_default()),
            false => self.0.write_char(c),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displays_file_place_message_and_remedy_on_one_line() {
        let error = Error::bad_input("block is truncated")
            .in_file(Path::new("a.tif"))
            .at("block 3")
            .remedy("copy the file again");
        assert_eq!(error.to_string(), "a.tif: block 3: block is truncated; copy the file again");
    }

    #[test]
    fn whatever_a_file_says_stays_on_one_line() {
        let error = Error::unsupported("type \"\u{1b}[31m\n\"").in_file(Path::new("a\r\nb.npy"));
        assert_eq!(error.to_string(), r#"a\r\nb.npy: type "\u{1b}[31m\n""#);
    }

    #[test]
    fn refusals_of_the_system_come_with_a_remedy() {
        use io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem, StorageFull};
        for (kind, code) in [(PermissionDenied, 73), (ReadOnlyFilesystem, 73), (StorageFull, 74)] {
            let error = Error::write(Path::new("a"), kind.into());
            assert!(
                error.kind().exit_code() == code && error.to_string().contains("; "),
                "{error}"
            );
        }
        let error = Error::read(Path::new("a"), PermissionDenied.into());
        assert!(error.kind().exit_code() == 65 && error.to_string().contains("; "), "{error}");
    }

    #[test]
    fn failures_of_files_are_told_together_and_others_first() {
        let bad = |name: &str| Error::bad_input("is bad").in_file(Path::new(name));
        let found = || vec![Ok(1), Err(bad("a")), Ok(2), Err(bad("b"))];
        let together = all(found()).unwrap_err();
        assert_eq!(together.each().len(), 2);
        let told = together.to_string();
        assert!(told.starts_with("2 of 4 files cannot be used: a: is bad | b: is bad; "), "{told}");
        assert!(together.spares_some() && !together.in_file(Path::new("a.vrt")).spares_some());
        assert!(!Error::several(vec![bad("a"), bad("b")], 2).spares_some());
        assert_eq!(all(vec![Ok(1), Err(bad("a"))]).unwrap_err().to_string(), "a: is bad");
        let mut stopped = found();
        stopped.push(Err(Error::new(ErrorKind::Interrupted, "stopped")));
        let first = all(stopped).unwrap_err();
        assert_eq!((first.kind(), first.each().len()), (ErrorKind::Interrupted, 0));
        assert_eq!(all(vec![Ok(1), Ok(2)]).unwrap(), [1, 2]);
    }

    #[test]
    fn the_first_file_attached_stays() {
        let error = Error::usage("x").in_file(Path::new("a")).in_file(Path::new("b"));
        assert_eq!(error.path(), Some(Path::new("a")));
    }
}
