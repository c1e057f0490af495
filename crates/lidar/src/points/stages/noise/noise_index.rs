//! Noise as recorded in a plan: found once among all points, and classified by tasks while reading.

use std::iter::zip;
use std::str::Split;

use serde::{Deserialize, Serialize};

use super::NoiseMarks;
use crate::records::selection::ChosenRecords;
use terrane_base::error::{Error, ErrorKind, Result};

/// Most bytes of recorded noise: about eighty million points.
const MAX_BYTES: u64 = 256 << 20;
/// Number of copies in memory while a plan is read.
const COPIES: u64 = 3;

/// The noise among all points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::points) struct Noise {
    pub(in crate::points) own: Noted,
    /// Noise among the points of the ground, if these are not the requested ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::points) ground: Option<Noted>,
    /// Notes, one line each.
    pub(in crate::points) notes: Vec<String>,
}

impl Noise {
    /// Noise among the points of the ground.
    pub(in crate::points) fn of_ground(&self) -> &Noted {
        self.ground.as_ref().unwrap_or(&self.own)
    }

    /// Bytes of memory for a reader of the plan.
    pub(in crate::points) fn bytes(&self) -> u64 {
        COPIES * (self.own.bytes() + self.ground.as_ref().map_or(0, Noted::bytes))
    }
}

/// The noise records of a point cloud.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::points) struct Noted {
    class: u8,
    /// Noise of each part of the point cloud, in order.
    parts: Vec<NoiseGaps>,
}

impl Noted {
    fn bytes(&self) -> u64 {
        self.parts.iter().map(|gaps| gaps.0.len() as u64).sum()
    }

    /// An iterator of marks of the records of a part.
    pub(in crate::points) fn marks(&self, part: usize) -> Marks<'_> {
        let gaps = self.parts.get(part).map_or("", |gaps| gaps.0.as_str());
        let mut marks = Marks { class: self.class, gaps: gaps.split(' '), left: None };
        marks.left = marks.gap();
        marks
    }
}

/// Noise records, by the number of other records between them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "String")]
struct NoiseGaps(String);

impl NoiseGaps {
    fn of(places: impl Iterator<Item = u64>) -> Self {
        let mut next = 0;
        let gaps = places.map(|place| {
            let gap = place - next;
            next = place + 1;
            gap.to_string()
        });
        Self(gaps.collect::<Vec<_>>().join(" "))
    }
}

impl TryFrom<String> for NoiseGaps {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        match text.is_empty() || text.split(' ').all(|gap| gap.parse::<u64>().is_ok()) {
            true => Ok(Self(text)),
            false => Err("the noise numbers are not integers".to_owned()),
        }
    }
}

/// Classifies the records of a part in order.
pub(in crate::points) struct Marks<'a> {
    class: u8,
    gaps: Split<'a, char>,
    /// Records before the next that is noise, if there is one.
    left: Option<u64>,
}

impl Marks<'_> {
    /// The class of the next record, if it is noise.
    pub(in crate::points) fn take(&mut self) -> Option<u8> {
        match self.left? {
            0 => {
                self.left = self.gap();
                Some(self.class)
            }
            left => {
                self.left = Some(left - 1);
                None
            }
        }
    }

    fn gap(&mut self) -> Option<u64> {
        self.gaps.next().and_then(|gap| gap.parse().ok())
    }
}

impl NoiseMarks<'_> {
    /// The noise for a plan, by indices of records in their parts, after the removal of duplicates in `single`.
    ///
    /// # Errors
    /// Too much noise for a plan.
    pub(in crate::points) fn noted(&self, single: Option<&ChosenRecords<'_>>) -> Result<Noted> {
        let mut noted =
            Noted { class: self.class, parts: Vec::with_capacity(self.numbers.units()) };
        let mut bytes = 0;
        for unit in 0..self.numbers.units() {
            let (first, numbers) = (self.numbers.first(unit), self.numbers.of_unit(unit));
            let gaps = match single {
                Some(single) => {
                    let kept = zip(single.kept_in(unit), numbers);
                    NoiseGaps::of(kept.filter(|(_, i)| self.noise.contains(*i)).map(|(at, _)| at))
                }
                None => NoiseGaps::of(self.noise.within(numbers).map(|i| i as u64 - first)),
            };
            bytes += gaps.0.len() as u64;
            if bytes > MAX_BYTES {
                return Err(too_much());
            }
            noted.parts.push(gaps);
        }
        Ok(noted)
    }
}

fn too_much() -> Error {
    Error::new(ErrorKind::Resource, "the point cloud has too much noise for a plan")
        .remedy("run ‹terrane points› with ‹classify=noise› first, then plan on its output")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_records_are_marked_as_were_noted() {
        for places in [&[][..], &[0], &[4], &[0, 1, 2, 7, 8, 30], &[3, 29]] {
            let gaps = NoiseGaps::of(places.iter().copied());
            let text = serde_json::to_string(&Noted { class: 18, parts: vec![gaps] }).unwrap();
            let noted: Noted = serde_json::from_str(&text).unwrap();
            let mut marks = noted.marks(0);
            let marked: Vec<u64> = (0..31).filter(|_| marks.take() == Some(18)).collect();
            assert_eq!(marked, places, "{text}");
            assert!(noted.marks(1).take().is_none());
        }
        for text in [" ", "1  2", "-1", "1 x", "99999999999999999999"] {
            assert!(NoiseGaps::try_from(text.to_owned()).is_err(), "{text}");
        }
    }
}
