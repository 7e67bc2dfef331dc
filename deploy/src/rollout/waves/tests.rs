use proptest::prelude::*;

use super::*;

fn wave(hosts: &[usize], at_once: usize) -> Wave {
    Wave {
        hosts: hosts.to_vec(),
        at_once,
        soak: Duration::from_secs(10),
        dropped_per_s_max: 10.0,
    }
}

/// A canary, then two hosts, then two hosts.
fn waves() -> Vec<Wave> {
    vec![wave(&[0], 1), wave(&[1, 2], 2), wave(&[3, 4], 1)]
}

fn well(in_flight: usize) -> Event {
    Event::Seen(Sight {
        in_flight: Some(in_flight),
        complaint: None,
        dropped_per_s: 0.0,
    })
}

fn ill() -> Event {
    Event::Seen(Sight {
        in_flight: Some(0),
        complaint: Some("drone 0: an actor hangs".to_owned()),
        dropped_per_s: 0.0,
    })
}

fn away() -> Event {
    Event::Seen(Sight {
        in_flight: None,
        complaint: Some("no connection".to_owned()),
        dropped_per_s: 0.0,
    })
}

/// Hosts that do as they are told: what they do with a release, and what was asked of them.
struct Fleet {
    /// Hosts that are lost once their drones are called down.
    lost_at_recall: Vec<usize>,
    rollout: Rollout,
    now: Duration,
    /// Hosts on which the release fails its trial.
    bad: Vec<usize>,
    /// Hosts that look ill once they have the release, and since when.
    ill_after: Vec<(usize, Duration)>,
    flying: Vec<usize>,
    actions: Vec<Action>,
    /// Fewest drones in flight at any time.
    fewest_flying: usize,
}

impl Fleet {
    fn new(states: &[HostState; 5], flying: [usize; 5], keep_flying: Option<usize>) -> Self {
        let rollout = Rollout::new(
            waves(),
            states.to_vec(),
            flying.to_vec(),
            vec![BTreeMap::new(); 5],
            keep_flying,
        );
        Self {
            rollout,
            now: Duration::ZERO,
            lost_at_recall: Vec::new(),
            bad: Vec::new(),
            ill_after: Vec::new(),
            fewest_flying: flying.iter().sum(),
            flying: flying.to_vec(),
            actions: Vec::new(),
        }
    }

    fn waiting() -> Self {
        Self::new(&[const { HostState::Waiting }; 5], [0; 5], None)
    }

    /// Until the rollout is over: each second all hosts are seen, and what was begun ends.
    fn run(mut self) -> Self {
        let mut changed_at = [Duration::MAX; 5];
        for _ in 0..1_000 {
            let actions = self.rollout.poll(self.now);
            self.actions.extend(&actions);
            self.now += Duration::from_secs(1);
            for action in actions {
                let (host, event) = match action {
                    Action::Change(host) if self.bad.contains(&host) => {
                        (host, Event::Failed("crashed".to_owned()))
                    }
                    Action::Change(host) => {
                        assert_eq!(self.flying[host], 0, "a host in flight is changed");
                        changed_at[host] = self.now;
                        (host, Event::Changed)
                    }
                    Action::TakeBack(host) => (host, Event::TakenBack(Ok(()))),
                    Action::Recall(host) => {
                        self.flying[host] = 0;
                        let flying = self.flying.iter().sum();
                        self.fewest_flying = self.fewest_flying.min(flying);
                        continue;
                    }
                };
                self.rollout.handle(self.now, host, event);
            }
            for (host, changed_at) in changed_at.iter().enumerate() {
                let is_ill = self.ill_after.iter().any(|(nth, after)| {
                    *nth == host && self.now.saturating_sub(*after) >= *changed_at
                });
                let is_lost = self.lost_at_recall.contains(&host)
                    && self.actions.contains(&Action::Recall(host));
                let event = if is_lost {
                    away()
                } else if is_ill {
                    ill()
                } else {
                    well(self.flying[host])
                };
                self.rollout.handle(self.now, host, event);
            }
            if self.rollout.is_over() {
                return self;
            }
        }
        panic!("the rollout does not end: {:?}", self.rollout);
    }

    fn assert_all_changed(&self) {
        let mut hosts = self.rollout.hosts().iter();
        assert!(hosts.all(|it| *it == HostState::Changed));
    }

    fn position(&self, action: Action) -> Option<usize> {
        self.actions.iter().position(|it| *it == action)
    }
}

#[test]
fn each_wave_soaks_before_the_next() {
    let fleet = Fleet::waiting().run();
    fleet.assert_all_changed();
    let changes: Vec<_> = (0..5).map(Action::Change).collect();
    assert_eq!(fleet.actions, changes);
    assert!(
        fleet.now >= Duration::from_secs(30),
        "three soaks: {:?}",
        fleet.now
    );
}

#[test]
fn canary_that_fails_stops_the_rollout() {
    let mut fleet = Fleet::waiting();
    fleet.bad = vec![0];
    let fleet = fleet.run();
    assert_eq!(fleet.actions, [Action::Change(0)]);
    assert_eq!(fleet.rollout.stopped(), Some("host 0: crashed"));
    assert_eq!(fleet.rollout.hosts()[4], HostState::Waiting);
}

#[test]
fn wave_is_taken_back_whole_and_the_one_before_is_kept() {
    let mut fleet = Fleet::waiting();
    fleet.ill_after = vec![(2, Duration::from_secs(3))];
    let fleet = fleet.run();
    let hosts = fleet.rollout.hosts();
    assert_eq!(hosts[0], HostState::Changed);
    for host in [1, 2] {
        assert_eq!(hosts[host], HostState::TakenBack(Ok(())));
    }
    assert_eq!(fleet.position(Action::Change(3)), None);
    assert_eq!(
        fleet.rollout.stopped(),
        Some("host 2: drone 0: an actor hangs")
    );
}

#[test]
fn flood_of_dropped_frames_fails_the_gate() {
    let mut rollout = Fleet::waiting().rollout;
    assert_eq!(rollout.poll(Duration::ZERO), [Action::Change(0)]);
    rollout.handle(Duration::ZERO, 0, Event::Changed);
    for second in 0..6 {
        let sight = Sight {
            in_flight: Some(0),
            complaint: None,
            dropped_per_s: 11.0,
        };
        let at = Duration::from_secs(second);
        rollout.handle(at, 0, Event::Seen(sight));
        let is_late = second >= 5;
        let expected: &[Action] = if is_late { &[Action::TakeBack(0)] } else { &[] };
        assert_eq!(rollout.poll(at), expected, "second {second}");
    }
}

#[test]
fn host_in_flight_is_left_alone_and_a_wave_of_such_hosts_stops_the_rollout() {
    let mut states = [const { HostState::Waiting }; 5];
    states[2] = HostState::Deferred;
    let fleet = Fleet::new(&states, [0, 0, 1, 0, 0], None).run();
    assert_eq!(fleet.position(Action::Change(2)), None);
    assert_eq!(fleet.rollout.hosts()[4], HostState::Changed);
    let fleet = Fleet::new(&[const { HostState::Deferred }; 5], [1; 5], None).run();
    assert_eq!(fleet.actions, []);
    assert_eq!(
        fleet.rollout.stopped(),
        Some("no host of the wave could be changed")
    );
}

#[test]
fn recall_takes_hosts_one_at_a_time_and_keeps_the_stated_number_flying() {
    for keep in 0..=5 {
        let states = [const { HostState::Deferred }; 5];
        let fleet = Fleet::new(&states, [1; 5], Some(keep)).run();
        assert!(
            fleet.fewest_flying >= keep,
            "{keep}: {}",
            fleet.fewest_flying
        );
        let recalls = fleet
            .actions
            .iter()
            .filter(|it| matches!(it, Action::Recall(_)));
        assert_eq!(recalls.count(), 5 - keep, "keep {keep}");
        for host in 0..5 - keep {
            let (recalled, changed) = (
                fleet.position(Action::Recall(host)),
                fleet.position(Action::Change(host)),
            );
            assert!(recalled < changed, "{:?}", fleet.actions);
            let next = fleet.position(Action::Recall(host + 1));
            assert!(
                next.is_none_or(|next| Some(next) > changed),
                "one at a time"
            );
        }
    }
}

#[test]
fn host_that_is_lost_while_its_drones_are_called_down_is_left_out() {
    let mut states = [const { HostState::Waiting }; 5];
    for host in [1, 2] {
        states[host] = HostState::Deferred;
    }
    let mut fleet = Fleet::new(&states, [0, 1, 1, 0, 0], Some(0));
    fleet.lost_at_recall = vec![1];
    let fleet = fleet.run();
    let lost = "lost while its drones were called down".to_owned();
    assert_eq!(fleet.rollout.hosts()[1], HostState::Blocked(lost));
    for host in [0, 2, 3, 4] {
        assert_eq!(fleet.rollout.hosts()[host], HostState::Changed, "{host}");
    }
    // Its drones are not counted as flying while others are called down.
    let mut fleet = Fleet::new(&states, [0, 1, 1, 0, 0], Some(1));
    fleet.lost_at_recall = vec![1];
    assert_eq!(fleet.run().position(Action::Recall(2)), None);
}

#[test]
fn host_that_is_seen_again_while_its_drones_are_called_down_is_changed() {
    let mut states = [const { HostState::Unchanged }; 5];
    states[0] = HostState::Deferred;
    let mut rollout = Fleet::new(&states, [1, 0, 0, 0, 0], Some(0)).rollout;
    assert_eq!(rollout.poll(Duration::ZERO), [Action::Recall(0)]);
    for (at, event) in [(0, away()), (89, well(1)), (90, away()), (179, well(0))] {
        rollout.handle(Duration::from_secs(at), 0, event);
    }
    let now = Duration::from_secs(179);
    assert_eq!(rollout.poll(now), [Action::Change(0)]);
}

#[test]
fn resumed_rollout_continues_behind_what_is_done() {
    let mut states = [const { HostState::Waiting }; 5];
    (states[0], states[1]) = (HostState::Unchanged, HostState::Unchanged);
    let fleet = Fleet::new(&states, [0; 5], None).run();
    assert_eq!(fleet.actions, [2, 3, 4].map(Action::Change));
}

#[test]
fn host_that_loses_a_drone_is_changed_before_the_one_that_gets_it() {
    let mut fleet = Fleet::waiting();
    fleet.rollout.waits_for[1] = BTreeMap::from([(2, "drone 1 runs on c".to_owned())]);
    let fleet = fleet.run();
    assert!(fleet.position(Action::Change(2)) < fleet.position(Action::Change(1)));
    fleet.assert_all_changed();
}

#[test]
fn host_is_left_out_if_its_drone_does_not_leave_the_other_host() {
    // It is in a later wave.
    let mut fleet = Fleet::waiting();
    fleet.rollout.waits_for[1] = BTreeMap::from([(3, "drone 1 runs on d".to_owned())]);
    let fleet = fleet.run();
    let blocked = HostState::Blocked("drone 1 runs on d".to_owned());
    assert_eq!(fleet.rollout.hosts()[1], blocked);
    assert_eq!(fleet.position(Action::Change(1)), None);
    // Each has a drone of the other.
    let mut fleet = Fleet::waiting();
    for (host, other) in [(1, 2), (2, 1)] {
        fleet.rollout.waits_for[host] = BTreeMap::from([(other, "it runs there".to_owned())]);
    }
    let fleet = fleet.run();
    assert!(matches!(fleet.rollout.hosts()[2], HostState::Blocked(_)));
    assert_eq!(fleet.position(Action::Change(1)), None);
}

#[test]
fn take_off_defers_a_host_and_does_not_stop_the_rollout() {
    let mut rollout = Fleet::waiting().rollout;
    rollout.handle(Duration::ZERO, 1, well(1));
    assert_eq!(rollout.hosts()[1], HostState::Deferred, "seen in time");
    assert_eq!(rollout.poll(Duration::ZERO), [Action::Change(0)]);
    rollout.handle(Duration::ZERO, 0, Event::Changed);
    let soaked = Duration::from_secs(10);
    rollout.poll(Duration::ZERO);
    assert_eq!(rollout.poll(soaked), [Action::Change(2)]);
    rollout.handle(soaked, 2, Event::Deferred);
    assert_eq!(rollout.hosts()[2], HostState::Deferred, "seen by the host");
    assert_eq!(rollout.stopped(), None);
}

#[test]
fn host_that_is_lost_or_locked_is_left_out() {
    let mut rollout = Fleet::waiting().rollout;
    assert_eq!(rollout.poll(Duration::ZERO), [Action::Change(0)]);
    rollout.handle(Duration::ZERO, 0, Event::Changed);
    rollout.poll(Duration::ZERO);
    let soaked = Duration::from_secs(10);
    assert_eq!(rollout.poll(soaked), [Action::Change(1), Action::Change(2)]);
    rollout.handle(soaked, 1, Event::Blocked("no connection".to_owned()));
    rollout.handle(soaked, 2, Event::Changed);
    rollout.poll(soaked);
    assert_eq!(rollout.poll(2 * soaked), [Action::Change(3)]);
    assert_eq!(rollout.stopped(), None);
}

proptest! {
    /// Whatever hosts do: at most so many at once, no wave before the last one has soaked, and an end.
    #[test]
    fn no_wave_begins_before_the_last_one_is_good(
        bad in prop::collection::vec(0_usize..5, 0..3),
        ill in prop::collection::vec((0_usize..5, 0_u64..20), 0..3),
        deferred in prop::collection::vec(0_usize..5, 0..3),
    ) {
        let mut states = [const { HostState::Waiting }; 5];
        let mut flying = [0; 5];
        for host in deferred {
            (states[host], flying[host]) = (HostState::Deferred, 1);
        }
        let mut fleet = Fleet::new(&states, flying, None);
        fleet.bad = bad;
        fleet.ill_after = ill.into_iter().map(|(host, s)| (host, Duration::from_secs(s))).collect();
        let fleet = fleet.run();
        let begun = |hosts: &[usize]| hosts.iter().any(|it| fleet.position(Action::Change(*it)).is_some());
        let hosts = fleet.rollout.hosts();
        if begun(&[1, 2]) {
            prop_assert_eq!(&hosts[0], &HostState::Changed);
        }
        if begun(&[3, 4]) {
            prop_assert!(hosts[1] == HostState::Changed || hosts[2] == HostState::Changed);
            prop_assert!(!matches!(&hosts[1], HostState::Failed(_)) && !matches!(&hosts[2], HostState::Failed(_)));
        }
        if fleet.rollout.stopped().is_none() {
            prop_assert!(!hosts.contains(&HostState::Waiting));
        } else {
            let wave = &waves()[fleet.rollout.wave().0];
            prop_assert!(wave.hosts.iter().all(|it| hosts[*it] != HostState::Changed));
        }
    }
}
