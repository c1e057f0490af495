//! What plans tell of the work before, in and after it.

use std::time::Instant;

use serde_json::Value;

use crate::cli_support::{Place, json};

fn cloud() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=150,density=4,seed=5", "c.laz"]);
    place
}

/// Kinds of work whose time does not follow from the number of points alone.
#[test]
fn the_time_foretold_is_about_the_time_taken() {
    let place = cloud();
    let kinds: [&[&str]; 3] = [
        &["--cell", "0.5", "--stat", "idw:radius=4"],
        &["--cell", "0.5", "--chm"],
        &["--cell", "0.5", "--stat", "natural"],
    ];
    for kind in kinds {
        let plan = ["plan", "grid", "c.laz", "-o", "work", "--tile", "256"];
        place.ok(&[&plan[..], kind].concat());
        let foretold =
            json(&place.ok(&["status", "work", "--json"]).out)["seconds"].as_f64().unwrap();
        let started = Instant::now();
        place.ok(&["run", "work"]);
        let taken = started.elapsed().as_secs_f64();
        // The machine may be busy with other things, now or before.
        assert!(
            foretold < 10.0 * taken && taken < 10.0 * foretold,
            "{kind:?}: {foretold} for {taken}"
        );
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn what_is_done_is_what_was_to_do() {
    let place = cloud();
    place.ok(&["synth", "rough,size=300", "dem.tif"]);
    let plans: [&[&str]; 4] = [
        &["grid", "c.laz", "--cell", "0.4", "--stat", "mean", "--tile", "256"],
        &["points", "c.laz", "--tile", "60", "--cut", "1"],
        &["tin", "c.laz", "--max-error", "1"],
        &["tin", "dem.tif", "--max-error", "3", "--tile", "64", "--strip-rows", "2"],
    ];
    for plan in plans {
        let before = place.ok(&[&["plan"], plan, &["-o", "work"]].concat()).out;
        let status = json(&place.ok(&["status", "work", "--json"]).out);
        let to_do = status["to_do"].as_array().unwrap();
        let names: Vec<&Value> = to_do.iter().map(|task| &task["id"]).collect();
        assert!(before.contains(&format!("0 done, {} to do", names.len())), "{plan:?}:\n{before}");
        let (finish, others) = to_do.split_last().unwrap();
        assert_eq!(finish["id"], "finish");
        let after: Vec<&Value> = finish["after"].as_array().unwrap().iter().collect();
        let others: Vec<&Value> = others.iter().map(|task| &task["id"]).collect();
        assert_eq!(after, others, "{plan:?}: finish waits for all others");
        let told = place.ok(&["run", "work"]).out;
        assert!(told.contains(&format!("{} tasks, ", names.len())), "{plan:?}:\n{told}");
        let again = place.ok(&["run", "work"]).out;
        assert!(again.contains(&format!("{0} of {0}, ", names.len())), "{plan:?}:\n{again}");
        assert!(!again.contains(" tasks, "), "nothing is made again:\n{again}");
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn a_grid_has_as_many_points_as_its_cloud() {
    let place = cloud();
    let count = json(&place.ok(&["info", "c.laz", "--json"]).out)["points"].as_u64().unwrap();
    let plan =
        ["plan", "grid", "c.laz", "-o", "work", "--cell", "0.4", "--stat", "tin", "--tile", "256"];
    place.ok(&plan);
    let told = place.ok(&["run", "work", "--json"]).out;
    let report = json(&told);
    assert_eq!(report["grid"]["cloud_points"], count);
    assert!(report["points"].as_u64().unwrap() > count, "tiles read what lies near them");
    std::fs::remove_dir_all(place.path("work")).unwrap();
    place.ok(&plan);
    let told = place.ok(&["run", "work"]).out;
    let digits = |n: u64| {
        let text = n.to_string();
        let (head, tail) = text.split_at(text.len() - 3);
        format!("{head},{tail}")
    };
    assert!(told.contains(&format!("{} in the cloud; ", digits(count))), "{told}");
}

/// Plans of one request are one plan, however long their samples took.
#[test]
fn the_time_is_no_part_of_what_is_asked() {
    let place = cloud();
    let plan = |folder: &str| {
        place.ok(&["plan", "grid", "c.laz", "-o", folder, "--cell", "2", "--stat", "tin"]);
        json(&place.ok(&["status", folder, "--json"]).out)["plan_id"].clone()
    };
    assert_eq!(plan("one"), plan("two"));
    assert_eq!(plan("one"), plan("one"));
}
