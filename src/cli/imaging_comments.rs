//! How links are to be imaged, in the comments that a CSV file of links or samples begins with.

use super::recording::{RecordingError, wrong};
use crate::config::LinksFile;

/// What begins a line of a CSV file that holds no link.
const COMMENT: char = '#';

/// Returns the comments that say how a file is to be imaged.
pub(super) fn comments(imaging: Option<&LinksFile>) -> String {
    let text = imaging.map(LinksFile::written).unwrap_or_default();
    text.lines()
        .map(|line| format!("{COMMENT} {line}").trim_end().to_owned() + "\n")
        .collect()
}

/// Reads how links are to be imaged from the comments that a file begins with; `None` when they say nothing of it.
pub(super) fn read_comments(text: &str) -> Result<Option<LinksFile>, RecordingError> {
    let blank_or_comment = |line: &'_ str| match line.trim().is_empty() {
        true => Some(String::new()),
        false => line.strip_prefix(COMMENT).map(str::to_owned),
    };
    let comments: Vec<String> = text.lines().map_while(blank_or_comment).collect();
    let uncommented = comments
        .iter()
        .map(|line| line.strip_prefix(' ').unwrap_or(line));
    // Notes of others may stand before; their lines are counted.
    let mut has_begun = false;
    let toml: String = uncommented
        .map(|line| {
            has_begun = has_begun || LinksFile::begins(line);
            format!("{}\n", if has_begun { line } else { "" })
        })
        .collect();
    if !has_begun {
        return Ok(None);
    }
    LinksFile::read("", &toml).map(Some).map_err(|problems| {
        let first = problems.list().first();
        let (line, found, expected) = first.map_or((1, String::new(), String::new()), |first| {
            let found = match (first.key.as_str(), first.value.as_str()) {
                ("", _) => first.wrong.clone(),
                (key, "") => format!("that {key} {}", first.wrong),
                (key, value) => format!("{key} = {value}, which {}", first.wrong),
            };
            // Rules are whole sentences ("a list is allowed"), of which this one takes what comes before the verb.
            let rule = first.allowed.as_str();
            let of = [" is allowed", " is needed"].map(|verb| rule.split_once(verb));
            let expected = match (of.into_iter().flatten().next(), rule) {
                (Some((what, more)), _) => format!("{what}{more}"),
                (None, "") => {
                    "TOML in these comments, as a run writes it above its links".to_owned()
                }
                (None, rule) => rule.to_owned(),
            };
            (first.line, found, expected)
        });
        wrong(format!("{line}: "), found, expected)
    })
}
