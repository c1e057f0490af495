//! Points with their visual attributes, from files of any format.

use terrane_base::error::Result;
use terrane_base::geom::Point;

use crate::format::PointFormat;
use crate::las::ExtraBytes;
use crate::open::PointCloud;
use crate::point_format::PointFormatConversion;
use crate::raw::Flags;
use crate::source::ReturnCounts;
use crate::source_file::{CloudFile, with_buffers};

/// The point format with all visual attributes.
const FORMAT: u8 = 7;

/// Visual attributes of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointAppearance {
    /// Position in the frame of the cloud.
    pub point: Point,
    /// Return strength.
    pub intensity: u16,
    /// Classification.
    pub class: u8,
    /// Return number from 1, and number of returns; 0 if unknown.
    pub returns: [u8; 2],
    /// Classification flags, with the bits of LAS 1.4.
    pub flags: Flags,
    /// Red, green, blue as stored; 0 if absent.
    pub colour: [u16; 3],
}

/// Reader of visual attributes. Extra bytes, times and waveforms are ignored, so files may differ in them.
pub struct AppearanceReader<'a> {
    cloud: &'a PointCloud,
    format: PointFormat,
    /// One per file.
    conversions: Vec<PointFormatConversion>,
}

impl<'a> AppearanceReader<'a> {
    /// For all files of a cloud.
    ///
    /// # Errors
    /// Unknown point formats.
    pub fn new(cloud: &'a PointCloud) -> Result<Self> {
        let (format, none) = (PointFormat::new(FORMAT)?, ExtraBytes::default());
        let conversions = cloud.kinds().map(|file| {
            let source = match file {
                CloudFile::Las(file) => PointFormat::new(file.header.format)?,
                CloudFile::Text(file) => file.format(),
            };
            Ok(PointFormatConversion::new(source, &none, format, &none))
        });
        let conversions = conversions.collect::<Result<_>>()?;
        Ok(Self { cloud, format, conversions })
    }

    /// Passes on the filtered points of a part in batches. Each lies within the bounds of the cloud.
    ///
    /// # Errors
    /// Errors of [`PointSource::read`](crate::PointSource::read).
    pub fn read(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[PointAppearance]) -> Result<()>,
    ) -> Result<ReturnCounts> {
        let (number, member, inner) = self.cloud.part(part)?;
        let (size, colour) = (self.format.size(), self.format.places().colour.unwrap_or(0));
        let mut points = Vec::new();
        with_buffers(|buffers| {
            let conversion = &self.conversions[number];
            member.convert_records(inner, conversion, false, buffers, &mut |records| {
                points.clear();
                let records = records.chunks_exact(size);
                points.extend(records.map(|record| PointAppearance::of(record, colour)));
                each(&points)
            })
        })
    }
}

impl PointAppearance {
    /// From a LAS 1.4 record with the offset of its colour.
    fn of(record: &[u8], colour: usize) -> Self {
        let [x, y, z] =
            [0, 4, 8].map(|at| i32::from_le_bytes(std::array::from_fn(|i| record[at + i])));
        Self {
            point: Point::new(x, y, z),
            intensity: u16::from_le_bytes([record[12], record[13]]),
            returns: [record[14] & 15, record[14] >> 4],
            flags: Flags(record[15] & 15),
            class: record[16],
            colour: [colour, colour + 2, colour + 4]
                .map(|at| u16::from_le_bytes([record[at], record[at + 1]])),
        }
    }
}
