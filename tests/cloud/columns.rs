//! Points with attributes: the same points as without, each attribute as it was written, in every format.

use std::path::Path;

use crate::write::{options, records, write};
use terrane_base::attribute::ATTRIBUTES;
use terrane_base::geom::Point;
use terrane_cloud::write::{PointPacking, PointRecord};
use terrane_cloud::{
    CloudFilter, CloudOpenOptions, PointBatch, PointSource, Return, ReturnCounts, open,
};

/// The value that a reader of such a file has to find.
fn written(record: &PointRecord, name: &str, is_new: bool) -> f64 {
    match name {
        "intensity" => record.intensity.into(),
        "return_number" => record.number.into(),
        "number_of_returns" => record.returns.into(),
        "classification" => record.class.into(),
        "scan_angle" if is_new => f64::from(record.angle) * 0.006,
        // Whole degrees, cut off as the writer does.
        "scan_angle" => (f32::from(record.angle) * 0.006) as i8 as f64,
        "user_data" => record.user.into(),
        "point_source_id" => record.source.into(),
        "red" => record.colour[0].into(),
        "green" => record.colour[1].into(),
        "blue" => record.colour[2].into(),
        "infrared" => record.infrared.into(),
        "gps_time" => record.time,
        other => unreachable!("{other}"),
    }
}

fn has(format: u8, name: &str) -> bool {
    match name {
        "red" | "green" | "blue" => matches!(format, 2 | 3 | 7 | 8),
        "infrared" => format == 8,
        "gps_time" => !matches!(format, 0 | 2),
        _ => true,
    }
}

/// All points of a source with these attributes.
fn told(source: &dyn PointSource, names: &[String]) -> (Vec<Point>, Vec<Vec<f64>>, ReturnCounts) {
    let selection = source.select(names).unwrap();
    let (mut points, mut all, mut census) =
        (Vec::new(), vec![Vec::new(); names.len()], ReturnCounts::default());
    for part in 0..source.parts() {
        let read = source.read(part, &selection, &mut |batch| {
            let PointBatch { positions, attributes } = batch;
            assert!(attributes.iter().all(|column| column.len() == positions.len()));
            points.extend_from_slice(positions);
            all.iter_mut().zip(attributes).for_each(|(all, column)| all.extend(column));
            Ok(())
        });
        census.add(&read.unwrap());
    }
    (points, all, census)
}

fn plain(source: &dyn PointSource) -> (Vec<Point>, ReturnCounts) {
    let (mut points, mut census) = (Vec::new(), ReturnCounts::default());
    for part in 0..source.parts() {
        let read = source.positions(part, &mut |batch| {
            points.extend_from_slice(batch);
            Ok(())
        });
        census.add(&read.unwrap());
    }
    (points, census)
}

fn opened(path: &Path, options: &CloudOpenOptions) -> terrane_cloud::PointCloud {
    open(&[format!("cloud:{}", path.display())], options).unwrap()
}

/// Points within reach of each other.
fn near(count: usize) -> Vec<PointRecord> {
    let mut all = records(count);
    all.iter_mut().for_each(|record| {
        record.point = Point::new(record.point.x >> 8, record.point.y >> 8, record.point.z);
    });
    all
}

#[test]
fn attributes_are_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let all = near(60_000);
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for compress in [false, true] {
            let path = folder.path().join(format!("{format}-{compress}.las"));
            write(&path, &options(format, compress), &all).unwrap();
            let filter = CloudFilter { keep_withheld: true, ..CloudFilter::default() };
            let reading = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
            let cloud = opened(&path, &reading);
            let own = ATTRIBUTES.iter().map(|a| a.name).filter(|name| has(format, name));
            let names: Vec<String> = own.map(str::to_owned).collect();
            let (points, columns, census) = told(&cloud, &names);
            assert_eq!((points, census), plain(&cloud), "{format}");
            for (name, column) in names.iter().zip(&columns) {
                for (found, record) in column.iter().zip(&all) {
                    let expected = written(record, name, format >= 6);
                    assert!(
                        (found - expected).abs() < 1e-12 * expected.abs().max(1.0),
                        "{format} {name}: {found} {expected}"
                    );
                }
                assert_eq!(column.len(), all.len());
            }
            // What needs no whole records is the same without them, whatever is filtered.
            let filter = CloudFilter {
                classes: Some(vec![2, 7, 31]),
                returns: Some(Return::Last),
                ..CloudFilter::default()
            };
            let cloud = opened(&path, &CloudOpenOptions { filter, ..reading });
            let common = ["number_of_returns", "classification"].map(str::to_owned);
            let with_more = [&common[..], &["intensity".to_owned()]].concat();
            let ((points, few, census), (_, more, _)) =
                (told(&cloud, &common), told(&cloud, &with_more));
            assert_eq!((points, census), plain(&cloud));
            assert!(census.kept > 1000 && few == more[..2]);
            let lacking = ATTRIBUTES.iter().map(|a| a.name).find(|name| !has(format, name));
            for name in lacking.into_iter().chain(["amplitude"]) {
                let error = cloud.select(&[name.to_owned()]).err().unwrap().to_string();
                assert!(error.contains(name) && error.contains(".las"), "{error}");
            }
        }
    }
}

/// Times of the week beside those since 1980 are no times of one kind.
#[test]
fn times_that_are_counted_otherwise_are_refused_only_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for (name, encoding) in [("a.las", 0), ("b.las", 1)] {
        let mut options = options(6, false);
        options.carried.encoding = encoding;
        write(&folder.path().join(name), &options, &near(10)).unwrap();
    }
    let cloud = opened(folder.path(), &CloudOpenOptions::default());
    assert!(cloud.select(&["intensity".to_owned()]).is_ok());
    let error = cloud.select(&["gps_time".to_owned()]).err().unwrap().to_string();
    assert!(error.contains("b.las") && error.contains("GPS time encoding differs"), "{error}");
}

/// Whatever is damaged, no point is told of twice, and none is missing from the counts.
#[test]
fn damage_is_an_error_or_salvaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let all = near(120_000);
    for format in [1, 6] {
        let options = options(format, true);
        assert_eq!(options.packing, PointPacking::Chunks);
        let _ = std::fs::remove_file(&path);
        write(&path, &options, &all).unwrap();
        let sound = std::fs::read(&path).unwrap();
        for share in [3, 5, 8] {
            let mut bytes = sound.clone();
            let at = bytes.len() * share / 10;
            bytes[at] ^= 0x55;
            std::fs::write(&path, bytes).unwrap();
            let names = ["intensity", "gps_time"].map(str::to_owned);
            let cloud = opened(&path, &CloudOpenOptions::default());
            let selection = cloud.select(&names).unwrap();
            let failed = (0..cloud.parts())
                .filter(|part| cloud.read(*part, &selection, &mut |_| Ok(())).is_err());
            assert_eq!(failed.count(), 1, "{format} {share}");
            let salvage = CloudOpenOptions { salvage: true, ..CloudOpenOptions::default() };
            let (points, columns, census) = told(&opened(&path, &salvage), &names);
            assert_eq!(points.len() as u64, census.kept);
            assert!(columns.iter().all(|column| column.len() == points.len()));
            assert!(census.lost > 0 && census.read == all.len() as u64, "{census:?}");
            assert_eq!(census.read, census.kept + census.withheld + census.lost + census.outside);
        }
    }
}
