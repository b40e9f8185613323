//! What is answered to whoever may look, beside the feed: metrics, the checks before a start, what stands in a simulation,
//! who has seen a cell, how strongly a pair was heard, what is set, files, and which links made a pixel. Each judges the token
//! first, and changes nothing.

use std::collections::BTreeSet;

use serde_json::json;
use tomoswarm_proto::{ImageSubject, RunId, Sender, VehicleId};

use super::PageServer;
use crate::config::keys_in_words;
use crate::dash::board::Board;
use crate::dash::cell_view::cell;
use crate::dash::gate::{GateRefusal, PageId};
use crate::dash::heard_files::HeardFiles;
use crate::dash::metrics::metrics;
use crate::dash::pair_history::pair_history;
use crate::dash::run_files::{MissionFormat, places_of, waypoints};
use crate::dash::why::{WhyQuestion, WhyTask, settings_of};
use crate::geom::Point;
use crate::operator::preflight::{Requirements, inspect, is_go};
use crate::operator::status::Expected;
use crate::time::Time;
use crate::tomo::ImagingSettings;

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
        let (at, board) = self.shown_to(now, asked.page);
        Ok(cell(at, board, asked.at, asked.slice))
    }

    /// Returns how strongly two vehicles heard each other, as JSON, for whoever may look; `page` = as for [`CellQuestion`].
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn pair(
        &self,
        now: Time,
        authorization: Option<&str>,
        [one, other]: [VehicleId; 2],
        page: Option<PageId>,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let (at, _) = self.shown_to(now, page);
        Ok(pair_history(at, &self.history, one, other))
    }

    /// Returns the moment that a page looks at, and what was known then; without a page the present.
    fn shown_to(&self, now: Time, page: Option<PageId>) -> (Time, &Board) {
        let page = page.and_then(|id| self.pages.get(&id));
        match page.and_then(|page| page.playback.as_ref()) {
            Some(playback) => (playback.moment(&self.history, now), playback.board()),
            None => (self.present(now), &self.board),
        }
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

    /// Returns where the vehicles of another run were ([`Ghost::beside`](crate::dash::ghost::Ghost::beside)), for whoever
    /// may look.
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

    /// Returns what is set, TOML with the meaning of each key, for whoever may look; of a node what it has said itself.
    ///
    /// # Errors
    /// The token is none of this server's, or the node has said nothing.
    pub fn settings(
        &self,
        authorization: Option<&str>,
        of: Option<Sender>,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let Some(node) = of else {
            return Ok(self.settings.clone());
        };
        self.node_settings.of(node).ok_or_else(|| {
            GateRefusal::Unreadable(format!("{node} has not said its settings to this page"))
        })
    }

    /// Returns every key that can be set, with its default and what is allowed, as `tomoswarm check --keys` prints them
    /// ([`keys_in_words`]), for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn keys(&self, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        Ok(keys_in_words())
    }

    /// Judges whether who asks may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn judge_looking(&self, authorization: Option<&str>) -> Result<(), GateRefusal> {
        self.gate.judge_looking(authorization)
    }

    /// Returns the files of runs as far as they were heard, which a thread may make for whoever may look.
    pub fn heard_files(&self) -> HeardFiles {
        HeardFiles::new(&self.venue, &self.board, self.links.heard())
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

    /// Returns what is needed to say which links made a pixel of an image, for whoever may look: of the newest one, or of that
    /// which a page sees that looks back.
    ///
    /// # Errors
    /// The token is none of this server's; the question cannot be read; there is no such image; it is not known any more what
    /// had been heard when an earlier one came.
    pub fn why(
        &self,
        now: Time,
        authorization: Option<&str>,
        question: &[u8],
    ) -> Result<WhyTask, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let unreadable = |reason: String| GateRefusal::Unreadable(reason);
        let asked: WhyQuestion = serde_json::from_slice(question)
            .map_err(|error| unreadable(format!("not a question: {error}")))?;
        let (subject, is_change) = match asked.subject {
            0 => (ImageSubject::Structure, false),
            1 => (ImageSubject::Change, true),
            _ => return Err(unreadable("subject: 0 or 1 is expected".to_owned())),
        };
        let (_, board) = self.shown_to(now, asked.page);
        let shown = board.image(subject);
        let image = shown.and_then(|shown| shown.parts.values().next());
        let image = image.ok_or_else(|| unreadable("there is no such image yet".to_owned()))?;
        let edition = (image.run, image.sequence);
        let newest = self.board.image(subject).map(|newest| newest.edition);
        let earlier = (newest != Some(edition)).then(|| {
            let heard = self.links.before_image(edition).cloned();
            heard.ok_or_else(|| {
                unreadable("what this image was made of is not known any more".to_owned())
            })
        });
        let usual = settings_of(image, is_change);
        let known = self.imaging.map(|of| of[usize::from(is_change)]);
        let settings = known.map_or(usual, |known| ImagingSettings {
            grid: usual.grid,
            ..known
        });
        Ok(WhyTask {
            run: image.run,
            is_change,
            empty_run: is_change.then(|| compared_with(board, image.run)).flatten(),
            links: self.links.heard().clone(),
            earlier: earlier.transpose()?,
            made_of: image.links_used,
            settings,
            at: Point::new(asked.at[0], asked.at[1]),
        })
    }

    /// Returns the checks before a start of everyone who was heard, as JSON, for whoever may look, at the moment that a
    /// page looks at; `software` is the version that all are to run.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn preflight(
        &self,
        now: Time,
        authorization: Option<&str>,
        page: Option<PageId>,
        software: &str,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let (now, board) = self.shown_to(now, page);
        let view = board.view();
        let everyone = Expected {
            vehicles: BTreeSet::new(),
            ground: true,
        };
        let needs = Requirements {
            vehicles: everyone.vehicles(view, now),
            venue_hash: board.venue_hash(),
            fence: self.venue.fence.clone(),
            homes: self.venue.homes.clone(),
            pose_sd_max_m: Some(self.venue.swarm.pose_sd_max_m),
            software: software.to_owned(),
        };
        let nodes = inspect(view, &needs, now);
        Ok(json!({ "isGo": is_go(&nodes), "nodes": nodes }).to_string())
    }
}

/// Returns the run that a run is compared with, as the ground station says.
fn compared_with(board: &Board, run: RunId) -> Option<RunId> {
    let grounds = board.view().grounds();
    let mut reports = grounds.flat_map(|report| &report.value.runs);
    reports.find(|report| report.run == run)?.compared_with
}
