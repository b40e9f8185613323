//! The files of the nodes of a live swarm, as text: what a simulation's file says, said to one ground station and its
//! vehicles. Opens nothing; the folder and the free ports are the caller's matter.

use std::net::SocketAddr;
use std::path::PathBuf;

use tomoswarm_proto::{OperatorId, RunId, VehicleId};

use crate::config::{
    self, BusFile, Config, Drivers, Endpoint, GroundFile, MissionTable, OperatorFile, PoseFile,
    PoseSource, Protocol, RadioDriver, Record, Sim, Topology, VehicleFile, WorldEndpoint,
    XBEE_BAUD, XbeePort,
};
use crate::run::membership::FIRST_OPERATOR;

/// What recordings of one node may take, megabytes.
const RECORD_MB: usize = 64;
/// The number of the operator that plays a scenario; the file for commands and the page has the first.
pub const SCENARIO_OPERATOR: OperatorId = OperatorId(2);
/// The longest silence after which a neighbour is taken for gone, and the shortest that may be said, seconds.
const LEASE_S: (f64, f64) = (3.0, 1.0);

/// Where everybody is to be found.
#[derive(Clone, PartialEq, Debug)]
pub struct LiveAddresses {
    /// The shape in which the nodes are joined.
    pub topology: Topology,
    /// The venue's file, relative to those of the nodes.
    pub venue: String,
    /// Where the world listens.
    pub world: SocketAddr,
    /// The world's word.
    pub token: String,
    /// Port of this machine at which the ground station listens.
    pub ground_port: u16,
    /// The same of each vehicle, ascending by id; not used in a star.
    pub vehicle_ports: Vec<u16>,
    /// The folder with a port `vehicle-N` for the XBee of each; `None` = radios are the world's.
    pub xbees: Option<PathBuf>,
}

impl LiveAddresses {
    /// Returns the text of the venue's file: what the simulation says of the swarm's contract is in it.
    pub fn venue(&self, sim: &Sim) -> String {
        text(Config::Venue(sim.venue.clone()))
    }

    /// Returns the text of the ground station's file; `empty` is the run with which images are compared.
    pub fn ground(&self, sim: &Sim, empty: Option<RunId>) -> String {
        text(Config::Ground(Box::new(GroundFile {
            venue_file: self.venue.clone(),
            venue: sim.venue.clone(),
            vehicles: sim.vehicle_ids().collect(),
            state_dir: "state/ground".to_owned(),
            sweep: sim.sweep.clone(),
            imaging: sim.imaging,
            reception: sim.radio.reception,
            compare_with: empty,
            take_over: false,
            bus: self.bus(sim, Some(self.ground_port), &[]),
            record: RECORD,
            operators_note: String::new(),
        })))
    }

    /// Returns the text of a vehicle's file.
    pub fn vehicle(&self, sim: &Sim, id: VehicleId) -> String {
        let index = usize::from(id.0.saturating_sub(1)).min(self.vehicle_ports.len());
        let own = self.vehicle_ports.get(index).copied();
        text(Config::Vehicle(Box::new(VehicleFile {
            venue_file: self.venue.clone(),
            venue: sim.venue.clone(),
            id,
            home: sim.home(id).unwrap_or_default(),
            state_dir: format!("state/vehicle-{id}"),
            mission: MissionTable::default(),
            task: None,
            drivers: Drivers {
                radio: self.radio(id),
                ..Drivers::SIMULATED
            },
            body: sim.vehicles.body,
            flight: sim.vehicles.flight,
            look: sim.range.look.clone(),
            radio: sim.radio.own,
            pose: PoseFile {
                source: PoseSource::Autopilot,
                expected_sd_m: sim.vehicles.pose_sd_m,
            },
            world: WorldEndpoint {
                connect: self.world,
                token: self.token.clone(),
            },
            safety: sim.safety,
            bus: self.bus(sim, own, &self.vehicle_ports[..index]),
            record: RECORD,
        })))
    }

    /// Returns what speaks with a vehicle's radio.
    fn radio(&self, id: VehicleId) -> RadioDriver {
        let port = |folder: &PathBuf| {
            let port = folder.join(format!("vehicle-{id}"));
            RadioDriver::Xbee(XbeePort {
                port: port.display().to_string(),
                baud: XBEE_BAUD,
            })
        };
        self.xbees.as_ref().map_or(RadioDriver::Simulated, port)
    }

    /// Returns the text of the file of the operator's commands. In a mesh it names every vehicle: an emergency must reach them
    /// without the ground station too.
    pub fn operator(&self, sim: &Sim) -> String {
        text(Config::Operator(Box::new(OperatorFile {
            id: FIRST_OPERATOR,
            venue_file: self.venue.clone(),
            venue: sim.venue.clone(),
            bus: self.bus(sim, Some(0), &self.vehicle_ports),
            mavlink: None,
        })))
    }

    /// Returns where a node listens and what it connects to: the ground station, unless it is the one that listens there, and
    /// in a mesh `others`, so that vehicles find each other without it too.
    fn bus(&self, sim: &Sim, own: Option<u16>, others: &[u16]) -> BusFile {
        let is_ground = own == Some(self.ground_port);
        let ground = [self.ground_port];
        let ground: &[u16] = if is_ground { &[] } else { &ground };
        let (listen, others) = match self.topology {
            Topology::Mesh => (own, others),
            Topology::Star => (own.filter(|_| is_ground), &[][..]),
        };
        let connect = ground.iter().chain(others.iter().filter(|_| !is_ground));
        // A vehicle must not be lost while its link may still be silent.
        let (longest_s, shortest_s) = LEASE_S;
        let lease_s = (0.5 * sim.venue.swarm.lost_after_s).clamp(shortest_s, longest_s);
        let (topology, here) = (self.topology, |port: &u16| here(*port));
        let listen = listen.iter().map(here).collect();
        let (connect, egress_kb_per_s) = (connect.map(here).collect(), sim.bus.egress_kb_per_s);
        BusFile {
            topology,
            listen,
            connect,
            lease_s,
            egress_kb_per_s,
            ..BusFile::unsaid()
        }
    }
}

/// The recordings of a node.
const RECORD: Record = Record {
    limit_mb: RECORD_MB,
};

/// Returns an endpoint of this machine.
fn here(port: u16) -> Endpoint {
    Endpoint {
        protocol: Protocol::Tcp,
        host: "127.0.0.1".to_owned(),
        port,
    }
}

/// Returns the text of a file, every key included.
fn text(config: Config) -> String {
    format!(
        "# Written by tomoswarm sim --live.\n{}",
        config::to_toml(&config)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::bundled;
    use crate::geom::Angle;
    use crate::node::VehicleSettings;
    use tomoswarm_proto::Boot;

    /// The bundled place, with everything that a node's file carries away from its default.
    fn sim() -> Sim {
        let text = "kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\nscene = \"../scenes/courtyard.scene.toml\"\n\
            empty_sweep = true\n[vehicles]\ncount = 8\nradius_m = 0.3\nheight_m = 0.4\nantenna_height_m = 0.6\n\
            max_speed_mps = 0.4\nacceleration_mps2 = 0.7\nbraking_mps2 = 1.5\nturn_rate_deg_per_s = 77\npose_sd_m = 0.04\n\
            [range]\nbeams_deg = [10, -20, 33.3]\nhalf_angle_deg = 12\nmin_range_m = 0.03\nmax_range_m = 5\n\
            sure_range_m = 3.5\nscan_period_s = 0.08\nsettle_s = 0.02\n[safety]\npadding_m = 0.12\nseparation_m = 1.2\n\
            pose_sd_max_m = 0.4\nautonomy_s = 55\nseparation_up_m = 3\nbattery_return = 0.3\nbattery_hold = 0.04\ncloseness_m = 0.35\n[radio]\nchannel = 17\npower_dbm = -3\nslot_ms = 40\n\
            sensitivity_dbm = -95\n[sweep]\npositions = 60\nlaps = 7\n[imaging]\npixels = [30, 31]\nbin_m = 0.4\n\
            min_link_m = 2.5\nrim_m = 1.1\npeaks = 4\npeak_separation_m = 2.5\nsolver = \"tikhonov\"\nweights = \"line\"\n\
            [imaging.prior]\nsigma_db_per_m = 0.7\n[imaging.structure_prior]\ncorrelation_length_m = 1.3\n";
        config::read_sim("configs/a.toml", text, None, &mut |path| {
            bundled::load(path)
        })
        .unwrap()
    }

    fn places(topology: Topology) -> LiveAddresses {
        LiveAddresses {
            topology,
            venue: "courtyard.venue.toml".to_owned(),
            world: "127.0.0.1:7500".parse().unwrap(),
            token: "0123456789abcdef".to_owned(),
            ground_port: 7600,
            vehicle_ports: (7601..=7608).collect(),
            xbees: None,
        }
    }

    #[test]
    fn each_vehicle_speaks_with_an_xbee_of_its_own_where_there_are_some() {
        let sim = sim();
        let places = LiveAddresses {
            xbees: Some(PathBuf::from("/run/the ports")),
            ..places(Topology::Mesh)
        };
        for id in sim.vehicle_ids() {
            let text = places.vehicle(&sim, id);
            let file =
                config::read_vehicle("configs/v.toml", &text, &mut |_| Ok(places.venue(&sim)));
            let RadioDriver::Xbee(port) = file.unwrap().drivers.radio else {
                panic!("{text}");
            };
            assert_eq!(port.port, format!("/run/the ports/vehicle-{id}"));
        }
    }

    #[test]
    fn vehicles_are_told_what_the_simulation_says() {
        let sim = sim();
        for topology in [Topology::Mesh, Topology::Star] {
            for id in sim.vehicle_ids() {
                let text = places(topology).vehicle(&sim, id);
                let file = config::read_vehicle("configs/v.toml", &text, &mut |_| {
                    Ok(places(topology).venue(&sim))
                })
                .unwrap();
                assert_eq!((file.id, Some(file.home)), (id, sim.home(id)));
                assert_eq!(file.safety, sim.safety);
                assert_eq!(file.pose.expected_sd_m, sim.vehicles.pose_sd_m);
                let (found, expected) = (
                    VehicleSettings::from_vehicle_file(&file, Boot(1)),
                    VehicleSettings::from_config(&sim, id, Boot(1), file.home),
                );
                assert_eq!(
                    (found.body, found.radio, found.safety),
                    (expected.body, expected.radio, expected.safety)
                );
                assert_eq!(
                    (found.fence, found.lattice),
                    (expected.fence, expected.lattice)
                );
                assert_eq!(
                    (&file.look, file.venue.hash()),
                    (&sim.range.look, sim.venue.hash())
                );
                let (found, wanted) = (&found.look, &expected.look);
                let near = |a: Angle, b: Angle| (a.radians() - b.radians()).abs() < 1e-9;
                assert_eq!(found.beams.len(), 3);
                assert!(
                    found
                        .beams
                        .iter()
                        .zip(&wanted.beams)
                        .all(|(a, b)| near(*a, *b))
                );
                assert!(near(found.half_angle, wanted.half_angle));
                assert_eq!(
                    (
                        found.min_range_m,
                        found.max_range_m,
                        found.sure_range_m,
                        found.period,
                        found.settle
                    ),
                    (
                        wanted.min_range_m,
                        wanted.max_range_m,
                        wanted.sure_range_m,
                        wanted.period,
                        wanted.settle
                    )
                );
            }
        }
    }

    #[test]
    fn the_ground_station_sweeps_and_images_as_the_simulation_does() {
        let sim = sim();
        for topology in [Topology::Mesh, Topology::Star] {
            let text = places(topology).ground(&sim, Some(RunId(1)));
            let file = config::read_ground("configs/g.toml", &text, &mut |_| {
                Ok(places(topology).venue(&sim))
            })
            .unwrap();
            assert_eq!(file.vehicles, sim.vehicle_ids().collect::<Vec<_>>());
            assert_eq!((&file.sweep, &file.imaging), (&sim.sweep, &sim.imaging));
            assert_eq!(
                (file.reception.sensitivity_dbm, file.compare_with),
                (-95.0, Some(RunId(1)))
            );
            let text = places(topology).operator(&sim);
            config::read_operator("configs/o.toml", &text, &mut |_| {
                Ok(places(topology).venue(&sim))
            })
            .unwrap();
        }
    }

    #[test]
    fn in_a_mesh_everyone_is_reached_without_the_ground_and_in_a_star_nobody_listens_but_the_ground()
     {
        let sim = sim();
        let bus = |topology, id: u8| {
            let text = places(topology).vehicle(&sim, VehicleId(id));
            config::read_vehicle("configs/v.toml", &text, &mut |_| {
                Ok(places(topology).venue(&sim))
            })
            .unwrap()
            .bus
        };
        let mesh = bus(Topology::Mesh, 3);
        assert_eq!(
            mesh.listen
                .iter()
                .map(|endpoint| endpoint.port)
                .collect::<Vec<_>>(),
            [7603]
        );
        assert_eq!(
            mesh.connect
                .iter()
                .map(|endpoint| endpoint.port)
                .collect::<Vec<_>>(),
            [7600, 7601, 7602]
        );
        let star = bus(Topology::Star, 3);
        assert!(star.listen.is_empty());
        assert_eq!(
            star.connect
                .iter()
                .map(|endpoint| endpoint.port)
                .collect::<Vec<_>>(),
            [7600]
        );
        let operator = |topology| {
            let text = places(topology).operator(&sim);
            let file = config::read_operator("configs/o.toml", &text, &mut |_| {
                Ok(places(topology).venue(&sim))
            });
            file.unwrap()
                .bus
                .connect
                .iter()
                .map(|endpoint| endpoint.port)
                .collect::<Vec<_>>()
        };
        assert_eq!(operator(Topology::Mesh), (7600..=7608).collect::<Vec<_>>());
        assert_eq!(operator(Topology::Star), [7600]);
    }
}
