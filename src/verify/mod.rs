//! Independent proof of a mesh's promises: error bound, coverage, topology. Pure; shares no code
//! with `tin`.
