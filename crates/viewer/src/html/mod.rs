//! Interactive pages: one self-contained HTML file each.
//!
//! A page is a [`Template`] (markup, style and scripts of `web/`, all our own), facts as JSON, and arrays of
//! whole numbers, packed ([`pack`]). Its Content-Security-Policy lets only its own script run and nothing be
//! fetched; every text from outside is escaped where it is put in.
//!
//! Scripts of one page share one scope. `tools/web` opens pages in a browser and compares what they show with the files.

pub mod pack;
mod parts;

pub use parts::{HtmlPage, TEMPLATES, Template, escape};
