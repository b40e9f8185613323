//! How `tomoswarm image` makes an image: as the options say, else as the recording says, else as usual for what the ends of the
//! links enclose. It reads no file.

use super::image::{CELL_M, ImageCommand, bounds};
use super::image_values::SolverName;
use super::recording::{LengthUnit, Recording};
use crate::config::{Imaging, LinksFile};
use crate::geom::{PixelGrid, Rect};
use crate::ground::from_config::image_settings;
use crate::ground::imager::Subject;
use crate::tomo::{BIN_M, FindSettings, ImagingSettings, Link, ring_of};

/// Two areas have one shape when the ratios of their sides differ by less than this share.
const SAME_SHAPE: f64 = 0.01;

/// Links may end so far outside of an area of which nothing is left out, shares of the longer side of the ring.
const BESIDE_RING: f64 = 0.025;

/// Vehicles drive around nothing smaller, metres.
const SMALLEST_DRIVEN_M: f64 = 5.0;

impl ImageCommand {
    /// Returns how the image of a recording is made, whose links and those of the empty sweep are given.
    pub(super) fn settings<'a>(
        &self,
        links: impl Iterator<Item = &'a Link>,
        recording: &Recording,
    ) -> ImagingSettings {
        let mut settings = match &recording.imaging {
            Some(file) => self.as_recorded(file),
            None => self.as_usual(links, recording),
        };
        if let Some((columns, rows)) = self.pixels {
            settings.grid.columns = columns;
            settings.grid.rows = rows;
        }
        if let Some(weights) = self.weights {
            let recorded = recording.imaging.as_ref();
            let width_m = recorded.map(|file| file.imaging.width_m);
            settings.weights = weights.model(&settings, width_m);
        }
        if let Some(limit) = self.peaks {
            settings.peaks.limit = usize::from(limit);
        }
        if let Some(rate) = self.false_finds {
            settings.finds.false_per_image = rate;
        }
        settings
    }

    /// Returns the settings of a recording that says them, with another solver or another area where these are asked for. The
    /// ring stays: it is where the links end, whatever is imaged.
    fn as_recorded(&self, file: &LinksFile) -> ImagingSettings {
        let recorded = &file.imaging;
        let asked_for = self.solver.or(self.why.map(|_| SolverName::Map));
        let imaging = Imaging {
            solver: asked_for.map_or(recorded.solver, SolverName::in_files),
            ..*recorded
        };
        let sensitivity_dbm = file.reception.sensitivity_dbm;
        let mut settings = image_settings(&imaging, file.area, sensitivity_dbm, self.subject());
        if let Some(area) = self.area {
            settings.grid = grid_of(area, settings.grid);
        }
        settings
    }

    fn as_usual<'a>(
        &self,
        links: impl Iterator<Item = &'a Link>,
        recording: &Recording,
    ) -> ImagingSettings {
        let links: Vec<&Link> = links.collect();
        let enclosed = bounds(links.iter().copied());
        let ring = ring_of(links.into_iter()).unwrap_or(enclosed);
        // What is measured, and how, does not change with what is imaged of it.
        let whole = recording.area.unwrap_or(enclosed);
        let usual = match self.subject() {
            Subject::Structure => ImagingSettings::for_area(whole),
            Subject::Change => ImagingSettings::for_change(whole),
        };
        let finds = match recording.unit {
            LengthUnit::Metre => FindSettings::IN_METRES,
            LengthUnit::Cell => FindSettings::in_cells(whole, self.cell.unwrap_or(CELL_M)),
        };
        let mut settings = ImagingSettings {
            ring,
            finds,
            ..usual
        };
        if let (LengthUnit::Metre, None) = (recording.unit, &self.nodes) {
            settings.pairing_m = usual_bin_m(whole);
        }
        let solver = match self.why {
            Some(_) => SolverName::Map,
            None => SolverName::Auto,
        };
        self.solver.unwrap_or(solver).choose(&mut settings);
        if let Some(area) = self.area {
            let imaged = ImagingSettings::for_area(area);
            (settings.grid, settings.peaks) = (imaged.grid, imaged.peaks);
        }
        settings
    }

    /// Returns what is imaged.
    fn subject(&self) -> Subject {
        match self.empty.is_empty() {
            true => Subject::Structure,
            false => Subject::Change,
        }
    }
}

/// Returns a warning where an area that was asked for leaves out a part of the ring around which the links end.
pub(super) fn warning_of_part(area: Option<Rect>, ring: Rect) -> Option<String> {
    let area = area?;
    let beside_m = BESIDE_RING * ring.width_m().max(ring.height_m());
    let is_whole = area.min.x_m <= ring.min.x_m + beside_m
        && area.min.y_m <= ring.min.y_m + beside_m
        && area.max.x_m >= ring.max.x_m - beside_m
        && area.max.y_m >= ring.max.y_m - beside_m;
    let Rect { min, max } = ring;
    (!is_whole).then(|| {
        format!(
            "warning: --area leaves out a part of what the links cross, ({:.1}, {:.1}) to ({:.1}, {:.1}): what stands outside \
             is drawn inside, and persons may be found at the border where nobody stands",
            min.x_m, min.y_m, max.x_m, max.y_m
        )
    })
}

/// Returns the bins of links whose ends were driven, metres: those of the ground station, and smaller ones around an area
/// that is too small for a vehicle.
fn usual_bin_m(area: Rect) -> f64 {
    let extent_m = area.width_m().max(area.height_m());
    BIN_M * (extent_m / SMALLEST_DRIVEN_M).min(1.0)
}

/// Returns the pixels of another area than was recorded: as many where it has the same shape, else as many along the longer
/// side, and square.
fn grid_of(area: Rect, recorded: PixelGrid) -> PixelGrid {
    let ratio = |area: Rect| area.width_m() / area.height_m();
    if (ratio(area) / ratio(recorded.area) - 1.0).abs() < SAME_SHAPE {
        return PixelGrid { area, ..recorded };
    }
    let most = recorded.columns.max(recorded.rows) as f64;
    let longer_m = area.width_m().max(area.height_m());
    let count = |side_m: f64| (libm::round(most * side_m / longer_m) as usize).max(1);
    PixelGrid {
        area,
        columns: count(area.width_m()),
        rows: count(area.height_m()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::recording::{links_csv, read_recording};
    use crate::config::{Prior, Reception, Solver, Weights};
    use crate::geom::Point;
    use crate::tomo::{self, WeightModel};

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        image: ImageCommand,
    }

    const AREA: Rect = Rect {
        min: Point::new(0.0, 0.0),
        max: Point::new(20.0, 20.0),
    };

    /// A recording that says everything otherwise than is usual.
    fn file() -> LinksFile {
        let prior = |sigma_db_per_m, correlation_length_m| Prior {
            sigma_db_per_m,
            correlation_length_m,
        };
        LinksFile {
            area: AREA,
            as_measured: false,
            channel: None,
            reception: Reception {
                sensitivity_dbm: -91.0,
            },
            imaging: Imaging {
                pixels: Some((50, 30)),
                weights: Weights::InverseArea,
                width_m: 0.45,
                solver: Solver::Auto,
                bin_m: 0.25,
                prior: prior(0.4, 0.75),
                structure_prior: prior(0.6, 1.5),
                min_link_m: 2.5,
                rim_m: 1.25,
                peak_separation_m: 2.0,
                peaks: 3,
                false_finds_per_image: 0.05,
                ..Imaging::default()
            },
        }
    }

    fn settings(options: &[&str], file: Option<&LinksFile>) -> ImagingSettings {
        let links = [
            Link::fixed(Point::new(0.0, 1.0), Point::new(20.0, 20.0), 4, -60.0),
            Link::fixed(Point::new(0.0, 0.0), Point::new(20.0, 9.0), 4, -60.0),
        ];
        let text = links_csv(&links, file);
        let recording = read_recording(text.as_bytes()).unwrap();
        let words = ["image", "now.csv"]
            .into_iter()
            .chain(options.iter().copied());
        let command = Program::parse_from(words).image;
        command.settings(recording.links.iter(), &recording)
    }

    fn recorded(solver: Solver, subject: Subject) -> ImagingSettings {
        let file = file();
        let imaging = Imaging {
            solver,
            ..file.imaging
        };
        image_settings(&imaging, AREA, -91.0, subject)
    }

    #[test]
    fn another_solver_takes_the_priors_and_weights_of_the_recording() {
        let change = |options: &[&str]| {
            let all = [&["--empty", "empty.csv"], options].concat();
            settings(&all, Some(&file()))
        };
        let as_map = recorded(Solver::Map, Subject::Change);
        assert_eq!(change(&["--solver", "map"]), as_map);
        assert_eq!(change(&["--why", "3,4"]), as_map);
        let tomo::Solver::Map(prior, _) = as_map.solver else {
            panic!("{:?}", as_map.solver);
        };
        assert!((prior.variance - 0.16).abs() < 1e-9 && prior.length_m == 0.75);
        assert_eq!(as_map.weights, WeightModel::InverseArea { width_m: 0.45 });
        assert_eq!(change(&[]), recorded(Solver::Auto, Subject::Change));
        for (name, solver) in [
            ("tikhonov", Solver::Tikhonov),
            ("tsvd", Solver::Tsvd),
            ("nn", Solver::Nn),
        ] {
            assert_eq!(
                change(&["--solver", name]),
                recorded(solver, Subject::Change)
            );
        }
        let weights = change(&["--area", "5,5,10,10", "--weights", "ellipse"]).weights;
        assert_eq!(weights, WeightModel::Ellipse { width_m: 0.45 });
        let structure = settings(&["--solver", "map"], Some(&file()));
        assert_eq!(structure, recorded(Solver::Map, Subject::Structure));
    }

    #[test]
    fn without_settings_the_prior_of_map_is_that_of_what_is_imaged() {
        let usual = |options: &[&str]| settings(options, None).solver;
        let change = ["--empty", "empty.csv", "--solver", "map"];
        assert_eq!(usual(&change), ImagingSettings::for_change(AREA).solver);
        assert_eq!(usual(&change[2..]), ImagingSettings::for_area(AREA).solver);
        assert_eq!(
            usual(&["--why", "3,4"]),
            ImagingSettings::for_area(AREA).solver
        );
    }

    #[test]
    fn another_area_changes_the_pixels_alone() {
        let of = |area: &str| settings(&["--empty", "e.csv", "--area", area], Some(&file()));
        let all = recorded(Solver::Auto, Subject::Change);
        for (text, columns, rows) in [("5,5,15,15", 50, 30), ("5,5,15,10", 50, 25)] {
            let part = of(text);
            assert_eq!(
                (part.grid.columns, part.grid.rows),
                (columns, rows),
                "{text}"
            );
            assert_eq!(part.grid.area.min, Point::new(5.0, 5.0));
            assert_eq!(part.ring, AREA);
            let grid = all.grid;
            assert_eq!(ImagingSettings { grid, ..part }, all, "{text}");
        }
        let told = ["--area", "5,5,15,15", "--pixels", "7x9", "--peaks", "2"];
        let told = settings(&told, Some(&file()));
        assert_eq!(
            (told.grid.columns, told.grid.rows, told.peaks.limit),
            (7, 9, 2)
        );
    }

    #[test]
    fn an_area_that_leaves_out_a_part_of_the_ring_is_warned_of() {
        let of = |min: (f64, f64), max: (f64, f64)| {
            let area = Rect::new(Point::new(min.0, min.1), Point::new(max.0, max.1));
            warning_of_part(Some(area), AREA)
        };
        for whole in [of((0.0, 0.0), (20.0, 20.0)), of((0.3, -5.0), (30.0, 19.8))] {
            assert_eq!(whole, None);
        }
        assert_eq!(warning_of_part(None, AREA), None);
        for part in [of((5.0, 0.0), (20.0, 20.0)), of((0.0, 0.0), (20.0, 12.0))] {
            let said = part.unwrap();
            assert!(said.contains("(0.0, 0.0) to (20.0, 20.0)"), "{said}");
        }
    }

    #[test]
    fn of_a_recording_without_settings_another_area_changes_the_pixels_alone_too() {
        let whole = settings(&["--empty", "e.csv"], None);
        let part = settings(&["--empty", "e.csv", "--area", "5,5,15,10"], None);
        assert_eq!((part.grid.columns, part.grid.rows), (40, 20));
        let (grid, peaks) = (whole.grid, whole.peaks);
        assert_eq!(
            ImagingSettings {
                grid,
                peaks,
                ..part
            },
            whole
        );
        assert_eq!(whole.pairing_m, BIN_M);
        let bin_m = |side_m: f64| usual_bin_m(Rect::new(Point::default(), Point::new(side_m, 1.0)));
        assert_eq!([60.0, 6.0, 2.5].map(bin_m), [BIN_M, BIN_M, BIN_M / 2.0]);
    }

    #[test]
    fn notes_above_the_settings_of_a_links_file_do_not_hide_them() {
        let file = file();
        let links = [Link::fixed(
            Point::default(),
            Point::new(6.0, 6.0),
            4,
            -60.0,
        )];
        let text = links_csv(&links, Some(&file));
        let noted = format!("# measured on Tuesday\n\n#\n{text}");
        assert_eq!(
            read_recording(noted.as_bytes()).unwrap().imaging,
            Some(file)
        );
        let wrong = noted.replace("bin_m = ", "bin_m = -");
        let line = wrong
            .lines()
            .position(|line| line.contains("bin_m"))
            .unwrap()
            + 1;
        let said = read_recording(wrong.as_bytes()).unwrap_err().to_string();
        assert!(said.starts_with(&format!("{line}: ")), "{said}");
        let broken = noted.replace("bin_m = ", "bin_m ");
        let said = read_recording(broken.as_bytes()).unwrap_err().to_string();
        let words = "expected TOML in these comments, as a run writes it above its links";
        assert!(said.starts_with(&format!("{line}: found ")), "{said}");
        assert!(said.ends_with(words), "{said}");
        let none = read_recording(b"# a note\ntx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n0,0,6,6,-60\n");
        assert_eq!(none.unwrap().imaging, None);
    }
}
