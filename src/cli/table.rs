//! Tables of text: columns as wide as their widest cell, parted by two spaces. What does not fit a terminal is wrapped in
//! the last column; nothing is cut.

/// The last column of a table is wrapped only where it has so much room; otherwise the terminal does what it does.
const ROOM: usize = 16;

/// Writes rows below a heading; a row may have fewer cells than the heading. Where there is a terminal, `columns` is how
/// wide it is, and the last column is wrapped to fit.
pub(super) fn table(heading: &[&str], rows: &[Vec<String>], columns: Option<usize>) -> String {
    let width = |column: usize, title: &str| {
        let cells = rows
            .iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count());
        cells.max().unwrap_or(0).max(title.chars().count())
    };
    let widths: Vec<usize> = heading
        .iter()
        .enumerate()
        .map(|(column, title)| width(column, title))
        .collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"))
            .collect();
        format!("{}\n", padded.join("  ").trim_end())
    };
    let last = heading.len().saturating_sub(1);
    let indent: usize = widths.iter().take(last).map(|width| width + 2).sum();
    let room = columns
        .map(|columns| columns.saturating_sub(indent))
        .filter(|room| *room >= ROOM);
    let mut text = line(&mut heading.iter().copied());
    for row in rows {
        let wrapped = row
            .get(last)
            .zip(room)
            .map(|(cell, room)| wrapped(cell, room))
            .unwrap_or_default();
        let Some((first, more)) = wrapped.split_first() else {
            text += &line(&mut row.iter().map(String::as_str));
            continue;
        };
        text += &line(
            &mut row
                .iter()
                .take(last)
                .map(String::as_str)
                .chain([first.as_str()]),
        );
        more.iter()
            .for_each(|more| text += &format!("{:indent$}{more}\n", ""));
    }
    text
}

/// Breaks text between words into lines of so many letters; a longer word has a line of its own.
fn wrapped(text: &str, room: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= room => {
                line.push(' ');
                line.push_str(word);
            }
            Some(_) | None => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::names::listed;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_lines_end_without_spaces() {
        let rows = [
            vec!["1".to_owned(), "drives".to_owned()],
            vec!["12345678".to_owned(), String::new()],
        ];
        assert_eq!(
            table(&["vehicle", "mode"], &rows, None),
            "vehicle   mode\n1         drives\n12345678\n"
        );
        assert_eq!(
            (listed(&[1, 2]), listed::<u8>(&[])),
            ("1,2".to_owned(), "-".to_owned())
        );
    }

    #[test]
    fn on_a_terminal_the_last_column_is_wrapped_between_words_and_in_a_pipe_nothing_is() {
        let troubles = "disk: cannot be written: No space left on device";
        let rows = [
            vec!["1".to_owned(), troubles.to_owned()],
            vec!["2".to_owned(), "none".to_owned()],
        ];
        let narrow = table(&["vehicle", "troubles"], &rows, Some(30));
        let expected = "vehicle  troubles\n1        disk: cannot be\n         written: No space\n         left on device\n2        none\n";
        assert_eq!(narrow, expected);
        for columns in [None, Some(200), Some(12)] {
            assert!(
                table(&["vehicle", "troubles"], &rows, columns).contains(troubles),
                "{columns:?}"
            );
        }
    }
}
