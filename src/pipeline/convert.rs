//! Copies any grid into terrane's own store.
