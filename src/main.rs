//! The `terrane` binary: calls the command line of the library.

fn main() -> std::process::ExitCode {
    terrane::command_line(std::env::args_os())
}
