//! The token ring of real radio actors over modems and modules: how many beacons a second there are, and that none starves.

use std::time::Duration;

use tomoswarm::actor::Actor;
use tomoswarm::config::{self, Config, bundled};
use tomoswarm::geom::{Angle, Point, Pose};
use tomoswarm::hw::xbee_modem::ModemOut;
use tomoswarm::hw::xbee_registers::ModuleKind;
use tomoswarm::node::radio::{In, Out, Radio};
use tomoswarm::node::{OwnState, VehicleSettings};
use tomoswarm::sim::xbee_module::ModuleFaults;
use tomoswarm::time::Time;
use tomoswarm_proto::{Boot, VehicleId, VehicleMode};

use crate::field::Field;

/// A slot of the ring as venues have it where they say nothing of it. With XBees at 57,600 baud `tomoswarm check` refuses it.
const SLOT: Duration = Duration::from_millis(50);
/// The shortest slot that it takes there (tests/config/slots.rs).
const SLOT_AT_57600: Duration = Duration::from_millis(63);
/// What a direct successor waits in the field.
const SUCCESSOR: Option<Duration> = Some(Duration::from_millis(3));

/// How soon vehicles speak after each other.
#[derive(Clone, Copy)]
struct Turns {
    slot: Duration,
    successor: Option<Duration>,
}
/// The ring has formed by then.
const FORMED: Duration = Duration::from_secs(5);
const LASTS: Duration = Duration::from_secs(65);

fn radio(vehicle: u8, turns: Turns) -> Radio {
    let path = bundled::simulation("courtyard").unwrap();
    let text = bundled::load(path).unwrap();
    let Ok(Config::Sim(sim)) = config::read(path, &text, &mut |path| bundled::load(path)) else {
        panic!("{path} is no simulation");
    };
    let place = Point::new(f64::from(vehicle), 0.0);
    let mut settings = VehicleSettings::from_config(&sim, VehicleId(vehicle), Boot(1), place);
    (
        settings.radio.slot,
        settings.radio.channel,
        settings.radio.power_dbm,
    ) = (turns.slot, 15, 8);
    settings.radio.successor = turns.successor;
    Radio::new(settings)
}

/// Where a vehicle is: a beacon is as long as in the field.
fn state(index: usize) -> OwnState {
    OwnState {
        sequence: 1,
        pose: Pose {
            at: Point::new(17.31 + index as f64, -8.42),
            heading: Angle::from_degrees(123.0),
            sd_m: 0.05,
        },
        flight_state: Default::default(),
        speed_mps: 0.0,
        mode: VehicleMode::Idle,
        is_at_rest: true,
        may_move: true,
        sees: true,
        is_armed: true,
        is_landed: true,
        battery: Some(1.0),
        leg: None,
        stored: None,
        accepted: Default::default(),
        ordered: Default::default(),
    }
}

/// What a ring did once it had formed.
struct Talk {
    /// How many beacons a second each vehicle has sent.
    rates: Vec<f64>,
    /// Share of the beacons that a vehicle which ought to have heard one did not.
    missed: f64,
}

/// Lets a ring talk.
fn talk(field: &mut Field, turns: Turns) -> Talk {
    let mut radios: Vec<Radio> = (1..=field.links.len() as u8)
        .map(|vehicle| radio(vehicle, turns))
        .collect();
    let (end, mut before, mut heard) = (Time::ZERO + LASTS, None, 0);
    field.open();
    while field.now < end {
        let slots = radios
            .iter()
            .filter_map(Actor::deadline)
            .map(|deadline| deadline.at);
        let next = slots.min().map_or(end, |at| at.min(end));
        let mut told = field.step(next);
        for (index, radio) in radios.iter_mut().enumerate() {
            if radio
                .deadline()
                .is_none_or(|deadline| field.now < deadline.at)
            {
                continue;
            }
            let mut out = Vec::new();
            radio
                .handle(field.now, In::State(state(index)), &mut out)
                .unwrap();
            radio.wake(field.now, &mut out).unwrap();
            for out in out {
                if let Out::Transmit(beacon) = out {
                    told.extend(
                        field
                            .send(index, beacon)
                            .into_iter()
                            .map(|out| (index, out)),
                    );
                }
            }
        }
        for (index, out) in told {
            let input = match out {
                ModemOut::Heard(beacon) => {
                    heard += u64::from(before.is_some());
                    In::Heard(beacon)
                }
                ModemOut::Unsent(number) => In::Unsent(number),
                ModemOut::Write(_) => panic!("it was carried out"),
            };
            radios[index]
                .handle(field.now, input, &mut Vec::new())
                .unwrap();
        }
        if field.now >= Time::ZERO + FORMED && before.is_none() {
            before = Some(sent(field));
        }
    }
    let seconds = (LASTS - FORMED).as_secs_f64();
    let counts = before.expect("it has formed").into_iter().zip(sent(field));
    let counts: Vec<u64> = counts.map(|(before, after)| after - before).collect();
    let expected = counts.iter().sum::<u64>() * (counts.len() as u64 - 1);
    Talk {
        rates: counts.iter().map(|sent| *sent as f64 / seconds).collect(),
        missed: 1.0 - heard as f64 / expected as f64,
    }
}

fn sent(field: &Field) -> Vec<u64> {
    field
        .links
        .iter()
        .map(|link| link.modem.health().sent)
        .collect()
}

#[test]
fn a_ring_over_modules_is_as_fast_as_its_baud_rate_lets_it_and_starves_nobody() {
    let turns = Turns {
        slot: SLOT,
        successor: None,
    };
    check(turns, &[(57_600, 11.0), (115_200, 13.0), (230_400, 15.0)]);
}

#[test]
fn a_ring_whose_successors_do_not_wait_for_a_slot_is_two_to_four_times_as_fast() {
    let turns = Turns {
        slot: SLOT,
        successor: SUCCESSOR,
    };
    check(turns, &[(57_600, 25.0), (115_200, 40.0), (230_400, 55.0)]);
}

#[test]
fn with_the_slot_that_is_needed_at_57600_baud_a_ring_is_as_fast_as_wanted() {
    for (successor, least) in [(None, 11.0), (SUCCESSOR, 25.0)] {
        let turns = Turns {
            slot: SLOT_AT_57600,
            successor,
        };
        check(turns, &[(57_600, least)]);
    }
}

/// Lets 2, 4 and 8 vehicles talk at each baud rate, with so many beacons a second in all at least.
fn check(turns: Turns, rates: &[(u32, f64)]) {
    let slot_ms = turns.slot.as_millis();
    for (baud, least) in rates.iter().copied() {
        for count in [2, 4, 8] {
            let mut field = Field::of(count, ModuleKind::Xbee3, baud);
            let Talk { rates, missed } = talk(&mut field, turns);
            let sum: f64 = rates.iter().sum();
            let (slowest, fastest) = (
                rates.iter().copied().fold(f64::MAX, f64::min),
                rates.iter().copied().fold(0.0, f64::max),
            );
            let spoilt = field.collisions as f64 / field.packets as f64;
            println!(
                "{baud} baud, slots of {slot_ms} ms, {count}: {sum:.1}/s in all, {slowest:.2} to {fastest:.2} each, {spoilt:.3} spoilt, {missed:.4} missed"
            );
            assert!(sum >= least, "{baud} baud, {count}: {sum:.1}/s");
            assert!(slowest >= 0.5 * fastest, "{baud} baud, {count}: {rates:?}");
            assert!(spoilt < 0.03, "{baud} baud, {count}: {spoilt}");
            assert!(missed < 0.03, "{baud} baud, {count}: {missed}");
        }
    }
}

#[test]
fn a_ring_goes_on_though_the_channel_is_busy_for_a_third_of_one_members_beacons() {
    let mut field = Field::of(4, ModuleKind::Xbee3, 115_200);
    let faults = ModuleFaults {
        busy: 0.3,
        doubled: 0.1,
    };
    field.links[0].module.set_faults(faults);
    let Talk { rates, .. } = talk(
        &mut field,
        Turns {
            slot: SLOT,
            successor: None,
        },
    );
    let sum: f64 = rates.iter().sum();
    assert!(sum >= 11.0, "{rates:?}");
    let health = field.links[0].modem.health();
    let share = health.busy as f64 / (health.sent + health.unsent) as f64;
    assert!((0.2..0.4).contains(&share), "{health:?}");
}
