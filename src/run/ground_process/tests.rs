//! What the ground's process says and stores, also when its disk is in trouble.

use tomoswarm_proto::{
    Deviation, Heading, Mark, OperatorId, Plan, PoseReport, Position, Revision, RunId, Sample,
    Samples,
};

use super::super::state_dir::FolderPlace;
use super::*;

const VENUE: u64 = 5;
const SAMPLE: Sample = Sample {
    sequence: 0,
    heard_at_ns: 0,
    transmitter: VehicleId(9),
    transmitter_pose: NOWHERE,
    receiver_pose: NOWHERE,
    channel: 11,
    power_dbm: 0,
    rssi_dbm: None,
};
const NOWHERE: PoseReport = PoseReport {
    at: Position {
        x_mm: 0,
        y_mm: 0,
        z_mm: 0,
    },
    heading: Heading(0),
    sd: Deviation::UNKNOWN,
};

fn store(folder: &Path) -> GroundStore {
    let start = Start {
        venue_hash: VENUE,
        new_id: 7,
        ..Start::default()
    };
    GroundStore::open(&folder.join("ground.sqlite"), &start).unwrap()
}

fn archive(folder: &Path, troubles: Troubles) -> Archive {
    let lock = folder.join("lock");
    std::fs::write(&lock, "").unwrap();
    Archive::new(store(folder), FolderPlace::of(lock).unwrap(), troubles)
}

#[test]
fn a_store_whose_thread_has_ended_is_a_trouble() {
    let (troubles, node) = (Troubles::default(), LiveGround::default());
    let (end, ended) = std::sync::mpsc::channel::<()>();
    let keeper = std::thread::spawn(move || {
        let _ = ended.recv();
    });
    watch_store(&keeper, &node, &troubles);
    assert!(troubles.list().is_empty());
    drop(end);
    while !keeper.is_finished() {
        std::thread::yield_now();
    }
    watch_store(&keeper, &node, &troubles);
    let told = troubles.list();
    assert_eq!(told, ["store: its thread has ended; start the node anew"]);
}

#[test]
fn a_disk_without_room_for_a_run_is_a_trouble_as_long_as_it_is_so() {
    let troubles = Troubles::default();
    let said = |free_mb, recording| {
        watch_disk(free_mb, recording, &troubles);
        troubles.list()
    };
    assert_eq!(said(Some(201), None), [""; 0]);
    let short = ["disk: 200 MB free, over 200 MB needed"];
    assert_eq!(said(Some(200), None), short);
    assert_eq!(said(Some(201), None), [""; 0]);
    let recording = Some(RecordingHealth {
        used_mb: 100,
        limit_mb: 4000,
    });
    let short = "disk: 4100 MB free, over 4100 MB needed: 200 MB, and 3900 MB for recordings (100 of 4000 MB)";
    assert_eq!(said(Some(4100), recording), [short]);
    assert_eq!(said(None, recording), [""; 0], "nobody says it");
}

#[test]
fn what_could_not_be_stored_is_stored_later_and_each_trouble_ends_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let troubles = Troubles::default();
    let archive = archive(folder.path(), troubles.clone());
    let reader = rusqlite::Connection::open(folder.path().join("ground.sqlite")).unwrap();
    let stop = |table: &str| {
        let no = format!(
            "CREATE TRIGGER no_{table} BEFORE INSERT ON {table} BEGIN SELECT raise(ABORT, 'no'); END"
        );
        reader.execute_batch(&no).unwrap();
    };
    let go = |table: &str| {
        reader
            .execute_batch(&format!("DROP TRIGGER no_{table}"))
            .unwrap()
    };
    let count = |query: &str| {
        reader
            .query_row(query, [], |row| row.get::<_, i64>(0))
            .unwrap()
    };
    ["memory", "plans", "runs"].into_iter().for_each(stop);
    let plan = |vehicle| Plan {
        vehicle: VehicleId(vehicle),
        run: RunId(1),
        revision: Revision(2),
        ..Plan::default()
    };
    archive.remember(vec![1]);
    archive.remember(vec![2, 2]);
    archive.hold_plan(&plan(1));
    archive.hold_plan(&plan(2));
    archive.hold_run(RunId(1), None);
    assert!(!archive.keep(true));
    archive.hold_end(RunId(1));
    assert_eq!(troubles.list().len(), 3, "{:?}", troubles.list());
    go("plans");
    assert!(!archive.keep(true));
    assert_eq!(
        (troubles.list().len(), count("SELECT count(*) FROM plans")),
        (2, 2),
        "{:?}",
        troubles.list()
    );
    go("memory");
    go("runs");
    assert!(archive.keep(true));
    assert!(troubles.list().is_empty());
    assert_eq!(count("SELECT length(blob) FROM memory"), 2, "the newest");
    assert_eq!(
        count("SELECT count(*) FROM runs WHERE closed_utc_s IS NOT NULL"),
        1
    );
    // A plan that is stored is not written again.
    stop("plans");
    archive.hold_plan(&plan(1));
    assert!(archive.keep(true));
}

#[test]
fn what_nobody_would_find_is_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state");
    std::fs::create_dir(&state).unwrap();
    let archive = archive(&state, Troubles::default());
    let batch = Samples {
        vehicle: VehicleId(1),
        samples: vec![SAMPLE],
        ..Samples::default()
    };
    assert!(archive.keep_samples(std::slice::from_ref(&batch)));
    std::fs::remove_dir_all(&state).unwrap();
    assert!(!archive.keep_samples(std::slice::from_ref(&batch)));
    std::fs::create_dir(&state).unwrap();
    std::fs::write(state.join("lock"), "").unwrap();
    assert!(!archive.keep_samples(&[batch]), "it is another folder");
}

#[test]
fn a_store_that_works_again_is_noticed_although_nobody_repeats_anything() {
    let folder = tempfile::tempdir().unwrap();
    let archive = Arc::new(archive(folder.path(), Troubles::default()));
    let reader = rusqlite::Connection::open(folder.path().join("ground.sqlite")).unwrap();
    let no = "CREATE TRIGGER no BEFORE INSERT ON samples BEGIN SELECT raise(ABORT, 'no'); END";
    reader.execute_batch(no).unwrap();
    let (to_store, wanted) = sync_channel(8);
    let (told, events) = std::sync::mpsc::channel();
    let keeper = keeper(archive, wanted, move |event| drop(told.send(event))).unwrap();
    let next = || {
        events
            .recv_timeout(std::time::Duration::from_secs(20))
            .unwrap()
    };
    to_store
        .send(StoreJob::Samples(Samples {
            vehicle: VehicleId(1),
            samples: vec![SAMPLE],
            ..Samples::default()
        }))
        .unwrap();
    assert!(matches!(next(), Event::StoresSamples(false)));
    reader.execute_batch("DROP TRIGGER no").unwrap();
    let mut event = next();
    while matches!(event, Event::StoresSamples(false)) {
        event = next();
    }
    assert!(matches!(event, Event::StoresSamples(true)), "{event:?}");
    assert!(matches!(next(), Event::Bus(_, Message::Samples(_))));
    to_store.send(StoreJob::End).unwrap();
    keeper.join().unwrap();
}

#[test]
fn software_is_noted_once_and_never_of_an_older_start() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), Troubles::default());
    let reader = rusqlite::Connection::open(folder.path().join("ground.sqlite")).unwrap();
    let say = |boot, software: &str| {
        archive.hold_software(VehicleId(1), Boot(boot), software.to_owned());
        archive.keep(true)
    };
    assert!(say(4, "0.1.0"));
    reader
        .execute_batch(
            "CREATE TRIGGER no BEFORE INSERT ON vehicles BEGIN SELECT raise(ABORT, 'no'); END",
        )
        .unwrap();
    assert!(say(4, "0.1.0") && say(3, "0.1.0"), "nothing is written");
    assert!(!say(5, "0.1.0"), "that is new");
}

#[test]
fn what_strangers_have_sent_before_is_passed_over_after_a_restart() {
    let settings = station::StationSettings {
        vehicles: vec![VehicleId(1)],
        lease: None,
        holder: 1,
        take_over: false,
        boot: Boot(1),
        compare_with: None,
        lost_after: std::time::Duration::from_secs(30),
        autonomy: std::time::Duration::from_secs(60),
        store: 7,
        lattice: crate::geom::Lattice::new(0.2),
        image_times: crate::config::ImageTimes::Free,
        bin_m: 0.5,
        fence_m: 72.0,
        spot_m: 0.06,
    };
    let batch = |id| Samples {
        vehicle: VehicleId(id),
        boot: Boot(1),
        run: RunId(1),
        samples: vec![SAMPLE],
        lost: vec![],
    };
    let restored = RestoredStore {
        samples: vec![batch(1), batch(2)],
        ..RestoredStore::default()
    };
    let station = resume(settings, restored, &BTreeSet::from([VehicleId(1)]));
    assert_eq!(station.samples().count(RunId(1)), 1);
    assert_eq!(
        station.samples().have(&BTreeSet::new(), 0).watermarks.len(),
        1
    );
}

#[test]
fn who_comes_is_told_the_last_marks_and_however_many_come_they_are_told_once_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let archive = Arc::new(archive(folder.path(), Troubles::default()));
    let mark = |run: u32, x_mm: i32| Mark {
        run: RunId(run),
        at: Position {
            x_mm,
            ..Position::default()
        },
        stands: true,
    };
    for place in 0..40 {
        assert!(archive.keep_mark(mark(1, place)) && archive.keep_mark(mark(2, place)));
    }
    let (to_store, wanted) = sync_channel(64);
    let (told, events) = std::sync::mpsc::channel();
    let keeper = keeper(archive, wanted, move |event| drop(told.send(event))).unwrap();
    let began = std::time::Instant::now();
    for _ in 0..30 {
        to_store.send(StoreJob::TellMarks).unwrap();
    }
    let next = || {
        let event = events.recv_timeout(std::time::Duration::from_secs(20));
        match event.unwrap() {
            Event::Bus(Sender::Ground, Message::Mark(mark)) => mark,
            other => panic!("{other:?}"),
        }
    };
    let first: Vec<Mark> = (0..50).map(|_| next()).collect();
    assert!(first[..40].iter().all(|mark| mark.run == RunId(2)));
    assert!(first[40..].iter().all(|mark| mark.run == RunId(1)));
    // Those who come after that are told together, a second later.
    for _ in 0..30 {
        to_store.send(StoreJob::TellMarks).unwrap();
    }
    let again: Vec<Mark> = (0..50).map(|_| next()).collect();
    assert_eq!(again, first);
    assert!(began.elapsed() >= std::time::Duration::from_secs(1));
    to_store.send(StoreJob::End).unwrap();
    keeper.join().unwrap();
    assert!(events.try_recv().is_err(), "nothing more was said");
}

#[test]
fn marks_that_could_not_be_stored_are_stored_later_in_their_order_and_the_trouble_ends() {
    let folder = tempfile::tempdir().unwrap();
    let troubles = Troubles::default();
    let archive = Arc::new(archive(folder.path(), troubles.clone()));
    let reader = rusqlite::Connection::open(folder.path().join("ground.sqlite")).unwrap();
    let no = "CREATE TRIGGER no BEFORE INSERT ON marks BEGIN SELECT raise(ABORT, 'no'); END";
    reader.execute_batch(no).unwrap();
    let (to_store, wanted) = sync_channel(8);
    let (told, events) = std::sync::mpsc::channel();
    let store = archive.clone();
    let keeper = keeper(archive, wanted, move |event| drop(told.send(event))).unwrap();
    let mark = |x_mm: i32, stands: bool| Mark {
        run: RunId(1),
        at: Position {
            x_mm,
            ..Position::default()
        },
        stands,
    };
    // What is said last of a place counts, however often it was changed meanwhile.
    let said = [
        mark(1, true),
        mark(2, true),
        mark(1, false),
        mark(2, false),
        mark(2, true),
        mark(1, false),
    ];
    for mark in said {
        let job = StoreJob::Mark(Sender::Operator(OperatorId(1)), mark);
        to_store.send(job).unwrap();
    }
    while troubles.list().is_empty() {
        std::thread::yield_now();
    }
    reader.execute_batch("DROP TRIGGER no").unwrap();
    for expected in &said[4..] {
        let event = events.recv_timeout(std::time::Duration::from_secs(20));
        match event.unwrap() {
            Event::Bus(Sender::Operator(_), Message::Mark(mark)) => assert_eq!(mark, *expected),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(store.newest_marks(9), [mark(2, true)]);
    assert_eq!(troubles.list(), Vec::<String>::new());
    to_store.send(StoreJob::End).unwrap();
    keeper.join().unwrap();
}
