//! The line that says how something gets on: on a terminal alone, and gone afterwards.

use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressStyle};

use crate::tomo::ImagingStep;

/// Returns a bar without a length by a template of indicatif; hidden where standard error is no terminal.
pub(super) fn progress_bar(template: &str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::no_length().with_style(style)
}

/// Makes an image, and shows its steps while it is made.
pub(super) fn with_steps<T>(make: impl FnOnce(&dyn Fn(ImagingStep)) -> T) -> T {
    let bar = progress_bar("{spinner} {msg}");
    let made = make(&|step| {
        bar.set_message(step.to_string());
        bar.tick();
    });
    bar.finish_and_clear();
    made
}
