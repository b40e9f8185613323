//! What the kernel writes down of a run: tracks, places, contacts, and what everybody holds at the end.
//! It changes nothing in the world.

use tomoswarm_proto::Digest;

use super::Kernel;
use crate::sim::body::BodyState;
use crate::sim::log::hash;
use crate::sim::operator_script::RUN;
use crate::sim::run_view::{RunView, ShownVehicle};
use crate::sim::world::Collision;

impl Kernel {
    pub(super) fn log(&mut self, who: &str, what: std::fmt::Arguments<'_>) {
        self.record.log.line(self.now, who, what);
    }

    pub(super) fn log_collision(&mut self, collision: &Collision) {
        let place = collision.place;
        self.log(
            "referee",
            format_args!(
                "collision of {} with {} at {:.3},{:.3}",
                collision.vehicle,
                collision
                    .with
                    .map_or("the scene".to_owned(), |peer| peer.to_string()),
                place.x_m,
                place.y_m
            ),
        );
    }

    /// Logs what every node holds at the end: all maps must be one, and every sample made must be stored.
    pub(super) fn log_holdings(&mut self) {
        for vehicle in 0..self.vehicles.len() {
            let node = &mut self.vehicles[vehicle];
            let (who, map) = (
                format!("vehicle {}", node.id()),
                map_hash(&node.map().digest()),
            );
            let (samples, dropped) = (node.samples_made(RUN), node.dropped());
            let waits = node
                .mission()
                .waits_for()
                .map_or("drives on".to_owned(), |waits| waits.to_string());
            let what = format!(
                "holds map {map:016x}, made {samples} samples, dropped {dropped} inputs, {waits}"
            );
            self.log(&who, format_args!("{what}"));
        }
        let station = self.ground.station();
        let (map, samples) = (
            map_hash(&station.map().digest()),
            station.samples().count(RUN),
        );
        self.log(
            "ground",
            format_args!("holds map {map:016x}, stored {samples} samples"),
        );
    }

    /// Returns what is to be seen of the run now.
    pub(super) fn shown(&mut self) -> RunView<'_> {
        self.status.now = self.now;
        let one = |vehicle: usize| {
            let (state, node) = (
                self.environment.world().truth(vehicle, self.now),
                &self.vehicles[vehicle],
            );
            let status = (!self.is_dead[vehicle]).then(|| node.mission().status());
            ShownVehicle {
                id: node.id(),
                at: state.at,
                heading: state.heading,
                status,
            }
        };
        let vehicles = (0..self.vehicles.len()).map(one).collect();
        RunView {
            status: self.status,
            map: self.ground.station().map(),
            vehicles,
        }
    }

    /// Writes down where everybody truly is, and every tenth time into the log.
    pub(super) fn track(&mut self, states: &[BodyState]) {
        for (vehicle, state) in states.iter().enumerate() {
            self.record.track(vehicle, state.at);
        }
        if self.now.as_nanos() % 10_000_000_000 < 1_000_000_000 {
            self.log_poses(states);
        }
    }

    fn log_poses(&mut self, states: &[BodyState]) {
        for (vehicle, state) in states.iter().enumerate() {
            let who = format!("vehicle {}", self.vehicles[vehicle].id());
            let (at, degrees) = (state.at, state.heading.degrees());
            self.log(
                &who,
                format_args!(
                    "at {:.3},{:.3} faces {degrees:.1} drives {:.3}",
                    at.x_m, at.y_m, state.speed_mps
                ),
            );
        }
    }
}

/// Returns a hash of what a node holds of every layer of the map.
fn map_hash(digest: &Digest) -> u64 {
    let words = digest.layers.iter().flat_map(|layer| {
        let (vehicle, boot) = (
            u64::from(layer.layer.vehicle.0),
            u64::from(layer.layer.boot.0),
        );
        [vehicle, boot, u64::from(layer.tiles), layer.hash]
    });
    hash(words)
}
