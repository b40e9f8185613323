//! Whether recordings fit together, and to what is asked of them, before and after `tomoswarm image` has calibrated them.
//!
//! Nothing is read or written here.

use std::collections::BTreeSet;

use tomoswarm_proto::RunId;

use super::error::CliError;
use super::image::{ImageCommand, bounds};
use super::recording::{LengthUnit, Recording};
use super::true_places::TruePlaces;
use crate::geom::Rect;
use crate::tomo::{DropReason, DroppedLinks};

impl ImageCommand {
    /// Checks that a venue can say where something is.
    pub(super) fn check_venue(&self, unit: LengthUnit, is_given: bool) -> Result<(), CliError> {
        match (unit, is_given) {
            (LengthUnit::Cell, true) => Err(CliError::Usage(
                "--venue: the cells of this recording have no place on the earth".to_owned(),
            )),
            (LengthUnit::Cell | LengthUnit::Metre, _) => Ok(()),
        }
    }

    /// Checks that an empty sweep was measured where the sweep was, on a channel of it.
    pub(super) fn check_alike(&self, now: &Recording, empty: &Recording) -> Result<(), CliError> {
        let Some(path) = self.empty.first() else {
            return Ok(());
        };
        let refused = |reason: String| CliError::Input {
            path: path.clone(),
            reason,
        };
        let (of_now, of_empty) = (bounds(now.links.iter()), bounds(empty.links.iter()));
        let is_apart =
            |one: Rect, other: Rect| one.max.x_m < other.min.x_m || one.max.y_m < other.min.y_m;
        if is_apart(of_now, of_empty) || is_apart(of_empty, of_now) {
            let words = |area: Rect| {
                let Rect { min, max } = area;
                format!(
                    "({:.1}, {:.1}) to ({:.1}, {:.1})",
                    min.x_m, min.y_m, max.x_m, max.y_m
                )
            };
            return Err(refused(format!(
                "found links from {}, expected an empty sweep of the same place: the sweep lies from {}",
                words(of_empty),
                words(of_now)
            )));
        }
        let (is, was) = (&now.channels, &empty.channels);
        if !is.is_empty() && !was.is_empty() && is.is_disjoint(was) {
            let words = |channels: &BTreeSet<u8>| {
                let numbers: Vec<String> = channels.iter().map(u8::to_string).collect();
                numbers.join(", ")
            };
            return Err(refused(format!(
                "found channel {}, expected an empty sweep on channel {} as the sweep",
                words(was),
                words(is)
            )));
        }
        Ok(())
    }

    /// Checks that the empty sweep has most of the links that the sweep has, as calibrating them has shown: `used` are in the
    /// image.
    pub(super) fn check_partners(
        &self,
        used: usize,
        dropped: &DroppedLinks,
    ) -> Result<(), CliError> {
        let Some(path) = self.empty.first() else {
            return Ok(());
        };
        let count = |reason: DropReason| dropped.get(&reason).copied().unwrap_or(0);
        let without = count(DropReason::NoEmptyPartner);
        let with = used + count(DropReason::OutsideArea);
        if without <= with {
            return Ok(());
        }
        let reason = format!(
            "found links where {with} of the {} of the sweep lie, expected an empty sweep of the same place, with most of them",
            with + without
        );
        Err(CliError::Input {
            path: path.clone(),
            reason,
        })
    }

    /// Checks that marks are of the run that is imaged, as far as both say of which they are.
    pub(super) fn check_run(&self, now: &Recording, stood: &TruePlaces) -> Result<(), CliError> {
        let (Some(path), Some(run)) = (&self.marks, stood.run) else {
            return Ok(());
        };
        if now.runs.is_empty() || now.runs.contains(&run) {
            return Ok(());
        }
        let runs: Vec<String> = now.runs.iter().map(RunId::to_string).collect();
        let reason = format!(
            "found marks of run {run}, expected run {} as in {}",
            runs.join(", "),
            self.files[0].display()
        );
        Err(CliError::Input {
            path: path.clone(),
            reason,
        })
    }

    /// Checks that what is imaged has a size.
    pub(super) fn check_area(&self, area: Rect) -> Result<(), CliError> {
        if area.width_m() > 0.0 && area.height_m() > 0.0 {
            return Ok(());
        }
        let Rect { min, max } = area;
        let reason = format!(
            "found all links on one line, ({:.1}, {:.1}) to ({:.1}, {:.1}), expected links across an area of positive size, \
             or --area",
            min.x_m, min.y_m, max.x_m, max.y_m
        );
        Err(CliError::Input {
            path: self.files[0].clone(),
            reason,
        })
    }

    /// Checks that there is something to make an image of.
    pub(super) fn check_links(&self, count: usize) -> Result<(), CliError> {
        if count > 1 {
            return Ok(());
        }
        let reason = format!(
            "found {count} link, expected several: one says how much is lost along it, and not where"
        );
        Err(CliError::Input {
            path: self.files[0].clone(),
            reason,
        })
    }
}
