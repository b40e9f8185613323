//! How long the USB adapter of a serial port holds bytes back to send more at once: FTDI's do so for 16 ms unless told otherwise,
//! which costs a ring of XBees at 115,200 baud more than a quarter of its beacons. Reads what the kernel says; changes nothing.

use std::fs;
use std::path::Path;

/// Where the kernel has the serial ports of USB adapters.
pub const USB_SERIAL: &str = "/sys/bus/usb-serial/devices";

/// The file in the folder of a port.
const FILE: &str = "latency_timer";
/// A longer delay is told, ms; the rule in the package sets 1.
const MOST_MS: u32 = 2;

/// Returns what is wrong with the adapter of a port, and what helps; `devices` is the folder that has one for each port of
/// an adapter, [`USB_SERIAL`]. `None` = nothing is, or it is not known: the port is on no adapter, or on one that has no such
/// delay.
pub fn delay_in_words(port: &str, devices: &Path) -> Option<String> {
    // Names such as those under /dev/serial/by-id stand for another one, which is the kernel's.
    let port = fs::canonicalize(port).ok()?;
    let file = devices.join(port.file_name()?).join(FILE);
    let delay_ms = delay_ms(&fs::read_to_string(&file).ok()?)?;
    (delay_ms > MOST_MS).then(|| {
        let file = file.display();
        format!(
            "its USB adapter holds bytes back for {delay_ms} ms ({file}; at most {MOST_MS} are wanted), so beacons come late and \
             fewer are sent; the package's udev rule sets 1 when it is plugged in, and so does now: echo 1 | sudo tee {file}"
        )
    })
}

/// Reads the delay, ms, as the kernel writes it; `None` = it is no number.
fn delay_ms(text: &str) -> Option<u32> {
    text.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_a_whole_number_of_milliseconds() {
        for (text, expected) in [
            ("16\n", Some(16)),
            ("1", Some(1)),
            ("", None),
            ("\n", None),
            ("-1\n", None),
            ("0x10\n", None),
            ("99999999999\n", None),
        ] {
            assert_eq!(delay_ms(text), expected, "{text:?}");
        }
    }

    #[test]
    fn a_port_is_found_by_the_name_that_it_stands_for() {
        let folder = tempfile::tempdir().unwrap();
        let (devices, port) = (folder.path().join("devices"), folder.path().join("by-id"));
        fs::write(folder.path().join("ttyUSB3"), "").unwrap();
        std::os::unix::fs::symlink("ttyUSB3", &port).unwrap();
        let words = || delay_in_words(port.to_str().unwrap(), &devices);
        assert_eq!(words(), None, "it is on no adapter");
        let adapter = devices.join("ttyUSB3");
        fs::create_dir_all(&adapter).unwrap();
        assert_eq!(words(), None, "its adapter has no such delay");
        let file = adapter.join(FILE);
        for (text, is_right) in [
            ("1\n", true),
            ("2\n", true),
            ("3\n", false),
            ("16\n", false),
        ] {
            fs::write(&file, text).unwrap();
            assert_eq!(words().is_none(), is_right, "{text}");
        }
        let said = words().unwrap();
        assert!(said.starts_with("its USB adapter holds bytes back for 16 ms"));
        let remedy = format!("echo 1 | sudo tee {}", file.display());
        assert!(said.ends_with(&remedy), "{said}");
        fs::write(&file, "soon\n").unwrap();
        assert_eq!(words(), None, "it is no number");
        fs::remove_file(&port).unwrap();
        assert_eq!(words(), None, "there is no port");
    }
}
