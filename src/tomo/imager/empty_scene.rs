//! What stood there in the empty sweep: its image, which is made once for one empty sweep.
//!
//! It says where there is room for a change ([`super::super::room`]), and what of a link's loss is the same in both sweeps
//! ([`super::super::empty_sweep`]).

use serde::{Deserialize, Serialize};

use super::super::empty_sweep::EmptyLinks;
use super::super::error::TomoError;
use super::super::map_solver::MapSettings;
use super::super::settings::{ImagingSettings, Solver};
use super::super::{Image, Link};
use super::{Extras, Imager};

/// What stood there in the empty sweep.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct EmptyScene {
    empty: Vec<Link>,
    /// Its image; `None` when its links show nothing.
    pub(super) structure: Option<Image>,
}

impl EmptyScene {
    /// Images an empty sweep.
    ///
    /// # Errors
    /// [`TomoError::TooLarge`].
    pub(super) fn of(empty: &[Link], settings: &ImagingSettings) -> Result<EmptyScene, TomoError> {
        let prior = ImagingSettings::prior_for(settings.grid.area);
        let settings = ImagingSettings {
            solver: Solver::Map(prior, MapSettings::default()),
            ..*settings
        };
        let made = Imager::new(settings)
            .and_then(|mut imager| imager.update(empty, None, Extras::default()));
        let structure = match made {
            Ok(made) => Some(made.image),
            Err(problem @ TomoError::TooLarge { .. }) => return Err(problem),
            // Without a picture of the empty sweep nothing is known to stand anywhere.
            Err(TomoError::NoLinks { .. } | TomoError::BadGrid { .. }) => None,
        };
        Ok(EmptyScene {
            empty: empty.to_vec(),
            structure,
        })
    }

    /// Returns the links that it was made from, with their image.
    pub(super) fn links(&self) -> EmptyLinks<'_> {
        EmptyLinks {
            links: &self.empty,
            structure: self.structure.as_ref(),
        }
    }

    /// Returns whether it is that of these links, or of such whose strengths differ by so much at most, dB.
    pub(super) fn is_of(&self, links: &[Link], within_db: f64) -> bool {
        Link::are_same(&self.empty, links, within_db)
    }
}
