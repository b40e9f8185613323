//! What was understood of the file of a node (vehicle, ground station, operator), in a few lines for a person. Opens
//! none of the files that it names.

use super::describe::{
    Line, beams_line, imaging_lines, motion_line, safety_line, sensors_line, sweep_line, venue_lines,
};
use crate::config::{BusFile, Endpoint, GroundFile, OperatorFile, Record, Topology, VehicleFile};

/// The most vehicles that a sweep is planned for.
const SWEEPING: std::ops::RangeInclusive<usize> = 2..=8;

/// Describes a vehicle's node.
pub(super) fn vehicle_lines(file: &VehicleFile) -> Vec<Line> {
    let (body, look, radio) = (&file.body, &file.look, &file.radio);
    let home = file.home;
    let mut list = vec![
        ("vehicle", format!("number {}, at home at ({}, {})", file.id, home.x_m, home.y_m)),
        ("state", file.state_dir.clone()),
        (
            "body",
            format!(
                "radius {} m, height {} m, antenna at {} m",
                body.radius_m, body.height_m, body.antenna_height_m
            ),
        ),
        motion_line(body),
        ("pose", format!("from the autopilot, deviation {} m expected", file.pose_sd_m)),
        (
            "range",
            format!(
                "{} to {} m (sure up to {} m), ±{:.0}°",
                look.min_range_m,
                look.max_range_m,
                look.sure_range_m,
                look.half_angle_rad.to_degrees()
            ),
        ),
        beams_line(look),
        sensors_line(look),
        safety_line(&file.safety),
        ("radio", format!("channel {}, power {} dBm, slot {:?}", radio.channel, radio.power_dbm, radio.slot)),
        ("drivers", format!("all simulated, by the world at {}", file.world.connect)),
    ];
    list.extend(bus_lines(&file.bus));
    list.push(record_line(file.record));
    list.extend(venue_lines(&file.venue));
    list
}

/// Describes the ground station's node.
pub(super) fn ground_lines(file: &GroundFile) -> Vec<Line> {
    let ids: Vec<String> = file.vehicles.iter().map(ToString::to_string).collect();
    let mut list = vec![
        ("vehicles", format!("{}: {}", ids.len(), ids.join(" "))),
        ("state", file.state_dir.clone()),
        sweep_line(&file.sweep, false),
    ];
    if !SWEEPING.contains(&ids.len()) {
        let text = format!("no sweep is planned for {} vehicles, only for 2 to 8; all else works", ids.len());
        list.push(("warning", text));
    }
    let compared = file.compare_with.map_or("with nothing".to_owned(), |run| format!("with run {run}"));
    let over = if file.take_over { "displaced" } else { "left in place" };
    list.extend(imaging_lines(&file.imaging));
    list.push(("compared", compared));
    list.push(("reception", format!("half lost at {} dBm", file.sensitivity_dbm)));
    list.push(("safety", format!("separation {} m, lost after {:?}", file.separation_m, file.lost_after)));
    list.push(("operators", format!("a living one is {over}")));
    if !file.operators_note.is_empty() {
        list.push(("note", file.operators_note.clone()));
    }
    list.extend(bus_lines(&file.bus));
    list.push(record_line(file.record));
    list.extend(venue_lines(&file.venue));
    list
}

/// Describes an operator's commands.
pub(super) fn operator_lines(file: &OperatorFile) -> Vec<Line> {
    let mut list = bus_lines(&file.bus);
    list.extend(venue_lines(&file.venue));
    list
}

fn bus_lines(bus: &BusFile) -> Vec<Line> {
    let shape = match bus.topology {
        Topology::Mesh => "mesh",
        Topology::Star => "star",
    };
    let trust = match &bus.identity {
        Some(identity) => format!("certificate {}, roster {}", identity.certificate, identity.roster),
        None if bus.unprotected_network => {
            "NONE: anyone who reaches this node can read and give orders".to_owned()
        }
        None => "none: this machine only".to_owned(),
    };
    vec![
        (
            "bus",
            format!(
                "{shape}, listens on {}, connects to {}",
                endpoints(&bus.listen),
                endpoints(&bus.connect)
            ),
        ),
        ("protection", trust),
        ("traffic", format!("up to {} kB/s, a neighbour is gone after {:?}", bus.egress_kb_per_s, bus.lease)),
        ("gossip", if bus.gossip { "on" } else { "off: only connect joins nodes" }.to_owned()),
    ]
}

fn endpoints(list: &[Endpoint]) -> String {
    match list {
        [] => "nothing".to_owned(),
        list => list.iter().map(Endpoint::to_string).collect::<Vec<_>>().join(" "),
    }
}

fn record_line(record: Record) -> Line {
    let text = match record.limit_bytes() {
        Some(_) => format!("up to {} MB", record.limit_mb),
        None => "off".to_owned(),
    };
    ("recording", text)
}
