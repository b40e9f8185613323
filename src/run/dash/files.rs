//! The files of the page, built in; or read from a folder, for whoever works on them.

use std::borrow::Cow;
use std::path::Path;

/// A file of the page.
struct PageFile {
    name: &'static str,
    bytes: &'static [u8],
}

const fn file(name: &'static str, bytes: &'static [u8]) -> PageFile {
    PageFile { name, bytes }
}

const FILES: [PageFile; 21] = [
    file("index.html", include_bytes!("../../../web/index.html")),
    file("app.css", include_bytes!("../../../web/app.css")),
    file("app.js", include_bytes!("../../../web/app.js")),
    file("begin.js", include_bytes!("../../../web/begin.js")),
    file("decode.js", include_bytes!("../../../web/decode.js")),
    file("feed.js", include_bytes!("../../../web/feed.js")),
    file("fleet.js", include_bytes!("../../../web/fleet.js")),
    file("frames.js", include_bytes!("../../../web/frames.js")),
    file("icon.svg", include_bytes!("../../../web/icon.svg")),
    file("image.js", include_bytes!("../../../web/image.js")),
    file("log.js", include_bytes!("../../../web/log.js")),
    file("model.js", include_bytes!("../../../web/model.js")),
    file("orders.js", include_bytes!("../../../web/orders.js")),
    file("plan.js", include_bytes!("../../../web/plan.js")),
    file("preflight.js", include_bytes!("../../../web/preflight.js")),
    file("radio.js", include_bytes!("../../../web/radio.js")),
    file("scene2d.js", include_bytes!("../../../web/scene2d.js")),
    file("stop.js", include_bytes!("../../../web/stop.js")),
    file("tabs.js", include_bytes!("../../../web/tabs.js")),
    file("theme.js", include_bytes!("../../../web/theme.js")),
    file("time.js", include_bytes!("../../../web/time.js")),
];

/// Returns a file by the path of its address, and what it is; `None` = there is no such file.
pub(super) fn find(
    path: &str,
    folder: Option<&Path>,
) -> Option<(&'static str, Cow<'static, [u8]>)> {
    let name = match path.trim_start_matches('/') {
        "" => "index.html",
        name => name,
    };
    let kind = kind_of(name)?;
    match folder {
        Some(folder) => {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '_' || c == '-';
            let is_inside = name.chars().all(is_plain) && !name.starts_with('.');
            let read = is_inside.then(|| std::fs::read(folder.join(name)).ok());
            read.flatten().map(|bytes| (kind, Cow::Owned(bytes)))
        }
        None => {
            let file = FILES.iter().find(|file| file.name == name)?;
            Some((kind, Cow::Borrowed(file.bytes)))
        }
    }
}

fn kind_of(name: &str) -> Option<&'static str> {
    let (_, ending) = name.rsplit_once('.')?;
    match ending {
        "html" => Some("text/html; charset=utf-8"),
        "css" => Some("text/css; charset=utf-8"),
        "js" => Some("text/javascript; charset=utf-8"),
        "svg" => Some("image/svg+xml"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/web");

    #[test]
    fn every_file_of_the_folder_is_built_in_and_none_is_long() {
        let mut names: Vec<String> = std::fs::read_dir(FOLDER)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let mut built_in: Vec<&str> = FILES.iter().map(|file| file.name).collect();
        built_in.sort_unstable();
        assert_eq!(built_in, names);
        for file in &FILES {
            let lines = file.bytes.iter().filter(|byte| **byte == b'\n').count();
            assert!(lines <= 600, "{}: {lines} lines", file.name);
        }
    }

    #[test]
    fn nothing_outside_the_folder_is_found() {
        let folder = Some(Path::new(FOLDER));
        assert!(find("/", folder).is_some() && find("/stop.js", None).is_some());
        for path in [
            "/../Cargo.toml",
            "/..%2fapp.js",
            "/.app.js",
            "//etc/passwd",
            "/sub/app.js",
            "/app.js/",
            "/app",
        ] {
            assert!(
                find(path, folder).is_none() && find(path, None).is_none(),
                "{path}"
            );
        }
    }
}
