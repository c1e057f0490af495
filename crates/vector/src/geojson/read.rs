//! Reader: finds the text of each feature and parses it separately.

use std::path::Path;

use super::feature::{self, GeoJsonFeatureReader, no_object};
use crate::crs;
use crate::feature::{Feature, JsonMember, LayerHeader};
use crate::json::{JsonCursor, JsonEndSearch};
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::window::FileWindow;
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Opens a file.
pub(super) fn open(path: &Path, _: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let mut source = GeoJsonSource {
        window: FileWindow::open(path)?,
        layer: LayerHeader { crs: crs::wgs84(), ..LayerHeader::default() },
        reader: GeoJsonFeatureReader::default(),
        state: GeoJsonReadState::Between,
        is_first: true,
        objects: 0,
        at: 0,
        notes: Vec::new(),
    };
    source.go_on()?;
    if source.objects == 0 {
        return Err(Error::bad_input("contains no JSON object"));
    }
    Ok(Box::new(source))
}

/// State of the reader.
#[derive(Clone, Copy, PartialEq)]
enum GeoJsonReadState {
    /// Between two top-level objects.
    Between,
    /// At the start of an object that is a single feature or geometry.
    Single,
    /// In the features array of a collection.
    Features,
    /// Among the members of a collection after its features.
    Behind,
    /// At the end.
    End,
}

struct GeoJsonSource {
    window: FileWindow,
    layer: LayerHeader,
    reader: GeoJsonFeatureReader,
    state: GeoJsonReadState,
    /// True before the first feature of a collection.
    is_first: bool,
    /// Number of top-level objects begun.
    objects: u64,
    /// Offset of the last feature.
    at: u64,
    notes: Vec<String>,
}

impl FeatureSource for GeoJsonSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        loop {
            match self.state {
                GeoJsonReadState::End => return Ok(None),
                GeoJsonReadState::Single => {
                    let feature = self.feature()?;
                    self.state = GeoJsonReadState::Between;
                    return Ok(Some(feature));
                }
                GeoJsonReadState::Features => {
                    if self.is_at_feature()? {
                        return self.feature().map(Some);
                    }
                    self.state = GeoJsonReadState::Behind;
                }
                GeoJsonReadState::Between | GeoJsonReadState::Behind => self.go_on()?,
            }
        }
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        format!("byte {}", self.at)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }
}

impl GeoJsonSource {
    /// Skips to the next feature.
    fn go_on(&mut self) -> Result<()> {
        match self.state {
            GeoJsonReadState::Between => self.begin(),
            GeoJsonReadState::Behind => {
                self.members(true)?;
                self.state = GeoJsonReadState::Between;
                Ok(())
            }
            GeoJsonReadState::Single | GeoJsonReadState::Features | GeoJsonReadState::End => Ok(()),
        }
    }

    /// The next byte that is neither white space nor a record separator.
    fn peek(&mut self) -> Result<Option<u8>> {
        loop {
            let text = self.window.text();
            let blank =
                text.iter().take_while(|b| matches!(b, b' ' | b'\n' | b'\r' | b'\t' | 0x1e));
            let blank = blank.count();
            let found = text.get(blank).copied();
            self.window.advance(blank);
            if found.is_some() || !self.window.more()? {
                return Ok(found);
            }
        }
    }

    /// Begins the next top-level object.
    fn begin(&mut self) -> Result<()> {
        match self.peek()? {
            None => self.state = GeoJsonReadState::End,
            Some(b'{') => {
                self.objects += 1;
                self.state = GeoJsonReadState::Single;
                self.is_first = true;
                if self.members(false)? {
                    self.state = GeoJsonReadState::Features;
                }
            }
            Some(_) => {
                let place = self.window.offset();
                return Err(Error::bad_input(format!("byte {place}: not a JSON object")));
            }
        }
        Ok(())
    }

    /// Reads the members of the current object. Before the features: true with the cursor inside the features
    /// array, or false with nothing consumed if the object is a single feature or geometry. After the
    /// features: reads to the end of the object.
    fn members(&mut self, is_behind: bool) -> Result<bool> {
        let mut at = usize::from(!is_behind);
        let mut foreign = Vec::new();
        let mut is_first = !is_behind;
        loop {
            at = self.blank(at)?;
            match self.window.byte(at)? {
                Some(b'}') if is_behind => {
                    self.window.advance(at + 1);
                    self.take_members(foreign, true)?;
                    return Ok(false);
                }
                Some(b'}') => return Ok(false),
                Some(b',') if !is_first => at = self.blank(at + 1)?,
                _ if !is_first => return Err(self.damaged(at)),
                _ => {}
            }
            is_first = false;
            let name_end = self.string_end(at)?;
            let colon = self.blank(name_end)?;
            if self.window.byte(colon)? != Some(b':') {
                return Err(self.damaged(colon));
            }
            let value = self.blank(colon + 1)?;
            let base = self.window.offset() + at as u64;
            let name =
                JsonCursor::new(&self.window.text()[at..name_end], base).string()?.into_owned();
            let opens = self.window.byte(value)?;
            match name.as_str() {
                "features" if opens == Some(b'[') && !is_behind => {
                    self.window.advance(value + 1);
                    self.take_members(foreign, false)?;
                    return Ok(true);
                }
                "coordinates" | "geometry" | "geometries" | "properties" if !is_behind => {
                    return Ok(false);
                }
                _ => {}
            }
            let end = self.value_end(value)?;
            limits::check("header size in bytes", end as u64, limits::MAX_HEADER_BYTES)?;
            let base = self.window.offset() + value as u64;
            let mut cursor = JsonCursor::new(&self.window.text()[value..end], base);
            foreign.push(feature::member(&name, &mut cursor)?);
            at = end;
        }
    }

    /// Applies the members of a collection to the layer header.
    fn take_members(&mut self, members: Vec<JsonMember>, is_behind: bool) -> Result<()> {
        let is_only = self.objects == 1;
        for member in members {
            match member.name.as_str() {
                "type" | "features" => {}
                "crs" => self.take_crs(&member.json, is_behind)?,
                "name" if member.json.starts_with('"') && !is_behind && is_only => {
                    self.layer.name = serde_json::from_str(&member.json).ok();
                }
                _ if is_only => self.layer.foreign.push(member),
                _ => {}
            }
        }
        Ok(())
    }

    fn take_crs(&mut self, json: &str, is_behind: bool) -> Result<()> {
        let found = crs::of_member(json);
        if self.objects == 1 && !is_behind {
            if found.epsg.is_none() {
                let what = "CRS name is not recognised";
                self.notes.push(format!("{what}: {}", feature::short(json)));
            }
            self.layer.crs = found;
            return Ok(());
        }
        if found.agrees(&self.layer.crs) {
            return Ok(());
        }
        Err(Error::unsupported("\"crs\" member follows the features")
            .remedy("move it before the features"))
    }

    /// True if another feature follows in the array; otherwise consumes the end of the array.
    fn is_at_feature(&mut self) -> Result<bool> {
        let next = self.peek()?;
        if next == Some(b']') {
            self.window.advance(1);
            return Ok(false);
        }
        if !std::mem::take(&mut self.is_first) {
            if next != Some(b',') {
                return Err(self.damaged(0));
            }
            self.window.advance(1);
        }
        match self.peek()? {
            Some(b'{') => Ok(true),
            Some(_) => Err(no_object(self.window.offset())),
            None => Err(self.damaged(0)),
        }
    }

    /// The current object, as a feature.
    fn feature(&mut self) -> Result<Feature> {
        self.at = self.window.offset();
        let end = self.value_end(0)?;
        let feature = self.reader.feature(&self.window.text()[..end], self.at)?;
        self.window.advance(end);
        Ok(feature)
    }

    /// Index of the first byte from `at` on that is not white space.
    fn blank(&mut self, mut at: usize) -> Result<usize> {
        while matches!(self.window.byte(at)?, Some(b' ' | b'\n' | b'\r' | b'\t')) {
            at += 1;
        }
        Ok(at)
    }

    /// Index after the string that begins at `at`.
    fn string_end(&mut self, at: usize) -> Result<usize> {
        if self.window.byte(at)? != Some(b'"') {
            return Err(self.damaged(at));
        }
        let mut end = at + 1;
        loop {
            match self.window.byte(end)? {
                Some(b'"') => return Ok(end + 1),
                Some(b'\\') => end += 2,
                Some(_) => end += 1,
                None => return Err(self.damaged(end)),
            }
            let bytes = (end - at) as u64;
            limits::check("header size in bytes", bytes, limits::MAX_HEADER_BYTES)?;
        }
    }

    /// Index after the value that begins at `at`.
    fn value_end(&mut self, at: usize) -> Result<usize> {
        match self.window.byte(at)? {
            Some(b'"') => self.string_end(at),
            Some(open @ (b'{' | b'[')) => {
                let mut extent = JsonEndSearch::new(open);
                loop {
                    if let Some(bytes) = extent.end(&self.window.text()[at..]) {
                        return Ok(at + bytes);
                    }
                    if !self.window.more()? {
                        return Err(self.damaged(self.window.text().len()));
                    }
                }
            }
            _ => {
                let mut end = at;
                while let Some(byte) = self.window.byte(end)? {
                    if matches!(byte, b',' | b'}' | b']' | b' ' | b'\n' | b'\r' | b'\t') {
                        break;
                    }
                    end += 1;
                    let bytes = (end - at) as u64;
                    limits::check("header size in bytes", bytes, limits::MAX_HEADER_BYTES)?;
                }
                Ok(end)
            }
        }
    }

    fn damaged(&self, at: usize) -> Error {
        let place = self.window.offset() + at as u64;
        let is_end = self.window.text().len() <= at;
        let what = if is_end { "unexpected end of file" } else { "not valid JSON" };
        Error::bad_input(format!("byte {place}: {what}")).remedy("copy or recreate the file")
    }
}
