//! What a vehicle's computer says of itself: a supply that is too low, or a processor that is too hot, fails in the middle of a
//! run. Its clock decides nothing, and is shown because times in recordings come from it.

use tomoswarm_proto::{Health, Power};

use super::{Check, CheckStatus, reported};

/// From here on a processor is too hot for a run, °C: a Raspberry Pi slows down.
const HOT_C: i8 = 80;

/// Checks supply, temperature and clock.
pub(super) fn machine(health: Option<&Health>) -> [Check; 3] {
    let power = health.map(|health| health.power);
    let power = power.filter(|power| *power != Power::Unknown);
    let processor_c = health.and_then(|health| health.processor_c);
    let clock = health.and_then(|health| health.is_clock_synchronised);
    let silent = CheckStatus::Unknown;
    [
        reported("power", power, silent, |power| {
            (power != Power::Low, in_words(power).to_owned())
        }),
        reported("temperature", processor_c, silent, |processor_c| {
            let found = format!("{processor_c} °C, under {HOT_C} °C needed");
            (processor_c < HOT_C, found)
        }),
        reported("clock", clock, silent, |is_synchronised| {
            let found = match is_synchronised {
                true => "synchronised",
                false => "not synchronised: times in recordings are not right",
            };
            (true, found.to_owned())
        }),
    ]
}

fn in_words(power: Power) -> &'static str {
    match power {
        Power::Unknown => "not reported",
        Power::Good => "good",
        Power::WasLow => "good now, and its voltage was too low at times",
        Power::Low => "its voltage is too low",
    }
}
