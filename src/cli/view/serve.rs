//! `terrane view --serve`: serves a page to browsers on this machine until a signal.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::ViewArgs;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::verb::VerbCall;
use crate::cli::shared::{VerbOutcome, report, text};
use terrane_base::error::{Error, Result};
use terrane_engine::skip_bad::Skipped;
use terrane_files::folder_for;
use terrane_viewer::page::PageReport;
use terrane_viewer::serve::{ServedSite, Server};

/// Message when the server is ready.
#[derive(Serialize)]
struct ServeReport<'a> {
    url: &'a str,
    port: u16,
    #[serde(flatten)]
    page: report::WithSkipped<'a, PageReport>,
}

impl ViewArgs {
    /// Makes a page, and serves it with the files of a folder until it is cancelled. The page is a temporary
    /// file, because it may be large.
    pub(super) fn serve(
        &self,
        temp_dir: Option<&Path>,
        folder: Option<PathBuf>,
        call: &VerbCall<'_>,
        make: impl FnOnce(&Path) -> Result<(PageReport, Vec<Skipped>)>,
    ) -> Result<VerbOutcome> {
        let default = std::env::temp_dir().join("page");
        let parent = folder_for(&default, temp_dir);
        let temp = tempfile::tempdir_in(parent).map_err(|e| Error::write(parent, e))?;
        let file = temp.path().join("page.html");
        let (mut made, skipped) = make(&file)?;
        let server = Server::open(&ServedSite { page: file, folder }, self.port)?;
        let url = server.url();
        made.output.clone_from(&url);
        let report = ServeReport {
            url: &url,
            port: server.port(),
            page: report::WithSkipped { report: &made, skipped: &skipped },
        };
        self.show.print(&report, || {
            format!("{}{}", made.summary(), text::table(&[("until", "Ctrl-C".to_owned())]))
        })?;
        server.run(call.cancel);
        Ok(VerbOutcome::Kept)
    }
}
