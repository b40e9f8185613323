//! What becomes a reading of what an autopilot says of distances, and what never does.

use super::*;

/// A sensor ahead, one to the left and one on a servo astern.
fn ranges() -> Ranges {
    let sensor = |sensor, mounted_deg, is_turned| AutopilotSensor {
        sensor,
        mounted: Angle::from_degrees(mounted_deg),
        is_turned,
        nothing_from_m: None,
        delay: Duration::from_millis(40),
    };
    Ranges::new(RangeSettings {
        sensors: vec![
            sensor(0, 0.0, false),
            sensor(1, 90.0, false),
            sensor(2, 180.0, true),
        ],
        half_angle: Angle::from_degrees(15.0),
        max_range_m: 4.0,
        rate_hz: 40,
    })
}

fn vouched(nothing_from_m: f64) -> Ranges {
    let mut ranges = ranges();
    ranges.settings.sensors[0].nothing_from_m = Some(nothing_from_m);
    ranges
}

const FROM: MavAddress = MavAddress {
    system: 1,
    component: 1,
};

fn ahead(current_distance: u16) -> DISTANCE_SENSOR_DATA {
    DISTANCE_SENSOR_DATA {
        min_distance: 20,
        max_distance: 700,
        current_distance,
        orientation: MavSensorOrientation::MAV_SENSOR_ROTATION_NONE,
        ..DISTANCE_SENSOR_DATA::default()
    }
}

/// All around, five degrees each, at 6 m.
fn around() -> OBSTACLE_DISTANCE_DATA {
    OBSTACLE_DISTANCE_DATA {
        distances: [600; 72],
        increment: 5,
        min_distance: 20,
        max_distance: 800,
        frame: MavFrame::MAV_FRAME_BODY_FRD,
        ..OBSTACLE_DISTANCE_DATA::default()
    }
}

/// Says a message often enough that the clock is known; the last at one second, said 10 ms after its own time of 5 s.
fn told(ranges: &mut Ranges, message: impl Fn(u64) -> MavMessage) -> Vec<AutopilotReading> {
    let mut out = Vec::new();
    for step in 0..=10u64 {
        out.clear();
        let now = Time::from_nanos((500 + 50 * step) * 1_000_000);
        let own_ms = 4500 + 50 * step;
        assert!(ranges.hear(now, FROM, &message(own_ms), &mut out));
    }
    readings(&out)
}

fn readings(out: &[DriverOut]) -> Vec<AutopilotReading> {
    let reading = |said: &DriverOut| match said {
        DriverOut::Reading(reading) => *reading,
        other => panic!("{other:?}"),
    };
    out.iter().map(reading).collect()
}

fn told_distance(ranges: &mut Ranges, said: &DISTANCE_SENSOR_DATA) -> Vec<AutopilotReading> {
    told(ranges, |own_ms| {
        let mut said = said.clone();
        said.time_boot_ms = own_ms as u32;
        MavMessage::DISTANCE_SENSOR(said)
    })
}

fn told_around(ranges: &mut Ranges, said: &OBSTACLE_DISTANCE_DATA) -> Vec<AutopilotReading> {
    told(ranges, |own_ms| {
        let mut said = said.clone();
        said.time_usec = own_ms * 1000;
        MavMessage::OBSTACLE_DISTANCE(said)
    })
}

#[test]
fn a_distance_is_a_reading_of_the_sensor_that_is_mounted_there() {
    let reading = |sensor| AutopilotReading {
        sensor,
        measured: Time::from_nanos(960_000_000),
        range_m: Some(1.5),
    };
    for (orientation, sensor) in [
        (MavSensorOrientation::MAV_SENSOR_ROTATION_NONE, Some(0)),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_270, Some(1)),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_180, Some(2)),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_180, Some(2)),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_90, None),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_YAW_45, None),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270, None),
        (MavSensorOrientation::MAV_SENSOR_ROTATION_CUSTOM, None),
    ] {
        let mut said = ahead(150);
        said.orientation = orientation;
        let expected: Vec<AutopilotReading> = sensor.map(reading).into_iter().collect();
        let found = told_distance(&mut ranges(), &said);
        assert_eq!(found, expected, "{orientation:?}");
    }
}

#[test]
fn what_a_distance_sensor_cannot_have_measured_is_no_reading_and_never_nothing() {
    for current_cm in [0, 19, 700, 701, 800, 65_534, 65_535] {
        let mut ranges = ranges();
        assert_eq!(told_distance(&mut ranges, &ahead(current_cm)), []);
        let tally = ranges.tallies()[&0];
        assert_eq!((tally.heard, tally.dropped), (11, 11), "{current_cm} cm");
        assert!(matches!(tally.fault, Some(RangeFault::OutOfRange { .. })));
    }
    let mut invalid = ahead(150);
    invalid.signal_quality = 1;
    assert_eq!(told_distance(&mut ranges(), &invalid), []);
    assert_eq!(told_distance(&mut vouched(1.0), &invalid), []);
    invalid.signal_quality = 2;
    assert_eq!(told_distance(&mut ranges(), &invalid).len(), 1);
    let mut no_range = ahead(150);
    (no_range.min_distance, no_range.max_distance) = (700, 700);
    assert_eq!(told_distance(&mut ranges(), &no_range), []);
}

#[test]
fn a_distance_sensor_says_that_nothing_is_there_only_by_the_number_in_the_file() {
    let range = |current_cm| {
        let found = told_distance(&mut vouched(7.0), &ahead(current_cm));
        found.first().map(|reading| reading.range_m)
    };
    assert_eq!(range(699), Some(Some(6.99)));
    assert_eq!(range(700), Some(None));
    assert_eq!(range(800), Some(None));
    assert_eq!([0, 19, 65_535].map(range), [None, None, None]);
    // It looks less far than the vehicle believes.
    let mut short = ahead(800);
    short.max_distance = 399;
    let mut ranges = vouched(7.0);
    assert_eq!(told_distance(&mut ranges, &short), []);
    let fault = ranges.tallies()[&0].fault.unwrap().to_string();
    assert!(fault.contains("looks 3.99 m far, not 4.00 m"), "{fault}");
}

#[test]
fn a_message_that_was_under_way_for_long_is_as_old_as_its_clock_shows() {
    let mut ranges = ranges();
    told_distance(&mut ranges, &ahead(150));
    let mut hear = |now_ms: u64, own_ms: u32| {
        let mut said = ahead(150);
        said.time_boot_ms = own_ms;
        let mut out = Vec::new();
        let now = Time::from_nanos(now_ms * 1_000_000);
        ranges.hear(now, FROM, &MavMessage::DISTANCE_SENSOR(said), &mut out);
        let found = readings(&out);
        found.first().map(|reading| reading.measured.as_secs_f64())
    };
    let near = |found: Option<f64>, expected_s: f64| (found.unwrap() - expected_s).abs() < 2e-3;
    assert!(near(hear(1050, 5050), 1.01), "in time");
    assert!(near(hear(2050, 5100), 1.06), "a second late");
    assert!(near(hear(2051, 5100), 1.06), "the same once more");
    assert_eq!(hear(2052, 5090), None, "overtaken");
    assert!(near(hear(2100, 6100), 2.06), "in time again");
    // Its clock stands: what it says becomes ever older.
    for now_ms in (2200..9000).step_by(100) {
        assert!(hear(now_ms, 6100).unwrap() < 2.07);
    }
    // It was started anew: it is believed when its new clock is known.
    let anew: Vec<bool> = (0..7u32)
        .map(|step| hear(9000 + 50 * u64::from(step), 100 + 50 * step).is_some())
        .collect();
    assert_eq!(anew, [false, false, false, false, true, true, true]);
}

#[test]
fn a_clock_that_is_set_back_by_less_than_a_second_is_known_again_after_a_few_messages() {
    for back_ms in [300, 700, 990] {
        let mut ranges = ranges();
        told_distance(&mut ranges, &ahead(150));
        let ages_s: Vec<Option<f64>> = (1..=7u32)
            .map(|step| {
                let mut said = ahead(150);
                said.time_boot_ms = 5000 - back_ms + 50 * step;
                let mut out = Vec::new();
                let now = Time::from_nanos(u64::from(1000 + 50 * step) * 1_000_000);
                ranges.hear(now, FROM, &MavMessage::DISTANCE_SENSOR(said), &mut out);
                let found = readings(&out);
                let first = found.first();
                first.map(|reading| now.since(reading.measured).as_secs_f64())
            })
            .collect();
        let (unknown, known) = ages_s.split_at(4);
        assert_eq!(unknown, [None; 4], "{back_ms} ms");
        let is_fresh = |age_s: &Option<f64>| age_s.is_some_and(|age_s| age_s < 0.041);
        assert!(known.iter().all(is_fresh), "{back_ms} ms: {known:?}");
    }
}

#[test]
fn clocks_that_run_apart_a_little_make_no_reading_old() {
    let mut ranges = ranges();
    let mut last = Vec::new();
    for step in 0..72_000u64 {
        let mut said = ahead(150);
        // A hundred parts in a million slow, for an hour.
        said.time_boot_ms = (step * 50 - step * 50 / 10_000) as u32;
        last.clear();
        let now = Time::from_nanos((1000 + step * 50) * 1_000_000);
        ranges.hear(now, FROM, &MavMessage::DISTANCE_SENSOR(said), &mut last);
    }
    let measured = readings(&last)[0].measured;
    let age = Time::from_nanos((1000 + 71_999 * 50) * 1_000_000).since(measured);
    assert!(age < Duration::from_millis(45), "{age:?}");
}

/// The reading ahead of a message in which some elements, degrees clockwise, say something else.
fn seen(elements: &[(usize, u16)], base: OBSTACLE_DISTANCE_DATA) -> Option<Option<f64>> {
    let mut said = base;
    for (index, cm) in elements {
        said.distances[*index] = *cm;
    }
    let found = told_around(&mut ranges(), &said);
    let ahead = found.iter().find(|reading| reading.sensor == 0);
    ahead.map(|reading| reading.range_m)
}

#[test]
fn the_nearest_obstacle_within_the_cone_is_the_reading() {
    assert_eq!(seen(&[], around()), Some(Some(6.0)));
    assert_eq!(seen(&[(1, 210), (71, 190)], around()), Some(Some(1.9)));
    assert_eq!(seen(&[(3, 150)], around()), Some(Some(1.5)), "at the edge");
    assert_eq!(seen(&[(4, 150), (68, 150)], around()), Some(Some(6.0)));
    let mut left = around();
    // 90° to the left is 270° clockwise.
    left.distances[54] = 120;
    let found = told_around(&mut ranges(), &left);
    let ranges_m: Vec<(usize, Option<f64>)> = found
        .iter()
        .map(|reading| (reading.sensor, reading.range_m))
        .collect();
    assert_eq!(ranges_m, [(0, Some(6.0)), (1, Some(1.2))], "none is turned");
}

#[test]
fn an_offset_and_a_width_of_either_sign_say_where_elements_look() {
    let mut turned = around();
    turned.angle_offset = -90.0;
    assert_eq!(seen(&[(18, 200)], turned.clone()), Some(Some(2.0)));
    assert_eq!(seen(&[(0, 200)], turned.clone()), Some(Some(6.0)));
    (turned.angle_offset, turned.increment_f) = (45.0, -2.5);
    assert_eq!(seen(&[(18, 200)], turned.clone()), Some(Some(2.0)));
    assert_eq!(seen(&[(0, 200)], turned), Some(Some(6.0)));
}

#[test]
fn nothing_is_there_only_when_every_element_of_the_cone_says_so() {
    let free = OBSTACLE_DISTANCE_DATA {
        distances: [801; 72],
        ..around()
    };
    assert_eq!(seen(&[], free.clone()), Some(None));
    assert_eq!(seen(&[(0, 300)], free.clone()), Some(Some(3.0)));
    assert_eq!(seen(&[(3, 65_535)], free.clone()), None, "unknown");
    assert_eq!(seen(&[(3, 0)], free.clone()), None, "too near");
    assert_eq!(seen(&[(3, 802)], free.clone()), None, "out of range");
    assert_eq!(seen(&[(36, 65_535)], free.clone()), Some(None), "elsewhere");
    // It looks less far than the vehicle believes.
    let mut short = free.clone();
    (short.max_distance, short.distances) = (300, [301; 72]);
    assert_eq!(seen(&[], short), None);
    // Its elements end within the cone.
    let mut narrow = free.clone();
    (narrow.increment_f, narrow.angle_offset) = (0.5, -14.0);
    assert_eq!(seen(&[], narrow), None);
    // Its directions count from north, or are none.
    let mut north = free.clone();
    north.frame = MavFrame::MAV_FRAME_GLOBAL;
    assert_eq!(seen(&[], north), None);
    for width in [f32::NAN, f32::INFINITY, 0.01, 400.0] {
        let mut said = free.clone();
        said.increment_f = width;
        assert_eq!(seen(&[], said), None, "{width}");
    }
    let mut said = free.clone();
    said.angle_offset = f32::NAN;
    assert_eq!(seen(&[], said), None);
    let mut said = free;
    said.increment = 0;
    assert_eq!(seen(&[], said), None);
}

#[test]
fn whatever_is_said_nothing_is_never_made_of_what_is_not_known() {
    // Every way to write the same two facts: an element is unknown, the others are free.
    for half_deg in [0.1, 2.0, 7.4, 15.0, 60.0] {
        for (width, index) in [(5.0, 0), (2.5, 3), (-5.0, 1), (1.0, 0), (30.0, 0)] {
            let mut ranges = ranges();
            ranges.settings.half_angle = Angle::from_degrees(half_deg);
            let mut said = OBSTACLE_DISTANCE_DATA {
                distances: [801; 72],
                increment_f: width,
                ..around()
            };
            // Centred on the cone of the sensor ahead.
            said.angle_offset = -(index as f32) * width;
            said.distances[index] = UNKNOWN_CM;
            let found = told_around(&mut ranges, &said);
            assert!(
                found.iter().all(|reading| reading.sensor != 0),
                "{half_deg}°, {width}°: {found:?}"
            );
        }
    }
}

#[test]
fn another_message_is_none_of_distances() {
    let heartbeat = MavMessage::HEARTBEAT(Default::default());
    assert!(!ranges().hear(Time::ZERO, FROM, &heartbeat, &mut Vec::new()));
}
