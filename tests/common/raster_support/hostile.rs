//! Reading files that may be damaged in any way, and damaging them.

use std::any::Any;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use terrane_base::error::Result;

use super::attempt::attempt;

/// Far below what any of the lying headers asks for.
pub(crate) const MAX_MEMORY: u64 = 512 << 20;
/// A file that takes longer is one that hangs.
const PATIENCE: Duration = Duration::from_secs(10);

/// As [`attempt`]; a panic, or more time than [`PATIENCE`], is told as text.
pub(crate) fn guarded(path: &Path) -> std::result::Result<Result<Vec<f64>>, String> {
    let (tell, hear) = mpsc::channel();
    let path = path.to_path_buf();
    let reader = std::thread::spawn(move || drop(tell.send(attempt(&path))));
    match hear.recv_timeout(PATIENCE) {
        Ok(outcome) => Ok(outcome),
        Err(mpsc::RecvTimeoutError::Timeout) => Err("reading hangs".to_owned()),
        Err(mpsc::RecvTimeoutError::Disconnected) => Err(text_of(reader.join().err())),
    }
}

fn text_of(panic: Option<Box<dyn Any + Send>>) -> String {
    let text = panic.as_ref().and_then(|panic| panic.downcast_ref::<String>().cloned());
    let text = text.or_else(|| Some((*panic?.downcast_ref::<&str>()?).to_owned()));
    text.unwrap_or_else(|| "panicked".to_owned())
}

/// A small generator of repeatable numbers (xorshift).
pub(crate) struct Random(u64);

impl Random {
    /// The generator of mutation `number`.
    pub(crate) fn of(number: usize) -> Self {
        Self((number as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    pub(crate) fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % most as u64) as usize
    }
}

/// Changes a few bytes, to anything or to values that tend to hurt; sometimes moves a piece, cuts
/// the end or adds one.
pub(crate) fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len());
        bytes[at] = match random.below(4) {
            0 => 0,
            1 => 0xff,
            2 => bytes[at] ^ (1 << random.below(8)),
            _ => random.below(256) as u8,
        };
    }
    match random.below(18) {
        0 | 1 => bytes.truncate(1 + random.below(bytes.len())),
        2 => lengthen(bytes, random),
        3 => repeat_piece(bytes, random),
        4..=7 => put_number(bytes, random),
        8 | 9 => put_word(bytes, random),
        _ => {}
    }
}

fn lengthen(bytes: &mut Vec<u8>, random: &mut Random) {
    let more = 1 + random.below(100);
    bytes.extend((0..more).map(|_| random.below(256) as u8));
}

fn repeat_piece(bytes: &mut [u8], random: &mut Random) {
    let most = bytes.len() - random.below(bytes.len());
    let from = random.below(most);
    let to = random.below(most);
    let length = random.below(32).min(bytes.len() - from.max(to));
    bytes.copy_within(from..from + length, to);
}

/// Writes a number that tends to hurt, in any width and byte order.
fn put_number(bytes: &mut [u8], random: &mut Random) {
    let length = bytes.len() as u64;
    let numbers = [0, 1, 8, 0x7fff, 0x7fff_ffff, u64::MAX >> 1, u64::MAX, length, length - 1];
    let number = numbers[random.below(numbers.len())];
    let width = [2, 4, 8][random.below(3)].min(bytes.len());
    let at = random.below(bytes.len() - width + 1);
    let place = &mut bytes[at..at + width];
    place.copy_from_slice(&number.to_le_bytes()[..width]);
    if random.below(2) == 0 {
        place.reverse();
    }
}

/// Writes a word that tends to hurt where numbers are text.
fn put_word(bytes: &mut [u8], random: &mut Random) {
    const WORDS: [&str; 12] = [
        "0",
        "-1",
        "99999999999",
        "4294967296",
        "1e999",
        "-1e-999",
        "nan",
        "inf",
        "1,5",
        "\n\n",
        " ",
        "\0",
    ];
    let word = WORDS[random.below(WORDS.len())].as_bytes();
    let length = word.len().min(bytes.len());
    let at = random.below(bytes.len() - length + 1);
    bytes[at..at + length].copy_from_slice(&word[..length]);
}
