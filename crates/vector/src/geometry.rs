//! Geometries with flat coordinate arrays: a line or ring is a slice of x, y.

use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Geometry type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum GeometryType {
    /// Null geometry of a feature.
    #[default]
    Null,
    /// One position, or empty.
    Point,
    /// Any number of positions.
    MultiPoint,
    /// One line, or empty.
    LineString,
    /// Any number of lines.
    MultiLineString,
    /// One outer ring with its holes, or empty.
    Polygon,
    /// Any number of polygons.
    MultiPolygon,
    /// Geometries of any type.
    Collection,
}

impl GeometryType {
    /// All types.
    pub const ALL: [Self; 8] = [
        Self::Null,
        Self::Point,
        Self::MultiPoint,
        Self::LineString,
        Self::MultiLineString,
        Self::Polygon,
        Self::MultiPolygon,
        Self::Collection,
    ];

    /// The name in GeoJSON and WKT.
    pub fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Point => "Point",
            Self::MultiPoint => "MultiPoint",
            Self::LineString => "LineString",
            Self::MultiLineString => "MultiLineString",
            Self::Polygon => "Polygon",
            Self::MultiPolygon => "MultiPolygon",
            Self::Collection => "GeometryCollection",
        }
    }

    /// The type called `name`, in any case.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(name))
    }

    /// True for points, which have no parts.
    pub fn is_points(self) -> bool {
        matches!(self, Self::Point | Self::MultiPoint)
    }

    /// True if the parts are rings.
    pub fn is_polygons(self) -> bool {
        matches!(self, Self::Polygon | Self::MultiPolygon)
    }
}

/// Positions, grouped into parts (lines or rings), and parts grouped into polygons.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoordinateSequence {
    /// x and y in units of the CRS.
    pub xy: Vec<[f64; 2]>,
    /// Heights: empty, or one per position; NaN where missing.
    pub z: Vec<f64>,
    /// Measures: empty, or one per position; NaN where missing.
    pub m: Vec<f64>,
    /// End index of the positions of each part.
    pub ends: Vec<usize>,
    /// End index of the parts of each polygon.
    pub polygons: Vec<usize>,
}

impl CoordinateSequence {
    /// Positions without heights and parts.
    pub fn of(xy: Vec<[f64; 2]>) -> Self {
        Self { xy, ..Self::default() }
    }

    /// Appends a position.
    #[inline]
    pub fn push(&mut self, xy: [f64; 2], z: Option<f64>, m: Option<f64>) {
        let before = self.xy.len();
        push_value(&mut self.z, before, z);
        push_value(&mut self.m, before, m);
        self.xy.push(xy);
    }

    /// Ends the current part, unless it is empty.
    pub fn end_part(&mut self) {
        if self.ends.last().copied().unwrap_or(0) < self.xy.len() {
            self.ends.push(self.xy.len());
        }
    }

    /// Ends the current polygon, unless it is empty.
    pub fn end_polygon(&mut self) {
        if self.polygons.last().copied().unwrap_or(0) < self.ends.len() {
            self.polygons.push(self.ends.len());
        }
    }

    /// Index range of the positions of part `part`.
    fn range(&self, part: usize) -> std::ops::Range<usize> {
        let start = if part == 0 { 0 } else { self.ends[part - 1] };
        start..self.ends[part]
    }

    /// True if the first and last position of part `part` are equal.
    fn is_closed(&self, part: usize) -> bool {
        let part = &self.xy[self.range(part)];
        part.first() == part.last()
    }

    /// Closes all open parts.
    fn close(&mut self) {
        if (0..self.ends.len()).all(|part| self.is_closed(part)) {
            return;
        }
        let mut closed = Self { polygons: std::mem::take(&mut self.polygons), ..Self::default() };
        for part in 0..self.ends.len() {
            let range = self.range(part);
            let again = (!self.is_closed(part)).then_some(range.start);
            closed.extend(self, range.chain(again));
            closed.end_part();
        }
        *self = closed;
    }

    /// Appends the positions of `from` with the given indices.
    pub(super) fn extend(&mut self, from: &Self, which: impl Iterator<Item = usize> + Clone) {
        self.xy.extend(which.clone().map(|i| from.xy[i]));
        if !from.z.is_empty() {
            self.z.extend(which.clone().map(|i| from.z[i]));
        }
        if !from.m.is_empty() {
            self.m.extend(which.map(|i| from.m[i]));
        }
    }
}

/// Appends an optional value, filling earlier missing ones with NaN. The list stays empty until there is a
/// value.
#[inline]
fn push_value(values: &mut Vec<f64>, before: usize, value: Option<f64>) {
    if let Some(value) = value {
        values.resize(before, f64::NAN);
        values.push(value);
    } else if !values.is_empty() {
        values.push(f64::NAN);
    }
}

/// A geometry. Rings are closed: the first position is repeated at the end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Geometry {
    kind: GeometryType,
    coordinates: CoordinateSequence,
    members: Vec<Geometry>,
    /// Depth of nested collections, itself included.
    depth: u32,
}

/// Role of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartRole {
    /// An open line (possibly with equal ends).
    Line,
    /// The outer ring of a polygon.
    Outer,
    /// A hole of the polygon of the preceding outer ring.
    Hole,
}

/// A line or ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometryPart<'a> {
    /// x and y of each vertex; the first vertex of a ring is repeated at the end.
    pub xy: &'a [[f64; 2]],
    /// Heights; empty if there are none.
    pub z: &'a [f64],
    /// Measures; empty if there are none.
    pub m: &'a [f64],
    /// Role of the part.
    pub role: PartRole,
}

impl GeometryPart<'_> {
    /// True for outer rings and holes.
    pub fn is_ring(&self) -> bool {
        self.role != PartRole::Line
    }
}

impl Geometry {
    /// A geometry of any type but a collection. Positions outside parts form one part, parts outside polygons
    /// form one polygon; open rings are closed.
    ///
    /// # Errors
    /// More than one position in a Point, line in a LineString or polygon in a Polygon; inconsistent array
    /// lengths.
    pub fn new(kind: GeometryType, mut coordinates: CoordinateSequence) -> Result<Self> {
        check(&coordinates)?;
        if kind.is_points() || matches!(kind, GeometryType::Null | GeometryType::Collection) {
            coordinates.ends.clear();
        } else {
            coordinates.end_part();
        }
        if kind.is_polygons() {
            coordinates.end_polygon();
            coordinates.close();
        } else {
            coordinates.polygons.clear();
        }
        let (found, most) = match kind {
            GeometryType::Null | GeometryType::Collection => (coordinates.xy.len(), 0),
            GeometryType::Point => (coordinates.xy.len(), 1),
            GeometryType::LineString => (coordinates.ends.len(), 1),
            GeometryType::Polygon => (coordinates.polygons.len(), 1),
            GeometryType::MultiPoint
            | GeometryType::MultiLineString
            | GeometryType::MultiPolygon => (0, 0),
        };
        if found > most {
            let message = format!("{} has {found} parts, at most 1 allowed", kind.name());
            return Err(Error::bad_input(message));
        }
        let depth = u32::from(kind == GeometryType::Collection);
        Ok(Self { kind, coordinates, members: Vec::new(), depth })
    }

    /// A null geometry.
    pub fn null() -> Self {
        Self::default()
    }

    /// One line.
    pub fn line(xy: Vec<[f64; 2]>) -> Self {
        let ends = if xy.is_empty() { Vec::new() } else { vec![xy.len()] };
        let coordinates = CoordinateSequence { xy, ends, ..CoordinateSequence::default() };
        Self { kind: GeometryType::LineString, coordinates, ..Self::default() }
    }

    /// A collection, which may contain collections.
    ///
    /// # Errors
    /// Collections nested deeper than [`limits::MAX_COLLECTION_DEPTH`].
    pub fn collection(members: Vec<Geometry>) -> Result<Self> {
        let collection = Self::with_members(members);
        let most = limits::MAX_COLLECTION_DEPTH;
        limits::check("depth of a geometry collection", collection.depth.into(), most)?;
        Ok(collection)
    }

    /// A geometry of coordinates known to match the type.
    pub(super) fn of_kind(kind: GeometryType, coordinates: CoordinateSequence) -> Self {
        Self { kind, coordinates, members: Vec::new(), depth: 0 }
    }

    /// A collection whose depth is known to be within the limit.
    pub(super) fn with_members(members: Vec<Geometry>) -> Self {
        let depth = 1 + members.iter().map(|member| member.depth).max().unwrap_or(0);
        Self { kind: GeometryType::Collection, members, depth, ..Self::default() }
    }

    /// Geometry type.
    pub fn kind(&self) -> GeometryType {
        self.kind
    }

    /// Coordinates of this geometry; empty for a collection.
    pub fn coordinates(&self) -> &CoordinateSequence {
        &self.coordinates
    }

    /// Coordinates of this geometry, for reuse.
    pub(super) fn into_coordinates(self) -> CoordinateSequence {
        CoordinateSequence { polygons: Vec::new(), ..self.coordinates }
    }

    /// The members of a collection.
    pub fn members(&self) -> &[Geometry] {
        &self.members
    }

    /// This geometry, or the members of a collection, recursively and in order.
    pub fn leaves(&self) -> impl Iterator<Item = &Geometry> {
        LeafGeometries { next: Some(self), stack: Vec::new() }
    }

    /// The lines and rings in order, including those of members. Points have no parts.
    pub fn parts(&self) -> impl Iterator<Item = GeometryPart<'_>> {
        self.leaves().flat_map(Self::own_parts)
    }

    /// The lines and rings of a geometry other than a collection.
    pub(super) fn own_parts(&self) -> impl Iterator<Item = GeometryPart<'_>> {
        (0..self.coordinates.ends.len()).map(|part| self.part(part))
    }

    /// The rings of each polygon.
    pub(super) fn polygons(&self) -> impl Iterator<Item = impl Iterator<Item = GeometryPart<'_>>> {
        let ends = &self.coordinates.polygons;
        let starts = std::iter::once(&0).chain(ends);
        starts.zip(ends).map(|(start, end)| (*start..*end).map(|part| self.part(part)))
    }

    fn part(&self, part: usize) -> GeometryPart<'_> {
        let CoordinateSequence { xy, z, m, polygons, .. } = &self.coordinates;
        let range = self.coordinates.range(part);
        let of = |values: &'_ Vec<f64>| if values.is_empty() { 0..0 } else { range.clone() };
        let role = match self.kind {
            GeometryType::Polygon | GeometryType::MultiPolygon if part == 0 => PartRole::Outer,
            GeometryType::Polygon => PartRole::Hole,
            GeometryType::MultiPolygon if polygons.binary_search(&part).is_ok() => PartRole::Outer,
            GeometryType::MultiPolygon => PartRole::Hole,
            _ => PartRole::Line,
        };
        GeometryPart { xy: &xy[range.clone()], z: &z[of(z)], m: &m[of(m)], role }
    }

    /// Replaces the vertices of lines and rings by `positions`, in the order of [`parts`](Self::parts);
    /// points are unchanged.
    pub fn place_parts(&mut self, positions: &mut impl Iterator<Item = [f64; 2]>) {
        if !self.kind.is_points() {
            self.coordinates.xy.iter_mut().zip(&mut *positions).for_each(|(own, new)| *own = new);
        }
        // The depth of collections is limited by their constructor.
        self.members.iter_mut().for_each(|member| member.place_parts(positions));
    }

    /// Calls `each` with the coordinates of this geometry or of all members.
    pub fn for_each_leaf(&mut self, each: &mut impl FnMut(&mut CoordinateSequence)) {
        each(&mut self.coordinates);
        // The depth of collections is limited by their constructor.
        self.members.iter_mut().for_each(|member| member.for_each_leaf(each));
    }

    /// Number of positions, including those of members.
    pub fn vertices(&self) -> usize {
        self.leaves().map(|leaf| leaf.coordinates.xy.len()).sum()
    }

    /// True if there are no positions.
    pub fn is_empty(&self) -> bool {
        self.leaves().all(|leaf| leaf.coordinates.xy.is_empty())
    }

    /// True if any position has a height.
    pub fn has_z(&self) -> bool {
        self.leaves().any(|leaf| !leaf.coordinates.z.is_empty())
    }

    /// True if any position has a measure.
    pub fn has_m(&self) -> bool {
        self.leaves().any(|leaf| !leaf.coordinates.m.is_empty())
    }

    /// x min, y min, x max, y max; `None` if empty.
    pub fn bounds(&self) -> Option<[f64; 4]> {
        let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for [x, y] in self.leaves().flat_map(|leaf| &leaf.coordinates.xy) {
            let [west, south, east, north] = bounds;
            bounds = [west.min(*x), south.min(*y), east.max(*x), north.max(*y)];
        }
        (bounds[0] <= bounds[2]).then_some(bounds)
    }

    /// Fails if a coordinate is NaN or infinite, or a height or measure is infinite; the error gives the
    /// vertex index over all members.
    pub(super) fn check_finite(&self) -> Result<()> {
        let mut first = 0;
        for leaf in self.leaves() {
            let CoordinateSequence { xy, z, m, .. } = &leaf.coordinates;
            // Branch-free, so that the loop is vectorised.
            let all = xy.as_flattened().iter().fold(true, |all, c| all & c.is_finite());
            if !all {
                let at = xy.iter().position(|p| !p.iter().all(|c| c.is_finite()));
                return Err(not_finite(first + at.unwrap_or_default(), "its position"));
            }
            for (values, what) in [(z, "its height"), (m, "its measure")] {
                if let Some(at) = values.iter().position(|value| value.is_infinite()) {
                    return Err(not_finite(first + at, what));
                }
            }
            first += xy.len();
        }
        Ok(())
    }
}

fn not_finite(vertex: usize, what: &str) -> Error {
    Error::bad_input(format!("vertex {vertex}: {what} is not finite"))
        .remedy("correct the vertex, or remove it or the feature")
}

/// Fails if the array lengths are inconsistent, which is a programming error of the caller.
fn check(coordinates: &CoordinateSequence) -> Result<()> {
    let CoordinateSequence { xy, z, m, ends, polygons } = coordinates;
    let fits = |values: &[f64]| values.is_empty() || values.len() == xy.len();
    if fits(z) && fits(m) && ascends(ends, xy.len()) && ascends(polygons, ends.len()) {
        return Ok(());
    }
    Err(Error::usage("lengths of the coordinate arrays are inconsistent"))
}

/// Whether end indices ascend from above 0 to at most `max`.
fn ascends(ends: &[usize], max: usize) -> bool {
    ends.iter().try_fold(0, |last, &end| (last < end && end <= max).then_some(end)).is_some()
}

/// Iterator over the members of nested collections.
struct LeafGeometries<'a> {
    next: Option<&'a Geometry>,
    stack: Vec<std::slice::Iter<'a, Geometry>>,
}

impl<'a> Iterator for LeafGeometries<'a> {
    type Item = &'a Geometry;

    fn next(&mut self) -> Option<&'a Geometry> {
        loop {
            let geometry = match self.next.take() {
                Some(geometry) => geometry,
                None => loop {
                    match self.stack.last_mut()?.next() {
                        Some(geometry) => break geometry,
                        None => _ = self.stack.pop(),
                    }
                },
            };
            match geometry.kind {
                GeometryType::Collection => self.stack.push(geometry.members.iter()),
                _ => return Some(geometry),
            }
        }
    }
}
