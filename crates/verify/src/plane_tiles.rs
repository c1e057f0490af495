//! Division of a plane without blocks into square tiles, and subdivision of tiles with too many records.

use super::work::ProofResources;
use terrane_base::error::Result;
use terrane_files::Buckets;
use terrane_proof::{DomainLayout, GridDomain};

/// Target number of points or triangles in a domain, so that its data fits into the processor's
/// cache.
const DOMAIN_RECORDS: u64 = 1 << 15;
/// Maximum number of domains.
const MAX_DOMAINS: u64 = 1 << 16;
/// Minimum number of domains for each thread.
pub(super) const DOMAINS_PER_THREAD: u64 = 4;
/// Bytes of index for a run of records.
const RUN_BYTES: u64 = 16;
/// Halvings of a domain with too many records.
const HALVINGS: u32 = 4;

/// The number of domains for so many points or triangles, which need `bytes` in all: few enough for a small index, but
/// so many that one of average density takes half of a thread's memory. Each flush leaves a run in every domain at
/// worst.
pub(super) fn domain_count(
    work: &ProofResources<'_>,
    records: u64,
    bytes: u64,
    flushes: u64,
) -> u64 {
    let count = (records / DOMAIN_RECORDS)
        .max(bytes / (work.share / 2))
        .max(DOMAINS_PER_THREAD * work.threads as u64);
    let indexed = work.share / 8 / RUN_BYTES / flushes;
    count.min(indexed).clamp(1, MAX_DOMAINS)
}

/// About `count` square tiles, but no more than [`MAX_DOMAINS`].
pub(super) fn divide(grid: [u32; 2], count: u64) -> DomainLayout {
    let area = u64::from(grid[0]) * u64::from(grid[1]);
    let mut side = (area / count).isqrt();
    loop {
        let size = side
            .next_multiple_of(u64::from(GridDomain::UNIT))
            .clamp(u64::from(GridDomain::UNIT), 1 << 30);
        let layout = DomainLayout { grid, size: [size as u32; 2] };
        if layout.len() <= MAX_DOMAINS {
            return layout;
        }
        side = size + size.div_ceil(8);
    }
}

/// The records of a domain by piece.
pub(super) fn respread<T: bytemuck::Pod>(
    work: &ProofResources<'_>,
    buckets: &Buckets<T>,
    number: usize,
    pieces: &[GridDomain],
    belongs: impl Fn(&GridDomain, &T) -> bool,
) -> Result<Buckets<T>> {
    let pieces_of_domain = Buckets::new(&work.folder, pieces.len(), work.share / 4);
    let mut writer = pieces_of_domain.writer();
    buckets.try_read(number, |records| {
        records.iter().try_for_each(|record| {
            let mut all = (0..).zip(pieces).filter(|(_, piece)| belongs(piece, record));
            all.try_for_each(|(piece, _)| writer.push(piece, *record))
        })
    })?;
    writer.finish()?;
    pieces_of_domain.settle()?;
    Ok(pieces_of_domain)
}

/// All records of a domain.
pub(super) fn load<T: bytemuck::Pod>(buckets: &Buckets<T>, number: usize) -> Result<Vec<T>> {
    let mut all = Vec::with_capacity(buckets.len(number) as usize);
    buckets.read(number, |records| all.extend_from_slice(records))?;
    Ok(all)
}

/// A domain halved up to [`HALVINGS`] times.
pub(super) fn pieces(domain: GridDomain) -> Vec<GridDomain> {
    (0..HALVINGS).fold(vec![domain], |pieces, _| {
        pieces.into_iter().flat_map(|d| d.halves().map_or(vec![d], Vec::from)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Rect;

    #[test]
    fn any_extent_is_divided_into_about_as_many_domains_as_wanted() {
        for (grid, wanted) in [
            ([1 << 30, 1 << 30], 1000),
            ([1 << 30, 1], 1 << 16),
            ([1, 1], 1),
            ([7, 5], 1 << 16),
            ([40_000, 300], 500),
        ] {
            let layout = divide(grid, wanted);
            assert!(layout.len() <= MAX_DOMAINS, "{layout:?}");
            let fits = layout.size[0] == GridDomain::UNIT || layout.len() >= wanted / 2;
            assert!(fits || layout.size[0] > 1 << 10, "{layout:?}");
            let last = layout.domain(layout.len() - 1);
            assert_eq!([last.rect.end_col(), last.rect.end_row()], grid);
        }
    }

    #[test]
    fn pieces_tile_their_domain() {
        let domain = GridDomain { grid: [500, 300], rect: Rect::new(0, 0, 500, 300) };
        let all = pieces(domain);
        assert_eq!(all.len(), 16);
        assert_eq!(all.iter().map(|d| d.rect.len()).sum::<usize>(), 150_000);
        let unit = GridDomain { grid: [500, 300], rect: Rect::new(32, 32, 32, 32) };
        assert_eq!(pieces(unit), [unit]);
    }
}
