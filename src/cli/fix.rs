//! `tomoswarm fix CONFIG`: tells vehicles where something outside has measured them to be, line after line.

use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::time::{Duration, Instant};

use serde::Deserialize;
use tomoswarm_proto::{Deviation, FIX_AGE_MAX_MS, Fix, Heading, Position, VehicleId};

use super::error::CliError;
use super::operator::{OperatorContext, fault};
use super::standard_output::complain;
use super::stop::StopFlag;
use crate::geom::{Angle, Point, Vector};
use crate::operator::operator_actor::In;

/// How long a line may wait before it is passed on.
const LOOK: Duration = Duration::from_millis(5);
/// The bus is joined within this time, or that is said.
const JOINS: Duration = Duration::from_secs(3);
/// What comes before the bus is joined waits; so many lines at most.
const WAITING: usize = 256;
/// So many bad lines are shown.
const SHOWN: u64 = 5;
/// A place is no further away than this, metres.
const FAR_M: f64 = 100_000.0;
/// Trackers may count turns; more than this is none, degrees.
const TURNED_DEG: f64 = 3600.0;
/// Within this time what was said last leaves the machine, before the command ends.
const LAST: Duration = Duration::from_millis(200);

/// Tell vehicles where motion capture or ultra-wideband has measured them to be.
///
/// Reads one JSON object a line from standard input until that ends:
///   {"vehicle": 1, "x_m": 2.5, "y_m": 4.0, "z_m": 0.0, "heading_deg": 90, "sd_m": 0.01, "age_s": 0.02}
/// z_m (0), heading_deg (not measured), sd_m (not known) and age_s (0: how long ago it was measured) may be left out.
/// Lengths are metres in the venue's frame; heading_deg is counter-clockwise from the x axis. A vehicle whose file says
/// `[pose] source = "external"` gives them to its autopilot, 20 a second at most.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP, verbatim_doc_comment)]
pub struct FixArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Where the origin of what measures lies in the venue's frame, metres, and how its x axis is turned there, degrees
    #[arg(long, value_name = "X,Y,DEG", default_value = "0,0,0", value_parser = parse_origin, allow_hyphen_values = true)]
    pub origin: Origin,
}

const AFTER_HELP: &str = "\
Examples:
  my-motion-capture | tomoswarm fix operator.toml
  my-motion-capture | tomoswarm fix operator.toml --origin 12.0,3.5,90

Exit codes: 0 the input has ended, or Ctrl-C; 1 the bus cannot be joined; 2 bad usage or configuration, or lines that make no sense
(the first ones are shown, and what comes after them is passed on all the same).";

/// Where the origin of what measures lies in the venue's frame.
#[derive(Clone, Copy, Debug)]
pub struct Origin {
    at: Point,
    turned: Angle,
}

fn parse_origin(text: &str) -> Result<Origin, String> {
    let numbers: Result<Vec<f64>, _> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>())
        .collect();
    match numbers.as_deref() {
        Ok([x_m, y_m, degrees]) if [x_m, y_m, degrees].iter().all(|one| is_place(**one)) => {
            Ok(Origin {
                at: Point::new(*x_m, *y_m),
                turned: Angle::from_degrees(*degrees),
            })
        }
        _ => Err("expected X,Y,DEG, such as 12.0,3.5,90".to_owned()),
    }
}

fn is_place(coordinate: f64) -> bool {
    coordinate.abs() <= FAR_M
}

/// A line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    vehicle: u64,
    x_m: f64,
    y_m: f64,
    #[serde(default)]
    z_m: f64,
    heading_deg: Option<f64>,
    sd_m: Option<f64>,
    #[serde(default)]
    age_s: f64,
}

impl FixArgs {
    /// Passes on what is read until it ends.
    ///
    /// # Errors
    /// A bad file, no bus, or lines that make no sense.
    pub fn run(&self, _: &mut dyn Write) -> Result<(), CliError> {
        let context = OperatorContext::read(&self.config)?;
        let stop = StopFlag::listen();
        let lines = read_lines()?;
        let mut operator = context.open()?;
        let joined_by = operator.now() + JOINS;
        while !operator.session().is_linked() && operator.now() < joined_by && !stop.is_asked() {
            operator.go_on(joined_by, |_, _| {}).map_err(fault)?;
        }
        if !operator.session().is_linked() {
            complain(&"nobody is heard yet");
        }
        let (mut count, mut bad, mut is_over) = (0_u64, 0_u64, false);
        while !is_over && !stop.is_asked() {
            loop {
                let (read_at, text) = match lines.try_recv() {
                    Ok((read_at, Ok(text))) => (read_at, text),
                    Ok((_, Err(error))) => {
                        return Err(CliError::Read {
                            path: "standard input".into(),
                            source: error,
                        });
                    }
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        is_over = true;
                        break;
                    }
                };
                count += 1;
                if text.trim().is_empty() {
                    continue;
                }
                match self.fix(&text) {
                    Ok(fix) => operator.tell(In::Fix(older(fix, read_at.elapsed()))),
                    Err(why) => {
                        bad += 1;
                        if bad <= SHOWN {
                            complain(&format!("standard input:{count}: {why}"));
                        }
                    }
                }
            }
            let until = operator.now() + LOOK;
            operator.go_on(until, |_, _| {}).map_err(fault)?;
        }
        let end = operator.now() + LAST;
        while operator.now() < end {
            operator.go_on(end, |_, _| {}).map_err(fault)?;
        }
        operator.close();
        if bad > 0 {
            return Err(CliError::Usage(format!(
                "{bad} of {count} lines make no sense"
            )));
        }
        Ok(())
    }

    /// Returns what a line says.
    fn fix(&self, text: &str) -> Result<Fix, String> {
        let line: Line = serde_json::from_str(text)
            .map_err(|error| error.to_string().replace(" at line 1 column", " at column"))?;
        let is_sound = [line.x_m, line.y_m, line.z_m].into_iter().all(is_place);
        if !is_sound {
            return Err(format!("is further away than {FAR_M} m"));
        }
        let vehicle = u8::try_from(line.vehicle)
            .ok()
            .filter(|id| (1..=250).contains(id));
        let vehicle =
            vehicle.ok_or_else(|| format!("vehicle {}: 1 to 250 are allowed", line.vehicle))?;
        if line
            .heading_deg
            .is_some_and(|degrees| !(-TURNED_DEG..=TURNED_DEG).contains(&degrees))
        {
            return Err(format!(
                "heading_deg: -{TURNED_DEG} to {TURNED_DEG} are allowed"
            ));
        }
        let age_ms = line.age_s * 1000.0;
        if !(0.0..=f64::from(FIX_AGE_MAX_MS)).contains(&age_ms) {
            return Err(format!("age_s {}: 0 to 2 are allowed", line.age_s));
        }
        if line.sd_m.is_some_and(|sd_m| !(0.0..=65.0).contains(&sd_m)) {
            return Err("sd_m: 0 to 65 are allowed".to_owned());
        }
        let ahead = Vector::polar(self.origin.turned, 1.0);
        let at = self.origin.at + ahead * line.x_m + ahead.left() * line.y_m;
        let heading = line.heading_deg.map(|degrees| {
            Heading::from_radians((Angle::from_degrees(degrees) + self.origin.turned).radians())
        });
        Ok(Fix {
            vehicle: VehicleId(vehicle),
            at: Position::from_metres(at.x_m, at.y_m, line.z_m),
            heading,
            sd: line.sd_m.map_or(Deviation::UNKNOWN, Deviation::from_metres),
            age_ms: age_ms as u16,
        })
    }
}

/// Returns a fix that has waited.
fn older(fix: Fix, waited: Duration) -> Fix {
    let waited_ms = u16::try_from(waited.as_millis()).unwrap_or(u16::MAX);
    let age_ms = fix.age_ms.saturating_add(waited_ms).min(FIX_AGE_MAX_MS);
    Fix { age_ms, ..fix }
}

/// A line, or why there is none, and when it was read.
type ReadLine = (Instant, io::Result<String>);

/// Reads lines on a thread of their own, up to the end of standard input.
fn read_lines() -> Result<Receiver<ReadLine>, CliError> {
    let (told, lines) = sync_channel(WAITING);
    let read = move || {
        for line in io::stdin().lock().lines() {
            let is_over = line.is_err();
            if told.send((Instant::now(), line)).is_err() || is_over {
                return;
            }
        }
    };
    let thread = std::thread::Builder::new().name("fixes".to_owned());
    let started = thread.spawn(read);
    started.map_err(|error| CliError::Fault(error.to_string()))?;
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(origin: &str, text: &str) -> Result<Fix, String> {
        let args = FixArgs {
            config: PathBuf::new(),
            origin: parse_origin(origin).unwrap(),
        };
        args.fix(text)
    }

    #[test]
    fn a_line_is_turned_and_moved_into_the_venues_frame() {
        let line = r#"{"vehicle": 3, "x_m": 2, "y_m": 1.5, "z_m": 0.4, "heading_deg": 350, "sd_m": 0.012, "age_s": 0.02}"#;
        let fix = read("10,-5,90", line).unwrap();
        let place = (fix.at.x_mm, fix.at.y_mm, fix.at.z_mm);
        assert_eq!(place, (8_500, -3_000, 400));
        let heading = fix.heading.unwrap().radians().to_degrees();
        assert!((heading - 80.0).abs() < 0.01, "{heading}");
        assert_eq!(
            (fix.vehicle, fix.sd, fix.age_ms),
            (VehicleId(3), Deviation(12), 20)
        );
    }

    #[test]
    fn what_is_left_out_is_not_known() {
        let fix = read("0,0,0", r#"{"vehicle": 1, "x_m": 0, "y_m": 0}"#).unwrap();
        assert_eq!(
            (fix.heading, fix.sd, fix.age_ms),
            (None, Deviation::UNKNOWN, 0)
        );
    }

    #[test]
    fn a_line_that_makes_no_sense_is_refused_with_its_reason() {
        for (line, part) in [
            ("1,2,3", "expected"),
            (r#"{"vehicle": 1, "x_m": 0}"#, "y_m"),
            (r#"{"vehicle": 0, "x_m": 0, "y_m": 0}"#, "1 to 250"),
            (
                r#"{"vehicle": 300, "x_m": 0, "y_m": 0}"#,
                "vehicle 300: 1 to 250",
            ),
            (
                r#"{"vehicle": 1, "x_m": 0, "y_m": 0, "heading_deg": 1e300}"#,
                "-3600 to 3600",
            ),
            (r#"{"vehicle": 1, "x_m": 1e9, "y_m": 0}"#, "further away"),
            (
                r#"{"vehicle": 1, "x_m": 1, "y_m": 0, "age_s": 3}"#,
                "0 to 2",
            ),
            (
                r#"{"vehicle": 1, "x_m": 1, "y_m": 0, "age_s": -1}"#,
                "0 to 2",
            ),
            (
                r#"{"vehicle": 1, "x_m": 1, "y_m": 0, "sd_m": -1}"#,
                "0 to 65",
            ),
            (
                r#"{"vehicle": 1, "x_m": 1, "y_m": 0, "yaw": 1}"#,
                "unknown field",
            ),
            (r#"{"vehicle": 1, "x_m": NaN, "y_m": 0}"#, "expected"),
        ] {
            let why = read("0,0,0", line).unwrap_err();
            assert!(why.contains(part), "{line}: {why}");
        }
        assert!(parse_origin("1,2").is_err() && parse_origin("1,2,nan").is_err());
    }
}
