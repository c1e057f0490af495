//! Structs of options, whose values are visited by name.

use crate::codec::{AnyValue, SetValue};
use crate::table::OptionTable;

/// Looks at a value and the name of its field.
pub type Visit<'a> = dyn FnMut(&'static str, &dyn AnyValue) + 'a;
/// The same to change it.
pub type VisitMut<'a> = dyn FnMut(&'static str, &mut dyn SetValue) + 'a;

/// A struct of options; derived, never written by hand.
pub trait Options: Default {
    /// All that is said of the fields.
    const TABLE: &'static OptionTable;

    /// Looks at all values, those of groups among them, in the order of the table.
    fn visit(&self, visit: &mut Visit<'_>);

    /// The same to change them.
    fn visit_mut(&mut self, visit: &mut VisitMut<'_>);
}
