//! Common content of ESRI and ENVI headers, and their values.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::grid::SampleType;
use crate::strided::StridedLayout;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;

/// Band interleaving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Interleave {
    /// Band interleaved by line.
    Bil,
    /// Band interleaved by pixel.
    Bip,
    /// Band sequential.
    Bsq,
}

impl Interleave {
    pub(super) fn named(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "bil" => Some(Self::Bil),
            "bip" => Some(Self::Bip),
            "bsq" => Some(Self::Bsq),
            _ => None,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Bil => "BIL",
            Self::Bip => "BIP",
            Self::Bsq => "BSQ",
        }
    }
}

/// Content of a header.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawRasterHeader {
    pub(super) kind: &'static str,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) bands: u32,
    pub(super) sample_type: SampleType,
    pub(super) big_endian: bool,
    pub(super) interleave: Interleave,
    /// Bytes before the first sample.
    pub(super) skip: u64,
    /// Bytes of a row of one band, with padding, if declared.
    pub(super) band_row_bytes: Option<u64>,
    /// Bytes of a row of all bands, with padding, if declared.
    pub(super) total_row_bytes: Option<u64>,
    /// Gap between consecutive bands in bytes.
    pub(super) band_gap_bytes: u64,
    pub(super) transform: Option<Affine>,
    pub(super) nodata: Option<f64>,
    /// Height = stored * scale + offset, by band.
    pub(super) scale: Vec<f64>,
    pub(super) offset: Vec<f64>,
    pub(super) crs: Crs,
}

impl RawRasterHeader {
    /// Layout of the samples of band `band` (from 1); `None` on overflow.
    pub(super) fn layout(&self, band: u32) -> Option<StridedLayout> {
        let size = self.sample_type.bytes() as u64;
        let (width, bands) = (u64::from(self.width), u64::from(self.bands));
        let before = u64::from(band) - 1;
        let band_row = self.band_row_bytes.unwrap_or(width * size);
        let (col_pitch, row_pitch, band_pitch) = match self.interleave {
            Interleave::Bil => {
                let total = match self.total_row_bytes {
                    Some(total) => total,
                    None => band_row.checked_mul(bands)?,
                };
                (size, total, band_row)
            }
            Interleave::Bip => {
                (size * bands, self.total_row_bytes.unwrap_or(width * size * bands), size)
            }
            Interleave::Bsq => {
                let plane = band_row.checked_mul(u64::from(self.height))?;
                (size, band_row, plane.checked_add(self.band_gap_bytes)?)
            }
        };
        let offset = self.skip.checked_add(band_pitch.checked_mul(before)?)?;
        Some(StridedLayout { offset, col_pitch, row_pitch, big_endian: self.big_endian })
    }

    /// Possible file lengths: up to the last sample, with the padding of the last row, or with the gap after
    /// its band. `None` on overflow.
    pub(super) fn lengths(&self) -> Option<[u64; 3]> {
        let last = self.layout(self.bands)?;
        let end = last.end(self.width, self.height, self.sample_type.bytes())?;
        let rows = last.row_pitch.checked_mul(self.height.into())?;
        let start = if self.interleave == Interleave::Bsq { last.offset } else { self.skip };
        let full = start.checked_add(rows)?;
        Some([end, full, full.checked_add(self.band_gap_bytes)?])
    }

    /// True if rows have no padding.
    pub(super) fn is_dense(&self) -> bool {
        let row = u64::from(self.width) * self.sample_type.bytes() as u64;
        self.band_row_bytes.is_none_or(|bytes| bytes == row)
            && self.total_row_bytes.is_none_or(|bytes| bytes == row * u64::from(self.bands))
    }

    /// Fails if declared row lengths are shorter than a row.
    pub(super) fn check_rows(&self) -> Result<()> {
        let row = u64::from(self.width) * self.sample_type.bytes() as u64;
        let all = row * u64::from(self.bands);
        for (name, stated, least) in [
            ("BANDROWBYTES", self.band_row_bytes, row),
            ("TOTALROWBYTES", self.total_row_bytes, all),
        ] {
            if let Some(stated) = stated
                && stated < least
            {
                return Err(Error::bad_input(format!(
                    "{name} is {stated}, less than the {least} bytes of a row"
                )));
            }
        }
        Ok(())
    }
}

/// A size from a header, from 1 to `most`.
pub(super) fn count(key: &str, value: &str, most: u64) -> Result<u32> {
    let number = whole(key, value)?;
    limits::check(key, number, most)?;
    match u32::try_from(number) {
        Ok(number) if number > 0 => Ok(number),
        _ => Err(Error::bad_input(format!("{key} is {value}, expected a positive integer"))),
    }
}

/// An integer of a header, also in decimal notation ("20.0").
pub(super) fn whole(key: &str, value: &str) -> Result<u64> {
    if let Ok(integer) = value.parse() {
        return Ok(integer);
    }
    match value.parse::<f64>() {
        // Below 1e15 the conversion is exact.
        Ok(number) if number >= 0.0 && number.fract() == 0.0 && number < 1e15 => Ok(number as u64),
        _ => Err(Error::bad_input(format!("{key} is {value:?}, expected an integer"))),
    }
}

/// Values by key; conflicting duplicates are rejected, because programs disagree on which one applies.
pub(super) fn once<V: PartialEq>(
    pairs: impl Iterator<Item = (String, V)>,
) -> Result<HashMap<String, V>> {
    let mut values = HashMap::new();
    for (key, value) in pairs {
        match values.entry(key) {
            Entry::Occupied(known) if *known.get() != value => {
                let key = known.key();
                return Err(Error::bad_input(format!("conflicting values of {key} in the header"))
                    .remedy("remove the wrong line"));
            }
            Entry::Occupied(_) => {}
            Entry::Vacant(new) => drop(new.insert(value)),
        }
    }
    Ok(values)
}

/// A number from a header.
pub(super) fn number(key: &str, value: &str) -> Result<f64> {
    value.parse().map_err(|_| Error::bad_input(format!("{key} is {value:?}, expected a number")))
}
