//! What is known of the swarm as metrics that Prometheus reads (text format 0.0.4): numbers, with vehicles by their number. No
//! text of a node is in it.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::board::Board;
use super::radio::{PairView, WINDOW};
use crate::operator::fleet_view::VehicleView;
use crate::time::Time;

/// A pair of which no sample has come for so long has no strength and no loss to tell.
const FRESH: Duration = Duration::from_secs(2 * WINDOW.as_secs());

/// Returns all metrics; those that are not known are left out.
pub fn metrics(now: Time, board: &Board) -> String {
    let mut out = String::new();
    swarm(now, board, &mut out);
    let vehicles: Vec<(VehicleId, &VehicleView)> = board.view().vehicles().collect();
    let mut of_vehicles = |name: &str, help: &str, of: &dyn Fn(&VehicleView) -> Option<f64>| {
        let known = vehicles
            .iter()
            .filter_map(|(id, seen)| Some((*id, of(seen)?)));
        let lines = known.map(|(id, value)| (format!("{{vehicle=\"{id}\"}}"), value));
        gauge(&mut out, name, help, lines);
    };
    of_vehicles("vehicle_age_seconds", "Age of the newest state.", &|seen| {
        Some(seen.state.as_ref()?.age(now).as_secs_f64())
    });
    of_vehicles("vehicle_battery_ratio", "Charge left.", &|seen| {
        Some(seen.state.as_ref()?.value.battery?.fraction())
    });
    of_vehicles(
        "vehicle_stands",
        "1 while it stands and does not go on by itself.",
        &|seen| {
            Some(f64::from(u8::from(
                seen.state.as_ref()?.value.stands_under.is_some(),
            )))
        },
    );
    of_vehicles(
        "vehicle_mission_ratio",
        "Share of the mission that is done.",
        &|seen| Some(seen.mission.as_ref()?.value.share?.fraction()),
    );
    of_vehicles(
        "vehicle_samples_waiting",
        "Samples that the ground has not confirmed.",
        &|seen| Some(seen.health.as_ref()?.value.samples_waiting as f64),
    );
    of_vehicles("vehicle_troubles", "Troubles that it names.", &|seen| {
        Some(seen.health.as_ref()?.value.troubles.len() as f64)
    });
    let mut of_pairs = |name: &str, help: &str, of: &dyn Fn(PairView) -> Option<f64>| {
        let known = board
            .radio()
            .pairs()
            .filter_map(|pair| Some((pair, of(board.radio().pair(pair)?)?)));
        let label = |(to, from): (VehicleId, VehicleId)| {
            format!("{{receiver=\"{to}\",transmitter=\"{from}\"}}")
        };
        gauge(
            &mut out,
            name,
            help,
            known.map(|(pair, value)| (label(pair), value)),
        );
    };
    of_pairs(
        "radio_age_seconds",
        "Age of the last sample, of a beacon that was missed too.",
        &|pair| Some(now.since(pair.at).as_secs_f64()),
    );
    // Where both are silent nothing is missed: an old value would say that all is well.
    let is_fresh = |pair: &PairView| now.since(pair.at) <= FRESH;
    of_pairs(
        "radio_strength_dbm",
        "Last strength, while samples come.",
        &|pair| is_fresh(&pair).then_some(f64::from(pair.rssi_dbm?)),
    );
    of_pairs(
        "radio_loss_ratio",
        "Beacons missed in 5 s, while samples come.",
        &|pair| is_fresh(&pair).then_some(pair.loss),
    );
    of_pairs(
        "radio_excess_db",
        "Weaker than the path loss of all pairs, while samples come.",
        &|pair| is_fresh(&pair).then_some(pair.excess_db?),
    );
    out
}

fn swarm(now: Time, board: &Board, out: &mut String) {
    let mut one = |name: &str, help: &str, value: Option<f64>| {
        gauge(out, name, help, value.map(|value| (String::new(), value)));
    };
    let truth = |is: bool| Some(f64::from(u8::from(is)));
    one(
        "linked",
        "1 while anyone can be reached.",
        truth(board.is_linked()),
    );
    let stops = board.view().open_stops().len();
    one(
        "open_stops",
        "Emergency stops that are open.",
        Some(stops as f64),
    );
    let ground = board.view().ground(now).map(|report| &report.value);
    one(
        "ground_live",
        "1 while a ground station is heard.",
        truth(ground.is_some()),
    );
    one(
        "ground_samples",
        "Samples stored of the run.",
        ground.map(|report| report.samples as f64),
    );
    one(
        "ground_images",
        "Images made of the run.",
        ground.map(|report| f64::from(report.images)),
    );
    one(
        "ground_laps_done",
        "Laps done of the run.",
        ground.map(|report| f64::from(report.laps_done)),
    );
    let troubles = ground.map(|report| report.troubles.len() as f64);
    one(
        "ground_troubles",
        "Troubles that the ground station names.",
        troubles,
    );
}

/// Adds a metric with its values, each with its labels; one without values is left out.
fn gauge(
    out: &mut String,
    name: &str,
    help: &str,
    values: impl IntoIterator<Item = (String, f64)>,
) {
    let mut values = values.into_iter().peekable();
    if values.peek().is_none() {
        return;
    }
    *out += &format!("# HELP tomoswarm_{name} {help}\n# TYPE tomoswarm_{name} gauge\n");
    for (labels, value) in values {
        *out += &format!("tomoswarm_{name}{labels} {value}\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dash::board::BoardInput;
    use crate::geom::Lattice;
    use crate::operator::tests_support::{at, heard, report, state};
    use tomoswarm_proto::{Health, Message, PoseReport, Sample, Samples};

    #[test]
    fn every_line_is_a_number_and_no_text_of_a_vehicle_is_in_it() {
        let mut board = Board::new(7, Lattice::new(0.1));
        let health = Health {
            vehicle: VehicleId(2),
            boot: tomoswarm_proto::Boot(1),
            troubles: vec!["evil\n# TYPE x".to_owned()],
            ..Health::default()
        };
        for message in [
            Message::State(state(2)),
            Message::Health(health),
            Message::Report(report()),
        ] {
            board.take(at(1.0), &BoardInput::Heard(heard(message)));
        }
        let text = metrics(at(1.5), &board);
        for line in [
            "tomoswarm_vehicle_age_seconds{vehicle=\"2\"} 0.5",
            "tomoswarm_vehicle_battery_ratio{vehicle=\"2\"} 0.9",
            "tomoswarm_vehicle_troubles{vehicle=\"2\"} 1",
            "tomoswarm_ground_live 1",
            "tomoswarm_linked 0",
        ] {
            assert!(text.lines().any(|of| of == line), "{line} in {text}");
        }
        assert!(!text.contains("evil"), "{text}");
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let (_, value) = line.rsplit_once(' ').unwrap();
            assert!(value.parse::<f64>().is_ok(), "{line}");
        }
        assert!(!text.contains("radio_"), "no pair, no metric");
    }

    #[test]
    fn a_pair_of_which_nothing_comes_any_more_has_an_age_and_no_loss() {
        let mut board = Board::new(7, Lattice::new(0.1));
        let sample = Sample {
            sequence: 1,
            heard_at_ns: 1_000_000_000,
            transmitter: VehicleId(2),
            transmitter_pose: PoseReport::default(),
            receiver_pose: PoseReport::default(),
            channel: 20,
            power_dbm: 0,
            rssi_dbm: Some(-60),
        };
        let batch = Samples {
            vehicle: VehicleId(1),
            samples: vec![sample],
            ..Samples::default()
        };
        board.take(at(1.0), &BoardInput::Heard(heard(Message::Samples(batch))));
        let value = |now_s: f64, name: &str| {
            let text = metrics(at(now_s), &board);
            let start = format!("tomoswarm_radio_{name}{{receiver=\"1\",transmitter=\"2\"}} ");
            let line = text.lines().find_map(|line| line.strip_prefix(&start));
            line.map(|value| value.parse::<f64>().unwrap())
        };
        assert_eq!(value(3.0, "age_seconds"), Some(2.0));
        assert_eq!(value(3.0, "loss_ratio"), Some(0.0));
        assert_eq!(value(3.0, "strength_dbm"), Some(-60.0));
        assert_eq!(value(12.0, "age_seconds"), Some(11.0));
        assert_eq!(value(12.0, "loss_ratio"), None);
        assert_eq!(value(12.0, "strength_dbm"), None);
    }
}
