//! Which keys a node listens to, without the venue's prefix. Written in the bus's key expressions: `*` is one part, `**`
//! any number.

use tomoswarm_proto::Sender;

/// Gives the key expressions that concern a node.
pub fn heard_by(node: Sender) -> Vec<String> {
    match node {
        Sender::Vehicle(id) => {
            let from_ground = ["hello", "have", "digest", "report", "plan/*", "tile/**", "want/**"]
                .map(|key| format!("ground/{key}"));
            let from_peers = ["hello", "state", "progress", "digest", "tile/**", "want/**"]
                .map(|key| format!("vehicle/*/{key}"));
            let orders =
                [format!("ground/order/{id}"), format!("operator/order/{id}"), "operator/hello".to_owned()];
            from_ground.into_iter().chain(from_peers).chain(orders).collect()
        }
        // The other ground's report tells who holds the lease.
        Sender::Ground => {
            ["vehicle/**", "ground/hello", "ground/report", "operator/hello"].map(str::to_owned).to_vec()
        }
        Sender::Operator => vec!["**".to_owned()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::VehicleId;

    #[test]
    fn a_vehicle_hears_orders_to_itself_alone() {
        let heard = heard_by(Sender::Vehicle(VehicleId(3)));
        assert!(
            heard.contains(&"ground/order/3".to_owned()) && heard.contains(&"operator/order/3".to_owned())
        );
        assert!(
            !heard
                .iter()
                .any(|key| key == "ground/**" || key.ends_with("order/*") || key.ends_with("samples"))
        );
    }
}
