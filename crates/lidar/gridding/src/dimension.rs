//! The subject of a statistic: heights or another attribute, of all points or of a subset.

use serde::{Deserialize, Serialize};

use super::parameter::StatisticParameter;
use terrane_base::attribute::{CLASS, RETURN, RETURNS, Return, known};
use terrane_base::geom::{Point, PointFrame};

/// The subject of a statistic. Filters of the point cloud apply first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Subject {
    /// Name of the attribute; heights when `None`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attribute: Option<String>,
    /// Only points of these classes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub classes: Option<Vec<u8>>,
    /// Only points of this return of their pulse.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub returns: Option<Return>,
    /// Only points that are not lower than this, in world units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Only points that are lower than this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Only points that are higher than this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
}

/// The parameter that selects an attribute instead of heights.
pub(super) const ATTRIBUTE: StatisticParameter = StatisticParameter {
    key: "attribute",
    value: "NAME",
    about: "attribute to use instead of height",
};

/// The parameters that select points.
pub(super) const CONDITIONS: [StatisticParameter; 5] = [
    StatisticParameter {
        key: "class",
        value: "CODES",
        about: "only points of these classes, such as 2+9",
    },
    StatisticParameter {
        key: "return",
        value: "WHICH",
        about: "only points of this return: first, last, only (single returns), or a number",
    },
    StatisticParameter {
        key: "min",
        value: "NUMBER",
        about: "only points at or above this height",
    },
    StatisticParameter { key: "max", value: "NUMBER", about: "only points below this height" },
    StatisticParameter { key: "above", value: "NUMBER", about: "only points above this height" },
];

/// Parameters common to all statistics of points.
pub const OF_POINTS: [&StatisticParameter; 6] =
    [&ATTRIBUTE, &CONDITIONS[0], &CONDITIONS[1], &CONDITIONS[2], &CONDITIONS[3], &CONDITIONS[4]];

/// Names for heights themselves.
const HEIGHTS: [&str; 2] = ["z", "height"];

impl Subject {
    /// Sets a condition or the attribute; false if unknown or already given.
    pub(super) fn take(&mut self, key: &str, value: &str) -> bool {
        match key {
            "attribute" => {
                let name = Some(value.trim()).filter(|name| !name.is_empty());
                let name = name.map(|name| known(name).map_or(name, |known| known.name).to_owned());
                put(&mut self.attribute, name)
            }
            "class" => put(&mut self.classes, classes(value)),
            "return" => put(&mut self.returns, value.parse().ok()),
            "min" => put(&mut self.min, number(value)),
            "max" => put(&mut self.max, number(value)),
            "above" => put(&mut self.above, number(value)),
            _ => false,
        }
    }

    /// The subject with the `usual` attribute, if there is one and no other was given.
    pub(super) fn or_of(self, usual: Option<&str>) -> Self {
        let attribute = self.attribute.or(usual.map(str::to_owned));
        let attribute = attribute
            .filter(|name| !HEIGHTS.iter().any(|height| height.eq_ignore_ascii_case(name)));
        Self { attribute, ..self }
    }

    /// True for the heights of all points.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// Whether it is limited to some heights.
    pub(super) fn has_limits(&self) -> bool {
        self.min.or(self.max).or(self.above).is_some()
    }

    /// The subject without limits of heights.
    pub(super) fn of_any_height(&self) -> Self {
        Self { min: None, max: None, above: None, ..self.clone() }
    }

    /// Scale of its integer values; `None` for heights.
    pub(super) fn step(&self) -> Option<f64> {
        Some(step_of(self.attribute.as_deref()?).unwrap_or(1.0))
    }

    /// Whether its values are real numbers, not steps.
    pub(super) fn is_real(&self) -> bool {
        self.attribute.as_deref().is_some_and(|name| step_of(name).is_none())
    }

    /// The attributes it needs.
    pub(super) fn reads(&self) -> Vec<&str> {
        let class = self.classes.as_ref().map(|_| CLASS);
        let returns = self.returns.map(|_| [RETURN, RETURNS]).into_iter().flatten();
        self.attribute.as_deref().into_iter().chain(class).chain(returns).collect()
    }
}

/// Scale of the integer values of a known attribute.
fn step_of(name: &str) -> Option<f64> {
    known(name).and_then(|attribute| attribute.step)
}

fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Sets a value; false if it is invalid or already set.
fn put<T>(place: &mut Option<T>, value: Option<T>) -> bool {
    let fits = place.is_none() && value.is_some();
    *place = value;
    fits
}

/// "2+9".
fn classes(text: &str) -> Option<Vec<u8>> {
    let mut classes: Vec<u8> =
        text.split('+').map(|code| code.trim().parse().ok()).collect::<Option<_>>()?;
    classes.sort_unstable();
    classes.dedup();
    Some(classes)
}

/// Selects the points of a subject and its values.
#[derive(Clone, Debug)]
pub struct SubjectSelector {
    /// Lowest and highest height in steps.
    heights: [i64; 2],
    /// The column of classes, and the selected classes.
    classes: Option<(usize, [bool; 256])>,
    returns: Option<SelectedReturns>,
    values: SubjectValues,
}

/// Selected returns.
#[derive(Clone, Copy, Debug)]
struct SelectedReturns {
    /// Column of return numbers.
    number: usize,
    /// Column of the number of returns of a pulse.
    count: usize,
    selected: Return,
}

/// Values used instead of heights.
#[derive(Clone, Copy, Debug)]
enum SubjectValues {
    Heights,
    /// Multiples of a step, in this column.
    Whole(usize, f64),
    Real(usize),
}

/// The points of a subject.
#[derive(Clone, Debug, Default)]
pub struct SelectedPoints {
    /// With its values instead of heights; real values are indices into `reals`.
    pub points: Vec<Point>,
    /// Its real values.
    pub reals: Vec<f64>,
}

impl SubjectSelector {
    /// For points of `frame` with columns of these attributes, which include those that the subject needs.
    pub fn new(subject: &Subject, columns: &[String], frame: &PointFrame) -> Self {
        let classes = subject.classes.as_ref().map(|classes| {
            let mut selected = [false; 256];
            classes.iter().for_each(|class| selected[usize::from(*class)] = true);
            (column_of(CLASS, columns), selected)
        });
        let returns = subject.returns.map(|selected| {
            let [number, count] = [RETURN, RETURNS].map(|name| column_of(name, columns));
            SelectedReturns { number, count, selected }
        });
        let values = match (subject.attribute.as_deref(), subject.step()) {
            (Some(name), _) if subject.is_real() => SubjectValues::Real(column_of(name, columns)),
            (Some(name), Some(step)) => SubjectValues::Whole(column_of(name, columns), step),
            _ => SubjectValues::Heights,
        };
        Self { heights: heights(subject, frame), classes, returns, values }
    }

    /// Replaces the content of `out` by its points. Points without a finite value are skipped.
    pub fn select(&self, points: &[Point], columns: &[Vec<f64>], out: &mut SelectedPoints) {
        out.points.clear();
        out.reals.clear();
        for (at, point) in points.iter().enumerate() {
            if !self.accepts(point, columns, at) {
                continue;
            }
            match self.values {
                SubjectValues::Heights => out.points.push(*point),
                SubjectValues::Whole(column, step) => {
                    let z = (number_at(columns, column, at) / step).round() as i32;
                    out.points.push(Point { z, ..*point });
                }
                SubjectValues::Real(column) => {
                    let value = number_at(columns, column, at);
                    if value.is_finite() {
                        out.points.push(Point { z: out.reals.len() as i32, ..*point });
                        out.reals.push(value);
                    }
                }
            }
        }
    }

    /// Whether a point is one of the subject; its attributes are at `at` in the columns.
    #[inline]
    fn accepts(&self, point: &Point, columns: &[Vec<f64>], at: usize) -> bool {
        let [low, high] = self.heights;
        (low..=high).contains(&i64::from(point.z))
            && self.classes.as_ref().is_none_or(|(column, selected)| {
                selected[usize::from(number_at(columns, *column, at) as u8)]
            })
            && self.returns.is_none_or(|SelectedReturns { number, count, selected }| {
                let [number, count] =
                    [number, count].map(|column| number_at(columns, column, at) as u8);
                selected.is(number, count)
            })
    }
}

/// The column of an attribute; beyond all if it is missing.
fn column_of(name: &str, columns: &[String]) -> usize {
    columns.iter().position(|column| column == name).unwrap_or(columns.len())
}

#[inline]
fn number_at(columns: &[Vec<f64>], column: usize, at: usize) -> f64 {
    columns.get(column).and_then(|column| column.get(at)).copied().unwrap_or(f64::NAN)
}

/// Lowest and highest height in steps.
fn heights(subject: &Subject, frame: &PointFrame) -> [i64; 2] {
    let ruler = frame.ruler(2);
    let from = subject.min.map_or(i64::MIN, |min| ruler.first(min));
    let above = subject.above.map_or(i64::MIN, |above| ruler.last(above).saturating_add(1));
    let to = subject.max.map_or(i64::MAX, |max| ruler.first(max).saturating_sub(1));
    [from.max(above), to]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: PointFrame = PointFrame { scale: [0.1; 3], offset: [0.0; 3] };

    fn subject(text: &str) -> Subject {
        let mut subject = Subject::default();
        for pair in text.split(',').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').unwrap();
            assert!(subject.take(key, value), "{pair}");
        }
        subject.or_of(None)
    }

    proptest! {
        /// Each point on its own, by the words of the manual.
        #[test]
        fn points_are_those_that_the_conditions_are_of(
            all in prop::collection::vec((0_i32..9, 0_u8..4, 1_u8..4, 1_u8..4, 0_u16..5), 0..40),
            min in prop::option::of(0_i32..9), max in prop::option::of(0_i32..9), above in prop::option::of(0_i32..9),
            class: bool, returns in prop::option::of(prop_oneof![Just(Return::First), Just(Return::Last), Just(Return::Number(2))]),
        ) {
            // Heights are tenths, and limits are written as such.
            let tenth = |steps: i32| format!("{}.{}", steps / 10, steps % 10).parse::<f64>().unwrap();
            let subject = Subject {
                attribute: Some("intensity".to_owned()),
                classes: class.then(|| vec![1, 3]),
                returns,
                min: min.map(tenth), max: max.map(tenth), above: above.map(tenth),
            };
            let names = subject.reads().into_iter().map(str::to_owned).collect::<Vec<_>>();
            let column = |name: &String| all.iter().map(|(_, class, number, of, intensity)| match name.as_str() {
                "intensity" => f64::from(*intensity),
                CLASS => f64::from(*class),
                RETURN => f64::from(*number),
                _ => f64::from(*of),
            }).collect::<Vec<_>>();
            let columns: Vec<_> = names.iter().map(column).collect();
            let points: Vec<_> = (0..).zip(&all).map(|(x, (z, ..))| Point::new(x, 0, *z)).collect();
            let mut out = SelectedPoints::default();
            SubjectSelector::new(&subject, &names, &FRAME).select(&points, &columns, &mut out);
            let expected = all.iter().enumerate().filter(|(_, (z, class_of, number, of, _))| {
                min.is_none_or(|min| *z >= min) && max.is_none_or(|max| *z < max)
                    && above.is_none_or(|above| *z > above)
                    && (!class || *class_of == 1 || *class_of == 3)
                    && match returns {
                        Some(Return::First) => *number == 1,
                        Some(Return::Last) => number >= of,
                        Some(_) => *number == 2,
                        None => true,
                    }
            });
            let expected: Vec<_> = expected
                .map(|(x, (.., intensity))| Point::new(x as i32, 0, i32::from(*intensity)))
                .collect();
            prop_assert_eq!(out.points, expected);
            prop_assert!(out.reals.is_empty());
        }
    }

    #[test]
    fn any_numbers_are_named_by_their_places_and_none_is_left_out() {
        let time = subject("attribute=time");
        assert!(time.is_real() && time.step() == Some(1.0));
        let names = ["gps_time".to_owned()];
        let columns = [vec![3.5, f64::NAN, -1.25, f64::INFINITY]];
        let mut out = SelectedPoints::default();
        let points = [Point::new(1, 2, 3); 4];
        SubjectSelector::new(&time, &names, &FRAME).select(&points, &columns, &mut out);
        assert_eq!(out.reals, [3.5, -1.25]);
        assert_eq!(out.points, [Point::new(1, 2, 0), Point::new(1, 2, 1)]);
        let angle = subject("attribute=angle");
        assert!(!angle.is_real() && angle.step() == Some(0.002));
        let columns = [vec![15.0, -0.006, 0.012, -180.0]];
        let selector = SubjectSelector::new(&angle, &["scan_angle".to_owned()], &FRAME);
        selector.select(&points, &columns, &mut out);
        assert_eq!(out.points.iter().map(|p| p.z).collect::<Vec<_>>(), [7500, -3, 6, -90_000]);
    }

    #[test]
    fn what_is_no_condition_is_not_taken() {
        for (key, value) in [
            ("class", "256"),
            ("class", "2+"),
            ("class", ""),
            ("return", "second"),
            ("min", "nan"),
            ("above", "high"),
            ("attribute", " "),
            ("ddof", "1"),
        ] {
            assert!(!Subject::default().take(key, value), "{key}={value}");
        }
        let mut twice = Subject::default();
        assert!(twice.take("class", "2+9+2") && !twice.take("class", "2"));
        assert_eq!(subject("class=9+2+9").classes, Some(vec![2, 9]));
        assert!(subject("attribute=Z").is_plain());
        assert_eq!(Subject::default().or_of(Some(CLASS)).attribute.as_deref(), Some(CLASS));
        let mut heights = Subject::default();
        assert!(heights.take("attribute", "height") && heights.or_of(Some(CLASS)).is_plain());
    }
}
