//! What the store promises: everything once, nothing half, and what is acknowledged is there after any end.

use crate::ground::imager::ImageStage;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use tomoswarm_proto::{LayerId, Lease, Position, Sample, TILE_CELLS, TileAddress};

use super::*;
use crate::geom::{PixelGrid, Point, Rect};
use crate::tomo::{Find, Finds, Reconstruction};

const START: Start = Start {
    config: "kind = \"ground\"",
    venue: "kind = \"venue\"",
    venue_hash: 0xfeed_0000_0000_0001,
    seed: Some(u64::MAX),
    note: Some("windy"),
    new_id: 0x8000_0000_0000_0007,
};

fn sample(sequence: u64) -> Sample {
    let receiver_pose = tomoswarm_proto::PoseReport {
        at: tomoswarm_proto::Position {
            x_mm: 100,
            y_mm: -7,
            z_mm: 0,
        },
        heading: tomoswarm_proto::Heading(32_832),
        sd: tomoswarm_proto::Deviation(50),
    };
    Sample {
        sequence,
        heard_at_ns: 3_600_000_000_001 + sequence * 50_000_000,
        transmitter: VehicleId(2),
        transmitter_pose: Default::default(),
        receiver_pose,
        channel: 26,
        power_dbm: -8,
        rssi_dbm: (!sequence.is_multiple_of(3)).then_some(-61),
    }
}

fn batch(vehicle: u8, run: u32, sequences: impl Iterator<Item = u64>) -> Samples {
    let samples = sequences.map(sample).collect();
    Samples {
        vehicle: VehicleId(vehicle),
        boot: Boot(4),
        run: RunId(run),
        samples,
        lost: vec![],
    }
}

fn path_in(folder: &tempfile::TempDir) -> PathBuf {
    folder.path().join("swarm.db")
}

fn count(store: &GroundStore) -> usize {
    let mut count = 0;
    store.each_sample(None, |_| count += 1).unwrap();
    count
}

#[test]
fn samples_are_stored_once_and_come_back_in_a_fixed_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = GroundStore::open(&path_in(&folder), &START).unwrap();
    assert_eq!(
        store.take(&[batch(2, 1, 5..9), batch(1, 1, 0..3)]).unwrap(),
        7
    );
    assert_eq!(store.take(&[batch(2, 1, (0..10).rev())]).unwrap(), 6);
    drop(store);
    let store = GroundStore::open(&path_in(&folder), &START).unwrap();
    assert_eq!(store.id(), START.new_id);
    let restored = store.resume().unwrap();
    assert_eq!(restored.samples, [batch(1, 1, 0..3), batch(2, 1, 0..10)]);
    assert_eq!(
        (restored.store, restored.memory, restored.pictures),
        (START.new_id, None, 0)
    );
    let starts = store.provenance().unwrap();
    assert_eq!(starts.len(), 2);
    assert_eq!(
        (starts[0].seed, starts[0].note.as_deref()),
        (START.seed, START.note)
    );
}

#[test]
fn a_store_keeps_the_id_it_was_made_with() {
    let folder = tempfile::tempdir().unwrap();
    drop(GroundStore::open(&path_in(&folder), &START).unwrap());
    let store = GroundStore::open(
        &path_in(&folder),
        &Start {
            new_id: 99,
            ..START
        },
    )
    .unwrap();
    assert_eq!(store.id(), START.new_id);
}

#[test]
fn of_a_tile_the_highest_revision_is_kept_whatever_the_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = GroundStore::open(&path_in(&folder), &START).unwrap();
    let tile = |x, revision, value: i8| TileReport {
        layer: LayerId {
            vehicle: VehicleId(1),
            boot: Boot(1),
        },
        address: TileAddress {
            slice: -1,
            x,
            y: i32::MIN,
        },
        revision,
        cells: std::sync::Arc::new([value; TILE_CELLS]),
    };
    store
        .keep_tiles(&[tile(3, 7, -17), tile(-3, 1, 9)])
        .unwrap();
    store
        .keep_tiles(&[tile(3, 6, 1), tile(-3, u32::MAX, 17)])
        .unwrap();
    assert_eq!(
        store.resume().unwrap().tiles,
        [tile(-3, u32::MAX, 17), tile(3, 7, -17)]
    );
}

#[test]
fn plans_runs_clocks_memory_and_pictures_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = GroundStore::open(&path_in(&folder), &START).unwrap();
    let clock = UtcOffset {
        offset_s: 1.7e9,
        error_s: 0.02,
    };
    store
        .note_vehicle(VehicleId(1), Boot(4), Some("0.1.0"), Some(clock))
        .unwrap();
    store.note_run(RunId(2), Some(RunId(1))).unwrap();
    store.take(&[batch(1, 2, 0..2)]).unwrap();
    store.close_run(RunId(2)).unwrap();
    let plan = Plan {
        run: RunId(2),
        lease: Lease {
            number: 1,
            holder: u64::MAX,
        },
        ..Plan::default()
    };
    store.keep_plans([&plan, &plan]).unwrap();
    store.keep_plans([&plan]).unwrap();
    store.remember(b"first").unwrap();
    store.remember(b"second").unwrap();
    for laps in [1, 2] {
        store.keep_picture(&picture(laps)).unwrap();
    }
    drop(store);
    let mut store = GroundStore::open(&path_in(&folder), &START).unwrap();
    let restored = store.resume().unwrap();
    assert_eq!(
        (restored.memory.as_deref(), restored.pictures),
        (Some(&b"second"[..]), 2)
    );
    let run = restored.runs[0];
    assert_eq!(
        (run.run, run.empty, run.closed_utc_s.is_some()),
        (RunId(2), Some(RunId(1)), true)
    );
    store.take(&[batch(1, 2, 2..3)]).unwrap();
    store
        .each_sample(None, |stored| {
            let (utc_s, error_s) = stored.utc_s.unwrap();
            assert_eq!(error_s, 0.02);
            assert!((utc_s - 1.7e9 - 3600.0).abs() < 1.0);
        })
        .unwrap();
    let images = store.newest_images(RunId(2)).unwrap();
    assert_eq!(
        (images.len(), images[0].laps, images[0].kind.as_str()),
        (1, 2, "change")
    );
    assert_eq!(images[0].image, picture(2).result.unwrap().image);
    assert_eq!(images[0].peaks, picture(2).result.unwrap().peaks);
    assert_eq!(images[0].finds, picture(2).result.unwrap().finds);
    assert_eq!(images[0].deviation, picture(2).result.unwrap().deviation);
    // A memory of another version is not taken for one of this; nor one of this version under the wire before.
    for version in ["0.0.0", "0.1.0"] {
        store
            .connection
            .execute("UPDATE memory SET version = ?", [version])
            .unwrap();
        let restored = store.resume().unwrap();
        assert_eq!(
            (restored.memory, restored.foreign_memory.as_deref()),
            (None, Some(version))
        );
    }
}

/// Makes the tables those of version 3.
const BACK_TO_3: &str = "ALTER TABLE images DROP COLUMN deviation; PRAGMA user_version = 3;";

/// Returns a store whose tables are made those of a version of before by some statements, with a picture in it.
fn store_of_before(folder: &tempfile::TempDir, back: &str) -> PathBuf {
    let path = path_in(folder);
    let mut store = GroundStore::open(&path, &START).unwrap();
    store.keep_picture(&picture(2)).unwrap();
    store.connection.execute_batch(back).unwrap();
    path
}

#[test]
fn a_store_of_version_1_is_read_and_brought_up_to_date() {
    let folder = tempfile::tempdir().unwrap();
    let back = "ALTER TABLE images DROP COLUMN deviation; ALTER TABLE images DROP COLUMN finds;
                DROP TABLE marks; PRAGMA user_version = 1;";
    let path = store_of_before(&folder, back);
    let run = picture(2).run;
    let finds = |store: &GroundStore| store.newest_images(run).unwrap()[0].finds.clone();
    let old = GroundStore::open_to_read(&path).unwrap();
    assert_eq!((finds(&old), old.marks(run).unwrap()), (None, vec![]));
    drop(old);
    let mut store = GroundStore::open(&path, &START).unwrap();
    assert_eq!(schema::version(&store.connection).unwrap(), schema::VERSION);
    assert_eq!(finds(&store), None);
    store.keep_picture(&picture(3)).unwrap();
    assert_eq!(finds(&store), picture(3).result.unwrap().finds);
    store.keep_mark(mark_at(run.0, 1000)).unwrap();
    assert_eq!(store.marks(run).unwrap().len(), 1);
}

#[test]
fn images_of_version_3_have_no_deviation_and_new_ones_have() {
    let folder = tempfile::tempdir().unwrap();
    let path = store_of_before(&folder, BACK_TO_3);
    let newest = |store: &GroundStore| store.newest_images(picture(2).run).unwrap().remove(0);
    let old = newest(&GroundStore::open_to_read(&path).unwrap());
    let made = picture(2).result.unwrap();
    assert_eq!((old.deviation, old.finds), (None, made.finds));
    let mut store = GroundStore::open(&path, &START).unwrap();
    assert_eq!(newest(&store).deviation, None);
    store.keep_picture(&picture(3)).unwrap();
    assert_eq!(newest(&store).deviation, made.deviation);
    let short = "UPDATE images SET deviation = x'00000000'";
    store.connection.execute_batch(short).unwrap();
    let refused = store.newest_images(picture(2).run).unwrap_err();
    assert!(
        refused.to_string().contains("4 bytes of deviations"),
        "{refused}"
    );
}

fn mark_at(run: u32, x_mm: i32) -> Mark {
    Mark {
        run: RunId(run),
        at: Position {
            x_mm,
            y_mm: -2250,
            z_mm: 0,
        },
        stands: true,
    }
}

#[test]
fn a_place_is_marked_once_and_can_be_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    let mark = mark_at(2, 1000);
    let places = |store: &GroundStore, run: u32| -> Vec<Point> {
        let marks = store.marks(RunId(run)).unwrap();
        marks.into_iter().map(|mark| mark.at).collect()
    };
    store.keep_mark(mark).unwrap();
    let first = store.marks(RunId(2)).unwrap();
    for again in [mark, mark_at(2, 4000), mark_at(3, 1000)] {
        store.keep_mark(again).unwrap();
    }
    let (here, there) = (Point::new(1.0, -2.25), Point::new(4.0, -2.25));
    assert_eq!(
        store.marks(RunId(2)).unwrap()[0],
        first[0],
        "keeps its time"
    );
    assert_eq!(
        (places(&store, 2), places(&store, 3)),
        (vec![here, there], vec![here])
    );
    let newest = [mark_at(3, 1000), mark_at(2, 4000), mark];
    assert_eq!(store.newest_marks(9).unwrap(), newest);
    assert_eq!(store.newest_marks(2).unwrap(), newest[..2]);
    let back = Mark {
        stands: false,
        ..mark
    };
    store.keep_mark(back).unwrap();
    store.keep_mark(back).unwrap();
    drop(store);
    let store = GroundStore::open(&path_in(&folder), &START).unwrap();
    assert_eq!(
        (places(&store, 2), places(&store, 3)),
        (vec![there], vec![here])
    );
}

#[test]
fn samples_that_were_stored_with_more_digits_are_read_rounded() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = GroundStore::open(&path_in(&folder), &START).unwrap();
    store.take(&[batch(1, 1, 0..1)]).unwrap();
    let finer = "UPDATE samples SET rx_x_m = 0.1234567, rx_heading_rad = -3.0000123, rx_sd_m = 0.0512345, tx_sd_m = NULL";
    store.connection.execute(finer, []).unwrap();
    let restored = store.resume().unwrap();
    let sample = restored.samples[0].samples[0];
    assert_eq!(
        (sample.receiver_pose.at.x_mm, sample.receiver_pose.sd.0),
        (123, 51)
    );
    assert_eq!(sample.receiver_pose.heading.0, 32_832);
    assert_eq!(
        sample.transmitter_pose.sd,
        tomoswarm_proto::Deviation::UNKNOWN
    );
}

fn picture(laps: usize) -> ReconstructedImage {
    let area = Rect::new(Point::new(-1.0, 0.0), Point::new(2.0, 2.0));
    let values = vec![0.5, -0.25, laps as f64, 0.0, 1.0, 2.0];
    let image = Image {
        grid: PixelGrid {
            area,
            columns: 3,
            rows: 2,
        },
        values,
    };
    let peaks = vec![Peak {
        at: Point::new(0.3, 1.1),
        strength: 2.0,
        significance: Some(8.0),
    }];
    let find = Find {
        at: Point::new(0.31, 1.12),
        strength: 9.5,
        covariance_m2: [0.01, -0.002, 0.02],
        evidence: 22.0,
        probability: 0.999,
    };
    let finds = Finds {
        found: vec![find],
        next: None,
        threshold: 9.1,
        false_per_image: 0.02,
    };
    let result = Reconstruction {
        finds: Some(finds),
        deviation: Some(vec![0.5, 0.25, 0.125, 1.0, 2.0, 4.0]),
        shares: None,
        choice: None,
        links: None,
        image,
        peaks,
        residual_rms_db: 1.5,
        used: 321,
        dropped: Default::default(),
        path_loss: None,
        by_empty_sweep: true,
    };
    ReconstructedImage {
        run: RunId(2),
        laps,
        subject: Subject::Change,
        stage: ImageStage::Lap,
        result: Ok(result),
    }
}

fn check_refused(content: impl FnOnce(&Path), start: &Start, words: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = path_in(&folder);
    content(&path);
    let before = std::fs::read(&path).unwrap();
    let error = GroundStore::open(&path, start).unwrap_err().to_string();
    assert!(
        error.contains(words) && error.contains("swarm.db"),
        "{error}"
    );
    assert_eq!(
        std::fs::read(&path).unwrap(),
        before,
        "a refused file is not touched"
    );
}

fn make(path: &Path) -> GroundStore {
    let mut store = GroundStore::open(path, &START).unwrap();
    store.take(&[batch(1, 1, 0..2000)]).unwrap();
    store
}

#[test]
fn what_is_no_store_of_this_venue_and_version_is_refused_untouched() {
    check_refused(
        |path| std::fs::write(path, "garbage ".repeat(999)).unwrap(),
        &START,
        "no database",
    );
    let foreign = |path: &Path| {
        let connection = Connection::open(path).unwrap();
        connection
            .execute_batch("CREATE TABLE phones (number TEXT)")
            .unwrap();
    };
    check_refused(foreign, &START, "another database");
    let elsewhere = Start {
        venue_hash: 1,
        ..START
    };
    check_refused(|path| drop(make(path)), &elsewhere, "another venue");
    let older = |path: &Path| make(path).connection.execute_batch(BACK_TO_3).unwrap();
    check_refused(older, &elsewhere, "another venue");
    let newer = |path: &Path| {
        make(path)
            .connection
            .pragma_update(None, "user_version", 99)
            .unwrap()
    };
    check_refused(
        newer,
        &START,
        "newer tomoswarm (store version 99, this one knows 4)",
    );
    let damaged = |path: &Path| {
        drop(make(path));
        let mut bytes = std::fs::read(path).unwrap();
        let half = bytes.len() / 2;
        bytes[half..half + 20_000].fill(0xa5);
        std::fs::write(path, bytes).unwrap();
    };
    check_refused(damaged, &START, "damaged");
}

#[test]
fn an_empty_file_becomes_a_store_but_holds_nothing_to_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = path_in(&folder);
    std::fs::write(&path, b"").unwrap();
    let error = GroundStore::open_to_read(&path).unwrap_err().to_string();
    assert!(error.contains("found an empty file"), "{error}");
    drop(make(&path));
    assert_eq!(count(&GroundStore::open_to_read(&path).unwrap()), 2000);
    let error = GroundStore::open_to_read(folder.path())
        .unwrap_err()
        .to_string();
    assert!(error.contains("no file"), "{error}");
}

#[test]
fn a_second_ground_station_is_kept_out_and_readers_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    let error = GroundStore::open(&path_in(&folder), &START).unwrap_err();
    assert!(matches!(error, StoreError::InUse { .. }), "{error}");
    let reader = GroundStore::open_to_read(&path_in(&folder)).unwrap();
    store.take(&[batch(1, 1, 2000..2500)]).unwrap();
    assert_eq!(count(&reader), 2500);
}

#[test]
fn another_program_that_holds_the_file_delays_and_spoils_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    store
        .connection
        .busy_timeout(Duration::from_millis(20))
        .unwrap();
    let other = Connection::open(path_in(&folder)).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let error = store.take(&[batch(1, 1, 1990..2010)]).unwrap_err();
    assert!(matches!(error, StoreError::InUse { .. }), "{error}");
    other.execute_batch("ROLLBACK").unwrap();
    assert_eq!(store.take(&[batch(1, 1, 1990..2010)]).unwrap(), 10);
}

#[test]
fn a_full_disk_stores_nothing_by_halves_and_later_everything() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    // As a full disk does: no page more than there are.
    let set = |store: &GroundStore, pages: i64| {
        store
            .connection
            .query_row(&format!("PRAGMA max_page_count = {pages}"), [], |_| Ok(()))
            .unwrap();
    };
    set(&store, 1);
    let both = [batch(1, 1, 2000..2003), batch(7, 3, 0..20_000)];
    let error = store.take(&both).unwrap_err();
    assert!(matches!(error, StoreError::Full { .. }), "{error}");
    assert_eq!((count(&store), store.runs().unwrap().len()), (2000, 1));
    assert!(store.remember(&[0; 1 << 20]).is_err());
    set(&store, 1 << 30);
    assert_eq!(store.take(&both).unwrap(), 20_003);
    store.remember(b"all is well").unwrap();
    assert_eq!(
        store.memory().unwrap().as_deref(),
        Some(&b"all is well"[..])
    );
}

#[test]
fn a_disk_that_turns_read_only_stores_nothing_and_later_everything() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    store
        .connection
        .pragma_update(None, "query_only", true)
        .unwrap();
    let error = store.take(&[batch(1, 1, 2000..2010)]).unwrap_err();
    assert!(matches!(error, StoreError::ReadOnly { .. }), "{error}");
    store
        .connection
        .pragma_update(None, "query_only", false)
        .unwrap();
    assert_eq!(store.take(&[batch(1, 1, 2000..2010)]).unwrap(), 10);
}

/// Names the variable by which the test below tells its child the file.
const CHILD: &str = "TOMOSWARM_TEST_STORE";

/// The child's part: stores sample after sample in small groups, and says how far it is after each.
#[test]
fn child_that_is_killed() {
    let Ok(path) = std::env::var(CHILD) else {
        return;
    };
    let mut store = GroundStore::open(Path::new(&path), &START).unwrap();
    let mut next = count(&store) as u64;
    let mut out = std::io::stdout();
    loop {
        store.take(&[batch(1, 1, next..next + 40)]).unwrap();
        store.remember(&next.to_le_bytes()).unwrap();
        next += 40;
        writeln!(out, "stored {next}").unwrap();
        out.flush().unwrap();
    }
}

#[test]
fn a_process_that_is_killed_has_lost_and_doubled_nothing_that_it_had_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let path = path_in(&folder);
    let mut acknowledged = 0;
    for round in 0..6 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "store::ground::tests::child_that_is_killed",
                "--nocapture",
            ])
            .env(CHILD, &path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let stored = lines
            .map_while(Result::ok)
            .filter_map(|line| line.strip_prefix("stored ")?.parse().ok());
        // Killed at another moment each time, and without waiting for the next commit.
        acknowledged = stored.take(3 + 7 * round).last().unwrap_or(acknowledged);
        child.kill().unwrap();
        child.wait().unwrap();
        let store = GroundStore::open(&path, &START).unwrap();
        let sound: String = store
            .connection
            .query_row("PRAGMA integrity_check", [], |row| row.get(0))
            .unwrap();
        assert_eq!(sound, "ok");
        let mut expected = 0;
        store
            .each_sample(None, |stored| {
                assert_eq!(stored.sample, sample(expected));
                expected += 1;
            })
            .unwrap();
        assert!(
            expected >= acknowledged && expected.is_multiple_of(40),
            "{expected} of {acknowledged}"
        );
        let memory = store.memory().unwrap().unwrap();
        let remembered = u64::from_le_bytes(memory.try_into().unwrap());
        assert!(remembered + 40 >= acknowledged && remembered < expected);
    }
    assert!(acknowledged > 0);
}

/// Returns the SQL examples of the documentation.
fn documented_queries() -> Vec<String> {
    let page = include_str!("../../../docs/store.md");
    let blocks = page
        .split("```sql\n")
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap().to_owned());
    blocks.collect()
}

#[test]
fn the_documented_queries_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = make(&path_in(&folder));
    store.take(&[batch(9, 1, 0..5), batch(9, 1, 8..9)]).unwrap();
    store.keep_picture(&picture(3)).unwrap();
    store.keep_mark(mark_at(2, 1000)).unwrap();
    let answers: Vec<Vec<String>> = documented_queries()
        .iter()
        .map(|query| {
            let mut statement = store.connection.prepare(query).unwrap();
            let columns = statement.column_count();
            let cell = |row: &rusqlite::Row, index| format!("{:?}", row.get_ref(index).unwrap());
            let line = |row: &rusqlite::Row| {
                Ok((0..columns)
                    .map(|index| cell(row, index))
                    .collect::<Vec<_>>()
                    .join(" "))
            };
            statement
                .query_map([], line)
                .unwrap()
                .map(Result::unwrap)
                .collect()
        })
        .collect();
    assert_eq!(answers.len(), 5);
    assert_eq!(answers[0].len(), 2);
    assert!(
        answers[0][0].starts_with("Integer(1) Integer(1) Integer(2000) Integer(667) Real(-61.0)")
    );
    assert_eq!(answers[1], ["Integer(9) Integer(4) Integer(1) Integer(3)"]);
    assert_eq!(answers[2].len(), 1);
    assert!(
        answers[3][0].ends_with("Real(0.3) Real(1.1) Real(2.0)"),
        "{:?}",
        answers[3]
    );
    assert!(
        answers[4].len() == 1
            && answers[4][0].starts_with("Integer(2) Real(1.0) Real(-2.25) Real(11.83"),
        "{:?}",
        answers[4]
    );
}
