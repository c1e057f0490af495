//! Length units by name, EPSG code and size.

use super::node::{CrsWktNode, quoted};

/// A length unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LengthUnit {
    pub(super) name: String,
    /// Size in metres.
    pub(super) size: f64,
}

/// EPSG code, name, size in metres, and other spellings.
const KNOWN: &[(u16, &str, f64, &[&str])] = &[
    (9001, "metre", 1.0, &["meter", "metres", "meters", "m"]),
    (9002, "foot", 0.3048, &["ft", "feet", "internationalfoot", "footinternational", "footintl"]),
    (9003, "US survey foot", 1200.0 / 3937.0, &["footus", "ussurveyfeet", "usft", "ftus"]),
    (9014, "fathom", 1.8288, &[]),
    (9036, "kilometre", 1000.0, &["kilometer", "km"]),
    (9005, "Clarke's foot", 0.304_797_265_4, &["footclarke"]),
    (
        9041,
        "British foot (Sears 1922)",
        0.304_799_471_538_676,
        &["footsears", "footbritishsears1922"],
    ),
    (9080, "Indian foot", 0.304_799_510_248_147, &["footindian"]),
    (9094, "Gold Coast foot", 0.304_799_710_181_509, &["footgoldcoast"]),
    (9095, "British foot (1936)", 0.304_800_749_1, &["footbritish1936"]),
];

/// Tolerance for equal sizes; kinds of feet differ by two millionths.
const SLACK: f64 = 1e-7;

impl LengthUnit {
    pub(super) fn metre() -> Self {
        Self { name: "metre".to_owned(), size: 1.0 }
    }

    pub(super) fn of_code(code: u16) -> Option<Self> {
        let (_, name, size, _) = KNOWN.iter().find(|known| known.0 == code)?;
        Some(Self { name: (*name).to_owned(), size: *size })
    }

    /// By a common name.
    pub(super) fn named(name: &str) -> Option<Self> {
        let plain = plain(name);
        let known = KNOWN.iter().find(|(_, name, _, aliases)| {
            self::plain(name) == plain || aliases.contains(&plain.as_str())
        });
        known.and_then(|known| Self::of_code(known.0))
    }

    /// From a node with a name and a size.
    pub(super) fn of_node(node: &CrsWktNode<'_>) -> Option<Self> {
        let size = node.number(0).filter(|size| *size > 0.0)?;
        let by_size = KNOWN.iter().find(|known| same(known.2, size)).map(|known| known.0);
        // "Foot_US" often has the size of the international foot, and vice versa.
        match (Self::named(node.name()), by_size.and_then(Self::of_code)) {
            (Some(named), Some(sized)) if named.name == "US survey foot" || sized.is(&named) => {
                Some(named)
            }
            (_, Some(sized)) => Some(sized),
            (_, None) => Some(Self { name: node.name().to_owned(), size }),
        }
    }

    /// The name, if it is a common one.
    pub(super) fn common_name(&self) -> Option<&'static str> {
        KNOWN[..5].iter().map(|known| known.1).find(|name| *name == self.name)
    }

    /// True for units of equal size.
    pub(super) fn is(&self, other: &Self) -> bool {
        same(self.size, other.size)
    }

    pub(super) fn wkt(&self) -> String {
        let known = KNOWN.iter().find(|known| known.1 == self.name);
        let code = known.map(|known| format!(",AUTHORITY[\"EPSG\",\"{}\"]", known.0));
        format!("UNIT[{},{}{}]", quoted(&self.name), self.size, code.unwrap_or_default())
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SLACK * b
}

/// Letters and digits only, in lower case.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}
