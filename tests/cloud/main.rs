//! Point clouds: read, filtered, made and written.

#[path = "../common/cloud_support.rs"]
mod cloud_support;
#[path = "../common/data.rs"]
mod data;

mod above;
mod choices;
mod columns;
mod discs;
mod filters;
mod formats;
mod lookups;
mod noise;
mod noise_plan;
mod normals;
mod octree;
mod qa;
mod qa_faults;
mod stages;
mod synth;
mod translate;
mod tree_tops;
mod versions;
mod whole;
mod write;
