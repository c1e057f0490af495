//! Registries of named entries, such as formats and methods.

use crate::error::{Error, Result};

/// An entry of a registry.
pub trait RegistryEntry: 'static {
    /// Noun for the entries; the plural adds an s to the last word.
    const KIND: &'static str;

    /// Its name.
    fn name(&self) -> &'static str;

    /// Other names.
    fn aliases(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether it is listed in help and messages.
    fn is_offered(&self) -> bool {
        true
    }
}

/// The first entry called `name`, ignoring letter case.
pub fn find<T: RegistryEntry>(all: &'static [T], name: &str) -> Option<&'static T> {
    all.iter().find(|entry| {
        let mut names = std::iter::once(entry.name()).chain(entry.aliases().iter().copied());
        names.any(|known| known.eq_ignore_ascii_case(name))
    })
}

/// Like [`find`].
///
/// # Errors
/// Usage: an unknown name; the message lists the known ones.
pub fn named<T: RegistryEntry>(all: &'static [T], name: &str) -> Result<&'static T> {
    find(all, name).ok_or_else(|| {
        let several = T::KIND.rsplit(' ').next().unwrap_or_default();
        Error::usage(format!("unknown {} \"{name}\"", T::KIND)).remedy(format!(
            "known {several}s are {}",
            offered(all, |thing| thing.name().to_owned())
        ))
    })
}

/// The `text` of all listed entries, separated by commas, without consecutive duplicates.
pub fn offered<T: RegistryEntry>(all: &[T], text: impl Fn(&T) -> String) -> String {
    let mut texts: Vec<String> = all.iter().filter(|thing| thing.is_offered()).map(text).collect();
    texts.dedup();
    texts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Tool(&'static str, &'static [&'static str]);

    impl RegistryEntry for Tool {
        const KIND: &'static str = "garden tool";

        fn name(&self) -> &'static str {
            self.0
        }

        fn aliases(&self) -> &'static [&'static str] {
            self.1
        }

        fn is_offered(&self) -> bool {
            self.0 != "axe"
        }
    }

    const TOOLS: &[Tool] = &[Tool("Rake", &[]), Tool("spade", &["shovel"]), Tool("axe", &[])];

    #[test]
    fn things_are_found_by_any_of_their_names() {
        let found = |name| find(TOOLS, name).map(|tool| tool.0);
        assert_eq!((found("rake"), found("SHOVEL")), (Some("Rake"), Some("spade")));
        assert_eq!((found("axe"), found("hoe"), found("")), (Some("axe"), None, None));
        let told = named(TOOLS, "hoe").err().unwrap().to_string();
        assert!(told.contains("unknown garden tool \"hoe\""), "{told}");
        assert!(told.contains("known tools are Rake, spade") && !told.contains("axe"), "{told}");
    }
}
