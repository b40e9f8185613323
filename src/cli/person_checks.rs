//! Persons who stand where nobody can be found: outside the fence, outside the area that is imaged, inside something solid, or
//! inside each other. They are warned of, not refused: who builds a scene may mean it. It prints nothing.

use super::person_search;
use crate::geom::{Point, Polygon, Rect};
use crate::scene::{Outline, Person};
use crate::sim::{Scenario, ScenarioError};
use crate::time::Time;

/// Returns a line for each person of a scenario who stands where nobody can be found.
///
/// # Errors
/// The scene cannot be built.
pub(super) fn warnings(scenario: &Scenario) -> Result<Vec<String>, ScenarioError> {
    let (outlines, venue) = (scenario.outlines()?, &scenario.sim().venue);
    let mut found = lines(scenario.persons(), &venue.fence, &outlines);
    if person_search::is_wanted(scenario.sim()) {
        let ways = scenario.ways(Time::NEVER);
        found.extend(unimaged(
            scenario.persons(),
            &ways,
            &venue.fence,
            venue.area,
        ));
    }
    Ok(found)
}

fn lines(persons: &[Person], fence: &Polygon, outlines: &[Outline]) -> Vec<String> {
    let all = persons.iter().enumerate();
    all.filter_map(|(index, person)| {
        let where_to = where_in_words(person, &persons[..index], fence, outlines)?;
        Some(line(person, &format!("stands {where_to}")))
    })
    .collect()
}

/// Returns a line for each person within the fence who is nowhere on its way in the area that is imaged.
fn unimaged(persons: &[Person], ways: &[Vec<Point>], fence: &Polygon, area: Rect) -> Vec<String> {
    let is_outside = |(person, way): &(&Person, &Vec<Point>)| {
        fence.contains(person.at) && !way.iter().any(|at| area.contains(*at))
    };
    let said = |(person, way): (&Person, &Vec<Point>)| {
        let does = if way.len() > 1 { "walks" } else { "stands" };
        let Rect { min, max } = area;
        let where_to = format!(
            "{does} outside the area that is imaged (area_m, from ({}, {}) to ({}, {}) m)",
            min.x_m, min.y_m, max.x_m, max.y_m
        );
        line(person, &where_to)
    };
    persons
        .iter()
        .zip(ways)
        .filter(is_outside)
        .map(said)
        .collect()
}

fn line(person: &Person, does_where: &str) -> String {
    let (name, at) = (&person.name, person.at);
    format!(
        "person {name} at ({:.2}, {:.2}) m {does_where}, where nobody is found; it will count as missed",
        at.x_m, at.y_m
    )
}

/// Returns where a person stands whom nobody can find; `others` were placed before it.
fn where_in_words(
    person: &Person,
    others: &[Person],
    fence: &Polygon,
    outlines: &[Outline],
) -> Option<String> {
    if !fence.contains(person.at) {
        return Some("outside the fence".to_owned());
    }
    if let Some(solid) = outlines.iter().find(|outline| outline.contains(person.at)) {
        return Some(format!("inside {}", solid.name));
    }
    let reach_m = |other: &Person| person.radius_m + other.radius_m;
    let inside = others
        .iter()
        .find(|other| other.at.distance_to(person.at) < reach_m(other));
    inside.map(|other| format!("inside person {}", other.name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    fn square(low_m: f64, high_m: f64) -> Polygon {
        Rect::new(Point::new(low_m, low_m), Point::new(high_m, high_m)).polygon()
    }

    #[test]
    fn who_stands_where_nobody_is_found_is_named_with_the_place() {
        let check = |places: &[(f64, f64)], expected: &[&str]| {
            let names = ["ann", "bob"].iter().zip(places);
            let persons: Vec<Person> = names
                .map(|(name, (x_m, y_m))| Person {
                    name: (*name).to_owned(),
                    at: Point::new(*x_m, *y_m),
                    path: Vec::new(),
                    radius_m: 0.3,
                    height_m: 1.8,
                    db_per_m: 10.0,
                })
                .collect();
            let block = Outline {
                object: 0,
                name: "block".to_owned(),
                polygon: square(4.0, 5.0),
                holes: Vec::new(),
                db_per_m: 20.0,
            };
            assert_eq!(lines(&persons, &square(0.0, 10.0), &[block]), expected);
        };
        check(&[(2.0, 2.0), (2.7, 2.0)], &[]);
        check(
            &[(12.0, 2.0), (4.5, 4.2)],
            &[
                "person ann at (12.00, 2.00) m stands outside the fence, where nobody is found; it will count as missed",
                "person bob at (4.50, 4.20) m stands inside block, where nobody is found; it will count as missed",
            ],
        );
        check(
            &[(2.0, 2.0), (2.5, 2.0)],
            &[
                "person bob at (2.50, 2.00) m stands inside person ann, where nobody is found; it will count as missed",
            ],
        );
    }
}
