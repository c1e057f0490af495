//! Sample type, nodata, scale and offset of the output, from the options and the capabilities of the format.
//! The declared nodata value is exactly the stored value of voids.

use super::format::GridWriteRequest;
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::sample::{SampleCodec, SampleRounding, stored_nodata};
use terrane_base::error::{Error, Result};

/// Default nodata value for formats that require one.
const USUAL_NODATA: f64 = -9999.0;

impl GridWriteRequest<'_> {
    /// For formats that store stored values: scale and offset are kept.
    pub(super) fn stored(&self) -> Result<GridInfo> {
        let sample_type = self.options.sample_type.unwrap_or(self.info.sample_type);
        let nodata = self.info.nodata.and_then(|value| {
            // A nodata value outside the type of the input matches no sample, and is kept unchanged.
            let as_is = (sample_type == self.info.sample_type).then_some(value);
            stored_nodata(sample_type, value).or(as_is)
        });
        let info = GridInfo { sample_type, nodata, ..self.info.clone() };
        self.with_nodata(info)
    }

    /// For formats that store heights: scale and offset are applied, and a nodata value is always declared,
    /// `-9999` by default. `sample_type` is the type of the format.
    pub(super) fn heights(&self, sample_type: SampleType) -> Result<GridInfo> {
        let is_plain = (self.info.scale, self.info.offset) == (1.0, 0.0);
        let own = self.info.nodata.filter(|value| is_plain && value.is_finite());
        let nodata = own.and_then(|v| stored_nodata(sample_type, v)).or(Some(USUAL_NODATA));
        let info = GridInfo { sample_type, nodata, scale: 1.0, offset: 0.0, ..self.info.clone() };
        self.with_nodata(info)
    }

    fn with_nodata(&self, info: GridInfo) -> Result<GridInfo> {
        let Some(value) = self.options.nodata else { return Ok(info) };
        match stored_nodata(info.sample_type, value) {
            Some(stored) => Ok(GridInfo { nodata: Some(stored), ..info }),
            None => {
                let name = info.sample_type.name();
                Err(Error::usage(format!("nodata value {value} cannot be stored as {name}"))
                    .remedy("pass a value in the range of the type as ‹out_nodata›"))
            }
        }
    }

    /// Codec from heights to stored values.
    pub(super) fn codec(&self, info: &GridInfo) -> SampleCodec {
        SampleCodec::new(info).rounding(self.rounding())
    }

    pub(super) fn rounding(&self) -> SampleRounding {
        if self.options.round { SampleRounding::Nearest } else { SampleRounding::Exact }
    }
}
