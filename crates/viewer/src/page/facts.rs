//! Metadata of a page: position of the surface, units, and initial view.

use serde_json::json;

use super::PageJob;
use crate::html::HtmlPage;
use crate::view::DEGREE_METRES;
use terrane_base::geom::{Crs, is_geographic, metres_in};
use terrane_mesh::MeshInfo;
use terrane_raster::{GridInfo, Inputs};

/// CRS and units of a surface, as far as they are known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SurfaceSystem {
    label: String,
    pub(super) geographic: bool,
    pub(super) units: [String; 2],
    /// Metres in a unit of x and y, unless they are degrees; and of z.
    metres: [Option<f64>; 2],
}

impl SurfaceSystem {
    pub(super) fn of_grid(info: &GridInfo) -> Self {
        Self::of_crs(&info.crs, info.crs.label())
    }

    /// From the CRS label of a mesh and the unit of its declared tolerance.
    pub(super) fn of_mesh(info: &MeshInfo) -> Self {
        let label = info.crs.clone().unwrap_or_else(|| "unknown".to_owned());
        let digits = label.split("EPSG:").nth(1).unwrap_or_default();
        let code: String = digits.chars().take_while(char::is_ascii_digit).collect();
        let epsg = code.parse().ok();
        let vertical_unit = stated_unit(info);
        let geographic = epsg
            .and_then(is_geographic)
            .or(terrane_engine::input::is_geographic(info).then_some(true));
        Self::of_crs(&Crs { epsg, geographic, vertical_unit, ..Crs::default() }, label)
    }

    pub(super) fn of_features(crs: &Crs) -> Self {
        Self::of_crs(crs, crs.label())
    }

    fn of_crs(crs: &Crs, label: String) -> Self {
        let geographic = crs.geographic == Some(true);
        let horizontal = match crs.horizontal_unit() {
            "unit" => String::new(),
            unit => short(unit),
        };
        // Heights without a unit are taken to be in that of x and y, or in metres over degrees.
        let vertical = match &crs.vertical_unit {
            Some(unit) => short(unit),
            None if geographic => "m".to_owned(),
            None => horizontal.clone(),
        };
        let metres = [crs.horizontal_metres(), crs.vertical_metres()];
        Self { label, geographic, units: [horizontal, vertical], metres }
    }

    /// Metres of a unit along x, y and z, in the middle of `bounds`: west, south, east, north.
    pub(super) fn ground(&self, [_, south, _, north]: [f64; 4]) -> [f64; 3] {
        let [horizontal, vertical] = self.metres;
        if self.geographic {
            let latitude = ((south + north) / 2.0).clamp(-89.0, 89.0);
            return [
                DEGREE_METRES * latitude.to_radians().cos(),
                DEGREE_METRES,
                vertical.unwrap_or(1.0),
            ];
        }
        let horizontal = horizontal.unwrap_or(1.0);
        [horizontal, horizontal, vertical.unwrap_or(horizontal)]
    }
}

/// The unit of the tolerance that a mesh states.
fn stated_unit(info: &MeshInfo) -> Option<String> {
    let unit = info.promises().ok()?.max_error?.unit?;
    metres_in(&unit).map(|_| unit)
}

fn short(unit: &str) -> String {
    match unit {
        "metre" | "meter" | "metres" | "meters" => "m".to_owned(),
        "degree" => "°".to_owned(),
        other => other.to_owned(),
    }
}

/// Adds the facts common to all surfaces.
pub(super) fn put(
    page: &mut HtmlPage,
    job: &PageJob<'_>,
    system: &SurfaceSystem,
    bounds: [f64; 4],
    steps: [f64; 2],
) {
    page.fact("crs", system.label.clone());
    page.fact("geographic", system.geographic);
    page.fact("units", json!(system.units));
    page.fact("ground", json!(system.ground(bounds)));
    page.fact("reported_steps", json!(steps));
    job.add_settings(page);
    let [land, water] = crate::render::palette();
    page.fact("palette", json!({ "land": land, "water": water }));
}

/// Title of a page: names of input files without their folders, which may be private.
pub(super) fn title(inputs: &Inputs) -> String {
    match inputs.names() {
        [only] => file_name(only).to_owned(),
        [first, rest @ ..] => format!("{} and {} more", file_name(first), rest.len()),
        [] => String::new(),
    }
}

fn file_name(input: &str) -> &str {
    let path = input.strip_prefix("cloud:").unwrap_or(input);
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Short name of a page's CRS.
pub(super) fn about(system: &SurfaceSystem) -> String {
    match system.label.as_str() {
        "unknown" => "unknown CRS".to_owned(),
        label => label.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(crs: Option<&str>, comment: &str) -> SurfaceSystem {
        let plain = MeshInfo::plain("PLY", 3, 1);
        let details = vec![("comment".to_owned(), comment.to_owned())];
        SurfaceSystem::of_mesh(&MeshInfo { crs: crs.map(str::to_owned), details, ..plain })
    }

    #[test]
    fn a_mesh_is_measured_in_the_units_it_states() {
        let utm = mesh(Some("EPSG:32631 (WGS 84 / UTM zone 31N)"), "max error 5 metre");
        assert_eq!(utm.ground([0.0; 4]), [1.0; 3]);
        assert_eq!(utm.units, ["m", "m"]);
        let feet = mesh(Some("EPSG:2263 (x)"), "max error 2 US survey foot");
        let foot = 1200.0 / 3937.0;
        assert!(feet.ground([0.0; 4]).iter().all(|m| (m - foot).abs() < 1e-9), "{feet:?}");
        let degrees = mesh(Some("EPSG:4326 (WGS 84)"), "").ground([5.0, 59.0, 6.0, 61.0]);
        assert!((degrees[0] / degrees[1] - 0.5).abs() < 1e-9 && degrees[2] == 1.0);
        assert_eq!(mesh(None, "max error nonsense").ground([0.0; 4]), [1.0; 3]);
    }
}
