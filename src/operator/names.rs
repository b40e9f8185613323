//! Orders, modes, phases, who steers, missions and ends of runs in words, as they are typed and shown.

use tomoswarm_proto::{
    Control, MissionPhase, OrderKind, Ordered, RunEnd, StationPhase, VehicleMode,
};

/// Returns what a vehicle was ordered last, and by whose right.
pub fn ordered(ordered: Ordered) -> String {
    let Ordered {
        lease,
        revision,
        kind,
        ..
    } = ordered;
    kind.map_or("-".to_owned(), |kind| {
        format!("{} {}.{revision}", kind_name(kind), lease.number)
    })
}

/// Returns the name of an order as it is typed.
pub fn kind_name(kind: OrderKind) -> &'static str {
    match kind {
        OrderKind::Start => "start",
        OrderKind::Hold => "hold",
        OrderKind::Return => "return",
        OrderKind::Land => "land",
        OrderKind::CutMotors => "cut-motors",
    }
}

/// Returns in words who steers a vehicle.
pub fn control(control: Control) -> &'static str {
    match control {
        Control::Ours => "this software",
        Control::Remote => "somebody by remote control",
        Control::Own => "the autopilot by itself",
        Control::Silent => "not known: the autopilot is silent",
    }
}

/// Returns a mode in a word.
pub fn mode(mode: VehicleMode) -> &'static str {
    match mode {
        VehicleMode::Idle => "idle",
        VehicleMode::Driving => "driving",
        VehicleMode::Turning => "turning",
        VehicleMode::Halted => "halted",
        VehicleMode::Held => "held",
        VehicleMode::TakingOff => "taking off",
        VehicleMode::Climbing => "climbing",
        VehicleMode::Landing => "landing",
        VehicleMode::Stopped => "STOPPED",
        VehicleMode::MotorsCut => "MOTORS CUT",
    }
}

/// Returns what a ground station does in a word.
pub fn phase(phase: StationPhase) -> &'static str {
    match phase {
        StationPhase::Idle => "idle",
        StationPhase::Waiting => "waiting",
        StationPhase::Stopping => "stopping",
        StationPhase::Planning => "planning",
        StationPhase::Running => "running",
        StationPhase::Closing => "closing",
    }
}

/// Returns what a vehicle does for its mission in a word.
pub fn mission_phase(phase: MissionPhase) -> &'static str {
    match phase {
        MissionPhase::Waiting => "waiting",
        MissionPhase::Choosing => "choosing",
        MissionPhase::Going => "going",
        MissionPhase::Dwelling => "dwelling",
        MissionPhase::Looking => "looking",
        MissionPhase::Yielding => "yielding",
        MissionPhase::Held => "held",
        MissionPhase::Returning => "returning",
        MissionPhase::Over => "over",
    }
}

/// Returns how a run ended in a word; `None` = it has not.
pub fn run_end(end: Option<RunEnd>) -> &'static str {
    match end {
        None => "open",
        Some(RunEnd::Done) => "done",
        Some(RunEnd::Stopped) => "stopped",
        Some(RunEnd::Failed) => "failed",
    }
}

/// Returns troubles in one cell.
pub fn troubles(troubles: &[String]) -> String {
    if troubles.is_empty() {
        "none".to_owned()
    } else {
        troubles.join("; ")
    }
}

/// Returns in words how many laps of a sweep are done.
pub fn laps(done: u32, all: u32) -> String {
    match (done, all) {
        (0, 0) => "no laps planned".to_owned(),
        (done, all) => format!("lap {done} of {all}"),
    }
}

/// Returns a list in words; a dash for an empty one.
pub fn listed<T: std::fmt::Display>(all: &[T]) -> String {
    let words: Vec<String> = all.iter().map(T::to_string).collect();
    if words.is_empty() {
        "-".to_owned()
    } else {
        words.join(",")
    }
}
