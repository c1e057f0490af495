//! Agreement of the files of a point cloud in their CRS.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, VerticalReference};
use terrane_files::{path_of, shown};

use super::source_file::CloudFile;

/// The common CRS of all files, and a note; `given` is the CRS of files without one. The vertical CRS is that of the
/// first file that states one.
///
/// # Errors
/// Two files with different CRSs.
pub(super) fn crs(
    names: &[String],
    files: &[CloudFile],
    given: Option<&Crs>,
) -> Result<(Crs, Option<String>)> {
    // The first file, or the first one with a vertical CRS; and the first one without.
    let (mut known, mut silent): (Option<(&str, Crs)>, Option<&str>) = (None, None);
    for (name, file) in names.iter().zip(files) {
        let other = match (file.crs(), given) {
            (crs, Some(given)) if !crs.is_named() => given.clone(),
            (crs, _) => crs.clone(),
        };
        let is_silent = !states_heights(&other);
        if is_silent {
            silent = silent.or(Some(name));
        }
        let Some((first, system)) = &known else {
            known = Some((name, other));
            continue;
        };
        if !system.agrees(&other) {
            return Err(differ((first, system), (name, &other)));
        }
        if let (Some(a), Some(b)) = (&system.vertical_unit, &other.vertical_unit)
            && a != b
        {
            return Err(differ_in_units((first, system), (name, &other)));
        }
        if !is_silent && !states_heights(system) {
            known = Some((name, other));
        }
    }
    let Some((name, system)) = known else { return Ok(Default::default()) };
    let silent = silent.filter(|_| states_heights(&system));
    let note = silent.map(|silent| {
        let (silent, name) = (shown(silent), shown(name));
        format!("{silent} has no vertical CRS; that of {name} is assumed")
    });
    Ok((system, note))
}

fn differ(first: (&str, &Crs), other: (&str, &Crs)) -> Error {
    let [own, others] = first.1.distinct_names(other.1);
    let remedy = match !first.1.is_named() || !other.1.is_named() {
        true => "set the common CRS with ‹crs›, or reproject one of them",
        false => "reproject one of them, for example with PDAL's filters.reprojection",
    };
    Error::bad_input(format!("its CRS is {others}, the CRS of {} is {own}", shown(first.0)))
        .in_file(&path_of(other.0))
        .remedy(remedy)
}

fn states_heights(crs: &Crs) -> bool {
    crs.vertical_unit.is_some() || crs.heights() != VerticalReference::Unknown
}

fn differ_in_units(first: (&str, &Crs), other: (&str, &Crs)) -> Error {
    let [first_unit, unit] =
        [first.1, other.1].map(|crs| crs.vertical_unit.as_deref().unwrap_or("unknown"));
    Error::bad_input(format!(
        "its vertical unit is {unit}, the vertical unit of {} is {first_unit}",
        shown(first.0)
    ))
    .in_file(&path_of(other.0))
    .remedy("convert the heights of one of them")
}

/// Notes on the CRS that users may overlook.
pub(super) fn notes(crs: &Crs) -> Vec<String> {
    let mut notes = Vec::new();
    if !crs.is_named() {
        notes.push("CRS is missing (set it with ‹crs›)".to_owned());
    }
    let (across, up) = (crs.horizontal_unit(), crs.vertical_unit.as_deref());
    if across == "degree" {
        notes.push("x and y are in degrees, heights are not".to_owned());
    } else if let Some(up) = up.filter(|up| across != "unit" && *up != across) {
        notes.push(format!("x and y are in {across} but heights in {up}"));
    }
    notes
}
