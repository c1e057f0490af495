//! Points thinned by distance, beside a search of all pairs.

use std::collections::HashSet;

use proptest::prelude::*;
use terrane_engine::Resources;
use terrane_lidar::points::{PoissonSampling, TranslateJob};

use crate::cloud_support::{Made, Packing, Place, Random, raw};
use crate::translate::{job, run, whole};

/// Records of format 6 at these places, in steps of 0.01, 0.01 and 0.001; times tell apart those at one place.
fn cloud(places: &[[i32; 3]]) -> Made {
    let mut made = Made::new(6, Packing::Fixed(700), places.len());
    for (number, (record, place)) in made.records.iter_mut().zip(places).enumerate() {
        record[..12].copy_from_slice(place.map(i32::to_le_bytes).as_flattened());
        record[22..30].copy_from_slice(&((number * 7919 % 1009) as f64).to_le_bytes());
    }
    made
}

/// A hash of a place, written down anew.
fn turn(place: [i32; 3]) -> u64 {
    let mut seed = 0_u64;
    for axis in place {
        let mut x = seed ^ (i64::from(axis) + (1 << 31)) as u64;
        x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
        x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        seed = x ^ x >> 31;
    }
    seed
}

/// Whether two places are nearer than so many thousandths.
fn is_nearer(a: [i32; 3], b: [i32; 3], least: i64) -> bool {
    let apart = |axis: usize, step: i64| ((i64::from(a[axis]) - i64::from(b[axis])) * step).pow(2);
    apart(0, 10) + apart(1, 10) + apart(2, 1) < least * least
}

/// What is kept: one after the other, all beside all.
fn twin(records: &[Vec<u8>], least: i64) -> Vec<Vec<u8>> {
    let time = |record: &[u8]| f64::from_le_bytes(record[22..30].try_into().unwrap());
    let mut order: Vec<usize> = (0..records.len()).collect();
    order.sort_by_key(|number| {
        let place = raw(&records[*number]);
        (turn(place), time(&records[*number]) as u64, *number)
    });
    let mut kept: Vec<usize> = Vec::new();
    for number in order {
        let place = raw(&records[number]);
        if !kept.iter().any(|other| is_nearer(raw(&records[*other]), place, least)) {
            kept.push(number);
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|number| records[number].clone()).collect()
}

fn kept(place: &Place, made: &Made, least: i64, resources: Resources) -> Vec<Vec<u8>> {
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    let distance = Some(least as f64 / 1000.0);
    run(&TranslateJob { resources, ..job(&[&input], &output) }
        .stages(distance.map(PoissonSampling)))
    .unwrap();
    whole(&output).records
}

/// The least memory for a cloud, as it is advised.
fn least_memory(place: &Place, made: &Made) -> u64 {
    let input = place.write("in.laz", &made.bytes());
    let resources = Resources { threads: 1, memory: 1 << 20, temp_dir: None };
    let output = place.path().join("out.las");
    let job = TranslateJob { resources, ..job(&[&input], &output) }.stage(PoissonSampling(1.0));
    let told = run(&job).unwrap_err().to_string();
    let advised = told.split("‹memory› ").nth(1).and_then(|text| text.split('M').next());
    advised.unwrap().parse::<u64>().unwrap() << 20
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn like_a_search_of_all_pairs(
        seed in 0_usize..1000, count in 1_usize..1500, extent in 1_usize..2000, height in 1_usize..3000,
        least in prop::sample::select(vec![10_i64, 30, 50, 130, 1000, 5000, 40_000]),
        threads in 1_usize..5,
    ) {
        let mut random = Random::of(seed);
        let mut axis = |most: usize| random.below(most) as i32 - most as i32 / 3;
        let places: Vec<_> = (0..count).map(|_| [axis(extent), axis(extent), axis(height)]).collect();
        let made = cloud(&places);
        let place = Place::new();
        let resources = Resources { threads, ..Resources::default() };
        prop_assert!(kept(&place, &made, least, resources) == twin(&made.records, least));
    }
}

#[test]
fn the_same_in_any_memory_threads_and_order_and_of_any_part() {
    let place = Place::new();
    // A lattice whose steps are just the distance, and a crowd in one corner of it.
    let lattice = (0..90_000).map(|i| [i % 300 * 25, i / 300 * 25, 0]);
    let crowd = (0..90_000_i64).map(|i| [i * 7919 % 997, i * 104_729 % 991, i * 31 % 4001]);
    let crowd = crowd.map(|place| place.map(|steps| steps as i32));
    let places: Vec<_> = lattice.chain(crowd).collect();
    let made = cloud(&places);
    let least = least_memory(&place, &made);
    let [few, more] = [(1, least), (3, 1 << 30)].map(|(threads, memory)| Resources {
        threads,
        memory,
        temp_dir: None,
    });
    let of_few = kept(&place, &made, 250, few.clone());
    assert!(of_few == kept(&place, &made, 250, more.clone()));
    let (halves, both) = (made.records.split_at(70_000), place.path().join("both.las"));
    let files = [halves.0, halves.1].map(|half| Made { records: half.to_vec(), ..made.clone() });
    let [a, b] = [("1.laz", &files[0]), ("2.laz", &files[1])]
        .map(|(name, made)| place.write(name, &made.bytes()));
    run(&TranslateJob { resources: more.clone(), ..job(&[&b, &a], &both) }
        .stage(PoissonSampling(0.25)))
    .unwrap();
    assert!(whole(&both).records == of_few);
    // All of the lattice that is far from the crowd.
    let far = of_few.iter().filter(|record| raw(record)[0] > 1100).count();
    assert_eq!(far, (0..90_000).filter(|i| i % 300 * 25 > 1100).count());
    // Large discs, of which each has some thousand points, in little memory.
    for least in [2000, 9000, 60_000] {
        let found = kept(&place, &made, least, few.clone());
        assert!(found == kept(&place, &made, least, more.clone()), "{least}");
        assert!(found == twin(&made.records, least), "{least}");
    }
}

#[test]
fn of_points_at_one_place_the_earliest_is_kept() {
    let place = Place::new();
    let made = cloud(&[[5, 5, 5]; 40]);
    let found = kept(&place, &made, 10, Resources::default());
    let times: HashSet<_> = made.records.iter().map(|record| record[22..30].to_vec()).collect();
    assert_eq!((found.len(), times.len()), (1, 40));
    assert_eq!(found[0][22..30], 0.0_f64.to_le_bytes());
}
