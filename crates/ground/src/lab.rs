//! lab
use crate::*;
use crate::csf::*;
pub fn run(name: &str, lows: &Lows, args: &[f64]) -> Option<Ground> {
    let h = lows.heights();
    let w = lows.width;
    let step = lows.step[2];
    match name {
        "csf" => {
            let c = Cloth { rigidness: args[0] as u32, time_step: 0.65, iterations: 500, mend: true };
            let s = settled(&h, w, &c);
            Some(wide(&s, w, step, |_| 0.5))
        }
        "filter" => {
            let p = crate::filter::Parameters::metres(lows.cell, step);
            let m: Vec<i32> = lows.points.iter().map(|p| p.z).collect();
            Some(crate::filter::ground(&m, w, &p))
        }
        "ptd" => {
            // seed angle dist spacing tol
            use crate::ptd::*;
            let p = in_millimetres(lows);
            let side = (args[0] / lows.cell).ceil() as usize;
            let l = Limits { sine: args[1].to_radians().sin(), distance: args[2], spacing: args[3] };
            let g = densified(&p, seeds(&p, w, side), w, lows.cell, &l);
            let v = vertices(&p, &g, w, lows.cell);
            let s = surface(&v, w, p.len() / w, lows.cell);
            Some(Ground::new(w, s.into_iter().map(|z| z / step).collect(), |_| args[4] / step))
        }
        "mix" => {
            // 0 seed 1 angle 2 dist | 3 near cloth | 4 angle 5 dist 6 spacing | 7 tol | 8 tolslope
            use crate::ptd::*;
            let p = in_millimetres(lows);
            let side = (args[0] / lows.cell).ceil() as usize;
            let l = Limits { sine: args[1].to_radians().sin(), distance: args[2], spacing: 0.0 };
            let g = densified(&p, seeds(&p, w, side), w, lows.cell, &l);
            let c = Cloth { rigidness: 3, time_step: 0.65, iterations: 500, mend: true };
            let s = settled(&h, w, &c);
            let both: Vec<usize> = g.into_iter().filter(|&k| (h[k] - s[k]).abs() <= args[3]).collect();
            let l = Limits { sine: args[4].to_radians().sin(), distance: args[5], spacing: args[6] };
            let g = densified(&p, both, w, lows.cell, &l);
            let v = vertices(&p, &g, w, lows.cell);
            let s = surface(&v, w, p.len() / w, lows.cell);
            Some(Ground::new(w, s.into_iter().map(|z| z / step).collect(), |sl| (args[7] + args[8] * sl * step) / step))
        }
        _ => None,
    }
}
pub fn wide(s: &[f64], w: usize, step: f64, tol: impl Fn(f64) -> f64) -> Ground {
    let ww = w + 2;
    let mut o = vec![f64::NAN; ww * (s.len() / w + 2)];
    for (r, l) in s.chunks(w).enumerate() { for (c, v) in l.iter().enumerate() { o[(r + 1) * ww + c + 1] = v / step; } }
    Ground::new(w, o, |sl| tol(sl * step) / step)
}
/// heights at 1 m centres
pub fn dtm(points: &[terrane_base::geom::Point], x0: i32, y0: i32, w: usize, h: usize) -> Vec<f64> {
    let t = terrane_delaunay::Hull::of(points.to_vec());
    let mut tin = crate::tin::Tin::new(points).unwrap();
    let mut o = vec![f64::NAN; w * h];
    for r in 0..h { for c in 0..w {
        let (x, y) = (x0 + c as i32 * 1000 + 500, y0 + r as i32 * 1000 + 500);
        if t.place(terrane_delaunay::Position::of([x, y])) != terrane_delaunay::Place::Inside { continue; }
        if let Some((_, k)) = tin.around([x, y]) { o[r * w + c] = crate::tin::height_of(&k, [x as f64, y as f64]) / 1000.0; }
    } }
    o
}
