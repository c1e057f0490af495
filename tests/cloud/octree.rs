//! Octrees (COPC): each point once, in its cube, where the slow way puts it.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use terrane_cloud::PointFormat;
use terrane_engine::Resources;
use terrane_lidar::points::TranslateJob;

use crate::cloud_support::{Made, Packing, Place, keep_all, raw, read_all};
use crate::translate::{job, number, run, whole};

/// A field of points with a hill and a tower, of so many.
pub(crate) fn field(count: usize) -> Made {
    let mut made = Made::new(7, Packing::Fixed(50_000), count);
    for (number, record) in made.records.iter_mut().enumerate() {
        let [x, y] = [number * 7919 % 100_003, number * 104_729 % 100_019].map(|at| at as i32);
        let hill = (f64::from(x - 50_000).hypot(f64::from(y - 50_000)) / -20_000.0).exp();
        let at = if number % 5 == 0 {
            [x / 500, y / 500, x % 3000]
        } else {
            [x, y, (hill * 5e4) as i32]
        };
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
        record[22..30].copy_from_slice(&(number as f64 * 0.25).to_le_bytes());
    }
    made
}

/// A node of an octree: level and place; first byte, bytes, points.
type Node = ([i32; 4], [u64; 3]);

/// The nodes of an octree; with the cube's lowest corner and side.
fn nodes(path: &Path) -> (Vec<Node>, [f64; 4]) {
    let found = whole(path).vlrs;
    let data = |id: u16| {
        &found.iter().find(|(user, number, _)| user == "copc" && *number == id).unwrap().2
    };
    let info = data(1);
    let float = |at: usize| f64::from_le_bytes(number(info, at));
    let half = float(24);
    let cube = [float(0) - half, float(8) - half, float(16) - half, 2.0 * half];
    let entry = |bytes: &[u8]| {
        let key = [0, 4, 8, 12].map(|at| i32::from_le_bytes(number(bytes, at)));
        let count = |at: usize| u64::from(u32::from_le_bytes(number(bytes, at)));
        (key, [u64::from_le_bytes(number(bytes, 16)), count(24), count(28)])
    };
    (data(1000).chunks(32).map(entry).collect(), cube)
}

/// A point: which of 2^30 divisions of the cube it is in, and its record.
type Fine = ([u32; 3], Vec<u8>);

/// The slow way to an octree: the points that a node of all these has, those below it put into `nodes`.
fn held(
    key: [i32; 4],
    points: Vec<Fine>,
    nodes: &mut BTreeMap<[i32; 4], Vec<Vec<u8>>>,
) -> Vec<Fine> {
    if points.len() <= 1 << 16 || points.iter().all(|(fine, _)| *fine == points[0].0) {
        return points;
    }
    let [level, x, y, z] = key;
    let mut best: BTreeMap<[u32; 3], (i64, Vec<u8>)> = BTreeMap::new();
    let mut below = Vec::new();
    for child in 0..8_i32 {
        let [a, b, c] = [child & 1, child >> 1 & 1, child >> 2];
        let is_in =
            |(fine, _): &&Fine| fine.map(|fine| (fine >> (29 - level) & 1) as i32) == [a, b, c];
        let own = points.iter().filter(is_in).cloned().collect();
        let key = [level + 1, 2 * x + a, 2 * y + b, 2 * z + c];
        below.push((key, held(key, own, nodes)));
    }
    // Twice the cell of 2^(23 - level) divisions and the distance from its middle.
    let bits = 23 - level as u32;
    let cell = |fine: [u32; 3]| fine.map(|fine| fine >> bits);
    let apart = |fine: [u32; 3]| {
        let along = |fine: u32| 2 * i64::from(fine % (1 << bits)) + 1 - (1 << bits);
        fine.map(|fine| along(fine).pow(2)).iter().sum::<i64>()
    };
    for (fine, record) in below.iter().flat_map(|(_, all)| all) {
        let one = (apart(*fine), record.clone());
        let known = best.entry(cell(*fine)).or_insert_with(|| one.clone());
        *known = one.min(known.clone());
    }
    let mut own = Vec::new();
    for (key, all) in below {
        let (taken, rest): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|(fine, record)| best[&cell(*fine)].1 == *record);
        own.extend(taken);
        if !rest.is_empty() {
            nodes.insert(key, rest.into_iter().map(|(_, record)| record).collect());
        }
    }
    own
}

#[test]
fn an_octree_holds_each_point_once_in_its_cube_and_more_than_one_node() {
    let place = Place::new();
    let made = field(300_000);
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.copc.laz");
    let report = run(&job(&[&input], &output)).unwrap();
    assert_eq!(report.points, 300_000);
    let found = whole(&output);
    assert_eq!((found.vlrs[0].0.as_str(), found.vlrs[0].1), ("copc", 1));
    let sorted = |mut records: Vec<Vec<u8>>| {
        records.sort_unstable();
        records
    };
    assert!(sorted(found.records.clone()) == sorted(made.records.clone()));
    let (nodes, [x, y, z, side]) = nodes(&output);
    assert!(nodes.len() > 10 && nodes.iter().any(|(key, _)| *key == [0; 4]), "{}", nodes.len());
    let there: HashSet<_> = nodes.iter().map(|(key, _)| *key).collect();
    let mut by_place: BTreeMap<u64, ([i32; 4], u64)> = BTreeMap::new();
    for ([level, at @ ..], [first, _, points]) in &nodes {
        let above = [level - 1, at[0] / 2, at[1] / 2, at[2] / 2];
        assert!(*level == 0 || there.contains(&above), "{level} {at:?}");
        assert!((1..=1 << 16).contains(points), "{points}");
        by_place.insert(*first, ([*level, at[0], at[1], at[2]], *points));
    }
    let fine = |record: &Vec<u8>| {
        let world =
            |axis: usize| f64::from(raw(record)[axis]) * made.scale[axis] + made.offset[axis];
        let at = |(axis, low): (usize, f64)| {
            let share = (world(axis) - low) / side * f64::from(1 << 30);
            share.clamp(0.0, f64::from((1 << 30) - 1)) as u32
        };
        ([(0, x), (1, y), (2, z)].map(at), record.clone())
    };
    let mut expected = BTreeMap::new();
    let root = held([0; 4], made.records.iter().map(fine).collect(), &mut expected);
    expected.insert([0; 4], root.into_iter().map(|(_, record)| record).collect());
    let mut records = found.records.iter();
    for ([level, at @ ..], points) in by_place.into_values() {
        let own = records.as_slice()[..points as usize].to_vec();
        let key = [level, at[0], at[1], at[2]];
        assert!(sorted(own) == sorted(expected.remove(&key).unwrap()), "{key:?}");
        let size = side / f64::from(1 << level);
        let mut last = f64::NEG_INFINITY;
        for record in records.by_ref().take(points as usize) {
            let raw = raw(record);
            for (axis, low) in [x, y, z].into_iter().enumerate() {
                let world = f64::from(raw[axis]) * made.scale[axis] + made.offset[axis];
                let from = low + f64::from(at[axis]) * size;
                assert!((from - 1e-6..=from + size + 1e-6).contains(&world), "{world} of {from}");
            }
            let time = f64::from_le_bytes(number(record, 22));
            assert!(time >= last, "sorted by time");
            last = time;
        }
    }
    assert!(expected.is_empty());
    let bytes = std::fs::read(&output).unwrap();
    for (threads, memory, format) in [(1, 70, 7), (3, 4096, 7), (2, 100, 7)] {
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        let format = Some(PointFormat::new(format).unwrap());
        run(&TranslateJob { resources, format, ..job(&[&input], &output) }).unwrap();
        assert!(std::fs::read(&output).unwrap() == bytes, "{threads} threads, {memory} MiB");
    }
    let again = terrane_cloud::open(&[output.to_str().unwrap().to_owned()], &keep_all()).unwrap();
    assert_eq!((again.format(), read_all(&again).unwrap().1.kept), ("COPC", 300_000));
}

/// Whole coordinates, in centimetres, of clouds that are hard to divide; and the deepest level that they need.
fn heaps() -> Vec<(&'static str, Vec<[i32; 3]>, i32)> {
    let heap = |at: [i32; 3]| std::iter::repeat_n(at, 70_000);
    let spread = |step: usize| {
        (0..500_usize).map(move |i| [i * step, i * 7919 % 500 * step, i % 7].map(|at| at as i32))
    };
    let metre = (0..70_000).map(|i| [i % 100, i / 100 % 100, i / 10_000]);
    let off = |at: [i32; 3]| [at[0] + 100_000, at[1] + 100_000, at[2]];
    vec![
        ("no point", Vec::new(), 0),
        ("one point", vec![[3, 4, 5]], 0),
        ("one place", heap([5, 6, 7]).collect(), 0),
        ("others far off", heap([0; 3]).chain(spread(1).map(off)).collect(), 1),
        ("others around", heap([40_000; 3]).chain(spread(200)).collect(), 8),
        ("others beside", heap([0; 3]).chain(spread(1)).chain([off([0; 3])]).collect(), 17),
        ("two places", heap([0; 3]).chain(heap([1, 0, 0])).chain([off([0; 3])]).collect(), 17),
        ("a metre, and others far off", metre.chain(spread(1).map(off)).collect(), 11),
    ]
}

/// The nodes that a reader finds who walks down from the root.
fn reached(nodes: &[Node]) -> HashSet<[i32; 4]> {
    let there: HashSet<_> = nodes.iter().map(|(key, _)| *key).collect();
    let (mut found, mut next) = (HashSet::new(), vec![[0; 4]]);
    while let Some([level, x, y, z]) = next.pop() {
        if there.contains(&[level, x, y, z]) && found.insert([level, x, y, z]) {
            let below =
                |i: i32| [level + 1, 2 * x + (i & 1), 2 * y + (i >> 1 & 1), 2 * z + (i >> 2)];
            next.extend((0..8).map(below));
        }
    }
    found
}

#[test]
fn every_node_is_reached_from_the_root_and_depth_is_that_of_the_places() {
    let place = Place::new();
    for (what, at, deepest) in heaps() {
        let mut made = Made::new(6, Packing::Plain, at.len());
        for (record, at) in made.records.iter_mut().zip(&at) {
            record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
        }
        let input = place.write("in.las", &made.bytes());
        let output = place.path().join("out.copc.laz");
        run(&job(&[&input], &output)).unwrap();
        let (nodes, [x, y, z, side]) = nodes(&output);
        assert_eq!(reached(&nodes).len(), nodes.len(), "{what}: {nodes:?}");
        let last = nodes.iter().map(|(key, _)| key[0]).max();
        assert!(last <= Some(deepest), "{what}: level {last:?}");
        let mut by_place: Vec<_> = nodes.iter().filter(|(_, [.., points])| *points > 0).collect();
        by_place.sort_by_key(|(_, [first, ..])| *first);
        let mut found = whole(&output).records;
        let mut rest = found.as_slice();
        for ([level, at @ ..], [.., points]) in by_place {
            let (own, others) = rest.split_at(*points as usize);
            rest = others;
            let is_one = own.iter().all(|record| raw(record) == raw(&own[0]));
            assert!(own.len() <= 1 << 16 || is_one, "{what}: {points}");
            let size = side / f64::from(1 << level);
            for record in own {
                for (axis, low) in [x, y, z].into_iter().enumerate() {
                    let world = f64::from(raw(record)[axis]) * made.scale[axis] + made.offset[axis];
                    let from = low + f64::from(at[axis]) * size;
                    assert!((from - 1e-6..=from + size + 1e-6).contains(&world), "{what}: {world}");
                }
            }
        }
        assert!(rest.is_empty(), "{what}: {}", rest.len());
        found.sort_unstable();
        made.records.sort_unstable();
        assert!(found == made.records, "{what}");
        let again = terrane_cloud::open(&[output.to_str().unwrap().to_owned()], &keep_all());
        assert_eq!(read_all(&again.unwrap()).unwrap().1.kept, at.len() as u64, "{what}");
    }
}
