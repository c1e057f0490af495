//! Plans against a single run, with small regions and many rounds.

use super::*;
use crate::cloud_tin::CloudTinOptions;
use crate::cloud_tin::plan::{PlanCloudTinJob, plan_regions};
use terrane_engine::operation::Divisible;
use terrane_engine::plan::DiskCheck;
use terrane_engine::plan::{OutputForm, RunJob};

/// Most points of a region, and of a task.
const FEW: [u64; 2] = [300, 20_000];

/// Vertices that each round of tasks and the last task add to a mesh, made by plan and compared with one run.
fn added(cloud: &str, tolerance: f64, classes: Option<Vec<u8>>) -> [u64; 4] {
    let folder = tempfile::tempdir().unwrap();
    let at = RunControl { progress: &Silent, cancel: &Cancel::default() };
    let [whole, planned] = ["whole.ply", "planned.ply"].map(|name| folder.path().join(name));
    let resources = Resources { threads: 2, ..Resources::default() };
    let mut job = CloudTinJob::new(vec![cloud.to_owned()], whole.clone(), tolerance, resources);
    job.options.filter.classes = classes;
    let source = cloud::source(job.inputs.names(), &job.options).unwrap();
    let format = job.format().unwrap();
    let told = make(&job, &*source, ConstraintFeatures::default(), format, FEW[0], at).unwrap();
    let work = folder.path().join("work");
    let (cut, job) = (Some(FEW[1] as u32), CloudTinJob { format: Some("PLY".into()), ..job });
    let plan = PlanCloudTinJob { job, folder: work.clone(), cut, skipped: Vec::new() };
    let status = plan_regions(&plan, FEW[0], at).unwrap();
    assert_eq!(status.of.regions, told.regions);
    let (form, resources) = (OutputForm::default(), &plan.job.resources);
    let all = RunJob::until(&work, &planned, false, form, DiskCheck::On, resources);
    let run = |task: &str| {
        let job = RunJob { task: Some(task.to_owned()), output: None, ..all.clone() };
        CloudTinOptions::run_plan(&job, &Silent, &Cancel::default()).unwrap().of.vertices
    };
    let mut added = ["choose", "prove", "again", "finish"].map(|round| {
        let of_round = status.to_do.iter().rev().filter(|task| task.id.starts_with(round));
        of_round.filter(|task| task.id != "finish").map(|task| run(&task.id)).sum()
    });
    let made =
        CloudTinOptions::run_plan(&all, &Silent, &Cancel::default()).unwrap().of.mesh.unwrap();
    added[3] = made.vertices - added.iter().sum::<u64>();
    let [whole, planned] = [whole, planned].map(|path| std::fs::read(path).unwrap());
    assert!(whole == planned, "{cloud}: other bytes");
    assert_eq!(
        (made.vertices, made.triangles, made.stacked_points, made.points),
        (told.vertices, told.triangles, told.stacked_points, told.points)
    );
    added
}

#[test]
fn what_rounds_of_tasks_leave_the_last_one_adds() {
    let mut sums = [0; 4];
    for (cloud, tolerance, classes) in [
        ("synth:cloud,size=500,density=2,seed=4,voids=9,tile=60", 0.05, Some(vec![2])),
        ("synth:cloud,size=700,density=1,seed=9", 20.0, None),
        ("synth:cloud,width=3000,height=60,density=1,seed=5,voids=5,tile=90", 2.0, Some(vec![2])),
        ("synth:cloud,size=90,density=1,seed=6", 0.0, None),
    ] {
        let added = added(cloud, tolerance, classes);
        println!("{cloud}: {added:?}");
        sums = std::array::from_fn(|i| sums[i] + added[i]);
    }
    assert!(sums.iter().all(|sum| *sum > 0), "a round has nothing to do: {sums:?}");
}
