//! The file of a vehicle's node: which vehicle it is, what drives it, and how it joins the bus. Opens nothing of what
//! it names but the venue. Which drivers there are is in `drivers.rs` and `range_driver.rs`.

use core::net::SocketAddr;

use tomoswarm_proto::{TaskKind, VehicleId};

use super::Loader;
use super::bus_file::{BusFile, BusFileTable, Role};
use super::drivers::{AutopilotDriver, DriverKey, Drivers, RadioDriver};
use super::forms::{FileName, LoadedFile};
use super::keys::{Form, KeyEntry, Keyed, Keys, MaybeTable, Whole, read_table};
use super::mavlink_connection::AutopilotTable;
use super::pose_file::{PoseFile, PoseSource};
use super::radio::OwnRadio;
use super::range::SensorCoverage;
use super::range_driver::RangeDriver;
use super::range_table::RangeTable;
use super::section::Section;
use super::servo_driver::ServoTable;
use super::sim::{
    check_border, check_task, load, padding_at_fence_m, place_off_m, refuse_blind_speed,
    refuse_uncovered_radius, smallest_post,
};
use super::swarm::Swarm;
use super::task::MissionTable;
use super::vehicle::{
    BodySpec, Flight, OwnFlight, Safety, check_ceiling, contact_limits, sensing_limits,
};
use super::venue::Venue;
use super::world_endpoint::WorldEndpoint;
use super::xbee_port::{XbeePort, XbeeTable};
use crate::geom::Point;
use crate::plan::{ContactLimits, SmallestPost};

/// The numbers that vehicles may have.
pub(super) const VEHICLE_IDS: std::ops::RangeInclusive<usize> = 1..=250;

/// What stands in the place of that secret for others; shorter than one can be, so that it is none.
const NOT_SAID: &str = "hidden";

/// What a vehicle's node is told.
#[derive(Clone, PartialEq, Debug)]
pub struct VehicleFile {
    /// The file of the place, with its folder.
    pub venue_file: String,
    /// The place.
    pub venue: Venue,
    /// Which vehicle this is.
    pub id: VehicleId,
    /// Where it starts and returns to: the venue's home of its number.
    pub home: Point,
    /// The folder in which its boot count, outbox and recordings are kept.
    pub state_dir: String,
    /// What it is out for, as it is written.
    pub mission: MissionTable,
    /// What it is out for; `None` = it follows the plans of the ground station.
    pub task: Option<TaskKind>,
    /// What speaks with its devices.
    pub drivers: Drivers,
    /// Its body.
    pub body: BodySpec,
    /// What it is, how high it flies, and in what wind.
    pub flight: Flight,
    /// Its range sensor.
    pub look: SensorCoverage,
    /// Its radio.
    pub radio: OwnRadio,
    /// How well its place is known.
    pub pose: PoseFile,
    /// The simulated world that its drivers speak with.
    pub world: WorldEndpoint,
    /// The margins that it keeps.
    pub safety: Safety,
    /// How it joins the bus.
    pub bus: BusFile,
    /// Its flight recording.
    pub record: Record,
}

/// The flight recording of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Record {
    /// The most that all recordings together take, megabytes (10⁶ bytes); 0 = nothing is recorded.
    pub limit_mb: usize,
}

impl Record {
    /// Returns the most that all recordings together take, bytes; `None` when nothing is recorded.
    pub fn limit_bytes(self) -> Option<u64> {
        (self.limit_mb > 0).then_some(self.limit_mb as u64 * 1_000_000)
    }
}

impl Keyed for Record {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Record { limit_mb } = self;
        let means = "the most that the recordings take together; 0: nothing is recorded";
        to.whole(
            limit_mb,
            Whole {
                name: "limit_mb",
                default: 10_000,
                allowed: 0..=1_000_000,
                means,
            },
        );
    }
}

/// The table `[vehicle]`.
struct VehicleTable<'a> {
    body: &'a mut BodySpec,
    flight: &'a mut Flight,
}

impl Keyed for VehicleTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        OwnFlight(self.flight).keys(to);
        self.body.keys(to);
    }
}

/// The table `[radio]` of a vehicle.
struct RadioTable<'a> {
    driver: &'a mut RadioDriver,
    own: &'a mut OwnRadio,
}

impl Keyed for RadioTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        DriverKey(&mut *self.driver).show(to);
        let means =
            "what the driver `xbee` is told; checked and not used while another one is chosen";
        to.maybe_table(
            &mut XbeeTable {
                driver: self.driver,
                unused: XbeePort::default(),
            },
            KeyEntry {
                name: "xbee",
                left_out: "",
                means,
            },
        );
        self.own.keys(to);
        Swarm::moved_air(to);
    }
}

/// The table `[safety]` of a vehicle.
struct SafetyTable<'a>(&'a mut Safety);

impl Keyed for SafetyTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        self.0.keys(to);
        Swarm::moved_margins(to);
    }
}

impl VehicleFile {
    /// Returns it as others may read it: without what lets a driver into the simulated world.
    #[must_use]
    pub fn without_secrets(&self) -> VehicleFile {
        let mut shown = self.clone();
        shown.world.token = NOT_SAID.to_owned();
        shown
    }

    /// Returns a file of nothing, to be filled.
    pub(super) fn blank() -> VehicleFile {
        VehicleFile {
            venue_file: String::new(),
            venue: Venue::blank(),
            id: VehicleId(0),
            home: Point::default(),
            state_dir: String::new(),
            mission: MissionTable::default(),
            task: None,
            drivers: Drivers::default(),
            body: BodySpec::default(),
            flight: Flight::default(),
            look: SensorCoverage::default(),
            radio: OwnRadio::default(),
            pose: PoseFile::default(),
            world: WorldEndpoint {
                connect: NOWHERE,
                token: String::new(),
            },
            safety: Safety::default(),
            bus: BusFile::default(),
            record: Record::default(),
        }
    }

    /// Returns what decides which posts the vehicle does not touch.
    pub fn contact_limits(&self) -> ContactLimits {
        let pose_sd_m = self.pose.expected_sd_m;
        contact_limits(&self.body, &self.look, self.venue.cell_m, pose_sd_m)
    }

    /// Returns the thinnest post that the vehicle does not touch; `None` when its sensor does not promise it of any.
    pub fn smallest_post(&self) -> Option<SmallestPost> {
        if self.drivers.range == RangeDriver::None {
            return None;
        }
        let named_m = self.look.smallest_radius_m;
        smallest_post(self.contact_limits(), named_m, self.body.max_speed_mps)
    }

    pub(super) fn read(root: &Section<'_>, loader: &mut Loader) -> Option<VehicleFile> {
        let mut file = VehicleFile::blank();
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let is_loaded = venue.is_some();
        if let Some((name, venue)) = venue {
            (file.venue_file, file.venue) = (name, venue);
        }
        read_table(&mut file, root);
        file.task = file
            .mission
            .task(root.source, is_loaded.then_some(&file.venue), loader);
        check_world(root, &file.drivers);
        file.drivers.complete_own_range();
        file.drivers.servo.complete(root.source, &mut file.look);
        let is_sound = root
            .source
            .is_sound(&["vehicle", "safety.padding_m", "range"]);
        if file.drivers.range != RangeDriver::None && is_sound {
            let padding_m = file.safety.padding_m;
            file.look.bound_silence(root.source, &file.body, padding_m);
        }
        file.look.check(root.source);
        file.drivers.check(root.source, &file.look);
        file.safety.check(root.source);
        file.bus.check(root.source, Role::Vehicle);
        let is_whole = is_loaded && file.id.0 > 0 && !file.state_dir.is_empty();
        if !is_whole {
            return None;
        }
        file.home = check_home(
            root,
            &file.venue,
            file.id,
            file.body.radius_m
                + padding_at_fence_m(file.safety.padding_m, file.pose.expected_sd_m)
                + file.flight.carried_m(),
        )?;
        let (flown, ceiling_m) = ((&file.flight, &file.body), file.venue.ceiling_m);
        check_ceiling(root, "vehicle.altitude_m", flown, ceiling_m);
        check_together(root, &file);
        Some(file)
    }
}

impl Keyed for VehicleFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let VehicleFile {
            venue_file,
            venue: _,
            id,
            home: _,
            state_dir,
            mission,
            task: _,
            drivers,
            body,
            flight,
            look,
            radio,
            pose,
            world,
            safety,
            bus,
            record,
        } = self;
        let Drivers {
            autopilot,
            servo,
            range,
            own_range,
            radio: radio_driver,
        } = drivers;
        let table = |name, means| KeyEntry {
            name,
            left_out: "",
            means,
        };
        let means = "file of the place, the same on every node";
        to.form(
            &mut LoadedFile(venue_file),
            KeyEntry {
                name: "venue",
                left_out: "needed",
                means,
            },
        );
        let means = "1 to 250; vehicle N has the N-th home";
        to.form(
            &mut Number1To250(id),
            KeyEntry {
                name: "id",
                left_out: "needed",
                means,
            },
        );
        state_dir_key(state_dir, to);
        to.table(
            mission,
            table(
                "mission",
                "as in a simulation; a vehicle alone visits all places of `pathfind`",
            ),
        );
        let mut vehicle = VehicleTable { body, flight };
        to.table(
            &mut vehicle,
            table("vehicle", "what it is, its body and how it moves"),
        );
        to.table(
            &mut AutopilotTable(autopilot),
            table("autopilot", "what drives it"),
        );
        to.table(
            &mut ServoTable(servo),
            table(
                "servo",
                "what turns its range sensors; `none`: they are fixed",
            ),
        );
        let mut sensor = RangeTable {
            driver: range,
            own: own_range,
            servo,
            look,
        };
        let means = "its range sensors; `none`: it sees nothing, and is not driven";
        to.table(&mut sensor, table("range", means));
        let mut device = RadioTable {
            driver: radio_driver,
            own: radio,
        };
        to.table(&mut device, table("radio", "its radio"));
        to.table(pose, table("pose", "how well its place is known"));
        let means = "the simulated world that its drivers speak with; needed by simulated drivers";
        let is_needed = drivers.has_simulated();
        to.maybe_table(&mut WorldTable { world, is_needed }, table("world", means));
        to.table(
            &mut SafetyTable(safety),
            table("safety", "the margins that it keeps"),
        );
        let mut joined = BusFileTable {
            bus,
            role: Role::Vehicle,
        };
        to.table(&mut joined, table("bus", "how it joins the bus"));
        to.table(record, table("record", "its flight recording"));
    }
}

/// Shows the folder in which a node keeps what outlives it.
pub(super) fn state_dir_key(state_dir: &mut String, to: &mut dyn Keys) {
    let needed = "the name of a folder is needed, relative to this file; no two nodes may share it";
    let mut folder = Some(std::mem::take(state_dir));
    let means = "folder for what outlives the node, such as its boot count and its recordings; one for each node";
    let mut name = FileName {
        name: &mut folder,
        needed: Some(needed),
    };
    to.form(
        &mut name,
        KeyEntry {
            name: "state_dir",
            left_out: "needed",
            means,
        },
    );
    *state_dir = folder.unwrap_or_default();
}

/// The number of a vehicle.
struct Number1To250<'a>(&'a mut VehicleId);

impl Form for Number1To250<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(self.0.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        section.require(key, "a whole number from 1 to 250 is needed");
        let is_given = section.has(key);
        let id = section.whole(key, 0, VEHICLE_IDS);
        *self.0 = VehicleId(u8::try_from(id).ok().filter(|_| is_given).unwrap_or(0));
    }
}

/// An address of nobody.
const NOWHERE: SocketAddr = SocketAddr::V4(core::net::SocketAddrV4::new(
    core::net::Ipv4Addr::LOCALHOST,
    0,
));

/// The simulated world, which must be named when a driver is simulated.
struct WorldTable<'a> {
    world: &'a mut WorldEndpoint,
    is_needed: bool,
}

impl MaybeTable for WorldTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        self.is_needed.then_some(self.world as &mut dyn Keyed)
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        self.world
    }
}

/// Checks that the simulated world is named when a driver is simulated; one that nothing needs is left alone.
fn check_world(root: &Section<'_>, drivers: &Drivers) {
    // A driver that was refused may have been meant to be a real one; its own problem is said already.
    if drivers.has_simulated()
        && root
            .source
            .is_sound(&["autopilot", "range", "servo", "radio"])
    {
        let rule =
            "a table [world] with connect and token is needed by drivers of the kind \"sim\"";
        root.require("world", rule);
    }
}

/// Returns the home of a vehicle, where its body and the room around it must fit, as they must around the area.
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
        root.refuse(
            "venue",
            &wrong,
            "a vehicle, its padding and three deviations of its place must fit at home",
        );
    }
    Some(*home)
}

fn check_together(root: &Section<'_>, file: &VehicleFile) {
    let VehicleFile {
        body,
        safety,
        pose,
        venue,
        ..
    } = file;
    let swarm = &venue.swarm;
    let body_m = body.radius_m + file.flight.carried_m() + place_off_m(pose.expected_sd_m);
    check_task(root, file.task.as_ref(), venue, body_m);
    if let RadioDriver::Xbee(xbee) = &file.drivers.radio {
        XbeePort::check_power(root.source, file.radio.power_dbm);
        xbee.check_slot(root.source, swarm, &file.venue_file);
    }
    let is_sound = |keys: &[&str]| root.source.is_sound(keys);
    if is_sound(&["vehicle.radius_m"]) && swarm.separation_m <= 2.0 * body.radius_m {
        let separation_m = swarm.separation_m;
        let wrong = format!(
            "lets two vehicles touch: the separation_m of the venue is {separation_m} m, middle to middle"
        );
        root.source.refuse(
            "vehicle.radius_m",
            &wrong,
            "less than half of separation_m is allowed",
        );
    }
    if is_sound(&["pose.expected_sd_m"]) && pose.expected_sd_m > swarm.pose_sd_max_m {
        let wrong = "is above the pose_sd_max_m of the venue: nothing would ever be measured";
        root.source.refuse(
            "pose.expected_sd_m",
            wrong,
            "at most pose_sd_max_m is allowed",
        );
    }
    let is_simulated = matches!(file.drivers.autopilot, AutopilotDriver::Simulated);
    if is_simulated && pose.source == PoseSource::External {
        root.source.refuse(
            "pose.source",
            "is of no use to a simulated autopilot, which knows its place",
            "source = \"autopilot\" is allowed, or [autopilot] driver = \"mavlink\"",
        );
    }
    if is_sound(&["vehicle", "range", "safety", "pose"]) {
        let still = sensing_limits(body, &file.look, safety, venue.cell_m, pose.expected_sd_m);
        let sight = still.carried(file.flight.carried_m());
        refuse_blind_speed(root, &sight, body.max_speed_mps, "vehicle.max_speed_mps");
        let named_m = file.look.smallest_radius_m;
        let limits = file.contact_limits();
        refuse_uncovered_radius(root, Some(limits), named_m, body.max_speed_mps);
    }
}
