//! The settings of a zenoh session, as text that zenoh reads. What each is for stands beside it; what is not named here is
//! zenoh's default.

use serde_json::{Value, json};

use super::{BusSettings, SessionTopology, Trust, session_id};

/// Longest message that is taken from a link, bytes.
const MESSAGE_MAX: usize = 1 << 20;
/// Sizes of the kernel's buffers of a link, bytes: small, so that orders do not queue behind tiles. What is to be sent has the
/// smaller one: its end knows what is urgent.
const SEND_BUFFER: usize = 16 << 10;
const RECEIVE_BUFFER: usize = 32 << 10;

/// Returns the settings as JSON.
pub(super) fn session(settings: &BusSettings, is_hub: bool) -> Value {
    let mode = match (settings.topology, is_hub) {
        (SessionTopology::Mesh, _) => "peer",
        (SessionTopology::Star, true) => "router",
        (SessionTopology::Star, false) => "client",
    };
    let listen = if mode == "client" {
        Vec::new()
    } else {
        endpoints(&settings.listen)
    };
    let mut session = json!({
        "id": session_id::random(settings.node, &settings.prefix),
        "mode": mode,
        "connect": {
            "endpoints": endpoints(&settings.connect),
            // A peer goes on trying in the background for ever (with 0 it would try once); a client's opening fails at
            // once, and the bus tries again.
            "timeout_ms": { "router": -1, "peer": -1, "client": 0 },
            "exit_on_failure": { "router": false, "peer": false, "client": true },
            "retry": { "period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2 },
        },
        "listen": {
            "endpoints": listen,
            "timeout_ms": 0,
            "exit_on_failure": true,
        },
        // Whom it does not reach yet it need not wait for.
        "open": { "return_conditions": { "connect_scouted": false, "declares": false } },
        "scouting": {
            "delay": 1,
            "timeout": 1000,
            "multicast": { "enabled": false },
            "gossip": { "enabled": settings.gossip },
        },
        "timestamping": { "enabled": false },
        "transport": {
            "unicast": {
                "open_timeout": 1000,
                "accept_timeout": 2000,
                "accept_pending": 1000,
                "max_sessions": 1000,
            },
            "link": {
                "tx": { "lease": millis(settings.lease), "keep_alive": 4 },
                "rx": { "max_message_size": MESSAGE_MAX },
            },
            "shared_memory": { "enabled": false },
        },
        "adminspace": { "enabled": false },
    });
    if let Some(trust) = &settings.trust {
        session["transport"]["link"]["tls"] = tls(trust);
        session["access_control"] = access(trust, &settings.prefix);
    }
    session
}

fn millis(span: std::time::Duration) -> u64 {
    u64::try_from(span.as_millis()).unwrap_or(u64::MAX)
}

fn endpoints(plain: &[String]) -> Vec<String> {
    plain
        .iter()
        .map(|endpoint| format!("{endpoint}#so_sndbuf={SEND_BUFFER};so_rcvbuf={RECEIVE_BUFFER}"))
        .collect()
}

fn tls(trust: &Trust) -> Value {
    json!({
        "root_ca_certificate": trust.ca,
        "enable_mtls": true,
        "listen_certificate": trust.certificate,
        "listen_private_key": trust.key,
        "connect_certificate": trust.certificate,
        "connect_private_key": trust.key,
        // Hosts are named by addresses that change; the name in the certificate says who it is, and grants access.
        "verify_name_on_connect": false,
    })
}

/// Everything is denied but what the roster allows: to listen within the venue, and to write under its own prefix.
fn access(trust: &Trust, prefix: &str) -> Value {
    let within = format!("{prefix}/**");
    let mut rules = vec![
        json!({
            "id": "listen",
            "permission": "allow",
            "flows": ["ingress", "egress"],
            "messages": ["declare_subscriber"],
            "key_exprs": [&within],
        }),
        json!({
            "id": "send",
            "permission": "allow",
            "flows": ["egress"],
            "messages": ["put"],
            "key_exprs": [&within],
        }),
    ];
    let (mut subjects, mut policies) = (Vec::new(), Vec::new());
    for allowed in &trust.access {
        let name = &allowed.common_name;
        rules.push(json!({
            "id": format!("write-{name}"),
            "permission": "allow",
            "flows": ["ingress"],
            "messages": ["put"],
            "key_exprs": &allowed.writes,
        }));
        subjects.push(json!({ "id": name, "cert_common_names": [name] }));
        policies.push(
            json!({ "rules": ["listen", "send", format!("write-{name}")], "subjects": [name] }),
        );
    }
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}
