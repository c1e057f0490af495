//! Containers out of finished objects, for a run that goes on from them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::folder::{Folder, Survey};
use super::object::Object;
use super::tasks::{Strips, TaskId};
use crate::tin::container::Container;
use crate::tin::layout::TileId;
use crate::tin::schedule::lock;
use crate::tin::worker::Stock;
use terrane_base::error::Result;

/// Objects open at once: the sweep is in one strip, or at the seam between two.
const MOST_OPEN: usize = 4;

/// Opens objects as the sweep over the tiles comes to them.
pub(super) struct Shelf<'a> {
    folder: &'a Folder,
    survey: &'a Survey,
    /// Whose object has the tiles of a row.
    task_of: fn(&Strips, u32) -> TaskId,
    /// By the number in their task's name, so that the first one was left behind first.
    open: Mutex<BTreeMap<(u32, TaskId), Arc<Object>>>,
}

impl<'a> Shelf<'a> {
    /// Tiles as the strips left them.
    pub(super) fn of_strips(folder: &'a Folder, survey: &'a Survey) -> Self {
        let task_of = |strips: &Strips, row| TaskId::Strip(strips.strip_of(row));
        Self { folder, survey, task_of, open: Mutex::default() }
    }

    /// Tiles with all seams mended.
    pub(super) fn of_all(folder: &'a Folder, survey: &'a Survey) -> Self {
        Self { folder, survey, task_of: Strips::last_of, open: Mutex::default() }
    }

    fn object(&self, task: TaskId) -> Result<Arc<Object>> {
        let number = match task {
            TaskId::Strip(number) | TaskId::Seam(number) => number,
            TaskId::Finish => u32::MAX,
        };
        let mut open = lock(&self.open);
        if let Some(object) = open.get(&(number, task)) {
            return Ok(Arc::clone(object));
        }
        let object = Arc::new(self.folder.open_object(task, self.survey)?);
        if open.len() >= MOST_OPEN {
            open.pop_first();
        }
        open.insert((number, task), Arc::clone(&object));
        Ok(object)
    }
}

impl Stock for Shelf<'_> {
    fn load(&self, tile: TileId) -> Result<Container> {
        let strips = &self.folder.strips;
        let task = (self.task_of)(strips, tile.row);
        self.object(task)?.read(strips.position(task, tile))
    }
}
