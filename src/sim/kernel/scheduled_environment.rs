//! The environment as the kernel runs it: the moments at which it wants to be woken are put into the schedule. What happens
//! in it is said to the caller, who tells the nodes.

use super::schedule::{Schedule, ScheduledEvent};
use crate::node;
use crate::node::health::HealthFacts;
use crate::sim::body::BodyState;
use crate::sim::environment::{DeviceCommand, Environment, WorldEvent};
use crate::time::Time;

/// The environment, and a list that is kept for its memory.
pub(super) struct ScheduledEnvironment {
    environment: Environment,
    output: Vec<WorldEvent>,
}

impl ScheduledEnvironment {
    /// Begins an environment in which all `vehicles` run their software.
    pub(super) fn begin(
        mut environment: Environment,
        vehicles: usize,
        schedule: &mut Schedule,
    ) -> ScheduledEnvironment {
        let mut output = Vec::new();
        environment.begin(&mut output);
        put_into(schedule, &mut output);
        (0..vehicles).for_each(|vehicle| environment.attach(schedule.now(), vehicle));
        ScheduledEnvironment {
            environment,
            output,
        }
    }

    /// Returns the environment itself.
    #[cfg(test)]
    pub fn environment(&mut self) -> &mut Environment {
        &mut self.environment
    }

    /// Returns the environment, as it is at the end.
    pub(super) fn into_environment(self) -> Environment {
        self.environment
    }

    /// Returns where a vehicle truly is.
    pub(super) fn truth(&self, vehicle: usize, now: Time) -> BodyState {
        self.environment.world().truth(vehicle, now)
    }

    /// Returns how many sweeps are still to be driven, the present one included: one with the persons in it is the last.
    pub(super) fn sweeps_left(&self) -> usize {
        if self.environment.persons_are_in() {
            1
        } else {
            2
        }
    }

    /// The software of a vehicle runs from now on.
    pub(super) fn attach(&mut self, now: Time, vehicle: usize) {
        self.environment.attach(now, vehicle);
    }

    /// The software of a vehicle runs no more.
    pub(super) fn detach(&mut self, now: Time, vehicle: usize) {
        self.environment.detach(now, vehicle);
    }

    /// Returns what a vehicle's devices would tell of themselves.
    pub(super) fn facts(&self, vehicle: usize) -> HealthFacts {
        self.environment.facts(vehicle)
    }

    /// Lets a device of a vehicle obey; returns what it answers at once. The rest comes when its time has come.
    pub(super) fn obey(
        &mut self,
        vehicle: usize,
        command: DeviceCommand,
        schedule: &mut Schedule,
    ) -> Option<node::Event> {
        let mut output = std::mem::take(&mut self.output);
        let now = schedule.now();
        self.environment.obey(now, vehicle, command, &mut output);
        let answer = output.iter().find_map(answer);
        put_into(schedule, &mut output);
        self.output = output;
        answer
    }

    /// Lets the persons enter who wait outside.
    pub(super) fn let_persons_enter(&mut self, schedule: &mut Schedule) {
        let now = schedule.now();
        self.environment.let_persons_enter(now, &mut self.output);
        put_into(schedule, &mut self.output);
    }

    /// Lets happen what is due, and returns it in its order, with the moments of [`WorldEvent::Scheduled`] among it; the list
    /// comes back by [`ScheduledEnvironment::take_back`].
    pub(super) fn wake(&mut self, now: Time) -> Vec<WorldEvent> {
        let mut happened = std::mem::take(&mut self.output);
        self.environment.wake(now, &mut happened);
        happened
    }

    /// Takes an empty list back for its memory.
    pub(super) fn take_back(&mut self, list: Vec<WorldEvent>) {
        self.output = list;
    }
}

/// Queues the moments at which the environment wants to be woken; the list is empty then.
fn put_into(schedule: &mut Schedule, output: &mut Vec<WorldEvent>) {
    for event in output.drain(..) {
        if let WorldEvent::Scheduled(at) = event {
            schedule.push(at, ScheduledEvent::Environment);
        }
    }
}

/// Returns what a vehicle is told at once of what a device says.
fn answer(event: &WorldEvent) -> Option<node::Event> {
    match event {
        WorldEvent::Unsent { sequence, .. } => Some(node::Event::Unsent(*sequence)),
        WorldEvent::Ack { ack, .. } => Some(node::Event::Ack(*ack)),
        WorldEvent::Scheduled(_)
        | WorldEvent::Report { .. }
        | WorldEvent::Echo { .. }
        | WorldEvent::Heard { .. }
        | WorldEvent::Contact(_)
        | WorldEvent::Charged { .. }
        | WorldEvent::Track(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autopilot::{Command, NumberedCommand};
    use crate::geom::Point;
    use crate::sim::kernel::tests::scenario;

    fn begun() -> (ScheduledEnvironment, Schedule) {
        let mut schedule = Schedule::new(Time::from_secs_f64(60.0), None);
        let environment = scenario("").environment().unwrap();
        let environment = ScheduledEnvironment::begin(environment, 2, &mut schedule);
        (environment, schedule)
    }

    /// How many events are queued, and of which moments.
    fn queued(schedule: &mut Schedule) -> Vec<Time> {
        std::iter::from_fn(|| schedule.pop().map(|_| schedule.now())).collect()
    }

    #[test]
    fn what_it_waits_for_is_in_the_schedule_from_the_beginning() {
        let (_, mut schedule) = begun();
        let times = queued(&mut schedule);
        // The first reports of two autopilots, and the first look at where everybody is.
        assert_eq!(times.len(), 3);
        assert_eq!(times[2], Time::from_secs_f64(1.0));
    }

    #[test]
    fn a_command_is_answered_at_once_and_what_it_leads_to_later_is_queued() {
        let (mut environment, mut schedule) = begun();
        queued(&mut schedule);
        let command = Command::Route {
            corners: vec![Point::new(3.0, 5.0)],
            altitude_m: None,
            speed_mps: None,
        };
        let command = DeviceCommand::Autopilot(NumberedCommand { number: 4, command });
        let answer = environment.obey(0, command, &mut schedule);
        assert!(matches!(answer, Some(node::Event::Ack(ack)) if ack.number == 4));
        // The companion's silence, and the wall that it drives against.
        assert_eq!(queued(&mut schedule).len(), 2);
        assert!(environment.output.is_empty());
    }

    #[test]
    fn what_happens_comes_out_once_and_the_list_comes_back() {
        let (mut environment, mut schedule) = begun();
        schedule.pop();
        let happened = environment.wake(schedule.now());
        assert!(
            happened
                .iter()
                .any(|event| matches!(event, WorldEvent::Report { .. }))
        );
        environment.take_back(Vec::new());
        assert_eq!(environment.wake(schedule.now()).len(), 0);
    }
}
