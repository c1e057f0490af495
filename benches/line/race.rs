//! One method once: what `benches/line_peers.py` races against other programs.
//!
//! The environment variable TERRANE_LINE_RACE holds `METHOD TOLERANCE OUTPUT`. Chains come from
//! TERRANE_COAST and TERRANE_COAST_OFFSETS (starts, little-endian u64; one chain without it). METHOD is one of
//! the registry, or one that bounds a distance followed by `+topology`, or `hierarchy`: one of each chain is
//! made before, and asked. The line printed is
//! `method,tolerance,seconds,vertices`: processor seconds of the thread, the least of three calls (of
//! one where that takes three seconds). OUTPUT gets, for each chain, the number of vertices kept and their
//! indices, as u32.

use std::fs;

use terrane_line::topology::{Chains, RetainedChainVertices, UntangleOptions, refining, untangle};
use terrane_line::{Hierarchy, METHODS, PlaneMetric, SimplifyMethod, SimplifyScratch, Xy};

/// Questions to a hierarchy that are timed together: one is shorter than the clock tells.
const QUESTIONS: u32 = 50;

/// What asks stored hierarchies.
const STORED: &str = "hierarchy";

/// A method as told, and where its output goes.
struct Race {
    told: String,
    method: &'static SimplifyMethod,
    is_clean: bool,
    tolerance: f64,
    output: String,
}

impl Race {
    fn from_env() -> Option<Self> {
        let told = std::env::var("TERRANE_LINE_RACE").ok()?;
        let mut words = told.splitn(3, ' ').map(String::from);
        let mut word = || words.next().expect("TERRANE_LINE_RACE=\"METHOD TOLERANCE OUTPUT\"");
        let (told, tolerance, output) = (word(), word(), word());
        let name = if told == STORED { "rdp" } else { told.trim_end_matches("+topology") };
        let method = METHODS.iter().find(|method| method.name == name).expect("a known method");
        let tolerance = tolerance.parse().expect("a number");
        Some(Self { is_clean: name != told, told, method, tolerance, output })
    }

    /// The least processor seconds of three calls, and the vertices kept of all chains.
    fn time(&self, chains: &Chains<'_>) -> (f64, RetainedChainVertices) {
        let (mut least, mut spent, mut kept) =
            (f64::INFINITY, 0.0, RetainedChainVertices::default());
        for _ in 0..3 {
            let before = processor();
            kept = self.run(chains);
            let seconds = processor() - before;
            (least, spent) = (least.min(seconds), spent + seconds);
            if spent > 3.0 {
                break;
            }
        }
        (least, kept)
    }

    /// The same of hierarchies that are made before.
    fn ask(&self, chains: &Chains<'_>) -> (f64, RetainedChainVertices) {
        let own = |ends: &[usize]| Hierarchy::new(&PlaneMetric, &chains.points[ends[0]..ends[1]]);
        let all: Vec<Hierarchy> = chains.starts.windows(2).map(own).collect();
        let (mut least, mut kept) = (f64::INFINITY, RetainedChainVertices::new());
        for _ in 0..3 {
            let mut found = Vec::new();
            let before = processor();
            for _ in 0..QUESTIONS {
                found.clear();
                all.iter().for_each(|hierarchy| hierarchy.filter(self.tolerance, &mut found));
            }
            least = least.min((processor() - before) / f64::from(QUESTIONS));
        }
        for (hierarchy, start) in all.iter().zip(chains.starts) {
            let at = kept.vertices.len();
            hierarchy.filter(self.tolerance, &mut kept.vertices);
            kept.vertices[at..].iter_mut().for_each(|vertex| *vertex += *start as u32);
            kept.close();
        }
        (least, kept)
    }

    /// The vertices kept of all chains.
    fn run(&self, chains: &Chains<'_>) -> RetainedChainVertices {
        let mut scratch = SimplifyScratch::default();
        let method = self.method.plane;
        let mut refine = refining(chains.points, |part, kept| {
            method(&PlaneMetric, part, self.tolerance, &mut scratch, kept);
        });
        let kept = RetainedChainVertices::simplified(chains, &mut refine);
        match self.is_clean {
            true => {
                untangle(chains, &kept, &[], &UntangleOptions::default(), &mut refine)
                    .expect("sound chains")
                    .kept
            }
            false => kept,
        }
    }
}

/// Runs what the environment tells, if it does.
pub(crate) fn is_from_env(points: &[Xy]) -> bool {
    let Some(race) = Race::from_env() else { return false };
    let starts = starts(points.len());
    let closed = vec![starts.len() > 2; starts.len() - 1];
    let chains = Chains { points, starts: &starts, closed: &closed };
    let (least, kept) = if race.told == STORED { race.ask(&chains) } else { race.time(&chains) };
    let mut words: Vec<u32> = Vec::new();
    for (chain, start) in starts.iter().take(chains.count()).enumerate() {
        let own = kept.of(chain);
        words.push(own.len() as u32);
        words.extend(own.iter().map(|i| i - *start as u32));
    }
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    fs::write(&race.output, bytes).expect("a file that can be written");
    let vertices = words.len() - chains.count();
    println!("{},{},{least},{vertices}", race.told, race.tolerance);
    true
}

/// Where chains begin, and the last ends.
pub(crate) fn starts(count: usize) -> Vec<usize> {
    let Some(path) = std::env::var_os("TERRANE_COAST_OFFSETS") else { return vec![0, count] };
    let bytes = fs::read(path).expect("a file of starts");
    let word = |at: &[u8]| u64::from_le_bytes(at.try_into().expect("eight bytes")) as usize;
    bytes.chunks_exact(8).map(word).collect()
}

/// Processor seconds of the thread, from Linux.
fn processor() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").expect("needs Linux");
    let nanoseconds = text.split(' ').next().and_then(|word| word.parse().ok());
    nanoseconds.map_or(f64::NAN, |nanoseconds: f64| nanoseconds * 1e-9)
}
