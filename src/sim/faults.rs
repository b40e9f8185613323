//! The faults of a scenario, for those whom they hit: the environment (devices), the kernel (software) and the
//! bus. When they are is the file's business, what follows from them is the nodes'.

use tomoswarm_proto::{Sender, VehicleId};

use super::autopilot::Outage;
use crate::config::{FaultKind, FaultSpec, Partition};
use crate::time::Time;

/// All faults of a scenario.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    list: Vec<FaultSpec>,
}

/// What a fault of software does at the moment of its beginning or end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SoftwareFaultEvent {
    /// The software of a node ends.
    Ends(Sender),
    /// The software of a node starts.
    Starts(Sender),
}

impl SoftwareFaultEvent {
    /// Returns whether the software of a vehicle starts.
    pub fn starts_vehicle(&self) -> bool {
        matches!(self, SoftwareFaultEvent::Starts(Sender::Vehicle(_)))
    }
}

impl Faults {
    /// Takes the faults of a file.
    pub fn new(list: Vec<FaultSpec>) -> Faults {
        Faults { list }
    }

    /// Returns whether a vehicle's radio is dead at a moment.
    pub fn cut_radio(&self, now: Time, vehicle: VehicleId) -> bool {
        self.hits(FaultKind::Radio, now, vehicle)
    }

    /// Returns whether a vehicle's range sensor is dead at a moment.
    pub fn blind(&self, now: Time, vehicle: VehicleId) -> bool {
        self.hits(FaultKind::Sensor, now, vehicle)
    }

    fn hits(&self, kind: FaultKind, now: Time, vehicle: VehicleId) -> bool {
        self.list
            .iter()
            .any(|fault| fault.kind == kind && fault.hits(now, vehicle))
    }

    /// Returns which batteries have which charge at once, 0 to 1, and when.
    pub fn charges(&self) -> Vec<(Time, VehicleId, f64)> {
        let charge_of = |fault: &FaultSpec| match fault.kind {
            FaultKind::Battery(charge) => Some(charge),
            FaultKind::Bus
            | FaultKind::Radio
            | FaultKind::Restart
            | FaultKind::Dead
            | FaultKind::Sensor
            | FaultKind::Gps => None,
        };
        let charges = self
            .list
            .iter()
            .filter_map(|fault| Some((fault, charge_of(fault)?)));
        charges
            .flat_map(|(fault, charge)| {
                fault
                    .vehicles
                    .iter()
                    .map(move |id| (fault.from, *id, charge))
            })
            .collect()
    }

    /// Returns what happens to the software of nodes, and when.
    pub fn turns(&self) -> Vec<(Time, SoftwareFaultEvent)> {
        let turns = self.list.iter().flat_map(turns_of);
        turns
            .filter(|(at, turn)| *at < Time::NEVER && !self.is_kept_down(*at, *turn))
            .collect()
    }

    /// Returns whether software that would start is kept from it by another fault.
    fn is_kept_down(&self, at: Time, turn: SoftwareFaultEvent) -> bool {
        let SoftwareFaultEvent::Starts(node) = turn else {
            return false;
        };
        let ends_software =
            |fault: &&FaultSpec| matches!(fault.kind, FaultKind::Restart | FaultKind::Dead);
        let mut faults = self.list.iter().filter(ends_software);
        faults
            .any(|fault| fault.from <= at && at < fault.until && whom(fault).any(|one| one == node))
    }

    /// Returns when which autopilots hear no satellites.
    pub fn outages(&self) -> Vec<(VehicleId, Outage)> {
        let of_gps = self
            .list
            .iter()
            .filter(|fault| fault.kind == FaultKind::Gps);
        of_gps
            .flat_map(|fault| {
                let outage = Outage {
                    from: fault.from,
                    until: fault.until,
                };
                fault.vehicles.iter().map(move |vehicle| (*vehicle, outage))
            })
            .collect()
    }

    /// Returns the faults of the bus as what it knows: a node without it is a piece of its own.
    pub fn partitions(&self) -> impl Iterator<Item = Partition> {
        let of_bus = self
            .list
            .iter()
            .filter(|fault| fault.kind == FaultKind::Bus);
        of_bus.map(|fault| Partition {
            from: fault.from,
            until: fault.until,
            sides: whom(fault).map(|node| vec![node]).collect(),
        })
    }
}

/// Returns which nodes it hits.
fn whom(fault: &FaultSpec) -> impl Iterator<Item = Sender> + '_ {
    let ground = fault.ground.then_some(Sender::Ground);
    fault
        .vehicles
        .iter()
        .copied()
        .map(Sender::Vehicle)
        .chain(ground)
}

fn turns_of(fault: &FaultSpec) -> Vec<(Time, SoftwareFaultEvent)> {
    let each = |at: Time, turn: fn(Sender) -> SoftwareFaultEvent| {
        whom(fault).map(move |node| (at, turn(node)))
    };
    match fault.kind {
        FaultKind::Dead => each(fault.from, SoftwareFaultEvent::Ends).collect(),
        FaultKind::Restart => each(fault.from, SoftwareFaultEvent::Ends)
            .chain(each(fault.until, SoftwareFaultEvent::Starts))
            .collect(),
        FaultKind::Bus
        | FaultKind::Radio
        | FaultKind::Sensor
        | FaultKind::Gps
        | FaultKind::Battery(_) => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(kind: FaultKind) -> FaultSpec {
        let (from, until) = (Time::from_secs_f64(5.0), Time::from_secs_f64(9.0));
        FaultSpec {
            from,
            until,
            kind,
            vehicles: vec![VehicleId(1), VehicleId(3)],
            ground: false,
        }
    }

    #[test]
    fn a_vehicle_without_bus_hears_neither_the_ground_nor_another_without() {
        let faults = Faults::new(vec![fault(FaultKind::Bus)]);
        let partition = faults.partitions().next().unwrap();
        let (now, one) = (Time::from_secs_f64(6.0), Sender::Vehicle(VehicleId(1)));
        assert!(partition.cuts(now, one, Sender::Ground));
        assert!(partition.cuts(now, one, Sender::Vehicle(VehicleId(3))));
        assert!(!partition.cuts(now, Sender::Vehicle(VehicleId(2)), Sender::Ground));
        assert!(!partition.cuts(Time::from_secs_f64(9.0), one, Sender::Ground));
    }

    #[test]
    fn a_restart_ends_and_starts_and_a_dead_one_stays_dead() {
        let turns = Faults::new(vec![fault(FaultKind::Restart)]).turns();
        assert_eq!(turns.len(), 4);
        assert!(turns.contains(&(
            Time::from_secs_f64(9.0),
            SoftwareFaultEvent::Starts(Sender::Vehicle(VehicleId(3)))
        )));
        let turns = Faults::new(vec![fault(FaultKind::Dead)]).turns();
        assert_eq!(turns.len(), 2);
        let of_ground = FaultSpec {
            vehicles: Vec::new(),
            ground: true,
            ..fault(FaultKind::Restart)
        };
        let turns = [
            (5.0, SoftwareFaultEvent::Ends(Sender::Ground)),
            (9.0, SoftwareFaultEvent::Starts(Sender::Ground)),
        ];
        let turns = turns.map(|(at_s, turn)| (Time::from_secs_f64(at_s), turn));
        assert_eq!(Faults::new(vec![of_ground]).turns(), turns);
    }

    #[test]
    fn of_overlapping_faults_the_last_that_ends_lets_software_start_and_the_dead_stay_dead() {
        let seconds = Time::from_secs_f64;
        let lasting = |kind, from_s, until| FaultSpec {
            from: seconds(from_s),
            until,
            ..fault(kind)
        };
        let starts_of = |list: Vec<FaultSpec>| {
            let turns = Faults::new(list).turns();
            let starts = turns.into_iter().filter(|(_, turn)| turn.starts_vehicle());
            starts.map(|(at, _)| at).collect::<Vec<Time>>()
        };
        let long = lasting(FaultKind::Restart, 20.0, seconds(30.0));
        let short = lasting(FaultKind::Restart, 10.0, seconds(25.0));
        let dead = lasting(FaultKind::Dead, 20.0, Time::NEVER);
        for list in [[long.clone(), short.clone()], [short.clone(), long]] {
            assert_eq!(starts_of(list.to_vec()), [seconds(30.0); 2]);
        }
        assert!(starts_of(vec![dead, short.clone()]).is_empty());
        assert_eq!(starts_of(vec![short]), [seconds(25.0); 2]);
    }

    #[test]
    fn radio_and_sensor_are_dead_for_those_named_and_only_then() {
        let faults = Faults::new(vec![fault(FaultKind::Radio)]);
        assert!(faults.cut_radio(Time::from_secs_f64(5.0), VehicleId(3)));
        assert!(!faults.cut_radio(Time::from_secs_f64(4.9), VehicleId(3)));
        assert!(!faults.cut_radio(Time::from_secs_f64(5.0), VehicleId(2)));
        assert!(!faults.blind(Time::from_secs_f64(5.0), VehicleId(3)));
    }
}
