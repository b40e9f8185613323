//! Records what the echo line of an HC-SR04 does, for people whose sensor is read wrongly. The lines are taken for that
//! alone; the vehicle's own process must not have them.

use std::time::Duration;

use super::kernel_now;
use super::lines::{EchoLines, Wiring};
use crate::config::HcSr04Lines;
use crate::hw::echo_edges::Edge;
use crate::hw::edge_recording::{EdgeRecording, QUIET, RecordedPing};

/// So many times the sensor is triggered.
const PINGS: usize = 20;
/// A line that does not become quiet, since it hums, is not listened to for longer than this,
const LISTENS: Duration = Duration::from_secs(1);
/// nor for more edges.
const MOST_EDGES: usize = 200;

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

/// Triggers the sensor, unless its line is high, and takes edges until the line is quiet, or until it is clear that it never
/// is.
fn ping(lines: &mut EchoLines) -> Result<RecordedPing, String> {
    let mut recorded = RecordedPing {
        unasked: Vec::new(),
        at: kernel_now(),
        is_high: false,
        edges: Vec::new(),
    };
    recorded.unasked = edges(lines, Duration::ZERO)?;
    recorded.is_high = lines.is_high()?;
    recorded.at = kernel_now();
    if !recorded.is_high {
        lines.trigger()?;
    }
    recorded.edges = edges(lines, QUIET)?;
    Ok(recorded)
}

/// Takes edges until none comes for so long.
fn edges(lines: &mut EchoLines, quiet: Duration) -> Result<Vec<Edge>, String> {
    let (began, mut edges) = (kernel_now(), Vec::new());
    while edges.len() < MOST_EDGES
        && kernel_now().since(began) < LISTENS
        && let Some(edge) = lines.next_edge(quiet)?
    {
        edges.push(edge);
    }
    Ok(edges)
}
