//! The checks of [`crate::operator::preflight`] for a terminal: one table, or one JSON object. Pure.

use serde_json::{Value, json};

use super::table::table;
use crate::operator::preflight::{CheckStatus, NodeChecks, is_go};

/// Returns the checks as a table, what refuses in capitals; `columns` is how wide the terminal is, if there is one.
pub fn text(nodes: &[NodeChecks], columns: Option<usize>) -> String {
    let rows: Vec<Vec<String>> = nodes
        .iter()
        .flat_map(|node| node.checks.iter().map(|check| (&node.node, check)))
        .map(|(node, check)| {
            let light = match check.light {
                CheckStatus::Go => "go",
                CheckStatus::Unknown => "not known",
                CheckStatus::NoGo => "NO-GO",
            };
            vec![
                node.clone(),
                check.what.to_owned(),
                light.to_owned(),
                check.found.clone(),
            ]
        })
        .collect();
    let has_vehicle = nodes.iter().any(|node| node.node.starts_with("vehicle"));
    let verdict = match (is_go(nodes), has_vehicle) {
        (true, _) => "GO",
        (false, false) => "NO-GO: no vehicle was heard, and none was named",
        (false, true) => "NO-GO",
    };
    format!(
        "{}{verdict}\n",
        table(&["node", "check", "", "found"], &rows, columns)
    )
}

/// Returns the checks as one object.
pub fn json(nodes: &[NodeChecks]) -> Value {
    json!({"go": is_go(nodes), "nodes": nodes})
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::preflight::Check;

    fn node(node: &str, light: CheckStatus) -> NodeChecks {
        NodeChecks {
            node: node.to_owned(),
            checks: vec![Check {
                what: "bus",
                light,
                found: "so and so".to_owned(),
            }],
        }
    }

    #[test]
    fn the_last_line_and_the_object_say_whether_all_is_go() {
        for (light, is_go) in [
            (CheckStatus::Go, true),
            (CheckStatus::Unknown, true),
            (CheckStatus::NoGo, false),
        ] {
            let nodes = [node("vehicle 1", light), node("ground", CheckStatus::Go)];
            assert_eq!(text(&nodes, None).ends_with("\nGO\n"), is_go, "{light:?}");
            assert_eq!(json(&nodes)["go"], is_go, "{light:?}");
        }
        assert!(text(&[node("ground", CheckStatus::Go)], None).contains("no vehicle was heard"));
    }
}
