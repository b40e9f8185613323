//! The file of a vehicle's node: which vehicle it is, what drives it, and how it joins the bus. Opens nothing of what
//! it names but the venue; the drivers of real hardware are refused until they are built.

use core::net::SocketAddr;

use tomoswarm_proto::VehicleId;

use super::bus_file::{BusFile, Role};
use super::radio::OwnRadio;
use super::section::Section;
use super::sim::{check_border, check_task, load, refuse_blind_speed};
use super::task::Task;
use super::vehicle::{Body, Look, Safety, sight};
use super::venue::Venue;
use super::{Loader, beside};
use crate::geom::Point;

/// The numbers that vehicles may have.
pub(super) const VEHICLE_IDS: std::ops::RangeInclusive<usize> = 1..=250;
/// The shortest secret between a simulated driver and its world, characters.
const SHORTEST_TOKEN: usize = 8;

/// What a vehicle's node is told.
#[derive(Clone, PartialEq, Debug)]
pub struct VehicleFile {
    /// The place.
    pub venue: Venue,
    /// Which vehicle this is.
    pub id: VehicleId,
    /// Where it starts and returns to: the venue's home of its number.
    pub home: Point,
    /// The folder in which its boot count, outbox and recordings are kept.
    pub state_dir: String,
    /// What it is out for.
    pub task: Task,
    /// Its body.
    pub body: Body,
    /// Its range sensor.
    pub look: Look,
    /// Its radio.
    pub radio: OwnRadio,
    /// The deviation that its place usually has, metres; its speed is judged by it.
    pub pose_sd_m: f64,
    /// The simulated world that its drivers speak with.
    pub world: World,
    /// The margins that it keeps.
    pub safety: Safety,
    /// How it joins the bus.
    pub bus: BusFile,
    /// Its flight recording.
    pub record: Record,
}

/// The door of the process that simulates the world.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct World {
    /// Where it listens; always on this machine.
    pub connect: SocketAddr,
    /// What a driver says to be let in.
    pub token: String,
}

/// The flight recording of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// The most that all recordings together take, megabytes (10⁶ bytes); 0 = nothing is recorded.
    pub limit_mb: usize,
}

impl Record {
    pub(super) fn read(section: &Section) -> Record {
        let record = Record { limit_mb: section.whole("limit_mb", 256, 0..=1_000_000) };
        section.finish();
        record
    }

    /// Gives the most that all recordings together take, bytes; `None` when nothing is recorded.
    pub fn limit_bytes(self) -> Option<u64> {
        (self.limit_mb > 0).then_some(self.limit_mb as u64 * 1_000_000)
    }
}

impl VehicleFile {
    pub(super) fn read(root: &Section, loader: &mut Loader) -> Option<VehicleFile> {
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let id = read_id(root);
        let state_dir = read_state_dir(root);
        let (task, _) = Task::read(&root.section("mission"), venue.as_ref(), loader);
        let body = read_body(&root.section("vehicle"));
        let mut is_simulated =
            [read_autopilot(&root.section("autopilot")), read_servo(&root.section("servo"))].contains(&true);
        let (look, simulates_range) = read_range(&root.section("range"));
        let (radio, simulates_radio) = read_radio(&root.section("radio"));
        is_simulated |= simulates_range | simulates_radio;
        let pose_sd_m = read_pose(&root.section("pose"));
        let world = read_world(root, is_simulated);
        let safety = Safety::read(&root.section("safety"));
        let bus = BusFile::read(&root.section("bus"), Role::Vehicle);
        let record = Record::read(&root.section("record"));
        root.finish();
        let (venue, id, state_dir) = (venue?, id?, state_dir?);
        let home = check_home(root, &venue, id, body.radius_m + safety.padding_m)?;
        let file = VehicleFile {
            venue,
            id,
            home,
            state_dir,
            task,
            body,
            look,
            radio,
            pose_sd_m,
            world: world?,
            safety,
            bus,
            record,
        };
        check_together(root, &file);
        Some(file)
    }
}

fn read_id(root: &Section) -> Option<VehicleId> {
    root.require("id", "a whole number from 1 to 250 is needed");
    let is_given = root.has("id");
    let id = root.whole("id", 0, VEHICLE_IDS);
    u8::try_from(id).ok().filter(|id| is_given && *id > 0).map(VehicleId)
}

/// Reads the folder in which a node keeps what outlives it.
pub(super) fn read_state_dir(root: &Section) -> Option<String> {
    root.require(
        "state_dir",
        "the name of a folder is needed, relative to this file; no two nodes may share it",
    );
    root.text("state_dir").map(|folder| beside(root.source.file(), &folder))
}

fn read_body(section: &Section) -> Body {
    let body = Body::read_keys(section);
    section.finish();
    body
}

fn read_autopilot(section: &Section) -> bool {
    let is_simulated = read_driver(section, &["mavlink"]);
    section.finish();
    is_simulated
}

fn read_servo(section: &Section) -> bool {
    let is_simulated = read_driver(section, &["gpio", "mavlink"]);
    section.finish();
    is_simulated
}

fn read_range(section: &Section) -> (Look, bool) {
    let is_simulated = read_driver(section, &["hcsr04"]);
    let look = Look::read_keys(section);
    section.finish();
    (look, is_simulated)
}

fn read_radio(section: &Section) -> (OwnRadio, bool) {
    let is_simulated = read_driver(section, &["xbee"]);
    let radio = OwnRadio::read_keys(section);
    section.finish();
    (radio, is_simulated)
}

/// Tells whether a driver is simulated, and refuses every other: `planned` are those that hardware will bring.
fn read_driver(section: &Section, planned: &[&str]) -> bool {
    let allowed = "driver = \"sim\" is allowed today";
    section.require("driver", allowed);
    let Some(name) = section.text("driver") else { return false };
    match name.as_str() {
        "sim" => return true,
        other if planned.contains(&other) => section.refuse("driver", "is not built yet", allowed),
        _ => section.refuse("driver", "is not known", allowed),
    }
    false
}

fn read_pose(section: &Section) -> f64 {
    let allowed = "source = \"autopilot\" is allowed today";
    match section.text("source").as_deref() {
        None | Some("autopilot") => {}
        Some("external") => section.refuse("source", "is not built yet", allowed),
        Some(_) => section.refuse("source", "is not known", allowed),
    }
    let expected_sd_m = section.number("expected_sd_m", 0.05, 0.0..=5.0);
    section.finish();
    expected_sd_m
}

/// Reads the door of the simulated world, which is needed exactly when a driver is simulated.
fn read_world(root: &Section, is_simulated: bool) -> Option<World> {
    if !is_simulated {
        // A driver that was refused may have been meant to be simulated; its own problem is said already.
        if root.has("world") && root.source.is_sound(&["autopilot", "range", "servo", "radio"]) {
            root.refuse("world", "is of no use", "it is for simulated drivers only");
        }
        return None;
    }
    root.require("world", "a table [world] with connect and token is needed by drivers of the kind \"sim\"");
    let section = root.optional_section("world")?;
    let world = (read_door(&section), read_token(&section));
    section.finish();
    Some(World { connect: world.0?, token: world.1? })
}

fn read_door(section: &Section) -> Option<SocketAddr> {
    let rule = "an address of this machine such as \"127.0.0.1:7500\" is needed";
    section.require("connect", rule);
    let text = section.text("connect")?;
    let address: Option<SocketAddr> = text.parse().ok();
    let wrong = match address {
        None => "is no address with a port",
        Some(address) if !address.ip().is_loopback() => "leaves this machine",
        Some(address) if address.port() == 0 => "has port 0",
        Some(address) => return Some(address),
    };
    section.refuse("connect", wrong, rule);
    None
}

fn read_token(section: &Section) -> Option<String> {
    let rule = "8 to 128 letters, digits, - and _ are needed, the same as the world was given";
    section.require("token", rule);
    let token = section.text("token")?;
    let is_plain = token.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
    if (SHORTEST_TOKEN..=128).contains(&token.len()) && is_plain {
        return Some(token);
    }
    section.refuse("token", "is no such word", rule);
    None
}

/// Gives the home of a vehicle, where its body and the room around it must fit, as they must around the area.
fn check_home(root: &Section, venue: &Venue, id: VehicleId, reach_m: f64) -> Option<Point> {
    let Some(home) = venue.homes.get(usize::from(id.0).checked_sub(1)?) else {
        let wrong = format!("has no home: the venue has {} of them", venue.homes.len());
        root.refuse("id", &wrong, "vehicle N starts at the N-th of homes_m");
        return None;
    };
    if !root.source.is_sound(&["vehicle", "safety"]) {
        return Some(*home);
    }
    check_border(root, venue, reach_m);
    if !venue.fence.contains_disc(*home, reach_m) {
        let wrong = format!("home {} is nearer than {reach_m:.2} m to the fence", id.0);
        root.refuse("venue", &wrong, "a vehicle and its padding must fit at home");
    }
    Some(*home)
}

fn check_together(root: &Section, file: &VehicleFile) {
    let VehicleFile { body, safety, .. } = file;
    check_task(root, &file.task, &file.venue);
    let is_sound = |keys: &[&str]| root.source.is_sound(keys);
    if is_sound(&["vehicle.radius_m", "safety.separation_m"]) && safety.separation_m <= 2.0 * body.radius_m {
        let wrong = "lets two vehicles touch: it is measured from middle to middle";
        root.source.refuse("safety.separation_m", wrong, "more than two vehicle.radius_m is allowed");
    }
    if is_sound(&["pose.expected_sd_m", "safety.pose_sd_max_m"]) && file.pose_sd_m > safety.pose_sd_max_m {
        let wrong = "is above safety.pose_sd_max_m: nothing would ever be measured";
        root.source.refuse("pose.expected_sd_m", wrong, "at most pose_sd_max_m is allowed");
    }
    if is_sound(&["vehicle", "range", "safety", "pose"]) {
        let sight = sight(body, &file.look, safety, file.venue.cell_m, file.pose_sd_m);
        refuse_blind_speed(root, &sight, body.max_speed_mps, "vehicle.max_speed_mps");
    }
}
