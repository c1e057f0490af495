//! Conversion of stored samples to heights: nodata to NaN, scale and offset, one loop per sample type.

use half::f16;

use crate::grid::{GridInfo, SampleType};

/// Converts stored samples (native byte order) of a grid to heights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToHeight {
    kind: SampleType,
    nodata: Option<f64>,
    scale: f64,
    offset: f64,
}

impl ToHeight {
    /// For the samples of the grid described by `info`.
    pub(crate) fn of(info: &GridInfo) -> Self {
        Self { kind: info.sample_type, nodata: info.nodata, scale: info.scale, offset: info.offset }
    }

    /// Converts the contiguous samples `bytes` into `out`.
    pub(crate) fn convert<H: HeightSample>(&self, bytes: &[u8], out: &mut [H]) {
        match self.kind {
            SampleType::I8 => self.run::<i8, H, 1>(bytes, out),
            SampleType::U8 => self.run::<u8, H, 1>(bytes, out),
            SampleType::I16 => self.run::<i16, H, 2>(bytes, out),
            SampleType::U16 => self.run::<u16, H, 2>(bytes, out),
            SampleType::F16 => self.run::<f16, H, 2>(bytes, out),
            SampleType::I32 => self.run::<i32, H, 4>(bytes, out),
            SampleType::U32 => self.run::<u32, H, 4>(bytes, out),
            SampleType::F32 => self.run::<f32, H, 4>(bytes, out),
            SampleType::F64 => self.run::<f64, H, 8>(bytes, out),
        }
    }

    fn run<S: StoredSample<N>, H: HeightSample, const N: usize>(
        &self,
        bytes: &[u8],
        out: &mut [H],
    ) {
        let (low, high) = self.nodata.and_then(S::nodata_range).unwrap_or(S::EMPTY);
        let void = |s: S| ((low <= s) & (s <= high)) | !s.finite();
        if self.scale == 1.0 && self.offset == 0.0 {
            each(bytes, out, |s: S| if void(s) { H::VOID } else { H::of(s) });
        } else {
            let (scale, offset) = (self.scale, self.offset);
            let height = |s: S| H::of_f64(s.f64() * scale + offset);
            each(bytes, out, |s: S| if void(s) { H::VOID } else { height(s) });
        }
    }
}

#[inline(always)]
fn each<S: StoredSample<N>, H, const N: usize>(
    bytes: &[u8],
    out: &mut [H],
    height: impl Fn(S) -> H,
) {
    let (samples, _) = bytes.as_chunks::<N>();
    for (out, sample) in out.iter_mut().zip(samples) {
        *out = height(S::read(*sample));
    }
}

/// A height as read: `f32` or `f64`, NaN where void.
pub(crate) trait HeightSample: Copy {
    /// The void height.
    const VOID: Self;
    /// From a finite stored sample.
    fn of<S: StoredSample<N>, const N: usize>(sample: S) -> Self;
    /// From a scaled height; NaN and infinities become void.
    fn of_f64(height: f64) -> Self;
}

impl HeightSample for f32 {
    const VOID: f32 = f32::NAN;

    #[inline(always)]
    fn of<S: StoredSample<N>, const N: usize>(sample: S) -> f32 {
        sample.f32()
    }

    #[inline(always)]
    fn of_f64(height: f64) -> f32 {
        if height.is_finite() { narrow(height) } else { f32::NAN }
    }
}

impl HeightSample for f64 {
    const VOID: f64 = f64::NAN;

    #[inline(always)]
    fn of<S: StoredSample<N>, const N: usize>(sample: S) -> f64 {
        sample.f64()
    }

    #[inline(always)]
    fn of_f64(height: f64) -> f64 {
        if height.is_finite() { height } else { f64::NAN }
    }
}

/// The nearest finite `f32`, so that a sample is void in `f32` only if it is void in `f64`.
#[inline(always)]
fn narrow(height: f64) -> f32 {
    (height as f32).clamp(f32::MIN, f32::MAX)
}

/// A stored sample type of `N` bytes in native byte order.
pub(crate) trait StoredSample<const N: usize>: Copy + PartialOrd {
    /// An empty range.
    const EMPTY: (Self, Self);
    /// From its bytes.
    fn read(bytes: [u8; N]) -> Self;
    /// Exact.
    fn f64(self) -> f64;
    /// Nearest `f32`.
    fn f32(self) -> f32;
    /// False for NaN and infinities.
    fn finite(self) -> bool;
    /// Range of the samples that count as `nodata`; `None` if this type cannot store it.
    fn nodata_range(nodata: f64) -> Option<(Self, Self)>;
}

macro_rules! stored_integer {
    ($($type:ty, $bytes:literal;)*) => {$(
        impl StoredSample<$bytes> for $type {
            const EMPTY: ($type, $type) = (<$type>::MAX, <$type>::MIN);

            #[inline(always)]
            fn read(bytes: [u8; $bytes]) -> $type {
                <$type>::from_ne_bytes(bytes)
            }

            #[inline(always)]
            fn f64(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn finite(self) -> bool {
                true
            }

            fn nodata_range(nodata: f64) -> Option<($type, $type)> {
                let stored = nodata as $type;
                (f64::from(stored) == nodata).then_some((stored, stored))
            }
        }
    )*};
}

stored_integer! { i8, 1; u8, 1; i16, 2; u16, 2; i32, 4; u32, 4; }

impl StoredSample<2> for f16 {
    const EMPTY: (f16, f16) = (f16::MAX, f16::MIN);

    #[inline(always)]
    fn read(bytes: [u8; 2]) -> f16 {
        f16::from_ne_bytes(bytes)
    }

    #[inline(always)]
    fn f64(self) -> f64 {
        self.to_f64()
    }

    #[inline(always)]
    fn f32(self) -> f32 {
        self.to_f32()
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    fn nodata_range(nodata: f64) -> Option<(f16, f16)> {
        let stored = f16::from_f64(nodata).clamp(f16::MIN, f16::MAX);
        nodata.is_finite().then_some((stored, stored))
    }
}

/// Tolerance of nodata for floats as in GDAL, because the tag is decimal text: |a - b| < 2 epsilon |a + b|.
const NODATA_SLACK: f64 = 4.0;

impl StoredSample<4> for f32 {
    const EMPTY: (f32, f32) = (f32::MAX, f32::MIN);

    #[inline(always)]
    fn read(bytes: [u8; 4]) -> f32 {
        f32::from_ne_bytes(bytes)
    }

    #[inline(always)]
    fn f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn f32(self) -> f32 {
        self
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    fn nodata_range(nodata: f64) -> Option<(f32, f32)> {
        let stored = f64::from(narrow(nodata));
        let slack = NODATA_SLACK * f64::from(f32::EPSILON) * stored.abs();
        nodata.is_finite().then(|| (narrow(stored - slack), narrow(stored + slack)))
    }
}

impl StoredSample<8> for f64 {
    const EMPTY: (f64, f64) = (f64::MAX, f64::MIN);

    #[inline(always)]
    fn read(bytes: [u8; 8]) -> f64 {
        f64::from_ne_bytes(bytes)
    }

    #[inline(always)]
    fn f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn f32(self) -> f32 {
        narrow(self)
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    fn nodata_range(nodata: f64) -> Option<(f64, f64)> {
        let slack = NODATA_SLACK * f64::EPSILON * nodata.abs();
        nodata.is_finite().then_some((nodata - slack, nodata + slack))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decoder(kind: SampleType, nodata: Option<f64>, scale: f64, offset: f64) -> ToHeight {
        ToHeight { kind, nodata, scale, offset }
    }

    fn heights<H: HeightSample>(to: ToHeight, bytes: &[u8]) -> Vec<H> {
        let mut out = vec![H::VOID; bytes.len() / to.kind.bytes()];
        to.convert(bytes, &mut out);
        out
    }

    /// The slow twin: one sample at a time in f64.
    fn naive(to: ToHeight, stored: f64) -> f64 {
        let void = to.nodata == Some(stored) || !stored.is_finite();
        let height = if void { f64::NAN } else { stored * to.scale + to.offset };
        if height.is_finite() { height } else { f64::NAN }
    }

    fn same(a: f64, b: f64) -> bool {
        a == b || (a.is_nan() && b.is_nan())
    }

    proptest! {
        #[test]
        fn int16_like_its_naive_twin(
            samples in prop::collection::vec(any::<i16>(), 1..70),
            pick in any::<prop::sample::Index>(), scaled in any::<bool>(),
        ) {
            let nodata = Some(f64::from(samples[pick.index(samples.len())]));
            let (scale, offset) = if scaled { (0.1, -7.0) } else { (1.0, 0.0) };
            let to = decoder(SampleType::I16, nodata, scale, offset);
            let bytes: Vec<u8> = samples.iter().flat_map(|s| s.to_ne_bytes()).collect();
            let (narrow, wide) = (heights::<f32>(to, &bytes), heights::<f64>(to, &bytes));
            for (i, sample) in samples.iter().enumerate() {
                let expected = naive(to, f64::from(*sample));
                prop_assert!(same(wide[i], expected));
                prop_assert!(same(f64::from(narrow[i]), f64::from(expected as f32)));
            }
        }

        #[test]
        fn float32_like_its_naive_twin(samples in prop::collection::vec(any::<f32>(), 1..70)) {
            let to = decoder(SampleType::F32, None, 1.0, 0.0);
            let bytes: Vec<u8> = samples.iter().flat_map(|s| s.to_ne_bytes()).collect();
            let (narrow, wide) = (heights::<f32>(to, &bytes), heights::<f64>(to, &bytes));
            for (i, sample) in samples.iter().enumerate() {
                let expected = naive(to, f64::from(*sample));
                prop_assert!(same(wide[i], expected) && same(f64::from(narrow[i]), expected));
            }
        }
    }

    #[test]
    fn nodata_is_compared_in_the_sample_type() {
        let voids = |kind, nodata, bytes: &[u8]| -> Vec<bool> {
            let heights = heights::<f64>(decoder(kind, Some(nodata), 1.0, 0.0), bytes);
            heights.iter().map(|h| h.is_nan()).collect()
        };
        assert_eq!(voids(SampleType::U16, 65535.0, &[255, 255, 0, 0]), [true, false]);
        assert_eq!(voids(SampleType::U8, -9999.0, &[241, 0]), [false, false]);
        assert_eq!(voids(SampleType::U8, f64::NAN, &[0, 1]), [false, false]);
        assert_eq!(voids(SampleType::I8, 1.5, &[1, 2]), [false, false]);
        // 0.1 has no exact f32, and -3.40282306e38 is what careless writers make of f32::MIN.
        assert_eq!(voids(SampleType::F32, 0.1, &0.1_f32.to_ne_bytes()), [true]);
        let careless = (-3.402_823_060_737_096_5e38_f64 as f32).to_ne_bytes();
        assert_eq!(voids(SampleType::F32, f64::from(f32::MIN), &careless), [true]);
        assert_eq!(voids(SampleType::F32, -9999.0, &(-9998.9_f32).to_ne_bytes()), [false]);
        let half = f16::from_f32(-9999.0).to_ne_bytes();
        assert_eq!(voids(SampleType::F16, -9999.0, &half), [true]);
        assert_eq!(voids(SampleType::F64, 1e300, &1e300_f64.to_ne_bytes()), [true]);
        let near = (-9999.0001_f64).to_ne_bytes();
        assert_eq!(voids(SampleType::F64, -9999.0, &near), [false], "as near as only f32 is");
    }

    #[test]
    fn a_double_beyond_f32_stays_valid() {
        let to = decoder(SampleType::F64, None, 1.0, 0.0);
        let bytes: Vec<u8> = [1e300, -1e300].iter().flat_map(|v: &f64| v.to_ne_bytes()).collect();
        assert_eq!(heights::<f32>(to, &bytes), [f32::MAX, f32::MIN]);
        assert_eq!(heights::<f64>(to, &bytes), [1e300, -1e300]);
    }
}
