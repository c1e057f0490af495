//! Shapes are what they are said to be, and cells fit together.

use super::*;

fn lines(name: &str) -> SyntheticLines {
    SyntheticLines::parse(name).unwrap()
}

fn drawn(name: &str, number: u32) -> Vec<Xy> {
    let mut out = vec![[9.0, 9.0]];
    lines(name).feature(number, &mut out);
    out
}

fn length([p, q]: [Xy; 2]) -> f64 {
    (q[0] - p[0]).hypot(q[1] - p[1])
}

#[test]
fn names_come_back() {
    for shape in SHAPES {
        let named = lines(&format!("{},seed=7,vertices=50", shape.name));
        assert_eq!(named.to_string(), lines(&named.to_string()).to_string());
        assert_eq!((named.vertices, named.features, named.seed), (50, 1, 7));
    }
    let error = SyntheticLines::parse("knot").unwrap_err().to_string();
    assert!(error.contains("knot") && error.contains("koch, walk, zigzag, spiral, arc"), "{error}");
    assert!(
        SyntheticLines::parse("koch,vertices=1").is_err()
            && SyntheticLines::parse("koch,turns=3").is_err()
    );
    assert!(!SyntheticLines::is_named("rough,size=5") && SyntheticLines::is_named("walk"));
}

#[test]
fn lines_have_their_vertices_in_their_square() {
    for shape in SHAPES.iter().filter(|shape| !shape.is_rings) {
        for number in 0..6 {
            let name = format!("{},vertices=1000,features=6,size=10", shape.name);
            let own = drawn(&name, number);
            assert_eq!(own.len(), 1000, "{name}");
            let corner = [number % 3, number / 3].map(|v| f64::from(v) * 10.0);
            let inside =
                |p: &Xy| (0..2).all(|k| (-1e-9..=10.0 + 1e-9).contains(&(p[k] - corner[k])));
            assert!(own.iter().all(inside), "{name} {number}");
            assert!(own.windows(2).all(|pair| pair[0] != pair[1]), "{name}");
        }
    }
}

#[test]
fn the_curve_of_von_koch_is_like_its_quarters() {
    let whole = drawn("koch,vertices=1025,size=1", 0);
    let near = |p: Xy, q: Xy| length([p, q]) < 1e-12;
    assert!(near(whole[0], [0.0, 0.0]) && near(whole[1024], [1.0, 0.0]));
    assert!(near(whole[512], [0.5, 0.75_f64.sqrt() / 3.0]), "the tip");
    assert!(whole.windows(2).all(|p| (length([p[0], p[1]]) - 3.0_f64.powi(-5)).abs() < 1e-12));
    let fewer = drawn("koch,vertices=257,size=1", 0);
    let small = |i: usize| fewer[i].map(|v| v / 3.0);
    assert!((0..257).all(|i| near(whole[i], small(i))), "the first quarter");
    let last = |i: usize| [small(i)[0] + 2.0 / 3.0, small(i)[1]];
    assert!((0..257).all(|i| near(whole[768 + i], last(i))), "the last quarter");
}

#[test]
fn walks_differ_by_seed_and_feature() {
    let walks = [("walk,features=2", 0), ("walk,features=2", 1), ("walk,seed=2", 0)];
    let ends = walks.map(|(name, number)| {
        let walk = drawn(name, number);
        [walk[9_999][0] - walk[0][0], walk[9_999][1] - walk[0][1]]
    });
    assert!(ends[0] != ends[1] && ends[0] != ends[2] && ends[1] != ends[2]);
    assert!(ends.iter().all(|end| length([[0.0; 2], *end]) < 500.0), "{ends:?}");
}

#[test]
fn spirals_wind_inwards_and_arcs_stay_on_the_circle() {
    let spiral = drawn("spiral,vertices=5000,size=2", 0);
    let radius = |p: &Xy| length([*p, [1.0, 1.0]]);
    assert!(spiral.windows(2).all(|pair| radius(&pair[1]) < radius(&pair[0])));
    assert!(length([spiral[0], spiral[1000]]) < 0.3, "a thousand vertices are a turn");
    assert!(drawn("arc,size=1", 0).iter().all(|p| (length([*p, [0.0; 2]]) - 1.0).abs() < 1e-12));
}

#[test]
fn cells_share_their_borders_and_cross_nothing() {
    let name = "coverage,vertices=130,features=9,size=7";
    let rings: Vec<Vec<Xy>> = (0..9).map(|number| drawn(name, number)).collect();
    let mut uses = std::collections::BTreeMap::new();
    for ring in &rings {
        assert_eq!((ring.len(), ring[0]), (129, ring[128]));
        for pair in ring.windows(2) {
            let bits = |p: Xy| p.map(f64::to_bits);
            let ends = [bits(pair[0]), bits(pair[1])];
            *uses.entry(ends).or_insert(0) += 1;
        }
    }
    let twice = uses.keys().filter(|ends| uses.contains_key(&[ends[1], ends[0]])).count();
    assert!(uses.values().all(|n| *n == 1), "no segment has two rings on one side");
    assert_eq!(twice, 2 * 12 * 32, "the inner borders are those of two");
    let strays = rings[4].iter().map(|p| (p[0] - 7.0).abs()).filter(|off| *off < 3.5);
    assert!(strays.fold(0.0, f64::max) > 0.1, "borders are rough");
}
