//! LAS and LAZ as written, read back by an independent reader.

use std::path::Path;

use las::Reader;
use terrane::ErrorKind;
use terrane_base::geom::{Crs, Point, PointFrame};
use terrane_cloud::synth;
use terrane_cloud::write::{
    CHUNK, CloudWriteOptions, CloudWriter, PointFormat, PointPacking, PointRecord, packing_by_name,
};
use terrane_cloud::{CloudFilter, CloudOpenOptions, PointSource, Return};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::synthetic_cloud::{self, SyntheticCloudJob};

pub(crate) fn options(format: u8, compress: bool) -> CloudWriteOptions {
    let frame = PointFrame { scale: [0.01, 0.001, 0.5], offset: [500.0, -70.25, 10.0] };
    CloudWriteOptions {
        packing: if compress { PointPacking::Chunks } else { PointPacking::Plain },
        ..CloudWriteOptions::new(PointFormat::new(format).unwrap(), frame, synth::crs())
    }
}

/// Points that take every field to its ends now and then.
pub(crate) fn records(count: usize) -> Vec<PointRecord> {
    let record = |k: usize| {
        let hash = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let bits = |from: u32| (hash >> from) as u16;
        let returns = 1 + (hash >> 60) as u8 % 5;
        PointRecord {
            point: Point::new(hash as i32, (hash >> 20) as i32, k as i32 - 40_000),
            time: k as f64 * 0.25 + 7.0,
            intensity: bits(3),
            number: 1 + (hash >> 7) as u8 % returns,
            returns,
            // Class 12 alone is read as a mark.
            class: [1, 2, 3, 7, 13, 17, 31][(hash >> 11) as usize % 7],
            flags: (hash >> 23) as u8 & 15,
            forward: hash & 256 > 0,
            edge: hash & 512 > 0,
            angle: (hash >> 33) as i16 / 3,
            user: bits(41) as u8,
            source: bits(17),
            colour: [bits(1), bits(2), bits(9)],
            // Zero is read as none.
            infrared: bits(29) | 1,
        }
    };
    (0..count).map(record).collect()
}

pub(crate) fn write(
    path: &Path,
    options: &CloudWriteOptions,
    records: &[PointRecord],
) -> terrane::Result<u64> {
    let mut writer = CloudWriter::create(path, options)?;
    for chunk in records.chunks(CHUNK) {
        let chunk = writer.layout().chunk(chunk)?;
        writer.append(&chunk)?;
    }
    assert_eq!(writer.points(), records.len() as u64);
    writer.finish()
}

/// Whether a point as read is the record that was written, in the given format.
fn is_same(point: &las::Point, record: &PointRecord, format: u8, frame: PointFrame) -> bool {
    let is_new = format >= 6;
    let world = frame.world(record.point);
    let class = u8::from(point.classification);
    let marks = [
        (point.is_synthetic, 1),
        (point.is_key_point, 2),
        (point.is_withheld, 4),
        (point.is_overlap && is_new, 8),
    ];
    let flags: u8 = marks.into_iter().filter(|(is, _)| *is).map(|(_, flag)| flag).sum();
    let colour = point.color.map(|c| [c.red, c.green, c.blue]);
    let angle = f32::from(record.angle) * 0.006;
    [point.x, point.y, point.z] == world
        && (point.return_number, point.number_of_returns) == (record.number, record.returns)
        && class == record.class
        && flags == record.flags & if is_new { 15 } else { 7 }
        && point.intensity == record.intensity
        && (point.user_data, point.point_source_id) == (record.user, record.source)
        && point.is_edge_of_flight_line == record.edge
        && (point.scan_direction == las::point::ScanDirection::LeftToRight) == record.forward
        && (point.scan_angle - angle).abs() < if is_new { 1e-3 } else { 1.0 }
        && point.gps_time.is_none_or(|time| time == record.time)
        && point.gps_time.is_some() != matches!(format, 0 | 2)
        && colour.is_none_or(|colour| colour == record.colour)
        && colour.is_some() == matches!(format, 2 | 3 | 7 | 8)
        && point.nir == (format == 8).then_some(record.infrared)
}

#[test]
fn every_format_reads_back_as_written() {
    let folder = tempfile::tempdir().unwrap();
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for (compress, count) in
            [(false, 1234), (true, 1234), (true, CHUNK), (true, 2 * CHUNK + 1), (true, 0)]
        {
            let path = folder.path().join(format!("{format}-{compress}-{count}"));
            let (options, records) = (options(format, compress), records(count));
            let bytes = write(&path, &options, &records).unwrap();
            assert_eq!(bytes, path.metadata().unwrap().len());
            let mut reader = Reader::from_path(&path).unwrap();
            let header = reader.header().clone();
            assert_eq!(header.number_of_points(), count as u64);
            let points = reader.read_all().unwrap();
            assert_eq!(points.len(), count);
            for (point, record) in points.points().zip(&records) {
                let point = point.unwrap();
                assert!(
                    is_same(&point, record, format, options.frame),
                    "{format}: {point:?} {record:?}"
                );
            }
            check_header(&header, &records, options.frame);
        }
    }
}

fn check_header(header: &las::Header, records: &[PointRecord], frame: PointFrame) {
    for number in 1..=5 {
        let count = records.iter().filter(|r| r.number == number).count() as u64;
        assert_eq!(header.number_of_points_by_return(number).unwrap_or(0), count);
    }
    let all = records.iter().map(|r| frame.world(r.point));
    let low = all.clone().fold([f64::MAX; 3], |a, b| [0, 1, 2].map(|k| a[k].min(b[k])));
    let high = all.fold([f64::MIN; 3], |a, b| [0, 1, 2].map(|k| a[k].max(b[k])));
    let bounds = header.bounds();
    if !records.is_empty() {
        assert_eq!([bounds.min.x, bounds.min.y, bounds.min.z], low);
        assert_eq!([bounds.max.x, bounds.max.y, bounds.max.z], high);
    }
}

#[test]
fn the_reference_system_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let vlrs = |name: &str, options: &CloudWriteOptions| {
        let path = folder.path().join(name);
        write(&path, options, &records(3)).unwrap();
        let reader = Reader::from_path(&path).unwrap();
        reader.header().vlrs().iter().map(|v| (v.record_id, v.data.clone())).collect::<Vec<_>>()
    };
    let new = vlrs("new", &options(6, false));
    assert_eq!((new.len(), new[0].0), (1, 2112));
    assert!(String::from_utf8_lossy(&new[0].1).starts_with("PROJCS[\"WGS 84 / UTM zone 31N\""));
    let old = vlrs("old", &options(1, false));
    let keys: Vec<u16> =
        old[0].1.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    assert_eq!((old.len(), old[0].0), (1, 34_735));
    assert_eq!(keys, [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32_631]);
    let heights = Crs { vertical_epsg: Some(5773), ..synth::crs() };
    let compound = vlrs("compound", &CloudWriteOptions { crs: heights, ..options(6, false) });
    assert!(
        String::from_utf8_lossy(&compound[0].1).starts_with("COMPD_CS[\"WGS 84 / UTM zone 31N + ")
    );
    let read = Crs {
        geo_keys: vec![1, 1, 0, 1, 1026, 34_737, 4, 0],
        geo_ascii: "any|".to_owned(),
        geo_doubles: vec![1.5],
        ..Crs::default()
    };
    let kept = vlrs("kept", &CloudWriteOptions { crs: read, ..options(6, false) });
    assert_eq!(kept.iter().map(|v| v.0).collect::<Vec<_>>(), [34_735, 34_736, 34_737]);
    assert!(
        vlrs("none", &CloudWriteOptions { crs: Crs::default(), ..options(6, true) }).len() <= 1
    );
    let wkt = Some("x".repeat(70_000));
    let long = Crs { wkt, ..Crs::default() };
    let of = |format| CloudWriteOptions { crs: long.clone(), ..options(format, false) };
    let error = CloudWriter::create(&folder.path().join("long"), &of(1)).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::CannotWrite);
    // Behind the points there is room for it.
    let path = folder.path().join("behind");
    write(&path, &of(6), &records(3)).unwrap();
    let mut reader = Reader::from_path(&path).unwrap();
    assert_eq!(reader.header().evlrs()[0].data.len(), 70_001);
    assert_eq!(reader.read_all().unwrap().len(), 3);
}

#[test]
fn chunks_are_found_by_their_table() {
    let folder = tempfile::tempdir().unwrap();
    for format in [1, 6] {
        let path = folder.path().join(format!("{format}.laz"));
        let (options, records) = (options(format, true), records(3 * CHUNK + 7));
        write(&path, &options, &records).unwrap();
        let mut reader = Reader::from_path(&path).unwrap();
        for from in [3 * CHUNK + 2, CHUNK - 1, 2 * CHUNK] {
            reader.seek(from as u64).unwrap();
            let points = reader.read_points(4).unwrap();
            assert_eq!(points.len(), 4);
            let mut pairs = points.points().zip(&records[from..]);
            assert!(pairs.all(|(p, r)| is_same(&p.unwrap(), r, format, options.frame)), "{from}");
        }
    }
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let options = options(6, true);
    let mut writer = CloudWriter::create(&path, &options).unwrap();
    writer.append(&writer.layout().chunk(&records(9)).unwrap()).unwrap();
    drop(writer);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    write(&path, &options, &records(9)).unwrap();
    assert_eq!(write(&path, &options, &[]).unwrap_err().kind(), ErrorKind::Usage);
    let missing = folder.path().join("no/a.laz");
    assert_eq!(write(&missing, &options, &[]).unwrap_err().kind(), ErrorKind::CannotWrite);
}

#[test]
#[should_panic(expected = "must be the last")]
fn a_short_chunk_must_be_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = CloudWriter::create(&folder.path().join("a"), &options(6, true)).unwrap();
    let chunk = writer.layout().chunk(&records(9)).unwrap();
    writer.append(&chunk).unwrap();
    let _ = writer.append(&chunk);
}

#[test]
fn endings_choose_and_unknown_formats_are_refused() {
    let by = |name: &str| packing_by_name(Path::new(name));
    assert_eq!(by("a/b.LAS"), Some(PointPacking::Plain));
    assert_eq!(by("b.laz"), Some(PointPacking::Chunks));
    assert_eq!(by("b.copc.laz"), Some(PointPacking::Nodes));
    assert_eq!(by("b.tif"), None);
    for number in [11, 128] {
        assert_eq!(PointFormat::new(number).unwrap_err().kind(), ErrorKind::Usage);
    }
}

#[test]
fn a_survey_is_the_same_file_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let survey = synth::survey("cloud,size=220,density=6,seed=2,outliers=0.01").unwrap();
    for ending in ["las", "laz"] {
        let file = |threads: usize, memory: u64| {
            let output = folder.path().join(format!("{threads}.{ending}"));
            let job = SyntheticCloudJob {
                survey: survey.clone(),
                output: output.clone(),
                format: PointFormat::default(),
                overwrite: false,
                resources: Resources { threads, memory, temp_dir: None },
            };
            let report = synthetic_cloud::run(&job, &Silent, &Cancel::default()).unwrap();
            assert_eq!(report.output_bytes, output.metadata().unwrap().len());
            (report.points, std::fs::read(output).unwrap())
        };
        let (points, bytes) = file(1, 44 << 20);
        for threads in 2..4 {
            assert!(file(threads, 1 << 30) == (points, bytes.clone()), "{threads} threads");
        }
        let mut all = Vec::new();
        let mut echoes = Vec::new();
        for part in 0..survey.parts() {
            survey.fill(part, &mut echoes);
            all.extend(echoes.iter().map(PointRecord::from));
        }
        let mut reader = Reader::from_path(folder.path().join(format!("1.{ending}"))).unwrap();
        let frame = synth::frame(&survey);
        assert_eq!(points, all.len() as u64);
        let read = reader.read_all().unwrap();
        let mut pairs = read.points().zip(&all);
        assert!(pairs.all(|(point, record)| is_same(&point.unwrap(), record, 6, frame)));
    }
}

/// World coordinates of all points of a source, part by part.
fn world(source: &dyn PointSource) -> Vec<[f64; 3]> {
    let (frame, mut all) = (source.info().frame, Vec::new());
    for part in 0..source.parts() {
        let mut take = |batch: &[Point]| {
            all.extend(batch.iter().map(|point| frame.world(*point)));
            Ok(())
        };
        source.positions(part, &mut take).unwrap();
    }
    all
}

#[test]
fn a_survey_by_name_and_its_file_are_one_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let name = "synth:cloud,width=300,height=80,density=4,seed=8,outliers=0.01";
    let filter = CloudFilter {
        classes: Some(vec![2, 5, 7]),
        returns: Some(Return::Last),
        bounds: Some([500_020.0, 4_750_000.0, 500_160.0, 4_750_070.0]),
        ..CloudFilter::default()
    };
    let options = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
    let open = |input: &str| terrane_cloud::source(&[input.to_owned()], &options).unwrap();
    let by_name = world(open(name).as_ref());
    assert!(by_name.len() > 5000);
    for ending in ["las", "laz"] {
        let output = folder.path().join(format!("a.{ending}"));
        let job = SyntheticCloudJob {
            survey: synth::survey(name).unwrap(),
            output: output.clone(),
            format: PointFormat::default(),
            overwrite: false,
            resources: Resources { threads: 2, memory: 1 << 30, temp_dir: None },
        };
        synthetic_cloud::run(&job, &Silent, &Cancel::default()).unwrap();
        let file = open(&output.to_string_lossy());
        let read = world(file.as_ref());
        let far = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).any(|k| (a[k] - b[k]).abs() > 1e-6);
        assert!(read.len() == by_name.len() && !read.iter().zip(&by_name).any(far), "{ending}");
        assert_eq!(file.info().crs.epsg, Some(32_631));
    }
}
