//! The operator's page as a process of its own beside another command (`ground --dash`, `sim --live --dash`): `tomoswarm
//! dash` is started, and its links are passed on. It is tied to nobody: when the ground station is gone, it still stops
//! everybody. So a page that is left holds the port when the ground station begins anew; that one does not wait for it
//! (`PersistentPage`).

use std::io::{self, BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::dash::PAGE_PORT;
use super::error::CliError;
use super::standard_output::{StandardOutput, complain};

/// Lines that the page's process begins with: its links.
const LINKS: usize = 2;

/// The page's process.
pub(super) struct PageProcess {
    child: Child,
}

/// What a server of pages is started with. It keeps a history of some tens of megabytes among long texts that come and go:
/// the C library of GNU, left alone, keeps half as much again in gaps between them (`cargo bench --bench page`).
const PAGE_ENVIRONMENT: [(&str, &str); 1] = [("MALLOC_MMAP_THRESHOLD_", "131072")];

impl PageProcess {
    /// Starts it with an operator's file and the ground station's store, whose runs it may save; prints its links.
    ///
    /// # Errors
    /// It cannot be started, or ends at once: it has said why.
    pub(super) fn start(
        (operator_file, store): (&Path, &Path),
        port: Option<u16>,
        out: &mut dyn Write,
    ) -> Result<PageProcess, CliError> {
        let failed = |error: std::io::Error| CliError::Fault(format!("the page: {error}"));
        let mut command = Command::new(std::env::current_exe().map_err(failed)?);
        command.arg("dash").arg(operator_file);
        if let Some(port) = port {
            command.args(["--port", &port.to_string()]);
        }
        command.arg("--store").arg(store);
        for (name, value) in PAGE_ENVIRONMENT {
            if std::env::var_os(name).is_none() {
                command.env(name, value);
            }
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(failed)?;
        let said = child.stdout.take().map(BufReader::new);
        let lines = said.into_iter().flat_map(BufRead::lines);
        let links: Vec<String> = lines.take(LINKS).map_while(Result::ok).collect();
        if links.len() < LINKS {
            let ended = child.wait().map_err(failed)?;
            let reason = format!("the page of {} could not begin", operator_file.display());
            return Err(match ended.code() {
                Some(2) => CliError::Usage(reason),
                _ => CliError::Fault(reason),
            });
        }
        let page = PageProcess { child };
        let text = links.join("\n");
        match writeln!(out, "{text}").and_then(|()| out.flush()) {
            Ok(()) => Ok(page),
            Err(error) => {
                page.end();
                Err(CliError::stdout(error))
            }
        }
    }

    /// Ends it.
    pub(super) fn end(mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Leaves it to itself, and says so, unless it has ended.
    pub(super) fn leave(mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            complain(&format_args!(
                "the page goes on, and can stop the vehicles; end it with: kill {}",
                self.child.id()
            ));
        }
    }
}

/// A page whose port is taken is tried again so often; finding that out says nothing and starts nothing.
const PORT_AGAIN: Duration = Duration::from_secs(3);
/// One that ended at once has said why on standard error, and is tried again so often.
const ENDED_AGAIN: Duration = Duration::from_secs(30);

/// What the page of a ground station is started with.
#[derive(Debug)]
pub(super) struct PageFiles {
    /// The operator's file.
    pub operator_file: PathBuf,
    /// The ground station's store.
    pub store: PathBuf,
    /// The page's port; `None` = the usual one.
    pub port: Option<u16>,
}

/// Why a page could not begin.
#[derive(Debug, thiserror::Error)]
enum PageError {
    /// Its port is not free, or may not be used.
    #[error(
        "{at} cannot be listened on: {source} (if an earlier ground station has left its page there, that goes on serving)"
    )]
    Port {
        /// Where.
        at: SocketAddr,
        /// Why.
        source: io::Error,
    },
    /// Its process.
    #[error(transparent)]
    Process(CliError),
}

impl PageError {
    fn again_after(&self) -> Duration {
        match self {
            PageError::Port { .. } => PORT_AGAIN,
            PageError::Process(_) => ENDED_AGAIN,
        }
    }
}

impl PageFiles {
    /// Tries once. Whether the port is free is asked before: a process that finds it taken would complain each time.
    fn start(&self, out: &mut dyn Write) -> Result<PageProcess, PageError> {
        let at = SocketAddr::from((Ipv4Addr::LOCALHOST, self.port.unwrap_or(PAGE_PORT)));
        TcpListener::bind(at).map_err(|source| PageError::Port { at, source })?;
        PageProcess::start((&self.operator_file, &self.store), self.port, out)
            .map_err(PageError::Process)
    }

    /// Warns that the page could not begin.
    fn warn(&self, error: &PageError) {
        complain(&format_args!(
            "warning: the page of {} could not begin: {error}; the ground station goes on without it, and tries it again \
             every {} s",
            self.operator_file.display(),
            error.again_after().as_secs()
        ));
    }

    /// Tries until the page begins; `None` = the other side of `end` has gone before.
    fn start_at_last(
        &self,
        mut error: PageError,
        end: &Receiver<()>,
        out: &mut dyn Write,
    ) -> Option<PageProcess> {
        loop {
            match end.recv_timeout(error.again_after()) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => return None,
            }
            match self.start(out) {
                Ok(page) => return Some(page),
                Err(next) => {
                    if next.to_string() != error.to_string() {
                        self.warn(&next);
                    }
                    error = next;
                }
            }
        }
    }
}

/// A page that is tried again, beside what else the process does, for as long as it cannot begin.
pub(super) enum PersistentPage {
    /// It has begun.
    Begun(PageProcess),
    /// It is tried again, until the sender is dropped.
    Tried(Sender<()>, JoinHandle<Option<PageProcess>>),
}

impl PersistentPage {
    /// Starts it; prints its links, or warns why it could not begin, and prints them later.
    ///
    /// # Errors
    /// The system gives no thread on which to try it again.
    pub(super) fn start(files: PageFiles, out: &mut dyn Write) -> Result<PersistentPage, CliError> {
        let error = match files.start(out) {
            Ok(page) => return Ok(PersistentPage::Begun(page)),
            Err(error) => error,
        };
        files.warn(&error);
        let (end, ended) = channel();
        let attempts = move || files.start_at_last(error, &ended, &mut StandardOutput::on_stdout());
        let thread = std::thread::Builder::new()
            .name("page".to_owned())
            .spawn(attempts)
            .map_err(|error| CliError::Fault(format!("the page: {error}")))?;
        Ok(PersistentPage::Tried(end, thread))
    }

    /// Ends it.
    pub(super) fn end(self) {
        self.process().into_iter().for_each(PageProcess::end);
    }

    /// Leaves it to itself, and says so, unless it has ended or never begun.
    pub(super) fn leave(self) {
        self.process().into_iter().for_each(PageProcess::leave);
    }

    /// Tries it no longer; returns it if it has begun.
    fn process(self) -> Option<PageProcess> {
        match self {
            PersistentPage::Begun(page) => Some(page),
            PersistentPage::Tried(end, attempts) => {
                drop(end);
                attempts.join().ok().flatten()
            }
        }
    }
}
