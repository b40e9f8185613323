//! The order other than Start that is in force: whoever gave it, it holds up whatever the station would begin, plan or time,
//! until every vehicle has been started since. It orders nothing.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::OrderKind;

/// The strongest order since none was in force; none at the beginning.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub(super) struct OrderInForce(Option<OrderKind>);

impl OrderInForce {
    /// Takes the strongest order that the vehicles show, `None` = they show none; returns the one that is lifted by that.
    pub(super) fn update(&mut self, shown: Option<OrderKind>) -> Option<OrderKind> {
        match shown {
            None => self.0.take(),
            Some(_) => {
                self.0 = self.strongest_with(shown);
                None
            }
        }
    }

    /// Returns whether there is one.
    pub(super) fn is_any(self) -> bool {
        self.0.is_some()
    }

    /// Returns the stronger one of it and another.
    pub(super) fn strongest_with(self, other: Option<OrderKind>) -> Option<OrderKind> {
        self.0.into_iter().chain(other).reduce(OrderKind::stronger)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_order_stays_in_force_until_the_vehicles_show_none() {
        let mut order = OrderInForce::default();
        assert_eq!((order.update(None), order.is_any()), (None, false));
        assert_eq!(order.update(Some(OrderKind::Return)), None);
        assert_eq!(order.update(Some(OrderKind::Hold)), None);
        assert!(order.is_any());
        assert_eq!(
            order.strongest_with(None),
            Some(OrderKind::Return),
            "a weaker one changes nothing"
        );
        assert_eq!(
            order.strongest_with(Some(OrderKind::Land)),
            Some(OrderKind::Land)
        );
        assert_eq!(order.update(None), Some(OrderKind::Return));
        assert_eq!((order.update(None), order.is_any()), (None, false));
    }
}
