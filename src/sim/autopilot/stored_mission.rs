//! The stored mission: its items, which of them is under way, and whether the mission runs. How an item is carried out, and
//! what follows when the mission is over, is not known here.

use std::collections::BTreeMap;

use crate::autopilot::{Item, StoredReport};

/// A mission as an autopilot stores it; item 0 is home.
#[derive(Clone, Debug, Default)]
pub(super) struct StoredMission {
    items: Vec<Item>,
    /// The item under way, or begun last; 0 = none.
    item: usize,
    is_running: bool,
    /// Whether its last item is done.
    is_over: bool,
    /// How often each jump was made.
    jumps: BTreeMap<usize, u16>,
}

impl StoredMission {
    /// Returns the items.
    pub(super) fn items(&self) -> &[Item] {
        &self.items
    }

    /// Returns the item under way, or begun last; 0 = none.
    pub(super) fn item(&self) -> usize {
        self.item
    }

    /// Returns whether it runs.
    pub(super) fn is_running(&self) -> bool {
        self.is_running
    }

    /// Returns how far it is.
    pub(super) fn report(&self) -> StoredReport {
        StoredReport {
            item: u16::try_from(self.item).unwrap_or(u16::MAX),
            is_over: self.is_over,
        }
    }

    /// Returns the first item with which it would go on that takes time.
    pub(super) fn next_lasting_item(&self) -> Option<Item> {
        let left = self.items.iter().skip(self.item.max(1));
        left.copied().find(Item::takes_time)
    }

    /// Takes items in place of the stored ones; it does not run then. Returns whether it ran.
    pub(super) fn store(&mut self, items: Vec<Item>) -> bool {
        (self.items, self.item, self.is_over) = (items, 0, false);
        self.jumps.clear();
        std::mem::take(&mut self.is_running)
    }

    /// Goes back to the beginning, and does not run.
    pub(super) fn rewind(&mut self) {
        (self.item, self.is_running, self.is_over) = (0, false, false);
        self.jumps.clear();
    }

    /// Is to go on with an item.
    pub(super) fn set_item(&mut self, item: usize) {
        (self.item, self.is_over) = (item, false);
    }

    /// Runs; returns the item with which it goes on: the one begun last, or the first after home.
    pub(super) fn run(&mut self) -> usize {
        (self.is_running, self.is_over) = (true, false);
        self.item.max(1)
    }

    /// Begins an item; `None` = there is none of that number, and nothing has changed.
    pub(super) fn begin(&mut self, item: usize) -> Option<Item> {
        let begun = self.items.get(item).copied()?;
        self.item = item;
        Some(begun)
    }

    /// Returns the item with which it goes on after one that takes no time: a jump is made as often as it says.
    pub(super) fn after(&mut self, item: usize) -> usize {
        let Some(Item::Jump { to, times }) = self.items.get(item) else {
            return item + 1;
        };
        let made = self.jumps.entry(item).or_default();
        if times.is_none_or(|times| *made < times) {
            *made = made.saturating_add(1);
            *to
        } else {
            item + 1
        }
    }

    /// Runs no more; the item under way is remembered.
    pub(super) fn stop(&mut self) {
        self.is_running = false;
    }

    /// Is over, after its last item.
    pub(super) fn end(&mut self) {
        (self.is_running, self.is_over) = (false, true);
        self.item = self.items.len().saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::geom::Point;

    const HOME: Item = Item::Waypoint {
        at: Point { x_m: 0.0, y_m: 0.0 },
        altitude_m: 0.0,
        delay: Duration::ZERO,
    };
    const WAIT: Item = Item::Delay(Duration::from_secs(1));

    fn stored(items: &[Item]) -> StoredMission {
        let mut mission = StoredMission::default();
        mission.store(items.to_vec());
        mission
    }

    #[test]
    fn it_begins_after_home_and_goes_on_with_the_item_under_way() {
        let mut mission = stored(&[HOME, WAIT, Item::Return]);
        assert_eq!((mission.run(), mission.is_running()), (1, true));
        assert_eq!(mission.begin(2), Some(Item::Return));
        mission.stop();
        assert!(!mission.is_running());
        assert_eq!((mission.run(), mission.item()), (2, 2));
        mission.rewind();
        assert_eq!((mission.is_running(), mission.run()), (false, 1));
    }

    #[test]
    fn what_lies_beyond_its_end_is_not_begun() {
        let mut mission = stored(&[HOME, WAIT]);
        mission.run();
        assert_eq!((mission.begin(1), mission.begin(2)), (Some(WAIT), None));
        assert_eq!((mission.item(), mission.is_running()), (1, true));
        mission.end();
        assert_eq!((mission.item(), mission.is_running()), (1, false));
    }

    #[test]
    fn an_item_that_takes_no_time_is_none_to_begin_with() {
        let mut mission = stored(&[HOME, Item::Speed(1.0), WAIT, Item::Speed(2.0)]);
        assert_eq!(mission.next_lasting_item(), Some(WAIT));
        mission.set_item(3);
        assert_eq!(mission.next_lasting_item(), None);
        assert_eq!(
            stored(&[HOME]).next_lasting_item(),
            None,
            "home is no item to fly"
        );
    }

    #[test]
    fn a_jump_is_made_as_often_as_it_says() {
        let jump = |times| Item::Jump { to: 1, times };
        let mut mission = stored(&[HOME, WAIT, jump(Some(2)), WAIT]);
        assert_eq!([2, 2, 2].map(|item| mission.after(item)), [1, 1, 3]);
        mission.rewind();
        assert_eq!(mission.after(2), 1, "it is counted anew");
        let mut mission = stored(&[HOME, WAIT, jump(None)]);
        assert!((0..1000).all(|_| mission.after(2) == 1));
    }

    #[test]
    fn another_mission_ends_the_one_that_runs() {
        let mut mission = stored(&[HOME, WAIT]);
        mission.run();
        mission.begin(1);
        assert!(mission.store(Vec::new()));
        assert_eq!((mission.item(), mission.is_running()), (0, false));
        assert!(!mission.store(vec![HOME]));
        assert_eq!(mission.items(), [HOME]);
    }
}
