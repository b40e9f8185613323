//! The health actor: how a vehicle fares apart from where it is, for the operator. The edge tells it facts about the machine
//! and its devices, the other actors what they have met; it says [`Health`] with a fact every two seconds, and as soon
//! as other troubles are known than were said last. It judges nothing: what is a reason not to start is the reader's
//! matter.
//!
//! It has no deadline: facts come once a second, live also as soon as a device is seen to fail, and a trouble that time alone
//! makes, an autopilot that says nothing, is noticed with them.

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    AutopilotHealth, Boot, Health, Power, RadioHealth, RangeHealth, RecordingHealth, VehicleId,
    fitted_troubles,
};

use super::outbox::OutboxCounts;
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::autopilot::{CommandPurpose, LinkEvent};
use crate::time::{Deadline, Time};

/// Health is said this often, with the first facts that come then.
const SAID_EVERY: Duration = Duration::from_secs(2);
/// Facts may come a little early.
const EARLY: Duration = Duration::from_millis(100);
/// An autopilot that has said nothing for this long is silent.
const AUTOPILOT_SILENT: Duration = Duration::from_secs(2);
/// Who was in the ring when a beacon was sent is heard for this long.
const HEARS_FOR: Duration = Duration::from_secs(5);

const SILENT: &str = "autopilot: it says nothing";

/// What the edge knows of the machine and its devices.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct HealthFacts {
    /// Samples lost since nothing could keep them, at the edge.
    pub samples_lost: u64,
    /// Inputs that actors have dropped unread.
    pub inputs_dropped: u64,
    /// Frames that were refused.
    pub frames_refused: u64,
    /// Frames of a kind that it does not know.
    pub frames_unknown: u64,
    /// Room left where it keeps its data, MB; `None` = not known.
    pub disk_free_mb: Option<u32>,
    /// Its recording; `None` = it keeps none.
    pub recording: Option<RecordingHealth>,
    /// What its autopilot has said of itself; `None` = nothing.
    pub autopilot: Option<AutopilotHealth>,
    /// Its radio; `None` = it has none, or does not say.
    pub radio: Option<RadioHealth>,
    /// Its range sensors; `None` = it has none, or does not say.
    pub range: Option<RangeHealth>,
    /// The supply of its computer.
    pub power: Power,
    /// Temperature of its processor, °C; `None` = not known.
    pub processor_c: Option<i8>,
    /// Whether its clock is synchronised; `None` = not known.
    pub is_clock_synchronised: Option<bool>,
    /// What is wrong at the edge, in words.
    pub troubles: Vec<String>,
}

/// What the health actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// What the edge knows.
    Facts(Box<HealthFacts>),
    /// The vehicle has said its State, so its autopilot was heard; and whether it is armed.
    State {
        /// Whether the motors may turn.
        is_armed: bool,
    },
    /// What the link to the autopilot met.
    Link(LinkEvent),
    /// Who was in the ring when a beacon was sent.
    Hears(Vec<VehicleId>),
    /// How the outbox fares.
    Tally(OutboxCounts),
}

/// What the health actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// How the vehicle fares.
    Publish(Box<Health>),
    /// For people.
    HealthEvent(HealthEvent),
}

/// What the health actor has noticed by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum HealthEvent {
    /// The autopilot says nothing.
    AutopilotSilent,
    /// It speaks again.
    AutopilotSpeaks,
}

impl fmt::Display for HealthEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            HealthEvent::AutopilotSilent => SILENT,
            HealthEvent::AutopilotSpeaks => "autopilot: it speaks again",
        })
    }
}

/// The health actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HealthActor {
    vehicle: VehicleId,
    boot: Boot,
    /// When it was told something first.
    begun_at: Option<Time>,
    /// When the vehicle said its State last.
    state_at: Option<Time>,
    /// Who was in the ring at the last beacon.
    hears: Option<(Time, Vec<VehicleId>)>,
    tally: OutboxCounts,
    /// Why the autopilot has not armed, since it was told to.
    not_armed: Option<String>,
    /// Whether the autopilot was silent when facts came last.
    is_silent: bool,
    /// When Health was said last, and with which troubles.
    said: Option<(Time, Vec<String>)>,
}

impl HealthActor {
    /// Makes an actor that has not been told anything yet.
    pub fn new(vehicle: VehicleId, boot: Boot) -> HealthActor {
        HealthActor {
            vehicle,
            boot,
            begun_at: None,
            state_at: None,
            hears: None,
            tally: OutboxCounts::default(),
            not_armed: None,
            is_silent: false,
            said: None,
        }
    }

    /// Notices whether the autopilot is silent.
    fn listen(&mut self, now: Time, out: &mut Vec<Out>) {
        let heard_at = self.state_at.or(self.begun_at).unwrap_or(now);
        let is_silent = now.since(heard_at) > AUTOPILOT_SILENT;
        if is_silent != self.is_silent {
            self.is_silent = is_silent;
            out.push(Out::HealthEvent(match is_silent {
                true => HealthEvent::AutopilotSilent,
                false => HealthEvent::AutopilotSpeaks,
            }));
        }
    }

    /// Returns what is wrong, in words: what the edge knows and what was met here.
    fn troubles(&self, of_edge: Vec<String>) -> Vec<String> {
        let silent = self.is_silent.then(|| SILENT.to_owned());
        let not_armed = self.not_armed.as_ref();
        let not_armed = not_armed.map(|reason| format!("arming: {reason}"));
        let mut all: Vec<String> = of_edge.into_iter().chain(silent).chain(not_armed).collect();
        all.sort();
        fitted_troubles(all)
    }

    fn is_due(&self, now: Time, troubles: &[String]) -> bool {
        self.said.as_ref().is_none_or(|(at, said)| {
            now.since(*at) + EARLY >= SAID_EVERY || said.as_slice() != troubles
        })
    }

    fn hears(&self, now: Time) -> Vec<VehicleId> {
        let hears = self.hears.as_ref();
        let fresh = hears.filter(|(at, _)| now.since(*at) <= HEARS_FOR);
        fresh.map(|(_, hears)| hears.clone()).unwrap_or_default()
    }

    fn health(&self, now: Time, facts: HealthFacts, troubles: Vec<String>) -> Health {
        let HealthFacts {
            samples_lost,
            inputs_dropped,
            frames_refused,
            frames_unknown,
            disk_free_mb,
            recording,
            autopilot,
            radio,
            range,
            power,
            processor_c,
            is_clock_synchronised,
            troubles: _,
        } = facts;
        Health {
            vehicle: self.vehicle,
            boot: self.boot,
            hears: self.hears(now),
            samples_waiting: self.tally.waiting,
            samples_lost: self.tally.lost + samples_lost,
            inputs_dropped,
            frames_refused,
            frames_unknown,
            disk_free_mb,
            recording,
            autopilot: autopilot.filter(|_| self.state_at.is_some()),
            radio,
            range,
            power,
            processor_c,
            is_clock_synchronised,
            troubles,
        }
    }
}

impl Actor for HealthActor {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.begun_at.get_or_insert(now);
        match input {
            In::Facts(mut facts) => {
                let of_edge = std::mem::take(&mut facts.troubles);
                self.listen(now, out);
                let troubles = self.troubles(of_edge);
                if self.is_due(now, &troubles) {
                    self.said = Some((now, troubles.clone()));
                    out.push(Out::Publish(Box::new(self.health(now, *facts, troubles))));
                }
            }
            In::State { is_armed } => {
                self.state_at = Some(now);
                self.not_armed.take_if(|_| is_armed);
            }
            In::Link(LinkEvent::GivenUp(CommandPurpose::Arm, reason)) => {
                self.not_armed = Some(reason.to_string());
            }
            In::Link(_) => {}
            In::Hears(members) => self.hears = Some((now, members)),
            In::Tally(tally) => self.tally = tally,
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        None
    }

    fn wake(&mut self, _now: Time, _out: &mut Vec<Out>) -> Result<(), Fault> {
        Ok(())
    }
}

impl Input for In {
    type Key = std::mem::Discriminant<In>;

    fn class(&self) -> InputClass<Self::Key> {
        match self {
            In::Link(_) => InputClass::Queue,
            In::Facts(_) | In::State { .. } | In::Hears(_) | In::Tally(_) => {
                InputClass::Latest(std::mem::discriminant(self))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Message, codec};

    use super::*;
    use crate::autopilot::Reason;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn tell(actor: &mut HealthActor, time_s: f64, input: In) -> Option<Health> {
        all_told(actor, time_s, input).0
    }

    /// Tells it something; returns the Health that it says, and what it has noticed.
    fn all_told(
        actor: &mut HealthActor,
        time_s: f64,
        input: In,
    ) -> (Option<Health>, Vec<HealthEvent>) {
        let mut out = Vec::new();
        actor.handle(at(time_s), input, &mut out).unwrap();
        let (mut healths, mut events) = (Vec::new(), Vec::new());
        for out in out {
            match out {
                Out::Publish(health) => healths.push(*health),
                Out::HealthEvent(event) => events.push(event),
            }
        }
        assert!(healths.len() <= 1);
        (healths.pop(), events)
    }

    fn facts(troubles: &[&str]) -> In {
        In::Facts(Box::new(HealthFacts {
            samples_lost: 3,
            autopilot: Some(AutopilotHealth::default()),
            troubles: troubles
                .iter()
                .map(|trouble| (*trouble).to_owned())
                .collect(),
            ..HealthFacts::default()
        }))
    }

    fn actor() -> HealthActor {
        HealthActor::new(VehicleId(2), Boot(7))
    }

    #[test]
    fn it_is_said_every_two_seconds_and_at_once_with_other_troubles() {
        let mut actor = actor();
        let mut said_at = Vec::new();
        for (time_s, troubles) in [
            (0.0, &[][..]),
            (1.0, &[]),
            (2.0, &[]),
            (3.0, &["radio: gone"]),
            (4.0, &["radio: gone"]),
            (5.0, &["radio: gone"]),
            (6.0, &[]),
            (7.0, &[]),
            (7.95, &[]),
        ] {
            assert_eq!(
                tell(&mut actor, time_s, In::State { is_armed: false }),
                None
            );
            said_at.extend(tell(&mut actor, time_s, facts(troubles)).map(|health| {
                assert_eq!(health.troubles, troubles, "{time_s}");
                time_s
            }));
        }
        assert_eq!(said_at, [0.0, 2.0, 3.0, 5.0, 6.0, 7.95]);
    }

    #[test]
    fn an_autopilot_is_silent_after_two_seconds_also_one_that_was_never_heard() {
        // Whenever the actor began: it counts from the first that it was told.
        for begun_s in [0.0, 215.0] {
            let mut actor = actor();
            let at_s = |time_s: f64| begun_s + time_s;
            let (health, events) = all_told(&mut actor, at_s(0.0), facts(&[]));
            let health = health.unwrap();
            assert_eq!(
                (health.troubles.len(), health.autopilot, events.len()),
                (0, None, 0)
            );
            tell(&mut actor, at_s(2.0), facts(&[])).unwrap();
            let (health, events) = all_told(&mut actor, at_s(3.0), facts(&[]));
            assert_eq!(health.unwrap().troubles, [SILENT]);
            assert_eq!(events, [HealthEvent::AutopilotSilent]);
            let (_, events) = all_told(&mut actor, at_s(3.4), facts(&[]));
            assert_eq!(events, [], "it is said once");
            tell(&mut actor, at_s(3.5), In::State { is_armed: true });
            let (health, events) = all_told(&mut actor, at_s(4.0), facts(&[]));
            let health = health.unwrap();
            assert!(health.troubles.is_empty() && health.autopilot.is_some());
            assert_eq!(events, [HealthEvent::AutopilotSpeaks]);
            assert_eq!(tell(&mut actor, at_s(5.0), facts(&[])), None);
            let health = tell(&mut actor, at_s(5.6), facts(&["a: b"])).unwrap();
            assert_eq!(health.troubles, ["a: b", SILENT]);
        }
    }

    #[test]
    fn an_autopilot_that_does_not_arm_is_a_trouble_until_it_is_armed() {
        let mut actor = actor();
        tell(&mut actor, 0.0, In::State { is_armed: false });
        let reason = Reason::NotDone;
        tell(
            &mut actor,
            0.0,
            In::Link(LinkEvent::GivenUp(CommandPurpose::Arm, reason)),
        );
        let other = LinkEvent::GivenUp(CommandPurpose::Move, Reason::NotArmed);
        tell(&mut actor, 0.0, In::Link(other));
        let health = tell(&mut actor, 0.5, facts(&[])).unwrap();
        assert_eq!(health.troubles, [format!("arming: {reason}")]);
        tell(&mut actor, 1.0, In::State { is_armed: true });
        assert!(
            tell(&mut actor, 1.5, facts(&[]))
                .unwrap()
                .troubles
                .is_empty()
        );
    }

    #[test]
    fn troubles_are_told_in_words_that_a_message_carries_whole_when_they_are_short() {
        let whole = "recording: /var/lib/tomoswarm/vehicle-1/recording/0001.mcap: cannot be written: No space left on device";
        assert_eq!(
            tell(&mut actor(), 0.0, facts(&[whole])).unwrap().troubles,
            [whole]
        );
        let long = "ä".repeat(300);
        let health = tell(&mut actor(), 0.0, facts(&[long.as_str(); 99])).unwrap();
        assert!(health.troubles[0].ends_with("ä…"), "{}", health.troubles[0]);
        codec::encode(&Message::Health(health)).unwrap();
    }

    #[test]
    fn whom_it_heard_by_radio_and_how_many_samples_wait_are_said_as_the_actors_tell_them() {
        let mut actor = actor();
        tell(&mut actor, 0.0, In::Hears(vec![VehicleId(1), VehicleId(3)]));
        tell(
            &mut actor,
            0.0,
            In::Tally(OutboxCounts {
                waiting: 5,
                lost: 1,
            }),
        );
        let health = tell(&mut actor, 5.0, facts(&[])).unwrap();
        assert_eq!(health.hears, [VehicleId(1), VehicleId(3)]);
        assert_eq!((health.samples_waiting, health.samples_lost), (5, 4));
        let later = tell(&mut actor, 7.0, facts(&[])).unwrap();
        assert!(later.hears.is_empty(), "that is 7 s ago");
    }
}
