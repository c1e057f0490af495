//! Draws a grid or a mesh as a shaded relief picture.
