//! Points with what there is to see of them, from files of any format.

use terrane_base::error::Result;
use terrane_base::geom::Point;

use crate::format::PointFormat;
use crate::las::ExtraBytes;
use crate::member::{CloudFile, take_room};
use crate::open::PointCloud;
use crate::raw::Flags;
use crate::recast::Recast;
use crate::source::PointCensus;

/// The format that has a field for all that is seen.
const FORMAT: u8 = 7;

/// What there is to see of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointAppearance {
    /// In steps of the cloud's frame.
    pub point: Point,
    /// Strength of the return.
    pub intensity: u16,
    /// Classification.
    pub class: u8,
    /// Number of the return from 1, and returns of the pulse; 0 where unknown.
    pub returns: [u8; 2],
    /// Marks, by the bits of LAS 1.4.
    pub flags: Flags,
    /// Red, green, blue, as they are stored; 0 where the file has none.
    pub colour: [u16; 3],
}

/// Reads what is seen of a cloud. Extra bytes, times and waveforms are not looked at, so files that differ in them
/// are one cloud all the same.
pub struct AppearanceReader<'a> {
    cloud: &'a PointCloud,
    format: PointFormat,
    /// By file.
    recasts: Vec<Recast>,
}

impl<'a> AppearanceReader<'a> {
    /// Of all files of a cloud.
    ///
    /// # Errors
    /// A file of a point format that does not exist.
    pub fn new(cloud: &'a PointCloud) -> Result<Self> {
        let (format, none) = (PointFormat::new(FORMAT)?, ExtraBytes::default());
        let recast = |file: &CloudFile| {
            let own = match file {
                CloudFile::Las(file) => PointFormat::new(file.header.format)?,
                CloudFile::Text(file) => file.format(),
            };
            Ok(Recast::new((own, &none), (format, &none)))
        };
        Ok(Self { cloud, format, recasts: cloud.kinds().map(recast).collect::<Result<_>>()? })
    }

    /// Hands on the wanted points of a part, as many at a time as come. Each lies within the bounds of the cloud.
    ///
    /// # Errors
    /// Those of [`PointSource::read`](crate::PointSource::read).
    pub fn read(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[PointAppearance]) -> Result<()>,
    ) -> Result<PointCensus> {
        let (number, member, inner) = self.cloud.part(part)?;
        let (size, colour) = (self.format.size(), self.format.places().colour.unwrap_or(0));
        let mut seen = Vec::new();
        let mut take = |records: &[u8]| {
            seen.clear();
            seen.extend(
                records.chunks_exact(size).map(|record| PointAppearance::of(record, colour)),
            );
            each(&seen)
        };
        take_room(|room| member.carry(inner, (&self.recasts[number], false), room, &mut take))
    }
}

impl PointAppearance {
    /// From a record of a format of LAS 1.4 whose colour is there.
    fn of(record: &[u8], colour: usize) -> Self {
        let four = |at: usize| i32::from_le_bytes(std::array::from_fn(|i| record[at + i]));
        let two = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
        Self {
            point: Point::new(four(0), four(4), four(8)),
            intensity: two(12),
            returns: [record[14] & 15, record[14] >> 4],
            flags: Flags(record[15] & 15),
            class: record[16],
            colour: [0, 2, 4].map(|i| two(colour + i)),
        }
    }
}
