//! Simulated vehicles at sockets: the fleet that shows them over MAVLink and those who are connected. Whoever owns the
//! environment and its time hands both in.

use std::io;
use std::net::SocketAddr;

use super::mavlink_sockets::{FromClient, MavlinkSockets, SocketKind, Told};
use crate::mavlink::client_link::ClientBytes;
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::signing::{KEY_BYTES, signing_time};
use crate::sim::environment::Environment;
use crate::sim::mavlink_fleet::{Endpoints, MavlinkFleet};
use crate::sim::mavlink_vehicle::that_keep_place;
use crate::time::Time;

/// How simulated vehicles are served.
#[derive(Clone, Debug)]
pub struct PortSettings {
    /// Which sockets.
    pub sockets: SocketKind,
    /// The first endpoint; those of more vehicles have the next ports.
    pub address: SocketAddr,
    /// How vehicles are shown.
    pub endpoints: Endpoints,
    /// Only who signs with this key is heard.
    pub key: Option<[u8; KEY_BYTES]>,
    /// Where the vehicles' frame lies.
    pub frame: EarthFrame,
    /// Whether failsafes are on, and keep vehicles where they are; an autopilot comes without them.
    pub has_failsafes: bool,
    /// Parameters that are not to begin with the values that an autopilot comes with.
    pub parameters: Vec<(String, f32)>,
}

/// Why vehicles cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// An endpoint.
    #[error("{address} cannot be used: {source}")]
    Address {
        /// Which one.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// A parameter.
    #[error("the autopilot has no parameter {0}")]
    Parameter(String),
}

impl From<(SocketAddr, io::Error)> for PortError {
    fn from((address, source): (SocketAddr, io::Error)) -> PortError {
        PortError::Address { address, source }
    }
}

/// Vehicles at sockets; dropping it ends all connections.
pub struct MavlinkPort {
    fleet: MavlinkFleet,
    sockets: MavlinkSockets,
    output: Vec<ClientBytes>,
}

impl MavlinkPort {
    /// Opens the sockets; `told` gets what clients do, to be handed to [`MavlinkPort::take`].
    ///
    /// # Errors
    /// [`PortError`].
    pub fn open(
        environment: &mut Environment,
        settings: &PortSettings,
        told: Told,
    ) -> Result<MavlinkPort, PortError> {
        let mut fleet = MavlinkFleet::new(
            environment,
            settings.frame,
            settings.endpoints,
            settings.key,
        );
        let failsafes: &[_] = match settings.has_failsafes {
            true => that_keep_place(environment.kind()),
            false => &[],
        };
        let given = settings.parameters.iter();
        let given = given.map(|(name, value)| (name.as_str(), *value));
        for (name, value) in failsafes.iter().copied().chain(given) {
            if !fleet.set_parameter(Time::ZERO, (name, value), environment) {
                return Err(PortError::Parameter(name.to_owned()));
            }
        }
        let sockets =
            MavlinkSockets::open(settings.sockets, settings.address, fleet.endpoints(), told)?;
        Ok(MavlinkPort {
            fleet,
            sockets,
            output: Vec::new(),
        })
    }

    /// Returns where vehicles are served.
    pub fn addresses(&self) -> &[SocketAddr] {
        self.sockets.addresses()
    }

    /// Returns when something is to be said next.
    pub fn deadline(&self) -> Time {
        self.fleet.deadline()
    }

    /// Takes what a client has done; the environment has gone on to `now`.
    pub fn take(&mut self, now: Time, word: FromClient, environment: &mut Environment) {
        match word {
            FromClient::Joined { client, endpoint } => {
                self.fleet.joined(now, client, endpoint, signing_clock())
            }
            FromClient::Bytes { client, bytes } => {
                self.fleet
                    .hear(now, client, &bytes, environment, &mut self.output);
            }
            FromClient::Left { client } => self.fleet.left(client),
        }
    }

    /// Says what is due by now, and sends everything that was said.
    pub fn due(&mut self, now: Time, environment: &mut Environment) {
        self.fleet.due(now, environment, &mut self.output);
        for (client, bytes) in self.output.drain(..) {
            self.sockets.send(client, bytes);
        }
    }
}

/// Returns the time of signatures by this machine's clock.
pub fn signing_clock() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::SystemTime::UNIX_EPOCH);
    signing_time(since.unwrap_or_default())
}
