//! Reader: the file is kept in memory, its arcs are decoded, and geometries are assembled one by one.

use std::path::Path;

use super::arcs::{TopoJsonArcs, TopoJsonTransform};
use crate::crs;
use crate::feature::{Feature, LayerHeader};
use crate::geojson::{GeoJsonFeatureReader, check_depth, id, member, short};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::json::{JsonCursor, JsonToken};
use crate::source::{FeatureSource, VectorOpenOptions};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Crs;
use terrane_base::limits;
use terrane_files::RawFile;

/// Byte range in the text.
type Range = (usize, usize);

/// Opens a file.
pub(super) fn open(path: &Path, options: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let file = RawFile::open(path)?;
    limits::check("size of the TopoJSON file in bytes", file.size(), limits::MAX_TOPOLOGY_BYTES)?;
    let mut text = file.head(limits::MAX_TOPOLOGY_BYTES)?;
    if text.starts_with(b"\xef\xbb\xbf") {
        text.drain(..3);
    }
    let top = TopoJsonTopology::read(&text)?;
    let chosen = top.chosen(options.layer.as_deref())?;
    let features = features(&text, top.objects[chosen].1)?;
    let others = top.objects.iter().enumerate().filter(|(at, _)| *at != chosen);
    let others: Vec<&str> = others.map(|(_, (name, _))| name.as_str()).collect();
    let notes = match others.is_empty() {
        true => Vec::new(),
        false => vec![format!("other objects ignored: {}", others.join(", "))],
    };
    let layer = LayerHeader {
        name: Some(top.objects[chosen].0.clone()),
        crs: top.crs,
        features: Some(features.len() as u64),
        ..LayerHeader::default()
    };
    let arcs = top.arcs;
    let reader = GeoJsonFeatureReader::default();
    Ok(Box::new(TopoJsonSource { text, arcs, layer, features, next: 0, reader, notes }))
}

/// A topology without its geometries.
struct TopoJsonTopology {
    arcs: TopoJsonArcs,
    /// Names and byte ranges of the objects.
    objects: Vec<(String, Range)>,
    crs: Crs,
}

impl TopoJsonTopology {
    fn read(text: &[u8]) -> Result<Self> {
        let (mut arcs, mut transform, mut objects) = (None, None, Vec::new());
        let mut system = crs::wgs84();
        let mut cursor = JsonCursor::new(text, 0);
        let mut is_first = true;
        cursor.expect(b'{')?;
        while let Some(name) = cursor.member(&mut is_first)? {
            match &*name {
                "arcs" => arcs = Some(range(&mut cursor)?),
                "transform" => transform = Some(read_transform(&mut cursor)?),
                "objects" => {
                    let mut is_first = true;
                    cursor.expect(b'{')?;
                    while let Some(name) = cursor.member(&mut is_first)? {
                        objects.push((name.into_owned(), range(&mut cursor)?));
                    }
                }
                "crs" => {
                    if let JsonToken::Nested(json) = cursor.value()? {
                        system = crs::of_member(json);
                    }
                }
                _ => _ = cursor.value()?,
            }
        }
        let (start, end) =
            arcs.ok_or_else(|| Error::bad_input("is not a Topology: arcs are missing"))?;
        if objects.is_empty() {
            return Err(Error::bad_input("is not a Topology: objects are missing"));
        }
        let mut cursor = JsonCursor::new(&text[start..end], start as u64);
        let arcs = TopoJsonArcs::read(&mut cursor, transform)?;
        Ok(Self { arcs, objects, crs: system })
    }

    /// The object called `name`, or else the first.
    fn chosen(&self, name: Option<&str>) -> Result<usize> {
        let Some(name) = name else { return Ok(0) };
        self.objects.iter().position(|(found, _)| found == name).ok_or_else(|| {
            let names: Vec<&str> = self.objects.iter().map(|(name, _)| name.as_str()).collect();
            Error::usage(format!("object {name:?} does not exist"))
                .remedy(format!("choose one of {}", names.join(", ")))
        })
    }
}

/// Byte range of the current object or array, which is skipped.
fn range(cursor: &mut JsonCursor<'_>) -> Result<Range> {
    cursor.peek();
    let start = cursor.offset() as usize;
    cursor.skip_nested()?;
    Ok((start, cursor.offset() as usize))
}

fn read_transform(cursor: &mut JsonCursor<'_>) -> Result<TopoJsonTransform> {
    let start = cursor.offset();
    let JsonToken::Nested(json) = cursor.value()? else {
        return Err(cursor.bad("transform is not an object"));
    };
    let value: serde_json::Value = serde_json::from_str(json).unwrap_or_default();
    match ["scale", "translate"].map(|name| number_pair(&value[name])) {
        [Some(scale), Some(translate)] => Ok(TopoJsonTransform { scale, translate }),
        _ => Err(Error::bad_input(format!("byte {start}: transform lacks scale or translate"))),
    }
}

fn number_pair(value: &serde_json::Value) -> Option<[f64; 2]> {
    Some([value[0].as_f64()?, value[1].as_f64()?])
}

/// Byte ranges of the features of an object: the members of a collection, or the object itself.
fn features(text: &[u8], (start, end): Range) -> Result<Vec<Range>> {
    let mut cursor = JsonCursor::new(&text[start..end], start as u64);
    let (mut members, mut is_first) = (None, true);
    cursor.expect(b'{')?;
    while let Some(name) = cursor.member(&mut is_first)? {
        if name != "geometries" {
            cursor.value()?;
            continue;
        }
        let (mut found, mut is_first) = (Vec::new(), true);
        cursor.expect(b'[')?;
        while cursor.item(&mut is_first)? {
            found.push(range(&mut cursor)?);
        }
        members = Some(found);
    }
    Ok(members.unwrap_or_else(|| vec![(start, end)]))
}

struct TopoJsonSource {
    text: Vec<u8>,
    arcs: TopoJsonArcs,
    layer: LayerHeader,
    features: Vec<Range>,
    /// Index of the next feature.
    next: usize,
    reader: GeoJsonFeatureReader,
    notes: Vec<String>,
}

impl FeatureSource for TopoJsonSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        let Some(&(start, end)) = self.features.get(self.next) else { return Ok(None) };
        self.next += 1;
        let mut cursor = JsonCursor::new(&self.text[start..end], start as u64);
        // A feature that uses arcs more than twice is damaged or malicious.
        let budget = self.arcs.vertices().saturating_mul(4).saturating_add(1 << 16);
        let mut maker = TopoJsonAssembler { arcs: &self.arcs, reader: &mut self.reader, budget };
        maker.feature(&mut cursor, 0).map(Some)
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        let at = self.features.get(self.next.saturating_sub(1)).map_or(0, |range| range.0);
        format!("byte {at}")
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }
}

/// Assembles geometries from arcs.
struct TopoJsonAssembler<'a> {
    arcs: &'a TopoJsonArcs,
    reader: &'a mut GeoJsonFeatureReader,
    /// Number of vertices that the current feature may still have.
    budget: usize,
}

impl TopoJsonAssembler<'_> {
    /// A geometry with its id and properties, inside `depth` collections; recursion is limited to the allowed
    /// depth of collections.
    fn feature(&mut self, cursor: &mut JsonCursor<'_>, depth: u64) -> Result<Feature> {
        limits::check("depth of a geometry collection", depth, limits::MAX_COLLECTION_DEPTH)?;
        let mut feature = Feature::default();
        // Arc arrays are parsed once the type is known.
        let (mut kind, mut lists, mut coordinates, mut members) = (None, None, None, None);
        let mut is_first = true;
        cursor.expect(b'{')?;
        while let Some(name) = cursor.member(&mut is_first)? {
            match &*name {
                "type" => {
                    kind = Some(match cursor.value()? {
                        JsonToken::Null => GeometryType::Null,
                        JsonToken::Text(name) => GeometryType::by_name(&name).ok_or_else(|| {
                            cursor.bad(format!("type {:?} is not a geometry type", short(&name)))
                        })?,
                        _ => return Err(cursor.bad("type is not a string")),
                    });
                }
                "id" => feature.id = id(cursor)?,
                "properties" => feature.properties = self.reader.properties(cursor)?,
                "arcs" => {
                    cursor.peek();
                    let at = cursor.offset();
                    lists = Some(JsonCursor::new(cursor.skip_nested()?.as_bytes(), at));
                }
                "coordinates" => coordinates = Some(cursor.coordinates()?),
                "geometries" => members = Some(self.members(cursor, depth)?),
                _ => {
                    let count = feature.foreign.len() as u64;
                    limits::check("number of members of a feature", count, limits::MAX_FIELDS)?;
                    feature.foreign.push(member(&name, cursor)?);
                }
            }
        }
        let missing = |what: &str| cursor.bad(format!("geometry lacks {what}"));
        let kind = kind.ok_or_else(|| missing("type"))?;
        feature.geometry = match kind {
            GeometryType::Null => Geometry::null(),
            GeometryType::Collection => {
                Geometry::collection(members.ok_or_else(|| missing("geometries"))?)?
            }
            GeometryType::Point | GeometryType::MultiPoint => {
                let (deep, mut found) = coordinates.ok_or_else(|| missing("coordinates"))?;
                check_depth(kind, deep).map_err(|e| cursor.bad(e))?;
                found.xy.iter_mut().for_each(|xy| *xy = self.arcs.place(*xy));
                Geometry::new(kind, found)?
            }
            _ => self.lines(kind, lists.ok_or_else(|| missing("arcs"))?)?,
        };
        Ok(feature)
    }

    fn members(&mut self, cursor: &mut JsonCursor<'_>, depth: u64) -> Result<Vec<Geometry>> {
        let (mut is_first, mut members) = (true, Vec::new());
        cursor.expect(b'[')?;
        while cursor.item(&mut is_first)? {
            let count = members.len() as u64;
            limits::check(
                "number of members of a geometry collection",
                count,
                limits::MAX_COLLECTION_MEMBERS,
            )?;
            members.push(self.feature(cursor, depth + 1)?.geometry);
        }
        Ok(members)
    }

    /// Lines or rings from arrays of arc indices.
    fn lines(&mut self, kind: GeometryType, mut cursor: JsonCursor<'_>) -> Result<Geometry> {
        let deep = match kind {
            GeometryType::LineString => 1,
            GeometryType::MultiLineString | GeometryType::Polygon => 2,
            _ => 3,
        };
        let mut found = CoordinateSequence::default();
        let mut open = 0;
        loop {
            let is_list = cursor.peek() == Some(b'[');
            if is_list && open < deep {
                cursor.expect(b'[')?;
                open += 1;
                if !cursor.take(b']') {
                    continue;
                }
                open -= 1;
            } else if open == deep {
                self.arc(&mut cursor, &mut found)?;
            } else {
                return Err(cursor.bad(format!("arcs are not nested {deep} deep")));
            }
            loop {
                if open == 0 {
                    return Geometry::new(kind, found);
                }
                if cursor.take(b',') {
                    break;
                }
                cursor.expect(b']')?;
                if open == deep {
                    fill_up(if kind.is_polygons() { 4 } else { 2 }, &mut found);
                    found.end_part();
                } else if open + 1 == deep {
                    found.end_polygon();
                }
                open -= 1;
            }
        }
    }

    /// Appends the arc of the next index.
    fn arc(&mut self, cursor: &mut JsonCursor<'_>, to: &mut CoordinateSequence) -> Result<()> {
        let index = match cursor.value()? {
            JsonToken::Number(text) => text.parse().ok(),
            _ => None,
        };
        let index: i64 = index.ok_or_else(|| cursor.bad("arc index is not an integer"))?;
        let before = to.xy.len();
        let arc = self.arcs.get(index).ok_or_else(|| {
            cursor.bad(format!("arc {index} does not exist: the file has {} arcs", self.arcs.len()))
        })?;
        self.budget = self
            .budget
            .checked_sub(arc.len())
            .ok_or_else(|| cursor.bad("geometry repeats the same arcs too often"))?;
        // Consecutive arcs of a line share a vertex.
        let skip = usize::from(before > to.ends.last().copied().unwrap_or(0));
        match index < 0 {
            true => to.xy.extend(arc.iter().rev().skip(skip)),
            false => to.xy.extend(arc.iter().skip(skip)),
        }
        Ok(())
    }
}

/// Repeats the first vertex of the current part until it has `least` vertices, as the reference
/// implementation does: quantisation may collapse small rings.
fn fill_up(least: usize, part: &mut CoordinateSequence) {
    let start = part.ends.last().copied().unwrap_or(0);
    if let Some(&first) = part.xy.get(start) {
        let length = part.xy.len().max(start + least);
        part.xy.resize(length, first);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Id, open};

    fn read(text: &str, layer: Option<&str>) -> Result<Vec<Feature>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, text).unwrap();
        let mut source = open(
            &path,
            &VectorOpenOptions { layer: layer.map(str::to_owned), ..Default::default() },
        )?;
        std::iter::from_fn(|| source.next().transpose()).collect()
    }

    const TWO_SQUARES: &str = r#"{"type":"Topology","transform":{"scale":[0.1,0.5],"translate":[10,0]},
        "objects":{"cells":{"type":"GeometryCollection","geometries":[
        {"arcs":[[0,1]],"type":"Polygon","id":"left","properties":{"n":1}},
        {"type":"MultiPolygon","arcs":[[[-1,2]],[[3]]]},{"type":null}]},
        "border":{"type":"LineString","arcs":[0,1]},
        "at":{"type":"MultiPoint","coordinates":[[3,1],[0,0]]}},
        "arcs":[[[3,0],[0,3]],[[3,3],[-3,0],[0,-3],[3,0]],[[3,0],[3,0],[0,3],[-3,0]],[[9,9],[0,0]]]}"#;

    #[test]
    fn arcs_are_joined_turned_and_shared_to_the_bit() {
        let found = read(TWO_SQUARES, None).unwrap();
        assert_eq!((found.len(), found[0].id.clone()), (3, Some(Id::Text("left".into()))));
        let x = 3.0 * 0.1 + 10.0;
        let left = [[x, 0.0], [x, 1.5], [10.0, 1.5], [10.0, 0.0], [x, 0.0]];
        assert_eq!(found[0].geometry.coordinates().xy, left);
        let right = &found[1].geometry;
        let far = 6.0 * 0.1 + 10.0;
        assert_eq!(
            right.coordinates().xy[..5],
            [[x, 1.5], [x, 0.0], [far, 0.0], [far, 1.5], [x, 1.5]]
        );
        // A ring on one place is filled up.
        assert_eq!((right.coordinates().xy.len(), &right.coordinates().polygons), (9, &vec![1, 2]));
        assert_eq!(found[2].geometry.kind(), GeometryType::Null);
    }

    #[test]
    fn other_objects_by_name() {
        let border = read(TWO_SQUARES, Some("border")).unwrap();
        assert_eq!(border[0].geometry.coordinates().xy.len(), 5);
        let at = read(TWO_SQUARES, Some("at")).unwrap();
        assert_eq!(at[0].geometry.coordinates().xy, [[3.0 * 0.1 + 10.0, 0.5], [10.0, 0.0]]);
        let error = read(TWO_SQUARES, Some("x")).unwrap_err().to_string();
        assert!(error.contains("cells, border, at"), "{error}");
    }

    #[test]
    fn damage_is_told() {
        let bomb = format!("[[{}]]", vec!["0"; 100_000].join(","));
        for (from, to, told) in [
            ("[[0,1]]", "[[0,7]]", "arc 7 does not exist: the file has 4 arcs"),
            ("[[0,1]]", "[[0,-9]]", "arc -9 does not exist"),
            ("[[0,1]]", "[0,1]", "arcs are not nested 2 deep"),
            ("[[0,1]]", "[[0.5]]", "not an integer"),
            ("[[0,1]]", &bomb, "repeats the same arcs"),
            ("\"scale\":[0.1,0.5],", "", "lacks scale"),
            ("\"arcs\":[[[3,0]", "\"arx\":[[[3,0]", "arcs are missing"),
        ] {
            let error = read(&TWO_SQUARES.replace(from, to), None).unwrap_err().to_string();
            assert!(error.contains(told), "{to}: {error}");
        }
    }
}
