//! `tomoswarm image --layers N`: an image in three dimensions, of links or samples whose ends have heights.
//!
//! Files in, files out; the work is done by `tomo::reconstruct_volume`, of what [`super::volume_links`] has read.

use std::io::Write;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::counted::counted;
use super::error::CliError;
use super::image::{ImageCommand, print};
use super::image_settings::warning_of_part;
use super::image_text::{LEAST_SHOWN, dropped_in_words, offsets_in_words};
use super::image_values::SolverName;
use super::outputs::{PendingFile, about, choice_json, dropped_json, solver_json};
use super::progress_bar::with_steps;
use super::reference::Reference;
use super::standard_output::complain;
use super::volume_links::{Sweeps, VolumeInput};
use crate::config::SourceFile;
use crate::draw::{DrawError, HeatMap, Picture, described};
use crate::geom::{PixelGrid, Point, Rect};
use crate::tomo::{
    DropReason, ImagingSettings, MOST_VOLUME_LINKS, MOST_VOXELS, Solver, Volume, VolumeError,
    VoxelGrid, reconstruct_volume,
};

/// Voxels along the longer side, unless it is said.
const VOXELS: f64 = 20.0;
/// Layers beside each other in the picture.
const BESIDE: usize = 3;
/// Most layers that are drawn: each takes some megabytes.
const MOST_DRAWN: usize = 100;

/// Reads recordings with heights, makes the volume, writes it, and prints a summary.
///
/// # Errors
/// Recordings without heights or a partner, what no volume has, and files that cannot be read or written.
pub(super) fn run(
    command: &ImageCommand,
    layers: usize,
    out: &mut dyn Write,
) -> Result<(), CliError> {
    check_options(command, layers)?;
    let mut made_from = Vec::new();
    let mut input = Sweeps::read(command, &mut made_from)?.calibrated(command);
    check_input(command, &input)?;
    let grid = grid_of(command, &input, layers)?;
    if let Some(warning) = warning_of_part(command.area, input.ring) {
        complain(&warning);
    }
    let solver = solver_of(command, area_of(&grid));
    let made =
        with_steps(|watch| reconstruct_volume(&input.links, input.law, grid, &solver, watch));
    let volume = made.map_err(|problem| refused(command, why_no_volume(problem, &grid)))?;
    if volume.used < input.links.len() {
        let outside = input.links.len() - volume.used;
        input.dropped.insert(DropReason::OutsideArea, outside);
    }
    command.check_links(volume.used, &input.dropped)?;
    let made = Made {
        volume: &volume,
        solver: &solver,
        input: &input,
        made_from: &made_from,
    };
    let files = made.filled(command)?;
    // A command that ends with an error leaves no file.
    print(out, &made.summary())?;
    Ok(files.into_iter().try_for_each(PendingFile::finish)?)
}

/// Refuses the recordings of a sweep.
fn refused(command: &ImageCommand, reason: String) -> CliError {
    CliError::Input {
        path: command.files[0].clone(),
        reason,
    }
}

/// Checks that there are links to make a volume of.
fn check_input(command: &ImageCommand, input: &VolumeInput) -> Result<(), CliError> {
    let used = input.links.len();
    if used == 0 && input.dropped.contains_key(&DropReason::NoEmptyPartner) {
        let reason =
            "found no link that the empty sweep has as well, expected the same places in both";
        return Err(refused(command, reason.to_owned()));
    }
    command.check_partners(used, &input.dropped)?;
    command.check_links(used, &input.dropped)
}

/// Returns how a volume of an area is found.
fn solver_of(command: &ImageCommand, area: Rect) -> Solver {
    let mut settings = match command.empty.is_empty() {
        true => ImagingSettings::for_area(area),
        false => ImagingSettings::for_change(area),
    };
    command
        .solver
        .unwrap_or(SolverName::Auto)
        .choose(&mut settings);
    settings.solver
}

/// Returns why there is no volume, and which limit is exceeded.
fn why_no_volume(problem: VolumeError, grid: &VoxelGrid) -> String {
    match problem {
        VolumeError::TooManyVoxels => {
            let [columns, rows, layers] = grid.counts;
            format!(
                "found {columns} x {rows} x {layers} = {} voxels, expected at most {MOST_VOXELS}: fewer --layers or --pixels",
                grid.voxels()
            )
        }
        VolumeError::NoLinks => "found no link through the volume, expected several".to_owned(),
        VolumeError::TooManyLinks { links } => format!(
            "found {links} links through the volume, expected at most {MOST_VOLUME_LINKS} with --layers: a part of the \
             recording, or a smaller --area"
        ),
        VolumeError::Persons | VolumeError::NoAnswer => {
            "found links whose numbers leave no volume, expected strengths and places of a usual size".to_owned()
        }
    }
}

/// Refuses what volumes do not have, and a picture of too many layers.
fn check_options(command: &ImageCommand, layers: usize) -> Result<(), CliError> {
    if command.png.is_some() && layers > MOST_DRAWN {
        return Err(CliError::Usage(format!(
            "--png: found {layers} layers, expected at most {MOST_DRAWN} in a picture; --npy holds all"
        )));
    }
    let given = [
        (
            "--solver points",
            command.solver == Some(SolverName::Points),
        ),
        ("--weights", command.weights.is_some()),
        ("--why", command.why.is_some()),
        ("--peaks", command.peaks.is_some()),
        ("--false-finds", command.false_finds.is_some()),
        ("--cell", command.cell.is_some()),
        ("--deviation", command.deviation.is_some()),
        ("--coverage", command.coverage.is_some()),
        ("--links", command.links.is_some()),
        ("--residuals", command.residuals.is_some()),
        ("--progress", command.progress.is_some()),
        ("--venue", command.venue.is_some()),
        ("--nodes", command.nodes.is_some()),
    ];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(CliError::Usage(format!("{option} is not for --layers"))),
        None => Ok(()),
    }
}

fn area_of(grid: &VoxelGrid) -> Rect {
    let corner = |at: [f64; 3]| Point::new(at[0], at[1]);
    Rect::new(corner(grid.low_m), corner(grid.high_m))
}

fn grid_of(
    command: &ImageCommand,
    input: &VolumeInput,
    layers: usize,
) -> Result<VoxelGrid, CliError> {
    let area = command.area.unwrap_or(input.area);
    let (low_m, high_m) = input.heights_m;
    let longer_m = area.width_m().max(area.height_m());
    let count = |side_m: f64| (libm::round(VOXELS * side_m / longer_m) as usize).max(1);
    let least_m = input.bin_m.unwrap_or(0.0);
    if high_m - low_m < least_m {
        return Err(refused(
            command,
            format!(
                "found all ends {low_m:.2} to {high_m:.2} m high, expected altitudes at least {least_m:.2} m apart: at one altitude \
                 nothing tells how high something is"
            ),
        ));
    }
    let flat = (
        area.width_m() > 0.0 && area.height_m() > 0.0,
        high_m > low_m,
    );
    if flat != (true, true) {
        let reason = format!(
            "found links within {} x {} x {} m, expected a volume",
            area.width_m(),
            area.height_m(),
            high_m - low_m
        );
        return Err(refused(command, reason));
    }
    let usual = (count(area.width_m()), count(area.height_m()));
    let (columns, rows) = command.pixels.unwrap_or(usual);
    Ok(VoxelGrid {
        low_m: [area.min.x_m, area.min.y_m, low_m],
        high_m: [area.max.x_m, area.max.y_m, high_m],
        counts: [columns, rows, layers],
    })
}

/// A volume and where it comes from.
struct Made<'a> {
    volume: &'a Volume,
    solver: &'a Solver,
    input: &'a VolumeInput,
    made_from: &'a [SourceFile],
}

impl Made<'_> {
    /// Returns the files that are asked for, written, under temporary names.
    fn filled(&self, command: &ImageCommand) -> Result<Vec<PendingFile>, CliError> {
        let mut files = Vec::new();
        type Bytes<'a> = &'a dyn Fn() -> Result<Vec<u8>, CliError>;
        let mut add = |path: &Option<PathBuf>, bytes: Bytes<'_>| -> Result<(), CliError> {
            let Some(path) = path else { return Ok(()) };
            let mut file = PendingFile::open(path)?;
            file.fill(&bytes()?)?;
            files.push(file);
            Ok(())
        };
        add(&command.npy, &|| Ok(npy(self.volume)))?;
        add(&command.png, &|| {
            let slices = slices(self.volume).map_err(|error| CliError::Fault(error.to_string()))?;
            Ok(described(slices, &about(self.made_from)))
        })?;
        add(&command.json, &|| {
            Ok(format!("{:#}\n", self.report()).into_bytes())
        })?;
        Ok(files)
    }

    /// Returns what the JSON output holds.
    fn report(&self) -> Value {
        let Made { volume, input, .. } = self;
        let (grid, strongest) = (volume.grid, volume.strongest());
        let samples =
            |(read, repeated): (usize, usize)| json!({"read": read, "repeated": repeated});
        json!({
            "links": volume.used,
            "dropped": dropped_json(&input.dropped),
            "samples": input.samples.map(samples),
            "bin_m": input.bin_m,
            "reference": self.reference().map(Reference::to_json),
            "residual_db": volume.residual_rms_db,
            "solver": solver_json(self.solver),
            "choice": volume.choice.as_ref().map(choice_json),
            "low_m": grid.low_m,
            "high_m": grid.high_m,
            "voxels": grid.counts,
            "layers_without_links": self.layers_without_links(),
            "strongest": { "at_m": grid.centre(strongest), "strength": volume.values[strongest] },
            "version": env!("CARGO_PKG_VERSION"),
            "made_from": self.made_from,
        })
    }

    /// Returns what is printed.
    fn summary(&self) -> String {
        let Made { volume, input, .. } = self;
        let [x_m, y_m, z_m] = volume.grid.centre(volume.strongest());
        let strongest = match volume.values[volume.strongest()] {
            none if none < LEAST_SHOWN => format!("nothing reaches {LEAST_SHOWN} dB/m\n"),
            some => format!("strongest at ({x_m:.2}, {y_m:.2}, {z_m:.2}) m: {some:.2} dB/m\n"),
        };
        let samples = input.samples.map(|(read, repeated)| match repeated {
            0 => format!("samples: {read}\n"),
            _ => format!("samples: {read}, {repeated} given again and left out\n"),
        });
        let links = format!(
            "links: {}, {} used, residual {:.2} dB\n",
            volume.used + input.dropped.values().sum::<usize>(),
            volume.used,
            volume.residual_rms_db
        );
        let widened = input.bin_m.filter(|_| input.is_widened).map(|bin_m| {
            format!("bins of {bin_m:.2} m, since in smaller ones there are more than {MOST_VOLUME_LINKS} links\n")
        });
        let shortest = format!("{:.2} m", input.shortest_m);
        let chosen = volume.choice.as_ref().map(|choice| choice.words() + "\n");
        let offsets = input.offsets.as_ref().map(offsets_in_words);
        [
            samples,
            widened,
            Some(links),
            Some(dropped_in_words(&input.dropped, &shortest)),
            self.reference().map(Reference::in_words),
            offsets,
            chosen,
            self.unseen_in_words(),
            Some(strongest),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Returns the layers through which no link runs, from 0 for the lowest.
    fn layers_without_links(&self) -> Vec<usize> {
        let grid = self.volume.grid;
        let last = grid.counts[2] - 1;
        let layer_of = |height_m: f64| {
            let layers = (height_m - grid.low_m[2]) / grid.side_m(2);
            (layers.max(0.0) as usize).min(last)
        };
        let mut is_crossed = vec![false; last + 1];
        for link in &self.input.links {
            let (a, b) = (layer_of(link.from_m[2]), layer_of(link.to_m[2]));
            is_crossed[a.min(b)..=a.max(b)].fill(true);
        }
        (0..=last).filter(|layer| !is_crossed[*layer]).collect()
    }

    fn unseen_in_words(&self) -> Option<String> {
        let unseen = self.layers_without_links();
        let count = counted(unseen.len(), "layer");
        (!unseen.is_empty()).then(|| {
            let layers: Vec<String> = unseen.iter().map(|layer| (layer + 1).to_string()).collect();
            format!(
                "no link runs through {count} of {}, counted from the lowest: {}; what stands there is not seen\n",
                self.volume.grid.counts[2],
                layers.join(", ")
            )
        })
    }

    fn reference(&self) -> Option<Reference> {
        Reference::of(self.input.empty, self.input.law)
    }
}

/// Returns the values for NumPy: f32, layers from below, rows from the south, columns from the west.
fn npy(volume: &Volume) -> Vec<u8> {
    let [columns, rows, layers] = volume.grid.counts;
    crate::tomo::npy_of(&format!("{layers}, {rows}, {columns}"), &volume.values)
}

/// Returns a picture of all layers in the same colours, the lowest first.
fn slices(volume: &Volume) -> Result<Vec<u8>, DrawError> {
    let [columns, rows, layers] = volume.grid.counts;
    let top = volume.values.iter().copied().fold(0.0, f64::max);
    let grid = PixelGrid {
        area: area_of(&volume.grid),
        columns,
        rows,
    };
    let slice = |layer: usize| {
        let low_m = volume.grid.low_m[2] + layer as f64 * volume.grid.side_m(2);
        Picture::of_heat(&HeatMap {
            title: format!("{low_m:.2} to {:.2} m high", low_m + volume.grid.side_m(2)),
            grid,
            values: volume.layer(layer),
            unit: "dB/m",
            length_unit: "m",
            overlays: Vec::new(),
            range: (top > 0.0).then_some((0.0, top)),
        })
    };
    let all = (0..layers)
        .map(slice)
        .collect::<Result<Vec<Picture>, _>>()?;
    Picture::tiled(&all, BESIDE)
}
