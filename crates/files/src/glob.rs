//! Wildcards in paths: `*`, `?` and `[a-z]` within a path component, and `**` as a component for any number
//! of folders.

use std::path::{Component, Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// True when `text` has a wildcard.
pub(super) fn is_pattern(text: &str) -> bool {
    text.contains(['*', '?', '['])
}

/// All paths that match `pattern`, sorted. Hidden names match only patterns that begin with a dot.
///
/// # Errors
/// A folder that cannot be read, or more paths than [`limits::MAX_MEMBERS`].
pub(super) fn expand(pattern: &Path) -> Result<Vec<PathBuf>> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let text = part.as_os_str().to_string_lossy();
        found = match part {
            Component::Normal(_) if text == "**" => {
                let below = found.iter().map(|folder| folders_below(folder));
                below.collect::<Result<Vec<_>>>()?.concat()
            }
            Component::Normal(_) if is_pattern(&text) => {
                let mut next = Vec::new();
                for folder in &found {
                    matches_in(folder, &text, &mut next)?;
                }
                next
            }
            _ => found.into_iter().map(|path| path.join(part)).collect(),
        };
    }
    found.retain(|path| path.exists());
    found.sort();
    found.dedup();
    Ok(found)
}

/// A folder and all its subfolders, parents first. Hidden folders and symbolic links, which may form cycles,
/// are skipped.
///
/// # Errors
/// A folder that cannot be read, or more folders than [`limits::MAX_MEMBERS`].
pub(super) fn folders_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let (mut found, mut next) = (vec![folder.to_path_buf()], 0);
    while let Some(folder) = found.get(next).cloned() {
        let place = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
        for entry in std::fs::read_dir(place).map_err(|e| Error::read(place, e))? {
            let entry = entry.map_err(|e| Error::read(place, e))?;
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            if is_folder && !entry.file_name().as_encoded_bytes().starts_with(b".") {
                found.push(folder.join(entry.file_name()));
                limits::check(
                    "number of folders of one input",
                    found.len() as u64,
                    limits::MAX_MEMBERS,
                )?;
            }
        }
        next += 1;
    }
    found.sort();
    Ok(found)
}

fn matches_in(folder: &Path, pattern: &str, found: &mut Vec<PathBuf>) -> Result<()> {
    let place = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if !place.is_dir() {
        return Ok(());
    }
    let pattern: Vec<char> = pattern.chars().collect();
    for entry in std::fs::read_dir(place).map_err(|e| Error::read(place, e))? {
        let name = entry.map_err(|e| Error::read(place, e))?.file_name();
        let text: Vec<char> = name.to_string_lossy().chars().collect();
        if matches(&pattern, &text) && (text.first() != Some(&'.') || pattern.first() == Some(&'.'))
        {
            found.push(folder.join(&name));
            limits::check("number of files of one input", found.len() as u64, limits::MAX_MEMBERS)?;
        }
    }
    Ok(())
}

/// Whether all of `text` matches, in time O(pattern x text).
fn matches(pattern: &[char], text: &[char]) -> bool {
    let (mut p, mut t) = (0, 0);
    // Backtracking: after the last star, which matches one more character.
    let mut retry = None;
    while t < text.len() {
        if pattern.get(p) == Some(&'*') {
            retry = Some((p + 1, t + 1));
            p += 1;
        } else if let Some(length) = one(&pattern[p..], text[t]) {
            (p, t) = (p + length, t + 1);
        } else if let Some((star, from)) = retry {
            retry = Some((star, from + 1));
            (p, t) = (star, from);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// Number of characters of `pattern` that match `c`; `None` if its first item does not match.
fn one(pattern: &[char], c: char) -> Option<usize> {
    match pattern.first()? {
        '?' => Some(1),
        '[' => match pattern.iter().skip(2).position(|p| *p == ']') {
            Some(end) => is_in(&pattern[1..end + 2], c).then_some(end + 3),
            None => (c == '[').then_some(1),
        },
        plain => (*plain == c).then_some(1),
    }
}

/// Whether `c` is in a set such as `a-z0` or `!a`.
fn is_in(set: &[char], c: char) -> bool {
    let (negated, mut rest) = match set {
        ['!' | '^', rest @ ..] if !rest.is_empty() => (true, rest),
        _ => (false, set),
    };
    let mut found = false;
    loop {
        rest = match rest {
            [low, '-', high, rest @ ..] => {
                found |= (*low..=*high).contains(&c);
                rest
            }
            [one, rest @ ..] => {
                found |= *one == c;
                rest
            }
            [] => return found != negated,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fits(pattern: &str, text: &str) -> bool {
        let chars = |s: &str| s.chars().collect::<Vec<_>>();
        matches(&chars(pattern), &chars(text))
    }

    #[test]
    fn wildcards() {
        for (pattern, text) in [
            ("*", ""),
            ("*.tif", "a.tif"),
            ("N??E*.hgt", "N41E001.hgt"),
            ("[a-c]x", "bx"),
            ("[!a]x", "bx"),
            ("a*b*c", "aXbbYc"),
            ("[]]", "]"),
            ("[", "["),
            ("é*", "één"),
        ] {
            assert!(fits(pattern, text), "{pattern} {text}");
        }
        for (pattern, text) in [
            ("*.tif", "a.tiff"),
            ("?", ""),
            ("[a-c]", "d"),
            ("[!a]", "a"),
            ("a*b", "abc"),
            ("", "a"),
        ] {
            assert!(!fits(pattern, text), "{pattern} {text}");
        }
        assert!(!fits(&"*a".repeat(30), &"a".repeat(29)));
    }

    #[test]
    fn folders_of_a_pattern() {
        let folder = tempfile::tempdir().unwrap();
        for name in
            ["x1/b.tif", "x1/a.tif", "x2/c.tif", "x2/.d.tif", "y/e.tif", "y/z/f.tif", "y/.g/h.tif"]
        {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"x").unwrap();
        }
        let names = |pattern: &str| {
            let paths = expand(&folder.path().join(pattern)).unwrap();
            let name = |p: &PathBuf| p.strip_prefix(folder.path()).unwrap().display().to_string();
            paths.iter().map(name).collect::<Vec<_>>()
        };
        assert_eq!(names("x?/*.tif"), ["x1/a.tif", "x1/b.tif", "x2/c.tif"]);
        assert_eq!(names("*/e.tif"), ["y/e.tif"]);
        assert!(names("z*").is_empty());
        let all = ["x1/a.tif", "x1/b.tif", "x2/c.tif", "y/e.tif", "y/z/f.tif"];
        assert_eq!(names("**/*.tif"), all);
        assert_eq!(names("**/**/*.tif"), all, "each once");
        assert_eq!(names("y/**/f.tif"), ["y/z/f.tif"]);
        assert_eq!(names("y/**/e.tif"), ["y/e.tif"]);
    }
}
