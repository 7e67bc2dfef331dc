use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::tests::neighbourhood::{Neighbourhood, member, with_route};
use super::*;
use crate::routing::{Reception, Tree};

const REPAIR: Duration = Duration::from_millis(8);

fn config() -> Config {
    Config {
        id: NodeId(1),
        drones: 16,
        relays: 0,
        heartbeat_period: Neighbourhood::HEARTBEAT_PERIOD,
        landing_period: Neighbourhood::HEARTBEAT_PERIOD * 4,
        repair: REPAIR,
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        route_timeout: Duration::from_secs(10),
    }
}

/// Drone 1 with parent 0, which sends once per heartbeat period, and, unless it is alone, with child 2.
struct Child {
    near: Neighbourhood,
    shared: SharedState,
    rng: ChaCha8Rng,
    /// Whether a loss burst is going on, and when that changes.
    burst: (bool, Timestamp),
    /// Mean time between two bursts.
    gap_ms: f64,
}

/// Mean duration of a burst.
const BURST_MS: f64 = 20.0;

impl Child {
    fn new(seed: u64) -> Self {
        let mut child = Self::alone(seed);
        let subtree = Tree {
            parent: Some(NodeId(1)),
            ..with_route(2, 64, 0)
        };
        child.near.receive_well(2, &subtree);
        child
    }

    fn alone(seed: u64) -> Self {
        Self {
            near: Neighbourhood::of(1),
            shared: member(1),
            rng: ChaCha8Rng::seed_from_u64(seed),
            burst: (false, Timestamp::ZERO),
            gap_ms: 180.0,
        }
    }

    /// Receives the parent's heartbeats, lost by `is_lost`. The parent reports the same loss for the child's frames.
    fn receive_parent(&mut self, heartbeats: u32, mut is_lost: impl FnMut(&mut Self) -> bool) {
        let mut recent = 0.0;
        for heartbeat in 1..=heartbeats {
            self.near.now += Neighbourhood::HEARTBEAT_PERIOD;
            let missed = f64::from(u8::from(is_lost(self)));
            recent += (missed - recent) / 12.0;
            if is_lost(self) {
                self.near.miss(0);
                continue;
            }
            let sixteenths = f64::round((1.0 - recent) * 16.0).clamp(1.0, 16.0) as u8;
            let id = NodeId(1);
            let reception = Reception { id, sixteenths };
            self.near.receive(
                0,
                Tree {
                    weak: Some(reception)
                        .filter(|_| recent > 0.08)
                        .into_iter()
                        .collect(),
                    ..with_route(0, 0, heartbeat)
                },
            );
        }
        self.near.receive(0, with_route(0, 0, heartbeats + 1));
    }

    /// Whether a frame sent now is lost in a burst.
    fn is_in_burst(&mut self) -> bool {
        while self.burst.1 <= self.near.now {
            self.burst.0 = !self.burst.0;
            let mean = if self.burst.0 { BURST_MS } else { self.gap_ms };
            let millis = -mean * libm::log(self.rng.random_range(f64::EPSILON..1.0));
            self.burst.1 += Duration::from_nanos((millis * 1e6) as u64);
        }
        self.burst.0
    }

    /// Probes the stale parent until it answers or is dropped; returns the number of probes, their duration, and
    /// whether the parent was dropped. `is_answered` tells whether a probe is answered.
    fn probe(&mut self, mut is_answered: impl FnMut(&mut Self) -> bool) -> (u32, Duration, bool) {
        let (mut probe, begun, mut probes) = (ParentProbe::default(), self.near.now, 0);
        let config = config();
        loop {
            let route = WatchedRoute {
                parent: Some(NodeId(0)),
                stale_at: Some(begun),
                orphaned_since: None,
            };
            let due = probe.deadline(&self.shared, &self.near.links, route, &config);
            self.near.now = due.expect("a stale parent is probed or dropped");
            let times = (self.near.now, &config);
            let step = probe.step(&mut self.shared, &self.near.links, route, times);
            let elapsed = self.near.now.since(begun);
            match step.expect("a step was due") {
                ProbeStep::Probe { is_first } => {
                    assert_eq!(is_first, probes == 0);
                    probes += 1;
                    if is_answered(self) {
                        return (probes, elapsed, false);
                    }
                }
                ProbeStep::DropParent(parent) => {
                    assert_eq!(parent, NodeId(0));
                    return (probes, elapsed, true);
                }
                other => panic!("{other:?} is for drones without a parent"),
            }
        }
    }

    fn loses(&mut self, share: f64) -> bool {
        self.rng.random_bool(share)
    }
}

#[test]
fn live_parent_is_kept_at_30_percent_loss() {
    const LINKS: u64 = 300;
    let mut chance = 0.0;
    for seed in 0..LINKS {
        let mut child = Child::new(seed);
        child.receive_parent(100, |child| child.loses(0.3));
        // 100 probings each, 30,000 in all.
        for _ in 0..100 {
            let (_, _, is_dropped) = child.probe(|child| !child.loses(0.3) && !child.loses(0.3));
            assert!(!is_dropped, "link {seed}");
        }
        let (probes, _, _) = child.probe(|_| false);
        chance += libm::pow(1.0 - 0.7 * 0.7, f64::from(probes));
    }
    // One in a billion for a known loss, a bit more for an estimated one.
    let chance = chance / LINKS as f64;
    assert!(chance < 1e-6, "{chance}");
}

/// How many of 30,000 probings that start in a burst drop the live parent.
fn dropped_in_bursts(gap_ms: f64) -> u32 {
    let mut dropped = 0;
    for seed in 0..300 {
        let mut child = Child::new(seed);
        child.gap_ms = gap_ms;
        child.receive_parent(250, Child::is_in_burst);
        for _ in 0..100 {
            while !child.is_in_burst() {
                child.near.now = child.burst.1;
            }
            let answered = |child: &mut Child| !child.is_in_burst();
            dropped += u32::from(child.probe(answered).2);
            child.near.now += Duration::from_secs(1);
        }
    }
    dropped
}

#[test]
fn live_parent_is_kept_during_loss_bursts() {
    // 10 % loss: once in a few hundred thousand, if the loss is measured correctly.
    let dropped = dropped_in_bursts(180.0);
    assert!(dropped <= 2, "{dropped} of 30,000");
    // 5 % loss: less is often measured, which shortens the probing.
    let dropped = dropped_in_bursts(380.0);
    assert!(dropped <= 30, "{dropped} of 30,000");
}

#[test]
fn lost_parent_is_dropped_within_detection_max() {
    for seed in 0..20 {
        for percent in (0..100).step_by(5) {
            let mut child = Child::new(seed);
            child.receive_parent(200, |child| child.loses(f64::from(percent) / 100.0));
            let link = child.near.links.get(NodeId(0)).unwrap();
            let stale = Neighbourhood::HEARTBEAT_PERIOD * link.quality.stale_heartbeats.into();
            let (probes, took, is_dropped) = child.probe(|_| false);
            assert!(is_dropped && (1..=PROBES_MAX).contains(&probes));
            let bound =
                config().detection_max() - config().route_timeout - config().heartbeat_period;
            assert!((stale + took) * 2 <= bound, "{took:?} at {percent} %");
        }
    }
}

#[test]
fn probes_are_a_repair_apart_and_outlast_a_burst() {
    let mut child = Child::new(1);
    child.receive_parent(250, |child| child.loses(0.1));
    let mut at = Vec::new();
    let (_, took, _) = child.probe(|child| {
        at.push(child.near.now);
        false
    });
    assert!(took >= REPAIR * BURST_REPAIRS * 2 / 3, "{took:?}");
    for pair in at.windows(2) {
        assert!(pair[1].since(pair[0]) >= REPAIR);
    }
    // A lossless link has no bursts to wait for.
    let mut child = Child::new(1);
    child.receive_parent(250, |_| false);
    let (probes, took, _) = child.probe(|_| false);
    assert!((5..=7).contains(&probes) && took <= REPAIR * 2 * probes);
}

#[test]
fn heard_parent_restarts_the_probes() {
    let mut child = Child::new(1);
    child.receive_parent(100, |child| child.loses(0.3));
    let route = |stale_at| WatchedRoute {
        parent: Some(NodeId(0)),
        stale_at,
        orphaned_since: None,
    };
    let (mut probe, config) = (ParentProbe::default(), config());
    let stale_at = Some(child.near.now + Duration::from_secs(3));
    for is_first in [true, false, false] {
        let times = (child.near.now, &config);
        let step = probe.step(&mut child.shared, &child.near.links, route(stale_at), times);
        assert_eq!(step, Some(ProbeStep::Probe { is_first }));
        child.near.now += REPAIR * 2;
    }
    child.near.receive(0, with_route(0, 0, 500));
    let due = |probe: &ParentProbe, child: &Child| {
        let (shared, links) = (&child.shared, &child.near.links);
        probe.deadline(shared, links, route(stale_at), &config)
    };
    assert_eq!(due(&probe, &child), stale_at);
    let times = (child.near.now, &config);
    let step = probe.step(&mut child.shared, &child.near.links, route(stale_at), times);
    assert_eq!(step, Some(ProbeStep::Probe { is_first: true }));
}

#[test]
fn only_neighbour_gets_the_most_probes() {
    let mut child = Child::alone(1);
    child.receive_parent(250, |_| false);
    let (probes, _, is_dropped) = child.probe(|_| false);
    assert_eq!((probes, is_dropped), (PROBES_MAX, true));
}

impl Child {
    /// Runs without a route until the master is reported as silent; returns the number of inquiries and the time.
    fn report_master_silent(&mut self) -> (u32, Duration) {
        self.report_master_silent_with(ParentProbe::default())
    }

    /// Probes the parent in vain, drops it, and runs until the master is reported as silent; returns the number of
    /// inquiries since then and the time.
    fn drop_parent_and_report_master_silent(&mut self) -> (u32, Duration) {
        let (mut probe, config) = (ParentProbe::default(), config());
        let route = WatchedRoute {
            parent: Some(NodeId(0)),
            stale_at: Some(self.near.now),
            orphaned_since: None,
        };
        loop {
            let due = probe.deadline(&self.shared, &self.near.links, route, &config);
            self.near.now = due.expect("a stale parent is probed or dropped");
            let times = (self.near.now, &config);
            let step = probe.step(&mut self.shared, &self.near.links, route, times);
            if step == Some(ProbeStep::DropParent(NodeId(0))) {
                self.near.links.forget(NodeId(0));
                break;
            }
        }
        assert_eq!(probe.dropped_parent(), Some(NodeId(0)));
        self.report_master_silent_with(probe)
    }

    fn report_master_silent_with(&mut self, mut probe: ParentProbe) -> (u32, Duration) {
        let (config, begun) = (config(), self.near.now);
        let route = WatchedRoute {
            parent: None,
            stale_at: None,
            orphaned_since: Some(begun),
        };
        let mut inquiries = 0;
        loop {
            let due = probe.deadline(&self.shared, &self.near.links, route, &config);
            self.near.now = due.unwrap();
            let times = (self.near.now, &config);
            match probe.step(&mut self.shared, &self.near.links, route, times) {
                Some(ProbeStep::Inquire) => inquiries += 1,
                Some(ProbeStep::ReportMasterSilent) => break,
                other => panic!("{other:?}"),
            }
        }
        self.shared.report_master_silent();
        let due = probe.deadline(&self.shared, &self.near.links, route, &config);
        assert_eq!(due, None, "the master is reported already");
        (inquiries, self.near.now.since(begun))
    }
}

#[test]
fn drone_waits_one_heartbeat_and_does_not_ask_if_its_neighbours_lost_their_routes_too() {
    let mut child = Child::new(1);
    child.near.receive(3, Tree::default());
    let took = config().route_timeout + config().heartbeat_period;
    assert_eq!(child.report_master_silent(), (0, took));
}

#[test]
fn dropped_parent_is_asked_until_master_is_silent() {
    for loss in [0.0, 0.3] {
        let mut child = Child::new(1);
        child.receive_parent(250, |child| child.loses(loss));
        child.near.receive(3, Tree::default());
        let (inquiries, took) = child.drop_parent_and_report_master_silent();
        assert_eq!(took, config().route_timeout);
        assert_inquires_all_the_time(inquiries, took);
    }
}

#[test]
fn drone_that_lost_its_only_neighbour_probes_longer_before_it_misses_the_master() {
    let mut child = Child::alone(1);
    child.receive_parent(250, |_| false);
    let stale_at = child.near.now;
    let (inquiries, took) = child.drop_parent_and_report_master_silent();
    assert_eq!(took, config().route_timeout + config().probing_max());
    assert_inquires_all_the_time(inquiries, took);
    let stale = config().heartbeat_period * STALE_HEARTBEATS_MAX.into();
    assert!(stale + child.near.now.since(stale_at) <= config().detection_max());
}

#[test]
fn restarted_drone_waits_longer_for_a_route() {
    let mut probe = ParentProbe::default();
    probe.resume();
    let (_, took) = Child::alone(1).report_master_silent_with(probe);
    assert_eq!(took, config().route_timeout + config().probing_max());
    assert!(took <= config().detection_max());
}

/// The pause between inquiries is one to two repair intervals at first, and later grows with the time without a route.
fn assert_inquires_all_the_time(inquiries: u32, took: Duration) {
    let back_off = f64::from(INQUIRY_BACK_OFF);
    let later = back_off * libm::log(took.div_duration_f64(REPAIR) / back_off);
    let expected = (back_off + later) / 1.5;
    assert!(
        (f64::from(inquiries) / expected - 1.0).abs() < 0.2,
        "{inquiries} for {expected}"
    );
}

#[test]
fn only_neighbour_is_asked_until_master_is_silent() {
    let mut child = Child::alone(1);
    child.near.receive(0, Tree::default());
    let (inquiries, took) = child.report_master_silent();
    let expected = config().route_timeout + config().heartbeat_period;
    assert_eq!(took, expected, "the neighbour has no route");
    assert_inquires_all_the_time(inquiries, took);
}

#[test]
fn drone_without_route_waits_one_heartbeat_if_neighbours_have_routes() {
    let mut child = Child::new(1);
    for sibling in [3, 4] {
        child.near.receive(sibling, with_route(1, 500, 7));
    }
    let missed = child.report_master_silent();
    assert_eq!(
        missed,
        (
            INQUIRIES,
            config().route_timeout + config().heartbeat_period
        )
    );
}

#[test]
fn drone_that_dropped_its_parent_waits_one_heartbeat_if_others_have_routes() {
    let heartbeat = config().heartbeat_period;
    for (parent, waits) in [(2, heartbeat), (0, Duration::ZERO)] {
        let mut child = Child::new(1);
        child.receive_parent(250, |_| false);
        for other in [3, 4] {
            child.near.receive(other, with_route(1, 500, 7));
        }
        let probe = ParentProbe {
            dropped_parent: Some(NodeId(parent)),
            ..ParentProbe::default()
        };
        child.near.links.forget(NodeId(0));
        let (_, took) = child.report_master_silent_with(probe);
        assert_eq!(took, config().route_timeout + waits, "drone {parent}");
    }
}

#[test]
fn only_neighbour_with_a_route_is_asked_all_the_time() {
    let mut child = Child::new(1);
    child.near.receive(3, with_route(1, 500, 7));
    let (inquiries, took) = child.report_master_silent();
    assert_eq!(took, config().route_timeout + config().heartbeat_period);
    assert_inquires_all_the_time(inquiries, took);
}

#[test]
fn drone_waits_until_its_only_neighbour_may_have_probed() {
    let mut child = Child::alone(1);
    child.receive_parent(10, |_| false);
    let (_, took) = child.report_master_silent();
    let heartbeats = config().heartbeat_period * STALE_HEARTBEATS_MAX.into();
    assert_eq!(took, config().route_timeout + heartbeats);
    assert!(
        Neighbourhood::HEARTBEAT_PERIOD * STALE_HEARTBEATS_MAX.into() + took
            <= config().detection_max()
    );
}
