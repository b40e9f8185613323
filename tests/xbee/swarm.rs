//! Vehicles that speak in turn over modems and modules.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm::hw::xbee_frame::ApiMode;
use tomoswarm::hw::xbee_modem::{ModemOut, XbeeModem};
use tomoswarm::hw::xbee_registers::{AP, EE, ModuleKind, ModuleSettings};
use tomoswarm::sim::xbee_module::ModuleFaults;
use tomoswarm::time::Time;
use tomoswarm_proto::{Beacon, Boot, VehicleId};

use crate::field::{Field, module, rssi_dbm, wanted};

/// Each speaks this often.
const ROUND: Duration = Duration::from_millis(400);
/// A beacon has arrived, and its sender knows it, after this time at any baud rate.
const ARRIVED: Duration = Duration::from_millis(40);

/// A vehicle as a speaker: numbers its beacons, and notes what it hears.
#[derive(Default)]
struct Speaker {
    /// Of its last beacon that has not come back.
    last: u32,
    unsent: u32,
    /// Of each peer: numbers in the order in which they came, and how strongly.
    heard: BTreeMap<u8, Vec<(u32, i16)>>,
}

impl Speaker {
    fn take(&mut self, out: ModemOut) {
        match out {
            ModemOut::Heard(heard) => {
                let numbers = self.heard.entry(heard.beacon.sender.0).or_default();
                numbers.push((heard.beacon.sequence, heard.rssi_dbm));
            }
            ModemOut::Unsent(number) => {
                assert_eq!(number, self.last, "the last one comes back first");
                self.last -= 1;
                self.unsent += 1;
            }
            ModemOut::Write(_) => panic!("it was carried out"),
        }
    }
}

/// Vehicles that speak in turn.
struct Swarm {
    field: Field,
    speakers: Vec<Speaker>,
    turn: Duration,
    /// Who speaks next, and when.
    next: (usize, Time),
}

impl Swarm {
    /// Opens all ports; the first one speaks after a second.
    fn new(mut field: Field) -> Swarm {
        field.open();
        let count = field.links.len();
        Swarm {
            speakers: (0..count).map(|_| Speaker::default()).collect(),
            turn: ROUND / count as u32,
            next: (0, at_s(1)),
            field,
        }
    }

    fn run(&mut self, until: Time) {
        while self.field.now < until {
            let told = self.field.step(self.next.1.min(until));
            for (index, out) in told {
                self.speakers[index].take(out);
            }
            if self.field.now == self.next.1 {
                self.speak();
            }
        }
    }

    fn speak(&mut self) {
        let (index, at) = self.next;
        let speaker = &mut self.speakers[index];
        speaker.last += 1;
        let said = self.field.send(index, beacon(index, speaker.last));
        said.into_iter().for_each(|out| speaker.take(out));
        self.next = ((index + 1) % self.speakers.len(), at + self.turn);
    }

    /// All have heard all others without a gap, as strongly as they are far.
    fn everybody_heard_everybody(&self) {
        assert_eq!(self.field.collisions, 0);
        for (to, speaker) in self.speakers.iter().enumerate() {
            for (from, other) in self
                .speakers
                .iter()
                .enumerate()
                .filter(|(from, _)| *from != to)
            {
                let heard = &speaker.heard[&(from as u8 + 1)];
                let expected: Vec<(u32, i16)> = (1..=other.last)
                    .map(|number| (number, rssi_dbm(from, to)))
                    .collect();
                assert_eq!(*heard, expected, "{to} of {from}");
            }
        }
    }
}

fn beacon(index: usize, number: u32) -> Beacon {
    Beacon {
        sender: VehicleId(index as u8 + 1),
        boot: Boot(3),
        sequence: number,
        pose: Some(Default::default()),
        channel: 15,
        power_dbm: 8,
        members: (1..=8).map(VehicleId).collect(),
        ..Beacon::default()
    }
}

fn at_s(seconds: u64) -> Time {
    Time::ZERO + Duration::from_secs(seconds)
}

#[test]
fn two_four_and_eight_hear_each_beacon_of_each_other_with_its_strength() {
    for kind in [ModuleKind::S2c, ModuleKind::Xbee3] {
        for baud in [57_600, 115_200, 230_400] {
            for count in [2, 4, 8] {
                let mut swarm = Swarm::new(Field::of(count, kind, baud));
                swarm.run(at_s(21) - swarm.turn + ARRIVED);
                let links = &swarm.field.links;
                assert!(
                    links.iter().all(|link| link.modem.is_ready()),
                    "{kind:?} {baud}"
                );
                assert!(swarm.speakers.iter().all(|speaker| speaker.last == 50));
                swarm.everybody_heard_everybody();
            }
        }
    }
}

#[test]
fn modules_in_mode_1_are_heard_alike() {
    let mut field = Field::new();
    for vehicle in 1..=3 {
        let wanted = ModuleSettings {
            mode: ApiMode::Plain,
            ..wanted(vehicle)
        };
        field.add(
            XbeeModem::new(wanted),
            module(ModuleKind::S2c, &wanted, 115_200),
        );
    }
    let mut swarm = Swarm::new(field);
    swarm.run(at_s(21) - swarm.turn + ARRIVED);
    assert!(swarm.speakers.iter().all(|speaker| speaker.last >= 49));
    swarm.everybody_heard_everybody();
}

#[test]
fn a_busy_channel_at_one_sender_costs_it_beacons_and_is_a_miss_to_nobody() {
    for count in [2, 4, 8] {
        let mut field = Field::of(count, ModuleKind::Xbee3, 115_200);
        field.links[0].module.set_faults(ModuleFaults {
            busy: 0.3,
            doubled: 0.0,
        });
        let mut swarm = Swarm::new(field);
        swarm.run(at_s(201) - swarm.turn + ARRIVED);
        swarm.everybody_heard_everybody();
        let health = swarm.field.links[0].modem.health();
        assert_eq!(
            (health.sent + health.unsent, health.unsent),
            (500, health.busy)
        );
        let speaker = &swarm.speakers[0];
        assert_eq!(
            (u64::from(speaker.last), u64::from(speaker.unsent)),
            (health.sent, health.unsent)
        );
        assert!((120..180).contains(&health.unsent), "{}", health.unsent);
        let others = &swarm.field.links[1..];
        assert!(others.iter().all(|link| link.modem.health().unsent == 0));
    }
}

#[test]
fn a_packet_that_a_module_says_twice_is_heard_twice_under_one_number() {
    let mut field = Field::new();
    for vehicle in 1..=2 {
        let wanted = ModuleSettings {
            power_dbm: 0,
            ..wanted(vehicle)
        };
        field.add(
            XbeeModem::new(wanted),
            module(ModuleKind::S1, &wanted, 57_600),
        );
    }
    field.links[1].module.set_faults(ModuleFaults {
        busy: 0.0,
        doubled: 0.2,
    });
    let mut swarm = Swarm::new(field);
    swarm.run(at_s(81));
    let heard = &swarm.speakers[1].heard[&1];
    assert!((220..260).contains(&heard.len()), "{}", heard.len());
    let mut once = heard.clone();
    once.dedup();
    assert_eq!(once.len(), 200);
}

#[test]
fn a_module_that_resets_while_a_beacon_is_sent_leaves_no_gap() {
    let mut swarm = Swarm::new(Field::of(4, ModuleKind::Xbee3, 115_200));
    for (seconds, cut_ms) in (2..).zip(0..10) {
        swarm.run(at_s(2 * seconds));
        while swarm.next.0 != 1 {
            swarm.run(swarm.next.1);
        }
        swarm.run(swarm.field.now + Duration::from_millis(cut_ms));
        let now = swarm.field.now;
        swarm.field.links[0].module.switch_on(now);
    }
    swarm.run(at_s(24));
    assert!(swarm.field.links[0].modem.is_ready());
    let unsent = swarm.speakers[0].unsent;
    assert!((5..=20).contains(&unsent), "at most two a reset: {unsent}");
    for speaker in &swarm.speakers[1..] {
        let mut heard: Vec<u32> = speaker.heard[&1]
            .iter()
            .map(|(number, _)| *number)
            .collect();
        heard.dedup();
        let last = *heard.last().unwrap();
        assert!(heard.iter().copied().eq(1..=last), "{heard:?}");
        assert!(swarm.speakers[0].last - last <= 1);
    }
}

#[test]
fn a_module_that_is_plugged_in_again_sends_within_a_second() {
    let mut swarm = Swarm::new(Field::of(4, ModuleKind::Xbee3, 57_600));
    for second in 3..20 {
        swarm.run(at_s(second) + Duration::from_millis(7 * second));
        let said = swarm.field.replug(0);
        said.into_iter().for_each(|out| swarm.speakers[0].take(out));
        let before = swarm.field.links[0].modem.health().sent;
        swarm.run(swarm.field.now + Duration::from_secs(1));
        let health = swarm.field.links[0].modem.health();
        assert!(health.sent > before && health.reopens == second - 2);
    }
    let unsent = swarm.speakers[0].unsent;
    assert!(unsent <= 2 * 17, "{unsent}");
}

#[test]
fn a_module_in_the_other_mode_is_told_whichever_that_is() {
    let modes = [ApiMode::Plain, ApiMode::Escaped];
    for (index, mode) in modes.into_iter().enumerate() {
        let other = modes[1 - index];
        let of = |mode| ModuleSettings { mode, ..wanted(1) };
        let mut field = Field::new();
        let module = module(ModuleKind::Xbee3, &of(other), 115_200);
        field.add(XbeeModem::new(of(mode)), module);
        field.open();
        while field.now < at_s(1) {
            field.step(at_s(1));
        }
        let troubles = field.links[0].modem.troubles(field.now);
        let expected = format!(
            "AP is {}, wanted {}: `tomoswarm xbee setup` sets it",
            other.register(),
            mode.register()
        );
        assert_eq!(troubles.len(), 1);
        assert!(troubles[0].to_string().ends_with(&expected), "{troubles:?}");
    }
}

#[test]
fn a_module_in_transparent_mode_is_said_to_be_silent_and_speaks_once_it_is_set_up() {
    let mut transparent = module(ModuleKind::Xbee3, &wanted(1), 115_200);
    assert!(transparent.set_register(AP, &[0]));
    let mut field = Field::new();
    field.add(XbeeModem::new(wanted(1)), transparent);
    for vehicle in [2, 3] {
        let settings = wanted(vehicle);
        field.add(
            XbeeModem::new(settings),
            module(ModuleKind::Xbee3, &settings, 115_200),
        );
    }
    let mut swarm = Swarm::new(field);
    swarm.run(at_s(10));
    let link = &swarm.field.links[0];
    let troubles = link.modem.troubles(swarm.field.now);
    assert_eq!(troubles.len(), 1, "{troubles:?}");
    let said = troubles[0].to_string();
    assert!(
        said.starts_with("the module does not answer") && said.contains("in transparent mode"),
        "{said}"
    );
    assert!(said.ends_with("`tomoswarm xbee setup` finds it"), "{said}");
    assert_eq!(
        (link.modem.is_ready(), link.modem.health().sent),
        (false, 0)
    );
    let speaker = &swarm.speakers[0];
    assert!(speaker.last == 0 && speaker.unsent > 20, "all come back");
    // What the driver asks goes on the air as it is, and is a beacon to nobody; the others talk on.
    for (index, other) in [(1, 3), (2, 2)] {
        let speaker = &swarm.speakers[index];
        assert_eq!(speaker.heard.keys().copied().collect::<Vec<u8>>(), [other]);
        assert!(speaker.heard[&other].len() > 20);
    }
    assert!(swarm.field.links[0].module.set_register(AP, &[2]));
    swarm.run(at_s(13));
    let modem = &swarm.field.links[0].modem;
    assert_eq!(modem.troubles(swarm.field.now), []);
    assert!(modem.health().sent > 3);
}

#[test]
fn a_module_that_encrypts_is_refused_by_that_name() {
    let mut encrypting = module(ModuleKind::Xbee3, &wanted(1), 115_200);
    assert!(encrypting.set_register(EE, &[1]));
    let mut field = Field::new();
    field.add(XbeeModem::new(wanted(1)), encrypting);
    field.open();
    while field.now < at_s(1) {
        field.step(at_s(1));
    }
    let modem = &field.links[0].modem;
    let troubles = modem.troubles(field.now);
    assert!(!modem.is_ready() && troubles.len() == 1, "{troubles:?}");
    let said = troubles[0].to_string();
    assert!(said.contains("it encrypts (EE is 1, wanted 0)"), "{said}");
    assert!(said.ends_with("`tomoswarm xbee setup` sets it"), "{said}");
}

#[test]
fn a_module_of_another_network_or_baud_rate_is_told_and_hears_nobody() {
    let mut field = Field::of(2, ModuleKind::Xbee3, 115_200);
    let other = ModuleSettings {
        network: 7,
        ..wanted(3)
    };
    let elsewhere = module(ModuleKind::Xbee3, &other, 115_200);
    let mut slow = module(ModuleKind::Xbee3, &wanted(4), 57_600);
    slow.open(115_200);
    field.add(XbeeModem::new(wanted(3)), elsewhere);
    field.add(XbeeModem::new(wanted(4)), slow);
    let mut swarm = Swarm::new(field);
    swarm.run(at_s(10));
    let troubles = |index: usize| {
        let troubles = swarm.field.links[index].modem.troubles(swarm.field.now);
        troubles.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert!(troubles(0).is_empty() && troubles(1).is_empty());
    assert!(
        troubles(2)[0].contains("ID is 7, wanted 1A2B"),
        "{:?}",
        troubles(2)
    );
    assert!(
        troubles(3)[0].contains("does not answer"),
        "{:?}",
        troubles(3)
    );
    assert!(swarm.speakers[2].heard.is_empty() && swarm.speakers[3].heard.is_empty());
    assert_eq!(
        swarm.speakers[0].heard.keys().copied().collect::<Vec<_>>(),
        [2]
    );
}
