//! The height nearest to a computed one that a grid can store.

use half::f16;

use terrane_raster::{GridInfo, SampleType};

/// Smallest and greatest stored value.
fn limits(kind: SampleType) -> [f64; 2] {
    match kind {
        SampleType::I8 => [i8::MIN.into(), i8::MAX.into()],
        SampleType::U8 => [u8::MIN.into(), u8::MAX.into()],
        SampleType::I16 => [i16::MIN.into(), i16::MAX.into()],
        SampleType::U16 => [u16::MIN.into(), u16::MAX.into()],
        SampleType::I32 => [i32::MIN.into(), i32::MAX.into()],
        SampleType::U32 => [u32::MIN.into(), u32::MAX.into()],
        SampleType::F16 => [f16::MIN.to_f64(), f16::MAX.to_f64()],
        SampleType::F32 => [f32::MIN.into(), f32::MAX.into()],
        SampleType::F64 => [f64::MIN, f64::MAX],
    }
}

/// The nearest value of a type.
fn rounded(kind: SampleType, value: f64) -> f64 {
    let [low, high] = limits(kind);
    let value = value.clamp(low, high);
    match kind {
        SampleType::F64 => value,
        SampleType::F32 => f64::from(value as f32),
        SampleType::F16 => f16::from_f64(value).to_f64(),
        _ => value.round(),
    }
}

/// Relative width of the range of floats that are read as nodata, and the least step away from 0.
fn slack(kind: SampleType) -> [f64; 2] {
    match kind {
        SampleType::F16 => [f16::EPSILON.to_f64(), f16::MIN_POSITIVE.to_f64()],
        SampleType::F32 => [f32::EPSILON.into(), f32::MIN_POSITIVE.into()],
        _ => [f64::EPSILON, f64::MIN_POSITIVE],
    }
}

/// The height that a grid of this type, scale and offset stores for a height: the nearest one that is not nodata.
pub(crate) fn nearest_storable(info: &GridInfo, height: f64) -> f64 {
    let GridInfo { sample_type: kind, scale, offset, .. } = *info;
    let is_plain = scale == 1.0 && offset == 0.0;
    let exact = if is_plain { height } else { (height - offset) / scale };
    let stored = rounded(kind, exact);
    let stored = match info.nodata.map(|nodata| beside(kind, stored, exact, nodata)) {
        Some(other) => other,
        None => stored,
    };
    if is_plain { stored } else { stored * scale + offset }
}

/// A stored value that is not read as nodata.
fn beside(kind: SampleType, stored: f64, exact: f64, nodata: f64) -> f64 {
    let [epsilon, least] = if kind.is_float() { slack(kind) } else { [0.0, 1.0] };
    // Readers allow for four.
    let step = (9.0 * epsilon * nodata.abs()).max(least);
    // NaN is far from all.
    if nodata.is_nan() || (stored - nodata).abs() >= step {
        return stored;
    }
    let up = if exact >= nodata { 1.0 } else { -1.0 };
    let [low, high] = limits(kind);
    let other = nodata + up * step;
    rounded(kind, if (low..=high).contains(&other) { other } else { nodata - up * step })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_rounded_to_the_type_and_never_to_nodata() {
        let info = |sample_type, nodata, scale, offset| GridInfo {
            nodata,
            scale,
            offset,
            ..GridInfo::plain("test", 1, 1, sample_type)
        };
        use SampleType::{F16, F32, F64, I16, U8};
        for (info, height, expected) in [
            (info(I16, Some(-9999.0), 1.0, 0.0), 12.5, 13.0),
            (info(I16, None, 1.0, 0.0), -1e9, -32_768.0),
            (info(I16, Some(0.0), 1.0, 0.0), 0.4, 1.0),
            (info(I16, Some(0.0), 1.0, 0.0), -0.4, -1.0),
            (info(U8, Some(0.0), 1.0, 0.0), -3.0, 1.0),
            (info(U8, Some(255.0), 1.0, 0.0), 255.4, 254.0),
            (info(I16, Some(-1.0), 0.5, 10.0), 11.3, 11.5),
            (info(I16, Some(3.0), 0.5, 10.0), 11.6, 12.0),
            (info(F64, None, 1.0, 0.0), 0.1, 0.1),
            (info(F32, None, 1.0, 0.0), 0.1, f64::from(0.1_f32)),
            (info(F16, None, 1.0, 0.0), 0.1, f16::from_f64(0.1).to_f64()),
            (info(F32, Some(f64::NAN), 1.0, 0.0), 0.0, 0.0),
            (info(F32, Some(0.0), 1.0, 0.0), 0.0, f64::from(f32::MIN_POSITIVE)),
        ] {
            assert_eq!(nearest_storable(&info, height), expected, "{height} {info:?}");
        }
        let low = info(F32, Some(f64::from(f32::MIN)), 1.0, 0.0);
        assert!(nearest_storable(&low, -f64::MAX) > f64::from(f32::MIN));
        let float = nearest_storable(&info(F32, Some(-9999.0), 1.0, 0.0), -9999.0);
        assert!(float != -9999.0 && (float + 9999.0).abs() < 0.02, "{float}");
    }
}
