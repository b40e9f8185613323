//! The devices of a live vehicle, each behind the driver that its file chooses: where a vehicle's effects for devices go, and
//! where their events come from. All simulated ones share one [`WorldLink`]; a real one has a thread of its own.
//!
//! ```text
//!   Command   ─► autopilot ─┐
//!   Steer     ─► servo     ─┤                                  ┌─► Report, Ack
//!   Transmit  ─► radio     ─┼─ simulated ─► link ─► world ─────┼─► Heard, Unsent
//!   Ping      ─► range     ─┤                                  └─► Echo
//!                           ├─ on a serial line ─► range/serial ─► Echo
//!                           ├─ an HC-SR04 ─► range/hcsr04 ─► Echo
//!                           ├─ an output of this machine ─► servo/output
//!                           ├─ an XBee ─► radio/xbee ─► Heard, Unsent
//!                           └─ MAVLink ─► autopilot/mavlink ─► Report, Ack, and Echo of sensors on the autopilot
//! ```
//!
//! It decides nothing. What the bytes of a real device mean is said by `hw`. Only what is for a simulated device goes to the
//! world, and of what the world says only what simulated devices say is believed.

pub mod autopilot;
#[cfg(feature = "hw")]
mod device_thread;
mod device_troubles;
pub mod radio;
pub mod range;
mod reopening;
#[cfg(feature = "hw")]
mod serial_port;
pub mod servo;
#[cfg(feature = "hw")]
pub mod usb_adapter;

use std::io;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use tomoswarm_proto::{AutopilotHealth, Boot, RadioHealth, RangeHealth};

use self::autopilot::Autopilot;
use self::device_troubles::{DeviceTrouble, NamedTroubles};
use self::radio::Radio;
use self::range::Range;
use self::servo::{Servo, WantedPulse};
use super::clock::Clock;
use super::link::{LinkState, WorldLink, WorldLinkSettings};
use super::mailbox::{Troubles, lock};
use crate::autopilot::{Command, NumberedCommand};
use crate::config::{AutopilotDriver, Drivers, RadioDriver, RangeDriver, VehicleFile};
use crate::node::{Effect, Event};

/// Hears what devices say.
pub type EventSink = Arc<dyn Fn(Event) + Send + Sync>;

/// By what names a vehicle tells what is wrong with its devices.
const NAMES: [&str; 4] = ["range sensor", "servo", "autopilot link", "radio"];

/// The devices of a vehicle; dropping them ends their drivers.
pub struct VehicleDevices {
    world: Option<WorldLink>,
    autopilot: Autopilot,
    range: Range,
    servo: Servo,
    radio: Radio,
    /// The pulse that the servo must have before the sensor is asked that was steered last.
    awaited: Mutex<Option<WantedPulse>>,
    named: NamedTroubles,
}

impl VehicleDevices {
    /// Starts the drivers that a vehicle's file names. A device that is not there is no error: it is looked for for ever.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn start(
        file: &VehicleFile,
        boot: Boot,
        clock: Clock,
        events: &EventSink,
    ) -> io::Result<VehicleDevices> {
        let drivers = file.drivers.clone();
        tracing::info!("drivers: {}", drivers.in_words());
        if drivers.range == RangeDriver::None {
            tracing::warn!(
                "there is no range sensor: this vehicle sees nothing, and is not driven"
            );
        }
        let range = Range::start(&drivers, &file.look, clock, events)?;
        let servo = Servo::start(&drivers.servo, &file.look)?;
        let world = drivers
            .has_simulated()
            .then(|| link(file, boot, &range, events))
            .transpose()?;
        let autopilot = Autopilot::start(file, clock, events, range.on_autopilot())?;
        let radio = Radio::start(file, clock, events)?;
        Ok(VehicleDevices {
            world,
            autopilot,
            range,
            servo,
            radio,
            awaited: Mutex::new(None),
            named: NamedTroubles::default(),
        })
    }

    /// Carries out what concerns devices, from any thread; the rest does not concern it.
    pub fn carry_out(&self, effect: &Effect) {
        match effect {
            Effect::Command(_) if self.autopilot.is_simulated() => self.to_world(effect),
            Effect::Command(command) => self.autopilot.command(command),
            Effect::Fix(from, fix) => self.autopilot.fix(*from, *fix),
            // Also where neither servo nor range sensor is simulated: to a simulated autopilot any word of its companion is
            // a sign of life, and it brakes without one. What the world's own servo points at then answers no ping.
            Effect::Steer(beam) => {
                let pulse = self.servo.steer(*beam);
                if let Some(WantedPulse::Autopilot(pulse)) = pulse {
                    self.autopilot.give_pulse(pulse);
                }
                *lock(&self.awaited) = pulse;
                self.range.steer(*beam);
                self.to_world(effect);
            }
            // What a servo has not turned yet would measure along another direction.
            Effect::Ping(_) if !self.is_pointed() => {}
            Effect::Ping(ping) => {
                self.range.ping(*ping);
                if self.range.is_simulated() {
                    self.to_world(effect);
                }
            }
            Effect::Transmit(_) if self.radio.is_simulated() => self.to_world(effect),
            Effect::Transmit(beacon) => self.radio.transmit(beacon),
            Effect::Publish(_)
            | Effect::Keep(..)
            | Effect::Forget { .. }
            | Effect::Recall { .. }
            | Effect::Remember(_)
            | Effect::KeepStops(_)
            | Effect::VehicleEvent(_) => {}
        }
    }

    /// Tells the autopilot to stop, when no actor is left who could; nobody waits for its answer.
    pub fn stop(&self) {
        self.carry_out(&Effect::Command(NumberedCommand {
            number: 0,
            command: Command::Stop,
        }));
    }

    /// Names what is wrong with the devices, and takes back what is not any more.
    pub fn watch(&self, troubles: &Troubles) {
        let watch = |who: &str, trouble: Option<String>| match trouble {
            Some(trouble) => troubles.raise(who, trouble),
            None => troubles.clear(who),
        };
        let own = self.troubles();
        self.named.name(Instant::now(), &own);
        for who in NAMES {
            let of_name = own.iter().filter(|trouble| trouble.who == who);
            let all: Vec<&str> = of_name.map(|trouble| trouble.what.as_str()).collect();
            watch(who, (!all.is_empty()).then(|| all.join("; ")));
        }
        let Some(world) = &self.world else { return };
        watch(
            "world",
            match world.state() {
                LinkState::Joined(_) => None,
                LinkState::Connecting(reason) => {
                    Some(reason.unwrap_or_else(|| "not connected".to_owned()))
                }
                LinkState::Refused(refused) => Some(refused.to_string()),
            },
        );
    }

    /// Returns whether something is wrong that [`VehicleDevices::watch`] has not named; costs next to nothing while nothing
    /// is.
    pub fn has_new_trouble(&self) -> bool {
        self.named.has_new(&self.troubles())
    }

    fn troubles(&self) -> Vec<DeviceTrouble> {
        let [range_sensor, servo, autopilot_link, radio] = NAMES;
        let on_autopilot = || self.autopilot.servo_trouble();
        let of_sensors = self.range.troubles();
        let single = [
            (servo, self.servo.trouble().or_else(on_autopilot)),
            (autopilot_link, self.autopilot.trouble()),
            (radio, self.radio.trouble()),
        ];
        let of_sensors = of_sensors.map(|(nth, what)| DeviceTrouble {
            who: range_sensor,
            nth,
            what,
        });
        let single = single.into_iter().filter_map(|(who, what)| {
            let what = what?;
            Some(DeviceTrouble { who, nth: 0, what })
        });
        of_sensors.chain(single).collect()
    }

    /// Returns what the range sensor has done; `None` for a vehicle that has none.
    pub fn range_health(&self) -> Option<RangeHealth> {
        self.range.health()
    }

    /// Returns what the radio has done; `None` of a simulated one.
    pub fn radio_health(&self) -> Option<RadioHealth> {
        self.radio.health()
    }

    /// Returns what the autopilot has said of its health.
    pub fn autopilot_health(&self) -> Option<AutopilotHealth> {
        match self.autopilot.is_simulated() {
            true => Some(AutopilotHealth::default()),
            false => self.autopilot.health(),
        }
    }

    /// Returns whether the sensor that was steered last is known to look there, as far as a real servo turns it.
    fn is_pointed(&self) -> bool {
        let awaited = *lock(&self.awaited);
        match awaited {
            None => true,
            Some(WantedPulse::Machine(pulse)) => self.servo.stands_by(pulse),
            Some(WantedPulse::Autopilot(pulse)) => self.autopilot.given_pulse() == Some(pulse),
        }
    }

    fn to_world(&self, effect: &Effect) {
        if let Some(world) = &self.world {
            world.send(effect);
        }
    }
}

/// Begins to connect to the world; what it says is told when a simulated device says it.
fn link(
    file: &VehicleFile,
    boot: Boot,
    range: &Range,
    events: &EventSink,
) -> io::Result<WorldLink> {
    let settings = WorldLinkSettings {
        address: file.world.connect,
        token: file.world.token.clone(),
        vehicle: file.id,
        boot,
    };
    let (drivers, events) = (file.drivers.clone(), events.clone());
    let pings = range.simulated_pings();
    WorldLink::connect(settings, move |event| {
        if let (Event::Echo(echo), Some(pings)) = (&event, &pings) {
            pings.answered(echo.number);
        }
        if is_of_simulated(&drivers, &event) {
            events(event);
        }
    })
}

/// Returns whether a simulated device of these says such an event.
fn is_of_simulated(drivers: &Drivers, event: &Event) -> bool {
    match event {
        Event::Report(_) | Event::Ack(_) => drivers.autopilot == AutopilotDriver::Simulated,
        Event::Echo(_) => drivers.range == RangeDriver::Simulated,
        Event::Heard(_) | Event::Unsent(_) => drivers.radio == RadioDriver::Simulated,
        Event::Bus(..)
        | Event::SampleStored(..)
        | Event::Recalled(_)
        | Event::Dropped(_)
        | Event::Remembered(_)
        | Event::Facts(_) => false,
    }
}

#[cfg(test)]
pub(super) mod tests;
