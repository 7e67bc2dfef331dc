//! What a drone says of its way, and when it waits for others.

use std::time::Duration;

use super::Transmit;
use crate::formation::Path;
use crate::geometry::{Ned, Velocity};
use crate::identity::NodeId;
use crate::time::Timestamp;
use crate::traffic::{Config, Intent, Traffic};

/// How often a drone looks whether a way is free that it waits to fly, besides whenever another says that it goes.
pub(super) const TRY_AGAIN_AFTER: Duration = Duration::from_millis(500);
/// How long it waits before it flies round one that does not go: as long as a process that hangs is given.
pub(super) const ROUND_AFTER: Duration = Duration::from_secs(3);
/// How long it waits to come down while others are below it.
pub(super) const LANDS_AFTER: Duration = Duration::from_secs(10);
/// How often it says how much of its way is behind it.
pub(super) const SAYS_EVERY: Duration = Duration::from_secs(1);

/// Two places are the same that are no farther apart, in metres.
const SAME_M: f64 = 1.0;

/// The way that a drone flies or waits to fly, as the others were told last.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Said {
    path: Path,
    share: f64,
    is_heedless: bool,
}

/// What keeps a drone apart from those near it that say where they are and go.
#[derive(Debug)]
pub(super) struct Guard {
    traffic: Traffic,
    said: Option<Said>,
    /// Since when it has waited for its way to be free.
    waits_since: Option<Timestamp>,
    /// When it next looks whether a way is free that it waits to fly.
    next_try: Option<Timestamp>,
    /// When it next says how far it has got.
    next_word: Option<Timestamp>,
}

impl Guard {
    pub(super) const fn new(id: NodeId, config: Config) -> Self {
        Self {
            traffic: Traffic::new(id, config),
            said: None,
            waits_since: None,
            next_try: None,
            next_word: None,
        }
    }

    /// When telemetry is to be asked for.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        self.next_try.into_iter().chain(self.next_word).min()
    }

    /// Whether it is time to ask for telemetry.
    pub(super) fn is_due(&mut self, now: Timestamp) -> bool {
        let mut is_due = false;
        for time in [&mut self.next_try, &mut self.next_word] {
            is_due |= time.take_if(|at| *at <= now).is_some();
        }
        is_due
    }

    /// Says where the drone is and goes, if that is news; nothing if it can't be said.
    pub(super) fn intend(
        &mut self,
        now: Timestamp,
        path: Option<Path>,
        is_heedless: bool,
    ) -> Option<Transmit> {
        let is_said = |said: &Said| (Some(said.path), said.is_heedless) == (path, is_heedless);
        if self.said.as_ref().map_or(path.is_none(), is_said) {
            return None;
        }
        self.said = path.map(|path| Said {
            path,
            share: 0.0,
            is_heedless,
        });
        self.next_word = path
            .filter(|path| path.from != path.to)
            .map(|_| now + SAYS_EVERY);
        Some(self.word(true))
    }

    /// Says, in the frames that are sent anyway, how far the drone has got on its way.
    pub(super) fn gets(&mut self, now: Timestamp, place: Ned) -> Option<Transmit> {
        let said = self.said.as_mut()?;
        let along = (said.path.to - said.path.from).0;
        let length_m = along.norm();
        if length_m <= 0.0 || self.next_word.is_some_and(|at| at > now) {
            return None;
        }
        let share = (place - said.path.from).0.dot(&along) / (length_m * length_m);
        said.share = said.share.max(share.clamp(0.0, 1.0));
        self.next_word = Some(now + SAYS_EVERY);
        Some(self.word(false))
    }

    /// Says, likewise, where the drone follows a place that moves on for so long unless it is told more.
    pub(super) fn follows(&mut self, to: Ned, velocity: Velocity, hold: Duration) -> Transmit {
        let follows_on = self.said.is_some_and(|it| it.is_heedless);
        let ahead = velocity.0 * hold.as_secs_f64();
        self.said = Some(Said {
            path: Path {
                from: to,
                to: Ned(to.0 + ahead),
            },
            share: 0.0,
            is_heedless: true,
        });
        self.next_word = None;
        self.word(!follows_on)
    }

    /// What was said last, for a radio that has forgotten it.
    pub(super) fn word(&self, at_once: bool) -> Transmit {
        let intent = (self.said).map(|it| Intent::of(it.path, it.share, it.is_heedless));
        Transmit::Intend { intent, at_once }
    }

    /// Takes in where another is and goes; whether telemetry is needed to see what that means for the own way.
    pub(super) fn hears(&mut self, now: Timestamp, id: NodeId, intent: Option<Intent>) -> bool {
        let is_news = self.traffic.hears(now, id, intent);
        let is_in_the_way = self.said.is_some_and(|said| {
            let from = Ned(said.path.from.0.lerp(&said.path.to.0, said.share));
            let rest = Path { from, ..said.path };
            !said.is_heedless && self.traffic.gives_way(now, rest, said.path)
        });
        // One that was forgotten is in the way again though it says nothing new.
        is_in_the_way || is_news && self.next_try.is_some()
    }

    /// Whether a way may be begun; then it waits no longer.
    pub(super) fn lets_begin(&mut self, now: Timestamp, path: Path) -> bool {
        self.next_try = None;
        let is_free = self.traffic.is_free(now, path);
        if is_free {
            self.waits_since = None;
        }
        is_free
    }

    /// Whether it stops on its way to `to`, where it would come to rest at `stop`, for another that flies first.
    pub(super) fn stops(&mut self, now: Timestamp, stop: Ned, to: Ned) -> bool {
        self.next_try = None;
        let rest = Path { from: stop, to };
        let said = self
            .said
            .filter(|said| said.path.to.distance_m(to) < SAME_M);
        let whole = said.map_or(rest, |said| said.path);
        self.traffic.gives_way(now, rest, whole)
    }

    /// A way round one that stays in the way for too long, if there is one: its two corners.
    pub(super) fn way_round(&self, now: Timestamp, path: Path) -> Option<[Ned; 2]> {
        self.has_waited(now, ROUND_AFTER)
            .then(|| self.traffic.way_round(now, path))?
    }

    /// Waits, and looks again soon.
    pub(super) fn waits(&mut self, now: Timestamp) {
        self.next_try = Some(now + TRY_AGAIN_AFTER);
        self.waits_since.get_or_insert(now);
    }

    /// It has another goal, to which it flies in step with those that follow its master, or not.
    pub(super) const fn starts_anew(&mut self, in_step: bool) {
        self.traffic.flies_in_step(in_step);
        self.waits_since = None;
        self.next_try = None;
    }

    /// Whether it comes down here, for nobody is below it or it has waited for long enough.
    pub(super) fn lets_down(&mut self, now: Timestamp, column: Path) -> bool {
        self.has_waited(now, LANDS_AFTER) || self.traffic.is_free(now, column)
    }

    /// Where it comes down if others stay below it.
    pub(super) fn beside(&self, now: Timestamp, column: Path) -> Option<Ned> {
        self.has_waited(now, ROUND_AFTER)
            .then(|| self.traffic.beside(now, column))?
    }

    /// Whether it makes for a place beside others.
    pub(super) fn goes_aside(&self, target: Option<Ned>) -> bool {
        let leads_there = target.is_some_and(|to| self.leads_to(to));
        self.waits_since.is_some() && leads_there
    }

    /// Whether it has been said that it makes for this place.
    pub(super) fn leads_to(&self, place: Ned) -> bool {
        self.said
            .is_some_and(|said| said.path.to.distance_m(place) < SAME_M)
    }

    fn has_waited(&self, now: Timestamp, time: Duration) -> bool {
        self.waits_since.is_some_and(|it| now.since(it) >= time)
    }
}
