//! Point clouds: point sources that are read in parts, independent of the file formats.
//!
//! Points have two forms. [`PointSource::read`] hands on batches: positions in the frame of the cloud, and the attributes
//! that were selected as columns of numbers; nothing else is decoded. This is for work on points. The records of
//! [`PointFormatConverter::read`] are bytes of one point format, which carry all that a file holds, known or not. This is
//! for writing points, and for stages, which change single fields of them.

mod attributes;
mod class;
mod column;
mod condition;
mod consistency;
mod converter;
mod filter;
mod format;
mod frame;
mod header_summary;
mod in_memory;
mod inspect;
mod las;
pub mod lazip;
mod open;
mod origin;
mod point_filter;
mod point_format;
mod polygon;
mod quantization;
mod raw;
mod source;
mod source_file;
mod spacing;
pub mod synth;
mod text;
mod times;
mod version;
pub mod write;

pub use attributes::{AttributeSelection, CLASS_FLAGS, PointBatch};
pub use class::class_name;
pub use condition::{AXES, Condition};
pub use converter::{LasOutputFormat, NewDimension, NewDimensionValue, PointFormatConverter};
pub use filter::{CloudFilter, CompiledFilter, FilterRecord, FilterVerdict};
pub use format::PointFormat;
pub use in_memory::{InMemoryCloud, PointFlags};
pub use inspect::{InspectedPoint, StatedHeader, StatedLas};
pub use las::LegacyCounts;
pub use open::{CloudOpenOptions, PointCloud, files, files_below, is_cloud, is_cloud_below, open};
pub use polygon::{FilterPolygon, PolygonRings};
pub use raw::Flags;
pub use source::{BATCH, CloudInfo, PointConsumer, PointSource, ReturnCounts};
pub use spacing::{round_side, round_up, side_of};
pub use version::LasVersion;

pub use terrane_base::attribute::Return;
use terrane_base::error::Result;
use terrane_files::is_in_memory;

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
        [name] if is_in_memory(name) => in_memory::open(name, options)?,
        _ => return Ok(Box::new(open(inputs, options)?)),
    };
    options.filter.check_system(&source.info().crs)?;
    Ok(source)
}
