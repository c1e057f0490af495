//! Vertex channels: colours or band values.

use terrane_base::error::{Error, Result};

/// Storage type of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelKind {
    /// Integers from 0 to 255.
    Byte,
    /// An f32.
    Single,
    /// An f64.
    Double,
}

impl ChannelKind {
    /// Whether a value is stored exactly.
    fn stores(self, value: f64) -> bool {
        match self {
            Self::Byte => value == f64::from(value as u8),
            Self::Single => value == f64::from(value as f32),
            Self::Double => value.is_finite(),
        }
    }
}

/// A number per vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VertexChannel {
    /// "red", "green", "blue", "alpha", or "band_7".
    pub name: String,
    /// Storage type.
    pub kind: ChannelKind,
}

/// Vertex channels supported by a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VertexCapabilities {
    /// Positions only.
    Nothing,
    /// A colour of three or four bytes.
    Colours,
    /// Any channels.
    All,
}

/// Names of the channels of a colour.
pub(crate) const COLOURS: [&str; 4] = ["red", "green", "blue", "alpha"];
/// Prefix of the names of other channels.
pub(crate) const BAND: &str = "band_";

impl VertexChannel {
    /// Channels of bands: three or four byte bands are a colour, others are numeric channels.
    pub fn of_bands(bands: &[(u32, ChannelKind)]) -> Vec<Self> {
        let is_colour = matches!(bands.len(), 3 | 4)
            && bands.iter().all(|(_, kind)| *kind == ChannelKind::Byte);
        let channels = bands.iter().enumerate().map(|(place, (band, kind))| match kind {
            _ if is_colour => Self { name: COLOURS[place].to_owned(), kind: *kind },
            // No format stores bytes that are not colours.
            ChannelKind::Byte => Self { name: named(*band), kind: ChannelKind::Single },
            _ => Self { name: named(*band), kind: *kind },
        });
        channels.collect()
    }
}

fn named(band: u32) -> String {
    format!("{BAND}{band}")
}

/// True for the channels of a colour.
pub fn is_colour<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> bool {
    matches!(names.len(), 3 | 4) && names.zip(COLOURS).all(|(name, colour)| name == colour)
}

impl VertexCapabilities {
    /// True if these channels are supported.
    pub(crate) fn holds(self, channels: &[VertexChannel]) -> bool {
        let names = channels.iter().map(|channel| channel.name.as_str());
        match self {
            Self::All => true,
            Self::Colours => channels.is_empty() || is_colour(names),
            Self::Nothing => channels.is_empty(),
        }
    }
}

/// Fails unless there is a valid value for each channel of each vertex.
pub(crate) fn check_values(
    channels: &[VertexChannel],
    vertices: usize,
    values: &[f64],
) -> Result<()> {
    if values.len() != vertices * channels.len() {
        let (given, needed) = (values.len(), vertices * channels.len());
        return Err(Error::usage(format!("expected {needed} channel values, found {given}")));
    }
    let mut all = values.iter().zip(channels.iter().cycle());
    match all.find(|(value, channel)| !channel.kind.stores(**value)) {
        None => Ok(()),
        Some((value, VertexChannel { name, .. })) => {
            Err(Error::bad_input(format!("the channel {name} cannot store the value {value}")))
        }
    }
}

/// Linear intensity of each sRGB byte, as glTF requires.
pub(crate) fn linear() -> [f32; 256] {
    std::array::from_fn(|value| {
        let c = value as f64 / 255.0;
        (if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    })
}

/// The sRGB byte of a linear intensity: exact for values of [`linear`], interpolated otherwise.
pub(crate) fn from_linear(light: f32, table: &[f32; 256]) -> f64 {
    match table.binary_search_by(|known| known.total_cmp(&light)) {
        Ok(value) => value as f64,
        Err(_) => {
            let c = f64::from(light).clamp(0.0, 1.0);
            255.0 * if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
        }
    }
}

/// Opacity of a byte, from 0 to 1.
pub(crate) fn opacity(value: f64) -> f32 {
    (value / 255.0) as f32
}

/// The byte value of an [`opacity`].
pub(crate) fn from_opacity(share: f32) -> f64 {
    let value = f64::from(share) * 255.0;
    if opacity(value.round()) == share { value.round() } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FORMATS;
    use ChannelKind::{Byte, Double, Single};

    #[test]
    fn three_or_four_bytes_are_a_colour_and_all_else_numbers() {
        let names = |bands: &[(u32, ChannelKind)]| {
            let channels = VertexChannel::of_bands(bands);
            channels.into_iter().map(|c| (c.name, c.kind)).collect::<Vec<_>>()
        };
        let all = |kinds: &[(&str, ChannelKind)]| {
            kinds.iter().map(|(name, kind)| ((*name).to_owned(), *kind)).collect::<Vec<_>>()
        };
        let colour = all(&[("red", Byte), ("green", Byte), ("blue", Byte)]);
        assert_eq!(names(&[(4, Byte), (3, Byte), (2, Byte)]), colour);
        assert_eq!(names(&[(1, Byte), (2, Byte), (3, Byte), (9, Byte)])[3], ("alpha".into(), Byte));
        assert_eq!(names(&[(1, Byte)]), all(&[("band_1", Single)]));
        let mixed = all(&[("band_1", Single), ("band_2", Double), ("band_3", Single)]);
        assert_eq!(names(&[(1, Byte), (2, Double), (3, Single)]), mixed);
    }

    #[test]
    fn every_byte_comes_back_from_light_and_opacity() {
        let table = linear();
        assert!(table.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!((table[0], table[255]), (0.0, 1.0));
        for value in 0..=255_u8 {
            assert_eq!(from_linear(table[usize::from(value)], &table), f64::from(value));
            assert_eq!(from_opacity(opacity(f64::from(value))), f64::from(value));
        }
        // Mid grey has a fifth of the intensity of white.
        assert!((table[128] - 0.2159).abs() < 1e-4 && (table[10] - 0.003_035).abs() < 1e-6);
        let between = from_linear(f32::midpoint(table[100], table[101]), &table);
        assert!((100.4..100.6).contains(&between), "{between}");
        assert!(from_linear(f32::NAN, &table).is_nan());
    }

    #[test]
    fn values_that_cannot_be_stored_are_refused() {
        let check = |kind, values: &[f64]| {
            let channels = [VertexChannel { name: "band_1".to_owned(), kind }];
            check_values(&channels, 2, values)
        };
        assert!(check(Byte, &[0.0, 255.0]).is_ok() && check(Single, &[0.5, -7.0]).is_ok());
        assert!(check(Double, &[0.1, 1e300]).is_ok());
        for (kind, values) in [
            (Byte, &[0.0, 256.0][..]),
            (Byte, &[0.5, 1.0]),
            (Byte, &[-1.0, 1.0]),
            (Single, &[0.1, 1.0]),
            (Double, &[f64::NAN, 1.0]),
            (Single, &[f64::INFINITY.next_down(), 1.0]),
            (Byte, &[1.0]),
        ] {
            assert!(check(kind, values).is_err(), "{kind:?} {values:?}");
        }
    }

    #[test]
    fn formats_say_what_they_have_room_for() {
        let format = |name| FORMATS.iter().find(|format| format.name == name).unwrap();
        let colour = VertexChannel::of_bands(&[(1, Byte), (2, Byte), (3, Byte)]);
        let number = VertexChannel::of_bands(&[(1, Byte)]);
        for name in ["PLY", "GLB", "GLB-meshopt"] {
            assert!(format(name).check_channels(&colour).is_ok());
        }
        assert!(format("PLY").check_channels(&number).is_ok());
        let told = |name, channels| format(name).check_channels(channels).unwrap_err().to_string();
        assert!(told("GLB", &number).contains("GLB supports only vertex colours"));
        assert!(told("GLB", &number).ends_with("write PLY"));
        for name in ["STL", "OBJ"] {
            assert!(told(name, &colour).contains("no vertex channels"), "{}", told(name, &colour));
            assert!(told(name, &colour).ends_with("write PLY or GLB-meshopt or GLB"));
        }
    }
}
