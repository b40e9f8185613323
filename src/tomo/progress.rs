//! How an image gets on, told to who waits for it.

use std::fmt;

/// What is being done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ImagingStep {
    /// What stood in the empty sweep is imaged.
    Structure,
    /// Persons are searched.
    Persons,
    /// Candidates are asked what they were not told.
    Choosing {
        /// So many were asked before.
        done: usize,
        /// So many there are.
        of: usize,
    },
    /// The image is solved.
    Solving {
        /// Rounds before.
        done: usize,
        /// So many there are.
        of: usize,
    },
    /// The deviation of its pixels is computed.
    Deviation,
}

impl fmt::Display for ImagingStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ImagingStep::Structure => f.write_str("imaging the empty sweep"),
            ImagingStep::Persons => f.write_str("searching persons"),
            ImagingStep::Choosing { done, of } => {
                write!(f, "choosing the solver, {} of {of}", done + 1)
            }
            ImagingStep::Solving { done, of } => {
                write!(f, "solving the image, round {} of {of}", done + 1)
            }
            ImagingStep::Deviation => f.write_str("computing the deviation"),
        }
    }
}

/// Who is told of each step when it begins.
#[derive(Clone, Copy)]
pub(super) struct Watch<'a>(pub(super) &'a dyn Fn(ImagingStep));

impl Watch<'_> {
    /// Nobody is.
    pub(super) const NOBODY: Watch<'static> = Watch(&|_| {});

    pub(super) fn tell(&self, step: ImagingStep) {
        (self.0)(step);
    }
}

impl fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Watch")
    }
}
