//! Grids in memory under a name, used in place of a file name.

use super::array::ArrayGrid;
use crate::format::{GridOpenOptions, only_band};
use crate::grid::GridSource;
use terrane_base::error::Result;
use terrane_files::{InMemoryRegistry, InMemoryResource};

static GRIDS: InMemoryRegistry<ArrayGrid<'static>> = InMemoryRegistry::new();

/// A named grid in memory. Dropping it removes the name.
pub struct InMemoryGrid(InMemoryResource<ArrayGrid<'static>>);

impl InMemoryGrid {
    /// Registers `grid` under a name for [`open`](super::open).
    pub fn new(grid: ArrayGrid<'static>) -> Self {
        Self(GRIDS.register(grid))
    }

    /// The name.
    pub fn name(&self) -> &str {
        self.0.name()
    }
}

/// Opens the grid in memory called `name`.
pub(crate) fn open(name: &str, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    only_band(options.band)?;
    let grid = (*GRIDS.get(name)?).clone();
    Ok(Box::new(match options.nodata {
        None => grid,
        nodata => grid.with_nodata(nodata),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Rect;

    #[test]
    fn a_held_grid_is_opened_by_its_name() {
        let samples: Vec<i16> = (0..6).collect();
        let held = InMemoryGrid::new(ArrayGrid::shared(samples, 3, 2).unwrap());
        let options = GridOpenOptions { nodata: Some(4.0), ..GridOpenOptions::default() };
        let grid = crate::open_all(&[held.name().to_owned()], &options).unwrap();
        let name = held.name().to_owned();
        drop(held);
        let mut row = [0.0; 3];
        grid.read_f64(Rect::new(0, 1, 3, 1), &mut row).unwrap();
        assert!(row[0] == 3.0 && row[1].is_nan() && row[2] == 5.0, "{row:?}");
        assert!(crate::open(&name, &options).is_err(), "given up");
        let second = GridOpenOptions { band: 2, ..GridOpenOptions::default() };
        let held = InMemoryGrid::new(ArrayGrid::shared(vec![0_f32; 4], 2, 2).unwrap());
        assert!(crate::open(held.name(), &second).is_err());
    }
}
