//! Stages before grids, meshes and tiles: the same as points after these stages, and then the operation.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use terrane::prelude::*;
use terrane::{Cloud, StageText, open_cloud};
use terrane_cloud::PointFormat;
use terrane_cloud::synth;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::synthetic_cloud::{self, SyntheticCloudJob};

const STAGES: [&str; 3] =
    ["ground:csf", "height-above-ground", "where:HeightAboveGround > 1 or class = 2"];

fn stages(texts: &[&str]) -> Vec<StageText> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

fn survey(folder: &Path, seed: u64) -> String {
    let output = folder.join("survey.laz");
    let job = SyntheticCloudJob {
        survey: synth::survey(&format!("cloud,size=80,density=4,seed={seed}")).unwrap(),
        output: output.clone(),
        format: PointFormat::new(6).unwrap(),
        overwrite: true,
        resources: Resources::default(),
    };
    synthetic_cloud::run(&job, &Silent, &Cancel::default()).unwrap();
    output.to_str().unwrap().to_owned()
}

/// All files below a folder, by path.
fn all_files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => {
                    let bytes = std::fs::read(&path).unwrap();
                    all.insert(path.strip_prefix(folder).unwrap().to_path_buf(), bytes);
                }
            }
        }
    }
    all
}

/// The points after the stages.
fn made(cloud: &Cloud, texts: &[&str], folder: &Path) -> Cloud {
    let path = folder.join("made.las");
    cloud.points().stage(stages(texts)).overwrite(true).write(&path).unwrap();
    open_cloud(path.to_str().unwrap()).unwrap()
}

#[test]
fn stages_before_an_operation_are_those_of_points() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cloud = open_cloud(survey(folder, 9)).unwrap();
    let made = made(&cloud, &STAGES, folder);
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();

    let report =
        cloud.grid(2.0).stat("max,count,mean:attribute=HeightAboveGround").stage(stages(&STAGES));
    let report = report.write(folder.join("a.tif")).unwrap();
    made.grid(2.0)
        .stat("max,count,mean:attribute=HeightAboveGround")
        .write(folder.join("b.tif"))
        .unwrap();
    assert!(read("a.tif") == read("b.tif"));
    assert!(report.input.ends_with("survey.laz (after stages)"), "{}", report.input);
    assert!(report.notes[0].starts_with("stages: ") && report.notes[1].contains("csf"));
    let plan =
        cloud.grid(2.0).stat("max,count,mean:attribute=HeightAboveGround").stage(stages(&STAGES));
    let written = plan.plan(folder.join("grids"), None).unwrap().run().run().unwrap().written;
    assert!(std::fs::read(written.unwrap()).unwrap() == read("a.tif"));

    // Classes are those of the ground of a model, also after stages.
    cloud
        .grid(2.0)
        .dtm(true)
        .class([2, 9])
        .stage(stages(&STAGES))
        .write(folder.join("c.tif"))
        .unwrap();
    made.grid(2.0).dtm(true).class([2, 9]).write(folder.join("d.tif")).unwrap();
    assert!(read("c.tif") == read("d.tif"));

    // The name of the source is written to a mesh, but not to an STL file.
    for (name, work) in [("a.stl", None), ("b.stl", Some("mesh"))] {
        let mesh = cloud.tin().max_error(0.3).stage(stages(&STAGES));
        let mesh = work.into_iter().fold(mesh, |mesh, work| mesh.workdir(folder.join(work)));
        mesh.write(folder.join(name)).unwrap();
    }
    made.tin().max_error(0.3).write(folder.join("c.stl")).unwrap();
    assert!(read("a.stl") == read("b.stl") && read("a.stl") == read("c.stl"));

    for (name, work) in [("tiles", None), ("again", Some("work"))] {
        let tiles = cloud.tiles(None).stage(stages(&STAGES));
        let tiles = work.into_iter().fold(tiles, |tiles, work| tiles.workdir(folder.join(work)));
        tiles.write(folder.join(name)).unwrap();
    }
    made.tiles(None).write(folder.join("those")).unwrap();
    let [tiles, again, mut those] =
        ["tiles", "again", "those"].map(|name| all_files(&folder.join(name)));
    assert!(tiles == again);
    // The name of the point cloud is written here.
    let layer = PathBuf::from("layer.json");
    those.insert(layer.clone(), tiles[&layer].clone());
    assert!(tiles == those && tiles.len() > 20);
    // Nothing stays beside the outputs.
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(names.into_iter().all(|name| !name.to_str().unwrap().starts_with('.')));
}

#[test]
fn work_is_not_resumed_with_other_stages_or_files() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, input) = (folder.path(), survey(folder.path(), 9));
    let (work, output) = (folder.join("work"), folder.join("mesh.stl"));
    let run = |texts: &[&str], memory: &str| {
        let cloud = open_cloud(input.as_str()).unwrap();
        let mesh = cloud.tin().max_error(0.3).stage(stages(texts));
        let made = mesh.workdir(&work).memory(memory).overwrite(true).write(&output);
        made.map(|report| report.notes).map_err(|error| error.to_string())
    };
    let points = work.join("points/points.las");
    let first = run(&["thin:1:lowest"], "1G").unwrap();
    let kept = std::fs::metadata(&points).unwrap().modified().unwrap();
    assert_eq!(run(&["thin:1:lowest"], "256M").unwrap()[0], first[0]);
    assert_eq!(std::fs::metadata(&points).unwrap().modified().unwrap(), kept, "made again");
    let told = run(&["thin:2:lowest"], "1G").unwrap_err();
    assert!(told.contains("points.las: was made of other files, or with other options"), "{told}");
    assert_eq!(std::fs::metadata(&points).unwrap().modified().unwrap(), kept, "made again");
    // What was interrupted before its record was finished is made again, and is the same.
    let record = work.join("points/points.json");
    let mut json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&record).unwrap()).unwrap();
    json["made"] = serde_json::Value::Null;
    std::fs::write(&record, json.to_string()).unwrap();
    assert_eq!(run(&["thin:1:lowest"], "1G").unwrap()[0], first[0]);
    survey(folder, 10);
    let told = run(&["thin:1:lowest"], "1G").unwrap_err();
    assert!(told.contains("was made of other files"), "{told}");
}

#[test]
fn folders_of_others_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, input) = (folder.path(), survey(folder.path(), 9));
    let cloud = open_cloud(input.as_str()).unwrap();
    for (file, told) in
        [("points/points.las", "is not a file of this job"), ("notes.txt", "is not empty")]
    {
        let work = folder.join(told.replace(' ', "-"));
        let theirs = work.join(file);
        std::fs::create_dir_all(theirs.parent().unwrap()).unwrap();
        std::fs::write(&theirs, "theirs").unwrap();
        let mesh = cloud.tin().max_error(0.3).stage(stages(&["dedupe"]));
        let mesh = mesh.workdir(&work).write(folder.join("mesh.stl")).unwrap_err().to_string();
        let plan = cloud.grid(1.0).stage(stages(&["dedupe"])).plan(&work, None);
        let plan = plan.map(|_| ()).unwrap_err().to_string();
        assert!(mesh.contains(told) && plan.contains(told), "{mesh} {plan}");
        assert_eq!(std::fs::read(&theirs).unwrap(), b"theirs");
        assert_eq!(std::fs::read_dir(&work).unwrap().count(), 1, "something was written");
    }
    // What plans refuse is refused before the stages.
    let plan = cloud.grid(1.0).stage(stages(&["dedupe"])).plan(folder.join("odd"), 7);
    let told = plan.map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("not a multiple of 256") && !folder.join("odd").exists(), "{told}");
}

#[test]
fn errors_name_the_cloud_and_nothing_is_read_for_an_output_that_exists() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, input) = (folder.path(), survey(folder.path(), 9));
    let cloud = open_cloud(input.as_str()).unwrap();
    let output = folder.join("out.tif");
    let error = cloud.grid(1.0).stage(stages(&["where:z > 1e6"])).write(&output).unwrap_err();
    assert!(!error.to_string().contains("points.las"), "{error}");
    std::fs::write(&output, "something").unwrap();
    let error = cloud.grid(1.0).stage(stages(&["where:nothing > 1"])).write(&output).unwrap_err();
    assert!(error.to_string().contains("out.tif: output already exists"), "{error}");
}
