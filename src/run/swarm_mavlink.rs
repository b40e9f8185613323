//! The swarm at a socket of MAVLink: an operator of its own on the bus, on a thread of its own, beside whatever else its
//! process does. It carries states to the server, bytes between server and socket, and orders to the operator; what they
//! mean is not known here ([`crate::mavlink::swarm_server`]).
//!
//! ```text
//!   bus ─► operator ─view─► server ◄─bytes─► socket
//!   bus ◄─ operator ◄─orders─┘ ◄─how they ended─ operator
//! ```

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use super::live_operator::LiveOperator;
use super::mailbox::lock;
use super::mavlink_port::{PortError, signing_clock};
use super::mavlink_sockets::{FromClient, MavlinkSockets, SocketKind, by_queue};
use crate::actor::Fault;
use crate::mavlink::swarm_server::{
    OrderRequest, RequestEnd, ServerOutput, SwarmServer, SwarmServerSettings, VehicleReport,
};
use crate::operator::names::kind_name;
use crate::operator::operator_actor::{In, Out};
use crate::operator::order_goal::{GoalId, OrderGoal};
use crate::operator::outcome::OrderOutcome;
use crate::time::Time;

/// Words that wait for the server; whoever says more waits.
const WORDS_WAITING: usize = 1024;
/// So many words are heard before the operator goes on.
const WORDS_AT_ONCE: usize = 256;
/// Words are looked for this often.
const NAP: Duration = Duration::from_millis(20);
/// An order is given up after this time.
const ORDER_WITHIN: Duration = Duration::from_secs(5);
/// A link to the swarm is made within this time.
const LINKED_WITHIN: Duration = Duration::from_secs(5);

/// How the swarm is shown.
#[derive(Clone, Debug)]
pub struct SwarmMavlinkSettings {
    /// Whether ground stations speak first, or are spoken to.
    pub sockets: SocketKind,
    /// Where.
    pub address: SocketAddr,
    /// The hash of the venue's file: vehicles of another one are not shown.
    pub venue_hash: u64,
    /// What the server is told.
    pub server: SwarmServerSettings,
}

/// The thread that shows the swarm; dropping it ends it.
pub struct SwarmMavlink {
    is_over: Arc<AtomicBool>,
    trouble: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
}

struct Work {
    operator: LiveOperator,
    server: SwarmServer,
    sockets: MavlinkSockets,
    words: Receiver<FromClient>,
    venue_hash: u64,
    /// When the swarm could be reached last.
    linked: Time,
    is_over: Arc<AtomicBool>,
    trouble: Arc<Mutex<Option<String>>>,
}

impl SwarmMavlink {
    /// Opens the socket and begins.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn start(
        operator: LiveOperator,
        settings: SwarmMavlinkSettings,
    ) -> Result<SwarmMavlink, PortError> {
        let (told, words) = sync_channel(WORDS_WAITING);
        let address = settings.address;
        let told = by_queue(told, |word| word, Some);
        let sockets = MavlinkSockets::open(settings.sockets, address, 1, told)?;
        let (is_over, trouble) = (Arc::<AtomicBool>::default(), Arc::default());
        let work = Work {
            linked: operator.now(),
            operator,
            server: SwarmServer::new(settings.server),
            sockets,
            words,
            venue_hash: settings.venue_hash,
            is_over: is_over.clone(),
            trouble: Arc::clone(&trouble),
        };
        let thread = std::thread::Builder::new()
            .name("swarm over MAVLink".to_owned())
            .spawn(move || work.run())
            .map_err(|error| (address, error))?;
        Ok(SwarmMavlink {
            is_over,
            trouble,
            thread: Some(thread),
        })
    }

    /// Returns what is wrong, in words.
    pub fn trouble(&self) -> Option<String> {
        let is_ended = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
        let trouble = lock(&self.trouble).clone();
        trouble.or_else(|| is_ended.then(|| "the swarm is not shown any more".to_owned()))
    }
}

impl Drop for SwarmMavlink {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended, too.
            let _ = thread.join();
        }
    }
}

impl Work {
    fn run(mut self) {
        while !self.is_over.load(Ordering::Relaxed) {
            match self.go_on() {
                Ok(trouble) => *lock(&self.trouble) = trouble,
                Err(fault) => {
                    *lock(&self.trouble) = Some(fault.to_string());
                    break;
                }
            }
        }
        self.operator.close();
    }

    /// Does what is due; returns what is wrong.
    fn go_on(&mut self) -> Result<Option<String>, Fault> {
        let until = self.server.deadline().min(self.operator.now() + NAP);
        let said = self.operator.go_on(until, |_, _| {})?;
        let now = self.operator.now();
        let mut output = ServerOutput::default();
        for out in said {
            if let Out::InForce(GoalId::Hand(number), outcome)
            | Out::Ended(GoalId::Hand(number), outcome) = out
            {
                let end = end_of(&outcome);
                tracing::info!("order {number} of a ground station: {end}");
                self.server.ended(number, &end, &mut output);
            }
        }
        let words: Vec<FromClient> = self.words.try_iter().take(WORDS_AT_ONCE).collect();
        for word in words {
            match word {
                FromClient::Joined { client, .. } => {
                    self.server.joined(now, client, signing_clock());
                }
                FromClient::Bytes { client, bytes } => {
                    self.server.hear(now, client, &bytes, &mut output);
                }
                FromClient::Left { client } => self.server.left(client),
            }
        }
        let live = self.operator.view().live_vehicles(now, self.venue_hash);
        let reports = live.map(|(state, seen)| VehicleReport {
            at: state.at,
            state: &state.value,
            mission: seen.mission.as_ref().map(|mission| &mission.value),
            health: seen.health.as_ref().map(|health| &health.value),
            hello: seen.hello.as_ref().map(|hello| &hello.value),
        });
        self.server.due(now, reports, &mut output);
        self.carry_out(output);
        Ok(self.what_is_wrong(now))
    }

    fn carry_out(&mut self, output: ServerOutput) {
        for (client, bytes) in output.bytes {
            self.sockets.send(client, bytes);
        }
        for request in output.requests {
            let OrderRequest {
                number,
                vehicle,
                kind,
                begins,
            } = request;
            let wanted = kind_name(kind);
            tracing::info!("order {number} of a ground station: {wanted} for vehicle {vehicle}");
            let goal = OrderGoal {
                begins,
                ..OrderGoal::new(kind, [vehicle].into(), ORDER_WITHIN)
            };
            self.operator.tell(In::Want(number, goal));
        }
        for warning in output.warnings {
            tracing::warn!("{warning}");
        }
    }

    fn what_is_wrong(&mut self, now: Time) -> Option<String> {
        let session = self.operator.session();
        if session.is_linked() {
            self.linked = now;
        }
        let is_alone = now.since(self.linked) > LINKED_WITHIN;
        let troubles = session.troubles();
        let alone = is_alone.then(|| "its operator reaches nobody".to_owned());
        troubles.into_iter().next().or(alone)
    }
}

fn end_of(outcome: &OrderOutcome) -> RequestEnd {
    match (outcome.refused, outcome.is_done()) {
        (Some(refused), _) => RequestEnd::Refused(refused.to_string()),
        (None, true) => RequestEnd::InForce,
        (None, false) => RequestEnd::Failed(outcome.undone()),
    }
}
