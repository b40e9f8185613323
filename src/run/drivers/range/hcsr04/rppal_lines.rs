//! Lines of an HC-SR04 on a Raspberry Pi, by rppal: outputs by its registers, edges with the kernel's stamps. A line is
//! named as the kernel names it, `GPIO` and its number (of the chip, not of the header).
//!
//! The echo line is pulled down: one whose wire is broken would hear the hum of the mains, and be read as an obstacle's
//! distance.

use std::time::Duration;

use rppal::gpio::{Gpio, InputPin, OutputPin, Pin, Trigger};
use rppal::system::DeviceInfo;

use crate::config::HcSr04Lines;
use crate::hw::echo_edges::Edge;
use crate::time::Time;

/// Returns whether this machine is a Raspberry Pi.
pub(super) fn is_raspberry_pi() -> bool {
    DeviceInfo::new().is_ok()
}

/// Lines that are taken.
pub(super) struct RppalLines {
    trigger: OutputPin,
    power: Option<OutputPin>,
    echo: InputPin,
}

/// Opens the registers and the first GPIO chip of a Raspberry Pi.
///
/// # Errors
/// In words: one of them is not there, or may not be opened.
pub(super) fn registers() -> Result<Gpio, String> {
    Gpio::new().map_err(|error| error.to_string())
}

impl RppalLines {
    /// Takes the lines.
    ///
    /// # Errors
    /// In words: a line is not there, or in use.
    pub(super) fn take(gpio: &Gpio, lines: &HcSr04Lines) -> Result<RppalLines, String> {
        let pin = |name: &str| -> Result<Pin, String> {
            let number = name
                .strip_prefix("GPIO")
                .and_then(|number| number.parse().ok());
            let number = number.ok_or_else(|| {
                format!("{name}: no GPIO line has this name; GPIO0 to GPIO27 is needed")
            })?;
            gpio.get(number).map_err(|error| format!("{name}: {error}"))
        };
        let mut echo = pin(&lines.echo)?.into_input_pulldown();
        let watched = echo.set_interrupt(Trigger::Both, None);
        watched.map_err(|error| format!("{}: {error}", lines.echo))?;
        let power = lines.power.as_deref().map(pin).transpose()?;
        Ok(RppalLines {
            trigger: pin(&lines.trigger)?.into_output_low(),
            power: power.map(Pin::into_output_high),
            echo,
        })
    }

    /// Returns whether the echo line is high.
    pub(super) fn is_high(&self) -> bool {
        self.echo.is_high()
    }

    /// Sets the trigger line.
    pub(super) fn set_trigger(&mut self, is_high: bool) {
        self.trigger.write(is_high.into());
    }

    /// Returns whether the sensor's supply can be switched.
    pub(super) fn has_power(&self) -> bool {
        self.power.is_some()
    }

    /// Switches the sensor's supply, where that can be.
    pub(super) fn set_power(&mut self, is_on: bool) {
        if let Some(power) = &mut self.power {
            power.write(is_on.into());
        }
    }

    /// Returns the next edge of the echo line; `None` when none comes for so long.
    pub(super) fn next_edge(&mut self, within: Duration) -> Result<Option<Edge>, String> {
        let event = self.echo.poll_interrupt(false, Some(within));
        let event = event.map_err(|error| error.to_string())?;
        Ok(event.map(|event| Edge {
            at: Time::ZERO + event.timestamp,
            is_rising: event.trigger == Trigger::RisingEdge,
            number: event.seqno,
        }))
    }
}
