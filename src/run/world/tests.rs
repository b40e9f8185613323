//! The live world in virtual time and over real sockets, in one small place: vehicle 1 faces a wall 1.5 m ahead, vehicle
//! 2 has free space ahead; nothing is uncertain.

mod sockets;
mod virtual_time;

use tomoswarm_proto::{Beacon, Boot, Message, VehicleId, codec};

use crate::autopilot::{Command, NumberedCommand};
use crate::config;
use crate::geom::Point;
use crate::run::link::ToWorld;
use crate::sim::Scenario;

const ONE: VehicleId = VehicleId(1);
const TWO: VehicleId = VehicleId(2);
/// From vehicle 1 to the wall, metres; the sensor's noise is 1 cm.
const WALL_M: f64 = 1.5;
/// From vehicle 1, to its left, to the person that enters, metres.
const PERSON_M: f64 = 1.7;
/// Free space from vehicle 1 to vehicle 2: −40 − 20 log10(9.55 m) = −59.6 dBm.
const HEARD_DBM: std::ops::RangeInclusive<i16> = -61..=-58;

const SIM: &str =
    "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\nempty_sweep = true\n
[vehicles]\nmax_speed_mps = 1.0\nacceleration_mps2 = 5.0\nbraking_mps2 = 5.0\npose_sd_m = 0.0
[range]\nbeams_deg = [0.0]\nincidence_limit_deg = 75.0\n[radio]\nrician_k = 1e6\npacket_sd_db = 0.0\n[sweep]\npositions = 40\n";
const VENUE: &str =
    "kind = \"venue\"\narea_m = [0.0, 0.0, 10.0, 10.0]\nhomes_m = [[-1.5, 5.0], [5.0, -2.0]]
fence_m = [[-4.0, -4.0], [14.0, -4.0], [14.0, 14.0], [-4.0, 14.0]]
[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n";
const SCENE: &str = "kind = \"scene\"
[[object]]\nname = \"wall\"\noutline_m = [[0.0, 4.5], [1.0, 4.5], [1.0, 5.5], [0.0, 5.5]]
[[person]]\nname = \"somebody\"\nat_m = [-1.5, 7.0]\n";

fn scenario() -> Scenario {
    let mut loader = |name: &str| match name {
        "venue.toml" => Ok(VENUE.to_owned()),
        "scene.toml" => Ok(SCENE.to_owned()),
        other => Err(format!("no file {other}")),
    };
    let sim = config::read_sim("test.toml", SIM, None, &mut loader)
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    Scenario::new(sim, Vec::new(), 1).unwrap()
}

fn drive(x_m: f64, y_m: f64) -> ToWorld {
    route(vec![Point::new(x_m, y_m)])
}

fn route(corners: Vec<Point>) -> ToWorld {
    command(Command::Route {
        corners,
        altitude_m: None,
        speed_mps: Some(1.0),
    })
}

/// A command to the autopilot, by the number 9.
fn command(command: Command) -> ToWorld {
    ToWorld::Autopilot(NumberedCommand { number: 9, command })
}

fn beacon(sender: VehicleId, sequence: u32) -> ToWorld {
    let beacon = Beacon {
        sender,
        boot: Boot(1),
        sequence,
        pose: Some(Default::default()),
        channel: 15,
        power_dbm: 0,
        members: Vec::new(),
        ..Beacon::default()
    };
    ToWorld::Transmit(codec::encode(&Message::Beacon(beacon)).unwrap())
}
