//! Writes small TIFFs of every kind, byte by byte, independently of the reader under test.

use weezl::BitOrder;

/// Value of a tag.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Short(Vec<u16>),
    Long(Vec<u64>),
    Double(Vec<f64>),
    Text(String),
}

/// The TIFF to build. `format` and `bits` as in SampleFormat and BitsPerSample.
#[derive(Clone, Debug)]
pub(crate) struct Spec {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) bands: usize,
    pub(crate) format: u16,
    pub(crate) bits: usize,
    pub(crate) big_endian: bool,
    pub(crate) big_tiff: bool,
    /// Tile width and height; strips of `rows_per_strip` when `None`.
    pub(crate) tile: Option<(usize, usize)>,
    pub(crate) rows_per_strip: usize,
    pub(crate) compression: u16,
    pub(crate) predictor: u16,
    pub(crate) separate: bool,
    /// Pad the last strip to its full height, as some writers do.
    pub(crate) pad_last_strip: bool,
    /// Blocks left out (offset and byte count 0).
    pub(crate) sparse: Vec<usize>,
    /// Blocks said to lie at other offsets.
    pub(crate) lie: Vec<(usize, u64)>,
    pub(crate) extra: Vec<(u16, Value)>,
}

impl Spec {
    /// A little-endian classic strip file, uncompressed.
    pub(crate) fn new(width: usize, height: usize, format: u16, bits: usize) -> Self {
        Self {
            width,
            height,
            bands: 1,
            format,
            bits,
            big_endian: false,
            big_tiff: false,
            tile: None,
            rows_per_strip: 7,
            compression: 1,
            predictor: 1,
            separate: false,
            pad_last_strip: false,
            sparse: Vec::new(),
            lie: Vec::new(),
            extra: Vec::new(),
        }
    }

    /// Bits of the sample of value `v` in this type.
    fn encode(&self, v: f64) -> u64 {
        match (self.format, self.bits) {
            (1, _) => v as u64,
            (2, bits) => (v as i64 as u64) & mask(bits),
            (_, 16) => u64::from(half::f16::from_f64(v).to_bits()),
            (_, 32) => u64::from((v as f32).to_bits()),
            _ => v.to_bits(),
        }
    }

    fn bytes(&self, value: u64, size: usize) -> Vec<u8> {
        let mut bytes = value.to_le_bytes()[..size].to_vec();
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    /// Builds the file; `value(col, row, band)` is each sample.
    pub(crate) fn build(&self, value: impl Fn(usize, usize, usize) -> f64) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend(if self.big_endian { b"MM" } else { b"II" });
        if self.big_tiff {
            [43, 8, 0].iter().for_each(|v| out.extend(self.bytes(*v, 2)));
        } else {
            out.extend(self.bytes(42, 2));
        }
        out.resize(out.len() + self.offset_size(), 0);
        self.append(&mut out, &value);
        out
    }

    /// Puts this image behind those of `file`, whose last bytes are the place for its directory's
    /// offset.
    pub(crate) fn append(&self, out: &mut Vec<u8>, value: &impl Fn(usize, usize, usize) -> f64) {
        let blocks = self.blocks(value);
        let pointer_at = out.len() - self.offset_size();
        let (mut offsets, mut counts) = (Vec::new(), Vec::new());
        for (i, block) in blocks.iter().enumerate() {
            let sparse = self.sparse.contains(&i);
            offsets.push(if sparse { 0 } else { out.len() as u64 });
            counts.push(if sparse { 0 } else { block.len() as u64 });
            if !sparse {
                out.extend(block);
            }
        }
        self.lie.iter().for_each(|(block, offset)| offsets[*block] = *offset);
        self.directory(out, pointer_at, offsets, counts);
    }

    fn offset_size(&self) -> usize {
        if self.big_tiff { 8 } else { 4 }
    }

    fn directory(&self, out: &mut Vec<u8>, pointer_at: usize, offsets: Vec<u64>, counts: Vec<u64>) {
        let short = |v: usize| Value::Short(vec![v as u16]);
        let mut tags = vec![
            (256, Value::Long(vec![self.width as u64])),
            (257, Value::Long(vec![self.height as u64])),
            (258, Value::Short(vec![self.bits as u16; self.bands])),
            (259, short(self.compression.into())),
            (262, short(1)),
            (277, short(self.bands)),
            (284, short(if self.separate { 2 } else { 1 })),
            (317, short(self.predictor.into())),
            (339, Value::Short(vec![self.format; self.bands])),
        ];
        if let Some((width, height)) = self.tile {
            tags.push((322, short(width)));
            tags.push((323, short(height)));
            tags.push((324, Value::Long(offsets)));
            tags.push((325, Value::Long(counts)));
        } else {
            tags.push((273, Value::Long(offsets)));
            tags.push((278, short(self.rows_per_strip)));
            tags.push((279, Value::Long(counts)));
        }
        tags.retain(|(tag, _)| self.extra.iter().all(|(extra, _)| extra != tag));
        tags.extend(self.extra.iter().cloned());
        tags.sort_by_key(|(tag, _)| *tag);
        self.write_directory(out, pointer_at, &tags);
    }

    fn write_directory(&self, out: &mut Vec<u8>, pointer_at: usize, tags: &[(u16, Value)]) {
        let width = self.offset_size();
        let mut entries = Vec::new();
        for (tag, value) in tags {
            let (kind, count, mut payload) = self.payload(value);
            if payload.len() > width {
                let at = out.len() as u64;
                out.extend(&payload);
                payload = self.bytes(at, width);
            }
            payload.resize(width, 0);
            entries.extend(self.bytes((*tag).into(), 2));
            entries.extend(self.bytes(kind, 2));
            entries.extend(self.bytes(count as u64, width));
            entries.extend(payload);
        }
        let at = self.bytes(out.len() as u64, width);
        out[pointer_at..pointer_at + width].copy_from_slice(&at);
        out.extend(self.bytes(tags.len() as u64, if self.big_tiff { 8 } else { 2 }));
        out.extend(entries);
        out.extend(vec![0; width]);
    }

    fn payload(&self, value: &Value) -> (u64, usize, Vec<u8>) {
        match value {
            Value::Short(v) => {
                (3, v.len(), v.iter().flat_map(|v| self.bytes((*v).into(), 2)).collect())
            }
            Value::Long(v) => {
                let (kind, size) = if self.big_tiff { (16, 8) } else { (4, 4) };
                (kind, v.len(), v.iter().flat_map(|v| self.bytes(*v, size)).collect())
            }
            Value::Double(v) => {
                (12, v.len(), v.iter().flat_map(|v| self.bytes(v.to_bits(), 8)).collect())
            }
            Value::Text(v) => (2, v.len() + 1, v.bytes().chain([0]).collect()),
        }
    }

    fn blocks(&self, value: &impl Fn(usize, usize, usize) -> f64) -> Vec<Vec<u8>> {
        let (bw, bh) = self.tile.unwrap_or((self.width, self.rows_per_strip.min(self.height)));
        let planes = if self.separate { self.bands } else { 1 };
        let mut blocks = Vec::new();
        for plane in 0..planes {
            for row in (0..self.height).step_by(bh) {
                for col in (0..self.width).step_by(bw) {
                    let keep = self.tile.is_some() || self.pad_last_strip;
                    let rows = if keep { bh } else { bh.min(self.height - row) };
                    blocks.push(self.block(value, plane, (col, row), (bw, rows)));
                }
            }
        }
        blocks
    }

    fn block(
        &self,
        value: &impl Fn(usize, usize, usize) -> f64,
        plane: usize,
        (col, row): (usize, usize),
        (width, rows): (usize, usize),
    ) -> Vec<u8> {
        let stride = if self.separate { 1 } else { self.bands };
        let mut plain = Vec::new();
        for r in row..row + rows {
            let mut samples = Vec::new();
            for c in col..col + width {
                for b in 0..stride {
                    let inside = c < self.width && r < self.height;
                    let v = if inside { value(c, r, plane + b) } else { 0.0 };
                    samples.push(self.encode(v));
                }
            }
            plain.extend(self.predict(&samples, stride));
        }
        compress(&plain, self.compression)
    }

    fn predict(&self, samples: &[u64], stride: usize) -> Vec<u8> {
        if self.bits == 1 {
            let byte =
                |bits: &[u64]| (0..).zip(bits).fold(0, |b, (i, v)| b | (*v as u8) << (7 - i));
            return samples.chunks(8).map(byte).collect();
        }
        let size = self.bits / 8;
        let left = |i: usize| i.checked_sub(stride).map_or(0, |j| samples[j]);
        match self.predictor {
            1 => samples.iter().flat_map(|s| self.bytes(*s, size)).collect(),
            2 => {
                let difference = |i: usize| samples[i].wrapping_sub(left(i)) & mask(self.bits);
                (0..samples.len()).flat_map(|i| self.bytes(difference(i), size)).collect()
            }
            _ => {
                let plane = |k: usize| samples.iter().map(move |s| (s >> (8 * k)) as u8);
                let sorted: Vec<u8> = (0..size).rev().flat_map(plane).collect();
                let left = |i: usize| i.checked_sub(stride).map_or(0, |j| sorted[j]);
                (0..sorted.len()).map(|i| sorted[i].wrapping_sub(left(i))).collect()
            }
        }
    }
}

fn mask(bits: usize) -> u64 {
    if bits == 64 { u64::MAX } else { (1 << bits) - 1 }
}

fn compress(plain: &[u8], code: u16) -> Vec<u8> {
    match code {
        5 => weezl::encode::Encoder::with_tiff_size_switch(BitOrder::Msb, 8).encode(plain).unwrap(),
        8 | 32946 => {
            let mut deflate = libdeflater::Compressor::new(libdeflater::CompressionLvl::default());
            let mut out = vec![0; deflate.zlib_compress_bound(plain.len())];
            let bytes = deflate.zlib_compress(plain, &mut out).unwrap();
            out.truncate(bytes);
            out
        }
        32773 => packbits(plain),
        50000 => zstd::bulk::compress(plain, 3).unwrap(),
        _ => plain.to_vec(),
    }
}

/// Runs of equal bytes, and literals of one byte.
fn packbits(plain: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = plain;
    while let Some(first) = rest.first() {
        let run = rest.iter().take(128).take_while(|b| *b == first).count();
        out.push(if run == 1 { 0 } else { (257 - run) as u8 });
        out.push(*first);
        rest = &rest[run..];
    }
    out
}
