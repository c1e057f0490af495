//! Metadata of a file of a cloud.

use super::column::{PointColumn, columns};
use super::format::PointFormat;
use super::las::{ExtraBytes, LasFile};
use super::source_file::CloudFile;
use super::text::TextFile;
use super::times::GpsTimeEpoch;
use terrane_base::error::{Error, Result};
use terrane_files::{path_of, shown};

/// Metadata of a file.
pub(super) struct CloudFileOrigin<'a> {
    pub(super) name: &'a str,
    /// `None` for text.
    pub(super) las: Option<&'a LasFile>,
    text: Option<&'a TextFile>,
    pub(super) format: PointFormat,
    pub(super) extra: ExtraBytes,
}

impl<'a> CloudFileOrigin<'a> {
    pub(super) fn new(name: &'a str, file: &'a CloudFile) -> Result<Self> {
        match file {
            CloudFile::Las(file) => Self::of(name, file).map_err(|e| e.in_file(&file.path)),
            CloudFile::Text(file) => Ok(Self {
                name,
                las: None,
                text: Some(file),
                format: file.format(),
                extra: ExtraBytes::default(),
            }),
        }
    }

    fn of(name: &'a str, file: &'a LasFile) -> Result<Self> {
        let format = PointFormat::new(file.header.format)?;
        let extra = file.extra.clone();
        Ok(Self { name, las: Some(file), text: None, format, extra })
    }

    /// Columns of its records; for text, the optional columns.
    pub(super) fn columns(&self) -> Vec<PointColumn> {
        match self.text {
            None => columns(self.format, &self.extra.columns(self.format.size())),
            Some(text) => text.columns(),
        }
    }

    pub(super) fn encoding(&self) -> u16 {
        self.las.map_or(0, |file| file.header.encoding)
    }

    /// Epoch of its GPS times.
    pub(super) fn times(&self) -> GpsTimeEpoch {
        let is_standard = self.text.is_some_and(|text| text.is_standard);
        let of_text = if is_standard { GpsTimeEpoch::USUAL } else { GpsTimeEpoch::Week };
        self.las.map_or(of_text, |file| GpsTimeEpoch::of(&file.header))
    }

    pub(super) fn has_time(&self) -> bool {
        match self.text {
            None => self.format.places().time.is_some(),
            Some(text) => text.has_time(),
        }
    }
}

impl GpsTimeEpoch {
    /// Common epoch of all files with times.
    ///
    /// # Errors
    /// Different epochs.
    pub(super) fn of_all(origins: &[CloudFileOrigin<'_>]) -> Result<Self> {
        let mut timed = origins.iter().filter(|origin| origin.has_time());
        let first = timed.next();
        let times = first.map_or(Self::USUAL, CloudFileOrigin::times);
        match (first, timed.find(|origin| origin.times() != times)) {
            (Some(first), Some(other)) => Err(Error::unsupported(format!(
                "its GPS time encoding differs from that of {} (GPS week time or another time offset)",
                shown(first.name)
            ))
            .in_file(&path_of(other.name))
            .remedy("process the files separately, or convert their times")),
            _ => Ok(times),
        }
    }
}
