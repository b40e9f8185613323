//! The tracks that vehicles drove, as waypoint files that an autopilot, or `[mission] file`, drives again.

use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::folder::OutputFolder;
use crate::config::{Craft, MOST_ITEMS, Sim, WaypointFile};
use crate::geom::{Geodetic, Point, Segment};

/// What is left out of a track lies at most this far beside what is kept, metres.
const BESIDE_M: f64 = 0.1;
/// No kept piece of a track stands for more places than this.
const PIECE: usize = 200;

/// Writes every track of a run as `track-N.waypoints` (QGC WPL 110).
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_tracks(
    folder: &mut OutputFolder,
    sim: &Sim,
    tracks: &[(VehicleId, Vec<Point>)],
) -> Result<(), CliError> {
    let (plane, flight) = (sim.venue.plane(), sim.vehicles.flight);
    let altitude_m = flight.way_altitude_m();
    let place = |at: &Point| plane.to_earth([at.x_m, at.y_m, altitude_m]);
    for (vehicle, track) in tracks {
        let Some((home, way)) = corners(track)
            .split_first()
            .map(|(home, way)| (*home, way.to_vec()))
        else {
            continue;
        };
        let way: Vec<Geodetic> = way.iter().take(MOST_ITEMS).map(place).collect();
        // Who never moved has no track.
        let home = plane.to_earth([home.x_m, home.y_m, 0.0]);
        let Ok(mut file) = WaypointFile::of_track(home, &way) else {
            continue;
        };
        if flight.craft == Craft::Copter {
            file = file.with_takeoff(altitude_m);
        }
        folder.write(
            &format!("track-{vehicle}.waypoints"),
            file.to_wpl().as_bytes(),
        )?;
    }
    Ok(())
}

/// Leaves out what lies in a straight line between what is kept.
fn corners(track: &[Point]) -> Vec<Point> {
    let Some(first) = track.first() else {
        return Vec::new();
    };
    let mut kept = vec![*first];
    let mut from = 0;
    for next in 2..=track.len() {
        let is_straight = track.get(next).is_some_and(|to| {
            let piece = Segment::new(track[from], *to);
            let between = &track[from + 1..next];
            between.len() < PIECE
                && between
                    .iter()
                    .all(|at| piece.distance_to_point(*at) <= BESIDE_M)
        });
        if !is_straight {
            kept.push(track[next - 1]);
            from = next - 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_keeps_its_corners_and_its_ends() {
        let there = (0..=20).map(|step| Point::new(f64::from(step) * 0.5, 0.0));
        let back = (1..=20).map(|step| Point::new(10.0, f64::from(step) * 0.5));
        let track: Vec<Point> = there.chain(back).collect();
        assert_eq!(
            corners(&track),
            [
                Point::new(0.0, 0.0),
                Point::new(10.0, 0.0),
                Point::new(10.0, 10.0)
            ]
        );
        assert_eq!(corners(&track[..1]), [Point::new(0.0, 0.0)]);
        assert_eq!(corners(&track[..2]), track[..2]);
    }
}
