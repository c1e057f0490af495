//! Point clouds made in memory: any point format, version, packing; and reading them whole.

#![allow(dead_code, reason = "each test file uses a part")]

use std::io::Cursor;
use std::path::Path;

use laz::{LasZipCompressor, LasZipDecompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use terrane::Result;
use terrane_cloud::{self as cloud, CloudOpenOptions, PointCloud, PointSource, ReturnCounts};

/// Bytes of a record by point format.
pub(crate) const RECORD: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Scale and offset of what is made.
pub(crate) const SCALE: [f64; 3] = [0.01, 0.01, 0.001];
pub(crate) const OFFSET: [f64; 3] = [1000.0, 2000.0, 0.0];

/// A small generator of repeatable numbers (xorshift).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn of(seed: usize) -> Self {
        Self((seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    pub(crate) fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % most as u64) as usize
    }
}

/// How points are packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Packing {
    Plain,
    Fixed(u32),
    Variable(u32),
    /// One stream without chunks.
    Stream,
}

/// A file to be made.
#[derive(Clone, Debug)]
pub(crate) struct Made {
    pub(crate) format: u8,
    pub(crate) minor: u8,
    pub(crate) extra: u16,
    pub(crate) packing: Packing,
    pub(crate) records: Vec<Vec<u8>>,
    /// User, number, data.
    pub(crate) vlrs: Vec<(&'static str, u16, Vec<u8>)>,
    pub(crate) evlrs: Vec<(&'static str, u16, Vec<u8>)>,
    pub(crate) scale: [f64; 3],
    pub(crate) offset: [f64; 3],
}

/// Whole coordinates of a record.
pub(crate) fn raw(record: &[u8]) -> [i32; 3] {
    [0, 4, 8].map(|at| i32::from_le_bytes(record[at..at + 4].try_into().unwrap()))
}

/// Records of a walk through classes, returns and flags.
pub(crate) fn records(format: u8, extra: u16, count: usize, seed: usize) -> Vec<Vec<u8>> {
    let mut random = Random::of(seed);
    let mut at = [0_i32; 3];
    let record = |_| {
        let mut bytes = vec![0; usize::from(RECORD[usize::from(format)] + extra)];
        for (axis, at) in at.iter_mut().enumerate() {
            *at += random.below(2001) as i32 - 1000;
            bytes[4 * axis..4 * axis + 4].copy_from_slice(&at.to_le_bytes());
        }
        bytes.iter_mut().skip(17).for_each(|b| *b = random.below(7) as u8);
        let returns = 1 + random.below(5) as u8;
        let number = 1 + random.below(returns.into()) as u8;
        let flags = if random.below(4) == 0 { random.below(8) as u8 } else { 0 };
        let class = [1, 2, 2, 5, 6, 12][random.below(6)];
        if format < 6 {
            (bytes[14], bytes[15]) = (number | returns << 3, class | flags << 5);
        } else {
            let overlap = random.below(3) as u8 / 2 * 8;
            (bytes[14], bytes[15], bytes[16]) = (number | returns << 4, flags | overlap, class);
        }
        bytes
    };
    (0..count).map(record).collect()
}

impl Made {
    pub(crate) fn new(format: u8, packing: Packing, count: usize) -> Self {
        let minor = if format < 6 { 2 } else { 4 };
        Self {
            format,
            minor,
            extra: 0,
            packing,
            records: records(format, 0, count, usize::from(format)),
            vlrs: Vec::new(),
            evlrs: Vec::new(),
            scale: SCALE,
            offset: OFFSET,
        }
    }

    pub(crate) fn with_extra(mut self, extra: u16) -> Self {
        self.records = records(self.format, extra, self.records.len(), 77);
        Self { extra, ..self }
    }

    /// The file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let (points, vlr) = self.points();
        let mut vlrs = self.vlrs.clone();
        vlrs.extend(vlr.map(|data| ("laszip encoded", 22_204, data)));
        let size = [227_usize, 227, 227, 235, 375, 393][usize::from(self.minor)];
        let at = size + vlrs.iter().map(|(_, _, data)| 54 + data.len()).sum::<usize>();
        let mut points = points;
        if matches!(self.packing, Packing::Fixed(_) | Packing::Variable(_)) {
            let table = u64::from_le_bytes(points[..8].try_into().unwrap());
            points[..8].copy_from_slice(&(table + at as u64).to_le_bytes());
        }
        let mut file = self.header(size, at, vlrs.len(), at + points.len());
        for (user, id, data) in &vlrs {
            let head = file.len();
            file.resize(head + 54, 0);
            file[head + 2..head + 2 + user.len()].copy_from_slice(user.as_bytes());
            file[head + 18..head + 20].copy_from_slice(&id.to_le_bytes());
            file[head + 20..head + 22].copy_from_slice(&(data.len() as u16).to_le_bytes());
            file.extend(data);
        }
        file.extend(points);
        for (user, id, data) in &self.evlrs {
            let head = file.len();
            file.resize(head + 60, 0);
            file[head + 2..head + 2 + user.len()].copy_from_slice(user.as_bytes());
            file[head + 18..head + 20].copy_from_slice(&id.to_le_bytes());
            file[head + 20..head + 28].copy_from_slice(&(data.len() as u64).to_le_bytes());
            file.extend(data);
        }
        file
    }

    fn header(&self, size: usize, at: usize, vlrs: usize, evlrs_at: usize) -> Vec<u8> {
        let mut head = vec![0; size];
        let mut put = |at: usize, bytes: &[u8]| head[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"LASF");
        put(24, &[1, self.minor]);
        put(94, &(size as u16).to_le_bytes());
        put(96, &(at as u32).to_le_bytes());
        put(100, &(vlrs as u32).to_le_bytes());
        put(104, &[self.format | if self.packing == Packing::Plain { 0 } else { 128 }]);
        put(105, &(RECORD[usize::from(self.format)] + self.extra).to_le_bytes());
        let count = self.records.len();
        put(107, &(if self.format < 6 { count as u32 } else { 0 }).to_le_bytes());
        for axis in 0..3 {
            let ends = self.records.iter().map(|record| raw(record)[axis]);
            let world = |steps: Option<i32>| {
                f64::from(steps.unwrap_or(0)) * self.scale[axis] + self.offset[axis]
            };
            put(131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(155 + 8 * axis, &self.offset[axis].to_le_bytes());
            put(179 + 16 * axis, &world(ends.clone().max()).to_le_bytes());
            put(187 + 16 * axis, &world(ends.min()).to_le_bytes());
        }
        if self.minor >= 4 {
            put(235, &(evlrs_at as u64).to_le_bytes());
            put(243, &(self.evlrs.len() as u32).to_le_bytes());
            put(247, &(count as u64).to_le_bytes());
        }
        head
    }

    /// Points as they are in the file, and the LASzip record.
    fn points(&self) -> (Vec<u8>, Option<Vec<u8>>) {
        let items = LazItemRecordBuilder::default_for_point_format_id(self.format, self.extra);
        let builder = LazVlrBuilder::new(items.unwrap());
        let (vlr, every) = match self.packing {
            Packing::Plain => return (self.records.concat(), None),
            Packing::Fixed(points) => (builder.with_fixed_chunk_size(points).build(), None),
            Packing::Variable(points) => (builder.with_variable_chunk_size().build(), Some(points)),
            Packing::Stream => (builder.with_fixed_chunk_size(1 << 30).build(), None),
        };
        let mut out = Cursor::new(Vec::new());
        let mut data = Vec::new();
        vlr.write_to(&mut data).unwrap();
        let mut packer = LasZipCompressor::new(&mut out, vlr).unwrap();
        for (number, record) in self.records.iter().enumerate() {
            if every.is_some_and(|n| number > 0 && number.is_multiple_of(n as usize)) {
                packer.finish_current_chunk().unwrap();
            }
            packer.compress_one(record).unwrap();
        }
        packer.done().unwrap();
        drop(packer);
        let bytes = out.into_inner();
        if self.packing != Packing::Stream {
            return (bytes, Some(data));
        }
        let table = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        data[..2].copy_from_slice(&1_u16.to_le_bytes());
        (bytes[8..table].to_vec(), Some(data))
    }

    /// World coordinates of all points.
    pub(crate) fn world(&self) -> Vec<[f64; 3]> {
        let place = |record: &Vec<u8>| {
            let raw = raw(record);
            std::array::from_fn(|i| f64::from(raw[i]) * self.scale[i] + self.offset[i])
        };
        self.records.iter().map(place).collect()
    }
}

/// A file taken apart: point format, records, and user, number and data of the other records.
pub(crate) struct Whole {
    pub(crate) format: u8,
    pub(crate) records: Vec<Vec<u8>>,
    pub(crate) vlrs: Vec<(String, u16, Vec<u8>)>,
}

pub(crate) fn number<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().unwrap()
}

/// Reads a file by its header and the `laz` crate alone.
pub(crate) fn whole(path: &Path) -> Whole {
    let bytes = std::fs::read(path).unwrap();
    let (minor, head) = (bytes[25], u16::from_le_bytes(number(&bytes, 94)));
    let at = u32::from_le_bytes(number(&bytes, 96)) as usize;
    let (format, size) = (bytes[104] & 127, usize::from(u16::from_le_bytes(number(&bytes, 105))));
    let count = match minor {
        4.. => u64::from_le_bytes(number(&bytes, 247)) as usize,
        _ => u32::from_le_bytes(number(&bytes, 107)) as usize,
    };
    let (mut vlrs, mut next) = (Vec::new(), usize::from(head));
    let mut take = |next: &mut usize, head: usize, length: usize| {
        let user = String::from_utf8_lossy(&bytes[*next + 2..*next + 18]);
        let id = u16::from_le_bytes(number(&bytes, *next + 18));
        let data = bytes[*next + head..*next + head + length].to_vec();
        vlrs.push((user.trim_end_matches('\0').to_owned(), id, data));
        *next += head + length;
    };
    for _ in 0..u32::from_le_bytes(number(&bytes, 100)) {
        let length = usize::from(u16::from_le_bytes(number(&bytes, next + 20)));
        take(&mut next, 54, length);
    }
    if minor >= 4 {
        let mut next = u64::from_le_bytes(number(&bytes, 235)) as usize;
        for _ in 0..u32::from_le_bytes(number(&bytes, 243)) {
            let length = u64::from_le_bytes(number(&bytes, next + 20)) as usize;
            take(&mut next, 60, length);
        }
    }
    let mut points = vec![0; count * size];
    match vlrs.iter().find(|(_, id, _)| *id == 22_204) {
        None => points.copy_from_slice(&bytes[at..at + count * size]),
        Some((_, _, data)) if count > 0 => {
            let mut file = Cursor::new(&bytes);
            file.set_position(at as u64);
            let mut unpacker =
                LasZipDecompressor::new(file, LazVlr::from_buffer(data).unwrap()).unwrap();
            unpacker.decompress_many(&mut points).unwrap();
        }
        Some(_) => {}
    }
    let records = points.chunks_exact(size).map(<[u8]>::to_vec).collect();
    Whole { format, records, vlrs }
}

/// A COPC file of two levels with `each` points a node.
pub(crate) fn copc(each: usize) -> Vec<u8> {
    let mut random = Random::of(5);
    let mut made = Made::new(6, Packing::Variable(each as u32), each * 9);
    let half = 1 << 10;
    for (number, record) in made.records.iter_mut().enumerate() {
        let node = number / each;
        for axis in 0..3 {
            let low = if node == 0 { 0 } else { ((node - 1) >> axis & 1) * half };
            let size = if node == 0 { 2 * half } else { half };
            let steps = (low + random.below(size)) as i32;
            record[4 * axis..4 * axis + 4].copy_from_slice(&steps.to_le_bytes());
        }
    }
    (made.scale, made.offset) = ([1.0; 3], [0.0; 3]);
    made.vlrs = vec![("copc", 1, vec![0; 160])];
    made.evlrs = vec![("copc", 1000, vec![0; 32 * 9])];
    let mut file = made.bytes();
    let evlrs_at = u64::from_le_bytes(file[235..243].try_into().unwrap()) as usize;
    let points_at = u32::from_le_bytes(file[96..100].try_into().unwrap()) as usize;
    let info = 375 + 54;
    for (at, value) in [(0, half as f64), (8, half as f64), (16, half as f64), (24, half as f64)] {
        file[info + at..info + at + 8].copy_from_slice(&value.to_le_bytes());
    }
    let page = (evlrs_at + 60) as u64;
    file[info + 40..info + 48].copy_from_slice(&page.to_le_bytes());
    file[info + 48..info + 56].copy_from_slice(&(32_u64 * 9).to_le_bytes());
    let mut at = points_at as u64 + 8;
    for node in 0..9_usize {
        let alone = Made { records: made.records[node * each..][..each].to_vec(), ..made.clone() };
        let (packed, _) = alone.points();
        let bytes = u64::from_le_bytes(packed[..8].try_into().unwrap()) - 8;
        let entry = &mut file[page as usize + 32 * node..][..32];
        let child = node.max(1) - 1;
        let key = [usize::from(node > 0), child & 1, child >> 1 & 1, child >> 2 & 1];
        for (i, part) in key.into_iter().enumerate() {
            entry[4 * i..4 * i + 4].copy_from_slice(&(part as i32).to_le_bytes());
        }
        entry[16..24].copy_from_slice(&at.to_le_bytes());
        entry[24..28].copy_from_slice(&(bytes as i32).to_le_bytes());
        entry[28..32].copy_from_slice(&(each as i32).to_le_bytes());
        at += bytes;
    }
    file
}

/// A folder with files that are gone with it.
pub(crate) struct Place(tempfile::TempDir);

impl Place {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Options that keep every point.
pub(crate) fn keep_all() -> CloudOpenOptions {
    let mut options = CloudOpenOptions::default();
    options.filter.keep_withheld = true;
    options
}

/// World coordinates of all points that are handed on, part by part, and their counts.
pub(crate) fn read_all(cloud: &PointCloud) -> Result<(Vec<[f64; 3]>, ReturnCounts)> {
    let (mut points, mut census) = (Vec::new(), ReturnCounts::default());
    let info = cloud.info();
    for part in 0..cloud.parts() {
        let mut handed = 0;
        let found = cloud.positions(part, &mut |batch| {
            assert!(!batch.is_empty() && batch.len() <= cloud::BATCH);
            let [low, high] = info.bounds.expect("points lie somewhere");
            for point in batch {
                assert!(low.x <= point.x && point.x <= high.x, "{point:?}");
                assert!(low.y <= point.y && point.y <= high.y, "{point:?}");
                assert!(low.z <= point.z && point.z <= high.z, "{point:?}");
            }
            handed += batch.len() as u64;
            points.extend(batch.iter().map(|point| info.frame.world(*point)));
            Ok(())
        })?;
        let sum = found.kept + found.withheld + found.filtered + found.outside + found.lost;
        assert_eq!((found.read, found.kept), (sum, handed), "{found:?}");
        assert!(found.read <= cloud.points_of(part));
        census.add(&found);
    }
    Ok((points, census))
}

/// Opens and reads one file.
pub(crate) fn read_file(
    name: &str,
    options: &CloudOpenOptions,
) -> Result<(Vec<[f64; 3]>, ReturnCounts)> {
    read_all(&cloud::open(&[name.to_owned()], options)?)
}
