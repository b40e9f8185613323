//! Simulated XBees at pseudo-terminals: each vehicle of a world has one, on which the real driver speaks real frames. What
//! a module does is said by [`crate::sim::xbee_air`].
//!
//! ```text
//!   FOLDER/vehicle-1 ─► pseudo-terminal ─bytes, baud rate─► reader ─► the world's thread ─► module ─► air
//!                                       ◄───────────────────bytes─────────────────────── module ◄─┘
//! ```

use std::ffi::OsStr;
use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serial2::SerialPort;
use tomoswarm_proto::VehicleId;

use crate::config::{Venue, XBEE_BAUD, XBEE_BAUDS};
use crate::hw::xbee_registers::{AP, BD, CH, ID, MY, ModuleKind, ModuleSettings, PL};
use crate::run::link::WorldStatus;
use crate::sim::environment::Environment;
use crate::sim::noise::Noise;
use crate::sim::xbee_air::XbeeAir;
use crate::sim::xbee_module::XbeeModule;
use crate::time::Time;

/// The file in the folder of the ports that is locked while a world shows them.
const LOCK: &str = ".lock";
/// A reader looks this often whether it shall end, and whether somebody has opened the port.
const READ_FOR: Duration = Duration::from_millis(50);
/// What nobody reads within this time is lost.
const WRITE_FOR: Duration = Duration::from_millis(1);
/// Serial numbers of the maker begin with this.
const SERIALS: u64 = 0x0013_A200_4000_0000;

/// What a host has done at its port.
#[derive(Debug)]
pub(super) enum FromHost {
    /// It has said bytes, at a baud rate.
    Bytes(Vec<u8>, u32),
    /// It has closed the port.
    Closed,
}

/// The modules of a world, and their ports; dropping them removes the ports.
pub(super) struct XbeePtys {
    air: XbeeAir,
    ports: Vec<Pty>,
    /// Held for its lock.
    _lock: File,
}

/// The port of a module.
struct Pty {
    port: Arc<SerialPort>,
    link: PathBuf,
    is_ended: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

/// What the modules are to be.
pub(super) struct PtySettings {
    /// Where the ports are shown: one for each vehicle, `vehicle-N`.
    pub folder: PathBuf,
    /// The venue.
    pub venue: Venue,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Chance of the world.
    pub noise: Noise,
}

impl XbeePtys {
    /// Opens a port for each vehicle, with a module as `tomoswarm xbee setup` leaves it; `told` gets what hosts do, by the
    /// vehicle's index, on threads of their own.
    ///
    /// # Errors
    /// There are no pseudo-terminals, or the folder cannot be written.
    pub(super) fn open(
        settings: &PtySettings,
        environment: &Environment,
        told: impl Fn(usize, FromHost) + Clone + Send + 'static,
    ) -> io::Result<XbeePtys> {
        std::fs::create_dir_all(&settings.folder)?;
        let lock = File::create(settings.folder.join(LOCK))?;
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            return Err(io::Error::other(
                "another world shows its modules there; another folder is expected",
            ));
        }
        let world = environment.world();
        let mut modules = Vec::new();
        let mut ports = Vec::new();
        for index in 0..world.vehicles() {
            let id = world.id(index);
            modules.push(module(settings, id));
            let told = told.clone();
            let link = settings.folder.join(format!("vehicle-{id}"));
            ports.push(Pty::open(link, move |said| told(index, said))?);
        }
        Ok(XbeePtys {
            air: XbeeAir::new(modules),
            ports,
            _lock: lock,
        })
    }

    /// Takes what a host has done.
    pub(super) fn take(&mut self, now: Time, vehicle: usize, said: FromHost) {
        let Some(module) = self.air.module(vehicle) else {
            return;
        };
        match said {
            FromHost::Bytes(bytes, baud) => {
                module.open(baud);
                module.write(now, &bytes);
            }
            FromHost::Closed => module.close(),
        }
    }

    /// Returns when something happens by itself next.
    pub(super) fn deadline(&self) -> Time {
        self.air.deadline().unwrap_or(Time::NEVER)
    }

    /// Adds what the modules have carried to how it is going.
    pub(super) fn count(&self, status: &mut WorldStatus) {
        status.beacons_heard += self.air.heard();
        status.collided_beacons += self.air.collided();
    }

    /// Lets everything happen that is due by now.
    pub(super) fn due(&mut self, now: Time, environment: &Environment) {
        let mut to_host = Vec::new();
        self.air.due(now, environment, &mut to_host);
        for (vehicle, bytes) in to_host {
            if let Some(pty) = self.ports.get(vehicle) {
                // What a host does not read is lost, as on a wire.
                let _ = pty.port.write_all(&bytes);
            }
        }
    }
}

/// Returns the module of a vehicle, switched on.
fn module(settings: &PtySettings, vehicle: VehicleId) -> XbeeModule {
    let wanted = ModuleSettings::of_venue(vehicle, &settings.venue, settings.power_dbm);
    let level = |kind: ModuleKind| {
        let powers = kind.powers_dbm();
        powers.iter().position(|power| *power == wanted.power_dbm)
    };
    // Whichever has such a power; without one the driver says so.
    let kinds = [
        ModuleKind::S2c,
        ModuleKind::S1,
        ModuleKind::S2cPro,
        ModuleKind::S1Pro,
    ];
    let found = kinds
        .into_iter()
        .find_map(|kind| Some((kind, level(kind)?)));
    let (kind, level) = found.unwrap_or((ModuleKind::S2c, 4));
    let serial = SERIALS + u64::from(vehicle.0);
    let mut module = XbeeModule::new(kind, serial, settings.noise);
    let code = XBEE_BAUDS.iter().position(|baud| *baud == XBEE_BAUD);
    let registers = [
        (AP, u16::from(wanted.mode.register())),
        (BD, code.unwrap_or_default() as u16),
        (MY, wanted.address()),
        (ID, wanted.network),
        (CH, wanted.channel.into()),
        (PL, level as u16),
    ];
    for (name, value) in registers {
        module.set_register(name, &value.to_be_bytes());
    }
    module.switch_on(Time::ZERO);
    module
}

impl Pty {
    /// Opens a pseudo-terminal and shows it under a name.
    fn open(link: PathBuf, told: impl Fn(FromHost) + Send + 'static) -> io::Result<Pty> {
        let main = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&main)?;
        unlockpt(&main)?;
        let name = ptsname(&main, Vec::new())?;
        show(Path::new(OsStr::from_bytes(name.as_bytes())), &link)?;
        let mut port = SerialPort::from(main);
        port.set_read_timeout(READ_FOR)?;
        port.set_write_timeout(WRITE_FOR)?;
        let port = Arc::new(port);
        let is_ended = Arc::new(AtomicBool::new(false));
        let (read, is_over) = (port.clone(), is_ended.clone());
        let reader = std::thread::Builder::new()
            .name("xbee port".to_owned())
            .spawn(move || listen(&read, &is_over, &told))?;
        Ok(Pty {
            port,
            link,
            is_ended,
            reader: Some(reader),
        })
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        self.is_ended.store(true, Ordering::Release);
        if let Some(reader) = self.reader.take() {
            // A thread that panicked has ended, too.
            let _ = reader.join();
        }
        // Somebody may have removed it.
        let _ = std::fs::remove_file(&self.link);
    }
}

/// Makes a link, in place of one of an earlier world.
fn show(port: &Path, link: &Path) -> io::Result<()> {
    let is_link = std::fs::symlink_metadata(link).is_ok_and(|known| known.is_symlink());
    if is_link {
        std::fs::remove_file(link)?;
    }
    std::os::unix::fs::symlink(port, link).map_err(|error| {
        io::Error::other(format!(
            "{} cannot be made a link to a port: {error}",
            link.display()
        ))
    })
}

fn listen(port: &SerialPort, is_ended: &AtomicBool, told: &impl Fn(FromHost)) {
    let (mut bytes, mut is_open) = ([0; 512], false);
    while !is_ended.load(Ordering::Acquire) {
        match port.read(&mut bytes) {
            Ok(count) if count > 0 => {
                let baud = port.get_configuration().and_then(|set| set.get_baud_rate());
                is_open = true;
                told(FromHost::Bytes(
                    bytes[..count].to_vec(),
                    baud.unwrap_or(XBEE_BAUD),
                ));
            }
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
                ) => {}
            // Nobody has the port open.
            Ok(_) | Err(_) => {
                if std::mem::take(&mut is_open) {
                    told(FromHost::Closed);
                }
                std::thread::sleep(READ_FOR);
            }
        }
    }
}
