//! Nodes that do not belong to the swarm, or talk nonsense: on an unprotected bus, where nothing but the nodes themselves
//! can refuse them.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tomoswarm_proto::{
    Boot, Deviation, Heading, Hello, LayerId, Message, Permille, PoseReport, Position, Sample,
    Samples, Sender, State, TILE_CELLS, TileAddress, TileReport, VehicleId, VehicleMode, codec,
};

use crate::raw::{Shows, Stranger};
use crate::swarm::{GROUND, Size, Swarm, free_address, vehicle};

const PREFIX: &str = "tomoswarm/courtyard";
/// What the flood brings, bytes per second.
const FLOOD: usize = 5_000_000;

fn stranger(swarm: &Swarm) -> Stranger {
    let all: Vec<_> = [GROUND, vehicle(1), vehicle(2)]
        .map(|node| swarm.address(node))
        .to_vec();
    let stranger = Stranger::peer(Shows::Nothing, None, &all);
    while stranger.links() < 3 {
        std::thread::sleep(Duration::from_millis(50));
    }
    stranger
}

fn frame(message: &Message) -> Vec<u8> {
    codec::encode(message).unwrap()
}

fn state(id: u8, boot: u32, sequence: u64) -> Message {
    Message::State(State {
        vehicle: VehicleId(id),
        boot: Boot(boot),
        sequence,
        // In a corner where nobody drives: what it says of itself is believed.
        pose: Some(PoseReport {
            at: Position::from_metres(-3.0, 9.0, 0.0),
            heading: Heading(0),
            sd: Deviation(50),
        }),
        is_at_rest: true,
        mode: VehicleMode::Idle,
        battery: Some(Permille::WHOLE),
        leg: None,
        accepted: Default::default(),
        ordered: Default::default(),
        ..State::default()
    })
}

/// A sample that nobody has measured.
pub fn sample(sequence: u64) -> Sample {
    Sample {
        sequence,
        heard_at_ns: 1,
        transmitter: VehicleId(1),
        transmitter_pose: PoseReport::default(),
        receiver_pose: PoseReport::default(),
        channel: 15,
        power_dbm: 0,
        rssi_dbm: Some(-50),
    }
}

/// Returns one message of each kind that makes those who keep it grow.
fn flood(number: u32) -> [(String, Message); 3] {
    let me = VehicleId(9);
    let layer = LayerId {
        vehicle: me,
        boot: Boot(number / 7),
    };
    // Beyond the fence: within it, what it calls occupied would be avoided.
    let at = number as i32 + 1_000_000;
    let address = TileAddress {
        slice: 0,
        x: 1000 + at % 1000,
        y: at / 1000,
    };
    // Cells that do not repeat, so that the frame is long.
    let cells = std::sync::Arc::new(std::array::from_fn::<i8, TILE_CELLS, _>(|cell| {
        (cell * 37 % 90) as i8
    }));
    let tile = TileReport {
        layer,
        address,
        revision: 1,
        cells,
    };
    let samples = (0..60).map(sample).collect();
    let batch = Samples {
        vehicle: me,
        boot: Boot(number),
        run: tomoswarm_proto::RunId(1),
        samples,
        lost: vec![],
    };
    let key = format!("tile/9/{}/0/{}/{}", number / 7, address.x, address.y);
    [
        (key, Message::Tile(tile)),
        ("samples".to_owned(), Message::Samples(batch)),
        ("state".to_owned(), state(9, 1, u64::from(number))),
    ]
}

/// Ends a flood when it is dropped.
struct EndsFlood<'a>(&'a AtomicBool);

impl Drop for EndsFlood<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_vehicle_that_floods_stops_nobody() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let stranger = stranger(&swarm);
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (began, mut sent) = (Instant::now(), 0);
            for number in 0.. {
                for (key, message) in flood(number) {
                    let frame = frame(&message);
                    sent += frame.len();
                    stranger.say(&format!("{PREFIX}/vehicle/9/{key}"), &frame);
                }
                if is_over.load(Ordering::Relaxed) {
                    println!(
                        "flooded with {sent} bytes in {:.1} s",
                        began.elapsed().as_secs_f64()
                    );
                    break;
                }
                let due = Duration::from_secs_f64(sent as f64 / FLOOD as f64);
                std::thread::sleep(due.saturating_sub(began.elapsed()));
            }
        });
        // Also when a wait here fails: what floods must end, or nothing does.
        let _ends = EndsFlood(&is_over);
        swarm.begin();
        swarm.until_end();
        // While it still floods, and while what it has said of its map is passed on.
        swarm.until_delivered();
    });
    for node in [GROUND, vehicle(1), vehicle(2)] {
        assert!(
            swarm
                .log_of(node)
                .contains("more than its share of the bus"),
            "{node} refuses nothing"
        );
    }
    swarm.finish_among_strangers();
}

/// Bytes that are no message, each in its own way.
fn nonsense() -> Vec<Vec<u8>> {
    let good = frame(&state(9, 1, 1));
    let tile = frame(&flood(1)[0].1);
    let mut all: Vec<Vec<u8>> = (0..good.len())
        .map(|length| good[..length].to_vec())
        .collect();
    all.extend(
        (0..tile.len())
            .step_by(97)
            .map(|length| tile[..length].to_vec()),
    );
    // Every byte in turn is another one, and every kind claims the same body.
    for at in 0..good.len() {
        all.extend([0x01, 0x80, 0xff].map(|bits| {
            let mut bytes = good.clone();
            bytes[at] ^= bits;
            bytes
        }));
    }
    for kind in 0..=255 {
        let mut bytes = good.clone();
        bytes[3] = kind;
        all.push(bytes);
        // A header, and behind it lengths that would take all memory.
        all.push([&good[..3], &[kind], &[0xff; 40]].concat());
        all.push(
            [
                &good[..3],
                &[kind],
                &[0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f],
            ]
            .concat(),
        );
    }
    let long = |bytes: usize| [good.clone(), vec![0; bytes]].concat();
    all.extend([
        long(1),
        long(256 << 10),
        long((1 << 20) + 1),
        vec![0xaa; 2 << 20],
    ]);
    all
}

#[test]
fn nonsense_under_every_key_is_refused() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let stranger = stranger(&swarm);
    swarm.begin();
    let kinds = [
        "hello",
        "state",
        "tile/9/1/0/0/0",
        "digest",
        "want/9/1",
        "plan/1",
        "mission",
        "order/1",
        "samples",
    ];
    let kinds = kinds
        .into_iter()
        .chain(["have", "beacon", "health", "report", "unheard-of", ""]);
    let keys: Vec<String> = kinds
        .flat_map(|kind| {
            [
                "vehicle/9",
                "vehicle/1",
                "ground",
                "operator/1",
                "vehicle/300",
                "x",
            ]
            .map(|who| format!("{who}/{kind}"))
        })
        .map(|key| format!("{PREFIX}/{}", key.trim_end_matches('/')))
        .collect();
    let all = nonsense();
    for (number, bytes) in all.iter().enumerate() {
        // Each of them under some keys, the long ones under a few: a share of the bus is soon spent.
        let step = if bytes.len() > 10_000 { 40 } else { 7 };
        for key in keys.iter().skip(number % step).step_by(step) {
            stranger.insist(key, bytes);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    println!("{} kinds of nonsense under {} keys", all.len(), keys.len());
    swarm.finish_among_strangers();
    for node in [GROUND, vehicle(1), vehicle(2)] {
        assert!(
            swarm.log_of(node).contains("refused a frame"),
            "{node} refuses nothing"
        );
    }
}

#[test]
fn of_two_vehicles_with_one_id_the_second_leaves_with_a_word() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    swarm.begin();
    let bus = format!(
        "[bus]\nlisten = [\"tcp/{}\"]\nconnect = [\"tcp/{}\"]\n",
        free_address(),
        swarm.address(GROUND)
    );
    swarm.write("twin.toml", &swarm.vehicle_text(1, "state-twin", &bus));
    swarm.spawn("twin", &["vehicle", "twin.toml"]);
    let (code, output) = swarm.ended("twin", Duration::from_secs(10));
    assert_eq!(code, Some(2), "{output}");
    assert!(
        output.contains("vehicle 1 is on the bus already"),
        "{output}"
    );
    swarm.finish();
}

#[test]
fn another_version_of_the_wire_or_another_venue_is_refused_on_both_sides() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let stranger = stranger(&swarm);
    swarm.begin();
    let venue = std::fs::read_to_string(swarm.path("venue.toml")).unwrap();
    let bus = format!(
        "[bus]\nlisten = [\"tcp/{}\"]\nconnect = [\"tcp/{}\"]\n",
        free_address(),
        swarm.address(GROUND)
    );
    let text = swarm
        .vehicle_text(3, "state-3", &bus)
        .replace("venue.toml", "other.toml");
    swarm.write(
        "other.toml",
        &venue.replace("area_m = [0, 0, 6, 6]", "area_m = [0, 0, 6, 6.5]"),
    );
    swarm.write("elsewhere.toml", &text);
    swarm.spawn("elsewhere", &["vehicle", "elsewhere.toml"]);
    let (code, output) = swarm.ended("elsewhere", Duration::from_secs(30));
    assert!(
        code == Some(2) && output.contains("another venue file"),
        "{code:?} {output}"
    );
    // A node of the next version, of which only the greeting can be read.
    let hello = Message::Hello(Hello {
        is_member: true,
        member_for_s: 60,
        software: "2.0.0".to_owned(),
        ..Hello::asking(vehicle(9), Boot(1), 1, 1)
    });
    let mut next = frame(&hello);
    next[2] = codec::VERSION + 1;
    next.extend([1, 2, 3]);
    let version = format!("vehicle 9 is refused: wire version {}", codec::VERSION + 1);
    let refuses = |node| swarm.log_of(node).contains(&version);
    // It is answered, so that it can say the same.
    let is_answered = |node: Sender| {
        stranger
            .heard()
            .contains_key(&format!("{PREFIX}/{}/hello", node.prefix()))
    };
    let mut left = vec![GROUND, vehicle(1), vehicle(2)];
    // On a busy machine each of them may be late.
    let limit = Instant::now() + Duration::from_secs(20);
    while !left.is_empty() {
        stranger.insist(&format!("{PREFIX}/vehicle/9/hello"), &next);
        std::thread::sleep(Duration::from_millis(200));
        left.retain(|node| !refuses(*node) || !is_answered(*node));
        let output = || {
            left.iter()
                .map(|node| swarm.log_of(*node))
                .collect::<String>()
        };
        assert!(
            Instant::now() < limit,
            "refused or not answered by {left:?}: {}",
            output()
        );
    }
    // It has left with the first objection; on a busy machine that need not be the one of the node that it connected to.
    let refused = "vehicle 3 is refused: another venue file";
    let mut nodes = [GROUND, vehicle(1), vehicle(2)].into_iter();
    assert!(nodes.any(|node| swarm.log_of(node).contains(refused)));
    swarm.finish();
}
