//! A mesh of heights in memory.
//!
//! `cargo run --example tin_from_array`

use terrane::prelude::*;

fn main() -> terrane::Result<()> {
    let (width, height) = (400, 300);
    let hill = |i: u32| {
        let (x, y) = (f64::from(i % width) - 200.0, f64::from(i / width) - 150.0);
        120.0 * (-(x * x + y * y) / 8000.0).exp()
    };
    let heights: Vec<f64> = (0..width * height).map(hill).collect();

    let tin = terrane::Tin::from_array(&heights, width, height)?.max_error(0.5).build()?;

    println!("{} samples, {} vertices", heights.len(), tin.vertices().len());
    println!(
        "{} triangles, none of the samples further than {}",
        tin.triangles().len(),
        tin.max_error()
    );
    assert!(tin.max_error() <= 0.5);
    Ok(())
}
