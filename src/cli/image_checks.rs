//! Whether recordings fit together, and to what is asked of them, before and after `tomoswarm image` has calibrated them.
//!
//! Nothing is read or written here.

use std::collections::BTreeSet;

use tomoswarm_proto::RunId;

use super::counted::counted;
use super::error::CliError;
use super::image::{ImageCommand, bounds};
use super::recording::{LengthUnit, Recording};
use super::true_places::TruePlaces;
use crate::config::SourceFile;
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

    /// Checks that there is something to make an image of: `used` links are in it.
    pub(super) fn check_links(&self, used: usize, dropped: &DroppedLinks) -> Result<(), CliError> {
        if used > 1 {
            return Ok(());
        }
        let left_out = match dropped.is_empty() {
            true => String::new(),
            false => format!(" that can be imaged (left out: {})", reasons(dropped)),
        };
        let reason = format!(
            "found {}{left_out}, expected several: one says how much is lost along it, and not where",
            counted(used, "link")
        );
        Err(CliError::Input {
            path: self.files[0].clone(),
            reason,
        })
    }
}

/// Returns how many links were left out, and why, in a few words.
fn reasons(dropped: &DroppedLinks) -> String {
    let of = |(reason, count): (&DropReason, &usize)| format!("{count} {}", reason.words());
    dropped.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Returns a warning where a recording of the sweep is one of the empty sweep as well.
pub(super) fn warning_of_itself(now: &[SourceFile], empty: &[SourceFile]) -> Option<String> {
    let is_both = |file: &&SourceFile| empty.iter().any(|other| other.sha256 == file.sha256);
    let both = now.iter().find(is_both)?;
    Some(format!(
        "warning: {} is given as the sweep and as its own empty sweep: what is compared with itself has not changed",
        both.file
    ))
}

/// Returns a warning where most links are shorter than `shortest`, and so left out.
pub(super) fn warning_of_short(
    used: usize,
    dropped: &DroppedLinks,
    shortest: &str,
) -> Option<String> {
    let short = dropped.get(&DropReason::TooShort).copied().unwrap_or(0);
    let all = used + dropped.values().sum::<usize>();
    (2 * short > all).then(|| {
        format!(
            "warning: {short} of {} are left out as they are shorter than {shortest}, which goes with the size of what is \
             imaged or is the recording's min_link_m: the image rests on {used}",
            counted(all, "link")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_that_is_its_own_empty_sweep_is_warned_of() {
        let file = |name: &str, text: &str| SourceFile::of(name, text.as_bytes());
        let now = [file("a.csv", "1"), file("b.csv", "2")];
        assert_eq!(warning_of_itself(&now, &[file("c.csv", "3")]), None);
        let said = warning_of_itself(&now, &[file("copy.csv", "2")]).unwrap();
        assert!(
            said.starts_with("warning: b.csv is given as the sweep and as its own"),
            "{said}"
        );
    }

    #[test]
    fn links_that_are_mostly_too_short_are_warned_of() {
        let of = |short: usize, along: usize| {
            let dropped =
                DroppedLinks::from([(DropReason::TooShort, short), (DropReason::SameSide, along)]);
            warning_of_short(10, &dropped, "1.50 m")
        };
        let said = of(31, 20).unwrap();
        assert!(
            said.starts_with("warning: 31 of 61 links are left out"),
            "{said}"
        );
        assert!(
            said.contains("shorter than 1.50 m") && said.ends_with("rests on 10"),
            "{said}"
        );
        assert_eq!(of(30, 20), None);
        assert_eq!(warning_of_short(10, &DroppedLinks::new(), "1.50 m"), None);
    }
}
