//! Reads a geoid model: GTX, or a GeoTIFF in PROJ's form (Geodetic TIFF grid), whose samples are the heights at pixel
//! centres.

use std::path::Path;

use crate::Resources;
use crate::grids_in_memory::{self, SHARE};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Rect};
use terrane_base::limits;
use terrane_crs::{Geoid, MAX_GRID_BYTES};
use terrane_files::RawFile;
use terrane_raster::{FORMATS, GridInfo, GridOpenOptions, GridSource, SampleType};

/// The `TYPE` of geodetic grids that hold geoids.
const KIND: &str = "VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL";

/// Reads a geoid model, which must fit into a small part of the memory.
///
/// # Errors
/// A file that cannot be read, is too large, or is not a geoid model above the ellipsoid in metres, by longitude and
/// latitude.
pub fn read(path: &Path, resources: &Resources) -> Result<Geoid> {
    let file = RawFile::open(path).map_err(|e| e.remedy("check the name"))?;
    let head = file.head(64)?;
    let is_tiff = FORMATS.iter().any(|format| format.name == "GeoTIFF" && (format.sniff)(&head));
    let geoid = if is_tiff {
        of_tiff(path, resources)
    } else {
        Geoid::of_gtx(&grids_in_memory::read(path, resources)?)
    };
    geoid.map_err(|e| e.in_file(path))
}

fn of_tiff(path: &Path, resources: &Resources) -> Result<Geoid> {
    let options = GridOpenOptions {
        cache_bytes: usize::try_from(resources.memory / SHARE).unwrap_or(usize::MAX),
        temp_dir: resources.temp_dir.clone(),
        ..GridOpenOptions::default()
    };
    let grid = terrane_raster::open(&terrane_files::name_of(path.to_owned())?, &options)?;
    let info = grid.info();
    check_kind(info)?;
    check_place(info)?;
    let bytes = u64::from(info.width) * u64::from(info.height) * size_of::<f32>() as u64;
    limits::check("the size of the geoid grid in bytes", bytes, MAX_GRID_BYTES)
        .map_err(|e| e.remedy("cut out the area needed: gdal_translate -projwin"))?;
    grids_in_memory::check_memory(bytes, resources.memory)?;
    let mut heights = vec![0.0; (bytes as usize) / size_of::<f32>()];
    read_rows(&*grid, &mut heights)?;
    let [columns, rows] = [info.width, info.height];
    let map = info.transform;
    if map.e < 0.0 {
        turn_over(&mut heights, columns as usize);
    }
    let south = map.y0 + map.e.min(0.0) * f64::from(rows.max(1) - 1);
    Geoid::new([map.x0, south], [map.a, map.e.abs()], [columns, rows], heights)
}

/// Reads as many rows at a time as a block has, so that each block is decoded once.
fn read_rows(grid: &dyn GridSource, heights: &mut [f32]) -> Result<()> {
    let info = grid.info();
    let mut row = 0;
    while row < info.height {
        let part = Rect::new(0, row, info.width, info.block.1.clamp(1, info.height - row));
        let first = row as usize * info.width as usize;
        grid.read_f32(part, &mut heights[first..][..part.len()])?;
        grid.release(part);
        row += part.height;
    }
    Ok(())
}

/// Reverses the order of the rows.
fn turn_over(heights: &mut [f32], columns: usize) {
    let half = heights.len() / columns / 2 * columns;
    let (above, below) = heights.split_at_mut(half);
    for (high, low) in above.chunks_exact_mut(columns).zip(below.rchunks_exact_mut(columns)) {
        high.swap_with_slice(low);
    }
}

/// Fails if the values are not geoid heights in metres.
fn check_kind(info: &GridInfo) -> Result<()> {
    let grid_type = info.details.iter().find(|(name, _)| name == "grid type");
    match grid_type.map(|(_, text)| text.as_str()) {
        Some(KIND) => {}
        Some(other) => {
            return Err(not_a_geoid(format!("is a geodetic grid of type {other}, not a geoid")));
        }
        None if info.bands != 1 => {
            return Err(not_a_geoid(format!(
                "has {} bands and does not declare the first as a geoid",
                info.bands
            )));
        }
        None => {}
    }
    if let SampleType::U8 | SampleType::I8 | SampleType::F16 = info.sample_type {
        return Err(not_a_geoid(format!(
            "has samples of type {}, too coarse for a geoid",
            info.sample_type.name()
        )));
    }
    let unit = info.crs.vertical_unit.as_deref();
    if unit.is_some() && info.crs.vertical_metres() != Some(1.0) {
        let unit = unit.unwrap_or_default();
        return Err(not_a_geoid(format!("has heights in {unit}, not in metres")));
    }
    Ok(())
}

fn not_a_geoid(what: String) -> Error {
    Error::unsupported(what).remedy("name a grid of geoid heights above the ellipsoid in metres")
}

/// Fails if rows and columns are not parallels and meridians, in degrees from Greenwich.
fn check_place(info: &GridInfo) -> Result<()> {
    let (crs, map) = (&info.crs, info.transform);
    let remedy = "reproject it to longitude and latitude: gdalwarp -t_srs EPSG:4326";
    if !info.georeferenced || !crs.is_named() {
        return Err(Error::bad_input("lacks a georeference or CRS")
            .remedy("assign a CRS: gdal_edit.py -a_srs EPSG:4326"));
    }
    if !counts_degrees(crs) {
        let message = format!(
            "has the CRS {}, not longitude and latitude in degrees from Greenwich",
            crs.label()
        );
        return Err(Error::unsupported(message).remedy(remedy));
    }
    if map.b != 0.0 || map.d != 0.0 || map.a <= 0.0 {
        let message = "has columns that are not meridians in west-to-east order";
        return Err(Error::unsupported(message).remedy(remedy));
    }
    Ok(())
}

fn counts_degrees(crs: &Crs) -> bool {
    crs.geographic == Some(true)
        && crs.conversion().is_ok_and(|conversion| {
            conversion.proj.contains("+proj=longlat") && !conversion.proj.contains("+pm=")
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_turned_over_whatever_their_number() {
        for (rows, turned) in [
            (1, vec![0.0, 1.0]),
            (2, vec![2.0, 3.0, 0.0, 1.0]),
            (3, vec![4.0, 5.0, 2.0, 3.0, 0.0, 1.0]),
        ] {
            let mut heights: Vec<f32> = (0..2 * rows).map(|height| height as f32).collect();
            turn_over(&mut heights, 2);
            assert_eq!(heights, turned);
        }
    }
}
