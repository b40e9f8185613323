//! The operator's page as a process of its own beside another command (`ground --dash`, `sim --live --dash`): `tomoswarm dash` is
//! started, and its links are passed on. It is tied to nobody: when the ground station is gone, it still stops everybody.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::error::CliError;
use super::standard_output::complain;

/// Lines that the page's process begins with: its links.
const LINKS: usize = 2;

/// The page's process.
pub(super) struct PageProcess {
    child: Child,
}

/// What a server of pages is started with. It keeps a history of some tens of megabytes among long texts that come and go: the C
/// library of GNU, left alone, keeps half as much again in gaps between them (`cargo bench --bench page`).
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
        let text = links.join("\n");
        writeln!(out, "{text}")
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)?;
        Ok(PageProcess { child })
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
