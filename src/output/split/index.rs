//! The index of a folder of meshes: GeoJSON that any GIS shows, and that a reader needs.

use std::io::Write;
use std::path::Path;

use serde_json::{Value, json};

use crate::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::limits;
use crate::output::MeshHeader;

/// The file's name in the folder.
pub(super) const NAME: &str = "index.geojson";
/// What the index calls itself, so that a folder of meshes can be told.
const MARK: &str = "terrane mesh in blocks";

/// One block's file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    pub(super) file: String,
    pub(super) vertices: u64,
    pub(super) triangles: u64,
    pub(super) bytes: u64,
    /// World positions of its corners; triangles may reach beyond it on the right and below.
    pub(super) ring: [[f64; 2]; 5],
}

/// All blocks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Index {
    pub(super) format: String,
    pub(super) epsg: Option<u32>,
    pub(super) comments: Vec<String>,
    pub(super) blocks: Vec<Block>,
}

impl Index {
    pub(super) fn new(format: &str, header: &MeshHeader) -> Self {
        let (epsg, comments) = (header.crs.epsg, header.comments.clone());
        Self { format: format.to_owned(), epsg, comments, blocks: Vec::new() }
    }

    /// Writes the index into `folder`; returns its size.
    pub(super) fn write(&self, folder: &Path) -> Result<u64> {
        let path = folder.join(NAME);
        let mut file = AtomicFile::create(&path, false)?;
        let text = self.to_json().to_string();
        file.write_all(text.as_bytes()).map_err(|e| Error::write(&path, e))?;
        file.commit()
    }

    /// Reads the index of `folder`.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let fail = |e| Error::read(&path, e);
        let bytes = std::fs::metadata(&path).map_err(fail)?.len();
        limits::check("bytes of an index", bytes, limits::MAX_VRT_BYTES)
            .map_err(|e| e.in_file(&path))?;
        let text = std::fs::read(&path).map_err(fail)?;
        let value = serde_json::from_slice(&text).ok();
        value.as_ref().and_then(Self::of_json).ok_or_else(|| {
            Error::bad_input("is not the index of a mesh in blocks")
                .in_file(&path)
                .remedy("make the folder again with terrane")
        })
    }

    fn to_json(&self) -> Value {
        let feature = |block: &Block| {
            json!({
                "type": "Feature",
                "properties": {
                    "file": block.file,
                    "vertices": block.vertices,
                    "triangles": block.triangles,
                    "bytes": block.bytes,
                },
                "geometry": { "type": "Polygon", "coordinates": [block.ring] },
            })
        };
        let features: Vec<Value> = self.blocks.iter().map(feature).collect();
        let mut index = json!({
            "type": "FeatureCollection",
            "name": MARK,
            "format": self.format,
            "comments": self.comments,
            "features": features,
        });
        if let Some(epsg) = self.epsg {
            let name = format!("urn:ogc:def:crs:EPSG::{epsg}");
            index["crs"] = json!({ "type": "name", "properties": { "name": name } });
            index["epsg"] = json!(epsg);
        }
        index
    }

    fn of_json(index: &Value) -> Option<Self> {
        if index["name"].as_str() != Some(MARK) {
            return None;
        }
        let comments = index["comments"].as_array()?.iter();
        let block = |feature: &Value| {
            let of = &feature["properties"];
            let ring =
                serde_json::from_value(feature["geometry"]["coordinates"][0].clone()).ok()?;
            let file = of["file"].as_str()?.to_owned();
            // A name, not a way out of the folder.
            let is_name = Path::new(&file).file_name().is_some_and(|name| name == file.as_str());
            is_name.then_some(Block {
                file,
                vertices: of["vertices"].as_u64()?,
                triangles: of["triangles"].as_u64()?,
                bytes: of["bytes"].as_u64()?,
                ring,
            })
        };
        Some(Self {
            format: index["format"].as_str()?.to_owned(),
            epsg: index["epsg"].as_u64().and_then(|code| u32::try_from(code).ok()),
            comments: comments.map(|c| c.as_str().map(str::to_owned)).collect::<Option<_>>()?,
            blocks: index["features"].as_array()?.iter().map(block).collect::<Option<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_from_its_text_and_never_leads_out_of_its_folder() {
        let ring = [[0.5, 1.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0]];
        let file = "block-0000-0001.ply".to_owned();
        let block = Block { file, vertices: 4, triangles: 2, bytes: 99, ring };
        let mut index = Index {
            format: "PLY".into(),
            epsg: Some(32631),
            comments: vec!["max error 5".into()],
            blocks: vec![block],
        };
        assert_eq!(Index::of_json(&index.to_json()).as_ref(), Some(&index));
        for name in ["../a.ply", "/etc/passwd", "b/a.ply", "..", ""] {
            index.blocks[0].file = name.into();
            assert_eq!(Index::of_json(&index.to_json()), None, "{name}");
        }
        assert_eq!(Index::of_json(&json!({ "type": "FeatureCollection" })), None);
    }
}
