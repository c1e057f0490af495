//! Reports on lines and polygons.
