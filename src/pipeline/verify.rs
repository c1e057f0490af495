//! Proves a written mesh against its source grid, out of core.
