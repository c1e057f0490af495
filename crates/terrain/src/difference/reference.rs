//! The reference of a difference, on the lattice and with the heights of the grid.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use super::DifferenceOptions;
use crate::convert::copy::ReservedMemory;
use crate::warp::{self, LatticeChange};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Rect, VerticalReference};
use terrane_base::registry;
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions};
use terrane_engine::memory;
use terrane_engine::options::{GridInput, OperationFiles};
use terrane_engine::transform::{Transformed, extent_of};
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs};
use terrane_window::resample::RESAMPLINGS;

/// Less of a cell than this is rounding.
const HAIR: f64 = 1e-6;
/// Least cache of the reference.
const MIN_CACHE: u64 = 2 << 20;
/// Columns or rows beyond which lattices are apart.
const FARTHEST: f64 = 1e12;
/// The resampling method that keeps heights.
const NEAREST: &str = "near";

/// A file of the reference, looked at but not yet read.
pub(super) struct ReferenceFile<'a> {
    options: &'a DifferenceOptions,
    inputs: Inputs,
    /// Bytes in memory while its largest block is decoded.
    block: u64,
}

/// The reference on the lattice of a grid.
pub(super) struct ReferenceOnLattice {
    pub(super) source: Box<dyn GridSource>,
    /// The CRS of the grid, with what is assumed to be that of the reference.
    pub(super) crs: Crs,
    /// Its heights times this are in the unit of those of the grid.
    pub(super) factor: f64,
    pub(super) is_exact_in_f32: bool,
    pub(super) transformed: Option<Transformed>,
    /// Resampling method and scale, if lattices differ.
    pub(super) resampled: Option<(&'static str, [f64; 2])>,
    /// Files that the output must not replace.
    pub(super) members: Vec<PathBuf>,
    pub(super) notes: Vec<String>,
}

impl<'a> ReferenceFile<'a> {
    /// Reads the properties of the reference.
    ///
    /// # Errors
    /// Those of opening it.
    pub(super) fn inspect(options: &'a DifferenceOptions) -> Result<Self> {
        let inputs = Inputs::from(vec![options.reference.clone()]);
        let opening = GridInput::default().options(&options.common.resources, 0)?;
        let source = memory::open_for_estimate(&inputs, &opening)?;
        Ok(Self { options, inputs, block: source.block_bytes() })
    }

    /// Bytes of its cache.
    pub(super) fn cache(&self) -> ReservedMemory {
        let least = self.block.max(MIN_CACHE);
        let usual = memory::cache_beside(self.options.common.resources.memory) as u64;
        ReservedMemory { wanted: usual.max(least), least }
    }

    fn path(&self) -> &Path {
        Path::new(&self.options.reference)
    }

    /// Opens the reference on the lattice of a grid, with a cache of some bytes.
    ///
    /// # Errors
    /// A reference that does not overlap the grid, or whose CRS has no operation to that of the grid; those of opening it.
    pub(super) fn open(
        &self,
        grid: &GridInfo,
        name: &Path,
        cache: u64,
        nowhere: Arc<AtomicU64>,
    ) -> Result<ReferenceOnLattice> {
        let cache = usize::try_from(cache).unwrap_or(usize::MAX);
        let opening = GridInput::default().options(&self.options.common.resources, cache)?;
        let source = raster::open_all(self.inputs.names(), &opening)?;
        let info = source.info().clone();
        info.check_cells().map_err(|e| e.in_file(self.path()))?;
        let mut notes = raster::cautions(&info);
        let is_same = same_positions(&grid.crs, &info.crs);
        let operation = self.operation(grid, name, &info, is_same, &mut notes)?;
        let crs = with_assumed(&grid.crs, &info.crs);
        let factor = factor([&grid.crs, &info.crs], operation.as_ref(), &mut notes)
            .map_err(|e| e.in_file(self.path()))?;
        let is_geographic = info.crs.horizontal_unit() == "degree";
        // Longitudes may be counted from elsewhere.
        let turns: &[f64] = if is_geographic { &[0.0, 360.0, -360.0] } else { &[0.0] };
        let apart = turns.iter().map(|by| {
            let mut turned = info.clone();
            turned.transform.x0 += by;
            warp::disjoint_extents(&turned, grid, operation.as_ref())
        });
        if let Some(extents) = apart.collect::<Option<Vec<_>>>() {
            return Err(self.apart(name, extents[0]));
        }
        let transformed = operation.as_ref().filter(|own| !own.is_null()).map(Transformed::of);
        notes.extend(operation.iter().flat_map(|own| own.notes().iter().cloned()));
        let files = raster::files(self.inputs.names())?;
        let files = files.iter().map(|name| PathBuf::from(raster::file_name(name)));
        let members = source.members().into_iter().chain(files).collect();
        let is_exact_in_f32 = info.exact_in_f32() && factor == 1.0;
        let offset = whole_offset(grid, &info);
        let is_covered = offset.is_some_and(|[cols, _]| {
            cols >= 0 && cols + i64::from(grid.width) <= i64::from(info.width)
        });
        // Else the other columns may be a turn away.
        let is_shifted = transformed.is_none() && (is_covered || !is_geographic);
        let (source, resampled): (Box<dyn GridSource>, _) = match offset.filter(|_| is_shifted) {
            Some(offset) => (Box::new(ShiftedGrid::new(source, grid, offset)), None),
            None => {
                // Samples at the same positions are read as they are.
                let is_exact = offset.is_some() && is_same;
                let name = if is_exact { NEAREST } else { &self.options.resampling };
                let resampling = registry::named(RESAMPLINGS, name)?;
                let change = LatticeChange { operation, resampling, nowhere };
                let (source, scale) =
                    warp::on_lattice(source, grid, change).map_err(|e| e.in_file(self.path()))?;
                (source, Some((resampling.name, scale)).filter(|_| !is_exact))
            }
        };
        Ok(ReferenceOnLattice {
            source,
            crs,
            factor,
            is_exact_in_f32,
            transformed,
            resampled,
            members,
            notes,
        })
    }

    /// The operation to the CRS of the grid; `None` if both are the same or one is unknown. Heights are transformed if
    /// both state what they are above.
    fn operation(
        &self,
        grid: &GridInfo,
        name: &Path,
        reference: &GridInfo,
        is_same: bool,
        notes: &mut Vec<String>,
    ) -> Result<Option<CoordinateOperation>> {
        let both = [&grid.crs, &reference.crs];
        let flat = both.map(Crs::without_heights);
        let are_known = flat.each_ref().map(|crs| crs.is_named());
        if are_known != [true; 2] {
            let which = if are_known[0] { "reference" } else { "grid" };
            if are_known[0] != are_known[1] {
                notes.push(format!("the {which} has no CRS; that of the other is assumed"));
            }
            return self.without_files().map(|()| None);
        }
        let has_heights = both.map(|crs| crs.heights() != VerticalReference::Unknown);
        if has_heights[0] != has_heights[1] {
            let which = if has_heights[0] { "reference" } else { "grid" };
            notes.push(format!("the {which} has no vertical CRS; that of the other is assumed"));
        }
        let [own, other] = if has_heights == [true; 2] { both.map(Crs::clone) } else { flat };
        if own.agrees(&other) || has_heights != [true; 2] && is_same {
            return self.without_files().map(|()| None);
        }
        // The place of the grid chooses among operations.
        let DifferenceOptions { files, common, .. } = self.options;
        let extent = Some(extent_of(grid));
        let there = files.operation(&other, name, &own, extent, &common.resources);
        let there = there.map_err(|error| {
            let flat = both.map(Crs::without_heights);
            let options = CoordinateOperationOptions::default();
            let error = error.in_file(self.path());
            match CoordinateOperation::between(&flat[0], &flat[1], &options) {
                // Positions are no obstacle.
                Ok(_) if has_heights == [true; 2] && files.geoid.is_none() => error.remedy(
                    "pass a geoid model as ‹geoid›, or transform the heights of one grid first",
                ),
                _ => error,
            }
        })?;
        Ok(Some(there.inverse()))
    }

    /// Fails if there are files for an operation that is not needed.
    fn without_files(&self) -> Result<()> {
        let OperationFiles { shift_grid, geoid } = &self.options.files;
        let given = [("‹shift_grid›", shift_grid), ("‹geoid›", geoid)];
        match given.iter().find(|(_, file)| file.is_some()) {
            Some((name, _)) => {
                let message = format!("{name} has no effect: both grids are in the same CRS");
                Err(Error::usage(message).remedy(format!("leave out {name}")))
            }
            None => Ok(()),
        }
    }

    fn apart(&self, name: &Path, extents: [[f64; 4]; 2]) -> Error {
        let [own, other] = extents.map(|extent| extent.map(|at| at.to_string()).join(","));
        let name = name.display();
        Error::usage(format!(
            "the reference does not overlap the grid: {name} covers {own} in its CRS, the reference {other}"
        ))
        .in_file(self.path())
        .remedy("pass a reference of the same area, or correct the CRS of one of them")
    }
}

/// True if positions are the same in both CRSs.
fn same_positions(own: &Crs, other: &Crs) -> bool {
    let flat = [own, other].map(Crs::without_heights);
    // A CRS with ellipsoidal heights has another code than the same one without.
    flat[0].agrees(&flat[1])
        || CoordinateOperation::between(&flat[0], &flat[1], &CoordinateOperationOptions::default())
            .is_ok_and(|operation| operation.keeps_degrees())
}

/// The CRS of the grid, with what is unknown as in that of the reference.
fn with_assumed(grid: &Crs, reference: &Crs) -> Crs {
    let flat = [grid, reference].map(Crs::without_heights);
    let has_unit = grid.heights_unit().is_some();
    let known = match flat.each_ref().map(|crs| crs.is_named()) {
        [false, true] => Crs {
            vertical_unit: grid.vertical_unit.clone(),
            vertical_unit_text: grid.vertical_unit_text.clone(),
            ..flat[1].clone()
        },
        _ => grid.clone(),
    };
    if has_unit || grid.heights() != VerticalReference::Unknown {
        return known;
    }
    known.with_heights_of(reference)
}

/// The factor to the unit of heights of the grid, where the operation does not transform heights.
///
/// # Errors
/// Units that are no lengths, unless both are the same.
fn factor(
    both: [&Crs; 2],
    operation: Option<&CoordinateOperation>,
    notes: &mut Vec<String>,
) -> Result<f64> {
    let has_heights = both.map(|crs| crs.heights() != VerticalReference::Unknown);
    if operation.is_some() && has_heights == [true; 2] {
        return Ok(1.0);
    }
    let are_known = both.map(|crs| crs.heights_unit().is_some() || crs.vertical_metres().is_some());
    let units = both.map(|crs| crs.heights_unit().unwrap_or("its unit").to_owned());
    match (are_known, both.map(Crs::vertical_metres)) {
        ([true, true], [Some(own), Some(other)]) if own == other => Ok(1.0),
        ([true, true], [Some(own), Some(other)]) => {
            let [own_unit, unit] = units;
            notes.push(format!("heights of the reference are converted from {unit} to {own_unit}"));
            Ok(other / own)
        }
        ([true, true], _) if units[0] == units[1] => Ok(1.0),
        ([true, true], _) => {
            let [own, other] = units;
            Err(Error::unsupported(format!(
                "heights in {other} cannot be subtracted from heights in {own}"
            ))
            .remedy("convert the heights of one grid first"))
        }
        ([false, false], _) => {
            let [own, other] = both.map(Crs::horizontal_metres);
            if own != other {
                let note = "the units of heights are unknown; they are assumed to be the same";
                notes.push(note.to_owned());
            }
            Ok(1.0)
        }
        ([is_own, _], _) => {
            if has_heights[0] == has_heights[1] {
                let which = if is_own { "reference" } else { "grid" };
                notes.push(format!(
                    "the {which} has no unit of heights; that of the other is assumed"
                ));
            }
            Ok(1.0)
        }
    }
}

/// Columns and rows from samples of a grid to those of the reference, if they are at the same positions.
fn whole_offset(grid: &GridInfo, reference: &GridInfo) -> Option<[i64; 2]> {
    let [right, bottom] = [grid.width, grid.height].map(|side| f64::from(side) - 1.0);
    let offset = |at: [f64; 2]| {
        let [x, y] = grid.transform.apply(at[0], at[1]);
        let [col, row] = reference.transform.invert(x, y);
        [col - at[0], row - at[1]]
    };
    let whole = offset([0.0, 0.0]).map(f64::round);
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
    let mut offsets = corners.into_iter().flat_map(|at| {
        let own = offset(at);
        [own[0] - whole[0], own[1] - whole[1]]
    });
    let is_whole = offsets.all(|by| by.abs() <= HAIR) && whole.iter().all(|by| by.abs() < FARTHEST);
    is_whole.then_some(whole.map(|by| by as i64))
}

/// A grid whose samples lie at those of a lattice, some columns and rows further on; void beyond it.
struct ShiftedGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    offset: [i64; 2],
}

impl ShiftedGrid {
    fn new(inner: Box<dyn GridSource>, lattice: &GridInfo, offset: [i64; 2]) -> Self {
        let GridInfo { width, height, transform, .. } = *lattice;
        let info = GridInfo { width, height, transform, ..inner.info().clone() };
        Self { info, inner, offset }
    }

    /// The samples of the grid in a rectangle of the lattice, and their first column and row there.
    fn within(&self, rect: Rect) -> Option<(Rect, [usize; 2])> {
        let size = [self.inner.info().width, self.inner.info().height].map(i64::from);
        let span = |first: u32, count: u32, axis: usize| {
            let start = i64::from(first) + self.offset[axis];
            let (low, high) = (start.max(0), (start + i64::from(count)).min(size[axis]));
            (low < high).then_some((low as u32, (high - low) as u32, (low - start) as usize))
        };
        let (col, width, right) = span(rect.col, rect.width, 0)?;
        let (row, height, down) = span(rect.row, rect.height, 1)?;
        Some((Rect::new(col, row, width, height), [right, down]))
    }

    /// Reads a rectangle with `read`, row by row where a part of it is beyond the grid.
    fn read<H: Copy>(
        &self,
        rect: Rect,
        out: &mut [H],
        void: H,
        read: impl Fn(Rect, &mut [H]) -> Result<()>,
    ) -> Result<()> {
        let found = self.within(rect);
        let Some((part, [right, down])) = found else {
            out.fill(void);
            return Ok(());
        };
        if part.len() == rect.len() {
            return read(part, out);
        }
        out.fill(void);
        let mut heights = vec![void; part.len()];
        read(part, &mut heights)?;
        for (row, heights) in heights.chunks_exact(part.width as usize).enumerate() {
            out[(row + down) * rect.width as usize + right..][..heights.len()]
                .copy_from_slice(heights);
        }
        Ok(())
    }
}

impl GridSource for ShiftedGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.read(rect, out, f32::NAN, |part, out| self.inner.read_f32(part, out))
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.read(rect, out, f64::NAN, |part, out| self.inner.read_f64(part, out))
    }

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        if let Some((part, _)) = self.within(rect) {
            self.inner.release(part);
        }
    }

    fn copied(&self, rect: Rect) {
        if let Some((part, _)) = self.within(rect) {
            self.inner.copied(part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Affine;
    use terrane_raster::SampleType;

    #[test]
    fn lattices_agree_up_to_whole_cells() {
        let map = Affine { x0: 500_000.0, a: 10.0, b: 0.0, y0: 4e6, d: 0.0, e: -10.0 };
        let info = |transform| GridInfo {
            transform,
            ..GridInfo::plain("test", 900, 700, SampleType::F32)
        };
        let offset = |other| whole_offset(&info(map), &info(other));
        assert_eq!(offset(map.shifted(-3.0, 7.0)), Some([3, -7]));
        assert_eq!(offset(map.shifted(-3.0, 7.5)), None);
        assert_eq!(offset(Affine { a: 10.000_001, ..map }), None);
        assert_eq!(offset(Affine { a: 10.0 + 1e-9, ..map }), Some([0, 0]));
        assert_eq!(offset(Affine { e: 10.0, ..map }), None);
        assert_eq!(offset(Affine { x0: 0.0, ..map.shifted(1e-7, 0.0) }), Some([50_000, 0]));
    }
}
