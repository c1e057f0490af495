//! Reports on printed models.
