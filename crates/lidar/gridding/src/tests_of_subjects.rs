//! Statistics of attributes and of some of the points against slow twins, and the same bits for any order.

use proptest::prelude::*;

use super::*;
use terrane_base::geom::{Point, PointFrame};

const FRAME: PointFrame = PointFrame { scale: [1.0, 1.0, 0.25], offset: [0.0; 3] };
const UNITS: CellUnits = CellUnits { scale: 0.25, offset: 0.0, area: 3.0 };
const CELLS: usize = 3;

/// A point with what is known of it.
#[derive(Clone, Copy, Debug)]
struct Known {
    cell: u32,
    steps: i32,
    class: u8,
    returns: [u8; 2],
    intensity: u16,
    /// In steps of scan angles of LAS 1.4.
    angle: i16,
    time: f64,
}

impl Known {
    fn z(&self) -> f64 {
        f64::from(self.steps) / 4.0
    }

    fn attribute(&self, name: &str) -> f64 {
        match name {
            "classification" => self.class.into(),
            "return_number" => self.returns[0].into(),
            "number_of_returns" => self.returns[1].into(),
            "intensity" => self.intensity.into(),
            "scan_angle" => f64::from(self.angle) * 3.0 / 500.0,
            "gps_time" => self.time,
            other => unreachable!("{other}"),
        }
    }
}

fn known() -> impl Strategy<Value = Known> {
    let returns = (1_u8..4, 1_u8..4).prop_map(|(a, b)| [a.min(b), a.max(b)]);
    let time = prop_oneof![-9.0..9.0, Just(0.0), Just(-0.0), 3e8..4e8, Just(f64::NAN)];
    (0..CELLS as u32, -20_i32..60, 0_u8..4, returns, 0_u16..6, -900_i16..900, time).prop_map(
        |(cell, steps, class, returns, intensity, angle, time)| Known {
            cell,
            steps,
            class,
            returns,
            intensity,
            angle,
            time,
        },
    )
}

/// What is kept of points.
fn block(recipe: &StatisticRecipe, all: &[Known]) -> CellBlock {
    let names = recipe.attributes();
    let column = |name: &String| all.iter().map(|point| point.attribute(name)).collect();
    let columns: Vec<Vec<f64>> = names.iter().map(column).collect();
    let point = |known: &Known| Point::new(known.cell as i32, 0, known.steps);
    let points: Vec<Point> = all.iter().map(point).collect();
    let (mut block, mut out) = (CellBlock::new(recipe, CELLS), SelectedPoints::default());
    for (number, subject) in recipe.subjects().iter().enumerate() {
        SubjectSelector::new(subject, &names, &FRAME).select(&points, &columns, &mut out);
        let cells: Vec<u32> = out.points.iter().map(|point| point.x as u32).collect();
        for (region, _) in recipe.regions_of(number) {
            let hits = CellHits {
                cells: &cells,
                points: &out.points,
                squares: &[],
                unit: 1.0,
                reals: &out.reals,
            };
            block.add(region, hits).unwrap();
        }
    }
    block
}

/// A statistic by its definition, of the values that are wanted and of all points of the cell.
fn plain(statistic: Statistic, mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    let n = v.len() as f64;
    let mean = v.iter().sum::<f64>() / n;
    let moment = |power: i32| v.iter().map(|x| (x - mean).powi(power)).sum::<f64>() / n;
    let (Some(low), Some(high)) = (v.first(), v.last()) else {
        return if statistic.counts() { 0.0 } else { f64::NAN };
    };
    let is_flat = low == high;
    match statistic.name() {
        "count" => n,
        "density" => n / 3.0,
        "min" => *low,
        "max" => *high,
        "range" => high - low,
        "mean" => mean,
        "std" => {
            let left = n - statistic.parameter("ddof").unwrap_or(0.0);
            if left > 0.0 { (moment(2) * n / left).sqrt() } else { f64::NAN }
        }
        "skewness" | "kurtosis" if is_flat => f64::NAN,
        "skewness" => moment(3) / moment(2).powf(1.5),
        "kurtosis" => moment(4) / moment(2).powi(2),
        "mode" => {
            let often = |x: &f64| v.iter().filter(|y| *y == x).count();
            let most = v.iter().map(often).max().unwrap();
            *v.iter().find(|x| often(x) == most).unwrap()
        }
        "variety" => {
            v.dedup();
            v.len() as f64
        }
        "entropy" => {
            let layer = statistic.parameter("layer").unwrap_or(1.0);
            let layers = (high / layer).ceil() as usize;
            let above: Vec<f64> = v.iter().copied().filter(|z| *z >= 0.0).collect();
            if *high < 2.0 * layer {
                return f64::NAN;
            }
            let in_layer = |k: usize| {
                let [from, to] = [k, k + 1].map(|k| k as f64 * layer);
                let is_in = |z: &&f64| **z >= from && (**z < to || k + 1 == layers);
                above.iter().filter(is_in).count() as f64 / above.len() as f64
            };
            let shares = (0..layers).map(in_layer).filter(|share| *share > 0.0);
            shares.map(|share| -share * share.ln()).sum::<f64>() / (layers as f64).ln()
        }
        _ => {
            let place = statistic.rank().unwrap() / 100.0 * (n - 1.0);
            let [low, high] = [place.floor(), place.ceil()].map(|at| v[at as usize]);
            low + (high - low) * place.fract()
        }
    }
}

/// The statistics, what each is of by words of its own, and which points.
type Wanted = fn(&Known) -> bool;
const LIST: &[(&str, &str, Wanted)] = &[
    ("skewness", "z", |_| true),
    ("kurtosis", "z", |_| true),
    ("entropy", "z", |_| true),
    ("entropy:layer=2.5,min=0", "z", |p| p.steps >= 0),
    ("mode", "classification", |_| true),
    ("variety", "classification", |_| true),
    ("variety:attribute=z", "z", |_| true),
    ("mode:attribute=time", "gps_time", |_| true),
    ("count:class=1", "z", |p| p.class == 1),
    ("density:class=1+3,return=first", "z", |p| p.class % 2 == 1 && p.returns[0] == 1),
    ("count:min=2,max=5", "z", |p| (8..20).contains(&p.steps)),
    ("mean:above=2", "z", |p| p.steps > 8),
    ("p90:return=last,class=2", "z", |p| p.class == 2 && p.returns[0] == p.returns[1]),
    ("std:return=only", "z", |p| p.returns[1] == 1),
    ("max:attribute=intensity", "intensity", |_| true),
    ("mean:attribute=intensity,class=2", "intensity", |p| p.class == 2),
    ("std:attribute=scan_angle,ddof=1", "scan_angle", |_| true),
    ("range:attribute=angle", "scan_angle", |_| true),
    ("p37:attribute=angle", "scan_angle", |_| true),
    ("min:attribute=time", "gps_time", |_| true),
    ("max:attribute=time,above=1", "gps_time", |p| p.steps > 4),
    ("mean:attribute=gps_time", "gps_time", |_| true),
    ("std:attribute=gps_time", "gps_time", |_| true),
    ("std:attribute=gps_time,ddof=1", "gps_time", |_| true),
    ("range:attribute=gps_time", "gps_time", |_| true),
    ("p50:attribute=gps_time", "gps_time", |_| true),
    ("skewness:attribute=gps_time", "gps_time", |_| true),
];

/// Shares: which points, and of which.
const SHARES: &[(&str, Wanted, Wanted)] = &[
    ("share:class=2", |p| p.class == 2, |_| true),
    ("share:min=0,max=1.25,return=2", |p| (0..5).contains(&p.steps) && p.returns[0] == 2, |_| true),
    ("cover", |p| p.steps > 8 && p.returns[0] == 1, |p| p.returns[0] == 1),
    (
        "cover:min=2,return=last,class=1",
        |p| p.steps >= 8 && p.class == 1 && p.returns[0] == p.returns[1],
        |p| p.class == 1 && p.returns[0] == p.returns[1],
    ),
];

fn near(a: f64, b: f64, scale: f64) -> bool {
    a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-9 * scale.max(1.0)
}

fn recipe() -> StatisticRecipe {
    let names = LIST.iter().map(|(name, ..)| *name).chain(SHARES.iter().map(|(name, ..)| *name));
    let list = names.collect::<Vec<_>>().join(",");
    StatisticRecipe::new(
        &parse_list(&list).unwrap(),
        &StatisticDefaults { radius: 2.0, power: 1.0, around: false },
    )
}

proptest! {
    #[test]
    fn statistics_of_attributes_and_of_some_points_are_those_of_twins(
        points in prop::collection::vec(known(), 0..50),
    ) {
        let recipe = recipe();
        let mut found = block(&recipe, &points);
        found.settle();
        let (bands, shares) = recipe.bands().split_at(LIST.len());
        for at in 0..CELLS {
            let own: Vec<Known> = points.iter().copied().filter(|p| p.cell as usize == at).collect();
            for (band, (name, of, wanted)) in bands.iter().zip(LIST) {
                let values = own.iter().filter(|p| wanted(p));
                let values = values.map(|p| if *of == "z" { p.z() } else { p.attribute(of) });
                let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
                let scale = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                let is = found.value(band, at, &UNITS);
                let shall = plain(band.statistic, values);
                // What all but cancels out has few digits left in the twin.
                let scale = if band.statistic.name() == "skewness" && scale > 1e6 { 1e6 } else { scale };
                prop_assert!(near(is, shall, scale), "{name}: {is} {shall}");
            }
            for (band, (name, some, of)) in shares.iter().zip(SHARES) {
                let count = |wanted: &Wanted| own.iter().filter(|p| wanted(p)).count() as f64;
                let (is, shall) = (found.value(band, at, &UNITS), count(some) / count(of));
                prop_assert!(near(is, shall, 1.0), "{name}: {is} {shall}");
            }
        }
    }

    #[test]
    fn the_order_of_points_and_their_division_leave_no_trace(
        points in prop::collection::vec(known(), 0..50), cuts: [prop::sample::Index; 2],
    ) {
        let recipe = recipe();
        let mut whole = block(&recipe, &points);
        let mut cuts = cuts.map(|cut| cut.index(points.len() + 1));
        cuts.sort_unstable();
        let mut turned: Vec<Known> = points.clone();
        turned.reverse();
        let parts = [&turned[..cuts[0]], &turned[cuts[0]..cuts[1]], &turned[cuts[1]..]];
        let mut sum = block(&recipe, parts[1]);
        for part in [parts[2], parts[0]] {
            sum.fold(&block(&recipe, part)).unwrap();
        }
        whole.settle();
        sum.settle();
        for band in recipe.bands() {
            for at in 0..CELLS {
                let [a, b] = [&whole, &sum].map(|block| block.value(band, at, &UNITS).to_bits());
                prop_assert_eq!(a, b, "{}", band.label);
            }
        }
    }
}

/// Figures of numpy 2 and scipy 1 for some heights, entropy by its definition in lidR.
#[test]
fn figures_are_those_of_other_programs() {
    let heights = [0.25, 1.0, 1.25, 3.5, 3.5, 7.75, 8.0, 12.25, 2.0, 0.5];
    let points = heights.map(|z| Known {
        cell: 0,
        steps: (z * 4.0) as i32,
        class: 1,
        returns: [1, 1],
        intensity: 0,
        angle: 0,
        time: 0.0,
    });
    let recipe = recipe();
    let mut block = block(&recipe, &points);
    block.settle();
    for (name, expected) in [
        ("skewness", 0.948_814_275_485_763_4),
        ("kurtosis", 2.639_737_662_521_698_6),
        ("entropy", 0.735_568_824_846_231_2),
    ] {
        let band = recipe.bands().iter().find(|band| band.label == name).unwrap();
        let found = block.value(band, 0, &UNITS);
        assert!(near(found, expected, 1.0), "{name}: {found}");
    }
}
