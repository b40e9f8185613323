//! `tomoswarm image --layers N`: an image in three dimensions, of links whose ends have heights.
//!
//! Files in, files out; the work is done by `tomo::reconstruct_volume`.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::slice;

use serde_json::json;

use super::error::CliError;
use super::image::{ImageCommand, bounds, print, read_with};
use super::image_checks::warning_of_itself;
use super::image_settings::warning_of_part;
use super::image_text::{LEAST_SHOWN, dropped_in_words};
use super::image_values::SolverName;
use super::outputs::{PendingFile, about, choice_json, dropped_json, solver_json};
use super::progress_bar::with_steps;
use super::recording::{Recording, read_recording};
use super::standard_output::complain;
use crate::config::SourceFile;
use crate::draw::{DrawError, HeatMap, Picture, described};
use crate::geom::{PixelGrid, Point, Rect};
use crate::tomo::{
    DropReason, DroppedLinks, ImagingSettings, Link, MOST_VOLUME_LINKS, MOST_VOXELS, NoiseModel,
    Solver, Volume, VolumeError, VolumeLink, VoxelGrid, floor_dbm, reconstruct_volume,
};

/// Voxels along the longer side, unless it is said.
const VOXELS: f64 = 20.0;
/// Standard deviation of a packet, and of a link between two sweeps, dB.
const PACKET_SD_DB: f64 = 2.5;
const LINK_SD_DB: f64 = 1.1;
/// Layers beside each other in the picture.
const BESIDE: usize = 3;
/// Most layers that are drawn: each takes some megabytes.
const MOST_DRAWN: usize = 100;

/// Reads two recordings with heights, makes the volume, writes it, and prints a summary.
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
    let now = read(&command.files, "FILE", &mut made_from)?;
    let empty = read(&command.empty, "--empty", &mut made_from)?;
    if let [of_now, of_empty] = &made_from[..] {
        let warning = warning_of_itself(slice::from_ref(of_now), slice::from_ref(of_empty));
        warning.iter().for_each(|warning| complain(warning));
    }
    let (links, mut dropped) = calibrated(&now, &empty);
    let refused = |reason: String| CliError::Input {
        path: command.files[0].clone(),
        reason,
    };
    if links.is_empty() {
        let reason =
            "found no link that the empty sweep has as well, expected the same places in both";
        return Err(refused(reason.to_owned()));
    }
    command.check_partners(links.len(), &dropped)?;
    command.check_links(links.len(), &dropped)?;
    let grid = grid_of(command, &now, layers)?;
    if let Some(warning) = warning_of_part(command.area, bounds(now.links.iter())) {
        complain(&warning);
    }
    let solver = solver_of(command, area_of(&grid));
    let made = with_steps(|watch| reconstruct_volume(&links, grid, &solver, watch));
    let volume = made.map_err(|problem| refused(why_no_volume(problem, &grid)))?;
    if volume.used < links.len() {
        dropped.insert(DropReason::OutsideArea, links.len() - volume.used);
    }
    command.check_links(volume.used, &dropped)?;
    let files = filled(command, &volume, &solver, &dropped, &made_from)?;
    let [x_m, y_m, z_m] = grid.centre(volume.strongest());
    let strongest = match volume.values[volume.strongest()] {
        none if none < LEAST_SHOWN => format!("nothing reaches {LEAST_SHOWN} dB/m"),
        some => format!("strongest at ({x_m:.2}, {y_m:.2}, {z_m:.2}) m: {some:.2} dB/m"),
    };
    let chosen = match &volume.choice {
        Some(choice) => choice.words() + "\n",
        None => String::new(),
    };
    let text = format!(
        "links: {}, {} used, residual {:.2} dB\n{}{chosen}{strongest}\n",
        volume.used + dropped.values().sum::<usize>(),
        volume.used,
        volume.residual_rms_db,
        dropped_in_words(&dropped, "0 m")
    );
    // A command that ends with an error leaves no file.
    print(out, &text)?;
    Ok(files.into_iter().try_for_each(PendingFile::finish)?)
}

/// Returns how a volume of an area is found.
fn solver_of(command: &ImageCommand, area: Rect) -> Solver {
    let mut settings = ImagingSettings::for_change(area);
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

/// Reads the one recording of a sweep, which must have heights.
fn read(
    paths: &[PathBuf],
    option: &str,
    made_from: &mut Vec<SourceFile>,
) -> Result<Recording, CliError> {
    let [path] = paths else {
        let reason = format!(
            "--layers: found {} recordings as {option}, expected one",
            paths.len()
        );
        return Err(CliError::Usage(reason));
    };
    let recording = read_with(path, made_from, |text| read_recording(text.as_bytes()))?;
    if recording.heights_m.len() != recording.links.len() {
        let reason = match recording.is_of_samples {
            true => {
                "found samples, expected links with the columns tx_z_m and rx_z_m: --layers compares links between the very \
                 same places in both sweeps, and takes no samples"
            }
            false => "found links without heights, expected the columns tx_z_m and rx_z_m",
        };
        return Err(CliError::Input {
            path: path.clone(),
            reason: reason.to_owned(),
        });
    }
    Ok(recording)
}

type Key = [[i64; 3]; 2];

/// Returns both ends of the links of a recording, with which millimetres they stand at, whichever comes first.
fn ends(recording: &Recording) -> impl Iterator<Item = ([[f64; 3]; 2], Key)> + '_ {
    let of_link = move |(index, (from_z_m, to_z_m)): (usize, &(f64, f64))| {
        let link = &recording.links[index];
        let ends = [
            [link.from.x_m, link.from.y_m, *from_z_m],
            [link.to.x_m, link.to.y_m, *to_z_m],
        ];
        let mut key = ends.map(|end| end.map(|metres| libm::round(metres * 1e3) as i64));
        key.sort_unstable();
        (ends, key)
    };
    recording.heights_m.iter().enumerate().map(of_link)
}

/// What was measured between two places.
struct Pooled {
    ends: [[f64; 3]; 2],
    key: Key,
    /// Of all that was heard and missed there; its ends are those of the first.
    link: Link,
}

/// Returns what was measured between places, in the order in which they come first, and which of it is whose; what comes again
/// is pooled by its packets.
fn pooled(recording: &Recording) -> (Vec<Pooled>, BTreeMap<Key, usize>) {
    let (mut all, mut indices): (Vec<Pooled>, BTreeMap<Key, usize>) = (Vec::new(), BTreeMap::new());
    for (link, (ends, key)) in recording.links.iter().zip(ends(recording)) {
        let index = *indices.entry(key).or_insert(all.len());
        match all.get_mut(index) {
            Some(known) => {
                let Link { from, to, .. } = known.link;
                known.link = known.link.pooled(&Link { from, to, ..*link });
            }
            None => all.push(Pooled {
                ends,
                key,
                link: *link,
            }),
        }
    }
    (all, indices)
}

/// Returns what the links have lost that were measured in both sweeps between the same places, and how many were not.
fn calibrated(now: &Recording, empty: &Recording) -> (Vec<VolumeLink>, DroppedLinks) {
    let recorded = now.imaging.as_ref();
    let usual_dbm = NoiseModel::default().sensitivity_dbm;
    let sensitivity_dbm = recorded.map_or(usual_dbm, |file| file.reception.sensitivity_dbm);
    let ((now, _), (empty, partners)) = (pooled(now), pooled(empty));
    let (mut links, mut dropped) = (Vec::new(), DroppedLinks::new());
    let all = now.iter().chain(&empty).map(|one| &one.link);
    let floor_dbm = floor_dbm(all, sensitivity_dbm);
    for one in &now {
        let partner = partners.get(&one.key).map(|index| &empty[*index]);
        match lost(one, partner, floor_dbm) {
            Ok(link) => links.push(link),
            Err(reason) => *dropped.entry(reason).or_default() += 1,
        }
    }
    (links, dropped)
}

/// Returns what a link has lost, as an image of pixels takes it.
fn lost(now: &Pooled, partner: Option<&Pooled>, floor_dbm: f64) -> Result<VolumeLink, DropReason> {
    let strength = |one: &Pooled| one.link.censored(floor_dbm, PACKET_SD_DB);
    let now_is = strength(now).ok_or(DropReason::NeverHeard)?;
    let partner = partner.ok_or(DropReason::NoEmptyPartner)?;
    let empty_is = strength(partner).ok_or(DropReason::NoEmptyPartner)?;
    if now.link.is_silent() && partner.link.is_silent() {
        return Err(DropReason::SilentBefore);
    }
    let packets = 1.0 / now_is.packets + 1.0 / empty_is.packets;
    Ok(VolumeLink {
        from_m: now.ends[0],
        to_m: now.ends[1],
        attenuation_db: empty_is.mean_dbm - now_is.mean_dbm,
        sd_db: (PACKET_SD_DB * PACKET_SD_DB * packets + LINK_SD_DB * LINK_SD_DB).sqrt(),
        is_at_floor: now.link.is_silent(),
    })
}

fn area_of(grid: &VoxelGrid) -> Rect {
    let corner = |at: [f64; 3]| Point::new(at[0], at[1]);
    Rect::new(corner(grid.low_m), corner(grid.high_m))
}

fn grid_of(command: &ImageCommand, now: &Recording, layers: usize) -> Result<VoxelGrid, CliError> {
    let around = || bounds(now.links.iter());
    let area = command.area.or(now.area).unwrap_or_else(around);
    let heights = || {
        now.heights_m
            .iter()
            .flat_map(|(from_m, to_m)| [*from_m, *to_m])
    };
    let low_m = heights().fold(f64::INFINITY, f64::min);
    let high_m = heights().fold(f64::NEG_INFINITY, f64::max);
    let longer_m = area.width_m().max(area.height_m());
    let count = |side_m: f64| (libm::round(VOXELS * side_m / longer_m) as usize).max(1);
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
        return Err(CliError::Input {
            path: command.files[0].clone(),
            reason,
        });
    }
    let usual = (count(area.width_m()), count(area.height_m()));
    let (columns, rows) = command.pixels.unwrap_or(usual);
    Ok(VoxelGrid {
        low_m: [area.min.x_m, area.min.y_m, low_m],
        high_m: [area.max.x_m, area.max.y_m, high_m],
        counts: [columns, rows, layers],
    })
}

/// Returns the files that are asked for, written, under temporary names.
fn filled(
    command: &ImageCommand,
    volume: &Volume,
    solver: &Solver,
    dropped: &DroppedLinks,
    made_from: &[SourceFile],
) -> Result<Vec<PendingFile>, CliError> {
    let mut files = Vec::new();
    type Bytes<'a> = &'a dyn Fn() -> Result<Vec<u8>, CliError>;
    let mut add = |path: &Option<PathBuf>, bytes: Bytes<'_>| -> Result<(), CliError> {
        let Some(path) = path else { return Ok(()) };
        let mut file = PendingFile::open(path)?;
        file.fill(&bytes()?)?;
        files.push(file);
        Ok(())
    };
    add(&command.npy, &|| Ok(npy(volume)))?;
    add(&command.png, &|| {
        let slices = slices(volume).map_err(|error| CliError::Fault(error.to_string()))?;
        Ok(described(slices, &about(made_from)))
    })?;
    add(&command.json, &|| {
        let grid = volume.grid;
        let strongest = volume.strongest();
        let report = json!({
            "links": volume.used,
            "dropped": dropped_json(dropped),
            "residual_db": volume.residual_rms_db,
            "solver": solver_json(solver),
            "choice": volume.choice.as_ref().map(choice_json),
            "low_m": grid.low_m,
            "high_m": grid.high_m,
            "voxels": grid.counts,
            "strongest": { "at_m": grid.centre(strongest), "strength": volume.values[strongest] },
            "version": env!("CARGO_PKG_VERSION"),
            "made_from": made_from,
        });
        Ok(format!("{report:#}\n").into_bytes())
    })?;
    Ok(files)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_paired_by_their_places_whichever_end_comes_first() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,4,-66\n0,5,1,9,5,2,4,-60\n0,0,1,9,0,3,4,-61\n");
        let empty = recorded("9,0,2,0,0,1,4,-60\n0,5,1,9,5,2,4,-60\n");
        let (links, dropped) = calibrated(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        assert_eq!(losses, [6.0, 0.0]);
        let expected = DroppedLinks::from([(DropReason::NoEmptyPartner, 1)]);
        assert_eq!(dropped, expected);
        assert_eq!(links[0].to_m, [9.0, 0.0, 2.0]);
    }

    #[test]
    fn links_that_come_again_are_pooled_by_their_packets_in_both_sweeps() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,1,-70\n9,0,2,0,0,1,3,-66\n");
        let empty = recorded("0,0,1,9,0,2,6,-60\n0,5,1,9,5,2,4,-60\n9,0,2,0,0,1,2,-64\n");
        let (links, _) = calibrated(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        assert_eq!(losses, [6.0]);
        let square_db2 =
            PACKET_SD_DB * PACKET_SD_DB * (1.0 / 4.0 + 1.0 / 8.0) + LINK_SD_DB * LINK_SD_DB;
        assert!((links[0].sd_db - square_db2.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_link_that_was_silenced_has_lost_what_it_had_above_the_floor() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm,misses\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,0,,7\n0,5,1,9,5,2,2,-70,6\n0,9,1,9,9,2,0,,1\n");
        let empty = recorded("9,0,2,0,0,1,4,-60,0\n0,5,1,9,5,2,4,-60,0\n0,9,1,9,9,2,4,-60,0\n");
        let (links, dropped) = calibrated(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        // 0.906⁷ = ½, and Φ(1.315) = 0.906. Six of eight packets that are missed 25 dB above the floor have collided.
        let expected = [35.0 + 1.315 * PACKET_SD_DB, 10.0];
        assert!(
            losses.len() == 2
                && losses
                    .iter()
                    .zip(expected)
                    .all(|(lost, of)| (lost - of).abs() < 0.01),
            "{losses:?}"
        );
        assert_eq!(dropped, DroppedLinks::from([(DropReason::NeverHeard, 1)]));
    }
}
