//! The envelope: what is refused whatever the mission says, and when a vehicle stops for a peer that moves. It commands
//! nothing but a stop.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::messages::{CommandRefusal, MoveCommand, SafetyEvent};
use super::stored_way::{all_ways, track_of, way_ahead};
use super::{Out, Vehicle};
use crate::autopilot::{Item, Telemetry};
use crate::geom::{Pose, Segment, Track};
use crate::node::peers::{Peer, keeps_clear};
use crate::time::Time;

/// Commands that were decided longer ago than this are too old to obey.
const COMMAND_AGE: Duration = Duration::from_secs(1);
/// A route begins at most this far from where the vehicle is, metres.
const ROUTE_START_M: f64 = 0.75;
/// A route may begin so far behind the vehicle, which drives on meanwhile, metres.
const BEHIND_M: f64 = 0.03;
/// Of what it lacks to the fence a vehicle gains this share on even terms with the way on which it leaves it.
const GAINED: f64 = 0.5;
/// What rounding may take of a distance, metres.
const DUST_M: f64 = 1e-9;

impl Vehicle {
    /// Checks a command against the envelope.
    ///
    /// # Errors
    /// Why it is not obeyed.
    pub(super) fn check(
        &self,
        now: Time,
        decided: Time,
        command: &MoveCommand,
    ) -> Result<(), CommandRefusal> {
        let route = match command {
            MoveCommand::Hold => return Ok(()),
            MoveCommand::Turn(heading) if !heading.radians().is_finite() => {
                return Err(CommandRefusal::NoRoute);
            }
            MoveCommand::Turn(_) => None,
            MoveCommand::Drive { route, .. } => {
                Some(track_of(route).ok_or(CommandRefusal::NoRoute)?)
            }
            MoveCommand::FollowStored { items, from } => {
                return self.check_stored(now, decided, items, *from);
            }
        };
        let telemetry = self.check_moving(now, decided, route.is_some())?;
        route.map_or(Ok(()), |route| {
            self.check_route(now, &route, telemetry.pose)
        })
    }

    /// Checks whether it may move at all.
    fn check_moving(
        &self,
        now: Time,
        decided: Time,
        goes_on: bool,
    ) -> Result<&Telemetry, CommandRefusal> {
        if now.since(decided) > COMMAND_AGE || self.orders.have_overtaken(decided) {
            return Err(CommandRefusal::Old);
        }
        if self.emergency.stands() {
            return Err(CommandRefusal::Emergency);
        }
        if let Some(refusal) = self.orders.restraint().refusal() {
            return Err(refusal);
        }
        if goes_on && self.settings.look.is_blind {
            return Err(CommandRefusal::Blind);
        }
        if self.take_over.stands() {
            return Err(CommandRefusal::NotInControl);
        }
        let telemetry = self.telemetry.fresh(now).ok_or(CommandRefusal::NoPose)?;
        if telemetry.pose.sd_m > self.settings.swarm.pose_sd_max_m {
            return Err(CommandRefusal::PoseUncertain);
        }
        Ok(telemetry)
    }

    /// Checks a mission that the autopilot is to carry out: all its ways lie inside the fence, also those that jumps lead, and
    /// the way to its next place keeps clear as a drive does; what it claims beyond that keeps clear of peers.
    fn check_stored(
        &self,
        now: Time,
        decided: Time,
        items: &[Item],
        from: usize,
    ) -> Result<(), CommandRefusal> {
        let pose = self.check_moving(now, decided, true)?.pose;
        let ahead = way_ahead(items, from, self.settings.home, pose.at);
        if let Some(first) = track_of(&ahead[..ahead.len().min(2)]) {
            self.check_route(now, &first, pose)?;
            // Nobody has planned it by the map.
            if self.reflex.may_be_in_the_way(now, &first, pose.at) {
                return Err(CommandRefusal::ReflexObstacle);
            }
        }
        let mut ways = all_ways(items, self.settings.home).into_iter();
        if !ways.all(|way| self.holds(&way, pose)) {
            return Err(CommandRefusal::Fence);
        }
        match track_of(&ahead) {
            Some(ahead) if !self.stays_inside(&ahead, pose) => Err(CommandRefusal::Fence),
            Some(ahead) => self.check_peers(&ahead, pose),
            None => Ok(()),
        }
    }

    fn check_route(&self, now: Time, route: &Track, pose: Pose) -> Result<(), CommandRefusal> {
        if route.start().distance_to(pose.at) > ROUTE_START_M {
            return Err(CommandRefusal::NotHere);
        }
        if !self.stays_inside(route, pose) {
            return Err(CommandRefusal::Fence);
        }
        if self.reflex.is_in_the_way(now, route, pose.at) {
            return Err(CommandRefusal::ReflexObstacle);
        }
        self.check_peers(route, pose)
    }

    fn check_peers(&self, route: &Track, pose: Pose) -> Result<(), CommandRefusal> {
        let mut peers = self.peers.iter();
        let met = peers.find(|(_, peer)| !self.keeps_clear_of(route, pose, peer));
        met.map_or(Ok(()), |(vehicle, _)| {
            Err(CommandRefusal::Separation(vehicle))
        })
    }

    /// Returns whether the fence holds the body all along a route from where the vehicle is, wherever it is while it believes to
    /// be there, and where wind may carry it from there. Who is too near to the fence already, by wind or since its place is
    /// believed elsewhere by now, comes no nearer to any side of it, and leaves it with all of its first piece of way.
    pub(super) fn stays_inside(&self, route: &Track, pose: Pose) -> bool {
        let (settings, fence) = (&self.settings, &self.settings.fence);
        let kept_m = settings.fence_reach_m(pose) - DUST_M;
        let leaves_m = settings.leaves_fence_m(pose, fence.distance_to_edge(pose.at));
        let here_m = |edge: Segment| {
            let (here_m, start_m) = (
                edge.distance_to_point(pose.at),
                edge.distance_to_point(route.start()),
            );
            here_m.min(start_m.max(here_m - BEHIND_M)) - DUST_M
        };
        let comes_no_nearer = |piece: Segment| {
            let keeps = |edge: Segment| piece.distance_to(edge) >= kept_m.min(here_m(edge));
            fence.contains(piece.to) && fence.edges().all(keeps)
        };
        let leaves = |piece: Segment, share: f64| {
            let gains = |edge: Segment| {
                let here_m = here_m(edge);
                let gained_m = GAINED * share * (kept_m - here_m).max(0.0);
                let end_m = kept_m.min(here_m + gained_m.max(settings.carried_m));
                edge.distance_to_point(piece.to) >= end_m
            };
            comes_no_nearer(piece) && fence.edges().all(gains)
        };
        let mut along_m = 0.0;
        comes_no_nearer(Segment::new(pose.at, route.start()))
            && route.segments().all(|piece| {
                let (first, rest) = piece.split_at(leaves_m - along_m);
                along_m += piece.length_m();
                let share = (along_m / leaves_m).min(1.0);
                first.is_none_or(|first| leaves(first, share))
                    && rest.is_none_or(|rest| fence.contains_corridor(rest, kept_m))
            })
    }

    /// Returns whether the fence holds the body all along a way that leads from one planned place to another.
    fn holds(&self, way: &Track, pose: Pose) -> bool {
        let settings = &self.settings;
        let kept_m = (settings.reach_m() + pose.off_m()).min(settings.fence_reach_m(pose)) - DUST_M;
        let mut pieces = way.segments();
        pieces.all(|piece| settings.fence.contains_corridor(piece, kept_m))
    }

    /// Returns whether a route keeps its distance from a peer, or at least leads away from it.
    fn keeps_clear_of(&self, route: &Track, pose: Pose, peer: &Peer) -> bool {
        let separation_m = self.settings.swarm.separation_m;
        let claim = Track::new(peer.claim.clone());
        claim.is_none_or(|claim| keeps_clear(pose.at, route, &claim, separation_m))
    }

    /// Stops a vehicle on a leg whose rest does not keep clear of a peer: the command that was to take its place was
    /// refused for that peer, and whoever gave it does not watch the leg any more. On plan it goes on before a peer that
    /// moves: the plan says who goes first, or the other one yields.
    pub(super) fn stop_before(&mut self, now: Time, vehicle: VehicleId, out: &mut Vec<Out>) {
        let Some(pose) = self.telemetry.of_any_age().map(|telemetry| telemetry.pose) else {
            return;
        };
        let is_off_plan = self.movement.way_off_plan_from(pose.at).is_some();
        let counts = |peer: &&Peer| is_off_plan || peer.resting;
        let Some(peer) = self.peers.get(vehicle).filter(counts) else {
            return;
        };
        let rest = self.movement.leg_from(pose.at).and_then(Track::new);
        if rest.is_some_and(|rest| !self.keeps_clear_of(&rest, pose, peer)) {
            self.stop(now, out);
        }
    }

    /// Stops a vehicle that drives off plan when a peer that moves, or is about to, claims what lies ahead of it; of a stored
    /// mission, whose later ways nobody has judged against peers, also for one that rests there. For a peer that somebody else
    /// steers, which follows no plan, a vehicle on plan stops as well.
    pub(super) fn yield_to(&mut self, now: Time, vehicle: VehicleId, out: &mut Vec<Out>) {
        let Some(pose) = self.telemetry.of_any_age().map(|telemetry| telemetry.pose) else {
            return;
        };
        let judges_all = self.movement.follows_stored();
        let counts = |peer: &&Peer| judges_all || !peer.resting;
        let Some(peer) = self.peers.get(vehicle).filter(counts) else {
            return;
        };
        let route = match peer.is_steered {
            true => self.movement.route_from(pose.at),
            false => self.movement.way_off_plan_from(pose.at),
        };
        let route = route.and_then(Track::new);
        if route.is_some_and(|route| !self.keeps_clear_of(&route, pose, peer)) {
            self.stop(now, out);
            out.push(Out::SafetyEvent(SafetyEvent::Refused(
                CommandRefusal::Separation(vehicle),
            )));
        }
    }
}
