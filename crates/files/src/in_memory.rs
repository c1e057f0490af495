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
    input.starts_with(RULE_PREFIX) || is_in_memory(input)
}

/// True for names of datasets in memory, which other processes cannot read.
pub fn is_in_memory(input: &str) -> bool {
    input.starts_with(HELD_PREFIX)
}

/// Fails if one of `inputs` is held in memory, for jobs whose inputs are read by other processes.
///
/// # Errors
/// Usage: an input is in memory.
pub fn refuse_in_memory<'a>(inputs: impl IntoIterator<Item = &'a String>) -> Result<()> {
    match inputs.into_iter().any(|input| is_in_memory(input)) {
        true => Err(Error::usage("datasets in memory cannot be passed to other processes")
            .remedy("write the dataset to a file and plan with the file")),
        false => Ok(()),
    }
}

/// The datasets of one type, by name.
pub struct InMemoryRegistry<T>(Mutex<BTreeMap<String, Arc<T>>>);

/// Handle of a dataset in memory. Dropping it removes the name; open readers keep the data.
pub struct InMemoryResource<T: 'static> {
    register: &'static InMemoryRegistry<T>,
    name: String,
}

/// Names are unique across all types.
static NEXT: AtomicU64 = AtomicU64::new(1);

impl<T> InMemoryRegistry<T> {
    /// An empty register.
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// Registers `thing` under a new name.
    pub fn register(&'static self, thing: T) -> InMemoryResource<T> {
        let name = format!("{HELD_PREFIX}{}", NEXT.fetch_add(1, Ordering::Relaxed));
        lock(&self.0).insert(name.clone(), Arc::new(thing));
        InMemoryResource { register: self, name }
    }

    /// The dataset called `name`.
    ///
    /// # Errors
    /// Usage: no such dataset.
    pub fn get(&self, name: &str) -> Result<Arc<T>> {
        lock(&self.0)
            .get(name)
            .cloned()
            .ok_or_else(|| Error::usage(format!("no dataset {name:?} of this kind is in memory")))
    }
}

impl<T> InMemoryResource<T> {
    /// The name of the dataset.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl<T> Drop for InMemoryResource<T> {
    fn drop(&mut self) {
        lock(&self.register.0).remove(&self.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static WORDS: InMemoryRegistry<&str> = InMemoryRegistry::new();

    #[test]
    fn things_are_held_as_long_as_their_holder_lives() {
        let [one, two] = ["one", "two"].map(|word| WORDS.register(word));
        assert_ne!(one.name(), two.name());
        let open = WORDS.get(one.name()).unwrap();
        let name = one.name().to_owned();
        drop(one);
        assert_eq!(*open, "one");
        assert!(WORDS.get(&name).is_err() && WORDS.get("one").is_err());
        assert_eq!(*WORDS.get(two.name()).unwrap(), "two");
        assert!(is_made(two.name()) && is_made("synth:rough") && !is_made("rough.tif"));
        assert!(refuse_in_memory(&["a.tif".to_owned(), name]).is_err());
    }
}
