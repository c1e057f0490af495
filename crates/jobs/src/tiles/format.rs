//! The formats that tiles are written in.

use serde::{Deserialize, Serialize};

/// A format of tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Format {
    /// Quantized-mesh 1.0, with `layer.json`.
    #[default]
    #[serde(rename = "quantized-mesh")]
    QuantizedMesh,
    /// 3D Tiles 1.1, with `tileset.json`.
    #[serde(rename = "3dtiles")]
    ThreeTiles,
}

/// A format, its name, and what it is.
pub struct Known {
    /// Which.
    pub format: Format,
    /// As an option names it; also a folder where a run makes several.
    pub name: &'static str,
    /// In a line.
    pub about: &'static str,
}

/// All formats.
pub const FORMATS: [Known; 2] = [
    Known {
        format: Format::QuantizedMesh,
        name: "quantized-mesh",
        about: "quantized-mesh 1.0 and layer.json: terrain of CesiumJS and others",
    },
    Known {
        format: Format::ThreeTiles,
        name: "3dtiles",
        about: "3D Tiles 1.1 of binary glTF, with implicit tiling: any viewer of 3D Tiles",
    },
];

impl Format {
    /// Its entry.
    pub fn known(self) -> &'static Known {
        FORMATS.iter().find(|known| known.format == self).unwrap_or(&FORMATS[0])
    }

    /// The format of a name.
    pub fn named(name: &str) -> Option<Self> {
        FORMATS.iter().find(|known| known.name == name).map(|known| known.format)
    }
}
