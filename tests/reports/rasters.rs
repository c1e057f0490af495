//! Reports on rasters and meshes of them.
