//! Meshes that follow lines and keep points, sound and spoiled.

use super::*;
use terrane_base::geom::Crs;
use terrane_engine::constraints::ConstraintVertices;

/// Vertices of lines, in steps from the lowest of the terrain; NaN for no height.
const LINES: [&[[f64; 3]]; 4] = [
    &[[100.0, 100.0, 700.0], [20_000.0, 9000.0, 900.0], [39_000.0, 3000.0, 500.0]],
    &[[5000.0, 30_000.0, f64::NAN], [33_000.0, 31_000.5, f64::NAN]],
    &[[9000.0, 2000.0, f64::NAN], [12_000.0, 39_000.0, f64::NAN]],
    &[[-9000.0, 20_000.0, 0.0], [90_000.0, 20_700.0, 0.0]],
];

fn features() -> ConstraintFeatures {
    let of = |lines: &[&[[f64; 3]]]| {
        let all = || lines.iter().copied().flatten();
        let mut end = 0;
        let world = |&[x, y, _]: &[f64; 3]| [x * 0.01 + 500_000.0, y * 0.01 + 4_750_000.0];
        ConstraintVertices {
            path: "lines.wkt".into(),
            crs: Crs::default(),
            at: all().map(world).collect(),
            z: all().map(|[_, _, z]| z * 0.01).collect(),
            ends: lines
                .iter()
                .map(|line| {
                    end += line.len() as u32;
                    end
                })
                .collect(),
        }
    };
    ConstraintFeatures::of(Some(of(&LINES[..3])), Some(of(&LINES)))
}

fn terrain_with_mesh(crowded: bool, folder: &Path) -> (PointSample, Memory) {
    let cloud = terrain(6000, crowded);
    let mesh = made_with(features(), &cloud, tolerance(), folder, "l.ply");
    (cloud, Memory::of(&*mesh))
}

/// Failures reported for the mesh of a cloud with lines after `spoil`.
fn failures(spoil: impl FnOnce(&mut Memory)) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let (cloud, mut mesh) = terrain_with_mesh(false, folder.path());
    spoil(&mut mesh);
    let resources = resources(2, 64 << 20, folder.path());
    proved_with(features(), &mesh.settled(), &cloud, &resources).verdict.failures
}

/// Where a vertex is that is at (or nearest to) these steps.
fn near(mesh: &Memory, at: [f64; 2]) -> usize {
    let far =
        |v: &Point3| (v[0] - 500_000.0 - at[0] * 0.01).hypot(v[1] - 4_750_000.0 - at[1] * 0.01);
    let all = 0..mesh.vertices.len();
    all.min_by(|&a, &b| far(&mesh.vertices[a]).total_cmp(&far(&mesh.vertices[b]))).unwrap()
}

#[test]
fn planted_faults_of_lines_are_named() {
    assert_eq!(failures(|_| {}), Vec::<String>::new());
    // A post of a line with heights, at another one; and of one without, between steps.
    let lifted = failures(|mesh| {
        let post = near(mesh, [20_000.0, 9000.0]);
        mesh.vertices[post][2] += 0.01;
    });
    assert!(says(&lifted, "1 vertices off the points"), "{lifted:?}");
    let uneven = failures(|mesh| {
        let post = near(mesh, [5000.0, 30_000.0]);
        mesh.vertices[post][2] += 0.004;
    });
    assert!(says(&uneven, "1 vertices off the points"), "{uneven:?}");
    let moved = failures(|mesh| {
        let post = near(mesh, [20_000.0, 9000.0]);
        mesh.vertices[post][0] += 0.01;
    });
    assert!(says(&moved, "4 places on breaklines that edges do not follow"), "{moved:?}");
    // An edge of a line, flipped: the two triangles beside it share the other diagonal.
    let flipped = failures(|mesh| {
        let post = near(mesh, [20_000.0, 9000.0]) as u64;
        let on = |mesh: &Memory, v: u64| {
            let [x, y, _] = mesh.vertices[v as usize];
            let [x, y] = [(x - 500_000.0) * 100.0, (y - 4_750_000.0) * 100.0];
            x > 20_001.0 && ((x - 20_000.0) * (3000.0 - 9000.0) / 19_000.0 + 9000.0 - y).abs() < 0.8
        };
        let mates: Vec<u64> =
            mesh.triangles.iter().filter(|t| t.contains(&post)).flatten().copied().collect();
        let next = mates.into_iter().find(|&v| on(mesh, v)).unwrap();
        let both = |t: &[u64; 3]| t.contains(&post) && t.contains(&next);
        let beside: Vec<usize> =
            (0..mesh.triangles.len()).filter(|&t| both(&mesh.triangles[t])).collect();
        let apex =
            |t: usize| mesh.triangles[t].iter().copied().find(|&v| v != post && v != next).unwrap();
        let (a, b) = (apex(beside[0]), apex(beside[1]));
        let is_left = {
            let t = mesh.triangles[beside[0]];
            let i = t.iter().position(|&v| v == post).unwrap();
            t[(i + 1) % 3] == next
        };
        let (left, right) = if is_left { (a, b) } else { (b, a) };
        mesh.triangles[beside[0]] = [post, right, left];
        mesh.triangles[beside[1]] = [next, left, right];
    });
    assert!(says(&flipped, "1 places on breaklines that edges do not follow"), "{flipped:?}");
}

#[test]
fn points_that_are_not_kept_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = terrain(6000, false);
    let mesh = made(&cloud, 9.0, folder.path(), "m.ply");
    let resources = resources(2, 64 << 20, folder.path());
    let found = proved_with(features(), &*mesh, &cloud, &resources);
    assert!(found.of.not_kept.count > 3 && found.of.not_followed.count > 7, "{found:?}");
    let told = found.of.keep_points.unwrap();
    assert_eq!((told.points, told.outside, told.samples), (7, 1, 6));
    assert_eq!(told.vertices, 6 - found.of.not_kept.count);
    assert_eq!(found.of.breaklines.unwrap().apart, found.of.not_followed.count);
}

#[test]
fn threads_and_memory_change_nothing_about_lines() {
    let folder = tempfile::tempdir().unwrap();
    for crowded in [false, true] {
        let (cloud, mut mesh) = terrain_with_mesh(crowded, folder.path());
        let post = near(&mesh, [20_000.0, 9000.0]);
        mesh.vertices[post][2] += 0.03;
        mesh.triangles.swap_remove(90);
        let mesh = mesh.settled();
        let report = |threads, memory| {
            let resources = resources(threads, memory, folder.path());
            proved_with(features(), &mesh, &cloud, &resources)
        };
        let one = report(1, 1 << 30);
        assert!(one.of.on_breaklines > 20 && one.of.off_point_vertices.count == 1, "{one:?}");
        assert_eq!(report(3, 1 << 30), one);
        assert_eq!(report(1, 1 << 20), one);
        assert_eq!(report(3, 3 << 20), one);
    }
}
