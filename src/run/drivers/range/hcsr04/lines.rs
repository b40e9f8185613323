//! The lines of an HC-SR04, by whatever they are reached: on a Raspberry Pi by rppal, on any other board, and on a Pi whose
//! kernel has no registers for rppal or numbers its chips in another way, by the character devices of the kernel. Both find
//! lines by name, and hand on the kernel's stamps and numbers of edges.

use std::time::Duration;

use super::chardev_lines::ChardevLines;
use super::rppal_lines::{self, RppalLines};
use crate::config::HcSr04Lines;
use crate::hw::echo_edges::Edge;

/// A trigger is high for so long at least.
const TRIGGER: Duration = Duration::from_micros(20);

/// How lines are opened.
pub(super) enum Wiring {
    /// Those of this machine.
    Machine(HcSr04Lines),
    /// Those of a test.
    #[cfg(test)]
    Recorded(super::tests::Recorder),
}

/// Lines that are open.
pub(super) enum EchoLines {
    /// Of a Raspberry Pi.
    Rppal(RppalLines),
    /// Of any board.
    Chardev(ChardevLines),
    /// Of a test.
    #[cfg(test)]
    Recorded(super::tests::Recorder),
}

impl Wiring {
    /// Makes it from what a file says.
    pub(super) fn of(lines: &HcSr04Lines) -> Wiring {
        Wiring::Machine(lines.clone())
    }

    /// Takes the lines for this process alone.
    ///
    /// # Errors
    /// In words: a line is not there, its name is that of several, or it is in use.
    pub(super) fn open(&self) -> Result<EchoLines, String> {
        match self {
            Wiring::Machine(lines) if rppal_lines::is_raspberry_pi() => by_registers_or_name(
                rppal_lines::registers(),
                |gpio| RppalLines::take(&gpio, lines).map(EchoLines::Rppal),
                || ChardevLines::open(lines).map(EchoLines::Chardev),
            ),
            Wiring::Machine(lines) => ChardevLines::open(lines).map(EchoLines::Chardev),
            #[cfg(test)]
            Wiring::Recorded(recorder) => recorder.open().map(EchoLines::Recorded),
        }
    }
}

/// Takes lines by the registers of a Raspberry Pi, by their names alone where those cannot be opened: rppal looks for chips
/// that are numbered from 0, and kernels of a Pi 5 have begun at 11.
fn by_registers_or_name<R, L>(
    registers: Result<R, String>,
    by_registers: impl FnOnce(R) -> Result<L, String>,
    by_name: impl FnOnce() -> Result<L, String>,
) -> Result<L, String> {
    match registers {
        Ok(registers) => by_registers(registers),
        Err(closed) => {
            by_name().map_err(|why| format!("{why}; by the registers of the Pi: {closed}"))
        }
    }
}

impl EchoLines {
    /// Returns whether the echo line is high.
    pub(super) fn is_high(&self) -> Result<bool, String> {
        match self {
            EchoLines::Rppal(lines) => Ok(lines.is_high()),
            EchoLines::Chardev(lines) => lines.is_high(),
            #[cfg(test)]
            EchoLines::Recorded(recorder) => Ok(recorder.is_high()),
        }
    }

    /// Makes the sensor measure; a longer pulse than the shortest does no harm.
    pub(super) fn trigger(&mut self) -> Result<(), String> {
        self.set_trigger(true)?;
        std::thread::sleep(TRIGGER);
        self.set_trigger(false)
    }

    fn set_trigger(&mut self, is_high: bool) -> Result<(), String> {
        match self {
            EchoLines::Rppal(lines) => lines.set_trigger(is_high),
            EchoLines::Chardev(lines) => return lines.set_trigger(is_high),
            #[cfg(test)]
            EchoLines::Recorded(recorder) => recorder.set_trigger(is_high),
        }
        Ok(())
    }

    /// Returns whether the sensor's supply can be switched.
    pub(super) fn has_power(&self) -> bool {
        match self {
            EchoLines::Rppal(lines) => lines.has_power(),
            EchoLines::Chardev(lines) => lines.has_power(),
            #[cfg(test)]
            EchoLines::Recorded(_) => true,
        }
    }

    /// Switches the sensor's supply, where that can be.
    pub(super) fn set_power(&mut self, is_on: bool) -> Result<(), String> {
        match self {
            EchoLines::Rppal(lines) => lines.set_power(is_on),
            EchoLines::Chardev(lines) => return lines.set_power(is_on),
            #[cfg(test)]
            EchoLines::Recorded(recorder) => recorder.set_power(is_on),
        }
        Ok(())
    }

    /// Returns the next edge of the echo line; `None` when none comes for so long.
    pub(super) fn next_edge(&mut self, within: Duration) -> Result<Option<Edge>, String> {
        match self {
            EchoLines::Rppal(lines) => lines.next_edge(within),
            EchoLines::Chardev(lines) => lines.next_edge(within),
            #[cfg(test)]
            EchoLines::Recorded(recorder) => Ok(recorder.next_edge(within)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_a_pi_are_taken_by_name_where_its_registers_or_its_first_chip_are_not_there() {
        let missing = || Err::<(), _>("no /dev/gpiochip0".to_owned());
        let never = || panic!("another way is there");
        let taken = by_registers_or_name(Ok(()), |()| Ok("by registers"), never);
        assert_eq!(taken, Ok("by registers"));
        let taken = by_registers_or_name(missing(), |()| never(), || Ok("by name"));
        assert_eq!(taken, Ok("by name"));
        let refused = || Err("GPIO24: no GPIO line has this name".to_owned());
        let taken: Result<&str, String> = by_registers_or_name(missing(), |()| never(), refused);
        let both =
            "GPIO24: no GPIO line has this name; by the registers of the Pi: no /dev/gpiochip0";
        assert_eq!(taken, Err(both.to_owned()));
        // A line that is in use is not asked for in another way.
        let busy = by_registers_or_name(Ok(()), |()| Err("in use".to_owned()), never);
        assert_eq!(busy, Err("in use".to_owned()));
    }
}
