//! Stages: as the short options that stand for them, as obvious twins, in any order, and by plan.

use std::path::Path;

use terrane_cloud::{CloudFilter, CloudOpenOptions};
use terrane_engine::{Progress, Resources};
use terrane_lidar::grid::GroundFrom;
use terrane_lidar::points::plan::{PlanPointsJob, plan_points};
use terrane_lidar::points::{
    AnyStage, CellThinning, Dedupe, HeightQuery, HeightsAs, Overlap, PointTiling, PointsOptions,
    Sort, StageText, TranslateJob, stage_names,
};

use crate::above;
use crate::cloud_support::{Made, Packing, Place};
use crate::data;
use crate::noise_plan::{files, planned};
use crate::translate::{job, number, run, whole};

/// A survey with buildings and trees, times and flight lines.
fn survey(place: &Place) -> String {
    above::survey(place, "cloud,size=60,density=6,seed=5", 6, "survey.laz")
}

fn stage(text: &str) -> AnyStage {
    text.parse::<StageText>().unwrap().stage().clone()
}

fn chain(job: TranslateJob, texts: &[&str]) -> TranslateJob {
    job.stages(texts.iter().map(|text| stage(text)))
}

/// Stages that no option stands for; other tests try them.
const WITHOUT_OPTION: &[&str] =
    &["where", "normals", "overlay", "sample-grid", "colour", "dimension", "tree-tops", "trees"];

/// Options, and the stages that they stand for.
type Short = (fn(&mut PointsOptions), &'static [&'static str]);

const SHORT: &[Short] = &[
    (|o| o.dedupe = true, &["dedupe"]),
    (|o| o.classify = vec!["noise".parse().unwrap()], &["noise"]),
    (
        |o| o.classify = vec!["noise:voxel:step=2,isolated=3".parse().unwrap()],
        &["noise:voxel:step=2,isolated=3"],
    ),
    (
        |o| {
            o.classify = vec!["ground:reclassify=9".parse().unwrap()];
            o.ground = "csf:cloth=1.5".parse().unwrap();
        },
        &["ground:csf:cloth=1.5:reclassify=9"],
    ),
    (|o| o.height_above_ground = Some(HeightsAs::Dimension), &["height-above-ground"]),
    (|o| o.height_above_ground = Some(HeightsAs::Z), &["height-above-ground:z"]),
    (|o| o.classify = vec!["height:3=0.5,5=4".parse().unwrap()], &["height-classes:3=0.5,5=4"]),
    (
        |o| {
            let formulas = ["user_data = 3", "intensity = user_data * 2"];
            o.attribute = formulas.iter().map(|text| text.parse().unwrap()).collect();
        },
        &["assign:user_data = 3", "assign:intensity = user_data * 2"],
    ),
    (|o| o.drop_overlap = Some(Overlap { cell: Some(3.0) }), &["drop-overlap:3"]),
    (|o| o.drop_overlap = Some(Overlap { cell: None }), &["drop-overlap"]),
    (|o| o.thin = Some("1.5:lowest".parse().unwrap()), &["thin:1.5:lowest"]),
    (|o| o.thin_distance = Some(0.7), &["poisson:0.7"]),
    (|o| o.reprojection.to_crs = Some("EPSG:4326".to_owned()), &["reproject:EPSG:4326"]),
    (|o| o.sort = Some(Sort::Morton), &["sort:morton"]),
    (
        |o| {
            (o.dedupe, o.height_above_ground) = (true, Some(HeightsAs::Dimension));
            o.classify = ["noise", "ground"].map(|text| text.parse().unwrap()).into();
            o.ground = "csf".parse().unwrap();
            o.attribute = vec!["user_data = 1".parse().unwrap()];
            (o.thin, o.sort) = (Some("1".parse().unwrap()), Some(Sort::Time));
        },
        // Heights in a later stage are those of one: the points of class 2 are the ground that was found.
        &[
            "dedupe",
            "noise",
            "ground:csf",
            "where:z > -1000",
            "height-above-ground",
            "assign:user_data = 1",
            "thin:1",
            "sort:time",
        ],
    ),
];

#[test]
fn short_options_are_stages() {
    let place = Place::new();
    let input = survey(&place);
    let output = place.path().join("out.las");
    for (number, (set, stages)) in SHORT.iter().enumerate() {
        let made = |set: &dyn Fn(&mut PointsOptions)| {
            let mut options = PointsOptions::default();
            options.replacing.overwrite = true;
            set(&mut options);
            run(&options.job(std::slice::from_ref(&input), &output).unwrap()).unwrap();
            std::fs::read(&output).unwrap()
        };
        let expected = made(set);
        let found =
            made(&|o| o.stages.stage = stages.iter().map(|text| text.parse().unwrap()).collect());
        assert!(found == expected, "{number}: {stages:?}");
        assert!(found != std::fs::read(&input).unwrap());
    }
    let names = SHORT.iter().flat_map(|(_, stages)| *stages);
    let tried: Vec<_> = names.map(|text| text.split(':').next().unwrap()).collect();
    let is_tried = |name: &&str| tried.contains(name) || WITHOUT_OPTION.contains(name);
    let untried = stage_names().find(|known| !is_tried(&known.name));
    assert!(untried.is_none(), "{:?}", untried.map(|known| known.name));
}

#[test]
fn conditions_see_what_the_stages_before_them_made() {
    let place = Place::new();
    let input = survey(&place);
    let output = place.path().join("out.las");
    let with_heights = chain(job(&[&input], &output), &["height-above-ground"]);
    run(&with_heights).unwrap();
    let all = whole(&output).records;
    let height = |record: &[u8]| i32::from_le_bytes(number(record, record.len() - 4));
    // A height of one unit is 100 steps, and points without a height are neither above nor below.
    let is_high = |record: &&Vec<u8>| height(record) > 200 && record[16] != 6;
    let expected: Vec<_> = all.iter().filter(is_high).cloned().collect();
    let texts = ["height-above-ground", "where:HeightAboveGround > 2 and classification != 6"];
    run(&chain(job(&[&input], &output), &texts)).unwrap();
    assert!(
        whole(&output).records == expected && expected.len() > 100 && expected.len() < all.len()
    );

    // Before other stages, it takes from them what it drops.
    let few = ["where:classification = 2", "thin:5:highest"];
    run(&chain(job(&[&input], &output), &few)).unwrap();
    assert!(whole(&output).records.iter().all(|record| record[16] == 2));
}

/// A chain of random stages.
fn random_chain(state: &mut u64) -> Vec<&'static str> {
    const ALL: &[&str] = &[
        "dedupe",
        "noise",
        "noise:statistical:k=6,m=2",
        "ground:pmf",
        "ground:csf",
        "height-above-ground",
        "height-classes",
        "assign:user_data = 2 * classification",
        "assign:intensity = 7",
        "where:z > 3",
        "where:user_data < 5",
        "drop-overlap:2",
        "thin:1.5:lowest",
        "thin:0.8:random=3",
        "poisson:0.6",
        "normals:k=5",
        "tree-tops:1.5:min=0",
        "trees:2:min=0",
        "where:TreeID > 3",
        "dimension:Slope = 1 - NormalZ",
        "dimension:High = 2 * z",
        "where:High > 9",
        "where:NormalZ > 0.8",
        "reproject:EPSG:32633",
        "sort:morton",
        "sort:time",
    ];
    let mut below = |count: usize| {
        *state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as usize % count
    };
    (0..1 + below(5)).map(|_| ALL[below(ALL.len())]).collect()
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn chains_on_clouds_of_others_are_the_same_by_threads_and_memory() {
    let place = Place::new();
    let clouds = [data::files("lidar"), data::files("lidar/formats")].concat();
    let is_las = |path: &&std::path::PathBuf| {
        path.extension().is_some_and(|ending| ending == "las" || ending == "laz")
    };
    let (mut state, mut made) = (5, 0);
    for cloud in clouds.iter().filter(is_las) {
        for _ in 0..2 {
            let texts = random_chain(&mut state);
            let output = place.path().join("out.las");
            let [one, other] = [(1, 512), (3, 1024)].map(|(threads, memory)| {
                let resources = Resources { threads, memory: memory << 20, temp_dir: None };
                let job = job(&[cloud.to_str().unwrap()], &output);
                let told = run(&chain(TranslateJob { resources, ..job }, &texts));
                told.map(|_| std::fs::read(&output).unwrap()).map_err(|error| error.to_string())
            });
            let told = one.as_ref().err();
            assert!(
                one == other,
                "{} {texts:?} {told:?} {:?}",
                cloud.display(),
                other.as_ref().err()
            );
            made += usize::from(one.is_ok());
        }
    }
    assert!(made > 20, "{made}");
}

/// `TERRANE_CHAINS` says how many chains are tried, if not 24.
#[test]
fn random_chains_are_the_same_by_threads_memory_and_plan() {
    let place = Place::new();
    let input = survey(&place);
    let count = std::env::var("TERRANE_CHAINS").map_or(24, |count| count.parse().unwrap());
    let (mut state, mut planned_chains) = (count, 0);
    for number in 0..count {
        let texts = random_chain(&mut state);
        let output = place.path().join("out.las");
        let mut expected = None;
        for (threads, memory) in [(1, 256), (3, 1024)] {
            let resources = Resources { threads, memory: memory << 20, temp_dir: None };
            let job = TranslateJob { resources, ..job(&[&input], &output) };
            let told = run(&chain(job, &texts)).map(|_| std::fs::read(&output).unwrap());
            let found = told.map_err(|error| error.to_string());
            let before: &Result<Vec<u8>, String> = expected.get_or_insert_with(|| found.clone());
            let errors = [&found, before].map(|told| told.as_ref().err().cloned());
            assert!(found == *before, "{texts:?} {threads} {memory}: {errors:?}");
        }
        if expected.is_none_or(|found| found.is_err()) {
            continue;
        }
        let squares = PointTiling { side: 17.0, buffer: 2.0, flag: Default::default() };
        let folder = place.path().join(format!("whole{number}"));
        let whole = TranslateJob { squares: Some((squares, true)), ..job(&[&input], &folder) };
        let whole = chain(whole, &texts);
        let work = place.path().join(format!("work{number}"));
        if is_planned(&whole, &work) {
            run(&whole).unwrap();
            planned(&whole, &work, 2);
            assert!(files(&work.join("points")) == files(&folder), "{texts:?}");
            planned_chains += 1;
        }
    }
    assert!(planned_chains > count / 8, "{planned_chains}");
}

/// Whether a plan takes a job; it says what it does not take.
fn is_planned(job: &TranslateJob, folder: &Path) -> bool {
    let plan = PlanPointsJob {
        job: job.clone(),
        folder: folder.with_extension("tried"),
        cut: Some(2),
        skipped: vec![],
    };
    match plan_points(&plan, &terrane_engine::Silent, &Default::default()) {
        Ok(_) => true,
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("`plan points`"), "{text}");
            false
        }
    }
}

#[test]
fn what_is_no_stage_is_refused() {
    for (text, told) in [
        ("", "expected one of dedupe"),
        ("thin", "thin: expected CELL"),
        ("thin:0", "thin: expected CELL"),
        ("Thin:1", "expected one of"),
        ("dedupe:1", "dedupe: expected no arguments"),
        ("where:", "where: "),
        ("where:z", "not a condition"),
        ("assign:z = 3", "coordinate"),
        ("poisson:-1", "poisson: expected a distance"),
        ("reproject", "reproject: expected a CRS"),
        ("sort", "expected morton or time"),
        ("noise:best", "noise: "),
        ("ground:best", "ground: "),
        ("ground:csf:reclassify=7", "noise and cannot become ground"),
        ("height-above-ground:w", "expected dimension or z"),
        ("height-classes:3", "height-classes: "),
        ("tree-tops:5:max=3", "tree-tops: expected min=HEIGHT"),
        ("trees:5:radius=x", "trees: expected a share"),
        ("dimension:intensity = 3", "is an attribute of LAS"),
        ("normals:k=2", "normals: expected k=NUMBER"),
        ("drop-overlap:x", "drop-overlap: expected a number"),
    ] {
        let error = text.parse::<StageText>().unwrap_err();
        assert!(error.contains(told), "{text}: {error}");
    }
    let place = Place::new();
    let input = survey(&place);
    let output = place.path().join("out.laz");
    for (texts, told) in [
        (&["where:colour = 3"][..], "no attribute"),
        (&["where:HeightAboveGround > 1", "thin:2"], "no attribute"),
        (&["thin:0.0001"], "smaller than the coordinate resolution"),
        (&["reproject:EPSG:4326", "poisson:1"], "requires projected coordinates"),
        (&["reproject:EPSG:4326", "tree-tops:5"], "requires projected coordinates"),
        (&["reproject:EPSG:4326", "trees:5"], "requires coordinates in a unit of length"),
        (&["reproject:EPSG:4326", "normals"], "requires coordinates in a unit of length"),
        (&["where:HeightAboveGround > 2 or z > 0", "height-above-ground"], "no attribute"),
        (&["where:classification != 2", "height-above-ground"], "no points of class 2"),
        (&["dedupe"; 65], "65 stages exceed the limit of 64"),
    ] {
        let error = run(&chain(job(&[&input], &output), texts)).unwrap_err();
        assert!(error.to_string().contains(told), "{texts:?}: {error}");
        assert!(!output.exists());
    }
}

#[test]
fn heights_of_heights_are_those_of_two_runs() {
    let place = Place::new();
    // Far from the origin of the coordinates, with an offset of z, which heights do not have.
    let input = above::survey(&place, "cloud,size=60,density=6,seed=5", 6, "survey.las");
    let mut bytes = std::fs::read(&input).unwrap();
    // Offset, highest and lowest z of the header.
    for at in [171, 211, 219] {
        let z = f64::from_le_bytes(*bytes[at..].first_chunk().unwrap());
        bytes[at..at + 8].copy_from_slice(&(z + 100.0).to_le_bytes());
    }
    std::fs::write(&input, bytes).unwrap();
    let [first, twice, once] = ["1.las", "2.las", "3.las"].map(|name| place.path().join(name));
    run(&chain(job(&[&input], &first), &["height-above-ground:z"])).unwrap();
    run(&chain(job(&[first.to_str().unwrap()], &twice), &["height-classes"])).unwrap();
    run(&chain(job(&[&input], &once), &["height-above-ground:z", "height-classes"])).unwrap();
    assert!(whole(&once).records == whole(&twice).records);
    assert!(whole(&once).records.iter().any(|record| record[16] == 5));
}

#[test]
fn duplicates_of_other_classes_may_be_ground() {
    let place = Place::new();
    let made = Made::new(6, Packing::Fixed(700), 3_000);
    let records = (0..3_000).flat_map(|i| {
        let at = [i % 60 * 90, i / 60 * 90, i * 31 % 97];
        // The first is kept, and the second is ground.
        [1, 2].map(|class| {
            let mut record = made.records[0].clone();
            record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
            (record[14], record[15], record[16]) = (0x11, 0, class);
            record
        })
    });
    let input = place.write("in.laz", &Made { records: records.collect(), ..made.clone() }.bytes());
    let output = place.path().join("out.las");
    let cloud = CloudOpenOptions {
        filter: CloudFilter { classes: Some(vec![1]), ..CloudFilter::default() },
        ..CloudOpenOptions::default()
    };
    let asked = HeightQuery { heights: Some(HeightsAs::Dimension), ..HeightQuery::default() };
    let job = TranslateJob { cloud, ..job(&[&input], &output) };
    let report = run(&job.clone().stage(Dedupe).classify(asked.clone())).unwrap();
    let told = "ground: 3000 points of class 2".to_owned();
    assert!(report.points == 3_000 && report.notes.contains(&told), "{:?}", report.notes);
    // Attributes and order do not hinder the search.
    let same = chain(job.clone(), &["assign:user_data = 1", "sort:morton"]);
    let report = run(&same.classify(asked.clone())).unwrap();
    assert!(report.notes.contains(&"ground: 3000 points of class 2".to_owned()));
    // After a choice among them, the ground is among those that are left.
    let error = run(&job
        .stage("9".parse::<CellThinning>().unwrap())
        .classify(HeightQuery { from: GroundFrom::Class, ..asked }));
    assert!(error.unwrap_err().to_string().contains("no points of class 2"));
}

#[test]
fn heights_are_joined_with_the_ground_before_them_only_where_nothing_changes() {
    let place = Place::new();
    let input = survey(&place);
    let output = place.path().join("out.las");
    // Each chain beside the same with something between its last two stages that keeps them apart.
    for (texts, last) in [
        (&["ground:csf"][..], "height-above-ground"),
        (&["ground:csf"], "height-classes"),
        (&["height-above-ground"], "height-classes"),
        (&["ground:csf", "height-above-ground"], "height-classes"),
        (&["ground:csf", "height-above-ground:z"], "height-classes"),
        // Points between 0 and 6 become ground.
        (&["ground:csf", "height-classes:2=0,5=6"], "height-above-ground"),
    ] {
        let made = |texts: &[&str]| {
            run(&chain(job(&[&input], &output), texts)).unwrap();
            std::fs::read(&output).unwrap()
        };
        let apart = made(&[texts, &["where:z > -1000", last]].concat());
        assert!(made(&[texts, &[last]].concat()) == apart, "{texts:?} {last}");
    }
    // Heights after a change of the vertical CRS are no reason to refuse it.
    let moved = ["reproject:EPSG:32633", "height-above-ground:z"];
    run(&chain(job(&[&input], &output), &moved)).unwrap();
}

/// Fails where points are read.
struct Unread;

impl Progress for Unread {
    fn begin(&self, stage: &str, _: u64) {
        panic!("{stage} has begun");
    }

    fn advance(&self, _: u64) {}

    fn end(&self) {}
}

#[test]
fn a_plan_of_what_cannot_be_done_is_refused_before_points_are_read() {
    let place = Place::new();
    let input = above::survey(&place, "cloud,size=30,density=4,seed=2", 0, "plain.las");
    let squares = PointTiling { side: 10.0, buffer: 0.0, flag: Default::default() };
    for (text, told) in [("sort:time", "GPS times"), ("height-classes:64=3", "class 64")] {
        let folder = place.path().join("tiles");
        let job = TranslateJob { squares: Some((squares, true)), ..job(&[&input], &folder) };
        let work = place.path().join("work");
        let plan = PlanPointsJob {
            job: chain(job, &[text]),
            folder: work.clone(),
            cut: None,
            skipped: vec![],
        };
        let error = plan_points(&plan, &Unread, &Default::default()).unwrap_err();
        assert!(error.to_string().contains(told) && !work.exists(), "{error}");
    }
}
