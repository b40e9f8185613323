//! A pin of a Raspberry Pi, by rppal: by the PWM hardware where the pin is given to it, by a thread of rppal's, whose pulses
//! vary by some 100 µs under load, where it is not. Hardware that cannot be opened is an error, and no reason for the thread.
//! Any other board refuses.

use std::time::Duration;

use rppal::gpio::{Gpio, Mode, OutputPin, Pin};
use rppal::pwm::{Channel, Polarity, Pwm};
use rppal::system::{DeviceInfo, SoC};

use super::sysfs_pwm::Chip;
use crate::hw::pin_name::pin_number;
use crate::hw::pulse::PERIOD;

/// Where the kernel has its PWM chips.
const CHIPS: &str = "/sys/class/pwm";

/// A pin that gives pulses.
pub(super) enum RppalPwm {
    /// By hardware.
    Hardware(Pwm),
    /// By a thread.
    Software(OutputPin),
}

impl RppalPwm {
    /// Takes a pin by the name that the kernel has for it.
    ///
    /// # Errors In words: this is no Raspberry Pi, the pin is not there, or in use, or the hardware that it is given to cannot
    /// be opened.
    pub(super) fn open(name: &str) -> Result<RppalPwm, String> {
        let (pin, channel) = find(name)?;
        let Some(channel) = channel else {
            return Ok(RppalPwm::Software(pin.into_output_low()));
        };
        let mut pwm = Pwm::new(channel).map_err(|error| {
            format!("{error}; the pin is given to the PWM hardware, which cannot be opened (mostly: group gpio)")
        })?;
        // A servo without pulses would let the sensor swing.
        pwm.set_reset_on_drop(false);
        Ok(RppalPwm::Hardware(pwm))
    }

    /// Looks whether a pin could be opened, and leaves it as it is: opening stops the pulses of the hardware.
    ///
    /// # Errors
    /// As [`RppalPwm::open`].
    pub(super) fn could_be_opened(name: &str) -> Result<(), String> {
        let (_, Some(channel)) = find(name)? else {
            return Ok(());
        };
        let chips = std::fs::read_dir(CHIPS).map_err(|error| format!("{CHIPS}: {error}"))?;
        let mut why = format!("{CHIPS}: the PWM hardware is not there");
        for chip in chips.flatten() {
            let folder = chip.path();
            let channel = channel as usize;
            match (Chip { folder, channel }).could_be_opened() {
                Ok(()) => return Ok(()),
                Err(closed) => why = format!("{}: {closed}", chip.path().display()),
            }
        }
        Err(why)
    }

    /// Gives a pulse from now on.
    ///
    /// # Errors
    /// In words, why it cannot.
    pub(super) fn give(&mut self, pulse: Duration) -> Result<(), String> {
        match self {
            RppalPwm::Hardware(pwm) => {
                give_by_hardware(pwm, pulse).map_err(|error| error.to_string())
            }
            RppalPwm::Software(pin) => pin
                .set_pwm(PERIOD, pulse)
                .map_err(|error| error.to_string()),
        }
    }
}

/// Finds a pin and the hardware that it is given to; the pin stays as it is.
fn find(name: &str) -> Result<(Pin, Option<Channel>), String> {
    let machine = DeviceInfo::new().map_err(|_| "this machine is no Raspberry Pi".to_owned())?;
    let number = pin_number(name).map_err(|error| error.to_string())?;
    let gpio = Gpio::new().map_err(|error| {
        format!(
            "{error}; driver = \"pwm\" with its [servo.pwm] needs neither registers nor this chip"
        )
    })?;
    let pin = gpio.get(number).map_err(|error| error.to_string())?;
    let channel = channel_of(number, machine.soc(), pin.mode());
    Ok((pin, channel))
}

/// The period comes first: kernels before 6.11 refuse pulse and polarity while it is 0.
fn give_by_hardware(pwm: &Pwm, pulse: Duration) -> rppal::pwm::Result<()> {
    if pwm.period()? != PERIOD {
        // Of a longer pulse that somebody has left; without a period there is none.
        let _ = pwm.set_pulse_width(Duration::ZERO);
        pwm.set_period(PERIOD)?;
    }
    pwm.set_pulse_width(pulse)?;
    if pwm.polarity()? != Polarity::Normal {
        pwm.set_polarity(Polarity::Normal)?;
    }
    pwm.enable()
}

/// Returns the hardware that a pin is given to; `None` where its mode is another.
fn channel_of(number: u8, chip: SoC, mode: Mode) -> Option<Channel> {
    let (channel, of_hardware) = channel(number, chip)?;
    (mode == of_hardware).then_some(channel)
}

/// Returns the hardware that a pin can have, and the mode of the pin when the overlay `pwm` or `pwm-2chan` gives it to the pin:
/// without it the hardware's pulses come out nowhere, or at another pin (BCM2835 ARM Peripherals, 6.2; RP1 Peripherals, 3.1.1).
fn channel(number: u8, chip: SoC) -> Option<(Channel, Mode)> {
    match (number, chip) {
        (18, SoC::Bcm2712) => Some((Channel::Pwm2, Mode::Alt3)),
        (19, SoC::Bcm2712) => Some((Channel::Pwm3, Mode::Alt3)),
        (12, _) => Some((Channel::Pwm0, Mode::Alt0)),
        (13, _) => Some((Channel::Pwm1, Mode::Alt0)),
        (18, _) => Some((Channel::Pwm0, Mode::Alt5)),
        (19, _) => Some((Channel::Pwm1, Mode::Alt5)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_is_the_hardware_s_only_by_its_mode() {
        for (number, chip, mode, expected) in [
            (18, SoC::Bcm2711, Mode::Alt5, Some(Channel::Pwm0)),
            (18, SoC::Bcm2711, Mode::Output, None),
            (18, SoC::Bcm2712, Mode::Alt3, Some(Channel::Pwm2)),
            (18, SoC::Bcm2712, Mode::Alt5, None),
            (13, SoC::Bcm2835, Mode::Alt0, Some(Channel::Pwm1)),
            (17, SoC::Bcm2711, Mode::Alt5, None),
        ] {
            let found = channel_of(number, chip, mode);
            assert_eq!(found, expected, "GPIO{number} of {chip}: {mode}");
        }
    }
}
