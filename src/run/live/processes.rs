//! The processes of a live swarm: started, watched, started again, and ended in order. Each is in a process group of its
//! own, so that Ctrl-C on the terminal reaches only us and we end them in order. Their standard input is a pipe of ours
//! that is never written to: when this process is gone, however, they see its end and end themselves.
//!
//! A node that dies is started again as its service is in the field (`deploy/`), but within limits: after 1, 2 and 4 s, and no
//! more when it dies a fourth time within a minute ([`Restarts`]). One that refuses its configuration (exit code 2) or has
//! ended in order is not started again, and neither is the world, which cannot go on.
//!
//! ```text
//!   runs ─dies─► waits ─1, 2, 4 s─► runs      ─dies too often, exit code 0 or 2, the world─► dead
//! ```

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process, kill_process_group};

use crate::exchange::restarts::Restarts;
use crate::time::Time;

/// A process that was asked to end gets this long.
pub const ENDS_WITHIN: Duration = Duration::from_secs(8);
/// It is looked for its end this often.
const LOOK: Duration = Duration::from_millis(20);
/// The world says where it listens within this time.
const WORLD_WITHIN: Duration = Duration::from_secs(20);
/// The exit code of a node that refuses its configuration, or is refused by the others.
const REFUSED: i32 = 2;
/// Somebody who listens on this machine answers within this time.
const KNOCK: Duration = Duration::from_millis(200);
/// The last lines of a log that are shown.
const LAST_LINES: usize = 5;

/// What a process is in the order of the end; who is lower ends first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Rank {
    /// Vehicles brake while the world is still there.
    Vehicle,
    /// The ground station stores what came in last.
    Ground,
    /// The world sees all of it.
    World,
}

/// One process.
#[derive(Debug)]
struct Process {
    name: String,
    rank: Rank,
    command: Command,
    child: Child,
    log: PathBuf,
    ended: Option<ExitStatus>,
    restarts: Restarts,
    stage: Stage,
}

/// How it stands with a process.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    Runs,
    /// It has died, and is started again then.
    Waits(Time),
    Dead,
}

/// What has happened to a process.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ProcessEvent {
    /// It has died, and is started again after a while.
    Died {
        /// Which one, how, and what it said last.
        dead: Dead,
        /// After this long.
        again_after: Duration,
    },
    /// It was started again.
    Started(String),
    /// It has ended, and is not started again.
    Dead(Dead),
}

/// A process that ended by itself.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Dead {
    /// Which one.
    pub name: String,
    /// How, in words.
    pub how: String,
    /// The last lines of its log.
    pub last_words: String,
    /// It may not be started again, since that was done too often.
    pub too_often: bool,
}

impl Dead {
    /// Returns in words which limit keeps it from being started again; empty = none does.
    pub fn limit(&self) -> &'static str {
        match self.too_often {
            true => " for the fourth time within a minute, and is not started again",
            false => "",
        }
    }
}

impl fmt::Display for Dead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} has ended{}: {}", self.name, self.limit(), self.how)
    }
}

/// How a process was ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ended {
    /// Which one.
    pub name: String,
    /// Whether it did not end when it was asked to.
    pub was_killed: bool,
}

/// All processes of a swarm; dropping them ends them.
#[derive(Debug)]
pub struct Processes {
    folder: PathBuf,
    list: Vec<Process>,
    within: Duration,
}

impl Processes {
    /// Makes an empty list; logs are written into a folder.
    pub fn new(folder: &Path) -> Processes {
        Processes {
            folder: folder.to_owned(),
            list: Vec::new(),
            within: ENDS_WITHIN,
        }
    }

    /// Starts a process; what it says goes to its log, `NAME.log`.
    ///
    /// # Errors
    /// The log cannot be written, or the program cannot be started.
    pub fn start(&mut self, name: &str, rank: Rank, command: Command) -> io::Result<()> {
        self.spawn(name, rank, command, false).map(|_| ())
    }

    /// Starts the world, and waits until it says where it listens and by which word.
    ///
    /// # Errors
    /// It cannot be started, or says something else.
    pub fn start_world(&mut self, command: Command) -> io::Result<(SocketAddr, String)> {
        let child = self.spawn("world", Rank::World, command, true)?;
        let output = child
            .stdout
            .take()
            .ok_or_else(|| io::Error::other("the world has no output"))?;
        let (say, printed) = channel();
        // It goes on reading, so that the world never waits for us.
        let reader = move || {
            BufReader::new(output)
                .lines()
                .map_while(Result::ok)
                .for_each(|line| drop(say.send(line)))
        };
        std::thread::Builder::new()
            .name("world's words".to_owned())
            .spawn(reader)?;
        let first = printed.recv_timeout(WORLD_WITHIN).unwrap_or_default();
        let words: Vec<&str> = first.split_whitespace().collect();
        match words[..] {
            ["world", address, "token", token] => {
                let address = address.parse().map_err(io::Error::other)?;
                Ok((address, token.to_owned()))
            }
            _ => {
                let last = self
                    .list
                    .last()
                    .map(|process| last_lines(&process.log))
                    .unwrap_or_default();
                Err(io::Error::other(format!("the world has not begun: {last}")))
            }
        }
    }

    fn spawn(
        &mut self,
        name: &str,
        rank: Rank,
        mut command: Command,
        keeps_output: bool,
    ) -> io::Result<&mut Child> {
        fs::create_dir_all(&self.folder)?;
        let log = self.folder.join(format!("{name}.log"));
        let file = File::create(&log)?;
        let output = if keeps_output {
            Stdio::piped()
        } else {
            Stdio::from(file.try_clone()?)
        };
        command
            .stdin(Stdio::piped())
            .stdout(output)
            .stderr(file)
            .process_group(0);
        let child = command.spawn()?;
        self.list.push(Process {
            name: name.to_owned(),
            rank,
            command,
            child,
            log,
            ended: None,
            restarts: Restarts::default(),
            stage: Stage::Runs,
        });
        match self.list.last_mut() {
            Some(process) => Ok(&mut process.child),
            None => Err(io::Error::other("nothing was started")),
        }
    }

    /// Looks after all of them: starts again who has died and may be. Returns what has happened since.
    pub fn look_after(&mut self, now: Time) -> Vec<ProcessEvent> {
        self.list
            .iter_mut()
            .filter_map(|process| process.look_after(now))
            .collect()
    }

    /// Ends all of them in order: who is asked gets [`ENDS_WITHIN`] and is killed then.
    pub fn stop(&mut self) -> Vec<Ended> {
        let ranks = [Rank::Vehicle, Rank::Ground, Rank::World];
        ranks
            .into_iter()
            .flat_map(|rank| self.stop_those(rank))
            .collect()
    }

    /// Ends those of a rank in the same way.
    pub fn stop_those(&mut self, rank: Rank) -> Vec<Ended> {
        let of_rank = self.list.iter_mut().filter(|process| process.rank == rank);
        let ended = end(&mut of_rank.collect::<Vec<_>>(), self.within);
        self.list.retain(|process| process.rank != rank);
        ended
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Process {
    fn look_after(&mut self, now: Time) -> Option<ProcessEvent> {
        match self.stage {
            Stage::Runs => {
                let status = self.look()?;
                let mut dead = self.dead(status.to_string());
                let is_final =
                    self.rank == Rank::World || status.success() || status.code() == Some(REFUSED);
                let again_after = if is_final {
                    None
                } else {
                    self.restarts.failed(now)
                };
                dead.too_often = !is_final && again_after.is_none();
                self.stage = again_after.map_or(Stage::Dead, |wait| Stage::Waits(now + wait));
                Some(
                    again_after.map_or(ProcessEvent::Dead(dead.clone()), |again_after| {
                        ProcessEvent::Died { dead, again_after }
                    }),
                )
            }
            // What it says goes on in the same log.
            Stage::Waits(at) if now >= at => match self.command.spawn() {
                Ok(child) => {
                    (self.child, self.ended, self.stage) = (child, None, Stage::Runs);
                    Some(ProcessEvent::Started(self.name.clone()))
                }
                Err(error) => {
                    self.stage = Stage::Dead;
                    Some(ProcessEvent::Dead(
                        self.dead(format!("it cannot be started again: {error}")),
                    ))
                }
            },
            Stage::Waits(_) | Stage::Dead => None,
        }
    }

    fn dead(&self, how: String) -> Dead {
        Dead {
            name: self.name.clone(),
            how,
            last_words: last_lines(&self.log),
            too_often: false,
        }
    }

    /// Returns how it ended, if it has.
    fn look(&mut self) -> Option<ExitStatus> {
        if self.ended.is_none() {
            // One that cannot be asked for is taken for alive, and killed in the end.
            self.ended = self.child.try_wait().unwrap_or_default();
        }
        self.ended
    }

    fn pid(&self) -> Option<Pid> {
        i32::try_from(self.child.id()).ok().and_then(Pid::from_raw)
    }

    fn ask(&mut self) {
        if self.look().is_none()
            && let Some(pid) = self.pid()
        {
            // It may have ended this moment.
            let _ = kill_process(pid, Signal::TERM);
        }
    }

    /// Kills it, and all that it has started.
    fn kill(&mut self) {
        if let Some(pid) = self.pid() {
            // What is gone already needs no killing.
            let _ = kill_process_group(pid, Signal::KILL);
        }
        let _ = self.child.kill();
        self.ended = self.child.wait().ok();
    }
}

/// Asks some processes to end, waits for them, and kills who has not.
fn end(group: &mut [&mut Process], within: Duration) -> Vec<Ended> {
    group.iter_mut().for_each(|process| process.ask());
    let until = Instant::now() + within;
    while group.iter_mut().any(|process| process.look().is_none()) && Instant::now() < until {
        std::thread::sleep(LOOK);
    }
    let each = group.iter_mut().map(|process| {
        let was_killed = process.look().is_none();
        if was_killed {
            process.kill();
        }
        Ended {
            name: process.name.clone(),
            was_killed,
        }
    });
    each.collect()
}

/// Returns ports of this machine that nobody listens at now, none of them twice in a process.
///
/// # Errors
/// There are none.
pub fn free_ports(count: usize) -> io::Result<Vec<u16>> {
    // Below those that the system gives to outgoing connections: until somebody listens there, nobody
    // else gets them. Another process begins elsewhere.
    const FROM: u32 = 20_000;
    const HOW_MANY: u32 = 12_700;
    static TRIED: AtomicU32 = AtomicU32::new(0);
    let first = std::process::id() % 100 * 100;
    let next = |_| {
        let offset = first.wrapping_add(TRIED.fetch_add(1, Ordering::Relaxed)) % HOW_MANY;
        u16::try_from(FROM + offset).ok()
    };
    let tries = (0..HOW_MANY).filter_map(next);
    let ports: Vec<u16> = tries.filter(|port| is_free(*port)).take(count).collect();
    if ports.len() < count {
        return Err(io::Error::other("there are not enough free ports"));
    }
    Ok(ports)
}

/// Returns whether nobody listens at a port. It is knocked at, not listened at: a process that is started meanwhile would
/// inherit the listener, and hold the port for a moment after it is closed here.
fn is_free(port: u16) -> bool {
    let knocked = TcpStream::connect_timeout(&SocketAddr::from(([127, 0, 0, 1], port)), KNOCK);
    knocked.is_err_and(|error| error.kind() == io::ErrorKind::ConnectionRefused)
}

fn last_lines(log: &Path) -> String {
    let bytes = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(LAST_LINES)..].join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    fn is_alive(pid: u32) -> bool {
        Path::new(&format!("/proc/{pid}")).exists()
    }

    fn wait_for(what: &str, is_so: impl Fn() -> bool) {
        let until = Instant::now() + Duration::from_secs(5);
        while !is_so() {
            assert!(Instant::now() < until, "{what}");
            std::thread::sleep(LOOK);
        }
    }

    #[test]
    fn who_does_not_end_when_asked_is_killed_and_the_others_end_in_order() {
        let root = tempfile::tempdir().unwrap();
        let mut processes = Processes::new(root.path());
        processes.within = Duration::from_millis(600);
        let order = root.path().join("order");
        let polite = |name: &str| {
            let path = order.display();
            format!(
                "trap 'echo {name} >> {path}; exit 0' TERM; echo ready; while :; do sleep 0.02; done"
            )
        };
        processes
            .start("world", Rank::World, shell(&polite("world")))
            .unwrap();
        processes
            .start("ground", Rank::Ground, shell(&polite("ground")))
            .unwrap();
        processes
            .start("vehicle-1", Rank::Vehicle, shell(&polite("vehicle")))
            .unwrap();
        let deaf = "trap '' TERM; echo ready; while :; do sleep 0.02; done";
        processes
            .start("vehicle-2", Rank::Vehicle, shell(deaf))
            .unwrap();
        let logs: Vec<PathBuf> = processes
            .list
            .iter()
            .map(|process| process.log.clone())
            .collect();
        wait_for("all have begun", || {
            logs.iter().all(|log| last_lines(log) == "ready")
        });
        let pids: Vec<u32> = processes
            .list
            .iter()
            .map(|process| process.child.id())
            .collect();
        let ended = processes.stop();
        let killed: Vec<&str> = ended
            .iter()
            .filter(|ended| ended.was_killed)
            .map(|ended| ended.name.as_str())
            .collect();
        assert_eq!(killed, ["vehicle-2"]);
        assert_eq!(
            fs::read_to_string(&order).unwrap(),
            "vehicle\nground\nworld\n"
        );
        assert!(!pids.iter().any(|pid| is_alive(*pid)));
    }

    /// What happens first; the time is that of whoever looks.
    fn first(processes: &mut Processes, now_s: f64) -> ProcessEvent {
        let now = Time::from_secs_f64(now_s);
        let news = std::iter::repeat_with(|| {
            std::thread::sleep(LOOK);
            processes.look_after(now).into_iter().next()
        });
        news.take(250).flatten().next().unwrap()
    }

    #[test]
    fn who_dies_is_started_again_after_growing_waits_and_not_a_fourth_time_within_a_minute() {
        let root = tempfile::tempdir().unwrap();
        let mut processes = Processes::new(root.path());
        processes
            .start("ground", Rank::Ground, shell("sleep 60"))
            .unwrap();
        assert_eq!(processes.look_after(Time::ZERO), []);
        processes
            .start("vehicle-1", Rank::Vehicle, shell("seq 1 9 >&2; kill -9 $$"))
            .unwrap();
        let mut now_s = 0.0;
        for wait_s in [1, 2, 4] {
            let ProcessEvent::Died { dead, again_after } = first(&mut processes, now_s) else {
                panic!("it is final")
            };
            assert_eq!(
                (dead.name.as_str(), again_after),
                ("vehicle-1", Duration::from_secs(wait_s))
            );
            assert!(dead.how.contains("signal: 9"), "{}", dead.how);
            assert_eq!(dead.last_words, "5\n6\n7\n8\n9");
            now_s += wait_s as f64;
            assert_eq!(processes.look_after(Time::from_secs_f64(now_s - 0.1)), []);
            assert_eq!(
                first(&mut processes, now_s),
                ProcessEvent::Started("vehicle-1".to_owned())
            );
        }
        assert!(
            matches!(first(&mut processes, now_s), ProcessEvent::Dead(dead) if dead.name == "vehicle-1")
        );
        assert_eq!(
            processes.look_after(Time::from_secs_f64(1e6)),
            [],
            "that is said once"
        );
        let log = fs::read_to_string(root.path().join("vehicle-1.log")).unwrap();
        assert_eq!(log.lines().count(), 4 * 9, "every start's words are kept");
    }

    #[test]
    fn a_refused_configuration_an_end_in_order_and_the_world_are_final() {
        for (rank, script) in [
            (Rank::Vehicle, "echo no such venue >&2; exit 2"),
            (Rank::Ground, "exit 0"),
            (Rank::World, "kill -9 $$"),
        ] {
            let root = tempfile::tempdir().unwrap();
            let mut processes = Processes::new(root.path());
            processes.start("node", rank, shell(script)).unwrap();
            assert!(
                matches!(first(&mut processes, 0.0), ProcessEvent::Dead(_)),
                "{script}"
            );
        }
    }

    #[test]
    fn who_waits_to_be_started_again_needs_no_end() {
        let root = tempfile::tempdir().unwrap();
        let mut processes = Processes::new(root.path());
        processes
            .start("vehicle-1", Rank::Vehicle, shell("exit 1"))
            .unwrap();
        assert!(matches!(
            first(&mut processes, 0.0),
            ProcessEvent::Died { .. }
        ));
        let ended = processes.stop();
        assert_eq!(
            ended,
            [Ended {
                name: "vehicle-1".to_owned(),
                was_killed: false
            }]
        );
    }

    #[test]
    fn whoever_is_dropped_takes_its_processes_along() {
        let root = tempfile::tempdir().unwrap();
        let mut processes = Processes::new(root.path());
        processes
            .start("vehicle-1", Rank::Vehicle, shell("exec sleep 60"))
            .unwrap();
        let pid = processes.list[0].child.id();
        drop(processes);
        assert!(!is_alive(pid));
    }

    #[test]
    fn a_world_that_does_not_begin_is_a_reason_with_its_words() {
        let root = tempfile::tempdir().unwrap();
        let mut processes = Processes::new(root.path());
        let error = processes
            .start_world(shell("echo no such file >&2"))
            .unwrap_err();
        assert!(error.to_string().contains("no such file"), "{error}");
        let (address, token) = processes
            .start_world(shell("echo world 127.0.0.1:7500 token abc; sleep 60"))
            .unwrap();
        assert_eq!((address.port(), token.as_str()), (7500, "abc"));
    }

    #[test]
    fn a_free_port_can_be_listened_at_while_processes_are_started() {
        let is_over = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    while !is_over.load(Ordering::Relaxed) {
                        let _ = shell("true").status();
                    }
                });
            }
            let is_refused =
                |port: &u16| std::net::TcpListener::bind(("127.0.0.1", *port)).is_err();
            let ports = (0..400).map(|_| free_ports(1).unwrap()[0]);
            let refused: Vec<u16> = ports.filter(is_refused).collect();
            is_over.store(true, Ordering::Relaxed);
            assert!(refused.is_empty(), "{refused:?}");
        });
    }
}
