//! What terrane's kernels take: `cargo bench --bench kernels` and so on. A package of its own, so that tests need
//! not build what measures them.
