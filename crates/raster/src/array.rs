//! Grids of samples in memory.

use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use bytemuck::Pod;

use super::sample::{HeightSample, ToHeight};
use super::window::SampleWindow;
use crate::grid::{GridInfo, GridSource, SampleType};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_base::limits;

/// A sample type of arrays in memory.
pub trait ArraySample: Pod {
    /// Sample type of the grid.
    const TYPE: SampleType;
}

macro_rules! array_samples {
    ($($type:ty, $name:ident;)*) => {$(
        impl ArraySample for $type {
            const TYPE: SampleType = SampleType::$name;
        }
    )*};
}

array_samples! { i8, I8; u8, U8; i16, I16; u16, U16; i32, I32; u32, U32; f32, F32; f64, F64; }

/// Samples in memory, row by row. NaN, infinities and the nodata value are void.
#[derive(Clone, Debug)]
pub struct ArrayGrid<'a> {
    info: GridInfo,
    samples: SampleStorage<'a>,
}

/// Storage of the samples as bytes.
#[derive(Clone)]
enum SampleStorage<'a> {
    Borrowed(&'a [u8]),
    Shared(Arc<dyn SampleBuffer + Send + Sync>),
}

trait SampleBuffer {
    fn bytes(&self) -> &[u8];
}

/// Owner of samples of one type.
struct SampleHolder<T, S>(T, PhantomData<fn() -> S>);

impl<T: AsRef<[S]>, S: ArraySample> SampleBuffer for SampleHolder<T, S> {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.0.as_ref())
    }
}

impl SampleStorage<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Borrowed(bytes) => bytes,
            Self::Shared(samples) => samples.bytes(),
        }
    }
}

impl fmt::Debug for SampleStorage<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.bytes().len())
    }
}

impl<'a> ArrayGrid<'a> {
    /// `height` rows of `width` samples each, without georeference ([`Affine::LATTICE`]): x is the column and
    /// y is the negated row, so that north is up.
    ///
    /// # Errors
    /// Usage: wrong number of samples, no samples, or a side above [`limits::MAX_SIDE`].
    pub fn new<S: ArraySample>(samples: &'a [S], width: u32, height: u32) -> Result<Self> {
        let info = Self::plain::<S>(samples.len(), width, height)?;
        Ok(Self { info, samples: SampleStorage::Borrowed(bytemuck::cast_slice(samples)) })
    }

    fn plain<S: ArraySample>(count: usize, width: u32, height: u32) -> Result<GridInfo> {
        limits::check("number of columns", u64::from(width), limits::MAX_SIDE)?;
        limits::check("number of rows", u64::from(height), limits::MAX_SIDE)?;
        if count == 0 || count as u64 != u64::from(width) * u64::from(height) {
            let message = format!("{count} samples do not match a grid of {width} x {height}");
            return Err(Error::usage(message).remedy("pass width x height samples, row by row"));
        }
        Ok(GridInfo::plain("array", width, height, S::TYPE))
    }

    /// The grid with a georeference.
    pub fn placed(mut self, transform: Affine, crs: Crs) -> Self {
        self.info = GridInfo { transform, crs, georeferenced: true, ..self.info };
        self
    }

    /// The grid with a nodata value.
    pub fn with_nodata(mut self, nodata: Option<f64>) -> Self {
        self.info.nodata = nodata;
        self
    }

    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        let (to_height, size) = (ToHeight::of(&self.info), self.info.sample_type.bytes());
        let all = self.samples.bytes();
        for row in 0..rect.height {
            let first = (rect.row + row) as usize * self.info.width as usize + rect.col as usize;
            let bytes = &all[first * size..][..rect.width as usize * size];
            to_height.convert(bytes, window.row(rect, row));
        }
        Ok(())
    }
}

impl ArrayGrid<'static> {
    /// As [`new`](Self::new), sharing ownership of the samples.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn shared<S: ArraySample>(
        samples: impl AsRef<[S]> + Send + Sync + 'static,
        width: u32,
        height: u32,
    ) -> Result<Self> {
        let info = Self::plain::<S>(samples.as_ref().len(), width, height)?;
        let samples = SampleStorage::Shared(Arc::new(SampleHolder(samples, PhantomData)));
        Ok(Self { info, samples })
    }
}

impl GridSource for ArrayGrid<'_> {
    reads_alike!();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_the_samples_of_their_rows() {
        let samples: Vec<i16> = (0..12).collect();
        let grid = ArrayGrid::new(&samples, 4, 3).unwrap().with_nodata(Some(6.0));
        let mut out = [0.0; 4];
        grid.read_f64(Rect::new(1, 1, 2, 2), &mut out).unwrap();
        assert_eq!((out[0], out[2], out[3]), (5.0, 9.0, 10.0));
        assert!(out[1].is_nan(), "{}", out[1]);
        assert!(grid.read_f32(Rect::new(3, 0, 2, 1), &mut [0.0; 2]).is_err());
    }

    #[test]
    fn arrays_have_as_many_samples_as_their_sides_say() {
        for (count, width, height) in [(11, 4, 3), (13, 4, 3), (0, 0, 5), (1, u32::MAX, 1)] {
            assert!(ArrayGrid::new(&vec![0f32; count], width, height).is_err(), "{width}");
        }
    }
}
