//! Random features for tests.

use proptest::prelude::*;

use super::{
    CoordinateSequence, Feature, FeatureProperties, Geometry, GeometryType, Id, PropertyValue,
};

/// A number below `max` of any length.
fn number(max: f64) -> impl Strategy<Value = f64> {
    prop_oneof![
        (-max..max).prop_map(|v: f64| v),
        (-max..max).prop_map(|v: f64| v.round()),
        (-max..max).prop_map(|v: f64| (v * 1e6).round() / 1e6),
    ]
}

fn position() -> impl Strategy<Value = [f64; 2]> {
    (number(180.0), number(90.0)).prop_map(|(x, y)| [x, y])
}

fn line(least: usize) -> impl Strategy<Value = Vec<[f64; 2]>> {
    prop::collection::vec(position(), least..8)
}

/// A polygon whose outer ring is clockwise and whose holes, inside it, are not; each polygon of its
/// own number in a place of its own.
fn polygon(number: usize) -> impl Strategy<Value = Vec<Vec<[f64; 2]>>> {
    (0_usize..3, 3_usize..9, 0.01..1.0).prop_map(move |(holes, corners, size)| {
        let [x, y] = [number as f64 * 7.0 - 20.0, 10.0];
        let outer = std::iter::once(regular_ring([x, y], size * 3.0, corners, -1.0));
        let holes = (0..holes).map(|i| {
            regular_ring([x + (i as f64 - 0.5) * size * 0.6, y], size * 0.2, corners, 1.0)
        });
        outer.chain(holes).collect()
    })
}

/// A regular polygon, clockwise if `turn` is negative.
fn regular_ring([x, y]: [f64; 2], radius: f64, corners: usize, turn: f64) -> Vec<[f64; 2]> {
    let angles = (0..=corners).map(|i| {
        let share = (i % corners) as f64 / corners as f64;
        turn * share * std::f64::consts::TAU
    });
    angles.map(|angle| [x + radius * angle.cos(), y + radius * angle.sin()]).collect()
}

fn polygons(most: usize) -> impl Strategy<Value = Vec<Vec<Vec<[f64; 2]>>>> {
    (0..most + 1).prop_flat_map(|count| (0..count).map(polygon).collect::<Vec<_>>())
}

/// Whether positions have heights and measures.
#[derive(Clone, Copy, Debug)]
struct Extras {
    has_z: bool,
    has_m: bool,
}

fn extras() -> impl Strategy<Value = Extras> {
    (any::<bool>(), any::<bool>()).prop_map(|(has_z, has_m)| Extras { has_z, has_m })
}

fn assembled(kind: GeometryType, polygons: &[Vec<Vec<[f64; 2]>>], extras: Extras) -> Geometry {
    let Extras { has_z, has_m } = extras;
    let mut found = CoordinateSequence::default();
    for rings in polygons {
        for ring in rings {
            for &[x, y] in ring {
                // A ring ends with the height it began with.
                let (z, m) = (x * 2.0 + y, x - y / 3.0);
                found.push([x, y], has_z.then_some(z), has_m.then_some(m));
            }
            found.end_part();
        }
        found.end_polygon();
    }
    Geometry::new(kind, found).unwrap()
}

/// A geometry of a kind; a collection has members of all other kinds but null, and collections.
pub(super) fn geometry(kind: GeometryType) -> BoxedStrategy<Geometry> {
    if kind != GeometryType::Collection {
        return leaf(kind);
    }
    let leaf = prop::sample::select(&GeometryType::ALL[1..7]).prop_flat_map(leaf);
    leaf.prop_recursive(3, 8, 3, |inner| {
        prop::collection::vec(inner, 1..4)
            .prop_map(|members| Geometry::collection(members).unwrap())
    })
    .prop_filter("a collection", |geometry| geometry.kind() == GeometryType::Collection)
    .boxed()
}

/// A geometry of a kind other than a collection.
fn leaf(kind: GeometryType) -> BoxedStrategy<Geometry> {
    match kind {
        GeometryType::Null => Just(Geometry::null()).boxed(),
        GeometryType::Point => (prop::collection::vec(position(), 1), extras())
            .prop_map(|(xy, extras)| assembled(GeometryType::Point, &[vec![xy]], extras))
            .boxed(),
        GeometryType::MultiPoint => (line(1), extras())
            .prop_map(|(xy, extras)| assembled(GeometryType::MultiPoint, &[vec![xy]], extras))
            .boxed(),
        GeometryType::LineString => (line(2), extras())
            .prop_map(|(xy, extras)| assembled(GeometryType::LineString, &[vec![xy]], extras))
            .boxed(),
        GeometryType::MultiLineString => (prop::collection::vec(line(2), 2..4), extras())
            .prop_map(|(lines, extras)| assembled(GeometryType::MultiLineString, &[lines], extras))
            .boxed(),
        GeometryType::Polygon => (polygon(0), extras())
            .prop_map(|(rings, extras)| assembled(GeometryType::Polygon, &[rings], extras))
            .boxed(),
        GeometryType::MultiPolygon | GeometryType::Collection => (polygons(3), extras())
            .prop_filter("several", |(polygons, _)| polygons.len() > 1)
            .prop_map(|(polygons, extras)| assembled(GeometryType::MultiPolygon, &polygons, extras))
            .boxed(),
    }
}

fn value() -> impl Strategy<Value = PropertyValue> {
    prop_oneof![
        Just(PropertyValue::Null),
        any::<bool>().prop_map(PropertyValue::Bool),
        any::<i64>().prop_map(PropertyValue::Int),
        (-1e9..1e9).prop_map(PropertyValue::Real),
        "[a-zé\"\\\\,;<&]{0,8}[a-z]".prop_map(PropertyValue::Text),
        Just(PropertyValue::Json("{\"a\":[1,null]}".to_owned())),
    ]
}

/// Properties that every feature of a file has alike: one of each type a table can hold.
pub(super) fn properties() -> impl Strategy<Value = FeatureProperties> {
    let maybe =
        |value: PropertyValue, is_there: bool| if is_there { value } else { PropertyValue::Null };
    let values =
        (any::<bool>(), any::<i64>(), -1e9..1e9, "[a-zé\"\\\\,;<&]{0,9}[a-z]", any::<[bool; 4]>());
    values.prop_map(move |(flag, whole, real, text, there)| {
        let mut found = FeatureProperties::default();
        found.push("flag", maybe(PropertyValue::Bool(flag), there[0]));
        found.push("whole", maybe(PropertyValue::Int(whole), there[1]));
        found.push("real", maybe(PropertyValue::Real(real), there[2]));
        found.push("text", maybe(PropertyValue::Text(text), there[3]));
        found
    })
}

fn id() -> impl Strategy<Value = Option<Id>> {
    prop_oneof![
        Just(None),
        any::<i64>().prop_map(|id| Some(Id::Int(id))),
        "[a-z]{1,5}".prop_map(|id| Some(Id::Text(id))),
    ]
}

/// Any feature.
pub(super) fn feature() -> impl Strategy<Value = Feature> {
    let kind = prop::sample::select(&GeometryType::ALL[..]);
    let properties = prop::collection::vec(("[a-c]{1,2}", value()), 0..4).prop_map(|list| {
        let mut found = FeatureProperties::default();
        for (name, value) in list {
            if found.get(&name).is_none() {
                found.push(name, value);
            }
        }
        found
    });
    (kind.prop_flat_map(geometry), properties, id()).prop_map(|(geometry, properties, id)| {
        Feature { id, properties, geometry, foreign: Vec::new() }
    })
}
