//! What a live process tells about itself: log lines on standard error, for the terminal or the system's journal.

use std::io::IsTerminal;

/// Begins to log; what another part of the process has begun already goes on.
pub fn begin(is_verbose: bool) {
    let level = if is_verbose { tracing::Level::DEBUG } else { tracing::Level::INFO };
    let lines = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .with_max_level(level);
    // Only a second beginning fails, and the first one serves.
    let _ = lines.try_init();
}
