//! What the simulated drivers of a vehicle and the world process say to each other, over a loopback socket of their own.
//!
//! It is no bus: a cut bus leaves the simulated radio alive, and what is said here never leaves the machine. A frame is
//! its length (u32, little-endian, at most [`LIMIT`]), then the version of this protocol, then one of the enums below as
//! [`codec::pack`] writes it. No text travels: a length from outside never decides how much is allocated.
//!
//! ```text
//!   vehicle process                      world process                       who directs
//!     Join{vehicle, boot, token} ─────►                     ◄───── Control{token}
//!                                ◄───── Welcome or Refused ─────►
//!     Autopilot Steer Ping Transmit ──►                     ◄───── Enter Report Track Stop
//!                                ◄───── Report Ack Echo Heard Unsent, Status Places ─────►
//! ```

mod client;
mod control;
mod frame;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, VehicleId, codec};

use crate::autopilot::{Ack, AutopilotReport, NumberedCommand};
use crate::geom::{Angle, Point, Pose};
use crate::node::sensor::{Echo, Ping};

pub use client::{LinkState, WorldLink, WorldLinkSettings};
pub use control::{ControlError, WorldControl};
pub use frame::{FrameError, LIMIT, read_frame, write_frame};

/// Version of this protocol; both ends must speak the same.
pub const VERSION: u8 = 7;
/// Tokens are shorter than this, bytes.
pub const TOKEN_LIMIT: usize = 256;
/// Places of a track that one answer holds.
pub const PLACES_LIMIT: usize = 2000;
/// Collisions that a status lists.
pub const COLLISIONS_LIMIT: usize = 100;

/// What the world is told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum ToWorld {
    /// The drivers of a vehicle want to move its body; the first word of their connection.
    Join {
        /// Which vehicle.
        vehicle: VehicleId,
        /// Start of its software; the higher one replaces the lower one.
        boot: Boot,
        /// The world's token, in bytes.
        token: Vec<u8>,
    },
    /// Somebody wants to direct the scenario; the first word of their connection.
    Control {
        /// The world's token, in bytes.
        token: Vec<u8>,
    },
    /// The autopilot shall obey; answered with an ack.
    Autopilot(NumberedCommand),
    /// The servo shall point, relative to the heading.
    Steer(Angle),
    /// The range sensor shall measure.
    Ping(Ping),
    /// The radio shall send a beacon: a frame of the bus's codec.
    Transmit(Vec<u8>),
    /// The persons enter; answered with a status.
    Enter,
    /// How is it going? Answered with a status.
    Report,
    /// Where was a vehicle? Answered with places.
    Track {
        /// Which vehicle.
        vehicle: VehicleId,
        /// The first place wanted, counted from 0.
        from: u32,
    },
    /// The world shall end; answered with a status.
    Stop,
}

/// What the world says.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum FromWorld {
    /// The connection is accepted.
    Welcome(Welcome),
    /// It is not, or is not any longer; nothing follows.
    Refused(LinkRefusal),
    /// What the autopilot says of itself, ten times a second.
    Autopilot(AutopilotReport),
    /// The autopilot's answer to a command.
    Ack(Ack),
    /// The range sensor has its reading.
    Echo(Echo),
    /// The radio has heard a beacon.
    Heard {
        /// A frame of the bus's codec.
        frame: Vec<u8>,
        /// How strongly, dBm.
        rssi_dbm: i16,
    },
    /// The radio has not sent the beacon of this sequence: it was speaking, or the beacon is none that it could send.
    Unsent(u32),
    /// How it is going.
    Status(WorldStatus),
    /// Places of a track; fewer than [`PLACES_LIMIT`] are its end.
    Places(Vec<Point>),
}

/// What the world says to one that it accepts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Welcome {
    /// Nanoseconds since the world began.
    pub now_ns: u64,
    /// Where the vehicle believes to stand; `None` for one that directs.
    pub start: Option<Pose>,
}

/// Why the world does not listen to somebody.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum LinkRefusal {
    /// The protocol is another one.
    #[error("the world speaks version {expected} of the link, this program version {found}")]
    Version {
        /// The world's.
        expected: u8,
        /// The other end's.
        found: u8,
    },
    /// It began with something else than a word of greeting.
    #[error("a connection to the world begins with Join or Control")]
    NoGreeting,
    /// The token is wrong.
    #[error("the token is not that of this world")]
    Token,
    /// There is no such vehicle.
    #[error("there is no vehicle {vehicle} in this world; it has 1 to {count}")]
    Unknown {
        /// The one that was named.
        vehicle: VehicleId,
        /// How many there are.
        count: u8,
    },
    /// The vehicle's drivers are connected already, by the same or a later start of its software.
    #[error("vehicle {vehicle} is driven already by boot {present}; boot {found} is not higher")]
    Taken {
        /// Which vehicle.
        vehicle: VehicleId,
        /// The boot that drives it.
        present: Boot,
        /// The boot that wants to.
        found: Boot,
    },
    /// A later start of the vehicle's software was here before.
    #[error("vehicle {vehicle} was driven by boot {present} before; boot {found} is older")]
    Outdated {
        /// Which vehicle.
        vehicle: VehicleId,
        /// The highest boot seen.
        present: Boot,
        /// The boot that wants to.
        found: Boot,
    },
    /// A later start of the vehicle's software has taken over.
    #[error("boot {by} of vehicle {vehicle} has taken over")]
    Replaced {
        /// Which vehicle.
        vehicle: VehicleId,
        /// The boot that has taken over.
        by: Boot,
    },
    /// What it said cannot be understood.
    #[error("what was said to the world cannot be understood")]
    Garbage,
    /// There are too many connections.
    #[error("the world has too many connections")]
    Full,
}

/// How it is going in the world; true places, as the referee sees them.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct WorldStatus {
    /// Nanoseconds since the world began.
    pub now_ns: u64,
    /// Whether the persons have entered.
    pub entered: bool,
    /// Where the persons stand, or will stand.
    pub persons: Vec<Point>,
    /// The vehicles, ascending by id.
    pub vehicles: Vec<VehicleStatus>,
    /// How many contacts there were.
    pub collision_count: u64,
    /// The first [`COLLISIONS_LIMIT`] of them.
    pub collisions: Vec<Contact>,
    /// How many commands led a body over the fence.
    pub fence_breaches: u64,
    /// Smallest distance between the middles of two vehicles so far, metres; `None` for one alone.
    pub min_separation_m: Option<f64>,
    /// Range readings.
    pub scans: u64,
    /// Beacons received, each receiver counted.
    pub beacons_heard: u64,
    /// Beacons lost because two spoke at once.
    pub collided_beacons: u64,
    /// Words of vehicles that were dropped: impossible ones, or a device that was busy.
    pub dropped: u64,
}

/// A vehicle as the world sees it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct VehicleStatus {
    /// Who.
    pub vehicle: VehicleId,
    /// The start of its software that drives it; `None` while nobody does.
    pub driver: Option<Boot>,
    /// Where it truly is.
    pub at: Point,
    /// Where it faces.
    pub heading: Angle,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// Length of its track, for [`ToWorld::Track`].
    pub places: u32,
}

/// A contact that the referee saw.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Contact {
    /// When, nanoseconds since the world began.
    pub at_ns: u64,
    /// Who.
    pub vehicle: VehicleId,
    /// With which other vehicle; `None` = with the scene.
    pub with: Option<VehicleId>,
    /// Where the vehicle's middle was.
    pub place: Point,
}

/// Why a frame is no word of this protocol.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WordError {
    /// The other end speaks another version.
    #[error("the other end speaks version {found} of the link, expected {VERSION}")]
    Version {
        /// Version found.
        found: u8,
    },
    /// The rest cannot be read.
    #[error("a word of the link cannot be read: {reason}")]
    Body {
        /// What the codec found.
        reason: String,
    },
}

/// Writes a word, with its version.
///
/// # Errors
/// The codec refuses the word.
pub fn encode<T: Serialize>(word: &T) -> Result<Vec<u8>, codec::EncodeError> {
    let body = codec::pack(word)?;
    let mut frame = Vec::with_capacity(body.len() + 1);
    frame.push(VERSION);
    frame.extend_from_slice(&body);
    Ok(frame)
}

/// Reads a word.
///
/// # Errors
/// The frame is of another version, or no word.
pub fn decode<T: serde::de::DeserializeOwned>(frame: &[u8]) -> Result<T, WordError> {
    let unreadable = |reason: String| WordError::Body { reason };
    let (version, body) = frame
        .split_first()
        .ok_or_else(|| unreadable("it is empty".to_owned()))?;
    if *version != VERSION {
        return Err(WordError::Version { found: *version });
    }
    codec::unpack(body).map_err(|error| unreadable(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check<T: Serialize + serde::de::DeserializeOwned + PartialEq + std::fmt::Debug>(word: T) {
        let frame = encode(&word).unwrap();
        assert!(frame.len() <= LIMIT, "{} bytes", frame.len());
        assert_eq!(decode::<T>(&frame).unwrap(), word);
        assert!(
            decode::<T>(&frame[..frame.len() - 1]).is_err(),
            "a truncated word is refused"
        );
    }

    #[test]
    fn the_longest_answers_fit_into_a_frame() {
        let place = Point::new(-1234.567, 1e6);
        check(FromWorld::Places(vec![place; PLACES_LIMIT]));
        let contact = Contact {
            at_ns: u64::MAX,
            vehicle: VehicleId(255),
            with: Some(VehicleId(254)),
            place,
        };
        let vehicle = VehicleStatus {
            vehicle: VehicleId(255),
            driver: Some(Boot(u32::MAX)),
            at: place,
            heading: Angle::default(),
            speed_mps: 1.0,
            places: u32::MAX,
        };
        check(FromWorld::Status(WorldStatus {
            vehicles: vec![vehicle; 256],
            collisions: vec![contact; COLLISIONS_LIMIT],
            persons: vec![place; 256],
            ..WorldStatus::default()
        }));
    }

    #[test]
    fn another_version_is_told_apart_from_garbage() {
        let mut frame = encode(&ToWorld::Report).unwrap();
        frame[0] = VERSION + 1;
        assert_eq!(
            decode::<ToWorld>(&frame),
            Err(WordError::Version { found: VERSION + 1 })
        );
        assert!(matches!(
            decode::<ToWorld>(&[VERSION, 200]),
            Err(WordError::Body { .. })
        ));
        assert!(matches!(
            decode::<ToWorld>(&[]),
            Err(WordError::Body { .. })
        ));
    }

    proptest! {
        #[test]
        fn garbage_is_refused_and_never_believed(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut frame = vec![VERSION];
            frame.extend(&bytes);
            for kind in 0..12 {
                if frame.len() > 1 {
                    frame[1] = kind;
                }
                if let Ok(word) = decode::<ToWorld>(&frame) {
                    prop_assert_eq!(encode(&word).map(|again| again.len() <= frame.len()), Ok(true));
                }
                let _ = decode::<FromWorld>(&frame);
            }
        }
    }
}
