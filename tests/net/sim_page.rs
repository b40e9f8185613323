//! The page of a simulation (`sim --dash`), as a browser sees it and as somebody tries to order from it.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use crate::browser::Browser;
use crate::dash::{Dash, shot, view};
use crate::swarm::PROGRAM;

const CONFIG: &str = "configs/small.sim.toml";

/// A simulation with its page.
pub struct SimulationWithPage {
    child: Child,
    out: BufReader<ChildStdout>,
    pub dash: Dash,
}

fn simulate(folder: &Path, options: &[&str]) -> Command {
    simulate_config(CONFIG, folder, options)
}

fn simulate_config(config: &str, folder: &Path, options: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command.args(["sim", config, "--no-pictures", "--out"]);
    command.arg(folder).args(options);
    command
}

impl SimulationWithPage {
    pub fn start(folder: &Path, options: &[&str]) -> SimulationWithPage {
        SimulationWithPage::of(CONFIG, folder, options)
    }

    /// Starts one of a file.
    pub fn of(config: &str, folder: &Path, options: &[&str]) -> SimulationWithPage {
        let mut command = simulate_config(config, folder, &["--dash", "--port", "0"]);
        let mut child = command
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        out.read_line(&mut line).unwrap();
        let link = line.split_whitespace().last().unwrap().to_owned();
        assert!(link.contains("/#look="), "{line}");
        let dash = Dash::at(link);
        SimulationWithPage { child, out, dash }
    }

    /// Returns the number of its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits until the run has been written.
    pub fn until_written(&mut self) {
        let mut line = String::new();
        while !line.starts_with("written:") {
            line.clear();
            assert!(
                self.out.read_line(&mut line).unwrap() > 0,
                "it ended before"
            );
        }
    }

    /// Ends it as Ctrl-C does; returns the exit code and what it had still to say.
    fn interrupt(&mut self) -> (Option<i32>, String) {
        let id = self.child.id().to_string();
        Command::new("kill").args(["-INT", &id]).status().unwrap();
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).unwrap();
        (self.child.wait().unwrap().code(), rest)
    }
}

impl Drop for SimulationWithPage {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_simulation_with_its_page_runs_as_without_and_takes_no_orders() {
    let folder = tempfile::tempdir().unwrap();
    let (with, without) = (folder.path().join("with"), folder.path().join("without"));
    let mut simulation = SimulationWithPage::start(&with, &["--record"]);
    simulation.until_written();
    let dash = &simulation.dash;

    let own = format!("127.0.0.1:{}", dash.port);
    let (stop, token) = (r#"{"order":"stop","page":1}"#, Dash::token(&dash.look));
    let (status, answer) = dash.post(&own, &format!("http://{own}"), token, stop);
    assert_eq!(status, 403, "{answer}");
    assert!(answer.contains("takes no orders"), "{answer}");
    let (status, _) = dash.post(&own, &format!("http://{own}"), "", stop);
    assert_eq!(status, 401, "an empty token is none");
    let here = r#"{"at":[1,2],"page":1}"#;
    let (status, answer) = dash.post_to("/mark", (&own, &format!("http://{own}")), token, here);
    assert!(
        status == 403 && answer.contains("takes no orders"),
        "{answer}"
    );

    if let Some(mut browser) = Browser::open(1280, 800) {
        browser.go(&dash.look);
        browser.until("tomoswarm.model.states.size === 2", 10);
        browser.until("tomoswarm.model.images.size > 0", 10);
        let is_note = "tomoswarm.model.events.some((event) => event.kind === 'note' && event.vehicles[0] === 1)";
        browser.until(is_note, 5);
        browser.until("document.title.startsWith('SIMULATION')", 5);
        let is_hidden = "getComputedStyle(document.getElementById('stop')).display === 'none'";
        browser.until(is_hidden, 5);
        browser.until(
            "getComputedStyle(document.getElementById('head')).borderTopStyle === 'dashed'",
            5,
        );
        // Ages are those of the run's time, which stands still: who was heard at its end stays so.
        std::thread::sleep(Duration::from_secs(4));
        browser.until("!document.body.innerText.includes('silent for')", 1);
        browser.until("!document.body.innerText.includes('NO DATA')", 1);
        view(&mut browser, "log");
        browser.until(
            "document.querySelector('#log-list time')?.textContent.startsWith('00:0')",
            5,
        );
        // What truly stands there can be seen beside what was found.
        browser.until("!document.getElementById('truth-choice').hidden", 5);
        assert_eq!(
            browser.eval("tomoswarm.model.place.truth.persons.length"),
            1
        );
        browser.eval("document.getElementById('layer-truth').click()");
        view(&mut browser, "image");
        let earlier = "document.querySelectorAll('#earlier-finds li').length === 1";
        browser.until(earlier, 5);
        shot(&mut browser, "simulation");
        the_truth_and_what_is_not_known_lie_over_the_image(&mut browser);
        settings_say_what_they_may_be(&mut browser);
        browser.key(" ", "Space", 32);
        let said = "document.getElementById('stop-result').textContent.includes('takes no orders')";
        browser.until(said, 5);
        assert_eq!(browser.complaints, Vec::<String>::new());
    }
    assert_eq!(simulation.interrupt().0, Some(0));

    assert!(simulate(&without, &[]).output().unwrap().status.success());
    let log = |folder: &Path| std::fs::read(folder.join("run.log")).unwrap();
    assert!(!log(&with).is_empty());
    assert!(log(&with) == log(&without), "the page changes the run");
    let mut replay = Command::new(PROGRAM);
    let replay = replay.arg("replay").arg(with.join("flight"));
    let replayed = replay.output().unwrap();
    assert!(replayed.status.success(), "{replayed:?}");
}

/// The box of the scene shows persons and outlines over the image as well; and pixels are hatched of which nothing is known.
fn the_truth_and_what_is_not_known_lie_over_the_image(browser: &mut Browser) {
    // How many pixels over the image have the colour of what is true; how many are drawn over a corner of it.
    let purple = "(() => { const over = document.getElementById('heat-finds'), data = over.getContext('2d').getImageData(0, 0, over.width, over.height).data;
        let count = 0; for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 100 && Math.abs(data[i] - 160) < 6 && Math.abs(data[i + 1] - 60) < 6 && Math.abs(data[i + 2] - 200) < 6) count += 1;
        return count; })()";
    browser.until("document.getElementById('layer-truth').checked", 1);
    browser.until(&format!("{purple} > 20"), 5);
    // On the ring of the person some of it lies, as far as dashes reach, and in the middle of it nothing does.
    let at_ring = "(() => { const over = document.getElementById('heat-finds'), pen = over.getContext('2d'), { model } = tomoswarm;
        const image = model.images.get(Number(document.getElementById('image-subject').value)), { at, radius_m } = model.place.truth.persons[0];
        const x = (m) => (m * 1000 - image.least_x_mm) / (image.greatest_x_mm - image.least_x_mm) * over.width;
        const y = (m) => over.height - (m * 1000 - image.least_y_mm) / (image.greatest_y_mm - image.least_y_mm) * over.height;
        const isThere = (a) => { const seen = pen.getImageData(Math.round(x(at[0] + radius_m * Math.cos(a))) - 1, Math.round(y(at[1] + radius_m * Math.sin(a))) - 1, 3, 3).data;
          return seen.some((v, i) => i % 4 === 0 && seen[i + 3] > 60 && Math.abs(v - 160) < 40 && Math.abs(seen[i + 2] - 200) < 50); };
        return Array.from({ length: 72 }, (_, i) => i * Math.PI / 36).filter(isThere).length; })()";
    let seen = browser.eval(at_ring).as_u64().unwrap();
    assert!(
        seen >= 20,
        "{seen} of 72 places of the ring have its colour"
    );
    shot(browser, "truth_over_image");
    browser.eval("document.getElementById('layer-truth').click()");
    browser.until(&format!("{purple} === 0"), 5);

    let corner = |column: &str| {
        format!(
            "(() => {{ const over = document.getElementById('heat-finds'), image = tomoswarm.model.images.get(Number(document.getElementById('image-subject').value));
            const side = over.width / image.columns, data = over.getContext('2d').getImageData({column} * side, over.height - side, side, side).data;
            return data.filter((v, i) => i % 4 === 3 && v > 0).length; }})()"
        )
    };
    let [west, east] = [corner("0"), corner("(image.columns - 1)")];
    let hatched = "document.getElementById('heat-scale').textContent.includes('Hatched: ')";
    let choose = |browser: &mut Browser, plane: &str| {
        browser.eval(&format!("(() => {{ const s = document.getElementById('image-plane'); s.value = '{plane}'; s.dispatchEvent(new Event('change')); }})()"));
    };
    // Of one pixel nothing is known, of all others half of what was believed before.
    browser.eval(
        "(() => { const { model } = tomoswarm, subject = Number(document.getElementById('image-subject').value);
        const image = model.images.get(subject), prior = model.finds.get(subject).priorSd_dbpm;
        if (!(prior > 0.1)) throw new Error(`the prior is ${prior}`);
        image.deviation.fill(0.5 * prior); image.deviation[0] = prior; image.version += 1; })()",
    );
    // The text may be that of the image before, which has pixels of its own of which nothing is known.
    choose(browser, "mean");
    browser.until(&format!("{west} > 3 && {hatched}"), 5);
    assert_eq!(browser.eval(&east), 0, "not hatched");
    choose(browser, "deviation");
    browser.until(&format!("!{hatched}"), 5);
    assert_eq!(browser.eval(&west), 0, "that is shown as it is");
    choose(browser, "mean");
}

/// Each key is shown with its default and with what is allowed, as it is declared.
fn settings_say_what_they_may_be(browser: &mut Browser) {
    view(browser, "settings");
    let row = |start: &str| {
        format!(
            "[...document.querySelectorAll('#settings-list li')].map((row) => row.textContent).find((text) => text.startsWith('{start}'))"
        )
    };
    for (key, known) in [
        (
            "vehicles.max_speed_mps = 1.8 ",
            "(default: 0.5; allowed: 0.01 to 20 m/s)",
        ),
        ("imaging.min_link_m = 2", "(default: "),
        (
            "mission.kind = \"sweep\"",
            "(default: sweep; allowed: sweep, calibrate, ",
        ),
    ] {
        browser.until(&format!("{}?.includes('{known}')", row(key)), 10);
    }
}

#[test]
fn a_page_follows_a_run_at_its_pace_and_ctrl_c_ends_both() {
    let folder = tempfile::tempdir().unwrap();
    let began = Instant::now();
    let mut simulation = SimulationWithPage::start(folder.path(), &["--pace", "1"]);
    if let Some(mut browser) = Browser::open(390, 844) {
        browser.go(&simulation.dash.look);
        browser.until("tomoswarm.model.states.size === 2", 10);
        browser.until("tomoswarm.model.shown_ms > 4000", 20);
        let shown_s = browser.eval("tomoswarm.model.shown_ms / 1000").as_f64();
        let wall_s = began.elapsed().as_secs_f64();
        // It computes up to what it shows next, a tenth of a second ahead.
        let is_paced = shown_s.unwrap() < wall_s + 0.2;
        assert!(is_paced, "{shown_s:?} s after {wall_s} s");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }
    let (code, said) = simulation.interrupt();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("written:"), "{said}");
}

#[test]
fn a_simulation_whose_port_is_in_use_is_refused_and_writes_nothing() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let output = simulate(&out, &["--dash", "--port", &port])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("choose another port"), "{said}");
    assert!(!out.exists());
}

/// The pictures of the README: what is asserted is that they can be made.
#[test]
#[ignore = "writes pictures for the README: SCREENSHOTS=docs"]
fn pictures() {
    let folder = tempfile::tempdir().unwrap();
    let config = "configs/courtyard.sim.toml";
    let mut simulation = SimulationWithPage::of(config, folder.path(), &[]);
    simulation.until_written();
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    browser.go(&simulation.dash.look);
    browser.until("tomoswarm.model.images.size > 0", 20);
    browser.eval("document.getElementById('layer-truth').click()");
    browser.until("tomoswarm.model.tracks.size === 2", 10);
    // Some minutes before the end, on its way.
    let back = "tomoswarm.time.goTo(tomoswarm.model.moment.to_s - 240, 0); 0";
    browser.until("tomoswarm.model.moment.to_s > 600", 10);
    browser.eval(back);
    let is_there =
        "Math.abs(tomoswarm.model.moment.to_s - 240 - tomoswarm.model.shown_ms / 1000) < 1";
    browser.until(&format!("{is_there} && !tomoswarm.model.isFilling"), 10);
    view(&mut browser, "image");
    std::thread::sleep(Duration::from_millis(500));
    shot(&mut browser, "page");
    browser.key("v", "KeyV", 86);
    browser.until("tomoswarm.view.space?.frames > 0", 20);
    // Walls are made a moment after the map.
    std::thread::sleep(Duration::from_millis(1500));
    shot(&mut browser, "page-3d");
    assert_eq!(browser.complaints, Vec::<String>::new());
}
