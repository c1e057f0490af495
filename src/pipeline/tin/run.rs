//! The core of the job: any grid source in, any mesh sink out, under given settings.

use std::path::Path;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::AtomicU64;

use crossbeam_channel::{Receiver, bounded};

use super::layout::{Layout, TileId};
use super::report::{Clock, Stage, StageReport};
use super::schedule::Queue;
use super::store::Store;
use super::worker::{Kernel, Outlet, Shared, Worker};
use super::writer::{Part, Totals, Writer};
use crate::error::{Error, ErrorKind, Result};
use crate::output::MeshSink;
use crate::pipeline::{Cancel, Progress};
use crate::raster::GridSource;
use crate::tin::Spec;

/// How to run the core of a job.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// What each tile has to reach.
    pub spec: Spec,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Worker threads. With one, everything runs on the calling thread; with more, one further
    /// thread writes.
    pub threads: usize,
    /// Bytes of unfinished mesh to hold in memory; the rest is spilled.
    pub mesh_bytes: u64,
    /// Folder for the spill file.
    pub temp_dir: &'a Path,
    /// Takes tasks in an order drawn from this seed; for tests, because no result depends on it.
    pub order_seed: Option<u64>,
    /// Told of every triangulated tile, in samples.
    pub progress: &'a dyn Progress,
    /// Stops the run between two tasks.
    pub cancel: &'a Cancel,
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Vertices written.
    pub vertices: u64,
    /// Triangles written.
    pub triangles: u64,
    /// Valid samples.
    pub valid: u64,
    /// Valid samples without a valid cell.
    pub isolated: u64,
    /// Samples that look like undeclared nodata: the value as stored, and how many.
    pub suspects: Option<(f64, u64)>,
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
    settings: &Settings<'_>,
) -> Result<Outcome> {
    run_with(source, sink, settings, Kernel::GREEDY)
}

/// As [`run_on`], with another kernel.
pub(super) fn run_with(
    source: &dyn GridSource,
    sink: Box<dyn MeshSink>,
    settings: &Settings<'_>,
    kernel: Kernel,
) -> Result<Outcome> {
    let info = source.info();
    let layout = Layout::new(info.width, info.height, settings.tile)?;
    let with_corners = sink.wants_corners();
    let writer = Mutex::new(Writer::new(layout, sink));
    let shared = Shared {
        source,
        settings,
        kernel,
        layout,
        store: Store::new(layout, settings.mesh_bytes, settings.temp_dir),
        queue: Queue::new(layout, settings.threads.max(1), settings.order_seed),
        next_id: AtomicU64::new(0),
        valid: AtomicU64::new(0),
        isolated: AtomicU64::new(0),
        suspects: Mutex::default(),
        with_corners,
    };
    let clock = if settings.threads > 1 {
        run_threads(&shared, &writer)
    } else {
        Worker::new(&shared, Outlet::Direct(&writer)).run()
    };
    conclude(shared, writer.into_inner().unwrap_or_else(PoisonError::into_inner), clock)
}

/// Parts that may wait for the writer, by worker.
const WAITING_PARTS: usize = 4;

fn run_threads<'a>(shared: &'a Shared<'a>, writer: &'a Mutex<Writer>) -> Clock {
    let threads = shared.settings.threads;
    std::thread::scope(|scope| {
        let (sender, receiver) = bounded(WAITING_PARTS * threads);
        let writing = scope.spawn(move || write_parts(shared, writer, &receiver));
        let work = |outlet| move || Worker::new(shared, outlet).run();
        let others: Vec<_> =
            (1..threads).map(|_| scope.spawn(work(Outlet::Channel(sender.clone())))).collect();
        let mut clock = work(Outlet::Channel(sender))();
        for other in others {
            match other.join() {
                Ok(theirs) => clock.merge(&theirs),
                Err(_) => shared.queue.fail(Error::new(ErrorKind::Internal, "a worker failed")),
            }
        }
        if writing.join().is_err() {
            shared.queue.fail(Error::new(ErrorKind::Internal, "the writer failed"));
        }
        clock
    })
}

/// The writer thread: writes parts until all workers have left or writing fails.
fn write_parts(shared: &Shared<'_>, writer: &Mutex<Writer>, parts: &Receiver<(TileId, Part)>) {
    let mut writer = super::schedule::lock(writer);
    for (tile, part) in parts {
        match writer.accept(tile, part) {
            Ok(written) => shared.store.account(written, 0),
            Err(error) => return shared.queue.fail(error),
        }
    }
}

fn conclude(shared: Shared<'_>, writer: Writer, mut clock: Clock) -> Result<Outcome> {
    let (totals, writing) = writer.totals();
    let (valid, isolated) = (shared.valid.into_inner(), shared.isolated.into_inner());
    shared.queue.into_result()?;
    check_surface(valid, totals)?;
    clock.add_time(Stage::Write, writing);
    Ok(Outcome {
        vertices: totals.vertices,
        triangles: totals.triangles,
        valid,
        isolated,
        suspects: shared.suspects.into_inner().unwrap_or_else(PoisonError::into_inner),
        max_error: f64::from(totals.max_error),
        square_sum: totals.square_sum,
        spilled_bytes: shared.store.spilled(),
        output_bytes: writer.finish()?,
        stages: clock.report(),
    })
}

/// Fails when there is nothing to write.
fn check_surface(valid: u64, totals: Totals) -> Result<()> {
    if valid == 0 {
        return Err(Error::bad_input("the grid has no valid sample")
            .remedy("check its nodata value, or choose another --band"));
    }
    if totals.triangles == 0 {
        return Err(Error::bad_input("the grid has no cell with four valid samples")
            .remedy("fill its voids, or check its nodata value"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, Crs, Rect};
    use crate::output::MeshBatch;
    use crate::pipeline::Silent;
    use crate::raster::{GridInfo, SampleType};
    use crate::tin::{PatchInput, PatchMesh, Scratch, TileInput, TileMesh, triangulate_tile};

    /// A saddle with a fault in it, if wanted.
    struct Saddle {
        info: GridInfo,
        broken_row: Option<u32>,
    }

    impl Saddle {
        fn new(side: u32) -> Self {
            let info = GridInfo {
                width: side,
                height: side,
                transform: Affine::LATTICE,
                georeferenced: false,
                pixel_is_point: false,
                crs: Crs::default(),
                sample_type: SampleType::F32,
                nodata: None,
                scale: 1.0,
                offset: 0.0,
                block: (64, 64),
                bands: 1,
                band: 1,
                format: "test",
                details: Vec::new(),
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

    fn run(source: &Saddle, threads: usize, kernel: Kernel) -> Result<Outcome> {
        let settings = Settings {
            spec: Spec {
                tolerance: 5.0,
                strict: false,
                drop: true,
                single_precision: None,
                measure: false,
            },
            tile: 64,
            threads,
            mesh_bytes: 1 << 20,
            temp_dir: Path::new("."),
            order_seed: None,
            progress: &Silent,
            cancel: &Cancel::default(),
        };
        run_with(source, Box::new(Drain), &settings, kernel)
    }

    fn faulty_tile(input: &TileInput<'_>, spec: &Spec, scratch: &mut Scratch) -> TileMesh {
        assert!(input.apron_left + input.apron_above > 0, "planted fault");
        triangulate_tile(input, spec, scratch)
    }

    fn faulty_patch(_: &PatchInput<'_>, _: &Spec, _: &mut Scratch) -> PatchMesh {
        panic!("planted fault {}", 7);
    }

    #[test]
    fn a_panic_becomes_an_error_that_names_the_tile() {
        let source = Saddle::new(257);
        for threads in [1, 3] {
            let kernel = Kernel { tile: faulty_tile, ..Kernel::GREEDY };
            let error = run(&source, threads, kernel).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Internal);
            assert!(error.to_string().starts_with("tile 0,0: a worker failed: planted fault"));
            let kernel = Kernel { patch: faulty_patch, ..Kernel::GREEDY };
            let error = run(&source, threads, kernel).unwrap_err().to_string();
            assert!(error.contains("seam of tile") && error.contains("planted fault 7"), "{error}");
        }
    }

    #[test]
    fn a_read_error_names_the_tile() {
        let source = Saddle { broken_row: Some(200), ..Saddle::new(257) };
        for threads in [1, 3] {
            let error = run(&source, threads, Kernel::GREEDY).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::BadInput);
            assert!(error.to_string().contains("3,"), "{error}");
        }
    }
}
