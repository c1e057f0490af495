//! Header information of a single file, for people.

use super::las::{LasFile, LasHeader};
use super::open::PointCloud;
use super::source_file::CloudFile;

/// Maximum number of listed VLRs.
const MAX_VLRS: usize = 12;

impl PointCloud {
    /// Common file format.
    pub fn format(&self) -> &'static str {
        let mut kinds = self.kinds().map(|file| match file {
            CloudFile::Las(file) if file.is_copc => "COPC",
            CloudFile::Las(file) if file.header.is_compressed => "LAZ",
            CloudFile::Las(_) => "LAS",
            CloudFile::Text(_) => "text",
        });
        let first = kinds.next().unwrap_or("none");
        if kinds.all(|kind| kind == first) { first } else { "mixed" }
    }

    /// Header information other than the extent, by name.
    pub fn details(&self) -> Vec<(String, String)> {
        let found = self.las().map(of_las).unwrap_or_default();
        found.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

fn of_las(file: &LasFile) -> Vec<(&'static str, String)> {
    let LasHeader { version, format, record, system, software, created, .. } = &file.header;
    let extra = file.header.extra_bytes();
    let mut details = vec![
        ("version", format!("{}.{}", version[0], version[1])),
        ("point format", format!("{format}, {record} bytes, {extra} of them extra")),
    ];
    let known = [("system", system), ("software", software)];
    details.extend(known.into_iter().filter(|(_, s)| !s.is_empty()).map(|(n, s)| (n, s.clone())));
    if created[1] > 0 {
        details.push(("created", format!("day {} of {}", created[0], created[1])));
    }
    details.push(("packing", packing(file)));
    if file.header.time_offset > 0 {
        let millions = file.header.time_offset;
        details.push(("times", format!("GPS times less {millions} million seconds")));
    }
    let named = file.vlrs.iter().take(MAX_VLRS).map(|vlr| {
        let about = if vlr.description.is_empty() { "" } else { ", " };
        format!("{} {} ({} bytes{about}{})", vlr.user, vlr.id, vlr.bytes, vlr.description)
    });
    let mut named: Vec<_> = named.collect();
    if file.vlrs.len() > MAX_VLRS {
        named.push(format!("{} more", file.vlrs.len() - MAX_VLRS));
    }
    if !named.is_empty() {
        details.push(("records", named.join("; ")));
    }
    details
}

fn packing(file: &LasFile) -> String {
    let Some(layout) = &file.layout else { return "none".to_owned() };
    let most = file.parts.iter().map(|part| part.points).max().unwrap_or(0);
    let parts = file.parts.len();
    let what = if file.is_copc { "nodes of an octree" } else { "chunks" };
    format!("{}, {parts} {what} of at most {most} points", layout.compressor.name())
}
