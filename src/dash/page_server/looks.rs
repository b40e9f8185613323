//! What is answered to whoever may look, beside the feed: metrics, the checks before a start, what stands in a simulation, who has
//! seen a cell, what is set, files, and which links made a pixel. Each judges the token first, and changes nothing.

use std::collections::BTreeSet;

use serde_json::json;
use tomoswarm_proto::{ImageSubject, RunId};

use super::PageServer;
use crate::dash::cell_view::cell;
use crate::dash::gate::{GateRefusal, PageId};
use crate::dash::heard_files::HeardFiles;
use crate::dash::metrics::metrics;
use crate::dash::run_files::{MissionFormat, exported, places_of, waypoints};
use crate::dash::why::{WhyJob, WhyQuestion, settings_of};
use crate::geom::Point;
use crate::operator::preflight::{Requirements, inspect, is_go};
use crate::operator::status::Expected;
use crate::time::Time;
use crate::tomo::{ImagingSettings, links_csv};

/// Which cell is asked for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CellQuestion {
    /// A place in it.
    pub at: Point,
    /// Of one slice of altitude; `None` = of all.
    pub slice: Option<i16>,
    /// By which page: what one is told that looks at another time is what was known then.
    pub page: Option<PageId>,
}

impl PageServer {
    /// Returns who has seen a cell, what each says and since when, as JSON, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn cell(
        &self,
        now: Time,
        authorization: Option<&str>,
        asked: CellQuestion,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let page = asked.page.and_then(|id| self.pages.get(&id));
        let (at, board) = match page.and_then(|page| page.playback.as_ref()) {
            Some(playback) => (playback.moment(&self.history, now), playback.board()),
            None => (self.present(now), &self.board),
        };
        Ok(cell(at, board, asked.at, asked.slice))
    }

    /// Returns the metrics for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn metrics(&self, now: Time, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        Ok(metrics(self.present(now), &self.board))
    }

    /// Returns what stands in the scene of a simulation, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; it is not known what stands there.
    pub fn mesh(&self, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        if self.mesh.is_empty() {
            let reason = "what truly stands here is known in a simulation only";
            return Err(GateRefusal::Unreadable(reason.to_owned()));
        }
        Ok(self.mesh.clone())
    }

    /// Returns where the vehicles of another run were ([`Ghost::beside`](crate::dash::ghost::Ghost::beside)), for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; there is no other run.
    pub fn ghost(&self, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        if self.ghost.is_empty() {
            let reason =
                "no other run is shown beside this one: dash --replay FOLDER --ghost FOLDER";
            return Err(GateRefusal::Unreadable(reason.to_owned()));
        }
        Ok(self.ghost.clone())
    }

    /// Returns what is set, TOML with the meaning of each key, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn settings(&self, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        Ok(self.settings.clone())
    }

    /// Returns the links of a run as a file of `tomoswarm image`, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; nothing was heard of the run.
    pub fn links(&self, authorization: Option<&str>, run: RunId) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let links = self.links.measured(run);
        if links.is_empty() {
            let reason = format!("this page has heard no samples of run {run}");
            return Err(GateRefusal::Unreadable(reason));
        }
        Ok(links_csv(&links))
    }

    /// Judges whether who asks may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn judge_looking(&self, authorization: Option<&str>) -> Result<(), GateRefusal> {
        self.gate.judge_looking(authorization)
    }

    /// Returns a file of a run as far as it was heard, or without a name which files there are; whoever asks may look.
    ///
    /// # Errors
    /// Nothing was heard of the run, or there is no such file.
    pub fn heard_file(&self, run: RunId, name: Option<&str>) -> Result<Vec<u8>, GateRefusal> {
        let files = HeardFiles {
            venue: &self.venue,
            board: &self.board,
            links: &self.links,
        };
        let source = match self.links.samples().left_out(run) {
            0 => "what this page's program has heard".to_owned(),
            count => format!("what this page's program has heard; {count} samples had no room"),
        };
        exported(&files, &source, (run, name)).map_err(GateRefusal::Unreadable)
    }

    /// Returns places (JSON, `[[x, y], …]`, metres) as a mission of QGroundControl in a format, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; they are no places of the venue.
    pub fn waypoints(
        &self,
        authorization: Option<&str>,
        places: &[u8],
        format: MissionFormat,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let places: Vec<[f64; 2]> = serde_json::from_slice(places)
            .map_err(|error| GateRefusal::Unreadable(format!("no places: {error}")))?;
        waypoints(&self.venue, &places, format).map_err(GateRefusal::Unreadable)
    }

    /// Returns the places (JSON, `[[x, y], …]`, metres) of a mission, `.waypoints` or `.plan`, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; all that is wrong with the file.
    pub fn places(&self, authorization: Option<&str>, text: &[u8]) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let text = str::from_utf8(text)
            .map_err(|_| GateRefusal::Unreadable("the file is no text".to_owned()))?;
        places_of(&self.venue, text).map_err(GateRefusal::Unreadable)
    }

    /// Returns what is needed to say which links made a pixel of the newest image, for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's; the question cannot be read; there is no such image, or no links of it.
    pub fn why(&self, authorization: Option<&str>, question: &[u8]) -> Result<WhyJob, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let unreadable = |reason: String| GateRefusal::Unreadable(reason);
        let asked: WhyQuestion = serde_json::from_slice(question)
            .map_err(|error| unreadable(format!("not a question: {error}")))?;
        let (subject, is_change) = match asked.subject {
            0 => (ImageSubject::Structure, false),
            1 => (ImageSubject::Change, true),
            _ => return Err(unreadable("subject: 0 or 1 is expected".to_owned())),
        };
        let newest = self.board.image(subject);
        let image = newest.and_then(|newest| newest.parts.values().next());
        let image = image.ok_or_else(|| unreadable("there is no such image yet".to_owned()))?;
        let usual = settings_of(image, is_change);
        let known = self.imaging.map(|of| of[usize::from(is_change)]);
        let settings = known.map_or(usual, |known| ImagingSettings {
            grid: usual.grid,
            ..known
        });
        let empty_run = is_change.then(|| self.compared_with(image.run)).flatten();
        let (now, empty) = match empty_run {
            Some(empty) => {
                let (now, empty) = self.links.against(image.run, empty);
                (now, Some(empty))
            }
            None => (self.links.of(image.run), None),
        };
        let job = WhyJob {
            run: image.run,
            empty_run,
            now,
            empty,
            settings,
            at: Point::new(asked.at[0], asked.at[1]),
        };
        let lacks = job.now.is_empty() || job.empty.as_ref().is_some_and(Vec::is_empty);
        if lacks || (is_change && job.empty.is_none()) {
            let reason = "this page has not heard the samples of the run, or of the empty one: it began later";
            return Err(unreadable(reason.to_owned()));
        }
        Ok(job)
    }

    /// Returns the run that a run is compared with, as the ground station says.
    fn compared_with(&self, run: RunId) -> Option<RunId> {
        let mut reports = self
            .board
            .view()
            .grounds()
            .flat_map(|report| &report.value.runs);
        reports.find(|report| report.run == run)?.compared_with
    }

    /// Returns the checks before a start of everyone who was heard, as JSON, for whoever may look; `software` is the version
    /// that all are to run.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn preflight(
        &self,
        now: Time,
        authorization: Option<&str>,
        software: &str,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let now = self.present(now);
        let view = self.board.view();
        let everyone = Expected {
            vehicles: BTreeSet::new(),
            ground: true,
        };
        let needs = Requirements {
            vehicles: everyone.vehicles(view, now),
            venue_hash: self.board.venue_hash(),
            fence: self.venue.fence.clone(),
            homes: self.venue.homes.clone(),
            pose_sd_max_m: None,
            software: software.to_owned(),
        };
        let nodes = inspect(view, &needs, now);
        Ok(json!({ "isGo": is_go(&nodes), "nodes": nodes }).to_string())
    }
}
