//! Persons who walk within a fixed network: where they are, from a stream of measurements.
//!
//! A Bayes filter on a lattice for each person (Thrun, Burgard & Fox 2005, chapter 4). A person moves as in Brownian
//! motion, and costs a link its chord ([`super::person`]):
//!
//! ```text
//!   y_l  = what link l has lost against the empty place, dB        t_l(p) = chord of a person at p, m
//!   on   = Student-t(y_l − a t_l(p);  ν, s² + (κ a t_l(p))²)       off = Student-t(y_l;  ν, s²)
//!   w(p) ∝ w(p) · exp(β Σ_l ln(on / off))
//! ```
//!
//! ν = 4. κ makes up for what multipath does to a link that is shadowed, β for errors of one link that last from one
//! measurement to the next. Of several persons each is filtered with what the others are expected to cost taken out, and
//! its variance added. One filter more than there are persons waits, spread over the whole place but where somebody is, for
//! somebody to come; who has hardly any probability left goes, and of two that are at one place the one that came later.
//! What belongs to a file, and which place was empty, is not known here.

mod person_filter;

use self::person_filter::{Lattice, PersonFilter};
use super::person::PersonModel;
use crate::geom::{Point, Rect};

/// A newcomer with this probability, whose place is as sure as [`SURE_M`], is a person.
const CAME: f64 = 0.99;
const SURE_M: f64 = 0.7;
/// Nobody comes nearer to a person than this: what a shadow is deeper than expected is no second person. Metres.
const APART_M: f64 = 1.0;
/// Two persons nearer than this are one, radii of a person.
const SAME_BODY: f64 = 1.3;
/// A person with less than this probability has gone.
const GONE: f64 = 0.05;
/// Most persons that are followed.
const MOST_PERSONS: usize = 4;
/// Most places of the lattice to a side.
const MOST_TO_A_SIDE: f64 = 80.0;
/// Chords shorter than this are left out, metres.
const LEAST_CHORD_M: f64 = 0.01;

/// What is believed before tracking.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackingSettings {
    /// What is believed of a person.
    pub person: PersonModel,
    /// a: what a person costs, dB/m.
    pub strength_db_per_m: f64,
    /// s: noise of a measurement, dB.
    pub noise_sd_db: f64,
    /// κ: what is wrong about the cost of a person, a share of it.
    pub cost_error: f64,
    /// β: how much of a measurement is new beside the one before of its link.
    pub novelty: f64,
    /// How far persons get: standard deviation of each coordinate after a second, metres.
    pub walk_m: f64,
    /// Rate at which persons come and go, 1/s.
    pub exchange_hz: f64,
    /// Places are this far apart, metres.
    pub pitch_m: f64,
    /// Shorter links are passed over, metres.
    pub shortest_link_m: f64,
}

impl Default for TrackingSettings {
    /// Persons in a room with radios of 2.4 GHz.
    fn default() -> TrackingSettings {
        TrackingSettings {
            person: PersonModel {
                radius_m: 0.3,
                wavelength_m: 0.125,
            },
            strength_db_per_m: 8.0,
            noise_sd_db: 2.5,
            cost_error: 1.0,
            novelty: 0.4,
            walk_m: 0.6,
            exchange_hz: 0.02,
            pitch_m: 0.2,
            shortest_link_m: 2.0,
        }
    }
}

/// Where a person is believed to be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackedPerson {
    /// Who; numbers are not given twice.
    pub number: u32,
    /// The expected place, metres.
    pub at: Point,
    /// Variance by x, covariance, variance by y, m².
    pub covariance_m2: [f64; 3],
    /// Probability that there is such a person.
    pub probability: f64,
}

/// The chords of a link: places of the lattice and metres, where there is any.
type Chords = Vec<(u32, f64)>;

/// Follows persons.
#[derive(Clone, Debug)]
pub struct Tracker {
    settings: TrackingSettings,
    /// By receiver and transmitter, row-major; `None` for those that are passed over.
    chords: Vec<Option<Chords>>,
    nodes: usize,
    followed: Followed,
    last_s: Option<f64>,
}

/// Who is there, and who may come.
#[derive(Clone, Debug)]
struct Followed {
    persons: Vec<(u32, PersonFilter)>,
    newcomer: PersonFilter,
    next_number: u32,
}

/// What one link says.
#[derive(Clone, Copy)]
struct LinkLoss<'a> {
    chords: &'a Chords,
    lost_db: f64,
    noise_db2: f64,
}

impl Tracker {
    /// Makes a tracker for a network of nodes around an area; nobody is there.
    pub fn new(nodes: &[Point], area: Rect, settings: TrackingSettings) -> Tracker {
        let longest_m = area.width_m().max(area.height_m());
        let lattice = Lattice::new(area, settings.pitch_m.max(longest_m / MOST_TO_A_SIDE));
        let of_pair = |index: usize| {
            let (from, to) = (nodes[index / nodes.len()], nodes[index % nodes.len()]);
            (from.distance_to(to) >= settings.shortest_link_m.max(1e-6)).then(|| {
                let link = settings.person.link(from, to, area, 0.0);
                let chord = |place: usize| settings.person.chord_m(&link, lattice.at(place));
                (0..lattice.len())
                    .map(|place| (place as u32, chord(place)))
                    .filter(|(_, chord_m)| *chord_m >= LEAST_CHORD_M)
                    .collect()
            })
        };
        Tracker {
            settings,
            chords: (0..nodes.len() * nodes.len()).map(of_pair).collect(),
            nodes: nodes.len(),
            followed: Followed {
                persons: Vec::new(),
                newcomer: PersonFilter::anywhere(lattice),
                next_number: 1,
            },
            last_s: None,
        }
    }

    /// Takes what a receiver lost on the links to all nodes, dB against the empty place (`None` = nothing was heard, or the
    /// node itself), measured at a time that never goes back, seconds. Nodes that are not of the network count as not
    /// heard.
    pub fn take(&mut self, at_s: f64, receiver: usize, attenuation_db: &[Option<f64>]) {
        let elapsed_s = self.last_s.map_or(0.0, |last_s| (at_s - last_s).max(0.0));
        self.last_s = Some(at_s);
        if receiver >= self.nodes {
            return;
        }
        let chords = &self.chords[receiver * self.nodes..(receiver + 1) * self.nodes];
        let noise_db2 = self.settings.noise_sd_db * self.settings.noise_sd_db;
        let links: Vec<LinkLoss<'_>> = chords
            .iter()
            .zip(attenuation_db)
            .filter_map(|(chords, lost_db)| Some((chords.as_ref()?, (*lost_db)?)))
            .filter(|(_, lost_db)| lost_db.is_finite())
            .map(|(chords, lost_db)| LinkLoss {
                chords,
                lost_db,
                noise_db2,
            })
            .collect();
        self.followed.walk(elapsed_s, &self.settings);
        self.followed.weigh(&links, &self.settings);
        self.followed.update(self.settings.person.radius_m);
    }

    /// Returns everybody who is believed to be there, in the order of their numbers.
    pub fn persons(&self) -> Vec<TrackedPerson> {
        let tracked = |(number, filter): &(u32, PersonFilter)| {
            let (at, covariance_m2) = filter.place();
            TrackedPerson {
                number: *number,
                at,
                covariance_m2,
                probability: filter.probability(),
            }
        };
        self.followed.persons.iter().map(tracked).collect()
    }
}

impl Followed {
    fn walk(&mut self, elapsed_s: f64, settings: &TrackingSettings) {
        for (_, filter) in &mut self.persons {
            filter.walk(elapsed_s, settings);
        }
        self.newcomer.walk(elapsed_s, settings);
    }

    fn weigh(&mut self, links: &[LinkLoss<'_>], settings: &TrackingSettings) {
        let cost = |filter: &PersonFilter| -> Vec<(f64, f64)> {
            let strength = settings.strength_db_per_m;
            let of_link = |link: &LinkLoss<'_>| filter.expected_cost(link.chords, strength);
            links.iter().map(of_link).collect()
        };
        let costs: Vec<_> = self
            .persons
            .iter()
            .map(|(_, filter)| cost(filter))
            .collect();
        for (own, (_, filter)) in self.persons.iter_mut().enumerate() {
            filter.weigh(&without_others(links, &costs, Some(own)), settings);
        }
        for (_, person) in &self.persons {
            self.newcomer.leave_out(person.place().0, APART_M);
        }
        self.newcomer
            .weigh(&without_others(links, &costs, None), settings);
    }

    /// Lets go who has gone, and makes a person of a newcomer who is surely there.
    fn update(&mut self, radius_m: f64) {
        let mut taken: Vec<Point> = Vec::new();
        self.persons.retain(|(_, filter)| {
            let (at, _) = filter.place();
            let is_same = |other: &Point| other.distance_to(at) < SAME_BODY * radius_m;
            let stays = filter.probability() >= GONE && !taken.iter().any(is_same);
            taken.extend(stays.then_some(at));
            stays
        });
        let (_, [xx, _, yy]) = self.newcomer.place();
        let is_sure = xx.max(yy) <= SURE_M * SURE_M && self.newcomer.probability() >= CAME;
        if is_sure && self.persons.len() < MOST_PERSONS {
            let fresh = PersonFilter::anywhere(self.newcomer.lattice());
            let came = std::mem::replace(&mut self.newcomer, fresh);
            self.persons.push((self.next_number, came));
            self.next_number += 1;
        }
    }
}

/// Takes out what all persons but one are expected to cost, and adds the variance of that to the noise.
fn without_others<'a>(
    links: &[LinkLoss<'a>],
    costs: &[Vec<(f64, f64)>],
    own: Option<usize>,
) -> Vec<LinkLoss<'a>> {
    let of_link = |(index, link): (usize, &LinkLoss<'a>)| {
        let others = (0..costs.len()).filter(|person| Some(*person) != own);
        others.fold(*link, |rest, person| {
            let (cost_db, variance_db2) = costs[person][index];
            LinkLoss {
                lost_db: rest.lost_db - cost_db,
                noise_db2: rest.noise_db2 + variance_db2,
                ..rest
            }
        })
    };
    links.iter().enumerate().map(of_link).collect()
}

#[cfg(test)]
mod tests;
