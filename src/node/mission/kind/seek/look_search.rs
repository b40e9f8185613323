//! Over which ground the best look is sought: first where there is room to spare; then through every doorway that is wide
//! enough; only when nothing is left so, through gaps that the vehicle has already driven itself.
//!
//! What was searched for some candidates serves for the next ones too: grids and ways do not depend on what is looked at.

use super::frontier_candidates::{FrontierCandidate, Ground, LookCandidate, Reach};
use super::look_history::{LookHistory, Rigour};
use crate::geom::Point;
use crate::map::OccupancyGrid;
use crate::node::mission::terrain::{
    OpenGround, PathSearch, RULES, ReachedGround, Resolution, WAYS,
};
use crate::plan::{Distances, SearchGrid};

/// The place in [`WAYS`] of the search from half cell to half cell.
const BY_HALVES: usize = 1;
/// The place of the search from part to part.
const FINELY: usize = 2;

/// A look, and the way to where it is taken.
pub(super) struct FoundLook {
    pub(super) look: LookCandidate,
    /// The ground that was searched.
    pub(super) ground: ReachedGround,
    /// Over places too that it has driven, however near to something these are.
    pub(super) is_narrow: bool,
}

/// Why there is no look.
pub(super) enum NoLook {
    /// The fence is too large to be searched.
    TooLarge,
    /// Nothing of what is to be looked at is seen from places that can be reached.
    InVain,
}

/// The ground of one of the [`WAYS`], as far as it was searched.
enum SearchedGround {
    Unsearched,
    /// The vehicle has no room on it.
    Cramped,
    Reached(Box<ReachedGround>),
}

/// A search for looks from where a vehicle is, clear of what peers claim.
pub(super) struct LookSearch<'a> {
    search: &'a PathSearch<'a>,
    occupancy: &'a OccupancyGrid,
    claims: &'a [Vec<Point>],
    reach: Reach,
    /// In the order of [`WAYS`].
    grounds: [SearchedGround; WAYS.len()],
}

impl<'a> LookSearch<'a> {
    /// Makes a search of which nothing was searched.
    pub(super) fn new(
        search: &'a PathSearch<'a>,
        occupancy: &'a OccupancyGrid,
        claims: &'a [Vec<Point>],
        reach: Reach,
    ) -> LookSearch<'a> {
        LookSearch {
            search,
            occupancy,
            claims,
            reach,
            grounds: WAYS.map(|_| SearchedGround::Unsearched),
        }
    }

    /// Returns the best look at one of some candidates.
    pub(super) fn best(
        &mut self,
        looks: &LookHistory,
        rigour: Rigour,
        candidates: &[FrontierCandidate],
    ) -> Result<FoundLook, NoLook> {
        for (index, (resolution, is_narrow)) in WAYS.into_iter().enumerate() {
            let Some(ReachedGround { grid, ways }) = self.take(index, resolution, is_narrow)?
            else {
                continue;
            };
            let known = self.known(&grid, looks, rigour, index);
            match known.best_look(self.search.from(), candidates, self.reach, ways) {
                Ok((look, ways)) => {
                    return Ok(FoundLook {
                        look,
                        ground: ReachedGround { grid, ways },
                        is_narrow,
                    });
                }
                Err(ways) => {
                    let ways = *ways;
                    self.grounds[index] =
                        SearchedGround::Reached(Box::new(ReachedGround { grid, ways }));
                }
            }
        }
        Err(NoLook::InVain)
    }

    /// Returns whether one of some candidates that were sought in vain is seen from other ground that can be reached.
    pub(super) fn is_any_seen(
        &self,
        looks: &LookHistory,
        rigour: Rigour,
        candidates: &[FrontierCandidate],
        ground: &OpenGround,
    ) -> bool {
        self.known(&ground.grid, looks, rigour, WAYS.len())
            .is_any_seen(
                (self.search.from(), &ground.reached),
                candidates,
                self.reach,
            )
    }

    /// Returns the ground searched from part to part, if the vehicle had room on it and all of it was searched.
    pub(super) fn finely(&self) -> Option<&ReachedGround> {
        self.reached(FINELY).filter(|ground| ground.ways.is_whole())
    }

    /// Returns the same, which ends the search.
    pub(super) fn into_finely(self) -> Option<ReachedGround> {
        self.finely()?;
        match self.grounds.into_iter().nth(FINELY)? {
            SearchedGround::Reached(ground) => Some(*ground),
            SearchedGround::Unsearched | SearchedGround::Cramped => None,
        }
    }

    fn reached(&self, index: usize) -> Option<&ReachedGround> {
        match &self.grounds[index] {
            SearchedGround::Reached(ground) => Some(ground),
            SearchedGround::Unsearched | SearchedGround::Cramped => None,
        }
    }

    /// Returns a ground and what is known of the ways on it; `None` when the vehicle has no room on it.
    fn take(
        &mut self,
        index: usize,
        resolution: Resolution,
        is_narrow: bool,
    ) -> Result<Option<ReachedGround>, NoLook> {
        let known = std::mem::replace(&mut self.grounds[index], SearchedGround::Cramped);
        match known {
            SearchedGround::Cramped => Ok(None),
            SearchedGround::Reached(ground) => Ok(Some(*ground)),
            SearchedGround::Unsearched => {
                let grid = self.grid(resolution, is_narrow).ok_or(NoLook::TooLarge)?;
                Ok(grid.and_then(|grid| {
                    let start = grid.lattice().cell_at(self.search.from());
                    let ways = Distances::within(&grid, start, &RULES, 0.0).ok()?;
                    Some(ReachedGround { grid, ways })
                }))
            }
        }
    }

    /// Makes a grid; `None` when it is too large, and none in it when the vehicle has no room on it.
    fn grid(&self, resolution: Resolution, is_narrow: bool) -> Option<Option<SearchGrid>> {
        let again = self.reached(BY_HALVES).filter(|_| is_narrow);
        let mut grid = match again {
            Some(ground) => ground.grid.clone(),
            None => self.search.ground(None, resolution, false, self.claims)?,
        };
        let has_room = !self.search.is_cramped(&grid, resolution)
            && (!is_narrow || grid.open_along(self.search.driven()));
        Some(has_room.then_some(grid))
    }

    /// Returns what is known of the ground; from what was searched before in the order of [`WAYS`] nothing is seen.
    fn known<'b>(
        &'b self,
        grid: &'b SearchGrid,
        looks: &'b LookHistory,
        rigour: Rigour,
        before: usize,
    ) -> Ground<'b> {
        // Where nodes lie as far apart as cells, others see more.
        let in_vain = (BY_HALVES..before).filter_map(|index| self.reached(index));
        Ground {
            lattice: self.search.lattice(),
            occupancy: self.occupancy,
            grid,
            looks,
            rigour,
            in_vain: in_vain.filter(|ground| ground.ways.is_whole()).collect(),
        }
    }
}
