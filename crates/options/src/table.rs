//! Tables of fields.

use serde_json::Value as Json;

/// A named value of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceName {
    /// Its name, in lower case with dashes.
    pub name: &'static str,
    /// What it means, in a line.
    pub about: &'static str,
}

/// What values of a field are.
#[derive(Clone, Copy, Debug)]
pub enum OptionKind {
    /// On or off.
    Flag,
    /// A whole number.
    Whole,
    /// A number.
    Number,
    /// A text.
    Text,
    /// The name of a file or folder.
    Path,
    /// One of some names.
    Choice(fn() -> Vec<ChoiceName>),
    /// Numbers with commas between them; a list of numbers in Python.
    Numbers,
    /// A text of a form of its own, such as `KEY=VAL`; the type of values in Python.
    Shaped(&'static str),
}

/// How many values a field takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionArity {
    /// One, which has a default.
    One,
    /// One or none.
    Optional,
    /// Any number, one after the other.
    Repeated,
}

/// What a field is to the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionRole {
    /// The result depends on its value.
    Result,
    /// The name of a file that is read, on which the result depends.
    Reads,
    /// The name of a grid that is read: a file, a folder, a list or a pattern.
    ReadsGrid,
    /// It says what a run may use or replace, and nothing of the result.
    Run,
}

/// The least and the largest value, both allowed unless they are bounds alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptionRange {
    /// The least one; a value has to be above it where it is `open`.
    pub least: f64,
    /// The largest one.
    pub most: f64,
    /// True where the least itself is not allowed.
    pub open: bool,
}

impl OptionRange {
    /// Numbers above zero.
    pub const POSITIVE: Self = Self { least: 0.0, most: f64::MAX, open: true };
    /// Zero, and numbers above it.
    pub const FROM_ZERO: Self = Self { least: 0.0, most: f64::MAX, open: false };
    /// Any finite number.
    pub const FINITE: Self = Self { least: f64::MIN, most: f64::MAX, open: false };

    /// From the least to the largest value, both included.
    pub const fn new(least: f64, most: f64) -> Self {
        Self { least, most, open: false }
    }

    /// True for a value in it.
    pub fn contains(&self, value: f64) -> bool {
        value <= self.most && if self.open { value > self.least } else { value >= self.least }
    }

    /// What was expected, in words.
    pub fn text(&self) -> String {
        let Self { least, most, open } = *self;
        match (least == f64::MIN, most == f64::MAX, open) {
            (true, true, _) => "a number".to_owned(),
            (false, true, true) if least == 0.0 => "a number above zero".to_owned(),
            (false, true, false) if least == 0.0 => "a number of zero or more".to_owned(),
            (false, true, true) => format!("a number above {least}"),
            (false, true, false) => format!("a number of at least {least}"),
            (true, false, _) => format!("a number of at most {most}"),
            (false, false, _) => format!("a number from {least} to {most}"),
        }
    }
}

/// All that is said of an option.
#[derive(Debug)]
pub struct OptionField {
    /// Its name: that of the field unless told otherwise.
    pub name: &'static str,
    /// Other names of it.
    pub aliases: &'static [&'static str],
    /// Options of other structs in whose place it is, for those who meet the one and know the other.
    pub stands_for: &'static [&'static str],
    /// A letter for the command line.
    pub short: Option<char>,
    /// What it means.
    pub about: &'static str,
    /// What turning a flag off does that is on.
    pub off: Option<&'static str>,
    /// True for a name among those of inputs and output.
    pub positional: bool,
    /// The section of help that it stands in.
    pub heading: &'static str,
    /// What stands for its value in help.
    pub value: Option<&'static str>,
    /// The default in words.
    pub default_text: Option<&'static str>,
    /// The value of an option that is named without one.
    pub bare: Option<&'static str>,
    /// The values of numbers.
    pub range: Option<OptionRange>,
    /// What it is to the engine.
    pub role: OptionRole,
    /// What its values are.
    pub kind: OptionKind,
    /// How many it takes.
    pub shape: OptionArity,
    /// The value of a text as JSON, or what was expected instead.
    pub read: fn(&str) -> Result<Json, String>,
}

impl OptionField {
    /// Whether a value asks for anything: null does not, nor does `false` where the name alone is enough.
    pub fn is_given(&self, value: &Json) -> bool {
        !(value.is_null() || self.bare.is_some() && value == false)
    }

    /// The value that it has where it has none, if its default in words is one. Any words are a text or a path.
    pub(crate) fn usual(&self) -> Option<Json> {
        let is_value = !matches!(self.kind, OptionKind::Text | OptionKind::Path);
        let words =
            self.default_text.filter(|_| is_value && self.shape == OptionArity::Optional)?;
        (self.read)(words).ok()
    }

    /// Fails for a number out of the range; what was expected is in the error.
    ///
    /// # Errors
    /// What was expected, in words.
    pub fn check_range(&self, number: f64) -> Result<(), String> {
        match self.range {
            Some(range) if !range.contains(number) => Err(self.expected(&range)),
            _ => Ok(()),
        }
    }

    /// Fails for a text that is no value; what was expected is in the error.
    ///
    /// # Errors
    /// What was expected, in words.
    pub fn check_text(&self, text: &str) -> Result<(), String> {
        (self.read)(text).map(drop).map_err(|expected| match (self.range, self.kind) {
            (Some(range), OptionKind::Whole | OptionKind::Number) => {
                format!("expected {}", self.expected(&range))
            }
            _ => expected,
        })
    }

    fn expected(&self, range: &OptionRange) -> String {
        match self.kind {
            OptionKind::Whole => range.text().replacen("a number", "a whole number", 1),
            _ => range.text(),
        }
    }
}

/// A field, or the fields of a group.
#[derive(Debug)]
pub enum OptionEntry {
    /// A field.
    Field(OptionField),
    /// All fields of another table.
    Group(&'static OptionTable),
}

/// What options go with what. A term is the name of an option that is not at its default, or `name=value`, which of several
/// values is one, or `name!=value`, which is another.
#[derive(Clone, Copy, Debug)]
pub enum OptionRule {
    /// Exactly one of these, which say what the second field names.
    OneOf(&'static [&'static str], &'static str),
    /// The first one cannot be used with any of the others.
    NotWith(&'static str, &'static [&'static str]),
    /// The first one acts with one of the others only.
    Needs(&'static str, &'static [&'static str]),
}

/// The fields of a struct.
#[derive(Debug)]
pub struct OptionTable {
    /// What the struct is for.
    pub about: &'static str,
    /// Its fields, in their order.
    pub entries: &'static [OptionEntry],
    /// What of them goes with what.
    pub rules: &'static [OptionRule],
}

impl OptionTable {
    /// All fields, those of groups among them.
    pub fn fields(&'static self) -> Vec<&'static OptionField> {
        let mut fields = Vec::new();
        self.collect(&mut fields);
        fields
    }

    /// All rules, those of groups among them.
    pub fn rules(&'static self) -> Vec<&'static OptionRule> {
        let groups = self.entries.iter().filter_map(|entry| match entry {
            OptionEntry::Field(_) => None,
            OptionEntry::Group(table) => Some(table.rules()),
        });
        self.rules.iter().chain(groups.flatten()).collect()
    }

    fn collect(&'static self, fields: &mut Vec<&'static OptionField>) {
        for entry in self.entries {
            match entry {
                OptionEntry::Field(field) => fields.push(field),
                OptionEntry::Group(table) => table.collect(fields),
            }
        }
    }

    /// The field of this name or alias; dashes count as underscores.
    pub fn find(&'static self, name: &str) -> Option<&'static OptionField> {
        let name = name.replace('-', "_");
        let is_it =
            |field: &&OptionField| field.name == name || field.aliases.contains(&name.as_str());
        self.fields().into_iter().find(is_it)
    }

    /// Whether a field has this name, for rules that are checked when they are compiled.
    pub(crate) const fn has(&self, name: &str) -> bool {
        let mut i = 0;
        while i < self.entries.len() {
            let found = match &self.entries[i] {
                OptionEntry::Field(field) => is_same(field.name, name),
                OptionEntry::Group(table) => table.has(name),
            };
            if found {
                return true;
            }
            i += 1;
        }
        false
    }
}

const fn is_same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}
