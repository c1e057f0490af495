//! Formats of tiles.

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

/// A format of tiles; its name is also the subfolder in an output with several formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice, Serialize, Deserialize)]
pub enum TilesFormat {
    /// quantized-mesh 1.0 and layer.json: terrain of CesiumJS and others
    #[serde(rename = "quantized-mesh")]
    QuantizedMesh,
    /// 3D Tiles 1.1 of binary glTF, with implicit tiling: any viewer of 3D Tiles
    #[choice(name = "3dtiles")]
    #[serde(rename = "3dtiles")]
    ThreeTiles,
}
