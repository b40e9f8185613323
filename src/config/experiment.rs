//! An experiment: a grid of simulations (mission × scene × safety distance × cell × size × sensor × vehicles × seeds).
//!
//! Every value of an axis is laid over the simulation file (or its venue) *before* the ordinary reader checks it, so
//! that each cell of the grid is a wholly checked [`Sim`]. Nothing is run here, and no text is kept: files are asked for
//! whenever a cell is made.
//!
//! A **safety distance** is measured as the thesis's vehicle, a point with a sensor, measured it: from the middle of the
//! vehicle to the nearest surface. So `padding_m` = safety distance − `radius_m`.

mod file;

pub use file::MOST_RUNS;
use file::{CELLS, ExperimentFile, Given, SAFETY, SIZES, SceneRow, Seeds, Variant, stem};

use super::keys::{Keyed, Keys, read_table, read_values};
use super::overlay::{Layer, OverlaidText, Overlay};
use super::section::Section;
use super::source::Source;
use super::vehicle::BodySpec;
use super::venue::Venue;
use super::{Loader, Problem, Problems, Sim, beside, read_kind, read_kind_over, vehicle};
use crate::geom::{Point, Rect, without_dust};

/// What is varied.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Axis {
    /// What the vehicles do.
    Mission,
    /// Where.
    Scene,
    /// How far the middle of a vehicle keeps from everything, metres.
    Safety,
    /// Side of a map cell, metres.
    Cell,
    /// Longer side of the area, metres.
    Size,
    /// The range sensor.
    Sensor,
    /// How many vehicles.
    Vehicles,
    /// The seed of everything random.
    Seed,
}

impl Axis {
    /// All axes, in grid order: the last one changes fastest.
    pub const ALL: [Axis; 8] = [
        Axis::Mission,
        Axis::Scene,
        Axis::Safety,
        Axis::Cell,
        Axis::Size,
        Axis::Sensor,
        Axis::Vehicles,
        Axis::Seed,
    ];

    /// Returns its name in keys, tables and options.
    pub fn word(self) -> &'static str {
        match self {
            Axis::Mission => "mission",
            Axis::Scene => "scene",
            Axis::Safety => "safety_m",
            Axis::Cell => "cell_m",
            Axis::Size => "size_m",
            Axis::Sensor => "sensor",
            Axis::Vehicles => "vehicles",
            Axis::Seed => "seed",
        }
    }
}

/// What a value of an axis does to a simulation.
#[derive(Clone, PartialEq, Debug)]
enum Change {
    /// Nothing: the axis is not given.
    Nothing,
    Mission(Layer),
    Scene(Box<SceneChange>),
    Safety(f64),
    Cell(f64),
    Size(f64),
    Sensor(Layer),
    Vehicles(usize),
    Seed(u64),
}

/// A simulation file, and what is changed in it.
#[derive(Clone, PartialEq, Debug)]
struct SceneChange {
    sim: String,
    with: Layer,
    /// What is changed in `[mission]` for a mission of this name.
    missions: Vec<(String, Layer)>,
}

/// A value of an axis.
#[derive(Clone, PartialEq, Debug)]
struct Choice {
    name: String,
    line: usize,
    change: Change,
}

/// A grid of simulations.
#[derive(Clone, PartialEq, Debug)]
pub struct Experiment {
    /// The name of its file.
    file: String,
    keys: ExperimentFile,
    /// What follows from the keys: one list for each of [`Axis::ALL`], none empty.
    axes: Vec<Vec<Choice>>,
}

impl Keyed for Experiment {
    /// Shows the keys of its file; the grid follows from them when a file is read.
    fn keys(&mut self, to: &mut dyn Keys) {
        self.keys.keys(to);
    }
}

impl Experiment {
    /// Returns one without a file, whose keys have no values.
    pub(super) fn blank() -> Experiment {
        Experiment {
            file: String::new(),
            keys: ExperimentFile::default(),
            axes: Vec::new(),
        }
    }

    /// Reads an experiment; the simulations that it names are not read yet.
    pub(super) fn read(root: &Section) -> Experiment {
        let mut keys = ExperimentFile::default();
        read_table(&mut keys, root);
        keys.check(root);
        let axes = Axis::ALL.map(|axis| or_nothing(keys.axis(axis))).to_vec();
        let experiment = Experiment {
            file: root.source.file().to_owned(),
            keys,
            axes,
        };
        experiment.check_size(root);
        experiment.check_doubles(root);
        experiment
    }

    fn check_doubles(&self, root: &Section) {
        for choices in &self.axes {
            let mut names: Vec<&str> = choices.iter().map(|choice| choice.name.as_str()).collect();
            names.sort_unstable();
            let pairs = names.windows(2).filter(|pair| pair[0] == pair[1]);
            let mut doubles: Vec<&str> = pairs.map(|pair| pair[0]).collect();
            doubles.dedup();
            for name in doubles {
                let key = choices.first().map_or("", |choice| choice.change.key());
                root.refuse(
                    key,
                    &format!("has {name} twice"),
                    "each may stand there once",
                );
            }
        }
    }

    fn check_size(&self, root: &Section) {
        let lengths = self.axes.iter().map(|axis| axis.len() as u128);
        let runs: u128 = lengths.product();
        if runs > MOST_RUNS as u128 {
            let counts = Axis::ALL.iter().zip(&self.axes);
            let counts: Vec<String> = counts
                .map(|(axis, list)| format!("{} {}", list.len(), axis.word()))
                .collect();
            let wrong = format!("the grid has {runs} runs ({})", counts.join(" × "));
            root.refuse(
                "kind",
                &wrong,
                &format!("at most {MOST_RUNS} runs are allowed"),
            );
        }
    }

    /// Returns its plain name, fit to be part of a file's name.
    pub fn name(&self) -> &str {
        &self.keys.name
    }

    /// Returns the number of runs.
    pub fn runs(&self) -> usize {
        self.axes.iter().map(Vec::len).product()
    }

    /// Returns the number of different simulations: runs that differ in their seeds only count once.
    pub fn cells(&self) -> usize {
        self.runs() / self.seeds()
    }

    /// Returns the number of seeds.
    pub fn seeds(&self) -> usize {
        self.axes.last().map_or(1, Vec::len)
    }

    /// Returns whether an axis was given.
    pub fn has(&self, axis: Axis) -> bool {
        self.choices(axis)
            .iter()
            .any(|choice| choice.change != Change::Nothing)
    }

    /// Returns the names of an axis's values, in order; a single "-" when it was not given.
    pub fn names(&self, axis: Axis) -> Vec<&str> {
        self.choices(axis)
            .iter()
            .map(|choice| choice.name.as_str())
            .collect()
    }

    /// Returns the name of a run's value on an axis. Run `number` of cell `cell` is `cell × seeds + number`.
    pub fn name_of(&self, run: usize, axis: Axis) -> &str {
        self.choice(run, axis)
            .map_or("-", |choice| choice.name.as_str())
    }

    /// Returns the seed of a run; `None` leaves it to the file.
    pub fn seed_of(&self, run: usize) -> Option<u64> {
        let Change::Seed(seed) = self.choice(run, Axis::Seed)?.change else {
            return None;
        };
        Some(seed)
    }

    /// Returns which values a run has on the axes that were given: `mission=search scene=castle …`.
    pub fn key(&self, run: usize, with_seed: bool) -> String {
        let output = |axis: &&Axis| self.has(**axis) && (with_seed || **axis != Axis::Seed);
        let words = Axis::ALL
            .iter()
            .filter(output)
            .map(|axis| format!("{}={}", axis.word(), self.name_of(run, *axis)));
        words.collect::<Vec<_>>().join(" ")
    }

    /// Makes the simulation of a cell.
    ///
    /// # Errors
    /// Everything that is wrong with it, where it stands: in a file, or in the experiment.
    pub fn sim(&self, cell: usize, loader: &mut Loader) -> Result<Sim, Problems> {
        let run = cell * self.seeds();
        let mut laid = Laid {
            overlay: Overlay {
                file: self.file.clone(),
                ..Overlay::default()
            },
            ..Laid::default()
        };
        laid.overlay.sim.lay_all(self.keys.with());
        let mut wrong = Vec::new();
        for axis in [
            Axis::Scene,
            Axis::Mission,
            Axis::Cell,
            Axis::Sensor,
            Axis::Vehicles,
            Axis::Safety,
            Axis::Size,
        ] {
            // What cannot be laid over is left out, so that all else that is wrong is found as well.
            if let Some(choice) = self.choice(run, axis)
                && let Err(problems) = self.lay(choice, run, &mut laid, loader)
            {
                wrong.extend(problems.into_list());
            }
        }
        let sim = self.read_laid(run, &laid, loader);
        if wrong.is_empty() {
            return sim;
        }
        wrong.extend(sim.err().map(Problems::into_list).unwrap_or_default());
        Err(Problems::new(&self.file, wrong))
    }

    /// Reads a simulation with what is laid over it.
    fn read_laid(&self, run: usize, laid: &Laid, loader: &mut Loader) -> Result<Sim, Problems> {
        let text = laid.text(loader).map_err(|reason| {
            self.problem(
                self.choice(run, Axis::Scene),
                &format!("{} cannot be read: {reason}", laid.sim),
                "a simulation file is needed",
            )
        })?;
        read_kind_over(&laid.sim, &text, Some(&laid.overlay), "sim", |root| {
            Sim::read(root, None, vehicle::SWARM, loader)
        })
    }

    fn choices(&self, axis: Axis) -> &[Choice] {
        let index = Axis::ALL.iter().position(|other| *other == axis);
        index
            .and_then(|index| self.axes.get(index))
            .map_or(&[], Vec::as_slice)
    }

    /// Returns a run's value on an axis.
    fn choice(&self, run: usize, axis: Axis) -> Option<&Choice> {
        let faster = Axis::ALL.iter().filter(|other| **other > axis);
        let step: usize = faster.map(|other| self.choices(*other).len()).product();
        let choices = self.choices(axis);
        choices.get(run / step.max(1) % choices.len().max(1))
    }

    /// Lays a value over the simulation or its venue.
    fn lay(
        &self,
        choice: &Choice,
        run: usize,
        laid: &mut Laid,
        loader: &mut Loader,
    ) -> Result<(), Problems> {
        let Choice { line, change, .. } = choice;
        let Overlay { sim, venue, .. } = &mut laid.overlay;
        match change {
            Change::Nothing | Change::Seed(_) => {}
            Change::Scene(scene) => {
                laid.sim.clone_from(&scene.sim);
                sim.lay_all(&scene.with);
                let mission = self.name_of(run, Axis::Mission);
                for (_, layer) in scene.missions.iter().filter(|(name, _)| name == mission) {
                    laid.late.lay_all(layer);
                }
            }
            Change::Mission(layer) => {
                sim.clear("mission");
                sim.lay_all(&layer.under(&["mission"]));
                let late = std::mem::take(&mut laid.late);
                sim.lay_all(&late.under(&["mission"]));
            }
            Change::Cell(cell_m) => venue.lay_at("cell_m", &exact(*cell_m), *line),
            Change::Sensor(layer) => sim.lay_all(&layer.under(&["range"])),
            Change::Vehicles(count) => sim.lay_at("vehicles.count", &count.to_string(), *line),
            Change::Safety(distance_m) => {
                // A simulation that cannot be read is reported when the cell is.
                let Some(radius_m) = laid.radius_m(loader) else {
                    return Ok(());
                };
                if *distance_m < radius_m {
                    let wrong = format!("is within the vehicle, whose radius is {radius_m} m");
                    let allowed = "it is measured from the vehicle's middle: radius_m + padding_m";
                    return Err(self.problem(Some(choice), &wrong, allowed));
                }
                laid.overlay
                    .sim
                    .lay_at("safety.padding_m", &exact(distance_m - radius_m), *line);
            }
            Change::Size(size_m) => {
                // A venue that cannot be read is reported when the cell is.
                let Some(place) = laid.venue(loader) else {
                    return Ok(());
                };
                let Some(shrunk) = Shrunk::to(&place, *size_m) else {
                    let wrong = format!("is more than the area of venue {}", place.name);
                    return Err(self.problem(
                        Some(choice),
                        &wrong,
                        "a size can only make the area smaller",
                    ));
                };
                shrunk.lay_over(&mut laid.overlay.venue, *line);
            }
        }
        Ok(())
    }

    fn problem(&self, choice: Option<&Choice>, wrong: &str, allowed: &str) -> Problems {
        let (line, value) = choice.map_or((1, String::new()), |choice| {
            (choice.line, choice.name.clone())
        });
        let key = choice.map_or("", |choice| choice.change.key()).to_owned();
        let (file, wrong, allowed) = (self.file.clone(), wrong.to_owned(), allowed.to_owned());
        Problems::new(
            &self.file,
            vec![Problem {
                file,
                line,
                key,
                value,
                wrong,
                allowed,
            }],
        )
    }
}

impl Change {
    /// Returns the key of the experiment's file in which it stands.
    fn key(&self) -> &'static str {
        match self {
            Change::Nothing => "",
            Change::Mission(_) => "mission",
            Change::Scene(_) => "scene",
            Change::Safety(_) => SAFETY,
            Change::Cell(_) => CELLS,
            Change::Size(_) => SIZES,
            Change::Sensor(_) => "sensor",
            Change::Vehicles(_) => "vehicles",
            Change::Seed(_) => "seeds",
        }
    }
}

/// Returns a number as it may stand in a file, without the dust of subtractions.
fn exact(number: f64) -> String {
    format!("{:?}", without_dust(number))
}

/// A simulation file with what is laid over it so far.
#[derive(Default)]
struct Laid {
    sim: String,
    overlay: Overlay,
    /// What a scene says of the mission, which comes after the mission itself.
    late: Layer,
}

impl Laid {
    fn text(&self, loader: &mut Loader) -> Result<String, String> {
        loader(&self.sim)
    }

    /// Looks up something in the simulation file as it is so far; what is wrong with it is said later.
    fn look<T>(&self, loader: &mut Loader, read: impl FnOnce(&Section) -> T) -> Option<T> {
        let joined = OverlaidText::new(&self.text(loader).ok()?, &self.overlay.sim);
        let source = Source::over(&self.sim, &joined, &self.overlay);
        let tree = source.parse();
        Some(read(&Section::root(&source, &tree)))
    }

    /// Returns the radius of the vehicles; `None` = the simulation cannot be read.
    fn radius_m(&self, loader: &mut Loader) -> Option<f64> {
        let mut body = BodySpec::default();
        self.look(loader, |root| {
            read_values(&mut body, &root.section("vehicles"))
        })?;
        Some(body.radius_m)
    }

    fn venue(&self, loader: &mut Loader) -> Option<Venue> {
        let named = |root: &Section| {
            let named = root.text("venue")?;
            Some(beside(&root.source.file_of("venue"), &named))
        };
        let path = self.look(loader, named)??;
        let text = loader(&path).ok()?;
        read_kind(&path, &text, "venue", |root| Some(Venue::read(root))).ok()
    }
}

/// A venue made smaller: the area about its centre; what lies in it (homes, corners of the fence) keeps its share of
/// the way to the border, and what lies beyond keeps its distance from it.
struct Shrunk<'a> {
    venue: &'a Venue,
    area: Rect,
}

impl Shrunk<'_> {
    /// Makes the longer side this long; `None` when it is shorter already.
    fn to(venue: &Venue, size_m: f64) -> Option<Shrunk<'_>> {
        let area = venue.area;
        let share = size_m / area.width_m().max(area.height_m());
        let (centre, corner) = (area.centre(), area.max);
        let half = (corner - centre) * share;
        (share <= 1.0).then(|| Shrunk {
            venue,
            area: Rect::new(centre + half * -1.0, centre + half),
        })
    }

    fn moved(&self, point: Point) -> Point {
        let (old, new, centre) = (self.venue.area, self.area, self.area.centre());
        let along = |at_m: f64, centre_m: f64, old_m: f64, new_m: f64| {
            let (half_m, shorter_m, off_m) = (old_m / 2.0, new_m / 2.0, at_m - centre_m);
            let beyond_m = (off_m.abs() - half_m).max(0.0);
            centre_m + off_m.signum() * (off_m.abs().min(half_m) * shorter_m / half_m + beyond_m)
        };
        Point::new(
            along(point.x_m, centre.x_m, old.width_m(), new.width_m()),
            along(point.y_m, centre.y_m, old.height_m(), new.height_m()),
        )
    }

    fn lay_over(&self, venue: &mut Layer, line: usize) {
        let pair = |point: Point| format!("[{}, {}]", exact(point.x_m), exact(point.y_m));
        let list = |points: &[Point]| {
            let moved: Vec<String> = points
                .iter()
                .map(|point| pair(self.moved(*point)))
                .collect();
            format!("[{}]", moved.join(", "))
        };
        let Rect { min, max } = self.area;
        let numbers = [min.x_m, min.y_m, max.x_m, max.y_m].map(exact);
        venue.lay_at("area_m", &format!("[{}]", numbers.join(", ")), line);
        venue.lay_at("fence_m", &list(self.venue.fence.corners()), line);
        venue.lay_at("homes_m", &list(&self.venue.homes), line);
    }
}

impl ExperimentFile {
    /// Returns the values of an axis; nothing when it is not given.
    fn axis(&self, axis: Axis) -> Vec<Choice> {
        match axis {
            Axis::Mission => variants(&self.missions, Change::Mission),
            Axis::Scene => self.scene_axis(),
            Axis::Safety => numbers(&self.safety_distances_m, Change::Safety),
            Axis::Cell => numbers(&self.cells_m, Change::Cell),
            Axis::Size => numbers(&self.sizes_m, Change::Size),
            Axis::Sensor => variants(&self.sensors, Change::Sensor),
            Axis::Vehicles => numbers(&self.vehicles, Change::Vehicles),
            Axis::Seed => {
                let of = |seed: usize| Change::Seed(seed as u64);
                match &self.seeds {
                    Seeds::Own => Vec::new(),
                    Seeds::UpTo(count) => {
                        let seeds: Vec<Given<usize>> =
                            (1..=*count).map(|value| Given { value, line: 1 }).collect();
                        numbers(&seeds, of)
                    }
                    Seeds::These(seeds) => numbers(seeds, of),
                }
            }
        }
    }

    fn scene_axis(&self) -> Vec<Choice> {
        let of_row = |row: &SceneRow| {
            let missions = row
                .missions()
                .map(|(name, layer)| (name.clone(), layer.clone()))
                .collect();
            let sim = self.sim_of(row).unwrap_or_default();
            let change = Change::Scene(Box::new(SceneChange {
                sim,
                with: row.with(),
                missions,
            }));
            Choice {
                name: row.name.clone(),
                line: row.line,
                change,
            }
        };
        let alone = self
            .sim
            .iter()
            .filter(|_| self.scenes.is_empty())
            .map(|sim| {
                let change = SceneChange {
                    sim: sim.clone(),
                    with: Layer::default(),
                    missions: Vec::new(),
                };
                Choice {
                    name: stem(sim),
                    line: 1,
                    change: Change::Scene(Box::new(change)),
                }
            });
        alone.chain(self.scenes.iter().map(of_row)).collect()
    }
}

fn variants(rows: &[Variant], change: fn(Layer) -> Change) -> Vec<Choice> {
    let choice = |row: &Variant| Choice {
        name: row.name.clone(),
        line: row.line,
        change: change(row.keys.clone()),
    };
    rows.iter().map(choice).collect()
}

fn numbers<T: Copy + ToString>(values: &[Given<T>], change: fn(T) -> Change) -> Vec<Choice> {
    let choice = |&Given { value, line }: &Given<T>| Choice {
        name: value.to_string(),
        line,
        change: change(value),
    };
    values.iter().map(choice).collect()
}

fn or_nothing(choices: Vec<Choice>) -> Vec<Choice> {
    if !choices.is_empty() {
        return choices;
    }
    vec![Choice {
        name: "-".to_owned(),
        line: 1,
        change: Change::Nothing,
    }]
}

#[cfg(test)]
pub(in crate::config) mod tests;
