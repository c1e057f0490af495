//! Synthetic terrains: windows agree bit for bit, and every character shows what it promises.

use proptest::prelude::*;
use terrane_base::geom::Rect;
use terrane_synth::{CHARACTERS, MAX_SIDE, Terrain};

fn terrain(name: &str) -> Terrain {
    Terrain::parse(name).unwrap()
}

fn window(terrain: &Terrain, rect: Rect) -> Vec<f32> {
    let mut out = vec![f32::INFINITY; rect.len()];
    terrain.fill_f32(rect, &mut out);
    out
}

fn bits(heights: &[f32]) -> Vec<u32> {
    heights.iter().map(|z| z.to_bits()).collect()
}

/// Positions near 0, near the far end, and anywhere.
fn position() -> impl Strategy<Value = u32> {
    prop_oneof![0..5000_u32, MAX_SIDE - 5000..MAX_SIDE - 1200, 0..MAX_SIDE - 1200]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn a_window_holds_what_its_samples_are_alone(
        kind in 0..CHARACTERS.len(),
        seed: u64,
        col in position(),
        row in position(),
        width in prop_oneof![1..40_u32, 500..1100_u32],
        height in 1..20_u32,
        picks in prop::collection::vec(any::<[prop::sample::Index; 2]>(), 40),
    ) {
        let terrain = Terrain { seed, ..Terrain::new(&CHARACTERS[kind]) };
        let heights = window(&terrain, Rect::new(col, row, width, height));
        for [x, y] in picks {
            let (x, y) = (x.index(width as usize), y.index(height as usize));
            let alone = terrain.sample(col + x as u32, row + y as u32);
            prop_assert_eq!(alone.to_bits(), heights[y * width as usize + x].to_bits());
        }
    }

    #[test]
    fn overlapping_windows_agree(
        kind in 0..CHARACTERS.len(),
        seed: u64,
        col in position(),
        row in position(),
        right in 0..700_u32,
        down in 0..30_u32,
    ) {
        let terrain = Terrain { seed, ..Terrain::new(&CHARACTERS[kind]) };
        let whole = window(&terrain, Rect::new(col, row, 1100, 50));
        let part = window(&terrain, Rect::new(col + right, row + down, 400, 20));
        for (line, y) in part.chunks(400).zip(down as usize..) {
            let from = y * 1100 + right as usize;
            prop_assert_eq!(bits(line), bits(&whole[from..from + 400]));
        }
    }
}

/// FNV-1a over the bits: a change of a single bit on some machine or in some version shows.
fn digest(heights: &[f32]) -> u64 {
    let bytes = heights.iter().flat_map(|z| z.to_bits().to_le_bytes());
    bytes.fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

#[test]
fn heights_are_the_same_on_every_machine() {
    let of =
        |c| window(&Terrain { seed: 42, ..Terrain::new(c) }, Rect::new(123_456, 654_321, 600, 40));
    let found: Vec<_> = CHARACTERS.iter().map(|c| (c.name, digest(&of(c)))).collect();
    let expected = [
        ("rough", 17_835_766_717_931_185_853),
        ("smooth", 13_845_636_905_022_366_391),
        ("integer", 17_321_832_242_455_595_898),
        ("plateaus", 3_533_280_230_567_183_986),
        ("coast", 5_797_543_139_948_999_143),
        ("salt", 9_229_960_404_419_329_591),
    ];
    assert_eq!(found, expected);
}

#[test]
fn threads_compute_the_same_heights() {
    let terrain = terrain("salt,seed=5");
    let rect = Rect::new(70_000, 80_000, 700, 60);
    let expected = bits(&window(&terrain, rect));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| assert_eq!(bits(&window(&terrain, rect)), expected));
        }
    });
}

#[test]
fn another_seed_is_another_terrain_and_size_does_not_matter() {
    let rect = Rect::new(10, 20, 64, 64);
    for c in CHARACTERS {
        let of = |rest: &str| bits(&window(&terrain(&format!("{}{rest}", c.name)), rect));
        assert_ne!(of(",seed=1"), of(",seed=3"), "{}", c.name);
        assert_eq!(of(",size=100"), of(",width=90000,height=7,cell=30"), "{}", c.name);
    }
}

#[test]
fn rough_land_is_a_plausible_landscape() {
    let terrain = terrain("rough,seed=3");
    let mut all = Vec::new();
    for k in 0..12_u32 {
        let heights = window(&terrain, Rect::new(k * 7_919, k * 104_729, 512, 512));
        assert!(heights.iter().all(|z| (-500.0..2500.0).contains(z)));
        let steps = heights.chunks(512).flat_map(|line| line.windows(2));
        assert!(steps.map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max) < 30.0, "cliffs");
        all.extend(heights);
    }
    let mean = all.iter().map(|z| f64::from(*z)).sum::<f64>() / all.len() as f64;
    assert!((300.0..1000.0).contains(&mean), "{mean}");
}

#[test]
fn smooth_land_bends_less_than_rough() {
    let bend = |name| {
        let heights = window(&terrain(name), Rect::new(5000, 5000, 512, 512));
        let bends = heights.chunks(512).flat_map(|line| line.windows(3));
        bends.map(|w| f64::from((w[0] - 2.0 * w[1] + w[2]).abs())).sum::<f64>()
    };
    assert!(bend("smooth") * 20.0 < bend("rough"));
}

#[test]
fn integer_land_is_whole_metres_above_a_flat_sea() {
    let heights = window(&terrain("integer,seed=3"), Rect::new(0, 0, 3000, 1500));
    assert!(heights.iter().all(|z| z.fract() == 0.0 && (0.0..=32_767.0).contains(z)));
    let sea = heights.iter().filter(|z| **z == 0.0).count() as f64 / heights.len() as f64;
    assert!((0.1..0.9).contains(&sea), "{sea}");
}

#[test]
fn plateaus_are_level_almost_everywhere() {
    let heights = window(&terrain("plateaus,step=50"), Rect::new(300, 300, 1024, 1024));
    let level = heights.iter().filter(|z| **z % 50.0 == 0.0).count() as f64 / heights.len() as f64;
    assert!((0.5..0.95).contains(&level), "{level}");
}

#[test]
fn a_coast_has_land_and_void() {
    let heights = window(&terrain("coast"), Rect::new(0, 0, 2048, 1024));
    let land: Vec<f32> = heights.iter().copied().filter(|z| !z.is_nan()).collect();
    let share = land.len() as f64 / heights.len() as f64;
    assert!((0.1..0.9).contains(&share), "{share}");
    assert!(land.iter().all(|z| *z > 0.0));
}

#[test]
fn salt_is_strewn_at_the_share_asked() {
    for asked in [0.0, 0.001, 0.005, 0.5, 1.0] {
        let terrain = terrain(&format!("salt,voids={asked}"));
        let heights = window(&terrain, Rect::new(900, 100, 1000, 1000));
        let share = heights.iter().filter(|z| z.is_nan()).count() as f64 / heights.len() as f64;
        assert!((share - asked).abs() <= 0.1 * asked, "{share} instead of {asked}");
    }
}
