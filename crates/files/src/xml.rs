//! Streaming XML reader: start tags, texts, end tags. Document types and entities other than the five of XML
//! are rejected, and depth and token size are limited. Skipped elements must be well-formed as well.

use std::borrow::Cow;
use std::io::{self, BufRead, Read};

use quick_xml::XmlVersion;
use quick_xml::escape::unescape;
use quick_xml::events::attributes;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::QName;
use quick_xml::reader::Reader;

use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Deepest nesting of elements.
const MAX_DEPTH: u64 = 32;
/// Most attributes of an element.
const MAX_ATTRIBUTES: u64 = 4096;
/// Most bytes of a tag, a text or a comment.
const MAX_PART_BYTES: u64 = limits::MAX_HEADER_BYTES;

/// A document being read.
pub struct XmlReader<R> {
    reader: Reader<PartSizeGuard<R>>,
    buffer: Vec<u8>,
    /// Open elements.
    depth: u64,
    /// Byte offset at which reading began.
    base: u64,
}

/// An XML event.
pub enum XmlEvent {
    /// An element begins.
    Start(XmlStartTag),
    /// Text, or a piece of one.
    Text(String),
    /// The element that began last ends.
    End,
    /// The document ends.
    Over,
}

/// The start tag of an element.
pub struct XmlStartTag(BytesStart<'static>);

impl XmlStartTag {
    /// Its name, with its prefix.
    pub fn name(&self) -> &str {
        self.0.name().into_inner()
    }

    /// Its name without the prefix.
    pub fn local_name(&self) -> &str {
        self.0.local_name().into_inner()
    }

    /// Its attributes, names with their prefixes.
    ///
    /// # Errors
    /// References to unknown entities; too many attributes.
    pub fn attributes(&self) -> Result<Vec<(&str, String)>> {
        let mut found = Vec::new();
        let mut all = XmlAttributes { bytes: self.0.as_bytes(), at: self.name().len() };
        while let Some(attribute) = all.next()? {
            found.push((text(attribute.name)?, attribute.resolved()?.into_owned()));
            limits::check(
                "number of attributes of an element",
                found.len() as u64,
                MAX_ATTRIBUTES,
            )?;
        }
        Ok(found)
    }

    /// The value of the attribute of that name, owned.
    ///
    /// # Errors
    /// As [`attributes`](Self::attributes).
    pub fn attribute(&self, name: &str) -> Result<Option<String>> {
        Ok(self.value(name)?.map(Cow::into_owned))
    }

    /// The value of the attribute `name`, borrowed if it contains no reference.
    ///
    /// # Errors
    /// As [`attributes`](Self::attributes).
    pub fn value(&self, name: &str) -> Result<Option<Cow<'_, str>>> {
        let mut all = XmlAttributes { bytes: self.0.as_bytes(), at: self.name().len() };
        while let Some(attribute) = all.next()? {
            if attribute.name == name.as_bytes() {
                return attribute.resolved().map(Some);
            }
        }
        Ok(None)
    }
}

impl<R: BufRead> XmlReader<R> {
    /// A document read from its start.
    pub fn new(from: R) -> Self {
        Self::within(from, 0)
    }

    /// A document whose beginning was read before: starts at an element at byte `base`. The earlier part is
    /// not checked again.
    pub fn within(from: R, base: u64) -> Self {
        let mut reader = Reader::from_reader(PartSizeGuard { inner: from, left: MAX_PART_BYTES });
        let config = reader.config_mut();
        config.expand_empty_elements = true;
        config.check_comments = true;
        // Elements opened before `base` are unknown.
        config.allow_unmatched_ends = base > 0;
        Self { reader, buffer: Vec::new(), depth: 0, base }
    }

    /// Byte offset of the next event.
    pub fn offset(&self) -> u64 {
        self.base + self.reader.buffer_position()
    }

    /// The next part.
    ///
    /// # Errors
    /// Malformed XML; a document type or an unknown entity; an exceeded limit.
    #[expect(clippy::should_implement_trait, reason = "an iterator has no errors of its own")]
    pub fn next(&mut self) -> Result<XmlEvent> {
        loop {
            let is_begun = self.offset() > 0;
            self.buffer.clear();
            self.reader.get_mut().left = MAX_PART_BYTES;
            let event = self.reader.read_event_into(&mut self.buffer).map_err(|e| failed(&e))?;
            if self.base == 0 {
                check_text(&event)?;
            }
            match event {
                Event::Start(start) => {
                    if self.base == 0 {
                        check_tag(&start)?;
                    }
                    self.depth += 1;
                    limits::check("depth of XML elements", self.depth, MAX_DEPTH)?;
                    return Ok(XmlEvent::Start(XmlStartTag(start.into_owned())));
                }
                Event::End(_) => {
                    self.depth = self.depth.saturating_sub(1);
                    return Ok(XmlEvent::End);
                }
                Event::Text(text) if text.contains("]]>") => return Err(not_xml(&"]]> in a text")),
                Event::Text(text) => return Ok(XmlEvent::Text(text.into_inner().into_owned())),
                Event::CData(text) => return Ok(XmlEvent::Text(text.into_inner().into_owned())),
                Event::GeneralRef(name) => {
                    let c = name.resolve_char_ref().map_err(|e| not_xml(&e))?;
                    return reference(c, &name).map(XmlEvent::Text);
                }
                Event::DocType(_) => return Err(no_document_type()),
                Event::Eof if self.depth > 0 => {
                    return Err(Error::bad_input("file ends inside an element"));
                }
                Event::Eof => return Ok(XmlEvent::Over),
                Event::Decl(_) if is_begun => return Err(not_xml(&"a second declaration")),
                Event::PI(pi) if !is_name(pi.target()) => {
                    return Err(not_xml(&"processing instruction without a name"));
                }
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
    }

    /// Skips the rest of the current element.
    ///
    /// # Errors
    /// As [`next`](Self::next); the end of the document.
    pub fn skip(&mut self) -> Result<()> {
        let mut open = 1;
        while open > 0 {
            match self.next()? {
                XmlEvent::Start(_) => open += 1,
                XmlEvent::End => open -= 1,
                XmlEvent::Text(_) => {}
                XmlEvent::Over => return Err(Error::bad_input("file ends inside an element")),
            }
        }
        Ok(())
    }

    /// Checks that only comments and white space follow the root element.
    ///
    /// # Errors
    /// As [`next`](Self::next); other content.
    pub fn finish(&mut self) -> Result<()> {
        loop {
            match self.next()? {
                XmlEvent::Over => return Ok(()),
                XmlEvent::Text(text) if text.trim_ascii().is_empty() => {}
                _ => return Err(Error::bad_input("content follows the root element")),
            }
        }
    }
}

/// Checks a start tag: a name, then quoted attributes, each preceded by a space and unique.
fn check_tag(start: &str) -> Result<()> {
    let end = start.bytes().position(|c| has(c, SPACE)).unwrap_or(start.len());
    let mut all = XmlAttributes { bytes: start.as_bytes(), at: end };
    let mut is_sound = is_name(&start[..end]);
    // Most tags have few attributes, so names are compared pairwise.
    let (mut few, mut count, mut more) = ([&[][..]; 8], 0, Vec::new());
    while let Some(XmlAttribute { name, value, has_reference }) = all.next()? {
        is_sound &= !few.iter().any(|other| other.first() == name.first() && *other == name);
        is_sound &= !has_reference || text(value).is_ok_and(|value| unescape(value).is_ok());
        match few.get_mut(count) {
            Some(slot) => *slot = name,
            None => more.push(name),
        }
        count += 1;
    }
    more.sort_unstable();
    is_sound &= more.windows(2).all(|pair| pair[0] != pair[1]);
    if is_sound { Ok(()) } else { Err(damaged_tag()) }
}

/// An attribute with its raw value.
struct XmlAttribute<'a> {
    name: &'a [u8],
    value: &'a [u8],
    has_reference: bool,
}

/// Iterator over the attributes of a start tag.
struct XmlAttributes<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> XmlAttributes<'a> {
    #[inline]
    fn next(&mut self) -> Result<Option<XmlAttribute<'a>>> {
        let bytes = self.bytes;
        let start = skip(bytes, SPACE, self.at);
        if start == bytes.len() {
            return Ok(None);
        }
        let end = skip(bytes, NAME, start);
        let equals = skip(bytes, SPACE, end);
        let quote = skip(bytes, SPACE, equals + 1);
        let has_name = start > self.at && has(bytes[start], NAME_START);
        let mark = match bytes.get(quote) {
            Some(mark @ (b'"' | b'\'')) if has_name && bytes[equals] == b'=' => *mark,
            _ => return Err(damaged_tag()),
        };
        let mut at = skip(bytes, IN_VALUE, quote + 1);
        let mut has_reference = false;
        while let Some(&c) = bytes.get(at).filter(|c| **c != mark && **c != b'<') {
            has_reference |= c == b'&';
            at = skip(bytes, IN_VALUE, at + 1);
        }
        if bytes.get(at) != Some(&mark) {
            return Err(damaged_tag());
        }
        self.at = at + 1;
        let (name, value) = (&bytes[start..end], &bytes[quote + 1..at]);
        Ok(Some(XmlAttribute { name, value, has_reference }))
    }
}

/// Character classes of bytes: white space; first byte of a name; any byte of a name; bytes of a value that
/// need no further check.
const SPACE: u8 = 1;
const NAME_START: u8 = 2;
const NAME: u8 = 4;
const IN_VALUE: u8 = 8;

/// The classes of each byte. Characters beyond ASCII count as letters.
static CLASSES: [u8; 256] = {
    let mut classes = [0; 256];
    let mut c = 0;
    while c < 256 {
        let byte = c as u8;
        if matches!(byte, b' ' | b'\t' | b'\r' | b'\n') {
            classes[c] |= SPACE;
        }
        if byte.is_ascii_alphabetic() || matches!(byte, b'_' | b':' | 0x80..) {
            classes[c] |= NAME_START | NAME;
        }
        if byte.is_ascii_digit() || matches!(byte, b'-' | b'.') {
            classes[c] |= NAME;
        }
        if !matches!(byte, b'"' | b'\'' | b'<' | b'&') {
            classes[c] |= IN_VALUE;
        }
        c += 1;
    }
    classes
};

fn has(c: u8, kind: u8) -> bool {
    CLASSES[usize::from(c)] & kind != 0
}

fn text(bytes: &[u8]) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|e| not_xml(&e))
}

fn is_name(name: &str) -> bool {
    name.bytes().next().is_some_and(|c| has(c, NAME_START)) && name.bytes().all(|c| has(c, NAME))
}

impl<'a> XmlAttribute<'a> {
    /// The value with references resolved and white space normalised to spaces.
    fn resolved(&self) -> Result<Cow<'a, str>> {
        let value = text(self.value)?;
        if !self.has_reference && !value.bytes().any(|c| c < b' ') {
            return Ok(Cow::Borrowed(value));
        }
        let whole = attributes::Attribute { key: QName(""), value: Cow::Borrowed(value) };
        let found = whole.normalized_value(XmlVersion::Implicit1_0).map_err(|e| not_xml(&e))?;
        Ok(Cow::Owned(found.into_owned()))
    }
}

fn damaged_tag() -> Error {
    not_xml(&"malformed tag")
}

/// The first place at or after `at` whose byte is not of this kind.
#[inline]
fn skip(bytes: &[u8], kind: u8, mut at: usize) -> usize {
    while at < bytes.len() && has(bytes[at], kind) {
        at += 1;
    }
    at
}

/// Fails for characters that are not allowed in XML.
fn check_text(text: &str) -> Result<()> {
    // Branch-free, so that the loop is vectorised; 0xef is the first byte of the two other forbidden
    // characters.
    let may_be_forbidden = text.bytes().fold(false, |odd, c| {
        odd | ((c < b' ' && !matches!(c, b'\t' | b'\n' | b'\r')) | (c == 0xef))
    });
    match may_be_forbidden && text.contains(is_forbidden) {
        true => Err(not_xml(&"control characters are not allowed")),
        false => Ok(()),
    }
}

fn is_forbidden(c: char) -> bool {
    c < ' ' && !matches!(c, '\t' | '\n' | '\r') || matches!(c, '\u{fffe}' | '\u{ffff}')
}

/// The text of `&name;`.
fn reference(c: Option<char>, name: &str) -> Result<String> {
    const KNOWN: [(&str, char); 5] =
        [("lt", '<'), ("gt", '>'), ("amp", '&'), ("apos", '\''), ("quot", '"')];
    let known = KNOWN.iter().find(|(known, _)| *known == name).map(|(_, c)| *c);
    c.or(known).map(String::from).ok_or_else(|| {
        let name: String = name.chars().take(40).collect();
        Error::unsupported(format!("entity &{name}; is not supported"))
            .remedy("replace it by its text")
    })
}

fn not_xml(error: &dyn std::fmt::Display) -> Error {
    Error::bad_input(format!("is not well-formed XML: {error}"))
}

fn no_document_type() -> Error {
    Error::unsupported("document type declarations (DTD) are not supported")
        .remedy("remove the declaration from the file")
}

/// Error of a token that is too long, not UTF-8, or not XML.
fn failed(error: &quick_xml::Error) -> Error {
    match error {
        quick_xml::Error::Io(e) if e.kind() == io::ErrorKind::FileTooLarge => {
            Error::limit("size of one XML token in bytes", MAX_PART_BYTES + 1, MAX_PART_BYTES)
        }
        quick_xml::Error::Encoding(_) => {
            Error::bad_input("is not UTF-8").remedy("convert the file to UTF-8")
        }
        other => not_xml(other),
    }
}

/// `text` escaped for use in an attribute.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            // XML 1.0 cannot represent them.
            c if c.is_control() => out.push('?'),
            c => out.push(c),
        }
    }
    out
}

/// Reader that fails when one token exceeds [`MAX_PART_BYTES`].
struct PartSizeGuard<R> {
    inner: R,
    left: u64,
}

impl<R: BufRead> Read for PartSizeGuard<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = self.fill_buf()?;
        let count = bytes.len().min(out.len());
        out[..count].copy_from_slice(&bytes[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for PartSizeGuard<R> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_passed_over_is_well_formed_too() {
        let sound = "<?xml version='1.0'?>\n<a><b/></a>\n<!-- c --><?d e?>\n";
        let skipped = |text: &str| {
            let mut xml = XmlReader::new(text.as_bytes());
            while !matches!(xml.next()?, XmlEvent::Start(_)) {}
            xml.skip()?;
            xml.finish()
        };
        skipped(sound).unwrap();
        skipped("<a><b c = '1'\td=\"2\" ></b ></a>").unwrap();
        let too_late = "<a/><?xml version='1.0'?>";
        for inside in [
            "<b c=1/>",
            "<b c/>",
            "<b c='1'd='2'/>",
            "<b c='1' c='2'/>",
            "<b a='' b='' c='' d='' e='' f='' g='' h='' i='' a=''/>",
            "<b a='' b='' c='' d='' e='' f='' g='' h='' i='' j='' i=''/>",
            "<b c='<'/>",
            "<b c='&'/>",
            "<b 1c='2'/>",
            "<1/>",
            "< b/>",
            "<b></c>",
            "<b>",
            "</b>",
            "x & y",
            "&amp",
            "&#0;",
            "&#x110000;",
            "&nbsp;",
            "]]>",
            "\u{1}",
            "<b c='\u{2}'/>",
            "<!-- -- -->",
            "<!-- \u{3} -->",
            "<![CDATA[ x",
            "<!x>",
            "<??>",
            "<? x?>",
            "<b",
            "<b c='",
            "<?xml version='1.0'?>",
        ] {
            for text in [format!("<a>{inside}</a>"), format!("<a><u>{inside}</u></a>")] {
                assert!(skipped(&text).is_err(), "{text}");
            }
        }
        for behind in ["<b/>", "x", "&amp;", "</a>", "<![CDATA[x]]>", "<!DOCTYPE a>", "<", "\u{1}"]
        {
            assert!(skipped(&format!("{sound}{behind}")).is_err(), "{behind}");
        }
        assert!(skipped(too_late).is_err());
    }

    #[test]
    fn values_are_resolved() {
        let text = "<a b='1&lt;2&#x41;' cc=\"it's\" d='' e='\u{e9}' f = ' 6 ' g='7' h='8\n9' i='9' j='10'/>";
        let Ok(XmlEvent::Start(tag)) = XmlReader::new(text.as_bytes()).next() else {
            panic!("a tag")
        };
        let expected = [
            ("b", "1<2A"),
            ("cc", "it's"),
            ("d", ""),
            ("e", "\u{e9}"),
            ("f", " 6 "),
            ("g", "7"),
            ("h", "8 9"),
            ("i", "9"),
            ("j", "10"),
        ];
        let found = tag.attributes().unwrap();
        let found: Vec<(&str, &str)> =
            found.iter().map(|(name, value)| (*name, &**value)).collect();
        assert_eq!(found, expected);
        for (name, value) in expected {
            assert_eq!(tag.value(name).unwrap().as_deref(), Some(value));
        }
        assert_eq!(tag.value("c").unwrap(), None);
    }
}
