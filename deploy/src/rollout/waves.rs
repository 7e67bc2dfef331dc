//! A rollout in waves: which host is changed when, and when all of a wave are taken back.

use std::collections::BTreeMap;
use std::time::Duration;

use super::worker::AWAY_MAX;
use crate::hosts::Wave;

/// Time that a host may look unhealthy while its wave soaks, before the gate fails.
const RELAPSE_MAX: Duration = Duration::from_secs(5);

/// How far a host is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum HostState {
    /// It has the release already.
    Unchanged,
    /// It is to be changed.
    Waiting,
    /// It waits for its drones, which take part in a flight.
    Deferred,
    /// Its drones are called down. Since when the host can't be seen: `None` if it can.
    Recalled { away_since: Option<Duration> },
    /// It is being changed.
    Changing,
    /// Its release has proven itself there.
    Changed,
    /// It went back by itself; why, in words.
    Failed(String),
    /// It is being taken back.
    TakingBack,
    /// It was taken back; why not, if it could not be.
    TakenBack(Result<(), String>),
    /// It can't be changed; why, in words.
    Blocked(String),
}

/// What to do with a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Action {
    /// Install the release and try it.
    Change(usize),
    /// Run the release before it again.
    TakeBack(usize),
    /// Call its drones down.
    Recall(usize),
}

/// What happened on a host.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Event {
    /// The release has proven itself.
    Changed,
    /// The host did not take the release, or went back by itself; why, in words.
    Failed(String),
    /// Its drones took off before it could be changed; the host is as it was.
    Deferred,
    /// It could not be asked, as it is lost or another operator's; why, in words.
    Blocked(String),
    /// The host runs the release before again, or could not; why, in words.
    TakenBack(Result<(), String>),
    /// How the host looks.
    Seen(Sight),
}

/// How a host looks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sight {
    /// Number of its drones that take part in a flight. `None` if it can't be seen: then the last number counts.
    pub(super) in_flight: Option<usize>,
    /// What is wrong with it, in words. `None` if it is healthy.
    pub(super) complaint: Option<String>,
    /// Frames that a drone dropped a second since the last look, at most.
    pub(super) dropped_per_s: f64,
}

/// A rollout. Times are since its start.
#[derive(Debug)]
pub(super) struct Rollout {
    waves: Vec<Wave>,
    hosts: Vec<HostState>,
    in_flight: Vec<usize>,
    /// Hosts that must have been changed before each host, as they still have a drone of it; in words.
    waits_for: Vec<BTreeMap<usize, String>>,
    /// Since when a host of the wave looks unhealthy.
    unhealthy_since: Vec<Option<Duration>>,
    /// The wave that is on.
    wave: usize,
    /// Since when all of the wave have been changed.
    soaks_since: Option<Duration>,
    /// The fewest drones in flight while others are called down. `None`: none is called down.
    keep_flying: Option<usize>,
    stopped: Option<String>,
}

impl Rollout {
    /// A rollout of hosts in these states: unchanged, waiting, deferred or blocked. `waits_for` has, for each host, the hosts
    /// that must have been changed before it, and why.
    pub(super) fn new(
        waves: Vec<Wave>,
        hosts: Vec<HostState>,
        in_flight: Vec<usize>,
        waits_for: Vec<BTreeMap<usize, String>>,
        keep_flying: Option<usize>,
    ) -> Self {
        Self {
            unhealthy_since: vec![None; hosts.len()],
            waves,
            hosts,
            in_flight,
            waits_for,
            wave: 0,
            soaks_since: None,
            keep_flying,
            stopped: None,
        }
    }

    pub(super) fn hosts(&self) -> &[HostState] {
        &self.hosts
    }

    /// Why the rollout was stopped, in words. `None` if it was not.
    pub(super) fn stopped(&self) -> Option<&str> {
        self.stopped.as_deref()
    }

    /// The wave that is on, from 0, and since when it soaks.
    pub(super) const fn wave(&self) -> (usize, Option<Duration>) {
        (self.wave, self.soaks_since)
    }

    /// Whether nothing is left to do.
    pub(super) fn is_over(&self) -> bool {
        let is_idle = !self.hosts.iter().any(HostState::is_busy);
        let mut wave = self
            .waves
            .get(self.wave)
            .into_iter()
            .flat_map(|it| &it.hosts);
        let is_taken_back = !wave.any(|it| self.hosts[*it] == HostState::Changed);
        let is_stopped = self.stopped.is_some() && is_taken_back;
        is_idle && (self.wave == self.waves.len() || is_stopped)
    }

    /// Takes what happened on a host.
    pub(super) fn handle(&mut self, now: Duration, host: usize, event: Event) {
        match event {
            Event::Changed => self.hosts[host] = HostState::Changed,
            Event::TakenBack(result) => self.hosts[host] = HostState::TakenBack(result),
            Event::Failed(why) => {
                self.stop(format!("host {host}: {why}"));
                self.hosts[host] = HostState::Failed(why);
            }
            Event::Deferred => self.hosts[host] = HostState::Deferred,
            Event::Blocked(why) => self.hosts[host] = HostState::Blocked(why),
            Event::Seen(sight) => self.see(now, host, sight),
        }
    }

    fn see(&mut self, now: Duration, host: usize, sight: Sight) {
        if let Some(in_flight) = sight.in_flight {
            self.in_flight[host] = in_flight;
            match &mut self.hosts[host] {
                HostState::Recalled { .. } if in_flight == 0 => {
                    self.hosts[host] = HostState::Waiting;
                }
                HostState::Recalled { away_since } => *away_since = None,
                HostState::Waiting if in_flight > 0 => self.hosts[host] = HostState::Deferred,
                _ => {}
            }
        } else if let HostState::Recalled { away_since } = &mut self.hosts[host] {
            let since = *away_since.get_or_insert(now);
            if now.saturating_sub(since) >= AWAY_MAX {
                let why = "lost while its drones were called down".to_owned();
                self.hosts[host] = HostState::Blocked(why);
                // They land, and no longer count as drones that fly on.
                self.in_flight[host] = 0;
            }
        }
        let Some(wave) = self.waves.get(self.wave) else {
            return;
        };
        if !wave.hosts.contains(&host) || !matches!(self.hosts[host], HostState::Changed) {
            return;
        }
        let floods = sight.dropped_per_s > wave.dropped_per_s_max;
        let flood = || format!("drops {:.0} frames a second", sight.dropped_per_s);
        let complaint = sight.complaint.or_else(|| floods.then(flood));
        match complaint {
            None => self.unhealthy_since[host] = None,
            Some(words) => {
                let since = *self.unhealthy_since[host].get_or_insert(now);
                if now.saturating_sub(since) >= RELAPSE_MAX {
                    self.stop(format!("host {host}: {words}"));
                }
            }
        }
    }

    fn stop(&mut self, why: String) {
        self.stopped.get_or_insert(why);
    }

    /// What to do now. Call it after each event, and at least once a second.
    pub(super) fn poll(&mut self, now: Duration) -> Vec<Action> {
        if self.stopped.is_some() {
            return self.take_back();
        }
        while let Some(wave) = self.waves.get(self.wave).cloned() {
            let actions = self.advance(&wave);
            let is_busy = wave.hosts.iter().any(|nth| self.hosts[*nth].is_busy());
            if is_busy || !actions.is_empty() {
                self.soaks_since = None;
                return actions;
            }
            let was_changed = wave
                .hosts
                .iter()
                .any(|it| self.hosts[*it] == HostState::Changed);
            if was_changed {
                let since = *self.soaks_since.get_or_insert(now);
                let is_well = wave
                    .hosts
                    .iter()
                    .all(|it| self.unhealthy_since[*it].is_none());
                if now.saturating_sub(since) < wave.soak || !is_well {
                    return Vec::new();
                }
            }
            let has_release =
                |it: &usize| matches!(self.hosts[*it], HostState::Changed | HostState::Unchanged);
            if !wave.hosts.iter().any(has_release) && self.wave + 1 < self.waves.len() {
                self.stop("no host of the wave could be changed".to_owned());
                return Vec::new();
            }
            self.soaks_since = None;
            self.wave += 1;
        }
        Vec::new()
    }

    /// Starts as many hosts of the wave as may be changed at once, then calls drones down, a host at a time. Hosts that wait
    /// for what does not come are left out.
    fn advance(&mut self, wave: &Wave) -> Vec<Action> {
        let mut actions = Vec::new();
        let busy = wave
            .hosts
            .iter()
            .filter(|nth| self.hosts[**nth].is_busy())
            .count();
        let waiting: Vec<_> = wave
            .hosts
            .iter()
            .copied()
            .filter(|nth| self.hosts[*nth] == HostState::Waiting)
            .collect();
        let may_begin = waiting.iter().filter(|nth| self.lacks(**nth).is_none());
        let next: Vec<_> = may_begin
            .copied()
            .take(wave.at_once.saturating_sub(busy))
            .collect();
        for host in next {
            self.hosts[host] = HostState::Changing;
            actions.push(Action::Change(host));
        }
        if busy == 0 && actions.is_empty() {
            actions.extend(self.recall(wave));
        }
        if busy == 0 && actions.is_empty() {
            for host in waiting {
                if let Some(why) = self.lacks(host) {
                    self.hosts[host] = HostState::Blocked(why.to_owned());
                }
            }
        }
        actions
    }

    /// What a host waits for, in words: another host that has not been changed and still has a drone of it.
    fn lacks(&self, host: usize) -> Option<&str> {
        let mut others = self.waits_for[host].iter();
        let lacking = others.find(|(other, _)| self.hosts[**other] != HostState::Changed);
        lacking.map(|(_, why)| why.as_str())
    }

    /// Calls down the drones of one host, if enough others fly.
    fn recall(&mut self, wave: &Wave) -> Option<Action> {
        let keep = self.keep_flying?;
        let flying: usize = self.in_flight.iter().sum();
        let may = |nth: &&usize| {
            self.hosts[**nth] == HostState::Deferred && flying >= keep + self.in_flight[**nth]
        };
        let host = *wave.hosts.iter().find(may)?;
        self.hosts[host] = HostState::Recalled { away_since: None };
        Some(Action::Recall(host))
    }

    /// Takes back what the wave has changed. A host that is being changed is waited for.
    fn take_back(&mut self) -> Vec<Action> {
        let Some(wave) = self.waves.get(self.wave) else {
            return Vec::new();
        };
        let mut actions = Vec::new();
        for &host in &wave.hosts {
            match self.hosts[host] {
                HostState::Changed => {
                    self.hosts[host] = HostState::TakingBack;
                    actions.push(Action::TakeBack(host));
                }
                HostState::Recalled { .. } => self.hosts[host] = HostState::Deferred,
                _ => {}
            }
        }
        actions
    }
}

impl HostState {
    /// Whether something is being done with it.
    const fn is_busy(&self) -> bool {
        matches!(
            self,
            Self::Changing | Self::TakingBack | Self::Recalled { .. }
        )
    }
}

#[cfg(test)]
mod tests;
