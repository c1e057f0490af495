//! Filters against a naive reading of what they mean; many files that are one cloud; text.

use std::num::NonZeroU32;
use std::sync::Arc;

use crate::cloud_support::{
    Made, Packing, Place, Random, copc, keep_all, raw, read_all, read_file,
};
use terrane_base::geom::{Crs, wkt};
use terrane_cloud::{
    self as cloud, CloudFilter, CloudOpenOptions, FilterPolygon, Flags, PointSource, PolygonRings,
    Return, ReturnCounts, is_cloud,
};

fn of_rings(rings: &[Vec<[f64; 2]>]) -> FilterPolygon {
    let mut all = PolygonRings::default();
    rings.iter().for_each(|ring| all.push(ring).unwrap());
    FilterPolygon::new(all)
}

/// A triangle with a hole.
fn polygon() -> FilterPolygon {
    let around = [[900.0, 1900.0], [1200.0, 1900.0], [1000.0, 2300.0]];
    let hole = [[980.0, 1980.0], [980.0, 2020.0], [1020.0, 2020.0], [1020.0, 1980.0]];
    of_rings(&[around.to_vec(), hole.to_vec()])
}

fn filters() -> Vec<CloudFilter> {
    let none = CloudFilter::default;
    vec![
        none(),
        CloudFilter { keep_withheld: true, ..none() },
        CloudFilter { classes: Some(vec![2, 6]), ..none() },
        CloudFilter { returns: Some(Return::First), ..none() },
        CloudFilter { returns: Some(Return::Last), keep_withheld: true, ..none() },
        CloudFilter { returns: Some(Return::Only), ..none() },
        CloudFilter { returns: Some(Return::Number(3)), ..none() },
        CloudFilter { drop: Flags::OVERLAP.and(Flags::SYNTHETIC), ..none() },
        CloudFilter { bounds: Some([980.0, 1990.0, 1030.5, 2100.0]), ..none() },
        CloudFilter { z_range: Some([-0.5, 2.0]), ..none() },
        CloudFilter { every: NonZeroU32::new(3), ..none() },
        CloudFilter { polygon: Some(Arc::new(polygon())), ..none() },
        CloudFilter {
            classes: Some(vec![2]),
            returns: Some(Return::Last),
            bounds: Some([950.0, 1950.0, 1100.0, 2100.0]),
            every: NonZeroU32::new(2),
            ..none()
        },
    ]
}

/// What `filter` leaves of a file, straight from the format's tables.
fn naive(made: &Made, filter: &CloudFilter) -> Vec<[f64; 3]> {
    let is_new = made.format > 5;
    let keep = |(index, record): &(usize, &Vec<u8>)| {
        let (a, b) = (record[14], record[15]);
        let (number, returns) = if is_new { (a & 15, a >> 4) } else { (a & 7, a >> 3 & 7) };
        let class = if is_new { record[16] } else { b & 31 };
        let mut flags = if is_new { b & 15 } else { b >> 5 };
        if !is_new && class == 12 {
            flags |= 8;
        }
        let raw = raw(record);
        let [x, y, z] = [0, 1, 2].map(|i| f64::from(raw[i]) * made.scale[i] + made.offset[i]);
        let in_box = filter.bounds.is_none_or(|b| x >= b[0] && y >= b[1] && x <= b[2] && y <= b[3]);
        let returned = match filter.returns {
            None => true,
            Some(Return::First) => number == 1,
            Some(Return::Last) => number == returns,
            Some(Return::Only) => returns == 1,
            Some(Return::Number(n)) => number == n,
        };
        let in_triangle = || {
            let right = |a: [f64; 2], b: [f64; 2]| {
                (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0.0
            };
            let inside = right([900.0, 1900.0], [1200.0, 1900.0])
                && right([1200.0, 1900.0], [1000.0, 2300.0])
                && right([1000.0, 2300.0], [900.0, 1900.0]);
            inside && !(980.0 < x && x < 1020.0 && 1980.0 < y && y < 2020.0)
        };
        (filter.keep_withheld || flags & 4 == 0)
            && flags & filter.drop.0 == 0
            && filter.classes.as_ref().is_none_or(|c| c.contains(&class))
            && returned
            && in_box
            && filter.z_range.is_none_or(|[low, high]| low <= z && z <= high)
            && filter.every.is_none_or(|n| index % n.get() as usize == 0)
            && (filter.polygon.is_none() || in_triangle())
    };
    let world = made.world();
    made.records.iter().enumerate().filter(keep).map(|(index, _)| world[index]).collect()
}

#[test]
fn filters_mean_what_they_say() {
    let place = Place::new();
    for (format, packing) in
        [(1, Packing::Plain), (6, Packing::Plain), (0, Packing::Fixed(99)), (7, Packing::Fixed(99))]
    {
        let made = Made::new(format, packing, 2000);
        let name = place.write("a.laz", &made.bytes());
        for filter in filters() {
            let expected = naive(&made, &filter);
            let options =
                CloudOpenOptions { filter: filter.clone(), ..CloudOpenOptions::default() };
            let (points, census) = read_file(&name, &options).unwrap();
            assert_eq!(points, expected, "format {format}, {filter:?}");
            let told = census.kept + census.withheld + census.filtered;
            assert_eq!((census.read, told), (2000, 2000), "{filter:?}");
        }
    }
}

/// The decimal of so many digits that people write for `units` of its last one.
fn decimal(units: i64, digits: u32) -> f64 {
    format!("{units}e-{digits}").parse().unwrap()
}

/// Points of steps of 10^-`digits`, with offsets of whole steps, `apart` from the origin.
struct Steps {
    digits: u32,
    offset: i64,
    apart: i32,
}

const STEPS: [Steps; 7] = [
    Steps { digits: 2, offset: 0, apart: 0 },
    Steps { digits: 2, offset: 100_000, apart: 0 },
    Steps { digits: 3, offset: -4_750_000_500, apart: 0 },
    Steps { digits: 1, offset: 7, apart: 0 },
    Steps { digits: 6, offset: 3, apart: 0 },
    Steps { digits: 7, offset: 12_345_678_901, apart: 0 },
    // Too far off for the frame to begin where the file does.
    Steps { digits: 3, offset: 1_100, apart: 1_600_000_000 },
];

impl Steps {
    fn made(&self, format: u8, packing: Packing, count: usize) -> Made {
        let mut made = Made::new(format, packing, count);
        for record in &mut made.records {
            for axis in 0..3 {
                let at = raw(record)[axis] + self.apart;
                record[4 * axis..4 * axis + 4].copy_from_slice(&at.to_le_bytes());
            }
        }
        made.scale = [decimal(1, self.digits); 3];
        made.offset = [decimal(self.offset, self.digits); 3];
        made
    }

    /// Both ways to write the place of a step: the decimal, and what readers compute.
    fn limits(&self, made: &Made, step: i32, axis: usize) -> [f64; 2] {
        let read = f64::from(step) * made.scale[axis] + made.offset[axis];
        [decimal(i64::from(step) + self.offset, self.digits), read]
    }

    /// A file, as LAS, LAZ or text.
    fn write(&self, made: &Made, kind: &str, place: &Place) -> String {
        if kind != "txt" {
            return place.write(&format!("a.{kind}"), &made.bytes());
        }
        let line = |record: &Vec<u8>| {
            let [x, y, z] = raw(record).map(|step| i64::from(step) + self.offset);
            let number = |units: i64| {
                let ten = 10_u64.pow(self.digits);
                let (size, sign) = (units.unsigned_abs(), if units < 0 { "-" } else { "" });
                format!("{sign}{}.{:0w$}", size / ten, size % ten, w = self.digits as usize)
            };
            format!("{} {} {}\n", number(x), number(y), number(z))
        };
        place.write("a.txt", made.records.iter().map(line).collect::<String>().as_bytes())
    }
}

/// How many points a filter keeps.
fn kept(name: &str, filter: CloudFilter) -> usize {
    let filter = CloudFilter { keep_withheld: true, ..filter };
    read_file(name, &CloudOpenOptions { filter, ..CloudOpenOptions::default() }).unwrap().0.len()
}

#[test]
fn limits_on_steps_hold_the_points_on_them() {
    let place = Place::new();
    for steps in STEPS {
        for (kind, packing) in
            [("las", Packing::Plain), ("laz", Packing::Fixed(99)), ("txt", Packing::Plain)]
        {
            let made = steps.made(1, packing, 400);
            let name = steps.write(&made, kind, &place);
            let all: Vec<[i32; 3]> = made.records.iter().map(|record| raw(record)).collect();
            let count = |is_in: &dyn Fn(&[i32; 3]) -> bool| all.iter().filter(|p| is_in(p)).count();
            for p in all.iter().step_by(40) {
                let of = |axis: usize, more: i32| steps.limits(&made, p[axis] + more, axis);
                // What readers compute is another number for a file of decimals, and in a frame that
                // begins elsewhere.
                for which in 0..if kind == "txt" || steps.apart != 0 { 1 } else { 2 } {
                    let told = format!("{kind} {} {} {p:?} {which}", steps.digits, steps.offset);
                    let at = of(2, 0)[which];
                    let filter = CloudFilter { z_range: Some([at, at]), ..CloudFilter::default() };
                    assert_eq!(kept(&name, filter), count(&|q| q[2] == p[2]), "{told}");
                    let ends = |axis: usize| (of(axis, 0)[which], of(axis, 700)[which]);
                    let ((west, east), (south, north)) = (ends(0), ends(1));
                    let bounds = Some([west, south, east, north]);
                    let within = |q: &[i32; 3], axis: usize, closed: i32| {
                        p[axis] <= q[axis] && q[axis] < p[axis] + 700 + closed
                    };
                    let expected = count(&|q| within(q, 0, 1) && within(q, 1, 1));
                    assert_eq!(
                        kept(&name, CloudFilter { bounds, ..CloudFilter::default() }),
                        expected,
                        "{told}"
                    );
                    let corners = [[west, south], [east, south], [east, north], [west, north]];
                    let polygon = Some(Arc::new(of_rings(&[corners.to_vec()])));
                    let expected = count(&|q| within(q, 0, 0) && within(q, 1, 0));
                    assert_eq!(
                        kept(&name, CloudFilter { polygon, ..CloudFilter::default() }),
                        expected,
                        "{told}"
                    );
                }
            }
        }
    }
}

#[test]
fn limits_between_steps_lie_between_points() {
    let place = Place::new();
    let steps = &STEPS[1];
    let made = steps.made(6, Packing::Plain, 400);
    let name = steps.write(&made, "las", &place);
    for record in made.records.iter().step_by(40) {
        let z = raw(record)[2];
        let at = decimal(i64::from(z) + steps.offset, steps.digits);
        let above = made.records.iter().filter(|record| raw(record)[2] > z).count();
        let near = at.next_up().next_up().next_up().next_up();
        for beside in [near, at + 1e-9, at + 0.004] {
            let filter = CloudFilter { z_range: Some([beside, 1e9]), ..CloudFilter::default() };
            assert_eq!(kept(&name, filter), above, "{beside}");
        }
    }
}

#[test]
fn points_on_slanted_edges_are_decided_exactly() {
    let place = Place::new();
    for steps in &STEPS[..3] {
        let mut made = steps.made(1, Packing::Plain, 2000);
        // Near enough for many to lie on edges.
        for record in &mut made.records {
            for axis in 0..2 {
                let at = raw(record)[axis].rem_euclid(21);
                record[4 * axis..4 * axis + 4].copy_from_slice(&at.to_le_bytes());
            }
        }
        let name = steps.write(&made, "las", &place);
        let mut random = Random::of(5);
        for _ in 0..20 {
            let corners: [[i32; 2]; 3] =
                [(); 3].map(|()| [(); 2].map(|()| random.below(21) as i32));
            let place = |c: [i32; 2]| [0, 1].map(|axis| steps.limits(&made, c[axis], axis)[0]);
            let polygon = Some(Arc::new(of_rings(&[corners.map(place).to_vec()])));
            let inside = |record: &&Vec<u8>| {
                let [x, y, _] = raw(record);
                let left = [(0, 1), (1, 2), (2, 0)].into_iter().filter(|(a, b)| {
                    let (mut low, mut high) = (corners[*a], corners[*b]);
                    if low[1] > high[1] {
                        (low, high) = (high, low);
                    }
                    let side =
                        (high[0] - low[0]) * (y - low[1]) - (high[1] - low[1]) * (x - low[0]);
                    low[1] <= y && y < high[1] && side <= 0
                });
                left.count() == 1
            };
            let expected = made.records.iter().filter(inside).count();
            assert_eq!(
                kept(&name, CloudFilter { polygon, ..CloudFilter::default() }),
                expected,
                "{corners:?}"
            );
        }
    }
}

#[test]
fn a_box_elsewhere_reads_nothing() {
    let place = Place::new();
    let name = place.write("a.las", &Made::new(1, Packing::Plain, 50).bytes());
    let mut options = keep_all();
    options.filter.bounds = Some([5000.0, 5000.0, 6000.0, 6000.0]);
    let cloud = cloud::open(&[name], &options).unwrap();
    assert_eq!((cloud.parts(), cloud.info().count, cloud.info().bounds), (0, 0, None));
}

#[test]
fn polygons_share_borders_without_sharing_points() {
    let ring = |points: [[f64; 2]; 4]| of_rings(&[points.to_vec()]);
    let west = ring([[0.0, 0.0], [3.0, 1.0], [2.0, 5.0], [0.0, 4.0]]);
    let east = ring([[3.0, 1.0], [6.0, 0.0], [6.0, 6.0], [2.0, 5.0]]);
    let both = of_rings(&[
        vec![[0.0, 0.0], [3.0, 1.0], [2.0, 5.0], [0.0, 4.0]],
        vec![[3.0, 1.0], [6.0, 0.0], [6.0, 6.0], [2.0, 5.0]],
    ]);
    let mut random = Random::of(1);
    for _ in 0..20_000 {
        let [x, y] = [0; 2].map(|_| random.below(25) as f64 / 4.0);
        assert!(!(west.contains(x, y) && east.contains(x, y)), "{x} {y}");
        assert_eq!(west.contains(x, y) || east.contains(x, y), both.contains(x, y), "{x} {y}");
    }
    assert!(west.contains(1.0, 2.0) && !west.contains(4.0, 2.0) && east.contains(4.0, 2.0));
}

/// Points of all parts, sorted, with the counts.
fn sorted(inputs: &[String], options: &CloudOpenOptions) -> (Vec<[f64; 3]>, ReturnCounts) {
    let (mut points, census) = read_all(&cloud::open(inputs, options).unwrap()).unwrap();
    points.sort_by(|a, b| a.partial_cmp(b).unwrap());
    (points, census)
}

#[test]
fn many_files_are_one_cloud_in_any_order() {
    let place = Place::new();
    let mut a = Made::new(1, Packing::Plain, 300);
    let b = Made::new(6, Packing::Fixed(50), 200);
    // The same lattice, named from another step of it.
    a.offset = [1500.0, -3000.0, 7.0];
    let (one, two) = (place.write("a.las", &a.bytes()), place.write("b.laz", &b.bytes()));
    let forth = cloud::open(&[one.clone(), two.clone()], &keep_all()).unwrap();
    let back = cloud::open(&[two.clone(), one.clone(), two], &keep_all()).unwrap();
    assert_eq!(forth.info(), back.info());
    assert_eq!(read_all(&forth).unwrap(), read_all(&back).unwrap());
    assert!(!forth.notes().iter().any(|note| note.contains("move")));
    let (points, census) = read_all(&forth).unwrap();
    assert_eq!(census.kept, 500);
    let expected = [a.world(), b.world()].concat();
    let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9);
    assert!(points.iter().zip(&expected).all(near));
    let folder = place.path().to_str().unwrap().to_owned();
    let list = place.write("list.txt", b"a.las\nb.laz\n");
    for inputs in [folder.clone(), format!("{folder}/*.la[sz]"), format!("@{list}"), list] {
        assert!(is_cloud(&inputs), "{inputs}");
        assert_eq!(read_all(&cloud::open(&[inputs], &keep_all()).unwrap()).unwrap().0, points);
    }
}

#[test]
fn other_scales_are_rounded_to_the_finest() {
    let place = Place::new();
    let a = Made { scale: [0.01; 3], offset: [0.0; 3], ..Made::new(1, Packing::Plain, 100) };
    let b = Made { scale: [0.001; 3], offset: [0.0003; 3], ..Made::new(1, Packing::Plain, 100) };
    let inputs = [place.write("a.las", &a.bytes()), place.write("b.las", &b.bytes())];
    let cloud = cloud::open(&inputs, &keep_all()).unwrap();
    assert_eq!(cloud.info().frame.scale, [0.001; 3]);
    let (points, _) = read_all(&cloud).unwrap();
    for (found, expected) in points.iter().zip([a.world(), b.world()].concat()) {
        assert!(
            (0..3).all(|i| (found[i] - expected[i]).abs() <= 0.000_5),
            "{found:?} {expected:?}"
        );
    }
    let note = cloud.notes().iter().find(|note| note.contains("finest")).unwrap();
    assert!(note.contains("0.0005 x 0.0005 x 0.0005"), "{note}");
}

fn with_crs(code: Option<u32>) -> Made {
    let mut made = Made::new(6, Packing::Plain, 10);
    let text = code.map(|code| wkt::of_srs(&format!("EPSG:{code}")).to_wkt().unwrap());
    made.vlrs = text.map(|wkt| ("LASF_Projection", 2112, wkt.into_bytes())).into_iter().collect();
    made
}

#[test]
fn systems_must_agree() {
    let place = Place::new();
    let file = |name: &str, code| place.write(name, &with_crs(code).bytes());
    let (utm, same, other, none) = (
        file("utm.las", Some(32_611)),
        file("same.las", Some(32_611)),
        file("other.las", Some(2154)),
        file("none.las", None),
    );
    let cloud = cloud::open(&[utm.clone(), same], &keep_all()).unwrap();
    assert_eq!(
        (cloud.info().crs.epsg, cloud.info().crs.horizontal_unit()),
        (Some(32_611), "metre")
    );
    for (second, words) in [(&other, "EPSG:2154"), (&none, "‹crs›")] {
        let error = cloud::open(&[utm.clone(), second.clone()], &keep_all()).err().unwrap();
        let told = error.to_string();
        assert!(told.contains("utm.las") && told.contains(words), "{told}");
    }
    let given = Crs { epsg: Some(32_611), ..Crs::default() };
    let options = CloudOpenOptions { crs: Some(given), ..keep_all() };
    assert!(cloud::open(&[utm.clone(), none], &options).is_ok());
    assert!(cloud::open(&[utm, other], &options).is_err());
}

#[test]
fn text_clouds() {
    let place = Place::new();
    let options = keep_all();
    let plain = place.write("a.xyz", b"1.5 2.25 3\r\n# c\n\n4 5 6.125\n");
    let (points, census) = read_file(&plain, &options).unwrap();
    assert_eq!((points, census.kept), (vec![[1.5, 2.25, 3.0], [4.0, 5.0, 6.125]], 2));
    let csv = b"Y,X,Z,Classification,Return_Number,Number_of_Returns\n2,1,3,2,1,2\n5,4,6,6,2,2\n";
    let csv = place.write("b.csv", csv);
    let mut ground = keep_all();
    ground.filter.classes = Some(vec![2]);
    assert_eq!(read_file(&csv, &ground).unwrap().0, [[1.0, 2.0, 3.0]]);
    ground.filter = CloudFilter { returns: Some(Return::Last), ..CloudFilter::default() };
    assert_eq!(read_file(&csv, &ground).unwrap().0, [[4.0, 5.0, 6.0]]);
    let bad = place.write("c.txt", b"1 2 3\n1 2 x\n4 5 6\n");
    let told = read_file(&bad, &options).unwrap_err().to_string();
    assert!(told.contains("c.txt: line 2:") && told.contains("‹salvage›"), "{told}");
    let loose = CloudOpenOptions { salvage: true, ..keep_all() };
    let (points, census) = read_file(&bad, &loose).unwrap();
    assert_eq!((points.len(), census.read, census.lost), (2, 3, 1));
    assert!(!is_cloud(&plain) && is_cloud(&format!("cloud:{plain}")));
    assert_eq!(read_file(&format!("cloud:{plain}"), &options).unwrap().1.kept, 2);
}

#[test]
fn long_text_is_cut_at_line_ends() {
    let place = Place::new();
    let mut random = Random::of(3);
    let (mut text, mut expected) = (String::from("x;y;z\n"), Vec::new());
    for _ in 0..150_000 {
        let steps = [0; 3].map(|_| random.below(1_000_000));
        let [x, y, z] = steps.map(|n| n as f64 / 1000.0);
        let pad = " ".repeat(random.below(9));
        text += &format!("{pad}{x:.3};{y:.3};{}\n", z.to_string().replace('.', ","));
        expected.push([x, y, z]);
    }
    let name = place.write("long.csv", text.as_bytes());
    let cloud = cloud::open(&[name], &keep_all()).unwrap();
    assert!(cloud.parts() > 3);
    let (points, census) = read_all(&cloud).unwrap();
    assert_eq!((points.len(), census.kept), (150_000, 150_000));
    let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9);
    assert!(points.iter().zip(&expected).all(near));
}

#[test]
fn an_octree_and_boxes_agree_with_filtering() {
    let place = Place::new();
    let name = place.write("a.copc.laz", &copc(60));
    let all = sorted(std::slice::from_ref(&name), &keep_all()).0;
    for bounds in [[100.0, 200.0, 1500.0, 900.0], [0.0, 0.0, 1023.0, 1023.0], [3e3, 0.0, 4e3, 1.0]]
    {
        let mut options = keep_all();
        options.filter.bounds = Some(bounds);
        let [west, south, east, north] = bounds;
        let inside = |p: &&[f64; 3]| p[0] >= west && p[0] <= east && p[1] >= south && p[1] <= north;
        let expected: Vec<_> = all.iter().filter(inside).copied().collect();
        assert_eq!(sorted(std::slice::from_ref(&name), &options).0, expected, "{bounds:?}");
    }
}
