//! Tables of text: columns as wide as their widest cell, parted by two spaces.

/// Writes rows below a heading; a row may have fewer cells than the heading.
pub fn table(heading: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize, title: &str| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count());
        cells.max().unwrap_or(0).max(title.chars().count())
    };
    let widths: Vec<usize> = heading.iter().enumerate().map(|(column, title)| width(column, title)).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<String> = cells.zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        format!("{}\n", padded.join("  ").trim_end())
    };
    let mut text = line(&mut heading.iter().copied());
    for row in rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

/// Gives a list in words; a dash for an empty one.
pub fn listed<T: std::fmt::Display>(all: &[T]) -> String {
    let words: Vec<String> = all.iter().map(T::to_string).collect();
    if words.is_empty() { "-".to_owned() } else { words.join(",") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_lines_end_without_spaces() {
        let rows = [vec!["1".to_owned(), "drives".to_owned()], vec!["12345678".to_owned(), String::new()]];
        assert_eq!(table(&["vehicle", "mode"], &rows), "vehicle   mode\n1         drives\n12345678\n");
        assert_eq!((listed(&[1, 2]), listed::<u8>(&[])), ("1,2".to_owned(), "-".to_owned()));
    }
}
