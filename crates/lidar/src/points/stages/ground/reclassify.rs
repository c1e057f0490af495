//! The classes that `--classify ground` may change.

use std::fmt;
use std::str::FromStr;

use crate::grid::surface_model::NOISE;

/// Classes that may be replaced by ground: unclassified (0 and 1), ground (2) and vegetation (3 to 5), and
/// further ones by request. Points of other classes, such as water (9) or bridges (17), are not candidates and
/// keep their class.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reclassify {
    /// Sorted, without those that always may change.
    also: Vec<u8>,
}

/// The last class that always may change: high vegetation.
const LAST: u8 = 5;

impl Reclassify {
    /// The default classes and these.
    ///
    /// # Errors
    /// A class of noise, which is never ground.
    pub fn also(classes: impl IntoIterator<Item = u8>) -> Result<Self, String> {
        let mut also: Vec<u8> = classes.into_iter().filter(|class| *class > LAST).collect();
        also.sort_unstable();
        also.dedup();
        match also.iter().find(|class| NOISE.contains(class)) {
            Some(class) => Err(format!("class {class} is noise and cannot become ground")),
            None => Ok(Self { also }),
        }
    }

    /// Whether points of a class may become ground.
    pub fn may_change(&self, class: u8) -> bool {
        class <= LAST || self.also.binary_search(&class).is_ok()
    }
}

impl FromStr for Reclassify {
    type Err = String;

    /// "reclassify=9,17"; "" for the usual classes.
    fn from_str(text: &str) -> Result<Self, String> {
        let Some(classes) = text.strip_prefix("reclassify=") else {
            return Err(format!("{text:?} is not of the form reclassify=CLASS,..."));
        };
        let classes = classes.split(',').map(|class| {
            class.trim().parse().map_err(|_| format!("{class:?} is not a class from 0 to 255"))
        });
        Self::also(classes.collect::<Result<Vec<_>, _>>()?)
    }
}

impl fmt::Display for Reclassify {
    /// As `--classify` takes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let classes: Vec<_> = self.also.iter().map(u8::to_string).collect();
        match classes.as_slice() {
            [] => f.write_str("ground"),
            _ => write!(f, "ground:reclassify={}", classes.join(",")),
        }
    }
}
