//! Datasets held in memory under a name such as `memory:7`, used in place of a file name.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use terrane_base::error::{Error, Result};

use super::lock::lock;

/// Prefix of names of datasets in memory.
const HELD_PREFIX: &str = "memory:";
/// Prefix of names of synthetic datasets.
const RULE_PREFIX: &str = "synth:";

/// True for names that are not files: synthetic datasets and datasets in memory.
pub fn is_made(input: &str) -> bool {
    input.starts_with(RULE_PREFIX) || is_held(input)
}

/// True for names of datasets in memory, which other processes cannot read.
pub fn is_held(input: &str) -> bool {
    input.starts_with(HELD_PREFIX)
}

/// Fails if one of `inputs` is held in memory, for jobs whose inputs are read by other processes.
///
/// # Errors
/// Usage: an input is in memory.
pub fn refuse_held<'a>(inputs: impl IntoIterator<Item = &'a String>) -> Result<()> {
    match inputs.into_iter().any(|input| is_held(input)) {
        true => Err(Error::usage("datasets in memory cannot be passed to other processes")
            .remedy("write the dataset to a file and plan with the file")),
        false => Ok(()),
    }
}

/// The datasets of one type, by name.
pub struct HeldRegister<T>(Mutex<BTreeMap<String, Arc<T>>>);

/// Handle of a dataset in memory. Dropping it removes the name; open readers keep the data.
pub struct HeldResource<T: 'static> {
    register: &'static HeldRegister<T>,
    name: String,
}

/// Names are unique across all types.
static NEXT: AtomicU64 = AtomicU64::new(1);

impl<T> HeldRegister<T> {
    /// An empty register.
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// Registers `thing` under a new name.
    pub fn hold(&'static self, thing: T) -> HeldResource<T> {
        let name = format!("{HELD_PREFIX}{}", NEXT.fetch_add(1, Ordering::Relaxed));
        lock(&self.0).insert(name.clone(), Arc::new(thing));
        HeldResource { register: self, name }
    }

    /// The dataset called `name`.
    ///
    /// # Errors
    /// Usage: no such dataset.
    pub fn get(&self, name: &str) -> Result<Arc<T>> {
        let nothing = || Error::usage(format!("no dataset {name:?} of this kind is in memory"));
        lock(&self.0).get(name).cloned().ok_or_else(nothing)
    }
}

impl<T> HeldResource<T> {
    /// The name of the dataset.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl<T> Drop for HeldResource<T> {
    fn drop(&mut self) {
        lock(&self.register.0).remove(&self.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static WORDS: HeldRegister<&str> = HeldRegister::new();

    #[test]
    fn things_are_held_as_long_as_their_holder_lives() {
        let [one, two] = ["one", "two"].map(|word| WORDS.hold(word));
        assert_ne!(one.name(), two.name());
        let open = WORDS.get(one.name()).unwrap();
        let name = one.name().to_owned();
        drop(one);
        assert_eq!(*open, "one");
        assert!(WORDS.get(&name).is_err() && WORDS.get("one").is_err());
        assert_eq!(*WORDS.get(two.name()).unwrap(), "two");
        assert!(is_made(two.name()) && is_made("synth:rough") && !is_made("rough.tif"));
        assert!(refuse_held(&["a.tif".to_owned(), name]).is_err());
    }
}
