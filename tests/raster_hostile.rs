//! Damaged files and header lies: a right answer or an error, quickly, in bounded memory, no panic.

mod raster_support;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use raster_support::{data_folder, open_band, read_all};

fn attempt(path: &Path) -> String {
    match open_band(path, 1) {
        Ok(s) => match read_all(s.as_ref()) { Ok(v) => format!("OK {}x{} {}", s.info().width, s.info().height, v.iter().filter(|v| !v.is_nan()).sum::<f64>()), Err(e)=>format!("READ {e}") },
        Err(e) => format!("OPEN {e}"),
    }
}

#[test]
fn corpus() {
    let Some(folder) = data_folder() else { return };
    for part in ["malformed/tiff", "malformed/grid"] {
        let mut v: Vec<_> = std::fs::read_dir(folder.join(part)).unwrap().map(|e| e.unwrap().path()).collect();
        v.sort();
        for path in v {
            let r = catch_unwind(AssertUnwindSafe(|| attempt(&path)));
            println!("{}", r.unwrap_or_else(|_| format!("PANIC {path:?}")).replace("/work/shared/data/", ""));
        }
    }
}
