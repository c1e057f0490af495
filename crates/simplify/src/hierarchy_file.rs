//! The hierarchy file of a job: created if missing, otherwise read along with the features.
//!
//! A header (64 bytes, little-endian: magic, version, metric, number of features, file size, and a digest of
//! these), then for each feature, in input order, the length of its record, the digest of its coordinates and
//! its hierarchies. Other properties of a feature may change, and files may be copied or converted: a hierarchy
//! belongs to coordinates, bit by bit.
//!
//! A record is at most as long as the vertices of its feature allow, so memory is that of a batch, and a false
//! length allocates nothing. Closed lines and rings are split before they reach the method, and a hierarchy
//! replaces the method after the split: collapsing rings, halves and policies share one implementation.

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::job::LineJob;
use super::tool::{DistanceKind, SimplifyRule};
use super::trees::{FeatureHierarchies, digest};
use terrane_base::error::{Error, Result};
use terrane_engine::plan::Digest;
use terrane_files::RawFile;
use terrane_files::atomic::AtomicFile;
use terrane_vector::Geometry;

/// Magic bytes of the file.
const MAGIC: [u8; 8] = *b"TRNLINHS";
/// Version of the format.
const VERSION: u32 = 1;
/// Size of the header in bytes: 32, and the digest.
const HEADER: u64 = 64;
/// Size of a record length in bytes.
const LENGTH: usize = 8;
/// Size of the read buffer in bytes.
const RUN: u64 = 1 << 20;

/// Metrics by their number in the header.
const MEASURES: [DistanceKind; 3] =
    [DistanceKind::Plane, DistanceKind::Space, DistanceKind::Geographic];

/// Source and destination of the hierarchies of a job.
#[derive(Default)]
pub(super) struct HierarchyFile {
    reader: Option<HierarchyReader>,
    writer: Option<HierarchyWriter>,
}

/// How a feature is simplified.
pub(super) enum HierarchyUse {
    /// By the method.
    Run,
    /// By new hierarchies.
    Make,
    /// By stored hierarchies (their bytes).
    Use(Vec<u8>),
}

impl HierarchyFile {
    /// The store of a job: reads an existing file, or creates one.
    pub(super) fn of(job: &LineJob, rule: &SimplifyRule) -> Result<Self> {
        let Some(path) = &job.hierarchy else { return Ok(Self::default()) };
        match path.symlink_metadata().is_ok() {
            true => {
                Ok(Self { reader: Some(HierarchyReader::open(path, rule.measure)?), writer: None })
            }
            false => Ok(Self {
                reader: None,
                writer: Some(HierarchyWriter::create(path, rule.measure)?),
            }),
        }
    }

    /// True if features are simplified by hierarchies.
    pub(super) fn is_some(&self) -> bool {
        self.reader.is_some() || self.writer.is_some()
    }

    /// True if hierarchies are created.
    pub(super) fn makes(&self) -> bool {
        self.writer.is_some()
    }

    /// How the next feature is simplified.
    pub(super) fn next(&mut self, geometry: &Geometry) -> Result<HierarchyUse> {
        match (&mut self.reader, &self.writer) {
            (Some(reader), _) => reader.next(geometry).map(HierarchyUse::Use),
            (None, Some(_)) => Ok(HierarchyUse::Make),
            (None, None) => Ok(HierarchyUse::Run),
        }
    }

    /// Stores the record of the next feature.
    pub(super) fn push(&mut self, record: &[u8]) -> Result<()> {
        self.writer.as_mut().map_or(Ok(()), |writer| writer.push(record))
    }

    /// Fails if the file continues after the last feature.
    pub(super) fn end(&self) -> Result<()> {
        self.reader.as_ref().map_or(Ok(()), HierarchyReader::end)
    }

    /// Completes a new file; returns the size of the file in bytes.
    pub(super) fn finish(self) -> Result<u64> {
        match (self.reader, self.writer) {
            (Some(reader), _) => Ok(reader.file.size()),
            (_, Some(writer)) => writer.finish(),
            _ => Ok(0),
        }
    }
}

/// The hierarchies of a feature, created or read.
///
/// # Errors
/// A part that the metric does not support; damaged hierarchies, or hierarchies of other coordinates.
pub(super) fn trees(
    order: HierarchyUse,
    geometry: &Geometry,
    rule: &SimplifyRule,
) -> Result<Option<FeatureHierarchies>> {
    match order {
        HierarchyUse::Run => Ok(None),
        HierarchyUse::Make => FeatureHierarchies::of(geometry, rule).map(Some),
        HierarchyUse::Use(record) => {
            let (own, trees) = record.split_at(Digest::BYTES);
            if *own != digest(geometry, rule.measure).bytes()[..] {
                return Err(Error::bad_input("the stored hierarchy belongs to other coordinates")
                    .remedy("delete the ‹hierarchy› file, or name another"));
            }
            FeatureHierarchies::from_bytes(trees).map(Some)
        }
    }
}

struct HierarchyReader {
    file: RawFile,
    /// Offset of the next record.
    at: u64,
    /// Number of remaining features.
    features: u64,
    buffer: Vec<u8>,
    /// Used bytes of the buffer.
    taken: usize,
}

impl HierarchyReader {
    fn open(path: &Path, measure: DistanceKind) -> Result<Self> {
        let file = RawFile::open(path)?;
        let header = file.head(HEADER)?;
        let features = features(&header, file.size(), measure).map_err(|e| e.in_file(path))?;
        Ok(Self { file, at: HEADER, features, buffer: Vec::new(), taken: 0 })
    }

    /// Record of the next feature.
    fn next(&mut self, geometry: &Geometry) -> Result<Vec<u8>> {
        let path = self.file.path().to_path_buf();
        if self.features == 0 {
            return Err(others("has fewer features than the input").in_file(&path));
        }
        self.features -= 1;
        let bytes = self.take(LENGTH as u64)?.try_into().map_or(0, u64::from_le_bytes);
        // The bound is of the input's feature, not of the file: a damaged length asks for no memory.
        if !(Digest::BYTES as u64..=FeatureHierarchies::max_bytes(geometry)).contains(&bytes) {
            return Err(others("holds a feature of another size than the input").in_file(&path));
        }
        self.take(bytes).map(<[u8]>::to_vec)
    }

    /// Next bytes; the caller has limited their number.
    fn take(&mut self, bytes: u64) -> Result<&[u8]> {
        let buffered = (self.buffer.len() - self.taken) as u64;
        if buffered < bytes {
            let rest = self.file.size().saturating_sub(self.at);
            // What is left of the buffer is read again, which is less than a feature.
            self.buffer = self.file.read_vec(self.at, RUN.min(rest).max(bytes))?;
            self.taken = 0;
        }
        self.at += bytes;
        let start = self.taken;
        self.taken += bytes as usize;
        Ok(&self.buffer[start..self.taken])
    }

    fn end(&self) -> Result<()> {
        match (self.features, self.file.size() - self.at) {
            (0, 0) => Ok(()),
            (0, _) => Err(damaged("bytes follow its end").in_file(self.file.path())),
            _ => Err(others("has more features than the input").in_file(self.file.path())),
        }
    }
}

/// Number of features, if the header of a file of `length` bytes is valid and of this metric.
fn features(header: &[u8], length: u64, measure: DistanceKind) -> Result<u64> {
    let Some((content, seal)) = header.split_at_checked(32) else {
        return Err(damaged("the header is truncated"));
    };
    if content[..8] != MAGIC {
        return Err(damaged("its signature is missing"));
    }
    let [version, measure_code] =
        [8, 12].map(|at| content[at..at + 4].try_into().map_or(0, u32::from_le_bytes));
    let [features, bytes] =
        [16, 24].map(|at| content[at..at + 8].try_into().map_or(0, u64::from_le_bytes));
    if version != VERSION {
        return Err(damaged(&format!("version {version} is not supported (expected {VERSION})")));
    }
    let found = MEASURES.get(measure_code as usize);
    let (true, Some(found)) = (*seal == Digest::of(content).bytes()[..], found) else {
        return Err(damaged("its header is damaged"));
    };
    if bytes != length {
        return Err(damaged(&format!("it is {length} bytes long, expected {bytes}")));
    }
    if *found != measure {
        let message =
            format!("holds {}, but the options require {}", name_of(*found), name_of(measure));
        return Err(Error::usage(message).remedy("name another ‹hierarchy›"));
    }
    Ok(features)
}

/// Description of a metric's distances.
fn name_of(measure: DistanceKind) -> &'static str {
    match measure {
        DistanceKind::Plane => "distances in x and y",
        DistanceKind::Space => "distances in x, y and z",
        DistanceKind::Geographic => "distances in metres on the ellipsoid",
    }
}

fn damaged(why: &str) -> Error {
    Error::bad_input(format!("is not a valid hierarchy file: {why}"))
        .remedy("delete it, or name another ‹hierarchy›")
}

fn others(what: &str) -> Error {
    Error::bad_input(format!("{what}: the hierarchy belongs to other lines"))
        .remedy("delete it, or name another ‹hierarchy›")
}

struct HierarchyWriter {
    out: BufWriter<AtomicFile>,
    path: PathBuf,
    measure: DistanceKind,
    features: u64,
    bytes: u64,
}

impl HierarchyWriter {
    fn create(path: &Path, measure: DistanceKind) -> Result<Self> {
        let out = BufWriter::with_capacity(RUN as usize, AtomicFile::create(path, false)?);
        let (path, bytes) = (path.to_path_buf(), HEADER);
        let mut writer = Self { out, path, measure, features: 0, bytes };
        writer.write(&[0; HEADER as usize])?;
        Ok(writer)
    }

    fn push(&mut self, record: &[u8]) -> Result<()> {
        self.features += 1;
        self.bytes += (LENGTH + record.len()) as u64;
        self.write(&(record.len() as u64).to_le_bytes())?;
        self.write(record)
    }

    fn finish(mut self) -> Result<u64> {
        let mut header = Vec::from(MAGIC);
        let measure = MEASURES.iter().position(|measure| *measure == self.measure);
        header.extend(VERSION.to_le_bytes());
        header.extend((measure.unwrap_or_default() as u32).to_le_bytes());
        header.extend(self.features.to_le_bytes());
        header.extend(self.bytes.to_le_bytes());
        header.extend(*Digest::of(&header).bytes());
        self.out.seek(SeekFrom::Start(0)).map_err(|e| Error::write(&self.path, e))?;
        self.write(&header)?;
        let file = self.out.into_inner().map_err(|e| Error::write(&self.path, e.into_error()))?;
        file.commit()
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_line::METHODS;
    use terrane_line::topology::RingCollapse;

    fn rule(measure: DistanceKind) -> SimplifyRule {
        SimplifyRule {
            method: &METHODS[1],
            measure,
            threshold: 0.0,
            collapse: RingCollapse::Minimal,
        }
    }

    fn zigzag(count: usize) -> Geometry {
        Geometry::line((0..count).map(|i| [i as f64, (i * i % 7) as f64]).collect())
    }

    /// A file of the hierarchies of two lines.
    fn file(folder: &Path) -> (PathBuf, Vec<u8>) {
        let path = folder.join("h");
        let mut writer = HierarchyWriter::create(&path, DistanceKind::Plane).unwrap();
        for line in [zigzag(50), zigzag(9)] {
            let trees = FeatureHierarchies::of(&line, &rule(DistanceKind::Plane)).unwrap();
            writer.push(&trees.record(&line, DistanceKind::Plane)).unwrap();
        }
        assert!(!path.exists());
        let bytes = writer.finish().unwrap();
        let all = std::fs::read(&path).unwrap();
        assert_eq!(bytes, all.len() as u64);
        (path, all)
    }

    /// Reads all of a file that should be of those two lines.
    fn read(path: &Path) -> Result<Vec<FeatureHierarchies>> {
        let mut reader = HierarchyReader::open(path, DistanceKind::Plane)?;
        let mut next = |line: Geometry| {
            trees(HierarchyUse::Use(reader.next(&line)?), &line, &rule(DistanceKind::Plane))
        };
        let all = [next(zigzag(50))?, next(zigzag(9))?];
        reader.end()?;
        Ok(all.into_iter().flatten().collect())
    }

    /// The file with another header, sealed.
    fn with_checksum(bytes: &[u8], at: usize, value: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        bytes[at..at + value.len()].copy_from_slice(value);
        let seal = *Digest::of(&bytes[..32]).bytes();
        bytes[32..64].copy_from_slice(&seal);
        bytes
    }

    #[test]
    fn what_is_stored_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let (path, _) = file(folder.path());
        let made = [50, 9]
            .map(|n| FeatureHierarchies::of(&zigzag(n), &rule(DistanceKind::Plane)).unwrap());
        assert_eq!(read(&path).unwrap(), made);
    }

    #[test]
    fn every_flipped_byte_and_every_cut_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let (path, all) = file(folder.path());
        for at in 0..all.len() {
            let mut bytes = all.clone();
            bytes[at] ^= 0x41;
            std::fs::write(&path, &bytes).unwrap();
            assert!(read(&path).is_err(), "byte {at}");
            std::fs::write(&path, &all[..at]).unwrap();
            assert!(read(&path).is_err(), "the first {at} bytes");
        }
    }

    #[test]
    fn claims_under_a_right_seal_are_checked_before_memory_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let (path, all) = file(folder.path());
        let told = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read(&path).unwrap_err().to_string()
        };
        assert!(told(&with_checksum(&all, 8, &9_u32.to_le_bytes())).contains("version 9"));
        assert!(told(&with_checksum(&all, 12, &7_u32.to_le_bytes())).contains("header is damaged"));
        assert!(
            told(&with_checksum(&all, 12, &2_u32.to_le_bytes()))
                .contains("metres on the ellipsoid")
        );
        assert!(told(&with_checksum(&all, 16, &u64::MAX.to_le_bytes())).contains("more features"));
        assert!(told(&with_checksum(&all, 16, &1_u64.to_le_bytes())).contains("fewer features"));
        assert!(told(&with_checksum(&all, 24, &u64::MAX.to_le_bytes())).contains("bytes long"));
        for length in [0, 31, u64::MAX] {
            let mut bytes = all.clone();
            bytes[64..72].copy_from_slice(&length.to_le_bytes());
            assert!(told(&bytes).contains("another size"), "{length}");
        }
        // The length of a hierarchy in its record.
        for length in [3, 1 << 40, u64::MAX] {
            let mut bytes = all.clone();
            bytes[104..112].copy_from_slice(&length.to_le_bytes());
            assert!(told(&bytes).contains("hierarch"), "{length}");
        }
    }

    #[test]
    fn hierarchies_belong_to_coordinates_and_to_how_they_make_parts() {
        let square = || vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]];
        let polygon = |xy| {
            let coordinates = terrane_vector::CoordinateSequence::of(xy);
            Geometry::new(terrane_vector::GeometryType::Polygon, coordinates).unwrap()
        };
        let plane = |geometry: &Geometry| digest(geometry, DistanceKind::Plane);
        let own = plane(&polygon(square()));
        assert_ne!(own, plane(&Geometry::line(square())), "a ring is no line");
        let mut moved = square();
        moved[1][1] = f64::MIN_POSITIVE;
        assert_ne!(own, plane(&polygon(moved)));
        let mut high = terrane_vector::CoordinateSequence::default();
        square().into_iter().for_each(|xy| high.push(xy, Some(xy[0]), None));
        let high = Geometry::new(terrane_vector::GeometryType::Polygon, high).unwrap();
        assert_eq!(own, plane(&high), "heights take no part in the plane");
        assert_ne!(digest(&high, DistanceKind::Space), plane(&high));
    }
}
