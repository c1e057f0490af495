//! Georeference from world files and from z/x/y tile addresses.

use std::path::Path;

use crate::sidecars;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;

/// Size limit of a world file in bytes.
const MAX_BYTES: u64 = 4096;
/// Half the width of Web Mercator (EPSG:3857), in metres.
const HALF_WORLD: f64 = 20_037_508.342_789_244;
/// Maximum zoom level of a tile address.
const MAX_ZOOM: u32 = 30;

/// Reads the world file of `path`, if there is one: six numbers with the position of the first sample's
/// centre.
///
/// # Errors
/// A world file without six numbers, or with a singular transform.
pub(super) fn sidecar_transform(path: &Path, endings: &[&str]) -> Result<Option<Affine>> {
    let Some(world) = sidecars::sidecar(path, endings) else { return Ok(None) };
    let text = sidecars::small_text(&world, "size of the world file in bytes", MAX_BYTES)?;
    let numbers: Option<Vec<f64>> =
        text.split_whitespace().map(|word| word.replace(',', ".").parse().ok()).collect();
    let map = match numbers.as_deref() {
        Some(&[a, d, b, e, x0, y0]) => Affine { x0, a, b, y0, d, e },
        _ => {
            return Err(Error::bad_input("world file does not contain six numbers").in_file(&world));
        }
    };
    if !map.is_valid() {
        return Err(
            Error::bad_input("world file does not define a valid transform").in_file(&world)
        );
    }
    Ok(Some(map))
}

/// A tile of the Web Mercator pyramid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WebMercatorTile {
    /// Zoom level: the world is 2^zoom tiles wide.
    pub(super) zoom: u32,
    /// Column from the west.
    pub(super) x: u32,
    /// Row from the north.
    pub(super) y: u32,
}

impl WebMercatorTile {
    /// Parses a path that ends in zoom/x/y.ext (also y@2x.ext).
    pub(super) fn of_path(path: &Path) -> Option<Self> {
        let mut parts = path.iter().rev();
        let file = Path::new(parts.next()?).file_stem()?.to_str()?;
        let y = digits(file.strip_suffix("@2x").unwrap_or(file))?;
        let x = digits(parts.next()?.to_str()?)?;
        let zoom = digits(parts.next()?.to_str()?)?;
        let inside = zoom <= MAX_ZOOM && x < 1 << zoom && y < 1 << zoom;
        inside.then_some(Self { zoom, x, y })
    }

    /// The transform of a grid of `width` x `height` samples that fills the tile.
    pub(super) fn transform(&self, width: u32, height: u32) -> Affine {
        let side = 2.0 * HALF_WORLD / f64::from(1_u32 << self.zoom);
        let west = f64::from(self.x) * side - HALF_WORLD;
        let north = HALF_WORLD - f64::from(self.y) * side;
        let (dx, dy) = (side / f64::from(width), side / f64::from(height));
        Affine::from_gdal([west, dx, 0.0, north, 0.0, -dy])
    }
}

fn digits(text: &str) -> Option<u32> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_in_paths() {
        let of = |path: &str| WebMercatorTile::of_path(Path::new(path));
        assert_eq!(of("a/10/163/357.png"), Some(WebMercatorTile { zoom: 10, x: 163, y: 357 }));
        assert_eq!(of("0/0/0@2x.png"), Some(WebMercatorTile { zoom: 0, x: 0, y: 0 }));
        for path in
            ["10/163/a.png", "357.png", "1/2/0.png", "31/0/0.png", "a/1/1/.png", "-1/0/0.png"]
        {
            assert_eq!(of(path), None, "{path}");
        }
    }

    #[test]
    fn tiles_cover_the_world() {
        let map = WebMercatorTile { zoom: 1, x: 1, y: 0 }.transform(256, 256);
        let [west, dx, _, north, _, dy] = map.to_gdal();
        assert!(west.abs() < 1e-6 && (north - HALF_WORLD).abs() < 1e-6);
        assert!((dx * 256.0 - HALF_WORLD).abs() < 1e-6 && (dx + dy).abs() < 1e-12);
    }

    #[test]
    fn world_files() {
        let folder = tempfile::tempdir().unwrap();
        let grid = folder.path().join("a.png");
        let read = |text: &str| {
            std::fs::write(folder.path().join("a.PGW"), text).unwrap();
            sidecar_transform(&grid, &["pgw", "wld"])
        };
        assert_eq!(sidecar_transform(&grid, &["pgw"]).unwrap(), None);
        let map = read("30\n0\n0\n-30\n500\n700\n").unwrap().unwrap();
        assert_eq!(map, Affine { x0: 500.0, a: 30.0, b: 0.0, y0: 700.0, d: 0.0, e: -30.0 });
        for text in ["1 2 3", "a b c d e f", "0 0 0 0 0 0", "nan 0 0 1 0 0", "1 0 0 1 0 0 0"] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
