//! How the computer itself fares: its supply, the temperature of its processor, and whether its clock is synchronised. It is
//! looked at on a thread of its own every few seconds; nothing is decided by it here.
//!
//! What a machine does not say is not known. A Raspberry Pi says that its voltage is too low by its firmware, or by the hwmon
//! device that its kernel makes of that.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use tomoswarm_proto::Power;

use super::mailbox::lock;

/// The machine is looked at this often: its kernel says within 2 s that its voltage was too low.
const LOOKS_EVERY: Duration = Duration::from_secs(2);
/// The clock is asked about this often, and less often once it is synchronised: a program has to be started for it.
const CLOCK_EVERY: Duration = Duration::from_secs(60);
const SYNCHRONISED_EVERY: Duration = Duration::from_secs(600);
/// Where the firmware of a Raspberry Pi says what it has throttled, hexadecimal.
const THROTTLED: &str = "sys/devices/platform/soc/soc:firmware/get_throttled";
/// The voltage is too low; it was since the bits were cleared last.
const LOW: u32 = 1;
const WAS_LOW: u32 = 1 << 16;
/// Its name among the devices of hwmon.
const VOLTAGE_MONITOR: &str = "rpi_volt";
/// Here systemd-timesyncd notes that it has set the clock.
const TIMESYNC: &str = "run/systemd/timesync/synchronized";

/// What is known of the computer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct MachineHealth {
    /// Its supply.
    pub power: Power,
    /// Temperature of its processor, °C; `None` = not known.
    pub processor_c: Option<i8>,
    /// Whether its clock is synchronised; `None` = not known.
    pub is_clock_synchronised: Option<bool>,
}

/// The computer, watched for as long as this is kept.
pub struct Machine(Arc<Shared>);

#[derive(Default)]
struct Shared {
    /// `None` = it was not looked at yet.
    health: Mutex<Option<MachineHealth>>,
    is_ended: Mutex<bool>,
    ended: Condvar,
}

impl Machine {
    /// Begins to look; `root` is the root of the file system.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn watch(root: &Path) -> io::Result<Machine> {
        let machine = Machine(Arc::default());
        let (shared, root) = (Arc::downgrade(&machine.0), root.to_owned());
        std::thread::Builder::new()
            .name("machine".to_owned())
            .spawn(move || look_on(&shared, root))?;
        Ok(machine)
    }

    /// Returns what was seen last.
    pub fn health(&self) -> MachineHealth {
        lock(&self.0.health).unwrap_or_default()
    }

    /// Returns whether the machine's clock is to be believed: it was looked at, and nobody says that it is not synchronised.
    pub fn has_right_time(&self) -> bool {
        let seen = *lock(&self.0.health);
        seen.is_some_and(|seen| seen.is_clock_synchronised != Some(false))
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        *lock(&self.0.is_ended) = true;
        self.0.ended.notify_all();
    }
}

/// Looks until nobody wants to know any more. It is not waited for: a program that it has started may take its time.
fn look_on(shared: &Weak<Shared>, root: PathBuf) {
    let mut watch = Watch::new(root);
    while let Some(shared) = shared.upgrade() {
        let seen = watch.look();
        *lock(&shared.health) = Some(seen);
        let is_ended = lock(&shared.is_ended);
        let waited = shared
            .ended
            .wait_timeout_while(is_ended, LOOKS_EVERY, |is_ended| !*is_ended);
        if *waited.unwrap_or_else(PoisonError::into_inner).0 {
            return;
        }
    }
}

/// What is remembered from one look to the next.
struct Watch {
    root: PathBuf,
    was_low: bool,
    clock: Option<bool>,
    clock_due: Option<Instant>,
}

impl Watch {
    fn new(root: PathBuf) -> Watch {
        Watch {
            root,
            was_low: false,
            clock: None,
            clock_due: None,
        }
    }

    fn look(&mut self) -> MachineHealth {
        let now = Instant::now();
        if self.clock_due.is_none_or(|due| now >= due) {
            self.clock = is_clock_synchronised(&self.root);
            let again = match self.clock {
                Some(true) => SYNCHRONISED_EVERY,
                Some(false) | None => CLOCK_EVERY,
            };
            self.clock_due = Some(now + again);
        }
        MachineHealth {
            power: self.power(),
            processor_c: processor_c(&self.root),
            is_clock_synchronised: self.clock,
        }
    }

    /// Returns the supply; what was once too low is remembered, since the kernel's look clears the firmware's own memory.
    fn power(&mut self) -> Power {
        let Some((is_low, was_low)) = voltage(&self.root) else {
            return Power::Unknown;
        };
        self.was_low |= is_low || was_low;
        match (is_low, self.was_low) {
            (true, _) => Power::Low,
            (false, true) => Power::WasLow,
            (false, false) => Power::Good,
        }
    }
}

/// Returns whether the voltage is too low, and whether it was; `None` where nothing says so.
fn voltage(root: &Path) -> Option<(bool, bool)> {
    let throttled = number(&root.join(THROTTLED), 16).map(|bits| {
        let has = |bit: u32| bits & i64::from(bit) != 0;
        (has(LOW), has(WAS_LOW))
    });
    throttled.or_else(|| {
        let monitors = fs::read_dir(root.join("sys/class/hwmon")).ok()?;
        let monitor = monitors.flatten().map(|entry| entry.path()).find(|path| {
            let name = fs::read_to_string(path.join("name"));
            name.is_ok_and(|name| name.trim() == VOLTAGE_MONITOR)
        })?;
        let alarm = number(&monitor.join("in0_lcrit_alarm"), 10)?;
        Some((alarm != 0, false))
    })
}

/// Returns the temperature of the processor, °C.
fn processor_c(root: &Path) -> Option<i8> {
    let thousandths = number(&root.join("sys/class/thermal/thermal_zone0/temp"), 10)?;
    i8::try_from(thousandths.checked_add(500)?.div_euclid(1000)).ok()
}

/// Returns whether the clock is synchronised: as its own service notes it, else as the system says of whatever service.
fn is_clock_synchronised(root: &Path) -> Option<bool> {
    if root.join(TIMESYNC).exists() {
        return Some(true);
    }
    let asked = Command::new("timedatectl")
        .args(["show", "--property=NTPSynchronized", "--value"])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    synchronised_in(&asked.ok()?.stdout)
}

/// Returns what was answered; `None` when that was no answer.
fn synchronised_in(answer: &[u8]) -> Option<bool> {
    match answer.trim_ascii() {
        b"yes" => Some(true),
        b"no" => Some(false),
        _ => None,
    }
}

/// Returns the number that a small file holds.
fn number(path: &Path, radix: u32) -> Option<i64> {
    let text = fs::read_to_string(path).ok()?;
    i64::from_str_radix(text.trim().trim_start_matches("0x"), radix).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine of files in a folder.
    struct Files(tempfile::TempDir);

    impl Files {
        fn new() -> Files {
            Files(tempfile::tempdir().unwrap())
        }

        fn write(&self, path: &str, text: &str) {
            let path = self.0.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }

        fn watch(&self) -> Watch {
            Watch::new(self.0.path().to_owned())
        }
    }

    #[test]
    fn the_firmware_of_a_raspberry_pi_says_that_the_voltage_is_or_was_too_low() {
        for (text, power) in [
            ("0\n", Power::Good),
            ("1\n", Power::Low),
            ("50005\n", Power::Low),
            ("50000\n", Power::WasLow),
            ("0x10000\n", Power::WasLow),
            // The frequency is capped, the processor was hot: that is no matter of the supply.
            ("e000e\n", Power::Good),
            ("no number\n", Power::Unknown),
            ("", Power::Unknown),
        ] {
            let files = Files::new();
            files.write(THROTTLED, text);
            assert_eq!(files.watch().power(), power, "{text:?}");
        }
    }

    #[test]
    fn what_the_kernel_saw_once_is_remembered() {
        let files = Files::new();
        files.write("sys/class/hwmon/hwmon0/name", "cpu_thermal\n");
        files.write("sys/class/hwmon/hwmon0/in0_lcrit_alarm", "1\n");
        let mut watch = files.watch();
        assert_eq!(watch.power(), Power::Unknown, "of another device");
        let alarm = "sys/class/hwmon/hwmon1/in0_lcrit_alarm";
        files.write("sys/class/hwmon/hwmon1/name", "rpi_volt\n");
        for (text, power) in [
            ("0\n", Power::Good),
            ("1\n", Power::Low),
            ("0\n", Power::WasLow),
            ("0\n", Power::WasLow),
        ] {
            files.write(alarm, text);
            assert_eq!(watch.power(), power);
        }
    }

    #[test]
    fn temperatures_are_rounded_and_nonsense_is_not_known() {
        for (text, expected) in [
            ("48500\n", Some(49)),
            ("48499\n", Some(48)),
            ("-10600\n", Some(-11)),
            ("900000\n", None),
            ("9223372036854775807\n", None),
            ("hot\n", None),
        ] {
            let files = Files::new();
            files.write("sys/class/thermal/thermal_zone0/temp", text);
            assert_eq!(processor_c(files.0.path()), expected, "{text:?}");
        }
        assert_eq!(processor_c(Files::new().0.path()), None);
    }

    #[test]
    fn a_clock_is_synchronised_when_somebody_says_so() {
        let answers = [&b"yes\n"[..], b"no\n", b"", b"n/a\n"].map(synchronised_in);
        assert_eq!(answers, [Some(true), Some(false), None, None]);
        let files = Files::new();
        files.write(TIMESYNC, "");
        assert_eq!(files.watch().look().is_clock_synchronised, Some(true));
    }

    #[test]
    fn a_clock_is_believed_unless_it_was_not_looked_at_or_somebody_says_that_it_is_wrong() {
        let seen = |is_clock_synchronised| {
            Some(MachineHealth {
                is_clock_synchronised,
                ..MachineHealth::default()
            })
        };
        for (health, expected) in [
            (None, false),
            (seen(Some(false)), false),
            (seen(Some(true)), true),
            (seen(None), true),
        ] {
            let shared = Shared {
                health: Mutex::new(health),
                ..Shared::default()
            };
            assert_eq!(Machine(Arc::new(shared)).has_right_time(), expected);
        }
    }

    #[test]
    fn a_machine_is_looked_at_until_it_is_dropped() {
        let files = Files::new();
        files.write(THROTTLED, "0\n");
        files.write(TIMESYNC, "");
        files.write("sys/class/thermal/thermal_zone0/temp", "40000\n");
        let machine = Machine::watch(files.0.path()).unwrap();
        let began = Instant::now();
        let expected = MachineHealth {
            power: Power::Good,
            processor_c: Some(40),
            is_clock_synchronised: Some(true),
        };
        while machine.health() != expected {
            assert!(began.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
        let shared = Arc::downgrade(&machine.0);
        drop(machine);
        while shared.upgrade().is_some() {
            assert!(began.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
