//! Closed-form pieces of motion: how speed runs along a straight path, and the phases (turn,
//! speed up, cruise, brake) that come of it. Knows no commands and no clock; times are seconds
//! since the command that laid the phases.

use crate::geom::{Angle, Point, Vector};
use crate::plan::stopping_distance_m;

/// What a vehicle's drive can do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DriveLimits {
    /// Highest speed, m/s.
    pub speed_mps: f64,
    /// Speeding up, m/s².
    pub acceleration_mps2: f64,
    /// Slowing down, m/s², positive.
    pub braking_mps2: f64,
    /// Turning on the spot, rad/s.
    pub turn_rate_radps: f64,
}

impl DriveLimits {
    /// Returns whether all limits are finite and at least 0.001 of their unit.
    pub fn are_possible(&self) -> bool {
        [
            self.speed_mps,
            self.acceleration_mps2,
            self.braking_mps2,
            self.turn_rate_radps,
        ]
        .iter()
        .all(|limit| (0.001..1e6).contains(limit))
    }

    /// Returns the way needed to brake from a speed to rest, metres.
    pub fn stopping_distance_m(&self, speed_mps: f64) -> f64 {
        stopping_distance_m(speed_mps, 0.0, self.braking_mps2)
    }
}

/// A straight piece of a path, longer than nothing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Piece {
    pub from: Point,
    pub to: Point,
    pub heading: Angle,
    pub length_m: f64,
}

impl Piece {
    pub(super) fn new(from: Point, to: Point) -> Piece {
        Piece {
            from,
            to,
            heading: from.angle_to(to),
            length_m: from.distance_to(to),
        }
    }
}

/// Constant acceleration over a distance: speed at its start and end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Law {
    pub distance_m: f64,
    pub first_mps: f64,
    pub last_mps: f64,
}

impl Law {
    /// Speed after a part of the distance; v² is linear in the way.
    fn speed_after_mps(&self, way_m: f64) -> f64 {
        let share = (way_m / self.distance_m).clamp(0.0, 1.0);
        let (first, last) = (
            self.first_mps * self.first_mps,
            self.last_mps * self.last_mps,
        );
        (first + (last - first) * share).sqrt()
    }

    fn split(self, way_m: f64) -> (Law, Law) {
        let speed_mps = self.speed_after_mps(way_m);
        let first = Law {
            distance_m: way_m,
            last_mps: speed_mps,
            ..self
        };
        (
            first,
            Law {
                distance_m: self.distance_m - way_m,
                first_mps: speed_mps,
                ..self
            },
        )
    }
}

/// Trapezoidal speed over `length_m` from a speed to rest, never above `top_mps` for longer than
/// braking to it takes. The stopping distance must fit into the length.
pub(super) fn trapezoid(
    length_m: f64,
    first_mps: f64,
    top_mps: f64,
    limits: &DriveLimits,
) -> Vec<Law> {
    let (a, b) = (limits.acceleration_mps2, limits.braking_mps2);
    let reachable = (2.0 * a * b * length_m + b * first_mps * first_mps) / (a + b);
    let peak_mps = reachable.sqrt().max(first_mps).min(top_mps);
    let rate = if peak_mps >= first_mps { a } else { b };
    let change_m = (peak_mps * peak_mps - first_mps * first_mps).abs() / (2.0 * rate);
    let brake_m = limits.stopping_distance_m(peak_mps);
    let laws = [
        Law {
            distance_m: change_m,
            first_mps,
            last_mps: peak_mps,
        },
        Law {
            distance_m: length_m - change_m - brake_m,
            first_mps: peak_mps,
            last_mps: peak_mps,
        },
    ];
    let mut kept: Vec<Law> = laws
        .into_iter()
        .filter(|law| law.distance_m > NEGLIGIBLE_M)
        .collect();
    let used_m: f64 = kept.iter().map(|law| law.distance_m).sum();
    kept.push(Law {
        distance_m: length_m - used_m,
        first_mps: peak_mps,
        last_mps: 0.0,
    });
    kept
}

/// Borders of path and speed nearer than this are one.
const NEGLIGIBLE_M: f64 = 1e-9;

/// One phase of motion.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct MotionPhase {
    pub start_s: f64,
    pub duration_s: f64,
    pub from: Point,
    pub to: Point,
    pub heading: Angle,
    pub kind: PhaseKind,
}

/// How a phase moves.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum PhaseKind {
    /// On the spot, from the phase's heading at this signed rate.
    Turn { rate_radps: f64 },
    /// Along a unit vector.
    Straight {
        along: Vector,
        length_m: f64,
        speed_mps: f64,
        acceleration_mps2: f64,
    },
}

impl MotionPhase {
    pub(super) fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    pub(super) fn is_straight(&self) -> bool {
        matches!(self.kind, PhaseKind::Straight { .. })
    }

    /// Way covered since the start of the phase, metres, never beyond its end.
    pub(super) fn way_m(&self, time_s: f64) -> f64 {
        let t = (time_s - self.start_s).clamp(0.0, self.duration_s);
        match self.kind {
            PhaseKind::Turn { .. } => 0.0,
            PhaseKind::Straight {
                length_m,
                speed_mps,
                acceleration_mps2,
                ..
            } => (t * (speed_mps + 0.5 * acceleration_mps2 * t)).clamp(0.0, length_m),
        }
    }

    pub(super) fn at(&self, time_s: f64) -> Point {
        match self.kind {
            PhaseKind::Turn { .. } => self.from,
            PhaseKind::Straight { along, .. } => self.from + along * self.way_m(time_s),
        }
    }

    pub(super) fn heading(&self, time_s: f64) -> Angle {
        match self.kind {
            PhaseKind::Turn { rate_radps } => {
                let t = (time_s - self.start_s).clamp(0.0, self.duration_s);
                Angle::from_radians(self.heading.radians() + rate_radps * t)
            }
            PhaseKind::Straight { .. } => self.heading,
        }
    }

    pub(super) fn speed_mps(&self, time_s: f64) -> f64 {
        match self.kind {
            PhaseKind::Turn { .. } => 0.0,
            PhaseKind::Straight {
                speed_mps,
                acceleration_mps2,
                ..
            } => {
                let t = (time_s - self.start_s).clamp(0.0, self.duration_s);
                (speed_mps + acceleration_mps2 * t).max(0.0)
            }
        }
    }

    pub(super) fn acceleration(&self) -> Vector {
        match self.kind {
            PhaseKind::Turn { .. } => Vector::default(),
            PhaseKind::Straight {
                along,
                acceleration_mps2,
                ..
            } => along * acceleration_mps2,
        }
    }

    /// When a way since the start of the phase is covered, seconds since the command.
    pub(super) fn time_at_s(&self, way_m: f64) -> f64 {
        match self.kind {
            PhaseKind::Turn { .. } => self.start_s,
            PhaseKind::Straight {
                speed_mps,
                acceleration_mps2,
                ..
            } => {
                let square = speed_mps * speed_mps + 2.0 * acceleration_mps2 * way_m;
                let sum_mps = speed_mps + square.max(0.0).sqrt();
                if sum_mps <= 0.0 {
                    return self.start_s;
                }
                self.start_s + (2.0 * way_m / sum_mps).min(self.duration_s)
            }
        }
    }
}

/// Phases in the making: where the body is at the end of them.
#[derive(Clone, Debug)]
pub(super) struct PhaseBuilder {
    pub phases: Vec<MotionPhase>,
    pub at: Point,
    pub heading: Angle,
    clock_s: f64,
}

impl PhaseBuilder {
    pub(super) fn new(at: Point, heading: Angle) -> PhaseBuilder {
        PhaseBuilder {
            phases: Vec::new(),
            at,
            heading,
            clock_s: 0.0,
        }
    }

    /// Adds a turn on the spot, the shorter way round (to the left for half a turn).
    pub(super) fn turn(&mut self, heading: Angle, turn_rate_radps: f64) {
        let by_rad = (heading - self.heading).radians();
        if by_rad.abs() > 1e-9 {
            let kind = PhaseKind::Turn {
                rate_radps: turn_rate_radps.copysign(by_rad),
            };
            self.push(by_rad.abs() / turn_rate_radps, self.at, self.heading, kind);
        }
        self.heading = heading;
    }

    /// Adds the phases of driving a path with the given laws, which cover its length.
    pub(super) fn drive(&mut self, path: &[Piece], laws: &[Law]) {
        let mut laws = laws.iter().copied();
        let Some(mut law) = laws.next() else { return };
        for piece in path {
            let mut left_m = piece.length_m;
            while law.distance_m <= left_m + NEGLIGIBLE_M {
                let Some(next) = laws.next() else { break };
                left_m -= law.distance_m;
                let ends_with_piece = left_m <= NEGLIGIBLE_M;
                let to = if ends_with_piece {
                    piece.to
                } else {
                    self.at + (piece.unit() * law.distance_m)
                };
                self.straight(piece, to, law);
                law = next;
                if ends_with_piece {
                    left_m = 0.0;
                    break;
                }
            }
            if left_m > 0.0 {
                let whole = law.distance_m <= left_m + NEGLIGIBLE_M;
                let (now, later) = if whole { (law, law) } else { law.split(left_m) };
                self.straight(piece, piece.to, now);
                law = later;
            }
        }
    }

    fn straight(&mut self, piece: &Piece, to: Point, law: Law) {
        let (length_m, sum_mps) = (law.distance_m, law.first_mps + law.last_mps);
        if length_m > 0.0 && sum_mps > 0.0 {
            let kind = PhaseKind::Straight {
                along: piece.unit(),
                length_m,
                speed_mps: law.first_mps,
                acceleration_mps2: (law.last_mps - law.first_mps) * sum_mps / (2.0 * length_m),
            };
            self.push(2.0 * length_m / sum_mps, to, piece.heading, kind);
        }
        (self.at, self.heading) = (to, piece.heading);
    }

    fn push(&mut self, duration_s: f64, to: Point, heading: Angle, kind: PhaseKind) {
        self.phases.push(MotionPhase {
            start_s: self.clock_s,
            duration_s,
            from: self.at,
            to,
            heading,
            kind,
        });
        self.clock_s += duration_s;
    }
}

impl Piece {
    fn unit(&self) -> Vector {
        (self.to - self.from) * (1.0 / self.length_m)
    }
}
