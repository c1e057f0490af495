//! The core of the job: any grid source in, any mesh sink out, under given settings.

use std::sync::Mutex;
use std::sync::atomic::AtomicU64;

use crossbeam_channel::{Receiver, bounded};

use super::artifact::ArtifactWriter;
use super::counters::{MeshFlaws, SampleCounts};
use super::kernel::PipelineKernel;
use super::layout::{TileId, TileLayout};
use super::report::{PipelineStage, StageClock, StageReport};
use super::schedule::TaskQueue;
use super::settings::TinSettings;
use super::store::ContainerStore;
use super::task_scope::{LayoutWork, RunScope};
use super::worker::{ContainerSource, SharedTinState, TilePartOutlet, TinWorker};
use super::writer::{ContainerSaver, MeshTotals, OrderedMeshWriter, TilePart, TilePartSink};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::workers::spawn;
use terrane_files::{lock, unlocked};
use terrane_mesh::MeshSink;
use terrane_raster::GridSource;

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TinOutcome {
    /// Vertices written.
    pub vertices: u64,
    /// Triangles written.
    pub triangles: u64,
    /// Valid samples.
    pub valid: u64,
    /// Valid samples without a valid cell.
    pub isolated: u64,
    /// Samples to keep that are vertices.
    pub kept: u64,
    /// Triangles below the minimum angle.
    pub thin: MeshFlaws,
    /// Vertices on breaklines without an edge along them.
    pub apart: MeshFlaws,
    /// Samples that look like undeclared nodata: the stored value, and their number.
    pub suspects: Option<(f64, u64)>,
    /// The lowest and highest height of windows with heights outside the usual range of land.
    pub odd_range: Option<[f64; 2]>,
    /// Largest error of any sample (0 unless measured).
    pub max_error: f64,
    /// Sum of squared errors of all samples on the surface (0 unless measured).
    pub square_sum: f64,
    /// Size of the output.
    pub output_bytes: u64,
    /// Bytes written to the spill file.
    pub spilled_bytes: u64,
    /// Time by stage.
    pub stages: Vec<StageReport>,
}

/// Triangulates all of `source` into `sink`.
///
/// The sequence of vertices and triangles depends on the samples, the transform, `spec` and `tile`
/// only: not on threads, memory or the order of work. Fails with `BadInput` when there is no cell
/// with four valid samples, with the error of the source or the sink, and with `Interrupted`; then
/// the sink is dropped unfinished. Time is linear in the samples plus the kernel's; memory is
/// `mesh_bytes` and the workers' buffers.
pub fn run_on(
    source: &dyn GridSource,
    sink: Box<dyn MeshSink>,
    settings: &TinSettings<'_>,
) -> Result<TinOutcome> {
    run_with(source, sink, settings, PipelineKernel::GREEDY)
}

/// As [`run_on`], with another kernel.
pub(super) fn run_with(
    source: &dyn GridSource,
    sink: Box<dyn MeshSink>,
    settings: &TinSettings<'_>,
    kernel: PipelineKernel,
) -> Result<TinOutcome> {
    let work = LayoutWork { layout: layout(source, settings)?, scope: RunScope::Whole };
    let shared = SharedTinState::new(source, settings, kernel, work, None, sink.wants_corners());
    write_mesh(shared, sink)
}

/// Writes the mesh from the containers in `saved_tiles`, all seams mended; `tally` has their counts.
pub(super) fn write(
    source: &dyn GridSource,
    saved_tiles: &dyn ContainerSource,
    tally: SampleCounts,
    sink: Box<dyn MeshSink>,
    settings: &TinSettings<'_>,
) -> Result<TinOutcome> {
    let work = LayoutWork { layout: layout(source, settings)?, scope: RunScope::Write };
    let shared = SharedTinState::new(
        source,
        settings,
        PipelineKernel::GREEDY,
        work,
        Some(saved_tiles),
        sink.wants_corners(),
    );
    lock(&shared.tally).add(tally);
    write_mesh(shared, sink)
}

/// Carries out one unit of the work and puts the containers into `object`; tiles come from `saved_tiles` where the
/// scope says so. Returns the object, the time spent, and the bytes spilled.
pub(super) fn save(
    source: &dyn GridSource,
    scope: RunScope,
    saved_tiles: Option<&dyn ContainerSource>,
    object: ArtifactWriter,
    settings: &TinSettings<'_>,
) -> Result<SaveOutcome> {
    let work = LayoutWork { layout: layout(source, settings)?, scope };
    let shared =
        SharedTinState::new(source, settings, PipelineKernel::GREEDY, work, saved_tiles, false);
    let saver = Mutex::new(ContainerSaver::new(work, object));
    let clock = drive(&shared, &saver);
    shared.queue.into_result()?;
    let saver = unlocked(saver);
    Ok(SaveOutcome {
        object: saver.into_object(),
        tally: unlocked(shared.tally),
        clock,
        spilled_bytes: shared.store.spilled(),
    })
}

/// What [`save`] did.
pub(super) struct SaveOutcome {
    pub(super) object: ArtifactWriter,
    pub(super) tally: SampleCounts,
    pub(super) clock: StageClock,
    pub(super) spilled_bytes: u64,
}

fn layout(source: &dyn GridSource, settings: &TinSettings<'_>) -> Result<TileLayout> {
    TileLayout::new(source.info().width, source.info().height, settings.tile)
}

impl<'a> SharedTinState<'a> {
    fn new(
        source: &'a dyn GridSource,
        settings: &'a TinSettings<'a>,
        kernel: PipelineKernel,
        work: LayoutWork,
        saved_tiles: Option<&'a dyn ContainerSource>,
        with_corners: bool,
    ) -> Self {
        let layout = work.layout;
        Self {
            source,
            settings,
            kernel,
            layout,
            saved_tiles,
            store: ContainerStore::new(layout, settings.mesh_bytes, settings.temp_dir),
            queue: TaskQueue::new(work, settings.threads.max(1), settings.order_seed),
            next_id: AtomicU64::new(0),
            tally: Mutex::default(),
            with_corners,
        }
    }
}

/// Carries out all tasks; sends their results to `collector`.
fn drive(shared: &SharedTinState<'_>, collector: &Mutex<dyn TilePartSink + '_>) -> StageClock {
    if threads_for(shared) > 1 {
        run_threads(shared, collector)
    } else {
        TinWorker::new(shared, TilePartOutlet { collector, writer: None }).run()
    }
}

/// Threads that have something to do.
fn threads_for(shared: &SharedTinState<'_>) -> usize {
    let tiles = usize::try_from(shared.layout.tiles()).unwrap_or(usize::MAX);
    shared.settings.threads.min(tiles)
}

fn write_mesh(shared: SharedTinState<'_>, sink: Box<dyn MeshSink>) -> Result<TinOutcome> {
    let writer = Mutex::new(OrderedMeshWriter::new(shared.layout, sink));
    let clock = drive(&shared, &writer);
    conclude(shared, unlocked(writer), clock)
}

/// Parts that may wait for the writer, by worker.
const WAITING_PARTS: usize = 4;

fn run_threads(
    shared: &SharedTinState<'_>,
    collector: &Mutex<dyn TilePartSink + '_>,
) -> StageClock {
    let threads = threads_for(shared);
    std::thread::scope(|scope| {
        let (sender, receiver) = bounded(WAITING_PARTS * threads);
        let writing = spawn(scope, move || write_parts(shared, collector, &receiver));
        // Without a thread for the writer, this thread does all the work.
        let Some(writing) = writing else {
            return TinWorker::new(shared, TilePartOutlet { collector, writer: None }).run();
        };
        let others = (1..threads).map_while(|_| {
            let outlet = TilePartOutlet { collector, writer: Some(sender.clone()) };
            spawn(scope, move || TinWorker::new(shared, outlet).run())
        });
        let others: Vec<_> = others.collect();
        // The last sender moves into this thread's worker. The writer's loop ends only when no sender is
        // left, so one kept here would make the join below wait for ever.
        let outlet = TilePartOutlet { collector, writer: Some(sender) };
        let mut clock = TinWorker::new(shared, outlet).run();
        for other in others {
            match other.join() {
                Ok(theirs) => clock.merge(&theirs),
                Err(_) => shared.queue.fail(Error::new(ErrorKind::Internal, "a worker failed")),
            }
        }
        if writing.join().is_err() {
            shared.queue.fail(Error::new(ErrorKind::Internal, "the writer thread failed"));
        }
        clock
    })
}

/// The writer thread: writes parts until all workers have left or writing fails.
fn write_parts(
    shared: &SharedTinState<'_>,
    collector: &Mutex<dyn TilePartSink + '_>,
    parts: &Receiver<(TileId, TilePart)>,
) {
    for (tile, part) in parts {
        match lock(collector).accept(tile, part) {
            Ok(written) => shared.store.account(written, 0),
            // The failure is noted before the receiver is dropped. Workers then fail with "the writer has
            // stopped" instead of blocking on a full channel, and the queue keeps the first error.
            Err(error) => return shared.queue.fail(error),
        }
    }
}

fn conclude(
    shared: SharedTinState<'_>,
    writer: OrderedMeshWriter,
    mut clock: StageClock,
) -> Result<TinOutcome> {
    let (totals, writing) = writer.totals();
    let tolerance = shared.settings.spec.tolerance;
    let SampleCounts { valid, isolated, suspects, odd_range, kept, thin, apart } =
        unlocked(shared.tally);
    shared.queue.into_result()?;
    check_surface(valid, totals)?;
    clock.add_time(PipelineStage::Write, writing);
    Ok(TinOutcome {
        vertices: totals.vertices,
        triangles: totals.triangles,
        valid,
        isolated,
        kept,
        thin,
        apart,
        suspects,
        odd_range,
        // It was rounded up, and all samples are known to be within.
        max_error: f64::from(totals.max_error).min(tolerance),
        square_sum: totals.square_sum,
        spilled_bytes: shared.store.spilled(),
        output_bytes: writer.finish()?,
        stages: clock.report(),
    })
}

/// Fails when there is nothing to write.
fn check_surface(valid: u64, totals: MeshTotals) -> Result<()> {
    if valid == 0 {
        return Err(Error::bad_input("the grid has no valid sample")
            .remedy("check its nodata value, or choose another ‹band›"));
    }
    if totals.triangles == 0 {
        return Err(Error::bad_input("the grid has no cell with four valid samples")
            .remedy("fill its voids, check its nodata value, or clip it to larger polygons"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tin::container::TileContainer;
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};
    use terrane_base::bound::ErrorBound;
    use terrane_base::geom::Rect;
    use terrane_engine::constraints::GridConstraints;
    use terrane_engine::{Cancel, Silent};
    use terrane_mesh::MeshBatch;
    use terrane_raster::{GridInfo, SampleType};
    use terrane_tin::{PatchInput, PatchMesh, TileInput, TileMesh, TileScratch, triangulate_tile};
    use terrane_tin::{TilePosition, TileTriangle, TinSpec, mend_patch};

    /// A saddle, optionally with a fault.
    struct Saddle {
        info: GridInfo,
        broken_row: Option<u32>,
    }

    impl Saddle {
        fn new(side: u32) -> Self {
            let info = GridInfo {
                block: (64, 64),
                ..GridInfo::plain("test", side, side, SampleType::F32)
            };
            Self { info, broken_row: None }
        }
    }

    impl GridSource for Saddle {
        fn info(&self) -> &GridInfo {
            &self.info
        }

        fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
            if self.broken_row.is_some_and(|row| rect.contains(rect.col, row)) {
                return Err(Error::bad_input("block is damaged"));
            }
            for (i, out) in (0..).zip(out) {
                let (col, row) = (rect.col + i % rect.width, rect.row + i / rect.width);
                *out = ((col * row) % 97) as f32;
            }
            Ok(())
        }

        fn read_f64(&self, _: Rect, _: &mut [f64]) -> Result<()> {
            Err(Error::unsupported("f64"))
        }
    }

    struct Drain;

    impl MeshSink for Drain {
        fn push(&mut self, _: MeshBatch<'_>) -> Result<()> {
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<u64> {
            Ok(0)
        }
    }

    fn settings(cancel: &Cancel, threads: usize) -> TinSettings<'_> {
        TinSettings {
            spec: TinSpec {
                tolerance: 5.0,
                bound: ErrorBound::Samples,
                strict: false,
                drop: true,
                fit_heights: false,
                data_dependent: false,
                min_angle: None,
                single_precision: None,
                measure: false,
            },
            tile: 64,
            constraints: GridConstraints::NONE,
            threads,
            mesh_bytes: 1 << 20,
            temp_dir: Path::new("."),
            order_seed: None,
            progress: &Silent,
            cancel,
        }
    }

    fn run(source: &Saddle, threads: usize, kernel: PipelineKernel) -> Result<TinOutcome> {
        let cancel = Cancel::default();
        run_with(source, Box::new(Drain), &settings(&cancel, threads), kernel)
    }

    fn faulty_tile(input: &TileInput<'_>, spec: &TinSpec, scratch: &mut TileScratch) -> TileMesh {
        assert!(input.apron_left + input.apron_above > 0, "planted fault");
        triangulate_tile(input, spec, scratch)
    }

    fn faulty_patch(_: &PatchInput<'_>, _: &TinSpec, _: &mut TileScratch) -> PatchMesh {
        panic!("planted fault {}", 7);
    }

    #[test]
    fn a_panic_becomes_an_error_that_names_the_tile() {
        let source = Saddle::new(257);
        for threads in [1, 3] {
            let kernel = PipelineKernel { tile: faulty_tile, ..PipelineKernel::GREEDY };
            let error = run(&source, threads, kernel).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Internal);
            assert!(error.to_string().starts_with("tile 0,0: a worker failed: planted fault"));
            let kernel = PipelineKernel { patch: faulty_patch, ..PipelineKernel::GREEDY };
            let error = run(&source, threads, kernel).unwrap_err().to_string();
            assert!(error.contains("seam of tile") && error.contains("planted fault 7"), "{error}");
        }
    }

    fn is_corner(input: &PatchInput<'_>) -> bool {
        input.seam_col.is_some() && input.seam_row.is_some()
    }

    /// Largest height of a patch around a corner.
    static TALLEST: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

    fn measured(
        of: usize,
        input: &PatchInput<'_>,
        spec: &TinSpec,
        scratch: &mut TileScratch,
    ) -> PatchMesh {
        if is_corner(input) {
            TALLEST[of].fetch_max(input.heights.height, Ordering::Relaxed);
        }
        mend_patch(input, spec, scratch)
    }

    /// Leaves something to mend at the first row of all patches along rows.
    fn leaving(input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch) -> PatchMesh {
        let is_row = input.seam_row.is_some() && !is_corner(input);
        let left = if is_row { vec![TilePosition::new(0, 0)] } else { Vec::new() };
        PatchMesh { left, ..measured(1, input, spec, scratch) }
    }

    #[test]
    fn what_is_left_between_samples_beside_a_seam_is_taken_up_around_the_corners() {
        let source = Saddle::new(257);
        let usual = |input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch| {
            measured(0, input, spec, scratch)
        };
        run(&source, 1, PipelineKernel { patch: usual, ..PipelineKernel::GREEDY }).unwrap();
        run(&source, 1, PipelineKernel { patch: leaving, ..PipelineKernel::GREEDY }).unwrap();
        let [usual, leaving] = [0, 1].map(|i| TALLEST[i].load(Ordering::Relaxed));
        assert!(leaving > usual, "{leaving} rows against {usual}");
    }

    #[test]
    fn what_no_patch_around_a_corner_can_mend_between_samples_is_an_error() {
        let stuck = |input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch| {
            let left = if is_corner(input) { vec![TilePosition::new(0, 0)] } else { Vec::new() };
            PatchMesh { left, ..mend_patch(input, spec, scratch) }
        };
        let kernel = PipelineKernel { patch: stuck, ..PipelineKernel::GREEDY };
        let error = run(&Saddle::new(257), 1, kernel).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Internal);
        assert!(error.to_string().contains("cannot be kept within the tolerance"), "{error}");
        let narrow = |input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch| {
            let is_left = is_corner(input) && input.heights.width < 55;
            let left = if is_left { vec![TilePosition::new(0, 0)] } else { Vec::new() };
            PatchMesh { left, ..mend_patch(input, spec, scratch) }
        };
        run(&Saddle::new(257), 1, PipelineKernel { patch: narrow, ..PipelineKernel::GREEDY })
            .unwrap();
    }

    /// Two triangles for every tile of a flat land.
    struct Flat(TileLayout);

    impl ContainerSource for Flat {
        fn load(&self, tile: TileId) -> Result<TileContainer> {
            let (rect, owned) = (self.0.rect(tile), self.0.owned(tile));
            let (right, below) = (rect.width - 1, rect.height - 1);
            let corners = [(0, 0), (right, 0), (0, below), (right, below)];
            let at = corners.map(|(col, row)| TilePosition::new(col, row));
            let triangle = |corners| TileTriangle { corners, max_error: 0.0, square_sum: 0.0 };
            let mut kept = TileContainer::default();
            kept.triangles = vec![triangle([at[0], at[3], at[2]]), triangle([at[0], at[1], at[3]])];
            let is_own = |at: &TilePosition| at.col() < owned.width && at.row() < owned.height;
            kept.vertices = at.into_iter().filter(is_own).collect();
            kept.heights = vec![0.0; kept.vertices.len()];
            kept.close();
            Ok(kept)
        }
    }

    fn write_flat(side: u32, tile: u32) -> TinOutcome {
        let source = Saddle::new(side);
        let cancel = Cancel::default();
        let settings = TinSettings { tile, ..settings(&cancel, 2) };
        let layout = layout(&source, &settings).unwrap();
        let tally = SampleCounts { valid: layout.samples(), ..SampleCounts::default() };
        write(&source, &Flat(layout), tally, Box::new(Drain), &settings).unwrap()
    }

    #[test]
    fn saved_tiles_are_numbered_and_written() {
        let outcome = write_flat(16 * 37 + 1, 16);
        assert_eq!((outcome.vertices, outcome.triangles), (38 * 38, 2 * 37 * 37));
    }

    /// The step that no machine can share, at 640 billion samples:
    /// `cargo test --release --lib full_scale -- --ignored --nocapture`.
    #[test]
    #[ignore = "takes minutes"]
    fn ids_at_full_scale() {
        let started = std::time::Instant::now();
        let outcome = write_flat(800_001, 512);
        assert_eq!((outcome.vertices, outcome.triangles), (1564 * 1564, 2 * 1563 * 1563));
        let peak = terrane_engine::peak_memory().unwrap_or_default() >> 20;
        println!("{} tiles in {:.1} s, {peak} MiB", 1563 * 1563, started.elapsed().as_secs_f64());
    }

    #[test]
    fn a_read_error_names_the_tile() {
        let source = Saddle { broken_row: Some(200), ..Saddle::new(257) };
        for threads in [1, 3] {
            let error = run(&source, threads, PipelineKernel::GREEDY).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::BadInput);
            assert!(error.to_string().contains("3,"), "{error}");
        }
    }
}
