//! No way to a place is known: looks from near at what may bar it, one after the other, and what becomes of the place when
//! that does not help. What is worth such a look is decided by [`Doubts`](super::super::doubts::Doubts).

use super::{Destination, RunnerContext, StepRunner};
use crate::geom::{Cell, Point};
use crate::node::mission::MissionEvent;
use crate::node::mission::doubts::{CloseLook, DoubtStep, DoubtTry};
use crate::node::mission::kind::PassedOver;
use crate::node::mission::look_around::LookAround;

impl StepRunner {
    /// No way to a place is known but past what the pilot did not pass: looks at that from near, and then the map decides.
    pub(super) fn doubt_barred(&mut self, scene: &mut RunnerContext<'_>, claims: &[Vec<Point>]) {
        let lattice = self.settings.lattice;
        let places = self.barred.places().iter();
        let cells: Vec<Cell> = places.map(|place| lattice.cell_at(*place)).collect();
        self.barred.clear();
        let search = scene.terrain.search(scene.now, scene.pose());
        match self.doubts.look_at_bars(&search, &cells, claims) {
            Some(look) => self.go_and_look_closely(scene, look),
            None => self.try_again(scene),
        }
    }

    /// Looks from near at what has stopped it at a place, if that was not done before; returns whether it does.
    pub(super) fn looks_at_bar(&mut self, scene: &mut RunnerContext<'_>, at: Point) -> bool {
        if scene.terrain.is_free(at) {
            return false;
        }
        let (cell, claims) = (
            self.settings.lattice.cell_at(at),
            scene.surroundings().claims(),
        );
        let search = scene.terrain.search(scene.now, scene.pose());
        let look = self.doubts.look_at_bars(&search, &[cell], &claims);
        let looks = look.is_some();
        if let Some(look) = look {
            self.go_and_look_closely(scene, look);
        }
        looks
    }

    /// No way to a place is known: looks from near at what may bar it and may not, or passes the place over.
    pub(super) fn doubt(
        &mut self,
        scene: &mut RunnerContext<'_>,
        place: Point,
        claims: &[Vec<Point>],
    ) {
        let search = scene.terrain.search(scene.now, scene.pose());
        match self.doubts.toward(&search, place, claims) {
            DoubtStep::NoWay(bars) => {
                scene.emit(MissionEvent::NoWay(place, bars));
                self.pass_over(scene, place, PassedOver::NoWay);
            }
            // Its peers keep it from where it could look.
            DoubtStep::Spent(_) if self.doubts.wait_for_peers(&search, place, claims) => {
                self.yield_to_peers(scene);
            }
            DoubtStep::Spent(bars) => {
                scene.emit(MissionEvent::StaysDoubtful(place, bars));
                self.pass_over(scene, place, PassedOver::GivenUp);
            }
            DoubtStep::Try(DoubtTry::Look(look)) => self.go_and_look_closely(scene, look),
            DoubtStep::Try(DoubtTry::GoBack(course)) => {
                self.yields.end();
                self.drive(scene, &course, Destination::OpenGround);
            }
        }
    }

    /// Goes to where a cell can be looked at from near, and looks.
    pub(super) fn go_and_look_closely(&mut self, scene: &mut RunnerContext<'_>, look: CloseLook) {
        match look {
            CloseLook {
                course: Some(course),
                at,
            } => {
                self.yields.end();
                self.drive(scene, &course, Destination::Doubtful(at));
            }
            CloseLook { course: None, at } => {
                self.doubts.note(self.settings.lattice, at, scene.pose().at);
                self.look_closely(scene, at);
            }
        }
    }

    /// Looks from near at a cell that may bar the way.
    pub(super) fn look_closely(&mut self, scene: &mut RunnerContext<'_>, cell: Cell) {
        // Each is looked at so often at most: this cannot go on for ever.
        self.progress.get_on(scene.now);
        let (at, middle) = (scene.pose().at, self.settings.lattice.centre(cell));
        scene.emit(MissionEvent::LooksClosely(middle));
        let look = LookAround::closely(at.angle_to(middle), scene.now);
        self.begin_look(scene, look, None);
    }
}
