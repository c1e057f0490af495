//! Consistency checks of the files of a mosaic, with an error for each kind of difference.

use crate::grid::GridInfo;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Crs;
use terrane_files::path_of;

use super::layout::{GridShape, LatticeMisfit, SLACK};

/// The remedy for files on different lattices or in different CRSs.
const RESAMPLE: &str = "merge the files with ‹terrane convert› and ‹resampling›";

/// The remedy for heights in different vertical CRSs.
const HEIGHTS: &str =
    "convert the heights of one file first, with ‹terrane convert›, ‹to_crs› and ‹geoid›";

/// A file name with its metadata.
#[derive(Clone, Copy)]
pub(super) struct NamedGrid<'a> {
    pub(super) name: &'a str,
    pub(super) info: &'a GridInfo,
}

/// Fails unless heights and coordinates of `other` have the same meaning as those of `first`.
pub(super) fn check(first: NamedGrid<'_>, other: NamedGrid<'_>) -> Result<()> {
    if !other.info.georeferenced {
        return Err(nowhere(other.name));
    }
    check_crs(first, other)?;
    let scales = [first, other].map(|file| (file.info.scale, file.info.offset));
    if scales[0] != scales[1] {
        let [a, b] = scales.map(|(scale, offset)| format!("x {scale} + {offset}"));
        return Err(differ(other.name, "scale and offset", &b, &a, first.name).remedy(RESAMPLE));
    }
    Ok(())
}

/// Fails if two files declare different height units.
pub(super) fn check_units(first: (&str, &str), other: (&str, &str)) -> Result<()> {
    if first.1 == other.1 {
        return Ok(());
    }
    Err(differ(other.0, "height unit", other.1, first.1, first.0).remedy(
        "convert the heights of one file, for example feet to metres: gdal_calc.py -A IN --calc=A*0.3048 --outfile=OUT",
    ))
}

/// Error of a file without georeference.
pub(super) fn nowhere(name: &str) -> Error {
    Error::bad_input("georeference is missing, which a mosaic requires")
        .in_file(&path_of(name))
        .remedy(format!(
            "add one: gdal_translate -a_srs EPSG:CODE -a_ullr WEST NORTH EAST SOUTH {name} {}",
            renamed(name, "placed")
        ))
}

fn check_crs(first: NamedGrid<'_>, other: NamedGrid<'_>) -> Result<()> {
    let (a, b) = (&first.info.crs, &other.info.crs);
    if a.agrees(b) {
        return Ok(());
    }
    let code = |crs: &Crs| {
        let vertical = crs.vertical_epsg.map(|code| format!("+{code}")).unwrap_or_default();
        crs.epsg.map_or_else(|| "EPSG:CODE".to_owned(), |code| format!("EPSG:{code}{vertical}"))
    };
    let declared = |code: String, name: &str| {
        format!("declare the CRS if it is the same: gdal_edit.py -a_srs {code} {name}")
    };
    let remedy = match [a, b].map(Crs::is_named) {
        [true, false] => declared(code(a), other.name),
        [false, true] => declared(code(b), first.name),
        _ if a.without_heights().agrees(&b.without_heights()) => HEIGHTS.to_owned(),
        _ => RESAMPLE.to_owned(),
    };
    let [ours, theirs] = a.distinct_names(b);
    Err(differ(other.name, "CRS", &theirs, &ours, first.name).remedy(remedy))
}

/// Error of a file with another vertical CRS, by code.
pub(super) fn vertical_differs(first: (&str, u32), other: (&str, u32)) -> Error {
    let [a, b] = [first.1, other.1].map(|code| format!("EPSG:{code}"));
    differ(other.0, "vertical CRS", &b, &a, first.0).remedy(HEIGHTS)
}

/// Error of a file off the lattice of the first one.
pub(super) fn misplaced(
    first: &str,
    first_shape: &GridShape,
    other: &str,
    shape: &GridShape,
    misfit: LatticeMisfit,
) -> Error {
    let error = match misfit {
        LatticeMisfit::Cell(theirs, ours) => {
            differ(other, "cell size", &pair(theirs), &pair(ours), first)
        }
        LatticeMisfit::Rotation(theirs, ours) => {
            differ(other, "rotation of the transform", &pair(theirs), &pair(ours), first)
        }
        LatticeMisfit::Offset([x, y]) => Error::bad_input(format!(
            "samples are {x:.6} x {y:.6} cells off the lattice of {first} (tolerance {SLACK}): first sample at {}, that of {first} at {}",
            first_sample(shape),
            first_sample(first_shape)
        ))
        .in_file(&path_of(other)),
        LatticeMisfit::Far => Error::bad_input(format!(
            "too far from {first} for one mosaic: first sample at {}, that of {first} at {}",
            first_sample(shape),
            first_sample(first_shape)
        ))
        .in_file(&path_of(other)),
    };
    error.remedy(match misfit {
        LatticeMisfit::Far => "omit one of the files".to_owned(),
        _ => RESAMPLE.to_owned(),
    })
}

fn pair([x, y]: [f64; 2]) -> String {
    format!("{x} x {y}")
}

/// Coordinates of the first sample.
fn first_sample(shape: &GridShape) -> String {
    pair([shape.transform.x0, shape.transform.y0])
}

fn differ(name: &str, what: &str, theirs: &str, ours: &str, first: &str) -> Error {
    Error::bad_input(format!("{what} is {theirs}, that of {first} is {ours}"))
        .in_file(&path_of(name))
}

/// "a/b.tif" as "a/b-word.tif".
fn renamed(name: &str, word: &str) -> String {
    let path = path_of(name);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{word}.tif")).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SampleType;
    use terrane_base::geom::Crs;

    fn info() -> GridInfo {
        let crs = Crs { epsg: Some(32_631), ..Crs::default() };
        GridInfo { crs, georeferenced: true, ..GridInfo::plain("x", 4, 3, SampleType::I16) }
    }

    fn refusal(change: impl Fn(&mut GridInfo)) -> String {
        let (a, mut b) = (info(), info());
        change(&mut b);
        let first = NamedGrid { name: "a.tif", info: &a };
        check(first, NamedGrid { name: "d/b.tif", info: &b }).unwrap_err().to_string()
    }

    #[test]
    fn differences_name_both_files_both_values_and_a_remedy() {
        let same = info();
        let named = NamedGrid { name: "a", info: &same };
        assert!(check(named, named).is_ok());
        assert_eq!(
            refusal(|b| b.crs.epsg = Some(4326)),
            "d/b.tif: CRS is EPSG:4326, that of a.tif is EPSG:32631; \
             merge the files with ‹terrane convert› and ‹resampling›"
        );
        assert!(
            refusal(|b| b.crs = Crs::default()).contains("gdal_edit.py -a_srs EPSG:32631 d/b.tif")
        );
        assert!(
            refusal(|b| b.scale = 0.1)
                .contains("is x 0.1 + 0, that of a.tif is x 1 + 0; merge the files")
        );
        assert!(refusal(|b| b.georeferenced = false).contains("-a_ullr"));
        let units = check_units(("a.tif", "metre"), ("b.tif", "foot")).unwrap_err().to_string();
        assert!(units.contains("is foot, that of a.tif is metre"), "{units}");
    }

    #[test]
    fn systems_without_a_code_are_compared_by_what_they_say() {
        let keys = |raster_type: u16, x: u16| Crs {
            geo_keys: vec![1, 1, 0, 2, 1025, 0, 1, raster_type, 3075, 0, 1, x],
            ..Crs::default()
        };
        assert!(keys(1, 8).agrees(&keys(2, 8)));
        assert!(!keys(1, 8).agrees(&keys(1, 9)));
        let named = |name: &str| Crs { citation: Some(name.to_owned()), ..Crs::default() };
        assert!(named("x").agrees(&named("x")) && !named("x").agrees(&named("y")));
        let high = |code| Crs { epsg: Some(1), vertical_epsg: Some(code), ..Crs::default() };
        assert!(!high(1).agrees(&high(2)));
    }
}
