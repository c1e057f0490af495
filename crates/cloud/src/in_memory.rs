//! Named point clouds in memory, in place of files.

use std::sync::Arc;

use super::attributes::{AttributeSelection, PointTable};
use super::filter::CompiledFilter;
use super::frame::FrameTransform;
use super::open::CloudOpenOptions;
use super::point_filter::PointFilterPass;
use super::quantization::{PointLattice, PositionSpan, decimals};
use super::raw::{Flags, RawPoint};
use super::source::{BATCH, CloudInfo, PointConsumer, PointSource, ReturnCounts};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point};
use terrane_files::{InMemoryRegistry, InMemoryResource};

static CLOUDS: InMemoryRegistry<InMemoryPoints> = InMemoryRegistry::new();

/// Attributes of a point in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointFlags {
    /// Classification.
    pub class: u8,
    /// Return number from 1, and number of returns; 0 if unknown.
    pub returns: [u8; 2],
    /// Classification flags, with the bits of LAS 1.4.
    pub flags: Flags,
}

/// A named point cloud in memory; dropping it removes the name.
pub struct InMemoryCloud(InMemoryResource<InMemoryPoints>);

/// Points on a lattice made for them.
struct InMemoryPoints {
    points: Vec<InMemoryPoint>,
    placed: PointLattice,
    span: PositionSpan,
    crs: Crs,
}

/// A stored point.
#[derive(Clone, Copy)]
struct InMemoryPoint {
    xyz: [i32; 3],
    marks: PointFlags,
}

impl RawPoint for InMemoryPoint {
    fn xyz(self) -> [i32; 3] {
        self.xyz
    }

    fn class(self) -> u8 {
        self.marks.class
    }

    fn returns(self) -> [u8; 2] {
        self.marks.returns
    }

    fn flags(self) -> Flags {
        self.marks.flags
    }
}

impl InMemoryCloud {
    /// Names points, so that [`source`](super::source) can open them. Their lattice has the decimals of the
    /// coordinates, at most 9 and within the range of steps; excess decimals are rounded, with a note. Takes 16 bytes
    /// a point and two passes.
    ///
    /// # Errors
    /// A coordinate that is not finite, with the number of its point; another number of attribute records than points;
    /// points too far apart.
    pub fn new(positions: &[[f64; 3]], marks: Option<&[PointFlags]>, crs: Crs) -> Result<Self> {
        if let Some(marks) = marks.filter(|marks| marks.len() != positions.len()) {
            let (marks, points) = (marks.len(), positions.len());
            return Err(Error::usage(format!("{marks} attribute records for {points} points")));
        }
        let mut span = PositionSpan::default();
        for (number, world) in positions.iter().enumerate() {
            if !world.iter().all(|coordinate| coordinate.is_finite()) {
                return Err(Error::bad_input("a coordinate is not finite")
                    .at(format_args!("point {number}"))
                    .remedy("remove such points"));
            }
            let found = std::array::from_fn(|axis| decimals(world[axis], span.decimals[axis]));
            span.add(*world, found);
        }
        let placed = PointLattice::of(&span)?;
        let points = positions.iter().enumerate().map(|(number, world)| InMemoryPoint {
            xyz: placed.quantize(*world),
            marks: marks.map_or(PointFlags::default(), |marks| marks[number]),
        });
        let points = points.collect();
        Ok(Self(CLOUDS.register(InMemoryPoints { points, placed, span, crs })))
    }

    /// The name.
    pub fn name(&self) -> &str {
        self.0.name()
    }
}

/// A point cloud in memory as a source; each part is a batch.
struct InMemoryCloudSource {
    cloud: Arc<InMemoryPoints>,
    pass: Option<PointFilterPass>,
    info: CloudInfo,
    notes: Vec<String>,
}

/// Opens the cloud called `name`.
pub(super) fn open(name: &str, options: &CloudOpenOptions) -> Result<Box<dyn PointSource>> {
    let cloud = CLOUDS.get(name)?;
    let frame = cloud.placed.lattice();
    let compiled = CompiledFilter::new(&options.filter, &frame);
    // Nothing is read if the bounds do not intersect, as for a file.
    let claim = cloud.placed.claim(&cloud.span).filter(|all| all.within(&options.filter).is_some());
    let bounds = claim.and_then(|claim| {
        compiled.cut([claim.low, claim.high].map(|[x, y, z]| Point::new(x, y, z)))
    });
    let known = cloud.crs.clone();
    let crs = if known == Crs::default() { options.crs.clone().unwrap_or(known) } else { known };
    let condition = options.filter.condition.as_ref();
    let condition = condition.map(|condition| condition.bind(&[], &frame)).transpose()?;
    let pass = claim.map(|claim| {
        PointFilterPass::new(
            compiled,
            condition,
            claim,
            FrameTransform::Shift([0; 3]),
            options.salvage,
        )
    });
    let count = if pass.is_some() { cloud.points.len() as u64 } else { 0 };
    let info = CloudInfo { frame, bounds, count, crs };
    let notes = cloud.placed.note.iter().cloned().collect();
    Ok(Box::new(InMemoryCloudSource { cloud, pass, info, notes }))
}

impl InMemoryCloudSource {
    fn part(&self, part: usize) -> &[InMemoryPoint] {
        self.cloud.points.chunks(BATCH).nth(part).unwrap_or_default()
    }
}

impl PointSource for InMemoryCloudSource {
    fn info(&self) -> &CloudInfo {
        &self.info
    }

    fn parts(&self) -> usize {
        (self.info.count as usize).div_ceil(BATCH)
    }

    fn points_of(&self, part: usize) -> u64 {
        self.part(part).len() as u64
    }

    fn read(
        &self,
        part: usize,
        selection: &AttributeSelection,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let mut counts = ReturnCounts::default();
        if let Some(pass) = &self.pass {
            let records = self.part(part).iter().map(|point| (&[][..], *point));
            let mut table = PointTable::new(Vec::new(), selection.of_file(0));
            pass.batch(records, (part * BATCH) as u64, &mut table, &mut counts, each)?;
        }
        Ok(counts)
    }

    fn select(&self, names: &[String]) -> Result<AttributeSelection> {
        AttributeSelection::of_one(names, &[])
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CloudFilter, Return, source};
    use proptest::prelude::*;

    /// All that is read of a cloud with these options.
    fn all(name: &str, options: &CloudOpenOptions) -> (Vec<Point>, ReturnCounts) {
        let source = source(&[name.to_owned()], options).unwrap();
        let (mut points, mut census) = (Vec::new(), ReturnCounts::default());
        for part in 0..source.parts() {
            let found = source.positions(part, &mut |batch| {
                points.extend_from_slice(batch);
                Ok(())
            });
            census.add(&found.unwrap());
        }
        (points, census)
    }

    proptest! {
        /// A text file of the same points is the same cloud; the box asked for may hold some, all or none.
        #[test]
        fn a_held_cloud_is_what_a_file_of_its_points_is(
            points in prop::collection::vec((0_i32..900_000, -5_000_i32..5_000, 0_i32..9_000, 0_u8..4, 1_u8..4), 1..200),
            decimals in 0_usize..5,
            low in prop_oneof![0.0..60.0, -1.0..1e6, Just(1e7)],
        ) {
            let per_unit = 10_f64.powi(decimals as i32);
            let world = |steps: i32| f64::from(steps) / per_unit;
            let positions: Vec<[f64; 3]> =
                points.iter().map(|(x, y, z, ..)| [*x, *y, *z].map(world)).collect();
            let marks: Vec<PointFlags> = points
                .iter()
                .map(|(.., class, number)| PointFlags { class: *class, returns: [*number, 3], ..PointFlags::default() })
                .collect();
            // With the minimum number of decimals, which is that of the lattice.
            let lines = positions.iter().zip(&marks).map(|([x, y, z], marks)| {
                format!("{x},{y},{z},{},{},3\n", marks.class, marks.returns[0])
            });
            let text: String = lines.collect();
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("points.csv");
            std::fs::write(&path, format!("x,y,z,class,return_number,number_of_returns\n{text}")).unwrap();
            let path = format!("cloud:{}", path.display());
            let held = InMemoryCloud::new(&positions, Some(&marks), Crs::default()).unwrap();
            let filter = CloudFilter {
                classes: Some(vec![1, 2]),
                returns: Some(Return::First),
                bounds: Some([low, -1e9, 1e9, 1e9]),
                ..CloudFilter::default()
            };
            for filter in [CloudFilter::default(), filter] {
                let options = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
                let [of_file, of_held] = [&*path, held.name()].map(|name| all(name, &options));
                prop_assert_eq!(of_file, of_held);
                let info = |name: &str| source(&[name.to_owned()], &options).unwrap().info().clone();
                let (of_file, of_held) = (info(&path), info(held.name()));
                prop_assert_eq!((of_file.bounds, of_file.count), (of_held.bounds, of_held.count));
            }
        }
    }

    #[test]
    fn what_is_no_cloud_is_refused() {
        let new = |points: &[[f64; 3]], marks| InMemoryCloud::new(points, marks, Crs::default());
        let told = new(&[[0.0; 3], [0.0, f64::NAN, 0.0]], None).err().unwrap().to_string();
        assert!(told.contains("point 1"), "{told}");
        assert!(new(&[[0.0; 3]], Some(&[])).is_err());
        assert!(new(&[[0.0; 3], [1e18, 0.0, 0.0]], None).is_err(), "too far apart");
        let held = new(&[], None).unwrap();
        let (points, census) = all(held.name(), &CloudOpenOptions::default());
        assert!(points.is_empty() && census == ReturnCounts::default());
        let name = held.name().to_owned();
        drop(held);
        assert!(source(&[name], &CloudOpenOptions::default()).is_err());
    }

    #[test]
    fn coordinates_without_an_end_are_rounded_and_told_of() {
        let third = 1.0 / 3.0;
        let held =
            InMemoryCloud::new(&[[third, 0.0, 1000.0 + third]], None, Crs::default()).unwrap();
        let source = source(&[held.name().to_owned()], &CloudOpenOptions::default()).unwrap();
        assert!(source.notes()[0].contains("rounded"), "{:?}", source.notes());
        let mut found = [0.0; 3];
        let mut keep = |batch: &[Point]| {
            found = source.info().frame.world(batch[0]);
            Ok(())
        };
        source.positions(0, &mut keep).unwrap();
        assert!((found[0] - third).abs() < 1e-9 && (found[2] - 1000.0 - third).abs() < 1e-6);
    }
}
