//! Header of an ESRI ASCII grid: keys in any case and order, up to the first value.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_base::limits;

use super::tokens::{AscTokens, number};

const KEYS: [&str; 10] = [
    "ncols",
    "nrows",
    "xllcorner",
    "yllcorner",
    "xllcenter",
    "yllcenter",
    "cellsize",
    "dx",
    "dy",
    "nodata_value",
];

/// Content of the header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AscHeader {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) transform: Affine,
    /// True if the lower left position is that of a sample centre, not of a corner.
    pub(super) is_centre: bool,
    pub(super) nodata: Option<f64>,
    /// Offset and line number of the first value.
    pub(super) data: (u64, u64),
}

/// True if `head`, the first bytes of a file, is such a header.
pub(super) fn is_header(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head).to_lowercase();
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let first = text.split_ascii_whitespace().next().unwrap_or_default();
    KEYS.contains(&first) && first.len() < text.len()
}

/// Values by key, in the order of [`KEYS`].
#[derive(Default)]
struct AscHeaderValues([Option<f64>; KEYS.len()]);

impl AscHeaderValues {
    fn get(&self, key: &str) -> Option<f64> {
        KEYS.iter().position(|k| *k == key).and_then(|i| self.0[i])
    }

    fn need(&self, key: &str) -> Result<f64> {
        self.get(key).ok_or_else(|| Error::bad_input(format!("header lacks {key}")))
    }
}

/// Reads the header from the start of the file.
pub(super) fn read(tokens: &mut AscTokens<'_>) -> Result<AscHeader> {
    let mut values = AscHeaderValues::default();
    loop {
        let Some((offset, word)) = tokens.next()? else {
            return Err(Error::bad_input("file ends inside the header"));
        };
        let Some(key) = key_of(word) else {
            if number(word).is_none() {
                return Err(unknown(word).at(tokens.place()));
            }
            return finish(&values, (offset, tokens.line()));
        };
        let value = value_of(tokens, KEYS[key])?;
        if values.0[key].replace(value).is_some_and(|before| before != value) {
            let message = format!("conflicting values of {} in the header", KEYS[key]);
            return Err(Error::bad_input(message).at(tokens.place()));
        }
    }
}

fn key_of(word: &[u8]) -> Option<usize> {
    let word = word.strip_prefix(b"\xef\xbb\xbf").unwrap_or(word);
    KEYS.iter().position(|key| word.eq_ignore_ascii_case(key.as_bytes()))
}

fn value_of(tokens: &mut AscTokens<'_>, key: &str) -> Result<f64> {
    let value = tokens.next()?.and_then(|(_, word)| number(word));
    value.ok_or_else(|| {
        Error::bad_input(format!("{key} is not followed by a number")).at(tokens.place())
    })
}

fn unknown(word: &[u8]) -> Error {
    let word = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
    Error::bad_input(format!("{word:?} is neither a header key nor a number"))
}

fn finish(values: &AscHeaderValues, data: (u64, u64)) -> Result<AscHeader> {
    let width = side(values, "ncols")?;
    let height = side(values, "nrows")?;
    let (dx, dy) = match values.get("cellsize") {
        Some(size) => (size, size),
        None => (values.need("dx")?, values.need("dy")?),
    };
    let (x, half_x) = lower_left(values, "xllcorner", "xllcenter")?;
    let (y, half_y) = lower_left(values, "yllcorner", "yllcenter")?;
    let up = f64::from(height - 1) + half_y;
    let transform = Affine { x0: x + half_x * dx, a: dx, b: 0.0, y0: y + up * dy, d: 0.0, e: -dy };
    if dx <= 0.0 || dy <= 0.0 || !transform.is_valid() {
        return Err(Error::bad_input("invalid cell size or position in the header"));
    }
    let nodata = values.get("nodata_value");
    Ok(AscHeader { width, height, transform, is_centre: half_x == 0.0, nodata, data })
}

fn side(values: &AscHeaderValues, key: &str) -> Result<u32> {
    let value = values.need(key)?;
    if value < 1.0 || value.fract() != 0.0 || value.is_nan() {
        return Err(Error::bad_input(format!("{key} is {value}, expected a positive integer")));
    }
    limits::check(key, value as u64, limits::MAX_SIDE)?;
    Ok(value as u32)
}

/// The lower left coordinate, and its offset from the sample in cells.
fn lower_left(values: &AscHeaderValues, corner: &str, centre: &str) -> Result<(f64, f64)> {
    match values.get(centre) {
        Some(position) => Ok((position, 0.0)),
        None => Ok((values.need(corner)?, 0.5)),
    }
}
