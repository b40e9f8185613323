//! The client's side of a WebSocket (RFC 6455), by hand: as much of it as a page or a viewer says, and whatever strangers say.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// What comes from a server.
#[derive(Clone, PartialEq, Debug)]
pub enum Incoming {
    Text(String),
    Binary(Vec<u8>),
    /// It closes the connection, and why.
    Close(u16, String),
    /// Nothing more comes: the connection is gone, or silent for long.
    End,
}

/// An open connection.
pub struct WebSocket(pub TcpStream);

/// Asks a server of this machine to upgrade a connection; returns it with the head of the answer.
pub fn upgrade(port: u16, path: &str, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(6)))
        .unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\n{headers}Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|read| read > 0) {
        head.push(byte[0]);
    }
    (stream, String::from_utf8_lossy(&head).into_owned())
}

/// A message of a client: whole, masked by nothing but zeros (RFC 6455, 5.2).
fn message(operation: u8, content: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x80 | operation];
    match u16::try_from(content.len()).unwrap() {
        short @ 0..126 => bytes.push(0x80 | short as u8),
        long => {
            bytes.push(0x80 | 126);
            bytes.extend(long.to_be_bytes());
        }
    }
    bytes.extend([0; 4]);
    bytes.extend(content);
    bytes
}

/// A text of a client.
pub fn text_message(text: &str) -> Vec<u8> {
    message(1, text.as_bytes())
}

/// A binary message of a client.
pub fn binary_message(content: &[u8]) -> Vec<u8> {
    message(2, content)
}

impl WebSocket {
    pub fn say(&mut self, text: &str) {
        self.0.write_all(&text_message(text)).unwrap();
    }

    /// Returns what comes next. A server's messages come whole.
    pub fn next(&mut self) -> Incoming {
        self.read().unwrap_or(Incoming::End)
    }

    fn read(&mut self) -> Option<Incoming> {
        loop {
            let [operation, length] = self.bytes()?;
            let length = match length {
                126 => usize::from(u16::from_be_bytes(self.bytes()?)),
                127 => usize::try_from(u64::from_be_bytes(self.bytes()?)).unwrap(),
                short => usize::from(short),
            };
            let mut content = vec![0; length];
            self.0.read_exact(&mut content).ok()?;
            match operation & 0x0f {
                1 => return Some(Incoming::Text(String::from_utf8(content).unwrap())),
                2 => return Some(Incoming::Binary(content)),
                8 => {
                    let code = content
                        .first_chunk()
                        .map_or(0, |code| u16::from_be_bytes(*code));
                    let reason = content.get(2..).unwrap_or_default();
                    let reason = String::from_utf8_lossy(reason).into_owned();
                    return Some(Incoming::Close(code, reason));
                }
                9 => self.0.write_all(&message(10, &content)).ok()?,
                // Pong.
                _ => {}
            }
        }
    }

    fn bytes<const COUNT: usize>(&mut self) -> Option<[u8; COUNT]> {
        let mut bytes = [0; COUNT];
        self.0.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }
}
