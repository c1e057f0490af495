//! Projection methods: their names in GeoTIFF, WKT and common use, and their parameters.

use super::unit::plain;

/// A projection parameter. Names differ between methods and notations; each of them maps to one of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProjectionParameter {
    Latitude,
    Longitude,
    Parallel1,
    Parallel2,
    Azimuth,
    GridAngle,
    Scale,
    Easting,
    Northing,
}

use ProjectionParameter::{
    Azimuth, Easting, GridAngle, Latitude, Longitude, Northing, Parallel1, Parallel2, Scale,
};

impl ProjectionParameter {
    pub(super) const ALL: [Self; 9] =
        [Latitude, Longitude, Parallel1, Parallel2, Azimuth, GridAngle, Scale, Easting, Northing];

    /// Value of an omitted parameter; `None` if it is required.
    pub(super) fn default(self) -> Option<f64> {
        match self {
            Latitude | Longitude | Easting | Northing => Some(0.0),
            Scale => Some(1.0),
            Parallel1 | Parallel2 | Azimuth | GridAngle => None,
        }
    }

    /// True for lengths, in the unit of x and y.
    pub(super) fn is_length(self) -> bool {
        matches!(self, Easting | Northing)
    }

    /// Tolerance for equal values: about a millimetre on the ground.
    pub(super) fn slack(self) -> f64 {
        match self {
            Easting | Northing => 1e-3,
            Scale => 1e-10,
            _ => 1e-8,
        }
    }

    /// GeoKeys of this parameter, in any method.
    pub(super) fn keys(self) -> &'static [u16] {
        match self {
            Latitude => &[3081, 3085, 3089],
            Longitude => &[3080, 3084, 3088, 3095],
            Parallel1 => &[3078],
            Parallel2 => &[3079],
            Azimuth => &[3094],
            GridAngle => &[3096],
            Scale => &[3092, 3093],
            Easting => &[3082, 3086, 3090],
            Northing => &[3083, 3087, 3091],
        }
    }

    /// By the name of a `PARAMETER`, in any notation.
    pub(super) fn of_name(name: &str) -> Option<Self> {
        Some(match plain(name).as_str() {
            "latitudeoforigin"
            | "latitudeofcenter"
            | "latitudeofnaturalorigin"
            | "latitudeoffalseorigin"
            | "latitudeofprojectioncentre" => Latitude,
            "centralmeridian"
            | "longitudeofcenter"
            | "longitudeoforigin"
            | "longitudeofnaturalorigin"
            | "longitudeoffalseorigin"
            | "longitudeofprojectioncentre"
            | "straightverticallongitudefrompole" => Longitude,
            "standardparallel1"
            | "latitudeof1ststandardparallel"
            | "latitudeofstandardparallel" => Parallel1,
            "standardparallel2" | "latitudeof2ndstandardparallel" => Parallel2,
            "azimuth" | "azimuthofinitialline" | "azimuthatprojectioncentre" => Azimuth,
            "rectifiedgridangle" | "anglefromrectifiedtoskewgrid" => GridAngle,
            "scalefactor"
            | "scalefactoratnaturalorigin"
            | "scalefactoroninitialline"
            | "scalefactoratprojectioncentre" => Scale,
            "falseeasting" | "eastingatfalseorigin" | "eastingatprojectioncentre" => Easting,
            "falsenorthing" | "northingatfalseorigin" | "northingatprojectioncentre" => Northing,
            _ => return None,
        })
    }
}

/// Names of the latitude and longitude parameters in WKT 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CenterNaming {
    Origin,
    Center,
}

/// A projection method.
#[derive(Debug)]
pub(super) struct ProjectionMethod {
    /// GeoTIFF code.
    pub(super) code: u16,
    /// Name in WKT 1.
    pub(super) name: &'static str,
    /// Other names, letters and digits only.
    also: &'static [&'static str],
    centre: CenterNaming,
    /// Parameters, in the order of writing.
    pub(super) roles: &'static [ProjectionParameter],
}

impl PartialEq for ProjectionMethod {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl ProjectionMethod {
    /// Name of `role` in WKT 1.
    pub(super) fn parameter(&self, role: ProjectionParameter) -> &'static str {
        match (role, self.centre) {
            (Latitude, CenterNaming::Origin) => "latitude_of_origin",
            (Latitude, CenterNaming::Center) => "latitude_of_center",
            (Longitude, CenterNaming::Origin) => "central_meridian",
            (Longitude, CenterNaming::Center) => "longitude_of_center",
            (Parallel1, _) => "standard_parallel_1",
            (Parallel2, _) => "standard_parallel_2",
            (Azimuth, _) => "azimuth",
            (GridAngle, _) => "rectified_grid_angle",
            (Scale, _) => "scale_factor",
            (Easting, _) => "false_easting",
            (Northing, _) => "false_northing",
        }
    }

    /// True if the single standard parallel is the latitude of origin, whatever the file calls it.
    pub(super) fn is_tangent(&self) -> bool {
        matches!(self.code, 9 | 15)
    }

    /// By the GeoTIFF code and the parameters present.
    pub(super) fn of_code(
        code: u16,
        has: impl Fn(ProjectionParameter) -> bool,
    ) -> Option<&'static Self> {
        let mut methods = METHODS.iter().filter(|method| method.code == code);
        // Mercator has one code for both variants.
        let variant =
            methods.clone().find(|method| method.roles.contains(&Parallel1) == has(Parallel1));
        variant.or_else(|| methods.next())
    }

    /// By the WKT name and the parameters present.
    pub(super) fn of_name(
        name: &str,
        has: impl Fn(ProjectionParameter) -> bool,
    ) -> Option<&'static Self> {
        let name = plain(name);
        let code = match name.as_str() {
            // Esri has one name for both variants of each.
            "lambertconformalconic" if has(Parallel2) => 8,
            "lambertconformalconic" => 9,
            "mercator" => 7,
            name => {
                let mut methods = METHODS.iter();
                return methods
                    .find(|method| plain(method.name) == name || method.also.contains(&name));
            }
        };
        Self::of_code(code, has)
    }
}

const ORIGIN: &[ProjectionParameter] = &[Latitude, Longitude, Scale, Easting, Northing];
const PLAIN: &[ProjectionParameter] = &[Latitude, Longitude, Easting, Northing];
const TWO: &[ProjectionParameter] = &[Latitude, Longitude, Parallel1, Parallel2, Easting, Northing];
const OBLIQUE: &[ProjectionParameter] =
    &[Latitude, Longitude, Azimuth, GridAngle, Scale, Easting, Northing];
const WORLD: &[ProjectionParameter] = &[Longitude, Easting, Northing];

const fn method(
    code: u16,
    name: &'static str,
    also: &'static [&'static str],
    centre: CenterNaming,
    roles: &'static [ProjectionParameter],
) -> ProjectionMethod {
    ProjectionMethod { code, name, also, centre, roles }
}

/// All methods, by their GeoTIFF codes.
pub(super) const METHODS: &[ProjectionMethod] = {
    use CenterNaming::{Center, Origin};
    &[
        method(1, "Transverse_Mercator", &["gausskruger"], Origin, ORIGIN),
        method(3, "Hotine_Oblique_Mercator", &["hotineobliquemercatorvarianta"], Center, OBLIQUE),
        method(
            9815,
            "Hotine_Oblique_Mercator_Azimuth_Center",
            &["hotineobliquemercatorvariantb"],
            Center,
            OBLIQUE,
        ),
        method(
            7,
            "Mercator_1SP",
            &["mercatorvarianta"],
            Origin,
            &[Longitude, Scale, Easting, Northing],
        ),
        method(
            7,
            "Mercator_2SP",
            &["mercatorvariantb"],
            Origin,
            &[Parallel1, Longitude, Easting, Northing],
        ),
        method(8, "Lambert_Conformal_Conic_2SP", &["lambertconicconformal2sp"], Origin, TWO),
        method(9, "Lambert_Conformal_Conic_1SP", &["lambertconicconformal1sp"], Origin, ORIGIN),
        method(10, "Lambert_Azimuthal_Equal_Area", &[], Center, PLAIN),
        method(11, "Albers_Conic_Equal_Area", &["albers", "albersequalarea"], Center, TWO),
        method(12, "Azimuthal_Equidistant", &["modifiedazimuthalequidistant"], Center, PLAIN),
        method(13, "Equidistant_Conic", &[], Center, TWO),
        method(14, "Stereographic", &[], Origin, ORIGIN),
        method(
            15,
            "Polar_Stereographic",
            &[
                "polarstereographicvarianta",
                "polarstereographicvariantb",
                "stereographicnorthpole",
                "stereographicsouthpole",
            ],
            Origin,
            ORIGIN,
        ),
        method(16, "Oblique_Stereographic", &["doublestereographic"], Origin, ORIGIN),
        method(
            17,
            "Equirectangular",
            &["equidistantcylindrical"],
            Origin,
            &[Latitude, Longitude, Parallel1, Easting, Northing],
        ),
        method(18, "Cassini_Soldner", &["cassini"], Origin, PLAIN),
        method(19, "Gnomonic", &[], Origin, PLAIN),
        method(20, "Miller_Cylindrical", &[], Center, WORLD),
        method(21, "Orthographic", &[], Origin, PLAIN),
        method(22, "Polyconic", &["americanpolyconic"], Origin, PLAIN),
        method(23, "Robinson", &[], Center, WORLD),
        method(24, "Sinusoidal", &[], Center, WORLD),
        method(25, "VanDerGrinten", &["vandergrinteni"], Origin, WORLD),
        method(26, "New_Zealand_Map_Grid", &["newzealandmapgrid"], Origin, PLAIN),
        method(27, "Transverse_Mercator_South_Orientated", &[], Origin, ORIGIN),
        method(
            28,
            "Cylindrical_Equal_Area",
            &["lambertcylindricalequalarea"],
            Origin,
            &[Parallel1, Longitude, Easting, Northing],
        ),
    ]
};
