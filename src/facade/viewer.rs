//! Pictures, pages and reports of data.

use terrane_engine::operation::Job;
use terrane_viewer::info::{
    CloudInfoOptions, FeaturesInfoOptions, GridInfoOptions, MeshInfoOptions,
};
use terrane_viewer::page::{CloudPageOptions, LinePageOptions, PageOptions};
use terrane_viewer::qa::QaOptions;
use terrane_viewer::view::PictureOptions;

use super::{Cloud, Data, Features, Grid, Mesh};

impl Grid {
    /// Shaded relief as PNG, at most this many columns wide.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [picture, page] = ["dem.png", "dem.html"].map(|name| folder.path().join(name));
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// let made = dem.picture().width(300).altitude(30.0).exaggeration(2.0).write(&picture)?;
    /// assert_eq!((made.width, made.exaggeration), (300, 2.0));
    /// let made = dem.page().insertion(true).write(&page)?; // how greedy insertion goes
    /// assert_eq!(made.page, "insertion");
    /// # Ok(())
    /// # }
    /// ```
    pub fn picture(&self) -> Job<'_, PictureOptions> {
        self.job()
    }

    /// A self-contained HTML page of the grid.
    pub fn page(&self) -> Job<'_, PageOptions> {
        self.job()
    }

    /// Properties: size, georeference, storage, problems, the cost of a mesh, and [statistics of
    /// heights](crate::prelude::GridInfoSetters::stats).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// let known = dem.inspect().stats(true).run()?;
    /// assert_eq!((known.format, known.stats.unwrap().valid), ("synthetic terrain", 129 * 129));
    /// # Ok(())
    /// # }
    /// ```
    pub fn inspect(&self) -> Job<'_, GridInfoOptions> {
        self.job()
    }
}

impl Cloud {
    /// A self-contained HTML page with a number of the [points](crate::prelude::CloudPageSetters::points) and
    /// their attributes.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, page, picture] = ["cloud.xyz", "cloud.html", "cloud.png"].map(|name| folder.path().join(name));
    /// # let text: String = (0..2000).map(|i| format!("{} {} {}\n", i % 50, i / 50, i % 7)).collect();
    /// # std::fs::write(&path, text).unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?; // "cloud.xyz"
    /// assert_eq!(cloud.page().points(1000).write(&page)?.points, Some(1000));
    /// let known = cloud.inspect().picture(&picture).run()?;
    /// assert!(known.density.unwrap() > 1.0 && known.picture.unwrap().points > 1000);
    /// # Ok(())
    /// # }
    /// ```
    pub fn page(&self) -> Job<'_, CloudPageOptions> {
        self.job(|_| {})
    }

    /// A report on the quality of the point cloud: density, voids, flight lines and headers, as one HTML file.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, page, index] = ["cloud.xyz", "qa.html", "files.geojson"].map(|name| folder.path().join(name));
    /// # let text: String = (0..2000).map(|i| format!("{} {} {}\n", i % 50, i / 50, i % 7)).collect();
    /// # std::fs::write(&path, text).unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?; // "cloud.xyz"
    /// let report = cloud.qa().cell(5.0).min_density(0.5).index(&index).write(&page)?;
    /// assert!(report.min_density.unwrap().is_met == Some(true) && report.findings.is_empty());
    /// # Ok(())
    /// # }
    /// ```
    pub fn qa(&self) -> Job<'_, QaOptions> {
        self.job(|_| {})
    }

    /// Properties from the headers, or from [all points](crate::prelude::CloudInfoSetters::stats), with an
    /// optional [picture](crate::prelude::CloudInfoSetters::picture) from above.
    pub fn inspect(&self) -> Job<'_, CloudInfoOptions> {
        self.job(|_| {})
    }
}

impl Mesh {
    /// Properties of the mesh.
    pub fn inspect(&self) -> Job<'_, MeshInfoOptions> {
        Job::new(self.inputs(), MeshInfoOptions::default())
    }

    /// A picture from above: shaded relief, or vertex colours.
    pub fn picture(&self) -> Job<'_, PictureOptions> {
        Job::new(self.inputs(), PictureOptions::default())
    }

    /// A self-contained HTML page of the mesh.
    pub fn page(&self) -> Job<'_, PageOptions> {
        Job::new(self.inputs(), PageOptions::default())
    }
}

impl Features {
    /// A self-contained HTML page of the lines and rings with all simplifications.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, page] = ["line.wkt", "line.html"].map(|name| folder.path().join(name));
    /// # std::fs::write(&path, "LINESTRING(0 0, 1 0.01, 2 0)\n").unwrap();
    /// let lines = terrane::open_features(&path)?;
    /// assert_eq!(lines.page().write(&page)?.vertices, Some(3));
    /// assert_eq!(lines.inspect().run()?.lines, 1);
    /// # Ok(())
    /// # }
    /// ```
    pub fn page(&self) -> Job<'_, LinePageOptions> {
        self.job()
    }

    /// Properties: geometry types, fields, heights, bounds. Reads all features.
    pub fn inspect(&self) -> Job<'_, FeaturesInfoOptions> {
        self.job()
    }
}
