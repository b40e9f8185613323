//! Why a pixel is dark: which links made it, how much each, and what the image leaves unexplained of it. It is asked by a page
//! ([`WhyQuestion`]), made of the links that were heard ([`super::links`]), and answered apart from the server's loop
//! ([`WhyTask`]), since it takes about a second.
//!
//! An earlier image, which a page sees that looks back, was made of what had been measured until it came: so is the answer.
//! Of the newest image it is made of all that was heard; where there is a ground station's store, of what that has, also of
//! what was sent before this program began.
//!
//! Only the solver `map` knows which links made a pixel, so that is what answers, on the grid of the image that is shown;
//! its value and that of an image by another solver differ, and the page says both.

use serde::Deserialize;
use tomoswarm_proto::{Image, RunId};

use super::gate::PageId;
use super::links::{HeardLinks, SamplesHeard};
use super::run_files::RunFiles;
use super::told::{Why, WhyLink, as_text};
use crate::geom::{PixelGrid, Point, Rect, Segment};
use crate::tomo::{Extras, Imager, ImagingSettings, Link, LinkShare};

/// Links that are told, those that add or take most.
const TOLD: usize = 200;
/// An image of more pixels is not computed again for a question.
const MOST_PIXELS: usize = 40_000;

/// What a page asks: about the image that it sees.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhyQuestion {
    /// 0 = the image of the structure, 1 = that of the change.
    pub subject: u8,
    /// The place, metres.
    pub at: [f64; 2],
    /// The page, which may look at another time; without one the newest image is meant.
    #[serde(default)]
    pub page: Option<PageId>,
}

/// A question with all that was heard.
#[derive(Clone, Debug)]
pub struct WhyTask {
    /// Of which run.
    pub run: RunId,
    /// Whether it is about the image of the change.
    pub is_change: bool,
    /// The run that it is compared with.
    pub empty_run: Option<RunId>,
    /// The links of all runs.
    pub links: HeardLinks,
    /// What had been heard when the image came, if it is an earlier one.
    pub earlier: Option<SamplesHeard>,
    /// How many links the image was made of, as it says itself.
    pub made_of: u32,
    /// How it is imaged.
    pub settings: ImagingSettings,
    /// The place.
    pub at: Point,
}

impl WhyTask {
    /// Returns the answer as text (JSON); `store` is that of a ground station, if there is one.
    ///
    /// # Errors
    /// No samples were heard of a run, nor are there any in the store; not all that an earlier image was made of are kept; or
    /// there is no answer ([`WhyJob::answer`]); in words.
    pub fn answer(self, store: Option<&dyn RunFiles>) -> Result<String, String> {
        let runs = std::iter::once(self.run).chain(self.empty_run);
        let links = match (&self.earlier, store) {
            (Some(heard), _) => self.links.when(heard, runs)?,
            (None, Some(store)) => {
                let is_heard = runs.clone().all(|run| self.links.has(run));
                let stored = runs.map(|run| Ok((run, store.links(run)?)));
                match stored.collect::<Result<Vec<_>, String>>() {
                    Ok(stored) => HeardLinks::of_runs(stored),
                    // One that is not there, or cannot be read, takes nothing from what was heard.
                    Err(_) if is_heard => self.links,
                    Err(reason) => return Err(reason),
                }
            }
            (None, None) => self.links,
        };
        let (now, empty) = match self.empty_run {
            Some(empty) => {
                let (now, empty) = links.against(self.run, empty);
                (now, Some(empty))
            }
            None => (links.of(self.run), None),
        };
        let lacks = now.is_empty() || empty.as_ref().is_some_and(Vec::is_empty);
        if lacks || (self.is_change && empty.is_none()) {
            let reason = "this page has not heard the samples of the run, or of the empty one: it began later";
            return Err(reason.to_owned());
        }
        let job = WhyJob {
            run: self.run,
            empty_run: self.empty_run,
            now,
            empty,
            heard: links,
            made_of: self.made_of,
            settings: self.settings,
            at: self.at,
        };
        job.answer()
    }
}

/// What is needed for the answer.
#[derive(Clone, Debug)]
pub struct WhyJob {
    /// Of which run.
    pub run: RunId,
    /// The run that it is compared with.
    pub empty_run: Option<RunId>,
    /// Links of the run.
    pub now: Vec<Link>,
    /// Links of the empty run.
    pub empty: Option<Vec<Link>>,
    /// What was heard of the links of all runs, which says who has measured which.
    pub heard: HeardLinks,
    /// How many links the image was made of, as it says itself.
    pub made_of: u32,
    /// How it is imaged.
    pub settings: ImagingSettings,
    /// The place.
    pub at: Point,
}

/// Returns how an image is made again by the solver `map`: as is usual for its area, on its grid.
pub fn settings_of(image: &Image, is_change: bool) -> ImagingSettings {
    let corner = |at: tomoswarm_proto::Position| Point::new(at.x_m(), at.y_m());
    let area = Rect::new(corner(image.area.least), corner(image.area.greatest));
    let usual = match is_change {
        true => ImagingSettings::for_change(area),
        false => ImagingSettings::for_area(area),
    };
    ImagingSettings {
        grid: PixelGrid {
            area,
            columns: usize::from(image.columns),
            rows: usize::from(image.rows),
        },
        ..usual
    }
}

impl WhyJob {
    /// Returns the answer as text (JSON).
    ///
    /// # Errors
    /// The place is outside of the image, or there is no image; in words.
    pub fn answer(&self) -> Result<String, String> {
        let grid = &self.settings.grid;
        if grid.columns * grid.rows > MOST_PIXELS {
            return Err(format!("the image has more than {MOST_PIXELS} pixels"));
        }
        let pixel = grid.pixel_at(self.at);
        let pixel = pixel.ok_or("this place is outside of the image")?;
        let extras = Extras {
            shares_of: Some(pixel),
            ..Extras::default()
        };
        let mut imager = Imager::new(self.settings).map_err(|error| error.to_string())?;
        let made = imager.update(&self.now, self.empty.as_deref(), extras);
        let made = made.map_err(|error| error.to_string())?;
        let shares = made.shares.ok_or("no link made this pixel")?;
        let nearest = shares.links.iter().map(|link| distance_m(link, shares.at));
        let untold = shares.links.iter().skip(TOLD).map(|link| link.share);
        let told = shares.links.iter().take(TOLD);
        Ok(as_text(&Why {
            run: self.run.0,
            empty_run: self.empty_run.map(|run| run.0),
            at: [shares.at.x_m, shares.at.y_m],
            value_dbpm: shares.value,
            links: shares.links.len(),
            made_of: self.made_of,
            nearest_m: nearest.min_by(f64::total_cmp),
            residual_rms_db: made.residual_rms_db,
            least_covered_deg: least_covered_deg(&shares.links, shares.at),
            untold_dbpm: untold.sum::<f64>(),
            told: told.map(|of| self.link(of)).collect(),
        }))
    }

    fn link(&self, of: &LinkShare) -> WhyLink {
        let metres = |at: Point| [(at.x_m * 1e3).round() / 1e3, (at.y_m * 1e3).round() / 1e3];
        let parts = |value: f64| (value * 1e4).round() / 1e4;
        let by = self.heard.vehicles_between(self.run, of.from, of.to);
        WhyLink {
            from: metres(of.from),
            to: metres(of.to),
            length_m: parts(of.from.distance_to(of.to)),
            vehicles: by.iter().map(|id| id.0).collect(),
            share_dbpm: parts(of.share),
            loss_db: parts(of.attenuation_db),
            sd_db: parts(of.sd_db),
            residual_db: parts(of.residual_db),
            packets: of.packets,
            misses: of.misses,
        }
    }
}

/// Returns how far a link passes from a place, metres.
fn distance_m(link: &LinkShare, at: Point) -> f64 {
    Segment::new(link.from, link.to).distance_to_point(at)
}

/// Links nearer than this go through a place, metres.
const THROUGH_M: f64 = 0.75;
/// Directions that are told apart.
const SECTORS: usize = 12;

/// Returns from which direction fewest links go through a place: the middle of a sector of 15°, counter-clockwise from the
/// x axis, 0 to 180; `None` when none goes through.
fn least_covered_deg(links: &[LinkShare], at: Point) -> Option<f64> {
    let mut counts = [0_usize; SECTORS];
    for link in links.iter().filter(|link| distance_m(link, at) < THROUGH_M) {
        let along = link.to - link.from;
        let turn = libm::atan2(along.y_m, along.x_m) / std::f64::consts::PI;
        let share = (turn + 1.0).fract();
        counts[((share * SECTORS as f64) as usize).min(SECTORS - 1)] += 1;
    }
    let (sector, _) = counts.iter().enumerate().min_by_key(|(_, count)| **count)?;
    let is_any = counts.iter().any(|count| *count > 0);
    is_any.then(|| (sector as f64 + 0.5) * 180.0 / SECTORS as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dash::links::LinkBook;
    use crate::tomo::LinkBins;
    use serde_json::{Value, json};
    use std::collections::BTreeMap;
    use tomoswarm_proto::{Boot, PoseReport, Position, Sample, Samples, VehicleId};

    fn job(at: Point) -> WhyJob {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
        let mut now = Vec::new();
        for k in 0..10 {
            let x_m = f64::from(k) * 2.0 + 1.0;
            let is_dark = k == 4;
            let strength = if is_dark { -75.0 } else { -60.0 };
            let up = (Point::new(x_m, 0.0), Point::new(x_m, 20.0));
            let across = (Point::new(0.0, x_m), Point::new(20.0, x_m));
            now.push(Link::fixed(up.0, up.1, 20, strength));
            now.push(Link::fixed(across.0, across.1, 20, strength));
        }
        WhyJob {
            run: RunId(2),
            empty_run: None,
            now,
            empty: None,
            heard: HeardLinks::default(),
            made_of: 20,
            settings: ImagingSettings::for_area(area),
            at,
        }
    }

    #[test]
    fn a_pixel_is_the_sum_of_its_links_and_the_strongest_go_through_it() {
        let answer = job(Point::new(9.0, 9.0)).answer().unwrap();
        let said: Value = serde_json::from_str(&answer).unwrap();
        let told = said["told"].as_array().unwrap();
        let sum: f64 = told
            .iter()
            .map(|of| of["share_dbpm"].as_f64().unwrap())
            .sum();
        assert!(
            (sum - said["value_dbpm"].as_f64().unwrap()).abs() < 0.01,
            "{answer}"
        );
        assert!(sum > 0.05, "{answer}");
        for of in told {
            // It lies along an axis; and nobody has said who measured it.
            let length_m = of["length_m"].as_f64().unwrap();
            assert!((length_m - 20.0).abs() < 1e-9, "{of}");
            assert_eq!(of["vehicles"], json!([]));
        }
        for strongest in &told[..2] {
            let ends = [&strongest["from"], &strongest["to"]];
            let is_through = ends.iter().any(|end| end[0] == 9.0 || end[1] == 9.0);
            assert!(is_through, "{strongest}");
        }
        // Links go through it along x and along y only.
        let least = said["leastCovered_deg"].as_f64().unwrap();
        assert!((20.0..70.0).contains(&least), "{least}");
    }

    #[test]
    fn each_link_names_the_vehicles_that_measured_it() {
        let pose = |x_m, y_m| PoseReport {
            at: Position::from_metres(x_m, y_m, 0.0),
            ..PoseReport::default()
        };
        let mut book = LinkBook::default();
        // Two stand at the same places one after the other, and hear a third across the yard.
        for (receiver, x_m) in [(1, 5.0), (2, 5.0), (2, 15.0)] {
            let sample = |sequence| Sample {
                sequence,
                heard_at_ns: sequence,
                transmitter: VehicleId(3),
                transmitter_pose: pose(x_m, 20.0),
                receiver_pose: pose(x_m, 0.0),
                channel: 20,
                power_dbm: 0,
                rssi_dbm: Some(-60),
            };
            let from = (x_m * 10.0) as u64;
            book.take(&Samples {
                vehicle: VehicleId(receiver),
                boot: Boot(1),
                run: RunId(2),
                samples: (from..from + 9).map(sample).collect(),
                lost: Vec::new(),
            });
        }
        let asked = WhyJob {
            heard: book.heard().clone(),
            ..job(Point::new(9.0, 9.0))
        };
        let said: Value = serde_json::from_str(&asked.answer().unwrap()).unwrap();
        let by = |x_m: f64| {
            let told = said["told"].as_array().unwrap();
            let link = told.iter().find(|of| of["from"][0] == x_m).unwrap();
            link["vehicles"].clone()
        };
        assert_eq!(by(5.0), json!([1, 2, 3]));
        assert_eq!(by(15.0), json!([2, 3]));
        assert_eq!(by(7.0), json!([]), "it is not known who");
    }

    /// A store that has one run.
    struct Stored(LinkBins);

    impl RunFiles for Stored {
        fn names(&self, _: RunId) -> Result<Vec<String>, String> {
            Ok(Vec::new())
        }

        fn file(&self, _: RunId, name: &str) -> Result<Vec<u8>, String> {
            Err(name.to_owned())
        }

        fn links(&self, run: RunId) -> Result<LinkBins, String> {
            let bins = (run == RunId(2)).then(|| self.0.clone());
            bins.ok_or_else(|| format!("there is no run {run}"))
        }
    }

    #[test]
    fn a_store_knows_what_was_sent_before_this_program_began() {
        let job = job(Point::new(9.0, 9.0));
        let mut bins = LinkBins::default();
        for link in &job.now {
            bins.record_link(None, link);
        }
        let store = Stored(bins);
        let task = |run, empty_run, links| WhyTask {
            run: RunId(run),
            is_change: false,
            empty_run,
            links,
            earlier: None,
            made_of: 20,
            settings: job.settings,
            at: job.at,
        };
        let unheard = HeardLinks::default();
        let said = task(2, None, unheard.clone()).answer(Some(&store)).unwrap();
        assert!(said.contains("\"links\":20"), "{said}");
        let refused = task(2, Some(RunId(1)), unheard).answer(Some(&store));
        assert_eq!(refused.unwrap_err(), "there is no run 1");
        // What was heard counts where the store does not have it.
        let heard = HeardLinks::of_runs([(RunId(5), store.0.clone())]);
        let said = task(5, None, heard).answer(Some(&store)).unwrap();
        assert!(said.contains("\"links\":20"), "{said}");
    }

    #[test]
    fn an_earlier_image_whose_samples_have_no_room_any_more_is_not_answered_by_halves() {
        let task = WhyTask {
            run: RunId(2),
            is_change: false,
            empty_run: None,
            links: HeardLinks::default(),
            earlier: Some(BTreeMap::from([(RunId(2), 700)])),
            made_of: 20,
            settings: job(Point::new(9.0, 9.0)).settings,
            at: Point::new(9.0, 9.0),
        };
        let refused = task.answer(None).unwrap_err();
        assert!(refused.contains("of the 700 samples of run 2"), "{refused}");
    }

    #[test]
    fn a_run_that_was_not_heard_or_is_compared_with_none_is_said() {
        let task = |is_change| WhyTask {
            run: RunId(2),
            is_change,
            empty_run: None,
            links: HeardLinks::default(),
            earlier: None,
            made_of: 20,
            settings: job(Point::new(9.0, 9.0)).settings,
            at: Point::new(9.0, 9.0),
        };
        for is_change in [true, false] {
            let refused = task(is_change).answer(None).unwrap_err();
            assert!(refused.contains("has not heard the samples"), "{refused}");
        }
    }

    #[test]
    fn a_place_outside_and_a_run_without_links_are_said() {
        let outside = job(Point::new(90.0, 9.0)).answer();
        assert!(outside.unwrap_err().contains("outside"));
        let mut empty = job(Point::new(9.0, 9.0));
        empty.now.clear();
        assert!(empty.answer().unwrap_err().contains("no link"));
    }
}
