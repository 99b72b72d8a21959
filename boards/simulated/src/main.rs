//! `motor-hub`: see `motor-hub --help`.

fn main() -> std::process::ExitCode {
    simulated::cli::main()
}
