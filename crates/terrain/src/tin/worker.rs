//! One worker: takes tasks from the queue and carries them out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crossbeam_channel::Sender;

use super::artifact::ContainerRecord;
use super::boxes::PositionShift;
use super::breakline_check::BreaklineFans;
use super::container::{MeshPiece, TileContainer};
use super::counters::{MeshFlaws, SampleCounts};
use super::kernel::PipelineKernel;
use super::layout::{SeamKind, TileId, TileLayout};
use super::numbering::{VertexFlags, VertexLookup, positions};
use super::patch_region::{PatchFrontier, PatchTriangles, rect_around};
use super::report::{PipelineStage, StageClock};
use super::schedule::TaskQueue;
use super::settings::TinSettings;
use super::store::ContainerStore;
use super::task::{TileStep, TileTask};
use super::window::HeightBuffers;
use super::writer::{TilePart, TilePartSink};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_engine::WorkSpan;
use terrane_files::fault::{self, FaultPoint};
use terrane_files::lock;
use terrane_raster::GridSource;
use terrane_tin::{
    HeightWindow, PatchInput, PatchMesh, PathStretch, TileInput, TileMesh, TilePosition,
    TileScratch, TileTriangle, TinSpec,
};

/// What all workers of a running job share.
pub(super) struct SharedTinState<'a> {
    pub(super) source: &'a dyn GridSource,
    pub(super) settings: &'a TinSettings<'a>,
    pub(super) kernel: PipelineKernel,
    pub(super) layout: TileLayout,
    /// Source of tiles of other runs.
    pub(super) saved_tiles: Option<&'a dyn ContainerSource>,
    pub(super) store: ContainerStore,
    pub(super) queue: TaskQueue,
    /// Id of the next vertex to be numbered.
    pub(super) next_id: AtomicU64,
    pub(super) tally: Mutex<SampleCounts>,
    /// The sink wants triangles by position.
    pub(super) with_corners: bool,
}

/// Where saved containers come from.
pub(super) trait ContainerSource: Sync {
    /// The container of `tile`.
    fn load(&self, tile: TileId) -> Result<TileContainer>;
}

/// Where finished parts go.
pub(super) struct TilePartOutlet<'a> {
    pub(super) collector: &'a Mutex<dyn TilePartSink + 'a>,
    /// Channel to a thread that passes them to the collector while the worker continues.
    pub(super) writer: Option<Sender<(TileId, TilePart)>>,
}

/// One worker and its buffers.
pub(super) struct TinWorker<'a> {
    job: &'a SharedTinState<'a>,
    outlet: TilePartOutlet<'a>,
    window: HeightBuffers,
    scratch: TileScratch,
    triangles: Vec<TileTriangle>,
    /// Heights of their corners, where those are free.
    vertices: Vec<(TilePosition, f64)>,
    /// Samples to keep where it works, sorted.
    constraints: Vec<TilePosition>,
    /// Parts of breaklines there, in the same order for all tiles.
    lines: Vec<PathStretch>,
    line_fans: BreaklineFans,
    used: VertexFlags,
    lookup: VertexLookup,
    clock: StageClock,
}

impl<'a> TinWorker<'a> {
    pub(super) fn new(job: &'a SharedTinState<'a>, outlet: TilePartOutlet<'a>) -> Self {
        let mut scratch = TileScratch::default();
        scratch.stop_by(job.settings.cancel);
        Self {
            job,
            outlet,
            window: HeightBuffers::default(),
            scratch,
            triangles: Vec::new(),
            vertices: Vec::new(),
            constraints: Vec::new(),
            lines: Vec::new(),
            line_fans: BreaklineFans::default(),
            used: VertexFlags::default(),
            lookup: VertexLookup::default(),
            clock: StageClock::default(),
        }
    }

    /// Carries out tasks until there are no more; returns the time spent on them.
    pub(super) fn run(mut self) -> StageClock {
        while let Some(task) = self.job.queue.next(|| self.job.store.has_room()) {
            match self.job.settings.cancel.check().and_then(|()| self.attempt(task)) {
                Ok(()) => self.job.queue.done(task),
                Err(error) => self.job.queue.fail(error),
            }
        }
        self.clock
    }

    /// Carries out `task`; a panic becomes an error that names the tile.
    fn attempt(&mut self, task: TileTask) -> Result<()> {
        let _span = WorkSpan::enter("tile", &task);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            fault::point(FaultPoint::Panic).map_err(|e| Error::io(ErrorKind::Io, "work", e))?;
            self.perform(task)
        }));
        outcome.unwrap_or_else(|panic| Err(panicked(&*panic))).map_err(|error| error.at(task))
    }

    fn perform(&mut self, task: TileTask) -> Result<()> {
        match task.step {
            TileStep::Tile => match self.job.saved_tiles {
                None => self.triangulate(task.tile),
                Some(saved_tiles) => self.load(saved_tiles, task.tile),
            },
            TileStep::Vertical => self.mend(SeamKind::Vertical, task.tile),
            TileStep::Horizontal => self.mend(SeamKind::Horizontal, task.tile),
            TileStep::Corner => self.mend(SeamKind::Corner, task.tile),
            TileStep::Gather => self.gather(task.tile),
            TileStep::Number => self.number(task.tile),
            TileStep::Emit => self.emit(task.tile),
            TileStep::Save => self.save(task.tile),
        }
    }

    fn triangulate(&mut self, tile: TileId) -> Result<()> {
        let layout = &self.job.layout;
        let rect = layout.rect(tile);
        self.read(layout.apron(tile))?;
        let suspects = self.window.suspects(layout.owned(tile), self.job.source.info());
        let started = Instant::now();
        self.list_constraints(rect);
        self.list_lines(rect);
        let ends = self.lines.iter().flat_map(|line| line.ends(rect.width, rect.height));
        self.constraints.extend(ends);
        self.constraints.sort_unstable();
        let input = tile_input(layout, tile, self.window.heights(), &self.constraints, &self.lines);
        let input = TileInput { spacing: self.spacing(), ..input };
        let mesh = (self.job.kernel.tile)(&input, &self.job.settings.spec, &mut self.scratch);
        self.job.settings.cancel.check()?;
        let TileMesh { triangles, vertices, heights, isolated, valid } = &mesh;
        let odd_range = self.window.odd_range();
        let tally = SampleCounts { suspects, odd_range, ..SampleCounts::default() };
        let tally = SampleCounts { valid: *valid, isolated: *isolated, ..tally };
        lock(&self.job.tally).add(tally);
        let _room = self.job.store.reserve(mesh.bytes(), tile)?;
        self.job.insert(MeshPiece { rect, triangles, vertices, heights })?;
        let samples = layout.owned(tile).len() as u64;
        self.clock.add(PipelineStage::Tiles, started, samples);
        self.job.settings.progress.advance(samples);
        if layout.cols == 1 {
            self.job.source.copied(layout.middle(tile));
        }
        Ok(())
    }

    /// Brings a tile that another run has made.
    fn load(&mut self, saved_tiles: &dyn ContainerSource, tile: TileId) -> Result<()> {
        let started = Instant::now();
        let saved = saved_tiles.load(tile)?;
        self.job.store.with(tile, |container| *container = saved)?;
        let samples = self.job.layout.owned(tile).len() as u64;
        self.clock.add(PipelineStage::Load, started, samples);
        self.job.settings.progress.advance(samples);
        Ok(())
    }

    /// Mends one seam, in a wider patch while the mesh beyond does not agree with the result.
    fn mend(&mut self, seam: SeamKind, tile: TileId) -> Result<()> {
        let layout = self.job.layout;
        let along = self.reach_along(seam, tile)?;
        self.triangles.clear();
        for reach in layout.reaches() {
            let zone = PatchTriangles::new(&layout, seam, tile, reach, along);
            self.extract(&zone)?;
            let is_widest = reach == layout.widest_reach();
            if !is_widest && self.is_last_of_lines(seam, &zone) {
                continue;
            }
            let Some(rect) = rect_around(&self.triangles, zone.limits(), &layout) else { continue };
            self.read(rect)?;
            self.look_up_heights(rect)?;
            let patch = self.mend_rect(seam, tile, zone.limits(), rect);
            self.job.settings.cancel.check()?;
            let frontier = self.frontier(&patch, rect, &zone)?;
            let is_done = seam != SeamKind::Corner || patch.left.is_empty();
            if is_widest && !is_done {
                return Err(unbounded());
            }
            let is_done = is_done && patch.apart == 0;
            let is_done = is_done && (is_widest || !self.is_thin(seam, tile, along, &patch)?);
            if is_widest || (is_done && !frontier.is_open()) {
                return self.settle(seam, tile, rect, &patch, &frontier);
            }
        }
        Ok(())
    }

    /// True around a corner near breaklines.
    fn is_last_of_lines(&self, seam: SeamKind, zone: &PatchTriangles) -> bool {
        // No patch comes after this one, and the rest of a line may be anywhere within its reach.
        seam == SeamKind::Corner
            && self.job.settings.constraints.lines().paths().near(zone.limits()).next().is_some()
    }

    /// Spacing of anchor vertices; half as much where lines are followed.
    fn spacing(&self) -> u32 {
        let spacing = self.job.layout.spacing();
        // A sample may be inserted anywhere on a line, and all that this changes has to be in a patch.
        if self.job.settings.constraints.lines().paths().is_empty() {
            spacing
        } else {
            (spacing / 2).max(1)
        }
    }

    /// How far up and down from a tile corner the patch has to follow the vertical seam.
    fn reach_along(&self, seam: SeamKind, tile: TileId) -> Result<u32> {
        if seam != SeamKind::Corner {
            return Ok(0);
        }
        let right = self.job.layout.clamp(tile, 0, 1);
        Ok(self.job.store.reach(tile)?.max(self.job.store.reach(right)?))
    }

    /// True when a patch has left a triangle with too small an angle, or a wider patch at a corner would take one in.
    fn is_thin(&self, seam: SeamKind, tile: TileId, along: u32, patch: &PatchMesh) -> Result<bool> {
        let Some(bound) = self.job.settings.spec.min_angle else { return Ok(false) };
        if seam != SeamKind::Corner || patch.thin > 0 {
            return Ok(patch.thin > 0);
        }
        let (layout, store) = (&self.job.layout, &self.job.store);
        let widest = PatchTriangles::new(layout, seam, tile, layout.widest_reach(), along);
        for tile in layout.keepers(widest.limits()) {
            if store.with(tile, |container| container.is_thin_in(&widest, tile, layout, &bound))? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Adds the triangles of `zone` to those found in a narrower one.
    fn extract(&mut self, zone: &PatchTriangles) -> Result<()> {
        let started = Instant::now();
        let layout = &self.job.layout;
        for tile in layout.keepers(zone.limits()) {
            let out = &mut self.triangles;
            self.job.store.with(tile, |container| container.extract(zone, tile, layout, out))?;
        }
        self.clock.add(PipelineStage::Seams, started, 0);
        Ok(())
    }

    /// Brings the heights of all vertices in `rect`, where they are free.
    fn look_up_heights(&mut self, rect: Rect) -> Result<()> {
        self.vertices.clear();
        if !self.job.settings.spec.fit_heights {
            return Ok(());
        }
        let layout = &self.job.layout;
        for tile in layout.owners(rect) {
            let out = &mut self.vertices;
            self.job.store.with(tile, |container| container.heights_in(rect, tile, layout, out))?;
        }
        Ok(())
    }

    /// Mends the triangles in `rect`, whose heights have been read.
    fn mend_rect(&mut self, seam: SeamKind, tile: TileId, limits: Rect, rect: Rect) -> PatchMesh {
        let started = Instant::now();
        let layout = &self.job.layout;
        let seams = layout.seam_lines(seam, tile, rect);
        let shift = PositionShift::new((limits.col, limits.row), (rect.col, rect.row));
        let triangles: Vec<TileTriangle> =
            self.triangles.iter().map(|t| shift.triangle(t)).collect();
        let patch = self.patch(self.job.kernel.patch, rect, &triangles, seams);
        self.clock.add(PipelineStage::Seams, started, rect.len() as u64);
        patch
    }

    /// The patch that `make` computes from triangles in `rect`, whose heights have been read.
    fn patch(
        &mut self,
        make: fn(&PatchInput<'_>, &TinSpec, &mut TileScratch) -> PatchMesh,
        rect: Rect,
        triangles: &[TileTriangle],
        [seam_col, seam_row]: [Option<u32>; 2],
    ) -> PatchMesh {
        self.list_constraints(rect);
        self.list_lines(rect);
        let input = PatchInput {
            heights: self.window.heights(),
            vertices: &self.vertices,
            triangles,
            seam_col,
            seam_row,
            grid_ends: self.job.layout.grid_ends(rect),
            spacing: self.spacing(),
            kept: &self.constraints,
            lines: &self.lines,
        };
        make(&input, &self.job.settings.spec, &mut self.scratch)
    }

    /// Drops vertices that only a Delaunay mesh needs: those whose triangles are all kept with the tile, inside it.
    fn reduce(&mut self, tile: TileId) -> Result<()> {
        // All patches around the tile are done, and no neighbour looks at what changes here: its own vertices,
        // and which of them are in use, stay as they are.
        let layout = self.job.layout;
        let rect = layout.rect(tile);
        self.read(rect)?;
        let started = Instant::now();
        self.look_up_heights(rect)?;
        let bytes = self.job.store.with(tile, |container| container.bytes())?;
        let _room = self.job.store.reserve(2 * bytes, tile)?;
        let triangles = self.job.store.with(tile, |container| container.within(tile, &layout))?;
        let patch = self.patch(self.job.kernel.reduce, rect, &triangles, [None; 2]);
        self.job.settings.cancel.check()?;
        let PatchMesh { triangles, vertices, heights, .. } = &patch;
        let piece = MeshPiece { rect, triangles, vertices, heights };
        self.job.store.with(tile, |container| container.replace_within(piece, tile, &layout))?;
        self.clock.add(PipelineStage::Reduce, started, layout.owned(tile).len() as u64);
        Ok(())
    }

    /// Checks a mended patch against the mesh beyond it.
    fn frontier(
        &mut self,
        patch: &PatchMesh,
        rect: Rect,
        zone: &PatchTriangles,
    ) -> Result<PatchFrontier> {
        let started = Instant::now();
        let layout = &self.job.layout;
        let limits = zone.limits();
        let places = ((rect.col, rect.row), (limits.col, limits.row));
        let mut frontier = PatchFrontier::new(&patch.border, places.0, places.1);
        for tile in layout.keepers(limits).take_while(|_| !patch.border.is_empty()) {
            self.job.store.with(tile, |container| {
                frontier.add([&container.triangles, &container.inner], zone, tile, layout)
            })?;
        }
        self.clock.add(PipelineStage::Seams, started, 0);
        Ok(frontier)
    }

    /// Stores a mended patch.
    fn settle(
        &mut self,
        seam: SeamKind,
        tile: TileId,
        rect: Rect,
        patch: &PatchMesh,
        frontier: &PatchFrontier,
    ) -> Result<()> {
        let started = Instant::now();
        let PatchMesh { triangles, vertices, heights, .. } = patch;
        self.job.insert(MeshPiece { rect, triangles, vertices, heights })?;
        match seam {
            SeamKind::Vertical => self.drop_left_of_seam(tile),
            SeamKind::Horizontal => {
                let row = self.job.layout.widest_reach() as i32;
                let seam = self.job.layout.seam_lines(seam, tile, rect)[1].unwrap_or_default();
                let left = patch.left.iter().map(|at| at.row().abs_diff(seam)).max();
                let reach = frontier.closed_reach(row).max(left.unwrap_or_default());
                self.job.store.set_reach(tile, reach)?;
            }
            SeamKind::Corner => {}
        }
        self.clock.add(PipelineStage::Seams, started, 0);
        Ok(())
    }

    /// The tiles on the left of a mended seam (and the last one) are read again at their ends only.
    fn drop_left_of_seam(&self, tile: TileId) {
        let layout = &self.job.layout;
        self.job.source.copied(layout.middle(tile));
        if let Some(last) = layout.step(tile, 0, 1).filter(|next| next.col + 1 == layout.cols) {
            self.job.source.copied(layout.middle(last));
        }
    }

    /// Settles which vertices of a tile are in use, and writes them.
    fn gather(&mut self, tile: TileId) -> Result<()> {
        if self.job.settings.spec.data_dependent {
            self.reduce(tile)?;
        }
        let started = Instant::now();
        let job = self.job;
        let layout = &job.layout;
        self.used.reset(layout.owned(tile));
        let steps = [(0, 0), (0, -1), (-1, 0), (-1, -1)];
        self.line_fans.begin(job.settings.constraints.lines(), layout.owned(tile));
        for near in steps.into_iter().filter_map(|(rows, cols)| layout.step(tile, rows, cols)) {
            let origin = layout.origin(near);
            job.store.with(near, |container| {
                self.used.mark(&container.triangles, origin);
                self.line_fans.add(&container.triangles, origin);
            })?;
        }
        let points = job.store.with(tile, |container| {
            self.used.mark(&container.inner, layout.origin(tile));
            self.line_fans.add(&container.inner, layout.origin(tile));
            container.settle(|at| self.used.contains(at));
            positions(container, layout.origin(tile), &job.source.info().transform)
        })?;
        self.list_constraints(layout.owned(tile));
        let kept = self.constraints.iter().filter(|&&at| self.used.contains(at)).count() as u64;
        let apart = self.line_fans.apart();
        lock(&job.tally).add(SampleCounts { kept, apart, ..SampleCounts::default() });
        if points.len() as u64 != self.used.count() {
            return Err(Error::new(ErrorKind::Internal, "a vertex lacks a height"));
        }
        self.clock.add(PipelineStage::Write, started, 0);
        self.send(tile, TilePart::Vertices(points))
    }

    /// Fixes the ids of a tile's vertices.
    fn number(&mut self, tile: TileId) -> Result<()> {
        // No other task numbers at this time: each waits for the one before.
        let first = self.job.next_id.load(Ordering::Relaxed);
        let next = self.job.store.number(tile, first)?;
        self.job.next_id.store(next, Ordering::Relaxed);
        self.job.source.release(self.job.layout.owned(tile));
        Ok(())
    }

    /// Writes the triangles kept with a tile.
    fn emit(&mut self, tile: TileId) -> Result<()> {
        let started = Instant::now();
        let job = self.job;
        for (near, ranks) in self.lookup.begin(&job.layout, tile) {
            let owned = job.layout.owned(near);
            job.store.with_ids(near, |container, id| {
                ranks.fill(container, owned, id, job.with_corners)
            })?;
        }
        let triangles = job.store.with(tile, TileContainer::take_triangles)?;
        lock(&job.tally)
            .add(SampleCounts { thin: self.thin(tile, &triangles), ..SampleCounts::default() });
        let _room =
            job.store.reserve(VertexLookup::bytes(triangles.len(), job.with_corners), tile)?;
        let to_world = &job.source.info().transform;
        let faces = self.lookup.faces(triangles, to_world, job.with_corners);
        let faces =
            faces.ok_or_else(|| Error::new(ErrorKind::Internal, "a corner is not a vertex"))?;
        let steps = [(0, 0), (0, 1), (1, 0), (1, 1)];
        for near in steps.into_iter().filter_map(|(rows, cols)| job.layout.step(tile, rows, cols)) {
            job.store.finish(near)?;
        }
        self.clock.add(PipelineStage::Write, started, job.layout.owned(tile).len() as u64);
        self.send(tile, TilePart::Triangles(faces))
    }

    /// The triangles of a tile with too small an angle.
    fn thin(&self, tile: TileId, triangles: &[TileTriangle]) -> MeshFlaws {
        let mut thin = MeshFlaws::default();
        let Some(bound) = self.job.settings.spec.min_angle else { return thin };
        let (col, row) = self.job.layout.origin(tile);
        for triangle in triangles.iter().filter(|triangle| !bound.holds(triangle.corners)) {
            let corner = triangle.corners[0];
            thin.note(row + corner.row(), col + corner.col());
        }
        thin
    }

    /// Saves the container of a tile, for another run.
    fn save(&mut self, tile: TileId) -> Result<()> {
        let started = Instant::now();
        let mut container = self.job.store.with(tile, std::mem::take)?;
        self.job.store.discard(tile);
        let _room = self.job.store.reserve(2 * container.bytes(), tile)?;
        container.close();
        let record = ContainerRecord::of(&container);
        self.job.source.release(self.job.layout.owned(tile));
        self.clock.add(PipelineStage::Write, started, self.job.layout.owned(tile).len() as u64);
        self.send(tile, TilePart::Saved(record))
    }

    /// Lists the samples to keep in `rect`, as positions there.
    fn list_constraints(&mut self, rect: Rect) {
        let constraints = self.job.settings.constraints.within(rect);
        self.constraints.clear();
        self.constraints.extend(
            constraints.map(|[col, row]| TilePosition::new(col - rect.col, row - rect.row)),
        );
        self.constraints.sort_unstable();
    }

    /// Lists the parts of breaklines in `rect`, by positions there.
    fn list_lines(&mut self, rect: Rect) {
        let origin = [rect.col, rect.row].map(i64::from);
        let near = self.job.settings.constraints.lines().paths().near(rect);
        self.lines.clear();
        self.lines.extend(
            near.filter_map(|line| {
                PathStretch::of(line.seen_from(origin), rect.width, rect.height)
            }),
        );
    }

    fn read(&mut self, rect: Rect) -> Result<()> {
        let started = Instant::now();
        self.window.read(self.job.source, rect)?;
        self.window.check_rounding(&self.job.settings.spec)?;
        self.clock.add(PipelineStage::Read, started, rect.len() as u64);
        Ok(())
    }

    /// Hands over a part.
    fn send(&self, tile: TileId, part: TilePart) -> Result<()> {
        let store = &self.job.store;
        store.account(0, part.bytes());
        // Without room the worker waits for the collector: no more parts are made than can be written.
        match &self.outlet.writer {
            Some(writer) if store.has_room() => writer
                .send((tile, part))
                .map_err(|_| Error::new(ErrorKind::Internal, "the writer has stopped")),
            _ => {
                let written = lock(self.outlet.collector).accept(tile, part)?;
                store.account(written, 0);
                Ok(())
            }
        }
    }
}

impl SharedTinState<'_> {
    /// Hands a piece of the mesh to the containers it belongs to.
    fn insert(&self, piece: MeshPiece<'_>) -> Result<()> {
        self.layout.owners(piece.rect).try_for_each(|tile| {
            self.store.with(tile, |container| container.insert(piece, tile, &self.layout))
        })
    }
}

/// The kernel's view of a tile whose apron has been read.
pub(super) fn tile_input<'a>(
    layout: &TileLayout,
    tile: TileId,
    heights: HeightWindow<'a>,
    kept: &'a [TilePosition],
    lines: &'a [PathStretch],
) -> TileInput<'a> {
    let (rect, apron) = (layout.rect(tile), layout.apron(tile));
    TileInput {
        heights,
        apron_left: rect.col - apron.col,
        apron_right: apron.end_col() - rect.end_col(),
        apron_above: rect.row - apron.row,
        apron_below: apron.end_row() - rect.end_row(),
        spacing: layout.spacing(),
        kept,
        lines,
    }
}

/// The error of a bound between samples that cannot be met: never seen.
fn unbounded() -> Error {
    Error::new(ErrorKind::Internal, "the surface cannot be kept within the tolerance at a corner")
        .remedy("choose another ‹tile›, and report this with the input")
}

fn panicked(panic: &(dyn std::any::Any + Send)) -> Error {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    Error::new(ErrorKind::Internal, format!("a worker failed: {}", text.unwrap_or("no message")))
        .remedy("report this with the input")
}
