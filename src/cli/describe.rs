//! What was understood of a configuration, in a few lines for a person. Every value is shown, those that
//! were left out with their defaults.

use std::fmt::Write;

use super::describe_nodes::{ground_lines, operator_lines, vehicle_lines};
use crate::config::{
    Axis, Body, Config, Craft, Experiment, Fault, FaultKind, Flight, Imaging, Lobe, Look, Material, Planner,
    RandomPersons, RangeSensor, Safety, SceneFile, Sim, Sweep, Task, Venue,
};
use crate::geom::Point;
use crate::plan::Mount;
use crate::time::Time;

/// Describes a configuration; ends in a line break.
pub fn describe(config: &Config) -> String {
    match config {
        Config::Venue(venue) => format!("a venue\n{}", lines(&venue_lines(venue))),
        Config::Scene(scene) => format!("a scene\n{}", lines(&scene_lines(scene))),
        Config::Sim(sim) => format!("a simulation\n{}", lines(&sim_lines(sim))),
        Config::Vehicle(file) => format!("a vehicle's node\n{}", lines(&vehicle_lines(file))),
        Config::Ground(file) => format!("a ground station's node\n{}", lines(&ground_lines(file))),
        Config::Operator(file) => format!("an operator's commands\n{}", lines(&operator_lines(file))),
        Config::Experiment(experiment) => {
            format!("an experiment\n{}", lines(&experiment_lines(experiment)))
        }
    }
}

/// A name and what is said under it.
pub(super) type Line = (&'static str, String);

fn lines(list: &[Line]) -> String {
    let mut text = String::new();
    for (name, value) in list {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "  {name:<12} {value}");
    }
    text
}

/// Values of an axis that are listed.
const VALUES_SHOWN: usize = 20;

fn experiment_lines(experiment: &Experiment) -> Vec<Line> {
    let runs = format!("{} runs of experiment {}", experiment.runs(), experiment.name);
    let mut list = vec![("grid", runs)];
    for axis in Axis::ALL.into_iter().filter(|axis| experiment.has(*axis)) {
        let names = experiment.names(axis);
        let rest = if names.len() > VALUES_SHOWN { " …" } else { "" };
        let shown = names[..names.len().min(VALUES_SHOWN)].join(" ");
        list.push((axis.word(), format!("{}: {shown}{rest}", names.len())));
    }
    list
}

/// Describes a place.
pub(super) fn venue_lines(venue: &Venue) -> Vec<Line> {
    let (area, datum) = (venue.area, venue.datum);
    let homes: Vec<String> = venue.homes.iter().map(place).collect();
    vec![
        ("venue", format!("venue {}, hash {:016x}", venue.name, venue.hash())),
        (
            "datum",
            format!(
                "{}° north, {}° east, {} m; x axis at {}°",
                datum.latitude_deg,
                datum.longitude_deg,
                datum.altitude_m,
                venue.x_axis_bearing.degrees()
            ),
        ),
        (
            "area",
            format!(
                "{} m × {} m from {} to {}",
                area.width_m(),
                area.height_m(),
                place(&area.min),
                place(&area.max)
            ),
        ),
        ("fence", format!("{} corners, {:.1} m²", venue.fence.corners().len(), venue.fence.area_m2().abs())),
        ("homes", format!("{}: {}", homes.len(), homes.join(" "))),
        (
            "map",
            format!(
                "cells of {} m, slices at {:?} m, ceiling {} m",
                venue.cell_m, venue.slice_borders_m, venue.ceiling_m
            ),
        ),
    ]
}

fn scene_lines(scene: &SceneFile) -> Vec<Line> {
    let shapes = scene.wrl.as_deref().unwrap_or("none");
    let mut list = vec![
        ("scene", format!("scene {}", scene.name)),
        ("shapes", format!("{shapes}, {:?} up, moved by {:?} m", scene.up, scene.offset_m)),
    ];
    for (name, material) in &scene.materials {
        list.push(("material", format!("{name}: {}", material_text(material))));
    }
    let other = scene.default_material;
    list.push(("material", format!("of others: {}", material_text(&other))));
    list.push(("objects", scene.objects.len().to_string()));
    for person in &scene.persons {
        list.push((
            "person",
            format!(
                "{} at {}, radius {} m, {} dB/m",
                person.name,
                place(&person.at),
                person.radius_m,
                person.db_per_m
            ),
        ));
    }
    list.extend(scene.random_persons.as_ref().map(random_line));
    list
}

/// Describes what a body is made of.
pub(super) fn material_text(material: &Material) -> String {
    let colour = material.colour.map(|[red, green, blue]| format!(", #{red:02x}{green:02x}{blue:02x}"));
    let (inside, crossing) = (material.db_per_m, material.db_per_crossing);
    format!("{inside} dB/m, {crossing} dB a crossing{}", colour.unwrap_or_default())
}

fn random_line(random: &RandomPersons) -> Line {
    let text = format!(
        "{} random persons, {} m from the border, {} m from shapes, {} m apart; radius {} m, {} dB/m",
        random.count,
        random.keep_from_border_m,
        random.keep_from_objects_m,
        random.apart_m,
        random.radius_m,
        random.db_per_m
    );
    ("persons", text)
}

fn sim_lines(sim: &Sim) -> Vec<Line> {
    let mut list = venue_lines(&sim.venue);
    list.extend(scene_lines(&sim.scene));
    list.extend(fleet_lines(sim));
    list.extend(sensing_lines(sim));
    list.extend(field_lines(sim));
    list.push(("mission", mission_text(&sim.task)));
    if sim.task.is_planned_by_ground() {
        list.push(sweep_line(&sim.sweep, sim.empty_sweep));
    }
    list.extend(imaging_lines(&sim.imaging));
    list.extend(end_lines(sim));
    list.extend(sim.faults.iter().map(fault_line));
    list
}

/// Describes what vehicles are out for.
pub(super) fn mission_text(task: &Task) -> String {
    let places = |places: &[Point]| places.iter().map(place).collect::<Vec<String>>().join(" ");
    match task {
        Task::Sweep => "sweep: as the ground station plans".to_owned(),
        Task::Legs { places: list } => format!("straight from place to place: {}", places(list)),
        Task::Forward { distance_m } => format!("forward: {distance_m} m straight ahead"),
        Task::Browse => "browse: a look around on the spot".to_owned(),
        Task::Search => "search: all that can be reached, near to objects first".to_owned(),
        Task::Pathfind { places: list } => format!("pathfind: visits {}", places(list)),
        Task::Explore => "explore: all that can be reached, together".to_owned(),
    }
}

fn fleet_lines(sim: &Sim) -> Vec<Line> {
    let fleet = &sim.vehicles;
    vec![
        (
            "vehicles",
            format!(
                "{} vehicles, radius {} m, height {} m, antenna at {} m",
                fleet.count, fleet.radius_m, fleet.height_m, fleet.antenna_height_m
            ),
        ),
        motion_line(&fleet.body()),
        ("flight", flight_in_words(&fleet.flight)),
        (
            "pose",
            format!(
                "deviation {} m over {} s, growing by {} m/s without satellites",
                fleet.pose_sd_m, fleet.pose_correlation_s, fleet.gps_growth_mps
            ),
        ),
        (
            "battery",
            format!("lasts {:?} driving, {:?} at rest", fleet.endurance_driving, fleet.endurance_resting),
        ),
    ]
}

fn flight_in_words(flight: &Flight) -> String {
    match flight.craft {
        Craft::Rover => "none: rovers".to_owned(),
        Craft::Copter => format!(
            "copters at {} m, climbing at {} m/s; wind of {} m/s from {:.0}°",
            flight.altitude_m,
            flight.climb_mps,
            flight.wind_mps,
            flight.wind_from.degrees()
        ),
    }
}

/// Describes how a body moves.
pub(super) fn motion_line(body: &Body) -> Line {
    let text = format!(
        "up to {} m/s, acceleration {} m/s², braking {} m/s², turning {:.0}°/s",
        body.max_speed_mps,
        body.acceleration_mps2,
        body.braking_mps2,
        body.turn_rate_rad_per_s.to_degrees()
    );
    ("motion", text)
}

fn sensing_lines(sim: &Sim) -> Vec<Line> {
    let (range, safety) = (&sim.range, &sim.safety);
    vec![
        (
            "range",
            format!(
                "{} to {} m (sure up to {} m), ±{:.0}°, up to {:.0}° off the normal, deviation {} m, at {} m",
                range.min_range_m,
                range.max_range_m,
                range.sure_range_m,
                range.half_angle_rad.to_degrees(),
                range.incidence_limit_rad.to_degrees(),
                range.noise_sd_m,
                range.height_m
            ),
        ),
        ("lobe", lobe_in_words(range)),
        beams_line(&range.look()),
        sensors_line(&range.look()),
        safety_line(safety),
        alone_line(safety),
    ]
}

/// Describes where a range sensor looks.
pub(super) fn beams_line(look: &Look) -> Line {
    let beams: Vec<String> = look.beams.iter().map(|beam| format!("{:.0}°", beam.degrees())).collect();
    let text =
        format!("{}, one every {:?} of which {:?} to settle", beams.join(" "), look.scan_period, look.settle);
    ("beams", text)
}

fn lobe_in_words(range: &RangeSensor) -> String {
    let lobe = match range.lobe {
        Lobe::Beam => "an ideal beam",
        Lobe::Fan => "a flat fan",
        Lobe::Cone => "a cone",
    };
    let glitches = range.glitch_share * 100.0;
    format!("{lobe}, {glitches} % of the readings are glitches")
}

/// Describes which range sensor looks where.
pub(super) fn sensors_line(look: &Look) -> Line {
    let sensor = |mount: &Mount| {
        let (zero, slew_s) = (mount.zero.degrees(), mount.slew_s_per_rad * 60f64.to_radians());
        let (from, to) = (mount.from_rad.to_degrees(), mount.to_rad.to_degrees());
        if mount.from_rad == mount.to_rad {
            return format!("fixed at {:.0}°", zero + from);
        }
        format!("at {zero:.0}°, servo {from:.0}° to {to:.0}°, 60° in {slew_s:.2} s")
    };
    let sensors: Vec<String> = look.mounts.all().iter().map(sensor).collect();
    let far = format!("echoes beyond {} m are ignored", look.farness_m);
    ("sensors", format!("{}; a round takes {:?}; {far}", sensors.join("; "), look.cycle()))
}

/// Describes the margins that vehicles keep.
pub(super) fn safety_line(safety: &Safety) -> Line {
    let text = format!(
        "padding {} m, separation {} m, halts nearer than {} m, pose deviation up to {} m; without bus {:?}, home at {:.0} % of the battery",
        safety.padding_m,
        safety.separation_m,
        safety.closeness_m,
        safety.pose_sd_max_m,
        safety.autonomy,
        safety.battery_return * 100.0
    );
    ("safety", text)
}

fn field_lines(sim: &Sim) -> Vec<Line> {
    let (radio, bus) = (&sim.radio, &sim.bus);
    vec![
        (
            "radio",
            format!(
                "{:.3} GHz, {} dBm at 1 m, exponent {}, Rician K {}, packets ±{} dB, objects up to {} dB",
                radio.frequency_hz * 1e-9,
                radio.p0_dbm,
                radio.exponent,
                radio.rician_k,
                radio.packet_sd_db,
                radio.object_limit_db
            ),
        ),
        (
            "reception",
            format!(
                "half lost at {} dBm, slope {} dB; slot {:?}, channel {}, power {} dBm",
                radio.sensitivity_dbm, radio.sensitivity_slope_db, radio.slot, radio.channel, radio.power_dbm
            ),
        ),
        (
            "bus",
            format!(
                "delay {:?} + up to {:?}, {} % lost, {} % doubled, {} partitions",
                bus.delay,
                bus.jitter,
                bus.drop_share * 100.0,
                bus.duplicate_share * 100.0,
                bus.partitions.len()
            ),
        ),
    ]
}

fn fault_line(fault: &Fault) -> Line {
    let kind = match fault.kind {
        FaultKind::Bus => "no bus".to_owned(),
        FaultKind::Radio => "no radio".to_owned(),
        FaultKind::Restart => "restart".to_owned(),
        FaultKind::Dead => "software dead".to_owned(),
        FaultKind::Sensor => "no range sensor".to_owned(),
        FaultKind::Gps => "no satellites".to_owned(),
        FaultKind::Battery(charge) => format!("charge of {} %", charge * 100.0),
    };
    let until = if fault.until == Time::NEVER { String::new() } else { format!(" to {}", fault.until) };
    let whom: Vec<String> = fault.vehicles.iter().map(ToString::to_string).collect();
    ("fault", format!("{kind} from {}{until}, vehicles {}", fault.from, whom.join(" ")))
}

/// Describes when a vehicle acts on its own.
pub(super) fn alone_line(safety: &Safety) -> Line {
    (
        "on its own",
        format!(
            "returns after {:?} without bus or below {} % of charge, stays below {} %",
            safety.autonomy,
            safety.battery_return * 100.0,
            safety.battery_hold * 100.0
        ),
    )
}

/// Describes how a sweep is driven, and whether an empty one is driven first.
pub(super) fn sweep_line(sweep: &Sweep, is_empty_first: bool) -> Line {
    let planner = match sweep.planner {
        Planner::RotatingGap => "rotating gap",
        Planner::Fan => "fan",
        Planner::Calibrate => "calibration",
        Planner::FanCorners => "fan from the corners",
        Planner::FanStraight => "straight fan",
    };
    let laps = sweep.laps.map_or("the planner's laps".to_owned(), |laps| format!("{laps} laps"));
    let first = if is_empty_first { ", an empty sweep first" } else { "" };
    let text = format!(
        "{planner} over {} positions, {laps}, dwell {:?} to {:?}{first}",
        sweep.positions, sweep.dwell, sweep.dwell_limit
    );
    ("sweep", text)
}

/// Describes how images are made.
pub(super) fn imaging_lines(imaging: &Imaging) -> Vec<Line> {
    vec![
        (
            "image",
            format!(
                "{} × {} pixels, weights {:?} (width {} m), solver {:?}, bins of {} m",
                imaging.columns,
                imaging.rows,
                imaging.weights,
                imaging.width_m,
                imaging.solver,
                imaging.bin_m
            ),
        ),
        (
            "priors",
            format!(
                "changes {} dB/m over {} m, structure {} dB/m over {} m",
                imaging.prior.sigma_db_per_m,
                imaging.prior.correlation_length_m,
                imaging.structure_prior.sigma_db_per_m,
                imaging.structure_prior.correlation_length_m
            ),
        ),
        (
            "peaks",
            format!(
                "up to {}, {} m from the rim, {} m apart; links from {} m",
                imaging.peaks, imaging.rim_m, imaging.peak_separation_m, imaging.min_link_m
            ),
        ),
    ]
}

fn end_lines(sim: &Sim) -> Vec<Line> {
    let durations = &sim.durations;
    vec![
        (
            "thinking",
            format!(
                "imager {:?}, planner {:?}, route {:?}",
                durations.imager, durations.planner, durations.route
            ),
        ),
        ("end", format!("{:?} after at most {:?}; seed {}", sim.end, sim.until, sim.seed)),
        ("expected", format!("{:?}", sim.expect).to_lowercase()),
    ]
}

/// Writes a place of the plane.
pub(super) fn place(point: &Point) -> String {
    format!("({}, {})", point.x_m, point.y_m)
}
