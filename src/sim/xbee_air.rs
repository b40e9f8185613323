//! Simulated XBees on the air of a world: whoever is on a channel is heard by the others as strongly as the world's radio field
//! says, and two at once on one channel are lost. Pure: it is told what hosts say and what time it is, and says what they hear.

use crate::geom::Point;
use crate::sim::air::Sent;
use crate::sim::environment::Environment;
use crate::sim::xbee_module::{ModuleOut, Packet, XbeeModule};
use crate::time::Time;

/// The modules of all vehicles, in their order.
#[derive(Clone, Debug)]
pub struct XbeeAir {
    modules: Vec<XbeeModule>,
    on_air: Vec<OnAir>,
    /// Packets that were ever on the air.
    packets: u64,
    /// Payloads that reached a host, each receiver counted.
    heard: u64,
    /// Packets that were lost because two spoke at once.
    collided: u64,
}

#[derive(Clone, Debug)]
struct OnAir {
    from: usize,
    /// Where the vehicle was when it began.
    place: Point,
    packet: Packet,
    number: u64,
    until: Time,
    is_spoilt: bool,
}

impl XbeeAir {
    /// Puts modules on one air.
    pub fn new(modules: Vec<XbeeModule>) -> XbeeAir {
        XbeeAir {
            modules,
            on_air: Vec::new(),
            packets: 0,
            heard: 0,
            collided: 0,
        }
    }

    /// Returns how many payloads reached a host, each receiver counted.
    pub fn heard(&self) -> u64 {
        self.heard
    }

    /// Returns how many packets were lost because two spoke at once.
    pub fn collided(&self) -> u64 {
        self.collided
    }

    /// Returns the module of a vehicle, by its index, for its host.
    pub fn module(&mut self, vehicle: usize) -> Option<&mut XbeeModule> {
        self.modules.get_mut(vehicle)
    }

    /// Returns when something happens by itself next.
    pub fn deadline(&self) -> Option<Time> {
        let modules = self.modules.iter().filter_map(XbeeModule::deadline);
        modules
            .chain(self.on_air.iter().map(|packet| packet.until))
            .min()
    }

    /// Lets everything happen that is due by now; `to_host` gets what the host of a vehicle is told.
    pub fn due(
        &mut self,
        now: Time,
        environment: &Environment,
        to_host: &mut Vec<(usize, Vec<u8>)>,
    ) {
        while let Some(at) = self.deadline().filter(|at| *at <= now) {
            self.end_packets(at, environment);
            for vehicle in 0..self.modules.len() {
                let is_due = |module: &XbeeModule| module.deadline().is_some_and(|due| due <= at);
                if self.modules.get(vehicle).is_some_and(is_due) {
                    self.wake(vehicle, at, environment, to_host);
                }
            }
        }
    }

    /// Delivers what has been on the air to its end.
    fn end_packets(&mut self, at: Time, environment: &Environment) {
        let (ended, on_air): (Vec<OnAir>, Vec<OnAir>) = std::mem::take(&mut self.on_air)
            .into_iter()
            .partition(|packet| packet.until <= at);
        self.on_air = on_air;
        self.collided += ended.iter().filter(|packet| packet.is_spoilt).count() as u64;
        let clear = |packet: &OnAir| !packet.is_spoilt;
        for OnAir {
            from,
            place,
            packet,
            number,
            ..
        } in ended.into_iter().filter(clear)
        {
            let sent = Sent {
                from,
                place,
                channel: packet.channel,
                power_dbm: packet.power_dbm,
                key: [packet.from64, u64::from(packet.from16), number],
                frame: [].into(),
            };
            for (to, module) in self.modules.iter_mut().enumerate() {
                if let Some(rssi_dbm) = environment.received_dbm(&sent, to) {
                    self.heard += u64::from(module.receive(at, &packet, rssi_dbm));
                }
            }
        }
    }

    fn wake(
        &mut self,
        vehicle: usize,
        at: Time,
        environment: &Environment,
        to_host: &mut Vec<(usize, Vec<u8>)>,
    ) {
        let Some(module) = self.modules.get_mut(vehicle) else {
            return;
        };
        let channel = module.channel();
        let is_busy = self
            .on_air
            .iter()
            .any(|other| other.from != vehicle && other.packet.channel == channel);
        let mut out = Vec::new();
        module.due(at, is_busy, &mut out);
        for said in out {
            match said {
                ModuleOut::Host(bytes) => to_host.push((vehicle, bytes)),
                ModuleOut::OnAir(packet, until) => {
                    let place = environment.world().truth(vehicle, at).at;
                    self.begin(vehicle, place, packet, until);
                }
            }
        }
    }

    fn begin(&mut self, from: usize, place: Point, packet: Packet, until: Time) {
        self.packets += 1;
        let mut is_spoilt = false;
        for other in &mut self.on_air {
            if other.packet.channel == packet.channel {
                (other.is_spoilt, is_spoilt) = (true, true);
            }
        }
        self.on_air.push(OnAir {
            from,
            place,
            packet,
            number: self.packets,
            until,
            is_spoilt,
        });
    }
}
