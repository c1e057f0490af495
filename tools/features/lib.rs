//! Nothing but a list of features (`Cargo.toml`): tests, the program and the Python package each turn on some that the
//! others do not, of crates that nearly all else is built upon. Where all ask for all of these, what was built for
//! one of them is taken for the others, too.
