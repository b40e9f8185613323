//! What a live process tells about itself: log lines on standard error, for the terminal or the system's journal. Of the
//! bus's library only errors are shown, unless more is asked for: we ourselves say who cannot be reached, and nothing is shown
//! of its sessions.

use std::io::IsTerminal;

use crate::run::log_book::{LogBook, LogBookLayer};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// Where the bus's library says of frames that it does not know their subject ("unknown key_expr", with a path of its own
/// sources). That is so while a link begins or a session ends. Such a frame is dropped, and what it said is said again; a node
/// that is not heard any more is told of by our own lines, and the session is opened anew then.
const SESSIONS: &str = "zenoh::api::session";

/// Begins to log; what another part of the process has begun already goes on.
pub(super) fn begin(is_verbose: bool) {
    let (own, others, sessions) = if is_verbose {
        (LevelFilter::DEBUG, LevelFilter::INFO, LevelFilter::INFO)
    } else {
        (LevelFilter::INFO, LevelFilter::ERROR, LevelFilter::OFF)
    };
    let shown = Targets::new()
        .with_target("tomoswarm", own)
        .with_target(SESSIONS, sessions)
        .with_default(others);
    // What is told to operators elsewhere does not depend on what is shown here.
    let told = Targets::new()
        .with_target("tomoswarm", LevelFilter::INFO)
        .with_target(SESSIONS, LevelFilter::OFF)
        .with_default(LevelFilter::ERROR);
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false);
    // Only a second beginning fails, and the first one serves.
    let _ = tracing_subscriber::registry()
        .with(lines.with_filter(shown))
        .with(LogBookLayer(LogBook::of_process().clone()).with_filter(told))
        .try_init();
}
