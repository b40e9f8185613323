//! Says the newest image to whoever shows images: in parts, each pixel in a byte, when it is made and again from time to time,
//! and at once when an operator comes that was not there before.
//!
//! Of a run that is compared with another the images of changes are said, of any other run those of what stands there: they
//! share one topic on the bus, where the newer takes the place of the older.
//!
//! It is told images and which operators are heard; it says messages. Deadlines: `repeat the image`, every 30 s.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Covariance, Find, IMAGE_FINDS_MAX, IMAGE_PART_PIXELS, IMAGE_SIDE_MAX, Image,
    ImageSubject, OperatorId, Permille, Position, Rectangle, RunId,
};

use super::imager::{ReconstructedImage, Subject};
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::time::{Deadline, Time};
use crate::tomo::{self, Reconstruction};

/// The newest image is said again this often.
const REPEATED: Duration = Duration::from_secs(30);
/// An operator that was silent for this long counts as a new one.
const OPERATOR_GONE: Duration = Duration::from_secs(10);
/// 2 to this are as many images as a start of the software may make before the next one's numbers.
const IMAGES_OF_A_START: u32 = 16;

/// What the publisher can be told.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum In {
    /// An image was made, or could not be.
    Made(Box<ReconstructedImage>),
    /// An operator has greeted.
    Heard(OperatorId),
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// An image of a run.
    Made(RunId, Subject),
    /// The greeting of an operator.
    Heard(OperatorId),
}

/// The publisher actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ImagePublisher {
    /// The newest image, in parts.
    parts: Vec<Image>,
    /// Counts images; of a later start of the software it is higher, but for zero that follows the greatest number.
    sequence: u32,
    repeat_at: Option<Time>,
    /// When each operator was heard last.
    operators: BTreeMap<OperatorId, Time>,
}

impl ImagePublisher {
    /// Makes a publisher that has no image yet, for a start of the software.
    pub fn new(boot: Boot) -> ImagePublisher {
        ImagePublisher {
            parts: Vec::new(),
            // Bits that do not fit are starts long gone: whoever compares takes the nearer way around.
            sequence: boot.0 << IMAGES_OF_A_START,
            repeat_at: None,
            operators: BTreeMap::new(),
        }
    }

    fn take(&mut self, now: Time, made: &ReconstructedImage, out: &mut Vec<Image>) {
        let shown = self.parts.first().map(|part| (part.run, part.subject));
        let is_hidden = match (made.subject, shown) {
            (Subject::Structure, Some((run, ImageSubject::Change))) => run == made.run,
            (Subject::Structure | Subject::Change, _) => false,
        };
        let Ok(reconstruction) = &made.result else {
            return;
        };
        if is_hidden || !is_sendable(&reconstruction.image) {
            return;
        }
        self.sequence = self.sequence.wrapping_add(1);
        self.parts = parts(made, reconstruction, self.sequence);
        self.say(now, out);
    }

    fn hear(&mut self, now: Time, operator: OperatorId, out: &mut Vec<Image>) {
        let before = self.operators.insert(operator, now);
        if before.is_none_or(|at| now.since(at) > OPERATOR_GONE) {
            self.say(now, out);
        }
    }

    fn say(&mut self, now: Time, out: &mut Vec<Image>) {
        if !self.parts.is_empty() {
            self.repeat_at = Some(now + REPEATED);
            out.extend(self.parts.iter().cloned());
        }
    }
}

impl Actor for ImagePublisher {
    type In = In;
    type Out = Image;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Image>) -> Result<(), Fault> {
        match input {
            In::Made(made) => self.take(now, &made, out),
            In::Heard(operator) => self.hear(now, operator, out),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let at = self.repeat_at?;
        Some(Deadline {
            at,
            why: "repeat the image",
        })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Image>) -> Result<(), Fault> {
        if self.repeat_at.is_some_and(|at| at <= now) {
            self.say(now, out);
        }
        Ok(())
    }
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        InputClass::Latest(match self {
            In::Made(made) => Key::Made(made.run, made.subject),
            In::Heard(operator) => Key::Heard(*operator),
        })
    }
}

/// Returns whether an image fits into messages.
fn is_sendable(image: &tomo::Image) -> bool {
    let side = 1..=usize::from(IMAGE_SIDE_MAX);
    side.contains(&image.grid.columns) && side.contains(&image.grid.rows)
}

/// Returns an image as messages.
fn parts(made: &ReconstructedImage, reconstruction: &Reconstruction, sequence: u32) -> Vec<Image> {
    let tomo::Image { grid, values } = &reconstruction.image;
    let greatest = values
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    let step_udb_per_m = step_udb(greatest, i8::MAX as u8);
    let mean: Vec<i8> = values
        .iter()
        .map(|value| (value * 1e6 / f64::from(step_udb_per_m)).round() as i8)
        .collect();
    let deviation = reconstruction.deviation.as_deref().unwrap_or_default();
    let greatest = deviation.iter().copied().fold(0.0, f64::max);
    let deviation_step_udb_per_m = step_udb(greatest, u8::MAX);
    let deviation: Vec<u8> = deviation
        .iter()
        .map(|value| (value * 1e6 / f64::from(deviation_step_udb_per_m)).round() as u8)
        .collect();
    let of_part = |part: u16| {
        let mut chunks = deviation.chunks(IMAGE_PART_PIXELS);
        chunks.nth(usize::from(part)).map(<[u8]>::to_vec)
    };
    let corner = |x_m: f64, y_m: f64| Position::from_metres(x_m, y_m, 0.0);
    let chunks = mean.chunks(IMAGE_PART_PIXELS);
    let count = chunks.len() as u16;
    let part = |(part, mean): (u16, &[i8])| Image {
        run: made.run,
        sequence,
        laps: u32::try_from(made.laps).unwrap_or(u32::MAX),
        subject: match made.subject {
            Subject::Change => ImageSubject::Change,
            Subject::Structure => ImageSubject::Structure,
        },
        area: Rectangle {
            least: corner(grid.area.min.x_m, grid.area.min.y_m),
            greatest: corner(grid.area.max.x_m, grid.area.max.y_m),
        },
        columns: grid.columns as u16,
        rows: grid.rows as u16,
        part,
        parts: count,
        mean_step_udb_per_m: step_udb_per_m,
        mean: mean.to_vec(),
        deviation_step_udb_per_m,
        deviation: of_part(part),
        finds: if part == 0 {
            finds(reconstruction)
        } else {
            Vec::new()
        },
        links_used: u32::try_from(reconstruction.used).unwrap_or(u32::MAX),
        links_dropped: u32::try_from(reconstruction.dropped.values().sum::<usize>())
            .unwrap_or(u32::MAX),
    };
    (0..).zip(chunks).map(part).collect()
}

/// Returns the unit in which a value up to this one has at most so many, 1e-6 dB/m.
fn step_udb(greatest_db_per_m: f64, most: u8) -> u32 {
    (greatest_db_per_m * 1e6 / f64::from(most)).ceil().max(1.0) as u32
}

fn finds(reconstruction: &Reconstruction) -> Vec<Find> {
    let square_mm2 = |square_m2: f64| square_m2 * 1e6;
    let find = |find: &tomo::Find| {
        let [xx_m2, xy_m2, yy_m2] = find.covariance_m2;
        Find {
            at: Position::from_metres(find.at.x_m, find.at.y_m, 0.0),
            covariance: Some(Covariance {
                xx_mm2: square_mm2(xx_m2).round() as u32,
                xy_mm2: square_mm2(xy_m2).round() as i32,
                yy_mm2: square_mm2(yy_m2).round() as u32,
            }),
            strength_udb_per_m: (find.strength * 1e6).round() as i32,
            probability: Permille::from_fraction(find.probability),
        }
    };
    let found = reconstruction.finds.iter().flat_map(|finds| &finds.found);
    found.take(IMAGE_FINDS_MAX).map(find).collect()
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::codec;

    use super::*;
    use crate::geom::{PixelGrid, Point, Rect};
    use crate::ground::imager::ImageStage;
    use crate::tomo::{DroppedLinks, Finds, Image as TomoImage};

    const RUN: RunId = RunId(3);

    fn at(at_s: u64) -> Time {
        Time::ZERO + Duration::from_secs(at_s)
    }

    fn grid(columns: usize, rows: usize) -> PixelGrid {
        PixelGrid {
            area: Rect::new(Point::new(-1.0, 0.0), Point::new(19.0, 10.0)),
            columns,
            rows,
        }
    }

    fn made(run: RunId, subject: Subject, grid: PixelGrid) -> ReconstructedImage {
        let values = (0..grid.len()).map(|pixel| (pixel % 9) as f64 * 0.25 - 1.0);
        let find = tomo::Find {
            at: Point::new(4.0, 5.0),
            strength: 9.5,
            covariance_m2: [0.04, -0.01, 0.09],
            evidence: 33.0,
            probability: 0.999,
        };
        ReconstructedImage {
            run,
            laps: 2,
            subject,
            stage: ImageStage::Lap,
            result: Ok(Reconstruction {
                image: TomoImage {
                    grid,
                    values: values.collect(),
                },
                peaks: Vec::new(),
                residual_rms_db: 1.0,
                used: 700,
                dropped: DroppedLinks::new(),
                path_loss: None,
                by_empty_sweep: true,
                deviation: Some(vec![0.25; grid.len()]),
                shares: None,
                choice: None,
                links: None,
                finds: Some(Finds {
                    found: vec![find],
                    next: None,
                    threshold: 12.0,
                    false_per_image: 0.02,
                }),
            }),
        }
    }

    fn publisher() -> ImagePublisher {
        ImagePublisher::new(Boot(0))
    }

    fn take(publisher: &mut ImagePublisher, now_s: u64, made: ReconstructedImage) -> Vec<Image> {
        let mut out = Vec::new();
        let input = In::Made(Box::new(made));
        publisher.handle(at(now_s), input, &mut out).unwrap();
        out
    }

    #[test]
    fn every_part_can_be_read_and_together_they_are_the_image() {
        for (columns, rows) in [(1, 1), (40, 40), (64, 48), (64, 49), (400, 400)] {
            let grid = grid(columns, rows);
            let made = made(RUN, Subject::Change, grid);
            let parts = take(&mut publisher(), 1, made.clone());
            let mut pixels = Vec::new();
            for (index, part) in parts.iter().enumerate() {
                let message = tomoswarm_proto::Message::Image(part.clone());
                let frame = codec::encode(&message).unwrap();
                assert!(frame.len() < 8192, "{}", frame.len());
                assert_eq!(usize::from(part.part), index);
                assert_eq!(
                    (part.finds.len(), part.links_used),
                    (usize::from(index == 0), 700)
                );
                let deviations = part.deviation.as_ref().unwrap();
                let unit = f64::from(part.deviation_step_udb_per_m) * 1e-6;
                let is_quarter = |sd: &u8| (f64::from(*sd) * unit - 0.25).abs() < 1e-3;
                assert!(deviations.len() == part.mean.len() && deviations.iter().all(is_quarter));
                let unit = f64::from(part.mean_step_udb_per_m) * 1e-6;
                pixels.extend(part.mean.iter().map(|value| f64::from(*value) * unit));
            }
            let values = &made.result.unwrap().image.values;
            assert_eq!(pixels.len(), values.len());
            let near = |(got, value): (&f64, &f64)| (got - value).abs() <= 0.5 / 127.0 + 1e-6;
            assert!(pixels.iter().zip(values).all(near), "{columns} x {rows}");
        }
    }

    #[test]
    fn an_image_is_said_when_it_is_made_again_after_a_while_and_to_who_comes() {
        let mut publisher = publisher();
        let greet = |publisher: &mut ImagePublisher, now_s, operator| {
            let mut out = Vec::new();
            let input = In::Heard(OperatorId(operator));
            publisher.handle(at(now_s), input, &mut out).unwrap();
            out.len()
        };
        assert_eq!(greet(&mut publisher, 0, 1), 0, "there is none yet");
        assert_eq!(
            take(&mut publisher, 1, made(RUN, Subject::Change, grid(4, 4))).len(),
            1
        );
        assert_eq!(greet(&mut publisher, 2, 1), 0);
        assert_eq!(greet(&mut publisher, 3, 2), 1);
        assert_eq!(greet(&mut publisher, 12, 1), 0);
        assert_eq!(greet(&mut publisher, 23, 1), 1, "it was gone");
        assert_eq!(publisher.deadline().unwrap().at, at(53));
        let mut out = Vec::new();
        publisher.wake(at(53), &mut out).unwrap();
        assert_eq!((out.len(), publisher.deadline().unwrap().at), (1, at(83)));
    }

    #[test]
    fn what_stands_there_is_said_of_runs_that_are_compared_with_none() {
        let mut publisher = publisher();
        let mut said = |now_s, run, subject| {
            let parts = take(&mut publisher, now_s, made(run, subject, grid(4, 4)));
            parts.first().map(|part| (part.subject, part.sequence))
        };
        let (structure, change) = (Subject::Structure, Subject::Change);
        assert_eq!(said(1, RUN, structure), Some((ImageSubject::Structure, 1)));
        assert_eq!(said(2, RUN, change), Some((ImageSubject::Change, 2)));
        assert_eq!(said(3, RUN, structure), None);
        assert_eq!(
            said(4, RunId(4), structure),
            Some((ImageSubject::Structure, 3))
        );
    }

    #[test]
    fn the_numbers_of_a_later_start_are_ahead_also_where_they_begin_again() {
        for boot in [0, 1, 0x7FFF, 0xFFFF, 0x1_0000, u32::MAX - 1] {
            let mut of = [boot, boot + 1].map(|boot| ImagePublisher::new(Boot(boot)));
            let said = |publisher: &mut ImagePublisher, now_s| {
                take(publisher, now_s, made(RUN, Subject::Change, grid(4, 4)))[0].sequence
            };
            let earlier = (0..9).map(|now_s| said(&mut of[0], now_s)).last().unwrap();
            let ahead = said(&mut of[1], 9).wrapping_sub(earlier).cast_signed();
            assert!(ahead > 0, "{ahead} after start {boot}");
        }
    }

    #[test]
    fn an_image_that_could_not_be_made_is_not_said() {
        let mut failed = made(RUN, Subject::Change, grid(4, 4));
        failed.result = Err("no links".to_owned());
        assert!(take(&mut publisher(), 1, failed).is_empty());
    }
}
