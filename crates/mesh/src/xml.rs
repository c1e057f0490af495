//! XML reader of meshes that can start at any element, with positions in errors.

use std::io::BufReader;
use std::path::Path;

use crate::input::MeshFile;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::RawFileReader;
use terrane_files::xml::{self, XmlEvent, XmlStartTag};

/// A document being read.
pub(super) struct MeshXmlReader<'a> {
    inner: xml::XmlReader<BufReader<RawFileReader<'a>>>,
    path: &'a Path,
}

impl<'a> MeshXmlReader<'a> {
    /// The document from `offset`, the start of an element.
    pub(super) fn new(input: &'a MeshFile, offset: u64) -> Self {
        Self { inner: xml::XmlReader::within(input.from(offset), offset), path: input.path() }
    }

    /// Offset of the next event in bytes.
    pub(super) fn offset(&self) -> u64 {
        self.inner.offset()
    }

    /// The next event.
    pub(super) fn next(&mut self) -> Result<XmlEvent> {
        let at = self.offset();
        self.inner.next().map_err(|e| e.in_file(self.path).at(format!("byte {at}")))
    }

    /// The text of the current element, to its end.
    pub(super) fn text(&mut self) -> Result<String> {
        let mut all = String::new();
        let mut open = 1;
        while open > 0 {
            match self.next()? {
                XmlEvent::Start(_) => open += 1,
                XmlEvent::Text(text) => all += &text,
                XmlEvent::End => open -= 1,
                XmlEvent::Over => return Err(self.bad("truncated element")),
            }
            limits::check("length of an XML text", all.len() as u64, limits::MAX_HEADER_BYTES)
                .map_err(|e| self.place(e))?;
        }
        Ok(all)
    }

    /// Three numbers of the text of the current element.
    pub(super) fn three<T: std::str::FromStr + Copy>(&mut self, what: &str) -> Result<[T; 3]> {
        let text = self.text()?;
        let mut numbers = text.split_ascii_whitespace().map(parsed::<T>);
        let [a, b, c, more] =
            [(); 4].map(|()| numbers.next().transpose().map_err(|e| self.place(e)));
        match (a?, b?, c?, more) {
            (Some(a), Some(b), Some(c), Ok(None)) => Ok([a, b, c]),
            (.., Ok(None)) => Err(self.bad(format!("{what} has fewer than three numbers"))),
            _ => Err(self.place(Error::unsupported(format!("{what} has more than three numbers")))),
        }
    }

    /// An error at this position.
    pub(super) fn bad(&self, message: impl Into<String>) -> Error {
        self.place(Error::bad_input(message))
    }

    /// Attaches the position to an error.
    pub(super) fn place(&self, error: Error) -> Error {
        error.in_file(self.path).at(format!("byte {}", self.offset()))
    }
}

/// A required numeric attribute.
pub(super) fn number<T: std::str::FromStr>(tag: &XmlStartTag, name: &str) -> Result<T> {
    let text = tag
        .value(name)?
        .ok_or_else(|| Error::bad_input(format!("{} has no attribute {name}", tag.local_name())))?;
    parsed(text.trim())
}

/// Parses the word as a number.
fn parsed<T: std::str::FromStr>(word: &str) -> Result<T> {
    word.parse().map_err(|_| {
        let word: String = word.chars().take(40).collect();
        Error::bad_input(format!("\"{}\" is not a number", word.escape_debug()))
    })
}
