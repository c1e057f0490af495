//! Conversion of file samples to those of the mosaic: scaled, rounded to the mosaic's type, and void if equal
//! to the mosaic's nodata value.

use crate::grid::SampleType;
use crate::sample::StoredSample;

/// Conversion of the valid heights of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeightRecoding {
    /// Stored value of the mosaic = read * ratio + shift, rounded to `kind` if given.
    pub(super) ratio: f64,
    pub(super) shift: f64,
    pub(super) kind: Option<SampleType>,
    /// Range of stored values that are void.
    pub(super) void: Option<(f64, f64)>,
    /// Height = stored * scale + offset.
    pub(super) scale: f64,
    pub(super) offset: f64,
}

impl HeightRecoding {
    /// No conversion.
    pub(super) const NONE: Self =
        Self { ratio: 1.0, shift: 0.0, kind: None, void: None, scale: 1.0, offset: 0.0 };

    /// The mosaic's height of the valid height `read`; NaN if void.
    #[inline]
    pub(super) fn height(&self, read: f64) -> f64 {
        let scaled = read * self.ratio + self.shift;
        let stored = self.kind.map_or(scaled, |kind| fitted(scaled, kind));
        match self.void {
            Some((low, high)) if low <= stored && stored <= high => f64::NAN,
            _ => stored * self.scale + self.offset,
        }
    }
}

/// The nearest value of `kind`, halves away from zero.
fn fitted(value: f64, kind: SampleType) -> f64 {
    let integer = |low: f64, high: f64| value.round().clamp(low, high);
    match kind {
        SampleType::I8 => integer(i8::MIN.into(), i8::MAX.into()),
        SampleType::U8 => integer(u8::MIN.into(), u8::MAX.into()),
        SampleType::I16 => integer(i16::MIN.into(), i16::MAX.into()),
        SampleType::U16 => integer(u16::MIN.into(), u16::MAX.into()),
        SampleType::I32 => integer(i32::MIN.into(), i32::MAX.into()),
        SampleType::U32 => integer(u32::MIN.into(), u32::MAX.into()),
        SampleType::F16 => half::f16::from_f64(value).to_f64(),
        SampleType::F32 => f64::from(value as f32),
        SampleType::F64 => value,
    }
}

/// Whether two nodata values are equal.
pub(super) fn is_same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// Range of the values of `kind` that count as `nodata`.
pub(super) fn void_range(kind: SampleType, nodata: f64) -> Option<(f64, f64)> {
    fn of<S: StoredSample<N>, const N: usize>(nodata: f64) -> Option<(f64, f64)> {
        S::nodata_range(nodata).map(|(low, high)| (low.f64(), high.f64()))
    }
    match kind {
        SampleType::I8 => of::<i8, 1>(nodata),
        SampleType::U8 => of::<u8, 1>(nodata),
        SampleType::I16 => of::<i16, 2>(nodata),
        SampleType::U16 => of::<u16, 2>(nodata),
        SampleType::I32 => of::<i32, 4>(nodata),
        SampleType::U32 => of::<u32, 4>(nodata),
        SampleType::F16 => of::<half::f16, 2>(nodata),
        SampleType::F32 => of::<f32, 4>(nodata),
        SampleType::F64 => of::<f64, 8>(nodata),
    }
}

/// The narrowest type that contains all values of both.
pub fn wider(a: SampleType, b: SampleType) -> SampleType {
    use SampleType::{F16, F32, F64, I8, I16, I32, U8, U16, U32};
    const ALL: [SampleType; 9] = [U8, I8, U16, I16, F16, U32, I32, F32, F64];
    if a == b {
        return a;
    }
    ALL.into_iter().find(|wide| holds(*wide, a) && holds(*wide, b)).unwrap_or(F64)
}

/// True if all values of `narrow` are values of `wide`.
pub(super) fn holds(wide: SampleType, narrow: SampleType) -> bool {
    use SampleType::{F16, F32, F64, I8, I16, I32, U8, U16, U32};
    match wide {
        U8 => narrow == U8,
        I8 => narrow == I8,
        U16 => matches!(narrow, U8 | U16),
        I16 => matches!(narrow, U8 | I8 | I16),
        U32 => matches!(narrow, U8 | U16 | U32),
        I32 => matches!(narrow, U8 | I8 | U16 | I16 | I32),
        F16 => matches!(narrow, U8 | I8 | F16),
        F32 => matches!(narrow, U8 | I8 | U16 | I16 | F16 | F32),
        F64 => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SampleType::{F16, F32, F64, I8, I16, I32, U8, U16, U32};

    #[test]
    fn types_widen_without_loss() {
        for (a, b, wide) in [
            (U8, U8, U8),
            (U8, I8, I16),
            (I16, U16, I32),
            (U32, I32, F64),
            (I16, F32, F32),
            (I32, F32, F64),
            (F16, U8, F16),
            (F16, I16, F32),
            (U16, I32, I32),
            (F32, F64, F64),
        ] {
            assert_eq!((wider(a, b), wider(b, a)), (wide, wide), "{a:?} {b:?}");
        }
    }

    #[test]
    fn values_are_rounded_clamped_and_voided() {
        let recode = HeightRecoding {
            ratio: 0.5,
            shift: -1.0,
            kind: Some(I16),
            void: void_range(I16, -9999.0),
            scale: 10.0,
            offset: 3.0,
        };
        assert_eq!(recode.height(4.0), 13.0);
        assert_eq!(recode.height(5.0), 23.0, "1.5 becomes 2");
        assert_eq!(recode.height(-1.0), -17.0, "-1.5 becomes -2");
        assert_eq!(recode.height(1e9), 327_673.0);
        assert!(recode.height(-19_996.0).is_nan());
        assert_eq!(HeightRecoding::NONE.height(0.1), 0.1);
        assert_eq!(fitted(0.1, F32), f64::from(0.1_f32));
        assert_eq!(void_range(U8, -1.0), None);
        assert!(void_range(F32, -3.4028234e38).is_some());
    }
}
