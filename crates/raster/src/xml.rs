//! XML of VRTs and PAM sidecars: streamed elements, or one element as a tree.

use std::io::BufRead;

use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::xml::{self, XmlEvent};

/// Maximum number of elements of a tree.
const MAX_NODES: u64 = 4096;

/// A document being read.
pub(super) struct RasterXmlReader<R>(xml::XmlReader<R>);

/// Start tag of an element.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RasterXmlTag {
    pub(super) name: String,
    attributes: Vec<(String, String)>,
}

/// An element with its content.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RasterXmlElement {
    pub(super) tag: RasterXmlTag,
    /// Its text, trimmed.
    pub(super) text: String,
    pub(super) children: Vec<RasterXmlElement>,
}

impl RasterXmlTag {
    fn of(tag: &xml::XmlStartTag) -> Result<Self> {
        let attributes = tag.attributes()?.into_iter();
        let attributes = attributes.map(|(name, value)| (name.to_owned(), value)).collect();
        Ok(Self { name: tag.name().to_owned(), attributes })
    }

    /// The attribute `name`, in any case.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let mut attributes = self.attributes.iter();
        let (_, value) = attributes.find(|(other, _)| other.eq_ignore_ascii_case(name))?;
        Some(value)
    }

    /// True when the element is called `name`, in any case.
    pub(super) fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }
}

impl RasterXmlElement {
    /// The first child called `name`.
    pub(super) fn child(&self, name: &str) -> Option<&RasterXmlElement> {
        self.children.iter().find(|child| child.tag.is(name))
    }

    /// Its text as a number, possibly NaN.
    pub(super) fn number(&self) -> Result<f64> {
        parsed(&self.text).ok_or_else(|| {
            let (name, text) = (&self.tag.name, short(&self.text));
            Error::bad_input(format!("{name} is not a number: {text:?}"))
        })
    }

    /// Its text as a finite number.
    pub(super) fn finite(&self) -> Result<f64> {
        let number = self.number()?;
        if number.is_finite() {
            return Ok(number);
        }
        Err(Error::bad_input(format!("{} is not finite: {number}", self.tag.name)))
    }
}

/// The six coefficients of a GDAL geotransform, separated by commas.
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

/// A prefix of untrusted text for error messages.
pub(super) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

impl<R: BufRead> RasterXmlReader<R> {
    pub(super) fn new(from: R) -> Self {
        Self(xml::XmlReader::new(from))
    }

    /// The root element.
    pub(super) fn root(&mut self) -> Result<RasterXmlTag> {
        match self.0.next()? {
            XmlEvent::Start(tag) => RasterXmlTag::of(&tag),
            XmlEvent::Text(text) if text.trim().is_empty() => self.root(),
            XmlEvent::Over => Err(ends_early()),
            _ => Err(Error::bad_input("root element is missing").at(self.place())),
        }
    }

    /// The next child of the current element; `None` at its end.
    pub(super) fn child(&mut self) -> Result<Option<RasterXmlTag>> {
        loop {
            match self.0.next()? {
                XmlEvent::Start(tag) => return RasterXmlTag::of(&tag).map(Some),
                XmlEvent::End => return Ok(None),
                XmlEvent::Text(_) => {}
                XmlEvent::Over => return Err(ends_early()),
            }
        }
    }

    /// The rest of the element begun by `tag`.
    pub(super) fn node(&mut self, tag: RasterXmlTag) -> Result<RasterXmlElement> {
        self.branch(tag, &mut 0)
    }

    fn branch(&mut self, tag: RasterXmlTag, nodes: &mut u64) -> Result<RasterXmlElement> {
        *nodes += 1;
        limits::check("number of elements inside one XML element", *nodes, MAX_NODES)?;
        let mut node = RasterXmlElement { tag, ..RasterXmlElement::default() };
        loop {
            match self.0.next()? {
                XmlEvent::Start(tag) => {
                    node.children.push(self.branch(RasterXmlTag::of(&tag)?, nodes)?)
                }
                XmlEvent::Text(text) => node.text += &text,
                XmlEvent::End => break,
                XmlEvent::Over => return Err(ends_early()),
            }
            let bytes = node.text.len() as u64;
            limits::check("size of an XML text in bytes", bytes, limits::MAX_HEADER_BYTES)?;
        }
        node.text = node.text.trim().to_owned();
        Ok(node)
    }

    /// Skips the rest of the current element.
    pub(super) fn skip(&mut self) -> Result<()> {
        self.0.skip()
    }

    /// Checks that only comments and white space follow the root element.
    pub(super) fn finish(&mut self) -> Result<()> {
        self.0.finish().map_err(|e| e.at(self.place()))
    }

    /// Position of the reader.
    pub(super) fn place(&self) -> String {
        format!("byte {}", self.0.offset())
    }
}

fn ends_early() -> Error {
    Error::bad_input("file ends inside an element")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(text: &str) -> Result<RasterXmlElement> {
        let mut xml = RasterXmlReader::new(text.as_bytes());
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
        let mut xml = RasterXmlReader::new("<a><b><c/>x</b>y<d/></a>".as_bytes());
        xml.root().unwrap();
        assert!(xml.child().unwrap().unwrap().is("b"));
        xml.skip().unwrap();
        assert!(xml.child().unwrap().unwrap().is("d"));
        assert!(xml.child().unwrap().is_none(), "d ends");
        assert!(xml.child().unwrap().is_none(), "a ends");
    }

    #[test]
    fn what_is_refused() {
        assert!(refused("<!DOCTYPE a [<!ENTITY x 'y'>]><a>&x;</a>").contains("document type"));
        assert!(refused("<a>&x;</a>").contains("entity &x;"));
        assert!(refused("<a b='&x;'/>").contains("well-formed"));
        assert!(refused("<a><b></a>").contains("well-formed"));
        assert!(refused("<a>").contains("inside") && refused("").contains("inside"));
        assert!(refused("<a \u{0}=").contains("well-formed"));
        assert!(refused(&"<a>".repeat(40)).contains("depth of XML"));
        assert!(refused(&format!("<a>{}</a>", "<b/>".repeat(5000))).contains("number of elements"));
        assert!(refused("x").contains("element"));
        assert!(refused("</a>").contains("well-formed"));
    }
}
