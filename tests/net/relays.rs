//! What the relay promises.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use crate::member::within;
use crate::relay::Relay;

/// Takes one connection and sends back what comes.
fn echo() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            std::thread::spawn(move || {
                std::io::copy(&mut stream.try_clone().unwrap(), &mut stream)
            });
        }
    });
    address
}

#[test]
fn a_relay_keeps_to_its_rate_and_delay() {
    let relay = Relay::start(echo());
    relay.shape(100_000.0, Duration::from_millis(30));
    let mut stream = TcpStream::connect(relay.address()).unwrap();
    let (began, mut answer) = (Instant::now(), vec![0; 50_000]);
    let mut out = stream.try_clone().unwrap();
    let sent = std::thread::spawn(move || out.write_all(&[7; 50_000]));
    stream.read_exact(&mut answer[..1]).unwrap();
    let first = began.elapsed();
    stream.read_exact(&mut answer[1..]).unwrap();
    let whole = began.elapsed();
    sent.join().unwrap().unwrap();
    assert!(answer.iter().all(|byte| *byte == 7));
    assert!(
        (60..300).contains(&first.as_millis()),
        "there and back after {first:?}"
    );
    assert!(
        (500..1500).contains(&whole.as_millis()),
        "50 kB at 100 kB/s took {whole:?}"
    );
}

#[test]
fn a_relay_freezes_without_a_word_and_cuts_for_good() {
    let relay = Relay::start(echo());
    let mut stream = TcpStream::connect(relay.address()).unwrap();
    let mut byte = [0];
    stream.write_all(b"a").unwrap();
    stream.read_exact(&mut byte).unwrap();
    relay.freeze();
    stream
        .set_read_timeout(Some(Duration::from_millis(200)))
        .unwrap();
    stream.write_all(b"b").unwrap();
    assert!(matches!(
        stream.read(&mut byte).unwrap_err().kind(),
        ErrorKind::WouldBlock
    ));
    relay.restore();
    stream
        .set_read_timeout(Some(Duration::from_secs(5)))
        .unwrap();
    stream.read_exact(&mut byte).unwrap();
    assert_eq!(byte, *b"b");
    relay.cut();
    assert!(matches!(stream.read(&mut byte), Ok(0) | Err(_)));
    let mut next = TcpStream::connect(relay.address()).unwrap();
    next.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    assert!(matches!(next.read(&mut byte), Ok(0) | Err(_)));
    relay.restore();
    let mut last = TcpStream::connect(relay.address()).unwrap();
    last.write_all(b"c").unwrap();
    last.read_exact(&mut byte).unwrap();
    assert_eq!(byte, *b"c");
    // What was sent is counted a moment after it has arrived.
    assert!(
        within(Duration::from_secs(5), || relay.carried() == 6),
        "{}",
        relay.carried()
    );
}
