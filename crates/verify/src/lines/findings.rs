//! Findings on features beyond their lines and rings.

use super::attributes::UnsupportedAttributes;

/// How often something was found, and where first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FeatureTally {
    pub(super) count: u64,
    pub(super) first: Option<String>,
}

impl FeatureTally {
    pub(super) fn add(&mut self, first: impl FnOnce() -> String) {
        self.count += 1;
        self.first.get_or_insert_with(first);
    }

    /// A line for a report, if there are findings.
    pub(super) fn sentence(&self, what: &str) -> Option<String> {
        let first = self.first.as_ref()?;
        Some(format!("{} {what}; the first is {first}", self.count))
    }
}

/// Findings about features.
#[derive(Clone, Debug, Default)]
pub(super) struct FeatureFindings {
    /// Features of the original.
    pub(super) features: u64,
    /// Features of the original that none was made from, and features that were made from none.
    pub(super) gone: FeatureTally,
    pub(super) added: FeatureTally,
    /// Features with other properties or another id.
    pub(super) attributes: FeatureTally,
    /// Features with other points: their position, number, height or measure.
    pub(super) points: FeatureTally,
    /// Holes that are outer rings now, and the other way round.
    pub(super) roles: FeatureTally,
    /// Features with heights, and with measures, that the format cannot store.
    pub(super) unstored: [u64; 2],
    pub(super) lost: UnsupportedAttributes,
    /// Names that the format has cut.
    pub(super) cut: Vec<String>,
}

impl FeatureFindings {
    /// A line for each broken promise.
    pub(super) fn failures(&self) -> Vec<String> {
        let all = [
            (&self.gone, "features of the original are gone"),
            (&self.added, "features were made from none of the original"),
            (&self.attributes, "features have other properties"),
            (&self.points, "features have other points"),
            (&self.roles, "rings are holes no more, or are holes now"),
        ];
        all.into_iter().filter_map(|(tally, what)| tally.sentence(what)).collect()
    }

    /// A line for each thing that could not be judged, as `format` cannot hold it.
    pub(super) fn not_judged(&self, format: &str) -> Vec<String> {
        let [heights, measures] = self.unstored;
        let UnsupportedAttributes { properties, ids, rounded } = self.lost;
        let no_place = format!("features, which {format} has no place for");
        let all = [
            (properties, format!("properties of {properties} {no_place}")),
            (ids, format!("ids of {ids} {no_place}")),
            (heights, format!("heights of {heights} {no_place}")),
            (measures, format!("measures of {measures} {no_place}")),
            (rounded, format!("{rounded} values beyond the digits that {format} has for them")),
        ];
        all.into_iter().filter(|(count, _)| *count > 0).map(|(_, what)| what).collect()
    }
}
