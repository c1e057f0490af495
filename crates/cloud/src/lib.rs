//! Point clouds: point sources that are read in chunks, independent of the file formats.

mod agree;
mod attributes;
mod carry;
mod class;
mod column;
mod condition;
mod facts;
mod filter;
mod format;
mod frame;
mod held;
mod las;
mod lattice;
pub mod lazip;
mod member;
mod open;
mod origin;
mod polygon;
mod raw;
mod recast;
mod sieve;
mod source;
mod spacing;
pub mod synth;
mod text;
mod times;
mod version;
pub mod write;

pub use carry::{AppearanceReader, LasOutputFormat, PointAppearance, PointFormatConverter};
pub use class::class_name;
pub use condition::{AXES, Condition};
pub use filter::{CloudFilter, CompiledFilter, FilterRecord, FilterVerdict};
pub use format::PointFormat;
pub use held::{InMemoryCloud, PointMarks};
pub use open::{CloudOpenOptions, PointCloud, files, files_below, is_cloud, is_cloud_below, open};
pub use polygon::{FilterPolygon, PolygonRings};
pub use raw::Flags;
pub use source::{AttributeSource, BATCH, CloudInfo, Each, PointCensus, PointSource};
pub use spacing::{round_side, round_up};
pub use version::LasVersion;

pub use terrane_base::attribute::Return;
use terrane_base::error::Result;
use terrane_files::is_held;

/// Opens files as one cloud, a synthetic cloud, or a named cloud in memory.
///
/// # Errors
/// Errors of [`open`]; an unknown name; a synthetic cloud among other inputs.
pub fn source(inputs: &[String], options: &CloudOpenOptions) -> Result<Box<dyn PointSource>> {
    let source: Box<dyn PointSource> = match inputs {
        [name] if synth::is_synthetic(name) => {
            let survey = synth::survey(name)?;
            Box::new(synth::SyntheticCloud::new(survey, options.filter.clone())?)
        }
        [name] if is_held(name) => held::open(name, options)?,
        _ => return Ok(Box::new(open(inputs, options)?)),
    };
    options.filter.check_system(&source.info().crs)?;
    Ok(source)
}
