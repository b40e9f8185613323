//! A folder of its own for each test, with a small world in it in which a whole mission takes a tenth of a second,
//! and the program run in it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;

/// The simulation: a ring of 8 m by 8 m in 24 positions, one lap, an empty sweep first.
pub const SIM: &str = r#"kind = "sim"
venue = "small.venue.toml"
scene = "small.scene.toml"
empty_sweep = true
until_s = 600.0

[sweep]
positions = 24
laps = 1
"#;

/// The place.
pub const VENUE: &str = r#"kind = "venue"
name = "small"
area_m = [0.0, 0.0, 8.0, 8.0]
fence_m = [[-3.0, -3.0], [11.0, -3.0], [11.0, 11.0], [-3.0, 11.0]]
homes_m = [[-0.85, -0.85], [8.85, 8.85], [8.85, -0.85], [-0.85, 8.85]]

[datum]
latitude_deg = 52.0
longitude_deg = 4.0
altitude_m = 0.0
"#;

/// The scene.
pub const SCENE: &str = r#"kind = "scene"
name = "small"
wrl = "small.wrl"
up = "z"

[material.Wall]
db_per_m = 20.0

[random_persons]
count = 1
keep_from_border_m = 2.0
keep_from_objects_m = 0.5
"#;

/// The shapes.
pub const SHAPES: &str = "#VRML V2.0 utf8
DEF Wall Transform { translation 3 3 1 children Shape { geometry Box { size 2 0.3 2 } } }
";

/// What the program said and how it ended.
#[derive(Debug)]
pub struct ProgramOutput {
    /// The exit code.
    pub code: i32,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

/// A folder with the small world.
pub struct ProgramRunner {
    folder: TempDir,
}

impl ProgramRunner {
    /// Lays the small world out.
    pub fn new() -> ProgramRunner {
        let runner = ProgramRunner {
            folder: tempfile::tempdir().unwrap(),
        };
        runner.write("small.sim.toml", SIM);
        runner.write("small.venue.toml", VENUE);
        runner.write("small.scene.toml", SCENE);
        runner.write("small.wrl", SHAPES);
        runner
    }

    /// Returns the path of a file.
    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    /// Writes a file again with one text in place of another.
    pub fn change(&self, name: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(from), "{name} has no {from}");
        self.write(name, text.replace(from, to));
    }

    /// Returns the program, to be run in this folder with nothing to read.
    pub fn program<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .stdin(Stdio::null());
        command
    }

    /// Runs the program to its end; it must not panic.
    pub fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> ProgramOutput {
        output_of(self.program(arguments))
    }

    /// Runs the program, which must refuse: exit code 2, no answer, every file as before. Gives what it
    /// complained of, which must name every one of `parts`.
    pub fn refused<S: AsRef<OsStr>>(&self, arguments: &[S], parts: &[&str]) -> String {
        let before = self.files();
        let ProgramOutput { code, out, err } = self.run(arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{err}");
        for part in parts {
            assert!(err.contains(part), "`{part}` is missing in: {err}");
        }
        assert_eq!(self.files(), before, "files were left behind or changed");
        err
    }

    /// Returns all files below the folder with their content; a folder has a name that ends in `/`.
    pub fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(self.folder.path(), &mut files);
        files
    }

    /// Returns the names in a folder.
    pub fn names_in(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Reads a file that was written.
    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }
}

fn collect(folder: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.insert(path.join(""), Vec::new());
            collect(&path, files);
        } else {
            let content = std::fs::read(&path).unwrap();
            files.insert(path, content);
        }
    }
}

/// Runs a command to its end; it must not panic.
pub fn output_of(mut command: Command) -> ProgramOutput {
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    let printed = ProgramOutput {
        code: output.status.code().unwrap_or(-1),
        out: text(output.stdout),
        err: text(output.stderr),
    };
    assert!(
        !printed.err.contains("panicked") && (0..=2).contains(&printed.code),
        "{printed:?}"
    );
    printed
}
