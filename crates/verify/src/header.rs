//! The header of a mesh compared with its original: CRS, units and unknown comments.

use std::path::Path;

use terrane_base::error::Result;
use terrane_base::geom::{Crs, metres_in, wkt};
use terrane_engine::input::mesh_bounds;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::{Cancel, Progress};
use terrane_mesh::{MaxError, MeshInfo, MeshSource, Promises, plain};

/// A header to be judged.
pub(super) struct CheckedHeader<'a> {
    /// The file, which may have a `.prj` sidecar.
    pub(super) mesh: &'a Path,
    pub(super) info: &'a MeshInfo,
    pub(super) stated: &'a Promises,
    /// The CRS of the original.
    pub(super) crs: &'a Crs,
    /// Kind of the original: "grid" or "cloud".
    pub(super) original: &'static str,
}

/// Fails a mesh made by terrane whose vertices do not fill the bounding box stated in the file. Viewers rely on it.
///
/// # Errors
/// As [`mesh_bounds`].
pub(super) fn judge_bounds(
    mesh: &dyn MeshSource,
    verdict: &mut ProofVerdict,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<()> {
    let stated = mesh.stated_bounds().filter(|_| mesh.info().is_own());
    let Some(stated) = stated else { return Ok(()) };
    match mesh_bounds(mesh, progress, cancel)? {
        Some(found) if found != stated => verdict.fail(format!(
            "the mesh states that it lies from {:?} to {:?}; its vertices lie from {:?} to {:?}",
            stated[0], stated[1], found[0], found[1]
        )),
        _ => {}
    }
    Ok(())
}

impl CheckedHeader<'_> {
    /// Adds failures and unjudged statements to a verdict.
    ///
    /// # Errors
    /// A `.prj` that cannot be read.
    pub(super) fn judge(&self, verdict: &mut ProofVerdict) -> Result<()> {
        self.systems(verdict)?;
        self.unit_of_error(verdict);
        self.unit_of_file(verdict);
        if self.info.is_own() {
            for line in &self.stated.unknown {
                verdict.leave(format!("the statement \"{line}\" (unknown)"));
            }
        }
        Ok(())
    }

    /// Judges every CRS named in the file and its `.prj`.
    fn systems(&self, verdict: &mut ProofVerdict) -> Result<()> {
        let sidecar = terrane_files::prj(self.mesh)?;
        let own = self.info.crs.iter().chain(&self.info.systems).map(|text| ("the mesh", text));
        let sidecar = Some(&sidecar).filter(|text| !text.is_empty());
        let named: Vec<_> = own.chain(sidecar.map(|text| ("the .prj beside it", text))).collect();
        for (place, text) in &named {
            self.system(place, text, verdict);
        }
        let is_defined = named.iter().any(|(_, text)| system(text).is_some());
        if !named.is_empty() && !is_defined && self.crs.to_wkt().is_some() {
            let name = self.crs.label();
            verdict.leave(format!("its CRS beyond its name, {name}: no .prj beside it defines it"));
        }
        if named.is_empty() && self.info.is_own() && self.crs.is_named() {
            let ours = self.crs.label();
            verdict.leave(match self.info.names_crs() {
                true => format!("its CRS: it names none, and that of the {} is {ours}", self.original),
                false => format!(
                    "its CRS: {} has no place for one, no .prj lies beside it, and that of the {} is {ours}",
                    self.info.format, self.original
                ),
            });
        }
        Ok(())
    }

    fn system(&self, place: &str, text: &str, verdict: &mut ProofVerdict) {
        let (known, original) = (system(text), self.original);
        match known.as_ref().map_or_else(|| self.is_called(text), |crs| self.is(crs, text)) {
            Some(true) => {}
            Some(false) => {
                let [ours, theirs] = self.crs.distinct_names(&known.unwrap_or_default());
                verdict.fail(format!(
                    "{place} names the CRS {theirs}, and that of the {original} is {ours}"
                ));
            }
            None => {
                let ours = match self.crs.is_named() {
                    true => format!("is that of the {original}, {}", self.crs.label()),
                    false => format!("is its own, as the {original} names none"),
                };
                let theirs = known.map_or_else(|| text.to_owned(), |crs| crs.label());
                verdict.leave(format!("whether the CRS that {place} names, {theirs}, {ours}"));
            }
        }
    }

    /// Whether a CRS is that of the original; `None` where this cannot be decided.
    fn is(&self, crs: &Crs, text: &str) -> Option<bool> {
        if !self.crs.is_named() {
            return None;
        }
        if !self.crs.agrees(crs) {
            return self.crs.is_surely_another(crs).then_some(false);
        }
        let is_label = text == plain(&self.crs.label());
        let is_as_high = crs.vertical_epsg.is_some() == self.crs.vertical_epsg.is_some();
        let is_lost = self.crs.lost_in_wkt().is_some();
        // A code alone, as in LandXML, does not exclude a vertical CRS.
        let is_code = !text.contains(['(', '[', '+']);
        (is_code || is_label || self.crs.is_said_by(text) || is_as_high || is_lost).then_some(true)
    }

    /// True for an unknown name equal to that of the original; `None` for another one, which may be a synonym.
    fn is_called(&self, name: &str) -> Option<bool> {
        (name == plain(&self.crs.label())).then_some(true)
    }

    /// Judges the unit behind the tolerance; a tolerance of several bands has none.
    fn unit_of_error(&self, verdict: &mut ProofVerdict) {
        let Some(MaxError { unit, .. }) = &self.stated.max_error else { return };
        match (unit.as_deref(), self.crs.heights_unit()) {
            (Some(theirs), Some(ours)) if !is_same(theirs, ours) => verdict.fail(format!(
                "the mesh states its largest error in {theirs}, and heights of the {} are in {ours}",
                self.original
            )),
            // Heights without a unit are usually in that of x and y.
            (Some(theirs), None) if !is_same(theirs, self.usual_unit()) => verdict.leave(format!(
                "whether its largest error is in {theirs}, as the {} names no unit of heights",
                self.original
            )),
            (None, Some(ours)) if self.can_state_unit() => verdict.leave(format!(
                "the unit of its largest error: it states none, and heights of the {} are in {ours}",
                self.original
            )),
            _ => {}
        }
    }

    fn usual_unit(&self) -> &'static str {
        Some(self.crs.horizontal_unit()).filter(|name| metres_in(name).is_some()).unwrap_or("metre")
    }

    /// True for a mesh made by terrane whose header can state a unit of the tolerance.
    fn can_state_unit(&self) -> bool {
        self.info.is_own() && self.info.names_crs() && self.stated.bands.is_none()
    }

    /// Judges the unit stated by the format itself. A scaled file is a 3D print, or has degrees in metres: its unit
    /// is not a promise.
    fn unit_of_file(&self, verdict: &mut ProofVerdict) {
        let unit = self.info.details.iter().find(|(key, _)| key == "unit");
        let Some((_, unit)) = unit.filter(|_| self.info.is_own()) else { return };
        let ours = self.crs.horizontal_metres().unwrap_or(1.0);
        match metres_in(unit) {
            _ if unit == "millimeter" => {}
            Some(theirs) if self.info.scale != [1.0; 3] && theirs == 1.0 => {}
            Some(theirs) if self.info.scale == [1.0; 3] && near(theirs, ours) => {}
            Some(theirs) => verdict.fail(format!(
                "the mesh states that its unit is {unit} ({theirs} m), and that of the {} is {ours} m",
                self.original
            )),
            None => verdict.leave(format!("whether its unit is {unit} (unknown unit)")),
        }
    }
}

/// The CRS of a text: a code, optionally followed by a name in brackets, or WKT.
fn system(text: &str) -> Option<Crs> {
    let code = text.split_once(" (").map_or(text, |(code, _)| code);
    let is_code = code.split_once(':').is_some_and(|(name, _)| name.eq_ignore_ascii_case("EPSG"));
    let known = match is_code {
        true => wkt::of_srs(code),
        false if text.contains('[') => wkt::of_srs(text),
        false => return None,
    };
    (known.epsg.is_some() || known.wkt.is_some()).then_some(known)
}

fn is_same(a: &str, b: &str) -> bool {
    match (metres_in(a), metres_in(b)) {
        (Some(a), Some(b)) => near(a, b),
        _ => a == b,
    }
}

fn near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 1e-9
}
