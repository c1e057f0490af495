//! The page of a tile folder. It contains no tiles and requests the visible ones from its server.
//!
//! A section is the plane through both places and the middle of the earth. It cuts triangles in straight lines, and
//! each end of a piece has its own place and height, so it does not matter that the plane leans a little.

use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::{PageJob, PageReport};
use crate::html::HtmlPage;
use terrane_base::error::{Error, Result};
use terrane_files::{RawFile, path_of};

/// Index of quantized-mesh tiles.
const LAYER: &str = "layer.json";
/// Index of 3D Tiles.
const TILESET: &str = "tileset.json";
/// Folders of the formats, in a folder of tiles in several formats.
const SETS: [&str; 2] = ["quantized-mesh", "3dtiles"];
/// Maximum bytes of an index: rectangles of a million tiles that touch no other.
const MAX_LISTED: u64 = 64 << 20;

/// Fields read from a `layer.json`; the page reads it again, with more fields.
#[derive(Debug, Deserialize)]
struct PageLayerJson {
    format: String,
    #[serde(default = "tms")]
    scheme: String,
    #[serde(default = "degrees")]
    projection: String,
    tiles: Vec<String>,
    #[serde(default = "world")]
    bounds: [f64; 4],
    #[serde(default)]
    available: Vec<Vec<PageTileRange>>,
    #[serde(rename = "parentUrl")]
    parent: Option<Value>,
}

/// Fields read from a `tileset.json`, including terrane's own.
#[derive(Debug, Deserialize)]
struct Tileset {
    extras: PageTilesetExtras,
}

#[derive(Debug, Deserialize)]
struct PageTilesetExtras {
    terrane: Terrane,
}

#[derive(Debug, Deserialize)]
struct Terrane {
    bounds: [f64; 4],
    levels: Vec<PageTilesetLevel>,
}

#[derive(Debug, Deserialize)]
struct PageTilesetLevel {
    tiles: u64,
}

/// Contents of a folder.
struct ViewedTileset {
    format: &'static str,
    /// Name of the file that lists the tiles.
    index: &'static str,
    levels: usize,
    tiles: u64,
    bounds: [f64; 4],
}

/// Tiles from one to another, both included.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct PageTileRange {
    start_x: u64,
    start_y: u64,
    end_x: u64,
    end_y: u64,
}

fn tms() -> String {
    "tms".to_owned()
}

fn degrees() -> String {
    "EPSG:4326".to_owned()
}

fn world() -> [f64; 4] {
    [-180.0, -90.0, 180.0, 90.0]
}

/// True for a folder of terrain tiles, or of folders of them.
pub fn is_tiles(path: &Path) -> bool {
    has_index(path) || SETS.iter().any(|set| has_index(&path.join(set)))
}

fn has_index(folder: &Path) -> bool {
    [LAYER, TILESET].iter().any(|name| folder.join(name).is_file())
}

pub(super) fn page(job: &PageJob<'_>) -> Result<(HtmlPage, PageReport)> {
    let input = job.input.to_string();
    let folder = path_of(&input);
    let set = ViewedTileset::read(&folder)?;
    let mut page = HtmlPage::new("tiles", &name(&folder))?;
    let [land, water] = crate::render::palette();
    page.fact("format", set.format);
    page.fact("index", set.index);
    page.fact("palette", json!({ "land": land, "water": water }));
    job.add_settings(&mut page);
    let (levels, tiles) = (Some(set.levels as u32), Some(set.tiles));
    Ok((
        page,
        PageReport { page: "tiles", levels, tiles, bounds: set.bounds, ..PageReport::default() },
    ))
}

impl ViewedTileset {
    fn read(folder: &Path) -> Result<Self> {
        let [layer, tileset] = [LAYER, TILESET].map(|name| folder.join(name));
        match (layer.is_file(), tileset.is_file()) {
            (true, _) => {
                let layer: PageLayerJson = parsed(&layer)?;
                layer.check()?;
                let tiles = layer.available.iter().flatten().map(PageTileRange::count).sum();
                let (levels, bounds) = (layer.available.len(), layer.bounds);
                Ok(Self { format: SETS[0], index: LAYER, levels, tiles, bounds })
            }
            (false, true) => {
                let Tileset { extras: PageTilesetExtras { terrane } } = parsed(&tileset)?;
                let tiles = terrane.levels.iter().map(|level| level.tiles).sum();
                let (levels, bounds) = (terrane.levels.len(), terrane.bounds);
                Ok(Self { format: SETS[1], index: TILESET, levels, tiles, bounds })
            }
            (false, false) => Err(Error::usage("holds tiles of several formats")
                .in_file(folder)
                .remedy(format!("name {}", folder.join(SETS[0]).display()))),
        }
    }
}

/// Parses a JSON file that describes the tiles.
fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let file = RawFile::open(path)?;
    if file.size() > MAX_LISTED {
        return Err(Error::limit("the file", file.size(), MAX_LISTED).in_file(path));
    }
    let bytes = file.read_vec(0, file.size())?;
    serde_json::from_slice(&bytes).map_err(|e| {
        Error::bad_input(format!("not a terrane tile set description: {e}"))
            .in_file(path)
            .remedy("name a folder made by ‹terrane tiles›")
    })
}

impl PageLayerJson {
    fn check(&self) -> Result<()> {
        let Self { format, scheme, projection, .. } = self;
        if !format.starts_with("quantized-mesh-1.") {
            return Err(unsupported_tiles(&format!(
                "unsupported tile format {format}; expected quantized-mesh-1.x"
            )));
        }
        if scheme != "tms" || projection != "EPSG:4326" {
            return Err(unsupported_tiles(&format!(
                "unsupported tiling {projection} {scheme}; expected EPSG:4326 tms"
            )));
        }
        if self.parent.is_some() {
            return Err(unsupported_tiles("tiles in another folder (parentUrl) are not supported"));
        }
        if self.available.is_empty() {
            return Err(unsupported_tiles("the list of available tiles (available) is missing"));
        }
        match self.tiles.first() {
            Some(name) if is_in_folder(name) => Ok(()),
            _ => Err(unsupported_tiles("the tile address is outside this folder")),
        }
    }
}

fn unsupported_tiles(message: &str) -> Error {
    Error::unsupported(message).remedy("name a folder made by ‹terrane tiles›")
}

/// True for a tile address below the folder, with the extension that the server serves.
fn is_in_folder(name: &str) -> bool {
    let path = name.split('?').next().unwrap_or_default();
    path.split('/').all(is_plain) && path.ends_with(".terrain")
}

/// True for a part of a path that cannot lead elsewhere.
fn is_plain(part: &str) -> bool {
    !part.is_empty() && !part.starts_with('.') && !part.contains(':')
}

impl PageTileRange {
    fn count(&self) -> u64 {
        let columns = (self.end_x + 1).saturating_sub(self.start_x);
        columns.saturating_mul((self.end_y + 1).saturating_sub(self.start_y))
    }
}

/// The name of a folder without its parents.
fn name(folder: &Path) -> String {
    let path = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::tests::{job, within};
    use terrane_raster::Inputs;

    const LAYER_TEXT: &str = r#"{"format":"quantized-mesh-1.0","tiles":["{z}/{x}/{y}.terrain?v=1"],
        "bounds":[7,46,8,47],"available":[[{"startX":0,"startY":0,"endX":1,"endY":0}],
        [{"startX":2,"startY":1,"endX":2,"endY":1}]]}"#;

    fn made(layer: &str) -> Result<PageReport> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(LAYER), layer).unwrap();
        assert!(is_tiles(folder.path()));
        let input = Inputs::from(folder.path().display().to_string());
        let (made, report) = page(&job(&input, &within(1 << 30)))?;
        let html = made.html();
        assert!(
            html.contains("connect-src 'self'")
                && !html.contains(&*folder.path().to_string_lossy())
        );
        Ok(report)
    }

    #[test]
    fn a_page_says_what_tiles_there_are() {
        let report = made(LAYER_TEXT).unwrap();
        assert_eq!(
            (report.tiles, report.levels, report.bounds),
            (Some(3), Some(2), [7.0, 46.0, 8.0, 47.0])
        );
    }

    #[test]
    fn other_tiles_are_refused_by_name() {
        for (from, to, told) in [
            ("quantized-mesh-1.0", "heightmap-1.0", "heightmap-1.0"),
            ("{z}/", "https://example.org/{z}/", "outside this folder"),
            ("{z}/", "../{z}/", "outside this folder"),
            (".terrain", ".png", "outside this folder"),
            ("\"bounds\"", "\"scheme\":\"slippyMap\",\"bounds\"", "slippyMap"),
            ("\"bounds\"", "\"projection\":\"EPSG:3857\",\"bounds\"", "EPSG:3857"),
            ("\"bounds\"", "\"parentUrl\":\"x\",\"bounds\"", "parentUrl"),
            ("\"available\"", "\"others\"", "available"),
            ("\"format\"", "\"form\"", "missing field `format`"),
        ] {
            let error = made(&LAYER_TEXT.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(told) && error.contains("; "), "{told}: {error}");
        }
        let folder = tempfile::tempdir().unwrap();
        assert!(!is_tiles(folder.path()));
        let page = || {
            let input = Inputs::from(folder.path().display().to_string());
            page(&job(&input, &within(1 << 30))).unwrap_err().to_string()
        };
        let set = folder.path().join(SETS[0]);
        std::fs::create_dir(&set).unwrap();
        std::fs::write(set.join(LAYER), "{}").unwrap();
        assert!(is_tiles(folder.path()) && page().contains("several formats"));
        std::fs::write(folder.path().join(TILESET), r#"{"asset":{"version":"1.1"}}"#).unwrap();
        assert!(page().contains("missing field `extras`"));
    }
}
