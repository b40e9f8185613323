//! Who rides with a vehicle of a live swarm sees what its range sensors hear, and they say it only as long as somebody rides.

use std::time::Duration;

use serde_json::json;

use crate::dash::{live_page, shot};
use crate::page_3d::{key, until_drawn};

#[test]
fn who_rides_sees_what_the_sensors_hear_and_they_say_it_to_nobody_else() {
    let Some((mut browser, swarm, _dash)) = live_page(1280, 800) else {
        return;
    };
    std::thread::sleep(Duration::from_secs(3));
    assert_eq!(swarm.look(|watch| watch.looks), 0, "nobody has asked");
    assert_eq!(browser.eval("tomoswarm.model.looks.size"), json!(0));

    browser.key("2", "Digit2", 50);
    key(&mut browser, 'g');
    until_drawn(&mut browser, "ride");
    browser.until("tomoswarm.model.looks.get(2)?.readings.length >= 7", 20);
    assert_eq!(
        browser.eval("[...tomoswarm.model.looks.keys()]"),
        json!([2])
    );
    // Seven beams, ten readings a second, of two seconds.
    browser.until("tomoswarm.model.looks.get(2).readings.length >= 15", 10);
    let is_as_set = browser.eval(
        "(() => { const { readings, halfAngle_rad, maxRange_m } = tomoswarm.model.looks.get(2), { x, y } = tomoswarm.model.states.get(2);
           return readings.every(([rx, ry, , , range, age]) => Math.hypot(rx - x, ry - y) < 1 && (range === null || range <= maxRange_m) && age <= 2.1)
             && halfAngle_rad > 0 && maxRange_m > 1; })()",
    );
    assert_eq!(is_as_set, json!(true));
    // The body, how sure its place is, free cones, echoes, and echoes that may be none.
    browser.until(
        "tomoswarm.view.space.layers.groups.get('vehicle 2').children.length === 5",
        10,
    );
    shot(&mut browser, "ride-live");
    assert!(
        swarm.look(|watch| watch.looks) > 5,
        "both vehicles say them"
    );

    key(&mut browser, 'v');
    browser.until("!document.getElementById('plane').hidden", 5);
    // Vehicles stop when the greetings of ten seconds have asked for nothing.
    std::thread::sleep(Duration::from_secs(12));
    let before = swarm.look(|watch| watch.looks);
    std::thread::sleep(Duration::from_secs(3));
    assert_eq!(
        swarm.look(|watch| watch.looks),
        before,
        "nobody rides any more"
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}
