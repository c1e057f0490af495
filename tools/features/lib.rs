//! Nothing but a list of features (`Cargo.toml`): the tests and the Python package each turn on some that the other
//! does not, of crates that nearly all others are built upon. Where both ask for all of these, what was built for the
//! tests is taken for the package, too.
