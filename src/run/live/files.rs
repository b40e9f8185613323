//! The files of the nodes of a live swarm, as text: what a simulation's file says, said to one ground station and its
//! vehicles. Opens nothing; the folder and the free ports are the caller's matter.

use std::fmt::Write as _;
use std::net::SocketAddr;

use tomoswarm_proto::{RunId, VehicleId};

use crate::config::{Imaging, Planner, Prior, Sim, Solver, Sweep, Topology, Weights};
use crate::geom::Angle;
use crate::plan::{Mount, Mounts};

/// What recordings of one node may take, megabytes.
const RECORD_MB: usize = 64;

/// Where everybody is to be found.
#[derive(Clone, PartialEq, Debug)]
pub struct Places {
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
}

impl Places {
    /// Gives the text of the ground station's file; `empty` is the run with which images are compared.
    pub fn ground(&self, sim: &Sim, empty: Option<RunId>) -> String {
        let ids: Vec<String> = sim.vehicle_ids().map(|id| id.to_string()).collect();
        let mut text = format!(
            "# Written by tomoswarm sim --live.\nkind = \"ground\"\nvenue = {:?}\nvehicles = [{}]\nstate_dir = \"state/ground\"\n",
            self.venue,
            ids.join(", ")
        );
        if let Some(empty) = empty {
            line(&mut text, "compare_with", empty);
        }
        sweep(&mut text, &sim.sweep);
        imaging(&mut text, &sim.imaging);
        head(&mut text, "safety");
        number(&mut text, "separation_m", sim.safety.separation_m);
        head(&mut text, "radio");
        number(&mut text, "sensitivity_dbm", sim.radio.sensitivity_dbm);
        self.bus(&mut text, Some(self.ground_port), &[]);
        record(&mut text);
        text
    }

    /// Gives the text of a vehicle's file.
    pub fn vehicle(&self, sim: &Sim, id: VehicleId) -> String {
        let mut text = format!(
            "# Written by tomoswarm sim --live.\nkind = \"vehicle\"\nvenue = {:?}\nid = {id}\nstate_dir = \"state/vehicle-{id}\"\n",
            self.venue
        );
        body(&mut text, sim);
        for driver in ["autopilot", "servo"] {
            head(&mut text, driver);
            line(&mut text, "driver", "\"sim\"");
        }
        look(&mut text, sim);
        head(&mut text, "radio");
        line(&mut text, "driver", "\"sim\"");
        line(&mut text, "channel", sim.radio.channel);
        line(&mut text, "power_dbm", sim.radio.power_dbm);
        number(&mut text, "slot_ms", sim.radio.slot.as_secs_f64() * 1e3);
        head(&mut text, "pose");
        number(&mut text, "expected_sd_m", sim.vehicles.pose_sd_m);
        safety(&mut text, sim);
        let _ = writeln!(text, "\n[world]\nconnect = \"{}\"\ntoken = {:?}", self.world, self.token);
        let index = usize::from(id.0.saturating_sub(1)).min(self.vehicle_ports.len());
        let own = self.vehicle_ports.get(index).copied();
        self.bus(&mut text, own, &self.vehicle_ports[..index]);
        record(&mut text);
        text
    }

    /// Gives the text of the file of the operator's commands.
    pub fn operator(&self) -> String {
        let mut text =
            format!("# Written by tomoswarm sim --live.\nkind = \"operator\"\nvenue = {:?}\n", self.venue);
        self.bus(&mut text, Some(0), &[]);
        text
    }

    /// Says where a node listens and what it connects to: the ground station, unless it is the one that listens there, and
    /// in a mesh `others`, so that vehicles find each other without it too.
    fn bus(&self, text: &mut String, own: Option<u16>, others: &[u16]) {
        let endpoints = |ports: &[u16]| {
            let each: Vec<String> = ports.iter().map(|port| format!("\"tcp/127.0.0.1:{port}\"")).collect();
            format!("[{}]", each.join(", "))
        };
        let is_ground = own == Some(self.ground_port);
        let ground = [self.ground_port];
        let ground: &[u16] = if is_ground { &[] } else { &ground };
        let (name, listen, others) = match self.topology {
            Topology::Mesh => ("mesh", own, others),
            Topology::Star => ("star", own.filter(|_| is_ground), &[][..]),
        };
        head(text, "bus");
        let _ = writeln!(text, "topology = \"{name}\"");
        if let Some(port) = listen {
            line(text, "listen", endpoints(&[port]));
        }
        if !is_ground {
            line(text, "connect", endpoints(&[ground, others].concat()));
        }
    }
}

fn head(text: &mut String, section: &str) {
    let _ = writeln!(text, "\n[{section}]");
}

fn line(text: &mut String, key: &str, value: impl std::fmt::Display) {
    // Writing into a string cannot fail.
    let _ = writeln!(text, "{key} = {value}");
}

/// Writes a number with all its digits, and a point.
fn number(text: &mut String, key: &str, value: f64) {
    let _ = writeln!(text, "{key} = {value:?}");
}

/// Gives radians as degrees without the last digits, which only come from reckoning.
fn degrees(radians: f64) -> f64 {
    libm::round(radians.to_degrees() * 1e9) / 1e9
}

fn body(text: &mut String, sim: &Sim) {
    let body = sim.vehicles.body();
    head(text, "vehicle");
    number(text, "radius_m", body.radius_m);
    number(text, "height_m", body.height_m);
    number(text, "antenna_height_m", body.antenna_height_m);
    number(text, "max_speed_mps", body.max_speed_mps);
    number(text, "acceleration_mps2", body.acceleration_mps2);
    number(text, "braking_mps2", body.braking_mps2);
    number(text, "turn_rate_deg_per_s", degrees(body.turn_rate_rad_per_s));
}

fn look(text: &mut String, sim: &Sim) {
    let range = &sim.range;
    let beam = |beam: &Angle| format!("{:?}", degrees(beam.radians()));
    let beams: Vec<String> = range.beams.iter().map(beam).collect();
    head(text, "range");
    line(text, "driver", "\"sim\"");
    line(text, "beams_deg", format!("[{}]", beams.join(", ")));
    number(text, "half_angle_deg", degrees(range.half_angle_rad));
    number(text, "min_range_m", range.min_range_m);
    number(text, "max_range_m", range.max_range_m);
    number(text, "sure_range_m", range.sure_range_m);
    number(text, "scan_period_s", range.scan_period.as_secs_f64());
    number(text, "settle_s", range.settle.as_secs_f64());
    number(text, "farness_m", range.farness_m);
    if range.mounts != Mounts::default() {
        range.mounts.all().iter().for_each(|mount| sensor(text, mount));
    }
}

fn sensor(text: &mut String, mount: &Mount) {
    let _ = writeln!(text, "\n[[range.sensor]]");
    number(text, "mount_deg", degrees(mount.zero.radians()));
    number(text, "servo_from_deg", degrees(mount.from_rad));
    number(text, "servo_to_deg", degrees(mount.to_rad));
    number(text, "slew_s_per_60_deg", mount.slew_s_per_rad * 60f64.to_radians());
}

fn safety(text: &mut String, sim: &Sim) {
    let safety = &sim.safety;
    head(text, "safety");
    number(text, "padding_m", safety.padding_m);
    number(text, "separation_m", safety.separation_m);
    number(text, "pose_sd_max_m", safety.pose_sd_max_m);
    number(text, "autonomy_s", safety.autonomy.as_secs_f64());
    number(text, "battery_return", safety.battery_return);
    number(text, "closeness_m", safety.closeness_m);
}

fn sweep(text: &mut String, sweep: &Sweep) {
    let planner = match sweep.planner {
        Planner::RotatingGap => "rotating-gap",
        Planner::Fan => "fan",
        Planner::Calibrate => "calibrate",
        Planner::FanCorners => "fan-corners",
        Planner::FanStraight => "fan-straight",
    };
    head(text, "sweep");
    let _ = writeln!(text, "planner = \"{planner}\"");
    line(text, "positions", sweep.positions);
    if let Some(laps) = sweep.laps {
        line(text, "laps", laps);
    }
    number(text, "dwell_s", sweep.dwell.as_secs_f64());
    number(text, "dwell_limit_s", sweep.dwell_limit.as_secs_f64());
}

fn imaging(text: &mut String, imaging: &Imaging) {
    let weights = match imaging.weights {
        Weights::Line => "line",
        Weights::Ellipse => "ellipse",
        Weights::InverseArea => "inverse-area",
    };
    let solver = match imaging.solver {
        Solver::Map => "map",
        Solver::Tikhonov => "tikhonov",
    };
    head(text, "imaging");
    line(text, "pixels", format!("[{}, {}]", imaging.columns, imaging.rows));
    let _ = writeln!(text, "weights = \"{weights}\"\nsolver = \"{solver}\"");
    number(text, "width_m", imaging.width_m);
    number(text, "bin_m", imaging.bin_m);
    number(text, "min_link_m", imaging.min_link_m);
    number(text, "rim_m", imaging.rim_m);
    number(text, "peak_separation_m", imaging.peak_separation_m);
    line(text, "peaks", imaging.peaks);
    for (name, prior) in [("prior", imaging.prior), ("structure_prior", imaging.structure_prior)] {
        let Prior { sigma_db_per_m, correlation_length_m } = prior;
        head(text, &format!("imaging.{name}"));
        number(text, "sigma_db_per_m", sigma_db_per_m);
        number(text, "correlation_length_m", correlation_length_m);
    }
}

fn record(text: &mut String) {
    head(text, "record");
    line(text, "limit_mb", RECORD_MB);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{self, bundled};
    use crate::node::Settings;
    use tomoswarm_proto::Boot;

    /// The bundled place, with everything that a node's file carries away from its default.
    fn sim() -> Sim {
        let text = "kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\nscene = \"../scenes/courtyard.scene.toml\"\n\
            empty_sweep = true\n[vehicles]\ncount = 8\nradius_m = 0.3\nheight_m = 0.4\nantenna_height_m = 0.6\n\
            max_speed_mps = 0.4\nacceleration_mps2 = 0.7\nbraking_mps2 = 1.5\nturn_rate_deg_per_s = 77\npose_sd_m = 0.04\n\
            [range]\nbeams_deg = [10, -20, 33.3]\nhalf_angle_deg = 12\nmin_range_m = 0.03\nmax_range_m = 5\n\
            sure_range_m = 3.5\nscan_period_s = 0.08\nsettle_s = 0.02\n[safety]\npadding_m = 0.12\nseparation_m = 1.2\n\
            pose_sd_max_m = 0.4\nautonomy_s = 55\nbattery_return = 0.3\ncloseness_m = 0.35\n[radio]\nchannel = 17\npower_dbm = -3\nslot_ms = 40\n\
            sensitivity_dbm = -95\n[sweep]\npositions = 60\nlaps = 7\n[imaging]\npixels = [30, 31]\nbin_m = 0.4\n\
            min_link_m = 2.5\nrim_m = 1.1\npeaks = 4\npeak_separation_m = 2.5\nsolver = \"tikhonov\"\nweights = \"line\"\n\
            [imaging.prior]\nsigma_db_per_m = 0.7\n[imaging.structure_prior]\ncorrelation_length_m = 1.3\n";
        config::read_sim("configs/a.toml", text, None, &mut |path| bundled::load(path)).unwrap()
    }

    fn places(topology: Topology) -> Places {
        Places {
            topology,
            venue: "courtyard.venue.toml".to_owned(),
            world: "127.0.0.1:7500".parse().unwrap(),
            token: "0123456789abcdef".to_owned(),
            ground_port: 7600,
            vehicle_ports: (7601..=7608).collect(),
        }
    }

    #[test]
    fn vehicles_are_told_what_the_simulation_says() {
        let sim = sim();
        for topology in [Topology::Mesh, Topology::Star] {
            for id in sim.vehicle_ids() {
                let text = places(topology).vehicle(&sim, id);
                let file =
                    config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap();
                assert_eq!((file.id, Some(file.home)), (id, sim.home(id)));
                assert_eq!(file.safety, sim.safety);
                assert_eq!(file.pose_sd_m, sim.vehicles.pose_sd_m);
                let (told, expected) = (
                    Settings::from_vehicle_file(&file, Boot(1)),
                    Settings::from_config(&sim, id, Boot(1), file.home),
                );
                assert_eq!(
                    (told.body, told.radio, told.safety),
                    (expected.body, expected.radio, expected.safety)
                );
                assert_eq!((told.fence, told.lattice), (expected.fence, expected.lattice));
                let (found, wanted) = (&told.look, &expected.look);
                let near = |a: Angle, b: Angle| (a.radians() - b.radians()).abs() < 1e-9;
                assert_eq!(found.beams.len(), 3);
                assert!(found.beams.iter().zip(&wanted.beams).all(|(a, b)| near(*a, *b)));
                assert!(near(found.half_angle, wanted.half_angle));
                assert_eq!(
                    (found.min_range_m, found.max_range_m, found.sure_range_m, found.period, found.settle),
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
            let file = config::read_ground("configs/g.toml", &text, &mut |path| bundled::load(path)).unwrap();
            assert_eq!(file.vehicles, sim.vehicle_ids().collect::<Vec<_>>());
            assert_eq!((&file.sweep, &file.imaging), (&sim.sweep, &sim.imaging));
            assert_eq!(file.separation_m, sim.safety.separation_m);
            assert_eq!((file.sensitivity_dbm, file.compare_with), (-95.0, Some(RunId(1))));
            let text = places(topology).operator();
            config::read_operator("configs/o.toml", &text, &mut |path| bundled::load(path)).unwrap();
        }
    }

    #[test]
    fn in_a_mesh_everyone_is_reached_without_the_ground_and_in_a_star_nobody_listens_but_the_ground() {
        let sim = sim();
        let bus = |topology, id: u8| {
            let text = places(topology).vehicle(&sim, VehicleId(id));
            config::read_vehicle("configs/v.toml", &text, &mut |path| bundled::load(path)).unwrap().bus
        };
        let mesh = bus(Topology::Mesh, 3);
        assert_eq!(mesh.listen.iter().map(|endpoint| endpoint.port).collect::<Vec<_>>(), [7603]);
        assert_eq!(mesh.connect.iter().map(|endpoint| endpoint.port).collect::<Vec<_>>(), [7600, 7601, 7602]);
        let star = bus(Topology::Star, 3);
        assert!(star.listen.is_empty());
        assert_eq!(star.connect.iter().map(|endpoint| endpoint.port).collect::<Vec<_>>(), [7600]);
    }
}
