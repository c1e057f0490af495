//! Options of tile sets.

use terrane_options::{OptionRange, OptionRule, Options};

use super::format::TilesFormat;
use super::outside::TilesBeyond;
use terrane_engine::Resources;
use terrane_engine::options::{CellSize, CloudInput, FileName, GridInput, Replacing, Resuming};
use terrane_lidar::grid::{AsText, GroundFrom};
use terrane_lidar::points::CloudStages;

/// Content of tiles
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Tiles", rules = OF_FORMATS, setters = group)]
#[non_exhaustive]
pub struct TileOptions {
    /// Tile format; several formats go to a subfolder each
    #[option(short = 'f', value = "FORMAT", default = vec![TilesFormat::QuantizedMesh], default_text = "quantized-mesh")]
    pub format: Vec<TilesFormat>,
    /// Write the edge vertices of 3D Tiles (CESIUM_tile_edges, a draft extension); CesiumJS requires them for terrain
    pub tile_edges: bool,
    /// Compress 3D Tiles to less than half the size (EXT_meshopt_compression); clients must support the extension
    pub meshopt: bool,
    /// Add skirts to 3D Tiles, deep enough to hide gaps to the next coarser level, for viewers without skirts of their
    /// own
    pub skirts: bool,
    /// Maximum level
    #[option(value = "LEVEL", range = OptionRange::new(0.0, 20.0),
             default_text = "the first level with at most 64 samples along a tile side")]
    pub max_level: Option<u8>,
    /// Terrain between the edge of the grid and the sides of its tiles
    #[option(value = "GROUND")]
    pub beyond: TilesBeyond,
    /// Geoid model (GTX or GeoTIFF) of the heights of the grid, to convert them to ellipsoidal heights
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// Write vertex normals for lighting
    #[option(default = true, off = "Write no vertex normals")]
    pub normals: bool,
    /// Compress each file with gzip; a server must send "Content-Encoding: gzip"
    #[option(
        alias = "compress",
        default = true,
        off = "Write uncompressed files; by default files are gzipped and a server must send \"Content-Encoding: \
            gzip\""
    )]
    pub gzip: bool,
    /// Write a water mask of 256 x 256 pixels into each quantized-mesh tile (extension "watermask"): pixels with their
    /// centre in a polygon of ‹water›
    pub water_mask: bool,
}

const OF_FORMATS: &[OptionRule] = &[
    OptionRule::Needs("tile_edges", &["format=3dtiles"]),
    OptionRule::Needs("meshopt", &["format=3dtiles"]),
    OptionRule::Needs("skirts", &["format=3dtiles"]),
    OptionRule::Needs("water_mask", &["format=quantized-mesh"]),
];

/// Make terrain tiles of a grid for globe viewers, at every level of detail
///
/// The output folder holds quantized-mesh 1.0 tiles (EPSG:4326, TMS) with layer.json, or 3D Tiles 1.1 with
/// tileset.json, at every level down to the resolution of the grid. The error of a tile, as decoded on the ellipsoid,
/// is at most the error that clients assume for its level (77 km at level 0, half at each further level), or the stated
/// error of the level where quantization is coarser. Each tile states its maximum error. Adjacent tiles have the same
/// border. Voids are bridged. The grid may have any CRS; samples are transformed to WGS 84 without resampling. Heights
/// are ellipsoidal, or converted with ‹geoid›.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_WATER)]
#[non_exhaustive]
pub struct TilesOptions {
    /// Content of tiles.
    #[option(flatten)]
    pub tiles: TileOptions,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Where work is kept.
    #[option(flatten)]
    pub resuming: Resuming,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Make terrain tiles of a point cloud for globe viewers
///
/// The tiles are made from a terrain model, as by terrane grid ‹dtm›.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_WATER)]
#[non_exhaustive]
pub struct CloudTilesOptions {
    /// Content of tiles.
    #[option(flatten)]
    pub tiles: TileOptions,
    /// The model of the ground.
    #[option(flatten)]
    pub model: ModelOptions,
    /// File of water features in the CRS of the point cloud, to be flattened
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub water: Option<String>,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Where work is kept.
    #[option(flatten)]
    pub resuming: Resuming,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const OF_WATER: &[OptionRule] = &[OptionRule::Needs("water_mask", &["water"])];

terrane_engine::has_within!(CloudTilesOptions: ModelOptions => [CloudStages]);

/// Terrain model of a point cloud
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Model of the ground", setters = group)]
#[non_exhaustive]
pub struct ModelOptions {
    /// Cell size of the terrain model of a point cloud, or cell width and height, in CRS units
    #[option(value = "SIZE", with = CellSize,
             default_text = "the point spacing from the headers, rounded up to 1, 2 or 5 times a power of ten")]
    pub cell: Option<[f64; 2]>,
    /// Ground points of a point cloud, as in terrane grid: class, a method with parameters, or auto (by class if the
    /// cloud has ground points, else csf-ptd)
    #[option(value = "HOW", with = AsText)]
    pub ground: GroundFrom,
    /// Stages before.
    #[option(flatten)]
    pub stages: CloudStages,
}
