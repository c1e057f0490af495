//! Visitors of option values by name.

use crate::codec::{AnyValue, SetValue};
use crate::table::OptionTable;

/// Visitor of values with the names of their fields.
pub type Visit<'a> = dyn FnMut(&'static str, &dyn AnyValue) + 'a;
/// Mutable visitor.
pub type VisitMut<'a> = dyn FnMut(&'static str, &mut dyn SetValue) + 'a;

/// A struct of options; always derived.
pub trait Options: Default {
    /// Descriptions of the fields.
    const TABLE: &'static OptionTable;

    /// Visits all values, including those of groups, in the order of the table.
    fn visit(&self, visit: &mut Visit<'_>);

    /// Visits all values mutably.
    fn visit_mut(&mut self, visit: &mut VisitMut<'_>);
}
