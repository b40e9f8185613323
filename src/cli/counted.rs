//! Numbers of things in words, as several commands print them.

/// Returns a number of things whose plural ends with an s: `1 link`, `2 links`.
pub(super) fn counted(count: usize, what: &str) -> String {
    match count {
        1 => format!("1 {what}"),
        count => format!("{count} {what}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thing_has_no_plural() {
        let all = [0, 1, 2].map(|count| counted(count, "link"));
        assert_eq!(all, ["0 links", "1 link", "2 links"]);
    }
}
