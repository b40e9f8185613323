//! How a vehicle comes home beside others: it waits for its turn, drives, or steps aside for those whose way it bars. What
//! becomes of a return is decided by [`super::returning`].

use std::collections::BTreeSet;

use tomoswarm_proto::VehicleId;

use super::aside::{
    Bound, ROOM_AFTER_LOOKS, aside_in_turn, enough_m, peers_on_way, way_aside_for, ways_of,
    ways_of_peers,
};
use super::goal::{Goal, GoalSource, Return, ReturnQueue, ReturnStage};
use super::home::{HOME_M, WayHome};
use super::kind::RouteRoom;
use super::returning::{Bars, MORE_ROOM_AFTER, ReturnDecision, Returning};
use super::terrain::{PathSearch, RULES, Resolution, Trip};
use super::{AutonomyCause, Mission, MissionEvent, Out};
use crate::geom::Point;
use crate::node::OwnState;
use crate::node::peers::Peer;
use crate::plan::Component;
use crate::time::Time;

impl Mission {
    /// Goes on with the way home: waits for its turn, or drives.
    pub(super) fn bring_home(&mut self, now: Time, home: Return, out: &mut Vec<Out>) {
        match home.stage {
            ReturnStage::InQueue(queue) => self.wait_in_queue(now, home, &queue, out),
            ReturnStage::UnderWay { .. } => self.drive_home(now, home, out),
        }
        if self.announcements.goal(self.goal_place()) {
            out.push(Out::Progress(self.on_wire()));
        }
    }

    fn wait_in_queue(&mut self, now: Time, home: Return, queue: &ReturnQueue, out: &mut Vec<Out>) {
        let Some(state) = self.state.as_ref().filter(|state| state.leg.is_none()) else {
            return;
        };
        let returning = self.returning(now, home);
        if !returning.is_its_turn(queue) {
            return;
        }
        let claims = self.peers.standing_claims(now);
        let search = self.terrain.search(now, state.pose);
        let way_home = WayHome::of(&search, self.settings.home, &claims);
        let pose = state.pose;
        let mut barred = Vec::new();
        let bars = || {
            let (bars, peers) = self.bars_on_their_way_home(now, &search);
            barred = peers;
            bars
        };
        let way_aside = |times: u32| self.way_aside(now, &search, &claims, times);
        let (home, unknown) = match returning.turn(queue, (way_home, bars), way_aside) {
            ReturnDecision::Waits(home) => {
                if queue.barred_since.is_none() {
                    let event = match barred.is_empty() {
                        true => MissionEvent::WaitsForPeers(peers_on_way(
                            &search,
                            self.settings.home,
                            &self.peers,
                        )),
                        false => MissionEvent::LetsFirst(barred),
                    };
                    out.push(Out::MissionEvent(event));
                }
                (home, None)
            }
            ReturnDecision::Drives(home, unknown) => (home, Some(unknown)),
            ReturnDecision::StepsAside(home, corners) => {
                let to = corners.last().copied().unwrap_or(pose.at);
                out.push(Out::MissionEvent(MissionEvent::StepsAside(to)));
                self.pilot.take_route(pose.at, &corners, RouteRoom::Kept);
                (home, None)
            }
        };
        self.terrain.note_standing_peers(claims);
        if let Some(unknown) = unknown {
            self.pilot.go_home(now, pose, &self.terrain, unknown);
        }
        if home.is_under_way() {
            self.plan.leave();
        }
        self.goal = Goal::Returning(home);
    }

    /// Returns a way to where the vehicle stands in the way of none of the peers that stand, or of none that go first, the
    /// `times`-th time in a row.
    fn way_aside(
        &self,
        now: Time,
        search: &PathSearch<'_>,
        claims: &[Vec<Point>],
        times: u32,
    ) -> Option<Vec<Point>> {
        let separation_m = self.settings.swarm.separation_m;
        let all_ways = ways_of_peers(&self.peers, now, search, separation_m);
        let grid = search.ground(None, Resolution::Parts, false, claims)?;
        let home = self.settings.home;
        let homeward = self.homeward_peers(now);
        let may_stay = !matches!(self.goal, Goal::Returning(home) if home.lets_first_for(now) >= MORE_ROOM_AFTER);
        let way_for = |first: &[&Bound<'_>]| {
            // From there it must get home when those are at home whom it lets go first; where that cannot be, anything is better.
            let at_home = first.iter().filter(|peer| peer.is_barred(search, home));
            let at_home = at_home.flat_map(|peer| peer.stay().iter().copied().chain([peer.to]));
            let stand: Vec<Vec<Point>> = at_home.map(|place| vec![place]).collect();
            let leads_home = |unknown_allowed: bool| {
                let then = search.ground(Some(home), Resolution::Parts, unknown_allowed, &stand)?;
                let nodes = then.lattice();
                Some((nodes, Component::around(&then, nodes.cell_at(home), &RULES)))
            };
            let ways = ways_of(&all_ways, first, homeward.len());
            let enough_m = enough_m(ways.iter().copied(), times);
            let mut grounds = [false, true].into_iter().filter_map(leads_home);
            let back = grounds.find_map(|(nodes, open)| {
                let may_stand = |place: Point| open.contains(nodes.cell_at(place));
                way_aside_for(search, &grid, (&ways, enough_m), first, may_stand)
            });
            let anywhere = || way_aside_for(search, &grid, (&ways, enough_m), first, |_| true);
            back.or_else(anywhere)
        };
        aside_in_turn(search, self.settings.vehicle, &homeward, may_stay, way_for)
    }

    /// Returns the peers that are on their way home, and not yet there.
    fn homeward_peers(&self, now: Time) -> Vec<Bound<'_>> {
        let all = Bound::all(&self.peers, now);
        all.filter(|bound| bound.peer.goes_home(now)).collect()
    }

    fn drive_home(&mut self, now: Time, home: Return, out: &mut Vec<Out>) {
        if self.state.is_none() {
            return;
        }
        self.drive(now, out);
        let is_there = self.pilot.way().is_empty();
        if is_there && self.seems_home() {
            if let Some(back) = self.lets_first_after_all(now, home) {
                self.goal = Goal::Returning(back);
                return;
            }
            self.goal = Goal::Home(home.by);
            out.push(Out::MissionEvent(MissionEvent::Home));
        } else if is_there || self.pilot.is_refused() {
            // What it has driven beside its home may lie on the far side of that.
            self.step_back(now, |returning| returning.after_refused_paths());
        }
    }

    /// At home after a return, steps aside for others that cannot get home because of it, as may show only after a while: a peer
    /// that came home after it has closed the other way. Of several that bar a way together the highest id goes first. One
    /// with a low battery stays, and so does one whose motors are off: people may be near.
    pub(super) fn make_room_at_home(&mut self, now: Time, by: GoalSource, out: &mut Vec<Out>) {
        let may_drive = |state: &&OwnState| state.is_armed && state.is_at_rest;
        let stays = self.autonomy.is_battery_low() || !self.barring.are_due(now);
        let Some(state) = self.state.as_ref().filter(may_drive).filter(|_| !stays) else {
            return;
        };
        let pose = state.pose;
        let search = self.terrain.search(now, pose);
        let homeward = self.homeward_peers(now);
        let bars = homeward.iter().any(|peer| peer.is_barred(&search, pose.at));
        let is_higher_at_rest = |(id, peer): &(VehicleId, &Peer)| {
            *id > self.settings.vehicle && peer.stands(now) && !peer.goes_home(now)
        };
        let higher = self.peers.iter().filter(is_higher_at_rest).count() as u32;
        if self.barring.note(now, bars) < ROOM_AFTER_LOOKS + higher {
            return;
        }
        let claims = self.peers.standing_claims(now);
        if let Some(corners) = self.way_aside(now, &search, &claims, 1) {
            self.barring.begin_anew();
            let to = corners.last().copied().unwrap_or(pose.at);
            out.push(Out::MissionEvent(MissionEvent::StepsAside(to)));
            self.pilot.take_route(pose.at, &corners, RouteRoom::Kept);
            self.terrain.note_standing_peers(claims);
            self.goal = Goal::Returning(Return::aside(now, by));
        }
    }

    /// Returns what becomes of the return of a vehicle that has come home, if it lets others go first that it bars there: what
    /// it has seen on its way may show that these can get home by no other way.
    fn lets_first_after_all(&self, now: Time, home: Return) -> Option<Return> {
        let pose = self.state.as_ref()?.pose;
        let bars = || {
            let search = self.terrain.search(now, pose);
            self.bars_on_their_way_home(now, &search).0
        };
        self.returning(now, home).lets_first_after_all(bars)
    }

    /// Returns whether others that go home cannot get there once this vehicle is at home, or as it stands; and who.
    fn bars_on_their_way_home(&self, now: Time, search: &PathSearch<'_>) -> (Bars, Vec<VehicleId>) {
        let (own, home, at) = (self.settings.vehicle, self.settings.home, search.from());
        let mut homeward = self.homeward_peers(now);
        let mut barred: BTreeSet<VehicleId> = BTreeSet::new();
        let here = homeward.iter().filter(|peer| peer.is_barred(search, at));
        barred.extend(here.map(|peer| peer.id));
        let stands_in_the_way = !barred.is_empty();
        homeward.retain(|peer| peer.is_barred(search, home));
        barred.extend(homeward.iter().map(|peer| peer.id));
        let homeward_trip = Trip {
            from: at,
            to: home,
            beside_m: HOME_M,
        };
        let bars_each_other =
            |peer: &Bound<'_>| own < peer.id && peer.bars_there(search, &homeward_trip);
        let bars = match (homeward.is_empty(), stands_in_the_way) {
            (true, false) => Bars::Nobody,
            (true, true) => Bars::HereAlone,
            (false, true) => Bars::Here,
            (false, false) if homeward.iter().all(bars_each_other) => Bars::EachOther,
            (false, false) if homeward.iter().any(bars_each_other) => Bars::Here,
            (false, false) => Bars::AtHome,
        };
        (bars, barred.into_iter().collect())
    }

    /// Something is in the way on the way aside: the vehicle has come far enough.
    pub(super) fn end_way_aside(&mut self) {
        if let Some(state) = self.state.as_ref().filter(|_| self.pilot.drives_route()) {
            self.pilot.give_up(state.pose.at);
        }
    }

    fn returning(&self, now: Time, home: Return) -> Returning<'_> {
        Returning {
            now,
            own: self.settings.vehicle,
            peers: &self.peers,
            home,
            is_battery_low: self.autonomy.is_battery_low()
                || home.by == GoalSource::Itself(AutonomyCause::BatteryLow),
        }
    }

    /// Lets others have their turn, if it returns and they are to have it.
    pub(super) fn step_back(
        &mut self,
        now: Time,
        back: impl FnOnce(Returning<'_>) -> Option<Return>,
    ) {
        if let Goal::Returning(home) = self.goal
            && let Some(home) = back(self.returning(now, home))
        {
            self.goal = Goal::Returning(home);
        }
    }
}
