//! Tests of the block cache.

use std::sync::atomic::AtomicUsize;

use super::*;
use proptest::prelude::*;

/// Bytes of a block.
const BYTES: usize = 10;

fn bytes() -> DecodeBytes {
    DecodeBytes { block: BYTES, beside: 0 }
}

/// A cache of `blocks` blocks in memory.
fn cache_of(blocks: usize) -> BlockCache {
    BlockCache::new(blocks * BYTES, None)
}

/// The content of block `number`.
fn filled(number: u64, out: &mut [u8]) -> Result<()> {
    out.iter_mut().zip(0..).for_each(|(byte, i)| *byte = (number * 31 + i) as u8);
    Ok(())
}

fn content(block: &CachedBlock) -> Vec<u8> {
    let mut bytes = Vec::new();
    let run = RowRun { offset: 0, pitch: 5, bytes: 5, rows: 2 };
    block.each_row(run, |_, row| bytes.extend_from_slice(row)).unwrap();
    bytes
}

/// Reads a block, checks it, and returns true if it was decoded.
fn is_decoded(cache: &BlockCache, number: u64) -> bool {
    let mut is_decoded = false;
    let block = cache.get((0, number), bytes(), true, |out| {
        is_decoded = true;
        assert_eq!(out.len(), BYTES);
        filled(number, out)
    });
    let mut expected = [0; BYTES];
    filled(number, &mut expected).unwrap();
    assert_eq!(content(&block.unwrap().unwrap()), expected);
    lock(&cache.state).validate(0);
    is_decoded
}

#[test]
fn blocks_beyond_the_memory_are_in_the_file() {
    let cache = cache_of(2);
    assert!((0..20).all(|number| is_decoded(&cache, number)));
    assert!(lock(&cache.state).bytes <= 2 * BYTES);
    assert!(!(0..20).any(|number| is_decoded(&cache, number)));
    let block = cache.get((0, 3), bytes(), true, |_| panic!("is in the file")).unwrap().unwrap();
    let mut rows = Vec::new();
    let run = RowRun { offset: 2, pitch: 4, bytes: 1, rows: 2 };
    block.each_row(run, |row, bytes| rows.push((row, bytes.to_vec()))).unwrap();
    assert_eq!(rows, [(0, vec![95]), (1, vec![99])]);
}

#[test]
fn a_file_that_cannot_be_written_is_an_error() {
    let cache = BlockCache::new(2 * BYTES, Some(Path::new("/no/such/folder")));
    assert!(is_decoded(&cache, 1) && is_decoded(&cache, 2) && !is_decoded(&cache, 1));
    let get = |number| cache.get((0, number), bytes(), true, |out| filled(number, out));
    let error = get(3).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::CannotWrite);
    assert!(error.to_string().contains("/no/such/folder"), "{error}");
    lock(&cache.state).validate(0);
}

#[test]
fn no_more_is_decoded_at_once_than_fits() {
    for (room, together) in [(1, 1), (2, 1), (3, 1), (6, 2), (8, 2), (9, 3)] {
        let cache = cache_of(room);
        let [now, most] = [0, 0].map(AtomicUsize::new);
        std::thread::scope(|scope| {
            for number in 0..8 {
                let (cache, now, most) = (&cache, &now, &most);
                scope.spawn(move || {
                    let bytes = DecodeBytes { block: BYTES, beside: 2 * BYTES };
                    let decode = |out: &mut Vec<u8>| {
                        most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        std::thread::sleep(std::time::Duration::from_millis(5));
                        now.fetch_sub(1, Ordering::SeqCst);
                        filled(number, out)
                    };
                    cache.get((0, number), bytes, true, decode).unwrap();
                });
            }
        });
        assert!(most.into_inner() <= together, "{room}");
        lock(&cache.state).validate(0);
    }
}

#[test]
fn a_block_is_dropped_once_all_its_samples_are_released() {
    let cache = cache_of(2);
    (0..4).for_each(|number| assert!(is_decoded(&cache, number)));
    for number in 0..4 {
        cache.release((0, number), 60, 100);
        assert!(!is_decoded(&cache, number));
        cache.release((0, number), 40, 100);
    }
    let state = lock(&cache.state);
    state.validate(0);
    assert_eq!(state.lookups(), [0, 0]);
    drop(state);
    assert!(is_decoded(&cache, 1));
    cache.release((0, 77), 1, 1);
}

#[test]
fn blocks_larger_than_the_cache_are_handed_out_but_not_kept() {
    let cache = BlockCache::new(5, None);
    assert!(is_decoded(&cache, 1) && is_decoded(&cache, 1));
    let state = lock(&cache.state);
    assert_eq!((state.bytes, state.lookups()), (0, [0, 0]));
}

#[test]
fn a_failed_or_panicking_decode_leaves_the_block_to_others() {
    let cache = cache_of(10);
    let bad = |_: &mut Vec<u8>| Err(Error::bad_input("no"));
    assert!(cache.get((0, 1), bytes(), true, bad).is_err());
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _ = cache.get((0, 1), bytes(), true, |_| panic!("bug"));
    }));
    assert!(panicked.is_err());
    assert!(is_decoded(&cache, 1));
}

#[test]
fn a_thread_that_waits_is_woken_when_the_decode_fails() {
    let cache = cache_of(10);
    std::thread::scope(|scope| {
        let (started, begun) = std::sync::mpsc::channel();
        let (end, ending) = std::sync::mpsc::channel::<()>();
        let cache = &cache;
        scope.spawn(move || {
            let failed = cache.get((0, 1), bytes(), true, |_| {
                started.send(()).unwrap();
                ending.recv().unwrap();
                Err(Error::bad_input("no"))
            });
            assert!(failed.is_err());
        });
        begun.recv().unwrap();
        assert!(cache.get((0, 1), bytes(), false, |_| panic!("is claimed")).unwrap().is_none());
        let waiting = scope.spawn(|| is_decoded(cache, 1));
        end.send(()).unwrap();
        assert!(waiting.join().unwrap());
    });
}

#[test]
fn many_threads_decode_each_block_once_in_any_memory() {
    for blocks in [1, 3, 1000] {
        let cache = cache_of(blocks);
        let decoded = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for thread in 0..8 {
                let (cache, decoded) = (&cache, &decoded);
                scope.spawn(move || {
                    for number in (0..50).map(|number| (number * 7 + thread) % 50) {
                        let block = cache.get((0, number), bytes(), true, |out| {
                            decoded.fetch_add(1, Ordering::Relaxed);
                            std::thread::yield_now();
                            filled(number, out)
                        });
                        let mut expected = [0; BYTES];
                        filled(number, &mut expected).unwrap();
                        assert_eq!(content(&block.unwrap().unwrap()), expected);
                    }
                });
            }
        });
        assert_eq!(decoded.into_inner(), 50, "{blocks} blocks in memory");
        lock(&cache.state).validate(0);
    }
}

#[test]
fn buffers_are_used_again() {
    let cache = cache_of(3);
    let buffer = |number| match cache.get((0, number), bytes(), true, |out| filled(number, out)) {
        Ok(Some(CachedBlock::Held(block))) => block.as_ptr(),
        other => panic!("{other:?}"),
    };
    let first: Vec<_> = (0..3).map(buffer).collect();
    let second: Vec<_> = (3..6).map(buffer).collect();
    assert_eq!(first, second);
    cache.release((0, 4), 1, 1);
    assert_eq!(buffer(6), first[1]);
}

proptest! {
    /// Beside a map of the blocks that are not released.
    #[test]
    fn reads_and_releases_in_any_order(
        blocks in 1_usize..5,
        steps in prop::collection::vec((0_u64..8, 0_u64..3), 1..60),
    ) {
        let cache = cache_of(blocks);
        let mut kept = std::collections::HashMap::new();
        for (number, released) in steps {
            if released == 0 {
                prop_assert_eq!(is_decoded(&cache, number), !kept.contains_key(&number));
                kept.entry(number).or_insert(());
            } else {
                cache.release((0, number), released, 2);
                let left = lock(&cache.state).is_partly_released((0, number));
                if !left {
                    kept.remove(&number);
                }
            }
            lock(&cache.state).validate(0);
        }
    }
}
