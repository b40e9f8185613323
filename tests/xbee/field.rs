//! Vehicles' modems with simulated modules on one air, in virtual time. Everybody hears everybody, the weaker the further apart
//! in the list; packets that overlap are lost.

use tomoswarm::config::XBEE_BAUDS;
use tomoswarm::hw::xbee_frame::ApiMode;
use tomoswarm::hw::xbee_modem::{ModemOut, XbeeModem};
use tomoswarm::hw::xbee_registers::{AP, BD, CH, ID, MY, ModuleKind, ModuleSettings, PL};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::xbee_module::{ModuleOut, Packet, XbeeModule};
use tomoswarm::time::Time;
use tomoswarm_proto::{Beacon, VehicleId};

/// What the module of a vehicle is to be.
pub fn wanted(vehicle: u8) -> ModuleSettings {
    ModuleSettings {
        vehicle: VehicleId(vehicle),
        network: 0x1A2B,
        channel: 15,
        power_dbm: 8,
        mode: ApiMode::Escaped,
    }
}

/// A module that is so, switched on.
pub fn module(kind: ModuleKind, wanted: &ModuleSettings, baud: u32) -> XbeeModule {
    let mut module = XbeeModule::new(
        kind,
        0x0013_A200_4000_0000 + u64::from(wanted.address()),
        Noise::new(5),
    );
    let level = kind
        .powers_dbm()
        .iter()
        .position(|power| *power == wanted.power_dbm);
    let code = XBEE_BAUDS.iter().position(|known| *known == baud);
    let values = [
        (AP, u16::from(wanted.mode.register())),
        (BD, code.expect("a code of it") as u16),
        (MY, wanted.address()),
        (ID, wanted.network),
        (CH, wanted.channel.into()),
        (PL, level.expect("a level of it") as u16),
    ];
    for (name, value) in values {
        assert!(module.set_register(name, &value.to_be_bytes()), "{name}");
    }
    module.switch_on(Time::ZERO);
    module.open(baud);
    module
}

/// How strongly one of the list hears another.
pub fn rssi_dbm(from: usize, to: usize) -> i16 {
    -40 - 3 * from.abs_diff(to) as i16
}

/// A vehicle's end.
pub struct Link {
    pub modem: XbeeModem,
    pub module: XbeeModule,
}

/// All of them.
pub struct Field {
    pub now: Time,
    pub links: Vec<Link>,
    air: Vec<OnAir>,
    /// Packets that were on the air, and those that another one has spoilt.
    pub packets: u64,
    pub collisions: u64,
}

struct OnAir {
    from: usize,
    packet: Packet,
    until: Time,
    is_spoilt: bool,
}

impl Field {
    pub fn new() -> Field {
        Field {
            now: Time::ZERO,
            links: Vec::new(),
            air: Vec::new(),
            packets: 0,
            collisions: 0,
        }
    }

    /// Vehicles 1 and up with good modules.
    pub fn of(count: u8, kind: ModuleKind, baud: u32) -> Field {
        let mut field = Field::new();
        for vehicle in 1..=count {
            let wanted = wanted(vehicle);
            field.add(XbeeModem::new(wanted), module(kind, &wanted, baud));
        }
        field
    }

    pub fn add(&mut self, modem: XbeeModem, module: XbeeModule) {
        self.links.push(Link { modem, module });
    }

    /// Opens all ports.
    pub fn open(&mut self) {
        for index in 0..self.links.len() {
            let mut out = Vec::new();
            self.links[index].modem.opened(self.now, &mut out);
            self.carry_out(index, out);
        }
    }

    /// The module of a vehicle is pulled out, and plugged in again.
    pub fn replug(&mut self, index: usize) -> Vec<ModemOut> {
        let (now, mut out) = (self.now, Vec::new());
        let Link { modem, module } = &mut self.links[index];
        modem.closed(&mut out);
        module.switch_on(now);
        modem.opened(now, &mut out);
        self.carry_out(index, out)
    }

    /// A vehicle sends a beacon.
    pub fn send(&mut self, index: usize, beacon: Beacon) -> Vec<ModemOut> {
        let mut out = Vec::new();
        self.links[index].modem.send(self.now, beacon, &mut out);
        self.carry_out(index, out)
    }

    /// Goes to what happens next, or to a time if nothing happens before it; returns what the vehicles are told.
    pub fn step(&mut self, until: Time) -> Vec<(usize, ModemOut)> {
        let ends = self.air.iter().map(|on_air| on_air.until);
        let modules = self.links.iter().filter_map(|link| link.module.deadline());
        let modems = self.links.iter().filter_map(|link| link.modem.deadline());
        let next = ends
            .chain(modules)
            .chain(modems)
            .min()
            .unwrap_or(Time::NEVER);
        self.now = next.min(until).max(self.now);
        self.end_packets();
        let mut told = Vec::new();
        for index in 0..self.links.len() {
            let mut out = Vec::new();
            self.links[index].modem.due(self.now, &mut out);
            out.extend(self.due(index));
            let said = self.carry_out(index, out);
            told.extend(said.into_iter().map(|out| (index, out)));
        }
        told
    }

    fn end_packets(&mut self) {
        let now = self.now;
        let ended: Vec<OnAir> = self
            .air
            .extract_if(.., |on_air| on_air.until <= now)
            .collect();
        for on_air in ended.iter().filter(|on_air| !on_air.is_spoilt) {
            for (to, link) in self.links.iter_mut().enumerate() {
                if to != on_air.from {
                    link.module
                        .receive(now, &on_air.packet, rssi_dbm(on_air.from, to));
                }
            }
        }
    }

    fn due(&mut self, index: usize) -> Vec<ModemOut> {
        let channel = self.links[index].module.channel();
        let is_busy = self
            .air
            .iter()
            .any(|on_air| on_air.packet.channel == channel);
        let (mut said, mut out) = (Vec::new(), Vec::new());
        self.links[index].module.due(self.now, is_busy, &mut said);
        for said in said {
            match said {
                ModuleOut::Host(bytes) => self.links[index].modem.take(self.now, &bytes, &mut out),
                ModuleOut::OnAir(packet, until) => self.begin_packet(index, packet, until),
            }
        }
        out
    }

    fn begin_packet(&mut self, from: usize, packet: Packet, until: Time) {
        let mut is_spoilt = false;
        for other in self
            .air
            .iter_mut()
            .filter(|other| other.packet.channel == packet.channel)
        {
            (other.is_spoilt, is_spoilt) = (true, true);
        }
        self.packets += 1;
        self.collisions += u64::from(is_spoilt);
        self.air.push(OnAir {
            from,
            packet,
            until,
            is_spoilt,
        });
    }

    /// Hands bytes to the module; returns the rest.
    fn carry_out(&mut self, index: usize, out: Vec<ModemOut>) -> Vec<ModemOut> {
        let (now, module) = (self.now, &mut self.links[index].module);
        out.into_iter()
            .filter(|out| match out {
                ModemOut::Write(bytes) => {
                    module.write(now, bytes);
                    false
                }
                ModemOut::Heard(_) | ModemOut::Unsent(_) => true,
            })
            .collect()
    }
}
