//! The ground filter: the same in tiles as whole, and as good as is stated, on clouds whose ground is
//! known and on real ones that people classified.

use crate::data;
use spade::{DelaunayTriangulation, FloatTriangulation, HasPosition, Point2, Triangulation};
use terrane_cloud::synth::survey;
use terrane_ground::pmf::{Parameters, ground};
use terrane_ground::{EMPTY, GroundSurface};
use terrane_synth::cloud::{GROUND, HIGH_NOISE, LOW_NOISE, LidarSurvey};

/// A point in cells and centimetres, with its class.
struct Classified {
    x: f64,
    y: f64,
    z: i32,
    class: u8,
}

impl Classified {
    fn cell(&self) -> (usize, usize) {
        (self.x as usize, self.y as usize)
    }

    fn is_ground(&self, ground: &GroundSurface) -> bool {
        let (col, row) = self.cell();
        ground.is_ground(col, row, [self.x.fract(), self.y.fract()], self.z)
    }
}

fn synthetic(name: &str) -> Vec<Classified> {
    let survey = survey(name).unwrap();
    let (mut echoes, mut points) = (Vec::new(), Vec::new());
    for part in 0..survey.parts() {
        survey.fill(part, &mut echoes);
        points.extend(echoes.iter().filter(|e| !e.withheld).map(|e| Classified {
            x: f64::from(e.point.x) * 0.01,
            y: f64::from(e.point.y) * 0.01,
            z: e.point.z,
            class: e.class,
        }));
    }
    points
}

/// Lowest heights of cells of a metre, and the cells of a row.
fn minima(points: &[Classified]) -> (Vec<i32>, usize) {
    let (cols, rows) = points
        .iter()
        .map(Classified::cell)
        .fold((0, 0), |(w, h), (col, row)| (w.max(col + 1), h.max(row + 1)));
    let mut minima = vec![EMPTY; cols * rows];
    for point in points {
        let (col, row) = point.cell();
        let low = &mut minima[row * cols + col];
        *low = point.z.min(*low);
    }
    (minima, cols)
}

/// Shares of ground points refused, of others taken for ground, of all wrong; noise aside.
fn errors(points: &[Classified], ground: &GroundSurface) -> [f64; 3] {
    let [mut of, mut wrong] = [[0_u32; 2]; 2];
    // Water and bridges are neither ground nor not.
    let apart = [LOW_NOISE, HIGH_NOISE, 9, 26];
    for point in points.iter().filter(|point| !apart.contains(&point.class)) {
        let kind = usize::from(point.class != GROUND);
        of[kind] += 1;
        wrong[kind] += u32::from(point.is_ground(ground) != (kind == 0));
    }
    let share = |wrong: u32, of: u32| f64::from(wrong) / f64::from(of.max(1));
    [share(wrong[0], of[0]), share(wrong[1], of[1]), share(wrong[0] + wrong[1], of[0] + of[1])]
}

/// A vertex of the terrain that is made of ground points.
struct Vertex(f64, f64, f64);

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.0, self.1)
    }
}

/// Root of the mean square of what separates the triangulation of the points taken for ground from the
/// ground itself, in metres, at the centres of cells.
fn terrain_error(points: &[Classified], ground: &GroundSurface, survey: &LidarSurvey) -> f64 {
    let kept = points.iter().filter(|point| point.is_ground(ground));
    let vertices = kept.map(|p| Vertex(p.x, p.y, f64::from(p.z) * 0.01)).collect();
    let tin = DelaunayTriangulation::<Vertex>::bulk_load(vertices).unwrap();
    let blend = tin.barycentric();
    let (mut count, mut sum) = (0.0, 0.0);
    let centres = |length: f64| (0..length as u32).map(|k| f64::from(k) + 0.5).collect::<Vec<_>>();
    let (xs, ys) = (centres(survey.width), centres(survey.height));
    let truth = survey.ground_rows(&xs, &ys);
    let places = ys.iter().flat_map(|y| xs.iter().map(move |x| Point2::new(*x, *y)));
    for (place, truth) in places.zip(truth) {
        if let Some(z) = blend.interpolate(|v| v.data().2, place) {
            count += 1.0;
            sum += (z - truth) * (z - truth);
        }
    }
    f64::sqrt(sum / count)
}

#[test]
fn the_ground_of_synthetic_clouds_is_found() {
    // Low plants of less than half a metre are most of what is taken for ground.
    for (name, most, rmse) in [
        ("cloud,size=300,density=8,seed=7,outliers=0.002", [0.002, 0.10, 0.03], 0.10),
        ("cloud,size=300,density=8,seed=9,relief=600", [0.01, 0.15, 0.04], 0.15),
        ("cloud,size=300,density=2,seed=3,voids=3,tile=100", [0.002, 0.10, 0.03], 0.15),
    ] {
        let points = synthetic(name);
        let (minima, width) = minima(&points);
        let grid = ground(&minima, width, &Parameters::metres(1.0, 0.01));
        let errors = errors(&points, &grid);
        assert!(errors.iter().zip(most).all(|(found, most)| *found <= most), "{name}: {errors:?}");
        let survey = survey(name).unwrap();
        let found = terrain_error(&points, &grid, &survey);
        println!("{name}: {errors:?}, {found:.3} m");
        assert!(found <= rmse, "{name}: {found}");
        let miss = |p: &Classified| f64::from(p.z) * 0.01 - survey.ground(p.x, p.y);
        // Noise near the ground cannot be told from it.
        let far =
            |p: &&Classified| [LOW_NOISE, HIGH_NOISE].contains(&p.class) && miss(p).abs() > 2.5;
        let noise: Vec<bool> = points.iter().filter(far).map(|p| p.is_ground(&grid)).collect();
        let taken = noise.iter().filter(|taken| **taken).count();
        assert!(taken * 20 <= noise.len(), "{name}: {taken} of {}", noise.len());
    }
}

#[test]
fn tiles_with_a_halo_are_as_the_whole() {
    let parameters = Parameters { window: 6.0, ..Parameters::metres(1.0, 0.01) };
    let points = synthetic("cloud,width=230,height=170,density=2,seed=5,voids=4,tile=60");
    let (minima, width) = minima(&points);
    let height = minima.len() / width;
    let whole = ground(&minima, width, &parameters);
    let places = [[0.0, 0.0], [0.5, 0.5], [0.99, 0.2], [0.3, 0.7]];
    let (tile, halo) = (50, parameters.reach());
    let differing = |halo: usize| {
        let mut differing = 0;
        for (south, west) in
            (0..height).step_by(tile).flat_map(|s| (0..width).step_by(tile).map(move |w| (s, w)))
        {
            let (left, low) = (west.saturating_sub(halo), south.saturating_sub(halo));
            let right = (west + tile + halo).min(width);
            let top = (south + tile + halo).min(height);
            let rows = (low..top).flat_map(|row| &minima[row * width + left..row * width + right]);
            let part = ground(&rows.copied().collect::<Vec<_>>(), right - left, &parameters);
            for row in south..(south + tile).min(height) {
                for col in west..(west + tile).min(width) {
                    let (c, r) = (col - left, row - low);
                    let same = places.iter().all(|place| {
                        let (a, b) = (whole.height(col, row, *place), part.height(c, r, *place));
                        let z = a.unwrap_or(0.0) as i32;
                        let is_same = |z: i32| {
                            whole.is_ground(col, row, *place, z) == part.is_ground(c, r, *place, z)
                        };
                        a.map(f64::to_bits) == b.map(f64::to_bits)
                            && [z - 60, z - 51, z + 40, z + 52, z + 70].into_iter().all(is_same)
                    });
                    differing += u32::from(!same);
                }
            }
        }
        differing
    };
    assert_eq!(differing(halo), 0);
    assert!(differing(6) > 0, "a small halo shows");
}

#[test]
fn low_noise_does_not_drag_the_surface_down() {
    let clean = synthetic("cloud,size=120,density=4,seed=2,outliers=0");
    let noisy = synthetic("cloud,size=120,density=4,seed=2,outliers=0.01");
    let found = |points: &[Classified]| {
        let (minima, width) = minima(points);
        ground(&minima, width, &Parameters::metres(1.0, 0.01))
    };
    let (clean_ground, noisy_ground) = (found(&clean), found(&noisy));
    let lower = clean.iter().filter(|point| point.class == GROUND).filter(|point| {
        let ((col, row), place) = (point.cell(), [point.x.fract(), point.y.fract()]);
        let height = |ground: &GroundSurface| ground.height(col, row, place).unwrap();
        height(&clean_ground) - height(&noisy_ground) > 100.0
    });
    let share = lower.count() as f64 / clean.len() as f64;
    assert!(share < 0.002, "{share}");
    let refused = clean.iter().filter(|p| p.class == GROUND && !p.is_ground(&noisy_ground)).count();
    assert!((refused as f64) < 0.02 * clean.len() as f64, "{refused}");
}

/// Points of a real file.
fn real(name: &str) -> Vec<Classified> {
    let path = data::at("lidar").join(name);
    let mut reader = las::Reader::from_path(path).unwrap();
    let low = reader.header().bounds().min;
    let points = reader.read_all().unwrap();
    let classified = |point: las::Point| Classified {
        x: point.x - low.x.floor(),
        y: point.y - low.y.floor(),
        z: (point.z * 100.0).round() as i32,
        class: point.classification.into(),
    };
    points.points().map(|point| classified(point.unwrap())).collect()
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn people_agree_on_the_ground_of_real_clouds() {
    for (name, most) in [
        ("ahn3_delft_1.laz", 0.05),
        ("ahn3_delft_2.laz", 0.03),
        ("ign_semis_2021_0382_6565.laz", 0.04),
        ("ign_semis_2023_0292_6833.laz", 0.07),
        ("ign_lidarhd_extrabytes.laz", 0.01),
    ] {
        let points = real(name);
        let (minima, width) = minima(&points);
        let found = ground(&minima, width, &Parameters::metres(1.0, 0.01));
        let errors = errors(&points, &found);
        println!("{name}: {errors:?}");
        assert!(errors[2] <= most, "{name}: {errors:?}");
    }
}
