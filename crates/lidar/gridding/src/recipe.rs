//! Accumulators for the requested statistics: statistics share common accumulators.
//!
//! A cell keeps what its statistics need and no more: count, sum, sum of squares, lowest, highest, sums of
//! weights, the nearest point, or all heights. Sums are of integers and the rest are extremes, so accumulators
//! can be merged in any order. Weights of inverse distances are rounded to integers once, before they are
//! added.

use super::cell::CellUnits;
use super::dimension::Subject;
use super::plane::AccumulatorKind;
use super::region::{CellNeighborhood, StatisticDefaults};
use super::statistic::{Statistic, StatisticRequest};

/// Accumulators of the points, and the bands computed from them.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticRecipe {
    subjects: Vec<Subject>,
    /// Regions, each with the index of its subject.
    pub(super) regions: Vec<(usize, CellNeighborhood)>,
    /// The accumulators, each with the index of its region.
    pub(super) planes: Vec<(usize, AccumulatorKind)>,
    bands: Vec<StatisticBand>,
}

/// One band.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticBand {
    /// Its name.
    pub label: String,
    /// Its statistic.
    pub statistic: Statistic,
    /// Its planes, in the order of the statistic.
    pub(super) planes: Vec<usize>,
    /// World size of a step of its values, if they are not heights.
    step: Option<f64>,
    /// Whether values are real numbers, not steps.
    pub(super) is_real: bool,
}

impl StatisticBand {
    /// True when a cell without points has a value, which is 0.
    pub fn counts(&self) -> bool {
        self.statistic.counts()
    }

    /// True if it is computed from the triangulation of all points.
    pub fn is_triangulated(&self) -> bool {
        self.statistic.shape().is_some()
    }

    /// Units of its values, given those of heights.
    pub(super) fn units(&self, heights: &CellUnits) -> CellUnits {
        self.step.map_or(*heights, |scale| CellUnits { scale, offset: 0.0, ..*heights })
    }
}

impl StatisticRecipe {
    /// The recipe of these statistics with these defaults.
    pub fn new(requests: &[StatisticRequest], rules: &StatisticDefaults) -> Self {
        let mut recipe = Self {
            subjects: Vec::new(),
            regions: Vec::new(),
            planes: Vec::new(),
            bands: Vec::new(),
        };
        for StatisticRequest { statistic, label, subject } in requests {
            let is_real = subject.is_real();
            let needs = statistic.needs(rules, is_real);
            let mut planes = recipe.keep(subject, &needs);
            if let Some(base) = statistic.base(subject) {
                planes.extend(recipe.keep(&base, &needs));
            }
            let (label, statistic, step) = (label.clone(), *statistic, subject.step());
            recipe.bands.push(StatisticBand { label, statistic, planes, step, is_real });
        }
        recipe
    }

    /// Adds the planes of the points of a subject.
    fn keep(
        &mut self,
        subject: &Subject,
        needs: &(CellNeighborhood, Vec<AccumulatorKind>),
    ) -> Vec<usize> {
        let (region, primitives) = needs;
        if primitives.is_empty() {
            return Vec::new();
        }
        let subject = position(&mut self.subjects, subject.clone());
        let region = position(&mut self.regions, (subject, *region));
        primitives.iter().map(|kind| position(&mut self.planes, (region, *kind))).collect()
    }

    /// Subjects of its statistics.
    pub fn subjects(&self) -> &[Subject] {
        &self.subjects
    }

    /// The attributes it needs.
    pub fn attributes(&self) -> Vec<String> {
        let mut all = Vec::new();
        for name in self.subjects.iter().flat_map(Subject::reads) {
            position(&mut all, name.to_owned());
        }
        all
    }

    /// The bands, in the requested order.
    pub fn bands(&self) -> &[StatisticBand] {
        &self.bands
    }

    /// Indices of the regions of a subject.
    pub fn regions_of(&self, subject: usize) -> impl Iterator<Item = (usize, CellNeighborhood)> {
        let all = self.regions.iter().enumerate();
        all.filter(move |(_, (of, _))| *of == subject).map(|(at, (_, region))| (at, *region))
    }

    /// True if it has no accumulators.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// True if a band is computed from the triangulation of all points.
    pub fn triangulates(&self) -> bool {
        self.bands.iter().any(StatisticBand::is_triangulated)
    }

    /// The largest radius of a statistic; 0 if cells use their own points only.
    pub fn reach(&self) -> f64 {
        self.regions.iter().fold(0.0, |reach, (_, region)| match *region {
            CellNeighborhood::Cell => reach,
            CellNeighborhood::Disc(radius) => radius.max(reach),
        })
    }

    /// Bytes for each cell, independent of the points.
    pub fn bytes_per_cell(&self) -> usize {
        self.planes.iter().map(|(_, primitive)| primitive.bytes_per_cell).sum()
    }

    /// Bytes for each point in a cell.
    pub fn bytes_per_point(&self) -> usize {
        self.planes.iter().map(|(_, primitive)| primitive.bytes_per_point).sum()
    }
}

/// Index of an item, which is added if new.
fn position<T: PartialEq>(items: &mut Vec<T>, item: T) -> usize {
    items.iter().position(|other| *other == item).unwrap_or_else(|| {
        items.push(item);
        items.len() - 1
    })
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;
    use super::*;

    #[test]
    fn bands_share_what_they_have_in_common() {
        let recipe = |list: &str, around| {
            let rules = StatisticDefaults { radius: 2.0, power: 1.0, around };
            StatisticRecipe::new(&parse_list(list).unwrap(), &rules)
        };
        let own = recipe("mean,std,min,range,count", false);
        assert_eq!(own.regions, [(0, CellNeighborhood::Cell)]);
        assert_eq!(own.bytes_per_cell(), 4 + 8 + 16 + 4 + 4);
        let wide = recipe("mean,idw,idw:power=2,idw:radius=3,nearest,count", false);
        assert_eq!(wide.regions.len(), 3);
        assert_eq!(wide.bytes_per_cell(), 4 + 8 + (32 + 4) + 32 + (32 + 4) + 32);
        assert_eq!((wide.reach(), own.reach()), (3.0, 0.0));
        assert_eq!(recipe("mean,idw", true).regions, [(0, CellNeighborhood::Disc(2.0))]);
        assert_eq!(recipe("median,p95,skewness,entropy", false).bytes_per_point(), 8);
        let classes = recipe("count:class=2,count:class=6,share:class=2,count,cover", false);
        assert_eq!((classes.subjects().len(), classes.bytes_per_cell()), (5, 20));
        assert_eq!(classes.attributes(), ["classification", "return_number", "number_of_returns"]);
        assert_eq!(recipe("p5:attribute=time", false).bytes_per_point(), 12);
        assert!(recipe("mean,max:above=2", false).attributes().is_empty());
    }
}
