//! Findings on features beyond their lines and rings.

use super::attributes::UnsupportedAttributes;

/// Number of occurrences of a fault, and the first one.
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
    /// Features of the original without a counterpart, and features without an original.
    pub(super) gone: FeatureTally,
    pub(super) added: FeatureTally,
    /// Features with other properties or another id.
    pub(super) attributes: FeatureTally,
    /// Features with other points: their position, number, height or measure.
    pub(super) points: FeatureTally,
    /// Holes that have become outer rings, or outer rings that have become holes.
    pub(super) roles: FeatureTally,
    /// Features with heights, and with measures, that the format cannot store.
    pub(super) unstored: [u64; 2],
    pub(super) lost: UnsupportedAttributes,
    /// Truncated names of fields.
    pub(super) cut: Vec<String>,
}

impl FeatureFindings {
    /// A line for each broken promise.
    pub(super) fn failures(&self) -> Vec<String> {
        let all = [
            (&self.gone, "features of the original are missing"),
            (&self.added, "features are not in the original"),
            (&self.attributes, "features have other properties"),
            (&self.points, "features have other points"),
            (&self.roles, "rings have changed between hole and outer ring"),
        ];
        all.into_iter().filter_map(|(tally, what)| tally.sentence(what)).collect()
    }

    /// A line for each property that could not be judged, as `format` does not support it.
    pub(super) fn not_judged(&self, format: &str) -> Vec<String> {
        let [heights, measures] = self.unstored;
        let UnsupportedAttributes { properties, ids, rounded } = self.lost;
        let unsupported = format!("features: not supported by {format}");
        let all = [
            (properties, format!("properties of {properties} {unsupported}")),
            (ids, format!("ids of {ids} {unsupported}")),
            (heights, format!("heights of {heights} {unsupported}")),
            (measures, format!("measures of {measures} {unsupported}")),
            (rounded, format!("{rounded} values: rounded to the digits of {format}")),
        ];
        all.into_iter().filter(|(count, _)| *count > 0).map(|(_, what)| what).collect()
    }
}
