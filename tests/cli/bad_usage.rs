//! Command lines that make no sense.

use super::program_runner::ProgramRunner;

fn check(arguments: &[&str], parts: &[&str]) {
    ProgramRunner::new().refused(arguments, parts);
}

#[test]
fn unknown_commands_and_options_are_refused_with_advice() {
    check(&[], &["Usage: tomoswarm", "sim", "image", "plan", "check"]);
    check(&["fly"], &["unrecognized subcommand 'fly'", "--help"]);
    check(&["simm"], &["a similar subcommand exists: 'sim'"]);
    check(
        &["sim", "--sed", "1"],
        &["a similar argument exists: '--seed'"],
    );
    check(
        &["sim", "a.toml", "b.toml"],
        &["unexpected argument 'b.toml'"],
    );
    check(&["image"], &["<FILE>"]);
    check(&["check"], &["<FILE>"]);
}

#[test]
fn a_number_of_vehicles_out_of_range_is_refused() {
    for count in ["0", "1", "9", "1000", "18446744073709551615"] {
        for command in ["sim", "plan"] {
            let expected = format!("vehicles.count = {count} (asked for): is out of range");
            check(
                &[command, "--vehicles", count],
                &[&expected, "a whole number from 2 to 8 is allowed"],
            );
        }
    }
    check(&["sim", "--vehicles", "-2"], &["'-2'", "--vehicles"]);
    check(
        &["sim", "small.sim.toml", "--vehicles", "5"],
        &["small.sim.toml", "4 homes for 5 vehicles"],
    );
}

#[test]
fn seeds_times_and_trials_out_of_range_are_refused() {
    // The limits are those of the keys `seed` and `until_s`.
    let seeds = "a whole number from 0 to 9223372036854775807";
    for seed in ["-1", "1.5", "x", "9223372036854775808"] {
        check(
            &["sim", "--seed", seed],
            &[&format!("'{seed}'"), "--seed <N>", seeds],
        );
    }
    let times = "a number of seconds from 1 to 1000000";
    for until in ["0", "nan", "-5", "inf", "1e300", "soon", "1000000.1"] {
        check(
            &["sim", "--until", until],
            &[&format!("'{until}'"), "--until <SECONDS>", times],
        );
    }
    for trials in ["0", "-1", "many"] {
        check(
            &["sim", "--trials", trials],
            &[&format!("'{trials}'"), "--trials <N>"],
        );
    }
    check(
        &["sim", "--trials", "2", "--seed", "9223372036854775807"],
        &["2 seeds from", "beyond the last one, 9223372036854775807"],
    );
    check(
        &["sim", "--trials", "2", "--out", "run"],
        &["--trials", "--out", "cannot be used"],
    );
}

#[test]
fn sizes_and_areas_out_of_range_are_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "a.csv",
        "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n0,0,8,8,-50\n",
    );
    for pixels in [
        "0x0",
        "0x5",
        "5",
        "1e9x1e9",
        "1000000000x1000000000",
        "-1x5",
        "nanx5",
        "99999999999999999999x1",
    ] {
        let option = format!("--pixels={pixels}");
        runner.refused(
            &["image", "a.csv", &option, "--png", "i.png"],
            &[pixels, "expected WIDTHxHEIGHT"],
        );
    }
    for area in [
        "8,8,0,0",
        "0,0,nan,8",
        "0,0,8",
        "0,0,8,8,8",
        "a,b,c,d",
        "0,0,0,0",
        "0,0,1e999,8",
        "-1e308,0,1e308,8",
    ] {
        let option = format!("--area={area}");
        runner.refused(
            &["image", "a.csv", &option, "--png", "i.png"],
            &[area, "expected X0,Y0,X1,Y1"],
        );
    }
    let same = ["image", "a.csv", "--npy", "./a.csv"];
    runner.refused(&same, &["a.csv: is to be written, but is an input"]);
    runner.refused(
        &["image", "a.csv", "--npy", "i", "--png", "./i"],
        &["i: is to be written", "another output"],
    );
    runner.refused(
        &["image", "a.csv", "--solver", "magic"],
        &["'magic'", "map", "tikhonov"],
    );
    runner.refused(&["image", "a.csv", "--peaks", "-1"], &["'-1'", "--peaks"]);
}

#[test]
fn help_teaches_every_command() {
    let runner = ProgramRunner::new();
    for (command, parts) in [
        (
            "sim",
            &[
                "Examples:",
                "--seed",
                "image.png",
                "summary.json",
                "Exit codes",
                "metres",
            ][..],
        ),
        (
            "image",
            &["Examples:", "tx_x_m,tx_y_m", "--empty", "dB", "Exit codes"],
        ),
        ("plan", &["Examples:", "--stops", "Exit codes", "metres"]),
        ("check", &["Examples:", ".wrl", "Exit codes"]),
        (
            "scene",
            &[
                "Examples:",
                "--pose",
                "--size",
                "plan.png",
                "view.png",
                "Exit codes",
                "metres",
            ],
        ),
    ] {
        let output = runner.run(&[command, "--help"]);
        assert_eq!(output.code, 0);
        for part in parts {
            assert!(
                output.out.contains(part),
                "{command} --help does not tell of {part}:\n{}",
                output.out
            );
        }
    }
}
