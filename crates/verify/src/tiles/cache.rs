//! Cache of decoded tiles.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use terrane_base::error::Result;
use terrane_files::lock;
use terrane_proof::tiles::ProofTileId;

/// Values by tile, in two generations: when the young one fills half of the bytes, it becomes the old one, and entries
/// unused since are dropped.
pub(super) struct TileCache<T> {
    /// Bytes of a generation.
    max_bytes: usize,
    cached: Mutex<CachedTiles<T>>,
}

struct CachedTiles<T> {
    young: HashMap<ProofTileId, (Arc<T>, usize)>,
    old: HashMap<ProofTileId, (Arc<T>, usize)>,
    bytes: usize,
}

impl<T> TileCache<T> {
    /// A cache of about `bytes` bytes.
    pub(super) fn new(bytes: u64) -> Self {
        let max_bytes = usize::try_from(bytes / 2).unwrap_or(usize::MAX);
        let cached = CachedTiles { young: HashMap::new(), old: HashMap::new(), bytes: 0 };
        Self { max_bytes, cached: Mutex::new(cached) }
    }

    /// The cached value of a tile, or else the result of `make`, with its bytes.
    pub(super) fn get(
        &self,
        id: ProofTileId,
        make: impl FnOnce() -> Result<(T, usize)>,
    ) -> Result<Arc<T>> {
        if let Some(found) = lock(&self.cached).find(id, self.max_bytes) {
            return Ok(found);
        }
        // Another thread may make the same meanwhile, which costs less than to wait.
        let (made, bytes) = make()?;
        let made = Arc::new(made);
        lock(&self.cached).put(id, (Arc::clone(&made), bytes), self.max_bytes);
        Ok(made)
    }
}

impl<T> CachedTiles<T> {
    fn find(&mut self, id: ProofTileId, max_bytes: usize) -> Option<Arc<T>> {
        if let Some((found, _)) = self.young.get(&id) {
            return Some(Arc::clone(found));
        }
        let found = self.old.remove(&id)?;
        let shared = Arc::clone(&found.0);
        self.put(id, found, max_bytes);
        Some(shared)
    }

    fn put(&mut self, id: ProofTileId, made: (Arc<T>, usize), max_bytes: usize) {
        if self.bytes + made.1 > max_bytes {
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
    fn recently_used_tiles_stay_and_bytes_are_bounded() {
        let cache = TileCache::new(100);
        let mut made = 0;
        for x in (0..100).flat_map(|x| [0, x]) {
            let make = || {
                made += 1;
                Ok((x, 10))
            };
            assert_eq!(*cache.get(ProofTileId { level: 5, y: 0, x }, make).unwrap(), x);
        }
        assert_eq!(made, 100, "a tile that is always in use is made once");
        let cached = lock(&cache.cached);
        assert!(cached.young.len() + cached.old.len() <= 10);
    }
}
