//! Lists of things that are known by name, such as formats and methods, and how one is found in them.

use crate::error::{Error, Result};

/// A thing in a list of such.
pub trait RegistryEntry: 'static {
    /// What a thing of the list is called; the last word takes an s for several.
    const KIND: &'static str;

    /// Its name.
    fn name(&self) -> &'static str;

    /// What else it may be called.
    fn aliases(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether it is offered to those who have to choose.
    fn is_offered(&self) -> bool {
        true
    }
}

/// The first of `all` that is called `name`, letter case aside.
pub fn find<T: RegistryEntry>(all: &'static [T], name: &str) -> Option<&'static T> {
    let is_it = |own: &&str| own.eq_ignore_ascii_case(name);
    all.iter().find(|thing| is_it(&thing.name()) || thing.aliases().iter().any(is_it))
}

/// As [`find`].
///
/// # Errors
/// Usage: a name of none; the known ones are listed.
pub fn named<T: RegistryEntry>(all: &'static [T], name: &str) -> Result<&'static T> {
    find(all, name).ok_or_else(|| {
        let several = T::KIND.rsplit(' ').next().unwrap_or_default();
        Error::usage(format!("unknown {} \"{name}\"", T::KIND)).remedy(format!(
            "known {several}s are {}",
            offered(all, |thing| thing.name().to_owned())
        ))
    })
}

/// What `text` says of each that is offered, in a row, and the same only once.
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
