//! The dispatcher, and the runs over both collections.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::fact::{Checked, Fact};
use super::shared::{complete, shared_text};
use super::{astar, geometry, links, missions, vehicle, vrml};

/// Areas of the predecessor that this design replaced on purpose (DECISIONS.md says why).
const REPLACED: [&str; 11] = [
    "packet",
    "ntp",
    "tdma",
    "line-follower",
    "robot-vehicle",
    "mock-vehicle",
    "waypoint",
    "collision-avoidance",
    "greedy-assignment",
    "reconstruction",
    "geometry-spherical",
];

/// Whether a fact ran.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Ran {
    Yes,
    /// What it needs is not there.
    No,
}

fn dispatch(fact: &Fact) -> Result<Ran, String> {
    let ran = |checked: Checked| checked.map(|()| Ran::Yes);
    let if_there =
        |checked: Result<bool, String>| checked.map(|ran| if ran { Ran::Yes } else { Ran::No });
    let outcome = match fact.area.as_str() {
        "geometry" => ran(geometry::check(fact)),
        "distance-sensor" => ran(vehicle::check_distance_sensor(fact)),
        "servo" => ran(vehicle::check_servo(fact)),
        "memory-map" => ran(vehicle::check_memory_map(fact)),
        "astar" => ran(astar::check(fact)),
        "snap-to-boundary" => ran(links::check_snap(fact)),
        "weights" => ran(links::check_weights(fact)),
        "planning-objective" => ran(links::check_objective(fact)),
        "pareto" => ran(links::check_pareto(fact)),
        "dataset" => ran(links::check_dataset(fact)),
        "mission-calibrate" => ran(missions::check_calibrate(fact)),
        "mission-fan" => ran(missions::check_fan(fact)),
        "mission-fan-straight" => ran(missions::check_fan_straight(fact)),
        "mission-square" => ran(missions::check_square(fact)),
        "vrml" => if_there(vrml::check_counts(fact)),
        "vrml-ray" => if_there(vrml::check_ray(fact)),
        other => Err(format!("the area {other} is not known")),
    }?;
    match outcome {
        Ran::Yes => fact.all_was_read().map(|()| Ran::Yes),
        Ran::No => Ok(Ran::No),
    }
}

fn parse(text: &str) -> Vec<Fact> {
    let values: Vec<Value> = serde_json::from_str(text).unwrap();
    values
        .iter()
        .map(|value| Fact::from_json(value).unwrap())
        .collect()
}

fn own() -> Vec<Fact> {
    parse(include_str!("../data/facts.json"))
}

/// Runs facts, prints how many of each area ran, and returns these numbers.
fn run(title: &str, facts: &[Fact]) -> BTreeMap<String, usize> {
    let (mut ran, mut wrong) = (BTreeMap::<String, usize>::new(), Vec::new());
    for fact in facts {
        match dispatch(fact) {
            Ok(Ran::Yes) => *ran.entry(fact.area.clone()).or_default() += 1,
            Ok(Ran::No) => {}
            Err(error) => wrong.push(format!("{} ({}): {error}", fact.id, fact.description)),
        }
    }
    println!(
        "{title}: {} of {} ran: {ran:?}",
        ran.values().sum::<usize>(),
        facts.len()
    );
    assert!(
        wrong.is_empty(),
        "{} facts do not hold:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    ran
}

#[test]
fn our_own_facts_hold() {
    let ran = run("own facts", &own());
    let least = [
        ("astar", 8),
        ("dataset", 1),
        ("distance-sensor", 6),
        ("geometry", 30),
        ("memory-map", 5),
        ("mission-calibrate", 1),
        ("mission-fan", 1),
        ("mission-fan-straight", 1),
        ("mission-square", 1),
        ("pareto", 2),
        ("planning-objective", 1),
        ("servo", 5),
        ("snap-to-boundary", 15),
        ("weights", 6),
    ];
    for (area, count) in least {
        assert!(
            ran.get(area).is_some_and(|ran| *ran >= count),
            "{area}: {:?} of {count} ran",
            ran.get(area)
        );
    }
}

#[test]
fn the_shared_facts_of_the_areas_kept_hold() {
    let Some(text) = shared_text("facts.json") else {
        return;
    };
    let all = parse(&text);
    let (replaced, mut kept): (Vec<Fact>, Vec<Fact>) = all
        .iter()
        .cloned()
        .partition(|fact| REPLACED.contains(&fact.area.as_str()));
    kept.iter_mut().for_each(|fact| complete(fact, &all));
    let ran = run("shared facts", &kept);
    println!(
        "{} facts are of areas that were replaced: {REPLACED:?}",
        replaced.len()
    );
    assert_eq!(
        ran.values().sum::<usize>(),
        kept.len(),
        "the scene lies beside the facts"
    );
}

/// Changes each leaf of a value in turn.
fn changed(value: &Value) -> Vec<Value> {
    match value {
        Value::Null => vec![json!(1.5)],
        Value::Bool(flag) => vec![json!(!flag)],
        Value::Number(number) => vec![json!(number.as_f64().unwrap() + 1.0), Value::Null],
        Value::String(_) => vec![json!("something else")],
        Value::Array(list) => {
            let at = |index: usize| {
                let list = list.clone();
                changed(&list[index]).into_iter().map(move |new| {
                    let mut list = list.clone();
                    list[index] = new;
                    Value::Array(list)
                })
            };
            let mut longer = list.clone();
            longer.push(json!(0));
            (0..list.len())
                .flat_map(at)
                .chain([Value::Array(longer)])
                .collect()
        }
        Value::Object(_) => vec![json!(0)],
    }
}

#[test]
fn a_fact_that_is_changed_anywhere_does_not_hold() {
    // Large grids are searched once only, above.
    let quick = |fact: &Fact| fact.area != "astar" || !fact.has("resolution");
    let (mut changes, facts) = (0, own());
    for fact in facts
        .iter()
        .filter(|fact| quick(fact) && dispatch(fact) == Ok(Ran::Yes))
    {
        for (key, value) in &fact.expected {
            for new in changed(value) {
                let mut altered = fact.clone();
                altered.expected.insert(key.clone(), new.clone());
                assert!(
                    dispatch(&altered).is_err(),
                    "{} holds with {key} = {new}",
                    fact.id
                );
                changes += 1;
            }
        }
    }
    assert!(changes > 300, "{changes}");
}

#[test]
fn what_nobody_knows_or_reads_does_not_hold() {
    for fact in own().iter().filter(|fact| dispatch(fact) == Ok(Ran::Yes)) {
        let mut more = fact.clone();
        more.inputs.insert("unheard_of".to_owned(), json!(1));
        assert!(dispatch(&more).is_err(), "{}", fact.id);
        let mut elsewhere = fact.clone();
        elsewhere.area = "alchemy".to_owned();
        assert!(dispatch(&elsewhere).is_err(), "{}", fact.id);
    }
    let odd = json!({"id": "x", "area": "geometry", "expected": {"a": 1}, "weight": 3});
    assert!(Fact::from_json(&odd).is_err());
}
