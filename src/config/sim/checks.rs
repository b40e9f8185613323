//! What the keys of a simulation must obey together: that vehicles see before they drive, that places lie where they
//! may, that homes are free. Nothing is read here.

use tomoswarm_proto::TaskKind;

use super::super::mission::{PlannerChoice, SMALLEST_GAP, SweepConfig};
use super::super::scene::Person;
use super::super::section::Section;
use super::super::venue::Venue;
use super::Sim;
use crate::geom::{Point, Segment, WORST_DEVIATIONS};
use crate::plan::{ContactLimits, SOUND_MPS, SensingLimits, SmallestPost, SpeedError, echo_time_s};

/// Refuses a speed at which a vehicle could not stop within what it surely sees.
pub(super) fn check_look_before_you_drive(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "range", "safety"]) {
        // What wind adds is judged by itself.
        refuse_blind_speed(
            root,
            &sim.sensing_limits_in_still_air(),
            sim.vehicles.body.max_speed_mps,
            "vehicles.max_speed_mps",
        );
        refuse_uncovered_radius(
            root,
            sim.contact_limits(),
            sim.range.look.smallest_radius_m,
            sim.vehicles.body.max_speed_mps,
        );
    }
}

/// Refuses a speed at which a vehicle could not stop within what it surely sees; `key` names the speed.
pub(in crate::config) fn refuse_blind_speed(
    root: &Section,
    sight: &SensingLimits,
    speed_mps: f64,
    key: &str,
) {
    let Err(error) = sight.allow(speed_mps) else {
        return;
    };
    let (key, allowed) = match error {
        SpeedError::NoRoom { .. } => (
            "range.sure_range_m",
            "see farther, or lower radius_m, padding_m, pose_sd_m or cell_m",
        ),
        SpeedError::TooFast { .. } | SpeedError::Value { .. } => (
            key,
            "lower max_speed_mps, brake harder, scan faster or with fewer beams, or see farther",
        ),
    };
    root.source.refuse(
        key,
        &format!("the vehicle cannot look before it drives: {error}"),
        allowed,
    );
}

/// Returns the thinnest post that a vehicle of this speed does not touch: the named one, or else what the speed covers.
pub(in crate::config) fn smallest_post(
    limits: ContactLimits,
    named_m: Option<f64>,
    speed_mps: f64,
) -> Option<SmallestPost> {
    match named_m {
        Some(radius_m) => limits
            .covers(radius_m, speed_mps)
            .then(|| limits.post(radius_m)),
        None => limits.smallest(speed_mps),
    }
}

/// Refuses a named radius of posts that must not be touched when the speed does not cover it; `None` for the limits of a
/// sensor that promises nothing.
pub(in crate::config) fn refuse_uncovered_radius(
    root: &Section,
    limits: Option<ContactLimits>,
    named_m: Option<f64>,
    speed_mps: f64,
) {
    let Some(radius_m) = named_m else {
        return;
    };
    let key = "range.smallest_radius_m";
    let Some(limits) = limits else {
        let wrong = "is not promised by a beam: it passes by what is thin";
        let allowed = "leave it out, or listen in a fan or a cone";
        root.source.refuse(key, wrong, allowed);
        return;
    };
    if limits.covers(radius_m, speed_mps) {
        return;
    }
    let wrong = format!(
        "is not covered at {speed_mps} m/s: a post of this radius is heard up to {:.2} m, and {:.2} m are needed",
        limits.post(radius_m).heard_m,
        limits.needed_m(speed_mps),
    );
    let slower = match limits.highest_speed_mps(radius_m).map(floored) {
        Some(highest_mps) if highest_mps > 0.0 => format!("at most {highest_mps} m/s"),
        Some(_) | None => "no speed".to_owned(),
    };
    let thicker = match limits.smallest(speed_mps) {
        Some(post) => format!("at least {} m", -floored(-post.radius_m)),
        None => "no radius".to_owned(),
    };
    let allowed = format!("{slower} is allowed for this radius, {thicker} at this speed");
    root.source.refuse(key, &wrong, &allowed);
}

/// Rounds down to thousandths.
pub(in crate::config) fn floored(number: f64) -> f64 {
    (number * 1000.0).floor() / 1000.0
}

pub(super) fn check_margins(root: &Section<'_>, sim: &Sim) {
    let (fleet, swarm) = (&sim.vehicles, &sim.venue.swarm);
    let are_sound = root
        .source
        .is_sound(&["vehicles.radius_m", "safety.separation_m"]);
    if are_sound && swarm.separation_m <= 2.0 * fleet.body.radius_m {
        let wrong = "lets two vehicles touch: it is measured from middle to middle";
        root.source.refuse(
            "safety.separation_m",
            wrong,
            "more than two vehicles.radius_m is allowed",
        );
    }
    let are_sound = root
        .source
        .is_sound(&["vehicles.pose_sd_m", "safety.pose_sd_max_m"]);
    if are_sound && fleet.pose_sd_m > swarm.pose_sd_max_m {
        let wrong = "is above safety.pose_sd_max_m: nothing would ever be measured";
        root.source.refuse(
            "vehicles.pose_sd_m",
            wrong,
            "at most pose_sd_max_m is allowed",
        );
    }
}

/// Refuses a sensor of which the next reading is asked for before an echo from its farthest has come: nothing would ever be
/// known to be free.
pub(super) fn check_echoes(root: &Section, sim: &Sim) {
    let look = &sim.range.look;
    if !root.source.is_sound(&["range"]) {
        return;
    }
    let listens_s = look.scan_period_s - look.settle_s;
    let echo_s = echo_time_s(look.max_range_m, SOUND_MPS);
    if echo_s <= listens_s {
        return;
    }
    let wrong = format!(
        "is heard after {echo_s:.3} s, and the next reading begins after {listens_s:.3} s: an empty look would say nothing"
    );
    let most_m = (listens_s / echo_time_s(1.0, SOUND_MPS) * 10.0).floor() / 10.0;
    let allowed = format!(
        "at most {most_m:.1} m is allowed, or a longer scan_period_s, or a shorter settle_s"
    );
    root.source.refuse("range.max_range_m", &wrong, &allowed);
}

/// Refuses a sensor that sees nothing of what is just beside the body: that ground stays unknown, and who drives over known
/// ground alone does not get away.
pub(super) fn check_near_ground(root: &Section, sim: &Sim) {
    let stays = matches!(sim.task, Some(TaskKind::Browse | TaskKind::Stored { .. }));
    let (radius_m, nearest_m) = (sim.vehicles.body.radius_m, sim.range.look.min_range_m);
    if stays
        || nearest_m <= radius_m
        || !root
            .source
            .is_sound(&["vehicles", "range", "venue", "mission"])
    {
        return;
    }
    let wrong = format!(
        "leaves ground just beside a body with a radius of {radius_m} m unseen: a vehicle does not get away from where it stands"
    );
    let allowed = format!("at most {radius_m} m is allowed for this radius");
    root.source.refuse("range.min_range_m", &wrong, &allowed);
}

/// Refuses a wind that would carry copters over the fence at home or on the ring, into each other, or past what they
/// surely see; says the wind that can be flown in.
pub(super) fn check_wind(root: &Section, sim: &Sim) {
    let wind_mps = sim.vehicles.flight.wind_mps;
    let tables = ["vehicles", "range", "safety", "sweep", "venue"];
    if sim.vehicles.flight.carried_m() <= 0.0 || !root.source.is_sound(&tables) {
        return;
    }
    let mut other = sim.clone();
    let mut can_fly_in = |wind_mps: f64| {
        other.vehicles.flight.wind_mps = wind_mps;
        can_fly(&other)
    };
    // What cannot be flown without wind was refused for another reason.
    if can_fly_in(wind_mps) || !can_fly_in(0.0) {
        return;
    }
    let tenths = (wind_mps * 10.0) as u32;
    let most = (0..=tenths).rev().map(|tenth| f64::from(tenth) / 10.0);
    let most_mps = most.into_iter().find(|mps| can_fly_in(*mps)).unwrap_or(0.0);
    let wrong = format!(
        "carries copters {:.2} m aside: more than their place, separation and sensors leave room for",
        sim.vehicles.flight.carried_m()
    );
    let allowed = format!("at most {most_mps:.1} m/s can be flown in here");
    root.source.refuse("vehicles.wind_mps", &wrong, &allowed);
}

/// Returns whether copters can fly in their wind.
fn can_fly(sim: &Sim) -> bool {
    let Sim {
        venue, vehicles, ..
    } = sim;
    let (body, carried_m) = (&vehicles.body, vehicles.flight.carried_m());
    let reach_m = room_at_fence_m(sim) + carried_m;
    let mut homes = venue.homes.iter().take(vehicles.count);
    let area = venue.area.polygon();
    let has_ring = !sim.is_planned_by_ground()
        || area
            .edges()
            .all(|side| venue.fence.contains_corridor(side, reach_m));
    has_ring
        && homes.all(|home| venue.fence.contains_disc(*home, reach_m))
        && venue.swarm.separation_m > 2.0 * body.radius_m + carried_m
        && sim.sensing_limits().allow(body.max_speed_mps).is_ok()
}

/// Checks the venue and the scene against the vehicles.
pub(super) fn check_places(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "safety", "sweep"]) {
        check_homes(root, sim);
        if sim.is_planned_by_ground() {
            check_ring(root, sim);
        }
    }
    let vehicles = &sim.vehicles;
    let body_m =
        vehicles.body.radius_m + vehicles.flight.carried_m() + place_off_m(vehicles.pose_sd_m);
    check_task(root, sim.task.as_ref(), &sim.venue, body_m);
    if sim.mission.is_of_one() && sim.vehicles.count != 1 {
        let allowed = "count = 1 is needed for a mission that one autopilot carries out";
        let key = match root.source.is_known("vehicles.count") {
            true => "vehicles.count",
            false => "mission.kind",
        };
        root.refuse(key, "are too many for a stored mission", allowed);
    }
    let Some(random) = sim.scene.random_persons else {
        return;
    };
    let inner = sim.venue.area.shrunk(random.keep_from_border_m);
    let room_m2 = inner.width_m() * inner.height_m();
    // Discs of half the distance cover at least this share of the room when no more fit (jamming).
    let taken_m2 =
        random.count as f64 * random.apart_m * random.apart_m * std::f64::consts::FRAC_PI_4;
    if random.count > 0
        && (inner.width_m() <= 0.0 || inner.height_m() <= 0.0 || taken_m2 > 0.5 * room_m2)
    {
        let wrong = format!(
            "{} random persons do not fit into the area of the venue",
            random.count
        );
        root.refuse(
            "scene",
            &wrong,
            "fewer persons or smaller distances are needed in [random_persons]",
        );
    }
}

fn room_at_fence_m(sim: &Sim) -> f64 {
    let vehicles = &sim.vehicles;
    vehicles.body.radius_m + padding_at_fence_m(sim.safety.padding_m, vehicles.pose_sd_m)
}

/// Returns the room that a body is meant to have at the fence, metres: its padding, or what its place may be off if that is
/// more. Wind is not counted.
pub(in crate::config) fn padding_at_fence_m(padding_m: f64, pose_sd_m: f64) -> f64 {
    padding_m.max(place_off_m(pose_sd_m))
}

/// Returns by how much a place of this deviation may be off at most, metres: three deviations.
pub(in crate::config) fn place_off_m(pose_sd_m: f64) -> f64 {
    WORST_DEVIATIONS * pose_sd_m
}

fn check_homes(root: &Section, sim: &Sim) {
    let (count, homes) = (sim.vehicles.count, &sim.venue.homes);
    if homes.len() < count {
        let wrong = format!("the venue has {} homes for {count} vehicles", homes.len());
        root.source.refuse(
            "vehicles.count",
            &wrong,
            "at most one vehicle per home is allowed",
        );
        return;
    }
    let apart_m = sim.venue.swarm.separation_m;
    let reach_m = room_at_fence_m(sim);
    for (index, home) in homes.iter().take(count).enumerate() {
        if !sim.venue.fence.contains_disc(*home, reach_m) {
            let wrong = format!(
                "home {} is nearer than {reach_m:.2} m to the fence",
                index + 1
            );
            root.refuse(
                "venue",
                &wrong,
                "a vehicle, its padding and three deviations of its place must fit at home",
            );
        }
        check_nobody_at_home(root, sim, index, *home);
        let is_near = |other: &&Point| other.distance_to(*home) < apart_m;
        if homes.iter().take(index).any(|other| is_near(&other)) {
            let wrong = format!(
                "home {} is nearer than {apart_m:.2} m to another",
                index + 1
            );
            root.refuse("venue", &wrong, "homes must be separation_m apart");
        }
    }
}

/// Refuses persons who stand at a home or walk over it; homes are counted from 0.
fn check_nobody_at_home(root: &Section, sim: &Sim, index: usize, home: Point) {
    let persons = sim.scene.persons.iter().zip(&sim.lines.persons);
    for (person, line) in persons {
        let room_m = sim.vehicles.body.radius_m + sim.safety.padding_m + person.radius_m;
        let does = if person.at.distance_to(home) < room_m {
            "stands"
        } else if walked_within_m(person, home) < room_m {
            "walks"
        } else {
            continue;
        };
        let wrong = format!(
            "{} ({line}) {does} in the way of vehicle {} at its home",
            person.name,
            index + 1
        );
        let allowed = format!(
            "vehicles and persons must stand and walk apart, {room_m:.2} m from ({}, {}) at least",
            home.x_m, home.y_m
        );
        root.refuse("scene", &wrong, &allowed);
    }
}

/// Returns how near a person comes to a place on its walk, metres; infinite for one who stands still.
fn walked_within_m(person: &Person, place: Point) -> f64 {
    let from = std::iter::once(&person.at).chain(&person.path);
    let pieces = from
        .zip(&person.path)
        .map(|(from, to)| Segment::new(*from, *to));
    let distances = pieces.map(|piece| piece.distance_to_point(place));
    distances.fold(f64::INFINITY, f64::min)
}

/// Refuses a mission that leads out of the fence, or nearer to it than a vehicle's body needs.
pub(in crate::config) fn check_task(
    root: &Section,
    task: Option<&TaskKind>,
    venue: &Venue,
    body_m: f64,
) {
    let places = task.map(TaskKind::places).unwrap_or_default();
    let mut places = places.into_iter().map(Point::from);
    let Some(at) = places.find(|place| !venue.fence.contains_disc(*place, body_m)) else {
        return;
    };
    let (place, edge_m) = (
        format!("({}, {})", at.x_m, at.y_m),
        venue.fence.distance_to_edge(at),
    );
    let wrong = match venue.fence.contains(at) {
        false => format!("leads to {place}, outside the fence of the venue"),
        true => format!(
            "leads to {place}, {edge_m:.2} m from the fence, where a vehicle whose place may be off needs {body_m:.2} m"
        ),
    };
    let key = ["mission.waypoints_m", "mission.size_m", "mission"];
    let key = key
        .into_iter()
        .find(|key| root.source.is_known(key))
        .unwrap_or("mission");
    root.source
        .refuse(key, &wrong, "places inside the fence are allowed");
}

pub(super) fn check_ring(root: &Section, sim: &Sim) {
    check_border(root, &sim.venue, room_at_fence_m(sim));
    check_gaps(
        root,
        &sim.venue,
        &sim.sweep,
        sim.vehicles.count,
        sim.venue.swarm.separation_m,
    );
}

/// Refuses a fence that leaves less room around the area than a vehicle needs.
pub(in crate::config) fn check_border(root: &Section, venue: &Venue, reach_m: f64) {
    let corners = venue.area.corners();
    let mut sides = corners.iter().zip(corners.iter().cycle().skip(1));
    if !sides.all(|(from, to)| {
        venue
            .fence
            .contains_corridor(Segment::new(*from, *to), reach_m)
    }) {
        let wrong = format!("its fence leaves less than {reach_m:.2} m around the area");
        root.refuse(
            "venue",
            &wrong,
            "vehicles drive along the area's border and need their radius, their padding and three deviations of their place",
        );
    }
}

/// Refuses a ring on which the smallest gap between two vehicles is under their separation.
pub(in crate::config) fn check_gaps(
    root: &Section,
    venue: &Venue,
    sweep: &SweepConfig,
    vehicles: usize,
    apart_m: f64,
) {
    let around_m = 2.0 * (venue.area.width_m() + venue.area.height_m());
    let gap_m = around_m / sweep.positions as f64 * SMALLEST_GAP as f64;
    if sweep.planner == PlannerChoice::RotatingGap && vehicles > 1 && gap_m < apart_m {
        let wrong = format!(
            "puts {SMALLEST_GAP} steps into {gap_m:.2} m, under the separation of {apart_m:.2} m"
        );
        root.source.refuse(
            "sweep.positions",
            &wrong,
            "fewer positions or a larger area are needed",
        );
    }
}
