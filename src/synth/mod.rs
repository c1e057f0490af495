//! Synthetic terrain from a seed: any window of any size, computed on its own. Pure.
