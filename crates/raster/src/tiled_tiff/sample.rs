//! Conversion between stored bytes and heights, for every sample type.

use half::f16;

use super::out_of_range::SampleMisfit;
use crate::grid::{GridInfo, SampleType};
use terrane_base::error::Error;

/// Meaning of stored samples: height = stored * scale + offset, and the nodata value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleCodec {
    sample_type: SampleType,
    nodata: Option<f64>,
    scale: f64,
    offset: f64,
    rounding: SampleRounding,
}

/// Handling of heights that the sample type cannot store exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SampleRounding {
    /// Fail.
    #[default]
    Exact,
    /// Round to the nearest value.
    Nearest,
    /// Round to the nearest value, but away from the nodata value; for means, which are not user data.
    Aside,
}

/// Number of heights that are stored together if they are integers.
const RUN: usize = 256;

/// Calls a generic method for the sample type.
macro_rules! by_type {
    ($codec:expr, $method:ident, $($argument:expr),*) => {
        match $codec.sample_type {
            SampleType::I8 => $codec.$method::<i8, _>($($argument),*),
            SampleType::U8 => $codec.$method::<u8, _>($($argument),*),
            SampleType::I16 => $codec.$method::<i16, _>($($argument),*),
            SampleType::U16 => $codec.$method::<u16, _>($($argument),*),
            SampleType::I32 => $codec.$method::<i32, _>($($argument),*),
            SampleType::U32 => $codec.$method::<u32, _>($($argument),*),
            SampleType::F16 => $codec.$method::<f16, _>($($argument),*),
            SampleType::F32 => $codec.$method::<f32, _>($($argument),*),
            SampleType::F64 => $codec.$method::<f64, _>($($argument),*),
        }
    };
}

impl SampleCodec {
    pub(crate) fn new(info: &GridInfo) -> Self {
        let GridInfo { sample_type, nodata, scale, offset, .. } = *info;
        Self { sample_type, nodata, scale, offset, rounding: SampleRounding::Exact }
    }

    /// The codec with another rounding.
    pub(crate) fn rounding(self, rounding: SampleRounding) -> Self {
        Self { rounding, ..self }
    }

    /// Decodes stored bytes into `out`; voids become NaN.
    pub(super) fn decode<H: TiledTiffHeight>(&self, stored: &[u8], out: &mut [H]) {
        by_type!(self, decode_as, stored, out);
    }

    fn decode_as<T: TiledTiffSample, H: TiledTiffHeight>(&self, stored: &[u8], out: &mut [H]) {
        let (scale, offset) = (self.scale, self.offset);
        match (T::exactly(self.nodata), self.is_plain()) {
            (None, true) => decode_run(stored, out, |v: T| v.is_hole(), H::of),
            (Some(n), true) => decode_run(stored, out, |v: T| v.is_hole() | (v == n), H::of),
            (nodata, false) => {
                let is_hole = |v: T| v.is_hole() | (Some(v) == nodata);
                decode_run(stored, out, is_hole, |v: T| H::of_f64(v.to_f64() * scale + offset));
            }
        }
    }

    fn is_plain(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Encodes heights. `bytes` may be longer: the rest is padded with voids (zeros without a nodata value).
    pub(crate) fn encode<H: TiledTiffHeight>(
        &self,
        heights: &[H],
        bytes: &mut [u8],
    ) -> Result<(), SampleMisfit> {
        by_type!(self, encode_as, heights, bytes)
    }

    fn encode_as<T: TiledTiffSample, H: TiledTiffHeight>(
        &self,
        heights: &[H],
        bytes: &mut [u8],
    ) -> Result<(), SampleMisfit> {
        let fill = T::exactly(self.nodata).or(T::HOLE);
        let (bytes, padding) = bytes.split_at_mut(heights.len() * T::BYTES);
        let mut sound = true;
        for (bytes, heights) in bytes.chunks_mut(RUN * T::BYTES).zip(heights.chunks(RUN)) {
            if self.is_plain() && T::write_whole(heights, bytes, fill) {
                continue;
            }
            for (bytes, height) in bytes.chunks_exact_mut(T::BYTES).zip(heights) {
                let (value, fits) = self.store::<T, H>(*height, fill);
                value.write(bytes);
                sound &= fits;
            }
        }
        for bytes in padding.chunks_exact_mut(T::BYTES) {
            fill.unwrap_or(T::ZERO).write(bytes);
        }
        if sound { Ok(()) } else { Err(self.misfit(heights, fill)) }
    }

    /// The height that a reader will get for `height`, for formats with their own number encoding.
    pub(crate) fn fit(&self, height: f64) -> Result<f64, SampleMisfit> {
        let (mut bytes, mut out) = ([0; 8], [0.0]);
        let bytes = &mut bytes[..self.sample_type.bytes()];
        self.encode(&[height], bytes)?;
        self.decode(bytes, &mut out);
        Ok(out[0])
    }

    #[inline(always)]
    fn store<T: TiledTiffSample, H: TiledTiffHeight>(
        &self,
        height: H,
        fill: Option<T>,
    ) -> (T, bool) {
        if height.is_void() {
            return (fill.unwrap_or(T::ZERO), fill.is_some());
        }
        let wanted = self.wanted::<T>(height.to_f64());
        let (value, fits) = T::nearest(wanted);
        let meets = fill.is_some_and(|fill| value.meets(fill));
        match self.rounding {
            // `&`, not `&&`: no branch in the loop over all samples.
            SampleRounding::Exact => (value, fits & self.is_close(value, wanted) & !meets),
            SampleRounding::Nearest => (value, fits & !meets),
            SampleRounding::Aside => (if meets { value.aside() } else { value }, fits),
        }
    }

    /// The stored value of a void; `None` if the type has none.
    fn void_as<T: TiledTiffSample, H: TiledTiffHeight>(&self, void: H) -> Option<f64> {
        let (value, is_held) = self.store::<T, H>(void, T::exactly(self.nodata).or(T::HOLE));
        is_held.then(|| value.to_f64())
    }

    /// The exact stored value of `height`, before rounding.
    #[inline(always)]
    fn wanted<T: TiledTiffSample>(&self, height: f64) -> f64 {
        if self.is_plain() { height } else { T::unscale(height, self.scale, self.offset) }
    }

    /// True if `value` equals `wanted` up to rounding by scale and offset.
    #[inline(always)]
    fn is_close<T: TiledTiffSample>(&self, value: T, wanted: f64) -> bool {
        let apart = (value.to_f64() - wanted).abs();
        apart <= if self.is_plain() { 0.0 } else { T::slack(wanted, self.offset / self.scale) }
    }

    /// The first height that [`encode`](Self::encode) could not store.
    fn misfit<T: TiledTiffSample, H: TiledTiffHeight>(
        &self,
        heights: &[H],
        fill: Option<T>,
    ) -> SampleMisfit {
        let at = heights.iter().position(|height| !self.store::<T, H>(*height, fill).1);
        let at = at.unwrap_or_default();
        let Some(height) = heights.get(at).filter(|height| !height.is_void()) else {
            return SampleMisfit::Void(at);
        };
        let height = height.to_f64();
        let (value, fits) = T::nearest(self.wanted::<T>(height));
        match (fits, fill.is_some_and(|fill| value.meets(fill))) {
            (false, _) => SampleMisfit::Beyond(at, height),
            (true, true) => SampleMisfit::Nodata(at, height),
            (true, false) => SampleMisfit::Between(at, height),
        }
    }

    /// The error of a misfit in a run that begins at (`col`, `row`).
    pub(crate) fn refusal(&self, misfit: SampleMisfit, col: u32, row: u32) -> Error {
        misfit.error(self.sample_type, self.nodata, col, row)
    }
}

/// The stored value of voids for the declared `nodata`: the nearest float, NaN for infinities. `None` if the
/// integer type lacks it.
pub(crate) fn stored_nodata(sample_type: SampleType, nodata: f64) -> Option<f64> {
    let info = GridInfo::plain("", 1, 1, sample_type);
    let codec = SampleCodec::new(&GridInfo { nodata: Some(nodata), ..info });
    by_type!(codec, void_as, f64::NAN)
}

#[inline(always)]
fn decode_run<T: TiledTiffSample, H: TiledTiffHeight>(
    stored: &[u8],
    out: &mut [H],
    is_hole: impl Fn(T) -> bool,
    height: impl Fn(T) -> H,
) {
    for (out, bytes) in out.iter_mut().zip(stored.chunks_exact(T::BYTES)) {
        let value = T::read(bytes);
        *out = if is_hole(value) { H::VOID } else { height(value) };
    }
}

/// A float type of heights.
pub(crate) trait TiledTiffHeight: Copy {
    const VOID: Self;
    fn of<T: TiledTiffSample>(value: T) -> Self;
    fn of_f64(value: f64) -> Self;
    fn to_f64(self) -> f64;
    fn is_void(self) -> bool;
}

impl TiledTiffHeight for f32 {
    const VOID: Self = f32::NAN;

    #[inline(always)]
    fn of<T: TiledTiffSample>(value: T) -> Self {
        value.to_f32()
    }

    #[inline(always)]
    fn of_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn is_void(self) -> bool {
        self.is_nan()
    }
}

impl TiledTiffHeight for f64 {
    const VOID: Self = f64::NAN;

    #[inline(always)]
    fn of<T: TiledTiffSample>(value: T) -> Self {
        value.to_f64()
    }

    #[inline(always)]
    fn of_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn is_void(self) -> bool {
        self.is_nan()
    }
}

/// A sample type.
pub(crate) trait TiledTiffSample: Copy + PartialEq {
    const BYTES: usize;
    const ZERO: Self;
    /// A value that is always void (NaN).
    const HOLE: Option<Self>;
    fn read(bytes: &[u8]) -> Self;
    fn write(self, bytes: &mut [u8]);
    fn to_f32(self) -> f32;
    fn to_f64(self) -> f64;
    /// NaN and infinities.
    fn is_hole(self) -> bool;
    /// The nearest value of this type, and whether `value` is within its range.
    fn nearest(value: f64) -> (Self, bool);

    /// Stores heights that are integers of this type. False if one is not, or equals the nodata value; the
    /// output is undefined then.
    fn write_whole<H: TiledTiffHeight>(
        _heights: &[H],
        _bytes: &mut [u8],
        _fill: Option<Self>,
    ) -> bool {
        false
    }

    /// The stored value of a declared nodata value: equal to it, or for floats the nearest finite one,
    /// because text of the lowest float is often out of range. `None` if there is none.
    fn exactly(value: Option<f64>) -> Option<Self>;

    /// Approximately the stored value with `value * scale + offset == height`.
    fn unscale(height: f64, scale: f64, offset: f64) -> f64 {
        (height - offset) / scale
    }

    /// Maximum rounding error of a value by scale and offset, in stored units.
    fn slack(wanted: f64, offset: f64) -> f64;

    /// True if readers treat this value as `nodata`.
    fn meets(self, nodata: Self) -> bool;

    /// A nearby value that readers do not treat as nodata.
    fn aside(self) -> Self;
}

/// Little-endian conversion of a value.
macro_rules! bytes_of {
    ($t:ty) => {
        const BYTES: usize = size_of::<$t>();

        #[inline(always)]
        fn read(bytes: &[u8]) -> Self {
            <$t>::from_le_bytes(bytes.try_into().unwrap_or_default())
        }

        #[inline(always)]
        fn write(self, bytes: &mut [u8]) {
            bytes.copy_from_slice(&self.to_le_bytes());
        }
    };
}

macro_rules! stored_integer {
    ($($t:ty),*) => {$(
        impl TiledTiffSample for $t {
            bytes_of!($t);
            const ZERO: Self = 0;
            const HOLE: Option<Self> = None;

            #[inline(always)]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn is_hole(self) -> bool {
                false
            }

            #[inline(always)]
            fn nearest(value: f64) -> (Self, bool) {
                // 1.5 * 2^52: adding and subtracting it rounds to an integer.
                const ROUND: f64 = 6_755_399_441_055_744.0;
                let whole = (value + ROUND) - ROUND;
                (whole as $t, f64::from(whole as $t) == whole)
            }

            fn write_whole<H: TiledTiffHeight>(heights: &[H], bytes: &mut [u8], fill: Option<Self>) -> bool {
                let mut all = true;
                for (bytes, height) in bytes.chunks_exact_mut(Self::BYTES).zip(heights) {
                    let height = height.to_f64();
                    // The cast saturates and makes NaN 0. Both fail the comparison below, so neither is stored as a
                    // height that it is not.
                    let value = height as $t;
                    value.write(bytes);
                    all &= (f64::from(value) == height) & (Some(value) != fill);
                }
                all
            }

            #[inline(always)]
            fn slack(_wanted: f64, _offset: f64) -> f64 {
                1e-3
            }

            #[inline(always)]
            fn meets(self, nodata: Self) -> bool {
                self == nodata
            }

            fn aside(self) -> Self {
                if self == <$t>::MAX { self - 1 } else { self + 1 }
            }

            fn exactly(value: Option<f64>) -> Option<Self> {
                value.map(|v| v as $t).filter(|near| Some(f64::from(*near)) == value)
            }
        }
    )*};
}

stored_integer!(i8, u8, i16, u16, i32, u32);

/// Common rules of floats: tolerance of nodata in readers (GDAL and terrane), and a step towards zero that
/// leaves it.
macro_rules! float_rules {
    ($epsilon:expr, $step:literal) => {
        #[inline(always)]
        fn slack(wanted: f64, offset: f64) -> f64 {
            1e-9 * (wanted.abs() + offset.abs())
        }

        #[inline(always)]
        fn meets(self, nodata: Self) -> bool {
            let nodata = TiledTiffSample::to_f64(nodata);
            (TiledTiffSample::to_f64(self) - nodata).abs() <= 4.0 * $epsilon * nodata.abs()
        }

        fn aside(self) -> Self {
            let value = TiledTiffSample::to_f64(self);
            Self::nearest(if value == 0.0 { $step } else { value * (1.0 - $step) }).0
        }
    };
}

impl TiledTiffSample for f32 {
    bytes_of!(f32);
    float_rules!(f64::from(f32::EPSILON), 1e-5);
    const ZERO: Self = 0.0;
    const HOLE: Option<Self> = Some(f32::NAN);

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn is_hole(self) -> bool {
        !self.is_finite()
    }

    #[inline(always)]
    fn nearest(value: f64) -> (Self, bool) {
        let near = value as f32;
        (near, near.is_finite())
    }

    fn exactly(value: Option<f64>) -> Option<Self> {
        value.filter(|v| v.is_finite()).map(|v| (v as f32).clamp(f32::MIN, f32::MAX))
    }
}

impl TiledTiffSample for f16 {
    bytes_of!(f16);
    float_rules!(0.0, 2e-3);
    const ZERO: Self = f16::ZERO;
    const HOLE: Option<Self> = Some(f16::NAN);

    #[inline(always)]
    fn to_f32(self) -> f32 {
        f16::to_f32(self)
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f16::to_f64(self)
    }

    #[inline(always)]
    fn is_hole(self) -> bool {
        !self.is_finite()
    }

    #[inline(always)]
    fn nearest(value: f64) -> (Self, bool) {
        let near = f16::from_f64(value);
        (near, near.is_finite())
    }

    fn exactly(value: Option<f64>) -> Option<Self> {
        value.filter(|v| v.is_finite()).map(|v| f16::from_f64(v).clamp(f16::MIN, f16::MAX))
    }
}

impl TiledTiffSample for f64 {
    bytes_of!(f64);
    float_rules!(f64::EPSILON, 1e-9);
    const ZERO: Self = 0.0;
    const HOLE: Option<Self> = Some(f64::NAN);

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn is_hole(self) -> bool {
        !self.is_finite()
    }

    #[inline(always)]
    fn nearest(value: f64) -> (Self, bool) {
        (value, value.is_finite())
    }

    fn exactly(value: Option<f64>) -> Option<Self> {
        value.filter(|v| v.is_finite())
    }

    /// Division may be off by one unit in the last place, so the neighbours are tried as well.
    fn unscale(height: f64, scale: f64, offset: f64) -> f64 {
        let near = (height - offset) / scale;
        let tries = [near, near.next_down(), near.next_up()];
        tries.into_iter().find(|v| v * scale + offset == height).unwrap_or(near)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    impl SampleCodec {
        /// Runs are stored as heights one by one are.
        fn check<T: TiledTiffSample, H: TiledTiffHeight>(
            &self,
            heights: &[H],
        ) -> Result<(), TestCaseError> {
            let fill = T::exactly(self.nodata).or(T::HOLE);
            let (mut slow, mut sound) = (vec![0; heights.len() * T::BYTES], true);
            for (bytes, height) in slow.chunks_exact_mut(T::BYTES).zip(heights) {
                let (value, fits) = self.store::<T, H>(*height, fill);
                value.write(bytes);
                sound &= fits;
            }
            let mut fast = vec![7; slow.len()];
            let is_sound = self.encode_as::<T, H>(heights, &mut fast).is_ok();
            prop_assert_eq!((fast, is_sound), (slow, sound));
            Ok(())
        }
    }

    fn height() -> impl Strategy<Value = f64> {
        let odd = [0.5, -0.0, 1e-9, 255.0, 256.0, -129.0, 65_536.0, 3e9, f64::NAN, f64::INFINITY];
        prop_oneof![200 => (0..120).prop_map(f64::from), 1 => prop::sample::select(odd.to_vec())]
    }

    proptest! {
        #[test]
        fn runs_are_stored_as_their_heights_one_by_one(
            heights in prop::collection::vec(height(), 1..900),
            nodata in prop::option::of(prop::sample::select(vec![0.0, 119.0, 255.0, -9999.0])),
            rounding in prop::sample::select(vec![SampleRounding::Exact, SampleRounding::Nearest, SampleRounding::Aside]),
            scale in prop::sample::select(vec![1.0, 0.5]),
        ) {
            let info = GridInfo { nodata, scale, ..GridInfo::plain("test", 1, 1, SampleType::U8) };
            let narrow: Vec<f32> = heights.iter().map(|height| *height as f32).collect();
            for sample_type in SampleType::ALL {
                let info = GridInfo { sample_type, ..info.clone() };
                let codec = SampleCodec::new(&info).rounding(rounding);
                by_type!(codec, check, &heights)?;
                by_type!(codec, check, &narrow)?;
            }
        }
    }
}
