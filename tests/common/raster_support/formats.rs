//! Small sound files of the formats other than GeoTIFF, all of one grid.

use std::io::Write;
use std::path::Path;

use super::write_anew;

/// Columns and rows of the grid.
pub(crate) const SIZE: (usize, usize) = (7, 5);

/// The height at column `col`, row `row`: whole, from -11 up, never twice in a row.
pub(crate) fn height(col: usize, row: usize) -> i32 {
    (col * 3 + row * 40) as i32 - 11
}

/// All heights, row by row.
pub(crate) fn heights() -> Vec<i32> {
    (0..SIZE.1).flat_map(|row| (0..SIZE.0).map(move |col| height(col, row))).collect()
}

/// Files of one grid; the first is the one to open.
pub(crate) struct Sample {
    /// Names and contents.
    pub(crate) files: Vec<(&'static str, Vec<u8>)>,
}

impl Sample {
    fn of(name: &'static str, bytes: Vec<u8>) -> Self {
        Self { files: vec![(name, bytes)] }
    }

    fn with(mut self, name: &'static str, text: &str) -> Self {
        self.files.push((name, text.as_bytes().to_vec()));
        self
    }

    /// Writes all files into `folder`.
    pub(crate) fn write(&self, folder: &Path) {
        for (name, bytes) in &self.files {
            write_anew(&folder.join(name), bytes);
        }
    }
}

/// One sample of each kind of file.
pub(crate) fn samples() -> Vec<Sample> {
    let plain = vec![
        bil(),
        flt(),
        envi(),
        png_gray(),
        Sample::of(
            "terrarium.png",
            png(::png::ColorType::Rgb, 8, |h| {
                let stored = ((h + 32768) as u32) << 8;
                stored.to_be_bytes()[1..].to_vec()
            }),
        ),
        Sample::of("a.dt0", dted()),
        Sample::of("a.dem", usgs("")),
        Sample::of("newline.dem", usgs("\n")),
        Sample::of("a.xyz", xyz(" ", false)),
        Sample::of("by_column.csv", xyz(",", true)),
        Sample::of("a.npy", npy("'<i4'", "False", i32::to_le_bytes, false)),
        Sample::of("f.npy", npy("'>i4'", "True", i32::to_be_bytes, true)),
    ];
    let packed = [
        Sample::of("a.dt0.gz", gzip(&dted())),
        Sample::of("a.zip", zip(&[("f/g.flt", &flt().files[0].1), ("f/g.hdr", &flt().files[1].1)])),
    ];
    plain.into_iter().chain(packed).collect()
}

fn rows<const N: usize>(bytes: impl Fn(i32) -> [u8; N]) -> Vec<u8> {
    heights().into_iter().flat_map(bytes).collect()
}

/// The heights in 16 bits beside another band and padding.
pub(crate) fn bil() -> Sample {
    let mut data = vec![0x55; 3];
    for row in 0..SIZE.1 {
        data.extend([0xaa; 16]);
        data.extend((0..SIZE.0).flat_map(|col| (height(col, row) as i16).to_be_bytes()));
        data.extend([0; 6]);
    }
    let header = "NROWS 5\nNCOLS 7\nNBANDS 2\nNBITS 16\nPIXELTYPE SIGNEDINT\nBYTEORDER M\n\
        LAYOUT BIL\nSKIPBYTES 3\nBANDROWBYTES 16\nTOTALROWBYTES 36\nULXMAP 105\nULYMAP 195\n\
        XDIM 10\nYDIM 10\n";
    Sample::of("a.bil", data).with("a.hdr", header)
}

/// As GridFloat.
pub(crate) fn flt() -> Sample {
    let header = "ncols 7\nnrows 5\nxllcorner 100\nyllcorner 150\ncellsize 10\n\
        NODATA_value -9999\nbyteorder LSBFIRST\n";
    Sample::of("g.flt", rows(|h| (h as f32).to_le_bytes())).with("g.hdr", header)
}

/// The heights behind two bytes that are none.
pub(crate) fn envi() -> Sample {
    let header = "ENVI\ndescription = {\n a }\nsamples = 7\nlines = 5\nbands = 1\n\
        header offset = 2\ndata type = 2\ninterleave = bsq\nbyte order = 0\n\
        map info = {UTM, 1, 1, 100, 200, 10, 10, 33, North, WGS-84, units=Meters}\n";
    let data = [vec![0; 2], rows(|h| (h as i16).to_le_bytes())].concat();
    Sample::of("e.dat", data).with("e.dat.hdr", header)
}

fn png_gray() -> Sample {
    let bytes = png(::png::ColorType::Grayscale, 16, |h| ((h + 11) as u16).to_be_bytes().to_vec());
    Sample::of("gray.png", bytes).with("gray.pgw", "10\n0\n0\n-10\n105\n195\n")
}

/// A picture of the grid.
pub(crate) fn png(color: ::png::ColorType, bits: u8, pixel: impl Fn(i32) -> Vec<u8>) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, SIZE.0 as u32, SIZE.1 as u32);
    encoder.set_color(color);
    encoder.set_depth(::png::BitDepth::from_u8(bits).unwrap());
    let data: Vec<u8> = heights().into_iter().flat_map(pixel).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    out
}

/// A cell with its columns as records.
pub(crate) fn dted() -> Vec<u8> {
    let mut out = format!("UHL10060000E0450000N{:04}{:04}", 600, 900).into_bytes();
    out.resize(47, b' ');
    out.extend(format!("{:04}{:04}0", SIZE.0, SIZE.1).bytes());
    out.resize(80, b' ');
    let mut dsi = b"DSIU".to_vec();
    dsi.resize(59, b' ');
    dsi.extend(b"DTED0");
    dsi.resize(141, b' ');
    dsi.extend(b"MSLWGS84");
    dsi.resize(648, b' ');
    dsi[289..291].copy_from_slice(b"00");
    out.extend(dsi);
    out.resize(80 + 648 + 2700, b' ');
    for col in 0..SIZE.0 {
        let mut record = vec![0xaa, 0, 0, col as u8, 0, col as u8, 0, 0];
        for row in (0..SIZE.1).rev() {
            let h = height(col, row);
            let bits = h.unsigned_abs() as u16 | if h < 0 { 0x8000 } else { 0 };
            record.extend(bits.to_be_bytes());
        }
        let sum: u32 = record.iter().map(|byte| u32::from(*byte)).sum();
        record.extend(sum.to_be_bytes());
        out.extend(record);
    }
    out
}

/// A UTM quad whose second profile lacks its southern height; records end in `newline`.
pub(crate) fn usgs(newline: &str) -> Vec<u8> {
    let mut first = format!("{:<156}{:6}{:6}", "A QUAD", 1, 33);
    first = format!("{first:<528}{:6}{:6}{:6}", 2, 2, 4);
    for corner in [100.0, 150.0, 100.0, 190.0, 160.0, 190.0, 160.0, 150.0] {
        first += &format!("{:>24}", format!("{corner:.6}D+00"));
    }
    first = format!("{first:<816}{:>12}{:>12}{:>12}{:6}{:6}", "10.0", "10.0", "1.0", 1, SIZE.0);
    let mut records = vec![format!("{first:<890} 3")];
    for col in 0..SIZE.0 {
        let rows = SIZE.1 - usize::from(col == 1);
        let south = 150.0 + 10.0 * (SIZE.1 - rows) as f64;
        let mut text = format!("{:6}{:6}{rows:6}{:6}", 1, col + 1, 1);
        for value in [100.0 + 10.0 * col as f64, south, 0.0, -11.0, 200.0] {
            text += &format!("{:>24}", format!("{value:.6}D+00"));
        }
        (0..rows).rev().for_each(|row| text += &format!("{:6}", height(col, row)));
        records.push(text);
    }
    records.iter().map(|record| format!("{record:<1024}{newline}")).collect::<String>().into_bytes()
}

/// Points with one left out.
pub(crate) fn xyz(separator: &str, by_column: bool) -> Vec<u8> {
    let (outer, inner) = if by_column { SIZE } else { (SIZE.1, SIZE.0) };
    let mut text = ["Easting", "Northing", "Height"].join(separator) + "\n";
    for (a, b) in (0..outer).flat_map(|a| (0..inner).map(move |b| (a, b))) {
        let (col, row) = if by_column { (a, b) } else { (b, a) };
        if (col, row) != (1, 4) {
            let (x, y) = (105 + 10 * col, 195 - 10 * row);
            let line = [x.to_string(), y.to_string(), height(col, row).to_string()];
            text += &(line.join(separator) + "\r\n");
        }
    }
    text.into_bytes()
}

/// An array with the given words in its header.
pub(crate) fn npy(
    descr: &str,
    fortran: &str,
    bytes: impl Fn(i32) -> [u8; 4],
    by_column: bool,
) -> Vec<u8> {
    let text = format!(
        "{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': ({}, {}), }}",
        SIZE.1, SIZE.0
    );
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend(118_u16.to_le_bytes());
    out.extend(format!("{text:<117}\n").bytes());
    if by_column {
        let columns = (0..SIZE.0).flat_map(|col| (0..SIZE.1).map(move |row| height(col, row)));
        out.extend(columns.flat_map(bytes));
    } else {
        out.extend(rows(bytes));
    }
    out
}

/// `bytes` as a gzip file.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// An archive of files.
pub(crate) fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ::zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(*name, ::zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}
