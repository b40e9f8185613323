//! Persons who walk in a room of 28 nodes, measured as the filter believes it, and with errors that it does not know.

use super::*;
use crate::tomo::tests_support::Noise;

const AREA: Rect = Rect {
    min: Point::new(0.0, 0.0),
    max: Point::new(6.4, 6.4),
};

/// 28 nodes, eight to a side.
fn nodes() -> Vec<Point> {
    let step_m = 6.4 / 7.0;
    (0..28)
        .map(|k| {
            let along_m = f64::from(k % 7) * step_m;
            match k / 7 {
                0 => Point::new(0.0, along_m),
                1 => Point::new(along_m, 6.4),
                2 => Point::new(6.4, 6.4 - along_m),
                _ => Point::new(6.4 - along_m, 0.0),
            }
        })
        .collect()
}

/// A room in which persons stand at places that depend on the time.
struct Room<'a> {
    nodes: Vec<Point>,
    noise: Noise,
    persons: &'a dyn Fn(f64) -> Vec<Point>,
}

impl Room<'_> {
    /// Measures for a while, receiver after receiver, and returns what is tracked after each round.
    fn track(&mut self, rounds: u32, tracker: &mut Tracker) -> Vec<(f64, Vec<TrackedPerson>)> {
        let mut tracked = Vec::new();
        for round in 0..rounds {
            for receiver in 0..self.nodes.len() {
                let at_s = f64::from(round) * 0.4 + receiver as f64 * 0.4 / 28.0;
                let lost_db = self.measure(at_s, receiver);
                tracker.take(at_s, receiver, &lost_db);
            }
            tracked.push((f64::from(round) * 0.4 + 0.4, tracker.persons()));
        }
        tracked
    }

    fn measure(&mut self, at_s: f64, receiver: usize) -> Vec<Option<f64>> {
        let persons = (self.persons)(at_s);
        let model = TrackingSettings::default().person;
        let nodes = self.nodes.clone();
        let lost = |(other, node): (usize, &Point)| {
            let link = model.link(self.nodes[receiver], *node, AREA, 0.0);
            let chords_m = persons.iter().map(|at| model.chord_m(&link, *at));
            let cost_db = 9.0 * chords_m.sum::<f64>() * (1.0 + 0.5 * self.noise.normal());
            (other != receiver).then_some(cost_db + 2.0 * self.noise.normal())
        };
        nodes.iter().enumerate().map(lost).collect()
    }
}

/// Along a square of 3.2 m, at 1 m/s.
fn on_a_square(at_s: f64) -> Point {
    let along_m = at_s.rem_euclid(12.8);
    let (side, m) = ((along_m / 3.2) as u32, along_m % 3.2);
    match side {
        0 => Point::new(1.6 + m, 1.6),
        1 => Point::new(4.8, 1.6 + m),
        2 => Point::new(4.8 - m, 4.8),
        _ => Point::new(1.6, 4.8 - m),
    }
}

fn room(persons: &dyn Fn(f64) -> Vec<Point>) -> (Room<'_>, Tracker) {
    let nodes = nodes();
    let tracker = Tracker::new(&nodes, AREA, TrackingSettings::default());
    let noise = Noise::new(3);
    (
        Room {
            nodes,
            noise,
            persons,
        },
        tracker,
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn one_person_is_followed_and_no_second_one_is_seen() {
    let (mut room, mut tracker) = room(&|at_s| vec![on_a_square(at_s)]);
    let tracked = room.track(60, &mut tracker);
    let settled = &tracked[5..];
    assert!(
        settled.iter().all(|(_, persons)| persons.len() == 1),
        "{settled:?}"
    );
    let error =
        |(at_s, persons): &(f64, Vec<TrackedPerson>)| persons[0].at.distance_to(on_a_square(*at_s));
    let error_m = median(settled.iter().map(error).collect());
    assert!(error_m < 0.35, "{error_m}");
    assert!(settled.iter().all(|(_, persons)| persons[0].number == 1));
}

#[test]
fn two_persons_are_told_apart() {
    let (mut room, mut tracker) = room(&|at_s| vec![on_a_square(at_s), on_a_square(at_s + 6.4)]);
    let tracked = room.track(80, &mut tracker);
    let settled = &tracked[15..];
    let both = settled.iter().filter(|(_, persons)| persons.len() == 2);
    assert!(
        both.clone().count() * 10 >= settled.len() * 9,
        "{settled:?}"
    );
    let errors = both.flat_map(|(at_s, persons)| {
        let truth = [on_a_square(*at_s), on_a_square(at_s + 6.4)];
        truth.map(|at| {
            let away_m = persons.iter().map(|one| one.at.distance_to(at));
            away_m.fold(f64::INFINITY, f64::min)
        })
    });
    let error_m = median(errors.collect());
    assert!(error_m < 0.5, "{error_m}");
}

#[test]
fn in_an_empty_room_nobody_is_seen_and_who_leaves_is_not_for_long() {
    let (mut empty, mut tracker) = room(&|_| Vec::new());
    let tracked = empty.track(60, &mut tracker);
    assert!(tracked.iter().all(|(_, persons)| persons.is_empty()));
    let (mut left, mut tracker) = room(&|at_s| {
        let is_there = at_s < 10.0;
        is_there.then(|| on_a_square(at_s)).into_iter().collect()
    });
    let tracked = left.track(50, &mut tracker);
    assert_eq!(tracked[22].1.len(), 1);
    assert!(
        tracked[40..].iter().all(|(_, persons)| persons.is_empty()),
        "{tracked:?}"
    );
}

#[test]
fn what_was_not_heard_or_is_no_node_or_comes_late_does_no_harm() {
    let (mut room, mut tracker) = room(&|at_s| vec![on_a_square(at_s)]);
    tracker.take(1.0, 99, &[Some(3.0); 28]);
    tracker.take(1.0, 0, &[]);
    tracker.take(1.0, 0, &[None; 28]);
    tracker.take(0.5, 3, &[Some(f64::NAN); 40]);
    tracker.take(1e9, 3, &[Some(1e300); 28]);
    room.track(3, &mut tracker);
    assert!(tracker.persons().iter().all(|one| one.at.x_m.is_finite()));
}
