//! Points of clouds into files of points.

use std::path::PathBuf;

use super::cloud::Cloud;
use super::plan::Plan;
use super::run::{Run, System, overwrite_setting, run_settings, system_settings};
use terrane_base::{Error, Result};
use terrane_cloud::{LasVersion, PointFormat};
use terrane_jobs::translate::plan::{PlanPointsJob, plan_points};
use terrane_jobs::translate::{
    self, Above, Assign, Overlap, Sort, Split, Squares, Thin, TranslateJob, TranslateReport,
};

/// Points of a cloud in files to be written, with all that is known of them: one file, or one for each square. Points
/// stay in the order of the files' names and of the points in them unless another is asked for; those marked as withheld are kept unless the cloud's
/// filter drops that mark.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let [path, thin] = ["points.xyz", "thin.laz"].map(|name| folder.path().join(name));
/// std::fs::write(&path, "x y z class\n0.5 0.5 3 2\n0.9 0.1 2 2\n1.5 0.5 4 6\n").unwrap();
/// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
/// let made = cloud.points().thin("1:lowest".parse().unwrap()).write(&thin)?;
/// assert_eq!(made.points, 2); // one of each square of 1 by 1
/// assert_eq!(terrane::open_cloud(thin.to_str().unwrap())?.info().count, 2);
/// # Ok(())
/// # }
/// ```
pub struct PointsBuilder<'a> {
    cloud: &'a Cloud,
    format: Option<PointFormat>,
    version: Option<LasVersion>,
    dedupe: bool,
    above: Above,
    assign: Vec<Assign>,
    overlap: Option<Overlap>,
    thin: Option<Thin>,
    distance: Option<f64>,
    sort: Option<Sort>,
    system: System,
    run: Run,
}

run_settings!([] PointsBuilder<'_>);
overwrite_setting!([] PointsBuilder<'_>);
system_settings!([] PointsBuilder<'_>);

impl<'a> PointsBuilder<'a> {
    pub(super) fn of(cloud: &'a Cloud) -> Self {
        Self {
            cloud,
            format: None,
            version: None,
            dedupe: false,
            above: Above::default(),
            assign: Vec::new(),
            overlap: None,
            thin: None,
            distance: None,
            sort: None,
            system: System::default(),
            run: Run::default(),
        }
    }

    /// The format of the points; the first that has all fields of all files unless told otherwise.
    pub fn format(mut self, format: PointFormat) -> Self {
        self.format = Some(format);
        self
    }

    /// The version of LAS; the first that has points of the format unless told otherwise.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, made] = ["points.xyz", "made.laz"].map(|name| folder.path().join(name));
    /// use terrane::LasVersion;
    /// std::fs::write(&path, "x y z\n0.5 0.5 3\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// cloud.points().las_version(LasVersion::V1_5).write(&made)?;
    /// assert_eq!(std::fs::read(&made).unwrap()[24..26], [1, 5]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn las_version(mut self, version: LasVersion) -> Self {
        self.version = Some(version);
        self
    }

    /// Of points of one place and time only the first.
    pub fn dedupe(mut self, dedupe: bool) -> Self {
        self.dedupe = dedupe;
        self
    }

    /// Heights above the ground, exact in the triangulation of its points, and classes by it.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, high] = ["points.xyz", "high.csv"].map(|name| folder.path().join(name));
    /// use terrane::{Above, HeightsAs};
    /// std::fs::write(&path, "x y z class\n0 0 1 2\n4 0 3 2\n0 4 1 2\n1 1 9.25 5\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let above = Above { heights: Some(HeightsAs::Z), ..Above::default() };
    /// cloud.points().above(above).write(&high)?;
    /// let text = std::fs::read_to_string(&high).unwrap();
    /// assert!(text.lines().nth(4).unwrap().starts_with("1,1,7.75,")); // the ground is at 1.5 there
    /// # Ok(())
    /// # }
    /// ```
    pub fn above(mut self, above: Above) -> Self {
        self.above = above;
        self
    }

    /// Only one point of each cell.
    pub fn thin(mut self, thin: Thin) -> Self {
        self.thin = Some(thin);
        self
    }

    /// Only points that are no nearer to each other than this, in space and the units of coordinates, and so many that
    /// each point left out is nearer than that to one of them.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, few] = ["points.xyz", "few.laz"].map(|name| folder.path().join(name));
    /// std::fs::write(&path, "x y z\n0 0 0\n1 0 0\n0 0 5\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let made = cloud.points().thin_distance(2.0).write(&few)?;
    /// assert_eq!(made.points, 2); // one of the lower two, and the one above
    /// # Ok(())
    /// # }
    /// ```
    pub fn thin_distance(mut self, least: f64) -> Self {
        self.distance = Some(least);
        self
    }

    /// Where flight lines overlap the points of one.
    pub fn drop_overlap(mut self, overlap: Overlap) -> Self {
        self.overlap = Some(overlap);
        self
    }

    /// Sets an attribute, after those that were asked for before.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, set] = ["points.xyz", "set.csv"].map(|name| folder.path().join(name));
    /// std::fs::write(&path, "x y z class\n0 0 7 2\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// cloud.points().attribute("intensity = 10 * (z + 1)".parse().unwrap()).write(&set)?;
    /// assert!(std::fs::read_to_string(&set).unwrap().lines().nth(1).unwrap().starts_with("0,0,7,80,"));
    /// # Ok(())
    /// # }
    /// ```
    pub fn attribute(mut self, assign: Assign) -> Self {
        self.assign.push(assign);
        self
    }

    /// The order of points; unless told otherwise that of files and of points in them.
    pub fn sort(mut self, sort: Sort) -> Self {
        self.sort = Some(sort);
        self
    }

    /// Writes the points: LAS, LAZ or COPC by the name's ending (`.las`, `.laz`, `.copc.laz`).
    ///
    /// # Errors
    /// A cloud that is not of files; files that do not go into one, or what the format cannot hold of a point; damage
    /// in the files; too little memory; an output that exists or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<TranslateReport> {
        let job = self.job(path.into())?;
        translate::run(&job, &*self.run.progress, &self.run.cancel)
    }

    /// Writes a folder of a LAZ file for each square that has points.
    ///
    /// # Errors
    /// Those of [`write`](Self::write); too many squares.
    pub fn write_squares(
        self,
        squares: Squares,
        folder: impl Into<PathBuf>,
    ) -> Result<TranslateReport> {
        let job = TranslateJob { squares: Some((squares, false)), ..self.job(folder.into())? };
        translate::run(&job, &*self.run.progress, &self.run.cancel)
    }

    /// Writes a folder of a file for each value of an attribute, such as `classification` or `point_source_id`.
    ///
    /// # Errors
    /// Those of [`write`](Self::write); an attribute that the points do not have, or of too many values.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [parts, path] = ["parts", "points.xyz"].map(|name| folder.path().join(name));
    /// std::fs::write(&path, "x y z class\n0 0 7 2\n1 0 9 5\n2 0 7 2\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let split = terrane::Split { attribute: "class".to_owned(), is_plain: false };
    /// assert_eq!(cloud.points().write_split(split, &parts)?.files, 2);
    /// let ground = parts.join("classification_2.laz");
    /// assert_eq!(terrane::open_cloud(ground.to_str().unwrap())?.info().count, 2);
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_split(self, split: Split, folder: impl Into<PathBuf>) -> Result<TranslateReport> {
        let job = TranslateJob { split: Some(split), ..self.job(folder.into())? };
        translate::run(&job, &*self.run.progress, &self.run.cancel)
    }

    /// Writes down in a folder what files of squares are to be made and by which tasks, so that it can be done by
    /// pieces and by many machines: [`Plan`]. A task has `cut` squares along its side, or as many as make a fair piece
    /// of work.
    ///
    /// # Errors
    /// Those of [`write_squares`](Self::write_squares) that are found before the work; what is no matter of what lies
    /// near a square; a folder that holds something else.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [work, tiles, path] = ["work", "tiles", "points.xyz"].map(|name| folder.path().join(name));
    /// let lines: Vec<_> = (0..900).map(|i| format!("{} {} 1", i % 30 * 4, i / 30 * 4)).collect();
    /// std::fs::write(&path, lines.join("\n")).unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let squares = terrane::Squares { side: 50.0, buffer: 5.0, mark: Default::default() };
    /// let plan = cloud.points().plan_squares(squares, &work, 1)?;
    /// plan.run().task("squares-4").run()?; // anywhere, in any order
    /// assert_eq!(plan.run().output(&tiles).run()?.found, 1);
    /// assert_eq!(std::fs::read_dir(&tiles).unwrap().count(), 9);
    /// # Ok(())
    /// # }
    /// ```
    pub fn plan_squares(
        self,
        squares: Squares,
        folder: impl Into<PathBuf>,
        cut: impl Into<Option<u32>>,
    ) -> Result<Plan> {
        if self.run.overwrite {
            return Err(Error::usage("a plan writes no points yet, in place of others")
                .remedy("leave overwrite out, and say it of the run"));
        }
        let folder = folder.into();
        let job = self.job(folder.join("points"))?;
        let job = TranslateJob { squares: Some((squares, false)), ..job };
        let plan =
            PlanPointsJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        plan_points(&plan, &*self.run.progress, &self.run.cancel)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<TranslateJob> {
        Ok(TranslateJob {
            cloud: self.cloud.options.clone(),
            format: self.format,
            version: self.version,
            dedupe: self.dedupe,
            above: self.above.clone(),
            assign: self.assign.clone(),
            overlap: self.overlap,
            thin: self.thin,
            distance: self.distance,
            sort: self.sort,
            transform: self.system.transform()?,
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..TranslateJob::new(self.cloud.inputs.clone(), output)
        })
    }
}
