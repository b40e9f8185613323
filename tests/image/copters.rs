//! Volumes of samples of copters, beside those of links of the same packets.

use std::fs;

use serde_json::Value;

use super::command::{folder_with, tomoswarm};
use super::outputs::check_refused;

const HEADER: &str = "vehicle,boot,run,sequence,heard_at_s,transmitter,tx_x_m,tx_y_m,tx_z_m,tx_sd_m,rx_x_m,rx_y_m,rx_z_m,\
    rx_sd_m,channel,power_dbm,rssi_dbm\n";
/// Standard deviation of where a copter is in light wind, metres.
const CALM_M: f64 = 0.05;
const ALTITUDES_M: [f64; 3] = [1.0, 2.5, 4.0];
/// What stands in the area, 6 dB/m: its lowest and its highest corner.
const BOX_M: [[f64; 3]; 2] = [[3.0, 5.0, 2.0], [5.0, 7.0, 3.0]];

/// Numbers of 0 to 1 that look drawn (splitmix64, Steele et al. 2014).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^= x >> 31;
        (x >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// How strongly a packet is heard in the mean, dBm: free space, and the box over so much of the way as it covers.
fn strength_dbm(from: [f64; 3], to: [f64; 3], is_empty: bool) -> f64 {
    let step = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let length_m = step.iter().map(|side| side * side).sum::<f64>().sqrt();
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let wall = |at: f64| (at - from[axis]) / step[axis];
        let (a, b) = (wall(BOX_M[0][axis]), wall(BOX_M[1][axis]));
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    let lost_db = if is_empty {
        0.0
    } else {
        6.0 * length_m * (leave - enter).max(0.0)
    };
    -40.0 - 20.0 * length_m.log10() - lost_db
}

/// A sweep of four copters at several altitudes around a square of 10 m, as samples and as links between the places where they
/// were to hover.
struct Sweep {
    samples: String,
    links: String,
}

/// `off_m` = standard deviation of how far the wind carries them off, on each axis.
fn sweep(is_empty: bool, off_m: f64, seed: u64) -> Sweep {
    let mut noise = Noise(seed);
    let mut places = Vec::new();
    for step in 0..9 {
        let along_m = 1.0 + f64::from(step);
        for z_m in ALTITUDES_M {
            places.extend([[along_m, 0.0, z_m], [along_m, 10.0, z_m]]);
            places.extend([[0.0, along_m, z_m], [10.0, along_m, z_m]]);
        }
    }
    let mut samples = HEADER.to_owned();
    let mut links =
        "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm,misses\n".to_owned();
    let mut sequence = 0;
    for (index, one) in places.iter().enumerate() {
        for other in places[..index].iter().skip(index % 3).step_by(3) {
            let mut heard = Vec::new();
            for packet in 0..6 {
                // A copter is carried off, and knows its place to two centimetres.
                let mut off = |sd_m: f64| [(); 3].map(|()| sd_m * noise.normal());
                let moved = |at: &[f64; 3], by: [f64; 3]| [0, 1, 2].map(|axis| at[axis] + by[axis]);
                let (from, to) = (moved(one, off(off_m)), moved(other, off(off_m)));
                let (said_from, said_to) = (moved(&from, off(0.02)), moved(&to, off(0.02)));
                let is_missed = noise.uniform() < 0.05;
                let noise_db = 2.0 * noise.normal();
                let rssi_dbm = (strength_dbm(from, to, is_empty) + noise_db).round();
                let rssi = if is_missed {
                    String::new()
                } else {
                    rssi_dbm.to_string()
                };
                heard.extend((!is_missed).then_some(rssi_dbm));
                sequence += 1;
                // Every other packet goes the other way.
                let (tx, rx, ends) = match packet % 2 {
                    0 => (1, 2, [said_from, said_to]),
                    _ => (2, 1, [said_to, said_from]),
                };
                let text = ends.map(|[x, y, z]| format!("{x:.4},{y:.4},{z:.4},0.02"));
                samples += &format!(
                    "{rx},1,5,{sequence},{sequence},{tx},{},{},11,0,{rssi}\n",
                    text[0], text[1]
                );
            }
            let mean_dbm = heard.iter().sum::<f64>() / heard.len() as f64;
            let ends = [one, other].map(|[x, y, z]| format!("{x},{y},{z}"));
            let (packets, misses) = (heard.len(), 6 - heard.len());
            links += &format!("{},{},{packets},{mean_dbm},{misses}\n", ends[0], ends[1]);
        }
    }
    Sweep { samples, links }
}

/// What a volume's report says.
fn report(folder: &std::path::Path, name: &str) -> Value {
    let text = fs::read_to_string(folder.join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn values(folder: &std::path::Path, name: &str) -> Vec<f64> {
    let bytes = fs::read(folder.join(name)).unwrap();
    let of = |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
    bytes[128..].chunks_exact(4).map(of).collect()
}

/// Checks that the strongest voxel lies in the box, in the middle layer of three.
fn check_strongest(report: &Value) {
    let at: Vec<f64> = report["strongest"]["at_m"]
        .as_array()
        .unwrap()
        .iter()
        .map(|metres| metres.as_f64().unwrap())
        .collect();
    assert!(
        (0..3).all(|axis| at[axis] > BOX_M[0][axis] && at[axis] < BOX_M[1][axis]),
        "{at:?}"
    );
}

#[test]
fn samples_of_copters_make_the_volume_of_their_links() {
    let (now, empty) = (sweep(false, CALM_M, 1), sweep(true, CALM_M, 2));
    let folder = folder_with(&[
        ("samples.csv", &now.samples),
        ("empty-samples.csv", &empty.samples),
        ("links.csv", &now.links),
        ("empty.csv", &empty.links),
    ]);
    for (name, now, before) in [
        ("of-samples", "samples.csv", "empty-samples.csv"),
        ("of-links", "links.csv", "empty.csv"),
        ("mixed", "samples.csv", "empty.csv"),
    ] {
        let (json, npy, png) = (
            format!("{name}.json"),
            format!("{name}.npy"),
            format!("{name}.png"),
        );
        let asked = [now, "--empty", before, "--layers", "3", "--pixels", "10x10"];
        let outputs = ["--json", &json, "--npy", &npy, "--png", &png];
        let output = tomoswarm(folder.path(), &[&asked[..], &outputs].concat());
        assert!(output.status.success(), "{output:?}");
        check_strongest(&report(folder.path(), &json));
        let said = String::from_utf8_lossy(&output.stdout);
        println!("{name}:\n{said}");
        assert_eq!(said.contains("samples: "), name != "of-links", "{said}");
    }
    let [of_samples, mixed, of_links] =
        ["of-samples.npy", "mixed.npy", "of-links.npy"].map(|name| values(folder.path(), name));
    assert_eq!(of_samples.len(), 300);
    let size = of_links.iter().map(|value| value * value).sum::<f64>();
    for (name, volume) in [("samples", of_samples), ("mixed", mixed)] {
        let pairs = volume.iter().zip(&of_links);
        let off = pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let share = (off / size).sqrt();
        println!("{name}: off by {share:.3} of the volume of links");
        assert!(share < 0.2, "{name}: {share}");
    }
    // Given twice, samples count once.
    let twice = ["samples.csv", "samples.csv", "--empty", "empty-samples.csv"];
    let more = ["--layers", "3", "--pixels", "10x10"];
    let output = tomoswarm(folder.path(), &[twice, more].concat());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        said.contains("given again and left out"),
        "{said} {output:?}"
    );
}

#[test]
fn what_the_wind_carries_through_too_many_bins_is_pooled_in_wider_ones() {
    let (now, empty) = (sweep(false, 0.2, 4), sweep(true, 0.2, 5));
    let files = [
        ("samples.csv", now.samples.as_str()),
        ("empty-samples.csv", &empty.samples),
    ];
    let folder = folder_with(&files);
    let asked = ["samples.csv", "--empty", "empty-samples.csv", "--layers"];
    let more = ["3", "--pixels", "10x10", "--json", "o.json"];
    let output = tomoswarm(folder.path(), &[&asked[..], &more].concat());
    assert!(output.status.success(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stdout);
    println!("{said}");
    assert!(
        said.contains("m, since in smaller ones there are more than 6000 links"),
        "{said}"
    );
    let report = report(folder.path(), "o.json");
    assert!(report["bin_m"].as_f64().unwrap() > 0.5);
    check_strongest(&report);
}

#[test]
fn without_an_empty_sweep_samples_show_what_stands_there() {
    let folder = folder_with(&[("samples.csv", &sweep(false, CALM_M, 3).samples)]);
    for solver in ["auto", "map", "nn"] {
        let asked = [
            "samples.csv",
            "--layers",
            "3",
            "--pixels",
            "10x10",
            "--solver",
            solver,
        ];
        let output = tomoswarm(folder.path(), &[&asked[..], &["--json", "o.json"]].concat());
        assert!(output.status.success(), "{solver}: {output:?}");
        let report = report(folder.path(), "o.json");
        check_strongest(&report);
        assert_eq!(report["reference"]["name"], "along the sides");
        println!("{solver}: {}", report["strongest"]);
    }
}

#[test]
fn samples_that_tell_no_heights_are_refused() {
    let (now, empty) = (
        sweep(false, CALM_M, 1).samples,
        sweep(true, CALM_M, 2).samples,
    );
    let asked = ["now.csv", "--empty", "empty.csv", "--layers", "3"];
    let check = |now: &str, empty: &str, words: &[&str]| {
        check_refused(&[("now.csv", now), ("empty.csv", empty)], &asked, words);
    };
    // Returns the file with a change of the fields of each line below the header.
    let changed = |text: &str, change: &dyn Fn(usize, &mut Vec<String>)| -> String {
        let lines = text.lines().enumerate().map(|(index, line)| {
            let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
            if index > 0 {
                change(index + 1, &mut fields);
            }
            fields.join(",") + "\n"
        });
        lines.collect()
    };
    let column = |name: &str| HEADER.split(',').position(|known| known == name).unwrap();
    let (tx_z, rx_z, channel) = (column("tx_z_m"), column("rx_z_m"), column("channel"));
    let level = |text: &str| {
        changed(text, &|number, fields: &mut Vec<String>| {
            fields[tx_z] = format!("1.2{}", number % 9);
            fields[rx_z] = format!("1.3{}", number % 9);
        })
    };
    let words = [
        "now.csv: found all ends 1.2",
        "expected altitudes at least 0.50 m apart",
    ];
    check(&level(&now), &level(&empty), &words);
    let without = changed(&now, &|number, fields: &mut Vec<String>| {
        if number == 7 {
            fields[rx_z] = String::new();
        }
    });
    let words = [
        "now.csv: found a sample without altitudes in line 7",
        "tx_z_m",
    ];
    check(&without, &empty, &words);
    check(
        &now,
        &without,
        &["empty.csv: found a sample without altitudes in line 7"],
    );
    let nan = changed(&now, &|number, fields: &mut Vec<String>| {
        if number == 9 {
            fields[tx_z] = "NaN".to_owned();
        }
    });
    check(&nan, &empty, &["now.csv:9: found \"NaN\", expected metres"]);
    let other = changed(&empty, &|_, fields: &mut Vec<String>| {
        fields[channel] = "26".to_owned()
    });
    let words = ["empty.csv: found channel 26, expected an empty sweep on channel 11"];
    check(&now, &other, &words);
    let two_runs = changed(&now, &|number, fields: &mut Vec<String>| {
        if number == 12 {
            fields[column("run")] = "6".to_owned();
        }
    });
    check(
        &two_runs,
        &empty,
        &["now.csv:12: found run 6, expected run 5"],
    );
    let higher = changed(&empty, &|_, fields: &mut Vec<String>| {
        for z in [tx_z, rx_z] {
            let z_m: f64 = fields[z].parse().unwrap();
            fields[z] = (z_m + 10.0).to_string();
        }
    });
    check(
        &now,
        &higher,
        &["now.csv: found no link that the empty sweep has as well"],
    );
    let same = changed(&now, &|number, fields: &mut Vec<String>| {
        if number == 3 {
            fields[column("sequence")] = "1".to_owned();
            fields[0] = "2".to_owned();
        }
    });
    check(
        &same,
        &empty,
        &[
            "now.csv:3: found sample 1 of vehicle 2",
            "otherwise than in line 2",
        ],
    );
    let header: String = now
        .lines()
        .take(1)
        .map(|line| line.to_owned() + "\n")
        .collect();
    check(&header, &empty, &["now.csv:2: found the end of the file"]);
}
