//! Lines of an HC-SR04 on a Raspberry Pi, by rppal: outputs by its registers, edges with the kernel's stamps. A line is
//! named as the kernel names it, `GPIO` and its number (of the chip, not of the header).
//! Registers take a line from whoever has it, so the kernel is asked before whether anybody has.
//!
//! The echo line is pulled down: one whose wire is broken would hear the hum of the mains, and be read as an obstacle's
//! distance.

use std::time::Duration;

use gpiocdev::Chip;
use gpiocdev::line::Info;
use rppal::gpio::{Gpio, InputPin, OutputPin, Pin, Trigger};
use rppal::system::DeviceInfo;

use super::chardev_lines::user_of;
use crate::config::HcSr04Lines;
use crate::hw::echo_edges::Edge;
use crate::hw::pin_name::pin_number;
use crate::time::Time;

/// What the chips with the pins of Raspberry Pis are called: of any up to the 3, of a 4, of a 5. A line's offset is its pin's
/// number.
const CHIPS: [&str; 3] = ["pinctrl-bcm2835", "pinctrl-bcm2711", "pinctrl-rp1"];

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
        let chip = chip_of_pins();
        let info = |number: u8| chip.as_ref()?.line_info(number.into()).ok();
        for output in [Some(&lines.trigger), lines.power.as_ref()]
            .into_iter()
            .flatten()
        {
            refuse_used(output, info)?;
        }
        let pin = |name: &str| -> Result<Pin, String> {
            let number = number_of(name)?;
            gpio.get(number).map_err(|error| format!("{name}: {error}"))
        };
        let mut echo = pin(&lines.echo)?.into_input_pulldown();
        // The kernel itself refuses an echo line that another process has; one of this process may still have it open.
        if let Err(error) = echo.set_interrupt(Trigger::Both, None) {
            refuse_used(&lines.echo, info)?;
            return Err(format!("{}: {error}", lines.echo));
        }
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

/// Returns the chip that has the pins; `None` when the system does not tell.
fn chip_of_pins() -> Option<Chip> {
    let chips = gpiocdev::chip::chips().ok()?;
    let mut open = chips.iter().filter_map(|path| Chip::from_path(path).ok());
    open.find(|chip| {
        let info = chip.info();
        info.is_ok_and(|info| CHIPS.contains(&info.label.as_str()))
    })
}

fn number_of(name: &str) -> Result<u8, String> {
    pin_number(name).map_err(|error| format!("{name}: {error}"))
}

/// Refuses a line that somebody uses, by what the kernel says of its number: `None` where that does not tell.
fn refuse_used(name: &str, info: impl Fn(u8) -> Option<Info>) -> Result<(), String> {
    let user = info(number_of(name)?).as_ref().and_then(user_of);
    match user {
        Some(user) => Err(format!("{name}: {user}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_somebody_uses_is_refused_with_who_that_is_before_its_registers_are_touched() {
        let info = |number: u8| {
            let (used, consumer) = match number {
                17 => (false, ""),
                23 => (true, "spi0 CS1"),
                24 => (true, ""),
                _ => return None,
            };
            Some(Info {
                offset: number.into(),
                used,
                consumer: consumer.to_owned(),
                ..Info::default()
            })
        };
        let refused = |words: &str| Err(words.to_owned());
        for (name, expected) in [
            ("GPIO17", Ok(())),
            ("GPIO23", refused("GPIO23: spi0 CS1 uses it")),
            ("GPIO24", refused("GPIO24: another program uses it")),
            // Of this one the kernel does not tell.
            ("GPIO25", Ok(())),
            (
                "GPIO",
                refused("GPIO: no GPIO line has this name; GPIO0 to GPIO27 is needed"),
            ),
        ] {
            assert_eq!(refuse_used(name, info), expected);
        }
    }
}
