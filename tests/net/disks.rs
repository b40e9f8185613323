//! What a node does on a disk that fills: recordings give way first, and its start is counted whatever else is on the disk.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use tomoswarm::geom::Lattice;
use tomoswarm::run::state_dir::StateDir;
use tomoswarm::store::recording::{Recorder, RecordingLimits, RecordingSubject};
use tomoswarm_proto::StationPhase;

use crate::small_disk::SmallDisk;
use crate::swarm::{Size, Swarm};

/// Writes a file until the disk has no room.
fn fill(path: &Path) {
    let mut file = File::create(path).unwrap();
    while file.write_all(&[1; 512]).is_ok() {}
}

fn flights(folder: &Path) -> usize {
    fs::read_dir(folder.join("flight")).map_or(0, Iterator::count)
}

/// A disk of 16 MB, of which 2 MB are kept free.
fn on_small_disk(test: impl FnOnce(&Path)) {
    let folder = tempfile::tempdir().unwrap();
    if let Some(_disk) = SmallDisk::mount(folder.path(), 16_384) {
        test(folder.path());
    }
}

#[test]
fn a_start_is_counted_on_a_disk_that_recordings_have_filled() {
    on_small_disk(|path| {
        let first = StateDir::open(path).unwrap().boot();
        fs::create_dir(path.join("flight")).unwrap();
        for number in 1..=4 {
            let segment = format!("flight/flight-{number:06}.mcap");
            fs::write(path.join(segment), vec![0; 3 << 20]).unwrap();
        }
        fill(&path.join("flight/flight-000005.mcap"));
        let state = StateDir::open(path).unwrap();
        assert_eq!(state.boot().0, first.0 + 1);
        assert_eq!(flights(path), 4, "the oldest has given way");
        assert!(state.free_mb().unwrap() >= 2);
    });
}

#[test]
fn a_start_is_counted_on_a_disk_that_others_have_filled() {
    on_small_disk(|path| {
        let first = StateDir::open(path).unwrap().boot();
        fill(&path.join("rest"));
        assert!(fs::write(path.join("more"), [1; 512]).is_err());
        for count in 1..=3 {
            assert_eq!(StateDir::open(path).unwrap().boot().0, first.0 + count);
        }
        assert!(!path.join("reserve").exists(), "that was the room for it");
        fs::remove_file(path.join("rest")).unwrap();
        drop(StateDir::open(path).unwrap());
        assert!(path.join("reserve").exists(), "it is made again");
    });
}

#[test]
fn a_recording_leaves_the_reserve_free_and_goes_on_when_there_is_room() {
    on_small_disk(|path| {
        let about = RecordingSubject {
            node: "vehicle/1".to_owned(),
            settings: String::new(),
            venue: String::new(),
            lattice: Lattice::new(0.2),
            start: None,
            utc_at_zero_ns: None,
        };
        let limits = RecordingLimits {
            cap_bytes: 4_000_000,
            segment_bytes: 500_000,
            leaves_reserve: true,
            ..RecordingLimits::default()
        };
        let recorder = Recorder::start(path.join("flight"), about, limits);
        assert_eq!(recorder.trouble(), None);
        let until = |what: &dyn Fn() -> bool| {
            let begun = Instant::now();
            while !what() {
                assert!(begun.elapsed() < Duration::from_secs(30));
                std::thread::sleep(Duration::from_millis(50));
            }
        };
        // Others leave 1 MB: less than is kept free.
        let rest = vec![1; (15 << 20) - 100_000];
        fs::write(path.join("rest"), rest).unwrap();
        until(&|| recorder.trouble().is_some());
        let trouble = recorder.trouble().unwrap();
        assert!(
            trouble.contains("2 MB are kept free for samples"),
            "{trouble}"
        );
        fs::remove_file(path.join("rest")).unwrap();
        until(&|| recorder.trouble().is_none());
        assert!(recorder.disk_use().used_bytes <= 4_000_000);
    });
}

#[test]
fn a_ground_whose_folder_is_removed_says_so_and_closes_no_run() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    swarm.begin();
    swarm.until_samples(50);
    fs::remove_dir_all(swarm.path("state-g")).unwrap();
    swarm.until("it is said", 20, |watch| {
        let is_gone = |trouble: &String| trouble.contains("was removed or replaced");
        watch.report().troubles.iter().any(is_gone)
    });
    swarm.until("the last samples are waited for", 120, |watch| {
        watch.report().phase == StationPhase::Closing
    });
    std::thread::sleep(Duration::from_secs(6));
    let phase = swarm.look(|watch| watch.report().phase);
    assert_eq!(phase, StationPhase::Closing);
    swarm.kill("ground");
}
