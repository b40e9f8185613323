//! Pins of a Raspberry Pi by their names: `GPIO` and the number that the chip has for it, which is not the header's. Opens
//! nothing, and does not know which pins a board has.

/// A name that no pin has.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no GPIO line has this name; GPIO0 to GPIO27 is needed")]
pub struct UnknownPin;

/// Returns the number of a pin by its name; every pin has one name only, without a sign and without zeros before it.
///
/// # Errors
/// No pin has this name.
pub fn pin_number(name: &str) -> Result<u8, UnknownPin> {
    let number = name.strip_prefix("GPIO").ok_or(UnknownPin)?;
    let number: u8 = number.parse().map_err(|_| UnknownPin)?;
    match format!("GPIO{number}") == name {
        true => Ok(number),
        false => Err(UnknownPin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_is_found_by_its_one_name_and_any_other_name_is_refused_with_those_that_there_are() {
        for (name, number) in [("GPIO0", 0), ("GPIO24", 24), ("GPIO45", 45)] {
            assert_eq!(pin_number(name), Ok(number), "{name}");
        }
        for name in [
            "",
            "24",
            "GPIO",
            "gpio24",
            "GPIO 24",
            "GPIO24 ",
            "GPIO+4",
            "GPIO-4",
            "GPIO04",
            "GPIO256",
            "GPIO2.0",
            "GPIO_GCLK",
            "BCM24",
            "PIN24",
        ] {
            assert_eq!(pin_number(name), Err(UnknownPin), "{name}");
        }
        let said = UnknownPin.to_string();
        assert_eq!(
            said,
            "no GPIO line has this name; GPIO0 to GPIO27 is needed"
        );
    }
}
