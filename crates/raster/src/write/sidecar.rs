//! Sidecars of a grid (.prj, .hdr, .pgw), committed together with it, and the lower left corner for text
//! headers.

use std::path::{Path, PathBuf};

use super::format::GridWriteOptions;
use crate::grid::GridInfo;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_files::atomic::Sidecar;

/// Pending sidecars of a grid.
pub(super) struct Sidecars {
    grid: PathBuf,
    overwrite: bool,
    /// Real paths of the input files, which are not overwritten.
    read: Vec<PathBuf>,
    files: Vec<Sidecar>,
}

impl Sidecars {
    /// No sidecars yet.
    pub(super) fn new(grid: &Path, options: &GridWriteOptions) -> Self {
        let read = options.read.iter().filter_map(|path| path.canonicalize().ok()).collect();
        Self { grid: grid.to_path_buf(), overwrite: options.overwrite, read, files: Vec::new() }
    }

    /// Adds the sidecar with extension `ending`; an equivalent existing one is kept.
    pub(super) fn add(&mut self, ending: &str, text: &str) -> Result<()> {
        self.push(ending, Some(text.to_owned()), |existing: &str| existing.trim() == text.trim())
    }

    /// Adds the CRS as a .prj sidecar.
    pub(super) fn add_prj(&mut self, crs: &Crs) -> Result<()> {
        let text = crs.to_wkt().map(|text| text + "\n");
        let is_said = text.is_some();
        self.push("prj", text, |found| crs.is_said_by(found))?;
        // Readers that find no .prj read this file.
        if is_said { Ok(()) } else { self.push("PRJ", None, |found| crs.is_said_by(found)) }
    }

    /// Removes stale sidecars with one of `endings`, which would apply to the new grid.
    pub(super) fn remove(&mut self, endings: &[&str]) -> Result<()> {
        endings.iter().try_for_each(|ending| self.push(ending, None, |_| false))
    }

    fn push(
        &mut self,
        ending: &str,
        text: Option<String>,
        says_so: impl Fn(&str) -> bool,
    ) -> Result<()> {
        let path = self.grid.with_extension(ending);
        if path.canonicalize().is_ok_and(|path| self.read.contains(&path)) {
            return Err(Error::usage(
                "sidecar of the input would be overwritten by that of the output",
            )
            .in_file(&path)
            .remedy("choose another output name"));
        }
        self.files.push(Sidecar::new(path, text, says_so, self.overwrite)?);
        Ok(())
    }

    /// Commits all sidecars.
    pub(super) fn commit(self) -> Result<()> {
        self.files.into_iter().try_for_each(|file| file.commit())
    }
}

/// Notes on metadata that a grid with a .prj sidecar cannot store.
pub(super) fn lost(info: &GridInfo) -> Vec<String> {
    let crs = &info.crs;
    let mut lost: Vec<String> = crs.lost_in_wkt().into_iter().collect();
    if let Some(unit) = crs.vertical_unit.as_ref().filter(|_| !crs.wkt_has_heights()) {
        lost.push(format!("the format cannot store the height unit ({unit})"));
    }
    lost
}

/// Fails unless the grid is north-up, for formats with a corner and a cell size.
pub(super) fn check_north_up(map: &Affine, format: &str) -> Result<()> {
    if (map.b, map.d) == (0.0, 0.0) && map.a > 0.0 && map.e < 0.0 && map.is_valid() {
        return Ok(());
    }
    let message = format!("the grid is rotated or not north-up, which {format} does not support");
    Err(Error::new(ErrorKind::CannotWrite, message).remedy("write GTiff, or gdalwarp it first"))
}

/// Lower left corner (`half` 0.5) or sample (`half` 0) of a north-up grid, chosen so that readers reconstruct
/// the position of sample (0, 0), exactly if possible.
pub(super) fn lower_left(info: &GridInfo, half: f64) -> [f64; 2] {
    let Affine { x0, a, y0, e, .. } = info.transform;
    let up = f64::from(info.height - 1) + half;
    let x = solve(x0, x0 - half * a, |x| x + half * a);
    let y = solve(y0, y0 + up * e, |y| y + up * -e);
    [x, y]
}

/// A number near `guess` that `read` maps to `wanted`, or else `guess`.
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
            let plain = GridInfo::plain("", 9, height, crate::SampleType::F32);
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
        let known = Crs { epsg: Some(4326), ..Crs::default() };
        let read = || std::fs::read_to_string(&prj);
        let replacing = GridWriteOptions { overwrite: true, ..GridWriteOptions::default() };
        for crs in [&Crs::default(), &known] {
            assert!(Sidecars::new(&grid, &GridWriteOptions::default()).add_prj(crs).is_err());
        }
        let mut sidecars = Sidecars::new(&grid, &replacing);
        sidecars.add_prj(&known).unwrap();
        assert_eq!(read().unwrap(), "old", "until the grid is whole");
        sidecars.commit().unwrap();
        assert!(read().unwrap().starts_with("GEOGCS["));
        Sidecars::new(&grid, &GridWriteOptions::default()).add_prj(&known).unwrap();
        let mut sidecars = Sidecars::new(&grid, &replacing);
        sidecars.add_prj(&Crs::default()).unwrap();
        sidecars.commit().unwrap();
        assert!(read().is_err());
    }
}
