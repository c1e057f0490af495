//! Tables of options.

use serde_json::Value as Json;

/// A named value of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceName {
    /// Its name, in lower case with dashes.
    pub name: &'static str,
    /// Description, in one line.
    pub about: &'static str,
}

/// Kind of values of a field.
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
    /// One of several names.
    Choice(fn() -> Vec<ChoiceName>),
    /// Comma-separated numbers; a list of numbers in Python.
    Numbers,
    /// Text with its own syntax, such as `KEY=VAL`; with the type of values in Python.
    Shaped(&'static str),
}

/// Number of values of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionArity {
    /// One, which has a default.
    One,
    /// One or none.
    Optional,
    /// Any number of values.
    Repeated,
}

/// Role of a field in the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionRole {
    /// The result depends on its value.
    Result,
    /// A file that is read; the result depends on it.
    Reads,
    /// A grid that is read: a file, folder, list or pattern.
    ReadsGrid,
    /// Resources and permissions of a run; the result does not depend on it.
    Run,
}

/// Minimum and maximum of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptionRange {
    /// The minimum; excluded if `open`.
    pub least: f64,
    /// The maximum.
    pub most: f64,
    /// True if the minimum is excluded.
    pub open: bool,
}

impl OptionRange {
    /// Positive numbers.
    pub const POSITIVE: Self = Self { least: 0.0, most: f64::MAX, open: true };
    /// Non-negative numbers.
    pub const FROM_ZERO: Self = Self { least: 0.0, most: f64::MAX, open: false };
    /// Any finite number.
    pub const FINITE: Self = Self { least: f64::MIN, most: f64::MAX, open: false };

    /// From minimum to maximum, both included.
    pub const fn new(least: f64, most: f64) -> Self {
        Self { least, most, open: false }
    }

    /// True for a value within the range.
    pub fn contains(&self, value: f64) -> bool {
        value <= self.most && if self.open { value > self.least } else { value >= self.least }
    }

    /// Description of the expected value.
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

/// Description of an option.
#[derive(Debug)]
pub struct OptionField {
    /// Name; that of the field by default.
    pub name: &'static str,
    /// Aliases.
    pub aliases: &'static [&'static str],
    /// Equivalent options of other structs, for hints to users who know those.
    pub stands_for: &'static [&'static str],
    /// Short name on the command line.
    pub short: Option<char>,
    /// Meaning.
    pub about: &'static str,
    /// Effect of turning off a flag that is on by default.
    pub off: Option<&'static str>,
    /// True for positional arguments.
    pub positional: bool,
    /// Section of help.
    pub heading: &'static str,
    /// Placeholder of its value in help.
    pub value: Option<&'static str>,
    /// The default in words.
    pub default_text: Option<&'static str>,
    /// Value if the option is given without one.
    pub bare: Option<&'static str>,
    /// Range of numbers.
    pub range: Option<OptionRange>,
    /// Role in the engine.
    pub role: OptionRole,
    /// Kind of values.
    pub kind: OptionKind,
    /// Number of values.
    pub shape: OptionArity,
    /// Parses a text to JSON, or returns the expected value.
    pub read: fn(&str) -> Result<Json, String>,
}

impl OptionField {
    /// Whether a value is given: null is not, nor is `false` for options with an optional value.
    pub fn is_given(&self, value: &Json) -> bool {
        !(value.is_null() || self.bare.is_some() && value == false)
    }

    /// The default in words as a value, if it is one; never for texts and paths.
    pub(crate) fn usual(&self) -> Option<Json> {
        let is_value = !matches!(self.kind, OptionKind::Text | OptionKind::Path);
        let words =
            self.default_text.filter(|_| is_value && self.shape == OptionArity::Optional)?;
        (self.read)(words).ok()
    }

    /// Fails for a number out of range.
    ///
    /// # Errors
    /// Description of the expected value.
    pub fn check_range(&self, number: f64) -> Result<(), String> {
        match self.range {
            Some(range) if !range.contains(number) => Err(self.expected(&range)),
            _ => Ok(()),
        }
    }

    /// Fails for an invalid text.
    ///
    /// # Errors
    /// Description of the expected value.
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

/// A rule on combinations of options. A term is the name of an option with a value other than its default, or
/// `name=value`, or `name!=value`.
#[derive(Clone, Copy, Debug)]
pub enum OptionRule {
    /// Exactly one of these; the second field is a noun for their purpose.
    OneOf(&'static [&'static str], &'static str),
    /// The first one excludes all others.
    NotWith(&'static str, &'static [&'static str]),
    /// The first one requires one of the others.
    Needs(&'static str, &'static [&'static str]),
}

/// The fields of a struct.
#[derive(Debug)]
pub struct OptionTable {
    /// What the struct is for.
    pub about: &'static str,
    /// Its fields, in their order.
    pub entries: &'static [OptionEntry],
    /// Rules on combinations of its fields.
    pub rules: &'static [OptionRule],
}

impl OptionTable {
    /// All fields, including those of groups.
    pub fn fields(&'static self) -> Vec<&'static OptionField> {
        let mut fields = Vec::new();
        self.collect(&mut fields);
        fields
    }

    /// All rules, including those of groups.
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

    /// The field with this name or alias; dashes equal underscores.
    pub fn find(&'static self, name: &str) -> Option<&'static OptionField> {
        let name = name.replace('-', "_");
        let mut fields = self.fields().into_iter();
        fields.find(|field| field.name == name || field.aliases.contains(&name.as_str()))
    }

    /// Whether a field has this name, for checks at compile time.
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
