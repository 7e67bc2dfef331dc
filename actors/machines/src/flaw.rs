//! Guards of the protocol that can be taken out on purpose, one at a time, to see that a scenario finds it.
//!
//! Only the feature `flaws` makes that possible, and only tests switch it on. Without it every guard is known to be in
//! when a machine is compiled, so that nothing of a flaw is left in whatever flies.

/// A guard that is taken out: what a drone does wrong without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flaw {
    /// Nobody mends an actor that has failed or hangs.
    LeavesWhatFails,
    /// A master hears that a member is back and does not wait for it.
    OverlooksWhoReturns,
    /// A master, by policy `tree`, does not turn to a better ballot.
    NeverStepsDown,
    /// Whoever hears of another ballot turns to it, better or not.
    ObeysAnyMaster,
    /// Frames of another swarm are let in.
    HeedsOtherSwarms,
    /// Frames are let in that are not signed by the sender that they name.
    BelievesAnySender,
    /// On the way to a waypoint nobody looks whether the master lives.
    MissesMasterAtWaypointsOnly,
    /// A master waits for whoever does not get ready, on the ground too, for as long as that takes.
    WaitsForEver,
    /// All drones have the same landing place.
    LandsOnOnePoint,
    /// A ring of a compact matrix has the places of the rings within it once more.
    RepeatsPlaces,
    /// Drones that are left over when clusters are of the same size have no slot.
    DropsRemainder,
    /// A cluster is as far out along an axis as it is to be in all, and so farther out on a diagonal.
    StretchesDiagonals,
    /// Who stands where on the ground goes by numbers, and not by the way to the slot.
    TakesSlotsByNumber,
    /// Whoever repeats the master's number proves that the master lives.
    CountsEchoes,
    /// A master does not wait for the member with the highest number.
    ForgetsOneMember,
    /// What is kept of a mission is not, once its master was elected.
    LosesCheckpoints,
    /// Nobody takes to a layer of its own.
    ForgetsLayers,
    /// A drone takes off at the height of its slot, not in its layer.
    TakesOffInOneLayer,
    /// A drone goes to land at the height of the last waypoint, not in its layer.
    GoesToLandInOneLayer,
    /// A drone crosses to its new slot at the height of the waypoint, not in its sector.
    CrossesInOneSector,
    /// A neighbour that does not hear a drone leads it all the same.
    ObeysOneWayNeighbours,
    /// Frames of a sender's earlier lives are let in.
    AcceptsEarlierLives,
    /// A radio that was started anew lets frames in of senders that have not signed its nonce.
    BelievesTheUnproven,
    /// Of two ballots of masters that were elected the worse one wins.
    TurnsToWorseBallots,
    /// A master that was elected opens again the waypoint that the swarm is at.
    ReopensWaypoints,
    /// A drone that goes to land alone follows orders again.
    RejoinsWhileLanding,
    /// A drone that has lost its master never leads.
    NeverClaims,
    /// Routes go by hops, however much their links lose.
    RoutesByHops,
    /// A drone takes a parent however far the route is that it announces.
    TakesFartherParents,
    /// A mission does nothing when it is to take over from a silent master, and asks to be woken for that again.
    DeadlineInThePast,
}

#[cfg(feature = "flaws")]
pub use planted::{Planted, plant};

#[cfg(feature = "flaws")]
pub(crate) use planted::has;

/// Whether this guard is out: never.
#[cfg(not(feature = "flaws"))]
pub(crate) const fn has(_: Flaw) -> bool {
    false
}

#[cfg(feature = "flaws")]
mod planted {
    use std::cell::Cell;
    use std::marker::PhantomData;

    use super::Flaw;

    thread_local! {
        static PLANTED: Cell<Option<Flaw>> = const { Cell::new(None) };
    }

    /// A guard is out for as long as this is kept, on the thread that took it out.
    #[derive(Debug)]
    #[must_use = "the guard is there again once this is dropped"]
    pub struct Planted(PhantomData<*const ()>);

    /// Takes a guard out, for all machines on this thread, and puts in the one that was out. Either engine runs a
    /// simulation on the thread that asks for it; a campaign does so on threads of its own, where all guards are in.
    pub fn plant(flaw: Flaw) -> Planted {
        PLANTED.set(Some(flaw));
        Planted(PhantomData)
    }

    impl Drop for Planted {
        fn drop(&mut self) {
            PLANTED.set(None);
        }
    }

    /// Whether this guard is out.
    pub(crate) fn has(flaw: Flaw) -> bool {
        PLANTED.get() == Some(flaw)
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn a_guard_is_out_until_it_is_dropped_and_on_one_thread_only() {
            let planted = plant(Flaw::NeverStepsDown);
            assert!(has(Flaw::NeverStepsDown) && !has(Flaw::WaitsForEver));
            let elsewhere = std::thread::spawn(|| has(Flaw::NeverStepsDown));
            assert!(!elsewhere.join().unwrap());
            drop(planted);
            assert!(!has(Flaw::NeverStepsDown));
        }
    }
}
