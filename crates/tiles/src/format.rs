//! Formats of tiles.

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

/// Format of tiles, also the name of the subfolder if several formats are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice, Serialize, Deserialize)]
pub enum TilesFormat {
    /// quantized-mesh 1.0 with layer.json, for CesiumJS and others
    #[serde(rename = "quantized-mesh")]
    QuantizedMesh,
    /// 3D Tiles 1.1 of binary glTF with implicit tiling, for any viewer of 3D Tiles
    #[choice(name = "3dtiles")]
    #[serde(rename = "3dtiles")]
    ThreeTiles,
}
