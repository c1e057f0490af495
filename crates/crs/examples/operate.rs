//! Brings positions from one system to another: `operate SOURCE TARGET [everywhere]`, positions as
//! lines "x y" on stdin. The first line of the output says the operation: its accuracy and its name. With
//! `everywhere`, it is not chosen by where the positions are.

use std::io::{BufRead, Write};

use terrane_base::error::{Error, Result};
use terrane_base::geom::wkt;
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions};

fn main() {
    if let Err(error) = run() {
        eprintln!("{error}");
        std::process::exit(i32::from(error.kind().exit_code()));
    }
}

fn run() -> Result<()> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let [from, to, rest @ ..] = names.as_slice() else {
        return Err(Error::usage("expected two CRSs"));
    };
    let mut positions = Vec::new();
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|_| Error::bad_input("cannot read positions"))?;
        let numbers: Vec<f64> =
            line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [x, y] = numbers[..] else {
            return Err(Error::bad_input("expected two numbers").at(line));
        };
        positions.push([x, y]);
    }
    let mut extent = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
    for [x, y] in &positions {
        extent = [extent[0].min(*x), extent[1].min(*y), extent[2].max(*x), extent[3].max(*y)];
    }
    let extent = (rest.is_empty() && !positions.is_empty()).then_some(extent);
    let options = CoordinateOperationOptions { extent, ..CoordinateOperationOptions::default() };
    let operation = CoordinateOperation::between(&wkt::of_srs(from), &wkt::of_srs(to), &options)?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut say =
        |text: String| writeln!(out, "{text}").map_err(|_| Error::bad_input("cannot write"));
    say(format!("{:?} {}", operation.accuracy(), operation.name()))?;
    for at in positions {
        match operation.position(at) {
            Ok([x, y]) => say(format!("{x} {y}"))?,
            Err(error) => say(format!("error {error}"))?,
        }
    }
    Ok(())
}
