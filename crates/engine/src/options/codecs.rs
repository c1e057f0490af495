//! Codecs of option values.

use std::path::PathBuf;

use serde_json::Value as Json;
use terrane_options::{ChoiceName, OptionCodec, OptionKind};

use terrane_base::attribute::Return;
use terrane_base::bound::ErrorBound;
use terrane_base::byte_size;
use terrane_base::error::Error;
use terrane_base::geom::wkt;
use terrane_cloud::{Condition, Flags, LasVersion, PointFormat};
use terrane_files::{name_of, path_of};
use terrane_raster::SampleType;

/// A file name, of any bytes.
pub struct FileName;

impl OptionCodec<String> for FileName {
    const KIND: OptionKind = OptionKind::Path;

    fn parse(text: &str) -> Result<String, String> {
        if text.is_empty() { Err("expected a name".to_owned()) } else { Ok(text.to_owned()) }
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}

impl OptionCodec<PathBuf> for FileName {
    const KIND: OptionKind = OptionKind::Path;

    fn parse(text: &str) -> Result<PathBuf, String> {
        <Self as OptionCodec<String>>::parse(text).map(|name| path_of(&name).into_owned())
    }

    fn json(value: &PathBuf) -> Json {
        name_of(value.clone()).unwrap_or_else(|_| value.display().to_string()).into()
    }
}

/// A finite number.
pub struct FiniteNumber;

impl OptionCodec<f64> for FiniteNumber {
    const KIND: OptionKind = OptionKind::Number;

    fn parse(text: &str) -> Result<f64, String> {
        let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| "expected a number".to_owned())
    }

    fn json(value: &f64) -> Json {
        (*value).into()
    }

    fn number(value: &f64) -> Option<f64> {
        Some(*value)
    }
}

/// A finite number or NaN, for nodata values.
pub struct FiniteOrNan;

impl OptionCodec<f64> for FiniteOrNan {
    const KIND: OptionKind = OptionKind::Number;

    fn parse(text: &str) -> Result<f64, String> {
        let value = text.trim().parse::<f64>().ok().filter(|value| !value.is_infinite());
        value.ok_or_else(|| "expected a number or nan".to_owned())
    }

    fn json(value: &f64) -> Json {
        if value.is_finite() { (*value).into() } else { value.to_string().to_lowercase().into() }
    }
}

/// `xmin,ymin,xmax,ymax`.
pub struct BoundsText;

impl OptionCodec<[f64; 4]> for BoundsText {
    const KIND: OptionKind = OptionKind::Numbers;

    fn parse(text: &str) -> Result<[f64; 4], String> {
        let values: Result<Vec<f64>, String> = text.split(',').map(FiniteNumber::parse).collect();
        let bounds: Option<[f64; 4]> = values.ok().and_then(|values| values.try_into().ok());
        bounds.filter(|[xmin, ymin, xmax, ymax]| xmin < xmax && ymin < ymax).ok_or_else(|| {
            "expected xmin,ymin,xmax,ymax with xmin < xmax and ymin < ymax".to_owned()
        })
    }

    fn json(value: &[f64; 4]) -> Json {
        value.as_slice().into()
    }
}

/// `low,high`. Infinite ends are stored as the most extreme finite numbers.
pub struct Interval;

impl OptionCodec<[f64; 2]> for Interval {
    const KIND: OptionKind = OptionKind::Numbers;

    fn parse(text: &str) -> Result<[f64; 2], String> {
        let ends = text.split_once(',').and_then(|(low, high)| {
            let [low, high]: [f64; 2] = [low.trim().parse().ok()?, high.trim().parse().ok()?];
            // False for NaN, too.
            (low <= high).then_some([low, high])
        });
        let ends = ends.ok_or_else(|| "expected low,high with low <= high".to_owned())?;
        Ok(ends.map(|end| end.clamp(f64::MIN, f64::MAX)))
    }

    fn json(value: &[f64; 2]) -> Json {
        value.as_slice().into()
    }
}

/// `x,y`.
pub struct PositionText;

impl OptionCodec<[f64; 2]> for PositionText {
    const KIND: OptionKind = OptionKind::Numbers;

    fn parse(text: &str) -> Result<[f64; 2], String> {
        let place =
            text.split_once(',').map(|(x, y)| (FiniteNumber::parse(x), FiniteNumber::parse(y)));
        match place {
            Some((Ok(x), Ok(y))) => Ok([x, y]),
            _ => Err("expected x,y".to_owned()),
        }
    }

    fn json(value: &[f64; 2]) -> Json {
        value.as_slice().into()
    }
}

/// `side`, or `width,height`.
pub struct CellSize;

impl OptionCodec<[f64; 2]> for CellSize {
    const KIND: OptionKind = OptionKind::Numbers;

    fn parse(text: &str) -> Result<[f64; 2], String> {
        let (width, height) = text.split_once(',').unwrap_or((text, text));
        match (FiniteNumber::parse(width), FiniteNumber::parse(height)) {
            (Ok(width), Ok(height)) if width > 0.0 && height > 0.0 => Ok([width, height]),
            _ => Err("expected a number above zero, or two: width,height".to_owned()),
        }
    }

    fn json(value: &[f64; 2]) -> Json {
        value.as_slice().into()
    }
}

/// Byte sizes: `512M`, `4GiB`.
pub struct ByteSizeText;

/// Minimum memory of any job.
const MIN_BYTES: u64 = 1 << 20;

impl OptionCodec<u64> for ByteSizeText {
    const KIND: OptionKind = OptionKind::Shaped("int | str");

    fn parse(text: &str) -> Result<u64, String> {
        match FileSize::parse(text)? {
            ..MIN_BYTES => {
                Err("expected at least 1M; a number without K, M or G counts bytes".to_owned())
            }
            bytes => Ok(bytes),
        }
    }

    fn json(value: &u64) -> Json {
        (*value).into()
    }
}

/// File sizes, in the same form; any number above 0.
pub struct FileSize;

impl OptionCodec<u64> for FileSize {
    const KIND: OptionKind = OptionKind::Shaped("int | str");

    fn parse(text: &str) -> Result<u64, String> {
        byte_size::parse(text).ok_or_else(|| "expected a size such as 512M or 4GiB".to_owned())
    }

    fn json(value: &u64) -> Json {
        (*value).into()
    }
}

/// `KEY=VAL`, in any case.
pub struct KeyValue;

impl OptionCodec<(String, String)> for KeyValue {
    const KIND: OptionKind = OptionKind::Shaped("dict[str, Any]");

    fn parse(text: &str) -> Result<(String, String), String> {
        let pair = text.split_once('=').filter(|(key, _)| !key.is_empty());
        let pair = pair.map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()));
        pair.ok_or_else(|| "expected KEY=VAL".to_owned())
    }

    fn json((key, value): &(String, String)) -> Json {
        format!("{key}={value}").to_ascii_uppercase().into()
    }
}

/// The same for values that may be numbers.
pub struct AsNumber;

/// The same for formulas, which may begin with a sign.
pub struct AsFormula;

/// Implements codecs by `Display` and `FromStr`: `by_text!(AsText, OptionKind::Text, Canopy)`.
#[macro_export]
macro_rules! by_text {
    ($codec:ident, $kind:expr, $($type:ty)*) => {$(
        impl terrane_options::OptionCodec<$type> for $codec {
            const KIND: terrane_options::OptionKind = $kind;

            fn parse(text: &str) -> ::std::result::Result<$type, String> {
                text.parse::<$type>().map_err(|error| error.to_string())
            }

            fn json(value: &$type) -> terrane_options::Json {
                value.to_string().into()
            }
        }
    )*};
}

by_text!(AsFormula, OptionKind::Shaped("str"), Condition);
by_text!(AsNumber, OptionKind::Shaped("float | str"), LasVersion Return);

/// A LAS point format, by number.
pub struct PointFormatNumber;

impl OptionCodec<PointFormat> for PointFormatNumber {
    const KIND: OptionKind = OptionKind::Whole;

    fn parse(text: &str) -> Result<PointFormat, String> {
        let number =
            text.trim().parse().map_err(|_| "expected a number from 0 to 10".to_owned())?;
        PointFormat::new(number).map_err(|error| error.to_string())
    }

    fn json(value: &PointFormat) -> Json {
        value.number().into()
    }
}

fn about_flag(flag: Flags) -> &'static str {
    match flag {
        Flags::SYNTHETIC => "not from a direct measurement",
        Flags::KEY => "model key point, not to be thinned",
        Flags::WITHHELD => "excluded from processing",
        _ => "in the overlap of flight lines",
    }
}

/// The name of a point flag.
pub struct FlagName;

impl OptionCodec<Flags> for FlagName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let choices = Flags::ALL.map(|(name, flag)| ChoiceName { name, about: about_flag(flag) });
        choices.to_vec()
    });

    fn parse(text: &str) -> Result<Flags, String> {
        let found = Flags::ALL.into_iter().find(|(name, _)| *name == text.trim());
        found.map(|(_, flag)| flag).ok_or_else(|| {
            let names = Flags::ALL.map(|(name, _)| name).join(", ");
            format!("expected one of {names}")
        })
    }

    fn json(value: &Flags) -> Json {
        let found = Flags::ALL.into_iter().find(|(_, flag)| flag == value);
        found.map_or("", |(name, _)| name).into()
    }
}

/// A CRS by code or text.
pub struct CrsText;

impl OptionCodec<String> for CrsText {
    const KIND: OptionKind = OptionKind::Text;

    fn parse(text: &str) -> Result<String, String> {
        let crs = wkt::of_srs(text);
        match crs.epsg.is_some() || crs.wkt.is_some() {
            true => Ok(text.to_owned()),
            false => Err("expected EPSG:CODE or well-known text".to_owned()),
        }
    }

    fn json(value: &String) -> Json {
        wkt::with_codes(value).into()
    }
}

/// A length of a print in millimetres, or with a unit: `100mm`, `12cm`, `0.1m`, `4in`.
pub struct PrintLength;

impl OptionCodec<f64> for PrintLength {
    const KIND: OptionKind = OptionKind::Shaped("float | str");

    fn parse(text: &str) -> Result<f64, String> {
        let units = [("mm", 1.0), ("cm", 10.0), ("in", 25.4), ("m", 1000.0)];
        let unit =
            units.into_iter().find_map(|(name, of)| Some((text.trim().strip_suffix(name)?, of)));
        let (number, millimetres) = unit.unwrap_or((text, 1.0));
        let length = FiniteNumber::parse(number).ok().map(|value: f64| value * millimetres);
        let length = length.filter(|length| *length > 0.0 && length.is_finite());
        length.ok_or_else(|| {
            "expected a length above zero, such as 100mm, 12cm, 0.1m or 4in".to_owned()
        })
    }

    fn json(value: &f64) -> Json {
        (*value).into()
    }

    fn number(value: &f64) -> Option<f64> {
        Some(*value)
    }
}

/// A scale: `1:50000` or `0.001`.
pub struct PrintScale;

impl OptionCodec<f64> for PrintScale {
    const KIND: OptionKind = OptionKind::Shaped("float | str");

    fn parse(text: &str) -> Result<f64, String> {
        let (print, ground) = text.split_once(':').unwrap_or((text, "1"));
        let lengths: [Result<f64, String>; 2] = [print, ground].map(FiniteNumber::parse);
        match lengths {
            [Ok(print), Ok(ground)]
                if print > 0.0 && ground > 0.0 && (print / ground).is_normal() =>
            {
                Ok(print / ground)
            }
            _ => Err("expected a scale such as 1:50000 or 0.001".to_owned()),
        }
    }

    fn json(value: &f64) -> Json {
        (*value).into()
    }

    fn number(value: &f64) -> Option<f64> {
        Some(*value)
    }
}

/// The name of a tolerance bound.
pub struct BoundName;

impl OptionCodec<ErrorBound> for BoundName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let choices = ErrorBound::ALL.map(|bound| ChoiceName {
            name: bound.name(),
            about: match bound {
                ErrorBound::Samples => "at all valid samples",
                ErrorBound::Surface => "along the grid lines between samples as well",
            },
        });
        choices.to_vec()
    });

    fn parse(text: &str) -> Result<ErrorBound, String> {
        text.trim().parse().map_err(|error: Error| error.to_string())
    }

    fn json(value: &ErrorBound) -> Json {
        value.name().into()
    }
}

/// The name of a sample type.
pub struct SampleTypeName;

impl OptionCodec<SampleType> for SampleTypeName {
    const KIND: OptionKind = OptionKind::Text;

    fn parse(text: &str) -> Result<SampleType, String> {
        SampleType::by_name(text.trim()).ok_or_else(|| {
            let names: Vec<_> = SampleType::ALL.iter().map(|kind| kind.name()).collect();
            format!("expected one of {}", names.join(", "))
        })
    }

    fn json(value: &SampleType) -> Json {
        value.name().into()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Parses a text and returns its JSON form.
    fn read<T, C: OptionCodec<T>>(text: &str) -> Option<Json> {
        C::parse(text).ok().map(|value| C::json(&value))
    }

    #[test]
    fn values_are_read_from_texts_and_written_as_such() {
        let cell = read::<[f64; 2], CellSize>;
        assert_eq!(cell("1"), Some(json!([1.0, 1.0])));
        assert_eq!(cell("0.5,2"), Some(json!([0.5, 2.0])));
        assert!(["0", "-1", "a", "1,2,3", "1,0"].iter().all(|text| cell(text).is_none()));
        let interval = read::<[f64; 2], Interval>;
        assert_eq!(interval("-1.5,2"), Some(json!([-1.5, 2.0])));
        assert_eq!(interval("-inf,2"), Some(json!([f64::MIN, 2.0])));
        assert!(["2,1", "1", "a,b", "1,nan", "1,2,3"].iter().all(|text| interval(text).is_none()));
        let place = read::<[f64; 2], PositionText>;
        assert_eq!(place("-1.5,2"), Some(json!([-1.5, 2.0])));
        assert!(place("1").is_none() && place("1,inf").is_none());
        let flag = read::<Flags, FlagName>;
        assert_eq!((flag("overlap"), flag("withhold")), (Some(json!("overlap")), None));
        for text in ["first", "last", "only", "3"] {
            assert_eq!(read::<Return, AsNumber>(text), Some(json!(text)));
        }
        let length = <PrintLength as OptionCodec<f64>>::parse;
        for (text, millimetres) in
            [("100mm", 100.0), ("100", 100.0), ("12 cm", 120.0), ("4in", 101.6), ("2m", 2000.0)]
        {
            assert!(length(text).is_ok_and(|own| (own - millimetres).abs() < 1e-9), "{text}");
        }
        let scale = <PrintScale as OptionCodec<f64>>::parse;
        assert_eq!(
            (scale("1:50000"), scale("0.001"), scale("2:1")),
            (Ok(2e-5), Ok(0.001), Ok(2.0))
        );
        for text in ["", "mm", "-1mm", "0", "1:0", "1:2:3", "nan", "x", "5ft"] {
            assert!(length(text).is_err() && scale(text).is_err(), "{text}");
        }
        let size = |text| <ByteSizeText as OptionCodec<u64>>::parse(text);
        let good =
            [("128M", 128 << 20), ("4GiB", 4 << 30), ("512 MiB", 512 << 20), ("2tb", 2 << 40)];
        for (text, value) in good.into_iter().chain([("1536k", 3 << 19), ("2000000", 2_000_000)]) {
            assert_eq!(size(text), Ok(value), "{text}");
        }
        for text in ["1", "512", "1023K"] {
            assert!(
                size(text).is_err_and(|e| e.contains("at least 1M") && e.contains("K, M or G"))
            );
        }
        for text in ["", "M", "-1M", "0", "4X", "1e9", "1..5M", "99999999T", "4 G i B", "NaN"] {
            assert!(size(text).is_err(), "{text}");
        }
        let bounds = |text| BoundsText::parse(text);
        assert_eq!(bounds("-1, 2,3,4.5"), Ok([-1.0, 2.0, 3.0, 4.5]));
        for text in ["1,2,3", "1,2,3,4,5", "3,2,1,4", "1,2,1,4", "a,b,c,d", "1,2,inf,4"] {
            assert!(bounds(text).is_err(), "{text}");
        }
        for number in 0..=11 {
            let known = (number <= 10).then(|| json!(number));
            assert_eq!(read::<PointFormat, PointFormatNumber>(&number.to_string()), known);
        }
    }
}
