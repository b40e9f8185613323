//! `/foxglove` of the page's server, as a client of its protocol sees it and as strangers try it.

use std::io::Write;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::dash::Dash;
use crate::sim_page::SimulationWithPage;
use crate::websocket::{Incoming, WebSocket, binary_message, upgrade};

const PROTOCOL: &str = "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n";
/// The numbers of channels.
const MAP: u32 = 1;
const CHANGE: u32 = 3;
const LOG: u32 = 4;
const POSE_OF_VEHICLE_1: u32 = 1001;

/// A simulation whose run is over, with its page.
fn shown(folder: &std::path::Path) -> SimulationWithPage {
    let mut simulation = SimulationWithPage::start(folder, &[]);
    simulation.until_written();
    simulation
}

/// Asks for a viewer's connection with the token of a link, of any Host that is the server's own, and any Origin.
fn ask(dash: &Dash, token: &str, protocol: &str) -> (WebSocket, String) {
    let headers = format!(
        "Host: 127.0.0.1:{}\r\nOrigin: https://app.foxglove.dev\r\n{protocol}",
        dash.port
    );
    let (stream, head) = upgrade(dash.port, &format!("/foxglove?look={token}"), &headers);
    (WebSocket(stream), head)
}

fn open(dash: &Dash) -> WebSocket {
    let (viewer, head) = ask(dash, Dash::token(&dash.look), PROTOCOL);
    assert!(head.contains(" 101 "), "{head}");
    viewer
}

fn json_of(incoming: Incoming) -> Value {
    match incoming {
        Incoming::Text(text) => serde_json::from_str(&text).unwrap(),
        other => panic!("text is expected: {other:?}"),
    }
}

fn subscribe(channels: &[(u32, u32)]) -> String {
    let one = |(id, channel): &(u32, u32)| json!({"id": id, "channelId": channel});
    let all: Vec<Value> = channels.iter().map(one).collect();
    json!({"op": "subscribe", "subscriptions": all}).to_string()
}

/// A binary message of the protocol: its operation, the subscription, the time in nanoseconds, and what it holds.
fn data(incoming: Incoming) -> (u32, u64, Value) {
    let Incoming::Binary(bytes) = incoming else {
        panic!("data is expected: {incoming:?}")
    };
    assert_eq!(bytes[0], 1, "the operation of data");
    let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
    let time_ns = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
    let content = serde_json::from_slice(&bytes[13..]).unwrap();
    (subscription, time_ns, content)
}

#[test]
fn a_viewer_is_told_the_channels_and_sent_what_it_subscribes_to() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = shown(folder.path());
    let (mut viewer, head) = ask(
        &simulation.dash,
        Dash::token(&simulation.dash.look),
        "Sec-WebSocket-Protocol: foxglove.sdk.v1, foxglove.websocket.v1\r\n",
    );
    assert!(
        head.to_lowercase()
            .contains("sec-websocket-protocol: foxglove."),
        "{head}"
    );
    let info = json_of(viewer.next());
    assert_eq!(info["op"], "serverInfo");
    assert!(info["name"].as_str().unwrap().contains("small"), "{info}");
    let advertised = json_of(viewer.next());
    assert_eq!(advertised["op"], "advertise");
    let channels = advertised["channels"].as_array().unwrap();
    let topic = |id: u32| {
        let channel = channels.iter().find(|channel| channel["id"] == id);
        let channel = channel.unwrap_or_else(|| panic!("{id}: {advertised}"));
        assert_eq!(channel["encoding"], "json");
        let schema: Value = serde_json::from_str(channel["schema"].as_str().unwrap()).unwrap();
        assert!(schema["properties"].is_object(), "{schema}");
        channel["topic"].as_str().unwrap().to_owned()
    };
    assert_eq!(topic(MAP), "/map");
    assert_eq!(topic(CHANGE), "/image");
    assert_eq!(topic(LOG), "/log");
    assert_eq!(topic(POSE_OF_VEHICLE_1), "/vehicle/1/pose");

    for (id, channel, key) in [
        (70, POSE_OF_VEHICLE_1, "pose"),
        (71, MAP, "data"),
        (72, CHANGE, "data"),
        (73, LOG, "message"),
    ] {
        viewer.say(&subscribe(&[(id, channel)]));
        let (subscription, time_ns, content) = data(viewer.next());
        assert_eq!(subscription, id);
        assert!(time_ns > 100_000_000_000, "the time of the run: {time_ns}");
        assert!(!content[key].is_null(), "{channel}: {content:.300}");
        viewer.say(&json!({"op": "unsubscribe", "subscriptionIds": [id]}).to_string());
        // Lines of the log that were on their way.
        viewer.say(&subscribe(&[(id + 100, POSE_OF_VEHICLE_1)]));
        while data(viewer.next()).0 == id {}
        viewer.say(&json!({"op": "unsubscribe", "subscriptionIds": [id + 100]}).to_string());
    }
}

#[test]
fn strange_viewers_are_refused_and_those_that_say_nonsense_are_closed() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = shown(folder.path());
    let dash = &simulation.dash;
    let token = Dash::token(&dash.look).to_owned();
    for strange in ["", "00000000000000000000000000000000", &token[1..]] {
        let (_, head) = ask(dash, strange, PROTOCOL);
        assert!(head.contains(" 401 "), "{strange:?}: {head}");
    }
    for protocol in ["", "Sec-WebSocket-Protocol: mqtt, foxglove\r\n"] {
        let (_, head) = ask(dash, &token, protocol);
        assert!(head.contains(" 400 "), "{protocol:?}: {head}");
    }
    let evil = format!("Host: evil.example:{}\r\n{PROTOCOL}", dash.port);
    let (_, head) = upgrade(dash.port, &format!("/foxglove?look={token}"), &evil);
    assert!(head.contains(" 421 "), "{head}");

    let nonsense = |bytes: &[u8]| {
        let mut viewer = open(dash);
        viewer.0.write_all(bytes).unwrap();
        loop {
            match viewer.next() {
                Incoming::Text(_) => {}
                Incoming::Binary(_) => panic!("nothing was subscribed to"),
                Incoming::Close(..) | Incoming::End => return,
            }
        }
    };
    let text = crate::websocket::text_message;
    let began = Instant::now();
    nonsense(&text("garbage"));
    nonsense(&text(r#"{"op":"subscribe"}"#));
    nonsense(&text(
        r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#,
    ));
    nonsense(&text(&"x".repeat(20_000)));
    nonsense(&binary_message(&[1, 2, 3]));
    nonsense(&[0xff; 40]);
    assert!(
        began.elapsed() < Duration::from_secs(5),
        "{:?}",
        began.elapsed()
    );

    // What is not known to the server, but to others, is passed over; so is a channel that there is not.
    let mut viewer = open(dash);
    viewer.say(r#"{"op":"fetchAsset","uri":"package://x","requestId":1}"#);
    viewer.say(&subscribe(&[(5, 4_000_000_000), (6, POSE_OF_VEHICLE_1)]));
    assert_eq!(json_of(viewer.next())["op"], "serverInfo");
    assert_eq!(json_of(viewer.next())["op"], "advertise");
    viewer.say(&subscribe(&[(5, 4_000_000_000), (6, POSE_OF_VEHICLE_1)]));
    assert_eq!(data(viewer.next()).0, 6);
}

#[test]
fn viewers_that_never_read_and_always_ask_keep_nobody_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = shown(folder.path());
    let dash = &simulation.dash;
    let mut greedy: Vec<WebSocket> = (0..3).map(|_| open(dash)).collect();
    let all: Vec<(u32, u32)> = (0..300)
        .map(|id| (id, [MAP, CHANGE, LOG][id as usize % 3]))
        .collect();
    for round in 0..60 {
        for viewer in &mut greedy {
            // One that was closed for it is no worse.
            let _ = viewer
                .0
                .write_all(&crate::websocket::text_message(&subscribe(&all)));
        }
        std::thread::sleep(Duration::from_millis(if round < 30 { 110 } else { 1 }));
    }
    let began = Instant::now();
    let mut another = open(dash);
    assert_eq!(json_of(another.next())["op"], "serverInfo");
    let (status, answer) = dash.metrics(Dash::token(&dash.look));
    assert_eq!(status, 200, "{answer}");
    assert!(
        began.elapsed() < Duration::from_secs(2),
        "{:?}",
        began.elapsed()
    );
    // A fifth one is refused with a reason.
    let mut fifth = open(dash);
    let end = fifth.next();
    assert!(
        matches!(&end, Incoming::Close(1008, reason) if reason.contains("viewers are open")),
        "{end:?}"
    );
}
