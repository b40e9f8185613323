//! A pin of a Raspberry Pi, by rppal: by the PWM hardware where the pin is given to it, else by a thread of rppal's, whose pulses vary by
//! some 100 µs under load. Any other board refuses.

use std::time::Duration;

use rppal::gpio::{Gpio, Mode, OutputPin};
use rppal::pwm::{Channel, Polarity, Pwm};
use rppal::system::{DeviceInfo, SoC};

use crate::hw::pulse::PERIOD;

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
    /// # Errors
    /// In words: this is no Raspberry Pi, the pin is not there, or in use.
    pub(super) fn open(name: &str) -> Result<RppalPwm, String> {
        let in_words = |error: &dyn std::error::Error| error.to_string();
        let machine =
            DeviceInfo::new().map_err(|_| "this machine is no Raspberry Pi".to_owned())?;
        let number: Option<u8> = name
            .strip_prefix("GPIO")
            .and_then(|number| number.parse().ok());
        let number = number.ok_or("no GPIO line has this name; GPIO0 to GPIO27 is needed")?;
        let gpio = Gpio::new().map_err(|error| {
            format!("{error}; `[servo.pwm]` names a PWM chip of the kernel instead")
        })?;
        let pin = gpio.get(number).map_err(|error| in_words(&error))?;
        if let Some((channel, mode)) = channel(number, machine.soc())
            && pin.mode() == mode
        {
            // Pulses of a thread would vary by more than the servo's ends allow, and nobody would know why.
            let mut pwm = Pwm::new(channel)
                .map_err(|error| format!("its PWM hardware cannot be used: {error}"))?;
            // A servo without pulses would let the sensor swing.
            pwm.set_reset_on_drop(false);
            return Ok(RppalPwm::Hardware(pwm));
        }
        Ok(RppalPwm::Software(pin.into_output_low()))
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
