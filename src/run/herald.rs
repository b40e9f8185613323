//! A node's presence on the bus: it asks whether it may take part, greets, judges greetings, and hands on what may be
//! heard. The rules are [`Joining`]'s.

use std::sync::{Arc, Mutex, OnceLock};

use tomoswarm_proto::{Hello, Message, OrderKind, Sender};

use super::bus::{Bus, BusError, BusSettings, Heard, Mouth, Reply};
use super::joining::{Joining, Verdict};
use super::mailbox::{Ending, RuntimeContext, lock};
use crate::time::Time;

/// A node on the bus.
pub struct Herald {
    bus: Bus,
    joining: Arc<Mutex<Joining>>,
    is_speaking: bool,
}

impl Herald {
    /// Goes on the bus and begins to ask; `hear` gets every message of nodes that fit.
    ///
    /// # Errors
    /// The bus cannot be opened.
    pub fn open(
        settings: BusSettings,
        own: Hello,
        context: &RuntimeContext,
        hear: impl Fn(Sender, Message) + Send + Sync + 'static,
    ) -> Result<Herald, BusError> {
        let joining = Arc::new(Mutex::new(Joining::new(context.clock.now(), own)));
        let answer: Arc<OnceLock<Reply>> = Arc::default();
        let (judged, answered, endings) =
            (joining.clone(), answer.clone(), Mutex::new(context.endings.clone()));
        let clock = context.clock;
        let ear = move |heard| match heard {
            Heard::Message(sender, message) => {
                if stops_at_once(&message) || lock(&judged).listens_to(sender) {
                    hear(sender, message);
                }
            }
            Heard::Greeting(greeting, hello) => {
                let verdict = lock(&judged).hear(clock.now(), &greeting, hello.as_ref());
                match verdict {
                    Verdict::Fine => {
                        if let Some(hello) = hello.filter(|hello| lock(&judged).listens_to(hello.node)) {
                            hear(hello.node, Message::Hello(hello));
                        }
                    }
                    Verdict::Foreign(reason) | Verdict::Stays(reason) => tracing::warn!("{reason}"),
                    Verdict::Refused(reason) => {
                        lock(&endings).send(Ending::Refused(reason)).unwrap_or_default();
                    }
                }
                // Whoever asks and does not fit learns it at once.
                let own = lock(&judged).greet_if_due(clock.now());
                if let (Some(own), Some(reply)) = (own, answered.get()) {
                    reply.publish(&Message::Hello(own));
                }
            }
        };
        let bus = Bus::open(settings, context.clock, context.troubles.clone(), ear)?;
        // It is empty: only here it is ever filled.
        let _ = answer.set(bus.mouth().reply());
        Ok(Herald { bus, joining, is_speaking: false })
    }

    /// Gives the handle by which messages are published.
    pub fn mouth(&self) -> Mouth {
        self.bus.mouth()
    }

    /// Greets when it is time; gives when to be called again. Once nobody has objected the node may speak.
    pub fn greet(&mut self, now: Time) -> Time {
        // Asked without the lock: the ear, which the bus's threads call, waits for it.
        let is_linked = !self.is_speaking && self.bus.mouth().links() > 0;
        let mut joining = lock(&self.joining);
        if is_linked {
            joining.meet(now);
        }
        let hello = joining.greet(now);
        if joining.is_member() && !self.is_speaking {
            self.is_speaking = true;
            self.bus.mouth().speak();
            tracing::info!("takes part in the bus");
        }
        if let Some(hello) = hello {
            self.bus.mouth().publish(&Message::Hello(hello));
        }
        joining.next()
    }

    /// Tells whether the node takes part.
    pub fn is_member(&self) -> bool {
        self.is_speaking
    }

    /// Leaves the bus.
    pub fn close(self) {
        self.bus.close();
    }
}

/// Tells whether a message is an order that must not depend on venue files: what makes everything stop at once. It was
/// judged by the bus like everything else.
fn stops_at_once(message: &Message) -> bool {
    matches!(message, Message::Order(order) if order.kind >= OrderKind::Emergency)
}
