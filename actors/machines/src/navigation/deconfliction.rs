//! Deconfliction: announces the own intent, and decides when to wait for others.

use std::sync::Arc;
use std::time::Duration;

use super::{Event, Fence, Transmit};
use crate::formation::Path;
use crate::geometry::{Ned, Velocity};
use crate::identity::{NodeId, NodeSet};
use crate::machine::Outbox;
use crate::time::Timestamp;
use crate::traffic::{Config, Intent, Traffic};

/// Interval of retries of a blocked path, besides a retry on each new intent of another drone.
pub(super) const RETRY_INTERVAL: Duration = Duration::from_millis(500);
/// Waiting time before a detour around stationary traffic: as long as a hung process has before it is restarted.
pub(super) const DETOUR_AFTER: Duration = Duration::from_secs(3);
/// Longest wait to land while others are below.
pub(super) const LANDING_WAIT_MAX: Duration = Duration::from_secs(10);
/// The same with an almost empty battery: time for those below to fly aside.
pub(super) const URGENT_LANDING_WAIT_MAX: Duration = Duration::from_secs(3);
/// Interval of progress announcements.
pub(super) const PROGRESS_INTERVAL: Duration = Duration::from_secs(1);

/// Places no farther apart are equal, in metres.
const SAME_M: f64 = 1.0;

/// The last announced path, being flown or waited for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Announcement {
    path: Path,
    share: f64,
    has_priority: bool,
    /// The tracked place, while the path leads there from elsewhere.
    joins: Option<Ned>,
}

impl Announcement {
    /// Where the drone was when it looked last.
    fn place(&self) -> Ned {
        self.path.at(self.share)
    }
}

/// Deconfliction of a drone with those near it that announce their intents.
///
/// Invariant: a drone that ignores traffic announces nothing, waits for nobody and finds each path clear.
#[derive(Debug)]
pub(super) struct Deconfliction {
    /// `None` if traffic is ignored.
    traffic: Option<Traffic>,
    /// Fence that no detour leaves, and the distance kept from it in metres.
    fence: Option<(Arc<Fence>, f64)>,
    announced: Option<Announcement>,
    /// Start of the wait for a clear path.
    waiting_since: Option<Timestamp>,
    /// Next retry of a blocked path.
    next_retry: Option<Timestamp>,
    /// Next progress announcement.
    next_progress: Option<Timestamp>,
}

impl Deconfliction {
    /// Of drone `id`, which ignores traffic without a configuration.
    pub(super) fn new(
        id: NodeId,
        config: Option<Config>,
        fence: Option<(Arc<Fence>, f64)>,
    ) -> Self {
        Self {
            fence,
            traffic: config.map(|it| Traffic::new(id, it)),
            announced: None,
            waiting_since: None,
            next_retry: None,
            next_progress: None,
        }
    }

    /// Whether it ignores traffic.
    pub(super) const fn ignores_traffic(&self) -> bool {
        self.traffic.is_none()
    }

    /// Next time at which telemetry is needed.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        self.next_retry.into_iter().chain(self.next_progress).min()
    }

    /// Whether telemetry is needed now; clears the elapsed timers.
    pub(super) fn take_due(&mut self, now: Timestamp) -> bool {
        let mut is_due = false;
        for time in [&mut self.next_retry, &mut self.next_progress] {
            is_due |= time.take_if(|at| *at <= now).is_some();
        }
        is_due
    }

    /// Announces a path, unless it is the announced one. A `path` of `None` withdraws the intent.
    pub(super) fn announce(
        &mut self,
        now: Timestamp,
        path: Option<Path>,
        has_priority: bool,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        let is_announced = |announced: &Announcement| {
            (Some(announced.path), announced.has_priority) == (path, has_priority)
        };
        let is_same = self.announced.as_ref().map_or(path.is_none(), is_announced);
        if is_same || self.traffic.is_none() {
            return;
        }
        self.announced = path.map(|path| Announcement {
            path,
            share: 0.0,
            has_priority,
            joins: None,
        });
        self.next_progress = path
            .filter(|path| path.from != path.to)
            .map(|_| now + PROGRESS_INTERVAL);
        self.send_intent(true, outbox);
    }

    /// Announces that the drone comes to rest at `stop`; it can't give way meanwhile. A master that flies among its
    /// followers looks at no drone that gives way to none.
    pub(super) fn announce_stop(
        &mut self,
        now: Timestamp,
        path: Path,
        at_rest: bool,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        let has_followers = self.traffic.as_ref().is_some_and(Traffic::has_followers);
        let has_priority = !at_rest && !has_followers;
        self.announce(now, Some(path), has_priority, outbox);
    }

    /// Announces the progress of the straight path to `corner`, or after a restart the rest of it; `place` is where the
    /// drone is.
    pub(super) fn announce_flight(
        &mut self,
        now: Timestamp,
        place: Ned,
        corner: Ned,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        if self.is_announced_to(corner) {
            self.announce_progress(now, place, outbox);
        } else {
            self.announce(now, Some(Path::new(place, corner)), false, outbox);
        }
    }

    /// Announces a landing from `stop` that can't be interrupted, or the progress of it, `place` being where the drone is.
    pub(super) fn announce_descent(
        &mut self,
        now: Timestamp,
        stop: Ned,
        place: Ned,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        let ground = stop.at_altitude(0.0);
        if self.is_announced_to(ground) {
            self.announce_progress(now, place, outbox);
        } else {
            self.announce(now, Some(Path::new(stop, ground)), true, outbox);
        }
    }

    /// Announces the progress on the path, in the next regular frame.
    pub(super) fn announce_progress(
        &mut self,
        now: Timestamp,
        place: Ned,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        let Some(announced) = self.announced.as_mut() else {
            return;
        };
        let is_stationary = announced.path.from == announced.path.to;
        if is_stationary || self.next_progress.is_some_and(|at| at > now) {
            return;
        }
        announced.share = announced.share.max(announced.path.share_nearest(place));
        self.next_progress = Some(now + PROGRESS_INTERVAL);
        self.send_intent(false, outbox);
    }

    /// Announces the path of a tracked place within `hold`. While the drone is elsewhere, the path begins where it is.
    pub(super) fn announce_track(
        &mut self,
        now: Timestamp,
        (to, velocity, hold): (Ned, Velocity, Duration),
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        if self.traffic.is_none() {
            return;
        }
        let before = self.announced;
        let joins_from = before
            .filter(|it| it.joins.is_some() || it.path.distance_m(to) > SAME_M)
            .map(|it| it.place());
        let ahead = velocity.0 * hold.as_secs_f64();
        self.announced = Some(Announcement {
            path: Path {
                from: joins_from.unwrap_or(to),
                to: Ned(to.0 + ahead),
            },
            share: 0.0,
            has_priority: true,
            joins: joins_from.map(|_| to),
        });
        self.next_progress = joins_from.and(self.next_progress.or(Some(now + PROGRESS_INTERVAL)));
        let was_tracking = before.is_some_and(|it| it.has_priority);
        let was_joining = before.is_some_and(|it| it.joins.is_some());
        let begins_to_join = joins_from.is_some() && !was_joining;
        self.send_intent(!was_tracking || begins_to_join, outbox);
    }

    /// Announces the rest of the path to a tracked place; `place` is where the drone is.
    pub(super) fn announce_joining(
        &mut self,
        now: Timestamp,
        place: Ned,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        let is_due = self.next_progress.is_none_or(|at| at <= now);
        let Some(announced) = self.announced.as_mut().filter(|_| is_due) else {
            return;
        };
        let Some(to) = announced.joins else {
            return;
        };
        let tracked = Path::new(to, announced.path.to);
        let has_joined = tracked.distance_m(place) <= SAME_M;
        announced.path.from = if has_joined { to } else { place };
        announced.joins = (!has_joined).then_some(to);
        self.next_progress = (!has_joined).then_some(now + PROGRESS_INTERVAL);
        self.send_intent(false, outbox);
    }

    /// Sends the announced intent, unless traffic is ignored.
    pub(super) fn send_intent(&self, immediately: bool, outbox: &mut Outbox<Transmit, Event>) {
        if self.traffic.is_some() {
            let intent = (self.announced).map(|it| Intent::of(it.path, it.share, it.has_priority));
            outbox.transmit(Transmit::AnnounceIntent {
                intent,
                immediately,
            });
        }
    }

    /// Updates the intent of another drone, with the time when it was heard. Returns whether telemetry is needed to check
    /// the own path.
    pub(super) fn update_traffic(
        &mut self,
        now: Timestamp,
        id: NodeId,
        (intent, heard_at): (Option<Intent>, Timestamp),
    ) -> bool {
        let Some(traffic) = &mut self.traffic else {
            return false;
        };
        let is_changed = traffic.update(heard_at, id, intent);
        let here = self.announced.map(|it| it.path.to);
        let is_below = here.is_some_and(|here| traffic.is_above(id, here)) && self.is_standing();
        // A drone that was forgotten blocks the path again even with an unchanged intent.
        self.is_blocked(now) || is_changed && (is_below || self.next_retry.is_some())
    }

    /// Updates which drones may not hear this one; returns whether telemetry is needed to check the own path.
    pub(super) fn update_deaf(&mut self, now: Timestamp, deaf: NodeSet) -> bool {
        if let Some(traffic) = &mut self.traffic {
            traffic.set_deaf(deaf);
        }
        self.is_blocked(now)
    }

    /// Whether the rest of the announced path must give way to another drone.
    fn is_blocked(&self, now: Timestamp) -> bool {
        self.announced.is_some_and(|announced| {
            let rest = Path {
                from: announced.place(),
                ..announced.path
            };
            !announced.has_priority && self.must_give_way(now, rest, announced.path)
        })
    }

    fn must_give_way(&self, now: Timestamp, rest: Path, whole: Path) -> bool {
        let traffic = self.traffic.as_ref();
        traffic.is_some_and(|it| it.must_give_way(now, rest, whole))
    }

    /// Whether no other drone is near a path.
    pub(super) fn is_clear(&self, now: Timestamp, path: Path) -> bool {
        let traffic = self.traffic.as_ref();
        traffic.is_none_or(|it| it.is_clear(now, path))
    }

    /// Whether a path may be started; ends the wait if so.
    pub(super) fn may_begin(&mut self, now: Timestamp, path: Path) -> bool {
        self.next_retry = None;
        let is_clear = self.is_clear(now, path);
        if is_clear {
            self.waiting_since = None;
        }
        is_clear
    }

    /// Whether to stop on the path to `to` for a drone with right of way; it would come to rest at `stop`.
    pub(super) fn must_stop(&mut self, now: Timestamp, stop: Ned, to: Ned) -> bool {
        self.next_retry = None;
        let rest = Path { from: stop, to };
        let announced = self
            .announced
            .filter(|announced| announced.path.to.distance_m(to) < SAME_M);
        let whole = announced.map_or(rest, |announced| announced.path);
        self.must_give_way(now, rest, whole)
    }

    /// Where to make room for a drone that may come down on this one, which stands here. Below others it looks again after
    /// a while, for one that falls silent sends nothing to react to.
    pub(super) fn room_beside(&mut self, now: Timestamp, here: Ned) -> Option<Ned> {
        let traffic = self.traffic.as_ref().filter(|_| self.is_standing())?;
        if self.next_progress.is_none() && traffic.is_any_above(here) {
            self.next_progress = Some(now + PROGRESS_INTERVAL);
        }
        traffic.room_beside(now, here, |side| self.keeps_inside(here, side))
    }

    /// Whether it announced that it stands still.
    fn is_standing(&self) -> bool {
        self.announced
            .is_some_and(|it| !it.has_priority && it.path.from.distance_m(it.path.to) < SAME_M)
    }

    /// Two corners of a detour around traffic that blocks the path for too long, if there is one.
    pub(super) fn detour(&self, now: Timestamp, path: Path) -> Option<[Ned; 2]> {
        let traffic = self.traffic.as_ref()?;
        self.has_waited(now, DETOUR_AFTER)
            .then(|| traffic.detour(now, path, |corner| self.keeps_inside(path.from, corner)))?
    }

    /// Starts or continues the wait for a clear path; returns whether it continues.
    pub(super) fn wait(&mut self, now: Timestamp) -> bool {
        self.next_retry = Some(now + RETRY_INTERVAL);
        self.waiting_since
            .replace(self.waiting_since.unwrap_or(now))
            .is_some()
    }

    /// Starts anew for another goal; `in_lockstep` is whether it is flown in lockstep with the others.
    pub(super) fn reset(&mut self, now: Timestamp, in_lockstep: bool) {
        if let Some(traffic) = &mut self.traffic {
            traffic.set_in_lockstep(now, in_lockstep);
        }
        self.waiting_since = None;
        self.next_retry = None;
    }

    /// Whether to land here: the column is clear and none comes down on it, or it has waited for so long.
    pub(super) fn may_descend(&self, now: Timestamp, column: Path, longest_wait: Duration) -> bool {
        let is_below_another = self.is_below_another(now, column.from);
        self.has_waited(now, longest_wait) || self.is_clear(now, column) && !is_below_another
    }

    fn is_below_another(&self, now: Timestamp, here: Ned) -> bool {
        let traffic = self.traffic.as_ref();
        traffic.is_some_and(|it| it.is_below_another(now, here))
    }

    /// Landing place beside traffic that stays below, or at once beside one that comes down here.
    pub(super) fn landing_detour(&self, now: Timestamp, column: Path) -> Option<Ned> {
        let traffic = self.traffic.as_ref()?;
        let is_due = self.has_waited(now, DETOUR_AFTER) || self.is_below_another(now, column.from);
        is_due.then(|| {
            traffic.landing_detour(now, column, |side| self.keeps_inside(column.from, side))
        })?
    }

    /// Whether it waits and flies to an announced place.
    pub(super) fn is_on_detour_to(&self, target: Option<Ned>) -> bool {
        let is_target = target.is_some_and(|to| self.is_announced_to(to));
        self.waiting_since.is_some() && is_target
    }

    /// Whether the announced path ends at this place.
    fn is_announced_to(&self, place: Ned) -> bool {
        self.announced
            .is_some_and(|announced| announced.path.to.distance_m(place) < SAME_M)
    }

    /// Whether a straight path stays inside the fence.
    fn keeps_inside(&self, from: Ned, to: Ned) -> bool {
        (self.fence.as_ref())
            .is_none_or(|(fence, margin_m)| fence.stopping_clearance_m(from, to) > *margin_m)
    }

    /// Whether it has waited long enough for a detour.
    pub(super) fn has_waited_for_detour(&self, now: Timestamp) -> bool {
        self.has_waited(now, DETOUR_AFTER)
    }

    fn has_waited(&self, now: Timestamp, time: Duration) -> bool {
        self.waiting_since.is_some_and(|it| now.since(it) >= time)
    }
}
