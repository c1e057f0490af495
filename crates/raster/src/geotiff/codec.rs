//! Decompression of blocks: LZW (both variants), deflate, PackBits, zstd, LERC; others are rejected by name.

use std::cell::RefCell;

use libdeflater::{DecompressionError, Decompressor};

use super::{lerc, lzw};
use terrane_base::error::{Error, Result};

/// Maximum size of scratch buffers that are kept, in bytes.
const KEPT_SCRATCH: usize = 2 << 20;

/// A supported compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GeoTiffCompression {
    None,
    Lzw,
    Deflate,
    PackBits,
    Zstd,
    Lerc(LercPacking),
}

/// Additional compression of LERC data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LercPacking {
    None,
    Deflate,
    Zstd,
}

impl GeoTiffCompression {
    /// From the Compression tag and the second value of LercParameters; unsupported ones are rejected by
    /// name.
    pub(super) fn from_code(code: u64, lerc_packing: u64) -> Result<Self> {
        match code {
            1 => Ok(Self::None),
            5 => Ok(Self::Lzw),
            8 | 32946 => Ok(Self::Deflate),
            32773 => Ok(Self::PackBits),
            50000 => Ok(Self::Zstd),
            34887 => LercPacking::from_code(lerc_packing).map(Self::Lerc),
            _ => Err(unsupported(code)),
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Lzw => "LZW",
            Self::Deflate => "deflate",
            Self::PackBits => "packbits",
            Self::Zstd => "zstd",
            Self::Lerc(LercPacking::None) => "LERC",
            Self::Lerc(LercPacking::Deflate) => "LERC and deflate",
            Self::Lerc(LercPacking::Zstd) => "LERC and zstd",
        }
    }

    pub(super) fn is_lerc(self) -> bool {
        matches!(self, Self::Lerc(_))
    }
}

impl LercPacking {
    fn from_code(code: u64) -> Result<Self> {
        match code {
            0 => Ok(Self::None),
            1 => Ok(Self::Deflate),
            2 => Ok(Self::Zstd),
            _ => Err(Error::unsupported(format!(
                "LERC with additional compression {code} is not supported"
            ))
            .remedy(REWRITE)),
        }
    }
}

/// Remedy for unsupported compressions.
const REWRITE: &str = "rewrite the file: gdal_translate -co COMPRESS=DEFLATE IN OUT";

fn unsupported(code: u64) -> Error {
    let name = match code {
        2 | 32771 => "CCITT run length",
        3 => "CCITT group 3 fax",
        4 => "CCITT group 4 fax",
        6 => "old-style JPEG",
        7 | 34892 => "JPEG",
        32766 => "NeXT",
        32809 => "ThunderScan",
        32908 | 32909 => "Pixar",
        33003 | 33004 | 33005 | 34712 => "JPEG 2000",
        34661 => "JBIG",
        34676 | 34677 => "SGI LogLuv",
        34925 => "LZMA",
        50001 => "WebP",
        50002 | 52546 => "JPEG XL",
        _ => "unknown",
    };
    Error::unsupported(format!("compression {name} (code {code}) is not supported")).remedy(REWRITE)
}

/// Decompression error.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum DecompressionFault {
    /// The data exceed the output.
    TooLong,
    /// The data are damaged: message of the decoder.
    Corrupt(String),
}

impl DecompressionFault {
    fn corrupt(error: std::io::Error) -> Self {
        Self::Corrupt(error.to_string())
    }
}

/// Buffers and decoders of one thread, reused between blocks.
pub(super) struct GeoTiffScratch {
    /// Compressed bytes.
    pub(super) packed: Vec<u8>,
    /// Decompressed bytes before reordering.
    pub(super) plain: Vec<u8>,
    /// Decoders.
    pub(super) decoders: BlockDecoders,
}

thread_local! {
    static SCRATCH: RefCell<GeoTiffScratch> = RefCell::new(GeoTiffScratch {
        packed: Vec::new(),
        plain: Vec::new(),
        decoders: BlockDecoders { deflate: Decompressor::new(), zstd: None, lzw: None },
    });
}

/// Runs `work` with the scratch of this thread.
pub(super) fn with_scratch<T>(work: impl FnOnce(&mut GeoTiffScratch) -> T) -> T {
    SCRATCH.with_borrow_mut(|scratch| {
        let result = work(scratch);
        for buffer in [&mut scratch.packed, &mut scratch.plain] {
            if buffer.capacity() > KEPT_SCRATCH {
                *buffer = Vec::new();
            }
        }
        result
    })
}

/// Decoders that are expensive to set up.
pub(super) struct BlockDecoders {
    deflate: Decompressor,
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    lzw: Option<Box<lzw::LzwTable>>,
}

impl BlockDecoders {
    /// Decompresses `packed` into the start of `out` and returns the number of bytes written. LZW and
    /// PackBits stop when `out` is full; deflate and zstd return [`DecompressionFault::TooLong`].
    pub(super) fn run(
        &mut self,
        compression: GeoTiffCompression,
        packed: &[u8],
        out: &mut [u8],
    ) -> std::result::Result<usize, DecompressionFault> {
        match compression {
            // LERC is decoded by shape: `lerc`.
            GeoTiffCompression::None | GeoTiffCompression::Lerc(_) => Ok(copy(packed, out)),
            GeoTiffCompression::Lzw => self.unlzw(packed, out),
            GeoTiffCompression::PackBits => packbits(packed, out),
            GeoTiffCompression::Deflate => self.inflate(packed, out),
            GeoTiffCompression::Zstd => self.unzstd(packed, out),
        }
    }

    /// Decodes LERC data, with or without additional compression, that fill `out`.
    pub(super) fn lerc(
        &mut self,
        packing: LercPacking,
        packed: &[u8],
        shape: lerc::LercBlockShape,
        out: &mut [u8],
    ) -> std::result::Result<(), DecompressionFault> {
        // Noisy blocks grow a little, and the mask is added.
        let most = out.len() + out.len() / 2 + 4096;
        let unpacked = match packing {
            LercPacking::None => None,
            LercPacking::Deflate => Some(unpacked(most, |room| self.inflate(packed, room))?),
            LercPacking::Zstd => Some(unpacked(most, |room| self.unzstd(packed, room))?),
        };
        lerc::decode(unpacked.as_deref().unwrap_or(packed), shape, out)
            .map_err(DecompressionFault::Corrupt)
    }

    fn inflate(
        &mut self,
        packed: &[u8],
        out: &mut [u8],
    ) -> std::result::Result<usize, DecompressionFault> {
        self.deflate.zlib_decompress(packed, out).map_err(|e| match e {
            DecompressionError::InsufficientSpace => DecompressionFault::TooLong,
            DecompressionError::BadData => {
                DecompressionFault::Corrupt("invalid deflate data".to_owned())
            }
        })
    }

    fn unzstd(
        &mut self,
        packed: &[u8],
        out: &mut [u8],
    ) -> std::result::Result<usize, DecompressionFault> {
        let decoder = match &mut self.zstd {
            Some(decoder) => decoder,
            none => {
                none.insert(zstd::bulk::Decompressor::new().map_err(DecompressionFault::corrupt)?)
            }
        };
        decoder.decompress_to_buffer(packed, out).map_err(|e| match e.to_string().as_str() {
            // The binding replaces zstd's error code by its name.
            "Destination buffer is too small" => DecompressionFault::TooLong,
            _ => DecompressionFault::corrupt(e),
        })
    }
    fn unlzw(
        &mut self,
        packed: &[u8],
        out: &mut [u8],
    ) -> std::result::Result<usize, DecompressionFault> {
        let table = self.lzw.get_or_insert_with(lzw::LzwTable::new);
        lzw::decode(packed, out, table)
            .map_err(|lzw::InvalidCode| DecompressionFault::Corrupt("invalid LZW code".to_owned()))
    }
}

/// Up to `most` bytes of the output of `unpack`.
fn unpacked(
    most: usize,
    unpack: impl FnOnce(&mut [u8]) -> std::result::Result<usize, DecompressionFault>,
) -> std::result::Result<Vec<u8>, DecompressionFault> {
    let mut room = vec![0; most];
    let bytes = unpack(&mut room)?;
    room.truncate(bytes);
    Ok(room)
}

fn copy(packed: &[u8], out: &mut [u8]) -> usize {
    let bytes = packed.len().min(out.len());
    out[..bytes].copy_from_slice(&packed[..bytes]);
    bytes
}

fn packbits(mut packed: &[u8], out: &mut [u8]) -> std::result::Result<usize, DecompressionFault> {
    let mut written = 0;
    while let (Some((head, rest)), true) = (packed.split_first(), written < out.len()) {
        let room = out.len() - written;
        packed = rest;
        match *head as i8 {
            // No operation (TIFF 6.0 section 9); as a run it would be one of 129 bytes.
            -128 => {}
            repeat @ ..0 => {
                let bytes = (1 - repeat as isize) as usize;
                let Some((value, rest)) = packed.split_first() else { break };
                out[written..][..bytes.min(room)].fill(*value);
                written += bytes.min(room);
                packed = rest;
            }
            literal => {
                // A literal that is cut short gives what is there. Whether the block is whole is judged by its
                // length afterwards.
                let bytes = (literal as usize + 1).min(packed.len());
                written += copy(&packed[..bytes], &mut out[written..]);
                packed = &packed[bytes..];
            }
        }
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn run(
        compression: GeoTiffCompression,
        packed: &[u8],
        bytes: usize,
    ) -> std::result::Result<Vec<u8>, DecompressionFault> {
        let mut out = vec![0; bytes];
        let written = with_scratch(|s| s.decoders.run(compression, packed, &mut out))?;
        out.truncate(written);
        Ok(out)
    }

    #[test]
    fn packbits_of_the_specification() {
        let packed = [
            0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7,
            0xAA,
        ];
        let mut expected = vec![0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0xAA, 0xAA, 0xAA, 0xAA];
        expected.extend([0x80, 0x00, 0x2A, 0x22]);
        expected.extend([0xAA; 10]);
        assert_eq!(run(GeoTiffCompression::PackBits, &packed, 24).unwrap(), expected);
        assert_eq!(run(GeoTiffCompression::PackBits, &packed, 20).unwrap(), expected[..20]);
        assert_eq!(run(GeoTiffCompression::PackBits, &[0x80, 0x05, 1, 2], 9).unwrap(), [1, 2]);
    }

    #[test]
    fn deflate_and_zstd_tell_too_long_from_corrupt() {
        let data = vec![7_u8; 5000];
        let mut zlib = vec![0; 6000];
        let level = libdeflater::CompressionLvl::default();
        let bytes = libdeflater::Compressor::new(level).zlib_compress(&data, &mut zlib).unwrap();
        let packed = [
            (GeoTiffCompression::Deflate, zlib[..bytes].to_vec()),
            (GeoTiffCompression::Zstd, zstd::bulk::compress(&data, 3).unwrap()),
        ];
        for (compression, mut packed) in packed {
            assert_eq!(run(compression, &packed, 5000).unwrap(), data);
            assert_eq!(run(compression, &packed, 6000).unwrap(), data);
            assert_eq!(run(compression, &packed, 4999).unwrap_err(), DecompressionFault::TooLong);
            packed[0] ^= 0x55;
            assert!(matches!(run(compression, &packed, 5000), Err(DecompressionFault::Corrupt(_))));
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(packed in prop::collection::vec(any::<u8>(), 0..300)) {
            use GeoTiffCompression::{Deflate, Lzw, PackBits, Zstd};
            for compression in [Lzw, Deflate, PackBits, Zstd] {
                let _ = run(compression, &packed, 500);
            }
        }
    }
}
