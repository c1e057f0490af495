//! Mosaics of georeferenced files on the lattice of the first one.

use std::sync::Arc;

use rayon::prelude::*;

use crate::format::GridOpenOptions;
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::nodata::is_no_height;
use crate::notes::{MASK, NODATA_VALUES};
use crate::tiled_tiff::sample::stored_nodata;
use terrane_base::error::{Error, Result, all};
use terrane_base::geom::Rect;
use terrane_files::{on_threads, path_of};

use super::consistency::{self, NamedGrid};
use super::find::{MosaicEntry, MosaicFamily, MosaicNesting, MosaicSource, find};
use super::layout::{GridShape, MosaicLayout, fits, lay_out};
use super::recode::{HeightRecoding, is_same, void_range, wider};
use super::{Mosaic, MosaicPart, members};

/// Maximum number of nodata values in details.
const MAX_LISTED: usize = 8;

/// Files that share a lattice and a CRS, as one grid.
pub struct MosaicLayer {
    /// Its first file.
    pub name: String,
    /// Its files, with later files on top where they are valid.
    pub grid: Box<dyn GridSource>,
}

/// Metadata of a file in a mosaic.
struct MosaicMember {
    source: MosaicSource,
    shape: GridShape,
    sample_type: SampleType,
    nodata: Option<f64>,
    unit: Option<String>,
    /// Code of its vertical CRS.
    vertical: Option<u32>,
    /// Its mask, if it has one besides a nodata value.
    mask: Option<(String, String)>,
}

impl MosaicMember {
    fn of(MosaicEntry { info, source }: MosaicEntry) -> Self {
        let shape = GridShape::of(&info);
        let GridInfo { sample_type, nodata, .. } = info;
        let mask = info.details.into_iter().find(|(name, _)| name == MASK && nodata.is_some());
        let (unit, vertical) = (info.crs.vertical_unit, info.crs.vertical_epsg);
        Self { source, shape, sample_type, nodata, unit, vertical, mask }
    }
}

/// Opens `inputs` (files, folders, lists, patterns) as one grid, with later files on top where they are
/// valid.
///
/// # Errors
/// Inputs without files; files that cannot be opened; inconsistent files.
pub(crate) fn open(inputs: &[String], options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let names = members::files(inputs)?;
    match names.as_slice() {
        [] => Err(nothing()),
        [one] => crate::open(one, options),
        _ => Ok(Box::new(mosaic(&names, options)?)),
    }
}

/// Opens `inputs` as grids that may differ in lattice and CRS, from bottom to top: files that agree are one layer, in the
/// order of their first files. All have one cache and one pool of open files.
///
/// # Errors
/// Those of [`open_all`](crate::open_all), but for lattices and CRSs that differ.
pub fn open_layers(inputs: &[String], options: &GridOpenOptions) -> Result<Vec<MosaicLayer>> {
    let names = members::files(inputs)?;
    let nest = nest(&names, options)?;
    let found = on_threads(options.threads.min(names.len().max(1)), || {
        let found = names.par_iter().map(|name| {
            let entry = find(name, options.band, options.nodata, &nest)?;
            match entry.info.georeferenced {
                true => Ok(entry),
                false => Err(consistency::nowhere(name)),
            }
        });
        Ok(found.collect::<Vec<_>>())
    })?;
    let mut layers: Vec<Vec<(&String, MosaicEntry)>> = Vec::new();
    for (name, entry) in names.iter().zip(all(found)?) {
        let own = NamedGrid { name, info: &entry.info };
        let place = layers.iter().position(|layer| {
            let (name, first) = &layer[0];
            let shapes = [&first.info, &entry.info].map(GridShape::of);
            consistency::check(NamedGrid { name, info: &first.info }, own).is_ok()
                && fits(&shapes[0].transform, &shapes[1])
        });
        match place {
            Some(layer) => layers[layer].push((name, entry)),
            None => layers.push(vec![(name, entry)]),
        }
    }
    // In a file that declares none, samples with the value of others are void, too.
    let declared = layers.iter().flatten().map(|(_, entry)| entry.info.nodata);
    let usual = common_nodata(declared, SampleType::F64).filter(|nodata| is_no_height(*nodata));
    let layers = layers.into_iter().map(|layer| {
        let first = layer[0].1.info.clone();
        let (names, members): (Vec<_>, Vec<_>) =
            layer.into_iter().map(|(name, entry)| (name.clone(), MosaicMember::of(entry))).unzip();
        let mosaic = assembled(&names, first, members, usual, nest.family.clone())?;
        mosaic.advise_read(mosaic.info().bounds());
        Ok(MosaicLayer { name: names[0].clone(), grid: Box::new(mosaic) })
    });
    layers.collect()
}

/// The state of a new mosaic of these files.
fn nest(names: &[String], options: &GridOpenOptions) -> Result<MosaicNesting> {
    let family = MosaicFamily::new(options);
    family.count_members(names.len() as u64)?;
    Ok(MosaicNesting { family, around: Vec::new() })
}

fn nothing() -> Error {
    Error::usage("no input").remedy("pass a grid file")
}

/// Finds a file and checks that it agrees with the first one, if that could be opened.
fn member(
    name: &str,
    first: Option<NamedGrid<'_>>,
    options: &GridOpenOptions,
    nest: &MosaicNesting,
) -> Result<MosaicMember> {
    let entry = find(name, options.band, options.nodata, nest)?;
    if let Some(first) = first {
        consistency::check(first, NamedGrid { name, info: &entry.info })?;
    }
    Ok(MosaicMember::of(entry))
}

fn mosaic(names: &[String], options: &GridOpenOptions) -> Result<Mosaic> {
    let nest = nest(names, options)?;
    let first = find(&names[0], options.band, options.nodata, &nest);
    let first = first.and_then(|grid| match grid.info.georeferenced {
        true => Ok(grid),
        false => Err(consistency::nowhere(&names[0])),
    });
    let info = first.as_ref().ok().map(|first| first.info.clone());
    let reference = info.as_ref().map(|info| NamedGrid { name: &names[0], info });
    // A failure of the first file does not end the search: `all` reports all failures together.
    let mut members = vec![first.map(MosaicMember::of)];
    members.extend(on_threads(options.threads.min(names.len() - 1), || {
        let rest = names[1..].par_iter();
        Ok(rest.map(|name| member(name, reference, options, &nest)).collect::<Vec<_>>())
    })?);
    let members = all(members)?;
    assembled(names, info.ok_or_else(nothing)?, members, None, nest.family)
}

/// The mosaic of files that agree with the first. `nodata` is that of other files, for files that declare none.
fn assembled(
    names: &[String],
    first: GridInfo,
    members: Vec<MosaicMember>,
    nodata: Option<f64>,
    family: Arc<MosaicFamily>,
) -> Result<Mosaic> {
    check_vertical(names, &members)?;
    let unit = unit(names, &members)?;
    let layout = laid_out(names, &members)?;
    let mut info = describe(first, &members, &layout, unit);
    let is_stored = |value: &f64| stored_nodata(info.sample_type, *value).is_some();
    info.nodata = info.nodata.or(nodata.filter(is_stored));
    let parts = parts(members, &layout, &info);
    Ok(Mosaic::new(info, parts, family))
}

/// Fails if two files state different vertical CRSs.
fn check_vertical(names: &[String], members: &[MosaicMember]) -> Result<()> {
    let stated = names.iter().zip(members).filter_map(|(name, own)| Some((name, own.vertical?)));
    let mut stated = stated.peekable();
    let Some(&(first, code)) = stated.peek() else { return Ok(()) };
    stated.find(|(_, other)| *other != code).map_or(Ok(()), |(name, other)| {
        Err(consistency::vertical_differs((first, code), (name, other)))
    })
}

/// The common height unit of the files; files without a unit agree with any.
fn unit(names: &[String], members: &[MosaicMember]) -> Result<Option<String>> {
    let stated =
        names.iter().zip(members).filter_map(|(n, m)| Some((n.as_str(), m.unit.as_deref()?)));
    let mut stated = stated.peekable();
    let Some(&first) = stated.peek() else { return Ok(None) };
    stated.try_for_each(|other| consistency::check_units(first, other))?;
    Ok(Some(first.1.to_owned()))
}

fn laid_out(names: &[String], members: &[MosaicMember]) -> Result<MosaicLayout> {
    let shapes: Vec<GridShape> = members.iter().map(|member| member.shape).collect();
    lay_out(&shapes).map_err(|e| e.in_file(&path_of(&names[0])))?.map_err(|(i, misfit)| {
        consistency::misplaced(&names[0], &shapes[0], &names[i], &shapes[i], misfit)
    })
}

/// Metadata of the mosaic: that of the first file, on the common lattice, with a type that holds all samples
/// and a nodata value that is not a height in any file.
fn describe(
    first: GridInfo,
    members: &[MosaicMember],
    layout: &MosaicLayout,
    unit: Option<String>,
) -> GridInfo {
    let types = members.iter().map(|member| member.sample_type);
    let sample_type = types.fold(first.sample_type, wider);
    let mut info = GridInfo {
        width: layout.width,
        height: layout.height,
        transform: layout.transform,
        sample_type,
        nodata: common_nodata(members.iter().map(|member| member.nodata), sample_type),
        format: "mosaic",
        details: facts(members, &first),
        block: (first.block.0.min(layout.width), first.block.1.min(layout.height)),
        ..first
    };
    if info.crs.vertical_unit.is_none() {
        info.crs.vertical_unit = unit;
    }
    info
}

fn parts(members: Vec<MosaicMember>, layout: &MosaicLayout, info: &GridInfo) -> Vec<MosaicPart> {
    let placed = members.into_iter().zip(&layout.places);
    placed
        .map(|(member, place)| MosaicPart {
            recode: recode(member.nodata, info),
            source: member.source,
            rect: Rect::new(place[0], place[1], member.shape.width, member.shape.height),
            from: [0, 0],
            transparent: true,
        })
        .collect()
}

/// The nodata value for the heights of several grids, from theirs: the common declared one, or else the first candidate
/// that is not a terrain height, or the last resort of the type. A height equal to it cannot be written and is reported
/// as an error.
pub fn common_nodata(
    all: impl Iterator<Item = Option<f64>> + Clone,
    kind: SampleType,
) -> Option<f64> {
    match &declared(all.clone())[..] {
        [] => None,
        [only] if all.into_iter().all(|nodata| nodata.is_some()) => Some(*only),
        all => {
            let mut all = all.iter().copied();
            let usable = all.find(|v| is_no_height(*v) && stored_nodata(kind, *v).is_some());
            Some(usable.unwrap_or(last_resort(kind)))
        }
    }
}

/// The distinct declared nodata values, in order.
fn declared(all: impl Iterator<Item = Option<f64>>) -> Vec<f64> {
    let mut distinct: Vec<f64> = Vec::new();
    for value in all.flatten() {
        if !distinct.iter().any(|own| is_same(*own, value)) {
            distinct.push(value);
        }
    }
    distinct
}

fn last_resort(kind: SampleType) -> f64 {
    match kind {
        SampleType::U8 => u8::MAX.into(),
        SampleType::U16 => u16::MAX.into(),
        SampleType::U32 => u32::MAX.into(),
        SampleType::I8 => i8::MIN.into(),
        SampleType::I16 => i16::MIN.into(),
        SampleType::I32 => i32::MIN.into(),
        SampleType::F16 | SampleType::F32 | SampleType::F64 => f64::NAN,
    }
}

/// In a file without a nodata value, samples equal to the mosaic's are void if they cannot be heights.
fn recode(own: Option<f64>, info: &GridInfo) -> Option<HeightRecoding> {
    let nodata = info.nodata.filter(|value| own.is_none() && is_no_height(*value))?;
    let (low, high) = void_range(info.sample_type, nodata)?;
    // Heights of all files have the same scale.
    let [low, high] = [low, high].map(|stored| stored * info.scale + info.offset);
    Some(HeightRecoding { void: Some((low.min(high), low.max(high))), ..HeightRecoding::NONE })
}

/// Details: number of files, metadata of the first, and differing nodata values.
fn facts(members: &[MosaicMember], first: &GridInfo) -> Vec<(String, String)> {
    let compression = first.details.iter().find(|(name, _)| name == "compression").cloned();
    let mut facts = vec![
        ("files".to_owned(), members.len().to_string()),
        ("format of the first".to_owned(), first.format.to_owned()),
    ];
    facts.extend(compression);
    facts.extend(members.iter().find_map(|member| member.mask.clone()));
    let declared = declared(members.iter().map(|member| member.nodata));
    if declared.len() > 1 {
        let values: Vec<_> = declared.iter().take(MAX_LISTED).map(f64::to_string).collect();
        facts.push((NODATA_VALUES.to_owned(), values.join(", ")));
    }
    facts
}
