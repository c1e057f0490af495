//! All operations. A new one is a file with its options and code, and a line here.

use terrane_engine::operation::AnyOperation;
#[cfg(feature = "lidar")]
use terrane_lidar::cloud_tin::CloudTinOptions;
#[cfg(feature = "lidar")]
use terrane_lidar::grid::GridOptions;
#[cfg(feature = "lidar")]
use terrane_lidar::points::PointsOptions;
use terrane_simplify::LineOptions;
use terrane_terrain::colours::ColorReliefOptions;
use terrane_terrain::contour::ContourOptions;
use terrane_terrain::convert::ConvertOptions;
use terrane_terrain::difference::DifferenceOptions;
use terrane_terrain::fill::FillOptions;
use terrane_terrain::relief::{
    AspectOptions, CurvatureOptions, HillshadeOptions, RoughnessOptions, SlopeOptions, TpiOptions,
    TriOptions,
};
use terrane_terrain::sample::SampleOptions;
use terrane_terrain::tin::TinOptions;
use terrane_terrain::zonal::ZonalOptions;
#[cfg(feature = "tiles")]
use terrane_tiles::{CloudTilesOptions, TilesOptions};
#[cfg(feature = "viewer")]
use terrane_viewer::page::{CloudPageOptions, LinePageOptions, PageOptions};
#[cfg(feature = "viewer")]
use terrane_viewer::qa::QaOptions;
#[cfg(feature = "viewer")]
use terrane_viewer::view::PictureOptions;

/// All operations that write a file, in the order of the help.
pub const OPERATIONS: &[AnyOperation] = &[
    AnyOperation::divisible::<TinOptions>(),
    #[cfg(feature = "lidar")]
    AnyOperation::divisible::<CloudTinOptions>(),
    AnyOperation::of::<ConvertOptions>(),
    AnyOperation::of::<FillOptions>(),
    AnyOperation::of::<DifferenceOptions>(),
    #[cfg(feature = "lidar")]
    AnyOperation::divisible::<GridOptions>(),
    #[cfg(feature = "lidar")]
    AnyOperation::divisible::<PointsOptions>(),
    AnyOperation::of::<ContourOptions>(),
    AnyOperation::of::<SampleOptions>(),
    AnyOperation::of::<ZonalOptions>(),
    AnyOperation::of::<LineOptions>(),
    #[cfg(feature = "tiles")]
    AnyOperation::divisible::<TilesOptions>(),
    #[cfg(feature = "tiles")]
    AnyOperation::of::<CloudTilesOptions>(),
    AnyOperation::of::<SlopeOptions>(),
    AnyOperation::of::<AspectOptions>(),
    AnyOperation::of::<HillshadeOptions>(),
    AnyOperation::of::<ColorReliefOptions>(),
    AnyOperation::of::<CurvatureOptions>(),
    AnyOperation::of::<RoughnessOptions>(),
    AnyOperation::of::<TpiOptions>(),
    AnyOperation::of::<TriOptions>(),
    #[cfg(feature = "viewer")]
    AnyOperation::of::<PictureOptions>(),
    #[cfg(feature = "viewer")]
    AnyOperation::of::<PageOptions>(),
    #[cfg(feature = "viewer")]
    AnyOperation::of::<CloudPageOptions>(),
    #[cfg(feature = "viewer")]
    AnyOperation::of::<LinePageOptions>(),
    #[cfg(feature = "viewer")]
    AnyOperation::of::<QaOptions>(),
];

#[cfg(all(test, feature = "cli"))]
mod tests {
    use serde_json::json;
    use terrane_engine::operation::given_names;
    use terrane_lidar::points::PointsOptions;
    use terrane_options::Options;

    use super::OPERATIONS;

    #[test]
    fn what_asks_for_nothing_is_not_given() {
        let given = json!({ "thin": null, "height_above_ground": false, "buffer": 0, "dedupe": 1 });
        let names = given_names(PointsOptions::TABLE, given.as_object().unwrap());
        assert_eq!(names.len(), 2, "{names:?}");
        assert!(names.contains(&"buffer") && names.contains(&"dedupe"), "{names:?}");
        let bare = json!({ "height_above_ground": "dimension", "drop_overlap": true });
        assert_eq!(given_names(PointsOptions::TABLE, bare.as_object().unwrap()).len(), 2);
    }

    #[test]
    fn names_of_operations_and_of_their_options_are_unique() {
        let is_unique = |mut names: Vec<&str>| {
            names.sort_unstable();
            names.windows(2).all(|pair| pair[0] != pair[1])
        };
        assert!(is_unique(OPERATIONS.iter().map(|operation| operation.name).collect()));
        for operation in OPERATIONS {
            let fields = operation.table.fields();
            let names = fields.iter().flat_map(|own| own.aliases.iter().copied().chain([own.name]));
            assert!(is_unique(names.collect()), "{}", operation.name);
            let letters = fields.iter().filter_map(|own| own.short).map(String::from);
            let letters: Vec<String> = letters.collect();
            assert!(is_unique(letters.iter().map(String::as_str).collect()), "{}", operation.name);
        }
    }
}
