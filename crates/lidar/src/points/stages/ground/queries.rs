//! Queries for the ground under points, and the points that may be ground.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

use super::reclassify::Reclassify;
use crate::grid::surface_model::{MetricFrame, NOISE, square_bytes};
use crate::grid::{GROUND, GroundFrom, WORKER};
use crate::records::values::VALUES;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::{CloudInfo, Flags, PointFormat};
use terrane_ground::noise;

/// Storage of the height above ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice, Serialize, Deserialize)]
pub enum HeightsAs {
    /// extra dimension HeightAboveGround, with the scale of z
    Dimension,
    /// z of the point; points without ground below are removed
    Z,
}

/// A classification of points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Classify {
    /// Noise found by a method gets its class; applied first, because noise is not ground.
    Noise(noise::Request),
    /// Among the classes that may change, ground points get class 2 and others lose it.
    Ground(Reclassify),
    /// Points of class 0 or 1 are classified by height above ground.
    Height(HeightClasses),
}

/// Classes by height above ground: each starts at a height and ends at the next one.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightClasses(Vec<(u8, f64)>);

impl Default for HeightClasses {
    /// Low, medium and high vegetation.
    fn default() -> Self {
        Self(vec![(3, 0.5), (4, 2.0), (5, 5.0)])
    }
}

impl FromStr for HeightClasses {
    type Err = String;

    /// "3=0.5,4=2,5=5".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let layers =
            text.split(',').map(parse_layer).collect::<std::result::Result<Vec<_>, _>>()?;
        match layers.is_sorted_by(|a, b| a.1 < b.1) {
            true => Ok(Self(layers)),
            false => Err("the heights are not ascending".to_owned()),
        }
    }
}

/// A class and its lowest height, such as "3=0.5".
fn parse_layer(text: &str) -> std::result::Result<(u8, f64), String> {
    let (class, height) = text
        .split_once('=')
        .ok_or_else(|| format!("{text:?} is not a class and its lowest height, such as 3=0.5"))?;
    let class =
        class.trim().parse().map_err(|_| format!("{class} is not a class from 0 to 255"))?;
    let height = height.trim().parse().ok().filter(|height: &f64| height.is_finite());
    Ok((class, height.ok_or_else(|| format!("{text:?} lacks a height"))?))
}

impl FromStr for Classify {
    type Err = String;

    /// "ground", "ground:reclassify=9,17", "height", "height:3=0.5,4=2,5=5", "noise", "noise:voxel:step=2,isolated=3".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once(':') {
            None if text == "ground" => Ok(Self::Ground(Reclassify::default())),
            None if text == "height" => Ok(Self::Height(HeightClasses::default())),
            None if text == "noise" => Ok(Self::Noise(noise::Request::DEFAULT)),
            Some(("ground", classes)) => classes.parse().map(Self::Ground),
            Some(("height", layers)) => layers.parse().map(Self::Height),
            Some(("noise", method)) => {
                noise::Request::parse(method).map(Self::Noise).map_err(|e| e.to_string())
            }
            _ => Err("expected ground, ground:reclassify=CLASS,..., height, height:CLASS=FROM,..., noise, noise:METHOD".to_owned()),
        }
    }
}

impl fmt::Display for Classify {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let layers = match self {
            Self::Ground(classes) => return classes.fmt(f),
            Self::Noise(request) => return write!(f, "noise:{request}"),
            Self::Height(HeightClasses(layers)) => layers,
        };
        let all: Vec<_> = layers.iter().map(|(class, from)| format!("{class}={from}")).collect();
        write!(f, "height:{}", all.join(","))
    }
}

impl From<Classify> for String {
    fn from(classify: Classify) -> Self {
        classify.to_string()
    }
}

impl TryFrom<String> for Classify {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl HeightClasses {
    /// The class at a height; `None` below the first.
    pub(super) fn at(&self, height: f64) -> Option<u8> {
        self.0.iter().rev().find(|(_, from)| height >= *from).map(|(class, _)| *class)
    }
}

/// Heights above ground, and classes derived from the ground.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeightQuery {
    /// Source of ground points.
    pub from: GroundFrom,
    /// Storage of heights above ground.
    pub heights: Option<HeightsAs>,
    /// Classification steps, in order.
    pub classify: Vec<Classify>,
}

/// Fails for a method that is given twice.
pub(in crate::points) fn refuse_twice(classify: &[Classify]) -> Result<()> {
    let kinds: Vec<_> = classify.iter().map(std::mem::discriminant).collect();
    match (1..kinds.len()).any(|i| kinds[..i].contains(&kinds[i])) {
        true => {
            Err(Error::usage("‹classify› has the same method twice")
                .remedy("leave out one of them"))
        }
        false => Ok(()),
    }
}

/// Bytes of tables for each tile.
const SQUARE: u64 = 512;

/// Whether a record is of a class of noise.
pub(in crate::points::stages) fn is_known_noise(format: PointFormat, record: &[u8]) -> bool {
    NOISE.contains(&format.class(record))
}

/// Whether a record is kept: not marked as withheld, unless these are kept.
pub(in crate::points::stages) fn is_there(
    format: PointFormat,
    keeps_withheld: bool,
    record: &[u8],
) -> bool {
    keeps_withheld || !format.flags(record).meets(Flags::WITHHELD)
}

impl HeightQuery {
    /// Whether the ground is needed.
    fn is_requested(&self) -> bool {
        self.heights.is_some() || !self.classify.is_empty()
    }

    /// Bytes for a point cloud, and for each thread.
    pub(super) fn needed(&self, info: &CloudInfo) -> [u64; 2] {
        let tables = (info.count / 4096).clamp(1, 1 << 18) * SQUARE;
        [2 * VALUES + tables + self.square(info), WORKER]
    }

    /// Part of these bytes for a tile of the ground method.
    pub(super) fn square(&self, info: &CloudInfo) -> u64 {
        let metres = MetricFrame::of(&info.crs, &info.frame);
        match metres {
            Ok(metres) if self.from != GroundFrom::Class => {
                square_bytes(&self.from.method(), metres.extent(info.bounds))
            }
            _ => 0,
        }
    }

    /// Frame, bounds and CRS of the written points.
    pub(super) fn info(&self, info: &CloudInfo) -> CloudInfo {
        if self.heights != Some(HeightsAs::Z) {
            return info.clone();
        }
        let [x, y, _] = info.frame.offset;
        let frame = PointFrame { offset: [x, y, 0.0], ..info.frame };
        let bounds = info.bounds.map(|[low, high]| {
            // The ground is between the lowest and the highest point; heights are rounded to a step.
            let range = high.z.saturating_sub(low.z).saturating_add(1);
            [Point { z: -range, ..low }, Point { z: range, ..high }]
        });
        CloudInfo { frame, bounds, crs: info.crs.without_heights(), ..info.clone() }
    }

    /// One query with the results of this one and then of the `next`, if there is one: a `next` that takes its ground
    /// from the classes finds the ground that this one found or took from them.
    pub(in crate::points) fn joined(&self, next: &Self) -> Option<Self> {
        let classify = [self.classify.as_slice(), &next.classify].concat();
        let is_same_ground = next.from == GroundFrom::Class
            && !next.finds_ground()
            && (self.finds_ground() || self.from == GroundFrom::Class);
        let mut classes = self.layers().into_iter().flat_map(|HeightClasses(all)| all);
        let is_joined = is_same_ground
            && self.heights != Some(HeightsAs::Z)
            && (self.heights.is_none() || next.heights.is_none())
            && !classes.any(|(class, _)| *class == GROUND)
            && refuse_twice(&classify).is_ok();
        let heights = self.heights.or(next.heights);
        is_joined.then_some(Self { from: self.from, heights, classify })
    }

    /// # Errors
    /// Conflicting options, and options that the format does not support.
    pub(super) fn check(&self, format: PointFormat) -> Result<()> {
        if self.finds_ground() && self.from == GroundFrom::Class {
            return Err(Error::usage(
                "‹classify› ground has no effect with ‹ground› class, which uses the existing classes",
            )
            .remedy("leave out one of them"));
        }
        if !self.is_requested() && self.from != GroundFrom::Auto {
            return Err(Error::usage(
                "‹ground› has no effect without ‹height_above_ground› or ‹classify›",
            )
            .remedy("pass one of them, or leave out ‹ground›"));
        }
        refuse_twice(&self.classify)?;
        let classes =
            self.layers().into_iter().flat_map(|HeightClasses(all)| all).map(|(class, _)| *class);
        match classes.max().filter(|class| *class > format.max_class()) {
            None => Ok(()),
            Some(class) => {
                let number = format.number();
                Err(Error::usage(format!(
                    "class {class} is not supported by point format {number}"
                ))
                .remedy("pass ‹point_format› 6, or 7 with colours"))
            }
        }
    }

    pub(super) fn layers(&self) -> Option<&HeightClasses> {
        self.classify.iter().find_map(|step| match step {
            Classify::Height(layers) => Some(layers),
            _ => None,
        })
    }

    /// The classes that may change, if ground is classified.
    pub(super) fn reclassify(&self) -> Option<&Reclassify> {
        self.classify.iter().find_map(|step| match step {
            Classify::Ground(classes) => Some(classes),
            _ => None,
        })
    }

    pub(super) fn finds_ground(&self) -> bool {
        self.reclassify().is_some()
    }

    /// Whether points of a class other than noise may be ground.
    pub(super) fn may_be_ground(&self, class: u8) -> bool {
        self.reclassify().is_none_or(|classes| classes.may_change(class))
    }

    /// Whether existing ground classes are used.
    pub(super) fn takes_classes(&self) -> bool {
        !self.from.is_method() && !self.finds_ground()
    }
}
