//! What is planted in a world, and what comes of it.

use std::fmt;

/// A mistake that is planted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mistake {
    /// An order is sent once, and not again.
    NotRepeated,
    /// A vehicle takes the lower lease for the higher one.
    LeaseComparedWrongly,
    /// An operator takes a state that shows an old order of the same kind for obedience.
    OldStateCounts,
    /// A vehicle that is started anew has forgotten what it obeyed.
    MemoryLost,
    /// A vehicle is told that its disk has what is only on its way there.
    ToldTooEarly,
    /// The ground station does not see what operators have stopped.
    GroundSeesNoStops,
    /// A ground station that is started anew orders by the lease that it held first.
    GroundOrdersBelow,
    /// The ground station does not wait until its disk, a slow one, has what it says.
    GroundDoesNotWait,
}

/// What came of a world.
#[derive(Clone, Copy, Default, Debug)]
pub struct Tally {
    /// Vehicles that an operator called obedient.
    pub obeyed: u64,
    /// Wants that ended otherwise for a vehicle.
    pub not_obeyed: u64,
    /// Orders that reached a vehicle below what an earlier start of it has left on its disk: none may be obeyed.
    pub below_disk: u64,
    /// Starts by the ground station that vehicles obeyed.
    pub ground_starts: u64,
    /// Of these, those that were on their way when an operator stopped the vehicle, and came later.
    pub crossed: u64,
}

impl Tally {
    /// Adds what came of another world.
    pub fn add(&mut self, other: &Tally) {
        let Tally {
            obeyed,
            not_obeyed,
            below_disk,
            ground_starts,
            crossed,
        } = *other;
        self.obeyed += obeyed;
        self.not_obeyed += not_obeyed;
        self.below_disk += below_disk;
        self.ground_starts += ground_starts;
        self.crossed += crossed;
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Tally {
            obeyed,
            not_obeyed,
            below_disk,
            ground_starts,
            crossed,
        } = self;
        write!(
            f,
            "{obeyed} orders obeyed, {not_obeyed} not; {below_disk} came to a vehicle started anew below what its disk \
             had; {ground_starts} starts by the ground station, {crossed} of them after a stop that crossed them"
        )
    }
}
