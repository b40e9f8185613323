//! The `tomoswarm` command.

fn main() -> std::process::ExitCode {
    tomoswarm::cli::run()
}
