//! Outlines that need not be convex, cut into triangles by their ears.
//!
//! Takes the square of the number of corners, and more on odd outlines: callers limit it. Holes are not known.

/// Cuts a simple outline into triangles by its ears; what crosses itself is cut somehow.
pub(super) fn ears(outline: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let twice = |a: u32, b: u32, c: u32| {
        let [p, q, r] = [a, b, c].map(|corner| outline[corner as usize]);
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let corners = 0..outline.len() as u32;
    let whole: f64 = corners
        .clone()
        .skip(2)
        .map(|corner| twice(0, corner - 1, corner))
        .sum();
    let (mut left, mut cuts): (Vec<u32>, Vec<[u32; 3]>) = (corners.collect(), Vec::new());
    while left.len() > 2 {
        let count = left.len();
        let around = |at: usize| {
            [
                left[(at + count - 1) % count],
                left[at],
                left[(at + 1) % count],
            ]
        };
        let is_ear = |at: &usize| {
            let [a, b, c] = around(*at);
            let holds = |corner: &u32| {
                let sides = [
                    twice(a, b, *corner),
                    twice(b, c, *corner),
                    twice(c, a, *corner),
                ];
                ![a, b, c].contains(corner) && sides.iter().all(|side| side * whole >= 0.0)
            };
            twice(a, b, c) * whole > 0.0 && !left.iter().any(holds)
        };
        let at = (0..count).find(is_ear).unwrap_or(0);
        cuts.push(around(at));
        left.remove(at);
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(outline: &[[f64; 2]], area: f64) {
        let cuts = ears(outline);
        assert_eq!(cuts.len(), outline.len() - 2);
        let areas = cuts.iter().map(|cut| {
            let [p, q, r] = cut.map(|corner| outline[corner as usize]);
            ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / 2.0
        });
        assert!((areas.clone().sum::<f64>() - area).abs() < 1e-12);
        assert!(
            areas.clone().all(|part| part * area > 0.0),
            "no triangle lies outside"
        );
    }

    #[test]
    fn the_triangles_fill_the_outline_and_nothing_else() {
        let mut comb = vec![
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 1.0],
            [3.0, 3.0],
            [2.0, 1.0],
            [1.0, 3.0],
        ];
        // Shoelace by hand: 2 * area = 0 + 15 - 7 + 9 - 3 + 5 + 0.
        check(&comb, 9.5);
        comb.reverse();
        check(&comb, -9.5);
    }

    #[test]
    fn outlines_that_cross_themselves_end() {
        assert_eq!(
            ears(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]).len(),
            2
        );
        assert_eq!(ears(&[[0.0; 2]; 9]).len(), 7);
        assert_eq!(ears(&[[f64::NAN; 2]; 4]).len(), 2);
        assert!(ears(&[]).is_empty());
    }
}
