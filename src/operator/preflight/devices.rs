//! What a vehicle's drivers say of its devices: a vehicle that lacks one that every run needs, or whose radio has never sent
//! anything, may not begin. Whether a device has fallen silent is a trouble of its own; nothing is guessed from other counts.

use tomoswarm_proto::{
    AutopilotFamily, BodyKind, Capability, Health, Hello, RadioHealth, RadioKind, RangeHealth,
    RangeSensorKind, ServoKind,
};

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

/// Returns whether a radio has sent a beacon, and what it has done.
pub(super) fn radio(radio: RadioHealth) -> (bool, String) {
    let RadioHealth {
        sent,
        unsent,
        busy,
        bad,
        reopens,
    } = radio;
    let found = format!(
        "{sent} sent, {unsent} not sent, {busy} of them as the channel was busy, {bad} bad frames, {reopens} times opened again"
    );
    (sent > 0, found)
}

fn in_words(capability: Capability) -> String {
    match capability {
        Capability::Autopilot(family, body) => {
            format!("autopilot: {} ({})", family_name(family), body_name(body))
        }
        Capability::RangeSensor(kind) => format!("range sensor: {}", range_sensor_name(kind)),
        Capability::Servo(kind) => format!("servo: {}", servo_name(kind)),
        Capability::Radio(kind) => format!("radio: {}", radio_name(kind)),
        Capability::StoredMissions => "stored missions".to_owned(),
    }
}

fn family_name(family: AutopilotFamily) -> &'static str {
    match family {
        AutopilotFamily::Simulated => "simulated",
        AutopilotFamily::ArduPilot => "ArduPilot",
        AutopilotFamily::Px4 => "PX4",
        AutopilotFamily::SerialText => "serial text",
        AutopilotFamily::Other => "another kind",
    }
}

fn body_name(body: BodyKind) -> &'static str {
    match body {
        BodyKind::Rover => "rover",
        BodyKind::Copter => "copter",
        BodyKind::Boat => "boat",
        BodyKind::Plane => "plane",
        BodyKind::Other => "another kind of vehicle",
    }
}

fn range_sensor_name(kind: RangeSensorKind) -> &'static str {
    match kind {
        RangeSensorKind::Simulated => "simulated",
        RangeSensorKind::HcSr04 => "HC-SR04",
        RangeSensorKind::TfLuna => "TF-Luna or TFmini",
        RangeSensorKind::Autopilot => "read by the autopilot",
        RangeSensorKind::Other => "another kind",
        RangeSensorKind::SerialText => "serial text",
    }
}

fn servo_name(kind: ServoKind) -> &'static str {
    match kind {
        ServoKind::Simulated => "simulated",
        ServoKind::Pwm => "PWM",
        ServoKind::Autopilot => "turned by the autopilot",
        ServoKind::Other => "another kind",
    }
}

fn radio_name(kind: RadioKind) -> &'static str {
    match kind {
        RadioKind::Simulated => "simulated",
        RadioKind::XBee => "XBee",
        RadioKind::Other => "another kind",
    }
}
