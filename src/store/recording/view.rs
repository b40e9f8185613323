//! What people look at in a recording: poses, the map, pictures and events, as Foxglove's own messages. It is all
//! taken from the steps; a replay ignores it.

use base64::prelude::{BASE64_STANDARD, Engine};
use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};
use tomoswarm_proto::{Message, State, TileReport, VehicleId};

use super::schema::Schema;
use crate::actor::{ActorStep, RecordedStep, StepCause};
use crate::autopilot::link::{self, AutopilotLink};
use crate::geom::{Cell, Lattice, Point};
use crate::ground::imager::{ImagerActor, ReconstructedImage, Subject};
use crate::ground::station::{self, Station};
use crate::map::Merged;
use crate::node::health::{self, HealthActor};
use crate::node::map::{self, Map};
use crate::node::mission::{self, Mission};
use crate::node::vehicle::{self, Vehicle};
use crate::stops::{self, Stops};
use crate::time::Time;

/// The frame of all poses: the venue's axes, metres.
const FRAME: &str = "venue";
/// The map is shown this often at most.
const MAP_EVERY: Duration = Duration::from_secs(10);
/// Altitude slice of the map that is shown.
const SLICE: i16 = 0;
/// Cells of a map that is shown, at most.
const CELLS: usize = 1 << 20;
/// Foxglove's numbers for types and levels.
const INT8: u8 = 2;
const FLOAT32: u8 = 7;
const INFO: u8 = 2;
const ERROR: u8 = 4;

/// A message for people.
pub(crate) struct MessageLine {
    /// Its topic.
    pub(crate) topic: String,
    /// Its kind.
    pub(crate) schema: Schema,
    /// What it says.
    pub(crate) value: Value,
}

/// What has been seen so far.
pub(super) struct RecordingView {
    node: String,
    map: Merged,
    is_map_new: bool,
    map_shown_at: Option<Time>,
    pose_shown_at: BTreeMap<VehicleId, u64>,
}

impl RecordingView {
    /// Makes the view of a node.
    pub(super) fn new(node: &str, lattice: Lattice) -> RecordingView {
        RecordingView {
            node: node.to_owned(),
            map: Merged::new(lattice, None),
            is_map_new: false,
            map_shown_at: None,
            pose_shown_at: BTreeMap::new(),
        }
    }

    /// Returns what is to be seen of a step of an actor; of most there is nothing but a fault.
    pub(super) fn of(&mut self, step: &ActorStep) -> Vec<MessageLine> {
        let now = step.now;
        let mut shown = Vec::new();
        if let Some(RecordedStep {
            outputs: output, ..
        }) = step.of::<Vehicle>()
        {
            shown.extend(output.iter().filter_map(|out| self.vehicle(now, out)));
        } else if let Some(RecordedStep { outputs, .. }) = step.of::<AutopilotLink>() {
            shown.extend(outputs.iter().filter_map(|out| match out {
                link::Out::LinkEvent(event) => {
                    Some(self.log(now, INFO, "autopilot", &format!("autopilot: {event}")))
                }
                _ => None,
            }));
        } else if let Some(RecordedStep { outputs, .. }) = step.of::<HealthActor>() {
            shown.extend(outputs.iter().filter_map(|out| match out {
                health::Out::HealthEvent(event) => {
                    Some(self.log(now, INFO, "health", &event.to_string()))
                }
                health::Out::Publish(_) => None,
            }));
        } else if let Some(RecordedStep { outputs, .. }) = step.of::<Stops>() {
            shown.extend(outputs.iter().filter_map(|out| match out {
                stops::Out::StopEvent(event) => {
                    Some(self.log(now, INFO, "stops", &event.to_string()))
                }
                _ => None,
            }));
        } else if let Some(RecordedStep {
            outputs: output, ..
        }) = step.of::<Mission>()
        {
            shown.extend(output.iter().filter_map(|out| self.mission(now, out)));
        } else if let Some(RecordedStep {
            outputs: output, ..
        }) = step.of::<Map>()
        {
            shown.extend(self.tiles(now, output));
        } else if let Some(step) = step.of::<Station>() {
            shown.extend(self.station(step));
        } else if let Some(RecordedStep {
            outputs: output, ..
        }) = step.of::<ImagerActor>()
        {
            shown.extend(
                output
                    .iter()
                    .filter_map(|picture| self.picture(now, picture)),
            );
        }
        shown.extend(
            step.fault
                .as_ref()
                .map(|fault| self.log(now, ERROR, "fault", fault)),
        );
        shown
    }

    fn tiles(&mut self, now: Time, output: &[map::Out]) -> Option<MessageLine> {
        for out in output {
            match out {
                map::Out::Tiles(tiles) => tiles.iter().for_each(|tile| self.learn(&tile.report)),
                map::Out::Publish(_) => {}
            }
        }
        self.map(now)
    }

    fn vehicle(&self, now: Time, out: &vehicle::Out) -> Option<MessageLine> {
        match out {
            vehicle::Out::Publish(state) => pose(now, state),
            vehicle::Out::SafetyEvent(event) => {
                Some(self.log(now, INFO, "vehicle", &event.to_string()))
            }
            vehicle::Out::AutopilotCommand(_)
            | vehicle::Out::State(_)
            | vehicle::Out::Remember(_)
            | vehicle::Out::Order(_) => None,
        }
    }

    fn mission(&self, now: Time, out: &mission::Out) -> Option<MessageLine> {
        match out {
            mission::Out::MissionEvent(event) => {
                Some(self.log(now, INFO, "mission", &event.to_string()))
            }
            mission::Out::Command(..)
            | mission::Out::Holds(_)
            | mission::Out::Accepted(..)
            | mission::Out::Progress(_)
            | mission::Out::Remember(_)
            | mission::Out::Measure(_) => None,
        }
    }

    fn station(&mut self, step: &RecordedStep<station::In, station::Out>) -> Vec<MessageLine> {
        let mut shown = Vec::new();
        if let StepCause::Input(station::In::Bus(message)) = &step.cause {
            match message {
                Message::State(state) => {
                    shown.extend(self.newer(state).then(|| pose(step.now, state)).flatten())
                }
                Message::Tile(report) => self.learn(report),
                Message::Digest(_)
                | Message::Want(_)
                | Message::Plan(_)
                | Message::Mission(_)
                | Message::Order(_)
                | Message::Samples(_)
                | Message::Have(_)
                | Message::Beacon(_)
                | Message::Hello(_)
                | Message::Health(_)
                | Message::Report(_)
                | Message::Standing(_)
                | Message::Task(_)
                | Message::Image(_)
                | Message::Fix(_)
                | Message::Mark(_)
                | Message::Look(_)
                | Message::Log(_)
                | Message::Settings(_) => {}
            }
        }
        for out in &step.outputs {
            if let station::Out::StationEvent(note) = out {
                shown.push(self.log(step.now, INFO, "station", &note.to_string()));
            }
        }
        shown.extend(self.map(step.now));
        shown
    }

    /// Returns whether a state is newer than the one shown before.
    fn newer(&mut self, state: &State) -> bool {
        let edition = u64::from(state.boot.0) << 32 | (state.sequence & u64::from(u32::MAX));
        let shown = self.pose_shown_at.insert(state.vehicle, edition);
        shown.is_none_or(|shown| edition > shown)
    }

    fn learn(&mut self, tile: &TileReport) {
        // Whoever has joined it before has checked it; one that does not fit is not shown.
        self.is_map_new |= self.map.join(tile).is_ok();
    }

    fn map(&mut self, now: Time) -> Option<MessageLine> {
        if !self.is_map_new
            || self
                .map_shown_at
                .is_some_and(|at| now.since(at) < MAP_EVERY)
        {
            return None;
        }
        let grid = map_grid(&self.map)?;
        (self.is_map_new, self.map_shown_at) = (false, Some(now));
        Some(self.shown("map", Schema::Grid, grid.json(now)))
    }

    fn picture(&self, now: Time, picture: &ReconstructedImage) -> Option<MessageLine> {
        let topic = match picture.subject {
            Subject::Change => "image",
            Subject::Structure => "structure",
        };
        let made = match &picture.result {
            Ok(made) => made,
            Err(reason) => return Some(self.log(now, ERROR, "imager", reason)),
        };
        let grid = made.image.grid;
        let values = made.image.values.iter().map(|value| *value as f32);
        let cell_m = (grid.dx_m(), grid.dy_m());
        let grid = image_grid(grid.area.min, cell_m, grid.columns, values);
        Some(self.shown(topic, Schema::Grid, grid.json(now)))
    }

    fn log(&self, now: Time, level: u8, name: &str, message: &str) -> MessageLine {
        let value = log_line(now, level == ERROR, name, message);
        self.shown("log", Schema::Log, value)
    }

    fn shown(&self, topic: &str, schema: Schema, value: Value) -> MessageLine {
        MessageLine {
            topic: format!("/{}/{topic}", self.node),
            schema,
            value,
        }
    }
}

/// Returns a merged map as a grid; `None` when nothing is known, or too much.
pub(crate) fn map_grid(map: &Merged) -> Option<Grid> {
    let extent = map.extent(SLICE)?;
    let (columns, rows) = (
        extent.width_cells() as usize,
        extent.height_cells() as usize,
    );
    if columns.saturating_mul(rows) > CELLS {
        return None;
    }
    let cells = (extent.low.y..=extent.high.y)
        .flat_map(|y| (extent.low.x..=extent.high.x).map(move |x| Cell::new(x, y)));
    let byte = |cell: Cell| map.value(SLICE, cell).clamp(-127, 127) as i8;
    let bytes: Vec<u8> = cells.map(|cell| byte(cell).cast_unsigned()).collect();
    let cell_m = map.lattice().cell_m();
    let corner = Point::new(
        f64::from(extent.low.x) * cell_m,
        f64::from(extent.low.y) * cell_m,
    );
    Some(Grid {
        corner,
        cell_m: (cell_m, cell_m),
        columns,
        field: ("log_odds_tenths", INT8, 1),
        bytes,
    })
}

/// Returns an image as a grid, dB/m, of what it covers and its columns.
pub(crate) fn image_grid(
    corner: Point,
    cell_m: (f64, f64),
    columns: usize,
    values: impl Iterator<Item = f32>,
) -> Grid {
    Grid {
        corner,
        cell_m,
        columns,
        field: ("db_per_m", FLOAT32, 4),
        bytes: values.flat_map(f32::to_le_bytes).collect(),
    }
}

/// Returns a line of a log.
pub(crate) fn log_line(now: Time, is_error: bool, name: &str, message: &str) -> Value {
    let level = if is_error { ERROR } else { INFO };
    json!({
        "timestamp": timestamp(now), "level": level, "message": message, "name": name, "file": "", "line": 0,
    })
}

/// A grid of one value per cell, rows from south to north.
pub(crate) struct Grid {
    corner: Point,
    cell_m: (f64, f64),
    columns: usize,
    field: (&'static str, u8, usize),
    bytes: Vec<u8>,
}

impl Grid {
    /// Returns it as a message.
    pub(crate) fn json(&self, now: Time) -> Value {
        let (name, kind, size) = self.field;
        let corner = json!({"x": self.corner.x_m, "y": self.corner.y_m, "z": 0.0});
        json!({
            "timestamp": timestamp(now),
            "frame_id": FRAME,
            "pose": {"position": corner, "orientation": turned(0.0)},
            "column_count": self.columns,
            "cell_size": {"x": self.cell_m.0, "y": self.cell_m.1},
            "row_stride": self.columns * size,
            "cell_stride": size,
            "fields": [{"name": name, "offset": 0, "type": kind}],
            "data": BASE64_STANDARD.encode(&self.bytes),
        })
    }
}

/// Returns where a vehicle is; `None` when it does not know.
pub(crate) fn pose(now: Time, state: &State) -> Option<MessageLine> {
    let pose = state.pose?;
    let position = json!({"x": pose.at.x_m(), "y": pose.at.y_m(), "z": pose.at.z_m()});
    let value = json!({
        "timestamp": timestamp(now),
        "frame_id": FRAME,
        "pose": {"position": position, "orientation": turned(pose.heading.radians())},
    });
    Some(MessageLine {
        topic: format!("/vehicle/{}/pose", state.vehicle),
        schema: Schema::Pose,
        value,
    })
}

/// A turn about the upward axis, as a quaternion.
fn turned(angle_rad: f64) -> Value {
    let (z, w) = libm::sincos(angle_rad / 2.0);
    json!({"x": 0.0, "y": 0.0, "z": z, "w": w})
}

fn timestamp(now: Time) -> Value {
    let nanos = now.as_nanos();
    json!({"sec": nanos / 1_000_000_000, "nsec": nanos % 1_000_000_000})
}
