//! What is odd about a grid, or easily overlooked, told before work starts.

use serde::Serialize;

use crate::{GridInfo, SampleType, undeclared_nodata};
use terrane_base::geom::Crs;

/// Something to know about a grid.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// What it is about, in words that stay the same: one of [`NOTE_KINDS`].
    pub kind: &'static str,
    /// One line for people.
    pub text: String,
}

/// A question about a grid; the answer is the line to tell, if there is something to tell.
type Check = fn(&GridInfo) -> Option<String>;

/// What is asked of what a file says of itself.
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
    ("thin strips", thin_strips),
];

/// What heights tell, once they are read.
const UNDECLARED: &str = "undeclared nodata";
const VOIDS: &str = "voids";

/// All kinds of notes there are.
pub const NOTE_KINDS: [&str; CHECKS.len() + 2] = {
    let mut kinds = [UNDECLARED; CHECKS.len() + 2];
    let mut i = 0;
    while i < CHECKS.len() {
        kinds[i] = CHECKS[i].0;
        i += 1;
    }
    kinds[i] = VOIDS;
    kinds
};

/// Notes on what a file says of itself; no sample is read.
pub fn notes(info: &GridInfo) -> Vec<Note> {
    let answers = CHECKS.iter().map(|(kind, check)| (*kind, check(info)));
    answers.filter_map(|(kind, text)| Some(Note { kind, text: text? })).collect()
}

/// Notes on the heights of a grid of `samples` samples, `valid` of which are not void. `suspects`
/// is a stored value that looks like nodata and is not declared, and how many samples have it.
pub fn notes_on_heights(samples: u64, valid: u64, suspects: Option<(f64, u64)>) -> Vec<Note> {
    let undeclared = suspects.map(|(stored, count)| undeclared_nodata(count, stored));
    let answers = [(UNDECLARED, undeclared), (VOIDS, voids(samples, valid))];
    answers.into_iter().filter_map(|(kind, text)| Some(Note { kind, text: text? })).collect()
}

fn voids(samples: u64, valid: u64) -> Option<String> {
    let void = samples.saturating_sub(valid);
    if valid == 0 {
        return Some("all samples are void: there is no surface".to_owned());
    }
    let share = 100.0 * void as f64 / samples as f64;
    (void > 0).then(|| format!("{void} samples are void, {share:.2} %: holes in the surface"))
}

fn unplaced(info: &GridInfo) -> Option<String> {
    let text = "the file does not say where it lies: columns and rows stand in for x and y";
    (!info.georeferenced).then(|| text.to_owned())
}

fn no_crs(info: &GridInfo) -> Option<String> {
    let Crs { epsg, citation, wkt, geographic, .. } = &info.crs;
    let nameless = epsg.is_none() && citation.is_none() && wkt.is_none() && geographic.is_none();
    let text = "the file does not name its coordinate system; neither will a mesh of it";
    (info.georeferenced && nameless).then(|| text.to_owned())
}

fn degrees(info: &GridInfo) -> Option<String> {
    let of = heights_unit(info).unwrap_or("the unit of the heights");
    let text = format!("x and y are in degrees; the vertical error (--max-error) is in {of}");
    (info.crs.horizontal_unit() == "degree").then_some(text)
}

fn mixed_units(info: &GridInfo) -> Option<String> {
    let (across, up) = (info.crs.horizontal_unit(), heights_unit(info)?);
    let comparable = across != "degree" && across != "unit" && across != up;
    comparable.then(|| {
        format!("x and y are in {across} but heights in {up}: the vertical error is in {up}")
    })
}

fn vertical_unit_unknown(info: &GridInfo) -> Option<String> {
    let text = "the file does not name the unit of its heights; the vertical error is in that unit";
    heights_unit(info).is_none().then(|| text.to_owned())
}

fn heights_unit(info: &GridInfo) -> Option<&str> {
    info.crs.vertical_unit.as_deref().map(str::trim).filter(|unit| !unit.is_empty())
}

/// Width and height of a cell, and how far its sides are from those of the axes, at most 1.
struct Cell {
    width: f64,
    height: f64,
    turn: f64,
}

impl Cell {
    fn of(info: &GridInfo) -> Self {
        let map = &info.transform;
        let (width, height) = (map.a.hypot(map.d), map.b.hypot(map.e));
        Self { width, height, turn: (map.d / width).abs().max((map.b / height).abs()) }
    }

    /// Beyond what rounding of the coefficients does.
    fn is_turned(&self) -> bool {
        self.turn > 1e-6
    }
}

fn cells_not_square(info: &GridInfo) -> Option<String> {
    let Cell { width, height, .. } = Cell::of(info);
    let ratio = width / height;
    let unit = info.crs.horizontal_unit();
    // Cell sizes are often rounded to six digits or so.
    ((ratio - 1.0).abs() > 1e-4)
        .then(|| format!("cells are {width} x {height} {unit}: {ratio:.4} times as wide as high"))
}

fn rotated(info: &GridInfo) -> Option<String> {
    let map = &info.transform;
    let [row, column] = [map.d.atan2(map.a), map.e.atan2(map.b)].map(f64::to_degrees);
    Cell::of(info)
        .is_turned()
        .then(|| format!("rows run at {row:.4} degrees from the x axis and columns at {column:.4}"))
}

fn south_up(info: &GridInfo) -> Option<String> {
    let text = "the first row is the southernmost";
    (info.transform.e > 0.0 && !Cell::of(info).is_turned()).then(|| text.to_owned())
}

fn mirrored(info: &GridInfo) -> Option<String> {
    let text = "columns run from east to west";
    (info.transform.a < 0.0 && !Cell::of(info).is_turned()).then(|| text.to_owned())
}

fn points(info: &GridInfo) -> Option<String> {
    let text = "samples are points (PixelIsPoint): the bounds reach half a cell beyond them";
    info.pixel_is_point.then(|| text.to_owned())
}

fn several_bands(info: &GridInfo) -> Option<String> {
    let GridInfo { bands, band, .. } = info;
    (*bands > 1).then(|| format!("the file has {bands} bands; band {band} is read (--band)"))
}

fn scaled(info: &GridInfo) -> Option<String> {
    let (scale, offset, kind) = (info.scale, info.offset, info.sample_type.name());
    ((scale, offset) != (1.0, 0.0)).then(|| {
        format!("heights are the stored {kind} x {scale} + {offset}; --nodata is a stored value")
    })
}

fn impossible_nodata(info: &GridInfo) -> Option<String> {
    let (nodata, kind) = (info.nodata?, info.sample_type);
    (!can_hold(kind, nodata)).then(|| {
        format!("the declared nodata value {nodata} is no {}: it makes no sample void", kind.name())
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
        SampleType::F16 => !value.is_finite() || value.abs() <= 65_520.0,
        // Text of the lowest float is often rounded beyond it.
        SampleType::F32 => !value.is_finite() || value.abs() <= f64::from(f32::MAX) * 1.000_001,
        SampleType::F64 => true,
    }
}

/// Columns from which strips are long, and rows below which they are thin.
const LONG_STRIP: u32 = 8192;
const THIN_STRIP: u32 = 64;

/// Uncompressed rows are read in parts.
fn thin_strips(info: &GridInfo) -> Option<String> {
    let (width, rows) = info.block;
    let packed = |(name, value): &(String, String)| name == "compression" && value != "none";
    let is_long = width >= LONG_STRIP && rows < THIN_STRIP.min(info.height);
    (is_long && info.details.iter().any(packed)).then(|| {
        let lines = if rows == 1 { "1 row".to_owned() } else { format!("{rows} rows") };
        format!(
            "compressed strips of {lines} across {width} columns: any part decodes whole rows; to \
             use it often, copy it with terrane convert first"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Affine;

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
        let degrees = |crs: &mut Crs| (crs.epsg, crs.geographic) = (Some(4326), Some(true));
        vec![
            ("unplaced", unplaced, "columns and rows"),
            ("no CRS", with_crs(|crs| *crs = Crs::default()), "coordinate system"),
            ("degrees", with_crs(degrees), "(--max-error) is in metre"),
            ("mixed units", with_crs(|crs| crs.vertical_unit = Some("foot".into())), "is in foot"),
            ("vertical unit unknown", with_crs(|crs| crs.vertical_unit = None), "the unit of its"),
            ("cells not square", turned([30.0, 0.0, 0.0, -20.0]), "30 x 20 metre: 1.5000 times"),
            ("rotated", turned([30.0, 5.0, 5.0, -30.0]), "9.4623 degrees"),
            ("south-up", turned([30.0, 0.0, 0.0, 30.0]), "southernmost"),
            ("mirrored", turned([-30.0, 0.0, 0.0, -30.0]), "east to west"),
            ("points", GridInfo { pixel_is_point: true, ..plain() }, "half a cell"),
            ("several bands", GridInfo { bands: 3, band: 2, ..plain() }, "3 bands; band 2 is"),
            ("scaled", scaled, "int16 x 0.001 + 5;"),
            ("impossible nodata", GridInfo { nodata: Some(-99_999.0), ..plain() }, "no int16"),
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
        assert_eq!(notes_on_heights(100, 100, None), []);
        let told = notes_on_heights(200, 150, Some((-32_767.0, 7)));
        let kinds: Vec<_> = told.iter().map(|note| note.kind).collect();
        assert_eq!(kinds, [UNDECLARED, VOIDS]);
        assert!(told[0].text.starts_with("7 samples are -32767,"));
        assert!(told[1].text.starts_with("50 samples are void, 25.00 %"), "{told:?}");
        assert!(notes_on_heights(9, 0, None)[0].text.contains("no surface"));
        assert_eq!(NOTE_KINDS.len(), CHECKS.len() + 2);
        assert!(NOTE_KINDS.contains(&VOIDS) && NOTE_KINDS.contains(&"thin strips"));
    }
}
