//! Records what the echo line of an HC-SR04 does, for people whose sensor is read wrongly. The lines are taken for that alone; the
//! vehicle's own process must not have them.

use std::time::Duration;

use super::kernel_now;
use super::lines::{EchoLines, Wiring};
use crate::config::HcSr04Lines;
use crate::hw::edge_recording::{EdgeRecording, QUIET, RecordedPing};

/// So many times the sensor is triggered.
const PINGS: usize = 20;

/// Records some pings of a sensor.
///
/// # Errors
/// In words: a line is not there, is in use, or has gone.
pub fn record_edges(lines: &HcSr04Lines) -> Result<EdgeRecording, String> {
    record_on(&Wiring::of(lines), lines)
}

pub(super) fn record_on(wiring: &Wiring, named: &HcSr04Lines) -> Result<EdgeRecording, String> {
    let mut lines = wiring.open()?;
    let pings = (0..PINGS).map(|_| ping(&mut lines));
    Ok(EdgeRecording {
        sensor: format!("{} and {}", named.trigger, named.echo),
        air_temperature_c: named.air_temperature_c,
        pings: pings.collect::<Result<_, String>>()?,
    })
}

/// Triggers the sensor, unless its line is high, and takes edges until the line is quiet.
fn ping(lines: &mut EchoLines) -> Result<RecordedPing, String> {
    let mut recorded = RecordedPing {
        unasked: Vec::new(),
        at: kernel_now(),
        is_high: false,
        edges: Vec::new(),
    };
    while let Some(edge) = lines.next_edge(Duration::ZERO)? {
        recorded.unasked.push(edge);
    }
    recorded.is_high = lines.is_high()?;
    recorded.at = kernel_now();
    if !recorded.is_high {
        lines.trigger()?;
    }
    while let Some(edge) = lines.next_edge(QUIET)? {
        recorded.edges.push(edge);
    }
    Ok(recorded)
}
