//! Delaunay triangulations of scattered points: exact, canonical, and local where that is enough. Pure.
