//! Water features of a file: polygons and centre lines of rivers.

use std::sync::Arc;

use crate::Resources;
use crate::feature_files::AuxiliaryFeatures;
use terrane_base::error::{Error, Result};
use terrane_raster::{Water, WaterFeatures};
use terrane_vector::{Feature, PartRole};

/// Reads all features; from TopoJSON the first object.
///
/// # Errors
/// Errors of the format's reader; a point; a file without polygons; more vertices than a quarter of the memory holds.
pub fn read(name: &str, resources: &Resources) -> Result<Arc<Water>> {
    let remedy = "simplify it with ‹terrane simplify›";
    let mut file = AuxiliaryFeatures::open(name, "water", WaterFeatures::VERTEX_BYTES, remedy)?;
    let mut water = WaterFeatures::default();
    file.each(resources.memory / 4, resources, |feature| add(feature, &mut water))?;
    if water.areas() == 0 {
        return Err(Error::bad_input("contains no polygon")
            .in_file(&file.path)
            .remedy("name a file with water polygons"));
    }
    Ok(Arc::new(Water::new(water, &file.path, file.source.layer().crs.clone())))
}

fn add(feature: &Feature, water: &mut WaterFeatures) -> Result<()> {
    let geometry = &feature.geometry;
    if geometry.leaves().any(|leaf| leaf.kind().is_points() && !leaf.is_empty()) {
        return Err(Error::bad_input("points are not supported as water")
            .remedy("remove it; use polygons for water and lines for its centre lines"));
    }
    for part in geometry.parts() {
        match part.role {
            PartRole::Line => water.push_line(part.xy)?,
            PartRole::Outer => {
                water.begin_area()?;
                water.push_ring(part.xy)?;
            }
            PartRole::Hole => water.push_ring(part.xy)?,
        }
    }
    Ok(())
}
