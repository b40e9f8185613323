//! Lines of an HC-SR04 by the GPIO character devices of the kernel, on any board. Chips are renumbered from kernel to kernel, so lines
//! are found by name, and a name that two lines have is refused.

use std::time::Duration;

use gpiocdev::line::{Bias, EdgeDetection, EdgeKind, Offset, Value};
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
    match line.info.used {
        true => format!("{}: {} uses it", line.info.name, line.info.consumer),
        false => format!("{}: {error}", line.info.name),
    }
}

/// Takes the echo line. A wire that is broken must be low, since one that hums gives pulses as of an echo; a chip that cannot
/// pull a line down leaves that to a resistor.
fn watched(echo: &FoundLine) -> Result<Request, String> {
    let take = |bias: Option<Bias>| {
        let mut request = Request::builder();
        request
            .with_consumer(CONSUMER)
            .with_found_line(echo)
            .as_input()
            .with_bias(bias)
            .with_edge_detection(EdgeDetection::BothEdges)
            .request()
    };
    let taken = take(Some(Bias::PullDown)).or_else(|_| take(None));
    taken.map_err(|error| in_words(echo, &error))
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
            echo: watched(echo)?,
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
    use gpiocdev::line::Info;

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
