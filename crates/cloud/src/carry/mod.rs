//! Points with all that is known of them, from the files of a cloud into one format: what an output is to be, and
//! the records of each part.
//!
//! A record goes from format to format byte by byte. Where files share a lattice it keeps the whole numbers it is
//! stored with. A value that has no place in the output is an error.

mod seen;

use std::collections::HashSet;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, PointFrame};
use terrane_files::{RawFile, path_of, shown};

use crate::column::{PointColumn, PointLineFormatter, columns};
use crate::format::PointFormat;
use crate::las::{ExtraBytes, LASZIP, LasFile, OCTREE, PROJECTION, VlrHeader, extra};
use crate::member::take_room;
use crate::open::PointCloud;
use crate::origin::CloudFileOrigin;
use crate::recast::Recast;
use crate::source::{CloudInfo, PointCensus};
use crate::times::GpsTimeEpoch;
use crate::version::{LasVersion, PointPacking};
use crate::write::{CarriedMetadata, CloudWriteOptions, Vlr};
pub use seen::{AppearanceReader, PointAppearance};

/// Numbers of records of [`extra::USER`]: records that are no longer valid, and descriptions of waveforms, which
/// are followed by one that holds the waveforms themselves.
const SUPERSEDED: u16 = 7;
const WAVES: std::ops::RangeInclusive<u16> = 100..=354;
const WAVE_DATA: u16 = 65_535;
/// Bits of the global encoding: waveforms are in the file, or in one beside it; returns were made up.
const WAVES_INSIDE: u16 = 2;
const WAVES_BESIDE: u16 = 4;
const MADE_RETURNS: u16 = 8;
/// Most bytes of the records that are carried.
const MOST_BYTES: u64 = 64 << 20;

/// What points are to be in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LasOutputFormat {
    /// The format of records; the first that holds all fields of all files when `None`.
    pub format: Option<PointFormat>,
    /// The version of LAS; the first that has points of the format when `None`.
    pub version: Option<LasVersion>,
    /// How the file is packed.
    pub packing: PointPacking,
}

impl LasOutputFormat {
    /// The format and version for files of such formats.
    ///
    /// # Errors
    /// A format that cannot be so packed, or a version that does not have it.
    fn choose(&self, held: PointFormat) -> Result<(PointFormat, LasVersion)> {
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

/// How the points of a cloud get into a file of one format.
pub struct PointFormatConverter<'a> {
    cloud: &'a PointCloud,
    info: CloudInfo,
    as_stored: bool,
    format: PointFormat,
    version: LasVersion,
    extra: ExtraBytes,
    carried: CarriedMetadata,
    /// By file.
    recasts: Vec<Recast>,
    /// Where a record has its height above the ground.
    heights: Option<usize>,
    notes: Vec<String>,
}

/// The dimension of heights above the ground, by the name that others have for it.
const HEIGHTS: (&str, &str) = ("HeightAboveGround", "Height above ground");

impl<'a> PointFormatConverter<'a> {
    /// For records of a file to be written. They have a dimension for heights above the ground where so told, which
    /// are not known yet.
    ///
    /// # Errors
    /// Files whose times, waveforms or extra bytes cannot be in one file; waveforms inside of a file; a format that
    /// cannot be so packed.
    pub fn new(cloud: &'a PointCloud, target: LasOutputFormat, has_heights: bool) -> Result<Self> {
        let origins = cloud.origins().collect::<Result<Vec<_>>>()?;
        let held = origins.iter().map(|origin| origin.format).reduce(PointFormat::holding);
        let (format, version) = target.choose(held.unwrap_or_default())?;
        let packing = target.packing;
        let (info, as_stored) = cloud.as_stored();
        let mut extra = ExtraBytes::of_all(&origins)?;
        // Before the recasts, which move extra bytes to where they are among all of them.
        let heights = has_heights.then(|| {
            let (name, about) = HEIGHTS;
            format.size() + extra.put_steps(name, about, info.frame.scale[2])
        });
        let (vlrs, mut notes) = records(&origins, format)?;
        let recast = |origin: &CloudFileOrigin<'_>| {
            Recast::new((origin.format, &origin.extra), (format, &extra))
        };
        let recasts = origins.iter().map(recast).collect();
        let only = match origins.as_slice() {
            [CloudFileOrigin { las: Some(file), .. }] => Some(&file.header),
            _ => None,
        };
        let times = GpsTimeEpoch::of_all(&origins)?;
        notes.extend(times.note(packing));
        let has_time = packing != PointPacking::Text && format.time_at().is_some();
        let (time, time_offset) = times.written(version, has_time)?;
        let carried = CarriedMetadata {
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
            notes.push("extra bytes that are no numbers are left out".to_owned());
        }
        Ok(Self {
            cloud,
            info,
            as_stored,
            format,
            version,
            extra,
            carried,
            recasts,
            heights,
            notes,
        })
    }

    /// The format of the records.
    pub fn format(&self) -> PointFormat {
        self.format
    }

    /// Where the records lie: in the lattice of the files, where they have one, and else in the frame of the cloud.
    pub fn info(&self) -> &CloudInfo {
        &self.info
    }

    /// How many steps records are from where their points are in the frame of the cloud, in which all methods work.
    pub fn shift(&self) -> [i32; 3] {
        self.cloud.stored_by()
    }

    /// Bytes of a record.
    pub fn size(&self) -> usize {
        self.format.size() + self.extra_bytes()
    }

    /// How many of these are extra bytes.
    pub fn extra_bytes(&self) -> usize {
        self.carried.extra_bytes.into()
    }

    /// Where a record has its height above the ground, in steps of heights (`i32`; the least stands for none).
    pub fn heights_at(&self) -> Option<usize> {
        self.heights
    }

    /// A file with these records, or with them as they are in another frame and system.
    pub fn file(&self, frame: PointFrame, crs: Crs) -> CloudWriteOptions {
        let (version, carried) = (self.version, self.carried.clone());
        CloudWriteOptions { version, carried, ..CloudWriteOptions::new(self.format, frame, crs) }
    }

    /// Their lines of text, as they are in a frame.
    pub fn lines(&self, frame: &PointFrame) -> PointLineFormatter {
        let extra = self.extra.columns(self.format.size());
        PointLineFormatter::new(self.format, frame, &extra, self.size())
    }

    /// What their fields are called, and where they are; the coordinates are not among them.
    pub fn columns(&self) -> Vec<PointColumn> {
        columns(self.format, &self.extra.columns(self.format.size()))
    }

    /// What is left out, or is not as in the files, one line each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Hands on the records of the wanted points of a part, as many at a time as come; places are those of
    /// [`info`](Self::info).
    ///
    /// # Errors
    /// Those of [`PointSource::read`](crate::PointSource::read); what the format cannot hold of a point.
    pub fn read(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<PointCensus> {
        let (number, member, inner) = self.cloud.part(part)?;
        let recast = &self.recasts[number];
        take_room(|room| member.carry(inner, (recast, self.as_stored), room, each))
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

/// The extra bytes, where a record can have so many.
fn fitting(format: PointFormat, extra: &ExtraBytes) -> Result<u16> {
    let (bytes, most) = (extra.bytes(), usize::from(u16::MAX) - format.size());
    if bytes <= most {
        return Ok(bytes as u16);
    }
    Err(Error::unsupported(format!(
        "the files have {bytes} extra bytes together, and a record may have {most}"
    ))
    .remedy("write some of them on their own"))
}

fn described(extra: &ExtraBytes) -> Option<Vlr> {
    let data = extra.described()?;
    Some(Vlr { user: extra::USER.into(), number: extra::NUMBER, about: "Extra bytes".into(), data })
}

/// The bits of the global encoding that hold for all files, but for those of times.
fn encoding(origins: &[CloudFileOrigin<'_>], format: PointFormat) -> u16 {
    let all = origins.iter().fold(0, |all, origin| all | origin.encoding());
    let waves = if format.has_waves() { WAVES_BESIDE } else { 0 };
    all & (MADE_RETURNS | waves)
}

/// What is to be said of waveforms, which are in a file beside that of the points, at places that these know.
///
/// # Errors
/// Waveforms of several files: each has its own.
fn waves(origins: &[CloudFileOrigin<'_>]) -> Result<Option<String>> {
    let mut waved = origins.iter().filter(|origin| origin.encoding() & WAVES_BESIDE > 0);
    let Some(first) = waved.next() else { return Ok(None) };
    match waved.next() {
        Some(other) => Err(Error::unsupported(format!(
            "its waveforms are in a file of their own, as those of {} are, and points of both cannot be in one file",
            shown(first.name)
        ))
        .in_file(&path_of(other.name))
        .remedy("write them on their own, or leave waveforms out with ‹point_format› 6")),
        None => Ok(Some(format!(
            "waveforms stay where they are, in the .wdp file beside {}: copy it to the name of the output with .wdp",
            shown(first.name)
        ))),
    }
}

/// The records that are carried, and what is to be said of others.
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
    let mut parted = HashSet::new();
    for other in others {
        let is_there = |record: &Vlr, all: &[Vlr]| all.contains(record);
        parted.extend(other.iter().filter(|r| !is_there(r, &shared)).map(Vlr::name));
        parted.extend(shared.iter().filter(|r| !is_there(r, other)).map(Vlr::name));
        shared.retain(|record| is_there(record, other));
    }
    // A hash set has another order in each run, which the note would show.
    let mut parted: Vec<_> = parted.into_iter().collect();
    parted.sort();
    if parted
        .iter()
        .any(|name| WAVES.clone().any(|number| *name == format!("{} {number}", extra::USER)))
    {
        return Err(Error::unsupported("the files describe their waveforms differently")
            .remedy("write them on their own, or leave waveforms out with ‹point_format› 6"));
    }
    let note = (!parted.is_empty()).then(|| {
        format!("records that are not the same in all files are left out: {}", parted.join(", "))
    });
    Ok((shared, note.into_iter().collect()))
}

/// The records of a file that do not tell of what is written anew.
fn of_file(file: &LasFile, format: PointFormat) -> Result<Vec<Vlr>> {
    let is_wave = |vlr: &VlrHeader| vlr.user == extra::USER && WAVES.contains(&vlr.id);
    let is_carried = |vlr: &VlrHeader| {
        let is_data = vlr.is(extra::USER, WAVE_DATA) || vlr.is(extra::USER, SUPERSEDED);
        let is_ours =
            vlr.is(LASZIP.0, LASZIP.1) || vlr.is(extra::USER, extra::NUMBER) || vlr.user == OCTREE;
        !is_data && !is_ours && vlr.user != PROJECTION && (format.has_waves() || !is_wave(vlr))
    };
    if format.has_waves() && file.header.encoding & WAVES_INSIDE > 0 {
        return Err(Error::unsupported(
            "its waveforms are inside of the file, and they are not written yet",
        )
        .remedy("leave them out with ‹point_format› 6, or 7 with colours"));
    }
    let mut left = MOST_BYTES;
    let carried = file.vlrs.iter().filter(|vlr| is_carried(vlr));
    let raw = file.reopen()?;
    carried.map(|vlr| data(vlr, &raw, &mut left)).collect()
}

fn data(vlr: &VlrHeader, file: &RawFile, left: &mut u64) -> Result<Vlr> {
    // Before it is read: headers of damaged files may state any length.
    *left = left.checked_sub(vlr.bytes).ok_or_else(|| {
        Error::unsupported(format!("its records hold more than {} MiB", MOST_BYTES >> 20))
            .remedy("take the largest of them out")
    })?;
    let data = vlr.data(file)?;
    Ok(Vlr { user: vlr.user.clone(), number: vlr.id, about: vlr.description.clone(), data })
}

/// What the format has no field for.
fn left_out(
    origins: &[CloudFileOrigin<'_>],
    format: PointFormat,
    packing: PointPacking,
) -> Vec<String> {
    let own = format.places();
    let fields = |origin: &CloudFileOrigin<'_>| {
        let places = origin.format.places();
        [
            ("times", origin.has_time() && own.time.is_none()),
            ("colours", places.colour > own.colour && own.colour.is_none()),
            ("infrared", places.infrared.is_some() && own.infrared.is_none()),
            (
                "waveforms",
                places.wave.is_some() && (own.wave.is_none() || packing == PointPacking::Text),
            ),
            (
                "parts of a degree of scan angles",
                origin.las.is_some() && origin.format.is_new() && !format.is_new(),
            ),
        ]
    };
    let all: Vec<_> = origins.iter().map(fields).collect();
    let is_lost = |i: &usize| all.iter().any(|fields| fields[*i].1);
    let lost: Vec<_> = (0..5).filter(is_lost).map(|i| all[0][i].0).collect();
    let lost = lost.join(", ");
    let note = match packing {
        PointPacking::Text => format!("{lost} are left out"),
        _ => {
            format!("point format {} has no field for {lost}, which are left out", format.number())
        }
    };
    (!lost.is_empty()).then_some(note).into_iter().collect()
}
