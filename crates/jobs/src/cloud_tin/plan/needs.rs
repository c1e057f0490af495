//! What the work on a mesh of a cloud will take, from a few regions that choose as all will.

use super::mesh::{CloudMesh, Desk, Opened};
use crate::plan::{At, Needs};
use crate::points::{ENTRY, POINT, parts_in};
use terrane_base::error::Result;

/// Regions that are tried.
const TRIED: usize = 5;
/// Most points that may lie in what is read for one: where a cloud is in no order, each would read much of it.
const MOST_POINTS: u64 = 1 << 22;
/// Nanoseconds of one thread for a point in all tasks, and for a vertex that is written, as measured on one machine;
/// see benches/RESULTS.md.
const NANOSECONDS: [f64; 2] = [3300.0, 2000.0];
/// What a few regions say less of all, vertices that are added when they look at each other among it.
const MARGIN: f64 = 1.12;
/// Bytes of the note on a region.
const LOOK: u64 = 80;

/// What the plan will take.
pub(super) fn expect(opened: &Opened, mesh: &CloudMesh, at: At<'_>) -> Result<Needs> {
    let ready = opened.ready()?;
    let desk = Desk::new(mesh, (opened, &ready), at.silent());
    let share = match ready.tolerance() {
        0.0 => 1.0,
        _ => (MARGIN * share(&desk, opened, mesh, at)?).min(1.0),
    };
    let regions = &mesh.seen.regions;
    let points: u64 = regions.iter().map(|region| region.points).sum();
    let vertices = (points as f64 * share) as u64;
    let entries = 3 * desk.tiling.count() as u64;
    let most = regions.iter().map(|region| region.points).max().unwrap_or(0);
    let worker = ready.division.worker(most, 0);
    let memory = ready.division.least(worker, entries * ENTRY * 2);
    let [task, writing] = NANOSECONDS.map(|n| n * 1e-9);
    Ok(Needs {
        memory,
        thread_memory: worker * 8 / ready.division.workers,
        objects: vertices * POINT + entries * ENTRY + 2 * LOOK * regions.len() as u64,
        output: (ready.format.most)().file_bytes(vertices, 2 * vertices),
        seconds: [points as f64 * task, vertices as f64 * writing],
    })
}

/// Vertices for each point, all of them where none can be tried.
fn share(desk: &Desk<'_>, opened: &Opened, mesh: &CloudMesh, at: At<'_>) -> Result<f64> {
    let regions = &mesh.seen.regions;
    let count = TRIED.min(regions.len().div_ceil(2));
    let (mut tried, mut chosen) = (0, 0);
    at.progress.begin("sample", count as u64);
    for number in (0..count).map(|i| regions.len() * (2 * i + 1) / (2 * count)) {
        at.cancel.check()?;
        let window = regions[number].window(&desk.tiling);
        let near = parts_in(&*opened.source, &window);
        if near.iter().map(|part| opened.source.points_of(*part)).sum::<u64>() <= MOST_POINTS {
            chosen += desk.choose(&regions[number], number..number + 1)?.count();
            tried += regions[number].points;
        }
        at.progress.advance(1);
    }
    at.progress.end();
    Ok(if tried == 0 { 1.0 } else { chosen as f64 / tried as f64 })
}
