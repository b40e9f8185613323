//! How strongly two vehicles heard each other in the minutes before a moment, from what was heard and is kept ([`History`]): a
//! page that comes late, looks back or was not looked at is told what it has not seen.
//!
//! A moment is that at which this program heard the sample. Of samples of long ago some may have been thinned out.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::history::History;
use super::told::{ToldPairHistory, ToldStrength, as_text};
use crate::time::Time;

/// So much is told.
const SPAN: Duration = Duration::from_secs(300);
/// Of so long a time the last strength.
const STEP: Duration = Duration::from_secs(1);

/// Returns how strongly one vehicle heard another before a moment, and that one it, JSON; oldest first.
pub fn pair_history(at: Time, history: &History, one: VehicleId, other: VehicleId) -> String {
    let from = Time::ZERO + at.since(Time::ZERO).saturating_sub(SPAN);
    let ways = [(one, other), (other, one)];
    let mut strengths: [Vec<(Time, i16)>; 2] = Default::default();
    // What was heard before is known by the board of then: said again later it is nothing new.
    if let Some((board, told_before)) = history.board_before(from) {
        let mut new = board.radio().new_samples().clone();
        let until = at + Duration::from_nanos(1);
        history.each_samples(told_before, until, &mut |heard_at, batch| {
            for sample in &batch.samples {
                let pair = (batch.vehicle, sample.transmitter);
                let way = ways.iter().position(|way| *way == pair);
                let is_new = new.take(batch, sample.sequence) && heard_at >= from;
                if let (true, Some(way), Some(rssi_dbm)) = (is_new, way, sample.rssi_dbm) {
                    let step = |at: Time| at.since(Time::ZERO).as_millis() / STEP.as_millis();
                    let of_way = &mut strengths[way];
                    of_way.pop_if(|(before, _)| step(*before) == step(heard_at));
                    of_way.push((heard_at, rssi_dbm));
                }
            }
        });
    }
    let told = |(heard_at, rssi_dbm): &(Time, i16)| ToldStrength {
        age_s: at.since(*heard_at).as_secs_f64(),
        rssi_dbm: *rssi_dbm,
    };
    let [there, back] = strengths.map(|of_way| of_way.iter().map(told).collect());
    as_text(&ToldPairHistory {
        at_s: at.as_secs_f64(),
        there,
        back,
    })
}
