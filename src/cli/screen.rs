//! The terminal while a command draws on all of it: taken over, drawn on, and given back as it was, also when the
//! program panics or is ended at once. What is drawn is decided elsewhere; keys are not read.

use std::io::{self, IsTerminal, Write};
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// To the second screen, which most terminals have, with the cursor hidden.
const TAKE: &str = "\x1b[?1049h\x1b[?25l\x1b[2J";
/// Colours off, the cursor shown, and back to the first screen.
const GIVE_BACK: &str = "\x1b[0m\x1b[?25h\x1b[?1049l";
/// Who ends the program at once does not wait any longer for a terminal that takes nothing.
const GIVE_BACK_WITHIN: Duration = Duration::from_millis(300);

/// Whether the terminal is taken.
static IS_TAKEN: AtomicBool = AtomicBool::new(false);
static PANICS_GIVE_BACK: Once = Once::new();

/// The size of a terminal.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Size {
    /// Letters in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
}

/// Returns how many letters fit in a line of standard output; `None` = it is no terminal, and nothing is to be wrapped.
#[cfg(feature = "net")]
pub(super) fn columns_of_stdout() -> Option<usize> {
    let term = console::Term::stdout();
    let size = term.size_checked().filter(|_| term.is_term());
    size.map(|(_, columns)| usize::from(columns))
}

/// The terminal behind standard error, taken over until this is dropped.
#[derive(Debug)]
pub(super) struct Screen {
    term: console::Term,
    drawn: Option<Size>,
}

impl Screen {
    /// Returns whether there is a terminal to draw on; if not, why.
    ///
    /// # Errors
    /// What is there instead.
    pub(super) fn check() -> Result<(), &'static str> {
        if !io::stderr().is_terminal() {
            return Err("standard error is no terminal");
        }
        if console::is_dumb() {
            Err("the terminal cannot move its cursor (TERM)")
        } else {
            Ok(())
        }
    }

    /// Takes the terminal over.
    pub(super) fn take() -> Screen {
        PANICS_GIVE_BACK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |panic| {
                give_back();
                before(panic);
            }));
        });
        IS_TAKEN.store(true, Ordering::SeqCst);
        say(TAKE);
        Screen {
            term: console::Term::stderr(),
            drawn: None,
        }
    }

    /// Returns the terminal's size now.
    pub(super) fn size(&self) -> Size {
        let (rows, columns) = self.term.size();
        Size {
            columns: usize::from(columns),
            rows: usize::from(rows),
        }
    }

    /// Draws lines from the top, the rest of the screen stays empty; there must not be more than fit.
    pub(super) fn draw(&mut self, size: Size, lines: &[String]) {
        let mut text = String::new();
        if self.drawn.replace(size) != Some(size) {
            text.push_str("\x1b[2J");
        }
        for (row, line) in lines.iter().take(size.rows).enumerate() {
            text.push_str(&format!("\x1b[{};1H{line}\x1b[0m\x1b[K", row + 1));
        }
        if IS_TAKEN.load(Ordering::SeqCst) {
            say(&text);
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back();
    }
}

/// Gives the terminal back, if it is taken.
fn give_back() {
    if IS_TAKEN.swap(false, Ordering::SeqCst) {
        say(GIVE_BACK);
    }
}

/// Gives the terminal back before the program is ended at once; does not wait for a terminal that was stopped.
pub(super) fn give_back_at_once() {
    if !IS_TAKEN.load(Ordering::SeqCst) {
        return;
    }
    let (done, is_done) = mpsc::channel();
    let given = std::thread::Builder::new().spawn(move || {
        give_back();
        // Who waited for it may have left.
        let _ = done.send(());
    });
    if given.is_ok() {
        let _ = is_done.recv_timeout(GIVE_BACK_WITHIN);
    }
}

fn say(text: &str) {
    let mut err = io::stderr().lock();
    // A terminal that is gone shows nothing any more; the run goes on, or is asked to end.
    let _ = err.write_all(text.as_bytes()).and_then(|()| err.flush());
}
