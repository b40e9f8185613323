//! The operator's page, as a real browser sees it and as strangers try it, against a swarm of separate processes.

use std::fs::Permissions;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rustix::process::geteuid;
use serde_json::json;
use tomoswarm::config::{self, Config};
use tomoswarm::run::bus::{BusSession, BusSettings};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::mailbox::Troubles;
use tomoswarm_proto::{
    Boot, Health, Hello, LayerId, Message, PoseReport, Position, RunId, Sample, Samples, Sender,
    StandReason, State, TILE_SIDE, TileAddress, TileReport, VehicleId,
};

use crate::browser::Browser;
use crate::member::settings;
use crate::swarm::{PROGRAM, Size, Swarm, free_address, vehicle};
use crate::websocket::{Incoming, WebSocket, text_message, upgrade};

/// What a vehicle calls itself and complains of, to see whether a page takes it for more than text.
const EVIL: &str = "<img src=x onerror=alert(1)>";

/// The middle of a wall outside of the fence, which a vehicle says that it has seen; what lies 4 m to the east is free.
const WALL_M: [f64; 2] = [0.8, -5.0];

/// A running server of the page.
pub struct Dash {
    pub port: u16,
    pub look: String,
    pub operate: String,
}

impl Dash {
    pub fn start(swarm: &mut Swarm) -> Dash {
        swarm.spawn("dash", &["dash", "operator.toml", "--port", "0"]);
        Dash::of_log(&swarm.path("dash.log"))
    }

    /// Waits until a process has printed the links.
    pub fn of_log(log: &std::path::Path) -> Dash {
        let began = Instant::now();
        loop {
            let text = std::fs::read_to_string(log).unwrap_or_default();
            let link = |word: &str| {
                let line = text
                    .lines()
                    .find(|line| line.contains(&format!("#{word}=")))?;
                Some(line.split_whitespace().last()?.to_owned())
            };
            if let (Some(look), Some(operate)) = (link("look"), link("operate")) {
                return Dash {
                    operate,
                    ..Dash::at(look)
                };
            }
            assert!(
                began.elapsed() < Duration::from_secs(20),
                "no links: {text}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Makes it of the link that may look, where there is no other.
    pub fn at(look: String) -> Dash {
        Dash {
            port: look.split([':', '/']).nth(4).unwrap().parse().unwrap(),
            operate: String::new(),
            look,
        }
    }

    pub fn token(link: &str) -> &str {
        link.split_once('=').unwrap().1
    }

    /// Sends a request, and returns the status and all that is answered.
    pub fn ask(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(5)))
            .unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        // An answer that is refused in the middle of the request ends with a reset.
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.split(' ').nth(1).unwrap_or("0").parse().unwrap();
        (status, answer)
    }

    /// Posts an order with these headers.
    pub fn post(&self, host: &str, origin: &str, token: &str, body: &str) -> (u16, String) {
        self.post_to("/order", (host, origin), token, body)
    }

    /// Posts something to a path.
    pub fn post_to(
        &self,
        path: &str,
        (host, origin): (&str, &str),
        token: &str,
        body: &str,
    ) -> (u16, String) {
        let origin = if origin.is_empty() {
            String::new()
        } else {
            format!("Origin: {origin}\r\n")
        };
        self.ask(&format!(
            "POST {path} HTTP/1.1\r\nHost: {host}\r\n{origin}Authorization: Bearer {token}\r\nContent-Length: {}\r\n\
             Connection: close\r\n\r\n{body}",
            body.len()
        ))
    }

    /// Asks for the metrics.
    pub fn metrics(&self, token: &str) -> (u16, String) {
        self.metrics_of(&format!("127.0.0.1:{}", self.port), token)
    }

    fn metrics_of(&self, host: &str, token: &str) -> (u16, String) {
        self.ask(&format!(
            "GET /metrics HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n\r\n"
        ))
    }

    /// Asks for the feed, and returns the connection with the head of the answer.
    fn feed(&self, host: &str, origin: &str) -> (TcpStream, String) {
        let origin = match origin {
            "" => String::new(),
            origin => format!("Origin: {origin}\r\n"),
        };
        upgrade(self.port, "/feed", &format!("Host: {host}\r\n{origin}"))
    }
}

/// Returns what comes until the connection ends, and after how long that was.
fn until_closed(mut stream: TcpStream) -> (Vec<u8>, Duration) {
    let began = Instant::now();
    let mut bytes = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(read @ 1..) = stream.read(&mut buffer) {
        bytes.extend(&buffer[..read]);
    }
    (bytes, began.elapsed())
}

pub fn prepared() -> Swarm {
    Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    })
}

#[test]
fn strangers_at_the_page_are_refused() {
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    let own = format!("127.0.0.1:{}", dash.port);
    let origin = format!("http://{own}");
    let evil = format!("evil.example:{}", dash.port);
    let evil_origin = format!("http://{evil}");
    let (operate, look) = (Dash::token(&dash.operate), Dash::token(&dash.look));
    let stop = r#"{"order":"stop","page":1}"#;

    let (status, answer) = dash.ask(&format!(
        "GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n"
    ));
    assert_eq!(status, 200);
    let answer = answer.to_lowercase();
    for header in [
        "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
         connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'\r\n",
        "x-content-type-options: nosniff",
        "cache-control: no-store",
    ] {
        assert!(answer.contains(header), "{header}");
    }
    assert!(!answer.contains("set-cookie"), "{answer}");
    let page = |host: &str, path: &str| {
        dash.ask(&format!(
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        ))
        .0
    };
    assert_eq!(
        page(&evil, "/"),
        421,
        "a name that was bound to this machine"
    );
    assert_eq!(page(&own, "/../Cargo.toml"), 404);

    for (host, origin, token, body, expected) in [
        (&own, &origin, operate, "stop", 400),
        (&evil, &evil_origin, operate, stop, 421),
        (&own, &evil_origin, operate, stop, 403),
        (&own, &String::new(), operate, stop, 403),
        (&own, &"null".to_owned(), operate, stop, 403),
        (&own, &origin, "", stop, 401),
        (&own, &origin, &operate[1..], stop, 401),
        (&own, &origin, look, stop, 403),
        (&own, &origin, operate, r#"{"order":"start","page":1}"#, 403),
        // An order may hold the file of a mission.
        (&own, &origin, operate, &" ".repeat(5000), 400),
        (&own, &origin, operate, &" ".repeat(530_000), 413),
    ] {
        let (status, answer) = dash.post(host, origin, token, body);
        assert_eq!(
            status, expected,
            "{host} {origin} {token} {body:.40}: {answer}"
        );
    }
    // Whatever is looked at asks for a token, and answers to its own names only.
    for path in [
        "/preflight",
        "/mesh",
        "/cell?x=1&y=1",
        "/pair?one=1&other=2",
        "/ghost",
        "/settings",
        "/settings?keys",
        "/links?run=1",
        "/export?run=1",
    ] {
        assert_eq!(page(&own, path), 401, "{path}");
        assert_eq!(page(&evil, path), 421, "{path}");
    }
    for path in ["/waypoints", "/places", "/why"] {
        let ask = |origin: &str, token: &str| dash.post_to(path, (&own, origin), token, "{}").0;
        assert_eq!(ask(&origin, ""), 401, "{path}");
        assert_eq!(ask(&evil_origin, look), 403, "{path}");
    }
    let (status, answer) = dash.metrics(look);
    assert!(
        status == 200 && answer.contains("\ntomoswarm_linked "),
        "{answer}"
    );
    let strangers = [
        dash.metrics(""),
        dash.metrics(&operate[1..]),
        dash.metrics_of(&evil, look),
    ];
    assert_eq!(strangers.map(|(status, _)| status), [401, 401, 421]);
    metrics_are_read_by_prometheus(&answer);
    for (host, origin) in [
        (&own, &evil_origin),
        (&evil, &evil_origin),
        (&own, &String::new()),
    ] {
        let (_, head) = dash.feed(host, origin);
        assert!(
            head.contains(" 403 ") || head.contains(" 421 "),
            "{host} {origin}: {head}"
        );
    }
    let open = || {
        let (stream, head) = dash.feed(&own, &origin);
        assert!(head.contains(" 101 "), "{head}");
        stream
    };
    let began = Instant::now();
    let closed = WebSocket(open()).next();
    assert!(
        (1800..4000).contains(&began.elapsed().as_millis()),
        "a silent page: {:?}",
        began.elapsed()
    );
    let is_late = |why: &str| why.contains("no token came");
    assert!(
        matches!(&closed, Incoming::Close(1013, why) if is_late(why)),
        "it is told why, and may try again: {closed:?}"
    );
    let mut strange = WebSocket(open());
    strange.say(&json!({"token": "0".repeat(32)}).to_string());
    let closed = strange.next();
    assert!(matches!(closed, Incoming::Close(1008, _)), "{closed:?}");
    let mut too_many: Vec<WebSocket> = (0..17).map(|_| WebSocket(open())).collect();
    let reasons = too_many.iter_mut().map(|page| match page.next() {
        Incoming::Close(1013, why) => why,
        other => panic!("{other:?}"),
    });
    let refused = reasons.filter(|why| why.contains("16 pages are open already"));
    assert_eq!(refused.count(), 1);
    for message in ["x".repeat(5000), "{}".to_owned()] {
        let mut stream = open();
        stream.write_all(&text_message(&message)).unwrap();
        let (said, after) = until_closed(stream);
        assert!(
            after < Duration::from_secs(2) && said.len() < 200,
            "{message:.40}: {after:?}, {} bytes",
            said.len()
        );
    }
    let (status, _) = dash.post(&own, &origin, operate, stop);
    assert_eq!(status, 200, "and whoever may is heard after all that");
}

/// Every line is a comment or a name, perhaps with labels, and a number; every name was declared before.
fn metrics_are_read_by_prometheus(answer: &str) {
    assert!(answer.contains("text/plain; version=0.0.4"), "{answer}");
    let (_, body) = answer.split_once("\r\n\r\n").unwrap();
    let mut declared = Vec::new();
    for line in body.lines() {
        if let Some(rest) = line.strip_prefix("# TYPE ") {
            declared.push(rest.split(' ').next().unwrap());
        }
        if !line.starts_with('#') {
            let (name, value) = line.rsplit_once(' ').unwrap();
            let name = name.split('{').next().unwrap();
            assert!(declared.contains(&name), "{line}");
            assert!(value.parse::<f64>().is_ok(), "{line}");
        }
    }
    assert!(declared.len() > 1, "{body}");
}

#[test]
fn a_port_that_is_in_use_is_said_and_refused() {
    let swarm = prepared();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let run = Command::new(PROGRAM)
        .args(["dash", "operator.toml", "--port", &port])
        .current_dir(swarm.folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(
        said.contains(&format!("127.0.0.1:{port} cannot be listened on")),
        "{said}"
    );
}

#[test]
fn what_may_not_be_read_or_listened_on_is_refused_with_its_reason() {
    if geteuid().is_root() {
        let _ = std::io::stderr().write_fmt(format_args!(
            "skipped: what may not be read or listened on: root may everything\n"
        ));
        return;
    }
    let swarm = prepared();
    let refused = |words: &[&str], reason: &str| {
        let run = Command::new(PROGRAM)
            .arg("dash")
            .args(words)
            .current_dir(swarm.folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains(reason), "{words:?}: {said}");
    };
    // Containers may let everybody listen everywhere.
    let first_free = std::fs::read_to_string("/proc/sys/net/ipv4/ip_unprivileged_port_start");
    let first_free: u16 = first_free.unwrap_or_default().trim().parse().unwrap_or(0);
    if first_free > 1 {
        let reason = "127.0.0.1:1 cannot be listened on: Permission denied";
        refused(&["operator.toml", "--port", "1"], reason);
    }
    let [files, recording] = ["files", "flight.mcap"].map(|name| swarm.path(name));
    std::fs::create_dir(&files).unwrap();
    std::fs::write(files.join("index.html"), "").unwrap();
    std::fs::write(&recording, "").unwrap();
    let allow = |mode: u32| {
        for path in [&files, &recording] {
            std::fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
        }
    };
    allow(0);
    refused(
        &["operator.toml", "--port", "0", "--files", "files"],
        "files/index.html: cannot be read: Permission denied",
    );
    refused(
        &["--port", "0", "--replay", "flight.mcap"],
        "flight.mcap: cannot be read: Permission denied",
    );
    // The folder is deleted afterwards.
    allow(0o700);
}

/// A tile of which the western half is occupied and the eastern one free, as far as it lies outside of the fence.
fn wall() -> TileReport {
    let cell = |place: usize| match (place / TILE_SIDE, place % TILE_SIDE) {
        (10.., _) => 0,
        (_, ..16) => 17,
        (_, _) => -17,
    };
    TileReport {
        layer: LayerId {
            vehicle: VehicleId(9),
            boot: Boot(1),
        },
        address: TileAddress {
            slice: 0,
            x: 0,
            y: -1,
        },
        revision: 1,
        cells: Arc::new(std::array::from_fn(cell)),
    }
}

/// A sample of vehicle 9, which hears vehicle 8 ever weaker and misses every fourth beacon.
fn samples(sequence: u64) -> Samples {
    let pose = |x_m| PoseReport {
        at: Position::from_metres(x_m, 9.0, 0.0),
        ..PoseReport::default()
    };
    let sample = Sample {
        sequence,
        heard_at_ns: sequence * 200_000_000,
        transmitter: VehicleId(8),
        transmitter_pose: pose(1.0),
        receiver_pose: pose(-3.0),
        channel: 20,
        power_dbm: 0,
        rssi_dbm: (sequence % 4 != 3).then_some(-50 - (sequence % 30) as i16),
    };
    Samples {
        vehicle: VehicleId(9),
        boot: Boot(1),
        run: RunId(1),
        samples: vec![sample],
        lost: Vec::new(),
    }
}

/// Puts a vehicle on the bus that says so, every so often, until a minute or two have passed; it is told how often it has
/// spoken, and its greeting.
pub fn vehicle_on_bus(
    swarm: &Swarm,
    every: Duration,
    mut says: impl FnMut(u64, Hello) -> Vec<Message> + Send + 'static,
) -> BusSession {
    let path = swarm.path("venue.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let read = config::read("venue.toml", &text, &mut |_| {
        Err("nothing is named".to_owned())
    });
    let Ok(Config::Venue(venue)) = read else {
        panic!("no venue")
    };
    let settings = BusSettings {
        node: vehicle(9),
        listen: vec![format!("tcp/{}", free_address())],
        ..settings(&swarm.path("operator.toml"))
    };
    let bus = BusSession::open(settings, Clock::start(), Troubles::default(), |_| {}).unwrap();
    let publisher = bus.publisher();
    publisher.speak();
    std::thread::spawn(move || {
        let began = Instant::now();
        let mut count = 0;
        while began.elapsed() < Duration::from_secs(120) {
            let hello = Hello::asking(Sender::Vehicle(VehicleId(9)), Boot(1), venue.hash(), 9);
            for message in says(count, hello) {
                publisher.publish(&message);
            }
            count += 1;
            std::thread::sleep(every);
        }
    });
    bus
}

/// Puts a vehicle on the bus that says evil things of itself, until it is dropped.
fn evil_vehicle(swarm: &Swarm) -> BusSession {
    let id = VehicleId(9);
    vehicle_on_bus(swarm, Duration::from_millis(200), move |sequence, hello| {
        let hello = Hello {
            is_member: true,
            name: EVIL.to_owned(),
            ..hello
        };
        let pose = PoseReport {
            at: Position::from_metres(-3.0, 9.0, 0.0),
            ..PoseReport::default()
        };
        let state = State {
            vehicle: id,
            boot: Boot(1),
            sequence,
            pose: Some(pose),
            is_at_rest: true,
            ..State::default()
        };
        let health = Health {
            vehicle: id,
            boot: Boot(1),
            troubles: vec![EVIL.to_owned()],
            ..Health::default()
        };
        vec![
            Message::Hello(hello),
            Message::State(state),
            Message::Health(health),
            Message::Tile(wall()),
            Message::Samples(samples(sequence)),
        ]
    })
}

/// Frames as they were written down, which the page's own code is to read.
fn golden_frames(browser: &mut Browser) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/dash/frames.txt");
    let text = std::fs::read_to_string(path).unwrap();
    let read = browser.eval(&format!(
        "(async () => {{ const {{ Model }} = await import('/model.js'); const model = new Model();
           for (const line of {text:?}.trim().split('\\n')) {{
             const hex = line.split(' ')[1];
             model.take(new Uint8Array(hex.match(/../g).map((b) => parseInt(b, 16))).buffer, 1000);
           }}
           const tile = model.tiles.get('-1/2/-3'), image = model.images.get(1), pair = model.pairs.get('1-2');
           return {{ pair: [pair.rssi, pair.loss, pair.excess, pair.distance, pair.at_ms], state: model.states.get(3), beat: model.frames, cells: [...tile.cells.slice(30, 42)],
             image: [image.run, image.laps, ...image.mean, ...image.deviation], text: model.vehicles.get(1).text }}; }})()"
    ));
    let state = &read["state"];
    assert_eq!(
        (
            &state["x"],
            &state["y"],
            &state["sd"],
            &state["battery"],
            &state["at_ms"]
        ),
        (
            &json!(-1.5),
            &json!(2000),
            &json!(0.05),
            &json!(0.87),
            &json!(960)
        )
    );
    assert_eq!(
        read["cells"],
        json!([17, 17, -4, -3, -2, -1, 0, 1, 2, 3, -17, -17])
    );
    assert_eq!(read["pair"], json!([-61, 0.25, null, 4.5, 700]));
    assert_eq!(read["beat"], 6);
    assert_eq!(read["text"], "<ä>");
    let rounded: Vec<i64> = read["image"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| (n.as_f64().unwrap() * 1000.0).round() as i64)
        .collect();
    assert_eq!(rounded, [1000, 6000, -50, 50, 45, 1000]);
}

/// Returns the colour of the scene at a place.
pub fn pixel(browser: &mut Browser, [x_m, y_m]: [f64; 2]) -> Vec<u64> {
    let read = browser.eval(&format!(
        "(() => {{ const {{ scene }} = tomoswarm, [x, y] = scene.toPixel({x_m}, {y_m}), r = scene.canvas.width / scene.canvas.clientWidth;
           return [...scene.canvas.getContext('2d').getImageData(Math.round(x * r), Math.round(y * r), 1, 1).data]; }})()"
    ));
    let channels = read.as_array().unwrap().iter();
    channels.map(|channel| channel.as_u64().unwrap()).collect()
}

#[test]
fn the_page_shows_the_swarm_and_the_space_key_stops_it() {
    let Some(mut browser) = Browser::open(1440, 900) else {
        return;
    };
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.until("all are there", 60, |watch| {
        let all = (1..=2).all(|id| watch.view.state(VehicleId(id)).is_some());
        all && watch.view.grounds().next().is_some()
    });
    swarm.order(&["start", "1", "2", "--run", "1", "--timeout", "60"]);
    let _evil = evil_vehicle(&swarm);
    browser.go(&dash.operate);
    browser.until(
        "document.querySelectorAll('#vehicles tr[data-vehicle]').length === 3",
        30,
    );
    assert_eq!(
        browser.eval("document.getElementById('showing').textContent"),
        "LIVE"
    );
    golden_frames(&mut browser);

    browser.until("[...document.querySelectorAll('#vehicles td')].some((cell) => cell.textContent.includes('<img src=x'))", 10);
    // Its trouble stands below its row, as wide as the table, and the row is described by it; so is what has no column.
    let troubles = browser.eval(
        "(() => { const row = document.querySelector('tr[data-vehicle=\"9\"]'), below = row.nextElementSibling.firstChild;
           const wide = below.offsetWidth >= 0.95 * document.getElementById('vehicles').offsetWidth;
           const isDescribed = row.getAttribute('aria-describedby') === below.id;
           return [/^[1-9]$/.test(row.lastChild.textContent), isDescribed, wide, below.offsetHeight < 100]; })()",
    );
    assert_eq!(troubles, json!([true, true, true, true]));
    browser.until(&format!("/^hears: .* · autopilot: /.test({})", below(9)), 5);
    assert_eq!(
        browser.eval("document.querySelectorAll('#vehicles img').length"),
        0,
        "it is text"
    );

    sort_the_fleet(&mut browser);

    let (wall, free) = (WALL_M, [WALL_M[0] + 4.0, WALL_M[1]]);
    browser.until(
        &format!(
            "tomoswarm.scene.cellWord({}, {}) === 'occupied'",
            wall[0], wall[1]
        ),
        20,
    );
    std::thread::sleep(Duration::from_millis(500));
    let (dark, light) = (pixel(&mut browser, wall), pixel(&mut browser, free));
    assert!(dark[0] < 60, "occupied is dark: {dark:?}");
    assert!(light[0] > 190, "free is light: {light:?}");
    browser.until(
        "[1, 2].some((id) => !tomoswarm.model.states.get(id).isAtRest)",
        60,
    );

    let began = Instant::now();
    browser.key(" ", "Space", 32);
    let is_open = |watch: &crate::swarm::Watch| !watch.view.open_stops().is_empty();
    while !swarm.look(is_open) {
        assert!(
            began.elapsed() < Duration::from_secs(5),
            "no stop on the bus"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    println!(
        "space key to stop on the bus: {} ms, the browser's tools included",
        began.elapsed().as_millis()
    );
    swarm.until("every vehicle stands under a stop", 10, |watch| {
        (1..=2).all(|id| {
            watch.view.state(VehicleId(id)).is_some_and(|state| {
                matches!(state.value.stands_under, Some(StandReason::Stop(_)))
                    && state.value.is_at_rest
            })
        })
    });
    browser.until(
        "document.getElementById('stops').innerText.includes('shown by 1, 2')",
        10,
    );
    browser.until(
        "document.querySelectorAll('#vehicles tr.stopped').length === 2",
        10,
    );
    shot(&mut browser, "stopped");

    look_back(&mut browser);
    start_again(&mut browser, &swarm);
    // How the last order fared with it stands in a vehicle's own row.
    browser.until(
        "/: start ./.test(document.querySelector('tr[data-vehicle=\"1\"]').children[4].textContent)",
        10,
    );
    one_that_falls_silent_is_grey(&mut browser, &swarm);
    // A letter that chooses in a list holds nobody.
    browser.eval("(() => { document.getElementById('stop-result').textContent = ''; document.getElementById('time-speed').focus(); })()");
    browser.key("h", "KeyH", 72);
    let held = browser.eval("document.getElementById('stop-result').textContent");
    assert_eq!(held, "");
    browser.eval("document.activeElement.blur()");

    // Who looks only stops nobody, and sees that.
    browser.go("about:blank");
    browser.go(&dash.look);
    browser.until(
        "document.querySelectorAll('#vehicles tr[data-vehicle]').length === 3",
        20,
    );
    browser.key("h", "KeyH", 72);
    assert!(
        browser
            .eval("document.getElementById('stop-result').textContent")
            .as_str()
            .unwrap()
            .contains("look only")
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// The text of the row below a vehicle's.
fn below(vehicle: u8) -> String {
    format!("document.querySelector('tr[data-vehicle=\"{vehicle}\"]').nextElementSibling.innerText")
}

/// The row of a vehicle that falls silent is grey and says for how long, and is as the others again when it speaks.
fn one_that_falls_silent_is_grey(browser: &mut Browser, swarm: &Swarm) {
    let row = "document.querySelector('tr[data-vehicle=\"2\"]')";
    browser.until(&format!("!{row}.matches('.silent')"), 10);
    swarm.stop(vehicle(2));
    browser.until(
        &format!(
            "{row}.matches('.silent') && /^silent for [0-9]+ s$/.test({row}.children[1].textContent)
             && parseFloat({row}.children[5].textContent) >= 2"
        ),
        10,
    );
    let is_grey = format!(
        "getComputedStyle({row}).color !== getComputedStyle(document.getElementById('vehicles')).color"
    );
    assert_eq!(browser.eval(&is_grey), true);
    swarm.go_on(vehicle(2));
    browser.until(&format!("!{row}.matches('.silent')"), 10);
}

/// Presses heads of the table of vehicles: rows change places, and a row that has nothing comes last either way.
fn sort_the_fleet(browser: &mut Browser) {
    let stand = "[...document.querySelectorAll('#vehicles tr[data-vehicle]')].map((row) => row.dataset.vehicle).join()";
    let head = |n: usize| format!("#vehicles thead th:nth-child({n}) button");
    let order = |browser: &mut Browser, wanted: &str, sorted: &str| {
        browser.until(&format!("{stand} === '{wanted}'"), 5);
        let shown = "document.querySelector('#vehicles [aria-sort]').getAttribute('aria-sort')";
        assert_eq!(browser.eval(shown), sorted);
    };
    order(browser, "1,2,9", "ascending");
    hold(browser, &head(1), 0);
    order(browser, "9,2,1", "descending");
    // Vehicle 9 has troubles.
    hold(browser, &head(10), 0);
    order(browser, "9,1,2", "ascending");
    // Each row below went with its vehicle's.
    let is_below = "[...document.querySelectorAll('#vehicles tr[data-vehicle]')].every((row) => row.nextElementSibling.firstChild.id === `below-${row.dataset.vehicle}`)";
    assert_eq!(browser.eval(is_below), true);
    hold(browser, &head(1), 0);
    order(browser, "1,2,9", "ascending");
    browser.eval("document.querySelector('tr[data-vehicle=\"1\"]').focus()");
    browser.key("ArrowDown", "ArrowDown", 40);
    assert_eq!(browser.eval("document.activeElement.dataset.vehicle"), "2");
    browser.eval("document.activeElement.blur()");
}

/// Looks at the pixels of the mean, which are the paler the less certain they are, and at those of the deviation, which are not.
fn see_what_is_uncertain(browser: &mut Browser) {
    let drawn = "(() => { const { model } = tomoswarm, image = model.images.get(0), heat = document.getElementById('heat');
           const side = heat.width / image.columns, pen = heat.getContext('2d'), most = Math.max(...image.deviation);
           const seen = (k) => [...pen.getImageData((k % image.columns + 0.5) * side, (image.rows - Math.floor(k / image.columns) - 0.5) * side, 1, 1).data];
           const some = [...image.deviation.keys()].filter((k) => k % 37 === 0);";
    let choose = |browser: &mut Browser, id: &str, value: &str| {
        browser.eval(&format!("(() => {{ const s = document.getElementById('{id}'); s.value = '{value}'; s.dispatchEvent(new Event('change')); }})()"));
    };
    let paler = format!(
        "{drawn} const least = Math.min(...image.deviation);
         return most > 1.05 * least && some.every((k) => Math.abs(seen(k)[3] / 255 - (1 - 0.75 * image.deviation[k] / most)) < 0.02); }})()"
    );
    browser.until(&paler, 20);
    choose(browser, "image-plane", "deviation");
    choose(browser, "image-scale", "0.5");
    let as_it_is = format!(
        "{drawn} const isRight = (k) => {{ const colour = model.place.heat[Math.round(Math.min(1, image.deviation[k] / 0.5) * 255)], at = seen(k);
           return at[3] === 255 && colour.every((channel, i) => channel === at[i]); }};
         return document.getElementById('heat-scale').textContent.startsWith('Deviation, 0 (dark) to 0.5') && some.every(isRight); }})()"
    );
    browser.until(&as_it_is, 20);
    choose(browser, "image-plane", "significance");
    let in_deviations = format!(
        "{drawn} const isRight = (k) => image.mean[k] < 0 || seen(k)[3] === 255 && model.place.heat[Math.round(Math.min(1, image.mean[k] / image.deviation[k] / 6) * 255)].every((channel, i) => channel === seen(k)[i]);
         return some.every(isRight); }})()"
    );
    browser.until(&in_deviations, 20);
    choose(browser, "image-plane", "mean");
    choose(browser, "image-scale", "4");
}

#[test]
fn an_image_comes_to_the_page_and_a_page_without_a_scene_still_stops() {
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.begin();
    browser.go(&dash.operate);
    browser.until("tomoswarm.model.images.has(0)", 240);
    browser.eval("(() => { const s = document.getElementById('image-subject'); s.value = '0'; s.dispatchEvent(new Event('change')); })()");
    browser.until(
        "document.getElementById('heat-scale').textContent.includes('dB/m')",
        10,
    );
    // Images come every second while it is looked: what is drawn is soon what is there. Uncertain pixels fade, which rounds.
    browser.until(
        "(() => { const { model } = tomoswarm, image = model.images.get(0), heat = document.getElementById('heat');
           const scaled = document.getElementById('heat-scale').textContent.match(/to ([0-9.]+) dB/);
           if (!image || !scaled) return false;
           const brightest = image.mean.indexOf(Math.max(...image.mean));
           const side = heat.width / image.columns, column = brightest % image.columns, row = Math.floor(brightest / image.columns);
           const scale = Number(scaled[1]);
           const colour = model.place.heat[Math.round(Math.min(1, image.mean[brightest] / scale) * 255)];
           const seen = heat.getContext('2d').getImageData((column + 0.5) * side, (image.rows - row - 0.5) * side, 1, 1).data;
           const isNear = (channel, i) => Math.abs(channel - seen[i]) <= 4;
           // The first images may have nothing in them.
           return Boolean(colour) && colour.every(isNear) && seen[3] >= 63 && image.mean[brightest] > 0; })()",
        20,
    );
    shot(&mut browser, "image");
    see_what_is_uncertain(&mut browser);

    assert_eq!(browser.complaints, Vec::<String>::new());
    browser.expect_complaints(&["/scene2d.js\""]);
    browser.ask("Network.setBlockedURLs", json!({"urls": ["*/scene2d.js"]}));
    browser.go("about:blank");
    browser.go(&dash.operate);
    browser.until("document.documentElement.dataset.mayStop === 'yes'", 10);
    assert_eq!(
        browser.eval("typeof tomoswarm"),
        "undefined",
        "the scene is gone, and what needs it"
    );
    browser.pointer("mousePressed", "#stop");
    swarm.until("everyone stands under a stop", 10, |watch| {
        (1..=2).all(|id| {
            let state = watch.view.state(VehicleId(id));
            state
                .is_some_and(|state| matches!(state.value.stands_under, Some(StandReason::Stop(_))))
        })
    });
    browser.until(
        "document.getElementById('stop-result').textContent.includes('Stop is given')",
        5,
    );
}

/// The names of all views beside the scene.
fn views(browser: &mut Browser) -> Vec<String> {
    let names = "[...document.querySelectorAll('[role=tab]')].map((tab) => tab.getAttribute('aria-controls'))";
    let names: Vec<String> = serde_json::from_value(browser.eval(names)).unwrap();
    assert!(names.len() >= 8, "{names:?}");
    names
}

/// Shows a view by its tab.
pub fn view(browser: &mut Browser, name: &str) {
    hold(browser, &format!("#tab-{name}"), 0);
    browser.eval(&format!("document.getElementById('tab-{name}').click()"));
    browser.until(&format!("!document.getElementById('{name}').hidden"), 5);
}

/// Every control that the browser's tree for screen readers has, and whatever takes the focus, must have a role and a name.
pub fn every_control_has_a_name(browser: &mut Browser) {
    let tree = browser.ask("Accessibility.getFullAXTree", json!({}));
    let roles = [
        "button",
        "checkbox",
        "combobox",
        "tab",
        "textbox",
        "spinbutton",
        "slider",
        "link",
        "image",
    ];
    let takes_focus = |node: &serde_json::Value| {
        let properties = node["properties"].as_array();
        let mut properties = properties.into_iter().flatten();
        properties.any(|of| of["name"] == "focusable" && of["value"]["value"] == json!(true))
    };
    let nodes = tree["nodes"].as_array().unwrap();
    let controls: Vec<_> = nodes
        .iter()
        .filter(|node| node["ignored"] != json!(true))
        .filter(|node| takes_focus(node) || roles.iter().any(|role| node["role"]["value"] == *role))
        .collect();
    assert!(controls.len() > 20, "{} controls", controls.len());
    for control in controls {
        let name = control["name"]["value"].as_str().unwrap_or_default();
        let role = control["role"]["value"].as_str().unwrap_or_default();
        assert!(
            !name.trim().is_empty() && !["", "none", "generic"].contains(&role),
            "a control without a name or a role: {control}"
        );
    }
}

#[test]
fn the_views_show_radio_plans_and_what_happened() {
    let Some(mut browser) = Browser::open(1440, 900) else {
        return;
    };
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.begin();
    let _evil = evil_vehicle(&swarm);
    browser.go(&dash.operate);
    browser.until("tomoswarm.model.pairs.has('9-8')", 30);

    view(&mut browser, "radio");
    let cell = |plane: &str| {
        format!(
            "(() => {{ const s = document.getElementById('radio-plane'); s.value = '{plane}'; s.dispatchEvent(new Event('change')); }})()"
        )
    };
    let said = "[...document.querySelectorAll('#radio-matrix button')].map((b) => b.getAttribute('aria-label')).find((t) => t.startsWith('9 hears 8'))";
    browser.until(&format!("/-[0-9]+ dBm/.test({said})"), 10);
    browser.eval(&cell("loss"));
    browser.until(&format!("/2[0-9] % missed/.test({said})"), 10);
    browser.eval("[...document.querySelectorAll('#radio-matrix button')].find((b) => b.getAttribute('aria-label').startsWith('9 hears 8')).click()");
    browser.until("!document.getElementById('pair-history').hidden", 5);
    shot(&mut browser, "radio");

    view(&mut browser, "log");
    browser.until(
        "document.getElementById('log-list').innerText.includes('<img src=x')",
        10,
    );
    assert_eq!(
        browser.eval("document.querySelectorAll('#log-list img').length"),
        0,
        "it is text"
    );
    browser.eval("(() => { const s = document.getElementById('log-vehicle'); s.value = '9'; s.dispatchEvent(new Event('change')); })()");
    browser.until("[...document.querySelectorAll('#log-list li')].every((li) => !/(change|trouble|→) [0-8]:/.test(li.innerText))", 5);
    browser.key("h", "KeyH", 72);
    browser.until(
        "document.getElementById('log-list').innerText.includes('hold, by page')",
        10,
    );
    // How it fared, and by whose right, stands there as well; and in the log of the page's program, with the page.
    browser.until(
        "/order [0-9]+: (done|NOT DONE) by lease [1-9][0-9]*: 1 has obeyed after/.test(document.getElementById('log-list').innerText)",
        10,
    );
    let page = browser.eval("tomoswarm.model.place.page");
    let log = std::fs::read_to_string(swarm.path("dash.log")).unwrap();
    let given = format!("of a page: {{\\\"order\\\":\\\"hold\\\",\\\"page\\\":{page},");
    let ended = format!("(hold all, by page {page}) is over: ");
    let line = |words: &str| log.lines().find(|line| line.contains(words));
    assert!(line(&given).is_some(), "{given}: {log}");
    let fate = line(&ended).unwrap_or_else(|| panic!("{ended}: {log}"));
    for words in [" by lease ", "1 has obeyed after", "2 has obeyed after"] {
        assert!(fate.contains(words), "{words}: {fate}");
    }
    shot(&mut browser, "log");

    view(&mut browser, "plan");
    browser.until("tomoswarm.model.timetable?.rows.length === 2", 120);
    browser.until(
        "document.getElementById('plan-summary').textContent.includes('Longest chain')",
        5,
    );
    let drawn = "(() => { const c = document.getElementById('gantt'); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        return d.some((v, i) => i % 4 === 3 && v > 0); })()";
    browser.until(drawn, 5);
    shot(&mut browser, "plan");

    view(&mut browser, "check");
    browser.until(
        "document.getElementById('preflight-verdict').textContent === '✖ NO-GO'",
        10,
    );
    browser.until(
        "/vehicle 9[^]*NO-GO/.test(document.getElementById('preflight-list').innerText)",
        5,
    );
    shot(&mut browser, "check");
    begin_a_mission(&mut browser);
    for name in views(&mut browser) {
        view(&mut browser, &name);
        every_control_has_a_name(&mut browser);
    }
    view(&mut browser, "begin");
    for theme in ["dark", "sunlight"] {
        browser.eval(&format!("(() => {{ const s = document.getElementById('theme'); s.value = '{theme}'; s.dispatchEvent(new Event('change')); }})()"));
        browser.until(
            &format!("document.documentElement.dataset.theme === '{theme}'"),
            5,
        );
        std::thread::sleep(Duration::from_millis(300));
        shot(&mut browser, theme);
    }
    assert_eq!(browser.complaints, Vec::<String>::new());
    drop(browser);
    on_a_phone(&dash);
}

/// Begins a mission with a place that is pointed at; before that one with a mistake, which the server refuses.
fn begin_a_mission(browser: &mut Browser) {
    take_seat(browser);
    view(browser, "begin");
    browser.until(
        "document.getElementById('mission-kind').options.length > 5",
        5,
    );
    let fill = |kind: &str, key: &str, value: &str| {
        format!(
            "(() => {{ const k = document.getElementById('mission-kind'); k.value = '{kind}'; k.dispatchEvent(new Event('change'));
               const i = document.querySelector('#mission-keys input[name={key}]'); i.value = '{value}'; i.dispatchEvent(new Event('input', {{bubbles: true}})); }})()"
        )
    };
    // What is refused stands in the console of the browser as an answer of 400.
    browser.expect_complaints(&["status of 400", "/order\""]);
    browser.eval(&fill("sweep", "laps", "0"));
    let command = "document.getElementById('begin-command').textContent";
    browser.until(
        &format!("{command}.endsWith(\"start --mission sweep --set 'laps=0'\")"),
        5,
    );
    hold(browser, "#begin-mission", 4000);
    browser.until(
        "/laps.*0/.test(document.getElementById('begin-result').textContent)",
        10,
    );
    shot(browser, "refused");
    browser.eval(&fill("pathfind", "waypoints_m", ""));
    browser.eval("[...document.querySelectorAll('#mission-keys button')].find((b) => b.textContent.startsWith('Add places')).click()");
    hold(browser, "#plane", 0);
    browser.until("/^\\[\\[-?[0-9.]+, -?[0-9.]+\\]\\]$/.test(document.querySelector('#mission-keys input[name=waypoints_m]').value)", 5);
    shot(browser, "begin");
    browser.eval("tomoswarm.scene.pick === null");
    hold(browser, "#begin-mission", 4000);
    browser.until(
        "document.getElementById('begin-result').textContent.includes('is given')",
        10,
    );
    browser.until(
        "document.getElementById('given').innerText.includes('start pathfind')",
        10,
    );
}

/// On a phone nothing is wider than the window, also with three dimensions, and Stop is seen and works by touch.
fn on_a_phone(dash: &Dash) {
    let Some(mut browser) = Browser::open(390, 844) else {
        return;
    };
    browser.ask(
        "Emulation.setTouchEmulationEnabled",
        json!({"enabled": true}),
    );
    browser.go(&dash.operate);
    browser.until(
        "document.querySelectorAll('#vehicles tr[data-vehicle]').length === 3",
        20,
    );
    // What has no column stands below.
    browser.until(
        &format!(
            "/^ordered: .* · waiting: .* · hears: .* · autopilot: /.test({})",
            below(1)
        ),
        5,
    );
    browser.eval("document.getElementById('view-space').click()");
    browser.until("tomoswarm.view.space?.frames > 0", 10);
    for name in views(&mut browser) {
        browser.eval(&format!("document.getElementById('tab-{name}').click()"));
        browser.until(&format!("!document.getElementById('{name}').hidden"), 5);
        std::thread::sleep(Duration::from_millis(400));
        let width = browser.eval("Math.max(document.documentElement.scrollWidth, document.querySelector('main').scrollWidth)");
        assert!(
            width.as_u64().unwrap() <= 390,
            "{name}: {width} pixels wide"
        );
        // Sideways scroll the boxes of tables and of the plans, nothing else, and nothing is cut off.
        let wide = browser.eval(
            "[...document.querySelectorAll('body *')].filter((e) => e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1
               && getComputedStyle(e).overflowX !== 'visible' && !e.matches('.scroll, option, select, input, canvas')).map((e) => e.id || e.outerHTML.slice(0, 80))",
        );
        assert_eq!(wide, json!([]), "{name}");
        let stop = browser.eval(
            "(() => { const r = document.getElementById('stop').getBoundingClientRect(), bar = document.getElementById('bar').getBoundingClientRect();
               return r.top >= 0 && r.bottom <= innerHeight && r.height >= 44 && r.width > 300 && Math.abs(bar.bottom - innerHeight) <= 1; })()",
        );
        assert_eq!(stop, json!(true), "{name}: Stop is seen, at the bottom");
        every_control_has_a_name(&mut browser);
        if name == "radio" {
            browser.eval("document.getElementById('views').scrollIntoView()");
        }
        shot(&mut browser, &format!("phone-{name}"));
    }
    browser.eval("document.getElementById('space').scrollIntoView()");
    shot(&mut browser, "phone-space");
    time_on_a_phone(&mut browser);
    browser.touch("#stop");
    browser.until(
        "document.getElementById('stop-result').textContent.includes('Stop is given')",
        5,
    );
    browser.until("document.querySelectorAll('#stops li').length > 0", 10);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Speed and marks are folded in, and unfolded by a finger; then they work, and nothing is too wide.
fn time_on_a_phone(browser: &mut Browser) {
    let seen = |id: &str| format!("document.getElementById('{id}').offsetHeight > 0");
    let folded = ["time-speed", "time-before", "time-after", "time-text"];
    for id in folded {
        browser.until(&format!("!({})", seen(id)), 5);
    }
    browser.touch("#time-more");
    for id in folded {
        browser.until(&seen(id), 5);
    }
    let width = browser.eval("Math.max(document.documentElement.scrollWidth, document.getElementById('time').scrollWidth)");
    assert!(width.as_u64().unwrap() <= 390, "{width} pixels wide");
    shot(browser, "phone-time");
    browser.touch("#time-before");
    browser.until(
        "tomoswarm.model.moment.speed === 0 && document.getElementById('time-mark').textContent.length > 5",
        10,
    );
    // What a replay does not offer is gone, and what stands above it has come down.
    browser.until("document.getElementById('start').offsetHeight === 0", 5);
    let stop = "document.getElementById('stop').getBoundingClientRect().bottom <= innerHeight";
    assert_eq!(browser.eval(stop), true, "Stop is seen");
    let width = browser.eval("document.documentElement.scrollWidth");
    assert!(width.as_u64().unwrap() <= 390, "{width} pixels wide");
    browser.eval("(() => { const s = document.getElementById('time-speed'); s.value = '4'; s.dispatchEvent(new Event('change')); })()");
    browser.touch("#time-play");
    browser.until("tomoswarm.model.moment.speed === 4", 10);
    browser.touch("#time-present");
    browser.until("tomoswarm.model.isPresent()", 10);
    browser.until("document.getElementById('start').offsetHeight > 0", 5);
    browser.touch("#time-more");
    browser.until(&format!("!({})", seen("time-speed")), 5);
}

/// The page of a swarm of two vehicles that has just begun, with the link that may order; `None` where there is no browser.
pub fn live_page(width: u32, height: u32) -> Option<(Browser, Swarm, Dash)> {
    let mut browser = Browser::open(width, height)?;
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    browser.go(&dash.operate);
    browser.until(
        "tomoswarm.model.states.size === 2 && tomoswarm.model.ground?.isHeard && tomoswarm.scene.view",
        60,
    );
    Some((browser, swarm, dash))
}

/// Holds the button until the page has the seat.
pub fn take_seat(browser: &mut Browser) {
    hold(browser, "#take-seat", 4000);
    browser.until(
        "tomoswarm.model.orders.seat === tomoswarm.model.place.page",
        10,
    );
}

/// Presses an element for so long.
pub fn hold(browser: &mut Browser, selector: &str, hold_ms: u64) {
    browser.pointer("mousePressed", selector);
    std::thread::sleep(Duration::from_millis(hold_ms));
    browser.pointer("mouseReleased", selector);
}

/// Takes the seat and starts vehicles 1 and 2 again by buttons that are held; a tap does nothing.
fn start_again(browser: &mut Browser, swarm: &Swarm) {
    let is_open = |watch: &crate::swarm::Watch| !watch.view.open_stops().is_empty();
    for id in [1, 2] {
        hold(browser, &format!("tr[data-vehicle=\"{id}\"]"), 0);
    }
    assert_eq!(
        browser.eval("document.getElementById('start').disabled"),
        true,
        "it has not the seat"
    );
    take_seat(browser);
    browser.until(
        "document.getElementById('start').textContent === 'Start 1, 2'",
        5,
    );
    hold(browser, "#start", 300);
    std::thread::sleep(Duration::from_millis(1200));
    assert!(swarm.look(is_open), "a tap does nothing");
    let began = Instant::now();
    while swarm.look(is_open) {
        assert!(
            began.elapsed() < Duration::from_secs(40),
            "the stop is not lifted"
        );
        // A start is refused while a vehicle was not heard for 2 s.
        hold(browser, "#start", 4000);
        std::thread::sleep(Duration::from_secs(2));
    }
}

/// A moment of a live swarm that is over is no present: it is called a replay, and nothing is begun from there; but Stop is
/// Stop.
fn look_back(browser: &mut Browser) {
    let is_back = "tomoswarm.model.moment.speed === 0 && document.title.startsWith('REPLAY')";
    browser.until(
        "tomoswarm.model.markers.some((mark) => mark.kind === 'order')",
        5,
    );
    browser.key("[", "BracketLeft", 219);
    browser.until(is_back, 10);
    browser.eval("globalThis.wanted_s = tomoswarm.model.moment.to_s - 1; tomoswarm.time.goTo(wanted_s, 0); 0");
    browser.until(
        "Math.abs(tomoswarm.model.shown_ms / 1000 - wanted_s) < 0.01 && tomoswarm.model.states.size === 3",
        10,
    );
    browser.until(
        "document.getElementById('age').textContent.includes('ago')",
        10,
    );
    for (id, is_hidden) in [
        ("start", true),
        ("take-seat", true),
        ("stop", false),
        ("hold", false),
    ] {
        let hides = format!(
            "(getComputedStyle(document.getElementById('{id}')).display === 'none') === {is_hidden}"
        );
        browser.until(&hides, 5);
    }
    shot(browser, "looking_back");
    browser.eval("delete document.documentElement.dataset.stopNumber");
    browser.key(" ", "Space", 32);
    browser.until(
        "document.documentElement.dataset.stopNumber !== undefined",
        5,
    );
    browser.key("n", "KeyN", 78);
    browser.until(
        "document.title.startsWith('LIVE') && tomoswarm.model.isPresent()",
        10,
    );
    browser.until(
        "document.querySelectorAll('#vehicles tr.stopped').length === 2",
        10,
    );
}

/// Keeps what is seen, where a folder for that is named.
pub fn shot(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("SCREENSHOTS") {
        let path = std::path::Path::new(&folder).join(format!("{name}.png"));
        std::fs::write(path, browser.screenshot()).unwrap();
    }
}
