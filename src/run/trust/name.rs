//! The name in a certificate: which node it is of, and which of that node's certificates it is.

use std::fmt;
use std::str::FromStr;

use tomoswarm_proto::{OperatorId, Sender, VehicleId};

/// The common name of a certificate, "ground.1" or "vehicle-3.2"; no two certificates of a swarm have the same.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct CommonName {
    /// The node.
    pub node: Sender,
    /// Which of its certificates, counted from 1.
    pub issue: u32,
}

impl CommonName {
    /// Returns the name of a node without the number of its certificate: "ground", "vehicle-3" or "operator-1".
    pub fn node_name(node: Sender) -> String {
        match node {
            Sender::Ground => "ground".to_owned(),
            Sender::Vehicle(vehicle) => format!("vehicle-{vehicle}"),
            Sender::Operator(operator) => format!("operator-{operator}"),
        }
    }

    /// Reads the name of a node; `None` when no node is called so.
    pub fn node_of(name: &str) -> Option<Sender> {
        let plain = |number| plain_number(number).and_then(|number| u8::try_from(number).ok());
        match name.split_once('-') {
            None => (name == "ground").then_some(Sender::Ground),
            Some(("operator", number)) => {
                plain(number).map(|number| Sender::Operator(OperatorId(number)))
            }
            Some(("vehicle", number)) => {
                let number = plain(number).filter(|number| (1..=250).contains(number))?;
                Some(Sender::Vehicle(VehicleId(number)))
            }
            Some(_) => None,
        }
    }
}

impl fmt::Display for CommonName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", CommonName::node_name(self.node), self.issue)
    }
}

impl FromStr for CommonName {
    type Err = ();

    fn from_str(text: &str) -> Result<CommonName, ()> {
        let (node, issue) = text.split_once('.').ok_or(())?;
        let node = CommonName::node_of(node).ok_or(())?;
        let issue = plain_number(issue).filter(|issue| *issue > 0).ok_or(())?;
        Ok(CommonName { node, issue })
    }
}

/// Reads a number that is spelled in the one way in which it is written, so that a name has one spelling.
fn plain_number(text: &str) -> Option<u32> {
    text.parse::<u32>()
        .ok()
        .filter(|number| number.to_string() == text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_one_spelling() {
        let vehicle = |number| Sender::Vehicle(VehicleId(number));
        for (text, node, issue) in [
            ("ground.1", Sender::Ground, 1),
            ("operator-1.12", Sender::Operator(OperatorId(1)), 12),
            ("operator-255.1", Sender::Operator(OperatorId(255)), 1),
            ("vehicle-3.2", vehicle(3), 2),
            ("vehicle-250.4294967295", vehicle(250), u32::MAX),
        ] {
            let name = CommonName { node, issue };
            assert_eq!((text.parse(), name.to_string().as_str()), (Ok(name), text));
        }
        for text in [
            "",
            "ground",
            "ground.0",
            "ground.01",
            "ground.+1",
            "ground.1 ",
            "Ground.1",
            "vehicle-03.1",
            "vehicle-0.1",
            "vehicle-251.1",
            "vehicle-1.1.1",
            "vehicle-.1",
            "vehicle.1",
            "operator.1",
            "operator-01.1",
            "operator-256.1",
            "ground.4294967296",
        ] {
            assert_eq!(text.parse::<CommonName>(), Err(()), "{text}");
        }
    }
}
