//! Containers out of finished objects, for a run that goes on from them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::tasks::{Strips, Task};
use crate::tin::container::Container;
use crate::tin::layout::TileId;
use crate::tin::object::{Facts, Object};
use crate::tin::worker::Stock;
use terrane_base::error::Result;
use terrane_engine::plan::{Survey, Work};
use terrane_files::lock;

/// Objects open at once: the sweep is in one strip, or at the seam between two.
const MOST_OPEN: usize = 4;

/// Opens objects as the sweep over the tiles comes to them.
pub(super) struct Shelf<'a, W: Work> {
    survey: &'a Survey<'a, W>,
    strips: Strips,
    /// Whose object has the tiles of a row.
    task_of: fn(&Strips, u32) -> Task,
    /// By the number in their task's name, so that the first one was left behind first.
    open: Mutex<BTreeMap<(u32, Task), Arc<Object>>>,
}

impl<'a, W: Work<Task = Task, Facts = Facts>> Shelf<'a, W> {
    /// Of the finished objects; `task_of` says whose tiles of a row are taken.
    pub(super) fn new(
        survey: &'a Survey<'a, W>,
        strips: Strips,
        task_of: fn(&Strips, u32) -> Task,
    ) -> Self {
        Self { survey, strips, task_of, open: Mutex::default() }
    }

    fn object(&self, task: Task) -> Result<Arc<Object>> {
        let (Task::Strip(number) | Task::Seam(number)) = task;
        let mut open = lock(&self.open);
        if let Some(object) = open.get(&(number, task)) {
            return Ok(Arc::clone(object));
        }
        let (path, done) = self.survey.object(task)?;
        let tiles = self.strips.work(task).tiles();
        let object = Arc::new(Object::open(path, done.facts.index, tiles)?);
        if open.len() >= MOST_OPEN {
            open.pop_first();
        }
        open.insert((number, task), Arc::clone(&object));
        Ok(object)
    }
}

impl<W: Work<Task = Task, Facts = Facts>> Stock for Shelf<'_, W> {
    fn load(&self, tile: TileId) -> Result<Container> {
        let task = (self.task_of)(&self.strips, tile.row);
        self.object(task)?.read(self.strips.position(task, tile))
    }
}
