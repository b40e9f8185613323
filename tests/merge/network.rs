//! A network in memory: map actors and a station that hear each other as the weather lets them.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm::actor::Actor;
use tomoswarm::config::ImageTimes;
use tomoswarm::geom::{Angle, Cell, Lattice, Point, Pose, Rect};
use tomoswarm::ground::station::{self, Station, StationSettings};
use tomoswarm::map::{Layer, Merged};
use tomoswarm::node::map::{self, Map};
use tomoswarm::node::sensor::Scan;
use tomoswarm::node::{BodySettings, LookSettings, RadioSettings, VehicleSettings};
use tomoswarm::time::Time;
use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Boot, LayerId, Lease, Message, VehicleId};

/// How the network behaves.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    pub seed: u64,
    /// Share of deliveries that are lost, 0 to 1.
    pub loss: f64,
    /// Share of deliveries that come twice.
    pub doubles: f64,
    /// A delivery takes 1 ms to this long: later ones overtake earlier ones.
    pub delay_ms: u64,
}

impl Weather {
    /// Nothing is lost, and all arrives within 15 ms.
    pub fn calm(seed: u64) -> Weather {
        Weather {
            seed,
            loss: 0.0,
            doubles: 0.0,
            delay_ms: 15,
        }
    }
}

/// What happens to a node. Numbers of nodes that are not there mean one that is.
#[derive(Clone, Debug)]
pub enum Act {
    /// It looks around at a place.
    Scan { node: usize, place: u32 },
    /// Its software starts anew, with the next boot and an empty map.
    Restart { node: usize },
    /// It falls silent for ever, unless it is the last one.
    Stop { node: usize },
    /// From now on only nodes with the same bit hear each other; the station is with bit 0.
    Cut { sides: u8 },
    /// A further vehicle begins.
    Join,
}

/// What is never sent, on purpose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Fault {
    Wants,
    Digests,
    Tiles,
}

/// The station hears as this node.
const STATION: usize = usize::MAX;

struct Vehicle {
    boot: u32,
    map: Option<Map>,
    /// Started at this moment: its own clock begins there.
    since: Time,
}

pub struct Network {
    now: Time,
    weather: Weather,
    vehicles: Vec<Vehicle>,
    station: Option<Station>,
    /// On the way, by when and in which order they arrive.
    queue: BTreeMap<(Time, u64), (usize, Vec<u8>)>,
    count: u64,
    sides: u8,
    fault: Option<Fault>,
    sent: Vec<Message>,
}

impl Network {
    pub fn new(vehicles: usize, weather: Weather) -> Network {
        let settings = StationSettings {
            vehicles: (1..=vehicles as u8).map(VehicleId).collect(),
            lease: Some(Lease {
                number: 1,
                holder: 1,
            }),
            holder: 1,
            take_over: false,
            boot: Boot(1),
            compare_with: None,
            lost_after: Duration::from_secs(30),
            autonomy: Duration::from_secs(60),
            fence_m: 96.0,
            store: 1,
            lattice: Lattice::new(0.2),
            image_times: ImageTimes::Lap,
            bin_m: 0.2,
            spot_m: 0.5,
        };
        let mut network = Network {
            now: Time::ZERO,
            weather,
            vehicles: Vec::new(),
            station: Some(Station::new(settings)),
            queue: BTreeMap::new(),
            count: 0,
            sides: 0,
            fault: None,
            sent: Vec::new(),
        };
        (0..vehicles).for_each(|_| network.join());
        network
    }

    /// Lets acts happen at their times from now on, seconds, and goes on until `until_s` from now.
    pub fn play(&mut self, script: &[(f64, Act)], until_s: f64) {
        let begin = self.now;
        let mut script = script.to_vec();
        script.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (at_s, act) in &script {
            self.run(begin + Duration::from_secs_f64(*at_s));
            self.act(act);
        }
        self.run(begin + Duration::from_secs_f64(until_s));
    }

    pub fn act(&mut self, act: &Act) {
        let living: Vec<usize> = (0..self.vehicles.len())
            .filter(|at| self.vehicles[*at].map.is_some())
            .collect();
        let pick = |node: usize| living[node % living.len()];
        match act {
            Act::Scan { node, place } => self.scan(pick(*node), *place),
            Act::Restart { node } => {
                let (node, now) = (pick(*node), self.now);
                let boot = self.vehicles[node].boot + 1;
                let map = Some(Map::new(settings(node as u8 + 1, boot)));
                self.vehicles[node] = Vehicle {
                    boot,
                    map,
                    since: now,
                };
            }
            Act::Stop { node } => {
                if living.len() > 1 {
                    self.vehicles[pick(*node)].map = None;
                }
            }
            Act::Cut { sides } => self.sides = *sides,
            Act::Join => self.join(),
        }
    }

    pub fn stop_station(&mut self) {
        self.station = None;
    }

    fn join(&mut self) {
        let map = Some(Map::new(settings(self.vehicles.len() as u8 + 1, 1)));
        self.vehicles.push(Vehicle {
            boot: 1,
            map,
            since: self.now,
        });
    }

    /// Ends all trouble; what is on its way still arrives.
    pub fn calm(&mut self) {
        self.weather = Weather::calm(self.weather.seed);
        self.sides = 0;
    }

    pub fn plant(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    /// A node looks around at one of the places of a grid: three walls and open space.
    fn scan(&mut self, node: usize, place: u32) {
        let at = Point::new(f64::from(place % 7) * 6.4, f64::from(place / 7) * 6.4);
        let pose = Pose {
            at,
            heading: Angle::default(),
            sd_m: 0.05,
        };
        for (degrees, range_m) in [
            (0.0, Some(2.0)),
            (90.0, Some(2.5)),
            (180.0, None),
            (270.0, Some(1.5)),
        ] {
            let scan = Scan {
                pose,
                beam: Angle::from_degrees(degrees),
                range_m,
                suspect: false,
            };
            for _ in 0..3 {
                self.tell_map(node, map::In::Scan(scan.clone()));
            }
        }
    }

    pub fn run_for(&mut self, seconds_s: f64) {
        self.run(self.now + Duration::from_secs_f64(seconds_s));
    }

    /// Runs until all maps are equal; returns the seconds it took, `None` when they never are.
    pub fn run_until_equal(&mut self, at_most_s: f64) -> Option<f64> {
        let begin = self.now;
        loop {
            let passed_s = self.now.since(begin).as_secs_f64();
            if self.difference().is_none() {
                return Some(passed_s);
            }
            if passed_s > at_most_s {
                return None;
            }
            self.run_for(0.05);
        }
    }

    fn run(&mut self, until: Time) {
        loop {
            let arrival = self.queue.first_key_value().map(|((at, _), _)| *at);
            let wake = self.next_wake();
            let next = arrival.into_iter().chain(wake.map(|(at, _)| at)).min();
            let Some(next) = next.filter(|next| *next <= until) else {
                break;
            };
            self.now = next;
            match wake.filter(|(at, _)| *at == next) {
                Some((_, node)) => self.wake(node),
                None => {
                    let Some((_, (to, frame))) = self.queue.pop_first() else {
                        break;
                    };
                    self.deliver(to, &frame);
                }
            }
        }
        self.now = until;
    }

    fn next_wake(&self) -> Option<(Time, usize)> {
        let of_vehicle = |(node, vehicle): (usize, &Vehicle)| {
            let deadline = vehicle.map.as_ref()?.deadline()?;
            Some((vehicle.since + deadline.at.since(Time::ZERO), node))
        };
        let vehicles = self.vehicles.iter().enumerate().filter_map(of_vehicle);
        let station = self
            .station
            .as_ref()
            .and_then(|station| Some((station.deadline()?.at, STATION)));
        vehicles.chain(station).min()
    }

    fn wake(&mut self, node: usize) {
        if node == STATION {
            let mut out = Vec::new();
            let Some(station) = &mut self.station else {
                return;
            };
            station.wake(self.now, &mut out).unwrap();
            self.station_says(out);
            return;
        }
        let mut out = Vec::new();
        let vehicle = &mut self.vehicles[node];
        let own = Time::ZERO + self.now.since(vehicle.since);
        let Some(map) = &mut vehicle.map else { return };
        map.wake(own, &mut out).unwrap();
        assert!(map.deadline().unwrap().at > own);
        self.map_says(node, out);
    }

    fn deliver(&mut self, to: usize, frame: &[u8]) {
        let Decoded::Message(message) = codec::decode(frame).unwrap() else {
            panic!("an unknown kind")
        };
        if to == STATION {
            let mut out = Vec::new();
            let Some(station) = &mut self.station else {
                return;
            };
            station
                .handle(self.now, station::In::Bus(message), &mut out)
                .unwrap();
            self.station_says(out);
            return;
        }
        match message {
            Message::Tile(report) => self.tell_map(to, map::In::Tile(report)),
            Message::Digest(digest) => self.tell_map(to, map::In::Digest(digest)),
            Message::Want(want) => self.tell_map(to, map::In::Want(want)),
            _ => {}
        }
    }

    fn tell_map(&mut self, node: usize, input: map::In) {
        let mut out = Vec::new();
        let vehicle = &mut self.vehicles[node];
        let own = Time::ZERO + self.now.since(vehicle.since);
        let Some(map) = &mut vehicle.map else { return };
        map.handle(own, input, &mut out).unwrap();
        self.map_says(node, out);
    }

    fn map_says(&mut self, node: usize, out: Vec<map::Out>) {
        for output in out {
            if let map::Out::Publish(message) = output {
                self.publish(node, message);
            }
        }
    }

    fn station_says(&mut self, out: Vec<station::Out>) {
        for output in out {
            if let station::Out::Publish(
                message @ (Message::Tile(_) | Message::Digest(_) | Message::Want(_)),
            ) = output
            {
                self.publish(STATION, message);
            }
        }
    }

    fn publish(&mut self, from: usize, message: Message) {
        let muted = matches!(
            (self.fault, &message),
            (Some(Fault::Wants), Message::Want(_))
                | (Some(Fault::Digests), Message::Digest(_))
                | (Some(Fault::Tiles), Message::Tile(_))
        );
        if muted {
            return;
        }
        let frame = codec::encode(&message).unwrap();
        let receivers = (0..self.vehicles.len())
            .chain([STATION])
            .filter(|to| *to != from);
        for to in receivers.collect::<Vec<_>>() {
            let copies = 1 + u64::from(self.luck() < self.weather.doubles);
            let lost = self.luck() < self.weather.loss || self.side(from) != self.side(to);
            for _ in 0..if lost { 0 } else { copies } {
                let delay_ms = 1.0 + self.luck() * self.weather.delay_ms.saturating_sub(1) as f64;
                self.count += 1;
                let arrives = self.now + Duration::from_secs_f64(delay_ms / 1e3);
                self.queue
                    .insert((arrives, self.count), (to, frame.clone()));
            }
        }
        self.sent.push(message);
    }

    fn side(&self, node: usize) -> bool {
        let bit = if node == STATION { 0 } else { node % 8 };
        self.sides >> bit & 1 == 1
    }

    /// The next number from 0 to 1 (SplitMix64).
    fn luck(&mut self) -> f64 {
        self.weather.seed = self.weather.seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.weather.seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn maps(&self) -> Vec<&Merged> {
        let vehicles = self
            .vehicles
            .iter()
            .filter_map(|vehicle| vehicle.map.as_ref().map(Map::merged));
        vehicles
            .chain(self.station.iter().map(Station::map))
            .collect()
    }

    /// Names what differs between the maps; `None` when they are equal: digests, tiles and merged cells.
    pub fn difference(&self) -> Option<String> {
        let maps = self.maps();
        let first = maps[0];
        let tiles = |map: &Merged| {
            map.layers()
                .map(|(id, layer)| (id, layer.clone()))
                .collect::<BTreeMap<LayerId, Layer>>()
        };
        for (number, map) in maps.iter().enumerate().skip(1) {
            if map.digest() != first.digest() {
                return Some(format!("map {number} and the first have different digests"));
            }
        }
        let expected = tiles(first);
        for (number, map) in maps.iter().enumerate().skip(1) {
            if tiles(map) != expected {
                return Some(format!(
                    "map {number} and the first have equal digests but different tiles"
                ));
            }
            let extent = first.extent(0);
            if map.extent(0) != extent {
                return Some(format!("map {number} and the first have different extents"));
            }
            let Some(extent) = extent else { continue };
            let columns = || (extent.low.x..=extent.high.x).step_by(3);
            let mut cells = (extent.low.y..=extent.high.y)
                .step_by(5)
                .flat_map(|y| columns().map(move |x| Cell::new(x, y)));
            if let Some(cell) = cells.find(|cell| map.value(0, *cell) != first.value(0, *cell)) {
                return Some(format!("map {number} and the first differ at {cell:?}"));
            }
        }
        None
    }

    /// Returns the tiles of all layers that the first map holds.
    pub fn tiles_held(&self) -> usize {
        self.maps()[0]
            .layers()
            .map(|(_, layer)| layer.tiles().count())
            .sum()
    }

    /// Returns the layers of a vehicle that the station's map holds.
    pub fn layers_of(&self, node: usize) -> usize {
        let map = self.maps();
        map[map.len() - 1]
            .layers()
            .filter(|(id, _)| usize::from(id.vehicle.0) == node + 1)
            .count()
    }

    pub fn sent_tiles(&self) -> usize {
        self.sent(|message| matches!(message, Message::Tile(_)))
    }

    pub fn sent(&self, which: impl Fn(&Message) -> bool) -> usize {
        self.sent.iter().filter(|message| which(message)).count()
    }
}

fn settings(vehicle: u8, boot: u32) -> VehicleSettings {
    VehicleSettings {
        vehicle: VehicleId(vehicle),
        boot: Boot(boot),
        memory: Default::default(),
        stops: Default::default(),
        listens_for: std::time::Duration::ZERO,
        fence: Rect::new(Point::new(-50.0, -50.0), Point::new(100.0, 100.0)).polygon(),
        fence_room_m: 1.0,
        expected_sd_m: 0.02,
        home: Point::new(0.0, 0.0),
        lattice: Lattice::new(0.2),
        slice: 0,
        body: BodySettings {
            radius_m: 0.25,
            speed_mps: 0.5,
            braking_mps2: 1.0,
        },
        look: LookSettings {
            is_blind: false,
            beams: vec![Angle::default()],
            half_angle: Angle::from_degrees(15.0),
            min_range_m: 0.1,
            max_range_m: 4.0,
            sure_range_m: 3.0,
            period: Duration::from_millis(100),
            settle: Duration::from_millis(50),
            mounts: tomoswarm::plan::Mounts::default(),
            smallest_post: None,
        },
        radio: RadioSettings {
            channel: 11,
            power_dbm: 0,
            slot: Duration::from_millis(50),
            successor: None,
        },
        carried_m: 0.0,
        safety: tomoswarm::config::Safety {
            padding_m: 0.15,
            ..Default::default()
        },
        swarm: tomoswarm::config::Swarm::default(),
        task: None,
        path_time: Duration::from_millis(20),
        autopilot: tomoswarm::autopilot::AutopilotLinkSettings::default(),
    }
}
