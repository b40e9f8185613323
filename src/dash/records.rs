//! What is shown of each subject as a record of a frame. Plain translation: it judges nothing.

use tomoswarm_proto::{
    ImageSubject, Position, Sender, StandReason, TileAddress, VehicleId, VehicleMode,
};

use super::board::Board;
use super::frame::{self, PAIR, STATE, STRIPE};
use super::radio::Pair;
use crate::time::Time;

/// A strength and an excess that are not known.
const NO_STRENGTH: i64 = i16::MIN as i64;
/// What a number of a state's record means when it is not known.
const UNKNOWN: i64 = 0xffff;

/// All modes; a record names one by its place here.
pub(super) const MODES: [VehicleMode; 10] = [
    VehicleMode::Idle,
    VehicleMode::Driving,
    VehicleMode::Turning,
    VehicleMode::Halted,
    VehicleMode::Held,
    VehicleMode::TakingOff,
    VehicleMode::Climbing,
    VehicleMode::Landing,
    VehicleMode::Stopped,
    VehicleMode::MotorsCut,
];

/// Why a vehicle stands; a record names one by its place here, 0 = it does not.
pub(super) const STANDS_UNDER: [&str; 9] = [
    "",
    "stop",
    "held",
    "remote control",
    "autopilot",
    "battery",
    "no place",
    "alone",
    "range sensors silent",
];

/// Returns where a vehicle is; `None` when it has said nothing of that.
pub fn state(now: Time, board: &Board, id: VehicleId) -> Option<Vec<u8>> {
    let newest = board.view().state(id)?;
    let state = &newest.value;
    let misfits = board.view().misfit(Sender::Vehicle(id), board.venue_hash());
    let at = state.pose.map_or(Position::default(), |pose| pose.at);
    let flags = [
        state.pose.is_some(),
        state.is_at_rest,
        state.is_armed,
        state.is_landed,
        misfits.is_some(),
    ];
    let flags = flags
        .iter()
        .enumerate()
        .map(|(bit, is_set)| i64::from(*is_set) << bit)
        .sum();
    let speed_mps = libm::hypot(state.velocity.x_mps(), state.velocity.y_mps());
    let vehicle = board.view().vehicle(id);
    let health = vehicle.and_then(|seen| seen.health.as_ref());
    let waiting = health.map(|health| health.value.samples_waiting);
    Some(STATE.record([
        i64::from(id.0),
        MODES.iter().position(|of| *of == state.mode).unwrap_or(0) as i64,
        stands_under(state.stands_under),
        flags,
        at.x_mm.into(),
        at.y_mm.into(),
        at.z_mm.into(),
        state.pose.map_or(0, |pose| i64::from(pose.heading.0)),
        state.pose.map_or(UNKNOWN, |pose| i64::from(pose.sd.0)),
        (speed_mps * 1000.0) as i64,
        state.battery.map_or(UNKNOWN, |charge| i64::from(charge.0)),
        newest.age(now).as_millis() as i64,
        waiting.map_or(UNKNOWN, |waiting| waiting.min(UNKNOWN as u64 - 1) as i64),
    ]))
}

/// Returns in a word why a vehicle stands.
pub(super) fn stand_reason(why: StandReason) -> &'static str {
    STANDS_UNDER[stands_under(Some(why)) as usize]
}

fn stands_under(why: Option<StandReason>) -> i64 {
    match why {
        None => 0,
        Some(StandReason::Stop(_)) => 1,
        Some(StandReason::Held) => 2,
        Some(StandReason::Remote) => 3,
        Some(StandReason::Autopilot) => 4,
        Some(StandReason::Battery) => 5,
        Some(StandReason::NoPlace) => 6,
        Some(StandReason::Alone) => 7,
        Some(StandReason::Blind) => 8,
    }
}

/// Returns a tile of the merged map; `None` where nothing is known.
pub fn tile(board: &Board, address: TileAddress) -> Option<Vec<u8>> {
    let cells = board.tile(address)?;
    Some(frame::tile(address.slice, address.x, address.y, &cells))
}

/// Returns a part of the newest image; `None` when that image is not there any more.
pub fn stripe(board: &Board, subject: ImageSubject, part: u16) -> Option<Vec<u8>> {
    let image = board.image(subject)?.parts.get(&part)?;
    let first = i64::from(image.part) * tomoswarm_proto::IMAGE_PART_PIXELS as i64;
    let mut record = STRIPE.record([
        image.run.0.into(),
        image.sequence.into(),
        image.laps.into(),
        subject_number(subject),
        i64::from(image.deviation.is_some()),
        image.columns.into(),
        image.rows.into(),
        first,
        image.mean.len() as i64,
        image.area.least.x_mm.into(),
        image.area.least.y_mm.into(),
        image.area.greatest.x_mm.into(),
        image.area.greatest.y_mm.into(),
        image.mean_step_udb_per_m.into(),
        image.deviation_step_udb_per_m.into(),
        image.links_used.into(),
        image.links_dropped.into(),
    ]);
    record.extend(image.mean.iter().map(|pixel| pixel.cast_unsigned()));
    record.extend(image.deviation.iter().flatten());
    Some(record)
}

pub(super) fn subject_number(subject: ImageSubject) -> i64 {
    match subject {
        ImageSubject::Structure => 0,
        ImageSubject::Change => 1,
    }
}

/// Returns how one vehicle hears another one; `None` when no sample of them came.
pub fn pair(now: Time, board: &Board, pair: Pair) -> Option<Vec<u8>> {
    let known = board.radio().pair(pair)?;
    let tenths = |db: f64| (db * 10.0).round() as i64;
    Some(PAIR.record([
        i64::from(pair.0.0),
        i64::from(pair.1.0),
        known.rssi_dbm.map_or(NO_STRENGTH, i64::from),
        (known.loss * 1000.0).round() as i64,
        known.excess_db.map_or(NO_STRENGTH, tenths),
        (known.distance_m * 1000.0) as i64,
        now.since(known.at).as_millis() as i64,
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_has_a_place_of_its_own_in_the_table() {
        for (place, of) in MODES.iter().enumerate() {
            assert_eq!(*of as usize, place, "{of:?}");
        }
    }
}
