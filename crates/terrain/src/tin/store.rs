//! All containers of a running job: found by tile, counted, spilled when they take too much.
//!
//! Each container has its own lock and a thread holds at most one of them, so there can be no deadlock.
//! Spilling does not change results.
//!
//! Containers are spilled when a worker needs memory: its buffers are counted until it hands over the
//! triangles, and tasks are taken in an order in which parts can be written soon, at the end of the grid too.

use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use super::container::{SpilledContainer, TileContainer};
use super::layout::{TileId, TileLayout};
use terrane_base::error::Result;
use terrane_files::{SpoolFile, lock};

/// A container, in memory or spilled.
#[derive(Default)]
struct ContainerSlot {
    place: SlotState,
    /// Id of the first vertex, once numbered.
    first_id: u64,
    /// How far from its seam the patch below this tile would have changed its neighbours' triangles.
    reach: u32,
    /// Tiles that still need the vertices to write their triangles.
    readers: u32,
}

enum SlotState {
    Held(TileContainer),
    Spilled(SpilledContainer),
}

impl Default for SlotState {
    fn default() -> Self {
        Self::Held(TileContainer::default())
    }
}

/// The containers of all tiles that are begun and not finished.
pub(super) struct ContainerStore {
    layout: TileLayout,
    slots: Mutex<HashMap<TileId, Arc<Mutex<ContainerSlot>>>>,
    spool: SpoolFile,
    /// Bytes in memory.
    resident: AtomicU64,
    /// Limit of the bytes in memory.
    limit: u64,
    /// One thread spills at a time.
    relief: Mutex<()>,
}

impl ContainerStore {
    /// An empty store that holds about `limit` bytes and spills to `folder`.
    pub(super) fn new(layout: TileLayout, limit: u64, folder: &Path) -> Self {
        Self {
            layout,
            slots: Mutex::default(),
            spool: SpoolFile::new(folder),
            resident: AtomicU64::new(0),
            limit,
            relief: Mutex::default(),
        }
    }

    /// Runs `f` on the container of `tile`, loading or creating it first.
    pub(super) fn with<R>(
        &self,
        tile: TileId,
        f: impl FnOnce(&mut TileContainer) -> R,
    ) -> Result<R> {
        self.slot(tile, |slot| self.load(slot, f))?
    }

    /// Sets the id of the tile's first vertex; returns the id after its last.
    pub(super) fn number(&self, tile: TileId, first_id: u64) -> Result<u64> {
        let vertices = self.slot(tile, |slot| {
            slot.first_id = first_id;
            match &slot.place {
                // The count of a spilled container is known without reading it. Numbering is the one step that
                // runs tile after tile, so a read here would hold up all workers.
                SlotState::Held(container) => container.vertices.len(),
                SlotState::Spilled(spilled) => spilled.vertices(),
            }
        })?;
        Ok(first_id + vertices as u64)
    }

    /// Notes how far from its seam the patch below `tile` would have gone on sideways.
    pub(super) fn set_reach(&self, tile: TileId, reach: u32) -> Result<()> {
        self.slot(tile, |slot| slot.reach = reach)
    }

    /// The reach noted for `tile`.
    pub(super) fn reach(&self, tile: TileId) -> Result<u32> {
        self.slot(tile, |slot| slot.reach)
    }

    /// Runs `f` on the container of a numbered tile and the id of its first vertex.
    pub(super) fn with_ids<R>(
        &self,
        tile: TileId,
        f: impl FnOnce(&mut TileContainer, u64) -> R,
    ) -> Result<R> {
        self.slot(tile, |slot| {
            let first_id = slot.first_id;
            self.load(slot, |container| f(container, first_id))
        })?
    }

    /// One of the tiles that need the vertices of `tile` has them; the last one frees the slot.
    pub(super) fn finish(&self, tile: TileId) -> Result<()> {
        let left = self.slot(tile, |slot| {
            slot.readers -= 1;
            slot.readers
        })?;
        if left > 0 {
            return Ok(());
        }
        let Some(slot) = lock(&self.slots).remove(&tile) else { return Ok(()) };
        match std::mem::take(&mut lock(&slot).place) {
            SlotState::Held(container) => self.account(container.bytes(), 0),
            SlotState::Spilled(spilled) => self.spool.free(spilled.extent),
        }
        Ok(())
    }

    /// Forgets a tile whose container has been taken.
    pub(super) fn discard(&self, tile: TileId) {
        lock(&self.slots).remove(&tile);
    }

    /// Reserves `bytes` for a worker, counted until the result is dropped.
    pub(super) fn reserve(&self, bytes: u64, tile: TileId) -> Result<ReservedBytes<'_>> {
        // Counted before the relief, which then frees as much as is about to be taken; the guard exists
        // before it, too, so that a failed relief gives the bytes back.
        self.account(0, bytes);
        let reserved = ReservedBytes { store: self, bytes };
        self.relieve(tile)?;
        Ok(reserved)
    }

    /// Counts bytes that wait elsewhere (in the writer's queue) against the same limit.
    pub(super) fn account(&self, before: u64, after: u64) {
        if after >= before {
            self.resident.fetch_add(after - before, Ordering::Relaxed);
        } else {
            self.resident.fetch_sub(before - after, Ordering::Relaxed);
        }
    }

    /// Whether memory is below the limit.
    pub(super) fn has_room(&self) -> bool {
        self.resident.load(Ordering::Relaxed) <= self.limit
    }

    /// Bytes written to the spool so far.
    pub(super) fn spilled(&self) -> u64 {
        self.spool.written()
    }

    fn slot<R>(&self, tile: TileId, f: impl FnOnce(&mut ContainerSlot) -> R) -> Result<R> {
        let slot = {
            let mut slots = lock(&self.slots);
            Arc::clone(slots.entry(tile).or_insert_with(|| Arc::new(self.fresh(tile))))
        };
        // The guard ends with this statement. `relieve` locks other slots, and a thread that held one
        // while it waits for another could deadlock with its mirror image.
        let result = f(&mut lock(&slot));
        self.relieve(tile)?;
        Ok(result)
    }

    /// An empty slot; its readers are the tiles up to one row above and one column to the left.
    fn fresh(&self, tile: TileId) -> Mutex<ContainerSlot> {
        let readers = (1 + u32::from(tile.row > 0)) * (1 + u32::from(tile.col > 0));
        Mutex::new(ContainerSlot { readers, ..ContainerSlot::default() })
    }

    fn load<R>(
        &self,
        slot: &mut ContainerSlot,
        f: impl FnOnce(&mut TileContainer) -> R,
    ) -> Result<R> {
        // A failed read leaves an empty container. The run fails with it, so nothing of it is written.
        let mut container = match std::mem::take(&mut slot.place) {
            SlotState::Held(container) => container,
            SlotState::Spilled(spilled) => {
                let container = spilled.load(&self.spool)?;
                self.account(0, container.bytes());
                container
            }
        };
        let before = container.bytes();
        let result = f(&mut container);
        self.account(before, container.bytes());
        slot.place = SlotState::Held(container);
        Ok(result)
    }

    /// At the limit, spills containers until an eighth of it is free, starting with those that the sweep, now
    /// at `tile`, will need last: the ones it has just passed. Other callers wait meanwhile, as they would take
    /// the freed memory.
    fn relieve(&self, tile: TileId) -> Result<()> {
        if self.has_room() {
            return Ok(());
        }
        let _only = lock(&self.relief);
        // The thread that held the lock before has made room for those that waited.
        if self.has_room() {
            return Ok(());
        }
        let mut slots: Vec<_> = {
            // The map is copied and unlocked: containers are written for a while, and other workers need the
            // map to find theirs.
            let slots = lock(&self.slots);
            slots
                .iter()
                .map(|(&id, slot)| (self.until_used(id, tile), id, Arc::clone(slot)))
                .collect()
        };
        slots.sort_by_key(|&(distance, id, _)| std::cmp::Reverse((distance, id)));
        for (_, _, slot) in slots {
            if self.resident.load(Ordering::Relaxed) <= self.limit / 8 * 7 {
                break;
            }
            // A container in use stays: its worker would need it back at once.
            let Ok(mut slot) = slot.try_lock() else { continue };
            self.spill_slot(&mut slot)?;
        }
        Ok(())
    }

    fn spill_slot(&self, slot: &mut ContainerSlot) -> Result<()> {
        if let SlotState::Held(container) = &slot.place
            && container.bytes() > 0
        {
            let bytes = container.bytes();
            slot.place = SlotState::Spilled(container.spill(&self.spool)?);
            self.account(bytes, 0);
        }
        Ok(())
    }

    /// Columns the sweep has to go from `now` until it touches the column of `tile` again.
    fn until_used(&self, tile: TileId, now: TileId) -> u32 {
        /// Columns behind the sweep that are still worked on.
        const TAIL: u32 = 4;
        let cols = self.layout.cols;
        (tile.col + TAIL + cols - now.col) % cols
    }
}

/// Bytes in use by a worker.
pub(super) struct ReservedBytes<'a> {
    store: &'a ContainerStore,
    bytes: u64,
}

impl Drop for ReservedBytes<'_> {
    fn drop(&mut self) {
        self.store.account(self.bytes, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_tin::TilePosition;

    #[test]
    fn containers_survive_a_tiny_limit() {
        let folder = tempfile::tempdir().unwrap();
        let layout = TileLayout::new(161, 33, 16).unwrap();
        let store = ContainerStore::new(layout, 100, folder.path());
        let tiles: Vec<TileId> = (0..layout.tiles()).map(|i| layout.tile_at(i)).collect();
        for &tile in &tiles {
            let fill = |c: &mut TileContainer| {
                c.vertices.extend([TilePosition::new(tile.col, tile.row); 10]);
                c.heights.extend([f64::from(tile.col); 10]);
            };
            store.with(tile, fill).unwrap();
        }
        assert!(store.spilled() > 0 && store.resident.load(Ordering::Relaxed) <= 300);
        for &tile in tiles.iter().rev() {
            let same =
                |c: &mut TileContainer| c.vertices == [TilePosition::new(tile.col, tile.row); 10];
            assert!(store.with(tile, same).unwrap());
            assert_eq!(store.number(tile, 5).unwrap(), 15);
        }
        for &tile in &tiles {
            let readers = (1 + tile.col.min(1)) * (1 + tile.row.min(1));
            (0..readers).for_each(|_| store.finish(tile).unwrap());
        }
        assert_eq!(store.resident.load(Ordering::Relaxed), 0);
        assert!(lock(&store.slots).is_empty());
    }
}
