//! Lines of an HC-SR04 by the GPIO character devices of the kernel, on any board. Chips are renumbered from kernel to
//! kernel, so lines are found by name, and a name that two lines have is refused.
//!
//! The echo line is pulled down: one whose wire is broken would hear the hum of the mains, and be read as an obstacle's
//! distance.

use std::time::Duration;

use gpiocdev::line::{Bias, EdgeDetection, EdgeKind, Info, Offset, Value};
use gpiocdev::request::Builder;
use gpiocdev::{FoundLine, Request};

use crate::config::HcSr04Lines;
use crate::hw::echo_edges::Edge;
use crate::time::Time;

/// Who uses the lines, as `gpioinfo` shows it.
const CONSUMER: &str = "tomoswarm";

/// Lines that are taken.
pub(super) struct ChardevLines {
    trigger: OutputLine,
    power: Option<OutputLine>,
    echo: Request,
}

struct OutputLine {
    request: Request,
    offset: Offset,
}

impl OutputLine {
    fn take(line: &FoundLine, value: Value) -> Result<OutputLine, String> {
        let request = Request::builder()
            .with_consumer(CONSUMER)
            .with_found_line(line)
            .as_output(value)
            .request()
            .map_err(|error| in_words(line, &error))?;
        let offset = line.info.offset;
        Ok(OutputLine { request, offset })
    }

    fn set(&self, is_high: bool) -> Result<(), String> {
        let value = if is_high {
            Value::Active
        } else {
            Value::Inactive
        };
        let set = self.request.set_value(self.offset, value);
        set.map_err(|error| error.to_string())
    }
}

/// Returns the line of a name.
///
/// # Errors
/// In words: no line has this name, or several have.
fn the_only<'l>(name: &str, all: &'l [FoundLine]) -> Result<&'l FoundLine, String> {
    let found: Vec<&FoundLine> = all.iter().filter(|line| line.info.name == name).collect();
    match found[..] {
        [] => Err(format!(
            "{name}: no GPIO line has this name; one that `gpioinfo` lists is needed"
        )),
        [line] => Ok(line),
        [..] => {
            let place = |line: &&FoundLine| format!("{} {}", line.chip.display(), line.info.offset);
            let places: Vec<String> = found.iter().map(place).collect();
            Err(format!(
                "{name}: {} GPIO lines have this name ({}); one that only one line has is needed",
                places.len(),
                places.join(", ")
            ))
        }
    }
}

fn in_words(line: &FoundLine, error: &gpiocdev::Error) -> String {
    let why = user_of(&line.info).unwrap_or_else(|| error.to_string());
    format!("{}: {why}", line.info.name)
}

/// Returns who uses a line, in words; `None` when nobody does.
pub(super) fn user_of(info: &Info) -> Option<String> {
    match (info.used, info.consumer.as_str()) {
        (true, "") => Some("another program uses it".to_owned()),
        (true, consumer) => Some(format!("{consumer} uses it")),
        (false, _) => None,
    }
}

/// Takes an echo line by `request`, pulled down; as it is where its chip refuses that, which is said in the log.
fn take_echo<T>(
    line: &FoundLine,
    request: impl Fn(&mut Builder) -> gpiocdev::Result<T>,
) -> gpiocdev::Result<T> {
    let mut builder = Request::builder();
    builder
        .with_consumer(CONSUMER)
        .with_found_line(line)
        .as_input()
        .with_edge_detection(EdgeDetection::BothEdges)
        .with_bias(Bias::PullDown);
    request(&mut builder).or_else(|refused| {
        let taken = request(builder.with_bias(None))?;
        tracing::warn!(
            "{}: its chip does not pull it down ({refused}): a broken wire may be read as distances; a resistor of \
             10 kΩ from this line to ground is needed",
            line.info.name
        );
        Ok(taken)
    })
}

impl ChardevLines {
    /// Finds the lines and takes them.
    ///
    /// # Errors
    /// In words: a line is not there, its name is that of several, or it is in use.
    pub(super) fn open(lines: &HcSr04Lines) -> Result<ChardevLines, String> {
        let all: Vec<FoundLine> = gpiocdev::lines()
            .map_err(|error| {
                format!("{error}; a /dev/gpiochip… is needed that this user may open (mostly group gpio)")
            })?
            .collect();
        let line = |name: &str| the_only(name, &all);
        let echo = line(&lines.echo)?;
        let power = lines.power.as_deref().map(line).transpose()?;
        Ok(ChardevLines {
            trigger: OutputLine::take(line(&lines.trigger)?, Value::Inactive)?,
            power: power
                .map(|power| OutputLine::take(power, Value::Active))
                .transpose()?,
            echo: take_echo(echo, Builder::request).map_err(|error| in_words(echo, &error))?,
        })
    }

    /// Returns whether the echo line is high.
    pub(super) fn is_high(&self) -> Result<bool, String> {
        let value = self.echo.lone_value().map_err(|error| error.to_string())?;
        Ok(value == Value::Active)
    }

    /// Sets the trigger line.
    pub(super) fn set_trigger(&self, is_high: bool) -> Result<(), String> {
        self.trigger.set(is_high)
    }

    /// Returns whether the sensor's supply can be switched.
    pub(super) fn has_power(&self) -> bool {
        self.power.is_some()
    }

    /// Switches the sensor's supply, where that can be.
    pub(super) fn set_power(&self, is_on: bool) -> Result<(), String> {
        self.power.as_ref().map_or(Ok(()), |power| power.set(is_on))
    }

    /// Returns the next edge of the echo line; `None` when none comes for so long.
    pub(super) fn next_edge(&self, within: Duration) -> Result<Option<Edge>, String> {
        let read = || {
            if !self.echo.wait_edge_event(within)? {
                return Ok(None);
            }
            self.echo.read_edge_event().map(Some)
        };
        let event = read().map_err(|error: gpiocdev::Error| error.to_string())?;
        Ok(event.map(|event| Edge {
            at: Time::from_nanos(event.timestamp_ns),
            is_rising: event.kind == EdgeKind::Rising,
            number: event.line_seqno,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(chip: &str, offset: Offset, name: &str) -> FoundLine {
        FoundLine {
            chip: chip.into(),
            info: Info {
                offset,
                name: name.to_owned(),
                ..Info::default()
            },
        }
    }

    #[test]
    fn an_echo_line_is_pulled_down_where_its_chip_can_do_that() {
        let line = line("/dev/gpiochip0", 24, "GPIO24");
        let bias = |builder: &mut Builder| builder.config().line_config(24).unwrap().bias;
        let taken = take_echo(&line, |builder| Ok(bias(builder)));
        assert_eq!(taken.unwrap(), Some(Bias::PullDown));
        let refused = || gpiocdev::Error::InvalidArgument("no bias".to_owned());
        let taken = take_echo(&line, |builder| match bias(builder) {
            Some(_) => Err(refused()),
            None => Ok("as it is"),
        });
        assert_eq!(taken.unwrap(), "as it is");
        let taken = take_echo::<()>(&line, |_| Err(refused()));
        assert!(taken.is_err(), "it is refused anyhow");
    }

    #[test]
    fn a_line_in_use_is_said_by_its_name_with_who_uses_it_and_any_other_error_as_it_is() {
        let refused = gpiocdev::Error::InvalidArgument("no bias".to_owned());
        let mut line = line("/dev/gpiochip0", 24, "GPIO24");
        assert_eq!(in_words(&line, &refused), format!("GPIO24: {refused}"));
        (line.info.used, line.info.consumer) = (true, "spi0 CS1".to_owned());
        assert_eq!(in_words(&line, &refused), "GPIO24: spi0 CS1 uses it");
        // The kernel does not name everybody.
        line.info.consumer.clear();
        assert_eq!(in_words(&line, &refused), "GPIO24: another program uses it");
    }

    #[test]
    fn a_name_that_no_line_has_or_several_have_is_refused_with_their_places() {
        let all = [
            line("/dev/gpiochip0", 23, "GPIO23"),
            line("/dev/gpiochip0", 24, "GPIO24"),
            line("/dev/gpiochip4", 7, "GPIO24"),
            line("/dev/gpiochip4", 8, ""),
        ];
        assert_eq!(the_only("GPIO23", &all), Ok(&all[0]));
        assert_eq!(
            the_only("GPIO2", &all),
            Err(
                "GPIO2: no GPIO line has this name; one that `gpioinfo` lists is needed".to_owned()
            )
        );
        assert_eq!(
            the_only("GPIO24", &all),
            Err("GPIO24: 2 GPIO lines have this name (/dev/gpiochip0 24, /dev/gpiochip4 7); one that only one line has is needed".to_owned())
        );
    }
}
