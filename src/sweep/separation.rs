//! Proves that a set of plans keeps vehicles apart whatever the delays.
//!
//! For every leg, vector clocks over the precedence graph tell which stops of each other vehicle must be done before
//! it is entered. All other legs, and the one resting place before
//! them, may coincide with it in time and must therefore be far enough away.

use tomoswarm_proto::Plan;

use super::PlanError;
use super::precedence::{
    check_starts, resolve_after, rest_after, too_close, topological_order, tracks_of, validate,
};
use crate::geom::Track;

/// Checks that no two vehicles can come closer than `separation_m` (middle to middle, metres), for
/// every timing that respects the precedence of the plans.
///
/// # Errors
/// The plans are not valid together, or two legs (or a leg and a resting place) that may coincide in
/// time are too close.
pub fn check_separation(plans: &[Plan], separation_m: f64) -> Result<(), PlanError> {
    validate(plans)?;
    check_starts(plans, separation_m)?;
    let clocks = clocks(plans)?;
    let tracks: Vec<Vec<Track>> = plans.iter().map(tracks_of).collect();
    for mover in 0..plans.len() {
        for other in (0..plans.len()).filter(|other| *other != mover) {
            for (leg, track) in tracks[mover].iter().enumerate() {
                let surely_done = clocks[mover][leg][other];
                let distance_m = track.distance_to_point(rest_after(&plans[other], surely_done));
                if distance_m < separation_m {
                    let at = (other, surely_done);
                    return Err(too_close(
                        plans,
                        (mover, leg + 1),
                        at,
                        distance_m,
                        separation_m,
                    ));
                }
                let may_coincide = |early: &usize| clocks[other][*early][mover] <= leg;
                for early in (surely_done..tracks[other].len()).take_while(may_coincide) {
                    let distance_m = tracks[other][early].distance_to(track);
                    if distance_m < separation_m {
                        let at = (other, early + 1);
                        return Err(too_close(
                            plans,
                            (mover, leg + 1),
                            at,
                            distance_m,
                            separation_m,
                        ));
                    }
                }
            }
        }
    }
    Ok(())
}

/// For every plan and stop, per plan: how many of its stops are surely done when the leg is entered.
fn clocks(plans: &[Plan]) -> Result<Vec<Vec<Vec<usize>>>, PlanError> {
    let after = resolve_after(plans)?;
    let mut clocks: Vec<Vec<Vec<usize>>> = plans
        .iter()
        .map(|plan| vec![vec![0; plans.len()]; plan.stops.len()])
        .collect();
    for (index, at) in topological_order(plans)? {
        let mut clock = if at > 0 {
            clocks[index][at - 1].clone()
        } else {
            vec![0; plans.len()]
        };
        clock[index] = at;
        for (of, stop) in &after[index][at] {
            for (known, earlier) in clock.iter_mut().zip(&clocks[*of][*stop]) {
                *known = (*known).max(*earlier);
            }
            clock[*of] = clock[*of].max(stop + 1);
        }
        clocks[index][at] = clock;
    }
    Ok(clocks)
}
