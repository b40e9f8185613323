//! Checks of closed outlines given by their corners: fences and footprints.

use crate::geom::{Point, Polygon, Segment};

/// The longest outline that is accepted, corners.
pub(super) const CORNERS: std::ops::RangeInclusive<usize> = 3..=500;

/// Returns what is wrong with an outline, or gives it as a polygon.
pub(super) fn simple_polygon(corners: Vec<Point>) -> Result<Polygon, String> {
    let polygon = Polygon::new(corners);
    let edges: Vec<Segment> = polygon.edges().collect();
    for (first, edge) in edges.iter().enumerate() {
        let next = edges[(first + 1) % edges.len()];
        let (along, onward) = (edge.vector(), next.vector());
        if edge.length_m() < 0.01 {
            return Err(format!(
                "corners {} and {} coincide",
                first + 1,
                (first + 1) % edges.len() + 1
            ));
        }
        if along.cross(onward).abs() < 1e-9 && along.dot(onward) < 0.0 {
            return Err(format!("side {} folds back on itself", first + 1));
        }
    }
    check_crossings(&edges)?;
    if polygon.area_m2().abs() < 0.001 {
        return Err("the outline encloses nothing".to_owned());
    }
    Ok(polygon)
}

/// Refuses sides that touch without being neighbours.
fn check_crossings(edges: &[Segment]) -> Result<(), String> {
    for (first, edge) in edges.iter().enumerate() {
        for (second, other) in edges.iter().enumerate().skip(first + 2) {
            let are_neighbours = first == 0 && second == edges.len() - 1;
            if !are_neighbours && edge.distance_to(*other) < 1e-6 {
                return Err(format!("side {} touches side {}", first + 1, second + 1));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(corners: &[(f64, f64)], expected: Result<(), &str>) {
        let points = corners
            .iter()
            .map(|(x_m, y_m)| Point::new(*x_m, *y_m))
            .collect();
        assert_eq!(
            simple_polygon(points).map(|_| ()),
            expected.map_err(str::to_owned),
            "{corners:?}"
        );
    }

    #[test]
    fn only_outlines_that_enclose_something_once_are_taken() {
        check(&[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)], Ok(()));
        check(&[(0.0, 0.0), (0.0, 4.0), (4.0, 0.0)], Ok(()));
        check(
            &[(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0)],
            Err("side 1 touches side 3"),
        );
        check(
            &[(0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (0.0, 4.0)],
            Err("corners 2 and 3 coincide"),
        );
        check(
            &[(0.0, 0.0), (4.0, 0.0), (8.0, 0.0)],
            Err("side 2 folds back on itself"),
        );
        check(
            &[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (4.0, 2.0)],
            Err("side 2 folds back on itself"),
        );
        check(
            &[(0.0, 0.0), (0.01, 0.0), (0.0, 0.01)],
            Err("the outline encloses nothing"),
        );
    }
}
