//! Processes of drones: they end, hang, and are started again.

use std::ops::{Index, IndexMut};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use super::core::Core;
use super::drone::Drone;
use super::event::{Event, ProcessEvent, Silence};
use super::trace::Kind;

/// How long a process takes to start again, unless the fault plan says otherwise.
pub(super) const RESTART_AFTER: Duration = Duration::from_secs(1);

/// The timeouts of those that watch a drone's process.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timeouts {
    /// How long an actor may hang before its supervisor restarts it.
    pub(super) actor: Duration,
    /// How long a process may hang before its service manager restarts it.
    pub(super) watchdog: Duration,
    /// How long a flight controller waits for its companion computer before it lands.
    pub(super) link: Duration,
}

/// The processes of all drones and relays.
///
/// Invariant: each hang and each restart of a process has its timeouts scheduled. Each timer that is set has a wake-up
/// scheduled at its time on the drone's clock.
#[derive(Debug)]
pub(super) struct Processes {
    drones: Vec<Drone>,
    timeouts: Timeouts,
}

/// The remedy for a process or an actor that has hung for too long.
#[derive(Debug, Clone, Copy)]
pub(super) enum Remedy {
    RestartProcess,
    RestartActor(Address),
}

impl Processes {
    pub(super) const fn new(drones: Vec<Drone>, timeouts: Timeouts) -> Self {
        Self { drones, timeouts }
    }

    /// Number of drones and relays.
    pub(super) const fn len(&self) -> usize {
        self.drones.len()
    }

    /// How long an actor may hang before its supervisor restarts it.
    pub(super) const fn actor_timeout(&self) -> Duration {
        self.timeouts.actor
    }

    /// Sets an actor's timer, on its drone's clock.
    #[inline]
    pub(super) fn set_timer(
        &mut self,
        core: &mut Core,
        drone: NodeId,
        address: Address,
        deadline: Option<Timestamp>,
    ) {
        if let Some((at, generation)) = self[drone].set_timer(address, deadline) {
            let wake = Event::Wake {
                drone,
                address,
                generation,
            };
            core.schedule(at.max(core.now()), wake);
        }
    }

    /// Stops an actor that failed, and drops its messages.
    pub(super) fn stop_actor(&mut self, core: &mut Core, drone: NodeId, address: Address) {
        self[drone].actors.take_down(address);
        core.inbox.drop_actor(drone, address);
    }

    /// Schedules the restart of an actor at a time of its drone's clock.
    pub(super) fn schedule_restart(
        &self,
        core: &mut Core,
        drone: NodeId,
        address: Address,
        at: Timestamp,
    ) {
        let at = self[drone].clock.when(at).max(core.now());
        let incarnation = self[drone].incarnation();
        let restart = ProcessEvent::RestartActor {
            address,
            incarnation,
        };
        core.schedule(at, Event::Process(drone, restart));
    }

    /// Whether an actor's restart is still due.
    pub(super) fn restarts(&self, drone: NodeId, incarnation: u32) -> bool {
        !self[drone].given_up && self[drone].incarnation() == incarnation
    }

    /// Ends a drone's process, and drops all messages for it.
    pub(super) fn end(&mut self, core: &mut Core, drone: NodeId) {
        core.inbox.drop_drone(drone);
        self[drone].end();
        core.swarms.of_mut(drone).barrier.given_up(drone);
    }

    /// Schedules the start of a process that has ended, and the link timeout of its flight controller.
    pub(super) fn schedule_boot(&self, core: &mut Core, drone: NodeId, after: Duration) {
        let incarnation = self[drone].incarnation();
        let boot = ProcessEvent::Boot { incarnation };
        core.schedule_after(after, Event::Process(drone, boot));
        let link_timeout = ProcessEvent::LinkTimeout(Silence::Ended { incarnation });
        core.schedule_after(self.timeouts.link, Event::Process(drone, link_timeout));
    }

    /// Whether a process that was to be started has yet to start.
    pub(super) fn is_awaited(&self, drone: NodeId, incarnation: u32) -> bool {
        self[drone].incarnation() == incarnation && !self[drone].runs()
    }

    /// Whether a flight controller still receives nothing.
    pub(super) fn is_silent(&self, drone: NodeId, silence: Silence) -> bool {
        match silence {
            Silence::Ended { incarnation } => self.is_awaited(drone, incarnation),
            Silence::Hung(hang) => self[drone].actors.are_held_by(hang),
        }
    }

    /// Makes an actor hang, or a whole process (`None`): for so long, or until its watchdog timeout.
    pub(super) fn hang(
        &mut self,
        core: &mut Core,
        drone: NodeId,
        actor: Option<Address>,
        lasts: Option<Duration>,
    ) {
        core.trace(drone, Kind::Hung, &actor);
        let timeouts = self.timeouts;
        let actors = &mut self[drone].actors;
        let (hang, watchdog) = match actor {
            Some(actor) => (actors.hang(&[actor]), timeouts.actor),
            None => {
                let hang = actors.hang(&Address::ALL);
                let link_timeout = ProcessEvent::LinkTimeout(Silence::Hung(hang));
                core.schedule_after(timeouts.link, Event::Process(drone, link_timeout));
                (hang, timeouts.watchdog)
            }
        };
        let watched = ProcessEvent::Watchdog { actor, hang };
        core.schedule_after(watchdog, Event::Process(drone, watched));
        if let Some(lasts) = lasts {
            let resume = ProcessEvent::Resume { hang };
            core.schedule_after(lasts, Event::Process(drone, resume));
        }
    }

    /// The remedy of a watchdog timeout. `None` if the hang is over.
    pub(super) fn remedy(
        &self,
        drone: NodeId,
        actor: Option<Address>,
        hang: u32,
    ) -> Option<Remedy> {
        let actors = &self[drone].actors;
        match actor {
            _ if !actors.are_held_by(hang) => None,
            None => Some(Remedy::RestartProcess),
            Some(actor) => actors.is_up(actor).then_some(Remedy::RestartActor(actor)),
        }
    }

    /// Ends a hang: timers that have expired fire first, then the messages held back are queued. Returns whether the hang
    /// was not over yet.
    pub(super) fn resume(&mut self, core: &mut Core, drone: NodeId, hang: u32) -> bool {
        if !self[drone].actors.are_held_by(hang) {
            return false;
        }
        core.trace(drone, Kind::Resumed, &());
        let (now, state) = (core.now(), &mut self[drone]);
        let shown = state.clock.at(now);
        for (address, generation) in state.actors.resume(hang, shown) {
            let wake = Event::Wake {
                drone,
                address,
                generation,
            };
            core.schedule(now, wake);
        }
        let incarnation = state.incarnation();
        let backlog = ProcessEvent::Backlog { incarnation };
        core.schedule(now, Event::Process(drone, backlog));
        true
    }

    /// Changes the rate of a drone's clock, and sets its timers by it.
    pub(super) fn skew(&mut self, core: &mut Core, drone: NodeId, ppm: i32) {
        core.trace(drone, Kind::Skewed, &ppm);
        self[drone].clock.skew(core.now(), ppm);
        for address in Address::ALL {
            if let Some(deadline) = self[drone].actors.deadline(address) {
                self[drone].set_timer(address, None);
                self.set_timer(core, drone, address, Some(deadline));
            }
        }
    }
}

impl Index<NodeId> for Processes {
    type Output = Drone;

    fn index(&self, drone: NodeId) -> &Drone {
        &self.drones[drone.0 as usize]
    }
}

impl IndexMut<NodeId> for Processes {
    fn index_mut(&mut self, drone: NodeId) -> &mut Drone {
        &mut self.drones[drone.0 as usize]
    }
}
