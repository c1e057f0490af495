//! Reports on point clouds.
