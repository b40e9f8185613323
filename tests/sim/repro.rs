//! Cases that once went wrong, where they lie beside the project: the quick ones. All of them:
//! `cargo bench --bench floor_plans -- repro`.

use std::time::Duration;

use crate::cases;

/// A case that takes longer is stopped, and is not judged by its end.
const LIMIT: Duration = Duration::from_secs(20);
/// Those that take long in a build of the tests.
const SLOW: [&str; 2] = ["gps_slow", "run154"];
/// Those in which something is touched today.
const TOUCH: [&str; 2] = ["pole", "run1214"];

#[test]
fn cases_that_once_went_wrong_end_without_a_panic_and_without_new_contacts() {
    let Some(folder) = cases::folder_beside() else {
        return;
    };
    for name in cases::names(&folder) {
        if SLOW.contains(&name.as_str()) {
            println!("{name}: left out, it takes long");
            continue;
        }
        let end = cases::run(&folder, &name, LIMIT);
        println!("{end}");
        assert!(!end.has_panicked, "{end}");
        let may_touch = TOUCH.contains(&name.as_str());
        assert!(may_touch || end.collisions == 0, "{end}");
    }
}
