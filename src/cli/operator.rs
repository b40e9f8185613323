//! How the operator's commands (`order`, `status`, `tap`, `preflight`) come to the bus: from a file of kind `operator`, or
//! where there are no certificates from the ground station's own file on its machine. They listen on a free port of this
//! machine in a mesh, and are clients in a star.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use tomoswarm_proto::{Boot, Hello, OperatorId, Sender, VehicleId};

use super::error::CliError;
use super::read;
use crate::actor::Fault;
use crate::config::{self, BusFile, Config, Endpoint, MavlinkServing, Protocol, Topology, Venue};
use crate::operator::operator_actor::OperatorSettings;
use crate::run::bus::{BusError, BusSettings};
use crate::run::live_operator::LiveOperator;
use crate::run::membership::{self, FIRST_OPERATOR, RandomUnavailable};
use crate::run::operator_session::Session;

/// What a command knows before it hears anything.
pub(super) struct OperatorContext {
    /// How it joins.
    pub settings: BusSettings,
    /// The place.
    pub venue: Venue,
    /// The vehicles that the file names; empty when it names none.
    pub vehicles: BTreeSet<VehicleId>,
    /// Where it is to show the swarm over MAVLink.
    pub mavlink: Option<MavlinkServing>,
}

impl OperatorContext {
    /// Reads the file.
    ///
    /// # Errors
    /// It is wrong, or of another kind.
    pub(super) fn read(path: &Path) -> Result<OperatorContext, CliError> {
        let text = read::text(path)?;
        match config::read(&read::shown(path), &text, &mut read::around(path))? {
            Config::Operator(file) => {
                let settings = settings(file.id, path, &file.venue, &file.bus)?;
                Ok(OperatorContext {
                    settings,
                    venue: file.venue,
                    vehicles: BTreeSet::new(),
                    mavlink: file.mavlink,
                })
            }
            Config::Ground(file) if file.bus.identity.is_some() => {
                let reason = "is the ground station's own file, and its certificate is not an operator's; \
                              give the operator's file here, which `tomoswarm enroll FOLDER --venue FILE operator \
                              --ground-host HOST` writes (FOLDER/operator-1/operator.toml)";
                Err(CliError::Input {
                    path: path.to_owned(),
                    reason: reason.to_owned(),
                })
            }
            Config::Ground(file) => {
                let bus = beside_ground(&file.bus);
                let settings = settings(FIRST_OPERATOR, path, &file.venue, &bus)?;
                Ok(OperatorContext {
                    settings,
                    venue: file.venue,
                    vehicles: file.vehicles.into_iter().collect(),
                    mavlink: None,
                })
            }
            Config::Venue(_)
            | Config::Scene(_)
            | Config::Sim(_)
            | Config::Experiment(_)
            | Config::Vehicle(_) => {
                let reason = "is of another kind; kind = \"operator\" or \"ground\" is needed here"
                    .to_owned();
                Err(CliError::Input {
                    path: path.to_owned(),
                    reason,
                })
            }
        }
    }

    /// Joins the bus.
    ///
    /// # Errors
    /// The bus does not take the settings, or cannot listen; the system gives no random numbers.
    pub(super) fn open(&self) -> Result<LiveOperator, CliError> {
        self.open_as(true)
    }

    /// Joins the bus; who does not greet only listens.
    ///
    /// # Errors
    /// As for [`OperatorContext::open`].
    pub(super) fn open_as(&self, greets: bool) -> Result<LiveOperator, CliError> {
        let settings = self
            .operator(greets)
            .map_err(|error| CliError::Fault(error.to_string()))?;
        let opened = Session::open(self.settings.clone(), self.venue.hash());
        let session = opened.map_err(|error| match error {
            BusError::Settings { .. } => CliError::Usage(error.to_string()),
            BusError::Listen { .. } | BusError::Thread(_) => CliError::Swarm(error.to_string()),
        })?;
        Ok(LiveOperator::new(session, settings))
    }

    fn operator(&self, greets: bool) -> Result<OperatorSettings, RandomUnavailable> {
        // An operator's tool counts no starts.
        let hello = membership::greeting(self.settings.node, Boot(0), &self.venue, Vec::new())?;
        Ok(OperatorSettings {
            hello: Hello {
                is_member: true,
                ..hello
            },
            greets,
            // Holder 0 is that of no operator.
            holder: membership::draw()?.max(1),
            expected: self.vehicles.clone(),
        })
    }
}

/// Makes the error of an operator that cannot go on, which is a fault of the program.
pub(super) fn fault(fault: Fault) -> CliError {
    CliError::Fault(fault.to_string())
}

/// Reads a span of seconds from the command line.
///
/// # Errors
/// It is no number from 0.1 to 86,400.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let number: Option<f64> = text.parse().ok();
    let number = number.filter(|seconds_s| (0.1..=86_400.0).contains(seconds_s));
    number
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "0.1 to 86400 seconds are allowed".to_owned())
}

/// Returns how a command joins that runs beside the ground station.
fn beside_ground(ground: &BusFile) -> BusFile {
    let own = Endpoint {
        protocol: Protocol::Tcp,
        host: "127.0.0.1".to_owned(),
        port: 0,
    };
    let listen = match ground.topology {
        Topology::Mesh => vec![own],
        Topology::Star => Vec::new(),
    };
    let its_own = ground
        .listen
        .iter()
        .filter(|endpoint| endpoint.port != 0)
        .map(reached);
    let connect = its_own.chain(ground.connect.iter().cloned()).collect();
    BusFile {
        listen,
        connect,
        ..ground.clone()
    }
}

/// Returns where one that listens on all addresses is reached from its own machine.
fn reached(endpoint: &Endpoint) -> Endpoint {
    let host = match endpoint.host.as_str() {
        "0.0.0.0" => "127.0.0.1".to_owned(),
        "::" => "::1".to_owned(),
        host => host.to_owned(),
    };
    Endpoint {
        host,
        ..endpoint.clone()
    }
}

fn settings(
    operator: OperatorId,
    path: &Path,
    venue: &Venue,
    file: &BusFile,
) -> Result<BusSettings, CliError> {
    let node = Sender::Operator(operator);
    if file.connect.is_empty() {
        let reason = "names no endpoint with a port by which the swarm can be reached".to_owned();
        return Err(CliError::Input {
            path: path.to_owned(),
            reason,
        });
    }
    let access = membership::access(node, venue, file, None);
    let access = access.map_err(|error| CliError::Usage(error.to_string()))?;
    Ok(membership::bus_settings(node, venue, file, access))
}
