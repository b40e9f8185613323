//! What the ground's process says and stores, also when its disk is in trouble.

use tomoswarm_proto::{Plan, Revision, RunId, Sample, Samples};

use super::*;

const VENUE: u64 = 5;

fn store(folder: &Path) -> GroundStore {
    let start = Start {
        venue_hash: VENUE,
        new_id: 7,
        ..Start::default()
    };
    GroundStore::open(&folder.join("ground.sqlite"), &start).unwrap()
}

#[test]
fn what_is_wrong_with_the_process_is_said_beside_what_the_station_says() {
    let report = GroundReport {
        troubles: vec!["not heard yet: vehicle 3".to_owned()],
        ..GroundReport::default()
    };
    let output = with_troubles(report, vec!["samples: no room".to_owned()]).troubles;
    assert_eq!(output, ["not heard yet: vehicle 3", "samples: no room"]);
}

#[test]
fn what_could_not_be_stored_is_stored_later_and_each_trouble_ends_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let troubles = Troubles::default();
    let archive = Archive::new(store(folder.path()), troubles.clone());
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
fn software_is_noted_once_and_never_of_an_older_start() {
    let folder = tempfile::tempdir().unwrap();
    let archive = Archive::new(store(folder.path()), Troubles::default());
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
    let sample = Sample {
        sequence: 0,
        heard_at_ns: 0,
        transmitter: VehicleId(9),
        transmitter_pose: Default::default(),
        receiver_pose: Default::default(),
        channel: 11,
        power_dbm: 0,
        rssi_dbm: None,
    };
    let batch = |id| Samples {
        vehicle: VehicleId(id),
        boot: Boot(1),
        run: RunId(1),
        samples: vec![sample],
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
