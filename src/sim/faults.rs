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
        self.list
            .iter()
            .flat_map(turns_of)
            .filter(|(at, _)| *at < Time::NEVER)
            .collect()
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
    fn radio_and_sensor_are_dead_for_those_named_and_only_then() {
        let faults = Faults::new(vec![fault(FaultKind::Radio)]);
        assert!(faults.cut_radio(Time::from_secs_f64(5.0), VehicleId(3)));
        assert!(!faults.cut_radio(Time::from_secs_f64(4.9), VehicleId(3)));
        assert!(!faults.cut_radio(Time::from_secs_f64(5.0), VehicleId(2)));
        assert!(!faults.blind(Time::from_secs_f64(5.0), VehicleId(3)));
    }
}
