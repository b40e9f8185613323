//! The actors of the ground station, each on a thread of its own, joined by [`crate::ground::route`]. The imager may take
//! seconds and the planner too; the station goes on meanwhile.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::mailbox::{Mailbox, Record, RestartPolicy, RuntimeContext, seat};
use crate::actor::Fault;
use crate::ground::Acted;
use crate::ground::imager::{Imager, Job};
use crate::ground::planner::{Planner, Request};
use crate::ground::route::{Destination, Effect, Event, Output, route};
use crate::ground::station::{self, Station};
use crate::store::recording::{Deed, Recorder};
use crate::time::Time;

/// The inboxes of the ground station's actors.
#[derive(Clone)]
pub struct Mailboxes {
    station: Mailbox<station::In>,
    planner: Mailbox<Request>,
    imager: Mailbox<Job>,
}

impl Default for Mailboxes {
    fn default() -> Mailboxes {
        Mailboxes {
            station: Mailbox::new("station"),
            planner: Mailbox::new("planner"),
            imager: Mailbox::new("imager"),
        }
    }
}

impl Mailboxes {
    /// Tells the station something from outside; never waits.
    pub fn tell(&self, event: Event) {
        // What comes from outside concerns actors only.
        self.pass(Output::Edge(event), &mut |_| {});
    }

    /// Hands on what was said; what concerns the edge goes to `carry_out`.
    pub(crate) fn pass(&self, said: Output, carry_out: &mut dyn FnMut(Effect)) {
        let mut routed = Vec::new();
        route(said, &mut routed);
        for to in routed {
            match to {
                Destination::Station(input) => self.station.tell(input),
                Destination::Planner(input) => self.planner.tell(input),
                Destination::Imager(input) => self.imager.tell(input),
                Destination::Edge(effect) => carry_out(effect),
            }
        }
    }

    /// Gives for how long the station has been acting without a pause; planner and imager may think for long.
    pub fn busy_for(&self, now: Time) -> Duration {
        self.station.busy_for(now)
    }

    /// Tells how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.station.dropped() + self.planner.dropped() + self.imager.dropped()
    }

    /// Sends all actors home.
    pub fn close(&self) {
        self.planner.close();
        self.imager.close();
        self.station.close();
    }
}

/// What makes an actor, at the start and again after a fault.
pub type Maker<A> = Box<dyn FnMut() -> Result<A, Fault> + Send>;

/// What makes the three actors.
pub struct Makers {
    /// The station; its fault ends the process.
    pub station: Maker<Station>,
    /// The planner.
    pub planner: Maker<Planner>,
    /// The imager.
    pub imager: Maker<Imager>,
}

/// Seats the three actors. `carry_out` is called from their threads for everything that concerns the outside.
///
/// # Errors
/// The machine has no threads to give.
pub fn start_actors(
    context: &RuntimeContext,
    mailboxes: &Mailboxes,
    makers: Makers,
    recorder: Option<&Recorder>,
    carry_out: impl Fn(Effect) + Send + Sync + 'static,
) -> std::io::Result<Vec<JoinHandle<()>>> {
    let edge = Arc::new(carry_out);
    let Makers { station, planner, imager } = makers;
    let of_station = Record::by(recorder, |step| Deed::Ground(Acted::Station(step)));
    let of_planner = Record::by(recorder, |step| Deed::Ground(Acted::Planner(step)));
    let of_imager = Record::by(recorder, |step| Deed::Ground(Acted::Imager(step)));
    Ok(vec![
        seat(
            context,
            &mailboxes.station,
            RestartPolicy::StopNode,
            of_station,
            station,
            output_sink(mailboxes, &edge, Output::Station),
        )?,
        seat(
            context,
            &mailboxes.planner,
            RestartPolicy::Restart,
            of_planner,
            planner,
            output_sink(mailboxes, &edge, Output::Planner),
        )?,
        seat(
            context,
            &mailboxes.imager,
            RestartPolicy::Restart,
            of_imager,
            imager,
            output_sink(mailboxes, &edge, Output::Imager),
        )?,
    ])
}

/// Gives what hands on the words of one actor.
fn output_sink<T, E>(
    mailboxes: &Mailboxes,
    edge: &Arc<E>,
    wrap: fn(T) -> Output,
) -> impl FnMut(T) + Send + 'static + use<T, E>
where
    T: 'static,
    E: Fn(Effect) + Send + Sync + 'static,
{
    let (mailboxes, edge) = (mailboxes.clone(), edge.clone());
    move |out| mailboxes.pass(wrap(out), &mut |effect| edge(effect))
}
