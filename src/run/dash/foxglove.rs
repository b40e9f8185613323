//! The board for Foxglove and Lichtblick, by their public protocol (`foxglove.websocket.v1`, `foxglove.sdk.v1`): poses, the
//! merged map, images, and what happened, with the schemas of recordings. It only shows: whatever a viewer publishes or
//! asks for beside channels is passed over. Nothing here opens a connection.
//!
//! A viewer that is slow is sent less: poses at most ten times a second, the map every ten seconds; map and images only when
//! nothing waits for it, and nothing while its connection is full. A channel is sent once, for the newest subscription of it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::Deserialize;
use serde_json::{Value, json};
use tomoswarm_proto::{Image, ImageSubject, RunId};

use crate::dash::board::Board;
use crate::dash::events::{Event, EventKind};
use crate::geom::Point;
use crate::store::recording::{Schema, image_grid, log_line, map_grid, pose};
use crate::time::Time;

/// Between two rounds.
const EVERY: Duration = Duration::from_millis(100);
/// Between two maps: each is the whole of it.
const MAP_EVERY: Duration = Duration::from_secs(10);
/// Lines of the log in one round at most.
const LINES_AT_ONCE: usize = 100;
/// The operation of a binary frame: data of a subscription.
const MESSAGE_DATA: u8 = 1;

/// What goes to a viewer.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum FoxgloveFrame {
    /// A text of the protocol.
    Text(String),
    /// A message.
    Binary(Vec<u8>),
}

/// A channel, by what it shows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Channel {
    Pose(u8),
    Map,
    Image(ImageSubject),
    Log,
}

/// One viewer.
#[derive(Debug)]
pub(super) struct FoxgloveViewer {
    advertised: BTreeSet<Channel>,
    /// Channels by the numbers of the viewer's subscriptions.
    subscriptions: BTreeMap<u32, Channel>,
    next_at: Time,
    sent: Sent,
}

/// What every channel was sent last.
#[derive(Debug, Default)]
struct Sent {
    poses: BTreeMap<u8, (u32, u64)>,
    map_at: Option<Time>,
    images: BTreeMap<ImageSubject, (RunId, u32)>,
    event: u64,
}

/// What a viewer says; other operations are passed over.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum ViewerMessage {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: u32,
}

impl Channel {
    /// Returns its number: of vehicles their own, behind 1000.
    fn number(self) -> u32 {
        match self {
            Channel::Map => 1,
            Channel::Image(ImageSubject::Structure) => 2,
            Channel::Image(ImageSubject::Change) => 3,
            Channel::Log => 4,
            Channel::Pose(vehicle) => 1000 + u32::from(vehicle),
        }
    }

    fn topic(self) -> String {
        match self {
            Channel::Map => "/map".to_owned(),
            Channel::Image(ImageSubject::Structure) => "/structure".to_owned(),
            Channel::Image(ImageSubject::Change) => "/image".to_owned(),
            Channel::Log => "/log".to_owned(),
            Channel::Pose(vehicle) => format!("/vehicle/{vehicle}/pose"),
        }
    }

    /// Returns whether a message of it is long: hundreds of kilobytes.
    fn is_large(self) -> bool {
        match self {
            Channel::Map | Channel::Image(_) => true,
            Channel::Pose(_) | Channel::Log => false,
        }
    }

    fn schema(self) -> Schema {
        match self {
            Channel::Map | Channel::Image(_) => Schema::Grid,
            Channel::Log => Schema::Log,
            Channel::Pose(_) => Schema::Pose,
        }
    }

    fn advertisement(self) -> Value {
        let schema = self.schema();
        json!({
            "id": self.number(),
            "topic": self.topic(),
            "encoding": "json",
            "schemaName": schema.name(),
            "schema": schema.text(),
            "schemaEncoding": "jsonschema",
        })
    }
}

impl FoxgloveViewer {
    /// Makes a viewer that has just come; returns what it is sent first.
    pub(super) fn new(now: Time, venue: &str) -> (FoxgloveViewer, FoxgloveFrame) {
        let info = json!({
            "op": "serverInfo",
            "name": format!("tomoswarm, {venue}"),
            "capabilities": [],
            "supportedEncodings": ["json"],
            "metadata": { "tomoswarm": env!("CARGO_PKG_VERSION") },
        });
        let viewer = FoxgloveViewer {
            advertised: BTreeSet::new(),
            subscriptions: BTreeMap::new(),
            next_at: now,
            sent: Sent::default(),
        };
        (viewer, FoxgloveFrame::Text(info.to_string()))
    }

    /// Takes what the viewer says. A new subscription is sent everything anew, in place of an earlier one of the same channel;
    /// one of a channel that there is not is passed over.
    ///
    /// # Errors
    /// It is no message of the protocol.
    pub(super) fn hear(&mut self, text: &str) -> Result<(), String> {
        let said: ViewerMessage =
            serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))?;
        match said {
            ViewerMessage::Subscribe { subscriptions } => {
                for Subscription { id, channel_id } in subscriptions {
                    let known = self.advertised.iter();
                    let channel = known.copied().find(|of| of.number() == channel_id);
                    if let Some(channel) = channel {
                        self.subscriptions.retain(|_, of| *of != channel);
                        self.subscriptions.insert(id, channel);
                        self.forget(channel);
                    }
                }
            }
            ViewerMessage::Unsubscribe { subscription_ids } => {
                for id in subscription_ids {
                    self.subscriptions.remove(&id);
                }
            }
            ViewerMessage::Other => {}
        }
        Ok(())
    }

    fn forget(&mut self, channel: Channel) {
        match channel {
            Channel::Pose(vehicle) => {
                self.sent.poses.remove(&vehicle);
            }
            Channel::Map => self.sent.map_at = None,
            Channel::Image(subject) => {
                self.sent.images.remove(&subject);
            }
            Channel::Log => self.sent.event = 0,
        }
    }

    /// Returns when it is next due.
    pub(super) fn deadline(&self) -> Time {
        self.next_at
    }

    /// Lets it wait for another round.
    pub(super) fn wait(&mut self, now: Time) {
        self.next_at = now + EVERY;
    }

    /// Returns what is due of a board as it is at a moment; `now` is the caller's clock. Of a viewer for which something waits
    /// already, what is large is put off.
    pub(super) fn due(
        &mut self,
        now: Time,
        (moment, board): (Time, &Board),
        is_idle: bool,
    ) -> Vec<FoxgloveFrame> {
        if now < self.next_at {
            return Vec::new();
        }
        self.next_at = now + EVERY;
        let mut frames = Vec::new();
        frames.extend(self.advertise(board));
        for (id, channel) in &self.subscriptions {
            if channel.is_large() && !is_idle {
                continue;
            }
            for value in self.sent.messages(*channel, moment, board) {
                frames.push(data(*id, moment, &value));
            }
        }
        frames
    }

    /// Says which channels there are that were not before.
    fn advertise(&mut self, board: &Board) -> Option<FoxgloveFrame> {
        let vehicles = board.view().vehicles().map(|(id, _)| Channel::Pose(id.0));
        let images = [ImageSubject::Structure, ImageSubject::Change].map(Channel::Image);
        let all = vehicles.chain(images).chain([Channel::Map, Channel::Log]);
        let new: Vec<Channel> = all.filter(|of| !self.advertised.contains(of)).collect();
        if new.is_empty() {
            return None;
        }
        let channels: Vec<Value> = new.iter().map(|of| of.advertisement()).collect();
        self.advertised.extend(new);
        let text = json!({ "op": "advertise", "channels": channels }).to_string();
        Some(FoxgloveFrame::Text(text))
    }
}

/// Returns a message of a subscription.
fn data(subscription: u32, moment: Time, value: &Value) -> FoxgloveFrame {
    let mut bytes = vec![MESSAGE_DATA];
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(moment.as_nanos().to_le_bytes());
    bytes.extend(value.to_string().as_bytes());
    FoxgloveFrame::Binary(bytes)
}

impl Sent {
    /// Returns what a channel has that was not sent.
    fn messages(&mut self, channel: Channel, moment: Time, board: &Board) -> Vec<Value> {
        match channel {
            Channel::Pose(vehicle) => self.pose(vehicle, moment, board).into_iter().collect(),
            Channel::Map => self.map(moment, board).into_iter().collect(),
            Channel::Image(subject) => self.image(subject, moment, board).into_iter().collect(),
            Channel::Log => self.log(board),
        }
    }

    fn pose(&mut self, vehicle: u8, moment: Time, board: &Board) -> Option<Value> {
        let state = board.view().state(tomoswarm_proto::VehicleId(vehicle))?;
        let edition = (state.value.boot.0, state.value.sequence);
        if self.poses.insert(vehicle, edition) == Some(edition) {
            return None;
        }
        Some(pose(moment, &state.value)?.value)
    }

    fn map(&mut self, moment: Time, board: &Board) -> Option<Value> {
        // A moment that lies before is one of another run.
        let is_soon = |at: Time| moment >= at && moment.since(at) < MAP_EVERY;
        if self.map_at.is_some_and(is_soon) {
            return None;
        }
        let grid = map_grid(board.map())?;
        self.map_at = Some(moment);
        Some(grid.json(moment))
    }

    fn image(&mut self, subject: ImageSubject, moment: Time, board: &Board) -> Option<Value> {
        let newest = board.image(subject)?;
        let parts: Vec<&Image> = newest.parts.values().collect();
        let first = parts.first()?;
        let is_whole = parts.len() == usize::from(first.parts);
        if !is_whole || self.images.get(&subject) == Some(&newest.edition) {
            return None;
        }
        self.images.insert(subject, newest.edition);
        let step = first.mean_step_udb_per_m as f32 / 1e6;
        let values = parts.iter().flat_map(|part| &part.mean);
        let values = values.map(|value| f32::from(*value) * step);
        let (least, greatest) = (first.area.least, first.area.greatest);
        let (columns, rows) = (
            usize::from(first.columns.max(1)),
            f64::from(first.rows.max(1)),
        );
        let cell_m = (
            (greatest.x_m() - least.x_m()) / columns as f64,
            (greatest.y_m() - least.y_m()) / rows,
        );
        let corner = Point::new(least.x_m(), least.y_m());
        Some(image_grid(corner, cell_m, columns, values).json(moment))
    }

    fn log(&mut self, board: &Board) -> Vec<Value> {
        let events = board.events();
        // Another board has fewer.
        let after = if events.last() < self.event {
            0
        } else {
            self.event
        };
        let new: Vec<&Event> = events.after(after).take(LINES_AT_ONCE).collect();
        self.event = new.last().map_or(after, |event| event.number);
        let line = |event: &&Event| {
            let is_error = event.kind == EventKind::Trouble;
            log_line(event.at, is_error, event.kind.word(), &event.text)
        };
        new.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dash::board::BoardInput;
    use crate::geom::Lattice;
    use crate::operator::HeardMessage;
    use tomoswarm_proto::{
        Boot, LayerId, Message, Sender, State, TileAddress, TileReport, VehicleId,
    };

    fn at(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    /// A board with a vehicle and a map.
    fn board() -> Board {
        let mut board = Board::new(7, Lattice::new(0.1));
        let sender = Sender::Vehicle(VehicleId(1));
        let state = State {
            vehicle: VehicleId(1),
            pose: Some(tomoswarm_proto::PoseReport::default()),
            ..State::default()
        };
        let tile = TileReport {
            address: TileAddress {
                slice: 0,
                x: 0,
                y: 0,
            },
            revision: 1,
            cells: std::sync::Arc::new([17; tomoswarm_proto::TILE_CELLS]),
            layer: LayerId {
                vehicle: VehicleId(1),
                boot: Boot(1),
            },
        };
        for message in [Message::State(state), Message::Tile(tile)] {
            let heard = HeardMessage::Message(sender, message);
            board.take(at(0.0), &BoardInput::Heard(heard));
        }
        board
    }

    /// A viewer that has been told of all channels.
    fn viewer(board: &Board) -> FoxgloveViewer {
        let (mut viewer, _) = FoxgloveViewer::new(at(0.0), "yard");
        viewer.due(at(0.0), (at(0.0), board), true);
        viewer
    }

    fn subscribe(viewer: &mut FoxgloveViewer, subscriptions: &[(u32, Channel)]) {
        let one = |(id, channel): &(u32, Channel)| json!({"id": id, "channelId": channel.number()});
        let all: Vec<Value> = subscriptions.iter().map(one).collect();
        let text = json!({"op": "subscribe", "subscriptions": all}).to_string();
        viewer.hear(&text).unwrap();
    }

    /// The subscriptions of the messages that are due.
    fn due(viewer: &mut FoxgloveViewer, at_s: f64, board: &Board, is_idle: bool) -> Vec<u8> {
        let frames = viewer.due(at(at_s), (at(at_s), board), is_idle);
        let subscription = |frame: &FoxgloveFrame| match frame {
            FoxgloveFrame::Binary(bytes) => Some(bytes[1]),
            FoxgloveFrame::Text(_) => None,
        };
        frames.iter().filter_map(subscription).collect()
    }

    #[test]
    fn a_channel_is_sent_once_however_often_it_is_subscribed_to() {
        let board = board();
        let mut viewer = viewer(&board);
        let often: Vec<(u32, Channel)> = (0..200).map(|id| (id, Channel::Map)).collect();
        subscribe(&mut viewer, &often);
        subscribe(&mut viewer, &[(3, Channel::Pose(1))]);
        assert_eq!(due(&mut viewer, 1.0, &board, true), [3, 199]);
        assert!(due(&mut viewer, 2.0, &board, true).is_empty());
    }

    #[test]
    fn what_is_large_waits_until_nothing_else_does() {
        let board = board();
        let mut viewer = viewer(&board);
        subscribe(&mut viewer, &[(1, Channel::Pose(1)), (2, Channel::Map)]);
        assert_eq!(due(&mut viewer, 1.0, &board, false), [1]);
        assert_eq!(due(&mut viewer, 2.0, &board, true), [2]);
    }
}
