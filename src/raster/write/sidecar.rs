//! Small text files beside a grid (.prj, .hdr, .pgw), put into place together with it, and the corner
//! that text headers want.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::atomic::AtomicFile;
use crate::error::{Error, ErrorKind, Result};
use crate::geom::{Affine, Crs};
use crate::limits;
use crate::raster::GridInfo;

/// Files beside the grid at a path, in the making.
pub(super) struct Sidecars {
    grid: PathBuf,
    overwrite: bool,
    files: Vec<AtomicFile>,
}

impl Sidecars {
    /// None yet.
    pub(super) fn new(grid: &Path, overwrite: bool) -> Self {
        Self { grid: grid.to_path_buf(), overwrite, files: Vec::new() }
    }

    /// Adds the file with `ending` in place of the grid's; one that says the same already stays.
    pub(super) fn add(&mut self, ending: &str, text: &str) -> Result<()> {
        let path = self.grid.with_extension(ending);
        if !says(&path, text) {
            let mut file = AtomicFile::create(&path, self.overwrite)?;
            file.write_all(text.as_bytes()).map_err(|e| Error::write(&path, e))?;
            self.files.push(file);
        }
        Ok(())
    }

    /// Adds the CRS as a .prj; without well-known text for it, one of an earlier grid is refused.
    pub(super) fn add_prj(&mut self, crs: &Crs) -> Result<()> {
        match wkt(crs) {
            Some(text) => self.add("prj", &format!("{text}\n")),
            None => self.refuse(&["prj", "PRJ"]),
        }
    }

    /// Fails when there is a file with one of `endings` that readers would take for the new grid's.
    pub(super) fn refuse(&self, endings: &[&str]) -> Result<()> {
        let mut files = endings.iter().map(|ending| self.grid.with_extension(ending));
        match files.find(|file| file.exists()) {
            Some(file) => {
                let message = "belongs to an earlier file and would be read with the new one";
                Err(Error::new(ErrorKind::CannotWrite, message)
                    .in_file(&file)
                    .remedy("remove it, or write to another name"))
            }
            None => Ok(()),
        }
    }

    /// Puts all files under their names.
    pub(super) fn commit(self) -> Result<()> {
        self.files.into_iter().try_for_each(|file| file.commit().map(drop))
    }
}

/// True when the file at `path` holds `text`, white space around it aside.
fn says(path: &Path, text: &str) -> bool {
    let is_small = std::fs::metadata(path).is_ok_and(|meta| meta.len() <= limits::MAX_HEADER_BYTES);
    is_small && std::fs::read_to_string(path).is_ok_and(|found| found.trim() == text.trim())
}

/// The well-known text that came with the grid, or else the definition of its EPSG code.
fn wkt(crs: &Crs) -> Option<&str> {
    let given = crs.wkt.as_deref().map(str::trim).filter(|wkt| !wkt.is_empty());
    given.or_else(|| {
        let code = u16::try_from(crs.epsg?).ok()?;
        Some(crs_definitions::from_code(code)?.wkt)
    })
}

/// What a grid of heights with a .prj beside it cannot say.
pub(super) fn lost(info: &GridInfo) -> Vec<String> {
    let crs = &info.crs;
    let mut lost = Vec::new();
    if wkt(crs).is_none() && (crs.citation.is_some() || !crs.geo_keys.is_empty()) {
        lost.push(format!("the CRS ({}) has neither a code nor a text to write", crs.label()));
    }
    if let Some(unit) = &crs.vertical_unit {
        lost.push(format!("the format does not say that heights are in {unit}"));
    }
    lost
}

/// Fails unless the grid is north-up, as formats with a corner and a cell size are.
pub(super) fn check_north_up(map: &Affine, format: &str) -> Result<()> {
    if (map.b, map.d) == (0.0, 0.0) && map.a > 0.0 && map.e < 0.0 && map.is_valid() {
        return Ok(());
    }
    let message = format!("the grid is rotated or not north-up, which {format} cannot say");
    Err(Error::new(ErrorKind::CannotWrite, message).remedy("write GTiff, or gdalwarp it first"))
}

/// World position to write for the lower left corner (`half` 0.5) or sample (`half` 0) of a north-up
/// grid, chosen so that readers come back to sample (0, 0), to the last bit where a number does.
pub(super) fn lower_left(info: &GridInfo, half: f64) -> [f64; 2] {
    let Affine { x0, a, y0, e, .. } = info.transform;
    let up = f64::from(info.height - 1) + half;
    let x = solve(x0, x0 - half * a, |x| x + half * a);
    let y = solve(y0, y0 + up * e, |y| y + up * -e);
    [x, y]
}

/// A number near `guess` that `read` turns into `wanted`, or else `guess`.
fn solve(wanted: f64, guess: f64, read: impl Fn(f64) -> f64) -> f64 {
    let near = [guess, guess.next_down(), guess.next_up()];
    near.into_iter().find(|number| read(*number) == wanted).unwrap_or(guess)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corner_leads_back_to_the_first_sample() {
        for (x0, y0, a, height) in
            [(500_015.1, 4_000_000.7, 30.3, 643), (-117.2, 36.1, 1.0 / 3600.0, 3601)]
        {
            let transform = Affine { x0, a, b: 0.0, y0, d: 0.0, e: -a };
            let plain = GridInfo::plain("", 9, height, crate::raster::SampleType::F32);
            let info = GridInfo { transform, ..plain };
            for half in [0.0, 0.5] {
                let [x, y] = lower_left(&info, half);
                let up = f64::from(height - 1) + half;
                assert_eq!((x + half * a, y + up * a), (x0, y0));
            }
        }
    }

    #[test]
    fn a_sidecar_of_an_earlier_grid_is_refused_or_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let grid = folder.path().join("a.asc");
        let prj = folder.path().join("a.prj");
        std::fs::write(&prj, "old").unwrap();
        let unknown = Crs::default();
        let known = Crs { epsg: Some(4326), ..Crs::default() };
        assert!(Sidecars::new(&grid, true).add_prj(&unknown).is_err());
        assert!(Sidecars::new(&grid, false).add_prj(&known).is_err());
        let mut sidecars = Sidecars::new(&grid, true);
        sidecars.add_prj(&known).unwrap();
        assert_eq!(std::fs::read_to_string(&prj).unwrap(), "old", "until the grid is whole");
        sidecars.commit().unwrap();
        assert!(std::fs::read_to_string(&prj).unwrap().starts_with("GEOGCS["));
        let mut again = Sidecars::new(&grid, false);
        again.add_prj(&known).unwrap();
        assert!(again.files.is_empty(), "it says so already");
    }
}
