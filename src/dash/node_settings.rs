//! What nodes have said of their settings, put together from its parts: for whoever looks at a page's settings. It is no
//! part of the history: there is no looking back at it.

use std::collections::BTreeMap;

use tomoswarm_proto::{NodeSettings, SETTINGS_PARTS_MAX, Sender};

/// The settings of nodes; of two starts of a node's software those that were said last.
#[derive(Clone, Debug, Default)]
pub(super) struct NodeSettingsBook(BTreeMap<Sender, HeardParts>);

#[derive(Clone, Debug)]
struct HeardParts {
    instance: u64,
    parts: Vec<Option<String>>,
    /// Of another start, as long as not all parts of this one were heard.
    before: Option<String>,
}

impl HeardParts {
    fn whole(&self) -> Option<String> {
        self.parts.iter().cloned().collect()
    }
}

impl NodeSettingsBook {
    /// Takes a part.
    pub(super) fn take(&mut self, said: &NodeSettings) {
        let count = usize::from(said.parts.min(SETTINGS_PARTS_MAX));
        let known = self.0.entry(said.node).or_insert_with(|| HeardParts {
            instance: said.instance,
            parts: vec![None; count],
            before: None,
        });
        if known.instance != said.instance || known.parts.len() != count {
            let before = known.whole().or(known.before.take());
            *known = HeardParts {
                instance: said.instance,
                parts: vec![None; count],
                before,
            };
        }
        if let Some(part) = known.parts.get_mut(usize::from(said.part)) {
            *part = Some(said.text.clone());
        }
    }

    /// Returns the settings of a node; `None` = not all of their parts were heard.
    pub(super) fn of(&self, node: Sender) -> Option<String> {
        let said = self.0.get(&node)?;
        said.whole().or_else(|| said.before.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::VehicleId;

    #[test]
    fn settings_are_whole_when_all_parts_were_heard_in_whatever_order() {
        let node = Sender::Vehicle(VehicleId(2));
        let mut book = NodeSettingsBook::default();
        let mut hear = |instance, part, parts, text: &str| {
            book.take(&NodeSettings {
                node,
                instance,
                part,
                parts,
                text: text.to_owned(),
            });
            book.of(node)
        };
        let whole = |text: &str| Some(text.to_owned());
        assert_eq!(hear(1, 1, 3, "b"), None);
        assert_eq!(hear(1, 2, 3, "c"), None);
        assert_eq!(hear(1, 2, 3, "c"), None, "it comes twice");
        assert_eq!(hear(1, 0, 3, "a"), whole("abc"));
        assert_eq!(
            hear(2, 0, 2, "x"),
            whole("abc"),
            "until those of the next start are whole"
        );
        assert_eq!(hear(2, 1, 2, "y"), whole("xy"));
        assert_eq!(
            hear(2, 200, 255, "z"),
            whole("xy"),
            "there are never so many"
        );
        assert_eq!(book.of(Sender::Ground), None);
    }
}
