//! Which method makes a mesh of a grid: the engine's own, or one of the textbooks.

use crate::cli::shared::lists::ENGINE;
use crate::cli::tin::args::{Args, Method};
use crate::error::{Error, Result};
use crate::jobs::tin::{Goal, Textbook, TinReport};
use crate::methods::{self, METHODS};

/// What was chosen.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct Chosen {
    /// How the mesh is made, by one of the methods below; all but the engine's own hold the whole grid in
    /// memory [default: greedy]
    #[arg(long, value_name = "NAME", value_parser = parse_method)]
    pub(crate) method: Option<By>,
}

/// A method by name.
#[derive(Clone, Copy, Debug)]
pub(crate) enum By {
    Engine,
    Textbook(&'static methods::Method),
}

fn parse_method(name: &str) -> std::result::Result<By, String> {
    if name.eq_ignore_ascii_case(ENGINE) {
        return Ok(By::Engine);
    }
    let found = METHODS.iter().find(|method| method.name.eq_ignore_ascii_case(name));
    found.map(By::Textbook).ok_or_else(|| {
        let names: Vec<&str> = METHODS.iter().map(|method| method.name).collect();
        format!("unknown method \"{name}\"; known methods are {ENGINE}, {}", names.join(", "))
    })
}

impl Chosen {
    /// The method, if it is not the engine's own.
    pub(crate) fn by(self, args: &Args) -> Option<Textbook> {
        let triangulation = args.method.triangulation.unwrap_or_default();
        match self.method {
            Some(By::Textbook(method)) => Some(Textbook { method, triangulation }),
            Some(By::Engine) | None => None,
        }
    }

    /// Fails when an option was given that the method does not know, or that is not for several bands.
    pub(crate) fn check(self, args: &Args) -> Result<()> {
        args.bands.refuse_beside(&[("--method", self.method.is_some())])?;
        args.bands.refuse_beside(&[("--triangulation", args.method.triangulation.is_some())])?;
        args.bands.refuse_beside(&engine_options(args))?;
        let Some(Textbook { method, .. }) = self.by(args) else {
            return args.method.check_triangulation();
        };
        let open = !method.takes_triangulation && args.method.triangulation.is_some();
        let options = engine_options(args);
        let options = [("--triangulation", open)].into_iter().chain(options);
        if let Some((option, _)) = options.into_iter().find(|(_, given)| *given) {
            return Err(unknown(option, method.name));
        }
        match args.goal.goal()? {
            Goal::MaxVertices(_) if !method.takes_budget => {
                Err(unknown("--max-vertices", method.name))
            }
            Goal::MaxTriangles(_) if !method.takes_budget => {
                Err(unknown("--max-triangles", method.name))
            }
            _ => Ok(()),
        }
    }
}

/// Options that the engine alone knows, and whether they were given.
pub(super) fn engine_options(args: &Args) -> Vec<(&'static str, bool)> {
    let Method { keep_points, breaklines, .. } = &args.method;
    let all = [
        ("--workdir", args.workdir.is_some()),
        ("--split", args.split.tiles.is_some()),
        ("--keep-points", keep_points.is_some()),
        ("--breaklines", breaklines.is_some()),
    ];
    all.into_iter().chain(args.method.engine_options()).collect()
}

pub(super) fn unknown(option: &str, method: &str) -> Error {
    let instead = match option {
        "--triangulation" | "--triangulation split3" => {
            "leave it out, or choose a method that leaves the triangulation open"
        }
        "--max-vertices" | "--max-triangles" => "pass --max-error instead",
        _ => "leave it out, or leave out --method",
    };
    Error::usage(format!("the method {method} has no {option}")).remedy(instead)
}

/// The method of a report, where there is something to say of it.
pub(super) fn told(report: &TinReport) -> Option<String> {
    let (method, triangulation) = (report.method.as_deref(), report.triangulation.as_deref());
    let method = method.or(triangulation.map(|_| ENGINE))?;
    Some([Some(method), triangulation].into_iter().flatten().collect::<Vec<_>>().join(", "))
}
