//! How far an order is with one vehicle: what was sent, and what its State showed since.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Control, EmergencyName, Lease, Ordered, Revision, State};

use crate::operator::outcome::VehicleOutcome;
use crate::time::Time;

/// The ground has this long to say that it brings about what was started.
pub(super) const CONTEST: Duration = Duration::from_millis(2500);

/// How far it is with one vehicle.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct VehicleDelivery {
    /// The order that is sent to it.
    pub issued: Option<OrderRight>,
    /// When it was sent an order first, and last.
    pub first_at: Option<Time>,
    pub sent_at: Option<Time>,
    /// Who has taken it over, as its state showed when it was sent an order first: a start ends that.
    pub take_over: Option<EmergencyName>,
    /// When its state showed it, and whether the ground has gone on from there.
    pub obeyed: Option<(Time, bool)>,
    /// Since when something else is above a start, and which: the ground station may be bringing it about.
    pub contested: Option<(Time, Ordered)>,
    /// What somebody else has ordered it since.
    pub overruled: Option<Ordered>,
    /// Since when something else is above an order that stands, and which.
    pub doubted: Option<(Time, Ordered)>,
    /// How often the order went above a weaker one.
    pub insisted: u32,
}

/// Returns the name of the take-over that a vehicle's state shows.
pub(super) fn take_over_of(state: &State) -> Option<EmergencyName> {
    let is_steered = match state.control {
        // Somebody may have taken over before the autopilot fell silent.
        Control::Remote | Control::Own | Control::Silent => true,
        Control::Ours => false,
    };
    is_steered.then(|| EmergencyName::of_take_over(state.vehicle, state.boot))
}

/// By which right an order is sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct OrderRight {
    pub lease: Lease,
    pub revision: Revision,
}

impl VehicleDelivery {
    /// Begins anew with a vehicle that was started anew, unless somebody else has the say since.
    pub(super) fn forget(&mut self, in_force: Lease) {
        let is_outbid = self.issued.is_some_and(|issued| in_force > issued.lease);
        let by_lease = is_outbid.then_some(Ordered {
            lease: in_force,
            ..Ordered::default()
        });
        self.overruled = self
            .overruled
            .or(self.doubted.map(|(_, echo)| echo))
            .or(by_lease);
        (self.issued, self.sent_at, self.doubted) = (None, None, None);
    }

    /// Takes the echo of a vehicle that obeys nothing of what was sent: one that was started anew shows what it remembers,
    /// and obeys nothing lower.
    pub(super) fn look_at_memory(&mut self, echo: Ordered) {
        let Some(issued) = self
            .issued
            .filter(|issued| echo.edition() > (issued.lease, issued.revision))
        else {
            return;
        };
        if echo.kind.is_some() {
            return;
        }
        if echo.lease == issued.lease {
            (self.issued, self.sent_at) = (None, None);
        } else {
            self.overruled = self.overruled.or(Some(echo));
        }
    }

    /// Takes what a vehicle shows after it has obeyed an order that stands. What somebody else has ordered ends it there,
    /// but for the ground station, which brings a start about by orders of its own; its report may be late.
    pub(super) fn doubt(&mut self, now: Time, echo: Ordered, is_explained: bool) {
        let since = self.doubted.map_or(now, |(since, _)| since);
        self.doubted = (!is_explained).then_some((since, echo));
        if self.doubted.is_some() && now.since(since) >= CONTEST {
            self.overruled = Some(echo);
        }
    }

    /// Returns whether there is nothing left to send.
    pub(super) fn is_over(&self) -> bool {
        self.obeyed.is_some() || self.overruled.is_some()
    }

    /// Returns how it ended, or stands.
    pub(super) fn outcome(&self, is_heard: bool) -> VehicleOutcome {
        match (self.obeyed, self.overruled) {
            (Some((at, by_ground)), _) => VehicleOutcome::Obeyed {
                after: at.since(self.first_at.unwrap_or(at)),
                by_ground,
            },
            (None, Some(echo)) => VehicleOutcome::Overruled(echo),
            (None, None) if is_heard => VehicleOutcome::Ignored,
            (None, None) => VehicleOutcome::Unheard,
        }
    }
}
