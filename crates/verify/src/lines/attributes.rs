//! Comparison of the properties and ids of a feature with its original, as far as the format supports them.

use std::collections::HashMap;

use terrane_vector::{
    Feature, FeatureSource, FieldDefinition, GeometryType, Id, PropertySupport, PropertyValue,
    VectorCapabilities,
};

/// Name of the property for ids in formats without ids.
const ID: &str = "id";
/// Name of an id outside the properties.
const OWN_ID: &str = "its id";
/// Name of the column of ids in a CSV that numbers features because ids repeat; followed by underscores
/// where a property has the name.
const ORIGINAL_ID: &str = "original_id";
/// Name of the field that numbers records of a dBASE table without any.
const NUMBER: &str = "FID";
/// Maximum number of bytes of the name of a field of a dBASE table.
const NAME_BYTES: usize = 10;

/// Mapping of original properties to those of the file.
pub(super) struct AttributeRules {
    holds: VectorCapabilities,
    /// The columns of the file, in formats that have some.
    columns: Vec<FieldDefinition>,
    /// Truncated names of properties, by the original name.
    cut: HashMap<String, String>,
    /// True where ids are stored outside the properties.
    has_ids: bool,
    /// Properties that were not compared, and the number of their features.
    pub(super) lost: UnsupportedAttributes,
}

/// Numbers of features with attributes that the format cannot store.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnsupportedAttributes {
    pub(super) properties: u64,
    pub(super) ids: u64,
    /// Values that have fewer digits than they had.
    pub(super) rounded: u64,
}

/// Properties and id of a feature, under the names of the file, without null values where the
/// format does not distinguish them.
pub(super) type Facts = Vec<Fact>;

/// A property or an id by its name.
type Fact = (String, PropertyValue);

impl AttributeRules {
    /// Rules for a file of lines of this format.
    pub(super) fn new(holds: VectorCapabilities, lines: &dyn FeatureSource) -> Self {
        let columns = lines.layer().schema.clone().unwrap_or_default();
        let has_ids = holds.ids && holds.values != PropertySupport::Cells;
        Self {
            holds,
            columns,
            cut: HashMap::new(),
            has_ids,
            lost: UnsupportedAttributes::default(),
        }
    }

    /// Truncated names, with the original ones.
    pub(super) fn cut(&self) -> Vec<String> {
        let mut cut: Vec<String> =
            self.cut.iter().filter(|(a, b)| a != b).map(|(a, b)| format!("{a} is {b}")).collect();
        cut.sort();
        cut
    }

    /// Expected attributes of a feature of the original.
    pub(super) fn expected(&mut self, feature: &Feature) -> Facts {
        let id = feature.id.as_ref().map(value_of);
        let has_name = feature.properties.get(ID).is_some();
        let mut facts: Facts = Vec::new();
        let known = match self.holds.values {
            PropertySupport::None => {
                self.lost.properties += u64::from(!feature.properties.0.is_empty());
                self.lost.ids += u64::from(id.is_some());
                return facts;
            }
            PropertySupport::Named([points, lines]) => {
                self.lost.ids += u64::from(id.is_some());
                Some(if feature.geometry.kind() == GeometryType::Point { points } else { lines })
            }
            _ if self.has_ids => {
                facts.extend(id.map(|id| (OWN_ID.to_owned(), id)));
                None
            }
            _ => {
                self.lost.ids += u64::from(id.is_some() && has_name);
                facts.extend(id.filter(|_| !has_name).map(|id| (self.name(ID), id)));
                None
            }
        };
        let mut has_lost = false;
        for (name, value) in feature.properties.iter() {
            match known.is_none_or(|known| known.contains(&&**name)) {
                true => facts.push((self.name(name), value.clone())),
                false => has_lost |= *value != PropertyValue::Null,
            }
        }
        self.lost.properties += u64::from(has_lost);
        self.without_nulls(facts)
    }

    /// Attributes of a feature of the lines.
    pub(super) fn found(&self, feature: &Feature) -> Facts {
        let id_name = if self.has_ids { OWN_ID } else { ID };
        let id = feature.id.as_ref().map(|id| (id_name.to_owned(), value_of(id)));
        let all = feature.properties.iter().map(|(name, value)| (name.to_string(), value.clone()));
        self.without_nulls(id.into_iter().chain(all).collect())
    }

    fn without_nulls(&self, mut facts: Facts) -> Facts {
        let has_nulls = self.holds.values == PropertySupport::Typed;
        let has_empty = has_nulls || self.holds.values == PropertySupport::Columns;
        facts.retain(|(_, value)| match value {
            PropertyValue::Null => has_nulls,
            PropertyValue::Text(text) => has_empty || !text.trim().is_empty(),
            _ => true,
        });
        facts
    }

    /// The name of a property in the file: dBASE tables truncate names, and number duplicates.
    fn name(&mut self, name: &str) -> String {
        if self.holds.values != PropertySupport::Dbase {
            return name.trim().to_owned();
        }
        if let Some(known) = self.cut.get(name) {
            return known.clone();
        }
        let unused = || {
            let fields = self.columns.iter();
            fields.filter(|field| self.cut.values().all(|used| **used != *field.name))
        };
        let found = unused()
            .find(|field| field.name.eq_ignore_ascii_case(name))
            .or_else(|| unused().find(|field| is_truncated(name, &field.name)));
        let found = found.map_or(name, |field| &field.name).to_owned();
        self.cut.insert(name.to_owned(), found.clone());
        found
    }

    /// The first difference of a feature's attributes; `None` without any.
    pub(super) fn difference(&mut self, expected: &Facts, found: &Facts) -> Option<String> {
        let moved = self.moved_id(expected, found);
        for (name, value) in expected {
            let known = moved.filter(|_| name == ID).or_else(|| fact(found, name));
            let Some((_, actual)) = known.or_else(|| fact(found, counterpart(name)?)) else {
                return Some(format!("{name} is gone"));
            };
            match self.compare(name, value, actual) {
                AttributeMatch::Yes => {}
                AttributeMatch::Rounded => self.lost.rounded += 1,
                AttributeMatch::No => {
                    return Some(format!("{name} is {}", distinct_texts(actual, value)));
                }
            }
        }
        let new = found.iter().find(|(name, _)| self.is_new(name, expected, moved));
        new.map(|(name, _)| format!("{name} is new"))
    }

    /// The column of a CSV that has the ids, where their own name is taken by the numbers of features.
    fn moved_id<'a>(&self, expected: &Facts, found: &'a Facts) -> Option<&'a Fact> {
        let mut columns = found.iter().filter(|_| self.holds.values == PropertySupport::Cells);
        columns.find(|(name, _)| {
            name.trim_end_matches('_') == ORIGINAL_ID && fact(expected, name).is_none()
        })
    }

    /// True for a property that the original does not have, unless the format adds it to number features.
    fn is_new(&self, name: &str, expected: &Facts, moved: Option<&Fact>) -> bool {
        let is_expected = |name: &str| fact(expected, name).is_some();
        let is_number = match self.holds.values {
            PropertySupport::Cells => {
                name == ID || moved.is_some_and(|(actual, _)| actual == name && is_expected(ID))
            }
            PropertySupport::Dbase => name == NUMBER && expected.is_empty(),
            _ => false,
        };
        !is_number && !is_expected(name) && !counterpart(name).is_some_and(is_expected)
    }

    fn compare(&self, name: &str, value: &PropertyValue, actual: &PropertyValue) -> AttributeMatch {
        match (number(value), number(actual)) {
            (Some(a), Some(b)) if a == b => {
                return AttributeMatch::exact(is_whole_same(value, actual));
            }
            (Some(a), Some(b)) => return self.compare_rounded(name, a, b),
            _ => {}
        }
        let is_typed = self.holds.values == PropertySupport::Typed;
        if is_typed || matches!((value, actual), (PropertyValue::Bool(_), PropertyValue::Bool(_))) {
            let is_same = match is_text(value) && is_text(actual) {
                true => text(value) == text(actual),
                false => value == actual,
            };
            return AttributeMatch::exact(is_same);
        }
        let (a, b) = (self.line(value), self.line(actual));
        let (had, has) = (a.parse::<f64>(), b.parse::<f64>());
        let is_number = match self.holds.values {
            PropertySupport::Cells => true,
            _ => number(value).is_some() && number(actual).is_none(),
        };
        let is_same = a == b || (is_number && had.is_ok_and(|a| has.is_ok_and(|b| a == b)));
        AttributeMatch::exact(is_same)
    }

    /// Numbers that differ: dBASE tables store a fixed number of decimals, and whole numbers in columns
    /// of fractions have 53 bits.
    fn compare_rounded(&self, name: &str, value: f64, actual: f64) -> AttributeMatch {
        let column = self.columns.iter().find(|field| *field.name == *name);
        let digits =
            column.filter(|_| self.holds.values == PropertySupport::Dbase).and_then(|c| c.decimals);
        let Some(digits) = digits else { return AttributeMatch::No };
        let half = 0.5 * 10f64.powi(-i32::try_from(digits).unwrap_or(i32::MAX));
        let is_near = (value - actual).abs() <= half * (1.0 + 1e-9);
        if is_near { AttributeMatch::Rounded } else { AttributeMatch::No }
    }

    /// The text of a value as the format holds it.
    fn line(&self, value: &PropertyValue) -> String {
        let text = text(value);
        match self.holds.values {
            PropertySupport::Dbase => text.trim_end_matches([' ', '\0']).to_owned(),
            PropertySupport::Cells => text.trim().to_owned(),
            PropertySupport::Named(_) => {
                text.replace(|c: char| c.is_control(), " ").trim().to_owned()
            }
            _ => text,
        }
    }
}

/// The other name of an id, which may become a property or cease to be one.
fn counterpart(name: &str) -> Option<&'static str> {
    match name {
        ID => Some(OWN_ID),
        OWN_ID => Some(ID),
        _ => None,
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AttributeMatch {
    Yes,
    Rounded,
    No,
}

impl AttributeMatch {
    fn exact(is_same: bool) -> Self {
        if is_same { Self::Yes } else { Self::No }
    }
}

/// The property of a name.
fn fact<'a>(facts: &'a Facts, name: &str) -> Option<&'a Fact> {
    facts.iter().find(|(other, _)| other == name)
}

/// True when a field of a dBASE table has the name of a property cut to [`NAME_BYTES`], or its beginning
/// with `_` and a number, as duplicates have.
fn is_truncated(name: &str, field: &str) -> bool {
    let stem = field.trim_end_matches(|c: char| c.is_ascii_digit());
    let numbered = stem.strip_suffix('_').filter(|_| stem.len() < field.len());
    let is_cut = name.len() > NAME_BYTES && starts_with(name, field);
    is_cut || numbered.is_some_and(|start| starts_with(name, start))
}

/// True when a name begins with another, in any case of letters.
fn starts_with(name: &str, start: &str) -> bool {
    name.get(..start.len()).is_some_and(|actual| actual.eq_ignore_ascii_case(start))
}

/// A key by which features with the same attributes are found; different attributes may share it.
pub(super) fn stamp(facts: &Facts) -> String {
    let mut all: Vec<String> = facts.iter().map(fact_key).collect();
    all.sort();
    all.join("\n")
}

/// A property as text; numbers in one notation, as formats write them differently.
fn fact_key((name, value): &Fact) -> String {
    let text = text(value);
    let text = text.trim();
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => format!("{name}={}", number + 0.0),
        _ => format!("{name}={text}"),
    }
}

fn value_of(id: &Id) -> PropertyValue {
    match id {
        Id::Int(id) => PropertyValue::Int(*id),
        Id::Real(id) => PropertyValue::Real(*id),
        Id::Text(id) => PropertyValue::Text(id.clone()),
    }
}

fn number(value: &PropertyValue) -> Option<f64> {
    match value {
        PropertyValue::Int(value) => Some(*value as f64),
        PropertyValue::Real(value) => Some(*value),
        _ => None,
    }
}

/// Whole numbers are the same to the last digit.
fn is_whole_same(value: &PropertyValue, actual: &PropertyValue) -> bool {
    match (value, actual) {
        (PropertyValue::Int(a), PropertyValue::Int(b)) => a == b,
        _ => true,
    }
}

/// True for texts, dates and times.
fn is_text(value: &PropertyValue) -> bool {
    matches!(value, PropertyValue::Text(_) | PropertyValue::Date(_) | PropertyValue::DateTime(_))
}

fn text(value: &PropertyValue) -> String {
    match value {
        PropertyValue::Null => String::new(),
        PropertyValue::Bool(value) => value.to_string(),
        PropertyValue::Int(value) => value.to_string(),
        PropertyValue::Real(value) => value.to_string(),
        PropertyValue::Text(text)
        | PropertyValue::Date(text)
        | PropertyValue::DateTime(text)
        | PropertyValue::Json(text) => text.clone(),
    }
}

/// A value and the expected one for messages, with their types where these differ.
fn distinct_texts(actual: &PropertyValue, expected: &PropertyValue) -> String {
    let show = if kind(actual) == kind(expected) { shown } else { shown_with_kind };
    format!("{}, not {}", show(actual), show(expected))
}

fn shown_with_kind(value: &PropertyValue) -> String {
    match value {
        PropertyValue::Null => shown(value),
        _ => format!("the {} {}", kind(value), shown(value)),
    }
}

/// The type of a value, for messages.
fn kind(value: &PropertyValue) -> &'static str {
    match value {
        PropertyValue::Null => "null",
        PropertyValue::Bool(_) => "boolean",
        PropertyValue::Int(_) | PropertyValue::Real(_) => "number",
        PropertyValue::Text(_) => "text",
        PropertyValue::Date(_) => "date",
        PropertyValue::DateTime(_) => "time",
        PropertyValue::Json(_) => "JSON",
    }
}

/// A value for messages: texts are in quotes.
pub(super) fn shown(value: &PropertyValue) -> String {
    const MAX_CHARS: usize = 40;
    let text = text(value);
    let (start, rest) = match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => (&text[..end], "..."),
        None => (&*text, ""),
    };
    match value {
        PropertyValue::Null => "null".to_owned(),
        PropertyValue::Text(_) => format!("{start:?}{rest}"),
        _ => format!("{start}{rest}"),
    }
}
