//! Reading options of a grid (band, voids, water, clip polygons) and of point clouds.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use crate::Resources;
use crate::feature_files::{self, AuxiliaryFeatures};
use crate::options::{CloudInput, GridInput};
use crate::water;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, wkt};
use terrane_cloud::{self as cloud, CloudFilter, FilterPolygon, Flags, PolygonRings};
use terrane_options::settled;
use terrane_raster::{Clip, ClipRings, GridOpenOptions};
use terrane_vector::Feature;

impl GridInput {
    /// Open options of the grid, with `cache_bytes` for decoded blocks. Reads all clip polygons and water features;
    /// from TopoJSON its first object.
    ///
    /// # Errors
    /// Errors of the format's reader; a clip feature with other geometries than polygons, by its number; a point among
    /// water; a file without rings; more edges than half of the memory holds.
    pub fn options(&self, resources: &Resources, cache_bytes: usize) -> Result<GridOpenOptions> {
        let clip = self.clip.as_deref().map(|name| polygons(name, resources)).transpose()?;
        let water = self.water.as_deref().map(|name| water::read(name, resources)).transpose()?;
        let Resources { threads, temp_dir, .. } = resources.clone();
        Ok(GridOpenOptions {
            band: self.band.unwrap_or(1),
            nodata: self.nodata,
            cache_bytes,
            cache: None,
            threads,
            temp_dir,
            bbox: self.bounds,
            clip,
            water,
            colours: false,
        })
    }

    /// The same with absolute paths.
    pub fn absolute(&self) -> Result<Self> {
        let clip = self.clip.as_deref().map(feature_files::absolute).transpose()?;
        let water = self.water.as_deref().map(feature_files::absolute).transpose()?;
        Ok(Self { clip, water, ..self.clone() })
    }

    /// The files of polygons and of water, with their companion files.
    pub fn files(&self) -> Vec<PathBuf> {
        self.clip.iter().chain(&self.water).flat_map(|name| feature_files::files(name)).collect()
    }
}

impl CloudInput {
    /// Open options of point clouds. Reads the clip polygons.
    ///
    /// # Errors
    /// A polygon file that cannot be read, or has other geometries; more edges than half of the memory holds.
    pub fn options(&self, resources: &Resources) -> Result<cloud::CloudOpenOptions> {
        let Self { bounds, clip, points } = settled(self)?;
        let polygon = clip.map(|name| polygon(&name, resources)).transpose()?;
        let mut classes = points.class;
        classes.sort_unstable();
        classes.dedup();
        let filter = CloudFilter {
            classes: (!classes.is_empty()).then_some(classes),
            returns: points.returns,
            keep_withheld: points.keep_withheld,
            drop: points.drop_flag.iter().fold(Flags::default(), |all, flag| all.and(*flag)),
            bounds,
            polygon: polygon.map(Arc::new),
            z_range: points.z_range,
            condition: points.condition,
            every: points.every.and_then(NonZeroU32::new),
        };
        let (salvage, threads) = (points.salvage, resources.threads);
        let crs = points.crs.as_deref().map(wkt::of_srs);
        Ok(cloud::CloudOpenOptions {
            filter,
            salvage,
            crs,
            threads,
            ..cloud::CloudOpenOptions::default()
        })
    }
}

/// Clip polygons of a grid.
fn polygons(name: &str, resources: &Resources) -> Result<Arc<Clip>> {
    let mut rings = ClipRings::default();
    let (path, crs) = rings_of(name, "grid", ClipRings::EDGE_BYTES, resources, |feature| {
        rings.begin_feature()?;
        feature.geometry.parts().try_for_each(|ring| rings.push(ring.xy))
    })?;
    Ok(Arc::new(Clip::new(rings, &path, crs)))
}

/// Clip polygons of a point cloud.
///
/// # Errors
/// As for the clip polygons of a grid.
pub fn polygon(name: &str, resources: &Resources) -> Result<FilterPolygon> {
    let (polygon, crs, path) = polygons_with(name, resources, |_| Ok(()))?;
    Ok(polygon.of_file(&path, crs))
}

/// Reads polygons, their CRS and their path, and passes their features to `take`.
///
/// # Errors
/// As [`polygon`]; the errors of `take`.
pub fn polygons_with(
    name: &str,
    resources: &Resources,
    mut take: impl FnMut(&Feature) -> Result<()>,
) -> Result<(FilterPolygon, Crs, PathBuf)> {
    let mut rings = PolygonRings::default();
    let (path, crs) = rings_of(name, "cloud", PolygonRings::EDGE_BYTES, resources, |feature| {
        take(feature)?;
        rings.begin_feature()?;
        feature.geometry.parts().try_for_each(|ring| rings.push(ring.xy))
    })?;
    Ok((FilterPolygon::new(rings), crs, path))
}

/// Passes all features of a clip polygon file on; returns its path and CRS.
fn rings_of(
    name: &str,
    dataset: &str,
    edge_bytes: u64,
    resources: &Resources,
    mut add: impl FnMut(&Feature) -> Result<()>,
) -> Result<(PathBuf, Crs)> {
    let remedy = "simplify them with ‹terrane simplify›";
    let mut file = AuxiliaryFeatures::open(name, "polygons", edge_bytes, remedy)?;
    let edges = file.each(resources.memory / 2, resources, |feature| {
        only_polygons(feature, dataset)?;
        add(feature)
    })?;
    if edges == 0 {
        return Err(Error::bad_input("contains no polygon")
            .in_file(&file.path)
            .remedy("name a file with clip polygons"));
    }
    let crs = file.source.layer().crs.clone();
    Ok((file.path, crs))
}

fn only_polygons(feature: &Feature, dataset: &str) -> Result<()> {
    let mut leaves = feature.geometry.leaves();
    let Some(other) = leaves.find(|leaf| !leaf.kind().is_polygons() && !leaf.is_empty()) else {
        return Ok(());
    };
    let kind = other.kind().name();
    Err(Error::bad_input(format!("is a {kind}, not a polygon to clip the {dataset} to"))
        .remedy("remove it, or convert it to a polygon"))
}
