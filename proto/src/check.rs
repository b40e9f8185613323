//! What makes a message impossible, beyond its bytes: values and lists out of bounds. No message that was read is handed
//! to anyone before [`Message::check`]; whether its sender may say it is not judged here.

use crate::{
    Beacon, Have, Hello, Message, Plan, PoseReport, Position, Progress, Report, Sample, Samples, State, Stop,
    VehicleId,
};

/// Layers of a digest at most; one a start of a vehicle's software.
const LAYERS_MAX: usize = 256;
/// Tiles of a want at most.
const KNOWN_MAX: usize = 4096;
/// Bytes of a software version at most.
const SOFTWARE_MAX: usize = 256;
/// Stops of a plan at most.
const STOPS_MAX: usize = 4096;
/// Corners of a route, or partners or stops waited for, or runs closed, at most.
const LIST_MAX: usize = 1024;
/// Troubles or capabilities named at most.
const WORDS_MAX: usize = 32;
/// Watermarks of a store at most.
const MARKS_MAX: usize = 4096;

impl Message {
    /// Names what makes a message impossible; `Ok` when it may be handed to an actor.
    ///
    /// # Errors
    /// The field that is wrong and what was expected of it.
    pub fn check(&self) -> Result<(), &'static str> {
        match self {
            Message::State(state) => state.check(),
            Message::Plan(plan) => plan.check(),
            Message::Tile(_) => Ok(()),
            Message::Samples(batch) => batch.check(),
            Message::Beacon(beacon) => beacon.check(),
            Message::Hello(hello) => hello.check(),
            Message::Digest(digest) if digest.layers.len() > LAYERS_MAX => {
                Err("a digest has at most 256 layers")
            }
            Message::Digest(_) => Ok(()),
            Message::Want(want) if want.known.len() > KNOWN_MAX => Err("a want has at most 4096 tiles"),
            Message::Want(_) => Ok(()),
            Message::Progress(progress) => progress.check(),
            Message::Order(order) => number(order.run.0).and(number(order.revision.0)),
            Message::Have(have) => have.check(),
            Message::Health(health) => ascending(&health.hears).and(words(&health.troubles)),
            Message::Report(report) => report.check(),
        }
    }
}

/// Checks a number that others count on from: the last one is never given.
fn number(number: u32) -> Result<(), &'static str> {
    if number == u32::MAX { Err("a run, revision or stop is under 4294967295") } else { Ok(()) }
}

/// Checks a list of words.
fn words(words: &[String]) -> Result<(), &'static str> {
    let sound = words.len() <= WORDS_MAX && words.iter().all(|word| word.len() <= SOFTWARE_MAX);
    if sound { Ok(()) } else { Err("at most 32 words of 256 bytes are said at once") }
}

/// Checks members: each named once, ascending.
fn ascending(members: &[VehicleId]) -> Result<(), &'static str> {
    let sorted = members.windows(2).all(|pair| pair[0] < pair[1]);
    if sorted { Ok(()) } else { Err("members are ascending, each named once") }
}

impl Position {
    fn check(&self) -> Result<(), &'static str> {
        let sane = |metres: f64| metres.abs() < 1e6;
        if sane(self.x_m) && sane(self.y_m) && sane(self.z_m) {
            Ok(())
        } else {
            Err("a position is finite and under 1000 km")
        }
    }
}

impl PoseReport {
    fn check(&self) -> Result<(), &'static str> {
        self.at.check()?;
        if !self.heading_rad.is_finite() {
            return Err("a heading is finite");
        }
        if (0.0..1e6).contains(&self.sd_m) { Ok(()) } else { Err("a pose deviation is from 0 to 1000 km") }
    }
}

impl State {
    fn check(&self) -> Result<(), &'static str> {
        self.pose.check()?;
        if !(0.0..1e3).contains(&self.speed_mps) {
            return Err("a speed is from 0 to 1000 m/s");
        }
        if !(0.0..=1.0).contains(&self.battery) {
            return Err("a battery is from 0 to 1");
        }
        number(self.accepted.0.0).and(number(self.accepted.1.0))?;
        number(self.ordered.revision.0).and(number(self.ordered.run.0))?;
        check_route(self.leg.as_ref().map_or(&[], |leg| &leg.route))
    }
}

impl Plan {
    fn check(&self) -> Result<(), &'static str> {
        self.start.check()?;
        if !self.members.contains(&self.vehicle) {
            return Err("a plan's vehicle is one of its members");
        }
        ascending(&self.members)?;
        number(self.run.0).and(number(self.revision.0))?;
        if self.stops.len() > STOPS_MAX {
            return Err("a plan has at most 4096 stops");
        }
        self.stops.iter().try_for_each(Stop::check)
    }
}

impl Stop {
    fn check(&self) -> Result<(), &'static str> {
        if self.partners.len() > LIST_MAX || self.after.len() > LIST_MAX {
            return Err("a stop has at most 1024 partners and 1024 stops to wait for");
        }
        number(self.id.0)?;
        self.after.iter().try_for_each(|(_, stop)| number(stop.0))?;
        self.at.check()?;
        check_route(&self.route)
    }
}

fn check_route(route: &[Position]) -> Result<(), &'static str> {
    if route.len() > LIST_MAX {
        return Err("a route has at most 1024 corners");
    }
    route.iter().try_for_each(Position::check)
}

impl Progress {
    fn check(&self) -> Result<(), &'static str> {
        number(self.run.0).and(number(self.revision.0))?;
        self.done.iter().chain(&self.leg).try_for_each(|stop| number(stop.0))
    }
}

impl Beacon {
    fn check(&self) -> Result<(), &'static str> {
        self.pose.check()?;
        self.progress.check()?;
        if self.progress.vehicle != self.sender {
            return Err("a beacon's progress is its sender's");
        }
        ascending(&self.members)
    }
}

impl Hello {
    fn check(&self) -> Result<(), &'static str> {
        if self.software.len() > SOFTWARE_MAX {
            return Err("a version has at most 256 bytes");
        }
        words(&self.capabilities)
    }
}

impl Have {
    fn check(&self) -> Result<(), &'static str> {
        if self.watermarks.len() > MARKS_MAX || self.closed.len() > LIST_MAX {
            return Err("a store speaks of at most 4096 watermarks and 1024 closed runs");
        }
        self.closed.iter().try_for_each(|run| number(run.0))?;
        self.watermarks.iter().try_for_each(|mark| number(mark.run.0))
    }
}

impl Report {
    fn check(&self) -> Result<(), &'static str> {
        number(self.run.0)?;
        ascending(&self.members).and(ascending(&self.lost))?;
        words(&self.troubles)
    }
}

impl Samples {
    fn check(&self) -> Result<(), &'static str> {
        number(self.run.0)?;
        if !self.samples.windows(2).all(|pair| pair[0].sequence < pair[1].sequence) {
            return Err("samples are ascending by sequence");
        }
        self.samples.iter().try_for_each(Sample::check)
    }
}

impl Sample {
    fn check(&self) -> Result<(), &'static str> {
        self.transmitter_pose.check()?;
        self.receiver_pose.check()?;
        match self.rssi_dbm {
            Some(rssi) if !(-200..=100).contains(&rssi) => Err("an RSSI is from -200 to 100 dBm"),
            Some(_) | None => Ok(()),
        }
    }
}
