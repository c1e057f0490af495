//! Conversion of the records of a point cloud to one point format, with all attributes.
//!
//! Records are converted byte by byte. Files with a common lattice keep their stored integers. A value that the
//! output cannot store is an error.

use std::collections::HashSet;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, PointFrame};
use terrane_files::{RawFile, path_of, shown};

use crate::column::{PointColumn, PointLineFormatter, columns};
use crate::format::PointFormat;
use crate::las::{ExtraBytes, LASZIP, LasFile, OCTREE, PROJECTION, VlrHeader, extra};
use crate::open::PointCloud;
use crate::origin::CloudFileOrigin;
use crate::point_format::PointFormatConversion;
use crate::source::{CloudInfo, ReturnCounts};
use crate::source_file::with_buffers;
use crate::times::GpsTimeEpoch;
use crate::version::{LasVersion, PointPacking};
use crate::write::{CloudWriteOptions, CopiedMetadata, Vlr};

/// Numbers of [`extra::USER`] records: superseded ones, and waveform packet descriptors, followed by the record with
/// the waveform data.
const SUPERSEDED: u16 = 7;
const WAVES: std::ops::RangeInclusive<u16> = 100..=354;
const WAVE_DATA: u16 = 65_535;
/// Bits of the global encoding: internal waveforms, external waveforms, synthetic return numbers.
const WAVES_INSIDE: u16 = 2;
const WAVES_BESIDE: u16 = 4;
const MADE_RETURNS: u16 = 8;
/// Maximum bytes of all copied VLRs.
const MAX_BYTES: u64 = 64 << 20;

/// Requested output format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LasOutputFormat {
    /// Point format; if `None`, the first one with all fields of all files.
    pub format: Option<PointFormat>,
    /// LAS version; if `None`, the first one with the point format.
    pub version: Option<LasVersion>,
    /// Storage of the points.
    pub packing: PointPacking,
}

impl LasOutputFormat {
    /// Point format and version for files of this format.
    ///
    /// # Errors
    /// Unsupported combinations of format, version and packing.
    fn choose_format(&self, held: PointFormat) -> Result<(PointFormat, LasVersion)> {
        let Self { version, packing, .. } = *self;
        let held = version.map_or(held, |version| version.holding(held));
        let format = match self.format {
            Some(asked) => packing.check(asked).map(|()| asked)?,
            None => packing.holding(held)?,
        };
        version.map_or(Ok(()), |version| version.check(format, packing))?;
        Ok((format, version.unwrap_or(LasVersion::of(format))))
    }
}

/// Converter of the points of a cloud to one point format.
pub struct PointFormatConverter<'a> {
    cloud: &'a PointCloud,
    info: CloudInfo,
    as_stored: bool,
    format: PointFormat,
    version: LasVersion,
    extra: ExtraBytes,
    carried: CopiedMetadata,
    /// One per file.
    conversions: Vec<PointFormatConversion>,
    /// Added dimensions: names and offsets in a record.
    added: Vec<(String, usize)>,
    notes: Vec<String>,
}

/// A dimension that a job adds to the records, and fills later.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewDimension {
    /// Its name, of at most 32 bytes, compared in any letter case.
    pub name: String,
    /// Its description, of at most 32 bytes.
    pub about: String,
    /// How its values are stored.
    pub value: NewDimensionValue,
    /// Whether a dimension of this name that the files have is kept instead; otherwise it is replaced.
    pub is_kept: bool,
}

/// How the values of an added dimension are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewDimensionValue {
    /// Steps of heights (`i32`); the minimum is nodata.
    HeightSteps,
    /// Whole numbers (`u32`); 0 is nodata.
    Whole,
    /// Numbers (`f32`); NaN is nodata.
    Single,
    /// Numbers (`f64`); NaN is nodata.
    Double,
}

impl NewDimension {
    /// A dimension of numbers.
    pub fn new(name: &str, about: &str, value: NewDimensionValue) -> Self {
        Self { name: name.to_owned(), about: about.to_owned(), value, is_kept: false }
    }
}

impl<'a> PointFormatConverter<'a> {
    /// A converter for records of a file, which get some more dimensions.
    ///
    /// # Errors
    /// Files whose times, waveforms or extra bytes cannot be merged; internal waveforms; unsupported combinations of
    /// format and packing.
    pub fn new(
        cloud: &'a PointCloud,
        target: LasOutputFormat,
        dimensions: &[NewDimension],
    ) -> Result<Self> {
        let origins = cloud.origins().collect::<Result<Vec<_>>>()?;
        let common = origins.iter().map(|origin| origin.format).reduce(PointFormat::holding);
        let (format, version) = target.choose_format(common.unwrap_or_default())?;
        let packing = target.packing;
        let (info, as_stored) = cloud.as_stored();
        let mut extra = ExtraBytes::of_all(&origins)?;
        // Before the conversions, which move extra bytes to where they are among all of them.
        let is_new = |new: &&NewDimension| !(new.is_kept && extra.has(&new.name));
        let dimensions: Vec<_> = dimensions.iter().filter(is_new).collect();
        dimensions.iter().for_each(|dimension| extra.remove(&dimension.name));
        let added = dimensions.into_iter().map(|new| {
            (new.name.clone(), format.size() + extra.push_new(new, info.frame.scale[2]))
        });
        let added = added.collect();
        let (vlrs, mut notes) = records(&origins, format)?;
        let conversions = origins
            .iter()
            .map(|origin| PointFormatConversion::new(origin.format, &origin.extra, format, &extra));
        let conversions = conversions.collect();
        let only = match origins.as_slice() {
            [CloudFileOrigin { las: Some(file), .. }] => Some(&file.header),
            _ => None,
        };
        let times = GpsTimeEpoch::of_all(&origins)?;
        notes.extend(times.note(packing));
        let has_time = packing != PointPacking::Text && format.time_at().is_some();
        let (time, time_offset) = times.written(version, has_time)?;
        let carried = CopiedMetadata {
            encoding: time | encoding(&origins, format),
            time_offset,
            source: only.map_or(0, |header| header.source),
            system: only.map_or_else(String::new, |header| header.system.clone()),
            extra_bytes: fitting(format, &extra)?,
            vlrs: described(&extra).into_iter().chain(vlrs).collect(),
        };
        if format.has_waves() && packing != PointPacking::Text {
            notes.extend(waves(&origins)?);
        }
        notes.extend(left_out(&origins, format, packing));
        if packing == PointPacking::Text && extra.has_others() {
            notes.push("extra bytes that are not numbers are left out".to_owned());
        }
        Ok(Self {
            cloud,
            info,
            as_stored,
            format,
            version,
            extra,
            carried,
            conversions,
            added,
            notes,
        })
    }

    /// Point format of the records.
    pub fn format(&self) -> PointFormat {
        self.format
    }

    /// Extent and frame of the records: the common lattice of the files, else the frame of the cloud.
    pub fn info(&self) -> &CloudInfo {
        &self.info
    }

    /// Offset in steps from the frame of the cloud, in which all methods work, to the records.
    pub fn shift(&self) -> [i32; 3] {
        self.cloud.stored_by()
    }

    /// Bytes of a record.
    pub fn size(&self) -> usize {
        self.format.size() + self.extra_bytes()
    }

    /// Number of extra bytes of a record.
    pub fn extra_bytes(&self) -> usize {
        self.carried.extra_bytes.into()
    }

    /// Offset of an added dimension in a record.
    pub fn added_at(&self, name: &str) -> Option<usize> {
        self.added.iter().find(|(added, _)| added.eq_ignore_ascii_case(name)).map(|(_, at)| *at)
    }

    /// Options of a file with these records, or with the records in another frame and CRS.
    pub fn file(&self, frame: PointFrame, crs: Crs) -> CloudWriteOptions {
        let (version, carried) = (self.version, self.carried.clone());
        CloudWriteOptions { version, carried, ..CloudWriteOptions::new(self.format, frame, crs) }
    }

    /// Formatter of the records as text lines in a frame.
    pub fn lines(&self, frame: &PointFrame) -> PointLineFormatter {
        let extra = self.extra.columns(self.format.size());
        PointLineFormatter::new(self.format, frame, &extra, self.size())
    }

    /// Columns of the records except the coordinates: names and offsets.
    pub fn columns(&self) -> Vec<PointColumn> {
        columns(self.format, &self.extra.columns(self.format.size()))
    }

    /// Notes on lost or changed data.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Passes on the filtered records of a part in batches; positions are in the frame of [`info`](Self::info).
    ///
    /// # Errors
    /// Errors of [`PointSource::read`](crate::PointSource::read); values that the format cannot store.
    pub fn read(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<ReturnCounts> {
        let (number, member, inner) = self.cloud.part(part)?;
        let conversion = &self.conversions[number];
        with_buffers(|buffers| {
            member.convert_records(inner, conversion, self.as_stored, buffers, each)
        })
    }
}

impl ExtraBytes {
    fn of_all(origins: &[CloudFileOrigin<'_>]) -> Result<Self> {
        let Some((first, others)) = origins.split_first() else { return Ok(Self::default()) };
        let mut all = first.extra.clone();
        for origin in others {
            all = all.and(&origin.extra).map_err(|e| e.in_file(&path_of(origin.name)))?;
        }
        Ok(all)
    }
}

/// Number of extra bytes, checked against the record length.
fn fitting(format: PointFormat, extra: &ExtraBytes) -> Result<u16> {
    let (bytes, most) = (extra.bytes(), usize::from(u16::MAX) - format.size());
    if bytes <= most {
        return Ok(bytes as u16);
    }
    Err(Error::unsupported(format!(
        "the extra bytes of all files ({bytes}) exceed the record limit of {most}"
    ))
    .remedy("process some of the files separately"))
}

fn described(extra: &ExtraBytes) -> Option<Vlr> {
    let data = extra.described()?;
    Some(Vlr { user: extra::USER.into(), number: extra::NUMBER, about: "Extra bytes".into(), data })
}

/// Bits of the global encoding that are set in all files, except those of times.
fn encoding(origins: &[CloudFileOrigin<'_>], format: PointFormat) -> u16 {
    let all = origins.iter().fold(0, |all, origin| all | origin.encoding());
    let waves = if format.has_waves() { WAVES_BESIDE } else { 0 };
    all & (MADE_RETURNS | waves)
}

/// Note on external waveforms.
///
/// # Errors
/// External waveforms of several files.
fn waves(origins: &[CloudFileOrigin<'_>]) -> Result<Option<String>> {
    let mut waved = origins.iter().filter(|origin| origin.encoding() & WAVES_BESIDE > 0);
    let Some(first) = waved.next() else { return Ok(None) };
    match waved.next() {
        Some(other) => Err(Error::unsupported(format!(
            "merging waveforms of several files is not supported (the first is {})",
            shown(first.name)
        ))
        .in_file(&path_of(other.name))
        .remedy("process the files separately, or drop waveforms with ‹point_format› 6")),
        None => Ok(Some(format!(
            "waveforms are not copied; copy the .wdp file of {} to the output name with extension .wdp",
            shown(first.name)
        ))),
    }
}

/// The copied VLRs, and a note on others.
fn records(
    origins: &[CloudFileOrigin<'_>],
    format: PointFormat,
) -> Result<(Vec<Vlr>, Vec<String>)> {
    let mut by_file = Vec::new();
    for (origin, file) in origins.iter().filter_map(|origin| Some((origin, origin.las?))) {
        let found = of_file(file, format).map_err(|e| e.in_file(&path_of(origin.name)))?;
        by_file.push(found);
    }
    let Some((mut shared, others)) = by_file.split_first_mut().map(|(a, b)| (std::mem::take(a), b))
    else {
        return Ok(Default::default());
    };
    let mut differing = HashSet::new();
    for other in others {
        differing.extend(other.iter().filter(|record| !shared.contains(record)).map(Vlr::name));
        differing.extend(shared.iter().filter(|record| !other.contains(record)).map(Vlr::name));
        shared.retain(|record| other.contains(record));
    }
    // A hash set has another order in each run, which the note would show.
    let mut differing: Vec<_> = differing.into_iter().collect();
    differing.sort();
    if differing
        .iter()
        .any(|name| WAVES.clone().any(|number| *name == format!("{} {number}", extra::USER)))
    {
        return Err(Error::unsupported("the waveform packet descriptors of the files differ")
            .remedy("process the files separately, or drop waveforms with ‹point_format› 6"));
    }
    let note = (!differing.is_empty())
        .then(|| format!("VLRs that differ between files are left out: {}", differing.join(", ")));
    Ok((shared, note.into_iter().collect()))
}

/// The VLRs of a file, except those that are written anew.
fn of_file(file: &LasFile, format: PointFormat) -> Result<Vec<Vlr>> {
    if format.has_waves() && file.header.encoding & WAVES_INSIDE > 0 {
        return Err(Error::unsupported("writing internal waveform data is not supported")
            .remedy("drop waveforms with ‹point_format› 6, or 7 with colours"));
    }
    let mut left = MAX_BYTES;
    let copied = file.vlrs.iter().filter(|vlr| is_copied(vlr, format));
    let raw = file.reopen()?;
    copied.map(|vlr| data(vlr, &raw, &mut left)).collect()
}

/// Whether a VLR is copied to files of a format.
fn is_copied(vlr: &VlrHeader, format: PointFormat) -> bool {
    let is_wave = vlr.user == extra::USER && WAVES.contains(&vlr.id);
    let is_data = vlr.is(extra::USER, WAVE_DATA) || vlr.is(extra::USER, SUPERSEDED);
    let is_rewritten =
        vlr.is(LASZIP.0, LASZIP.1) || vlr.is(extra::USER, extra::NUMBER) || vlr.user == OCTREE;
    !is_data && !is_rewritten && vlr.user != PROJECTION && (format.has_waves() || !is_wave)
}

fn data(vlr: &VlrHeader, file: &RawFile, left: &mut u64) -> Result<Vlr> {
    // Before it is read: headers of damaged files may state any length.
    *left = left.checked_sub(vlr.bytes).ok_or_else(|| {
        Error::unsupported(format!("its VLRs exceed {} MiB", MAX_BYTES >> 20))
            .remedy("remove the largest VLRs")
    })?;
    let data = vlr.data(file)?;
    Ok(Vlr { user: vlr.user.clone(), number: vlr.id, about: vlr.description.clone(), data })
}

/// The fields of any file that the format does not have.
fn lost_fields(
    origins: &[CloudFileOrigin<'_>],
    format: PointFormat,
    packing: PointPacking,
) -> Vec<&'static str> {
    let target = format.places();
    let has_no_waves = target.wave.is_none() || packing == PointPacking::Text;
    let any = |has: fn(&CloudFileOrigin<'_>) -> bool| origins.iter().any(has);
    let fields = [
        ("times", target.time.is_none() && any(|origin| origin.has_time())),
        (
            "colours",
            target.colour.is_none() && any(|origin| origin.format.places().colour.is_some()),
        ),
        (
            "infrared",
            target.infrared.is_none() && any(|origin| origin.format.places().infrared.is_some()),
        ),
        ("waveforms", has_no_waves && any(|origin| origin.format.places().wave.is_some())),
        (
            "fractions of scan angles",
            !format.is_new() && any(|origin| origin.las.is_some() && origin.format.is_new()),
        ),
    ];
    fields.into_iter().filter_map(|(name, is_lost)| is_lost.then_some(name)).collect()
}

/// Notes on fields that the format does not have.
fn left_out(
    origins: &[CloudFileOrigin<'_>],
    format: PointFormat,
    packing: PointPacking,
) -> Vec<String> {
    let lost = lost_fields(origins, format, packing).join(", ");
    let note = match packing {
        PointPacking::Text => format!("{lost} are left out"),
        _ => {
            format!("point format {} has no field for {lost}, which are left out", format.number())
        }
    };
    (!lost.is_empty()).then_some(note).into_iter().collect()
}
