//! The `terrane` binary: hands the process arguments to [`terrane::cli`] and exits with its code.

fn main() -> std::process::ExitCode {
    terrane::cli::main(std::env::args_os())
}
