//! Flaws that tests plant: each disables one guard of the protocol, to check that a scenario detects it.
//!
//! Only the feature `flaws` allows that, and only tests of this crate, of muster-scenarios and of muster-experiments enable it.
//! Without it `has` is a constant, so flight code contains no flaw.

/// What a drone does wrong while a guard is disabled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flaw {
    /// Failed or hung actors are not restarted.
    IgnoresFailedActors,
    /// A master does not wait for a member that has returned.
    IgnoresReturnedMembers,
    /// A master with policy `tree` does not adopt a better ballot.
    NeverStepsDown,
    /// A drone adopts any other ballot, better or worse.
    FollowsAnyBallot,
    /// Frames of other swarms are accepted.
    AcceptsOtherSwarms,
    /// Frames without a valid signature of their sender are accepted.
    SkipsSignatureCheck,
    /// A lost master is not detected on a leg.
    DetectsMasterLossAtWaypointsOnly,
    /// A master waits without limit for members that do not get ready, on the ground, too.
    WaitsForever,
    /// All drones have the same landing place.
    LandsOnOnePoint,
    /// A ring of a compact matrix contains the places of its inner rings again.
    RepeatsInnerRings,
    /// Drones that do not fill a cluster have no slot.
    DropsRemainder,
    /// The distance of a cluster applies to each axis, so clusters on a diagonal are farther out.
    StretchesDiagonals,
    /// Places on the ground are assigned by id, not by the distance to the slot.
    AssignsSlotsById,
    /// A repeated heartbeat sequence counts as proof that the master lives.
    AcceptsRepeatedHeartbeats,
    /// A master does not wait for the member with the highest id.
    IgnoresLastMember,
    /// The mission of an elected master stores no checkpoints.
    LosesCheckpoints,
    /// No drone moves to its own altitude layer.
    SkipsLayers,
    /// A drone takes off at the altitude of its slot, not in its layer.
    TakesOffInOneLayer,
    /// A drone flies to its landing place at the altitude of the last waypoint, not in its layer.
    FliesToLandingInOneLayer,
    /// A drone crosses to its new slot at the altitude of the waypoint, not in its sector.
    CrossesInOneSector,
    /// A neighbour that does not hear a drone may still change its leader.
    AcceptsOneWayLinks,
    /// Frames of a sender's earlier incarnations are accepted.
    AcceptsEarlierIncarnations,
    /// A restarted radio accepts frames of senders that have not signed its nonce.
    SkipsFreshnessProof,
    /// Of two elected ballots the worse one wins.
    PrefersWorseBallots,
    /// An elected master opens the current waypoint again.
    ReopensWaypoints,
    /// A drone that lands alone follows orders again.
    RejoinsWhileLanding,
    /// A drone that has lost its master never claims leadership.
    NeverClaims,
    /// Routes are chosen by hops, whatever their links lose.
    RoutesByHops,
    /// A drone takes a parent without checking the feasibility condition.
    SkipsFeasibilityCondition,
    /// A mission that should replace a silent master does nothing and sets a deadline in the past.
    SetsPastDeadline,
}

#[cfg(any(test, feature = "flaws"))]
pub use planted::{Planted, plant};

#[cfg(any(test, feature = "flaws"))]
pub(crate) use planted::has;

/// Whether this flaw is planted: never.
#[cfg(not(any(test, feature = "flaws")))]
pub(crate) const fn has(_: Flaw) -> bool {
    false
}

#[cfg(any(test, feature = "flaws"))]
mod planted {
    use std::cell::Cell;
    use std::marker::PhantomData;

    use super::Flaw;

    thread_local! {
        static PLANTED: Cell<Option<Flaw>> = const { Cell::new(None) };
    }

    /// Keeps a flaw planted on its thread until it is dropped.
    #[derive(Debug)]
    #[must_use = "dropping it removes the flaw"]
    pub struct Planted(PhantomData<*const ()>);

    /// Plants a flaw for all machines on this thread; replaces the one before. Both engines run a simulation on the
    /// calling thread. A campaign uses its own threads, which have no flaw.
    pub fn plant(flaw: Flaw) -> Planted {
        PLANTED.set(Some(flaw));
        Planted(PhantomData)
    }

    impl Drop for Planted {
        fn drop(&mut self) {
            PLANTED.set(None);
        }
    }

    /// Whether this flaw is planted on this thread.
    pub(crate) fn has(flaw: Flaw) -> bool {
        PLANTED.get() == Some(flaw)
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn flaw_is_planted_on_one_thread_until_dropped() {
            let planted = plant(Flaw::NeverStepsDown);
            assert!(has(Flaw::NeverStepsDown) && !has(Flaw::WaitsForever));
            let elsewhere = std::thread::spawn(|| has(Flaw::NeverStepsDown));
            assert!(!elsewhere.join().unwrap());
            drop(planted);
            assert!(!has(Flaw::NeverStepsDown));
        }
    }
}
