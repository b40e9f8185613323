//! The newest image of a kind as its parts come, and what was found in those before it. Bounded: of the earlier images of
//! one lap the last stays, so that a run is told from its first lap on.

use std::collections::{BTreeMap, VecDeque};

use tomoswarm_proto::{Find, Image, RunId};

use crate::time::Time;

/// Images of which it is known what was found in them, at most.
pub const EARLIER_MAX: usize = 40;

/// The newest image of its kind, as far as its parts have come.
#[derive(Clone, Debug)]
pub struct NewestImage {
    /// Its run and number in the run.
    pub edition: (RunId, u32),
    /// Its parts, ascending.
    pub parts: BTreeMap<u16, Image>,
    /// When its first part came.
    pub begun: Time,
    /// When its last part came, also one that was said again.
    pub at: Time,
    /// What was found in the images before, oldest first.
    pub earlier: VecDeque<EarlierFinds>,
}

/// What was found in an image that has given way to a newer one.
#[derive(Clone, PartialEq, Debug)]
pub struct EarlierFinds {
    /// When its first part came.
    pub at: Time,
    /// Its run.
    pub run: RunId,
    /// After how many laps.
    pub laps: u32,
    /// What was found.
    pub finds: Vec<Find>,
}

impl NewestImage {
    /// Returns whether it is newer than another one. Numbers of one run go on at zero after the greatest one, since starts
    /// of the ground station begin far apart: the nearer way around says which is the later one.
    pub fn is_after(&self, (run, sequence): (RunId, u32)) -> bool {
        let (own_run, own_sequence) = self.edition;
        let ahead = own_sequence.wrapping_sub(sequence).cast_signed();
        own_run > run || (own_run == run && ahead > 0)
    }

    /// Makes one of which nothing has come yet; `earlier` is what was found in those before it.
    pub fn new(now: Time, edition: (RunId, u32), earlier: VecDeque<EarlierFinds>) -> NewestImage {
        NewestImage {
            edition,
            parts: BTreeMap::new(),
            begun: now,
            at: now,
            earlier,
        }
    }

    /// Returns what was found in it and in those before it.
    pub fn give_way(&mut self) -> VecDeque<EarlierFinds> {
        let mut earlier = std::mem::take(&mut self.earlier);
        let finds = self.parts.get(&0).map(|first| EarlierFinds {
            at: self.begun,
            run: first.run,
            laps: first.laps,
            finds: first.finds.clone(),
        });
        earlier.extend(finds);
        if earlier.len() > EARLIER_MAX {
            let lap = |place: usize| earlier.get(place).map(|of| (of.run, of.laps));
            let is_followed = |place: &usize| lap(*place) == lap(place + 1);
            let place = (0..EARLIER_MAX).find(is_followed).unwrap_or(0);
            earlier.remove(place);
        }
        earlier
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::at;
    use tomoswarm_proto::{ImageSubject, Position, Rectangle};

    fn image(run: u32, sequence: u32, laps: u32) -> Image {
        Image {
            run: RunId(run),
            sequence,
            laps,
            subject: ImageSubject::Change,
            area: Rectangle {
                least: Position::default(),
                greatest: Position::default(),
            },
            columns: 1,
            rows: 1,
            part: 0,
            parts: 1,
            mean: vec![1],
            mean_step_udb_per_m: 1,
            deviation: None,
            deviation_step_udb_per_m: 1,
            links_used: 1,
            links_dropped: 0,
            finds: Vec::new(),
        }
    }

    /// The laps of the earlier images, after images of these laps have come, one a second.
    fn earlier_laps(laps: impl Iterator<Item = u32>) -> Vec<u32> {
        let mut newest: Option<NewestImage> = None;
        for (sequence, laps) in (0..).zip(laps) {
            let earlier = newest.as_mut().map(NewestImage::give_way);
            let now = at(f64::from(sequence));
            let mut next = NewestImage::new(now, (RunId(1), sequence), earlier.unwrap_or_default());
            next.parts.insert(0, image(1, sequence, laps));
            newest = Some(next);
        }
        let earlier = newest.unwrap().earlier;
        assert!(
            earlier
                .iter()
                .zip(earlier.iter().skip(1))
                .all(|(one, next)| one.at < next.at)
        );
        earlier.iter().map(|of| of.laps).collect()
    }

    #[test]
    fn of_many_images_of_a_lap_the_last_stays_and_the_first_laps_are_not_forgotten() {
        // Thirty images a lap, four laps.
        let laps = earlier_laps((0..120).map(|sequence| sequence / 30));
        assert_eq!(laps.len(), EARLIER_MAX);
        let of_lap = |lap: u32| laps.iter().filter(|of| **of == lap).count();
        assert_eq!([0, 1, 2, 3].map(of_lap), [1, 1, 9, 29]);
        // One image a lap: the newest of them.
        let laps = earlier_laps(0..100);
        assert_eq!(laps, (59..99).collect::<Vec<u32>>());
    }
}
