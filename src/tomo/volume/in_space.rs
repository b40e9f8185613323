//! What solvers of pixels believe, of voxels: a thing that is as high as four of the widths at which things are alike, as a person
//! is, costs there what it costs in an image.

use crate::tomo::prior::Prior;
use crate::tomo::solvers::{Candidates, Sparse, Variation};

/// How high things are, in the widths of the prior.
const HEIGHTS: f64 = 4.0;

/// Returns what is believed of a sparse volume.
pub(super) fn sparse(of: Sparse) -> Sparse {
    Sparse {
        sparsity: of.sparsity / height_m(of.prior),
        ..of
    }
}

/// Returns what is chosen from.
pub(super) fn candidates(of: Candidates) -> Candidates {
    let height_m = height_m(of.sparse.prior);
    let variation = |flat: Variation| Variation {
        weight: flat.weight / height_m,
        sparsity: flat.sparsity / height_m,
    };
    Candidates {
        sparse: sparse(of.sparse),
        variations: of.variations.map(variation),
    }
}

fn height_m(prior: Prior) -> f64 {
    HEIGHTS * prior.length_m
}
