//! Reports on tiles of the globe.
