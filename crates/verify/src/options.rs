//! Options of proofs: the files, and the requirements they are checked against.

use std::path::PathBuf;

use terrane_options::{Choice, OptionRange, OptionRule, Options};

use terrane_base::bound::ErrorBound;
use terrane_base::error::Result;
use terrane_engine::Resources;
use terrane_engine::bands::MeshBands;
use terrane_engine::options::Constraints;
use terrane_engine::options::{BoundName, CloudInput, FeatureInput, FileName, GridInput};
use terrane_engine::proof::WrittenOutput;
use terrane_simplify::{Length, LengthText, Metric};

/// The files and the options of a proof.
#[derive(Clone, Copy)]
pub(super) struct ProofQuestion<'a, O> {
    pub(super) written: &'a WrittenOutput,
    pub(super) options: &'a O,
}

/// Bands that the channels of a mesh are checked against.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelectedBands {
    /// Numbers, from 1, in the order of the mesh's channels.
    pub bands: Vec<u32>,
    /// A weight for each band; if empty, the weights stated by the mesh, or else 1.
    pub weights: Vec<f64>,
    /// The band of the heights; the one stated by the mesh when `None`.
    pub heights: Option<u32>,
}

/// Verify a mesh against its grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_MESHES)]
#[non_exhaustive]
pub struct MeshProof {
    /// Maximum vertical distance allowed
    #[option(value = "E", stands_for = "tolerance", range = OptionRange::FROM_ZERO,
             default_text = "as stated in the mesh file")]
    pub max_error: Option<f64>,
    /// Where the bound holds: at samples, or along the grid lines between them as well
    #[option(value = "WHAT", with = BoundName,
             default_text = "as stated in the mesh file, else samples")]
    pub bound: Option<ErrorBound>,
    /// Minimum triangle angle in plan view, in degrees
    #[option(value = "DEGREES", range = OptionRange::POSITIVE, default_text = "as stated in the mesh file")]
    pub min_angle: Option<f64>,
    /// Required vertices and edges.
    #[option(flatten)]
    pub constraints: Constraints,
    /// Input of the grid.
    #[option(flatten)]
    pub grid: GridInput,
    /// Bands approximated by the mesh, such as 1,2,3 for the colours of an image. Heights are those of ‹band›, if given
    #[option(value = "N,..", range = OptionRange::new(1.0, u32::MAX as f64), heading = "Bands")]
    pub bands: Vec<u32>,
    /// Weight of the error in each band
    #[option(value = "W,..", range = OptionRange::POSITIVE, heading = "Bands", default_text = "as stated \
        in the mesh")]
    pub weights: Vec<f64>,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const OF_MESHES: &[OptionRule] = &[
    OptionRule::Needs("weights", &["bands"]),
    OptionRule::NotWith("bands", &["bound=surface", "keep_points", "breaklines", "water"]),
];

/// Verify a mesh against its point cloud
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CloudMeshProof {
    /// Maximum vertical distance allowed
    #[option(value = "E", stands_for = "tolerance", range = OptionRange::FROM_ZERO,
             default_text = "as stated in the mesh file")]
    pub max_error: Option<f64>,
    /// Required vertices and edges.
    #[option(flatten)]
    pub constraints: Constraints,
    /// Input of the cloud.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Verify simplified lines against their original
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Lines", setters = own, rules = OF_LINES)]
#[non_exhaustive]
pub struct LineProof {
    /// Maximum distance allowed, in units of the data or with a unit: 100m, 2km, 50ft
    #[option(value = "LENGTH", stands_for = "max_error", with = LengthText, range = OptionRange::FROM_ZERO,
             default_text = "measured only")]
    pub tolerance: Option<Length>,
    /// Distance metric
    #[option(value = "NAME")]
    pub metric: Metric,
    /// Check crossings, rings, sides and shared borders as well
    pub topology: bool,
    /// File of points that must stay on the same side of every line
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub sides: Option<PathBuf>,
    /// Collapsed rings: rings that fit a segment within the tolerance may be missing, with their holes
    #[option(value = "HOW", default_text = "all rings are required")]
    pub collapse: Option<RemovedRings>,
    /// Input of the original lines.
    #[option(flatten)]
    pub features: FeatureInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Simplified lines to be proven.
#[derive(Clone, Debug)]
pub struct LineVerifyJob {
    /// The simplified lines.
    pub lines: PathBuf,
    /// The original of the lines.
    pub original: PathBuf,
    /// The object of a TopoJSON original; its first one when `None`.
    pub layer: Option<String>,
    /// Maximum distance allowed; only measured when `None`.
    pub tolerance: Option<Length>,
    /// Heights take part in distances.
    pub is_space: bool,
    /// Crossings, rings, sides and borders are checked as well.
    pub topology: bool,
    /// Rings that collapse within the tolerance may be missing.
    pub may_drop: bool,
    /// File of points that must stay on the same side of every line.
    pub sides: Option<PathBuf>,
    /// Resources of the job.
    pub resources: Resources,
}

/// Accepted changes of rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum RemovedRings {
    /// Collapsed rings may be missing
    Drop,
}

const OF_LINES: &[OptionRule] = &[OptionRule::Needs("sides", &["topology"])];

impl MeshProof {
    pub(super) fn tolerance(&self) -> Option<f64> {
        self.max_error.map(f64::abs)
    }

    /// The bands that the mesh's channels are checked against.
    pub(super) fn selected_bands(&self) -> Result<Option<SelectedBands>> {
        if self.bands.is_empty() {
            return Ok(None);
        }
        let heights = MeshBands::new(&self.bands, &self.weights, self.grid.band)?.heights();
        let (bands, weights) = (self.bands.clone(), self.weights.clone());
        Ok(Some(SelectedBands { heights, bands, weights }))
    }
}

impl CloudMeshProof {
    pub(super) fn tolerance(&self) -> Option<f64> {
        self.max_error.map(f64::abs)
    }
}
