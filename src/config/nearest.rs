//! The nearest known word to a mistyped one.

/// Returns the known word with the smallest edit distance, if it is near enough to be meant.
pub(crate) fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let short: String = word.chars().take(64).collect();
    let unit_left_out = format!("{short}_");
    if let Some(whole) = known.iter().find(|name| name.starts_with(&unit_left_out)) {
        return Some(whole);
    }
    let best = known
        .iter()
        .map(|candidate| (strsim::osa_distance(&short, candidate), *candidate))
        .min()?;
    let near_enough = best.0 <= 2.max(short.chars().count() / 3);
    let is_part = known.iter().copied().find(|name| is_stem(&short, name));
    if near_enough { Some(best.1) } else { is_part }
}

/// Returns whether one word is the other with more written behind it ("radius" and "radius_m").
fn is_stem(word: &str, known: &str) -> bool {
    word.len() >= 3 && (known.starts_with(word) || word.starts_with(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(word: &str, expected: Option<&str>) {
        assert_eq!(
            nearest(word, &["radius_m", "height_m", "count", "max_speed_mps"]),
            expected,
            "{word}"
        );
    }

    #[test]
    fn a_slip_of_the_pen_finds_the_word_that_was_meant() {
        check("cuont", Some("count"));
        check("radius", Some("radius_m"));
        check("hieght_m", Some("height_m"));
        check("max_sped_mps", Some("max_speed_mps"));
        check("max_speed", Some("max_speed_mps"));
        check("max", Some("max_speed_mps"));
    }

    #[test]
    fn a_strange_word_finds_nothing() {
        check("colour", None);
        check(&"x".repeat(100_000), None);
    }
}
