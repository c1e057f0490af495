//! Notes on unusual properties of a grid, reported before work starts.

use serde::Serialize;

use crate::grid::{GridInfo, SampleType};
use crate::nodata::undeclared_nodata;
use terrane_base::geom::{Crs, VerticalReference};

/// A note on a grid.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GridNote {
    /// Stable identifier of the note: one of [`NOTE_KINDS`].
    pub kind: &'static str,
    /// One line of text.
    pub text: String,
}

/// A check of the metadata; returns the text of a note.
type Check = fn(&GridInfo) -> Option<String>;

/// Checks of the metadata.
const CHECKS: &[(&str, Check)] = &[
    ("unplaced", unplaced),
    ("no CRS", no_crs),
    ("degrees", degrees),
    ("mixed units", mixed_units),
    ("vertical unit unknown", vertical_unit_unknown),
    ("cells not square", cells_not_square),
    ("rotated", rotated),
    ("south-up", south_up),
    ("mirrored", mirrored),
    ("points", points),
    ("several bands", several_bands),
    ("scaled", scaled),
    ("impossible nodata", impossible_nodata),
    ("nodata values differ", nodata_values_differ),
    ("masks", masks),
    ("cells too small", cells_too_small),
    ("thin strips", thin_strips),
];
/// Kinds of notes on samples that other programs interpret differently.
const CAUTIONS: [&str; 3] = ["impossible nodata", "nodata values differ", "masks"];

/// Keys of details: a mask that makes samples void, and the number of VRT sources whose masks are not used.
pub(crate) const MASK: &str = "mask";
/// Key of the different nodata values of the files of a mosaic.
pub(crate) const NODATA_VALUES: &str = "nodata of the files";
pub(crate) const UNUSED_MASKS: &str = "sources with masks";

/// Kinds of notes that need the heights.
const UNDECLARED: &str = "undeclared nodata";
const VOIDS: &str = "voids";
const NO_TERRAIN: &str = "no terrain";

/// All kinds of notes.
pub const NOTE_KINDS: [&str; CHECKS.len() + 3] = {
    let mut kinds = [UNDECLARED; CHECKS.len() + 3];
    let mut i = 0;
    while i < CHECKS.len() {
        kinds[i] = CHECKS[i].0;
        i += 1;
    }
    kinds[i] = VOIDS;
    kinds[i + 1] = NO_TERRAIN;
    kinds
};

/// Notes on the metadata; no samples are read.
pub fn notes(info: &GridInfo) -> Vec<GridNote> {
    let answers = CHECKS.iter().map(|(kind, check)| (*kind, check(info)));
    answers.filter_map(|(kind, text)| Some(GridNote { kind, text: text? })).collect()
}

/// Notes on samples that other programs interpret differently, for reports of derived products.
pub fn cautions(info: &GridInfo) -> Vec<String> {
    let cautions = notes(info).into_iter().filter(|note| CAUTIONS.contains(&note.kind));
    cautions.map(|note| note.text).collect()
}

/// Notes on the heights of a grid of `samples` samples, `valid` of which are not void and have the given
/// range. `suspects` is a stored value that looks like undeclared nodata, and the number of samples with it.
pub fn notes_on_heights(
    info: &GridInfo,
    (samples, valid): (u64, u64),
    range: Option<[f64; 2]>,
    suspects: Option<(f64, u64)>,
) -> Vec<GridNote> {
    let undeclared = suspects.map(|(stored, count)| undeclared_nodata(count, stored));
    let odd = range.filter(|_| suspects.is_none()).and_then(|range| no_terrain(info, range));
    let answers = [(UNDECLARED, undeclared), (VOIDS, voids(samples, valid)), (NO_TERRAIN, odd)];
    answers.into_iter().filter_map(|(kind, text)| Some(GridNote { kind, text: text? })).collect()
}

/// Range of terrain on Earth in metres with a margin, from the deepest trench to the highest summit.
const TERRAIN: [f64; 2] = [-12_000.0, 9_000.0];

/// Range of terrain heights in the unit of the grid; unbounded if the unit is unknown, or for other bodies
/// than the Earth.
pub fn terrain(info: &GridInfo) -> [f64; 2] {
    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
    let is_elsewhere =
        !info.crs.spheroid().is_ok_and(|own| own.is_none_or(|own| own.is_of_earth()));
    let metres = match (info.crs.vertical_metres(), info.crs.heights_unit()) {
        (None, Some(_)) => return ALL,
        (metres, _) => metres.unwrap_or(1.0),
    };
    match info.crs.heights() {
        _ if is_elsewhere => ALL,
        VerticalReference::Above { is_down: true, .. } => {
            [-TERRAIN[1], -TERRAIN[0]].map(|z| z / metres)
        }
        _ => TERRAIN.map(|z| z / metres),
    }
}

/// Note on heights outside the range of terrain.
pub fn no_terrain(info: &GridInfo, [lowest, highest]: [f64; 2]) -> Option<String> {
    let [least, most] = terrain(info);
    if lowest >= least && highest <= most {
        return None;
    }
    let packed = info.details.iter().find(|(name, _)| name == "heights");
    let remedy = match packed.map(|(_, packing)| packing.as_str()) {
        Some("terrain-RGB") => "for a terrarium image, pass terrarium:FILE",
        Some("terrarium") => "for a terrain-RGB image, pass terrain-rgb:FILE",
        _ => "check the height unit, scale, offset and ‹nodata›",
    };
    Some(format!(
        "heights range from {lowest} to {highest}, outside terrain on Earth ({least} to {most}); {remedy}"
    ))
}

fn voids(samples: u64, valid: u64) -> Option<String> {
    let void = samples.saturating_sub(valid);
    if valid == 0 {
        return Some("all samples are void: there is no surface".to_owned());
    }
    let share = 100.0 * void as f64 / samples as f64;
    (void > 0).then(|| format!("{void} samples are void ({share:.2} %): the surface has holes"))
}

fn unplaced(info: &GridInfo) -> Option<String> {
    let text = "georeference is missing: columns and rows are used as x and y";
    (!info.georeferenced).then(|| text.to_owned())
}

fn no_crs(info: &GridInfo) -> Option<String> {
    let Crs { epsg, citation, wkt, geographic, .. } = &info.crs;
    let nameless = epsg.is_none() && citation.is_none() && wkt.is_none() && geographic.is_none();
    let text = "CRS is missing; outputs will have no CRS";
    (info.georeferenced && nameless).then(|| text.to_owned())
}

fn degrees(info: &GridInfo) -> Option<String> {
    let of = info.crs.heights_unit().unwrap_or("the unit of the heights");
    let text = format!("x and y are in degrees; the vertical error (‹max_error›) is in {of}");
    (info.crs.horizontal_unit() == "degree").then_some(text)
}

fn mixed_units(info: &GridInfo) -> Option<String> {
    let (across, up) = (info.crs.horizontal_unit(), info.crs.heights_unit()?);
    let comparable = across != "degree" && across != "unit" && across != up;
    comparable.then(|| {
        format!("x and y are in {across} but heights in {up}: the vertical error is in {up}")
    })
}

fn vertical_unit_unknown(info: &GridInfo) -> Option<String> {
    let text = "height unit is missing; the vertical error is in the unit of the heights";
    info.crs.heights_unit().is_none().then(|| text.to_owned())
}

/// Width and height of a cell, and its largest rotation or shear, at most 1.
struct CellShape {
    width: f64,
    height: f64,
    turn: f64,
}

impl CellShape {
    fn of(info: &GridInfo) -> Self {
        let map = &info.transform;
        let (width, height) = (map.a.hypot(map.d), map.b.hypot(map.e));
        Self { width, height, turn: (map.d / width).abs().max((map.b / height).abs()) }
    }

    /// True if the rotation exceeds rounding errors of the coefficients.
    fn is_turned(&self) -> bool {
        self.turn > 1e-6
    }
}

fn cells_not_square(info: &GridInfo) -> Option<String> {
    let CellShape { width, height, .. } = CellShape::of(info);
    let ratio = width / height;
    let unit = info.crs.horizontal_unit();
    // Cell sizes are often rounded to six digits or so.
    ((ratio - 1.0).abs() > 1e-4)
        .then(|| format!("cells are not square: {width} x {height} {unit} (ratio {ratio:.4})"))
}

fn rotated(info: &GridInfo) -> Option<String> {
    let map = &info.transform;
    let [row, column] = [map.d.atan2(map.a), map.e.atan2(map.b)].map(f64::to_degrees);
    CellShape::of(info).is_turned().then(|| {
        format!("grid is rotated: rows at {row:.4} degrees from the x axis, columns at {column:.4}")
    })
}

fn south_up(info: &GridInfo) -> Option<String> {
    let text = "rows run from south to north";
    (info.transform.e > 0.0 && !CellShape::of(info).is_turned()).then(|| text.to_owned())
}

fn mirrored(info: &GridInfo) -> Option<String> {
    let text = "columns run from east to west";
    (info.transform.a < 0.0 && !CellShape::of(info).is_turned()).then(|| text.to_owned())
}

fn points(info: &GridInfo) -> Option<String> {
    let text = "samples are points (PixelIsPoint): bounds extend half a cell beyond them";
    info.pixel_is_point.then(|| text.to_owned())
}

fn several_bands(info: &GridInfo) -> Option<String> {
    let GridInfo { bands, band, .. } = info;
    (*bands > 1).then(|| format!("the file has {bands} bands; band {band} is read (‹band›)"))
}

fn scaled(info: &GridInfo) -> Option<String> {
    let (scale, offset, kind) = (info.scale, info.offset, info.sample_type.name());
    ((scale, offset) != (1.0, 0.0)).then(|| {
        format!("heights are stored {kind} x {scale} + {offset}; ‹nodata› refers to stored values")
    })
}

fn impossible_nodata(info: &GridInfo) -> Option<String> {
    let (nodata, kind) = (info.nodata?, info.sample_type);
    (!can_hold(kind, nodata)).then(|| {
        format!("declared nodata value {nodata} is not a valid {} and has no effect", kind.name())
    })
}

fn can_hold(kind: SampleType, value: f64) -> bool {
    let whole = |low: f64, high: f64| value.fract() == 0.0 && low <= value && value <= high;
    match kind {
        SampleType::I8 => whole(i8::MIN.into(), i8::MAX.into()),
        SampleType::U8 => whole(0.0, u8::MAX.into()),
        SampleType::I16 => whole(i16::MIN.into(), i16::MAX.into()),
        SampleType::U16 => whole(0.0, u16::MAX.into()),
        SampleType::I32 => whole(i32::MIN.into(), i32::MAX.into()),
        SampleType::U32 => whole(0.0, u32::MAX.into()),
        // The nearest float is intended: text of the lowest float is often out of range.
        SampleType::F16 | SampleType::F32 | SampleType::F64 => true,
    }
}

fn nodata_values_differ(info: &GridInfo) -> Option<String> {
    let (_, values) = info.details.iter().find(|(name, _)| name == NODATA_VALUES)?;
    let text = "files declare different nodata values, each applied to its own file";
    Some(format!("{text}: {values}"))
}

/// The values of the details called `name`.
fn details<'a>(info: &'a GridInfo, name: &str) -> Vec<&'a str> {
    let details = info.details.iter().filter(|(key, _)| key == name);
    details.map(|(_, value)| value.as_str()).collect()
}

/// Note on a mask beside the nodata value, or on unused masks of VRT sources.
fn masks(info: &GridInfo) -> Option<String> {
    if let Some(count) = details(info, UNUSED_MASKS).first() {
        return Some(format!(
            "sources with masks that the VRT does not use: {count}; masked samples are void, GDAL reads heights there"
        ));
    }
    let masks = details(info, MASK);
    (info.nodata.is_some() && !masks.is_empty()).then(|| {
        format!(
            "nodata value and mask ({}) both make samples void; GDAL applies only one of them",
            masks.join(", ")
        )
    })
}

fn cells_too_small(info: &GridInfo) -> Option<String> {
    let text =
        "cells are below the precision of double coordinates: meshes and lines are not supported";
    info.check_cells().is_err().then(|| text.to_owned())
}

/// Minimum number of columns of long strips, and maximum number of rows of thin ones.
const LONG_STRIP: u32 = 8192;
const THIN_STRIP: u32 = 64;

/// Uncompressed strips are not affected: they are read in parts.
fn thin_strips(info: &GridInfo) -> Option<String> {
    let (width, rows) = info.block;
    let is_long = width >= LONG_STRIP && rows < THIN_STRIP.min(info.height);
    let is_compressed = details(info, "compression").iter().any(|name| *name != "none");
    (is_long && is_compressed).then(|| {
        let lines = if rows == 1 { "1 row".to_owned() } else { format!("{rows} rows") };
        format!(
            "compressed strips of {lines} across {width} columns: any window decodes whole rows; \
             for repeated use, convert with ‹terrane convert› and ‹format=store› first"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::{Affine, wkt};

    /// A grid without anything to tell of.
    fn plain() -> GridInfo {
        let metric = Crs {
            epsg: Some(32_611),
            geographic: Some(false),
            vertical_unit: Some("metre".to_owned()),
            ..Crs::default()
        };
        GridInfo {
            georeferenced: true,
            transform: Affine { x0: 5e5, a: 30.0, b: 0.0, y0: 4e6, d: 0.0, e: -30.0 },
            crs: metric,
            ..GridInfo::plain("test", 20_000, 20_000, SampleType::I16)
        }
    }

    fn turned(coefficients: [f64; 4]) -> GridInfo {
        let [a, b, d, e] = coefficients;
        GridInfo { transform: Affine { a, b, d, e, ..plain().transform }, ..plain() }
    }

    fn with_crs(change: impl FnOnce(&mut Crs)) -> GridInfo {
        let mut info = plain();
        change(&mut info.crs);
        info
    }

    fn with_block(block: (u32, u32), compression: &str) -> GridInfo {
        let details = vec![("compression".to_owned(), compression.to_owned())];
        GridInfo { block, details, ..plain() }
    }

    /// A grid for each check, with words of what is told of it.
    fn odd_grids() -> Vec<(&'static str, GridInfo, &'static str)> {
        let unplaced = GridInfo { georeferenced: false, transform: Affine::LATTICE, ..plain() };
        let scaled = GridInfo { scale: 0.001, offset: 5.0, ..plain() };
        let values = vec![(NODATA_VALUES.to_owned(), "0, -1".to_owned())];
        let differing = GridInfo { details: values, ..plain() };
        let mask = vec![(MASK.to_owned(), "internal".to_owned())];
        let masked = GridInfo { nodata: Some(0.0), details: mask, ..plain() };
        let degrees = |crs: &mut Crs| (crs.epsg, crs.geographic) = (Some(4326), Some(true));
        vec![
            ("unplaced", unplaced, "columns and rows"),
            ("no CRS", with_crs(|crs| *crs = Crs::default()), "CRS is missing"),
            ("degrees", with_crs(degrees), "(‹max_error›) is in metre"),
            ("mixed units", with_crs(|crs| crs.vertical_unit = Some("foot".into())), "is in foot"),
            (
                "vertical unit unknown",
                with_crs(|crs| crs.vertical_unit = None),
                "height unit is missing",
            ),
            ("cells not square", turned([30.0, 0.0, 0.0, -20.0]), "30 x 20 metre (ratio 1.5000)"),
            ("rotated", turned([30.0, 5.0, 5.0, -30.0]), "9.4623 degrees"),
            ("south-up", turned([30.0, 0.0, 0.0, 30.0]), "south to north"),
            ("mirrored", turned([-30.0, 0.0, 0.0, -30.0]), "east to west"),
            ("points", GridInfo { pixel_is_point: true, ..plain() }, "half a cell"),
            ("several bands", GridInfo { bands: 3, band: 2, ..plain() }, "3 bands; band 2 is"),
            ("scaled", scaled, "int16 x 0.001 + 5;"),
            (
                "impossible nodata",
                GridInfo { nodata: Some(-99_999.0), ..plain() },
                "not a valid int16",
            ),
            ("nodata values differ", differing, "own file: 0, -1"),
            ("masks", masked, "nodata value and mask (internal)"),
            ("cells too small", turned([1e-9, 0.0, 0.0, -1e-9]), "precision of double"),
            ("thin strips", with_block((20_000, 1), "LZW"), "strips of 1 row across 20000"),
        ]
    }

    #[test]
    fn a_plain_grid_has_no_note_and_each_odd_one_its_own() {
        assert_eq!(notes(&plain()), []);
        let odd = odd_grids();
        assert!(odd.iter().map(|(kind, ..)| *kind).eq(CHECKS.iter().map(|(kind, _)| *kind)));
        for (kind, info, words) in odd {
            let found = notes(&info);
            let note = found.iter().find(|note| note.kind == kind).expect(kind);
            assert!(note.text.contains(words) && !note.text.contains('\n'), "{note:?}");
            let also = kind == "no CRS";
            assert!(found.len() == 1 || also, "{kind} has {found:?}");
        }
    }

    #[test]
    fn what_is_usual_goes_without_a_note() {
        let usual = [
            GridInfo { nodata: Some(-9999.0), ..plain() },
            GridInfo { nodata: Some(-3.402_823_5e38), sample_type: SampleType::F32, ..plain() },
            GridInfo { nodata: Some(f64::NAN), sample_type: SampleType::F32, ..plain() },
            turned([30.0, 1e-9, 1e-9, -30.000_001]),
            with_block((20_000, 1), "none"),
            with_block((20_000, 128), "LZW"),
            with_block((512, 1), "LZW"),
        ];
        for info in usual {
            assert_eq!(notes(&info), []);
        }
        let nan = GridInfo { nodata: Some(f64::NAN), ..plain() };
        assert_eq!(notes(&nan)[0].kind, "impossible nodata");
    }

    #[test]
    fn heights_tell_of_voids_and_undeclared_nodata() {
        let info = plain();
        let told = |counts, suspects| notes_on_heights(&info, counts, Some([0.0, 9.0]), suspects);
        assert_eq!(told((100, 100), None), []);
        let both = told((200, 150), Some((-32_767.0, 7)));
        let kinds: Vec<_> = both.iter().map(|note| note.kind).collect();
        assert_eq!(kinds, [UNDECLARED, VOIDS]);
        assert!(both[0].text.starts_with("7 samples are -32767,"));
        assert!(both[1].text.starts_with("50 samples are void (25.00 %)"), "{both:?}");
        assert!(told((9, 0), None)[0].text.contains("no surface"));
        assert_eq!(NOTE_KINDS.len(), CHECKS.len() + 3);
        assert!(NOTE_KINDS.contains(&VOIDS) && NOTE_KINDS.contains(&"thin strips"));
    }

    #[test]
    fn heights_of_no_terrain_are_told_on_earth_in_any_unit() {
        let in_unit = |unit: &str| with_crs(|crs| crs.vertical_unit = Some(unit.to_owned()));
        let depths = GridInfo { crs: wkt::of_srs("EPSG:4326+5715"), ..plain() };
        let moon = r#"GEOGCS["m",DATUM["m",SPHEROID["m",1737400,0]],PRIMEM["r",0],UNIT["degree",0.0174532925199433]]"#;
        let moon = GridInfo { crs: wkt::from_text(moon), ..plain() };
        let packing = |name: &str| GridInfo {
            details: vec![("heights".to_owned(), name.to_owned())],
            ..plain()
        };
        for (info, range, word) in [
            (plain(), [-10_994.0, 8849.0], None),
            (plain(), [0.0, 9001.0], Some("check the height unit")),
            (plain(), [-12_001.0, 5.0], Some("-12001")),
            (in_unit("foot"), [0.0, 29_035.0], None),
            (in_unit("foot"), [0.0, 39_000.0], Some("39000")),
            (in_unit("hectopascal"), [0.0, 1e6], None),
            (depths, [-8000.0, 11_000.0], None),
            (moon, [-9000.0, 10_786.0], None),
            (packing("terrain-RGB"), [833_985.0, 872_376.0], Some("terrarium:FILE")),
            (packing("terrarium"), [-32_338.0, -32_000.0], Some("terrain-rgb:FILE")),
        ] {
            let told = no_terrain(&info, range);
            assert_eq!(told.is_some(), word.is_some(), "{range:?} {told:?}");
            assert!(word.is_none_or(|word| told.unwrap().contains(word)), "{range:?}");
        }
    }
}
