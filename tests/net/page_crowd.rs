//! Whoever takes all connections of the page, without a token, keeps nobody's Stop out and closes nobody's page.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::json;

use crate::dash::{Dash, prepared};
use crate::websocket::{Incoming, WebSocket, upgrade};

const STOP: &str = r#"{"order":"stop","page":1}"#;

/// Opens a connection, and says something by which it stays open.
fn stranger(port: u16, said: &str) -> TcpStream {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    // One that had to give way already is as good.
    let _ = stream.write_all(said.as_bytes());
    stream
}

/// Returns after how long a connection has ended, and what came until then.
fn end_of(mut stream: TcpStream) -> (Duration, String) {
    let began = Instant::now();
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    (
        began.elapsed(),
        String::from_utf8_lossy(&answer).into_owned(),
    )
}

#[test]
fn a_crowd_without_tokens_keeps_no_stop_out_and_closes_no_page() {
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    let own = format!("127.0.0.1:{}", dash.port);
    let origin = format!("http://{own}");
    let token = Dash::token(&dash.operate);
    let headers = format!("Host: {own}\r\nOrigin: {origin}\r\n");
    let mut page = WebSocket(upgrade(dash.port, "/feed", &headers).0);
    page.say(&json!({"token": Dash::token(&dash.look)}).to_string());
    assert!(matches!(page.next(), Incoming::Binary(_)));

    let half_head = "GET / HTTP/1.1\r\nHost: ".to_owned();
    let answered = format!("GET /stop.js HTTP/1.1\r\nHost: {own}\r\n\r\n");
    let half_body = format!(
        "POST /order HTTP/1.1\r\n{headers}Content-Length: {}\r\n\r\n{{",
        STOP.len()
    );
    for said in ["", &half_head, &answered, &half_body] {
        let crowd: Vec<TcpStream> = (0..80).map(|_| stranger(dash.port, said)).collect();
        let (status, answer) = dash.post(&own, &origin, token, STOP);
        assert_eq!(status, 200, "{said:?}: {answer}");
        drop(crowd);
    }
    page.say(&json!({"credit": 4}).to_string());
    assert!(matches!(page.next(), Incoming::Binary(_)), "it goes on");
}

#[test]
fn a_head_and_a_body_that_do_not_come_are_waited_for_five_seconds() {
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    let own = format!("127.0.0.1:{}", dash.port);
    let slow = format!(
        "POST /order HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\nAuthorization: Bearer {}\r\n\
         Content-Length: 20\r\n\r\n{{",
        Dash::token(&dash.operate)
    );
    let waiting = ["", "GET / HTTP/1.1\r\nHost: ", &slow]
        .map(|said| stranger(dash.port, said))
        .map(|stream| std::thread::spawn(move || end_of(stream)));
    let ends = waiting.map(|thread| thread.join().unwrap());
    for (after, answer) in &ends {
        assert!(
            (4500..8000).contains(&after.as_millis()),
            "{after:?}: {answer}"
        );
    }
    assert!(ends[2].1.contains(" 408 "), "{}", ends[2].1);
}
