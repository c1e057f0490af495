//! The order of work: tasks, what each waits for, and the queue the workers take them from.
//!
//! There are no phases and no barriers. A task becomes ready when the tasks it waits for are done, and the
//! queue returns the ready task that the sweep over the tiles reached first, so that started work is finished
//! before new tiles are begun and memory stays at about three rows of tiles. The graph is never stored: tasks
//! and their edges are computed, and only tasks that have some but not all of their inputs are remembered.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::{Condvar, Mutex};

use super::layout::TileId;
use super::task::{MAX_LAG, TileStep, TileTask};
use super::task_scope::LayoutWork;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::{lock, unlocked, wait};

/// Offsets (step, rows, columns) of tasks around a tile.
type Edges = &'static [(TileStep, i32, i32)];

impl TileTask {
    fn at(step: TileStep, tile: TileId) -> Self {
        Self { tile, step }
    }

    /// The tasks at the end of `edges`; a run that saves tiles does so where others gather them.
    fn around(self, work: &LayoutWork, edges: Edges) -> impl Iterator<Item = TileTask> {
        edges.iter().filter_map(move |&(step, rows, cols)| {
            let step = if step == TileStep::Gather { work.last_touch() } else { step };
            let task = TileTask::at(step, work.layout.step(self.tile, rows, cols)?);
            work.has(task).then_some(task)
        })
    }

    /// The tasks this one waits for.
    fn inputs(self, work: &LayoutWork) -> Vec<TileTask> {
        use TileStep::{Corner, Emit, Gather, Horizontal, Number, Save, Tile, Vertical};
        let edges: Edges = match self.step {
            Tile => &[],
            Vertical => &[(Tile, 0, 0), (Tile, 0, 1)],
            // The patch is as wide as the tile and crosses the vertical seams at both its sides, above and
            // below the line: four vertical patches have to be final first.
            Horizontal => &[
                (Tile, 0, 0),
                (Tile, 1, 0),
                (Vertical, 0, -1),
                (Vertical, 0, 0),
                (Vertical, 1, -1),
                (Vertical, 1, 0),
            ],
            Corner => &[(Horizontal, 0, 0), (Horizontal, 0, 1)],
            Gather | Save => &[
                (Tile, 0, 0),
                (Tile, 0, -1),
                (Tile, -1, 0),
                (Tile, -1, -1),
                (Tile, 0, 1),
                (Tile, 1, 0),
                // These three tiles own vertices on the rim of this one. Their heights are looked up, although
                // none of their triangles is changed.
                (Tile, 1, 1),
                (Vertical, 0, -1),
                (Vertical, 0, 0),
                (Horizontal, -1, 0),
                (Horizontal, 0, 0),
                (Corner, -1, -1),
                (Corner, -1, 0),
                (Corner, 0, -1),
                (Corner, 0, 0),
            ],
            Number => return self.number_inputs(work),
            // Ids are given one tile after the other, so the number of the last tile implies those of the
            // other three.
            Emit => return vec![TileTask::at(Number, work.layout.furthest_vertex(self.tile))],
        };
        self.around(work, edges).collect()
    }

    fn number_inputs(self, work: &LayoutWork) -> Vec<TileTask> {
        let before = work.position(self.tile).checked_sub(1).map(|i| work.tile_at(i));
        let before = before.map(|tile| TileTask::at(TileStep::Number, tile));
        [TileTask::at(TileStep::Gather, self.tile)].into_iter().chain(before).collect()
    }

    /// The tasks that wait for this one: the inverse of [`inputs`](Self::inputs).
    fn outputs(self, work: &LayoutWork) -> Vec<TileTask> {
        use TileStep::{Corner, Emit, Gather, Horizontal, Number, Save, Tile, Vertical};
        let edges: Edges = match self.step {
            Tile => &[
                (Vertical, 0, -1),
                (Vertical, 0, 0),
                (Horizontal, -1, 0),
                (Horizontal, 0, 0),
                (Gather, 0, 0),
                (Gather, 0, 1),
                (Gather, 1, 0),
                (Gather, 1, 1),
                (Gather, 0, -1),
                (Gather, -1, 0),
                (Gather, -1, -1),
            ],
            Vertical => &[
                (Horizontal, -1, 0),
                (Horizontal, -1, 1),
                (Horizontal, 0, 0),
                (Horizontal, 0, 1),
                (Gather, 0, 0),
                (Gather, 0, 1),
            ],
            Horizontal => &[(Corner, 0, -1), (Corner, 0, 0), (Gather, 0, 0), (Gather, 1, 0)],
            Corner => &[(Gather, 0, 0), (Gather, 0, 1), (Gather, 1, 0), (Gather, 1, 1)],
            Gather => &[(Number, 0, 0)],
            Number => return self.number_outputs(work),
            Emit | Save => &[],
        };
        self.around(work, edges).collect()
    }

    fn number_outputs(self, work: &LayoutWork) -> Vec<TileTask> {
        let next = work.position(self.tile) + 1;
        let next =
            (next < work.tiles()).then(|| TileTask::at(TileStep::Number, work.tile_at(next)));
        let near = [(-1, -1), (-1, 0), (0, -1), (0, 0)];
        let emits = near
            .into_iter()
            .filter_map(|(rows, cols)| work.layout.step(self.tile, rows, cols))
            .filter(|&tile| work.layout.furthest_vertex(tile) == self.tile)
            .map(|tile| TileTask::at(TileStep::Emit, tile));
        next.into_iter().chain(emits).collect()
    }
}

/// The queue of ready tasks, shared by all workers.
pub(super) struct TaskQueue {
    work: LayoutWork,
    threads: u64,
    order_seed: Option<u64>,
    state: Mutex<TaskQueueState>,
    wake: Condvar,
}

#[derive(Default)]
struct TaskQueueState {
    ready: BinaryHeap<Reverse<(u64, TileTask)>>,
    waiting: HashMap<TileTask, usize>,
    /// Tiles put into `ready` so far, in row-by-row order.
    started: u64,
    /// Tiles in `ready`.
    tiles_ready: u64,
    finished: u64,
    running: u64,
    failure: Option<Error>,
}

impl TaskQueue {
    /// A queue for `threads` workers. With `order_seed`, ready tasks are taken in an order drawn
    /// from it (to test that results do not depend on the order).
    pub(super) fn new(work: LayoutWork, threads: usize, order_seed: Option<u64>) -> Self {
        let (state, wake) = (Mutex::default(), Condvar::new());
        Self { work, threads: threads as u64, order_seed, state, wake }
    }

    /// The next task; waits for one to become ready. `None` when all is done or a task failed. Without free
    /// memory, no tile is begun while anything else can be done: a worker that the system has stopped for a
    /// while would otherwise hold up the writer while the others fill the memory.
    pub(super) fn next(&self, has_room: impl Fn() -> bool) -> Option<TileTask> {
        let mut state = lock(&self.state);
        loop {
            if state.failure.is_some() || state.finished == self.work.tiles() {
                return None;
            }
            // A tile waits for nothing, so no finished task would ever ready it.
            self.begin_tiles(&mut state, &has_room);
            if let Some(Reverse((_, task))) = state.ready.pop() {
                state.running += 1;
                state.tiles_ready -= u64::from(task.step == TileStep::Tile);
                return Some(task);
            }
            // Only a running task can ready another. Waiting here would hang; a gap in the tables of edges
            // ends as an error instead.
            if state.running == 0 {
                state.failure = Some(Error::new(ErrorKind::Internal, "the schedule ran dry"));
                continue;
            }
            state = wait(&self.wake, state);
        }
    }

    /// Notes that `task` is done and readies those that waited for it only.
    pub(super) fn done(&self, task: TileTask) {
        let mut state = lock(&self.state);
        // A failed task is never taken off `running`: the failure ends the queue before anyone counts.
        state.running -= 1;
        state.finished += u64::from(matches!(task.step, TileStep::Emit | TileStep::Save));
        for output in task.outputs(&self.work) {
            let left =
                state.waiting.entry(output).or_insert_with(|| output.inputs(&self.work).len());
            *left -= 1;
            if *left == 0 {
                state.waiting.remove(&output);
                state.ready.push(Reverse((self.key(output), output)));
            }
        }
        drop(state);
        // All workers wake, not one: a task can ready several others, and the last one ends every wait.
        self.wake.notify_all();
    }

    /// Stops the queue; the first failure is kept.
    pub(super) fn fail(&self, error: Error) {
        lock(&self.state).failure.get_or_insert(error);
        self.wake.notify_all();
    }

    /// The outcome, after all workers have left.
    pub(super) fn into_result(self) -> Result<()> {
        let state = unlocked(self.state);
        state.failure.map_or(Ok(()), Err)
    }

    /// Adds tiles to the ready tasks: one for each worker while there is memory, and none too far ahead of the
    /// writer.
    fn begin_tiles(&self, state: &mut TaskQueueState, has_room: impl Fn() -> bool) {
        // A drawn order has to choose among all tiles of the window, not among the first few.
        let max_ready = if self.order_seed.is_some() { u64::MAX } else { self.threads };
        let end = self.work.tiles().min(state.finished + self.window());
        while state.started < end && state.tiles_ready < max_ready {
            // Only finished tiles free memory. Without this exception a run over its budget would never go on.
            let idle = state.ready.is_empty() && state.running == 0;
            if !idle && !has_room() {
                return;
            }
            let task = TileTask::at(TileStep::Tile, self.work.tile_at(state.started));
            state.ready.push(Reverse((self.key(task), task)));
            state.started += 1;
            state.tiles_ready += 1;
        }
    }

    /// Most tiles begun but not finished. A tile can be finished once the tiles up to two rows and
    /// three columns further are done, so fewer than that would be a deadlock.
    fn window(&self) -> u64 {
        let cols = u64::from(self.work.layout.cols);
        2 * cols + 4 + cols.max(4 * self.threads)
    }

    /// Lower goes first: the position of the last tile the task waits for, then the step.
    fn key(&self, task: TileTask) -> u64 {
        let (rows, cols) = task.step.lag();
        let layout = &self.work.layout;
        // As if the sweep went on beyond the last row and column, so that what waits for tiles that
        // are not there still keeps its distance.
        let cols = u64::from(task.tile.col + cols);
        let last = u64::from(task.tile.row + rows) * u64::from(layout.cols + MAX_LAG) + cols;
        match self.order_seed {
            // Of tasks that wait for the same last tile the earlier of the eight steps goes first.
            None => last * 8 + task.step as u64,
            Some(seed) => mix(seed ^ mix(layout.index(task.tile) * 8 + task.step as u64)),
        }
    }
}

/// SplitMix64's finalizer: a fixed, well-mixed function of `x`.
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeSet, HashSet};

    use crate::tin::layout::TileLayout;
    use crate::tin::task_scope::RunScope;

    const STEPS: [TileStep; 8] = [
        TileStep::Tile,
        TileStep::Vertical,
        TileStep::Horizontal,
        TileStep::Corner,
        TileStep::Gather,
        TileStep::Number,
        TileStep::Emit,
        TileStep::Save,
    ];

    /// Every scope of layouts of several shapes.
    fn works() -> Vec<LayoutWork> {
        let shapes = [(1, 1), (1, 2), (2, 1), (1, 7), (7, 1), (2, 2), (3, 5), (5, 3)];
        let layouts =
            shapes.map(|(cols, rows)| TileLayout::new(cols * 16 + 1, rows * 16 + 1, 16).unwrap());
        let scopes = |layout: TileLayout| {
            let strips =
                (0..layout.rows).map(move |row| RunScope::Strip { first: row / 2, end: row + 1 });
            let seams = (0..layout.rows - 1).map(|above| RunScope::Seam { above });
            let scopes = [RunScope::Whole, RunScope::Write].into_iter().chain(strips).chain(seams);
            scopes.map(move |scope| LayoutWork { layout, scope }).collect::<Vec<_>>()
        };
        layouts.into_iter().flat_map(scopes).collect()
    }

    fn all_tasks(work: &LayoutWork) -> Vec<TileTask> {
        let tiles = (0..work.layout.tiles()).map(|i| work.layout.tile_at(i));
        let tasks = tiles.flat_map(|tile| STEPS.map(|step| TileTask { tile, step }));
        tasks.filter(|task| work.has(*task)).collect()
    }

    #[test]
    fn outputs_are_the_inverse_of_inputs() {
        for work in works() {
            let tasks = all_tasks(&work);
            let mut forward = BTreeSet::new();
            let mut backward = BTreeSet::new();
            for &task in &tasks {
                forward.extend(task.outputs(&work).into_iter().map(|out| (task, out)));
                backward.extend(task.inputs(&work).into_iter().map(|input| (input, task)));
            }
            assert_eq!(forward, backward);
        }
    }

    /// A tile's rim has vertices of the tiles on its right and below it, whose heights are looked up.
    #[test]
    fn a_tile_is_gathered_when_all_owners_of_its_samples_are_there() {
        for work in works() {
            for task in all_tasks(&work).into_iter().filter(|task| task.step == work.last_touch()) {
                let inputs = task.inputs(&work);
                let owners = work.layout.owners(work.layout.rect(task.tile));
                for tile in owners.map(|tile| TileTask { tile, step: TileStep::Tile }) {
                    assert!(!work.has(tile) || inputs.contains(&tile), "{task:?} {tile:?}");
                }
            }
        }
    }

    #[test]
    fn every_task_runs_once_after_its_inputs_in_any_order() {
        for work in works() {
            for seed in [None, Some(1), Some(2), Some(3)] {
                let queue = TaskQueue::new(work, 1, seed);
                let mut seen = HashSet::new();
                while let Some(task) = queue.next(|| true) {
                    assert!(task.inputs(&work).iter().all(|input| seen.contains(input)));
                    assert!(seen.insert(task));
                    queue.done(task);
                }
                queue.into_result().unwrap();
                assert_eq!(seen.len(), all_tasks(&work).len());
            }
        }
    }

    #[test]
    fn without_room_one_tile_is_begun_when_nothing_else_can_be_done() {
        for work in works() {
            let queue = TaskQueue::new(work, 2, None);
            let mut first = queue.next(|| false);
            while let Some(task) = first {
                assert_eq!(lock(&queue.state).tiles_ready, 0, "a tile was begun beside {task:?}");
                queue.done(task);
                first = queue.next(|| false);
            }
            queue.into_result().unwrap();
        }
    }

    /// The tiles whose triangles or vertices a task may change, by its widest rectangle.
    fn touched(layout: &TileLayout, task: TileTask) -> Option<terrane_base::geom::Rect> {
        let widest = layout.widest_reach();
        match task.step.seam() {
            Some(seam) => Some(layout.patch(seam, task.tile, widest)),
            None => (task.step == TileStep::Tile).then(|| layout.rect(task.tile)),
        }
    }

    /// Tasks whose rectangles share a cell must be ordered by the graph.
    #[test]
    fn overlapping_tasks_never_run_at_the_same_time() {
        for work in works() {
            let tasks = all_tasks(&work);
            let before = |a: TileTask, b: TileTask| {
                let mut open = vec![a];
                let mut seen = HashSet::new();
                while let Some(task) = open.pop() {
                    if task == b {
                        return true;
                    }
                    open.extend(task.outputs(&work).into_iter().filter(|t| seen.insert(*t)));
                }
                false
            };
            for (i, &a) in tasks.iter().enumerate() {
                for &b in &tasks[i + 1..] {
                    let (Some(ra), Some(rb)) = (touched(&work.layout, a), touched(&work.layout, b))
                    else {
                        continue;
                    };
                    let shared = ra.intersect(&rb);
                    if shared.width > 1 && shared.height > 1 {
                        assert!(before(a, b) || before(b, a), "{a:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_first_failure_stops_the_queue() {
        let layout = TileLayout::new(33, 33, 16).unwrap();
        let queue = TaskQueue::new(LayoutWork { layout, scope: RunScope::Whole }, 1, None);
        assert!(queue.next(|| true).is_some());
        queue.fail(Error::usage("first"));
        queue.fail(Error::usage("second"));
        assert!(queue.next(|| true).is_none());
        assert_eq!(queue.into_result().unwrap_err().to_string(), "first");
    }
}
