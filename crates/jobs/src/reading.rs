//! How a grid is read: its band, its voids, and the polygons it is clipped to.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::Resources;
use crate::plan::as_text;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::{name_of, path_of};
use terrane_raster::OpenOptions;
use terrane_raster::{Clip, ClipRings};
use terrane_vector::{self as vector, Feature};

/// What is read of the files of a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Band, from 1.
    pub band: u32,
    /// Replaces the files' nodata value.
    #[serde(with = "as_text")]
    pub nodata: Option<f64>,
    /// The name of a file with the polygons that the grid is clipped to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clip: Option<String>,
}

impl Default for Reading {
    /// The first band, with the files' own nodata value, all of it.
    fn default() -> Self {
        Self { band: 1, nodata: None, clip: None }
    }
}

impl Reading {
    /// How to open the grid, with so many bytes for decoded blocks. Reads all polygons; of TopoJSON those of
    /// its first object.
    ///
    /// # Errors
    /// Whatever the reader of the polygons' format finds; a feature with anything else than polygons in it, by
    /// its number; a file without a ring; more edges than half of the memory holds.
    pub fn options(&self, resources: &Resources, cache_bytes: usize) -> Result<OpenOptions> {
        let clip = self.clip.as_deref().map(|name| polygons(name, resources)).transpose()?;
        let Resources { threads, temp_dir, .. } = resources.clone();
        Ok(OpenOptions {
            band: self.band,
            nodata: self.nodata,
            cache_bytes,
            threads,
            temp_dir,
            clip,
        })
    }

    /// The same wherever the process works.
    pub(crate) fn absolute(&self) -> Result<Self> {
        let clip = self.clip.as_deref().map(absolute).transpose()?;
        Ok(Self { clip, ..self.clone() })
    }

    /// The file of polygons, and what else is read of it.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        self.clip.as_deref().map_or_else(Vec::new, files)
    }
}

fn polygons(name: &str, resources: &Resources) -> Result<Arc<Clip>> {
    let path = &*path_of(name);
    if vector::synthetic(path).is_none() && !path.exists() {
        let error = Error::bad_input("no such file").in_file(path);
        return Err(error.remedy("check the name, or name a file of polygons"));
    }
    let mut source = vector::open(path, &vector::OpenOptions::default())?;
    let (mut rings, mut edges) = (ClipRings::default(), 0);
    while let Some(feature) = source.next()? {
        edges += feature.geometry.vertices() as u64;
        // Those beyond are counted all the same, to tell how much is enough.
        if bytes(edges) <= resources.memory / 2 {
            add(&feature, &mut rings).map_err(|e| e.at(source.place()).in_file(path))?;
        }
    }
    if edges == 0 {
        return Err(Error::bad_input("has no polygon")
            .in_file(path)
            .remedy("name a file with the polygons to clip to"));
    }
    if bytes(edges) > resources.memory / 2 {
        return Err(too_many(path, edges, resources));
    }
    Ok(Arc::new(Clip::new(rings, path, source.layer().crs.clone())))
}

fn bytes(edges: u64) -> u64 {
    edges.saturating_mul(ClipRings::EDGE_BYTES)
}

fn add(feature: &Feature, rings: &mut ClipRings) -> Result<()> {
    let geometry = &feature.geometry;
    if let Some(other) =
        geometry.leaves().find(|leaf| !leaf.kind().is_polygons() && !leaf.is_empty())
    {
        let kind = other.kind().name();
        return Err(Error::bad_input(format!("is a {kind}, and a grid is clipped to polygons"))
            .remedy("take it out, or make a polygon of it"));
    }
    rings.begin_feature()?;
    geometry.parts().try_for_each(|ring| rings.push(ring.xy))
}

fn too_many(path: &Path, edges: u64, resources: &Resources) -> Error {
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let (needed, allowed) = (mib(bytes(edges)), resources.memory >> 20);
    let message = format!("its {edges} vertices take {needed} MiB of the {allowed} MiB allowed");
    Error::new(ErrorKind::Resource, message).in_file(path).remedy(format!(
        "pass --memory {}M or more, or simplify them with terrane line",
        4 * needed + 64
    ))
}

fn absolute(name: &str) -> Result<String> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Ok(name.to_owned());
    }
    name_of(std::path::absolute(&path).map_err(|e| Error::read(&path, e))?)
}

fn files(name: &str) -> Vec<PathBuf> {
    let path = path_of(name);
    if vector::synthetic(&path).is_some() {
        return Vec::new();
    }
    let is_shape = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("shp"));
    let beside = ["shx", "SHX", "dbf", "DBF"].map(|ending| path.with_extension(ending));
    let beside = beside.into_iter().filter(|path| is_shape && path.is_file());
    std::iter::once(path.clone().into_owned()).chain(beside).collect()
}
