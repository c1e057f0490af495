//! Compression of TIFF blocks: deflate, zstd, LZW, PackBits. Output is deterministic.

use libdeflater::{CompressionLvl, Compressor};
use weezl::BitOrder;

use super::creation::CreationOptions;
use terrane_base::error::{Error, ErrorKind, Result};

/// A compression and its level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TiffCompression {
    None,
    Lzw,
    Deflate(i32),
    Zstd(i32),
    PackBits,
}

const DEFLATE_LEVEL: i32 = 6;
const MAX_DEFLATE_LEVEL: u32 = 12;
const ZSTD_LEVEL: i32 = 9;

impl TiffCompression {
    /// From COMPRESS and LEVEL; `default` is the default of COMPRESS.
    pub(super) fn of(creation: &CreationOptions, default: &str) -> Result<Self> {
        let name = creation.word("COMPRESS").unwrap_or(default);
        let level = creation.number("LEVEL");
        let levels = if name == "DEFLATE" { MAX_DEFLATE_LEVEL } else { u32::MAX };
        if let Some(level) = level.filter(|level| *level > levels) {
            return Err(Error::usage(format!("LEVEL={level} is out of range for {name}"))
                .remedy(format!("choose 1 to {levels}")));
        }
        let level_or = |default: i32| level.map_or(default, |level| level as i32);
        let compression = match name {
            "DEFLATE" => return Ok(Self::Deflate(level_or(DEFLATE_LEVEL))),
            "ZSTD" => return Ok(Self::Zstd(level_or(ZSTD_LEVEL))),
            "LZW" => Self::Lzw,
            "PACKBITS" => Self::PackBits,
            _ => Self::None,
        };
        creation.refuse("LEVEL", &format!("with COMPRESS={name}"))?;
        Ok(compression)
    }

    /// The value of the Compression tag.
    pub(super) fn code(self) -> u16 {
        match self {
            Self::None => 1,
            Self::Lzw => 5,
            Self::Deflate(_) => 8,
            Self::PackBits => 32_773,
            Self::Zstd(_) => 50_000,
        }
    }

    /// True if the compression supports predictors.
    pub(super) fn predicts(self) -> bool {
        !matches!(self, Self::None | Self::PackBits)
    }

    /// Compresses `plain`, rows of `row_bytes`, into `out`.
    pub(super) fn run(self, plain: &[u8], row_bytes: usize, out: &mut Vec<u8>) -> Result<()> {
        out.clear();
        match self {
            Self::None => out.extend_from_slice(plain),
            Self::Deflate(level) => deflate(plain, level, out)?,
            Self::Zstd(level) => *out = zstd::bulk::compress(plain, level).map_err(fault)?,
            Self::PackBits => plain.chunks_exact(row_bytes).for_each(|row| packbits(row, out)),
            Self::Lzw => {
                let mut encoder = weezl::encode::Encoder::with_tiff_size_switch(BitOrder::Msb, 8);
                let done = encoder.into_vec(out).encode_all(plain).status;
                done.map_err(fault)?;
            }
        }
        Ok(())
    }
}

fn deflate(plain: &[u8], level: i32, out: &mut Vec<u8>) -> Result<()> {
    let level = CompressionLvl::new(level).map_err(|_| fault("invalid compression level"))?;
    let mut compressor = Compressor::new(level);
    out.resize(compressor.zlib_compress_bound(plain.len()), 0);
    let written = compressor.zlib_compress(plain, out).map_err(fault)?;
    out.truncate(written);
    Ok(())
}

/// Compressors fail only if the output buffer is too small, which it is not.
fn fault(error: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Internal, format!("cannot compress a block: {error}"))
}

/// Maximum length of a run or literal.
const MAX_PACKED: usize = 128;

/// PackBits (TIFF 6.0 section 9) with runs of three bytes or more.
fn packbits(row: &[u8], out: &mut Vec<u8>) {
    let (mut at, mut literal) = (0, 0);
    while at < row.len() {
        let same = row[at..].iter().take(MAX_PACKED).take_while(|b| **b == row[at]).count();
        // A run of two bytes takes as many as in a literal, and would cut the literal in two.
        if same < 3 {
            at += same;
            continue;
        }
        literals(&row[literal..at], out);
        out.extend([(1 - same as isize) as i8 as u8, row[at]]);
        at += same;
        literal = at;
    }
    literals(&row[literal..], out);
}

fn literals(bytes: &[u8], out: &mut Vec<u8>) {
    for bytes in bytes.chunks(MAX_PACKED) {
        out.push((bytes.len() - 1) as u8);
        out.extend_from_slice(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CreationOption, tiff};
    use super::*;
    use proptest::prelude::*;

    /// What independent decoders make of it.
    fn unpacked(compression: TiffCompression, packed: &[u8], bytes: usize) -> Vec<u8> {
        let mut out = vec![0; bytes];
        match compression {
            TiffCompression::None => return packed.to_vec(),
            TiffCompression::PackBits => return unpackbits(packed),
            TiffCompression::Zstd(_) => return zstd::bulk::decompress(packed, bytes).unwrap(),
            TiffCompression::Lzw => {
                let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
                return decoder.decode(packed).unwrap();
            }
            TiffCompression::Deflate(_) => {
                let mut decoder = libdeflater::Decompressor::new();
                assert_eq!(decoder.zlib_decompress(packed, &mut out).unwrap(), bytes);
            }
        }
        out
    }

    fn unpackbits(packed: &[u8]) -> Vec<u8> {
        let (mut out, mut rest) = (Vec::new(), packed);
        while let [head, tail @ ..] = rest {
            let count = usize::from(*head);
            if count < 128 {
                out.extend(&tail[..count + 1]);
                rest = &tail[count + 1..];
            } else {
                out.extend(vec![tail[0]; 257 - count]);
                rest = &tail[1..];
            }
        }
        out
    }

    proptest! {
        #[test]
        fn the_reader_undoes_every_compression(
            runs in prop::collection::vec((any::<u8>(), 1_usize..300), 1..60),
            noise in prop::collection::vec(any::<u8>(), 0..2000),
        ) {
            let mut plain: Vec<u8> =
                runs.iter().flat_map(|(byte, count)| vec![*byte; *count]).collect();
            plain.extend(noise);
            use TiffCompression::{Deflate, Lzw, None, PackBits, Zstd};
            for compression in [None, Lzw, Deflate(1), Deflate(12), Zstd(1), Zstd(22), PackBits] {
                let (mut first, mut second) = (Vec::new(), vec![7; 9]);
                compression.run(&plain, plain.len(), &mut first).unwrap();
                compression.run(&plain, plain.len(), &mut second).unwrap();
                prop_assert_eq!(&first, &second);
                prop_assert_eq!(&unpacked(compression, &first, plain.len()), &plain);
            }
        }
    }

    #[test]
    fn packbits_of_the_specification() {
        let mut plain = vec![0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0xAA, 0xAA, 0xAA, 0xAA];
        plain.extend([0x80, 0x00, 0x2A, 0x22]);
        plain.extend([0xAA; 10]);
        let mut out = Vec::new();
        packbits(&plain, &mut out);
        let expected = [
            0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7,
            0xAA,
        ];
        assert_eq!(out, expected);
    }

    const CODING: &[CreationOption] = &[tiff::COMPRESS, tiff::LEVEL];

    #[test]
    fn levels_belong_to_their_compression() {
        let of = |given: &[(&str, &str)]| {
            let given: Vec<_> = given.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
            TiffCompression::of(&CreationOptions::new("COG", CODING, &given)?, "NONE")
        };
        assert_eq!(of(&[]).unwrap(), TiffCompression::None);
        assert_eq!(of(&[("COMPRESS", "ZSTD")]).unwrap(), TiffCompression::Zstd(9));
        let deflate = of(&[("COMPRESS", "DEFLATE"), ("LEVEL", "12")]);
        assert_eq!(deflate.unwrap(), TiffCompression::Deflate(12));
        for (name, level) in [("DEFLATE", "13"), ("LZW", "1"), ("NONE", "1"), ("ZSTD", "23")] {
            assert!(of(&[("COMPRESS", name), ("LEVEL", level)]).is_err(), "{name} {level}");
        }
    }
}
