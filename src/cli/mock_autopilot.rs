//! `tomoswarm mock-autopilot`: simulated vehicles that speak MAVLink, for ground stations, scripts and the driver's own tests.

use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;

use super::error::CliError;
use super::load;
use super::logging;
use super::parameters::parse_parameter;
use super::read;
use super::sim::parse_seed;
use super::standard_output::complain;
use super::stop::StopFlag;
use crate::autopilot::VehicleKind;
use crate::geom::{Bearing, Geodetic};
use crate::mavlink::earth_frame::EarthFrame;
use crate::run::mavlink_port::{PortError, PortSettings};
use crate::run::mavlink_sockets::SocketKind;
use crate::run::mock_autopilot::MockAutopilots;
use crate::sim::environment::Environment;
use crate::sim::free_space::free_space;
use crate::sim::mavlink_fleet::Endpoints;

/// Where ground stations look for a simulated autopilot.
const DEFAULT_TCP: SocketAddr =
    SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 5760);
/// Where free space lies unless it is told otherwise: latitude, longitude, metres above the sea, bearing of the x axis.
const DEFAULT_DATUM: &str = "51.9989,4.3733,0,90";

/// Serve simulated vehicles over MAVLink, as ArduPilot's rover or copter.
///
/// Each vehicle has a port of its own (that of the address and the next ones), or all share one (`--one-link`); system ids
/// are 1 to N. A vehicle starts switched on and disarmed, can be armed after half a second, and streams nothing but
/// heartbeats until it is asked to. It prints one line for each endpoint, `autopilot ADDRESS`, and runs until Ctrl-C or
/// SIGTERM.
///
/// There is no file transfer, no log, fence or rally point; parameters are kept, and those of failsafes and speeds are obeyed.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct MockAutopilotArgs {
    /// What it is
    #[arg(long, value_name = "KIND", value_parser = ["rover", "copter"], default_value = "rover", conflicts_with = "scene")]
    pub vehicle: String,
    /// Number of vehicles [default: 1, or as many as the scene's file has]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=250))]
    pub count: Option<u8>,
    /// Listen for TCP connections [default: 127.0.0.1:5760]
    #[arg(long, value_name = "ADDRESS", group = "socket")]
    pub tcp: Option<SocketAddr>,
    /// Wait for packets of UDP, and answer who sends some
    #[arg(long, value_name = "ADDRESS", group = "socket")]
    pub udp: Option<SocketAddr>,
    /// Send packets of UDP to who listens there (QGroundControl: 127.0.0.1:14550)
    #[arg(long, value_name = "ADDRESS", group = "socket")]
    pub udp_to: Option<SocketAddr>,
    /// Show all vehicles on one port
    #[arg(long)]
    pub one_link: bool,
    /// A simulation file (kind = "sim"): its scene with its vehicles at their homes [default: free space]
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// How much faster than real time it goes, 0.1 to 1000
    #[arg(long, value_name = "K", default_value_t = 1.0, value_parser = parse_speedup)]
    pub speedup: f64,
    /// Where free space lies: latitude, longitude (degrees), metres above the sea, bearing of the x axis (degrees)
    #[arg(long, value_name = "LAT,LON,ALT,BEARING", default_value = DEFAULT_DATUM, value_parser = parse_datum, allow_hyphen_values = true, conflicts_with = "scene")]
    pub datum: EarthFrame,
    /// Hear only who signs with the key in this file (64 hexadecimal digits)
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// Give a parameter a value, such as FS_GCS_ENABLE=1 [default: as an autopilot comes]
    #[arg(long = "parameter", value_name = "NAME=VALUE", value_parser = parse_parameter)]
    pub parameters: Vec<(String, f32)>,
    /// Seed of the errors of places
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = parse_seed)]
    pub seed: u64,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub tied: bool,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm mock-autopilot                                        one rover; then: mavproxy.py --master tcp:127.0.0.1:5760
  tomoswarm mock-autopilot --vehicle copter --udp-to 127.0.0.1:14550        for QGroundControl
  tomoswarm mock-autopilot --count 60 --one-link --speedup 10
  tomoswarm mock-autopilot --scene configs/courtyard.sim.toml --tcp 127.0.0.1:5760

Exit codes: 0 ended as asked; 1 a vehicle has touched something; 2 bad usage, bad files, or a port that cannot be used.";

impl MockAutopilotArgs {
    /// Serves the vehicles until it is asked to stop.
    ///
    /// # Errors
    /// Bad files, a port that cannot be used, or a contact.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        logging::begin(false);
        let (environment, frame) = self.environment()?;
        let (sockets, address) = self.sockets();
        let settings = PortSettings {
            sockets,
            address,
            endpoints: if self.one_link {
                Endpoints::Shared
            } else {
                Endpoints::OneEach
            },
            key: self.key.as_deref().map(read::signing_key).transpose()?,
            frame,
            has_failsafes: false,
            parameters: self.parameters.clone(),
        };
        let stop = StopFlag::listen();
        if self.tied {
            stop.end_with_input(|| {});
        }
        let mock = MockAutopilots::start(environment, &settings, self.speedup).map_err(
            |error| match error {
                PortError::Address { .. } | PortError::Parameter(_) => {
                    CliError::Usage(error.to_string())
                }
            },
        )?;
        let lines: String = mock
            .addresses()
            .iter()
            .map(|address| format!("autopilot {address}\n"))
            .collect();
        let written = out.write_all(lines.as_bytes()).and_then(|()| out.flush());
        written.map_err(|source| CliError::Write {
            path: "standard output".into(),
            source,
        })?;
        match mock.run(&|| stop.is_asked()) {
            0 => Ok(()),
            contacts => Err(CliError::Mission(format!("contacts: {contacts}"))),
        }
    }

    fn sockets(&self) -> (SocketKind, SocketAddr) {
        match (self.udp, self.udp_to) {
            (Some(address), _) => (SocketKind::Udp, address),
            (None, Some(address)) => (SocketKind::UdpTo, address),
            (None, None) => (SocketKind::Tcp, self.tcp.unwrap_or(DEFAULT_TCP)),
        }
    }

    fn environment(&self) -> Result<(Environment, EarthFrame), CliError> {
        let Some(scene) = &self.scene else {
            let kind = match self.vehicle.as_str() {
                "copter" => VehicleKind::Copter,
                _ => VehicleKind::Rover,
            };
            let environment =
                free_space(kind, self.count.unwrap_or(1), self.seed).map_err(CliError::Usage)?;
            return Ok((environment, self.datum));
        };
        let loaded = load::load_world(Some(scene), self.count.map(usize::from))?;
        for warning in &loaded.shapes.warnings {
            complain(&format_args!("warning: {warning}"));
        }
        let scenario = load::world(loaded, Some(scene), Some(self.seed))?;
        let environment = scenario
            .environment_from_cold()
            .map_err(|error| CliError::Usage(error.to_string()))?;
        let venue = &scenario.sim().venue;
        Ok((
            environment,
            EarthFrame::new(venue.datum.geodetic(), venue.x_axis_bearing()),
        ))
    }
}

fn parse_speedup(text: &str) -> Result<f64, String> {
    let speedup: Option<f64> = text
        .parse()
        .ok()
        .filter(|speedup| (0.1..=1000.0).contains(speedup));
    speedup.ok_or_else(|| "expected a number from 0.1 to 1000".to_owned())
}

fn parse_datum(text: &str) -> Result<EarthFrame, String> {
    let expected = || "expected LAT,LON,ALT,BEARING, such as 51.9989,4.3733,0,90".to_owned();
    let numbers: Result<Vec<f64>, _> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>())
        .collect();
    let Ok([latitude_deg, longitude_deg, altitude_m, bearing_deg]) = numbers.as_deref() else {
        return Err(expected());
    };
    let is_sound = (-89.0..=89.0).contains(latitude_deg)
        && (-180.0..=180.0).contains(longitude_deg)
        && (-500.0..=9000.0).contains(altitude_m)
        && bearing_deg.is_finite();
    if !is_sound {
        return Err(expected());
    }
    let datum = Geodetic {
        latitude_deg: *latitude_deg,
        longitude_deg: *longitude_deg,
        altitude_m: *altitude_m,
    };
    Ok(EarthFrame::new(datum, Bearing::from_degrees(*bearing_deg)))
}
