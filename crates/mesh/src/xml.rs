//! XML of meshes, read as a stream from any element on: start tags, texts, ends. No document type, no entity
//! but the five of XML itself, and limits on depth and on the size of a part.

use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::input::{Cursor, Input};
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Deepest nesting of elements.
const MOST_DEPTH: u64 = 32;
/// Most bytes of a tag, a text or a comment.
const MOST_PART_BYTES: u64 = 1 << 20;

/// A document being read.
pub(super) struct Xml<'a> {
    reader: Reader<Guard<'a>>,
    buffer: Vec<u8>,
    /// Elements that have begun and not ended, as far as they are known.
    depth: u64,
    /// Where reading began, in bytes.
    base: u64,
    path: &'a Path,
}

/// What comes next.
pub(super) enum Part<'b> {
    Start(Tag<'b>),
    Text(String),
    /// Of the element that began last.
    End,
    /// Of the document.
    Over,
}

/// The start of an element.
pub(super) struct Tag<'b>(BytesStart<'b>);

impl Tag<'_> {
    /// True when it is called so, whatever its prefix.
    pub(super) fn is(&self, name: &str) -> bool {
        self.0.local_name().as_ref() == name.as_bytes()
    }

    /// The attribute of that name.
    pub(super) fn attribute(&self, name: &str) -> Result<Option<String>> {
        for attribute in self.0.attributes() {
            let attribute = attribute.map_err(|e| not_xml(&e))?;
            if attribute.key.as_ref() == name.as_bytes() {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0);
                return Ok(Some(value.map_err(|e| not_xml(&e))?.into_owned()));
            }
        }
        Ok(None)
    }

    /// An attribute that is there, as a number of some kind.
    pub(super) fn number<T: std::str::FromStr>(&self, name: &str) -> Result<T> {
        let name_of = String::from_utf8_lossy(self.0.local_name().as_ref()).into_owned();
        let text = self.attribute(name)?;
        let text =
            text.ok_or_else(|| Error::bad_input(format!("{name_of} has no attribute {name}")))?;
        parsed(text.trim())
    }
}

impl<'a> Xml<'a> {
    /// The document from `offset` on, where an element begins.
    pub(super) fn new(input: &'a Input, offset: u64) -> Self {
        let guard = Guard { inner: input.from(offset), left: MOST_PART_BYTES };
        let mut reader = Reader::from_reader(guard);
        let config = reader.config_mut();
        config.expand_empty_elements = true;
        // What began before is not known to have begun.
        config.allow_unmatched_ends = offset > 0;
        Self { reader, buffer: Vec::new(), depth: 0, base: offset, path: input.path() }
    }

    /// Where the next part begins, in bytes.
    pub(super) fn offset(&self) -> u64 {
        self.base + self.reader.buffer_position()
    }

    /// The next part.
    pub(super) fn next(&mut self) -> Result<Part<'_>> {
        loop {
            let at = self.offset();
            self.buffer.clear();
            self.reader.get_mut().left = MOST_PART_BYTES;
            let place = |e: Error| e.in_file(self.path).at(format!("byte {at}"));
            // Events borrow the buffer, which is not used again before they are let go.
            let event = self.reader.read_event_into(&mut self.buffer);
            let text = match event.map_err(|e| place(failed(&e)))? {
                Event::Start(start) => {
                    self.depth += 1;
                    limits::check("depth of XML", self.depth, MOST_DEPTH).map_err(place)?;
                    return Ok(Part::Start(Tag(start.into_owned())));
                }
                Event::End(_) => {
                    self.depth = self.depth.saturating_sub(1);
                    return Ok(Part::End);
                }
                Event::Text(text) => text.decode().map(|text| text.into_owned()),
                Event::CData(text) => text.decode().map(|text| text.into_owned()),
                Event::GeneralRef(name) => {
                    let c = name.resolve_char_ref().map_err(|e| place(not_xml(&e)))?;
                    let name = name.decode().map_err(|e| place(not_xml(&e)))?;
                    Ok(reference(c, &name).map_err(place)?)
                }
                Event::DocType(_) => {
                    return Err(place(Error::unsupported(
                        "a document type (DTD) is not supported",
                    )));
                }
                Event::Eof if self.depth > 0 => {
                    return Err(place(Error::bad_input("ends in the middle of an element")));
                }
                Event::Eof => return Ok(Part::Over),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => continue,
            };
            return Ok(Part::Text(text.map_err(|e| place(not_xml(&e)))?));
        }
    }

    /// The text of the element at hand, to its end.
    pub(super) fn text(&mut self) -> Result<String> {
        let mut all = String::new();
        let mut open = 1;
        while open > 0 {
            match self.next()? {
                Part::Start(_) => open += 1,
                Part::Text(text) => all += &text,
                Part::End => open -= 1,
                Part::Over => return Err(self.bad("ends in the middle of an element")),
            }
            limits::check("length of a text in XML", all.len() as u64, MOST_PART_BYTES)
                .map_err(|e| self.place(e))?;
        }
        Ok(all)
    }

    /// The text of the element at hand: three numbers.
    pub(super) fn three<T: std::str::FromStr + Copy>(&mut self, what: &str) -> Result<[T; 3]> {
        let text = self.text()?;
        let mut words = text.split_ascii_whitespace();
        let mut word = || words.next().map(parsed::<T>).transpose();
        let found = [word(), word(), word(), word()];
        let [a, b, c, more] = found.map(|word| word.map_err(|e| self.place(e)));
        match (a?, b?, c?, more) {
            (Some(a), Some(b), Some(c), Ok(None)) => Ok([a, b, c]),
            (.., Ok(None)) => Err(self.bad(format!("{what} has fewer than three numbers"))),
            _ => Err(self.place(Error::unsupported(format!("{what} has more than three numbers")))),
        }
    }

    /// A complaint about this place.
    pub(super) fn bad(&self, message: impl Into<String>) -> Error {
        self.place(Error::bad_input(message))
    }

    /// Says of an error where it was found.
    pub(super) fn place(&self, error: Error) -> Error {
        error.in_file(self.path).at(format!("byte {}", self.offset()))
    }
}

/// The word as a number of some kind.
fn parsed<T: std::str::FromStr>(word: &str) -> Result<T> {
    word.parse().map_err(|_| {
        let word: String = word.chars().take(40).collect();
        Error::bad_input(format!("\"{}\" is not a number", word.escape_debug()))
    })
}

/// The text of `&name;`.
fn reference(c: Option<char>, name: &str) -> Result<String> {
    const KNOWN: [(&str, char); 5] =
        [("lt", '<'), ("gt", '>'), ("amp", '&'), ("apos", '\''), ("quot", '"')];
    let known = KNOWN.iter().find(|(known, _)| *known == name).map(|(_, c)| *c);
    c.or(known).map(String::from).ok_or_else(|| {
        let name: String = name.chars().take(40).collect();
        Error::unsupported(format!("entity &{name}; is not supported"))
    })
}

fn not_xml(error: &dyn std::fmt::Display) -> Error {
    Error::bad_input(format!("is not well-formed XML: {error}"))
}

/// Why a part was not read: it is too long, or no XML.
fn failed(error: &quick_xml::Error) -> Error {
    match error {
        quick_xml::Error::Io(e) if e.kind() == io::ErrorKind::FileTooLarge => {
            let most = MOST_PART_BYTES;
            limits::check("bytes of one part of XML", most + 1, most)
                .err()
                .unwrap_or_else(|| not_xml(&e))
        }
        other => not_xml(other),
    }
}

/// Appends a text as it stands in an attribute.
pub(super) fn push_escaped(text: &str, to: &mut Vec<u8>) {
    for c in text.chars() {
        let mut bytes = [0; 4];
        to.extend_from_slice(match c {
            '<' => b"&lt;",
            '>' => b"&gt;",
            '&' => b"&amp;",
            '"' => b"&quot;",
            // XML has no others of these, and no way to write them.
            c if c.is_control() => b"?",
            c => c.encode_utf8(&mut bytes).as_bytes(),
        });
    }
}

/// A text as it stands in an attribute.
pub(super) fn escaped(text: &str) -> String {
    let mut bytes = Vec::new();
    push_escaped(text, &mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Fails where one part takes more bytes than any would.
struct Guard<'a> {
    inner: BufReader<Cursor<'a>>,
    left: u64,
}

impl Read for Guard<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = self.fill_buf()?;
        let count = bytes.len().min(out.len());
        out[..count].copy_from_slice(&bytes[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Guard<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.left == 0 {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        self.inner.fill_buf()
    }

    fn consume(&mut self, bytes: usize) {
        self.left = self.left.saturating_sub(bytes as u64);
        self.inner.consume(bytes);
    }
}
