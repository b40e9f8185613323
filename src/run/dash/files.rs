//! The files of the page, built in; or read from a folder, for whoever works on them. They go compressed (gzip), which is done
//! once, when a file is asked for first.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;
use std::sync::OnceLock;

use flate2::Compression;
use flate2::write::GzEncoder;

/// What the page takes from elsewhere lies in a folder of its own; a browser is given this one file of it.
const VENDORED: &str = "vendor/three.js";

/// A file of the page.
struct PageFile {
    name: &'static str,
    bytes: &'static [u8],
}

const fn file(name: &'static str, bytes: &'static [u8]) -> PageFile {
    PageFile { name, bytes }
}

const FILE_COUNT: usize = 37;
const FILES: [PageFile; FILE_COUNT] = [
    file("app.css", include_bytes!("../../../web/app.css")),
    file("app.js", include_bytes!("../../../web/app.js")),
    file("begin.js", include_bytes!("../../../web/begin.js")),
    file("cell.js", include_bytes!("../../../web/cell.js")),
    file("cut.js", include_bytes!("../../../web/cut.js")),
    file("decode.js", include_bytes!("../../../web/decode.js")),
    file("draw.js", include_bytes!("../../../web/draw.js")),
    file("feed.js", include_bytes!("../../../web/feed.js")),
    file("finds.js", include_bytes!("../../../web/finds.js")),
    file("fleet.js", include_bytes!("../../../web/fleet.js")),
    file("frames.js", include_bytes!("../../../web/frames.js")),
    file("ghost.js", include_bytes!("../../../web/ghost.js")),
    file("icon.svg", include_bytes!("../../../web/icon.svg")),
    file("image.js", include_bytes!("../../../web/image.js")),
    file("index.html", include_bytes!("../../../web/index.html")),
    file("labels3d.js", include_bytes!("../../../web/labels3d.js")),
    file("layers3d.js", include_bytes!("../../../web/layers3d.js")),
    file("log.js", include_bytes!("../../../web/log.js")),
    file("marks.js", include_bytes!("../../../web/marks.js")),
    file("model.js", include_bytes!("../../../web/model.js")),
    file("orders.js", include_bytes!("../../../web/orders.js")),
    file("pace.js", include_bytes!("../../../web/pace.js")),
    file("plan.js", include_bytes!("../../../web/plan.js")),
    file("preflight.js", include_bytes!("../../../web/preflight.js")),
    file("radio.js", include_bytes!("../../../web/radio.js")),
    file("scene2d.js", include_bytes!("../../../web/scene2d.js")),
    file("scene3d.js", include_bytes!("../../../web/scene3d.js")),
    file("settings.js", include_bytes!("../../../web/settings.js")),
    file("stop.js", include_bytes!("../../../web/stop.js")),
    file("tabs.js", include_bytes!("../../../web/tabs.js")),
    file("theme.js", include_bytes!("../../../web/theme.js")),
    file("tiles.js", include_bytes!("../../../web/tiles.js")),
    file("time.js", include_bytes!("../../../web/time.js")),
    file("vehicle3d.js", include_bytes!("../../../web/vehicle3d.js")),
    file(
        "vendor/three.js",
        include_bytes!("../../../web/vendor/three.js"),
    ),
    file("view.js", include_bytes!("../../../web/view.js")),
    file("why.js", include_bytes!("../../../web/why.js")),
];
static COMPRESSED: [OnceLock<Vec<u8>>; FILE_COUNT] = [const { OnceLock::new() }; FILE_COUNT];

/// A file as it is sent.
pub(super) struct SentFile {
    /// Its media type.
    pub(super) kind: &'static str,
    /// It is compressed by gzip, whatever the browser says that it takes: all do.
    pub(super) bytes: Cow<'static, [u8]>,
}

/// Returns a file by the path of its address; `None` = there is no such file.
pub(super) fn find(path: &str, folder: Option<&Path>) -> Option<SentFile> {
    let name = match path.trim_start_matches('/') {
        "" => "index.html",
        name => name,
    };
    let kind = kind_of(name)?;
    match folder {
        Some(folder) => {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '_' || c == '-';
            let is_inside = name.chars().all(is_plain) && !name.starts_with('.');
            if !is_inside && name != VENDORED {
                return None;
            }
            let read = std::fs::read(folder.join(name)).ok()?;
            let bytes = Cow::Owned(compressed(&read));
            Some(SentFile { kind, bytes })
        }
        None => {
            let (file, sent) = FILES
                .iter()
                .zip(&COMPRESSED)
                .find(|(file, _)| file.name == name)?;
            let bytes = Cow::Borrowed(&sent.get_or_init(|| compressed(file.bytes))[..]);
            Some(SentFile { kind, bytes })
        }
    }
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut packer = GzEncoder::new(Vec::new(), Compression::best());
    // Memory takes whatever it is given.
    let _ = packer.write_all(bytes);
    packer.finish().unwrap_or_default()
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
            // Declarations are read where types are checked, never by a browser.
            .filter(|name| name != "vendor" && !name.ends_with(".d.ts"))
            .chain([VENDORED.to_owned()])
            .collect();
        names.sort();
        let mut built_in: Vec<&str> = FILES.iter().map(|file| file.name).collect();
        built_in.sort_unstable();
        assert_eq!(built_in, names);
        for file in &FILES {
            let lines = file.bytes.iter().filter(|byte| **byte == b'\n').count();
            let is_own = file.name != VENDORED;
            assert!(!is_own || lines <= 600, "{}: {lines} lines", file.name);
        }
    }

    #[test]
    fn the_page_with_its_three_dimensions_is_no_more_than_250_kilobytes_to_load() {
        let sent = |name: &str| find(&format!("/{name}"), None).unwrap().bytes.len();
        let three = sent(VENDORED);
        let all: usize = FILES.iter().map(|file| sent(file.name)).sum();
        println!("{} bytes, of which {three} come when 3D is asked for", all);
        assert!(all <= 250_000, "{all}");
    }

    #[test]
    fn what_is_sent_is_what_is_built_in() {
        for file in &FILES {
            let sent = find(&format!("/{}", file.name), None).unwrap();
            let mut unpacked = Vec::new();
            let mut packed = flate2::read::GzDecoder::new(&sent.bytes[..]);
            std::io::Read::read_to_end(&mut packed, &mut unpacked).unwrap();
            assert!(unpacked == file.bytes, "{}", file.name);
        }
    }

    #[test]
    fn what_is_taken_from_elsewhere_is_what_its_hash_says() {
        let held = std::fs::read_to_string(format!("{FOLDER}/vendor/three.js.sha256")).unwrap();
        let file = FILES.iter().find(|file| file.name == VENDORED).unwrap();
        let hash = ring::digest::digest(&ring::digest::SHA256, file.bytes);
        let words: Vec<String> = hash
            .as_ref()
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        assert_eq!(held.split_whitespace().next(), Some(&words.concat()[..]));
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
            "/vendor/../app.js",
            "/vendor/three.LICENSE",
            "/vendor/other.js",
        ] {
            assert!(
                find(path, folder).is_none() && find(path, None).is_none(),
                "{path}"
            );
        }
    }
}
