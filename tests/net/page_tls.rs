//! The page for other machines (`dash --listen`): TLS with the operator's certificate, for whoever trusts the swarm's
//! authority, under the names in it and no other; everything that is refused before anything begins; and that a page of another
//! swarm reaches nobody.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

use crate::dash::Dash;
use crate::member::{Member, settings, within};
use crate::swarm::{PROGRAM, free_address};

/// A name of the operator's machine as others know it. Nothing resolves it here: it stands in certificates and requests.
const HOST: &str = "operator.test";
/// What is said of a certificate of another swarm.
const FOREIGN: &str =
    "certificate.pem: the certificate is not signed by the authority of this swarm";
const VENUE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/small.venue.toml");

/// Enrols a node in a swarm.
fn enroll(swarm: &Path, node: &[&str]) {
    let mut program = Command::new(PROGRAM);
    program.arg("enroll").arg(swarm);
    let run = program
        .args(["--venue", VENUE])
        .args(node)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
}

/// Enrols an operator in a swarm of its own; returns the operator's folder.
fn enrolled(swarm: &Path, hosts: &[&str]) -> PathBuf {
    let hosts = hosts.iter().flat_map(|host| ["--host", *host]);
    let node: Vec<&str> = ["operator"].into_iter().chain(hosts).collect();
    enroll(swarm, &node);
    swarm.join("operator-1")
}

/// `dash` for this machine alone, in a folder.
fn on_this_machine(folder: &Path) -> Command {
    let mut program = Command::new(PROGRAM);
    program.current_dir(folder);
    program.args(["dash", "operator.toml", "--port", "0"]);
    program
}

/// `dash --listen` in a folder.
fn listening(folder: &Path, address: &str) -> Command {
    let mut program = on_this_machine(folder);
    program.args(["--listen", address]);
    program
}

/// A page's server.
struct Served {
    child: Child,
    dash: Dash,
    log: PathBuf,
}

impl Served {
    /// One with TLS.
    fn start(folder: &Path) -> Served {
        Served::by(listening(folder, "0.0.0.0"), folder)
    }

    fn by(mut command: Command, folder: &Path) -> Served {
        let log = folder.join("dash.log");
        let out = std::fs::File::create(&log).unwrap();
        let command = command.stdout(out.try_clone().unwrap()).stderr(out);
        let child = command.spawn().unwrap();
        let dash = Dash::of_log(&log);
        Served { child, dash, log }
    }

    fn host(&self) -> String {
        format!("{HOST}:{}", self.dash.port)
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.dash.port)).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(7)))
            .unwrap();
        stream
    }

    /// Sends a request by TLS, as a client that trusts these authorities and expects this name; returns the answer.
    fn ask(&self, trusted: RootCertStore, name: &str, request: &str) -> io::Result<String> {
        let provider = Arc::new(ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_root_certificates(trusted)
            .with_no_client_auth();
        let name = ServerName::try_from(name.to_owned()).unwrap();
        let connection = ClientConnection::new(Arc::new(config), name).unwrap();
        let mut stream = StreamOwned::new(connection, self.connect());
        stream.write_all(request.as_bytes())?;
        let mut answer = Vec::new();
        let mut buffer = [0; 4096];
        // A connection that goes on does not end by itself.
        while !is_whole(&String::from_utf8_lossy(&answer)) {
            match stream.read(&mut buffer)? {
                0 => break,
                read => answer.extend(&buffer[..read]),
            }
        }
        Ok(String::from_utf8_lossy(&answer).into_owned())
    }

    fn get(&self, path: &str, headers: &str) -> String {
        format!(
            "GET {path} HTTP/1.1\r\nHost: {}\r\n{headers}\r\n",
            self.host()
        )
    }
}

/// Whether an answer has its head and as much as that says.
fn is_whole(answer: &str) -> bool {
    let Some((head, body)) = answer.split_once("\r\n\r\n") else {
        return false;
    };
    let lines = head.lines().filter_map(|line| line.split_once(": "));
    let mut lengths = lines.filter(|(name, _)| name.eq_ignore_ascii_case("content-length"));
    let length = lengths
        .next()
        .map_or(0, |(_, length)| length.parse().unwrap());
    body.len() >= length
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the authority of a swarm, as a browser is given it.
fn authority(swarm: &Path) -> RootCertStore {
    let mut store = RootCertStore::empty();
    let certificate = CertificateDer::from_pem_file(swarm.join("ca.pem")).unwrap();
    store.add(certificate).unwrap();
    store
}

#[test]
fn a_page_for_other_machines_comes_by_tls_to_whoever_trusts_the_swarm_and_to_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let (swarm, other) = (folder.path().join("swarm"), folder.path().join("other"));
    let served = Served::start(&enrolled(&swarm, &[HOST]));
    enrolled(&other, &[HOST]);
    let link = format!("https://{}/#look=", served.host());
    assert!(served.dash.look.starts_with(&link), "{}", served.dash.look);

    // Some that say nothing keep nobody waiting.
    let silent: Vec<TcpStream> = (0..8).map(|_| served.connect()).collect();
    let page = served.get("/", "Connection: close\r\n");
    let began = Instant::now();
    let answer = served.ask(authority(&swarm), HOST, &page).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer:.200}");
    assert!(answer.to_lowercase().contains("content-security-policy: "));
    assert!(
        began.elapsed() < Duration::from_secs(2),
        "{:?}",
        began.elapsed()
    );
    drop(silent);

    let origin = format!("Origin: https://{}\r\n", served.host());
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
        Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";
    let token = Dash::token(&served.dash.operate);
    let body = r#"{"order":"stop","page":1}"#;
    let order = |origin: &str| {
        let headers = format!(
            "Authorization: Bearer {token}\r\n{origin}Content-Length: {}\r\nConnection: close\r\n",
            body.len()
        );
        let request = served.get("/order", &headers).replacen("GET", "POST", 1);
        request + body
    };
    let plain_origin = origin.replace("https:", "http:");
    let evil = page.replace(
        &served.host(),
        &format!("evil.example:{}", served.dash.port),
    );
    let by_address = page.replace(&served.host(), &format!("192.0.2.7:{}", served.dash.port));
    for (what, request, status) in [
        (
            "the feed",
            served.get("/feed", &format!("{origin}{upgrade}")),
            101,
        ),
        (
            "a feed of a page without TLS",
            served.get("/feed", &format!("{plain_origin}{upgrade}")),
            403,
        ),
        ("a stop", order(&origin), 200),
        ("a stop of a page without TLS", order(&plain_origin), 403),
        ("another name", evil, 421),
        (
            "an address that the certificate does not name",
            by_address,
            421,
        ),
    ] {
        let answer = served.ask(authority(&swarm), HOST, &request).unwrap();
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}")),
            "{what}: {answer:.300}"
        );
    }

    for (what, trusted, name) in [
        ("another swarm's authority", authority(&other), HOST),
        ("no authority", RootCertStore::empty(), HOST),
        ("a name that is not in it", authority(&swarm), "other.test"),
    ] {
        let error = served.ask(trusted, name, &page).unwrap_err().to_string();
        assert!(error.contains("certificate"), "{what}: {error}");
    }
    for request in [&page, "\r\n\r\n", "\u{16}\u{3}\u{1}garbage"] {
        let mut stream = served.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer);
        assert!(!answer.contains("HTTP"), "without TLS: {answer}");
    }
    // And after all that it is served.
    let answer = served.ask(authority(&swarm), HOST, &page).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer:.200}");
}

#[test]
fn an_address_or_a_certificate_that_does_not_fit_is_refused_before_anything_begins() {
    let folder = tempfile::tempdir().unwrap();
    let [swarm, other, own] = ["swarm", "other", "own"].map(|name| folder.path().join(name));
    let (operator, strange) = (enrolled(&swarm, &[HOST]), enrolled(&other, &[HOST]));
    let refused = |folder: &Path, address: &str, reason: &str| {
        let Output {
            status,
            stderr,
            stdout,
        } = listening(folder, address).output().unwrap();
        let said = String::from_utf8_lossy(&stderr);
        assert_eq!(status.code(), Some(2), "{said}");
        assert!(said.contains(reason), "{reason}: {said}");
        assert!(stdout.is_empty(), "no link is printed");
    };
    refused(
        &enrolled(&own, &[]),
        "0.0.0.0",
        "names this one only (127.0.0.1, ::1, localhost)",
    );
    let copy = |name: &str, from: &Path| {
        std::fs::copy(from.join(name), operator.join(name)).unwrap();
    };
    // Of another swarm: its certificate, then only its key.
    let mine = [operator.join("certificate.pem"), operator.join("key.pem")]
        .map(|path| std::fs::read(path).unwrap());
    copy("certificate.pem", &strange);
    copy("key.pem", &strange);
    refused(&operator, "0.0.0.0", FOREIGN);
    // So it is without TLS.
    let Output { status, stderr, .. } = on_this_machine(&operator).output().unwrap();
    let said = String::from_utf8_lossy(&stderr);
    assert!(status.code() == Some(2) && said.contains(FOREIGN), "{said}");
    std::fs::write(operator.join("certificate.pem"), &mine[0]).unwrap();
    refused(
        &operator,
        "0.0.0.0",
        "key.pem: is not the private key of the certificate",
    );
    std::fs::write(operator.join("key.pem"), &mine[1]).unwrap();
    std::fs::write(operator.join("certificate.pem"), "garbage").unwrap();
    refused(
        &operator,
        "0.0.0.0",
        "certificate.pem: the certificate is no certificate",
    );
    std::fs::write(operator.join("certificate.pem"), &mine[0]).unwrap();
    // An address of some other machine; no certificate at all.
    refused(
        &operator,
        "203.0.113.1",
        "203.0.113.1:0 cannot be listened on",
    );
    let plain = folder.path().join("plain");
    std::fs::create_dir(&plain).unwrap();
    let text = format!(
        "kind = \"operator\"\nvenue = {VENUE:?}\n[bus]\nlisten = [\"tcp/127.0.0.1:0\"]\nconnect = [\"tcp/127.0.0.1:7447\"]\n"
    );
    std::fs::write(plain.join("operator.toml"), text).unwrap();
    refused(&plain, "0.0.0.0", "has no certificate for TLS");
}

#[test]
fn a_page_that_is_wholly_of_another_swarm_reaches_nobody_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let port = free_address().port().to_string();
    let swarms = ["own", "other"].map(|name| {
        let swarm = folder.path().join(name);
        enroll(&swarm, &["--port", &port, "--state-dir", "state", "ground"]);
        enroll(&swarm, &["operator"]);
        swarm
    });
    let _ground = Member::join(settings(&swarms[0].join("ground/ground.toml")));
    let [own, other] = swarms.map(|swarm| {
        let operator = swarm.join("operator-1");
        Served::by(on_this_machine(&operator), &operator)
    });
    let soon = Duration::from_secs(20);
    let is_linked = |served: &Served| {
        let (_, metrics) = served.dash.metrics(Dash::token(&served.dash.look));
        metrics.contains("\ntomoswarm_linked 1")
    };
    assert!(within(soon, || is_linked(&own)), "its own swarm is there");
    let said = || std::fs::read_to_string(&other.log).unwrap();
    let says_why = || {
        let said = said();
        said.contains("reaches nobody yet: ") && said.contains("certificates of another authority")
    };
    assert!(within(soon, says_why), "{}", said());
    assert!(!is_linked(&other));
}
