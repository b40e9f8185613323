//! Moves the ends of a link onto the border of the network's rectangle, along the link.
//!
//! Vehicles stand a little outside the area that is imaged; what a link tells of the area is its part inside. Any unit
//! of length will do, as long as it is one.

use crate::geom::{Point, Rect, Segment};

/// Returns the part of a link's line that lies in the rectangle, from the border where it enters to where it leaves.
///
/// An end outside is moved inward. An end inside is moved outward if `snap_inside`, otherwise such a link has no part.
/// `None` too for a link that passes by, touches a corner only, or has no length.
pub fn snap_to_boundary(network: Rect, link: Segment, snap_inside: bool) -> Option<Segment> {
    let has_length = link.length_m() > 0.0 && link.length_m().is_finite();
    let (enter, leave) = network.line_shares(link).filter(|_| has_length)?;
    let reaches = enter < 1.0 && leave > 0.0;
    let ends_inside = enter < 0.0 || leave > 1.0;
    if !reaches || (ends_inside && !snap_inside) {
        return None;
    }
    let at = |share: f64| clamped(network, link.from.toward(link.to, share));
    let part = Segment::new(at(enter), at(leave));
    (part.length_m() > 0.0).then_some(part)
}

/// Takes out what rounding has put outside.
fn clamped(network: Rect, point: Point) -> Point {
    let Rect { min, max } = network;
    Point::new(
        point.x_m.clamp(min.x_m, max.x_m),
        point.y_m.clamp(min.y_m, max.y_m),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn network() -> Rect {
        Rect::new(Point::new(0.0, 2.0), Point::new(4.0, 6.0))
    }

    fn check(ends: [f64; 4], snap_inside: bool, expected: Option<[f64; 4]>) {
        let [x0, y0, x1, y1] = ends;
        let got = snap_to_boundary(
            network(),
            Segment::new(Point::new(x0, y0), Point::new(x1, y1)),
            snap_inside,
        );
        let got = got.map(|part| [part.from.x_m, part.from.y_m, part.to.x_m, part.to.y_m]);
        match (got, expected) {
            (Some(got), Some(expected)) => {
                assert!(
                    got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
                    "{ends:?}: {got:?}"
                );
            }
            (got, expected) => assert_eq!(got, expected, "{ends:?}"),
        }
    }

    #[test]
    fn ends_outside_come_to_the_border_and_those_inside_only_if_allowed() {
        check([-2.0, 3.0, 6.0, 5.0], false, Some([0.0, 3.5, 4.0, 4.5]));
        check([6.0, 5.0, -2.0, 3.0], false, Some([4.0, 4.5, 0.0, 3.5]));
        check([1.0, 3.0, 6.0, 3.0], false, None);
        check([1.0, 3.0, 6.0, 3.0], true, Some([0.0, 3.0, 4.0, 3.0]));
        check([2.0, 4.0, 2.0, 4.5], true, Some([2.0, 2.0, 2.0, 6.0]));
    }

    #[test]
    fn what_does_not_reach_or_only_touches_has_no_part() {
        check([5.0, 4.0, 9.0, 4.0], true, None);
        check([4.0, 4.0, 9.0, 4.0], true, None);
        check([3.0, 7.0, 5.0, 5.0], true, None);
        check([4.0, 6.0, 5.0, 7.0], true, None);
        check([2.0, 4.0, 2.0, 4.0], true, None);
        check([f64::NAN, 4.0, 2.0, 4.0], true, None);
    }

    proptest! {
        #[test]
        fn both_ends_lie_on_the_border_and_on_the_line(
            x0 in -9.0..9.0f64, y0 in -9.0..9.0f64, x1 in -9.0..9.0f64, y1 in -9.0..9.0f64, inside in any::<bool>(),
        ) {
            let link = Segment::new(Point::new(x0, y0), Point::new(x1, y1));
            if let Some(part) = snap_to_boundary(network(), link, inside) {
                for end in [part.from, part.to] {
                    prop_assert!(network().contains(end));
                    prop_assert!(network().polygon().distance_to_edge(end) < 1e-9);
                    let aside_m = link.vector().cross(end - link.from) / link.length_m();
                    prop_assert!(aside_m.abs() < 1e-6 * (1.0 + 1.0 / link.length_m()));
                }
                prop_assert!(part.vector().dot(link.vector()) > 0.0, "the direction stays");
                prop_assert!(inside || !network().shrunk(1e-9).contains(link.from));
            }
        }
    }
}
