//! Pages, orders and the seat, without a network.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::dash::frame::FrameKind;
use crate::dash::gate::PAGES_MAX;
use crate::dash::told::Showing;
use crate::geom::Lattice;
use crate::operator::given_marks::{MarkOutcome, MarkRequest};
use crate::operator::outcome::OrderOutcome;
use crate::operator::tests_support::{at, heard, report, state};
use tomoswarm_proto::{
    Boot, EmergencyName, EmergencyStop, Heading, Image, ImageSubject, Interest, LayerId, Look,
    LookReading, Mark, NodeSettings, OpenStops, OperatorId, PoseReport, Position, Rectangle, RunId,
    Sample, Samples, Sender, TileAddress, TileReport, VehicleId,
};

const LOOK: &str = "00112233445566778899aabbccddeeff";
const OPERATE: &str = "ffeeddccbbaa99887766554433221100";

fn server() -> PageServer {
    let gate = Gate::new(LOOK.to_owned(), OPERATE.to_owned());
    PageServer::new(place(), venue(), Board::new(7, Lattice::new(0.1)), gate)
}

/// What holds for the connection, in one frame.
fn place() -> Place {
    Place {
        missions: Vec::new(),
        heat: Vec::new(),
        ..crate::dash::texts::place(&venue(), Showing::Live)
    }
}

fn venue() -> Venue {
    let text = include_str!("../../../configs/small.venue.toml");
    let read = crate::config::read("venue.toml", text, &mut |path| Err(path.to_owned()));
    match read.unwrap() {
        crate::config::Config::Venue(venue) => venue,
        other => panic!("{other:?}"),
    }
}

fn page(server: &mut PageServer, at_s: f64, token: &str) -> PageId {
    let id = server.open(at(at_s)).unwrap();
    let text = json!({ "token": token }).to_string();
    server.page_said(at(at_s), id, &text).unwrap();
    id
}

fn order(server: &mut PageServer, at_s: f64, token: &str, body: &str) -> Result<u32, GateRefusal> {
    let header = format!("Bearer {token}");
    server.order(at(at_s), Some(&header), body.as_bytes())
}

/// A stop for all.
const STOP: &str = r#"{"order":"stop","page":1}"#;

/// The operator looks after an order no longer.
fn end(server: &mut PageServer, at_s: f64, number: u32) {
    let outcome = OrderOutcome {
        vehicles: BTreeMap::new(),
        lease: None,
        run: None,
        refused: None,
        lifts: Vec::new(),
    };
    server.operator_said(at(at_s), &Out::Ended(GoalId::Hand(number), outcome));
}

fn told(effects: &[PageEffect]) -> usize {
    effects
        .iter()
        .filter(|effect| matches!(effect, PageEffect::Tell(_)))
        .count()
}

/// All texts of a kind among frames for a page.
fn texts(effects: &[PageEffect], page: PageId, kind: FrameKind) -> Vec<Value> {
    let text = |effect: &PageEffect| match effect {
        PageEffect::Send(to, frame) if *to == page && frame[0] == kind as u8 => {
            serde_json::from_slice(&frame[16..]).ok()
        }
        _ => None,
    };
    effects.iter().filter_map(text).collect()
}

fn stop_open() -> HeardMessage {
    let stop = EmergencyStop {
        name: EmergencyName(77_777),
        scope: StopScope::All,
        by: OperatorId(1),
    };
    let standing = OpenStops {
        open: vec![stop],
        lifted: Vec::new(),
    };
    HeardMessage::Message(Sender::Vehicle(VehicleId(1)), Message::Standing(standing))
}

#[test]
fn a_page_is_told_who_it_is_and_whether_it_may_order() {
    let mut server = server();
    let (one, two) = (
        page(&mut server, 0.0, LOOK),
        page(&mut server, 0.0, OPERATE),
    );
    let effects = server.due(at(0.0));
    for (id, (number, may_order)) in [(one, (1, false)), (two, (2, true))] {
        let welcome = texts(&effects, id, FrameKind::Welcome);
        let read = (&welcome[0]["page"], &welcome[0]["mayOrder"]);
        assert_eq!(read, (&json!(number), &json!(may_order)));
        assert_eq!((welcome.len(), &welcome[0]["showing"]), (1, &json!("LIVE")));
    }
}

#[test]
fn a_page_is_told_what_there_is_for_its_first_picture() {
    let mut server = server();
    let there_is = |server: &mut PageServer, at_s: f64| {
        let id = page(server, at_s, LOOK);
        let welcome = texts(&server.due(at(at_s)), id, FrameKind::Welcome).remove(0);
        [welcome["tiles"].clone(), welcome["images"].clone()]
    };
    assert_eq!(there_is(&mut server, 0.0), [json!(0), json!([])]);
    server.hear(at(1.0), &tile(1, 1, 9));
    server.hear(at(1.0), &structure(1, 1, 9));
    assert_eq!(there_is(&mut server, 2.0), [json!(1), json!([0])]);
}

#[test]
fn a_page_that_says_no_token_in_two_seconds_is_closed_and_gets_nothing() {
    let mut server = server();
    let id = server.open(at(0.0)).unwrap();
    assert_eq!(server.due(at(1.9)), []);
    assert_eq!(server.deadline(at(0.0)), at(2.0));
    assert_eq!(
        server.due(at(2.0)),
        [PageEffect::Close(id, GateRefusal::Late)]
    );
    assert_eq!(server.deadline(at(0.0)), Time::NEVER);
}

#[test]
fn a_page_that_says_nonsense_or_a_strange_token_is_refused() {
    let mut server = server();
    let id = server.open(at(0.0)).unwrap();
    for text in [
        "",
        "[]",
        "{\"token\":\"x\"}",
        "{}",
        "{\"credit\":2}",
        "{\"jump\":1}",
        STOP,
    ] {
        assert!(server.page_said(at(0.1), id, text).is_err(), "{text}");
    }
    assert_eq!(server.due(at(0.2)), [], "nothing was sent to it");
}

#[test]
fn an_order_that_is_said_over_the_feed_is_refused_also_from_who_may_order() {
    let mut server = server();
    let one = page(&mut server, 0.0, OPERATE);
    for text in [
        STOP,
        r#"{"order":"hold","page":1}"#,
        r#"{"credit":1,"order":"stop"}"#,
    ] {
        let said = server.page_said(at(0.1), one, text);
        assert!(matches!(said, Err(GateRefusal::Unreadable(_))), "{text}");
    }
    assert_eq!(told(&server.due(at(0.2))), 0);
    assert_eq!(server.board().orders().given.iter().count(), 0);
}

#[test]
fn pages_beyond_the_most_are_refused_until_one_leaves() {
    let mut server = server();
    for _ in 0..PAGES_MAX {
        page(&mut server, 0.0, LOOK);
    }
    assert_eq!(server.open(at(0.0)), Err(GateRefusal::Pages));
    server.closed(PageId(3));
    assert!(server.open(at(0.0)).is_ok());
}

#[test]
fn an_order_reaches_the_operator_and_what_became_of_it_all_pages() {
    let mut server = server();
    let one = page(&mut server, 0.0, LOOK);
    let number = order(
        &mut server,
        1.0,
        OPERATE,
        r#"{"order":"hold","vehicles":[2],"page":9}"#,
    )
    .unwrap();
    let effects = server.due(at(1.0));
    assert_eq!(told(&effects), 1);
    end(&mut server, 2.0, number);
    server.page_said(at(1.1), one, r#"{"credit":2}"#).unwrap();
    let last = texts(&server.due(at(1.2)), one, FrameKind::Orders)
        .pop()
        .unwrap();
    assert_eq!(last["orders"][0]["what"], "hold");
    assert_eq!(last["orders"][0]["isOver"], true);
}

#[test]
fn what_the_gate_refuses_is_told_to_nobody() {
    let mut server = server();
    for (token, body, refusal) in [
        (LOOK, r#"{"order":"stop","page":1}"#, GateRefusal::LookOnly),
        ("", r#"{"order":"stop","page":1}"#, GateRefusal::Token),
        (
            OPERATE,
            r#"{"order":"start","page":1}"#,
            GateRefusal::NoSeat,
        ),
    ] {
        assert_eq!(order(&mut server, 0.0, token, body), Err(refusal));
    }
    assert!(matches!(
        order(&mut server, 0.0, OPERATE, "stop"),
        Err(GateRefusal::Unreadable(_))
    ));
    assert_eq!(server.due(at(0.0)), []);
}

#[test]
fn a_stop_that_is_open_is_not_named_again_when_it_is_pressed_again_at_once() {
    let mut server = server();
    let first = order(&mut server, 0.0, OPERATE, STOP).unwrap();
    assert_eq!(order(&mut server, 0.1, OPERATE, STOP), Ok(first));
    server.hear(at(0.2), &stop_open());
    end(&mut server, 0.3, first);
    assert_eq!(order(&mut server, 2.0, OPERATE, STOP), Ok(first));
    assert_eq!(
        order(&mut server, 8.5, OPERATE, STOP),
        Ok(first + 1),
        "a while has gone"
    );
    assert_eq!(told(&server.due(at(8.5))), 2);
}

#[test]
fn a_stop_that_reaches_nobody_is_one_stop_however_often_it_is_pressed_until_it_is_given_up() {
    let mut server = server();
    let first = order(&mut server, 0.0, OPERATE, STOP).unwrap();
    for press in 1..15 {
        assert_eq!(
            order(&mut server, f64::from(press), OPERATE, STOP),
            Ok(first)
        );
    }
    assert_eq!(told(&server.due(at(14.0))), 1);
    end(&mut server, 14.5, first);
    let second = order(&mut server, 14.6, OPERATE, STOP);
    assert_eq!(second, Ok(first + 1), "it was given up");
    let third = order(&mut server, 29.7, OPERATE, STOP);
    assert_eq!(third, Ok(first + 2), "nothing is heard of its end");
}

#[test]
fn a_stop_after_a_start_is_another_one_so_that_it_counts_more() {
    let mut server = server();
    let one = page(&mut server, 0.0, OPERATE);
    let seat = json!({ "order": "seat", "page": one.0 }).to_string();
    order(&mut server, 0.0, OPERATE, &seat).unwrap();
    let first = order(&mut server, 0.1, OPERATE, STOP).unwrap();
    server.hear(at(0.2), &stop_open());
    for (index, word) in (0..).zip(["start", "return", "land"]) {
        let now_s = 0.3 + f64::from(index);
        let moves = json!({ "order": word, "page": one.0 }).to_string();
        let given = order(&mut server, now_s, OPERATE, &moves).unwrap();
        let stop = order(&mut server, now_s + 0.1, OPERATE, STOP);
        assert_eq!(stop, Ok(given + 1), "it withdraws the {word}");
        assert_eq!(order(&mut server, now_s + 0.2, OPERATE, STOP), stop);
    }
    let told = server.due(at(3.0)).into_iter().filter_map(|effect| {
        let PageEffect::Tell(input) = effect else {
            return None;
        };
        Some(matches!(input, In::Stop(..)))
    });
    let expected = [true, false, true, false, true, false, true];
    assert_eq!(told.collect::<Vec<bool>>(), expected);
    assert_eq!(first, 1);
}

#[test]
fn a_stop_that_was_lifted_elsewhere_is_given_anew_though_it_is_still_looked_after() {
    let mut server = server();
    let first = order(&mut server, 0.0, OPERATE, STOP).unwrap();
    server.hear(at(0.2), &stop_open());
    let lifted = OpenStops {
        open: Vec::new(),
        lifted: vec![EmergencyName(77_777)],
    };
    let sender = Sender::Vehicle(VehicleId(1));
    let lifted = HeardMessage::Message(sender, Message::Standing(lifted));
    server.hear(at(3.0), &lifted);
    assert_eq!(order(&mut server, 3.1, OPERATE, STOP), Ok(first + 1));
}

#[test]
fn a_page_that_is_not_connected_cannot_have_the_seat() {
    let mut server = server();
    let one = page(&mut server, 0.0, OPERATE);
    let silent = server.open(at(0.0)).unwrap();
    let ask = |server: &mut PageServer, id: PageId| {
        let seat = json!({ "order": "seat", "page": id.0, "take_over": true }).to_string();
        order(server, 0.5, OPERATE, &seat)
    };
    for id in [silent, PageId(9)] {
        assert_eq!(ask(&mut server, id), Err(GateRefusal::NotOpen));
    }
    assert!(ask(&mut server, one).is_ok());
    server.closed(one);
    assert_eq!(ask(&mut server, one), Err(GateRefusal::NotOpen));
    assert_eq!(server.board().orders().seat, Some(one));
    server.due(at(0.6));
    assert_eq!(server.board().orders().seat, None);
}

#[test]
fn nobody_gives_orders_in_the_name_of_a_page_whose_number_is_seen() {
    let mut server = server();
    let one = server.open(at(0.0)).unwrap();
    let hello = json!({ "token": OPERATE, "secret": "drawn" }).to_string();
    server.page_said(at(0.0), one, &hello).unwrap();
    let two = page(&mut server, 0.0, OPERATE);
    let mut ask = |word: &str, page: PageId, secret: &str| {
        let said = json!({ "order": word, "page": page.0, "secret": secret, "take_over": true });
        order(&mut server, 0.5, OPERATE, &said.to_string())
    };
    assert_eq!(ask("seat", one, ""), Err(GateRefusal::NotThatPage));
    assert_eq!(ask("seat", two, "drawn"), Err(GateRefusal::NotThatPage));
    assert!(ask("seat", one, "drawn").is_ok());
    for word in ["start", "return", "land"] {
        for secret in ["", "drawm", "drawn "] {
            assert_eq!(ask(word, one, secret), Err(GateRefusal::NotThatPage));
        }
        assert!(ask(word, one, "drawn").is_ok());
    }
    assert_eq!(ask("start", two, ""), Err(GateRefusal::NoSeat));
    // Whoever stops need not be anybody.
    assert!(ask("stop", one, "").is_ok());
    let given = &server.board().orders().given;
    assert!(given.iter().all(|order| order.request.secret.is_empty()));
}

#[test]
fn all_pages_see_who_has_the_seat_and_that_it_is_free_again() {
    let mut server = server();
    let (one, two) = (
        page(&mut server, 0.0, LOOK),
        page(&mut server, 0.0, OPERATE),
    );
    let seat = json!({ "order": "seat", "page": two.0 }).to_string();
    order(&mut server, 0.5, OPERATE, &seat).unwrap();
    let seen = |server: &mut PageServer, at_s: f64| {
        server.page_said(at(at_s), one, r#"{"credit":2}"#).unwrap();
        let effects = server.due(at(at_s));
        texts(&effects, one, FrameKind::Orders)
            .pop()
            .map(|orders| orders["seat"].clone())
    };
    assert_eq!(seen(&mut server, 0.6), Some(json!(2)));
    assert!(server.deadline(at(0.0)) <= at(15.5));
    assert_eq!(seen(&mut server, 15.6), Some(json!(null)));
}

#[test]
fn what_a_vehicle_says_of_itself_reaches_the_page_as_it_is() {
    let mut server = server();
    let evil = "<img src=x onerror=alert(1)>";
    let health = tomoswarm_proto::Health {
        vehicle: VehicleId(1),
        troubles: vec![evil.to_owned()],
        ..tomoswarm_proto::Health::default()
    };
    server.hear(at(0.0), &heard(Message::State(state(1))));
    server.hear(at(0.0), &heard(Message::Health(health)));
    let one = page(&mut server, 0.0, LOOK);
    let mut rows = Vec::new();
    for tick in 1..10 {
        rows.extend(texts(
            &server.due(at(f64::from(tick) / 10.0)),
            one,
            FrameKind::Vehicle,
        ));
        server
            .page_said(at(f64::from(tick) / 10.0), one, r#"{"credit":2}"#)
            .unwrap();
    }
    assert_eq!(rows[0]["health"]["troubles"], json!([evil]));
}

/// A mark of a page that has no seat.
const MARK: &str = r#"{"at":[3.2,7.5],"page":1,"run":2}"#;

fn mark(server: &mut PageServer, at_s: f64, token: &str, body: &str) -> Result<u32, GateRefusal> {
    let header = format!("Bearer {token}");
    server.mark(at(at_s), Some(&header), body.as_bytes())
}

/// The marks that a page is shown within a second, while it draws.
fn marks_seen(server: &mut PageServer, page: PageId, from_s: f64) -> Vec<Value> {
    let step = |step: u8| {
        let now = at(from_s + f64::from(step) / 10.0);
        server.page_said(now, page, r#"{"credit":2}"#).unwrap();
        texts(&server.due(now), page, FrameKind::Marks)
    };
    (0..10).flat_map(step).collect()
}

#[test]
fn a_mark_needs_no_seat_reaches_the_operator_and_all_pages_see_how_it_fares() {
    let mut server = server();
    let one = page(&mut server, 0.0, LOOK);
    assert_eq!(mark(&mut server, 1.0, OPERATE, MARK), Ok(1));
    let effects = server.due(at(1.0));
    let expected = MarkRequest {
        run: Some(RunId(2)),
        at: Position::from_metres(3.2, 7.5, 0.0),
        stands: true,
        within: Duration::from_secs(5),
    };
    assert!(effects.contains(&PageEffect::Tell(In::Mark(1, expected))));
    let stored = Mark {
        run: RunId(2),
        at: expected.at,
        stands: true,
    };
    let mut seen = marks_seen(&mut server, one, 1.1);
    server.hear(at(2.2), &heard(Message::Mark(stored)));
    server.operator_said(at(2.3), &Out::Marked(1, MarkOutcome::Stored(stored)));
    seen.extend(marks_seen(&mut server, one, 2.4));
    let (first, last) = (seen.first().unwrap(), seen.last().unwrap());
    assert_eq!(
        (&first["marks"], &first["given"][0]["isOver"]),
        (&json!([]), &json!(false))
    );
    let known = json!([{ "run": 2, "at": [3.2, 7.5], "state": "stored" }]);
    assert_eq!(last["marks"], known);
    let given = &last["given"][0];
    assert_eq!(
        (&given["isDone"], &given["words"]),
        (&json!(true), &json!("run 2: (3.2, 7.5) is marked"))
    );
    let lines: Vec<&str> = server
        .board()
        .events()
        .after(0)
        .map(|event| event.text.as_str())
        .collect();
    let expected = [
        "mark 1: mark (3.2, 7.5), by page 1",
        "run 2: marked (3.2, 7.5)",
        "mark 1: run 2: (3.2, 7.5) is marked",
    ];
    assert_eq!(lines, expected);
}

#[test]
fn marks_of_whoever_may_not_and_what_is_no_mark_are_refused_and_told_to_nobody() {
    let mut of_swarm = server();
    for (token, body, expected) in [
        ("", MARK, GateRefusal::Token),
        (&OPERATE[1..], MARK, GateRefusal::Token),
        (LOOK, MARK, GateRefusal::LookOnly),
    ] {
        assert_eq!(mark(&mut of_swarm, 1.0, token, body), Err(expected));
    }
    assert_eq!(
        of_swarm.mark(at(1.0), None, MARK.as_bytes()),
        Err(GateRefusal::Token)
    );
    let unreadable = mark(&mut of_swarm, 1.0, OPERATE, r#"{"at":[1e9,0],"page":1}"#);
    assert!(matches!(unreadable, Err(GateRefusal::Unreadable(why)) if why.contains("too far")));
    let mut of_recording = PageServer::new(
        place(),
        venue(),
        Board::new(7, Lattice::new(0.1)),
        Gate::looking_only(LOOK.to_owned()),
    );
    assert_eq!(
        mark(&mut of_recording, 1.0, LOOK, MARK),
        Err(GateRefusal::NotLive)
    );
    for server in [&mut of_swarm, &mut of_recording] {
        assert_eq!(told(&server.due(at(1.0))), 0);
        assert_eq!(server.board().marks().given.last(), 0);
    }
    for _ in 0..20 {
        assert!(mark(&mut of_swarm, 2.0, OPERATE, MARK).is_ok());
    }
    assert_eq!(
        mark(&mut of_swarm, 2.5, OPERATE, MARK),
        Err(GateRefusal::Flood)
    );
    assert!(
        order(&mut of_swarm, 2.5, OPERATE, STOP).is_ok(),
        "a flood of marks keeps no stop back"
    );
}

#[test]
fn a_stop_that_is_said_again_and_again_is_one_stop_and_never_too_many() {
    let mut server = server();
    let first = order(&mut server, 1.0, OPERATE, STOP);
    assert!(first.is_ok());
    for _ in 0..60 {
        assert_eq!(order(&mut server, 1.2, OPERATE, STOP), first);
    }
}

#[test]
fn a_mission_that_is_wrong_is_refused_and_told_to_nobody() {
    let mut server = server();
    let seat = json!({ "order": "seat", "page": 1 }).to_string();
    page(&mut server, 0.0, OPERATE);
    order(&mut server, 0.0, OPERATE, &seat).unwrap();
    let body = |laps: i64| {
        let mission = json!({ "kind": "sweep", "set": [format!("laps={laps}")] });
        json!({ "order": "start", "page": 1, "mission": mission }).to_string()
    };
    let refused = order(&mut server, 0.1, OPERATE, &body(-1)).unwrap_err();
    assert!(refused.to_string().contains("laps"), "{refused}");
    assert_eq!(told(&server.due(at(0.1))), 0);
    let refused = order(&mut server, 0.1, OPERATE, &body(2)).unwrap_err();
    assert!(refused.to_string().contains("none is heard"), "{refused}");
    server.hear(at(0.2), &heard(Message::Report(report())));
    assert!(order(&mut server, 0.2, OPERATE, &body(2)).is_ok());
    assert_eq!(told(&server.due(at(0.2))), 1);
    let line = server
        .board()
        .events()
        .after(0)
        .last()
        .unwrap()
        .text
        .clone();
    assert_eq!(line, "order 1: start sweep, by page 1");
}

#[test]
fn who_may_look_reads_the_checks_before_a_start_and_nobody_else_does() {
    let mut server = server();
    let ask = |server: &PageServer, token: &str| {
        server.preflight(at(1.5), Some(&format!("Bearer {token}")), None, "0.1.0")
    };
    assert_eq!(ask(&server, "x"), Err(GateRefusal::Token));
    server.hear(at(1.0), &heard(Message::State(state(1))));
    let read: Value = serde_json::from_str(&ask(&server, LOOK).unwrap()).unwrap();
    assert_eq!(read["isGo"], false, "no ground station was heard");
    let nodes = read["nodes"].as_array().unwrap();
    let names: Vec<&str> = nodes
        .iter()
        .filter_map(|node| node["node"].as_str())
        .collect();
    assert_eq!(names, ["vehicle 1", "ground", "swarm"]);
}

#[test]
fn the_checks_before_a_start_are_those_of_the_moment_that_a_page_looks_at() {
    let mut server = ten_vehicles();
    let (one, two) = (page(&mut server, 11.0, LOOK), page(&mut server, 11.0, LOOK));
    drawn(&mut server, one, 11.0);
    show(&mut server, one, 11.0, r#"{"past":{"at_s":4.5,"speed":0}}"#);
    drawn(&mut server, one, 11.0);
    let nodes = |page: Option<PageId>| {
        let header = format!("Bearer {LOOK}");
        let text = server.preflight(at(11.0), Some(&header), page, "0.1.0");
        let read: Value = serde_json::from_str(&text.unwrap()).unwrap();
        read["nodes"].as_array().unwrap().len()
    };
    assert_eq!(nodes(Some(one)), nodes(None) - 6, "four vehicles of ten");
    assert_eq!(nodes(Some(two)), nodes(None));
}

#[test]
fn what_is_no_live_swarm_takes_no_orders_and_is_dated_by_its_own_time() {
    let board = Board::new(7, Lattice::new(0.1));
    let gate = Gate::looking_only(LOOK.to_owned());
    let mut server = PageServer::new(place(), venue(), board, gate);
    server.show_moment(at(0.0));
    let id = page(&mut server, 0.1, LOOK);
    server.hear(at(500.0), &heard(Message::State(state(1))));
    server.show_moment(at(500.0));
    for now_s in [0.2, 5.0] {
        let effects = server.due(at(now_s));
        let frames: Vec<&Vec<u8>> = effects
            .iter()
            .map(|effect| match effect {
                PageEffect::Send(to, frame) if *to == id => frame,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(frames.len(), 2, "two are on their way at most");
        let time_s = |frame: &[u8]| f64::from_le_bytes(frame[8..16].try_into().unwrap());
        let shown_s = time_s(frames[1]);
        assert!((shown_s - 500.0).abs() < 1e-6, "{shown_s} s");
        server.page_said(at(now_s), id, r#"{"credit":2}"#).unwrap();
    }
    assert_eq!(
        order(&mut server, 5.0, LOOK, STOP),
        Err(GateRefusal::NotLive)
    );
    for token in ["", OPERATE] {
        let refused = order(&mut server, 5.0, token, STOP);
        assert_eq!(refused, Err(GateRefusal::Token));
    }
    assert_eq!(told(&server.due(at(5.0))), 0);
}

/// Gives credit, and returns all texts of a kind that a page is sent at a time.
fn drawn(server: &mut PageServer, id: PageId, at_s: f64) -> Vec<PageEffect> {
    let mut all = Vec::new();
    for _ in 0..40 {
        server.page_said(at(at_s), id, r#"{"credit":2}"#).unwrap();
        all.extend(server.due(at(at_s)));
    }
    all
}

fn show(server: &mut PageServer, id: PageId, at_s: f64, wanted: &str) {
    let text = format!(r#"{{"show":{wanted}}}"#);
    server.page_said(at(at_s), id, &text).unwrap();
}

/// The sequences of the orders' ages do not matter here: which vehicles' states came, and the moment.
fn shown(effects: &[PageEffect], id: PageId) -> (Option<Value>, Vec<u8>) {
    let states = effects.iter().filter_map(|effect| match effect {
        PageEffect::Send(to, frame) if *to == id && frame[0] == FrameKind::States as u8 => Some(
            frame[16..]
                .chunks(crate::dash::frame::STATE.bytes())
                .map(|state| state[0]),
        ),
        _ => None,
    });
    let mut vehicles: Vec<u8> = states.flatten().collect();
    vehicles.sort_unstable();
    vehicles.dedup();
    (texts(effects, id, FrameKind::Moment).pop(), vehicles)
}

/// A server that has heard one vehicle after another, a second apart.
fn ten_vehicles() -> PageServer {
    let mut server = server();
    for id in 1..=10 {
        server.hear(at(f64::from(id)), &heard(Message::State(state(id))));
    }
    server
}

#[test]
fn a_page_looks_back_while_others_see_the_present_and_comes_back() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    let two = page(&mut server, 11.0, LOOK);
    let (moment, vehicles) = shown(&drawn(&mut server, one, 11.0), one);
    assert_eq!(vehicles, (1..=10).collect::<Vec<u8>>());
    let moment = moment.unwrap();
    assert_eq!(moment["speed"], json!(null));
    assert_eq!(
        (&moment["from_s"], &moment["to_s"]),
        (&json!(1.0), &json!(11.0))
    );

    show(&mut server, one, 11.0, r#"{"past":{"at_s":4.5,"speed":0}}"#);
    let effects = drawn(&mut server, one, 11.0);
    let (moment, vehicles) = shown(&effects, one);
    assert_eq!(vehicles, [1, 2, 3, 4]);
    assert_eq!(moment.unwrap()["at_s"], json!(4.5));
    let all = texts(&effects, one, FrameKind::Moment);
    assert_eq!(all[0]["isAnew"], json!(true));
    assert_eq!(all[1]["isWhole"], json!(true));
    let first = effects.iter().find_map(|effect| match effect {
        PageEffect::Send(to, frame) if *to == one => Some(frame[0]),
        _ => None,
    });
    assert_eq!(first, Some(FrameKind::Moment as u8), "it forgets first");
    assert_eq!(shown(&drawn(&mut server, two, 11.0), two).1.len(), 10);

    // What is new does not reach a page that looks back, and time stands.
    server.hear(at(12.0), &heard(Message::State(state(11))));
    let effects = drawn(&mut server, two, 13.0);
    assert_eq!(shown(&effects, two).1, [11]);
    let (moment, vehicles) = shown(&effects, one);
    assert_eq!(
        (moment.unwrap()["at_s"].clone(), vehicles),
        (json!(4.5), vec![])
    );

    show(&mut server, one, 13.0, r#""present""#);
    let (moment, vehicles) = shown(&drawn(&mut server, one, 13.0), one);
    assert_eq!(
        (moment.unwrap()["speed"].clone(), vehicles.len()),
        (json!(null), 11)
    );
}

#[test]
fn what_plays_goes_on_and_comes_to_the_present_by_itself() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    drawn(&mut server, one, 11.0);
    show(&mut server, one, 11.0, r#"{"past":{"at_s":2.5,"speed":2}}"#);
    assert_eq!(shown(&drawn(&mut server, one, 11.0), one).1, [1, 2]);
    assert!(server.deadline(at(11.0)) <= at(11.1));
    assert_eq!(shown(&drawn(&mut server, one, 12.0), one).1, [3, 4]);
    let (moment, vehicles) = shown(&drawn(&mut server, one, 20.0), one);
    assert_eq!(
        (moment.unwrap()["speed"].clone(), vehicles.len()),
        (json!(null), 10)
    );
}

#[test]
fn a_page_that_draws_nothing_is_not_played_to() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    server.due(at(11.0));
    show(&mut server, one, 11.0, r#"{"past":{"at_s":2.5,"speed":2}}"#);
    assert_eq!(server.due(at(12.0)), []);
    assert_eq!(server.deadline(at(12.0)), Time::NEVER);
}

#[test]
fn a_page_that_asks_for_a_thousand_moments_is_shown_the_last_one() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    drawn(&mut server, one, 11.0);
    for ask in 0..1000 {
        let at_s = 1.0 + f64::from(ask) / 200.0;
        let wanted = format!(r#"{{"past":{{"at_s":{at_s},"speed":0}}}}"#);
        show(&mut server, one, 11.0, &wanted);
    }
    let effects = drawn(&mut server, one, 11.0);
    let moments = texts(&effects, one, FrameKind::Moment);
    let anew = moments
        .iter()
        .filter(|moment| moment["isAnew"] == json!(true));
    assert_eq!(anew.count(), 1);
    assert_eq!(shown(&effects, one).1, [1, 2, 3, 4, 5]);
}

#[test]
fn times_outside_and_nonsense_are_the_nearest_or_refused() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    drawn(&mut server, one, 11.0);
    for (wanted, at_s) in [
        (r#"{"past":{"at_s":-5,"speed":0}}"#, 1.0),
        (r#"{"past":{"at_s":1e300,"speed":0}}"#, 10.0),
    ] {
        show(&mut server, one, 11.0, wanted);
        let (moment, _) = shown(&drawn(&mut server, one, 11.0), one);
        assert_eq!(moment.unwrap()["at_s"], json!(at_s), "{wanted}");
    }
    for nonsense in [
        r#"{"show":"yesterday"}"#,
        r#"{"show":{"past":{"at_s":1}}}"#,
        r#"{"show":{"past":{"at_s":"a","speed":1}}}"#,
        r#"{"show":{"past":{"at_s":1e999,"speed":1}}}"#,
    ] {
        assert!(
            server.page_said(at(12.0), one, nonsense).is_err(),
            "{nonsense}"
        );
    }
}

#[test]
fn a_recording_is_seen_from_its_beginning_and_its_end_is_no_present() {
    let gate = Gate::looking_only(LOOK.to_owned());
    let mut server = PageServer::new(place(), venue(), Board::new(7, Lattice::new(0.1)), gate);
    for id in 1..=10 {
        server.hear(at(f64::from(id)), &heard(Message::State(state(id))));
        server.show_moment(at(f64::from(id)));
    }
    server.end_history();
    let one = page(&mut server, 500.0, LOOK);
    let effects = drawn(&mut server, one, 500.0);
    assert_eq!(texts(&effects, one, FrameKind::Welcome).len(), 1);
    let (moment, vehicles) = shown(&effects, one);
    let moment = moment.unwrap();
    assert_eq!(
        (&moment["at_s"], &moment["speed"]),
        (&json!(1.0), &json!(1.0))
    );
    assert_eq!((&moment["to_s"], vehicles), (&json!(10.0), vec![1]));
    show(&mut server, one, 501.0, r#""present""#);
    let (moment, vehicles) = shown(&drawn(&mut server, one, 501.0), one);
    let moment = moment.unwrap();
    assert_eq!(
        (&moment["at_s"], &moment["speed"]),
        (&json!(10.0), &json!(0.0))
    );
    assert_eq!(vehicles.len(), 10);
    assert_eq!(drawn(&mut server, one, 501.5), [], "nothing moves");
}

#[test]
fn marks_reach_every_page_once_also_those_that_look_back() {
    let mut server = ten_vehicles();
    let one = page(&mut server, 11.0, LOOK);
    drawn(&mut server, one, 11.0);
    show(&mut server, one, 11.0, r#"{"past":{"at_s":4.5,"speed":0}}"#);
    let health = tomoswarm_proto::Health {
        vehicle: VehicleId(1),
        boot: tomoswarm_proto::Boot(1),
        troubles: vec!["no echo".to_owned()],
        ..tomoswarm_proto::Health::default()
    };
    server.hear(at(12.0), &heard(Message::Health(health)));
    let marks = texts(&drawn(&mut server, one, 12.0), one, FrameKind::Markers);
    assert_eq!(marks.len(), 1);
    let mark = &marks[0]["markers"][0];
    assert_eq!(
        (&mark["at_s"], &mark["kind"]),
        (&json!(12.0), &json!("trouble"))
    );
    assert_eq!(
        texts(&drawn(&mut server, one, 13.0), one, FrameKind::Markers),
        Vec::<Value>::new()
    );
}

/// One step of a random life of a page.
#[derive(Clone, Debug)]
enum Step {
    Hear(u8),
    Wait(u64),
    Past(f64, f64),
    Present,
    Credit(u32),
    Due,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (1..12_u8).prop_map(Step::Hear),
        3 => (1..700_u64).prop_map(Step::Wait),
        2 => (-2.0..30.0_f64, 0.0..60.0_f64).prop_map(|(at_s, speed)| Step::Past(at_s, speed.floor())),
        1 => Just(Step::Present),
        2 => (1..4_u32).prop_map(Step::Credit),
        3 => Just(Step::Due),
    ]
}

/// What a page that reads all its frames has of vehicles, and which moment it shows last.
#[derive(Default)]
struct Reader {
    vehicles: BTreeSet<u8>,
    moment: Value,
}

impl Reader {
    fn read(&mut self, effects: &[PageEffect]) {
        for effect in effects {
            let PageEffect::Send(_, frame) = effect else {
                continue;
            };
            if frame[0] == FrameKind::Moment as u8 {
                self.moment = serde_json::from_slice(&frame[16..]).unwrap();
                if self.moment["isAnew"] == json!(true) {
                    self.vehicles.clear();
                }
            } else if frame[0] == FrameKind::States as u8 {
                let records = frame[16..].chunks(crate::dash::frame::STATE.bytes());
                self.vehicles.extend(records.map(|state| state[0]));
            }
        }
    }
}

proptest! {
    #[test]
    fn whatever_a_page_asks_for_it_ends_with_all_of_what_it_asked_for_last(
        steps in prop::collection::vec(step(), 1..80), is_recording in any::<bool>(),
    ) {
        let mut server = server();
        let (mut now, mut reader) = (at(1.0), Reader::default());
        let mut heard_at = Vec::new();
        server.hear(now, &heard(Message::State(state(1))));
        heard_at.push((1, now));
        if is_recording {
            server.show_moment(now);
            server.end_history();
        }
        let id = server.open(now).unwrap();
        let token = json!({ "token": LOOK }).to_string();
        server.page_said(now, id, &token).unwrap();
        let mut sequence = 0;
        for step in steps {
            match step {
                Step::Hear(_) if is_recording => {}
                Step::Hear(vehicle) => {
                    sequence += 1;
                    let mut state = state(vehicle);
                    state.sequence = sequence;
                    server.hear(now, &heard(Message::State(state)));
                    heard_at.push((vehicle, now));
                }
                Step::Wait(ms) => now = now + Duration::from_millis(ms),
                Step::Past(at_s, speed) => {
                    let text = json!({ "show": { "past": { "at_s": at_s, "speed": speed } } });
                    server.page_said(now, id, &text.to_string()).unwrap();
                }
                Step::Present => server.page_said(now, id, r#"{"show":"present"}"#).unwrap(),
                Step::Credit(frames) => {
                    server.page_said(now, id, &json!({ "credit": frames }).to_string()).unwrap();
                }
                Step::Due => reader.read(&server.due(now)),
            }
        }
        for _ in 0..60 {
            now = now + Duration::from_millis(200);
            server.page_said(now, id, r#"{"credit":2}"#).unwrap();
            reader.read(&server.due(now));
        }
        let moment = &reader.moment;
        prop_assert_eq!(&moment["isWhole"], &json!(true));
        let newest = heard_at.last().unwrap().1;
        let shown_s = match moment["speed"].as_f64() {
            None => now.as_secs_f64(),
            Some(_) => moment["at_s"].as_f64().unwrap(),
        };
        // While more may come, what has the time of the newest waits for it.
        let is_told = |told: Time| {
            let waits = !is_recording && !moment["speed"].is_null() && told == newest;
            told.as_secs_f64() <= shown_s + 1e-9 && !waits
        };
        let expected = heard_at.iter().filter(|(_, told)| is_told(*told)).map(|(vehicle, _)| *vehicle);
        prop_assert_eq!(&reader.vehicles, &expected.collect::<BTreeSet<u8>>(), "{}", moment);
    }
}

/// What is said of the cell at (0.05, 0.05) to a page: the vehicle, what it says, since how long.
fn told_of_cell(server: &PageServer, page: Option<PageId>) -> Vec<(u64, String, f64)> {
    let asked = CellQuestion {
        at: crate::geom::Point::new(0.05, 0.05),
        slice: Some(0),
        page,
    };
    let header = format!("Bearer {LOOK}");
    let text = server.cell(at(11.0), Some(&header), asked).unwrap();
    let read: Value = serde_json::from_str(&text).unwrap();
    let row = |row: &Value| {
        let word = row["says"].as_str().unwrap().to_owned();
        (
            row["vehicle"].as_u64().unwrap(),
            word,
            row["age_s"].as_f64().unwrap(),
        )
    };
    read["told"].as_array().unwrap().iter().map(row).collect()
}

/// A tile of a vehicle, alike all over.
fn tile(vehicle: u8, revision: u32, value: i8) -> HeardMessage {
    heard(Message::Tile(TileReport {
        layer: LayerId {
            vehicle: VehicleId(vehicle),
            boot: Boot(1),
        },
        address: TileAddress::default(),
        revision,
        cells: std::sync::Arc::new([value; 1024]),
    }))
}

#[test]
fn who_has_seen_a_cell_is_told_of_the_moment_that_a_page_looks_at() {
    let mut server = server();
    for (at_s, vehicle, value) in [(1, 1, 9), (5, 2, -17), (8, 1, -17)] {
        server.hear(at(f64::from(at_s)), &tile(vehicle, at_s, value));
    }
    let one = page(&mut server, 11.0, LOOK);
    let two = page(&mut server, 11.0, LOOK);
    drawn(&mut server, one, 11.0);
    show(&mut server, one, 11.0, r#"{"past":{"at_s":6,"speed":0}}"#);
    drawn(&mut server, one, 11.0);
    let free = |vehicle, age_s| (vehicle, "free".to_owned(), age_s);
    let then = [free(2, 1.0), (1, "occupied".to_owned(), 5.0)];
    assert_eq!(told_of_cell(&server, Some(one)), then);
    let now = [free(1, 3.0), free(2, 6.0)];
    for page in [Some(two), None, Some(PageId(77))] {
        assert_eq!(told_of_cell(&server, page), now);
    }
    let asked = CellQuestion {
        at: crate::geom::Point::new(0.0, 0.0),
        slice: None,
        page: None,
    };
    let refused = server.cell(at(11.0), Some("Bearer nonsense"), asked);
    assert_eq!(refused, Err(GateRefusal::Token));
}

/// How strongly vehicle 1 heard vehicle 2, as a page is told: how long ago, and the strength; and how often 2 heard 1.
fn told_of_pair(server: &PageServer, page: Option<PageId>) -> (Vec<(f64, i64)>, usize) {
    let (header, pair) = (format!("Bearer {LOOK}"), [1, 2].map(VehicleId));
    let text = server.pair(at(400.0), Some(&header), pair, page).unwrap();
    let read: Value = serde_json::from_str(&text).unwrap();
    let row = |row: &Value| {
        let age_s = row["age_s"].as_f64().unwrap();
        (age_s, row["rssi_dbm"].as_i64().unwrap())
    };
    let [there, back] = ["there", "back"].map(|way| read[way].as_array().unwrap());
    (there.iter().map(row).collect(), back.len())
}

#[test]
fn how_strongly_a_pair_was_heard_is_told_of_the_minutes_before_the_moment_that_a_page_looks_at() {
    let mut server = server();
    let mut say =
        |at_s: f64, receiver: u8, transmitter: u8, sequence: u64, rssi_dbm: Option<i16>| {
            let sample = Sample {
                sequence,
                heard_at_ns: (at_s * 1e9) as u64,
                transmitter: VehicleId(transmitter),
                transmitter_pose: PoseReport::default(),
                receiver_pose: PoseReport::default(),
                channel: 20,
                power_dbm: 0,
                rssi_dbm,
            };
            let batch = Samples {
                vehicle: VehicleId(receiver),
                boot: Boot(1),
                run: RunId(1),
                samples: vec![sample],
                lost: Vec::new(),
            };
            server.hear(at(at_s), &heard(Message::Samples(batch)));
        };
    say(50.0, 1, 2, 1, Some(-40));
    // Of a second the last one; what was missed, others have heard, or is said again is none.
    say(200.1, 1, 2, 2, Some(-50));
    say(200.9, 1, 2, 3, Some(-60));
    say(250.0, 1, 2, 4, None);
    say(251.0, 1, 3, 5, Some(-51));
    say(252.0, 2, 1, 1, Some(-52));
    say(253.0, 1, 2, 3, Some(-60));
    // It was heard first before all that is told of the last moment.
    say(300.0, 1, 2, 1, Some(-40));
    say(390.0, 1, 2, 6, Some(-70));
    let one = page(&mut server, 400.0, LOOK);
    let two = page(&mut server, 400.0, LOOK);
    drawn(&mut server, one, 400.0);
    show(
        &mut server,
        one,
        400.0,
        r#"{"past":{"at_s":260,"speed":0}}"#,
    );
    drawn(&mut server, one, 400.0);
    let then = vec![(210.0, -40), (59.1, -60)];
    assert_eq!(told_of_pair(&server, Some(one)), (then, 1));
    // What is more than five minutes ago is left out.
    let now = (vec![(199.1, -60), (10.0, -70)], 1);
    for page in [Some(two), None, Some(PageId(77))] {
        assert_eq!(told_of_pair(&server, page), now);
    }
    let refused = server.pair(
        at(400.0),
        Some("Bearer nonsense"),
        [1, 2].map(VehicleId),
        None,
    );
    assert_eq!(refused, Err(GateRefusal::Token));
}

/// A look of a vehicle with one reading.
fn look(vehicle: u8) -> HeardMessage {
    let reading = LookReading {
        at: Position::from_metres(1.0, 2.0, 0.0),
        toward: Heading::from_radians(0.5),
        range_mm: Some(1830),
        is_suspect: false,
        age_ms: 0,
    };
    let id = VehicleId(vehicle);
    let look = Look {
        vehicle: id,
        half_angle: Heading::from_radians(0.25),
        max_range_mm: 4000,
        readings: vec![reading],
    };
    HeardMessage::Message(Sender::Vehicle(id), Message::Look(look))
}

#[test]
fn looks_are_asked_for_while_a_page_rides_and_shown_to_that_page_alone() {
    let mut server = server();
    let (one, two) = (
        page(&mut server, 0.0, LOOK),
        page(&mut server, 0.0, OPERATE),
    );
    let asked = |effects: &[PageEffect]| -> Vec<bool> {
        let said = effects.iter().filter_map(|effect| match effect {
            PageEffect::Tell(In::Ask(Interest::Looks, are_wanted)) => Some(*are_wanted),
            _ => None,
        });
        said.collect()
    };
    let seen = |effects: &[PageEffect], page| texts(effects, page, FrameKind::Look);
    drawn(&mut server, one, 0.0);
    drawn(&mut server, two, 0.0);
    server.hear(at(0.5), &look(1));
    let both = |server: &mut PageServer, at_s| {
        [drawn(server, one, at_s), drawn(server, two, at_s)].concat()
    };
    let quiet = both(&mut server, 0.5);
    assert_eq!(
        (asked(&quiet), seen(&quiet, one), seen(&quiet, two)),
        (vec![], vec![], vec![])
    );

    server.page_said(at(1.0), one, r#"{"ride":2}"#).unwrap();
    server.page_said(at(1.0), two, r#"{"ride":1}"#).unwrap();
    server.hear(at(1.0), &look(1));
    server.hear(at(1.0), &look(2));
    let riding = both(&mut server, 1.0);
    assert_eq!(asked(&riding), [true], "asked once");
    let ids = |effects, page| -> Vec<Value> {
        seen(effects, page)
            .iter()
            .map(|text| text["id"].clone())
            .collect()
    };
    assert_eq!(ids(&riding, one), [json!(2)]);
    assert_eq!(ids(&riding, two), [json!(1)]);
    assert_eq!(seen(&riding, two)[0]["readings"][1][4], json!(1.83));

    server.page_said(at(2.0), one, r#"{"ride":0}"#).unwrap();
    assert_eq!(asked(&both(&mut server, 2.0)), [false; 0]);
    server.hear(at(2.1), &look(2));
    assert_eq!(seen(&both(&mut server, 2.1), one), Vec::<Value>::new());
    server.closed(two);
    assert_eq!(
        asked(&server.due(at(2.2))),
        [false],
        "nobody rides any more"
    );
    let mut words = 0;
    for hundredth in 600..900 {
        let now = at(f64::from(hundredth) / 100.0);
        let rides = format!(r#"{{"ride":{}}}"#, hundredth % 2);
        server.page_said(now, one, &rides).unwrap();
        words += asked(&server.due(now)).len();
    }
    assert!((1..=3).contains(&words), "{words} in three seconds");
    assert!(server.page_said(at(2.3), one, r#"{"ride":300}"#).is_err());
}

#[test]
fn settings_of_a_node_are_those_that_it_said_last() {
    let mut server = server();
    let vehicle = Sender::Vehicle(VehicleId(2));
    let bearer = format!("Bearer {LOOK}");
    let look = Some(bearer.as_str());
    let mine = server.settings(look, None).unwrap();
    assert!(mine.contains("kind = \"venue\""), "{mine}");
    let refused = server.settings(look, Some(vehicle)).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("vehicle 2 has not said its settings"),
        "{refused}"
    );
    let mut say = |instance, text: &str| {
        let said = NodeSettings {
            node: vehicle,
            instance,
            part: 0,
            parts: 1,
            text: text.to_owned(),
        };
        server.hear(
            at(1.0),
            &HeardMessage::Message(vehicle, Message::Settings(said)),
        );
        server.settings(look, Some(vehicle)).unwrap()
    };
    assert_eq!(say(1, "id = 2\n"), "id = 2\n");
    assert_eq!(
        say(2, "id = 2\nrecord = \"all\"\n"),
        "id = 2\nrecord = \"all\"\n"
    );
    assert!(
        server
            .settings(Some("Bearer other"), Some(vehicle))
            .is_err()
    );
    assert!(server.settings(look, Some(Sender::Ground)).is_err());
}

/// Samples of a run in which vehicle 2 hears vehicle 1 across the area, along x at each of some y, ten times; the fifth is dark.
fn across(run: u32, rows: std::ops::Range<u64>) -> HeardMessage {
    let pose = |x_m, y_m| PoseReport {
        at: Position::from_metres(x_m, y_m, 0.0),
        ..PoseReport::default()
    };
    let sample = |sequence| {
        let y_m = 0.5 + (sequence / 10) as f64;
        Sample {
            sequence,
            heard_at_ns: sequence,
            transmitter: VehicleId(1),
            transmitter_pose: pose(0.0, y_m),
            receiver_pose: pose(20.0, y_m),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: Some(if sequence / 10 == 4 { -70 } else { -60 }),
        }
    };
    heard(Message::Samples(Samples {
        vehicle: VehicleId(2),
        boot: Boot(1),
        run: RunId(run),
        samples: (rows.start * 10..rows.end * 10).map(sample).collect(),
        lost: Vec::new(),
    }))
}

/// An image of what stands there.
fn structure(run: u32, sequence: u32, links_used: u32) -> HeardMessage {
    heard(Message::Image(Image {
        run: RunId(run),
        sequence,
        laps: 1,
        subject: ImageSubject::Structure,
        area: Rectangle {
            least: Position::default(),
            greatest: Position::from_metres(20.0, 20.0, 0.0),
        },
        columns: 10,
        rows: 10,
        part: 0,
        parts: 1,
        mean: vec![1; 100],
        mean_step_udb_per_m: 1,
        deviation: None,
        deviation_step_udb_per_m: 1,
        links_used,
        links_dropped: 0,
        finds: Vec::new(),
    }))
}

/// What is answered to a question about the pixel at (5, 5) m: of how many links it is, and of how many the image.
fn why(server: &PageServer, now_s: f64, page: Option<PageId>) -> Result<[u64; 2], String> {
    let question = json!({ "subject": 0, "at": [5.0, 5.0], "page": page });
    let token = format!("Bearer {LOOK}");
    let task = server.why(at(now_s), Some(&token), question.to_string().as_bytes());
    let answer = task.map_err(|error| error.to_string())?.answer(None)?;
    let said: Value = serde_json::from_str(&answer).unwrap();
    Ok(["links", "madeOf"].map(|key| said[key].as_u64().unwrap()))
}

#[test]
fn who_looks_back_is_told_of_the_links_that_an_earlier_image_was_made_of() {
    let mut server = server();
    server.hear(at(1.0), &across(1, 0..12));
    server.hear(at(2.0), &structure(1, 1, 12));
    // Some samples come a second time.
    server.hear(at(3.0), &across(1, 10..18));
    server.hear(at(4.0), &structure(1, 2, 18));
    server.hear(at(5.0), &across(1, 18..20));
    let one = page(&mut server, 6.0, LOOK);
    // Links along a side are dropped.
    assert_eq!(why(&server, 6.0, None), Ok([18, 18]), "all that was heard");
    assert_eq!(why(&server, 6.0, Some(one)), Ok([18, 18]));

    show(&mut server, one, 6.0, r#"{"past":{"at_s":2.5,"speed":0}}"#);
    drawn(&mut server, one, 6.0);
    assert_eq!(why(&server, 6.0, Some(one)), Ok([11, 12]), "it looks back");
    assert_eq!(why(&server, 6.0, None), Ok([18, 18]), "others do not");
    show(&mut server, one, 6.0, r#"{"past":{"at_s":4.5,"speed":0}}"#);
    drawn(&mut server, one, 6.0);
    assert_eq!(why(&server, 6.0, Some(one)), Ok([18, 18]), "the newest");
    show(&mut server, one, 6.0, r#"{"past":{"at_s":1.5,"speed":0}}"#);
    drawn(&mut server, one, 6.0);
    let refused = why(&server, 6.0, Some(one)).unwrap_err();
    assert!(refused.contains("there is no such image yet"), "{refused}");
}
