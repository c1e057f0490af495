//! The properties and ids of a feature compared with its original, as far as the format can represent
//! them.

use std::collections::HashMap;

use terrane_vector::{
    Feature, FeatureSource, FieldDefinition, GeometryType, Id, PropertySupport, PropertyValue,
    VectorCapabilities,
};

/// Name of the property that an id becomes in formats that have no other place for it.
const ID: &str = "id";
/// Name of an id that has a place of its own.
const OWN_ID: &str = "its id";
/// Name of the column that ids are in where a CSV numbers features as ids repeat; underscores follow
/// where a property has it.
const ORIGINAL_ID: &str = "original_id";
/// Name of the field that numbers records of a dBASE table without any.
const NUMBER: &str = "FID";
/// Most bytes of the name of a field of a dBASE table.
const NAME_BYTES: usize = 10;

/// Mapping of the original's properties to those of the file.
pub(super) struct AttributeRules {
    holds: VectorCapabilities,
    /// The columns of the file, in formats that have some.
    columns: Vec<FieldDefinition>,
    /// Truncated names of properties, by the original name.
    cut: HashMap<String, String>,
    /// True where ids have a place of their own: cells are all alike.
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
pub(super) type Facts = Vec<(String, PropertyValue)>;

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
        let is_there = |value: &PropertyValue| match value {
            PropertyValue::Null => has_nulls,
            PropertyValue::Text(text) => has_empty || !text.trim().is_empty(),
            _ => true,
        };
        facts.retain(|(_, value)| is_there(value));
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
        let is_free =
            |field: &&FieldDefinition| self.cut.values().all(|used| **used != *field.name);
        let is_it = |field: &&FieldDefinition| field.name.eq_ignore_ascii_case(name);
        let is_cut = |field: &&FieldDefinition| {
            let stem = field.name.trim_end_matches(|c: char| c.is_ascii_digit());
            let stem = stem.strip_suffix('_').filter(|_| stem.len() < field.name.len());
            let is_start =
                |of: &str| name.get(..of.len()).is_some_and(|own| own.eq_ignore_ascii_case(of));
            (name.len() > NAME_BYTES && is_start(&field.name)) || stem.is_some_and(is_start)
        };
        let free = || self.columns.iter().filter(is_free);
        let found = free().find(is_it).or_else(|| free().find(is_cut));
        let found = found.map_or(name, |field| &field.name).to_owned();
        self.cut.insert(name.to_owned(), found.clone());
        found
    }

    /// The first difference of a feature's attributes; `None` without any.
    pub(super) fn difference(&mut self, expected: &Facts, found: &Facts) -> Option<String> {
        let is_known = |of: &str| expected.iter().any(|(known, _)| known == of);
        let moved = found.iter().find(|(name, _)| {
            let is_it = name.trim_end_matches('_') == ORIGINAL_ID && !is_known(name);
            is_it && self.holds.values == PropertySupport::Cells
        });
        for (name, value) in expected {
            let is_it = |of: &str| found.iter().find(|(other, _)| other == of);
            let known = moved.filter(|_| name == ID).or_else(|| is_it(name));
            let Some((_, own)) = known.or_else(|| is_it(counterpart(name)?)) else {
                return Some(format!("{name} is gone"));
            };
            match self.compare(name, value, own) {
                AttributeMatch::Yes => {}
                AttributeMatch::Rounded => self.lost.rounded += 1,
                AttributeMatch::No => {
                    return Some(format!("{name} is {}", distinct_texts(own, value)));
                }
            }
        }
        let is_new = |(name, _): &&(String, PropertyValue)| {
            let is_number = match self.holds.values {
                PropertySupport::Cells => {
                    name == ID || moved.is_some_and(|(own, _)| own == name && is_known(ID))
                }
                PropertySupport::Dbase => name == NUMBER && expected.is_empty(),
                _ => false,
            };
            !is_number && !is_known(name) && !counterpart(name).is_some_and(is_known)
        };
        found.iter().find(is_new).map(|(name, _)| format!("{name} is new"))
    }

    fn compare(&self, name: &str, value: &PropertyValue, own: &PropertyValue) -> AttributeMatch {
        let yes = |is_same: bool| if is_same { AttributeMatch::Yes } else { AttributeMatch::No };
        match (number(value), number(own)) {
            (Some(a), Some(b)) if a == b => return yes(is_whole_same(value, own)),
            (Some(a), Some(b)) => return self.compare_rounded(name, a, b),
            _ => {}
        }
        let is_typed = self.holds.values == PropertySupport::Typed;
        if is_typed || matches!((value, own), (PropertyValue::Bool(_), PropertyValue::Bool(_))) {
            let is_text = |v: &PropertyValue| {
                !matches!(v, PropertyValue::Bool(_) | PropertyValue::Null | PropertyValue::Json(_))
            };
            let has_number = number(value).is_some() || number(own).is_some();
            let both = is_text(value) && is_text(own) && !has_number;
            return yes(if both { text(value) == text(own) } else { value == own });
        }
        let (a, b) = (self.line(value), self.line(own));
        let (had, has) = (a.parse::<f64>(), b.parse::<f64>());
        let is_number = match self.holds.values {
            PropertySupport::Cells => true,
            _ => number(value).is_some() && number(own).is_none(),
        };
        yes(a == b || (is_number && had.is_ok_and(|a| has.is_ok_and(|b| a == b))))
    }

    /// Numbers that differ: dBASE tables store a fixed number of decimals, and whole numbers in columns
    /// of fractions have 53 bits.
    fn compare_rounded(&self, name: &str, value: f64, own: f64) -> AttributeMatch {
        let column = self.columns.iter().find(|field| *field.name == *name);
        let digits =
            column.filter(|_| self.holds.values == PropertySupport::Dbase).and_then(|c| c.decimals);
        let Some(digits) = digits else { return AttributeMatch::No };
        let half = 0.5 * 10f64.powi(-i32::try_from(digits).unwrap_or(i32::MAX));
        let is_near = (value - own).abs() <= half * (1.0 + 1e-9);
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

/// Ids may move: from a place of their own to a property, or back.
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

/// A key by which features with the same attributes are found; different attributes may share it.
pub(super) fn stamp(facts: &Facts) -> String {
    let of = |(name, value): &(String, PropertyValue)| {
        let text = text(value);
        let text = text.trim();
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => format!("{name}={}", number + 0.0),
            _ => format!("{name}={text}"),
        }
    };
    let mut all: Vec<String> = facts.iter().map(of).collect();
    all.sort();
    all.join("\n")
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
fn is_whole_same(value: &PropertyValue, own: &PropertyValue) -> bool {
    match (value, own) {
        (PropertyValue::Int(a), PropertyValue::Int(b)) => a == b,
        _ => true,
    }
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

/// A value beside the one that it should be: with their types where these differ.
fn distinct_texts(own: &PropertyValue, value: &PropertyValue) -> String {
    let is_alike = kind(own) == kind(value);
    let told = |value: &PropertyValue| match value {
        _ if is_alike => shown(value),
        PropertyValue::Null => shown(value),
        _ => format!("the {} {}", kind(value), shown(value)),
    };
    format!("{}, not {}", told(own), told(value))
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
    const MOST: usize = 40;
    let text = text(value);
    let (start, rest) = match text.char_indices().nth(MOST) {
        Some((end, _)) => (&text[..end], "..."),
        None => (&*text, ""),
    };
    match value {
        PropertyValue::Null => "null".to_owned(),
        PropertyValue::Text(_) => format!("{start:?}{rest}"),
        _ => format!("{start}{rest}"),
    }
}
