//! The plan on paper: what is made from what, and by which tasks. It never changes once written.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::object::object_bytes;
use super::tasks::{Strips, TaskId, before};
use crate::placing::Placing;
use crate::plan::{self, InputFile, Planned};
use crate::sift::Skipped;
use crate::tin::estimate::Size;
use crate::tin::job::{Goal, TinJob};
use crate::tin::layout::Layout;
use crate::tin::make::Opened;
use crate::{REVISION, Resources};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_base::limits;
use terrane_files::{name_of, path_of};
use terrane_mesh::MeshFormat;
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs, SYNTH_PREFIX};
use terrane_tin::{Local, Triangle};

/// A plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Manifest {
    /// "tin".
    kind: String,
    /// Version of the program that made it.
    terrane: String,
    revision: u32,
    pub(super) method: Method,
    grid: Grid,
    files: Vec<InputFile>,
    /// Vertices of the mesh, about.
    vertices: u64,
    pub(super) tasks: Vec<Needs>,
    /// Files that are left out of the input because they are bad.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) skipped: Vec<Skipped>,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Method {
    /// Names of files, or of a synthetic terrain.
    input: Vec<String>,
    /// What the user called them.
    pub(super) label: String,
    band: u32,
    /// As text, because it may be NaN.
    nodata: Option<String>,
    pub(super) format: String,
    pub(super) max_error: f64,
    strict: bool,
    drop: bool,
    pub(super) tile: u32,
    strip_rows: u32,
    pub(super) height_origin: Option<f64>,
}

/// What was found in the input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Grid {
    width: u32,
    height: u32,
    transform: [f64; 6],
    crs: String,
}

/// A task and what it needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Needs {
    pub(super) id: String,
    after: Vec<String>,
    pub(super) samples: u64,
    /// Least bytes of memory.
    pub(super) memory: u64,
    /// Bytes of its result, about.
    pub(super) disk: u64,
}

impl Manifest {
    /// The plan for an opened job whose mesh will be of about `size`; `strip_rows` rows of tiles make
    /// a strip.
    pub(super) fn new(
        job: &TinJob,
        opened: &Opened,
        size: Size,
        memory: u64,
        strip_rows: Option<u32>,
    ) -> Result<Self> {
        let Goal::MaxError(max_error) = job.goal else { return Err(budget()) };
        let info = opened.source.info();
        let layout = Layout::new(info.width, info.height, job.tile)?;
        let strips = Strips::new(layout, strip_rows);
        let method = Method {
            input: job.input.names().to_vec(),
            label: job.input.to_string(),
            band: job.band,
            nodata: job.nodata.map(|nodata| nodata.to_string()),
            format: opened.format.name.to_owned(),
            max_error,
            strict: job.strict,
            drop: job.drop,
            tile: job.tile,
            strip_rows: strips.rows(),
            height_origin: opened.height_origin,
        };
        Ok(Self {
            kind: Self::KIND.to_owned(),
            terrane: env!("CARGO_PKG_VERSION").to_owned(),
            revision: REVISION,
            method,
            grid: Grid::of(info),
            files: plan::look_at(&all_files(job.input.names(), &*opened.source))?,
            vertices: size.vertices,
            tasks: needs(&strips, layout.samples(), size, opened.format, memory),
            skipped: Vec::new(),
        })
    }

    /// Fails when the grid is none, or its tasks are not those listed: only so many are worked on.
    fn check_size(&self) -> std::result::Result<(), String> {
        let Grid { width, height, .. } = self.grid;
        limits::check("columns or rows", width.max(height).into(), limits::MAX_SIDE)
            .and_then(|()| self.strips())
            .map_err(|e| e.to_string())
            .and_then(|strips| match 2 * u64::from(strips.count()) == self.tasks.len() as u64 {
                true => Ok(()),
                false => Err("its list of tasks does not match its grid".to_owned()),
            })
    }

    /// The files it is made from.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(InputFile::path)
    }

    /// Fails when a file is not what it was.
    pub(super) fn check_files(&self, by_content: bool) -> Result<()> {
        plan::check(&self.files, by_content)
    }

    /// Fails when the opened input is another grid, or has more files: one beside the others may
    /// say where voids are.
    pub(super) fn check_source(&self, source: &dyn GridSource) -> Result<()> {
        let known: HashSet<&Path> = self.files().collect();
        let all = all_files(&self.method.input, source);
        if let Some(new) = all.iter().find(|path| !known.contains(path.as_path())) {
            return Err(Error::bad_input(
                "is read with the input, and was not when it was planned",
            )
            .in_file(new)
            .remedy("move it away, or plan anew in another folder"));
        }
        let here = Grid::of(source.info());
        if here == self.grid {
            return Ok(());
        }
        let how = plan::difference(&self.grid, &here).unwrap_or_default();
        Err(Error::bad_input(format!("is not the grid the plan was made for: {how}"))
            .in_file(Path::new(&self.method.label))
            .remedy("put it back, or plan anew in another folder"))
    }

    /// The job that writes the mesh to `output`.
    pub(super) fn job(&self, output: PathBuf, overwrite: bool, resources: Resources) -> TinJob {
        let method = self.method.clone();
        TinJob {
            input: Inputs::labelled(method.input, method.label),
            band: method.band,
            nodata: method.nodata.and_then(|nodata| nodata.parse().ok()),
            output,
            format: Some(method.format),
            overwrite,
            split: None,
            solid_base: None,
            placing: Placing::default(),
            goal: Goal::MaxError(method.max_error),
            strict: method.strict,
            drop: method.drop,
            tile: method.tile,
            measure: true,
            resources,
        }
    }

    /// How the grid is cut.
    pub(super) fn strips(&self) -> Result<Strips> {
        let layout = Layout::new(self.grid.width, self.grid.height, self.method.tile)?;
        Ok(Strips::new(layout, Some(self.method.strip_rows)))
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> u64 {
        u64::from(self.grid.width) * u64::from(self.grid.height)
    }

    /// Share of the samples that the mesh keeps, about.
    pub(super) fn kept(&self) -> f64 {
        self.vertices as f64 / self.samples() as f64
    }

    /// Bytes of the mesh, about.
    pub(super) fn mesh_bytes(&self) -> u64 {
        self.tasks.last().map_or(0, |finish| finish.disk)
    }
}

impl Planned for Manifest {
    const KIND: &'static str = "tin";

    fn made_by(&self) -> (&str, u32) {
        (&self.terrane, self.revision)
    }

    fn check(&self) -> std::result::Result<(), String> {
        self.check_size()
    }

    fn files(&self) -> &[InputFile] {
        &self.files
    }

    fn files_mut(&mut self) -> &mut [InputFile] {
        &mut self.files
    }

    fn skipped(&self) -> &[Skipped] {
        &self.skipped
    }

    fn skipped_mut(&mut self) -> &mut Vec<Skipped> {
        &mut self.skipped
    }
}

impl Grid {
    fn of(info: &GridInfo) -> Self {
        let Affine { x0, a, b, y0, d, e } = info.transform;
        let transform = [x0, a, b, y0, d, e];
        let crs = info.crs.wkt.clone().unwrap_or_else(|| info.crs.label());
        Self { width: info.width, height: info.height, transform, crs }
    }
}

fn budget() -> Error {
    Error::usage("a plan needs a tolerance: no task alone can tell which one meets a budget")
        .remedy("pass --max-error")
}

/// The files behind `names` with all that is read beside them.
fn all_files(names: &[String], source: &dyn GridSource) -> Vec<PathBuf> {
    let is_file = |name: &&String| !name.starts_with(SYNTH_PREFIX);
    let path = |name: &String| path_of(raster::file_name(name)).into_owned();
    let members = source.members().into_iter().filter_map(|path| name_of(path).ok());
    let all: Vec<String> = names.iter().cloned().chain(members).collect();
    plan::with_companions(all.iter().filter(is_file).map(path).collect())
}

/// Tasks with what they need, from the size of the whole mesh.
fn needs(
    strips: &Strips,
    samples: u64,
    size: Size,
    format: &MeshFormat,
    memory: u64,
) -> Vec<Needs> {
    let kept = size.triangles * size_of::<Triangle>() as u64
        + size.vertices * (size_of::<Local>() + size_of::<f64>()) as u64;
    let need = |task: TaskId| {
        let (own, tiles) = (strips.work(task).samples(), strips.work(task).tiles());
        let disk = match task {
            TaskId::Finish => (format.most)().file_bytes(size.vertices, size.triangles),
            _ => object_bytes((kept as f64 * own as f64 / samples as f64) as u64, tiles),
        };
        let after = match task {
            TaskId::Finish => strips.tasks().filter(|other| *other != task).collect(),
            _ => before(task),
        };
        let after = after.iter().map(TaskId::to_string).collect();
        Needs { id: task.to_string(), after, samples: own, memory, disk }
    };
    strips.tasks().map(need).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Manifest {
        let task = serde_json::json!(
            { "id": "", "after": [], "samples": 0, "memory": 0, "disk": 0 }
        );
        let tasks = vec![task; 18];
        let plan = serde_json::json!({
            "kind": "tin", "terrane": env!("CARGO_PKG_VERSION"), "revision": REVISION,
            "method": {
                "input": ["synth:rough"], "label": "synth:rough", "band": 1, "nodata": "NaN",
                "format": "PLY", "max_error": 0.1, "strict": false, "drop": true, "tile": 512,
                "strip_rows": 2, "height_origin": null,
            },
            "grid": {
                "width": 9000, "height": 9000, "crs": "none",
                "transform": [0.1, 1e-300, 0.0, -7e22, 0.0, -1.0],
            },
            "files": [], "vertices": 0, "tasks": tasks,
        });
        serde_json::from_value(plan).unwrap()
    }

    #[test]
    fn a_plan_comes_back_from_its_file_and_another_version_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        let read = |plan: &Manifest| {
            std::fs::write(&path, plan::to_text(plan).unwrap()).unwrap();
            plan::read::<Manifest>(folder.path())
        };
        let plan = plan();
        let (back, id) = read(&plan).unwrap();
        assert_eq!((&back, id), (&plan, plan::id(&plan)));
        let job = back.job(PathBuf::new(), false, Resources::default());
        assert!(job.nodata.is_some_and(f64::is_nan));
        for other in [
            Manifest { terrane: "0.0.0".into(), ..plan.clone() },
            Manifest { revision: REVISION + 1, ..plan.clone() },
        ] {
            let refused = read(&other).unwrap_err().to_string();
            assert!(refused.contains("was made by terrane"), "{refused}");
        }
    }

    #[test]
    fn a_plan_with_more_work_than_it_lists_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        for (side, listed, part) in [
            (9000, 17, "does not match its grid"),
            (1_000_000, 18, "does not match its grid"),
            (u32::MAX, 18, "columns or rows"),
            (0, 18, "at least 2 x 2"),
        ] {
            let mut plan = plan();
            (plan.grid.width, plan.grid.height) = (side, side);
            plan.tasks.truncate(listed);
            std::fs::write(&path, plan::to_text(&plan).unwrap()).unwrap();
            let refused = plan::read::<Manifest>(folder.path()).unwrap_err().to_string();
            assert!(refused.contains("is no plan") && refused.contains(part), "{refused}");
        }
    }
}
