//! Who was searched for in a run, found and missed, in words and for a program; and why nobody was searched for. It writes
//! nothing.

use serde_json::{Value, json};

use super::image_text::{limit_in_words, unfound_in_words, why_not_searched};
use super::report::why_not_made;
use crate::config::Sim;
use crate::ground::imager::Subject;
use crate::scene::Person;
use crate::sim::{FoundObject, NEAR_M, RunOutcome, Scenario};

/// The search for persons in a run.
#[derive(Debug)]
pub(super) struct PersonSearch {
    /// The finds; `None` when nobody was searched for.
    found: Option<Vec<FoundObject>>,
    /// The evidence that a find needs, and how many finds of nobody that lets through in an image, on the mean.
    limit: Option<(f64, f64)>,
    /// Who else may be there, or that nobody was found.
    unfound: Option<String>,
    /// Why nobody was searched for; `None` as well where the mission is no sweep.
    why_not: Option<String>,
    persons: Vec<Person>,
    /// How far its find is from each of them, metres.
    errors_m: Vec<f64>,
}

/// Returns whether a run is to make an image of what has changed, in which persons are searched.
pub(super) fn is_wanted(sim: &Sim) -> bool {
    sim.is_planned_by_ground() && sim.empty_sweep
}

impl PersonSearch {
    /// Takes what an outcome has of it.
    pub(super) fn of(scenario: &Scenario, outcome: &RunOutcome) -> PersonSearch {
        let finds = outcome
            .change
            .as_ref()
            .and_then(|change| change.finds.as_ref());
        let area = scenario.sim().venue.area;
        let unfound = finds.and_then(|finds| {
            unfound_in_words(finds, &scenario.image(Subject::Change).finds, area, "m")
        });
        PersonSearch {
            found: outcome.has_searched().then(|| outcome.found()),
            limit: finds.map(|finds| (finds.threshold, finds.false_per_image)),
            unfound,
            why_not: why_not(scenario, outcome),
            persons: outcome.persons.clone(),
            errors_m: outcome.errors_m(),
        }
    }

    /// Returns who was found in lines, or that nobody was, or was searched for.
    pub(super) fn finds_in_words(&self) -> String {
        let found = self.found.iter().flatten();
        let lines: String = found.map(|find| self.find_in_words(find)).collect();
        let why_not = self.why_not.as_ref();
        let not_searched = why_not.map(|why| format!("nobody was searched for: {why}"));
        let rest = self.unfound.clone().or(not_searched);
        let limit = self.limit.map_or(String::new(), |(least, rate)| {
            format!("persons           {}\n", limit_in_words(least, rate))
        });
        let rest = rest.map_or(String::new(), |rest| format!("persons           {rest}\n"));
        lines + &rest + &limit
    }

    fn find_in_words(&self, find: &FoundObject) -> String {
        let nearest = match find.error_m {
            None => "nobody was there".to_owned(),
            Some(error_m) if find.is_somebody() => format!("{error_m:.2} m off"),
            Some(error_m) if error_m <= NEAR_M => {
                format!(
                    "nobody else within {NEAR_M} m, a person who is another find {error_m:.2} m off"
                )
            }
            Some(error_m) => format!("nobody within {NEAR_M} m, the nearest {error_m:.2} m off"),
        };
        let [xx, _, yy] = find.covariance_m2;
        format!(
            "found             at {:.2} ± {:.2}, {:.2} ± {:.2} m, {:.2} dB/m, evidence {:.1}: {nearest}\n",
            find.at.x_m,
            xx.sqrt(),
            find.at.y_m,
            yy.sqrt(),
            find.strength,
            find.evidence
        )
    }

    /// Returns who was searched for and is no find, in lines.
    pub(super) fn missed_in_words(&self) -> String {
        let judged = self.persons.iter().zip(&self.errors_m);
        let missed = judged.filter(|(_, error_m)| self.found.is_some() && **error_m > NEAR_M);
        missed
            .map(|(Person { name, at, path, .. }, _)| {
                let does = match path.is_empty() {
                    true => "at",
                    false => "who walks, from",
                };
                format!(
                    "missed            {name} {does} {:.2}, {:.2} m\n",
                    at.x_m, at.y_m
                )
            })
            .collect()
    }

    /// Returns the evidence that was needed and the rate of finds of nobody for a program; null when nobody was searched for.
    pub(super) fn limit_json(&self) -> Value {
        json!(
            self.limit.map(
                |(evidence, rate)| json!({ "evidence": evidence, "false_finds_per_image": rate })
            )
        )
    }

    /// Returns the finds for a program; null when nobody was searched for.
    pub(super) fn found_json(&self) -> Value {
        let find = |find: &FoundObject| {
            let [xx, xy, yy] = find.covariance_m2;
            let name = |person: usize| self.persons.get(person).map(|person| &person.name);
            json!({
                "x_m": find.at.x_m, "y_m": find.at.y_m, "strength": find.strength, "error_m": find.error_m,
                "person": find.person.and_then(name),
                "covariance_m2": [[xx, xy], [xy, yy]], "evidence": find.evidence, "probability": find.probability,
            })
        };
        let found = self.found.as_ref();
        json!(found.map(|found| found.iter().map(find).collect::<Vec<_>>()))
    }

    /// Returns why nobody was searched for, for a program; null where persons were, and where the mission is no sweep.
    pub(super) fn why_not_json(&self) -> Value {
        json!(self.why_not)
    }

    /// Returns who stood in the scene, for a program.
    pub(super) fn persons_json(&self) -> Value {
        let person = |Person { name, at, path, .. }: &Person| {
            let path: Vec<[f64; 2]> = path.iter().map(|at| [at.x_m, at.y_m]).collect();
            json!({ "name": name, "x_m": at.x_m, "y_m": at.y_m, "path_m": path })
        };
        json!(self.persons.iter().map(person).collect::<Vec<_>>())
    }
}

/// Returns why a sweep has searched for nobody.
fn why_not(scenario: &Scenario, outcome: &RunOutcome) -> Option<String> {
    let sim = scenario.sim();
    if outcome.has_searched() || !sim.is_planned_by_ground() {
        return None;
    }
    Some(match (&outcome.change, &outcome.failure) {
        _ if !sim.empty_sweep => {
            "persons are told only by an empty sweep (empty_sweep = true)".to_owned()
        }
        (_, Some(why)) => format!("that is done when the sweep has ended, and {why}"),
        (None, None) => why_not_made(outcome, Subject::Change).to_owned(),
        (Some(change), None) => {
            let settings = scenario.image(Subject::Change);
            why_not_searched(&settings.finds, change.image.grid.area, "m")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;

    fn find(person: Option<usize>, error_m: f64) -> FoundObject {
        FoundObject {
            at: Point::new(1.0, 2.0),
            strength: 8.0,
            covariance_m2: [0.01, 0.0, 0.01],
            evidence: 50.0,
            probability: 0.0,
            person,
            error_m: Some(error_m),
        }
    }

    fn search(found: Option<Vec<FoundObject>>, why_not: Option<&str>) -> PersonSearch {
        PersonSearch {
            found,
            limit: None,
            unfound: None,
            why_not: why_not.map(str::to_owned),
            persons: ["ann", "bob"]
                .map(|name| Person {
                    name: name.to_owned(),
                    at: Point::new(1.0, 2.5),
                    path: match name {
                        "bob" => vec![Point::new(3.0, 2.5)],
                        _ => Vec::new(),
                    },
                    radius_m: 0.3,
                    height_m: 1.8,
                    db_per_m: 10.0,
                })
                .into(),
            errors_m: vec![0.5, f64::INFINITY],
        }
    }

    #[test]
    fn who_was_not_searched_for_is_not_missed() {
        let given_up = search(None, Some("the sweep did not end"));
        assert_eq!(given_up.missed_in_words(), "");
        assert_eq!(
            given_up.finds_in_words(),
            "persons           nobody was searched for: the sweep did not end\n"
        );
        assert!(given_up.found_json().is_null());
        assert_eq!(given_up.why_not_json(), "the sweep did not end");
        let nobody = search(Some(Vec::new()), None);
        assert_eq!(nobody.found_json(), json!([]));
        assert!(nobody.why_not_json().is_null());
    }

    #[test]
    fn a_second_find_beside_a_person_is_nobody_and_names_no_person() {
        let searched = search(Some(vec![find(Some(0), 0.5), find(None, 0.7)]), None);
        let words = searched.finds_in_words();
        assert!(
            words.contains(": 0.50 m off\n") && words.contains(": nobody else within 1 m, "),
            "{words}"
        );
        let found = searched.found_json();
        assert_eq!(found[0]["person"], "ann");
        assert!(found[1]["person"].is_null());
        let missed = searched.missed_in_words();
        assert!(
            missed.contains("bob who walks, from 1.00, 2.50 m") && !missed.contains("ann"),
            "{missed}"
        );
    }
}
