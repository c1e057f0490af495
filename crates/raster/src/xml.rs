//! XML as VRTs and sidecars need it, read as a stream: elements, attributes and text. No document
//! type, no entity but the five of XML itself, and limits on depth and size. What is passed over must be
//! well-formed, too: a document damaged anywhere may be damaged in what is used.

use std::collections::HashSet;
use std::io::BufRead;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Deepest nesting of elements.
const MOST_DEPTH: u32 = 32;
/// Most elements kept of one branch.
const MOST_NODES: u64 = 4096;

/// A document being read.
pub(super) struct Xml<R> {
    reader: Reader<R>,
    buffer: Vec<u8>,
    depth: u32,
    /// True once anything was read.
    is_begun: bool,
}

/// The start of an element.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Tag {
    pub(super) name: String,
    attributes: Vec<(String, String)>,
}

/// An element read whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Node {
    pub(super) tag: Tag,
    /// Its text, without white space around it.
    pub(super) text: String,
    pub(super) children: Vec<Node>,
}

/// What comes next inside an element.
enum Next {
    Start(Tag),
    Text(String),
    End,
}

impl Tag {
    /// The attribute `name`, in any case.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let is_it = |(found, _): &&(String, String)| found.eq_ignore_ascii_case(name);
        self.attributes.iter().find(is_it).map(|(_, value)| value.as_str())
    }

    /// True when the element is called `name`, in any case.
    pub(super) fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }
}

impl Node {
    /// The first child called `name`.
    pub(super) fn child(&self, name: &str) -> Option<&Node> {
        self.children.iter().find(|child| child.tag.is(name))
    }

    /// Its text as a number, which may be NaN.
    pub(super) fn number(&self) -> Result<f64> {
        parsed(&self.text).ok_or_else(|| {
            let (name, text) = (&self.tag.name, short(&self.text));
            Error::bad_input(format!("{name} is not a number: {text:?}"))
        })
    }

    /// Its text as a number that is neither NaN nor infinite.
    pub(super) fn finite(&self) -> Result<f64> {
        let number = self.number()?;
        if number.is_finite() {
            return Ok(number);
        }
        Err(Error::bad_input(format!("{} is not finite: {number}", self.tag.name)))
    }
}

/// GDAL's six coefficients, separated by commas.
pub(super) fn geotransform(text: &str) -> Result<[f64; 6]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(parsed).collect();
    let numbers = numbers.and_then(|numbers| <[f64; 6]>::try_from(numbers).ok());
    numbers.ok_or_else(|| {
        Error::bad_input(format!("GeoTransform is not six numbers: {:?}", short(text)))
    })
}

pub(super) fn parsed(text: &str) -> Option<f64> {
    text.trim().parse().ok()
}

/// Enough of a hostile text to recognise it by.
pub(super) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

impl<R: BufRead> Xml<R> {
    pub(super) fn new(from: R) -> Self {
        let mut reader = Reader::from_reader(from);
        reader.config_mut().expand_empty_elements = true;
        reader.config_mut().check_comments = true;
        Self { reader, buffer: Vec::new(), depth: 0, is_begun: false }
    }

    /// The outermost element.
    pub(super) fn root(&mut self) -> Result<Tag> {
        match self.next()? {
            Next::Start(tag) => Ok(tag),
            Next::Text(text) if text.trim().is_empty() => self.root(),
            _ => Err(self.broken("has no element")),
        }
    }

    /// The next child of the element at hand; `None` once that has ended.
    pub(super) fn child(&mut self) -> Result<Option<Tag>> {
        loop {
            match self.next()? {
                Next::Start(tag) => return Ok(Some(tag)),
                Next::End => return Ok(None),
                Next::Text(_) => {}
            }
        }
    }

    /// The rest of the element that began with `tag`.
    pub(super) fn node(&mut self, tag: Tag) -> Result<Node> {
        self.branch(tag, &mut 0)
    }

    fn branch(&mut self, tag: Tag, nodes: &mut u64) -> Result<Node> {
        *nodes += 1;
        limits::check("elements in one of XML", *nodes, MOST_NODES)?;
        let mut node = Node { tag, ..Node::default() };
        loop {
            match self.next()? {
                Next::Start(tag) => node.children.push(self.branch(tag, nodes)?),
                Next::Text(text) => node.text += &text,
                Next::End => break,
            }
            let bytes = node.text.len() as u64;
            limits::check("bytes of a text in XML", bytes, limits::MAX_HEADER_BYTES)?;
        }
        node.text = node.text.trim().to_owned();
        Ok(node)
    }

    /// Passes over the rest of the element at hand.
    pub(super) fn skip(&mut self) -> Result<()> {
        let mut open = 1;
        while open > 0 {
            match self.next()? {
                Next::Start(_) => open += 1,
                Next::End => open -= 1,
                Next::Text(_) => {}
            }
        }
        Ok(())
    }

    /// Makes sure that nothing but comments and space follow the outermost element, which has ended.
    pub(super) fn finish(&mut self) -> Result<()> {
        loop {
            self.buffer.clear();
            let event = self.reader.read_event_into(&mut self.buffer);
            match event.map_err(|e| not_xml(&e))? {
                Event::Eof => return Ok(()),
                Event::Text(text) if text.trim_ascii().is_empty() => {}
                Event::PI(pi) if is_name(pi.target()) => {}
                Event::Comment(comment) => check_text(&comment)?,
                _ => return Err(self.broken("goes on behind its outermost element")),
            }
        }
    }

    /// Where the reader is.
    pub(super) fn place(&self) -> String {
        format!("byte {}", self.reader.buffer_position())
    }

    fn next(&mut self) -> Result<Next> {
        loop {
            self.is_begun = self.reader.buffer_position() > 0;
            self.buffer.clear();
            let event = self.reader.read_event_into(&mut self.buffer);
            let event = match event {
                Ok(event) => event,
                Err(e) => return Err(not_xml(&e)),
            };
            limits::check(
                "bytes of one part of XML",
                event.len() as u64,
                limits::MAX_HEADER_BYTES,
            )?;
            match event {
                Event::Start(start) => {
                    self.depth += 1;
                    limits::check("depth of XML", self.depth.into(), MOST_DEPTH.into())?;
                    return tag(&start).map(Next::Start);
                }
                Event::End(_) => {
                    self.depth -= 1;
                    return Ok(Next::End);
                }
                Event::Text(text) => {
                    check_text(&text)?;
                    if text.windows(3).any(|three| three == b"]]>") {
                        return Err(not_xml(&"]]> in a text"));
                    }
                    return Ok(Next::Text(text.decode().map_err(|e| not_xml(&e))?.into_owned()));
                }
                Event::CData(text) => {
                    check_text(&text)?;
                    return Ok(Next::Text(text.decode().map_err(|e| not_xml(&e))?.into_owned()));
                }
                Event::GeneralRef(name) => {
                    let c = name.resolve_char_ref().map_err(|e| not_xml(&e))?;
                    let name = name.decode().map_err(|e| not_xml(&e))?;
                    return reference(c, &name).map(Next::Text);
                }
                Event::DocType(_) => return Err(no_document_type()),
                Event::Eof => return Err(Error::bad_input("ends in the middle of an element")),
                Event::Comment(comment) => check_text(&comment)?,
                Event::Decl(_) if self.is_begun => return Err(not_xml(&"a second declaration")),
                Event::PI(pi) if !is_name(pi.target()) => {
                    return Err(not_xml(&"an instruction without a name"));
                }
                Event::Empty(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
    }

    fn broken(&self, message: &str) -> Error {
        Error::bad_input(message).at(self.place())
    }
}

fn tag(start: &BytesStart<'_>) -> Result<Tag> {
    check_tag(start)?;
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).map_err(|e| not_xml(&e));
    let mut attributes = Vec::new();
    // Repeated names were looked for.
    for attribute in start.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| not_xml(&e))?;
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| not_xml(&e))?;
        attributes.push((text(attribute.key.as_ref())?, value.into_owned()));
        limits::check("attributes of an element", attributes.len() as u64, MOST_NODES)?;
    }
    Ok(Tag { name: text(start.name().as_ref())?, attributes })
}

/// Fails unless the bytes of a start tag are a name and attributes with a space before each, quoted,
/// and each there once.
fn check_tag(start: &[u8]) -> Result<()> {
    check_text(start)?;
    let is_space = |c: &u8| matches!(c, b' ' | b'\t' | b'\r' | b'\n');
    let split = |text: &[u8], is_end: &dyn Fn(&u8) -> bool| {
        let end = text.iter().position(is_end).unwrap_or(text.len());
        (text[..end].to_vec(), end)
    };
    let (name, mut at) = split(start, &is_space);
    let mut names = HashSet::new();
    let mut is_sound = is_name(&name);
    while is_sound {
        let (_, spaces) = split(&start[at..], &|c| !is_space(c));
        if at + spaces == start.len() {
            return Ok(());
        }
        let (name, end) = split(&start[at + spaces..], &|c| is_space(c) || *c == b'=');
        let rest = start[at + spaces + end..].trim_ascii_start();
        let value = rest.strip_prefix(b"=").unwrap_or_default().trim_ascii_start();
        let quote = value.first().copied().filter(|c| matches!(c, b'"' | b'\''));
        let inside = value.get(1..).unwrap_or_default();
        let length = quote.and_then(|quote| inside.iter().position(|c| *c == quote));
        is_sound = spaces > 0
            && is_name(&name)
            && length.is_some_and(|length| !inside[..length].contains(&b'<'))
            && names.insert(name);
        at = start.len() - inside.len() + length.map_or(0, |length| length + 1);
    }
    Err(not_xml(&"a tag is damaged"))
}

/// Whether the bytes may be a name: what is beyond ASCII is taken to be letters.
fn is_name(name: &[u8]) -> bool {
    let is_letter = |c: u8| c.is_ascii_alphabetic() || matches!(c, b'_' | b':' | 0x80..);
    name.first().is_some_and(|c| is_letter(*c))
        && name.iter().all(|c| is_letter(*c) || c.is_ascii_digit() || matches!(c, b'-' | b'.'))
}

/// Fails where bytes are no text, or hold characters that XML has not.
fn check_text(bytes: &[u8]) -> Result<()> {
    let text = std::str::from_utf8(bytes).map_err(|e| not_xml(&e))?;
    let is_none = |c: char| {
        c < ' ' && !matches!(c, '\t' | '\n' | '\r') || matches!(c, '\u{fffe}' | '\u{ffff}')
    };
    match text.contains(is_none) {
        true => Err(not_xml(&"it holds control characters")),
        false => Ok(()),
    }
}

/// The text of `&name;`.
fn reference(c: Option<char>, name: &str) -> Result<String> {
    let known = match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "apos" => Some('\''),
        "quot" => Some('"'),
        _ => None,
    };
    c.or(known).map(String::from).ok_or_else(|| {
        let name: String = name.chars().take(40).collect();
        Error::unsupported(format!("entity &{name}; is not supported")).remedy("write it out")
    })
}

fn not_xml(error: &dyn std::fmt::Display) -> Error {
    Error::bad_input(format!("is not well-formed XML: {error}"))
}

fn no_document_type() -> Error {
    Error::unsupported("a document type (DTD) is not supported").remedy("take it out of the file")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(text: &str) -> Result<Node> {
        let mut xml = Xml::new(text.as_bytes());
        let tag = xml.root()?;
        let node = xml.node(tag)?;
        xml.finish().map(|()| node)
    }

    fn refused(text: &str) -> String {
        node(text).unwrap_err().to_string()
    }

    #[test]
    fn elements_attributes_and_text() {
        let found = node(
            "<?xml version=\"1.0\"?>\n<!-- c --><a X='1&amp;2'> t&lt;<![CDATA[&x]]>&#65;<b/>\n<c>d</c></a>",
        )
        .unwrap();
        assert_eq!(found.tag.attribute("x"), Some("1&2"));
        assert_eq!(found.text, "t<&xA");
        assert_eq!(found.children.len(), 2);
        assert_eq!(found.child("C").unwrap().text, "d");
    }

    #[test]
    fn children_one_by_one() {
        let mut xml = Xml::new("<a><b><c/>x</b>y<d/></a>".as_bytes());
        xml.root().unwrap();
        assert!(xml.child().unwrap().unwrap().is("b"));
        xml.skip().unwrap();
        assert!(xml.child().unwrap().unwrap().is("d"));
        assert!(xml.child().unwrap().is_none(), "d ends");
        assert!(xml.child().unwrap().is_none(), "a ends");
    }

    #[test]
    fn what_is_passed_over_is_well_formed_too() {
        let sound = "<?xml version='1.0'?>\n<a><b/></a>\n<!-- c --><?d e?>\n";
        let skipped = |text: &str| {
            let mut xml = Xml::new(text.as_bytes());
            xml.root()?;
            while xml.child()?.is_some() {
                xml.skip()?;
            }
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
                assert!(node(&text).is_err(), "{text}");
            }
        }
        for behind in ["<b/>", "x", "&amp;", "</a>", "<![CDATA[x]]>", "<!DOCTYPE a>", "<", "\u{1}"]
        {
            assert!(skipped(&format!("{sound}{behind}")).is_err(), "{behind}");
        }
        assert!(skipped(too_late).is_err());
    }

    #[test]
    fn what_is_refused() {
        assert!(refused("<!DOCTYPE a [<!ENTITY x 'y'>]><a>&x;</a>").contains("document type"));
        assert!(refused("<a>&x;</a>").contains("entity &x;"));
        assert!(refused("<a b='&x;'/>").contains("well-formed"));
        assert!(refused("<a><b></a>").contains("well-formed"));
        assert!(refused("<a>").contains("middle") && refused("").contains("middle"));
        assert!(refused("<a \u{0}=").contains("well-formed"));
        assert!(refused(&"<a>".repeat(40)).contains("depth of XML"));
        assert!(refused(&format!("<a>{}</a>", "<b/>".repeat(5000))).contains("elements in one"));
        assert!(refused("x").contains("element"));
        assert!(refused("</a>").contains("well-formed"));
    }
}
