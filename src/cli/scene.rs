//! `tomoswarm scene FILE`: says what stands in a scene and draws it, from above and as a vehicle would see it. Runs
//! nothing.

use std::io::Write;
use std::path::PathBuf;

use super::error::CliError;
use super::folder::{FileFamily, OutputFolder};
use super::load::{self, LoadedScene};
use super::read;
use super::scene_pictures::{SceneView, draw_plan, draw_view};
use super::scene_text::describe;
use super::sim::parse_seed;
use super::standard_output::complain;
use crate::config::{self, Config, SceneFile, Sim};
use crate::geom::Angle;
use crate::scene::{Person, Viewpoint, VrmlScene};
use crate::sim::staging;

/// The files in the folder.
const FAMILY: FileFamily = FileFamily {
    names: &["plan.png", "view.png"],
    mark: None,
    has_folders: false,
};
/// The height of the plan where no range sensor is known, metres.
const PLAN_M: f64 = 0.3;
/// Sides of the view, pixels.
const SIDES_PX: std::ops::RangeInclusive<usize> = 16..=2048;

/// Print what a scene holds, and draw it: a floor plan and a view from any place.
///
/// Nothing is run. A simulation is drawn with its fence, its area, its homes and the persons that its seed places; it is
/// refused for the same mistakes as by `tomoswarm sim`. Lengths are metres, x to the east, y to the north, z up.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct SceneArgs {
    /// A scene or a simulation (.toml, kind = "scene" or "sim"), or shapes alone (.wrl); or a bundled simulation by name:
    /// courtyard, castle, trees, house
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder for the pictures; older ones in it are replaced, other files stay [default: out/scene-NAME]
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Where the view is from, metres, and where it looks: degrees counter-clockwise from the x axis (0 = east, 90 =
    /// north), then degrees above the horizon (below it: negative) [default: all of it, from above the south-west]
    #[arg(long, value_name = "X,Y,Z,YAW[,PITCH]", allow_hyphen_values = true, value_parser = parse_pose)]
    pub pose: Option<Viewpoint>,
    /// Width and height of the view, 16 to 2048 pixels each
    #[arg(long, value_name = "WxH", default_value = "960x600", value_parser = parse_size)]
    pub size: (usize, usize),
    /// How wide the view is from side to side, 5 to 150 degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 60.0, value_parser = parse_field)]
    pub field: f64,
    /// Height of the floor plan's cut, metres [default: that of the simulation's range sensor, or 0.3]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = parse_height)]
    pub height: Option<f64>,
    /// Which axis of a .wrl that is shown alone points up, y or z [default: z]; a scene file says so itself
    #[arg(long, value_name = "AXIS", value_parser = parse_up)]
    pub up: Option<config::Up>,
    /// Seed that places the random persons of a simulation, in place of the file's
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    pub seed: Option<u64>,
}

const AFTER_HELP: &str = "\
The folder then holds
  plan.png   the cut at a vehicle's height, filled by material; faint what is only higher up; homes, fence, persons
  view.png   what is seen from the pose: with the height of the range sensor, what a vehicle there would see

Examples:
  tomoswarm scene castle                                         the bundled castle with homes and fence
  tomoswarm scene configs/house.sim.toml --pose 12,2,0.3,90      what vehicle 5 sees at home, looking north
  tomoswarm scene scenes/trees.scene.toml --pose 2,2,6,45,-25    the wood from above its south-west corner
  tomoswarm scene my.wrl --up y --out pictures                   shapes alone, y up as VRML has it

Exit codes: 0 done; 2 bad usage, bad files, or a folder that cannot be written.";

impl SceneArgs {
    /// Prints and draws.
    ///
    /// # Errors
    /// Bad files, or a folder that cannot be written.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let depicted = self.read()?;
        for warning in &depicted.shapes.warnings {
            complain(&format_args!("warning: {warning}"));
        }
        let target = self.out.clone().unwrap_or_else(|| {
            let name: String = depicted
                .name
                .chars()
                .filter(|c| c.is_alphanumeric() || "-_".contains(*c))
                .collect();
            PathBuf::from(format!("out/scene-{name}"))
        });
        let mut folder = OutputFolder::prepare(&target, FAMILY)?;
        let look = self.look(&depicted);
        folder.write("plan.png", &draw_plan(&depicted, &look)?)?;
        folder.write("view.png", &draw_view(&depicted, &look)?)?;
        let target = folder.publish()?;
        let text = format!(
            "{}: {}written: {}\n",
            self.file.display(),
            describe(&depicted, &look),
            target.display()
        );
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(CliError::stdout)
    }

    fn look(&self, depicted: &LoadedScene) -> SceneView {
        let sensor_m = depicted.sim.as_ref().map(Sim::sensor_height_m);
        SceneView {
            pose: self.pose,
            size_px: self.size,
            field_rad: self.field.to_radians(),
            height_m: self.height.or(sensor_m).unwrap_or(PLAN_M),
        }
    }

    fn read(&self) -> Result<LoadedScene, CliError> {
        let ending = self
            .file
            .extension()
            .and_then(|ending| ending.to_str())
            .unwrap_or_default();
        if ending.eq_ignore_ascii_case("wrl") {
            self.refuse_seed()?;
            return self.shapes_alone(self.up.unwrap_or(config::Up::Z));
        }
        if self.up.is_some() {
            let wrong =
                "--up is for shapes that are shown alone (.wrl); a scene file says `up` itself";
            return Err(CliError::Usage(wrong.to_owned()));
        }
        if load::bundled_one(Some(&self.file)).is_some() {
            return self.simulated();
        }
        let text = read::text(&self.file)
            .map_err(|error| load::no_such_name(&self.file).unwrap_or(error))?;
        let loader = &mut read::around(&self.file);
        let refused = |reason: &str| CliError::Input {
            path: self.file.clone(),
            reason: reason.to_owned(),
        };
        match config::read(&read::shown(&self.file), &text, loader)? {
            Config::Scene(file) => {
                self.refuse_seed()?;
                let shapes = load::shapes_of(&file, loader)?;
                let persons = file.persons.iter().map(staging::person).collect();
                let name = file.name.clone();
                self.put_together(name, file, shapes, persons, None)
            }
            Config::Sim(_) => self.simulated(),
            Config::Venue(_) => Err(refused(
                "is a venue, and what stands there is output by a scene; \
                expected a scene, a simulation or shapes (.wrl)",
            )),
            Config::Experiment(_) => Err(refused(
                "is a grid of simulations; expected a scene, a simulation or shapes (.wrl)",
            )),
            Config::Vehicle(_) | Config::Ground(_) | Config::Operator(_) => Err(refused(
                "is the file of a node; expected a scene, a simulation or shapes (.wrl)",
            )),
        }
    }

    fn refuse_seed(&self) -> Result<(), CliError> {
        let wrong = "--seed is for a simulation, which places persons by it; a scene says itself where they stand";
        match self.seed {
            None => Ok(()),
            Some(_) => Err(CliError::Usage(wrong.to_owned())),
        }
    }

    fn simulated(&self) -> Result<LoadedScene, CliError> {
        let loaded = load::load(Some(&self.file), None)?;
        let (sim, shapes) = (loaded.sim.clone(), loaded.shapes.clone());
        let scenario = load::scenario(loaded, Some(&self.file), self.seed)?;
        let persons = scenario.persons().to_vec();
        self.put_together(
            sim.scene.name.clone(),
            sim.scene.clone(),
            shapes,
            persons,
            Some(sim),
        )
    }

    fn shapes_alone(&self, up: config::Up) -> Result<LoadedScene, CliError> {
        // Through the common way of reading first, so that a missing file is named as everywhere.
        read::text(&self.file)?;
        let shapes =
            load::read_shapes(&read::shown(&self.file), up, &mut read::around(&self.file))?;
        let stem = self
            .file
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        self.put_together(stem, SceneFile::of_shapes(up), shapes, Vec::new(), None)
    }

    fn put_together(
        &self,
        name: String,
        file: SceneFile,
        shapes: VrmlScene,
        persons: Vec<Person>,
        sim: Option<Sim>,
    ) -> Result<LoadedScene, CliError> {
        let scene =
            staging::build(&file, &shapes.shapes, &persons).map_err(|error| CliError::Input {
                path: self.file.clone(),
                reason: format!("scene: {error}"),
            })?;
        Ok(LoadedScene {
            name,
            file,
            shapes,
            persons,
            scene,
            sim,
        })
    }
}

fn parse_pose(text: &str) -> Result<Viewpoint, String> {
    let expected = "expected X,Y,Z,YAW or X,Y,Z,YAW,PITCH: metres up to 100000, degrees, a pitch from -90 to 90";
    let parts: Result<Vec<f64>, _> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>())
        .collect();
    let (at, yaw_degrees, pitch_degrees) = match parts.as_deref() {
        Ok([x, y, z, yaw]) => ([*x, *y, *z], *yaw, 0.0),
        Ok([x, y, z, yaw, pitch]) => ([*x, *y, *z], *yaw, *pitch),
        Ok(_) | Err(_) => return Err(expected.to_owned()),
    };
    let is_near = at.iter().all(|part| part.abs() <= 1e5) && yaw_degrees.abs() <= 1e5;
    if !is_near || !(-90.0..=90.0).contains(&pitch_degrees) {
        return Err(expected.to_owned());
    }
    Ok(Viewpoint {
        at,
        yaw: Angle::from_degrees(yaw_degrees),
        pitch_rad: pitch_degrees.to_radians(),
    })
}

fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let sides = text
        .split_once(['x', 'X'])
        .and_then(|(wide, high)| Some((wide.parse().ok()?, high.parse().ok()?)));
    sides
        .filter(|(wide, high)| SIDES_PX.contains(wide) && SIDES_PX.contains(high))
        .ok_or_else(|| "expected WIDTHxHEIGHT such as 960x600, 16 to 2048 pixels each".to_owned())
}

fn parse_field(text: &str) -> Result<f64, String> {
    let degrees = text
        .parse()
        .ok()
        .filter(|degrees| (5.0..=150.0).contains(degrees));
    degrees.ok_or_else(|| "expected 5 to 150 degrees".to_owned())
}

fn parse_height(text: &str) -> Result<f64, String> {
    let metres = text.parse().ok().filter(|metres: &f64| metres.abs() <= 1e4);
    metres.ok_or_else(|| "expected metres from -10000 to 10000".to_owned())
}

fn parse_up(text: &str) -> Result<config::Up, String> {
    match text {
        "y" | "Y" => Ok(config::Up::Y),
        "z" | "Z" => Ok(config::Up::Z),
        _ => Err("expected y or z".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn args(file: &Path, out: &Path) -> SceneArgs {
        SceneArgs {
            file: file.to_owned(),
            out: Some(out.to_owned()),
            pose: None,
            size: (64, 40),
            field: 60.0,
            height: None,
            up: None,
            seed: None,
        }
    }

    fn run(args: &SceneArgs) -> Result<String, CliError> {
        let mut out = Vec::new();
        args.run(&mut out).map(|()| String::from_utf8(out).unwrap())
    }

    fn bundled(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
    }

    #[test]
    fn scenes_simulations_and_shapes_are_described_and_drawn() {
        let folder = tempfile::tempdir().unwrap();
        for (file, words) in [
            (
                "configs/courtyard.sim.toml",
                vec!["scene courtyard", "Wall: 20 dB/m", "person 2", "8 homes"],
            ),
            (
                "scenes/house.scene.toml",
                vec![
                    "scene house",
                    "Window: 0 dB/m, 3 dB a crossing, #7fb2cc; 6 shapes",
                ],
            ),
            (
                "scenes/courtyard.wrl",
                vec!["scene courtyard", "2 shapes", "NorthArm"],
            ),
        ] {
            let out = folder.path().join(file.replace('/', "-"));
            let text = run(&args(&bundled(file), &out)).unwrap();
            for word in words {
                assert!(text.contains(word), "{word} is missing in:\n{text}");
            }
            for picture in FAMILY.names {
                assert_eq!(&std::fs::read(out.join(picture)).unwrap()[1..4], b"PNG");
            }
        }
    }

    #[test]
    fn what_is_no_scene_is_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let check = |name: &str, text: &str, words: &str| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).unwrap();
            let error = run(&args(&file, &out)).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(words), "{error}");
            assert!(!out.exists());
        };
        let mut turned = args(&bundled("scenes/castle.scene.toml"), &out);
        turned.up = Some(config::Up::Y);
        let said = run(&turned).unwrap_err().to_string();
        assert!(said.contains("a scene file says `up` itself"), "{said}");
        let mut seeded = args(&bundled("scenes/castle.scene.toml"), &out);
        seeded.seed = Some(3);
        let said = run(&seeded).unwrap_err().to_string();
        assert!(said.contains("--seed is for a simulation"), "{said}");
        let said = run(&args(Path::new("castel"), &out))
            .unwrap_err()
            .to_string();
        assert!(said.contains("did you mean castle?"), "{said}");
        let venue = std::fs::read_to_string(bundled("configs/castle.venue.toml")).unwrap();
        check("v.toml", &venue, "is a venue");
        let buried =
            "#VRML V2.0 utf8\nTransform { translation 0 0 -3 children Shape { geometry Box {} } }";
        check(
            "b.wrl",
            buried,
            "the highest point of the whole scene is at -2.00 m",
        );
        let huge = "#VRML V2.0 utf8\nShape { geometry ElevationGrid {\nxDimension 40000 zDimension 25000 } }";
        check(
            "h.wrl",
            huge,
            "h.wrl:2: an ElevationGrid of 40000 x 25000 = 1000000000 points",
        );
        check(
            "s.toml",
            "kind = \"scene\"\nwrl = \"gone.wrl\"\n",
            "gone.wrl: cannot be read",
        );
        check(
            "s.toml",
            "kind = \"scene\"\n[[object]]\noutline_m = [[0, 0]]\ncolour = \"red\"\n",
            "colour = \"red\"",
        );
        assert!(run(&args(&folder.path().join("gone.toml"), &out)).is_err());
    }

    #[test]
    fn poses_and_sizes_are_read_or_refused() {
        let pose = parse_pose("1, -2,0.3,90,-15").unwrap();
        assert_eq!(
            (pose.at, pose.yaw),
            ([1.0, -2.0, 0.3], Angle::from_degrees(90.0))
        );
        assert!((pose.pitch_rad + 15f64.to_radians()).abs() < 1e-12);
        assert_eq!(parse_pose("1,2,3,4").unwrap().pitch_rad, 0.0);
        for bad in [
            "",
            "1,2,3",
            "1,2,3,4,5,6",
            "1,2,x,4",
            "nan,0,0,0",
            "1e9,0,0,0",
            "0,0,0,inf",
            "0,0,0,0,91",
        ] {
            assert!(parse_pose(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_size("64x32"), Ok((64, 32)));
        for bad in [
            "64", "64x", "x", "0x10", "15x16", "5000x100", "64x32x1", "-64x32", "1e2x50",
        ] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        assert!(
            parse_field("nan").is_err() && parse_field("4").is_err() && parse_field("150").is_ok()
        );
        assert!(parse_height("nan").is_err() && parse_height("-1") == Ok(-1.0));
    }
}
