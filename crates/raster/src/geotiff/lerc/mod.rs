//! LERC blocks of TIFF files, decoded by the crate `lerc`; the header of a blob is checked against the block
//! before decoding.

use bytemuck::Pod;
use lerc::{LercError, LercInfo, Sample};

use crate::grid::SampleType;

/// Expected content of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LercBlockShape {
    pub(super) kind: SampleType,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Samples per pixel.
    pub(super) depth: usize,
}

/// Error message about a blob.
type Fault = String;

/// Decodes `data` into `out`: samples in native byte order, pixel by pixel. Samples outside the mask are NaN,
/// or 0 for integers. Pixels of several samples may have one blob for each.
pub(super) fn decode(data: &[u8], shape: LercBlockShape, out: &mut [u8]) -> Result<(), Fault> {
    match shape.kind {
        SampleType::I8 => decode_as::<i8>(data, shape, 0, out),
        SampleType::U8 => decode_as::<u8>(data, shape, 0, out),
        SampleType::I16 => decode_as::<i16>(data, shape, 0, out),
        SampleType::U16 => decode_as::<u16>(data, shape, 0, out),
        SampleType::I32 => decode_as::<i32>(data, shape, 0, out),
        SampleType::U32 => decode_as::<u32>(data, shape, 0, out),
        SampleType::F32 => decode_as::<f32>(data, shape, f32::NAN, out),
        SampleType::F64 => decode_as::<f64>(data, shape, f64::NAN, out),
        SampleType::F16 => Err(other_type(shape)),
    }
}

fn decode_as<T: Sample + Pod>(
    data: &[u8],
    shape: LercBlockShape,
    void: T,
    out: &mut [u8],
) -> Result<(), Fault> {
    let info = lerc::decode_info(data).map_err(fault_of)?;
    check(&info, shape)?;
    if info.data_type != T::DATA_TYPE {
        return Err(other_type(shape));
    }
    let bands = info.bands as usize;
    // A single blob has the sample order of the block, and is decoded in place if aligned.
    let mut room = Vec::new();
    let own = (bands == 1).then(|| bytemuck::try_cast_slice_mut(out).ok()).flatten();
    let in_place = own.is_some();
    let samples: &mut [T] = match own {
        Some(samples) => samples,
        None => {
            room.resize(shape.width * shape.height * shape.depth, void);
            &mut room
        }
    };
    let found = lerc::decode_into_with_nodata(data, samples, void).map_err(fault_of)?;
    let valid = found.valid_masks.first().map(lerc::bitmask::BitMask::count_valid);
    if valid != Some(info.valid_pixels as usize) {
        return Err("invalid LERC data: mask size differs from the block size".to_owned());
    }
    if in_place {
        return Ok(());
    }
    let size = size_of::<T>();
    // Blobs follow one another band by band.
    for (band, samples) in room.chunks_exact(room.len() / bands).enumerate() {
        let samples = bytemuck::cast_slice::<T, u8>(samples);
        if bands == 1 {
            out.copy_from_slice(samples);
            continue;
        }
        for (to, from) in out.chunks_exact_mut(size * bands).zip(samples.chunks_exact(size)) {
            to[band * size..][..size].copy_from_slice(from);
        }
    }
    Ok(())
}

/// Fails if the blobs do not match the block.
fn check(info: &LercInfo, shape: LercBlockShape) -> Result<(), Fault> {
    let (width, height) = (info.width as usize, info.height as usize);
    let samples = u64::from(info.depth) * u64::from(info.bands);
    // The samples of a pixel are in one blob, or in one blob each.
    let is_one = info.depth == 1 || info.bands == 1;
    if (width, height, samples) == (shape.width, shape.height, shape.depth as u64) && is_one {
        return Ok(());
    }
    Err(format!(
        "LERC data of {width} x {height} pixels with {samples} samples, expected {} x {} with {}",
        shape.width, shape.height, shape.depth
    ))
}

fn other_type(shape: LercBlockShape) -> Fault {
    format!("LERC data type differs from {}", shape.kind.name())
}

fn fault_of(error: LercError) -> Fault {
    format!("LERC: {error}")
}

#[cfg(test)]
mod tests;
