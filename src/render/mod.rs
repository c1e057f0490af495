//! Pictures of grids and meshes: shaded relief in a pixel buffer. Pure.
