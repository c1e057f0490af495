//! Options of tile sets.

use terrane_options::{OptionRange, OptionRule, Options};

use super::beyond::TilesBeyond;
use super::format::TilesFormat;
use terrane_engine::Resources;
use terrane_engine::options::{CellSize, CloudInput, FileName, GridInput, Replacing, Resuming};
use terrane_lidar::grid::{AsText, GroundFrom};

/// What tiles hold
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Tiles", rules = OF_FORMATS, setters = group)]
#[non_exhaustive]
pub struct TileOptions {
    /// What to write; of several, a folder for each inside of the output
    #[option(short = 'f', value = "FORMAT", default = vec![TilesFormat::QuantizedMesh], default_text = "quantized-mesh")]
    pub format: Vec<TilesFormat>,
    /// Name the vertices of the sides of 3D Tiles (CESIUM_tile_edges, an extension that is not final), which CesiumJS needs
    /// to take them for its terrain
    pub tile_edges: bool,
    /// Compress what is in a tile of 3D Tiles (EXT_meshopt_compression), which then takes less than half the bytes; clients
    /// have to know the extension
    pub meshopt: bool,
    /// Hang a skirt from the sides of each tile of 3D Tiles, as deep as borders of its level and of the next coarser one may
    /// differ, so that viewers without skirts of their own show no gap between levels
    pub skirts: bool,
    /// The deepest level
    #[option(value = "LEVEL", range = OptionRange::new(0.0, 20.0),
             default_text = "the first whose tiles have at most 64 samples along a side")]
    pub max_level: Option<u8>,
    /// The ground between the edge of the grid and the sides of the tiles that hold it
    #[option(value = "GROUND")]
    pub beyond: TilesBeyond,
    /// Heights of the geoid that those of the grid are counted from, above the ellipsoid: a file (GTX or GeoTIFF)
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// Write normals of vertices, which viewers light the ground by
    #[option(
        default = true,
        off = "Write no normals of vertices, which viewers light the ground by"
    )]
    pub normals: bool,
    /// Compress each file (gzip); they are to be served with "Content-Encoding: gzip"
    #[option(
        alias = "compress",
        default = true,
        off = "Write plain files; compressed ones (gzip) are to be served with \"Content-Encoding: gzip\""
    )]
    pub gzip: bool,
    /// Tell in each tile of quantized-mesh which of its 256 x 256 pixels are water of ‹water› (the extension "watermask"):
    /// those whose middle lies in a polygon
    pub water_mask: bool,
}

const OF_FORMATS: &[OptionRule] = &[
    OptionRule::Needs("tile_edges", &["format=3dtiles"]),
    OptionRule::Needs("meshopt", &["format=3dtiles"]),
    OptionRule::Needs("skirts", &["format=3dtiles"]),
    OptionRule::Needs("water_mask", &["format=quantized-mesh"]),
];

/// Make terrain tiles of a grid for viewers of the globe, at every level of detail
///
/// The folder holds quantized-mesh 1.0 tiles (EPSG:4326, TMS) of every level down to the resolution of the grid, and
/// layer.json; or 3D Tiles 1.1 of the same levels, and tileset.json. No sample is further from a tile, as a client decodes it
/// on the bent earth, than clients take its level to be off by (77 km at level 0, half as much at each further one), or than
/// its level states where the steps of its positions cannot tell samples apart; each tile says how far its samples are at the
/// most. Tiles beside each other have the same border. Voids are spanned. The grid may be in any system; its samples are
/// brought to WGS 84, and none is made up. Heights are taken from the ellipsoid on, or brought there with ‹geoid›.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_WATER)]
#[non_exhaustive]
pub struct TilesOptions {
    /// What tiles hold.
    #[option(flatten)]
    pub tiles: TileOptions,
    /// What is there already.
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

/// Make terrain tiles of a point cloud for viewers of the globe, by way of a model of its ground
///
/// The model is the one that terrane grid ‹dtm› makes, and the samples of tiles are those of the model.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_WATER)]
#[non_exhaustive]
pub struct CloudTilesOptions {
    /// What tiles hold.
    #[option(flatten)]
    pub tiles: TileOptions,
    /// The model of the ground.
    #[option(flatten)]
    pub model: ModelOptions,
    /// Water of a file of features, in the system of the cloud, made level
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub water: Option<String>,
    /// What is there already.
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

/// The model of the ground of a cloud
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Model of the ground", setters = group)]
#[non_exhaustive]
pub struct ModelOptions {
    /// Side of a cell of the model of a cloud, or its width and height, in the units of the CRS
    #[option(value = "SIZE", with = CellSize,
             default_text = "the distance between points as the headers tell it, rounded up to 1, 2 or 5 times a power of ten")]
    pub cell: Option<[f64; 2]>,
    /// Which points of a cloud are ground, as in terrane grid: class, a method with its parameters, or auto: by class if there
    /// are any, else by the method adaptive
    #[option(value = "HOW", with = AsText)]
    pub ground: GroundFrom,
}
