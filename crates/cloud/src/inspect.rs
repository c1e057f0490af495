//! Inspection of files: points with the attributes of reports, and the statements of headers.

use terrane_base::error::Result;
use terrane_base::geom::Crs;

use crate::filter::FilterRecord;
use crate::las::LegacyCounts;
use crate::open::PointCloud;
use crate::source::ReturnCounts;

/// A point with the attributes of reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InspectedPoint<'a> {
    /// Position, class, returns and flags.
    pub record: &'a FilterRecord,
    /// Intensity.
    pub intensity: u16,
    /// Scan angle in degrees.
    pub angle: f64,
    /// Point source id: file or flight line.
    pub line: u16,
    /// GPS time, if the point format has it.
    pub time: Option<f64>,
}

/// What the header of a file states.
#[derive(Clone, Debug)]
pub struct StatedHeader<'a> {
    /// Name of the file.
    pub name: &'a str,
    /// CRS of the file.
    pub crs: &'a Crs,
    /// Point format; that of text files follows from their columns.
    pub format: u8,
    /// Seconds from the start of GPS time (1980-01-06) to time 0; `None` for seconds of a week.
    pub time_offset: Option<f64>,
    /// What only LAS and LAZ files state.
    pub las: Option<StatedLas<'a>>,
}

/// What the header of a LAS file states.
#[derive(Clone, Copy, Debug)]
pub struct StatedLas<'a> {
    /// LAS version.
    pub version: [u8; 2],
    /// Number of points.
    pub points: u64,
    /// Points by return, from the first: 5, or 15 from LAS 1.4.
    pub returns: &'a [u64],
    /// Legacy counts, from LAS 1.4.
    pub legacy: Option<&'a LegacyCounts>,
    /// Lowest and highest coordinates.
    pub bounds: [[f64; 3]; 2],
    /// Scale of the coordinates.
    pub scale: [f64; 3],
    /// Day of the year, and year.
    pub created: [u16; 2],
}

impl PointCloud {
    /// Headers of its files, in their order.
    ///
    /// # Errors
    /// An unknown point format.
    pub fn headers(&self) -> Result<Vec<StatedHeader<'_>>> {
        self.origins()
            .zip(self.kinds())
            .map(|(origin, file)| {
                let origin = origin?;
                let las = origin.las.map(|las| StatedLas {
                    version: las.header.version,
                    points: las.header.count,
                    returns: &las.header.returns,
                    legacy: las.header.legacy.as_ref(),
                    bounds: [las.header.low, las.header.high],
                    scale: las.header.scale,
                    created: las.header.created,
                });
                Ok(StatedHeader {
                    name: origin.name,
                    crs: file.crs(),
                    format: origin.format.number(),
                    time_offset: origin.times().offset(),
                    las,
                })
            })
            .collect()
    }

    /// As [`records`](Self::records), with more attributes.
    ///
    /// # Errors
    /// As [`records`](Self::records).
    pub fn inspect(
        &self,
        part: usize,
        each: &mut dyn FnMut(&InspectedPoint<'_>),
    ) -> Result<ReturnCounts> {
        let (_, member, inner) = self.part(part)?;
        let (format, has_time) = member.file.attributes()?;
        // Thousandths of a degree: the step of newer formats is 0.006.
        let step = if format.is_new() { 6.0 } else { 1000.0 };
        let time_at = format.time_at().filter(|_| has_time);
        member.records(inner, true, &mut |record, bytes| {
            let time = time_at.and_then(|at| bytes.get(at..at + 8)?.first_chunk());
            each(&InspectedPoint {
                record,
                intensity: u16::from_le_bytes([bytes[12], bytes[13]]),
                angle: f64::from(format.angle(bytes)) * step / 1000.0,
                line: format.source(bytes),
                time: time.map(|bytes| f64::from_le_bytes(*bytes)),
            });
        })
    }
}
