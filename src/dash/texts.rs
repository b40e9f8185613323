//! What is shown of each subject as text, of the types of [`super::told`]. Plain translation: it judges nothing but who is
//! silent.
//!
//! What nodes say of themselves is passed on as it is; the page shows it as text only.

use std::collections::VecDeque;

use tomoswarm_proto::{
    AutopilotHealth, Covariance, EmergencyStop, Find, Health, Image, ImageSubject, MissionProgress,
    Permille, Plan, Position, State, StopId, StopScope, VehicleId,
};

use super::board::Board;
use super::events::Event;
use super::marks::{GivenMark, MarkState};
use super::newest_image::EarlierFinds;
use super::orders::GivenOrder;
use super::outbox::Shown;
use super::records::{MODES, STANDS_UNDER, subject_number};
use super::timetable::{SHOWN_SPEED_MPS, Timetable};
use super::told::{
    At, DeclaredMission, EarlierImage, Ellipse, Events, Fate, Ground, ImageFinds, KnownMark,
    Marker, Markers, Marks, Moment, OpenStop, Orders, Place, ProgressRow, Showing, StopName,
    TimetableRow, ToldEvent, ToldFind, ToldMark, ToldOrder, ToldPlan, ToldProgress, ToldRun,
    ToldStop, ToldTimetable, ToldTrack, ToldVehicle, TruePerson, Truth, VehicleHealth,
    VehicleMission, Way, Welcome, as_text,
};
use crate::config::{GivenMission, Venue};
use crate::geom::{Point, Polygon, Rect};
use crate::operator::given_marks::MarkOutcome;
use crate::operator::names::{control, kind_name, mission_phase, mode, ordered, phase, run_end};
use crate::operator::outcome::{OrderOutcome, VehicleOutcome};
use crate::scene::{Outline, Person};
use crate::sweep::ExpectedStop;
use crate::time::Time;
use crate::tomo::ImagingSettings;

/// Returns what holds for the whole connection of any page, of a run of which no truth is known.
pub fn place(venue: &Venue, showing: Showing) -> Place {
    let colour = |id| crate::draw::vehicle_colour(VehicleId(id)).rgb;
    let missions = GivenMission::declared().map(|(kind, keys)| DeclaredMission { kind, keys });
    Place {
        showing,
        venue: venue.name.clone(),
        cell_m: venue.cell_m,
        slices_m: venue.slice_borders_m.clone(),
        x_axis_deg: venue.x_axis_bearing_deg,
        area: [point(venue.area.min), point(venue.area.max)],
        fence: venue.fence.corners().iter().map(|at| point(*at)).collect(),
        homes: venue.homes.iter().map(|at| point(*at)).collect(),
        modes: MODES.iter().map(|of| mode(*of)).collect(),
        stands_under: STANDS_UNDER.to_vec(),
        vehicle_colours: (1..=8).map(colour).collect(),
        heat: crate::draw::heat_colours(),
        missions: missions.collect(),
        truth: None,
        sensors: None,
        ghost: None,
    }
}

/// Returns the first text of the connection of a page: also what there is for its first picture.
pub fn welcome(place: &Place, board: &Board, page: u32, may_order: bool) -> String {
    let subjects = [ImageSubject::Structure, ImageSubject::Change];
    let images = subjects.into_iter().filter(|of| board.image(*of).is_some());
    as_text(&Welcome {
        place: place.clone(),
        page,
        may_order,
        tiles: board.map().addresses().count(),
        images: images.map(subject_number).collect(),
    })
}

/// Returns what truly stands in the scene of a simulation: outlines at antenna height, and persons.
pub fn truth(outlines: &[Outline], persons: &[Person]) -> Truth {
    let border = |of: &Polygon| of.corners().iter().map(|at| point(*at)).collect();
    let polygons = outlines
        .iter()
        .flat_map(|of| std::iter::once(&of.polygon).chain(&of.holes));
    let person = |of: &Person| TruePerson {
        name: of.name.clone(),
        at: point(of.at),
        radius_m: of.radius_m,
    };
    Truth {
        outlines: polygons.map(border).collect(),
        persons: persons.iter().map(person).collect(),
    }
}

/// Returns what was found in the newest image, and in those before it.
pub fn finds(board: &Board, subject: ImageSubject) -> Option<String> {
    let newest = board.image(subject)?;
    let image: &Image = newest.parts.get(&0)?;
    let deviation_m = |covariance: Covariance| {
        let most = covariance.xx_mm2.max(covariance.yy_mm2);
        libm::sqrt(f64::from(most)) / 1000.0
    };
    let find = |find: &Find| ToldFind {
        at: position(find.at),
        sd_m: find.covariance.map(deviation_m),
        ellipse: find.covariance.map(ellipse),
        strength_dbpm: f64::from(find.strength_udb_per_m) / 1e6,
        probability: find.probability.map(|share| share.fraction()),
    };
    let earlier = |of: &EarlierFinds| EarlierImage {
        at_s: tenths(of.at.as_secs_f64()),
        run: of.run.0,
        laps: of.laps,
        finds: of.finds.iter().map(find).collect(),
    };
    Some(as_text(&ImageFinds {
        subject: subject_number(subject),
        run: image.run.0,
        sequence: image.sequence,
        laps: image.laps,
        at_s: tenths(newest.begun.as_secs_f64()),
        prior_sd_dbpm: prior_sd_dbpm(image),
        finds: image.finds.iter().map(find).collect(),
        earlier: newest.earlier.iter().map(earlier).collect(),
    }))
}

/// Returns how uncertain each pixel was before all measuring, dB/m: the deviation of the prior by which the solver `auto`, and
/// all that have none of their own, tell that of their images. `map` believes no more of a change.
fn prior_sd_dbpm(image: &Image) -> f64 {
    let corner = |at: Position| Point::new(at.x_m(), at.y_m());
    let area = Rect::new(corner(image.area.least), corner(image.area.greatest));
    libm::sqrt(ImagingSettings::prior_for(area).variance)
}

/// Returns the ellipse of one standard deviation: half its axes, and how far the longer one is turned from the x axis.
fn ellipse(covariance: Covariance) -> Ellipse {
    let [xx, xy, yy] = [
        f64::from(covariance.xx_mm2),
        f64::from(covariance.xy_mm2),
        f64::from(covariance.yy_mm2),
    ];
    let (middle, half) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
    let away = libm::hypot(half, xy);
    let metres = |variance: f64| libm::sqrt(variance.max(0.0)) / 1000.0;
    Ellipse {
        major_m: metres(middle + away),
        minor_m: metres(middle - away),
        angle_rad: libm::atan2(xy, half) / 2.0,
    }
}

/// Returns how a vehicle fares.
pub fn vehicle(board: &Board, id: VehicleId) -> Option<String> {
    let seen = board.view().vehicle(id)?;
    let state = seen.state.as_ref().map(|state| &state.value);
    let mission = seen.mission.as_ref().map(|mission| &mission.value);
    let health = seen.health.as_ref().map(|health| &health.value);
    let hello = seen.hello.as_ref().map(|hello| &hello.value);
    let misfit = board
        .view()
        .misfit(tomoswarm_proto::Sender::Vehicle(id), board.venue_hash());
    let mission = mission.map(|mission| VehicleMission {
        kind: mission.kind.word(),
        phase: mission_phase(mission.phase),
        share: mission.share.map(|share| shown_share(share).fraction()),
        end: mission.end.map(|end| end.to_string()),
        is_at_home: mission.is_at_home,
    });
    let autopilot = |of: &AutopilotHealth| format!("{:?} {}", of.family, of.firmware);
    let health = health.map(|health| VehicleHealth {
        lost: health.samples_lost.to_string(),
        hears: ids(&health.hears),
        troubles: health.troubles.clone(),
        autopilot: health.autopilot.as_ref().map(autopilot),
    });
    Some(as_text(&ToldVehicle {
        id: id.0,
        name: hello.map(|hello| hello.name.clone()),
        software: hello.map(|hello| hello.software.clone()),
        misfit: misfit.map(|misfit| misfit.to_string()),
        boot: state.map(|state| state.boot.0),
        run: state.map(|state| state.accepted.0.0),
        revision: state.map(|state| state.accepted.1.0),
        ordered: state.map(|state| ordered(state.ordered)),
        control: state.map(|state| control(state.control)),
        mission,
        health,
    }))
}

/// Returns what is shown of a mission in its vehicle's row.
pub(super) fn shown_of_mission(mission: &MissionProgress) -> MissionProgress {
    MissionProgress {
        vehicle: mission.vehicle,
        kind: mission.kind,
        phase: mission.phase,
        share: mission.share.map(shown_share),
        end: mission.end,
        is_at_home: mission.is_at_home,
        ..MissionProgress::default()
    }
}

/// Returns how much of a mission is done, in whole percents: what is not wholly done is not 100.
fn shown_share(share: Permille) -> Permille {
    Permille(share.0 / 10 * 10)
}

/// Returns what is shown of a vehicle's health in its row, but for what its records say.
pub(super) fn shown_of_health(health: &Health) -> Health {
    let autopilot = health.autopilot.as_ref();
    Health {
        vehicle: health.vehicle,
        samples_lost: health.samples_lost,
        hears: health.hears.clone(),
        troubles: health.troubles.clone(),
        autopilot: autopilot.map(|of| AutopilotHealth {
            family: of.family,
            firmware: of.firmware.clone(),
            ..AutopilotHealth::default()
        }),
        ..Health::default()
    }
}

/// Returns the corners of the way that a vehicle is committed to, without the first: that is where it is, which its records
/// say ten times a second.
pub fn corners_ahead(state: &State) -> Option<&[Position]> {
    let leg = state.leg.as_ref()?;
    Some(leg.route.get(1..).unwrap_or_default())
}

/// Returns the way that a vehicle is committed to, or that it is to none.
pub fn way(board: &Board, id: VehicleId) -> Option<String> {
    let state = &board.view().state(id)?.value;
    let ahead = corners_ahead(state).map(route);
    Some(as_text(&Way { id: id.0, ahead }))
}

/// Returns the plan of a vehicle.
pub fn plan(board: &Board, id: VehicleId) -> Option<String> {
    let plan = board.plan(id)?;
    let stop = |stop: &tomoswarm_proto::Stop| ToldStop {
        id: stop.id.0,
        at: position(stop.at),
        route: route(&stop.route),
        after: stop.after.iter().map(name_of_stop).collect(),
    };
    Some(as_text(&ToldPlan {
        id: id.0,
        run: plan.run.0,
        revision: plan.revision.0,
        start: position(plan.start),
        stops: plan.stops.iter().map(stop).collect(),
    }))
}

/// Returns where a vehicle has been, in centimetres: x and y in turn.
pub fn track(board: &Board, id: VehicleId) -> Option<String> {
    let places = board.track(id)?.places().iter();
    Some(as_text(&ToldTrack {
        id: id.0,
        places_cm: places.flat_map(|at| [at.x_mm / 10, at.y_mm / 10]).collect(),
    }))
}

/// Returns the plans against time: for each vehicle its stops with what each waits for and when it is expected, and the
/// chain that takes longest. It is long, and changes with the plans alone.
pub fn timetable(board: &Board) -> String {
    let row = |(plan, expected): (&Plan, &[ExpectedStop])| {
        let times = expected
            .iter()
            .map(|stop| [tenths(stop.ready_s), tenths(stop.done_s)]);
        let after = plan
            .stops
            .iter()
            .map(|stop| stop.after.iter().map(name_of_stop).collect());
        TimetableRow {
            vehicle: plan.vehicle.0,
            stops: plan.stops.iter().map(|stop| stop.id.0).collect(),
            after: after.collect(),
            times_s: times.collect(),
        }
    };
    let table = board.timetable();
    let edition = table.and_then(edition_of);
    let chain = table.map(Timetable::longest_chain).unwrap_or_default();
    as_text(&ToldTimetable {
        run: edition.map(|(run, _)| run),
        revision: edition.map(|(_, revision)| revision),
        speed_mps: SHOWN_SPEED_MPS,
        length_s: table.map_or(0.0, |table| tenths(table.length_s())),
        chain: chain.iter().map(name_of_stop).collect(),
        rows: table.map_or(Vec::new(), |table| table.rows().map(row).collect()),
    })
}

/// Returns how far vehicles are in the plans against time, and who waits for whom now; `None` while there are none.
pub fn progress(board: &Board) -> Option<String> {
    let table = board.timetable()?;
    let progress = board.progress();
    let row = |(plan, _): (&Plan, &[ExpectedStop])| {
        let said = progress.get(&plan.vehicle);
        let said = said.filter(|said| (said.run, said.revision) == (plan.run, plan.revision));
        let waits_for = table.waits_for(plan.vehicle, &progress);
        ProgressRow {
            vehicle: plan.vehicle.0,
            is_followed: said.is_some(),
            done: said.and_then(|said| said.done).map(|stop| stop.0),
            leg: said.and_then(|said| said.leg).map(|stop| stop.0),
            waits_for: waits_for.iter().map(name_of_stop).collect(),
        }
    };
    let edition = edition_of(table);
    Some(as_text(&ToldProgress {
        run: edition.map(|(run, _)| run),
        revision: edition.map(|(_, revision)| revision),
        reached_s: tenths(table.reached_s(&progress)),
        rows: table.rows().map(row).collect(),
    }))
}

fn name_of_stop((of, stop): &(VehicleId, StopId)) -> StopName {
    (of.0, stop.0)
}

/// Returns the run and the revision of plans.
fn edition_of(table: &Timetable) -> Option<(u32, u32)> {
    let first = table.rows().next();
    first.map(|(plan, _)| (plan.run.0, plan.revision.0))
}

fn tenths(of: f64) -> f64 {
    (of * 10.0).round() / 10.0
}

/// Returns what happened behind an event, oldest first; `None` = nothing.
pub fn events(now: Time, board: &Board, after: u64) -> Option<String> {
    let event = |event: &Event| ToldEvent {
        number: event.number,
        age_s: tenths(now.since(event.at).as_secs_f64()),
        kind: event.kind.word(),
        vehicles: ids(&event.vehicles),
        text: event.text.clone(),
    };
    let events: Vec<ToldEvent> = board.events().after(after).map(event).collect();
    (!events.is_empty()).then(|| as_text(&Events { events }))
}

/// Returns which moment is shown, of which span; `is_anew`: everything comes anew; `is_whole`: all of that has come.
pub fn moment(shown: &Shown<'_>, is_anew: bool, is_whole: bool) -> String {
    as_text(&Moment {
        at_s: shown.at.as_secs_f64(),
        from_s: shown.span.0.as_secs_f64(),
        to_s: shown.span.1.as_secs_f64(),
        speed: shown.speed,
        is_anew,
        is_whole,
    })
}

/// Returns what is worth a mark behind a number, oldest first; `None` = nothing.
pub fn markers(all: &VecDeque<Event>, after: u64) -> Option<String> {
    let marker = |event: &Event| Marker {
        at_s: tenths(event.at.as_secs_f64()),
        kind: event.kind.word(),
        vehicles: ids(&event.vehicles),
        text: event.text.clone(),
    };
    let new = all.iter().filter(|event| event.number > after);
    let markers: Vec<Marker> = new.map(marker).collect();
    (!markers.is_empty()).then(|| as_text(&Markers { markers }))
}

/// Returns how the ground station fares; of several that of the greatest lease.
pub fn ground(now: Time, board: &Board) -> String {
    let newest = board
        .view()
        .grounds()
        .max_by_key(|report| (board.view().ground(now) == Some(*report), report.at));
    let Some(newest) = newest else {
        return as_text(&Ground::default());
    };
    let report = &newest.value;
    let run = |run: &tomoswarm_proto::RunReport| ToldRun {
        run: run.run.0,
        kind: run.kind.word(),
        compared_with: run.compared_with.map(|run| run.0),
        end: run_end(run.end),
        samples: run.samples.to_string(),
        images: run.images,
    };
    as_text(&Ground {
        is_heard: true,
        age_s: newest.age(now).as_secs_f64(),
        lease: report.lease.number,
        phase: phase(report.phase),
        run: report.run.0,
        laps: report.laps,
        laps_done: report.laps_done,
        samples: report.samples.to_string(),
        images: report.images,
        expected: ids(&report.expected),
        members: ids(&report.members),
        lost: ids(&report.lost),
        in_force: report.in_force.map(kind_name),
        runs: report.runs.iter().map(run).collect(),
        troubles: report.troubles.clone(),
    })
}

/// Returns the open stops, the last orders with how they fared, and who has the seat.
pub fn orders(now: Time, board: &Board) -> String {
    let view = board.view();
    let vehicles: Vec<VehicleId> = view.vehicles().map(|(id, _)| id).collect();
    let stop = |stop: &EmergencyStop| {
        let concerned: Vec<VehicleId> = vehicles
            .iter()
            .filter(|id| stop.concerns(**id))
            .copied()
            .collect();
        let (shown, open): (Vec<VehicleId>, Vec<VehicleId>) = concerned
            .iter()
            .partition(|id| view.shows_stop(**id, stop.name));
        OpenStop {
            name: stop.name.to_string(),
            is_many: stop.name.is_many(),
            vehicle: match stop.scope {
                StopScope::All => None,
                StopScope::One(id) => Some(id.0),
            },
            by: stop.by.0,
            shown: ids(&shown),
            not_shown: ids(&open),
        }
    };
    let orders = board.orders().given.iter();
    as_text(&Orders {
        is_linked: board.is_linked(),
        stops: view.open_stops().iter().map(stop).collect(),
        orders: orders.map(|order| given(now, order)).collect(),
        seat: board.orders().seat.map(|page| page.0),
        lease: view.lease(now).number,
    })
}

fn given(now: Time, order: &GivenOrder) -> ToldOrder {
    let outcome = order.outcome.as_ref();
    let refused = outcome.and_then(|outcome| outcome.refused);
    let mission = order.request.mission.as_ref();
    ToldOrder {
        number: order.number,
        what: order.request.order.word(),
        mission: mission.map(|said| said.kind.clone()),
        vehicles: order.request.vehicles.iter().copied().collect(),
        page: order.request.page,
        age_s: now.since(order.at).as_secs_f64(),
        is_over: outcome.is_some(),
        is_done: outcome.is_some_and(OrderOutcome::is_done),
        refused: refused.map(|why| why.to_string()),
        fates: outcome.map(fates),
    }
}

/// Returns where somebody truly stands, and how the last marks of pages fared.
pub fn marks(now: Time, board: &Board) -> String {
    let known = board.marks().known().map(|(run, at, state)| {
        let state = match state {
            MarkState::Stored => "stored",
            MarkState::Asked => "asked",
            MarkState::TakingBack => "taking back",
        };
        KnownMark {
            run: run.0,
            at: position(at),
            state,
        }
    });
    let given = |given: &GivenMark| ToldMark {
        number: given.number,
        at: position(given.request.place()),
        run: given.request.run,
        take_back: given.request.take_back,
        page: given.request.page,
        age_s: now.since(given.at).as_secs_f64(),
        is_over: given.outcome.is_some(),
        is_done: matches!(given.outcome, Some(MarkOutcome::Stored(_))),
        words: given.outcome.as_ref().map(MarkOutcome::to_string),
    };
    as_text(&Marks {
        marks: known.collect(),
        given: board.marks().given.iter().map(given).collect(),
    })
}

/// Returns what became of an order, in one line: by which lease it was given, and its fate for each vehicle.
pub fn outcome_in_words(outcome: &OrderOutcome) -> String {
    if let Some(refused) = outcome.refused {
        return format!("refused, {refused}");
    }
    let fate = |(id, of): (&VehicleId, &VehicleOutcome)| format!("{id} {of}");
    let fates: Vec<String> = outcome.vehicles.iter().map(fate).collect();
    let head = if outcome.is_done() {
        "done"
    } else {
        "NOT DONE"
    };
    let lease = outcome
        .lease
        .map_or(String::new(), |lease| format!(" by lease {}", lease.number));
    let fates = match fates.is_empty() {
        true => "nobody is heard".to_owned(),
        false => fates.join("; "),
    };
    format!("{head}{lease}: {fates}")
}

/// Returns what became of an order of a page, in one line for a log: what it was, for whom and of which page, by which lease, and
/// its fate for each vehicle.
pub fn order_in_words(board: &Board, number: u32, outcome: &OrderOutcome) -> String {
    let mut orders = board.orders().given.iter();
    let what = orders.find(|order| order.number == number).map(|order| {
        let whom: Vec<String> = order.request.vehicles.iter().map(u8::to_string).collect();
        let whom = match whom.is_empty() {
            true => "all".to_owned(),
            false => whom.join(", "),
        };
        let (word, page) = (order.request.order.word(), order.request.page);
        format!(" ({word} {whom}, by page {page})")
    });
    format!(
        "order {number}{} is over: {}",
        what.unwrap_or_default(),
        outcome_in_words(outcome)
    )
}

fn fates(outcome: &OrderOutcome) -> Vec<Fate> {
    let fate = |(id, of): (&VehicleId, &VehicleOutcome)| Fate {
        vehicle: id.0,
        is_done: of.is_done(),
        words: of.to_string(),
    };
    outcome.vehicles.iter().map(fate).collect()
}

fn ids(all: &[VehicleId]) -> Vec<u8> {
    all.iter().map(|id| id.0).collect()
}

fn point(at: Point) -> At {
    [at.x_m, at.y_m]
}

fn position(at: Position) -> At {
    [at.x_m(), at.y_m()]
}

fn route(places: &[Position]) -> Vec<At> {
    places.iter().map(|at| position(*at)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipse_has_the_axes_of_its_covariance() {
        let of = |xx_mm2, xy_mm2, yy_mm2| {
            let read = ellipse(Covariance {
                xx_mm2,
                xy_mm2,
                yy_mm2,
            });
            [read.major_m, read.minor_m, read.angle_rad]
        };
        let turn = std::f64::consts::FRAC_PI_4;
        for (read, expected) in [
            (of(90_000, 0, 40_000), [0.3, 0.2, 0.0]),
            (of(40_000, 0, 90_000), [0.3, 0.2, 2.0 * turn]),
            // 0.5 m along the diagonal and 0.1 m across it.
            (of(130_000, 120_000, 130_000), [0.5, 0.1, turn]),
            (of(130_000, -120_000, 130_000), [0.5, 0.1, -turn]),
            // What cannot be is flat, and no square root of less than nothing.
            (of(10_000, 20_000, 10_000), [0.173_205, 0.0, turn]),
        ] {
            for (one, other) in read.iter().zip(expected) {
                assert!((one - other).abs() < 1e-6, "{read:?} is not {expected:?}");
            }
        }
    }
}
