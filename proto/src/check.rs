//! What makes a message impossible, beyond its bytes: values and lists out of bounds. No message that was read is handed
//! to anyone before [`Message::check`]; whether its sender may say it is not judged here.

use crate::{
    AutopilotHealth, BEACON_MEMBERS_MAX, Beacon, EmergencyName, EmergencyStop, FIX_AGE_MAX_MS,
    Find, Fix, GroundReport, Have, Heading, Health, Hello, IMAGE_FINDS_MAX, IMAGE_PART_PIXELS,
    IMAGE_SIDE_MAX, Image, LOG_LINE_BYTES_MAX, LOG_LINES_MAX, LOOK_READINGS_MAX, LogLines, Look,
    LookReading, LostSamples, Mark, Message, MissionEnd, MissionKind, MissionProgress,
    NodeSettings, OpenStops, Order, OrderKind, Permille, Plan, PoseReport, Position, Progress,
    READING_AGE_MAX_MS, RunReport, SETTINGS_PART_BYTES_MAX, SETTINGS_PARTS_MAX, Sample, Samples,
    State, Stop, Task, Tilt, VehicleId, Velocity,
};

/// A coordinate is at most so far from the datum, millimetres.
pub(crate) const COORDINATE_MAX_MM: i32 = 1_000_000_000;
/// A component of a velocity is at most this, mm/s.
const VELOCITY_MAX_MMPS: i32 = 1_000_000;
/// Layers of a digest at most; one a start of a vehicle's software.
const LAYERS_MAX: usize = 256;
/// Tiles of a want at most.
const KNOWN_MAX: usize = 4096;
/// Bytes of a node's name, and of an autopilot's firmware, at most.
const NAME_MAX: usize = 32;
/// Bytes of a software version at most.
const SOFTWARE_MAX: usize = 64;
/// Capabilities of a node at most.
const CAPABILITIES_MAX: usize = 32;
/// Stops of a plan at most.
const STOPS_MAX: usize = 4096;
/// Corners of a route, or partners or stops waited for, or runs closed, at most.
const LIST_MAX: usize = 1024;
/// Samples of a message at most.
const SAMPLES_MAX: usize = 1024;
/// Ranges of lost samples at most.
pub const LOST_MAX: usize = 64;
/// Watermarks of a store at most.
const MARKS_MAX: usize = 4096;
/// Troubles named at most, and the bytes of each.
const TROUBLES_MAX: usize = 16;
const TROUBLE_BYTES_MAX: usize = 200;
/// Emergency stops named at most: open ones, lifted ones, and those that a start lifts.
const OPEN_MAX: usize = 9;
const LIFTED_MAX: usize = 64;
const ENDS_MAX: usize = 8;
/// Runs of a report at most.
const RUNS_MAX: usize = 16;

/// Why something is impossible, if it is.
pub(crate) type CheckResult = Result<(), &'static str>;

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
            Message::Digest(digest) => require(
                digest.layers.len() <= LAYERS_MAX,
                "a digest has at most 256 layers",
            ),
            Message::Want(want) => require(
                want.known.len() <= KNOWN_MAX,
                "a want has at most 4096 tiles",
            ),
            Message::Mission(mission) => mission.check(),
            Message::Order(order) => order.check(),
            Message::Have(have) => have.check(),
            Message::Health(health) => health.check(),
            Message::Report(report) => report.check(),
            Message::Standing(standing) => standing.check(),
            Message::Task(task) => task.check(),
            Message::Image(image) => image.check(),
            Message::Fix(fix) => fix.check(),
            Message::Mark(mark) => mark.check(),
            Message::Look(look) => look.check(),
            Message::Log(log) => log.check(),
            Message::Settings(settings) => settings.check(),
        }
    }
}

/// Returns a text as it is, or what fits into a number of bytes of it, cut between two letters; a cut one ends with "…".
#[must_use]
pub fn fitted(mut text: String, most_bytes: usize) -> String {
    const CUT: char = '…';
    if text.len() <= most_bytes {
        return text;
    }
    let most = most_bytes.saturating_sub(CUT.len_utf8());
    let ends = (0..=most).rev();
    let end = ends.into_iter().find(|end| text.is_char_boundary(*end));
    text.truncate(end.unwrap_or(0));
    if most_bytes >= CUT.len_utf8() {
        text.push(CUT);
    }
    text
}

/// Cuts what is wrong, in words, to what a message carries: the first 16, of 200 bytes each; a cut one shows that it is.
#[must_use]
pub fn fitted_troubles(troubles: Vec<String>) -> Vec<String> {
    let fit = |trouble| fitted(trouble, TROUBLE_BYTES_MAX);
    troubles.into_iter().take(TROUBLES_MAX).map(fit).collect()
}

pub(crate) fn require(holds: bool, expected: &'static str) -> CheckResult {
    if holds { Ok(()) } else { Err(expected) }
}

/// Checks a number that others count on from: the last one is never given.
fn number(number: u32) -> CheckResult {
    require(
        number < u32::MAX,
        "a run, revision or stop is under 4294967295",
    )
}

/// Checks what is wrong, in words.
fn troubles(troubles: &[String]) -> CheckResult {
    let is_short = |trouble: &String| trouble.len() <= TROUBLE_BYTES_MAX;
    require(
        troubles.len() <= TROUBLES_MAX && troubles.iter().all(is_short),
        "at most 16 troubles of 200 bytes are named",
    )
}

/// Checks members: each named once, ascending.
fn ascending(members: &[VehicleId]) -> CheckResult {
    require(
        members.is_sorted_by(|a, b| a < b),
        "members are ascending, each named once",
    )
}

fn share(share: Option<Permille>, expected: &'static str) -> CheckResult {
    require(share.is_none_or(|share| share <= Permille::WHOLE), expected)
}

fn route(route: &[Position]) -> CheckResult {
    require(route.len() <= LIST_MAX, "a route has at most 1024 corners")?;
    route.iter().try_for_each(Position::check)
}

fn names(names: &[EmergencyName], most: usize) -> CheckResult {
    let mut sorted = names.to_vec();
    sorted.sort_unstable();
    let is_once = sorted.is_sorted_by(|a, b| a < b);
    require(
        names.len() <= most && is_once,
        "a start ends at most 8 stops, 64 are remembered as lifted, each named once",
    )
}

impl Position {
    pub(crate) fn check(&self) -> CheckResult {
        let is_near =
            |coordinate_mm: i32| coordinate_mm.unsigned_abs() < COORDINATE_MAX_MM.unsigned_abs();
        require(
            [self.x_mm, self.y_mm, self.z_mm].into_iter().all(is_near),
            "a position is finite and under 1000 km",
        )
    }
}

impl PoseReport {
    fn check(&self) -> CheckResult {
        self.at.check()?;
        self.heading.check()
    }
}

impl Heading {
    fn check(&self) -> CheckResult {
        require(
            *self <= Heading::LAST,
            "a heading is from 0 to 62831 units of 1e-4 rad",
        )
    }
}

impl Fix {
    fn check(&self) -> CheckResult {
        self.at.check()?;
        self.heading.iter().try_for_each(Heading::check)?;
        require(
            self.age_ms <= FIX_AGE_MAX_MS,
            "a fix is at most two seconds old",
        )
    }
}

impl Look {
    fn check(&self) -> CheckResult {
        require(
            self.readings.len() <= LOOK_READINGS_MAX,
            "a look has at most 16 readings",
        )?;
        self.half_angle.check()?;
        self.readings.iter().try_for_each(LookReading::check)
    }
}

impl LogLines {
    fn check(&self) -> CheckResult {
        let lines = &self.lines;
        require(
            lines.len() <= LOG_LINES_MAX,
            "a log has at most 16 lines in a message",
        )?;
        require(
            lines.is_sorted_by(|a, b| a.number < b.number),
            "the lines of a log are ascending, each once",
        )?;
        require(
            lines
                .iter()
                .all(|line| line.text.len() <= LOG_LINE_BYTES_MAX),
            "a line of a log has at most 240 bytes",
        )
    }
}

impl NodeSettings {
    fn check(&self) -> CheckResult {
        require(
            self.part < self.parts && self.parts <= SETTINGS_PARTS_MAX,
            "settings have 1 to 16 parts",
        )?;
        require(
            self.text.len() <= SETTINGS_PART_BYTES_MAX,
            "a part of settings has at most 4096 bytes",
        )
    }
}

impl LookReading {
    fn check(&self) -> CheckResult {
        self.at.check()?;
        self.toward.check()?;
        require(
            self.age_ms <= READING_AGE_MAX_MS,
            "a reading is at most two seconds old",
        )
    }
}

impl Mark {
    fn check(&self) -> CheckResult {
        self.at.check()?;
        number(self.run.0)
    }
}

impl Velocity {
    fn check(&self) -> CheckResult {
        let is_slow = |mmps: i32| mmps.unsigned_abs() <= VELOCITY_MAX_MMPS.unsigned_abs();
        require(
            [self.x_mmps, self.y_mmps, self.z_mmps]
                .into_iter()
                .all(is_slow),
            "each component of a speed is at most 1000 m/s",
        )
    }
}

impl Tilt {
    fn check(&self) -> CheckResult {
        require(
            *self == Tilt::UNKNOWN || self.0.unsigned_abs() <= Tilt::LAST.0.unsigned_abs(),
            "a tilt is at most half a turn, or unknown",
        )
    }
}

impl State {
    fn check(&self) -> CheckResult {
        self.pose.iter().try_for_each(PoseReport::check)?;
        self.roll.check().and(self.pitch.check())?;
        self.velocity.check()?;
        share(self.battery, "a battery is from 0 to 1000 thousandths")?;
        number(self.accepted.0.0).and(number(self.accepted.1.0))?;
        number(self.ordered.revision.0).and(number(self.ordered.run.0))?;
        route(self.leg.as_ref().map_or(&[], |leg| &leg.route))
    }
}

impl Plan {
    fn check(&self) -> CheckResult {
        self.start.check()?;
        require(
            self.members.contains(&self.vehicle),
            "a plan's vehicle is one of its members",
        )?;
        ascending(&self.members)?;
        number(self.run.0).and(number(self.revision.0))?;
        require(
            self.stops.len() <= STOPS_MAX,
            "a plan has at most 4096 stops",
        )?;
        self.stops.iter().try_for_each(Stop::check)
    }
}

impl Stop {
    fn check(&self) -> CheckResult {
        require(
            self.partners.len() <= LIST_MAX && self.after.len() <= LIST_MAX,
            "a stop has at most 1024 partners and 1024 stops to wait for",
        )?;
        number(self.id.0)?;
        self.after.iter().try_for_each(|(_, stop)| number(stop.0))?;
        self.at.check()?;
        route(&self.route)
    }
}

impl Progress {
    fn check(&self) -> CheckResult {
        number(self.run.0).and(number(self.revision.0))?;
        self.done
            .iter()
            .chain(&self.leg)
            .try_for_each(|stop| number(stop.0))
    }
}

impl MissionProgress {
    fn check(&self) -> CheckResult {
        self.progress.check()?;
        share(self.share, "a share is from 0 to 1000 thousandths")?;
        self.goal.iter().try_for_each(Position::check)?;
        match self.end {
            Some(MissionEnd::NoWay(0) | MissionEnd::GaveUp(0)) => {
                Err("a mission that missed places missed at least one")
            }
            Some(
                MissionEnd::Done
                | MissionEnd::Stopped
                | MissionEnd::NoWay(_)
                | MissionEnd::GaveUp(_)
                | MissionEnd::Refused(_),
            )
            | None => Ok(()),
        }
    }
}

impl Beacon {
    fn check(&self) -> CheckResult {
        self.pose.iter().try_for_each(PoseReport::check)?;
        self.progress.check()?;
        require(
            self.members.len() <= BEACON_MEMBERS_MAX,
            "a beacon names at most 12 members",
        )?;
        ascending(&self.members)
    }
}

impl Hello {
    fn check(&self) -> CheckResult {
        require(self.name.len() <= NAME_MAX, "a name has at most 32 bytes")?;
        require(
            self.software.len() <= SOFTWARE_MAX,
            "a version has at most 64 bytes",
        )?;
        require(
            self.capabilities.len() <= CAPABILITIES_MAX && self.capabilities.is_sorted(),
            "at most 32 capabilities are named, ascending",
        )?;
        require(
            self.interest.is_sorted_by(|a, b| a < b),
            "interests are ascending, each named once",
        )
    }
}

impl Order {
    fn check(&self) -> CheckResult {
        number(self.run.0).and(number(self.revision.0))?;
        names(&self.ends, ENDS_MAX)?;
        require(
            self.ends.is_sorted(),
            "the stops that a start ends are ascending",
        )?;
        require(
            self.ends.is_empty() || self.kind == OrderKind::Start,
            "only a start ends emergency stops",
        )
    }
}

impl OpenStops {
    fn check(&self) -> CheckResult {
        let by_name = |a: &EmergencyStop, b: &EmergencyStop| a.name < b.name;
        require(
            self.open.len() <= OPEN_MAX && self.open.is_sorted_by(by_name),
            "at most 9 stops are open, 8 and one that stands for many, ascending by name, each named once",
        )?;
        names(&self.lifted, LIFTED_MAX)
    }
}

impl Task {
    fn check(&self) -> CheckResult {
        number(self.run.0)?;
        ascending(&self.members)?;
        require(!self.members.is_empty(), "a task has members")?;
        require(
            MissionKind::from(&self.kind) != MissionKind::Stored || self.members.len() == 1,
            "a stored mission is one vehicle's",
        )?;
        self.compare_with.iter().try_for_each(|run| number(run.0))?;
        require(
            self.compare_with != Some(self.run),
            "a run is compared with another one",
        )?;
        self.kind.check()
    }
}

impl Have {
    fn check(&self) -> CheckResult {
        require(
            self.watermarks.len() <= MARKS_MAX && self.closed.len() <= LIST_MAX,
            "a store speaks of at most 4096 watermarks and 1024 closed runs",
        )?;
        self.closed.iter().try_for_each(|run| number(run.0))?;
        self.watermarks
            .iter()
            .try_for_each(|mark| number(mark.run.0))
    }
}

impl Health {
    fn check(&self) -> CheckResult {
        ascending(&self.hears)?;
        self.autopilot.iter().try_for_each(AutopilotHealth::check)?;
        troubles(&self.troubles)
    }
}

impl AutopilotHealth {
    fn check(&self) -> CheckResult {
        require(
            self.firmware.len() <= NAME_MAX,
            "a firmware has at most 32 bytes",
        )
    }
}

impl GroundReport {
    fn check(&self) -> CheckResult {
        number(self.run.0)?;
        ascending(&self.expected)
            .and(ascending(&self.members))
            .and(ascending(&self.lost))?;
        let by_run = |a: &RunReport, b: &RunReport| a.run < b.run;
        require(
            self.runs.len() <= RUNS_MAX && self.runs.is_sorted_by(by_run),
            "at most 16 runs are reported, ascending, each named once",
        )?;
        self.runs.iter().try_for_each(RunReport::check)?;
        troubles(&self.troubles)
    }
}

impl RunReport {
    fn check(&self) -> CheckResult {
        number(self.run.0)?;
        self.compared_with.iter().try_for_each(|run| number(run.0))
    }
}

impl Samples {
    fn check(&self) -> CheckResult {
        number(self.run.0)?;
        require(
            self.samples.len() <= SAMPLES_MAX,
            "at most 1024 samples are sent at once",
        )?;
        require(
            self.samples.is_sorted_by(|a, b| a.sequence < b.sequence),
            "samples are ascending by sequence",
        )?;
        self.samples.iter().try_for_each(Sample::check)?;
        let is_range = |lost: &LostSamples| lost.from < lost.until;
        require(
            self.lost.len() <= LOST_MAX
                && self.lost.iter().all(is_range)
                && self.lost.is_sorted_by(|a, b| a.until < b.from),
            "at most 64 ranges are lost, ascending and apart",
        )
    }
}

impl Sample {
    fn check(&self) -> CheckResult {
        self.transmitter_pose.check()?;
        self.receiver_pose.check()?;
        require(
            self.rssi_dbm
                .is_none_or(|rssi| (-200..=100).contains(&rssi)),
            "an RSSI is from -200 to 100 dBm",
        )
    }
}

impl Image {
    fn check(&self) -> CheckResult {
        number(self.run.0)?;
        let (least, greatest) = (self.area.least, self.area.greatest);
        least.check().and(greatest.check())?;
        require(
            least.x_mm < greatest.x_mm && least.y_mm < greatest.y_mm && least.z_mm == greatest.z_mm,
            "an image covers a rectangle at one height",
        )?;
        require(
            (1..=IMAGE_SIDE_MAX).contains(&self.columns)
                && (1..=IMAGE_SIDE_MAX).contains(&self.rows),
            "an image has 1 to 400 columns and rows",
        )?;
        self.check_part()?;
        require(
            self.finds.len() <= IMAGE_FINDS_MAX && (self.part == 0 || self.finds.is_empty()),
            "at most 32 finds are named, in the first part",
        )?;
        self.finds.iter().try_for_each(Find::check)
    }

    fn check_part(&self) -> CheckResult {
        let pixels = usize::from(self.columns) * usize::from(self.rows);
        let before = usize::from(self.part) * IMAGE_PART_PIXELS;
        let here = pixels.saturating_sub(before).min(IMAGE_PART_PIXELS);
        let deviations = self.deviation.as_ref().map_or(here, Vec::len);
        require(
            usize::from(self.parts) == pixels.div_ceil(IMAGE_PART_PIXELS)
                && here > 0
                && self.mean.len() == here
                && deviations == here,
            "a part of an image has 3072 pixels, the last one the rest",
        )
    }
}

impl Find {
    fn check(&self) -> CheckResult {
        self.at.check()?;
        share(
            self.probability,
            "a probability is from 0 to 1000 thousandths",
        )
    }
}
