//! Sites in Morton order, one of each position: the order in which halves of halves lie together.

use super::parallel::ForkJoin;
use super::predicates::Site;
use super::window::SiteWindow;
use terrane_base::geom::Point;

/// A site on its way into order: the bits of x and y, interleaved, and where it came from.
#[derive(Clone, Copy, Debug, Default)]
struct MortonSite {
    key: u64,
    id: u32,
}

/// Sites in Morton order.
#[derive(Debug, Default)]
pub(super) struct MortonSites {
    /// Relative to the lowest x and y, hence not negative and below 2^30.
    pub(super) sites: Vec<Site>,
    /// The lowest x and y.
    pub(super) low: Site,
    /// Which point of the input each is.
    pub(super) ids: Vec<u32>,
    /// Points left out, each with the one at its position that stands for it.
    pub(super) duplicates: Vec<[u32; 2]>,
}

/// Bits of the first pass, which spreads the entries into buckets that fit into the cache.
const SPREAD: u32 = 11;

/// Fewer entries than this are sorted on one thread.
const FORK_LEAST: usize = 1 << 15;

/// Sorts the positions of points; of several at one position the lowest stands for all.
pub(super) fn order(points: &[Point], fork: &impl ForkJoin) -> MortonSites {
    let Some(window) = SiteWindow::of(points.iter().map(|p| [p.x, p.y])) else {
        return MortonSites::default();
    };
    let low = window.low;
    let last = window.high;
    let bits =
        64 - interleave((last[0] - low[0]) as u32, (last[1] - low[1]) as u32).leading_zeros();
    let entries = points.iter().enumerate().map(|(id, p)| {
        let key = interleave((p.x - low[0]) as u32, (p.y - low[1]) as u32);
        MortonSite { key, id: id as u32 }
    });
    let entries = sorted(entries, points.len(), bits, fork);
    let (sites, ids) = (Vec::with_capacity(points.len()), Vec::with_capacity(points.len()));
    let mut ordered = MortonSites { sites, low, ids, duplicates: vec![] };
    for same in entries.chunk_by(|a, b| a.key == b.key) {
        // The points themselves are far apart in memory, so they are looked at for duplicates only.
        let id = match same {
            [single] => single.id,
            _ => ordered.choose(points, same),
        };
        ordered.sites.push(site_of(same[0].key));
        ordered.ids.push(id);
    }
    ordered.duplicates.sort_unstable();
    ordered
}

impl MortonSites {
    /// Which of several entries at one position stands for all.
    fn choose(&mut self, points: &[Point], same: &[MortonSite]) -> u32 {
        let ids = same.iter().map(|entry| entry.id);
        let chosen = ids.clone().min_by_key(|&id| (points[id as usize], id)).unwrap_or_default();
        self.duplicates.extend(ids.filter(|&id| id != chosen).map(|id| [id, chosen]));
        chosen
    }
}

/// Entries sorted by key; those of equal keys in any order.
fn sorted(
    entries: impl Iterator<Item = MortonSite> + Clone,
    count: usize,
    bits: u32,
    fork: &impl ForkJoin,
) -> Vec<MortonSite> {
    let shift = bits.saturating_sub(SPREAD);
    let mut ends = vec![0usize; (1 << SPREAD) + 2];
    entries.clone().for_each(|entry| ends[(entry.key >> shift) as usize + 2] += 1);
    (2..ends.len()).for_each(|i| ends[i] += ends[i - 1]);
    let mut spread = vec![MortonSite::default(); count];
    for entry in entries {
        let end = &mut ends[(entry.key >> shift) as usize + 1];
        spread[*end] = entry;
        *end += 1;
    }
    ends.pop();
    sort_buckets(&mut spread, &ends, fork);
    spread
}

/// Sorts each bucket; bucket i is `ends[i]..ends[i + 1]` of the whole.
fn sort_buckets(entries: &mut [MortonSite], ends: &[usize], fork: &impl ForkJoin) {
    let base = ends[0];
    if ends.len() <= 2 || entries.len() < FORK_LEAST {
        for pair in ends.windows(2) {
            entries[pair[0] - base..pair[1] - base].sort_unstable_by_key(|entry| entry.key);
        }
        return;
    }
    let middle =
        ends.partition_point(|&end| end - base < entries.len() / 2).clamp(1, ends.len() - 2);
    let (left, right) = entries.split_at_mut(ends[middle] - base);
    fork.join(
        || sort_buckets(left, &ends[..=middle], fork),
        || sort_buckets(right, &ends[middle..], fork),
    );
}

/// The bits of x and y in turns, that of x first.
fn interleave(x: u32, y: u32) -> u64 {
    spread(x) << 1 | spread(y)
}

/// The bits of a number, each followed by a zero in front.
fn spread(v: u32) -> u64 {
    let mut v = u64::from(v);
    v = (v | v << 16) & 0x0000_FFFF_0000_FFFF;
    v = (v | v << 8) & 0x00FF_00FF_00FF_00FF;
    v = (v | v << 4) & 0x0F0F_0F0F_0F0F_0F0F;
    v = (v | v << 2) & 0x3333_3333_3333_3333;
    (v | v << 1) & 0x5555_5555_5555_5555
}

/// Undoes [`interleave`].
fn site_of(key: u64) -> Site {
    [gather(key >> 1) as i32, gather(key) as i32]
}

/// Undoes [`spread`], whatever the bits between are.
fn gather(v: u64) -> u32 {
    let mut v = v & 0x5555_5555_5555_5555;
    v = (v | v >> 1) & 0x3333_3333_3333_3333;
    v = (v | v >> 2) & 0x0F0F_0F0F_0F0F_0F0F;
    v = (v | v >> 4) & 0x00FF_00FF_00FF_00FF;
    v = (v | v >> 8) & 0x0000_FFFF_0000_FFFF;
    (v | v >> 16) as u32
}

#[cfg(test)]
mod tests {
    use super::super::oracle::Dice;
    use super::super::parallel::SerialJoin;
    use super::*;

    #[test]
    fn bits_take_turns() {
        assert_eq!(interleave(0b11, 0b00), 0b1010);
        assert_eq!(interleave(0b01, 0b11), 0b0111);
        for site in [[0, 0], [1, 2], [123_456_789, 987_654_321], [(1 << 30) - 1, 0]] {
            assert_eq!(site_of(interleave(site[0] as u32, site[1] as u32)), site);
        }
        assert_eq!(interleave((1 << 30) - 1, (1 << 30) - 1), (1 << 60) - 1);
    }

    /// So many that they are sorted in halves; in one set nearly all are in one of the first buckets.
    #[test]
    fn many_sites_come_in_order_wherever_they_lie() {
        let mut dice = Dice(8);
        for most in [1 << 29, 9_000, 300] {
            let mut point = || Point::new(dice.below(most), dice.below(most), 0);
            let mut points: Vec<_> = (0..40_000).map(|_| point()).collect();
            points.push(Point::new((1 << 29) - 1, (1 << 29) - 1, 0));
            let ordered = order(&points, &SerialJoin);
            let keys = ordered.sites.iter().map(|s| interleave(s[0] as u32, s[1] as u32));
            assert!(keys.clone().zip(keys.skip(1)).all(|(a, b)| a < b));
            let low = SiteWindow::of(points.iter().map(|p| [p.x, p.y])).unwrap().low;
            for (site, &id) in ordered.sites.iter().zip(&ordered.ids) {
                let p = points[id as usize];
                assert_eq!([p.x - low[0], p.y - low[1]], *site);
            }
        }
    }

    #[test]
    fn the_lowest_stands_for_all_at_a_position() {
        let mut dice = Dice(3);
        let mut point = || Point::new(dice.below(50) - 20, dice.below(40) - 50, dice.below(3));
        let points: Vec<_> = (0..5_000).map(|_| point()).collect();
        let ordered = order(&points, &SerialJoin);
        assert_eq!(ordered.ids.len() + ordered.duplicates.len(), points.len());
        let keys = ordered.sites.iter().map(|s| interleave(s[0] as u32, s[1] as u32));
        assert!(keys.clone().zip(keys.skip(1)).all(|(a, b)| a < b));
        for &[id, kept] in &ordered.duplicates {
            let (a, b) = (points[id as usize], points[kept as usize]);
            assert!([a.x, a.y] == [b.x, b.y] && (b, kept) < (a, id));
        }
    }
}
