//! Lengths in units of the data, or in metres on the ground.

use terrane_base::geom::metres_in;
use terrane_options::{Json, OptionCodec, OptionKind};

/// A length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length {
    /// Value.
    pub value: f64,
    /// Metres per unit; `None` for units of the data.
    pub unit: Option<f64>,
}

impl Length {
    /// A length in metres, on the ellipsoid for longitudes and latitudes.
    pub fn metres(value: f64) -> Self {
        Self { value, unit: Some(1.0) }
    }
}

impl From<f64> for Length {
    /// In units of the data.
    fn from(value: f64) -> Self {
        Self { value, unit: None }
    }
}

/// A length in units of the data, or with a unit: `0.01`, `100m`, `2km`, `50ft`.
pub struct LengthText;

impl OptionCodec<Length> for LengthText {
    const KIND: OptionKind = OptionKind::Shaped("float | str");

    fn parse(text: &str) -> Result<Length, String> {
        let units = ["km", "ft", "m"];
        let unit =
            units.into_iter().find_map(|name| Some((text.strip_suffix(name)?, metres_in(name)?)));
        let (number, unit) = unit.map_or((text, None), |(number, metres)| (number, Some(metres)));
        match number.trim().parse::<f64>() {
            Ok(value) if value >= 0.0 && value.is_finite() => Ok(Length { value, unit }),
            _ => Err("expected a number of 0 or more, alone or with m, km or ft".to_owned()),
        }
    }

    fn json(length: &Length) -> Json {
        match length.unit {
            None => length.value.into(),
            Some(metres) => format!("{}m", length.value * metres).into(),
        }
    }

    fn number(length: &Length) -> Option<f64> {
        Some(length.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read_with_their_units() {
        let of = |text| LengthText::parse(text).map(|length: Length| (length.value, length.unit));
        assert_eq!(of("0.01"), Ok((0.01, None)));
        assert_eq!(of("100m"), Ok((100.0, Some(1.0))));
        assert_eq!(of("2 km"), Ok((2.0, Some(1000.0))));
        assert_eq!(of("50ft"), Ok((50.0, Some(0.3048))));
        assert!(["", "m", "-1", "NaN", "1 mile", "inf"].iter().all(|text| of(text).is_err()));
    }
}
