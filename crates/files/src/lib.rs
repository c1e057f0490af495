//! Input files: read by position, and found by name, in folders, lists and patterns. Output files: written
//! sequentially and atomically, or as unnamed temporary files.

pub mod atomic;
mod companions;
pub mod fault;
pub mod format;
mod glob;
mod in_memory;
mod list;
mod lock;
mod machine;
mod name;
mod out;
mod position;
mod raw;
#[cfg_attr(not(feature = "remote"), path = "no_remote.rs")]
mod remote;
mod spool;
pub mod xml;

pub use companions::{beside_grid, companions, prj};
pub use in_memory::{InMemoryRegistry, InMemoryResource, is_in_memory, is_made, refuse_in_memory};
pub use list::FileKind;
pub use lock::{lock, unlocked, wait};
pub use machine::{cores, on_threads, physical_memory, proc_bytes};
pub use name::{
    absolute, is_file, is_remote, is_there, name_of, path_of, shown, shown_all, without_query,
};
pub use out::AppendWriter;
pub use position::{read_exact_at, write_all_at};
pub use raw::{AHEAD, RawFile, RawFileReader, RowRun, to_usize};
pub use spool::{
    AggregatedRecords, BucketWriter, Buckets, KeyedRecord, SpoolExtent, SpoolFile, folder_for,
    nameless,
};
