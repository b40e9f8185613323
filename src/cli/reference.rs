//! With what the strengths of an image are compared: with the links of an empty sweep, or with a fitted strength in free
//! space. Text and JSON say the same; nothing is fitted here.

use serde_json::{Value, json};

use super::counted::counted;
use crate::tomo::{LawBasis, PathLoss};

/// With what the strengths of an image are compared, and on how many links that rests.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Reference {
    kind: ReferenceKind,
    links: usize,
}

/// On which links a reference rests.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ReferenceKind {
    EmptySweep,
    FreeSpace(LawBasis),
}

impl Reference {
    /// Returns that of an image: so many pooled links of an empty sweep where there is one, else the law that was fitted;
    /// `None` = neither, and then there is no image.
    pub(super) fn of(empty: Option<usize>, path_loss: Option<PathLoss>) -> Option<Reference> {
        match (empty, path_loss) {
            (Some(links), _) => Some(Reference {
                kind: ReferenceKind::EmptySweep,
                links,
            }),
            (None, Some(law)) => Some(Reference {
                kind: ReferenceKind::FreeSpace(law.basis),
                links: law.links,
            }),
            (None, None) => None,
        }
    }

    /// Returns it in a line.
    pub(super) fn in_words(self) -> String {
        let count = counted(self.links, "link");
        match self.kind {
            ReferenceKind::EmptySweep => format!("reference: {count} of the empty sweep\n"),
            ReferenceKind::FreeSpace(LawBasis::Sides) => {
                format!("reference: free space, by {count} along the sides, where nothing stands\n")
            }
            ReferenceKind::FreeSpace(LawBasis::All) => format!(
                "reference: free space, by all {count} that are long enough: too few run along the sides, so the level is less \
                 sure\n"
            ),
        }
    }

    /// Returns it as the JSON output shows it.
    pub(super) fn to_json(self) -> Value {
        let name = match self.kind {
            ReferenceKind::EmptySweep => "empty sweep",
            ReferenceKind::FreeSpace(LawBasis::Sides) => "along the sides",
            ReferenceKind::FreeSpace(LawBasis::All) => "all",
        };
        json!({"name": name, "links": self.links})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(empty: Option<usize>, basis: LawBasis, (words, name, links): (&str, &str, usize)) {
        let law = PathLoss {
            p0_dbm: -40.0,
            exponent: 2.0,
            centre_db: 10.0,
            level_sd_db: 0.1,
            exponent_sd: 0.2,
            residual_db: 1.0,
            links: 9,
            basis,
        };
        let reference = Reference::of(empty, Some(law)).unwrap();
        assert_eq!(reference.in_words(), format!("reference: {words}\n"));
        assert_eq!(reference.to_json(), json!({"name": name, "links": links}));
    }

    #[test]
    fn text_and_json_name_the_same_reference() {
        // An empty sweep counts, whatever law was fitted to it.
        for basis in [LawBasis::Sides, LawBasis::All] {
            let empty = ("1 link of the empty sweep", "empty sweep", 1);
            check(Some(1), basis, empty);
        }
        let sides = "free space, by 9 links along the sides, where nothing stands";
        check(None, LawBasis::Sides, (sides, "along the sides", 9));
        let all = "free space, by all 9 links that are long enough: too few run along the sides, so the level is less sure";
        check(None, LawBasis::All, (all, "all", 9));
        assert_eq!(Reference::of(None, None), None);
    }
}
