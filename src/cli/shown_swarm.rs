//! How `tomoswarm ground --mavlink` comes to the swarm that it shows: by an operator's file with a table `[mavlink]`.

use std::path::{Path, PathBuf};

use super::describe::Line;
use super::error::CliError;
use super::operator::OperatorContext;
use super::read;
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::swarm_server::SwarmServerSettings;
use crate::run::mavlink_sockets::SocketKind;
use crate::run::swarm_mavlink::{SwarmMavlink, SwarmMavlinkSettings};

/// A swarm that is to be shown over MAVLink.
pub(super) struct ShownSwarm {
    path: PathBuf,
    operator: OperatorContext,
    settings: SwarmMavlinkSettings,
}

impl ShownSwarm {
    /// Reads an operator's file and the key that it names.
    ///
    /// # Errors
    /// One of them is wrong, or the file does not say where the swarm is to be shown.
    pub(super) fn read(path: &Path) -> Result<ShownSwarm, CliError> {
        let operator = OperatorContext::read(path)?;
        let serving = operator.mavlink.as_ref();
        let endpoint = serving.and_then(|serving| match (serving.listen, serving.address) {
            (Some(listen), _) => Some((serving, SocketKind::Udp, listen)),
            (None, Some(address)) => Some((serving, SocketKind::UdpTo, address)),
            (None, None) => None,
        });
        let Some((serving, sockets, address)) = endpoint else {
            let reason = "does not say where the swarm is to be shown; an operator's file with a table [mavlink] and its \
                          address or listen is needed";
            return Err(CliError::Input {
                path: path.to_owned(),
                reason: reason.to_owned(),
            });
        };
        let key = serving
            .key_file
            .as_deref()
            .map(|file| read::signing_key(Path::new(file)));
        let venue = &operator.venue;
        let server = SwarmServerSettings {
            frame: EarthFrame::new(venue.datum.geodetic(), venue.x_axis_bearing()),
            homes: venue.homes.clone(),
            separation_m: venue.swarm.separation_m,
            commands: serving.commands,
            file: read::shown(path),
            key: key.transpose()?,
        };
        let settings = SwarmMavlinkSettings {
            sockets,
            address,
            venue_hash: venue.hash(),
            server,
        };
        let path = path.to_owned();
        Ok(ShownSwarm {
            path,
            operator,
            settings,
        })
    }

    /// Returns what is shown where, in words.
    pub(super) fn line(&self) -> Line {
        let way = match self.settings.sockets {
            SocketKind::UdpTo => "sent to",
            SocketKind::Udp | SocketKind::Tcp => "at",
        };
        let commands = match self.settings.server.commands {
            true => "commands become orders",
            false => "commands are denied",
        };
        let address = self.settings.address;
        ("mavlink", format!("{way} {address}, {commands}"))
    }

    /// Joins the swarm, and begins to show it. Without commands it only listens.
    ///
    /// # Errors
    /// The bus or the socket cannot be opened.
    pub(super) fn start(self) -> Result<SwarmMavlink, CliError> {
        let operator = self.operator.open_as(self.settings.server.commands)?;
        let file = self.path.display();
        SwarmMavlink::start(operator, self.settings)
            .map_err(|error| CliError::NotNow(format!("{file}: [mavlink] {error}")))
    }
}
