//! Arcs.
