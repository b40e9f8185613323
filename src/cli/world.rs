//! `tomoswarm world CONFIG`: the simulated world as a process of its own, for vehicles that are real processes.

use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use super::describe::describe;
use super::error::CliError;
use super::load;
use super::read;
use super::sim::parse_seed;
use super::standard_output::complain;
use super::stop::StopFlag;
use crate::config::{Config, bundled};
use crate::mavlink::earth_frame::EarthFrame;
use crate::run::link::WorldStatus;
use crate::run::mavlink_port::{PortError, PortSettings};
use crate::run::mavlink_sockets::SocketKind;
use crate::run::world::{WorldError, WorldServer};
use crate::sim::Scenario;
use crate::sim::mavlink_fleet::Endpoints;

/// Run the simulated world of a live simulation: bodies, range sensors, radios, and the referee.
///
/// The simulated drivers of `tomoswarm vehicle` connect to it, over a socket of this machine that has nothing to do with
/// the bus. When it is ready it prints one line, `world ADDRESS`, and runs until Ctrl-C, SIGTERM, or until who runs
/// the scenario ends it; then it prints what the referee saw. Who does not know the token is refused.
///
/// A vehicle whose process is gone or silent for 2 s brakes and stands; when it comes back (with a higher boot), it goes
/// on from there. A contact ends all motion of those involved. There may be more vehicles than can sweep together.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct WorldArgs {
    /// A simulation file (kind = "sim"); see configs/courtyard.sim.toml [default: the bundled example]
    #[arg(value_name = "CONFIG")]
    pub config: Option<PathBuf>,
    /// Address to listen on, of this machine only; port 0 takes a free one
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:0")]
    pub listen: SocketAddr,
    /// What those who connect must know [default: drawn, and printed behind the address]
    #[arg(long, value_name = "TEXT", value_parser = crate::config::world_token)]
    pub token: Option<String>,
    /// Seed of everything that is random [default: the file's]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    pub seed: Option<u64>,
    /// Number of vehicles, 2 to 250, in place of the file's; the venue must have a home for each
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub vehicles: Option<usize>,
    /// Serve its autopilots over MAVLink by TCP, vehicle 1 at this address and each other at the next port; they start
    /// switched on and disarmed, for vehicles with `driver = "mavlink"`
    #[arg(long, value_name = "ADDRESS")]
    pub mavlink: Option<SocketAddr>,
    /// Give every vehicle an XBee at a pseudo-terminal FOLDER/vehicle-N, for vehicles with `[radio] driver = "xbee"`; all
    /// vehicles must have it then, since the simulated radio does not hear them
    #[arg(long, value_name = "FOLDER")]
    pub xbee_pty: Option<PathBuf>,
    /// Print what would start, and end
    #[arg(long)]
    pub check: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub tied: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm world configs/courtyard.sim.toml --check
  tomoswarm world configs/courtyard.sim.toml --listen 127.0.0.1:7000 --token anything

With `empty_sweep = true` in the file the persons wait outside until whoever runs the scenario (`tomoswarm sim --live`) lets
them enter; there is no command for it, so in a world that is started by hand they never come. For an empty sweep and one with
them by hand: sweep in this world, end it, and start it (same --listen, --token) with a file that says `empty_sweep = false`.
They are in then from the beginning, all vehicles are at home, and their processes connect again by themselves.

Exit codes: 0 ended as asked; 1 the referee saw a collision, or a fault; 2 bad usage, bad files, or an address that is in use.";

impl WorldArgs {
    /// Runs the world until it is ended.
    ///
    /// # Errors
    /// Bad files, an address that cannot be used, or a collision.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let scenario = self.scenario()?;
        if self.check {
            return say(out, &self.plan(&scenario));
        }
        let token = self.token.clone().map_or_else(random_token, Ok)?;
        let venue = &scenario.sim().venue;
        let port = self.mavlink.map(|address| PortSettings {
            sockets: SocketKind::Tcp,
            address,
            endpoints: Endpoints::OneEach,
            key: None,
            frame: EarthFrame::new(venue.datum.geodetic(), venue.x_axis_bearing()),
            has_failsafes: true,
            parameters: Vec::new(),
        });
        let server = WorldServer::start(
            &scenario,
            self.listen,
            &token,
            port.as_ref(),
            self.xbee_pty.as_deref(),
        )
        .map_err(refused)?;
        if scenario.sim().empty_sweep && !self.tied {
            complain(
                &"note: the persons wait outside (empty_sweep = true): nobody lets them enter a world that is started by hand",
            );
        }
        let stopper = server.stopper();
        let by_input = stopper.clone();
        let stop = StopFlag::listen_with(move || stopper.stop());
        if self.tied {
            stop.end_with_input(move || by_input.stop());
        }
        let drawn = if self.token.is_none() {
            format!(" token {token}")
        } else {
            String::new()
        };
        say(out, &format!("world {}{drawn}\n", server.address()))?;
        for address in server.autopilots() {
            say(out, &format!("autopilot {address}\n"))?;
        }
        let status = server.wait();
        say(out, &summary(&status))?;
        match status.collision_count {
            0 => Ok(()),
            count => Err(CliError::Mission(format!("collisions: {count}"))),
        }
    }

    fn scenario(&self) -> Result<Scenario, CliError> {
        let loaded = load::load_world(self.config.as_deref(), self.vehicles)?;
        for warning in &loaded.shapes.warnings {
            complain(&format_args!("warning: {warning}"));
        }
        load::world(loaded, self.config.as_deref(), self.seed)
    }

    fn plan(&self, scenario: &Scenario) -> String {
        let name = self
            .config
            .as_deref()
            .unwrap_or(Path::new(bundled::COURTYARD));
        let token = if self.token.is_some() {
            "as given"
        } else {
            "drawn at the start"
        };
        let listens = [(
            "world",
            format!("would listen on {}, token {token}", self.listen),
        )];
        describe(
            &read::shown(name),
            &Config::Sim(Box::new(scenario.sim().clone())),
            &listens,
        )
    }
}

/// Returns what is wrong: the user's input, or this machine.
fn refused(error: WorldError) -> CliError {
    match error {
        WorldError::NotLoopback { .. }
        | WorldError::Token { .. }
        | WorldError::Scenario(_)
        | WorldError::Radios { .. }
        | WorldError::NoRadios
        | WorldError::Listen { .. }
        | WorldError::Port(PortError::Address { .. }) => CliError::Usage(error.to_string()),
        WorldError::Thread(_) | WorldError::Port(PortError::Parameter(_)) => {
            CliError::Fault(error.to_string())
        }
    }
}

fn random_token() -> Result<String, CliError> {
    let drawn =
        getrandom::u64().map_err(|error| CliError::Fault(format!("no randomness: {error}")))?;
    Ok(format!("{drawn:016x}"))
}

fn summary(status: &WorldStatus) -> String {
    let separation = status
        .min_separation_m
        .map_or("none".to_owned(), |separation_m| {
            format!("{separation_m:.2} m")
        });
    format!(
        "ended after {:.1} s: {} collisions, {} fence breaches, smallest separation {separation}, {} scans, {} beacons heard\n",
        status.now_ns as f64 * 1e-9,
        status.collision_count,
        status.fence_breaches,
        status.scans,
        status.beacons_heard
    )
}

fn say(out: &mut dyn Write, text: &str) -> Result<(), CliError> {
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|source| CliError::Write {
        path: "standard output".into(),
        source,
    })
}
