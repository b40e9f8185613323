//! `--watch`: draws map and vehicles in the terminal while a simulation runs, and slows it down when that is asked for.
//! It decides when a picture is due; what it shows is made by `frame`, the terminal is `screen`'s.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::error::CliError;
use super::frame::{RunFrame, VehicleMarker};
use super::screen::{Screen, Size};
use super::sim::progress;
use super::stop::StopFlag;
use crate::config::Venue;
use crate::geom::Point;
use crate::sim::{RunView, VehicleSnapshot};
use crate::time::Time;

/// Pictures follow each other no faster than this.
const DRAW_EVERY: Duration = Duration::from_millis(100);
/// A request to end is seen within this time, however slow the run.
pub(super) const NAP: Duration = Duration::from_millis(50);
/// A run shows itself at least this often, virtual time.
const SHOWN_MIN: Duration = Duration::from_millis(10);
/// A run that is not slowed down shows itself this often, virtual time.
const SHOWN_EVERY: Duration = Duration::from_secs(1);
/// So many places of a track are drawn, this far apart, metres.
const TRACK: usize = 60;
const TRACK_STEP_M: f64 = 0.15;

/// Draws a run while it goes on.
pub(super) struct Watching<'a> {
    venue: &'a Venue,
    screen: Screen,
    began: Instant,
    drawn_at: Option<Instant>,
    pace: Option<f64>,
    vehicles: Vec<VehicleMarker>,
}

/// Returns whether a run can be watched here.
///
/// # Errors
/// There is no terminal to draw on.
pub(super) fn check() -> Result<(), CliError> {
    Screen::check().map_err(|reason| {
        CliError::Usage(format!(
            "--watch draws on the terminal behind standard error, but {reason}"
        ))
    })
}

/// Returns how often a run is to show itself, in virtual time, for a pace in virtual seconds a second.
pub(super) fn shown_every(pace: Option<f64>) -> Duration {
    pace.map_or(SHOWN_EVERY, |pace| {
        DRAW_EVERY.mul_f64(pace).clamp(SHOWN_MIN, SHOWN_EVERY)
    })
}

impl<'a> Watching<'a> {
    /// Takes the terminal over.
    pub(super) fn begin(venue: &'a Venue, pace: Option<f64>) -> Watching<'a> {
        let (screen, began) = (Screen::take(), super::sim::started());
        Watching {
            venue,
            screen,
            began,
            drawn_at: None,
            pace,
            vehicles: Vec::new(),
        }
    }

    /// Takes a moment of the run: draws it when a picture is due, and waits until the time for it has come.
    pub(super) fn show(&mut self, shown: &RunView<'_>, stop: &StopFlag) {
        self.follow(&shown.vehicles);
        if self.drawn_at.is_none_or(|at| at.elapsed() >= DRAW_EVERY) {
            self.drawn_at = Some(super::sim::started());
            self.draw(shown);
        }
        wait_for(shown.status.now, self.pace, self.began, stop);
    }

    fn draw(&mut self, shown: &RunView<'_>) {
        let size = self.screen.size();
        let line = progress(&shown.status, self.began.elapsed());
        let frame = RunFrame::new(self.venue, shown.map, &self.vehicles, line.clone(), size);
        let lines = frame.map_or_else(|| too_small(line, size), |frame| frame.lines());
        self.screen.draw(size, &lines);
    }

    /// Remembers where everybody comes from.
    fn follow(&mut self, vehicles: &[VehicleSnapshot]) {
        self.vehicles.truncate(vehicles.len());
        for (index, vehicle) in vehicles.iter().enumerate() {
            match self.vehicles.get_mut(index) {
                Some(drawn) => drawn.vehicle = *vehicle,
                None => self.vehicles.push(VehicleMarker {
                    vehicle: *vehicle,
                    track: VecDeque::new(),
                }),
            }
            extend(&mut self.vehicles[index].track, vehicle.at);
        }
    }
}

/// Waits until a moment of virtual time has come at a pace, or until the run is asked to stop.
pub(super) fn wait_for(now: Time, pace: Option<f64>, began: Instant, stop: &StopFlag) {
    let Some(pace) = pace else { return };
    let due = Duration::try_from_secs_f64(now.as_secs_f64() / pace).unwrap_or(Duration::MAX);
    while !stop.is_asked() && began.elapsed() < due {
        nap(NAP.min(due.saturating_sub(began.elapsed())));
    }
}

fn extend(track: &mut VecDeque<Point>, at: Point) {
    if track
        .back()
        .is_none_or(|last| last.distance_to(at) >= TRACK_STEP_M)
    {
        track.push_back(at);
    }
    if track.len() > TRACK {
        track.pop_front();
    }
}

/// What is drawn where no picture fits.
fn too_small(line: String, size: Size) -> Vec<String> {
    let lines = [line, "the terminal is too small for a picture".to_owned()];
    lines
        .into_iter()
        .take(size.rows)
        .map(|line| line.chars().take(size.columns).collect())
        .collect()
}

#[allow(
    clippy::disallowed_methods,
    reason = "who watches wants the run slowed down; no decision hangs on it"
)]
pub(super) fn nap(span: Duration) {
    std::thread::sleep(span);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_run_shows_itself_ten_times_a_second_and_a_fast_one_once_a_virtual_second() {
        let check = |pace, expected_s| assert_eq!(shown_every(pace).as_secs_f64(), expected_s);
        check(Some(1.0), 0.1);
        check(Some(4.0), 0.4);
        check(Some(0.01), 0.01);
        check(Some(1000.0), 1.0);
        check(None, 1.0);
    }

    #[test]
    fn a_track_is_as_long_as_allowed_and_grows_by_motion_only() {
        let mut track = VecDeque::new();
        (0..1000).for_each(|_| extend(&mut track, Point::new(1.0, 1.0)));
        assert_eq!(track.len(), 1);
        (0..1000).for_each(|step| extend(&mut track, Point::new(f64::from(step), 1.0)));
        assert_eq!(
            (track.len(), track.back().copied()),
            (TRACK, Some(Point::new(999.0, 1.0)))
        );
    }

    #[test]
    fn a_terminal_of_a_few_letters_gets_no_more_than_fits() {
        let size = Size {
            columns: 5,
            rows: 1,
        };
        assert_eq!(too_small("1.0 min simulated".to_owned(), size), ["1.0 m"]);
    }
}
