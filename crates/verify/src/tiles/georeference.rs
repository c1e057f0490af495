//! Positions of the samples of a raster on the globe, and their heights in metres.

use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::Resources;
use terrane_engine::globe::{OnGlobe, VerticalShift};
use terrane_proof::tiles::{LAST, ProofMeridian, ProofParallel, rows};
use terrane_raster::GridSource;

/// Error of positions in metres: by rounding alone, and after a transformation between CRSs.
const ROUNDED: [f64; 2] = [1e-6, 1e-4];

/// A raster on the globe.
pub(super) struct GlobeRaster<'a> {
    grid: &'a dyn GridSource,
    on_globe: OnGlobe,
    lift: VerticalShift,
    /// Whether the raster states the unit of heights.
    pub(super) knows_unit: bool,
    /// Remarks on the georeference.
    pub(super) notes: Vec<String>,
}

/// Positions of the samples of a window.
pub(super) enum WindowPositions {
    /// Columns are meridians and rows parallels: degrees of each, and constants of each parallel.
    Straight {
        longitudes: Vec<f64>,
        latitudes: Vec<f64>,
        meridians: Vec<ProofMeridian>,
        parallels: Vec<ProofParallel>,
    },
    /// Row by row, longitude and latitude in degrees.
    Moved(Vec<[f64; 2]>),
}

/// Lowest and highest coordinate along an axis.
fn range(positions: &[[f64; 2]], axis: usize) -> Option<(f64, f64)> {
    let along = positions.iter().map(|at| at[axis]);
    along.clone().reduce(f64::min).zip(along.reduce(f64::max))
}

impl<'a> GlobeRaster<'a> {
    /// The georeference of a raster.
    ///
    /// # Errors
    /// A raster without a known position on the globe (the missing item is named), or an unreadable
    /// geoid.
    pub(super) fn of(
        grid: &'a dyn GridSource,
        geoid: Option<&str>,
        resources: &Resources,
    ) -> Result<Self> {
        let info = grid.info();
        let (on_globe, notes) = OnGlobe::of(info)?;
        let (lift, knows_unit) = VerticalShift::of(&info.crs, geoid, resources)?;
        Ok(Self { grid, on_globe, lift, knows_unit, notes })
    }

    /// Whether a geoid is added to heights.
    pub(super) fn has_geoid(&self) -> bool {
        self.lift.has_geoid()
    }

    /// The rectangle of all samples.
    pub(super) fn bounds(&self) -> Rect {
        self.grid.info().bounds()
    }

    /// Bytes of the position of a sample of a window; 0 where columns are meridians.
    pub(super) fn sample_bytes(&self) -> u64 {
        match self.on_globe {
            OnGlobe::Straight(_) => 0,
            OnGlobe::Moved(..) => size_of::<[f64; 2]>() as u64,
        }
    }

    /// Error of the position of a sample, in metres.
    pub(super) fn rounded(&self) -> f64 {
        match self.on_globe {
            OnGlobe::Straight(_) => ROUNDED[0],
            OnGlobe::Moved(..) => ROUNDED[1],
        }
    }

    /// Degrees between neighbouring samples, about, along the finer axis; 0 for a single sample.
    pub(super) fn spacing(&self) -> f64 {
        let Rect { width, height, .. } = self.bounds();
        let [col, row] = [width / 2, height / 2];
        let along = (width > 1).then(|| self.degrees_between([col, row], [col - 1, row]));
        let down = (height > 1).then(|| self.degrees_between([col, row], [col, row - 1]));
        along.into_iter().chain(down).reduce(f64::min).unwrap_or_default()
    }

    /// Larger difference of longitudes or latitudes of two samples; 0 where one has no position.
    fn degrees_between(&self, a: [u32; 2], b: [u32; 2]) -> f64 {
        let [a, b] = [a, b].map(|[col, row]| self.position(col, row).unwrap_or([f64::NAN; 2]));
        (0..2).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max)
    }

    /// Largest number of neighbouring samples in a step of positions of a level; infinite for a single sample.
    pub(super) fn samples_of_step(&self, level: u8) -> f64 {
        let step = 180.0 / f64::from(rows(level)) / f64::from(LAST);
        // The spacing is measured in the middle: scales of a projection differ elsewhere, by no more than half.
        2.0 * step / self.spacing()
    }

    /// Longitude and latitude of a sample.
    ///
    /// # Errors
    /// A position outside the domain of the projection.
    pub(super) fn position(&self, col: u32, row: u32) -> Result<[f64; 2]> {
        let at = [col, row].map(f64::from);
        match &self.on_globe {
            OnGlobe::Straight(map) => Ok([map.apply(at[0], 0.0)[0], map.apply(0.0, at[1])[1]]),
            OnGlobe::Moved(map, operation) => operation.position(map.apply(at[0], at[1])),
        }
    }

    /// Longitude and latitude of a position in the CRS of the raster.
    ///
    /// # Errors
    /// A position outside the domain of the projection.
    pub(super) fn to_globe(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        match &self.on_globe {
            OnGlobe::Straight(_) => Ok(at),
            OnGlobe::Moved(_, operation) => operation.position(at),
        }
    }

    /// Whether the bounding box of a ring meets that of the samples.
    pub(super) fn may_meet(&self, ring: &[[f64; 2]]) -> bool {
        let info = self.grid.info();
        let last = [info.width - 1, info.height - 1].map(f64::from);
        let corners = [[0.0, 0.0], [last[0], 0.0], [0.0, last[1]], last];
        let samples = corners.map(|[col, row]| info.transform.apply(col, row));
        (0..2).all(|axis| match (range(ring, axis), range(&samples, axis)) {
            (Some((low, high)), Some((from, to))) => low <= to && from <= high,
            _ => false,
        })
    }

    /// Positions of the samples of a window.
    ///
    /// # Errors
    /// Samples outside the domain of the projection.
    pub(super) fn window(&self, rect: Rect) -> Result<WindowPositions> {
        let (cols, rows) = (rect.col..rect.end_col(), rect.row..rect.end_row());
        if let OnGlobe::Moved(..) = self.on_globe {
            let all = rows.flat_map(|row| cols.clone().map(move |col| (col, row)));
            return all
                .map(|(col, row)| self.position(col, row))
                .collect::<Result<_>>()
                .map(WindowPositions::Moved);
        }
        let longitudes =
            cols.map(|col| Ok(self.position(col, 0)?[0])).collect::<Result<Vec<_>>>()?;
        let latitudes =
            rows.map(|row| Ok(self.position(0, row)?[1])).collect::<Result<Vec<_>>>()?;
        let meridians = longitudes.iter().map(|&at| ProofMeridian::at(at)).collect();
        let parallels = latitudes.iter().map(|&at| ProofParallel::at(at)).collect();
        Ok(WindowPositions::Straight { longitudes, latitudes, meridians, parallels })
    }

    /// Reads heights in metres; voids are NaN.
    pub(super) fn read(&self, rect: Rect, heights: &mut [f64]) -> Result<()> {
        self.grid.read_f64(rect, heights)?;
        self.grid.copied(rect);
        let width = rect.width as usize;
        self.lift.lift(heights, |number| {
            self.position(rect.col + (number % width) as u32, rect.row + (number / width) as u32)
        })
    }
}
