//! A stranger on the bus: a bare zenoh session that says what it likes under any key and writes down what it hears.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::{Arc, Mutex};

use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;

/// How the stranger shows itself.
#[derive(Clone, Copy, Debug)]
pub enum Shows<'a> {
    /// Nothing: plain TCP.
    Nothing,
    /// Over TLS, knowing an authority, without a certificate of its own.
    Authority(&'a Path),
    /// Over TLS, with the files of a folder.
    Folder(&'a Path),
}

/// A bare session.
pub struct Stranger {
    session: zenoh::Session,
    heard: Arc<Mutex<BTreeMap<String, u64>>>,
}

impl Stranger {
    /// Joins as a peer, listening and connecting; listens to everything of any venue.
    pub fn peer(shows: Shows, listen: Option<SocketAddr>, connect: &[SocketAddr]) -> Stranger {
        Stranger::open("peer", shows, listen, connect).unwrap()
    }

    /// Joins as a client; `None` when it is not let in.
    pub fn client(shows: Shows, connect: SocketAddr) -> Option<Stranger> {
        Stranger::open("client", shows, None, &[connect])
    }

    fn open(
        mode: &str,
        shows: Shows,
        listen: Option<SocketAddr>,
        connect: &[SocketAddr],
    ) -> Option<Stranger> {
        let protocol = if matches!(shows, Shows::Nothing) {
            "tcp"
        } else {
            "tls"
        };
        let endpoint = |address: &SocketAddr| format!("{protocol}/{address}");
        let config = json!({
            "mode": mode,
            "listen": { "endpoints": listen.iter().map(endpoint).collect::<Vec<_>>() },
            "connect": {
                "endpoints": connect.iter().map(endpoint).collect::<Vec<_>>(),
                "timeout_ms": if mode == "peer" { -1 } else { 3000 },
                "exit_on_failure": mode != "peer",
            },
            "scouting": { "delay": 1, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
            "transport": { "link": { "tls": tls(shows) } },
        });
        let config = zenoh::Config::from_json5(&config.to_string()).unwrap();
        let session = zenoh::open(config).wait().ok()?;
        let heard = Arc::new(Mutex::new(BTreeMap::new()));
        let writes = heard.clone();
        let hear = move |sample: zenoh::sample::Sample| {
            *writes
                .lock()
                .unwrap()
                .entry(sample.key_expr().to_string())
                .or_default() += 1;
        };
        // Access control lets nobody listen to more than one venue.
        for keys in ["**", "tomoswarm/courtyard/**"] {
            let declared = session.declare_subscriber(keys).callback(hear.clone());
            declared
                .allowed_origin(Locality::Remote)
                .background()
                .wait()
                .unwrap();
        }
        Some(Stranger { session, heard })
    }

    /// Says something under a whole key.
    pub fn say(&self, key: &str, bytes: &[u8]) {
        self.session
            .put(key, bytes)
            .congestion_control(CongestionControl::Drop)
            .wait()
            .unwrap();
    }

    /// Says something and waits until it is under way.
    pub fn insist(&self, key: &str, bytes: &[u8]) {
        self.session
            .put(key, bytes)
            .congestion_control(CongestionControl::Block)
            .wait()
            .unwrap();
    }

    /// Returns how often it heard each key.
    pub fn heard(&self) -> BTreeMap<String, u64> {
        self.heard.lock().unwrap().clone()
    }

    /// Tells to how many others it has a link.
    pub fn links(&self) -> usize {
        let info = self.session.info();
        info.peers_zid().wait().count() + info.routers_zid().wait().count()
    }

    /// Leaves.
    pub fn close(self) {
        self.session.close().wait().unwrap();
    }
}

fn tls(shows: Shows) -> Value {
    match shows {
        Shows::Nothing => json!({}),
        Shows::Authority(ca) => {
            json!({ "root_ca_certificate": ca, "verify_name_on_connect": false })
        }
        Shows::Folder(folder) => json!({
            "root_ca_certificate": folder.join("ca.pem"),
            "enable_mtls": true,
            "listen_certificate": folder.join("certificate.pem"),
            "listen_private_key": folder.join("key.pem"),
            "connect_certificate": folder.join("certificate.pem"),
            "connect_private_key": folder.join("key.pem"),
            "verify_name_on_connect": false,
        }),
    }
}
