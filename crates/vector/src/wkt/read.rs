//! Streaming tokenizer and parser; a geometry may be longer than the buffer.

use std::path::Path;

use crate::crs;
use crate::decimal;
use crate::feature::{Feature, LayerHeader};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::window::FileWindow;
use terrane_base::error::{Error, Result};
use terrane_base::geom::wkt;
use terrane_base::limits;

/// Maximum length of a word in bytes.
const MAX_WORD: usize = 64;

/// Opens a file.
pub(super) fn open(path: &Path, _: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let layer = LayerHeader { crs: crs::sidecar_crs(path)?, ..LayerHeader::default() };
    let mut source = WktSource { window: FileWindow::open(path)?, layer, at: 0, srid: None };
    if let Some(code) = source.srid()? {
        source.layer.crs = wkt::of_srs(&format!("EPSG:{code}"));
        source.srid = Some(code);
    }
    Ok(Box::new(source))
}

struct WktSource {
    window: FileWindow,
    layer: LayerHeader,
    /// Offset of the last geometry.
    at: u64,
    srid: Option<u32>,
}

/// Geometry type of a keyword, and its Z and M suffixes ("POINTZM"). LINEARRING is read as a line.
pub(super) fn keyword(word: &str) -> Option<(GeometryType, Option<WktDimensions>)> {
    let upper = word.to_ascii_uppercase();
    if let Some(kind) = kind_of(&upper) {
        return Some((kind, None));
    }
    let tails = [("ZM", true, true), ("Z", true, false), ("M", false, true)];
    tails.into_iter().find_map(|(tail, has_z, has_m)| {
        let kind = kind_of(upper.strip_suffix(tail)?)?;
        Some((kind, Some(WktDimensions { has_z, has_m })))
    })
}

fn kind_of(word: &str) -> Option<GeometryType> {
    match word {
        "LINEARRING" => Some(GeometryType::LineString),
        _ => GeometryType::by_name(word).filter(|kind| *kind != GeometryType::Null),
    }
}

/// Dimensions after x and y.
#[derive(Clone, Copy)]
pub(super) struct WktDimensions {
    has_z: bool,
    has_m: bool,
}

impl FeatureSource for WktSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        let Some(_) = self.peek()? else { return Ok(None) };
        self.at = self.window.offset();
        // The SRID of the first geometry is the CRS of the file.
        if let Some(code) = self.srid()?
            && self.srid != Some(code)
        {
            let message = format!("SRID {code} differs from the first geometry");
            return Err(Error::unsupported(message).remedy("use one CRS per file"));
        }
        let geometry = self.geometry()?;
        if self.peek()? == Some(b';') {
            self.window.advance(1);
        }
        Ok(Some(Feature { geometry, ..Feature::default() }))
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        format!("byte {}", self.at)
    }
}

impl WktSource {
    /// The next byte that is not white space.
    #[inline]
    fn peek(&mut self) -> Result<Option<u8>> {
        loop {
            let text = self.window.text();
            let blank = text.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            let found = text.get(blank).copied();
            self.window.advance(blank);
            if found.is_some() || !self.window.more()? {
                return Ok(found);
            }
        }
    }

    /// Consumes `byte` if it is next.
    fn take(&mut self, byte: u8) -> Result<bool> {
        let is_next = self.peek()? == Some(byte);
        self.window.advance(usize::from(is_next));
        Ok(is_next)
    }

    /// The next word, without consuming it.
    fn word(&mut self) -> Result<String> {
        self.peek()?;
        self.window.ensure(MAX_WORD)?;
        let text = self.window.text();
        let letters = text.iter().take(MAX_WORD).take_while(|byte| byte.is_ascii_alphabetic());
        let letters = letters.count();
        Ok(String::from_utf8_lossy(&text[..letters]).into_owned())
    }

    /// Parses "SRID=4326;" if it is next.
    fn srid(&mut self) -> Result<Option<u32>> {
        if !self.word()?.eq_ignore_ascii_case("SRID") {
            return Ok(None);
        }
        self.window.advance(4);
        if !self.take(b'=')? {
            return Err(self.bad("\"=\" expected after SRID"));
        }
        self.peek()?;
        self.window.ensure(16)?;
        let digits = self.window.text().iter().take(16).take_while(|b| b.is_ascii_digit()).count();
        let code = std::str::from_utf8(&self.window.text()[..digits]).ok();
        let Some(code) = code.and_then(|code| code.parse().ok()) else {
            return Err(self.bad("SRID is not a number"));
        };
        self.window.advance(digits);
        if !self.take(b';')? {
            return Err(self.bad("\";\" expected after SRID"));
        }
        // SRID 0 means unknown.
        Ok(Some(code).filter(|code| *code != 0))
    }

    /// The next geometry. Collections are kept on an explicit stack.
    fn geometry(&mut self) -> Result<Geometry> {
        let mut open: Vec<Vec<Geometry>> = Vec::new();
        loop {
            let (kind, dimensions) = self.kind()?;
            let mut done = None;
            if self.word()?.eq_ignore_ascii_case("EMPTY") {
                self.window.advance("EMPTY".len());
                done = Some(match kind {
                    GeometryType::Collection => Geometry::collection(Vec::new())?,
                    kind => Geometry::new(kind, CoordinateSequence::default())?,
                });
            } else if kind != GeometryType::Collection {
                done = Some(self.coordinates(kind, dimensions)?);
            } else if !self.take(b'(')? {
                return Err(self.bad("\"(\" is missing"));
            } else {
                open.push(Vec::new());
                let depth = open.len() as u64;
                let most = limits::MAX_COLLECTION_DEPTH;
                limits::check("depth of a geometry collection", depth, most)?;
                if self.take(b')')? {
                    done = Some(Geometry::collection(open.pop().unwrap_or_default())?);
                }
            }
            // A complete geometry is added to its collection, which may then be complete as well.
            while let Some(geometry) = done.take() {
                let Some(members) = open.last_mut() else { return Ok(geometry) };
                let count = members.len() as u64;
                limits::check(
                    "number of members of a geometry collection",
                    count,
                    limits::MAX_COLLECTION_MEMBERS,
                )?;
                members.push(geometry);
                if self.take(b')')? {
                    done = Some(Geometry::collection(open.pop().unwrap_or_default())?);
                } else if !self.take(b',')? {
                    return Err(self.bad("\",\" or \")\" expected"));
                }
            }
        }
    }

    /// Parses the keywords of a geometry.
    fn kind(&mut self) -> Result<(GeometryType, Option<WktDimensions>)> {
        let word = self.word()?;
        let Some((kind, dimensions)) = keyword(&word) else {
            return Err(match word.as_str() {
                "" => self.bad("geometry expected"),
                word => self.bad(format!("unknown geometry type {word:?}")),
            });
        };
        self.window.advance(word.len());
        let next = self.word()?;
        let dimensions = match next.to_ascii_uppercase().as_str() {
            "Z" => Some(WktDimensions { has_z: true, has_m: false }),
            "M" => Some(WktDimensions { has_z: false, has_m: true }),
            "ZM" => Some(WktDimensions { has_z: true, has_m: true }),
            _ => return Ok((kind, dimensions)),
        };
        self.window.advance(next.len());
        Ok((kind, dimensions))
    }

    /// Parses nested lists of positions.
    fn coordinates(
        &mut self,
        kind: GeometryType,
        dimensions: Option<WktDimensions>,
    ) -> Result<Geometry> {
        let deep = match kind {
            GeometryType::Polygon | GeometryType::MultiLineString => 2,
            GeometryType::MultiPolygon => 3,
            _ => 1,
        };
        let mut found = CoordinateSequence::default();
        let mut open = 0;
        loop {
            match self.peek()? {
                Some(b'(') if open < deep || (kind == GeometryType::MultiPoint && open == 1) => {
                    self.window.advance(1);
                    open += 1;
                    continue;
                }
                // Points of a MultiPoint may be in parentheses.
                Some(b'-' | b'+' | b'.' | b'0'..=b'9') if open >= deep => {
                    self.position(dimensions, &mut found)?;
                }
                Some(b'e' | b'E') if open > 0 && self.word()?.eq_ignore_ascii_case("EMPTY") => {
                    self.window.advance("EMPTY".len());
                }
                _ => return Err(self.bad("position or \"(\" expected")),
            }
            loop {
                if self.take(b',')? {
                    break;
                }
                if !self.take(b')')? {
                    return Err(self.bad("\",\" or \")\" expected"));
                }
                if open == deep && !kind.is_points() {
                    found.end_part();
                } else if open + 1 == deep {
                    found.end_polygon();
                }
                open -= 1;
                if open == 0 {
                    return Geometry::new(kind, found).map_err(|e| self.bad(e));
                }
            }
        }
    }

    fn position(
        &mut self,
        known: Option<WktDimensions>,
        found: &mut CoordinateSequence,
    ) -> Result<()> {
        let mut numbers = [0.0; 4];
        let mut count = 0;
        loop {
            self.window.ensure(decimal::MAX_BYTES)?;
            let next = decimal::leading(self.window.text());
            let (value, bytes) = next.ok_or_else(|| self.bad("number expected"))?;
            self.window.advance(bytes);
            if count == numbers.len() {
                return Err(self.bad("position has more than four numbers"));
            }
            numbers[count] = value;
            count += 1;
            if matches!(self.peek()?, Some(b',' | b')') | None) {
                break;
            }
        }
        let [x, y, third, fourth] = numbers;
        let dimensions = known.unwrap_or(WktDimensions { has_z: count > 2, has_m: count > 3 });
        let expected = 2 + usize::from(dimensions.has_z) + usize::from(dimensions.has_m);
        if count != expected || count < 2 {
            return Err(self.bad(format!("position has {count} numbers, expected {expected}")));
        }
        let m = if dimensions.has_z { fourth } else { third };
        found.push([x, y], dimensions.has_z.then_some(third), dimensions.has_m.then_some(m));
        Ok(())
    }

    fn bad(&self, message: impl std::fmt::Display) -> Error {
        Error::bad_input(format!("byte {}: {message}", self.window.offset()))
    }
}
