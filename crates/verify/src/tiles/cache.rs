//! Cache of decoded tiles.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use terrane_base::error::Result;
use terrane_files::lock;
use terrane_proof::tiles::ProofTileId;

/// Values by tile. Once half of the bytes are filled, entries unused since the last time go first.
pub(super) struct TileCache<T> {
    half: usize,
    kept: Mutex<CachedTiles<T>>,
}

struct CachedTiles<T> {
    young: HashMap<ProofTileId, (Arc<T>, usize)>,
    old: HashMap<ProofTileId, (Arc<T>, usize)>,
    bytes: usize,
}

impl<T> TileCache<T> {
    /// One of about so many bytes.
    pub(super) fn new(bytes: u64) -> Self {
        let half = usize::try_from(bytes / 2).unwrap_or(usize::MAX);
        let kept = CachedTiles { young: HashMap::new(), old: HashMap::new(), bytes: 0 };
        Self { half, kept: Mutex::new(kept) }
    }

    /// The cached value of a tile, or else the result of `make`, with its bytes.
    pub(super) fn get(
        &self,
        id: ProofTileId,
        make: impl FnOnce() -> Result<(T, usize)>,
    ) -> Result<Arc<T>> {
        if let Some(found) = lock(&self.kept).find(id, self.half) {
            return Ok(found);
        }
        // Another thread may make the same meanwhile, which costs less than to wait.
        let (made, bytes) = make()?;
        let made = Arc::new(made);
        lock(&self.kept).put(id, (Arc::clone(&made), bytes), self.half);
        Ok(made)
    }
}

impl<T> CachedTiles<T> {
    fn find(&mut self, id: ProofTileId, half: usize) -> Option<Arc<T>> {
        if let Some((found, _)) = self.young.get(&id) {
            return Some(Arc::clone(found));
        }
        let found = self.old.remove(&id)?;
        let shared = Arc::clone(&found.0);
        self.put(id, found, half);
        Some(shared)
    }

    fn put(&mut self, id: ProofTileId, made: (Arc<T>, usize), half: usize) {
        if self.bytes + made.1 > half {
            self.old = std::mem::take(&mut self.young);
            self.bytes = 0;
        }
        self.bytes += made.1;
        if let Some((_, before)) = self.young.insert(id, made) {
            self.bytes -= before;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_stays_and_bytes_are_bounded() {
        let cache = TileCache::new(100);
        let id = |x| ProofTileId { level: 5, y: 0, x };
        let made = Mutex::new(0);
        let get = |x: u32| {
            let make = || {
                *lock(&made) += 1;
                Ok((x, 10))
            };
            *cache.get(id(x), make).unwrap()
        };
        for x in 0..100 {
            assert_eq!((get(0), get(x)), (0, x));
        }
        assert_eq!(*lock(&made), 100, "the one that is asked for all the time is made once");
        let kept = lock(&cache.kept);
        assert!(kept.young.len() + kept.old.len() <= 10);
    }
}
