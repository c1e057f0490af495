//! Guarantees and provenance of a mesh, as stated in the headers of all formats, one line each.

use std::fmt::Display;
use std::str::FromStr;

use terrane_base::bound::ErrorBound;
use terrane_base::error::{Error, Result};

/// Declares [`Promises`]: type and key of each field.
macro_rules! promises {
    ($($(#[$doc:meta])+ $field:ident: $type:ty = $key:literal;)+) => {
        /// Guarantees and provenance of a mesh. Lines are in the order of the fields.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Promises {
            $($(#[$doc])+ pub $field: Option<$type>,)+
            /// Lines with a key and an invalid value; the field is not set.
            pub invalid: Vec<String>,
            /// Lines without a key.
            pub unknown: Vec<String>,
        }

        impl Promises {
            /// Keys of lines.
            pub(super) const KEYS: &[&str] = &[$($key),+];

            /// Keys and values of all statements.
            pub fn statements(&self) -> impl Iterator<Item = (&'static str, String)> {
                let all = [$(($key, self.$field.as_ref().map(HeaderStatement::to_text))),+];
                all.into_iter().filter_map(|(key, text)| Some((key, text?)))
            }

            fn state(&mut self, key: &str, text: &str) -> Result<()> {
                let is_valid = match key {
                    $($key => state(&mut self.$field, key, text)?,)+
                    _ => false,
                };
                self.invalid.extend((!is_valid).then(|| line(key, text)));
                Ok(())
            }
        }
    };
}

promises! {
    /// Label of the CRS. Written headers state the CRS separately.
    crs: String = "crs";
    /// Name of the source grid or point cloud.
    source: String = "source";
    /// The tolerance.
    max_error: MaxError = "max error";
    /// Where the tolerance holds; at samples if not stated.
    bound: ErrorBound = "bound";
    /// Heights are fitted: vertices may be above or below their samples.
    fitted: FittedHeights = "fitted";
    /// Triangulation, or the name of a method; Delaunay if not stated.
    triangulation: String = "triangulation";
    /// Minimum angle of triangles in plan, in degrees from 0 to 60.
    min_angle: f64 = "min angle";
    /// Clip polygon file.
    clip: String = "clip";
    /// Water polygon file.
    water: String = "water";
    /// File of mandatory points.
    keep_points: String = "keep points";
    /// Breakline file.
    breaklines: String = "breaklines";
    /// Band numbers, from 1.
    bands: Vec<u32> = "bands";
    /// Error weights of the bands.
    weights: Vec<f64> = "weights";
    /// Band of the heights.
    heights: HeightBand = "heights";
    /// CRS of the grid, if the vertices are reprojected.
    transformed_from: String = "transformed from";
}

impl Promises {
    /// A line for each statement.
    pub fn to_lines(&self) -> Vec<String> {
        let lines = self.statements().map(|(key, text)| line(key, &text));
        lines.chain(self.invalid.iter().chain(&self.unknown).cloned()).collect()
    }

    /// Parses lines in any order.
    ///
    /// # Errors
    /// Contradictory lines with the same key. One may be more detailed, such as "max error 2 metre" and "max error
    /// 2".
    pub fn parse<T: AsRef<str>>(lines: impl IntoIterator<Item = T>) -> Result<Self> {
        let mut all = Self::default();
        for line in lines {
            match line.as_ref().trim() {
                // Statement of older versions, before the key existed.
                "data-dependent triangulation" => all.state("triangulation", "data-dependent")?,
                line => match Self::KEYS.iter().find_map(|key| Some((key, after(key, line)?))) {
                    Some((key, text)) => all.state(key, text)?,
                    None if line.is_empty() || is_mark(line) => {}
                    None => all.unknown.push(line.to_owned()),
                },
            }
        }
        Ok(all)
    }
}

/// Line of a statement.
pub(super) fn line(key: &str, text: &str) -> String {
    format!("{key} {text}").trim_end().to_owned()
}

/// True for the name and version of this program, and for the prefix of its STL headers.
pub(super) fn is_mark(text: &str) -> bool {
    let rest = text.strip_prefix("terrane ");
    rest.is_some_and(|rest| {
        rest.starts_with("origin ") || rest.starts_with(|c: char| c.is_ascii_digit())
    })
}

/// The text after a key on its line.
fn after<'a>(key: &str, line: &'a str) -> Option<&'a str> {
    let rest = line.strip_prefix(key)?;
    (rest.is_empty() || rest.starts_with(char::is_whitespace)).then(|| rest.trim_start())
}

/// Sets an empty field, or replaces a less detailed value; false if the text is invalid.
fn state<T: HeaderStatement>(known: &mut Option<T>, key: &str, text: &str) -> Result<bool> {
    let Some(value) = T::of_text(text) else { return Ok(false) };
    let old = known.as_ref().map(T::to_text);
    match old.filter(|old| !goes_on(text, old)) {
        None => *known = Some(value),
        Some(old) if goes_on(&old, text) => {}
        Some(old) => {
            let message = format!("states contradictory \"{key} {old}\" and \"{key} {text}\"");
            return Err(Error::bad_input(message)
                .remedy("make the mesh again, or remove one of these comments"));
        }
    }
    Ok(true)
}

/// True if a text equals another, or continues it with more words.
fn goes_on(text: &str, start: &str) -> bool {
    text.strip_prefix(start).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
}

/// A value type of headers.
trait HeaderStatement: Sized {
    fn to_text(&self) -> String;

    fn of_text(text: &str) -> Option<Self>;
}

macro_rules! words {
    ($($type:ty),+) => {$(
        impl HeaderStatement for $type {
            fn to_text(&self) -> String {
                self.to_string()
            }

            fn of_text(text: &str) -> Option<Self> {
                text.parse().ok()
            }
        }
    )+};
}

words!(String, ErrorBound);

/// Comma-separated numbers: "3,1".
impl<T: Display + FromStr> HeaderStatement for Vec<T> {
    fn to_text(&self) -> String {
        self.iter().map(T::to_string).collect::<Vec<_>>().join(",")
    }

    fn of_text(text: &str) -> Option<Self> {
        text.split(',').map(|number| number.parse().ok()).collect()
    }
}

/// A tolerance: "1.5 metre".
#[derive(Clone, Debug, PartialEq)]
pub struct MaxError {
    /// At least 0.
    pub value: f64,
    /// Unit of heights, if known.
    pub unit: Option<String>,
}

impl HeaderStatement for MaxError {
    fn to_text(&self) -> String {
        let words = [Some(self.value.to_string()), self.unit.clone()];
        words.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    fn of_text(text: &str) -> Option<Self> {
        let (value, unit) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let unit = Some(unit.trim().to_owned()).filter(|unit| !unit.is_empty());
        let value = value.parse().ok().filter(|value| (0.0..f64::INFINITY).contains(value))?;
        Some(Self { value, unit })
    }
}

/// Vertices may be above or below their samples: "heights".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FittedHeights;

impl HeaderStatement for FittedHeights {
    fn to_text(&self) -> String {
        "heights".to_owned()
    }

    fn of_text(text: &str) -> Option<Self> {
        (text == "heights").then_some(Self)
    }
}

/// Minimum angle of triangles.
impl HeaderStatement for f64 {
    fn to_text(&self) -> String {
        self.to_string()
    }

    fn of_text(text: &str) -> Option<Self> {
        text.parse().ok().filter(|degrees| (0.0..=60.0).contains(degrees))
    }
}

/// Source of heights: "band 2", or "none".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightBand {
    /// All vertices are at 0.
    None,
    /// The values of a band.
    Band(u32),
}

impl HeaderStatement for HeightBand {
    fn to_text(&self) -> String {
        match self {
            Self::None => "none".to_owned(),
            Self::Band(band) => format!("band {band}"),
        }
    }

    fn of_text(text: &str) -> Option<Self> {
        match text.strip_prefix("band ") {
            Some(band) => band.parse().ok().map(Self::Band),
            None => (text == "none").then_some(Self::None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MeshInfo;
    use proptest::prelude::*;

    /// Every promise, and its line.
    fn all() -> (Promises, [&'static str; 16]) {
        let text = |text: &str| Some(text.to_owned());
        let unit = Some("US survey foot".to_owned());
        let promises = Promises {
            crs: text("EPSG:32611 (WGS 84 / UTM zone 11N)"),
            source: text("a.tif and 3 more"),
            max_error: Some(MaxError { value: 1.5, unit }),
            bound: Some(ErrorBound::Surface),
            fitted: Some(FittedHeights),
            triangulation: text("data-dependent"),
            min_angle: Some(20.5),
            clip: text("area.fgb"),
            water: text("sea.fgb"),
            keep_points: text("peaks.geojson"),
            breaklines: text("roads.fgb"),
            bands: Some(vec![3, 1]),
            weights: Some(vec![0.5, 2.0]),
            heights: Some(HeightBand::Band(1)),
            transformed_from: text("EPSG:4326"),
            invalid: Vec::new(),
            unknown: vec!["size small".to_owned()],
        };
        let lines = [
            "crs EPSG:32611 (WGS 84 / UTM zone 11N)",
            "source a.tif and 3 more",
            "max error 1.5 US survey foot",
            "bound surface",
            "fitted heights",
            "triangulation data-dependent",
            "min angle 20.5",
            "clip area.fgb",
            "water sea.fgb",
            "keep points peaks.geojson",
            "breaklines roads.fgb",
            "bands 3,1",
            "weights 0.5,2",
            "heights band 1",
            "transformed from EPSG:4326",
            "size small",
        ];
        (promises, lines)
    }

    #[test]
    fn every_promise_has_a_line_that_reads_back() {
        let (promises, lines) = all();
        assert_eq!(promises.to_lines(), lines);
        assert_eq!(Promises::parse(lines.iter().rev()).unwrap(), promises);
        assert_eq!(lines.len(), Promises::KEYS.len() + 1);
        let mark = ["terrane 0.1.0", "", "data-dependent triangulation"];
        let old = Promises::parse(mark).unwrap();
        assert_eq!(old.to_lines(), ["triangulation data-dependent"]);
    }

    proptest! {
        /// Of any promises, with values right and wrong.
        #[test]
        fn promises_read_back_from_their_lines(
            stated in prop::collection::btree_map(
                prop::sample::select(Promises::KEYS),
                prop_oneof![
                    "[ -~]{0,12}",
                    "(band )?[0-9]{1,3}(,[0-9.]{1,4}){0,2}( [a-z]{1,5}){0,2}",
                    // Without NaN, which is not equal to itself.
                    (-1e300..1e300).prop_map(|value: f64| value.to_string()),
                    Just("surface".to_owned()),
                    Just("heights".to_owned()),
                    Just("none".to_owned()),
                ],
                0..16,
            ),
            unknown in prop::collection::vec("x [ -~]{0,12}", 0..3),
        ) {
            let lines = stated.iter().map(|(key, text)| format!("{key} {}", text.trim()));
            let lines = lines.chain(unknown);
            let lines: Vec<_> = lines.map(|line| line.trim_end().to_owned()).collect();
            let promises = Promises::parse(&lines).unwrap();
            let valid = promises.statements().map(|(key, _)| key);
            let found = valid.chain(promises.invalid.iter().map(String::as_str));
            let found: Vec<_> = found.chain(promises.unknown.iter().map(String::as_str)).collect();
            prop_assert_eq!(found.len(), lines.len());
            for line in &lines {
                prop_assert!(found.iter().any(|key| line.starts_with(key)), "{}", line);
            }
            prop_assert_eq!(Promises::parse(promises.to_lines()).unwrap(), promises);
        }
    }

    #[test]
    fn statements_are_read_from_comments_and_from_details_of_their_names() {
        for (details, value, unit) in [
            (&[("max error", "1.5 metre")][..], Some(1.5), Some("metre")),
            (&[("comment", "source a.tif"), ("comment", "max error 0.25")], Some(0.25), None),
            (&[("comment", "max errors are small"), ("encoding", "bound surface")], None, None),
            // The more detailed of two equivalent statements.
            (&[("max error", "5"), ("comment", "max error 5 foot")], Some(5.0), Some("foot")),
            (&[("max error", "5 foot"), ("comment", "max error 5")], Some(5.0), Some("foot")),
        ] {
            let details = details.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
            let info = MeshInfo { details, ..MeshInfo::plain("test", 0, 0) };
            let promises = info.promises().unwrap();
            let error = value.map(|value| MaxError { value, unit: unit.map(str::to_owned) });
            assert_eq!(promises, Promises { max_error: error, ..promises.clone() }, "{info:?}");
            assert_eq!(promises.bound, None, "{info:?}");
        }
    }

    #[test]
    fn statements_that_cannot_be_understood_are_kept_apart() {
        for line in [
            "max error unknown",
            "max error -1",
            "max error NaN",
            "max error inf",
            "max error",
            "bound volume",
            "bound",
            "bound 1.5",
            "min angle 61",
            "min angle 20 degrees",
            "min angle",
            "fitted widths",
            "bands 1,x",
            "weights",
            "heights band",
        ] {
            let invalid = vec![line.to_owned()];
            let expected = Promises { invalid, ..Promises::default() };
            assert_eq!(Promises::parse([line]).unwrap(), expected);
        }
        let error = Promises::parse(["max error 2", "max error 20"]).unwrap_err().to_string();
        assert!(error.contains("\"max error 2\" and \"max error 20\""), "{error}");
    }
}
