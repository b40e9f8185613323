//! The tables of `configs/README.md` are what the declarations of the keys say.

use tomoswarm::config::key_tables;

#[test]
fn the_tables_of_the_readme_are_those_of_the_declarations() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/README.md");
    let readme = std::fs::read_to_string(path).unwrap();
    for (kind, tables) in key_tables() {
        let (begin, end) = (
            format!("<!-- keys of {kind} -->\n\n"),
            "<!-- end of keys -->",
        );
        let found = readme
            .split_once(&begin)
            .and_then(|(_, rest)| rest.split_once(end))
            .map(|(text, _)| text);
        assert_eq!(
            found,
            Some(tables.as_str()),
            "the tables of kind {kind} in configs/README.md are not those of the program; `tomoswarm check --keys` \
             prints them"
        );
    }
}
