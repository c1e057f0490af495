//! Channels against the obvious: all samples of all triangles measured again for every vertex, by integers.

use super::{MultichannelTin, WeightedChannels, candidate, join_voids};
use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::{BaselineMesh, TriangleState, check_surface};
use crate::plane::samples_of;
use crate::settings::{BaselineGoal, BaselineTask, SurfaceSize};
use crate::tests::{Heights, check_cover, grids};
use crate::{BaselineTin, METHODS};
use proptest::prelude::*;
use terrane_base::geom::predicates::orient;

/// Up to three planes of whole numbers over one grid, and weights in halves.
#[derive(Clone, Debug)]
struct Picture {
    size: [u32; 2],
    planes: Vec<Vec<f64>>,
    halves: Vec<i64>,
}

impl Picture {
    fn weights(&self) -> Vec<f64> {
        self.halves.iter().map(|&halves| halves as f64 / 2.0).collect()
    }

    fn grid(&self) -> HeightGrid<'_> {
        HeightGrid::new(self.size[0], self.size[1], &self.planes[0], None).unwrap()
    }

    /// The error of a sample over a triangle by the definition: of whole numbers, rounded once as a quotient and once
    /// as a product; where a channel is beyond its tolerance, which is that of all divided by its weight, as a double.
    fn error(&self, corners: [PackedSample; 3], at: PackedSample, tolerance: f64) -> Option<f64> {
        let ([a, b, c], q) = (corners.map(PackedSample::lattice), at.lattice());
        let weights = [orient(b, c, q), orient(c, a, q), orient(a, b, q)];
        if weights.iter().any(|&weight| weight < 0) || corners.contains(&at) {
            return None;
        }
        let place = |at: PackedSample| (at.row() * self.size[0] + at.col()) as usize;
        let channels = self.planes.iter().zip(&self.halves).map(|(plane, halves)| {
            let value = |at: PackedSample| plane[place(at)] as i64;
            let sum: i64 = weights.iter().zip(corners).map(|(w, z)| w * value(z)).sum();
            let (off, area) = ((sum - orient(a, b, c) * value(at)).abs(), orient(a, b, c));
            let weight = *halves as f64 / 2.0;
            (weight * (off as f64 / area as f64), is_beyond(off, area, tolerance / weight))
        });
        let all: Vec<(f64, bool)> = channels.collect();
        let most = all.iter().map(|(error, _)| *error).fold(0.0, f64::max);
        all.iter().any(|(_, is_beyond)| *is_beyond).then_some(most)
    }
}

fn pictures() -> impl Strategy<Value = Picture> {
    (grids(), grids(), grids(), 1_usize..4, prop::collection::vec(1_i64..6, 3)).prop_map(
        |(first, second, third, count, halves)| {
            let Heights { width, height, values } = &first;
            let like = |other: &Heights| {
                let mut all = other.values.iter().copied().cycle();
                (0..values.len()).map(|_| all.next().unwrap_or(0.0)).collect::<Vec<_>>()
            };
            let mut planes = vec![values.clone(), like(&second), like(&third)];
            planes.truncate(count);
            join_voids(&mut planes);
            Picture { size: [*width, *height], planes, halves: halves[..count].to_vec() }
        },
    )
}

/// True when a fraction is above a double of 0 or above 2^-8, exactly.
fn is_beyond(off: i64, of: i64, limit: f64) -> bool {
    let parts = 2_f64.powi(60);
    i128::from(off) * parts as i128 > (limit * parts) as i128 * i128::from(of)
}

/// The twin: of all samples the one with the largest error, and the first of equals, again and again.
fn naive(picture: &Picture, goal: BaselineGoal, tolerance: f64) -> Vec<PackedSample> {
    let grid = picture.grid();
    let task = BaselineTask::new(grid, goal);
    let mut mesh = BaselineMesh::of_outline(&grid).unwrap();
    let mut size = SurfaceSize::of(&mesh, goal).unwrap();
    let mut order = Vec::new();
    loop {
        let mut worst = None;
        for at in grid.samples() {
            let surface =
                (0..mesh.tris.len()).filter(|&t| mesh.tris[t].state == TriangleState::Surface);
            let error = |t: usize| picture.error(mesh.tris[t].corners, at, tolerance);
            for (error, t) in surface.filter_map(|t| Some((error(t)?, t))) {
                if worst.is_none_or(|(most, _, _)| error > most) {
                    worst = Some((error, at, t as u32));
                }
            }
        }
        let Some((_, at, t)) = worst else { return order };
        if size.insert(&task, &mut mesh, t, at).is_none() {
            return order;
        }
        order.push(at);
    }
}

fn order(picture: &Picture, goal: BaselineGoal) -> (Vec<PackedSample>, MultichannelTin) {
    let weights = picture.weights();
    let channels = WeightedChannels::new(picture.size, &picture.planes, &weights).unwrap();
    let grid = picture.grid();
    let (mut mesh, mut order) = (BaselineMesh::of_outline(&grid).unwrap(), Vec::new());
    channels.insert(&BaselineTask::new(grid, goal), &mut mesh, |at| order.push(at)).unwrap();
    mesh.validate();
    (order, channels.triangulate(goal, &|| Ok(())).unwrap())
}

#[test]
fn an_error_of_a_third_is_beyond_a_double_below_it() {
    // The double next to a third is less than a third.
    let planes = vec![vec![0.0, 3.0, 0.0, 2.0, 0.0, 2.0, 0.0, 1.0]];
    let picture = Picture { size: [2, 4], planes, halves: vec![3] };
    let goal = BaselineGoal::MaxError(0.5);
    let (found, _) = order(&picture, goal);
    assert_eq!(found, naive(&picture, goal, 0.5));
    assert_eq!(found.len(), 2);
}

proptest! {
    #[test]
    fn the_same_vertices_in_the_same_order_as_by_measuring_everything_again(
        picture in pictures(), halves in prop_oneof![Just(0_i64), Just(1), Just(9), Just(26), Just(400)],
        budget in prop::option::of(4_u64..60),
    ) {
        prop_assume!(check_surface(&picture.grid()).is_ok());
        let tolerance = halves as f64 / 2.0;
        let (goal, tolerance) = match budget {
            None => (BaselineGoal::MaxError(tolerance), tolerance),
            Some(most) => (BaselineGoal::MaxVertices(most), 0.0),
        };
        prop_assume!(SurfaceSize::of(&BaselineMesh::of_outline(&picture.grid())?, goal).is_ok());
        let (found, drawn) = order(&picture, goal);
        prop_assert_eq!(&found, &naive(&picture, goal, tolerance));
        if let Some(most) = budget {
            prop_assert!(drawn.vertices.len() as u64 <= most);
        }
    }

    #[test]
    fn what_is_promised_is_kept_by_every_channel_and_measured(
        picture in pictures(), halves in prop_oneof![Just(0_i64), Just(1), Just(9), Just(26)],
    ) {
        prop_assume!(check_surface(&picture.grid()).is_ok());
        let tolerance = halves as f64 / 2.0;
        let (_, drawn) = order(&picture, BaselineGoal::MaxError(tolerance));
        let MultichannelTin { vertices, triangles, max_error, channels, census } = drawn;
        prop_assert!(max_error <= tolerance);
        let tin = BaselineTin { vertices, triangles, max_error, square_sum: 0.0, census };
        for ((plane, weight), found) in picture.planes.iter().zip(picture.weights()).zip(channels) {
            let grid = HeightGrid::new(picture.size[0], picture.size[1], plane, None).unwrap();
            check_cover(&grid, &tin);
            let (error, of) = crate::tests::worst(&grid, &tin);
            prop_assert!(error as f64 * weight <= tolerance * of as f64);
            prop_assert!((found.max_error - error as f64 / of as f64).abs() < 1e-12);
            prop_assert!(found.max_error <= max_error / weight);
        }
    }

    #[test]
    fn rows_that_are_passed_over_hold_nothing_worse(
        bits in prop::collection::vec(any::<u64>(), 2 * 90 * 60), flat in any::<bool>(),
        at in prop::collection::vec((0_u32..90, 0_u32..60), 3),
        scales in prop::collection::vec(-40_i32..40, 2), share in 0.0_f64..1.2,
    ) {
        // Lands in a plane up to rounding, where whatever is taken for far is rounding alone; and rough ones.
        let value = |(place, bits): (usize, &u64)| {
            let (plane, place) = (place / (90 * 60), place % (90 * 60));
            let slanted = 0.1 * (place % 90) as f64 - 0.7 * (place / 90) as f64 + 1e4;
            let noise = (bits >> 11) as f64 / (1_u64 << 53) as f64;
            2_f64.powi(scales[plane]) * if flat { slanted } else { noise }
        };
        let all: Vec<f64> = bits.iter().enumerate().map(value).collect();
        let planes = [all[..90 * 60].to_vec(), all[90 * 60..].to_vec()];
        let weights = [scales[0], scales[1]].map(|scale| 2_f64.powi(-scale) * 1.3);
        let corners = [0, 1, 2].map(|i| PackedSample::new(at[i].0, at[i].1));
        let [a, b, c] = corners.map(PackedSample::lattice);
        prop_assume!(orient(a, b, c) != 0);
        let channels = WeightedChannels::new([90, 60], &planes, &weights).unwrap();
        for tolerance in [0.0, 1e-13, share] {
            let over: Vec<_> =
                channels.channels.iter().map(|channel| channel.over(tolerance, corners)).collect();
            let naive = samples_of(corners).filter_map(|at| candidate(&over, at)).max();
            prop_assert_eq!(channels.worst(tolerance, corners), naive);
        }
    }

    #[test]
    fn one_channel_of_weight_1_is_greedy4(
        picture in pictures(), tolerance in 0_u8..20, budget in prop::option::of(4_u64..60)
    ) {
        let grid = picture.grid();
        prop_assume!(check_surface(&grid).is_ok());
        let goal = budget.map_or(BaselineGoal::MaxError(f64::from(tolerance) * 0.7), BaselineGoal::MaxVertices);
        prop_assume!(SurfaceSize::of(&BaselineMesh::of_outline(&grid)?, goal).is_ok());
        let greedy4 = METHODS.iter().find(|method| method.name == "greedy4").unwrap();
        let tin = (greedy4.run)(&BaselineTask::new(grid, goal)).unwrap();
        let one = WeightedChannels::new(picture.size, &picture.planes[..1], &[1.0]).unwrap();
        let drawn = one.triangulate(goal, &|| Ok(())).unwrap();
        prop_assert_eq!((&drawn.vertices, &drawn.triangles), (&tin.vertices, &tin.triangles));
        prop_assert_eq!(drawn.max_error, tin.max_error);
        prop_assert_eq!(drawn.channels[0].square_sum, tin.square_sum);
    }
}

#[test]
fn a_stated_tolerance_is_kept_after_its_division_by_any_weight() {
    let plane = |n: u32| (0..14 * 9).map(|i| f64::from(i * i % n) / 7.0).collect::<Vec<_>>();
    let planes = [plane(31), plane(23)];
    for weights in [[0.1, 3.0], [1.0 / 3.0, 7e-5], [1e200, 1e-200], [0.7, 0.7]] {
        let channels = WeightedChannels::new([14, 9], &planes, &weights).unwrap();
        let drawn = channels.triangulate(BaselineGoal::MaxVertices(40), &|| Ok(())).unwrap();
        for (weight, found) in weights.iter().zip(&drawn.channels) {
            assert!(found.max_error <= drawn.max_error / weight, "{weights:?}: {found:?}");
        }
        let again =
            channels.triangulate(BaselineGoal::MaxError(drawn.max_error), &|| Ok(())).unwrap();
        assert!(again.max_error <= drawn.max_error);
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let planes = [vec![1.0; 4], vec![2.0, f64::NAN, 2.0, 2.0]];
    let refused = |planes: &[Vec<f64>], weights: &[f64]| {
        WeightedChannels::new([2, 2], planes, weights).unwrap_err().to_string()
    };
    assert!(refused(&[], &[]).contains("0 weights"));
    assert!(refused(&planes, &[1.0]).contains("1 weights for 2 channels"));
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-310] {
        assert!(refused(&planes[..1], &[weight]).contains("invalid channel weight"), "{weight}");
    }
    assert!(refused(&planes, &[1.0, 1.0]).contains("sample 1 is void in some channels only"));
    let mut joined = planes.clone();
    join_voids(&mut joined);
    let channels = WeightedChannels::new([2, 2], &joined, &[1.0, 1.0]).unwrap();
    let error = channels.triangulate(BaselineGoal::MaxError(1.0), &|| Ok(())).unwrap_err();
    assert!(error.to_string().contains("four valid samples"));
}
