//! Which of several candidates are not beaten in every respect: layers and crowding for a search with several
//! objectives (Deb et al. 2002, NSGA-II; Beume et al. 2007, SMS-EMOA). All objectives are the smaller the better.

use std::cmp::Ordering;

/// Returns the layers of candidates, by index and ascending in each: the first is beaten by nobody, the second only by
/// members of the first, and so on.
///
/// One candidate beats another when it is nowhere worse and somewhere better; what is no number is worse than all.
pub fn non_dominated_layers<const N: usize>(objectives: &[[f64; N]]) -> Vec<Vec<usize>> {
    let beats = |a: usize, b: usize| dominates(&objectives[a], &objectives[b]);
    let count = objectives.len();
    let mut beaten_by: Vec<usize> = (0..count)
        .map(|b| (0..count).filter(|a| beats(*a, b)).count())
        .collect();
    let mut layers = Vec::new();
    let mut left: Vec<usize> = (0..count).collect();
    while !left.is_empty() {
        let layer: Vec<usize> = left
            .iter()
            .copied()
            .filter(|index| beaten_by[*index] == 0)
            .collect();
        left.retain(|index| beaten_by[*index] > 0);
        for index in &left {
            beaten_by[*index] -= layer
                .iter()
                .filter(|better| beats(**better, *index))
                .count();
        }
        layers.push(layer);
    }
    layers
}

/// Returns whether `a` is nowhere worse than `b` and somewhere better.
pub fn dominates<const N: usize>(a: &[f64; N], b: &[f64; N]) -> bool {
    let mut orders = a.iter().zip(b).map(|(a, b)| ordered(*a, *b));
    let is_nowhere_worse = orders.clone().all(|order| order != Ordering::Greater);
    is_nowhere_worse && orders.any(|order| order == Ordering::Less)
}

/// Returns how much of the dominated area each member of a layer adds alone, in the order given: the area between its
/// neighbours' values. The best of either objective add an infinite area, so that they are never the ones to drop.
///
/// The members must not dominate each other. A member that equals another one adds nothing.
pub fn hypervolume_contributions(layer: &[[f64; 2]]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..layer.len()).collect();
    order.sort_by(|a, b| {
        let ([x_a, y_a], [x_b, y_b]) = (layer[*a], layer[*b]);
        x_a.total_cmp(&x_b).then(y_b.total_cmp(&y_a))
    });
    let mut contributions = vec![f64::INFINITY; layer.len()];
    for around in order.windows(3) {
        let [before, own, after] = [layer[around[0]], layer[around[1]], layer[around[2]]];
        contributions[around[1]] = (after[0] - own[0]) * (before[1] - own[1]);
    }
    contributions
}

/// Compares two values; zeros of either sign are equal.
fn ordered(a: f64, b: f64) -> Ordering {
    (a + 0.0).total_cmp(&(b + 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn equal_candidates_do_not_beat_each_other() {
        assert_eq!(
            non_dominated_layers(&[[1.0, 2.0], [1.0, 2.0]]),
            [vec![0, 1]]
        );
        assert_eq!(
            non_dominated_layers(&[[0.0, 1.0], [-0.0, 1.0]]),
            [vec![0, 1]]
        );
        assert_eq!(
            non_dominated_layers(&[[1.0], [3.0], [2.0], [1.0]]),
            [vec![0, 3], vec![2], vec![1]]
        );
        assert_eq!(non_dominated_layers::<2>(&[]), Vec::<Vec<usize>>::new());
    }

    #[test]
    fn what_is_no_number_is_worse_than_all() {
        assert_eq!(
            non_dominated_layers(&[[f64::NAN, 1.0], [5.0, 1.0]]),
            [vec![1], vec![0]]
        );
    }

    #[test]
    fn the_order_in_which_members_are_given_does_not_matter() {
        let contributions =
            hypervolume_contributions(&[[6.0, 0.0], [0.0, 9.0], [2.0, 4.0], [3.0, 3.0]]);
        assert_eq!(contributions, [f64::INFINITY, f64::INFINITY, 5.0, 3.0]);
        assert_eq!(hypervolume_contributions(&[[1.0, 1.0]]), [f64::INFINITY]);
        assert!(hypervolume_contributions(&[]).is_empty());
    }

    /// The area dominated within a corner, by counting unit squares.
    fn area(points: &[[f64; 2]]) -> usize {
        let squares = (0..20).flat_map(|x| (0..20).map(move |y| [f64::from(x), f64::from(y)]));
        squares
            .filter(|at| points.iter().any(|p| p[0] <= at[0] && p[1] <= at[1]))
            .count()
    }

    proptest! {
        #[test]
        fn layers_are_those_of_the_definition(points in proptest::collection::vec((0..6u8, 0..6u8), 0..25)) {
            let points: Vec<[f64; 2]> = points.iter().map(|(x, y)| [f64::from(*x), f64::from(*y)]).collect();
            let layers = non_dominated_layers(&points);
            let mut left: Vec<usize> = (0..points.len()).collect();
            for layer in &layers {
                let worse = |a: usize, b: usize| {
                    let (a, b) = (points[a], points[b]);
                    b[0] <= a[0] && b[1] <= a[1] && a != b
                };
                let expected: Vec<usize> =
                    left.iter().copied().filter(|a| !left.iter().any(|b| worse(*a, *b))).collect();
                prop_assert_eq!(layer, &expected);
                left.retain(|index| !layer.contains(index));
            }
            prop_assert!(left.is_empty());
        }

        #[test]
        fn inner_members_add_the_area_that_is_lost_without_them(points in proptest::collection::vec((0..20u8, 0..20u8), 1..12)) {
            let all: Vec<[f64; 2]> = points.iter().map(|(x, y)| [f64::from(*x), f64::from(*y)]).collect();
            let first = non_dominated_layers(&all).swap_remove(0);
            let layer: Vec<[f64; 2]> = first.into_iter().map(|index| all[index]).collect();
            for (index, contribution) in hypervolume_contributions(&layer).into_iter().enumerate() {
                let mut others = layer.clone();
                others.remove(index);
                if contribution.is_finite() {
                    prop_assert_eq!(contribution, (area(&layer) - area(&others)) as f64);
                } else {
                    let is_best = |axis: usize| layer.iter().all(|p| layer[index][axis] <= p[axis]);
                    prop_assert!(is_best(0) || is_best(1));
                }
            }
        }
    }
}
