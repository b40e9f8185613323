//! Keeps the house in order by machine: who may use whom, how long a file may be, and that every file says what it is
//! for. Reads the sources as text; knows nothing of types. What pure code must not call is clippy's business
//! (`clippy.toml`, `[workspace.lints]` in Cargo.toml). Its own tests show that each rule can fail.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::fs;
use std::path::{Path, PathBuf};

const L0: &[&str] = &["time", "geom"];
const L1: &[&str] = &["map", "plan", "tomo", "sweep", "scene", "config", "draw"];
const L2: &[&str] = &[
    "actor",
    "stops",
    "autopilot",
    "node",
    "ground",
    "operator",
    "exchange",
    "hw",
    "mavlink",
    "dash",
];

/// Which modules a module may use beside itself; `None` for one that is not in the table.
fn may_use(module: &str) -> Option<Vec<&'static str>> {
    let joined = |groups: &[&[&'static str]]| Some(groups.concat());
    match module {
        "time" => joined(&[]),
        "geom" => joined(&[&["time"]]),
        "map" | "tomo" | "sweep" | "scene" => joined(&[L0]),
        "plan" => joined(&[L0, &["map"]]),
        "config" => joined(&[L0, &["map", "plan"]]),
        "draw" => joined(&[L0, &["tomo", "map", "scene"]]),
        "actor" => joined(&[L0, L1]),
        "stops" | "autopilot" => joined(&[L0, &["actor"]]),
        "node" => joined(&[L0, L1, &["actor", "stops", "autopilot"]]),
        "ground" => joined(&[L0, L1, &["actor", "stops", "exchange", "node"]]),
        "exchange" => joined(&[L0]),
        "hw" => joined(&[L0, &["config", "node"]]),
        "mavlink" => joined(&[L0, &["autopilot"]]),
        "operator" => joined(&[L0, L1, &["actor", "stops", "exchange", "node"]]),
        "dash" => joined(&[L0, L1, &["actor", "exchange", "operator", "stops"]]),
        "sim" => joined(&[L0, L1, L2]),
        "store" => joined(&[L0, L1, L2]),
        "run" => joined(&[L0, L1, L2, &["sim", "store"]]),
        "cli" | "main" | "lib" => joined(&[L0, L1, L2, &["sim", "store", "run", "cli"]]),
        _ => None,
    }
}

/// The longest file without its tests, lines.
const MOST_LINES: usize = 600;

/// Returns all that is untidy in one source file; `path` is relative to the package ("src/map/tile.rs").
fn complaints(path: &str, text: &str, is_test_module: bool) -> Vec<String> {
    let mut place = Place::of(path);
    place.is_test |= is_test_module;
    let code = without_comments_and_strings(text);
    let (product, tests) = split_off_tests(&code, place.is_test);
    let mut found = Vec::new();
    if !text.trim_start().starts_with("//!") {
        found.push(format!("{path}: does not begin with //!, what it is for"));
    }
    let lines = text.lines().count() - tests.lines().filter(|line| !line.trim().is_empty()).count();
    // What several test binaries share has no other name.
    if path.ends_with("/mod.rs") && path.contains("src/") {
        found.push(format!(
            "{path}: a module stands beside its folder, under its name"
        ));
    }
    if !place.is_test && lines > MOST_LINES {
        found.push(format!(
            "{path}: {lines} lines without tests, over {MOST_LINES}"
        ));
    }
    if place.is_layered {
        // A block of tests lies one module deeper than the file that holds it.
        let depth = place.modules.len();
        found.extend(upward(path, &place, &product, depth));
        found.extend(upward(
            path,
            &place,
            &tests,
            if place.is_test { depth } else { depth + 1 },
        ));
        found.dedup();
    }
    found
}

/// Where a source file stands.
struct Place {
    /// Its module path ("map", "tile"); empty for the crate's root.
    modules: Vec<String>,
    is_test: bool,
    is_layered: bool,
}

impl Place {
    fn of(path: &str) -> Place {
        let is_layered = path.starts_with("src/");
        let inner = path.trim_start_matches("proto/").trim_start_matches("src/");
        let mut modules: Vec<String> = inner
            .trim_end_matches(".rs")
            .split('/')
            .map(str::to_owned)
            .collect();
        let is_test =
            modules.iter().any(|module| module == "tests") || inner.ends_with("_tests.rs");
        if modules.last().is_some_and(|last| last == "mod") {
            modules.pop();
        }
        Place {
            modules,
            is_test,
            is_layered,
        }
    }

    fn top(&self) -> &str {
        &self.modules[0]
    }
}

/// Returns each use of a module that lies higher, or that the table does not know.
fn upward(path: &str, place: &Place, code: &str, depth: usize) -> Vec<String> {
    let Some(allowed) = may_use(place.top()) else {
        return vec![format!(
            "{path}: module {} is not in the layer table of tests/tidy.rs",
            place.top()
        )];
    };
    let mut found = Vec::new();
    for (at, module) in used_modules(code, depth) {
        let is_module = may_use(&module).is_some();
        if is_module && module != place.top() && !allowed.contains(&module.as_str()) {
            let line = 1 + code[..at].matches('\n').count();
            found.push(format!(
                "{path}:{line}: {} must not use {module}",
                place.top()
            ));
        }
    }
    found
}

/// Returns the top modules that code at a depth of modules names after `crate::` or by steps up
/// (`super::super::`), with their places in the text.
fn used_modules(code: &str, depth: usize) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for root in ["crate::", "tomoswarm::"] {
        for (at, _) in code.match_indices(root) {
            if !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
                found.extend(
                    first_names(&code[at + root.len()..])
                        .into_iter()
                        .map(|name| (at, name)),
                );
            }
        }
    }
    for (at, _) in code.match_indices("super::") {
        let steps = code[at..]
            .split("super::")
            .take_while(|between| between.is_empty())
            .count();
        // Only steps to the crate's root can reach another module.
        if !code[..at].ends_with("super::") && steps >= depth {
            let path = &code[at + steps * "super::".len()..];
            found.extend(first_names(path).into_iter().map(|name| (at, name)));
        }
    }
    found
}

/// Returns the first name of a path, or of every path in a group `{a::b, c}`.
fn first_names(path: &str) -> Vec<String> {
    let name_of = |text: &str| -> String {
        text.trim_start()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let Some(group) = path.strip_prefix('{') else {
        return vec![name_of(path)];
    };
    let (mut depth, mut names, mut start) = (1, Vec::new(), 0);
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 || (c == ',' && depth == 1) {
            names.push(name_of(&group[start..at]));
            start = at + 1;
        }
        if depth == 0 {
            break;
        }
    }
    names
}

/// Parts code from the items under `#[cfg(test)]`; each part keeps its lines, the rest is blank.
fn split_off_tests(code: &str, is_test: bool) -> (String, String) {
    let blank = |text: &str| {
        text.chars()
            .map(|c| if c == '\n' { c } else { ' ' })
            .collect::<String>()
    };
    if is_test {
        return (blank(code), code.to_owned());
    }
    let (mut product, mut tests, mut rest) = (String::new(), String::new(), code);
    while let Some(at) = rest.find("#[cfg(test)]") {
        let (before, from) = rest.split_at(at);
        let (item, after) = from.split_at(end_of_item(from));
        product.push_str(before);
        product.push_str(&blank(item));
        tests.push_str(&blank(before));
        tests.push_str(item);
        rest = after;
    }
    product.push_str(rest);
    tests.push_str(&blank(rest));
    (product, tests)
}

/// Returns the length of an item: up to its `;`, or to the brace that closes it.
fn end_of_item(item: &str) -> usize {
    let mut depth = 0_usize;
    for (at, c) in item.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth <= 1 => return at + 1,
            '}' => depth -= 1,
            ';' if depth == 0 => return at + 1,
            _ => {}
        }
    }
    item.len()
}

/// Blanks comments and the insides of strings and characters; lines stay where they are.
fn without_comments_and_strings(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let after_name = code.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let length = comment(rest)
            .or_else(|| string(rest, after_name))
            .or_else(|| character(rest));
        let (taken, is_blank) = length.map_or((c.len_utf8(), false), |length| (length, true));
        for c in rest[..taken].chars() {
            code.push(if is_blank && c != '\n' { ' ' } else { c });
        }
        rest = &rest[taken..];
    }
    code
}

/// Returns the length of the comment that begins here, if one does.
fn comment(text: &str) -> Option<usize> {
    if text.starts_with("//") {
        return Some(text.find('\n').unwrap_or(text.len()));
    }
    if !text.starts_with("/*") {
        return None;
    }
    let (mut depth, mut at) = (0_usize, 0);
    while at < text.len() {
        if text[at..].starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if text[at..].starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
        if depth == 0 {
            return Some(at);
        }
    }
    Some(text.len())
}

/// Returns the length of the string, raw or not, that begins here, if one does.
fn string(text: &str, after_name: bool) -> Option<usize> {
    if let Some(body) = text.strip_prefix('"') {
        let mut is_escaped = false;
        for (at, c) in body.char_indices() {
            match c {
                '"' if !is_escaped => return Some(at + 2),
                c => is_escaped = c == '\\' && !is_escaped,
            }
        }
        return Some(text.len());
    }
    let hashes = text
        .strip_prefix('r')?
        .chars()
        .take_while(|c| *c == '#')
        .count();
    let body = text[1 + hashes..]
        .strip_prefix('"')
        .filter(|_| !after_name || text.starts_with("r#\""))?;
    let close = format!("\"{}", "#".repeat(hashes));
    Some(
        body.find(&close)
            .map_or(text.len(), |at| 2 + hashes + at + close.len()),
    )
}

/// Returns the length of the character literal that begins here, if one does (and no lifetime).
fn character(text: &str) -> Option<usize> {
    let body = text.strip_prefix('\'')?;
    if let Some(escaped) = body.strip_prefix('\\') {
        let skip = escaped.chars().next()?.len_utf8();
        return escaped[skip..].find('\'').map(|at| 2 + skip + at + 1);
    }
    let c = body.chars().next()?;
    body[c.len_utf8()..]
        .starts_with('\'')
        .then(|| 2 + c.len_utf8())
}

/// Returns the paths, without ending, of the modules that a file declares for its tests only
/// (`#[cfg(test)] mod name;`).
fn test_modules(path: &str, text: &str) -> Vec<String> {
    let folder = path.trim_end_matches(".rs").trim_end_matches("/mod");
    let code = without_comments_and_strings(text);
    let declared = code.split("#[cfg(test)]").skip(1).filter_map(|item| {
        let (name, _) = item.trim_start().strip_prefix("mod ")?.split_once(';')?;
        (!name.contains('{')).then(|| format!("{folder}/{}", name.trim()))
    });
    declared.collect()
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let Ok(entries) = fs::read_dir(folder) else {
        return found;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn every_source_file_is_tidy() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["src", "proto/src", "tests"].map(|folder| root.join(folder));
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| sources(folder)).collect();
    assert!(files.len() > 20, "only {} files were found", files.len());
    let texts: Vec<(String, String)> = files
        .iter()
        .map(|file| {
            let path = file
                .strip_prefix(root)
                .unwrap()
                .to_str()
                .unwrap()
                .replace('\\', "/");
            (path, fs::read_to_string(file).unwrap())
        })
        .collect();
    let for_tests: Vec<String> = texts
        .iter()
        .flat_map(|(path, text)| test_modules(path, text))
        .collect();
    let is_for_tests = |path: &str| {
        let inside = |module: &String| {
            path.strip_prefix(module)
                .is_some_and(|rest| rest.starts_with(['.', '/']))
        };
        for_tests.iter().any(inside)
    };
    let found: Vec<String> = texts
        .iter()
        .flat_map(|(path, text)| complaints(path, text, is_for_tests(path)))
        .collect();
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

fn check(path: &str, code: &str, expected: &[&str]) {
    assert_eq!(
        complaints(path, &format!("//! A sample.\n{code}"), false),
        expected,
        "{code}"
    );
}

#[test]
fn a_use_of_a_higher_layer_is_seen_in_every_spelling() {
    let complaint = |line| format!("src/map/tile.rs:{line}: map must not use plan");
    for code in [
        "use crate::plan::Route;",
        "use crate::{geom::Point, plan::{Route, a}};",
        "fn a() -> crate::plan::Route { b() }",
        "use super::super::plan::Route;",
        "use tomoswarm::plan;",
    ] {
        check("src/map/tile.rs", code, &[&complaint(2)]);
    }
    check(
        "src/map/tile.rs",
        "use crate::{\n    geom,\n    plan,\n};",
        &[&complaint(2)],
    );
    check(
        "src/map.rs",
        "use super::plan::Route;",
        &["src/map.rs:2: map must not use plan"],
    );
    check(
        "src/map/tile.rs",
        "#[cfg(test)]\nmod tests {\n    use crate::plan;\n}",
        &[&complaint(4)],
    );
    check(
        "src/node/map.rs",
        "use crate::sim::World;",
        &["src/node/map.rs:2: node must not use sim"],
    );
    check(
        "src/actor/inbox.rs",
        "use crate::node;",
        &["src/actor/inbox.rs:2: actor must not use node"],
    );
    let complaint = "src/exchange/egress.rs:2: exchange must not use node";
    check("src/exchange/egress.rs", "use crate::node;", &[complaint]);
    check(
        "src/geom.rs",
        "use crate::map;",
        &["src/geom.rs:2: geom must not use map"],
    );
}

#[test]
fn a_use_of_the_same_or_a_lower_layer_is_right() {
    for (path, code) in [
        (
            "src/map/tile.rs",
            "use super::evidence; use crate::map::plan_of; use crate::{geom, time::Time};",
        ),
        (
            "src/plan/search.rs",
            "use crate::map::Tile; use super::super::map;",
        ),
        (
            "src/draw/map.rs",
            "use crate::{scene, tomo::{Image, Peak}};",
        ),
        (
            "src/sim/world.rs",
            "use crate::ground; use crate::node; use crate::actor;",
        ),
        ("src/main.rs", "use tomoswarm::cli;"),
        (
            "src/map/tile.rs",
            "// crate::plan\n/* crate::sim */ const A: &str = \"crate::cli\";",
        ),
        (
            "src/node/map.rs",
            "#[cfg(test)]\nmod tests {\n    use super::*;\n    use super::super::sim;\n}",
        ),
    ] {
        check(path, code, &[]);
    }
}

#[test]
fn a_module_in_its_folder_is_seen() {
    let complaint = "src/map/mod.rs: a module stands beside its folder, under its name";
    check("src/map/mod.rs", "use crate::geom;", &[complaint]);
}

#[test]
fn a_module_without_a_layer_is_seen() {
    let complaint = "src/extra.rs: module extra is not in the layer table of tests/tidy.rs";
    check("src/extra.rs", "use crate::geom;", &[complaint]);
}

#[test]
fn a_file_that_is_too_long_or_says_nothing_is_seen() {
    let long = "const A: u8 = 1;\n".repeat(MOST_LINES);
    let complaint = format!(
        "src/map/tile.rs: {} lines without tests, over {MOST_LINES}",
        MOST_LINES + 1
    );
    check("src/map/tile.rs", &long, &[&complaint]);
    let tests = format!("#[cfg(test)]\nmod tests {{\n{long}}}\n");
    check("src/map/tile.rs", &tests, &[]);
    check("src/map/tests.rs", &long, &[]);
    let silent = complaints(
        "src/map/tile.rs",
        "// A comment.\nconst A: u8 = 1;\n",
        false,
    );
    assert_eq!(
        silent,
        ["src/map/tile.rs: does not begin with //!, what it is for"]
    );
}

#[test]
fn a_module_for_tests_only_is_known_by_its_declaration() {
    let code = "mod a;\n#[cfg(test)]\nmod worlds;\n#[cfg(test)]\nmod tests { fn a() {} }\n";
    assert_eq!(test_modules("src/map.rs", code), ["src/map/worlds"]);
    assert_eq!(
        test_modules("src/map/tile.rs", code),
        ["src/map/tile/worlds"]
    );
    let long = format!("//! A.\n{}", "const A: u8 = 1;\n".repeat(MOST_LINES));
    assert_eq!(complaints("src/map/worlds.rs", &long, false).len(), 1);
    assert!(complaints("src/map/worlds.rs", &long, true).is_empty());
}

#[test]
fn quotes_and_lifetimes_do_not_confuse_the_reader() {
    for code in [
        "let a = '\"'; crate::plan::a()",
        "fn a<'a>(b: &'a str) { crate::plan::a() }",
        r"let a = '\''; crate::plan::a()",
    ] {
        check(
            "src/map/a.rs",
            code,
            &["src/map/a.rs:2: map must not use plan"],
        );
    }
    check(
        "src/map/a.rs",
        "let a = \"\\\"crate::plan::a()\"; /* a /* b */ crate::plan::a() */",
        &[],
    );
    check(
        "src/map/a.rs",
        "let a = r\"\\\"; crate::plan::a()",
        &["src/map/a.rs:2: map must not use plan"],
    );
}
