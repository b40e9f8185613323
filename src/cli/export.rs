//! `tomoswarm export`: writes what a store holds as files for other programs. Changes nothing in the store, which may be in
//! use by a ground station.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::json;
use tomoswarm_proto::{RunId, VehicleId};

use super::earth::{extend_track, world_file};
use super::error::CliError;
use super::export_target::ExportTarget;
use super::folder::{FileFamily, OutputFolder};
use super::imaging_comments::comments;
use super::outputs::deviation_picture;
use super::pictures::{CellGrid, colour_range, drawn, heat_title, homes, marks, shown_cells};
use super::recording::links_csv;
use super::samples_csv::sample_line;
use super::stored_run;
use super::true_places::{Named, circles};
use crate::config::{self, Config, LinksFile, Venue};
use crate::dash::geojson::{Features, MadeImage};
use crate::dash::run_files::MARKS_HEADER;
use crate::draw::{HeatMap, OccupancyMap, Overlay, Picture, Placement, described};
use crate::geom::{Lattice, Point};
use crate::ground::MeasuredSample;
use crate::map::Merged;
use crate::store::ground::{GroundStore, Provenance, StoredImage, StoredMark, StoredRun};
use crate::tomo::{BIN_M, Image, LinkBins, SAMPLES_HEADER, SPOT_M, npy_bytes, utc_text};

/// The files that are not of one run.
const FAMILY: FileFamily = FileFamily {
    names: &[
        "map.png",
        "map.pgw",
        "venue.toml",
        "swarm.geojson",
        "export.json",
    ],
    mark: Some(("export.json", "\"starts\": ")),
    has_folders: false,
};

/// Write what a ground station's store holds: CSV, NPY, PNG with world files, GeoJSON.
///
/// The store is only read, also while a ground station writes it.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct ExportArgs {
    /// The store: the file that `tomoswarm ground` writes
    #[arg(value_name = "STORE")]
    pub store: PathBuf,
    /// The folder for the files; those of an earlier export are replaced (with --run of that run, and those of no run), others
    /// are left alone
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// Only this run [default: all runs]
    #[arg(long, value_name = "N")]
    pub run: Option<u32>,
}

const AFTER_HELP: &str = "\
Files, N being the run:
  run-N-samples.csv    every beacon heard or missed, with UTC and its error where known
  run-N-links.csv      pooled links as they were measured; `tomoswarm image` reads both, and images them as the ground
                       station has: above their columns stand area, sensitivity and [imaging] of its file
  run-N-marks.csv      where somebody truly stood (`tomoswarm order FILE mark X,Y`), where that was marked
  run-N-KIND.npy .png  the newest picture of each kind: change (since the empty sweep) or structure
  run-N-KIND-deviation.npy .png  how sure that picture is: the standard deviation of each pixel, dB/m, where it was computed
  map.png              what the range sensors saw
  *.pgw                world files: where a picture lies, degrees (WGS84, EPSG:4326)
  swarm.geojson        area, fence, homes, peaks, finds, marks, tracks (WGS84)
  venue.toml           the venue, as the ground station read it
  export.json          where the data come from: versions, starts, runs, the operator's notes
Tables say in a first line where they come from, \"# ...\" (comment=\"#\" in pandas), pictures in a text chunk.

Examples:
  tomoswarm export swarm.db --out data
  tomoswarm export swarm.db --out data --run 2
  tomoswarm image data/run-2-links.csv --empty data/run-1-links.csv --png again.png

Exit codes: 0 done; 2 bad usage, no store, or a folder that cannot be written.";

impl ExportArgs {
    /// Reads the store, writes all files and prints what was written.
    ///
    /// # Errors
    /// The store cannot be read, the run is not in it, or the folder cannot be written; nothing is written then.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let export = Export::of(&self.store, self.run)?;
        let mut folder = OutputFolder::prepare(&self.out, FAMILY)?;
        let is_chosen = |run: u32| self.run.is_none_or(|chosen| chosen == run);
        folder.claim(|name| run_of(name).is_some_and(is_chosen))?;
        let mut lines = export.write_to(&mut folder)?;
        let target = folder.publish()?;
        lines += &format!("written to {}\n", target.display());
        let written = out.write_all(lines.as_bytes()).and_then(|()| out.flush());
        written.map_err(|source| CliError::Write {
            path: "standard output".into(),
            source,
        })
    }
}

/// What is said of a run whose tables do not say how it is to be imaged.
const NO_SETTINGS: &str = "  this version cannot read the ground station's file in the store: \
     the tables do not say how it imaged the run\n";

/// What is exported of a store.
pub(super) struct Export {
    store: GroundStore,
    runs: Vec<StoredRun>,
    /// Runs of which nothing is known but marks.
    only_marked: Vec<RunId>,
    starts: Vec<Provenance>,
    venue: Venue,
    venue_text: String,
}

/// What is gathered of all runs.
struct Gathered {
    features: Features,
    /// Where vehicles drove, if that is wanted.
    tracks: Option<Vec<(VehicleId, Vec<Point>)>>,
}

impl Export {
    /// Reads what a store says of itself, and of one run or all.
    ///
    /// # Errors
    /// The store cannot be read, or the run is not in it.
    pub(super) fn of(path: &Path, run: Option<u32>) -> Result<Export, CliError> {
        let store = GroundStore::open_to_read(path)?;
        let mut runs = store.runs()?;
        let mut only_marked = store.marked_runs()?;
        only_marked.retain(|marked| runs.iter().all(|run| run.run != *marked));
        if let Some(run) = run {
            only_marked.retain(|marked| *marked == RunId(run));
            runs = match only_marked.is_empty() {
                true => vec![stored_run::run_of(path, &runs, run)?],
                false => Vec::new(),
            };
        }
        let starts = store.provenance()?;
        let (venue, venue_text) = venue_of(path, &starts)?;
        Ok(Export {
            store,
            runs,
            only_marked,
            starts,
            venue,
            venue_text,
        })
    }

    /// Writes all files that are wanted; returns what there is to say of the runs.
    ///
    /// # Errors
    /// The store cannot be read any more, or a file cannot be written.
    pub(super) fn write_to(&self, target: &mut dyn ExportTarget) -> Result<String, CliError> {
        let Export { store, venue, .. } = self;
        let has_features = target.wants("swarm.geojson");
        let has_map = target.wants("map.png") | target.wants("map.pgw");
        let mut gathered = Gathered {
            features: Features::of_venue(venue),
            tracks: (has_features || has_map).then(Vec::new),
        };
        let mut lines = String::new();
        for run in &self.runs {
            let imaging = stored_run::imaging_of(run, &self.starts);
            let samples = self.write_run(target, (run.run, imaging.as_ref()), &mut gathered)?;
            let features = &mut gathered.features;
            let marks = write_marks(target, self, run.run, features)?;
            let (images, errors) = write_images(target, self, (run.run, &marks), features)?;
            lines += &format!(
                "run {}: {samples} samples, {images} pictures{}\n",
                run.run,
                count_of(&marks)
            );
            if imaging.is_none() {
                lines += NO_SETTINGS;
            }
            lines += &errors;
        }
        for run in &self.only_marked {
            let marks = write_marks(target, self, *run, &mut gathered.features)?;
            lines += &format!("run {run}: no samples{}\n", count_of(&marks));
        }
        let Gathered { features, tracks } = gathered;
        if has_map {
            write_map(target, self, tracks.unwrap_or_default())?;
        }
        if has_features {
            target.write("swarm.geojson", features.text().as_bytes())?;
        }
        if target.wants("venue.toml") {
            target.write("venue.toml", self.venue_text.as_bytes())?;
        }
        if target.wants("export.json") {
            let about = about(store, &self.runs, &self.starts);
            target.write("export.json", about.as_bytes())?;
        }
        Ok(lines)
    }

    /// Returns what a run has measured of links, pooled as the ground station does.
    ///
    /// # Errors
    /// The store cannot be read any more.
    #[cfg(feature = "dash")]
    pub(super) fn links(&self, run: RunId) -> Result<LinkBins, CliError> {
        let stored = self.runs.iter().find(|stored| stored.run == run);
        let imaging = stored.and_then(|stored| stored_run::imaging_of(stored, &self.starts));
        let mut bins = empty_bins(imaging.as_ref());
        self.store.each_sample(Some(run), |stored| {
            bins.record_sample(stored.vehicle, &stored.sample);
        })?;
        Ok(bins)
    }

    /// Returns in a line which program has made something of which store, and of which run of it.
    fn origin(&self, run: Option<RunId>) -> String {
        let path = self.store.path();
        let name = path.file_name().unwrap_or(path.as_os_str());
        format!(
            "made by tomoswarm {} from {}, the store {:016x}{}",
            env!("CARGO_PKG_VERSION"),
            name.display(),
            self.store.id(),
            run.map(|run| format!(", run {run}")).unwrap_or_default()
        )
    }

    /// Writes samples and links of a run with how it was imaged, and gathers its tracks; returns how many samples there are, of
    /// those that were read.
    fn write_run(
        &self,
        target: &mut dyn ExportTarget,
        (run, imaging): (RunId, Option<&LinksFile>),
        gathered: &mut Gathered,
    ) -> Result<usize, CliError> {
        let names = ["samples", "links"].map(|kind| format!("run-{run}-{kind}.csv"));
        let [has_samples, has_links] = [0, 1].map(|name: usize| target.wants(&names[name]));
        let Gathered { features, tracks } = gathered;
        if !has_samples && !has_links && tracks.is_none() {
            return Ok(0);
        }
        let origin = self.origin(Some(run));
        let mut text = format!("# {origin}\n{}{SAMPLES_HEADER}\n", comments(imaging));
        let mut bins = empty_bins(imaging);
        let mut driven: Vec<((VehicleId, u32), Vec<Point>)> = Vec::new();
        let (mut count, mut channels) = (0, BTreeSet::new());
        self.store.each_sample(Some(run), |stored| {
            let MeasuredSample {
                vehicle,
                boot,
                run: _,
                sample,
                utc_s: _,
            } = &stored;
            if has_samples {
                sample_line(&mut text, &stored);
            }
            bins.record_sample(*vehicle, sample);
            channels.insert(sample.channel);
            let who = (*vehicle, boot.0);
            if driven.last().is_none_or(|(last, _)| *last != who) {
                driven.push((who, Vec::new()));
            }
            if let Some((_, track)) = driven.last_mut() {
                extend_track(track, &stored);
            }
            count += 1;
        })?;
        if has_samples {
            target.write(&names[0], text.as_bytes())?;
        }
        if has_links {
            let as_measured = imaging.map(|file| LinksFile {
                as_measured: true,
                channel: channels.pop_first().filter(|_| channels.is_empty()),
                ..file.clone()
            });
            let links = links_csv(&bins.measured_links(), as_measured.as_ref());
            let text = format!("# {origin}, in squares of {} m\n{links}", bins.bin_m());
            target.write(&names[1], text.as_bytes())?;
        }
        for ((vehicle, boot), points) in driven {
            features.track(
                json!({"what": "track", "run": run.0, "vehicle": vehicle.0, "boot": boot}),
                &points,
            );
            if let Some(tracks) = tracks {
                tracks.push((vehicle, points));
            }
        }
        Ok(count)
    }
}

/// Returns bins for the samples of a run, as the ground station that imaged it has them.
fn empty_bins(imaging: Option<&LinksFile>) -> LinkBins {
    LinkBins::new(imaging.map_or(BIN_M, |file| file.imaging.bin_m), SPOT_M)
}

/// Returns the venue as the ground station read it last.
fn venue_of(path: &Path, starts: &[Provenance]) -> Result<(Venue, String), CliError> {
    let wrong = |reason: &str| CliError::Input {
        path: path.to_owned(),
        reason: reason.to_owned(),
    };
    let text = &starts.first().ok_or_else(|| wrong("holds no venue"))?.venue;
    let name = format!("the venue in {}", path.display());
    let mut no_files = |_: &str| Err("a venue names no other files".to_owned());
    match config::read(&name, text, &mut no_files)? {
        Config::Venue(venue) => Ok((venue, text.clone())),
        Config::Scene(_)
        | Config::Sim(_)
        | Config::Experiment(_)
        | Config::Vehicle(_)
        | Config::Ground(_)
        | Config::Operator(_) => Err(wrong("holds another kind of file in place of its venue")),
    }
}

/// Returns the run whose file has a name; `None` = that is not the name of a file of one run.
fn run_of(name: &str) -> Option<u32> {
    let (number, kind) = name.strip_prefix("run-")?.split_once('-')?;
    let is_kind = |stem: &str| matches!(stem, "change" | "structure");
    let is_picture = kind.rsplit_once('.').is_some_and(|(stem, ending)| {
        let of_deviation = stem.strip_suffix("-deviation");
        match ending {
            "npy" | "png" => is_kind(of_deviation.unwrap_or(stem)),
            "pgw" => is_kind(stem),
            _ => false,
        }
    });
    let is_ours = is_picture || matches!(kind, "samples.csv" | "links.csv" | "marks.csv");
    number.parse().ok().filter(|_| is_ours)
}

/// Returns how many marks there are, as it stands behind what else there is of a run; nothing of none.
fn count_of(marks: &[StoredMark]) -> String {
    match marks.len() {
        0 => String::new(),
        count => format!(", {count} marks"),
    }
}

/// Writes where somebody truly stood in a run, if that was marked, and returns it.
fn write_marks(
    target: &mut dyn ExportTarget,
    export: &Export,
    run: RunId,
    features: &mut Features,
) -> Result<Vec<StoredMark>, CliError> {
    let marks = export.store.marks(run)?;
    if marks.is_empty() {
        return Ok(marks);
    }
    let mut text = format!("# {}\n{MARKS_HEADER}\n", export.origin(Some(run)));
    for StoredMark {
        at,
        z_m,
        marked_utc_s,
    } in &marks
    {
        let marked = utc_text(*marked_utc_s);
        text += &format!("{run},{},{},{z_m},{marked}\n", at.x_m, at.y_m);
        features.place(json!({"what": "mark", "run": run.0, "marked": marked}), *at);
    }
    let name = format!("run-{run}-marks.csv");
    if target.wants(&name) {
        target.write(&name, text.as_bytes())?;
    }
    Ok(marks)
}

/// Writes the newest pictures of a run with its marks; returns how many, and in lines how far finds, or without an empty sweep
/// strong places, are from the marks.
fn write_images(
    target: &mut dyn ExportTarget,
    export: &Export,
    (run, truth): (RunId, &[StoredMark]),
    features: &mut Features,
) -> Result<(usize, String), CliError> {
    let images = export.store.newest_images(run)?;
    let mut errors = String::new();
    for made in images
        .iter()
        .filter(|made| matches!(made.kind.as_str(), "change" | "structure"))
    {
        let name = |ending: &str| format!("run-{run}-{}.{ending}", made.kind);
        if target.wants(&name("npy")) {
            target.write(&name("npy"), &npy_bytes(&made.image))?;
        }
        let spec = heat(made, truth);
        errors += &error_lines(made, truth);
        if target.wants(&name("png")) {
            let picture = drawn(Picture::heat(&spec))?;
            let origin = export.origin(Some(run));
            target.write(&name("png"), &described(picture, &origin))?;
        }
        if target.wants(&name("pgw")) {
            let world = world(&export.venue, spec.placement())?;
            target.write(&name("pgw"), world.as_bytes())?;
        }
        if let Some(values) = made.deviation.clone() {
            let grid = made.image.grid;
            let name = |ending: &str| format!("run-{run}-{}-deviation.{ending}", made.kind);
            write_deviation(target, export, (run, &Image { grid, values }), name)?;
        }
        features.image(MadeImage {
            says: &json!({"run": run.0, "kind": made.kind, "laps": made.laps}),
            peaks: &made.peaks,
            finds: made.finds.as_ref(),
        });
    }
    Ok((images.len(), errors))
}

/// Writes how sure a picture is.
fn write_deviation(
    target: &mut dyn ExportTarget,
    export: &Export,
    (run, deviation): (RunId, &Image),
    name: impl Fn(&str) -> String,
) -> Result<(), CliError> {
    if target.wants(&name("npy")) {
        target.write(&name("npy"), &npy_bytes(deviation))?;
    }
    if target.wants(&name("png")) {
        let picture = deviation_picture(deviation, "m")?;
        let origin = export.origin(Some(run));
        target.write(&name("png"), &described(picture, &origin))?;
    }
    Ok(())
}

/// Returns a line for every mark: how far from it the nearest place is that a picture names.
fn error_lines(made: &StoredImage, truth: &[StoredMark]) -> String {
    let named = Named::of(made.finds.as_ref(), &made.peaks);
    let line = |mark: &StoredMark| format!("  {}: {}\n", made.kind, named.words(mark.at, "m"));
    truth.iter().map(line).collect()
}

fn heat<'a>(made: &'a StoredImage, truth: &[StoredMark]) -> HeatMap<'a> {
    let seen = if made.kind == "change" {
        "What changed since the empty sweep"
    } else {
        "What stands there"
    };
    let Image { grid, values } = &made.image;
    let mut overlays = marks(made.finds.as_ref(), &made.peaks);
    let places: Vec<Point> = truth.iter().map(|mark| mark.at).collect();
    overlays.extend(circles(&places, 1.0));
    HeatMap {
        title: heat_title(seen, made.links, made.finds.as_ref()),
        grid: *grid,
        values,
        unit: "dB/m",
        length_unit: "m",
        overlays,
        range: colour_range(&made.image),
    }
}

fn world(
    venue: &Venue,
    placement: Result<Placement, crate::draw::DrawError>,
) -> Result<String, CliError> {
    let Placement {
        corner,
        metres_per_px,
    } = placement.map_err(|error| CliError::Fault(error.to_string()))?;
    Ok(world_file(&venue.plane(), corner, metres_per_px))
}

/// Writes the map that all vehicles have made together.
fn write_map(
    target: &mut dyn ExportTarget,
    export: &Export,
    tracks: Vec<(VehicleId, Vec<Point>)>,
) -> Result<(), CliError> {
    let Export { store, venue, .. } = export;
    let mut map = Merged::new(Lattice::new(venue.cell_m), None);
    for tile in store.tiles()? {
        // One that cannot be joined was not joined by the ground station either.
        let _ = map.join(&tile);
    }
    let CellGrid {
        origin,
        columns,
        rows,
        cells,
    } = shown_cells(&map, venue);
    let mut overlays = vec![
        Overlay::Fence {
            polygon: venue.fence.clone(),
        },
        Overlay::Area { rect: venue.area },
    ];
    overlays.extend(
        tracks
            .into_iter()
            .map(|(vehicle, points)| Overlay::Track { points, vehicle }),
    );
    overlays.extend(homes(venue));
    let title = "What the range sensors saw".to_owned();
    let spec = OccupancyMap {
        title,
        origin,
        cell_m: venue.cell_m,
        columns,
        rows,
        cells: &cells,
        overlays,
    };
    let picture = drawn(Picture::occupancy(&spec))?;
    target.write("map.png", &described(picture, &export.origin(None)))?;
    target.write("map.pgw", world(venue, spec.placement())?.as_bytes())
}

/// Returns where the data come from.
fn about(store: &GroundStore, runs: &[StoredRun], starts: &[Provenance]) -> String {
    let run = |run: &StoredRun| {
        json!({
            "run": run.run.0,
            "empty_run": run.empty.map(|empty| empty.0),
            "began": utc_text(run.began_utc_s),
            "closed": run.closed_utc_s.map(utc_text),
        })
    };
    let start = |start: &Provenance| {
        json!({
            "started": utc_text(start.started_utc_s),
            "version": start.version,
            "seed": start.seed,
            "note": start.note,
            "config": start.config,
        })
    };
    let about = json!({
        "store": format!("{:016x}", store.id()),
        "file": store.path().display().to_string(),
        "version": env!("CARGO_PKG_VERSION"),
        "runs": runs.iter().map(run).collect::<Vec<_>>(),
        "starts": starts.iter().map(start).collect::<Vec<_>>(),
    });
    format!("{about:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Imaging;
    use crate::draw::tests_support::decoded;
    use crate::geom::{PixelGrid, Rect};
    use crate::ground::imager::{ImageStage, ReconstructedImage as Made, Subject};
    use crate::store::ground::{Start, UtcOffset};
    use crate::tomo::{Peak, Reconstruction};
    use serde_json::Value;
    use tomoswarm_proto::{Boot, Mark, PoseReport, Position, Sample, Samples};

    /// A store with two runs of one vehicle that drove along the south side, and a picture.
    fn make_store(path: &Path) {
        make_store_of(path, "");
    }

    /// Makes one of a ground station with a file.
    fn make_store_of(path: &Path, config: &str) {
        let start = Start {
            config,
            venue: bundled_venue(),
            note: Some("dry"),
            ..Start::default()
        };
        let mut store = GroundStore::open(path, &start).unwrap();
        let clock = UtcOffset {
            offset_s: 1_700_000_000.0,
            error_s: 0.015,
        };
        store
            .note_vehicle(VehicleId(1), Boot(1), None, Some(clock))
            .unwrap();
        let place = |x_m, y_m| PoseReport {
            at: Position::from_metres(x_m, y_m, 0.0),
            ..PoseReport::default()
        };
        let sample = |sequence: u64| Sample {
            sequence,
            heard_at_ns: sequence * 1_000_000_000,
            transmitter: VehicleId(2),
            transmitter_pose: place(20.0, 20.0),
            receiver_pose: place(sequence as f64, 0.0),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: (sequence != 3).then_some(-60),
        };
        for run in [1, 2] {
            let samples = (0..10).map(sample).collect();
            let batch = Samples {
                vehicle: VehicleId(1),
                boot: Boot(1),
                run: RunId(run),
                samples,
                lost: vec![],
            };
            store.take(&[batch]).unwrap();
        }
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0));
        let mut image = Image::zeros(PixelGrid {
            area,
            columns: 4,
            rows: 4,
        });
        image.values[5] = 3.0;
        let result = Reconstruction {
            image,
            peaks: vec![Peak {
                at: Point::new(7.5, 7.5),
                strength: 3.0,
                significance: Some(9.0),
            }],
            residual_rms_db: 1.0,
            used: 9,
            dropped: Default::default(),
            path_loss: None,
            by_empty_sweep: true,
            finds: None,
            deviation: Some(vec![0.25; 16]),
            shares: None,
            choice: None,
            links: None,
        };
        store
            .keep_picture(&Made {
                run: RunId(2),
                laps: 1,
                subject: Subject::Change,
                stage: ImageStage::Last,
                result: Ok(result),
            })
            .unwrap();
    }

    fn bundled_venue() -> &'static str {
        include_str!("../../configs/courtyard.venue.toml")
    }

    fn export(store: &Path, out: &Path, run: Option<u32>) -> Result<String, CliError> {
        let mut text = Vec::new();
        ExportArgs {
            store: store.to_owned(),
            out: out.to_owned(),
            run,
        }
        .run(&mut text)?;
        Ok(String::from_utf8(text).unwrap())
    }

    fn listed(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn everything_is_written_and_an_export_of_one_run_leaves_the_files_of_others() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        let text = export(&store, &out, None).unwrap();
        assert!(
            text.contains("run 1: 10 samples, 0 pictures\n")
                && text.contains("run 2: 10 samples, 1 pictures\n"),
            "{text}"
        );
        let all = listed(&out);
        assert_eq!(all.len(), FAMILY.names.len() + 4 + 5, "{all:?}");
        for ending in ["npy", "png"] {
            assert!(all.contains(&format!("run-2-change-deviation.{ending}")));
        }
        let with = |more: &[&str]| {
            let mut names = all.clone();
            names.extend(more.iter().map(|name| (*name).to_owned()));
            names.sort();
            names
        };
        for name in ["run-notes.txt", "run-1-change.png", "run-7-links.csv"] {
            std::fs::write(out.join(name), "of before").unwrap();
        }
        export(&store, &out, Some(1)).unwrap();
        assert_eq!(listed(&out), with(&["run-notes.txt", "run-7-links.csv"]));
        export(&store, &out, None).unwrap();
        assert_eq!(listed(&out), with(&["run-notes.txt"]));
    }

    #[test]
    fn samples_have_utc_and_links_can_be_read_again() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        export(&store, &out, Some(2)).unwrap();
        let text = std::fs::read_to_string(out.join("run-2-samples.csv")).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 12);
        let fields: Vec<&str> = lines[5].split(',').collect();
        assert_eq!(fields.len(), lines[1].split(',').count());
        assert_eq!(
            fields[..8],
            [
                "1",
                "1",
                "2",
                "3",
                "3.000000",
                "2023-11-14T22:13:23.000Z",
                "0.015",
                "2"
            ]
        );
        assert_eq!((fields[13], fields[20]), ("3.0000", ""), "{}", lines[5]);
        for name in ["run-2-links.csv", "run-2-samples.csv"] {
            let recording = super::super::image::read_file(&out.join(name)).unwrap();
            let links = &recording.links;
            assert_eq!(links.iter().map(|link| link.packets).sum::<u32>(), 9);
            assert_eq!(links.iter().map(|link| link.misses).sum::<u32>(), 1);
        }
    }

    #[test]
    fn pictures_and_tables_say_of_which_run_of_which_store_they_are() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        let start = Start {
            venue: bundled_venue(),
            ..Start::default()
        };
        let mark = Mark {
            run: RunId(2),
            at: Position::from_metres(3.0, 4.0, 0.0),
            stands: true,
        };
        let kept = GroundStore::open(&store, &start).unwrap().keep_mark(mark);
        kept.unwrap();
        export(&store, &out, None).unwrap();
        let id = GroundStore::open_to_read(&store).unwrap().id();
        let of_store = format!("from swarm.db, the store {id:016x}");
        for (name, of_run) in [
            ("run-1-samples.csv", ", run 1"),
            ("run-2-links.csv", ", run 2"),
            ("run-2-marks.csv", ", run 2"),
            ("run-2-change.png", ", run 2"),
            ("map.png", ""),
        ] {
            let bytes = std::fs::read(out.join(name)).unwrap();
            let text = String::from_utf8_lossy(&bytes).into_owned();
            assert!(text.contains(&format!("{of_store}{of_run}")), "{name}");
        }
    }

    #[test]
    fn marks_are_written_also_of_a_run_of_which_there_is_nothing_else() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        let start = Start {
            venue: bundled_venue(),
            ..Start::default()
        };
        let mut written = GroundStore::open(&store, &start).unwrap();
        for run in [1, 7].map(RunId) {
            let (at, stands) = (Position::from_metres(3.0, 4.0, 0.0), true);
            written.keep_mark(Mark { run, at, stands }).unwrap();
        }
        let text = export(&store, &out, None).unwrap();
        for line in [
            "run 1: 10 samples, 0 pictures, 1 marks\n",
            "run 7: no samples, 1 marks\n",
        ] {
            assert!(text.contains(line), "{text}");
        }
        assert!(out.join("run-7-marks.csv").is_file());
        let alone = root.path().join("alone");
        assert!(
            export(&store, &alone, Some(7))
                .unwrap()
                .starts_with("run 7: no samples, 1 marks\n")
        );
        assert!(alone.join("run-7-marks.csv").is_file() && !alone.join("run-1-marks.csv").exists());
    }

    #[test]
    fn links_are_pooled_in_the_bins_of_the_ground_station() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        let file = include_str!("../../configs/courtyard.ground.toml");
        let config = file.replace("[imaging]\n", "[imaging]\nbin_m = 2.0\n");
        make_store_of(&store, &config);
        export(&store, &out, Some(2)).unwrap();
        // Ten places, a metre apart; the first one is alone in its bin, whose middle it is.
        let recording = super::super::image::read_file(&out.join("run-2-links.csv")).unwrap();
        assert_eq!(recording.links.len(), 6);
    }

    #[test]
    fn a_stored_run_and_what_is_written_of_it_are_imaged_as_the_ground_station_has() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        let file = include_str!("../../configs/courtyard.ground.toml");
        let imaging =
            "[radio]\nsensitivity_dbm = -101.0\n\n[imaging]\npixels = [24, 12]\nmin_link_m = 2.5\n";
        make_store_of(&store, &file.replace("[imaging]\n", imaging));
        let text = export(&store, &out, Some(2)).unwrap();
        assert!(!text.contains("cannot read"), "{text}");
        let read = |path: &Path| super::super::image::read_file(path).unwrap();
        let stored = read(&root.path().join("swarm.db:2")).imaging.unwrap();
        let Imaging {
            pixels, min_link_m, ..
        } = stored.imaging;
        assert_eq!((pixels, min_link_m), (Some((24, 12)), 2.5));
        assert_eq!(stored.reception.sensitivity_dbm, -101.0);
        assert_eq!(
            stored.area,
            Rect::new(Point::default(), Point::new(20.0, 20.0))
        );
        let samples = read(&out.join("run-2-samples.csv"));
        assert_eq!(samples.imaging.as_ref(), Some(&stored));
        let links = read(&out.join("run-2-links.csv"));
        assert!(!links.is_without_offsets && links.pooled_in_m == Some(stored.imaging.bin_m));
        let as_measured = LinksFile {
            as_measured: true,
            channel: Some(11),
            ..stored
        };
        assert_eq!(links.imaging, Some(as_measured));
        assert_eq!(links.channels, samples.channels);
    }

    #[test]
    fn a_store_whose_ground_station_has_no_file_that_can_be_read_is_written_without_settings() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        let text = export(&store, &out, None).unwrap();
        assert_eq!(
            text.matches("do not say how it imaged").count(),
            2,
            "{text}"
        );
        let read = |path: &Path| super::super::image::read_file(path).unwrap().imaging;
        assert_eq!(read(&out.join("run-2-samples.csv")), None);
        assert_eq!(read(&root.path().join("swarm.db:2")), None);
    }

    #[test]
    fn a_store_without_a_run_is_refused_with_the_runs_that_it_holds() {
        let root = tempfile::tempdir().unwrap();
        let store = root.path().join("swarm.db");
        make_store(&store);
        let refused = super::super::image::read_file(&store)
            .unwrap_err()
            .to_string();
        let expected = format!(
            "holds runs 1, 2; name the run that is meant, such as {}:2",
            store.display()
        );
        assert!(refused.ends_with(&expected), "{refused}");
    }

    #[test]
    fn the_map_of_the_earth_shows_peaks_and_tracks_at_the_datum() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        export(&store, &out, None).unwrap();
        let text = std::fs::read_to_string(out.join("swarm.geojson")).unwrap();
        let file: Value = serde_json::from_str(&text).unwrap();
        let of = |what: &str| -> Vec<&Value> {
            let features = file["features"].as_array().unwrap();
            features
                .iter()
                .filter(|feature| feature["properties"]["what"] == what)
                .collect()
        };
        assert_eq!(
            (of("area").len(), of("fence").len(), of("home").len()),
            (1, 1, 8)
        );
        assert_eq!((of("peak").len(), of("track").len()), (1, 2));
        let corner = &of("area")[0]["geometry"]["coordinates"][0][0];
        assert!((corner[0].as_f64().unwrap() - 4.8952).abs() < 1e-9);
        assert!((corner[1].as_f64().unwrap() - 52.3702).abs() < 1e-9);
        // 7.5 m north: a degree of latitude has 111 260 m there.
        let peak = &of("peak")[0]["geometry"]["coordinates"];
        assert!((peak[1].as_f64().unwrap() - 52.3702 - 7.5 / 111_260.0).abs() < 1e-8);
        let world = std::fs::read_to_string(out.join("run-2-change.pgw")).unwrap();
        assert_eq!(world.lines().count(), 6);
    }

    #[test]
    fn the_cross_lies_within_a_cell_of_the_brightest_one() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        make_store(&store);
        export(&store, &out, Some(2)).unwrap();
        let stored = GroundStore::open_to_read(&store).unwrap();
        let images = stored.newest_images(RunId(2)).unwrap();
        let spec = heat(&images[0], &[]);
        let Placement {
            corner,
            metres_per_px,
        } = spec.placement().unwrap();
        let file = std::fs::read(out.join("run-2-change.png")).unwrap();
        let (width, pixels) = decoded(&file);
        let place = |index: usize| {
            let (x_px, y_px) = (index % width, index / width);
            Point::new(
                corner.x_m + (x_px as f64 + 0.5) * metres_per_px,
                corner.y_m - (y_px as f64 + 0.5) * metres_per_px,
            )
        };
        let middle_of = |colour: [u8; 3]| {
            let places: Vec<Point> = (0..pixels.len())
                .filter(|index| pixels[*index] == colour)
                .map(place)
                .filter(|at| spec.grid.area.contains(*at))
                .collect();
            let mean =
                |of: fn(&Point) -> f64| places.iter().map(of).sum::<f64>() / places.len() as f64;
            Point::new(mean(|at| at.x_m), mean(|at| at.y_m))
        };
        // The colour of crosses, and the colour map's end, around the cross.
        let (cross, brightest) = (middle_of([70, 255, 130]), middle_of([255, 252, 210]));
        let off = cross - brightest;
        assert!(
            off.x_m.abs() < spec.grid.dx_m() && off.y_m.abs() < spec.grid.dy_m(),
            "{cross:?} {brightest:?}"
        );
    }

    #[test]
    fn what_cannot_be_exported_is_refused_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (store, out) = (root.path().join("swarm.db"), root.path().join("out"));
        let check = |path: &Path, run, words: &str| {
            let error = export(path, &out, run).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
            assert_eq!(error.exit_code(), 2);
            assert!(!out.exists());
        };
        check(&store, None, "there is no such file");
        std::fs::write(&store, b"").unwrap();
        check(&store, None, "an empty file");
        std::fs::write(&store, "no database ".repeat(500)).unwrap();
        check(&store, None, "no database");
        std::fs::remove_file(&store).unwrap();
        make_store(&store);
        check(&store, Some(7), "holds no run 7; it holds runs 1, 2");
        let error = export(&store, &store, None).unwrap_err();
        assert!(
            error.to_string().contains("something else is there"),
            "{error}"
        );
    }
}
