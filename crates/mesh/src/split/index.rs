//! The index of a split mesh: GeoJSON for any GIS, required by the reader.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::sink::MeshHeader;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::atomic::AtomicFile;

/// File name of the index.
pub(super) const NAME: &str = "index.geojson";
/// Name in the index, which identifies split meshes.
const MARK: &str = "terrane mesh in blocks";
/// Prefix of EPSG codes in CRS names.
const URN: &str = "urn:ogc:def:crs:EPSG::";

/// File of a block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshBlock {
    pub(super) file: String,
    pub(super) vertices: u64,
    pub(super) triangles: u64,
    pub(super) bytes: u64,
    /// World positions of its corners; triangles may extend beyond it on the right and below.
    pub(super) ring: [[f64; 2]; 5],
}

/// All blocks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshBlockIndex {
    pub(super) format: String,
    pub(super) epsg: Option<u32>,
    /// CRS for GeoJSON readers: "urn:ogc:def:crs:EPSG::32631".
    pub(super) crs: Option<String>,
    pub(super) comments: Vec<String>,
    pub(super) blocks: Vec<MeshBlock>,
}

impl MeshBlockIndex {
    pub(super) fn new(format: &str, header: &MeshHeader) -> Self {
        let (epsg, comments) = (header.crs.epsg, header.promises.to_lines());
        let crs = epsg.map(|code| format!("{URN}{code}"));
        Self { format: format.to_owned(), epsg, crs, comments, blocks: Vec::new() }
    }

    /// Codes of its CRSs.
    pub(super) fn systems(&self) -> Vec<String> {
        let urn = self.crs.as_deref().map(|name| name.strip_prefix(URN).unwrap_or(name));
        let codes =
            self.epsg.map(|code| code.to_string()).into_iter().chain(urn.map(str::to_owned));
        codes.map(|code| format!("EPSG:{code}")).collect()
    }

    /// Writes the index into `folder`; returns its size.
    pub(super) fn write(self, folder: &Path) -> Result<u64> {
        let path = folder.join(NAME);
        let fail = |e| Error::write(&path, e);
        let mut file = BufWriter::new(AtomicFile::create(&path, false)?);
        serde_json::to_writer(&mut file, &BlockIndexCollection::from(self))
            .map_err(|e| fail(e.into()))?;
        file.into_inner().map_err(|e| fail(e.into_error()))?.commit()
    }

    /// Reads the index of `folder`.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let fail = |e| Error::read(&path, e);
        let bytes = std::fs::metadata(&path).map_err(fail)?.len();
        limits::check("size of the index in bytes", bytes, limits::MAX_VRT_BYTES)
            .map_err(|e| e.in_file(&path))?;
        let file = BufReader::new(File::open(&path).map_err(fail)?);
        let read: Option<BlockIndexCollection> = match serde_json::from_reader(file.take(bytes)) {
            Err(error) if error.is_io() => return Err(fail(error.into())),
            read => read.ok(),
        };
        read.and_then(BlockIndexCollection::index).ok_or_else(|| {
            Error::bad_input("is not the index of a split mesh")
                .in_file(&path)
                .remedy("make the folder again")
        })
    }
}

/// The index as stored; keys are in alphabetical order.
#[derive(Serialize, Deserialize)]
struct BlockIndexCollection {
    comments: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    crs: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    epsg: Option<u32>,
    features: Vec<BlockIndexFeature>,
    format: String,
    name: String,
    #[serde(rename = "type", skip_deserializing)]
    kind: &'static str,
}

#[derive(Serialize, Deserialize)]
struct BlockIndexFeature {
    geometry: BlockIndexPolygon,
    properties: BlockIndexProperties,
    #[serde(rename = "type", skip_deserializing)]
    kind: &'static str,
}

#[derive(Serialize, Deserialize)]
struct BlockIndexPolygon {
    coordinates: [[[f64; 2]; 5]; 1],
    #[serde(rename = "type", skip_deserializing)]
    kind: &'static str,
}

#[derive(Serialize, Deserialize)]
struct BlockIndexProperties {
    bytes: u64,
    file: String,
    triangles: u64,
    vertices: u64,
}

impl From<MeshBlock> for BlockIndexFeature {
    fn from(MeshBlock { file, vertices, triangles, bytes, ring }: MeshBlock) -> Self {
        Self {
            geometry: BlockIndexPolygon { coordinates: [ring], kind: "Polygon" },
            properties: BlockIndexProperties { bytes, file, triangles, vertices },
            kind: "Feature",
        }
    }
}

impl BlockIndexFeature {
    /// The block, if its file name does not lead out of the folder.
    fn block(self) -> Option<MeshBlock> {
        let BlockIndexProperties { bytes, file, triangles, vertices } = self.properties;
        let is_name = Path::new(&file).file_name().is_some_and(|name| name == file.as_str());
        let [ring] = self.geometry.coordinates;
        is_name.then_some(MeshBlock { file, vertices, triangles, bytes, ring })
    }
}

impl From<MeshBlockIndex> for BlockIndexCollection {
    fn from(index: MeshBlockIndex) -> Self {
        Self {
            comments: index.comments,
            crs: index.crs.map(|name| json!({ "type": "name", "properties": { "name": name } })),
            epsg: index.epsg,
            features: index.blocks.into_iter().map(BlockIndexFeature::from).collect(),
            format: index.format,
            name: MARK.to_owned(),
            kind: "FeatureCollection",
        }
    }
}

impl BlockIndexCollection {
    /// The index, if valid and without names outside its folder.
    fn index(self) -> Option<MeshBlockIndex> {
        if self.name != MARK {
            return None;
        }
        let blocks = self.features.into_iter().map(BlockIndexFeature::block);
        let blocks = blocks.collect::<Option<_>>()?;
        let crs = self.crs.as_ref().and_then(|crs| crs["properties"]["name"].as_str());
        let (epsg, crs) = (self.epsg, crs.map(str::to_owned));
        Some(MeshBlockIndex { format: self.format, epsg, crs, comments: self.comments, blocks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_from_its_text_and_never_leads_out_of_its_folder() {
        let ring = [[0.5, 1.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0]];
        let file = "block-0000-0001.ply".to_owned();
        let block = MeshBlock { file, vertices: 4, triangles: 2, bytes: 99, ring };
        let mut index = MeshBlockIndex {
            format: "PLY".into(),
            epsg: Some(32631),
            crs: Some("urn:ogc:def:crs:EPSG::32631".into()),
            comments: vec!["max error 5".into()],
            blocks: vec![block],
        };
        let text = |index: &MeshBlockIndex| {
            serde_json::to_string(&BlockIndexCollection::from(index.clone())).unwrap()
        };
        let read = |text: &str| serde_json::from_str::<BlockIndexCollection>(text).ok()?.index();
        assert_eq!(read(&text(&index)).as_ref(), Some(&index));
        let same = serde_json::from_str::<Value>(&text(&index)).unwrap().to_string();
        assert_eq!(text(&index), same, "keys in order");
        for name in ["../a.ply", "/etc/passwd", "b/a.ply", "..", ""] {
            index.blocks[0].file = name.into();
            assert_eq!(read(&text(&index)), None, "{name}");
        }
        index.blocks.clear();
        assert_eq!(read(&text(&index)).as_ref(), Some(&index));
        assert_eq!(read(&text(&index).replace(MARK, "mesh")), None);
    }
}
