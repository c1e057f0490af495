//! Squares by plan with noise and what is there twice, beside the ground and without: those of a single run.

use std::collections::BTreeMap;
use std::path::Path;

use terrane_cloud::{CloudFilter, CloudOpenOptions};
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{DiskCheck, OutputForm, RunJob};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::grid::GroundFrom;
use terrane_lidar::points::plan::{PlanPointsJob, PointsWritten, plan_points};
use terrane_lidar::points::{
    CellThinning, Classify, Dedupe, HeightQuery, HeightsAs, PointTiling, PointsOptions,
    TranslateJob,
};

use crate::cloud_support::{Made, Packing, Place};
use crate::translate::{job, run};

/// A rough plain, with pits and birds that stand alone, some near each other and some far from all, and with points
/// that are there twice: the second is of another class or return.
fn cloud() -> Made {
    let plain = (0..12_000).map(|i| [i % 120 * 90, i / 120 * 90, i * 31 % 97]);
    let crowd = (0..2_000).map(|i| [3_000 + i * 7919 % 797, 4_000 + i * 4729 % 691, i * 31 % 401]);
    let pits = (0..60).map(|i| [i * 7919 % 10_000, i * 4729 % 8_900, -9_000 - i * 97]);
    let birds = (0..40).map(|i| [i * 3571 % 10_700, i * 6607 % 8_900, 30_000 + i % 4 * 300]);
    let lone = [[20_000, 9_000, 50], [20_090, 9_000, 50], [-6_000, 40, 7]];
    let places: Vec<[i32; 3]> = plain.chain(crowd).chain(pits).chain(birds).chain(lone).collect();
    let mut made = Made::new(6, Packing::Fixed(700), places.len());
    for (number, (record, place)) in made.records.iter_mut().zip(&places).enumerate() {
        record[..12].copy_from_slice(place.map(i32::to_le_bytes).as_flattened());
        record[14] = if number % 5 == 3 { 0x21 } else { 0x11 };
        record[15] = if number % 41 == 7 { 4 } else { 0 };
        record[16] = [1, 2, 2, 5][number % 4];
    }
    let twice: Vec<Vec<u8>> = made.records.iter().step_by(7).cloned().collect();
    let again = twice.iter().map(|record| {
        let mut record = record.clone();
        (record[14], record[16]) = (0x11, if record[16] == 2 { 1 } else { 2 });
        record
    });
    made.records.splice(5_000..5_000, again);
    made
}

/// Names and bytes of the files of a folder.
pub(crate) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let file = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(path).unwrap())
    };
    std::fs::read_dir(folder).unwrap().map(file).collect()
}

/// By plan, the first tasks alone, in the least memory that the plan tells.
pub(crate) fn planned(job: &TranslateJob, folder: &Path, cut: u32) -> PointsWritten {
    let silent = (&Silent, Cancel::default());
    let plan =
        PlanPointsJob { job: job.clone(), folder: folder.into(), cut: Some(cut), skipped: vec![] };
    plan_points(&plan, silent.0, &silent.1).unwrap();
    let status = PointsOptions::status(folder).unwrap();
    let memory = status.forecast.least_memory.next_multiple_of(1 << 20);
    let task = |name: Option<String>| {
        let run = RunJob {
            folder: folder.into(),
            task: name,
            output: None,
            overwrite: false,
            form: OutputForm::default(),
            disk: DiskCheck::default(),
            resources: Resources { memory, threads: 2, temp_dir: None },
        };
        PointsOptions::run_plan(&run, silent.0, &silent.1).unwrap()
    };
    let some = status.to_do.iter().take(3).map(|task| task.id.clone());
    some.for_each(|name| drop(task(Some(name))));
    task(None).of.written.unwrap()
}

struct Case {
    classify: &'static [&'static str],
    from: &'static str,
    heights: Option<HeightsAs>,
    returns: Option<&'static str>,
    classes: Option<Vec<u8>>,
    dedupe: bool,
    cut: u32,
}

const CASE: Case = Case {
    classify: &[],
    from: "auto",
    heights: None,
    returns: None,
    classes: None,
    dedupe: false,
    cut: 2,
};

const FAR: &str = "noise:statistical:k=5,m=1.5";

fn cases() -> Vec<Case> {
    let heights = Some(HeightsAs::Dimension);
    let (first, some) = (Some("first"), Some(vec![1, 2]));
    let case = |classify: &'static [&'static str], from| Case { classify, from, ..CASE };
    vec![
        case(&[FAR], "auto"),
        Case { cut: 1, dedupe: true, ..case(&[FAR], "auto") },
        Case { classes: some.clone(), ..case(&["noise:statistical:k=3,m=40,class=18"], "auto") },
        Case { heights, ..case(&["noise", "ground"], "csf") },
        Case { dedupe: true, cut: 1, ..case(&["noise", "ground"], "smrf") },
        Case { heights, dedupe: true, ..case(&["noise"], "class") },
        Case { returns: first, ..case(&[FAR, "ground", "height"], "pmf") },
        Case { heights, returns: first, dedupe: true, ..case(&[FAR], "class") },
        Case {
            heights: Some(HeightsAs::Z),
            classes: some,
            ..case(&["noise:voxel:step=2,isolated=3"], "class")
        },
        Case { heights, dedupe: true, ..case(&[], "class") },
        Case { dedupe: true, cut: 1, ..case(&["ground"], "ptd") },
    ]
}

#[test]
fn squares_by_plan_are_those_of_a_single_run() {
    let place = Place::new();
    let made = cloud();
    let halves = made.records.split_at(7_300);
    let [a, b] = [("1.laz", halves.0), ("2.laz", halves.1)].map(|(name, half)| {
        place.write(name, &Made { records: half.to_vec(), ..made.clone() }.bytes())
    });
    let squares = PointTiling { side: 31.0, buffer: 4.0, flag: Default::default() };
    for (number, case) in cases().into_iter().enumerate() {
        let classify = case.classify.iter().map(|text| text.parse::<Classify>().unwrap()).collect();
        let from = case.from.parse::<GroundFrom>().unwrap();
        let filter = CloudFilter {
            classes: case.classes,
            returns: case.returns.map(|text| text.parse().unwrap()),
            ..CloudFilter::default()
        };
        let whole = place.path().join(format!("whole{number}"));
        let single = TranslateJob {
            cloud: CloudOpenOptions { filter, ..CloudOpenOptions::default() },
            squares: Some((squares, true)),
            ..job(&[&b, &a], &whole)
        }
        .stages(case.dedupe.then_some(Dedupe))
        .classify(HeightQuery { from, heights: case.heights, classify })
        .stages((number % 3 == 1).then(|| "1.5:lowest".parse::<CellThinning>().unwrap()));
        let report = run(&single).unwrap();
        let folder = place.path().join(format!("work{number}"));
        let written = planned(&single, &folder, case.cut);
        let expected = files(&whole);
        assert!(files(&folder.join("points")) == expected, "{number}: {:?}", report.notes);
        assert!(expected.len() > 9, "{number}: {}", expected.len());
        let noise = |notes: &[String]| {
            notes.iter().find(|note| note.starts_with("noise: ")).cloned().unwrap_or_default()
        };
        assert!(!noise(&report.notes).starts_with("noise: 0 "), "{number}: {:?}", report.notes);
        assert_eq!(noise(&written.notes), noise(&report.notes), "{number}");
        let names = files_of_plan(&folder);
        assert_eq!(names, ["finished.json", "lock", "objects", "plan.json", "points"], "{number}");
    }
}

fn files_of_plan(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
