//! What a vehicle's drivers say of its devices: a vehicle that lacks one that every run needs may not begin. Whether a device
//! is silent is a trouble of its own; nothing is guessed from counts.

use tomoswarm_proto::{Capability, Health, Hello, RangeHealth};

use super::{Check, CheckStatus, check};

/// Checks the devices of a vehicle. One that names none is not refused: it has not said what it has.
pub(super) fn devices(hello: Option<&Hello>, health: Option<&Health>) -> Check {
    let capabilities = hello
        .map(|hello| hello.capabilities.as_slice())
        .unwrap_or_default();
    if capabilities.is_empty() {
        return Check {
            what: "devices",
            light: CheckStatus::Unknown,
            found: "not reported".to_owned(),
        };
    }
    let has = |is_it: fn(&Capability) -> bool| capabilities.iter().any(is_it);
    let needed = [
        (
            "no autopilot",
            has(|one| matches!(one, Capability::Autopilot(..))),
        ),
        (
            "no range sensor: it sees nothing, and is not driven",
            has(|one| matches!(one, Capability::RangeSensor(_))),
        ),
        (
            "no radio: it measures nothing",
            has(|one| matches!(one, Capability::Radio(_))),
        ),
    ];
    let missing = needed
        .iter()
        .filter(|(_, is_there)| !is_there)
        .map(|(words, _)| (*words).to_owned());
    let is_right = needed.iter().all(|(_, is_there)| *is_there);
    let mut found: Vec<String> = missing
        .chain(capabilities.iter().map(|one| in_words(*one)))
        .collect();
    let range = health.and_then(|health| health.range);
    found.extend(range.map(|RangeHealth { glitches, faults }| {
        format!("range: {glitches} glitches, {faults} pings without an answer")
    }));
    check("devices", is_right, found.join("; "))
}

fn in_words(capability: Capability) -> String {
    match capability {
        Capability::Autopilot(family, body) => format!("autopilot {family:?} ({body:?})"),
        Capability::RangeSensor(kind) => format!("range sensor {kind:?}"),
        Capability::Servo(kind) => format!("servo {kind:?}"),
        Capability::Radio(kind) => format!("radio {kind:?}"),
        Capability::StoredMissions => "stored missions".to_owned(),
    }
}
