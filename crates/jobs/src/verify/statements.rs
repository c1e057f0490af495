//! What a mesh states of itself: its comments, read by one table, so that none is passed over.

use terrane_base::bound::Bound;
use terrane_base::error::{Error, Result};
use terrane_mesh::{MeshInfo, is_mark};
use terrane_methods::{METHODS, Triangulation};

pub(super) const CRS: &str = "crs";
pub(super) const SOURCE: &str = "source";
pub(super) const TOLERANCE: &str = "max error";
pub(super) const BOUND: &str = "bound";
pub(super) const FITTED: &str = "fitted";
pub(super) const TRIANGULATION: &str = "triangulation";
pub(super) const ANGLE: &str = "min angle";
pub(super) const CLIP: &str = "clip";
pub(super) const WATER: &str = "water";
pub(super) const KEPT: &str = "keep points";
pub(super) const LINES: &str = "breaklines";
pub(super) const BANDS: &str = "bands";
pub(super) const WEIGHTS: &str = "weights";
pub(super) const HEIGHTS: &str = "heights";
pub(super) const TRANSFORMED: &str = crate::transform::TRANSFORMED;

/// What the comments of a mesh begin with.
const KEYS: [&str; 15] = [
    CRS,
    SOURCE,
    TOLERANCE,
    BOUND,
    FITTED,
    TRIANGULATION,
    ANGLE,
    CLIP,
    WATER,
    KEPT,
    LINES,
    BANDS,
    WEIGHTS,
    HEIGHTS,
    TRANSFORMED,
];

/// How meshes stated their triangulation before there was a key for it.
const DATA_DEPENDENT: &str = "data-dependent triangulation";

/// The statements of a mesh by key, and comments that begin with no key.
#[derive(Debug)]
pub(super) struct Statements<'a> {
    stated: Vec<(&'static str, &'a str)>,
    unknown: Vec<&'a str>,
}

impl<'a> Statements<'a> {
    /// Reads the comments of a mesh, and its system as one. Details under the name of a key count as comments do.
    ///
    /// # Errors
    /// Two statements with one key that differ: neither could be told to be the one that counts. One may
    /// be more detailed than the other, as "max error 2 metre" is beside "max error 2".
    pub(super) fn of(info: &'a MeshInfo) -> Result<Self> {
        let stated = info.crs.as_deref().map(|crs| (CRS, crs));
        let mut all = Self { stated: stated.into_iter().collect(), unknown: Vec::new() };
        for (name, value) in &info.details {
            let value = value.trim();
            let own_key = KEYS.into_iter().find(|key| key == name);
            match own_key.map(|key| (key, value)).or_else(|| parse(value)) {
                Some((key, value)) if own_key.is_some() || name == "comment" => {
                    all.add(key, value)?;
                }
                _ if name == "comment" && !value.is_empty() && !is_mark(value) => {
                    all.unknown.push(value);
                }
                _ => {}
            }
        }
        Ok(all)
    }

    fn add(&mut self, key: &'static str, value: &'a str) -> Result<()> {
        let Some((_, known)) = self.stated.iter_mut().find(|(own, _)| *own == key) else {
            self.stated.push((key, value));
            return Ok(());
        };
        if begins_with(value, known) {
            *known = value;
        } else if !begins_with(known, value) {
            return Err(Error::bad_input(format!(
                "states \"{key} {known}\" and \"{key} {value}\", which cannot both be"
            ))
            .remedy("make the mesh again, or remove one of these comments"));
        }
        Ok(())
    }

    /// What comes after a key.
    pub(super) fn text(&self, key: &str) -> Option<&'a str> {
        self.stated.iter().find(|(own, _)| *own == key).map(|(_, value)| *value)
    }

    /// The first word after a key.
    fn word(&self, key: &str) -> Option<&'a str> {
        self.text(key).map(|text| text.split_whitespace().next().unwrap_or_default())
    }

    /// Statements with none of these keys.
    pub(super) fn of_others(&self, keys: &[&str]) -> Vec<String> {
        let others = self.stated.iter().filter(|(key, _)| !keys.contains(key));
        others.map(|(key, value)| format!("{key} {value}")).collect()
    }

    /// Comments with no key.
    pub(super) fn unknown(&self) -> impl Iterator<Item = String> {
        self.unknown.iter().map(|text| (*text).to_owned())
    }

    /// The tolerance: "max error 1.5 metre". A statement that is not a bound is an error: to ignore it would
    /// leave the errors unjudged.
    pub(super) fn tolerance(&self) -> Result<Option<f64>> {
        let Some(word) = self.word(TOLERANCE) else { return Ok(None) };
        match word.parse() {
            Ok(tolerance) if (0.0..f64::INFINITY).contains(&tolerance) => Ok(Some(tolerance)),
            _ => Err(Error::bad_input(format!("states \"{TOLERANCE} {word}\", which is no bound"))
                .remedy("give the bound with ‹max_error›")),
        }
    }

    /// The unit of the tolerance.
    pub(super) fn unit(&self) -> Option<&'a str> {
        let (_, unit) = self.text(TOLERANCE)?.split_once(char::is_whitespace)?;
        Some(unit.trim())
    }

    /// The smallest angle of triangles in plan, in degrees: "min angle 20".
    pub(super) fn min_angle(&self) -> Result<Option<f64>> {
        let Some(text) = self.text(ANGLE) else { return Ok(None) };
        match text.parse() {
            Ok(degrees) if (0.0..=60.0).contains(&degrees) => Ok(Some(degrees)),
            _ => Err(Error::bad_input(format!("states \"{ANGLE} {text}\", which is no angle"))
                .remedy("give the smallest angle with ‹min_angle›")),
        }
    }

    /// Where the tolerance holds: "bound surface". A word that is not known is an error: to take it for
    /// less would leave a promise unjudged.
    pub(super) fn bound(&self) -> Result<Bound> {
        let Some(text) = self.text(BOUND) else { return Ok(Bound::default()) };
        text.parse().map_err(|_| {
            Error::bad_input(format!("states \"{BOUND} {text}\", which is not known"))
                .remedy("say what is to be proved with ‹bound›")
        })
    }

    /// True where vertices may lie above or below their samples: "fitted heights".
    pub(super) fn is_fitted(&self) -> Result<bool> {
        match self.text(FITTED) {
            None => Ok(false),
            Some("heights") => Ok(true),
            Some(text) => {
                Err(Error::bad_input(format!("states \"{FITTED} {text}\", which is not known"))
                    .remedy("make the mesh again; only \"fitted heights\" is known"))
            }
        }
    }

    /// True unless vertices are connected in a way that is not Delaunay: "triangulation data-dependent", or the
    /// name of a method. One that is not known is an error: to believe it would leave edges unjudged.
    pub(super) fn is_delaunay(&self) -> Result<bool> {
        let Some(text) = self.text(TRIANGULATION) else { return Ok(true) };
        let mut others = METHODS.iter().filter(|method| !method.is_delaunay).map(|m| m.name);
        match text.parse::<Triangulation>() {
            Ok(known) => Ok(known == Triangulation::Delaunay),
            Err(_) if others.any(|name| name == text) => Ok(false),
            Err(_) => Err(Error::bad_input(format!(
                "states \"{TRIANGULATION} {text}\", which is not known"
            ))
            .remedy("make the mesh again, or remove this comment: its edges are judged then")),
        }
    }
}

/// A comment as a key and what comes after it.
fn parse(comment: &str) -> Option<(&'static str, &str)> {
    if comment == DATA_DEPENDENT {
        return Some((TRIANGULATION, "data-dependent"));
    }
    KEYS.into_iter().find_map(|key| {
        let rest = comment.strip_prefix(key)?;
        (rest.is_empty() || rest.starts_with(char::is_whitespace)).then(|| (key, rest.trim()))
    })
}

/// True when a text is another one, or goes on behind it with more words.
fn begins_with(text: &str, start: &str) -> bool {
    text.strip_prefix(start).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    fn info(details: &[(&str, &str)]) -> MeshInfo {
        let details = details.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        MeshInfo { details, ..MeshInfo::plain("test", 0, 0) }
    }

    #[test]
    fn statements_are_read_from_comments_and_from_details_of_their_names() {
        for (details, tolerance, bound, unit) in [
            (&[("max error", "1.5 metre")][..], Some(1.5), Bound::Samples, Some("metre")),
            (
                &[("comment", "source a.tif"), ("comment", "max error 0.25")],
                Some(0.25),
                Bound::Samples,
                None,
            ),
            (&[("comment", "max errors are small")], None, Bound::Samples, None),
            (&[], None, Bound::Samples, None),
            (&[("max error", "1"), ("bound", "surface")], Some(1.0), Bound::Surface, None),
            (&[("comment", "bound surface")], None, Bound::Surface, None),
            (&[("comment", "bounds 0 0 9 9")], None, Bound::Samples, None),
            // The more detailed of two that say the same.
            (
                &[("max error", "5"), ("comment", "max error 5 foot")],
                Some(5.0),
                Bound::Samples,
                Some("foot"),
            ),
        ] {
            let info = info(details);
            let stated = Statements::of(&info).unwrap();
            assert_eq!(stated.tolerance().unwrap(), tolerance, "{details:?}");
            assert_eq!((stated.bound().unwrap(), stated.unit()), (bound, unit), "{details:?}");
        }
    }

    #[test]
    fn statements_that_cannot_be_understood_are_refused() {
        for comment in [
            "max error unknown",
            "max error -1",
            "max error NaN",
            "max error",
            "bound volume",
            "bound",
            "bound 1.5",
            "min angle 61",
            "min angle 20 degrees",
            "min angle",
            "fitted widths",
            "triangulation sloppy",
        ] {
            let info = info(&[("comment", comment)]);
            let stated = Statements::of(&info).unwrap();
            let results = [
                stated.tolerance().map(drop),
                stated.bound().map(drop),
                stated.min_angle().map(drop),
                stated.is_fitted().map(drop),
                stated.is_delaunay().map(drop),
            ];
            let errors: Vec<_> = results.into_iter().filter_map(Result::err).collect();
            assert_eq!(errors.len(), 1, "{comment}");
            assert_eq!(errors[0].kind(), ErrorKind::BadInput);
        }
        let twice = info(&[("comment", "max error 2"), ("comment", "max error 20")]);
        let error = Statements::of(&twice).unwrap_err().to_string();
        assert!(error.contains("\"max error 2\" and \"max error 20\""), "{error}");
    }

    #[test]
    fn what_has_no_key_is_known_to_be_unknown() {
        let all = [
            ("comment", "terrane 0.1.0"),
            ("comment", "bounds surface"),
            ("comment", "data-dependent triangulation"),
            ("encoding", "binary"),
        ];
        let info = info(&all);
        let stated = Statements::of(&info).unwrap();
        assert!(!stated.is_delaunay().unwrap());
        assert_eq!(stated.unknown().collect::<Vec<_>>(), ["bounds surface"]);
        assert_eq!(stated.of_others(&[SOURCE]), ["triangulation data-dependent"]);
    }
}
