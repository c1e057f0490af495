//! `terrane view --serve`: a page for browsers on this machine, until a signal comes.

use std::path::Path;

use serde::Serialize;

use super::{Args, page};
use crate::cli::shared::{Outcome, report, text};
use crate::error::{Error, Result};
use crate::files::{folder_for, path_of};
use crate::jobs::page::{PageReport, Show};
use crate::jobs::sift::Skipped;
use crate::jobs::{Cancel, Resources};
use terrane_serve::{Server, Site};

/// What is told once browsers can come.
#[derive(Serialize)]
struct ServeReport<'a> {
    url: &'a str,
    port: u16,
    #[serde(flatten)]
    page: report::WithSkipped<'a, PageReport>,
}

/// Makes the page, and serves it until it is cancelled. The page is a file until then: it may be large.
pub(super) fn run(
    args: &Args,
    show: Show,
    skipped: &[Skipped],
    resources: Resources,
    cancel: &Cancel,
) -> Result<Outcome> {
    let folder = (show == Show::Tiles).then(|| path_of(&args.input[0]).into_owned());
    let beside = std::env::temp_dir().join("page");
    let place = folder_for(&beside, resources.temp_dir.as_deref());
    let place = tempfile::tempdir_in(place).map_err(|e| Error::write(place, e))?;
    let file = place.path().join("page.html");
    let mut made = page::make(args, show, &file, resources, cancel)?;
    let server = Server::open(&Site { page: file, folder }, args.port)?;
    let url = server.url();
    made.output.clone_from(&url);
    let told = ServeReport {
        url: &url,
        port: server.port(),
        page: report::WithSkipped { report: &made, skipped },
    };
    args.show.tell(&told, || {
        format!("{}{}", page::summary(&made), text::table(&[("until", "Ctrl-C".to_owned())]))
    })?;
    server.run(cancel);
    Ok(Outcome::Kept)
}

/// True where the one input is a folder of tiles.
pub(super) fn are_tiles(inputs: &[String]) -> bool {
    let is_tiles = |input: &String| crate::jobs::page::is_tiles(Path::new(&*path_of(input)));
    matches!(inputs, [one] if is_tiles(one))
}

/// Fails when tiles are to be anything but served, and for options that do nothing for them.
pub(super) fn check_tiles(args: &Args) -> Result<()> {
    if !args.serve {
        return Err(Error::usage("a folder of tiles is looked at as a server sends it")
            .in_file(&path_of(&args.input[0]))
            .remedy("pass --serve, in place of -o or --html"));
    }
    let given = [
        ("--insertion", args.insertion),
        ("--against", args.against.is_some()),
        ("--layer", args.layer.is_some()),
    ];
    page::refuse("tiles", args, &given)
}
