//! The `terrane` binary: the command line, which the library has.

fn main() -> std::process::ExitCode {
    terrane::command_line(std::env::args_os())
}
