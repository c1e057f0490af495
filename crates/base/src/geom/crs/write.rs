//! CRS definitions as WKT 1, which every reader of `.prj` files supports.

use super::definition::{
    CrsDefinition, EpsgName, GeographicCrs, Horizontal, Projected, VerticalCrs,
};
use super::node::quoted;

fn authority(code: Option<u32>) -> String {
    code.map(|code| format!(",AUTHORITY[\"EPSG\",\"{code}\"]")).unwrap_or_default()
}

impl CrsDefinition {
    pub(super) fn wkt(&self) -> String {
        let horizontal = self.horizontal.wkt();
        match &self.vertical {
            Some(vertical) => compound(self.horizontal.name(), &horizontal, vertical),
            None => horizontal,
        }
    }
}

/// A compound CRS of a horizontal WKT and a vertical CRS.
pub(super) fn compound(name: &str, horizontal: &str, vertical: &VerticalCrs) -> String {
    let name = quoted(&format!("{name} + {}", vertical.name));
    format!("COMPD_CS[{name},{horizontal},{}]", vertical.wkt())
}

impl Horizontal {
    fn wkt(&self) -> String {
        match self {
            Self::Geographic(own) => own.wkt(),
            Self::Projected(own) => own.wkt(),
            Self::Local { name, unit } => format!(
                "LOCAL_CS[{},{},AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]]",
                quoted(name),
                unit.wkt()
            ),
        }
    }
}

impl EpsgName {
    fn wkt(&self, keyword: &str, inner: &str) -> String {
        format!("{keyword}[{}{inner}{}]", quoted(&self.name), authority(self.code))
    }
}

impl GeographicCrs {
    fn wkt(&self) -> String {
        let figure = format!(",{},{}", self.axis, self.flattening);
        let ellipsoid = format!(",{}", self.ellipsoid.wkt("SPHEROID", &figure));
        let datum = self.datum.wkt("DATUM", &ellipsoid);
        let meridian = format!("PRIMEM[{},{}]", quoted(&self.meridian), self.from_greenwich);
        let degree = "UNIT[\"degree\",0.0174532925199433,AUTHORITY[\"EPSG\",\"9122\"]]";
        // Esri's keyword for ellipsoidal heights; GDAL and PROJ support it.
        let up = if self.is_3d { ",LINUNIT[\"metre\",1]" } else { "" };
        let (name, code) = (quoted(&self.name), authority(self.code));
        format!("GEOGCS[{name},{datum},{meridian},{degree}{up}{code}]")
    }
}

impl Projected {
    fn wkt(&self) -> String {
        let numbers: String = self.method.roles.iter().zip(&self.values).fold(
            String::new(),
            |text, (role, value)| {
                text + &format!(",PARAMETER[\"{}\",{value}]", self.method.parameter(*role))
            },
        );
        format!(
            "PROJCS[{},{},PROJECTION[\"{}\"]{numbers},{}{}{}]",
            quoted(&self.name),
            self.base.wkt(),
            self.method.name,
            self.unit.wkt(),
            self.axes(),
            authority(self.code)
        )
    }

    /// Axes of south-orientated and polar CRSs; readers know them by the method.
    fn axes(&self) -> &'static str {
        match self.method.code {
            15 | 27 => "",
            _ => ",AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]",
        }
    }
}

impl VerticalCrs {
    fn wkt(&self) -> String {
        let datum = self.datum.wkt("VERT_DATUM", ",2005");
        let axis = if self.is_down { "AXIS[\"Depth\",DOWN]" } else { "AXIS[\"Up\",UP]" };
        let name = quoted(&self.name);
        format!("VERT_CS[{name},{datum},{},{axis}{}]", self.unit.wkt(), authority(self.code))
    }
}
