//! Whether a session still hears those to whom it has links. Links without certificates damage bytes at times, and what the
//! library itself says over them (who subscribes to what) has no checksum: a subscription that is damaged and still reads as
//! one leaves a node deaf to another for as long as the link stands. A session that is opened anew says and asks for all of
//! it again.
//!
//! It is told the time, opens nothing and names no library.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::Sender;

use crate::time::Time;

/// A session in which somebody was heard, and then nobody for this long: its links may be half open.
const NOBODY_FOR: Duration = Duration::from_secs(15);
/// One in which nobody was ever heard gets this long: it is seeking its neighbours by itself.
const ALONE_FOR: Duration = Duration::from_secs(60);
/// A vehicle or ground station whose link stands is silent for this long: each says something every second.
const SILENT_FOR: Duration = Duration::from_secs(15);
/// After a damaged frame the links must have been in order for this long, so that the next session is not damaged as well.
const IN_ORDER_FOR: Duration = Duration::from_secs(3);
/// A session with damaged frames lives at least this long.
const DAMAGED_AFTER: Duration = Duration::from_secs(5);
/// A session that has lived this long without damage begins to count from nothing.
const SOUND_AFTER: Duration = Duration::from_secs(120);
/// What was in vain waits twice as long each time, this often.
const DOUBLINGS: u32 = 5;

/// Why a session is opened anew.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub(super) enum ReopenReason {
    /// Nothing was heard of anyone.
    #[error("nothing is heard")]
    Nobody,
    /// Frames came damaged; what the library itself said may have been damaged too.
    #[error("frames were damaged on their way")]
    Damage,
    /// Others are allowed than before.
    #[error("the roster has changed")]
    Roster,
    /// Nothing was heard of a node whose link stands.
    #[error("nothing is heard of {0}, whose link stands")]
    Silent(Sender),
}

/// What one node hears of the others, session by session.
#[derive(Debug)]
pub(super) struct SessionHearing {
    opened: Time,
    /// When each was heard last in this session.
    heard: BTreeMap<Sender, Time>,
    /// Since when each has a link in this session.
    linked: BTreeMap<Sender, Time>,
    /// When the last damaged frame of this session came.
    damaged: Option<Time>,
    /// How often sessions were opened anew for damage, one soon after the other.
    damages: u32,
    /// How often one was opened anew for somebody's silence, who was not heard since.
    in_vain: BTreeMap<Sender, u32>,
    /// Whether the roster has changed since the session was opened.
    is_roster_new: bool,
}

impl SessionHearing {
    /// Begins with a session that is opened now.
    pub(super) fn new(now: Time) -> SessionHearing {
        SessionHearing {
            opened: now,
            heard: BTreeMap::new(),
            linked: BTreeMap::new(),
            damaged: None,
            damages: 0,
            in_vain: BTreeMap::new(),
            is_roster_new: false,
        }
    }

    /// A session was opened.
    pub(super) fn open(&mut self, now: Time) {
        self.opened = now;
        self.heard.clear();
        self.linked.clear();
        self.damaged = None;
    }

    /// A frame came from somebody, whole.
    pub(super) fn hear(&mut self, now: Time, sender: Sender) {
        self.heard.insert(sender, now);
        self.in_vain.remove(&sender);
    }

    /// A frame came that is not what was sent.
    pub(super) fn damage(&mut self, now: Time) {
        self.damaged = Some(now);
    }

    /// Others are allowed than before; a session knows only whom it was opened with.
    pub(super) fn change_roster(&mut self) {
        self.is_roster_new = true;
    }

    /// To these there are links now.
    pub(super) fn link(&mut self, now: Time, links: &[Sender]) {
        self.linked.retain(|sender, _| links.contains(sender));
        for sender in links {
            self.linked.entry(*sender).or_insert(now);
        }
    }

    /// Returns why the session is to be opened anew, which is then expected of the caller.
    pub(super) fn why_anew(&mut self, now: Time) -> Option<ReopenReason> {
        if std::mem::take(&mut self.is_roster_new) {
            return Some(ReopenReason::Roster);
        }
        if self.is_alone(now) {
            return Some(ReopenReason::Nobody);
        }
        if self.was_damaged(now) {
            self.damages += 1;
            return Some(ReopenReason::Damage);
        }
        let silent = self
            .linked
            .keys()
            .copied()
            .find(|sender| self.is_silent(now, *sender))?;
        *self.in_vain.entry(silent).or_default() += 1;
        Some(ReopenReason::Silent(silent))
    }

    fn is_alone(&self, now: Time) -> bool {
        match self.heard.values().max() {
            Some(last) => now.since(*last) > NOBODY_FOR,
            None => now.since(self.opened) > ALONE_FOR,
        }
    }

    fn was_damaged(&mut self, now: Time) -> bool {
        let Some(damaged) = self.damaged else {
            if now.since(self.opened) > SOUND_AFTER {
                self.damages = 0;
            }
            return false;
        };
        now.since(damaged) > IN_ORDER_FOR
            && now.since(self.opened) > doubled(DAMAGED_AFTER, self.damages)
    }

    /// Operators' tools may say nothing at all.
    fn is_silent(&self, now: Time, sender: Sender) -> bool {
        if let Sender::Operator(_) = sender {
            return false;
        }
        let last = self
            .linked
            .get(&sender)
            .into_iter()
            .chain(self.heard.get(&sender))
            .max();
        let patience = doubled(
            SILENT_FOR,
            self.in_vain.get(&sender).copied().unwrap_or_default(),
        );
        last.is_some_and(|last| now.since(*last) > patience)
    }
}

fn doubled(span: Duration, times: u32) -> Duration {
    span * (1 << times.min(DOUBLINGS))
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{OperatorId, VehicleId};

    use super::*;

    const TWO: Sender = Sender::Vehicle(VehicleId(2));
    const THREE: Sender = Sender::Vehicle(VehicleId(3));
    const TOOL: Sender = Sender::Operator(OperatorId(1));

    /// Looks every second, with the same links, while some are heard; returns when and why sessions were opened anew.
    fn opened(
        hearing: &mut SessionHearing,
        seconds: std::ops::Range<u64>,
        links: &[Sender],
        heard: &[Sender],
    ) -> Vec<(u64, ReopenReason)> {
        let mut all = Vec::new();
        for second in seconds {
            let now = Time::from_nanos(second * 1_000_000_000);
            heard.iter().for_each(|sender| hearing.hear(now, *sender));
            hearing.link(now, links);
            if let Some(why) = hearing.why_anew(now) {
                hearing.open(now);
                all.push((second, why));
            }
        }
        all
    }

    #[test]
    fn who_hears_all_to_whom_it_has_links_stays() {
        let mut hearing = SessionHearing::new(Time::default());
        assert_eq!(
            opened(
                &mut hearing,
                0..1000,
                &[TWO, THREE, TOOL],
                &[TWO, THREE, Sender::Ground]
            ),
            []
        );
        // A node that was switched off has no link any more.
        assert_eq!(opened(&mut hearing, 1000..2000, &[TWO, TOOL], &[TWO]), []);
    }

    #[test]
    fn a_new_roster_opens_the_session_anew_once() {
        let mut hearing = SessionHearing::new(Time::default());
        hearing.change_roster();
        let anew = opened(&mut hearing, 1..10, &[TWO], &[TWO]);
        assert_eq!(anew, [(1, ReopenReason::Roster)]);
    }

    #[test]
    fn who_hears_nobody_begins_anew_sooner_when_it_heard_somebody() {
        let mut hearing = SessionHearing::new(Time::default());
        assert_eq!(
            opened(&mut hearing, 0..70, &[], &[]),
            [(61, ReopenReason::Nobody)]
        );
        assert_eq!(opened(&mut hearing, 70..71, &[], &[TWO]), []);
        assert_eq!(
            opened(&mut hearing, 71..100, &[], &[]),
            [(86, ReopenReason::Nobody)]
        );
    }

    #[test]
    fn silence_on_a_link_that_stands_opens_the_session_anew_and_ever_less_often() {
        let mut hearing = SessionHearing::new(Time::default());
        let silent = |second| (second, ReopenReason::Silent(TWO));
        let links = [TWO, THREE];
        assert_eq!(
            opened(&mut hearing, 0..240, &links, &[THREE]),
            // Each time the link is new a second later: 16, then 31, then 61 seconds.
            [silent(16), silent(48), silent(110), silent(232)]
        );
        assert_eq!(opened(&mut hearing, 240..300, &links, &[TWO, THREE]), []);
        assert_eq!(
            opened(&mut hearing, 300..320, &links, &[THREE]),
            [silent(315)]
        );
    }

    #[test]
    fn damage_opens_the_session_anew_when_it_is_over() {
        let mut hearing = SessionHearing::new(Time::default());
        let mut damaged = |seconds: std::ops::Range<u64>| {
            let mut all = Vec::new();
            for second in seconds {
                hearing.damage(Time::from_nanos(second * 1_000_000_000));
                all.extend(opened(&mut hearing, second..second + 1, &[TWO], &[TWO]));
            }
            all
        };
        assert_eq!(damaged(1..20), []);
        assert_eq!(
            opened(&mut hearing, 20..60, &[TWO], &[TWO]),
            [(23, ReopenReason::Damage)]
        );
        // Damage that comes now and then does not keep the node busy with new sessions.
        let mut often = 0;
        for second in 60..1060 {
            if second % 5 == 0 {
                hearing.damage(Time::from_nanos(second * 1_000_000_000));
            }
            often += opened(&mut hearing, second..second + 1, &[TWO], &[TWO]).len();
        }
        assert!((4..=12).contains(&often), "{often}");
        assert_eq!(opened(&mut hearing, 1060..1400, &[TWO], &[TWO]).len(), 1);
        hearing.damage(Time::from_nanos(1_400_000_000_000));
        assert_eq!(
            opened(&mut hearing, 1400..1500, &[TWO], &[TWO]),
            [(1404, ReopenReason::Damage)]
        );
    }
}
