//! Whether the parent is still there: a drone that has not heard it for a while asks it, and asks again, the more often
//! the more the link loses; only if it does not answer any of them, and nobody else has heard more of the master for a while, the master is missed.
//!
//! Each drone watches its own link only. Whoever is farther out hears from its parent, which lives, what has become of
//! the master; so nobody waits for as long as numbers may be lost over all hops together.

use std::time::Duration;

use super::links::{QUESTIONS_MAX, STALE_BEACONS_MAX};
use super::speak::Occasion;
use super::{Config, TreeRouting};
use crate::identity::NodeId;
use crate::time::Timestamp;

/// A parent that is being asked whether it is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seek {
    parent: NodeId,
    /// When it was last heard.
    heard_at: Timestamp,
    due: Timestamp,
    asked: u32,
}

impl Config {
    /// How long a drone takes at most, from when it last heard a parent that is gone, until the master is missed: until
    /// the parent is asked, until it has not answered, both once more for another way that turns out to be gone too, and
    /// until nobody else has heard more of the master.
    #[must_use]
    pub fn detection(&self) -> Duration {
        let asked = (self.repair * 2).mul_f64(QUESTIONS_MAX);
        (self.beacon * STALE_BEACONS_MAX.into() + asked) * 2 + self.patience
    }
}

impl TreeRouting {
    /// When the parent is to be asked next, or for the first time.
    pub(super) fn next_seek(&self) -> Option<Timestamp> {
        if self.durable.landing.is_some() || self.durable.stopped {
            return None;
        }
        let Some(parent) = self.routes.parent else {
            let (since, _) = self.orphaned.filter(|_| !self.master_silent)?;
            return Some(since + self.config.patience);
        };
        if let Some(seek) = self.current_seek() {
            return Some(seek.due);
        }
        let stale_at = match self.good_parent {
            Some(parent) => parent.stale_at,
            None => self.links.get(parent)?.stale_at(self.config.beacon),
        };
        Some(stale_at)
    }

    /// Unless the parent has been heard since, or is another one by now.
    fn current_seek(&self) -> Option<Seek> {
        let (seek, parent) = (self.seek?, self.routes.parent?);
        let heard_at = self.links.get(parent)?.heard_at;
        (seek.parent == parent && seek.heard_at == heard_at).then_some(seek)
    }

    pub(super) fn seek_if_due(&mut self, now: Timestamp) {
        if self.next_seek().is_none_or(|due| due > now) {
            return;
        }
        let Some(parent) = self.routes.parent else {
            return self.miss_master();
        };
        let Some(link) = self.links.get(parent) else {
            return;
        };
        let (heard_at, questions) = (link.heard_at, link.quality.questions());
        let asked = self.current_seek().map_or(0, |seek| seek.asked);
        if asked >= questions {
            self.seek = None;
            self.links.forget(parent);
            return self.update_routes(now);
        }
        let pause = self.config.repair;
        let due = now + pause + self.jitter(pause);
        self.seek = Some(Seek {
            parent,
            heard_at,
            due,
            asked: asked + 1,
        });
        if asked == 0 && self.are_beacons_quick() {
            // All hear that it is there, and whoever has heard more of the master says so.
            self.beacon_soon(now);
        }
        self.say(now, Occasion::Seek);
    }
}
