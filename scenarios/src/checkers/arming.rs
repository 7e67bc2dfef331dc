use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::{Event, Input, Order, State};
use muster_machines::msp::FlightCommand;
use muster_machines::node::{Address, Envelope};
use muster_machines::routing::Notice;
use muster_machines::time::Timestamp;
use muster_machines::wire;

use super::Violation;

/// Rule 6: no drone arms or takes off because something restarted.
///
/// What is checked:
/// - A drone begins to take off only if it has been told to: the master by the operator, who tells it to fly; any other
///   by an order to take off, under the ballot of a master that the operator chose, not of one that was elected.
/// - A mission that was restarted on the ground has forgotten the order and must be told again, by its routing; that
///   the operator told the master to fly outlives it.
/// - A vehicle is told to arm only while its drone takes off, or flies on after that, and never again once the drone has
///   begun to land: so once a flight, whatever is restarted in the air.
/// - A drone whose process starts anew arms no vehicle in that flight any more; one that had been told to fly, and was
///   still on the ground, does not take off at all.
#[derive(Debug)]
pub(crate) struct ArmingChecker {
    drones: Vec<Phase>,
}

/// How far a drone is on its way from the ground to the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Phase {
    /// On the ground, told nothing that makes it take off.
    #[default]
    Grounded,
    /// A member, told to take off by a master that the operator chose.
    Told,
    /// The master, told to fly by the operator.
    Leads,
    /// It takes off or has done so.
    Up,
    /// Likewise, but its process has started anew since, or its flight controller brings it down.
    UpAgain,
    /// It lands or has landed, or never will take off.
    Down,
}

impl ArmingChecker {
    pub(crate) fn new(drones: usize) -> Self {
        Self {
            drones: vec![Phase::default(); drones],
        }
    }

    /// A drone's mission is told something.
    pub(crate) fn told(&mut self, drone: NodeId, envelope: &Envelope) {
        let phase = &mut self.drones[drone.0 as usize];
        if !matches!(phase, Phase::Grounded) {
            return;
        }
        match envelope {
            Envelope::Mission(Input::Fly) => *phase = Phase::Leads,
            Envelope::Mission(Input::Routing(Notice::Order { ballot, order, .. }))
                if !ballot.is_elected()
                    && matches!(wire::decode_order(order), Ok(Order::TakeOff { .. })) =>
            {
                *phase = Phase::Told;
            }
            _ => {}
        }
    }

    /// A drone that runs elsewhere waits to take off, under a ballot of the operator's.
    pub(crate) fn told_by(&mut self, drone: NodeId, ballot: Ballot) {
        let phase = &mut self.drones[drone.0 as usize];
        if *phase == Phase::Grounded && ballot.master != drone {
            *phase = Phase::Told;
        }
    }

    /// A machine of a drone is built, for the first time or anew.
    pub(crate) fn starting(&mut self, drone: NodeId, address: Address) {
        let phase = &mut self.drones[drone.0 as usize];
        if address == Address::Mission && *phase == Phase::Told {
            *phase = Phase::Grounded;
        }
    }

    /// A drone's process starts anew.
    pub(crate) fn boots(&mut self, drone: NodeId) {
        let phase = &mut self.drones[drone.0 as usize];
        *phase = match phase {
            Phase::Grounded => Phase::Grounded,
            Phase::Up | Phase::UpAgain => Phase::UpAgain,
            Phase::Told | Phase::Leads | Phase::Down => Phase::Down,
        };
    }

    pub(crate) fn observe(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        event: &Event,
        leader: Option<Ballot>,
    ) -> Option<Violation> {
        let Event::State(state) = *event else {
            return None;
        };
        let phase = &mut self.drones[drone.0 as usize];
        if !state.is_following() {
            if !matches!(state, State::Start | State::SetUp) {
                *phase = Phase::Down;
            }
            return None;
        }
        let what = match *phase {
            Phase::Up | Phase::UpAgain => return None,
            Phase::Down => format!("drone {drone} flies though it was to stay down"),
            Phase::Grounded => format!("drone {drone} takes off and was not told to"),
            Phase::Told | Phase::Leads => {
                *phase = Phase::Up;
                let elected = leader.filter(Ballot::is_elected)?;
                format!("drone {drone} takes off under {elected}")
            }
        };
        Some(violation(now, drone, what))
    }

    /// A drone's vehicle is told something.
    pub(crate) fn commands(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        command: FlightCommand,
    ) -> Option<Violation> {
        let phase = &mut self.drones[drone.0 as usize];
        match (command, *phase) {
            (FlightCommand::Land, _) => {
                // A mission that lands has said so before; one that has not, for it does not run, may take a while to
                // find out that its aircraft came down, but does not fly a second time.
                *phase = match phase {
                    Phase::Up | Phase::UpAgain => Phase::UpAgain,
                    Phase::Down => Phase::Down,
                    Phase::Grounded | Phase::Told | Phase::Leads => Phase::Grounded,
                };
                None
            }
            (FlightCommand::Arm, Phase::UpAgain) => {
                let what = format!("drone {drone} arms after its process has started anew");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Down) => {
                let what = format!("drone {drone} arms though it was to stay down");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Grounded | Phase::Told | Phase::Leads) => {
                let what = format!("drone {drone} arms and does not take off");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Up)
            | (FlightCommand::Report | FlightCommand::Yield | FlightCommand::Fly(_), _) => None,
        }
    }
}

fn violation(now: Timestamp, drone: NodeId, what: String) -> Violation {
    Violation {
        rule: 6,
        at: now,
        drones: vec![drone],
        what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRONE: NodeId = NodeId(1);

    const fn ballot(term: u32) -> Ballot {
        Ballot {
            term,
            rank: 0,
            master: NodeId(0),
        }
    }

    /// What one drone does, in order.
    #[derive(Clone, Copy)]
    enum Does {
        IsToldToFly,
        /// Told an order to take off, under a ballot of this term.
        IsToldToTakeOff(u32),
        RestartsMission,
        RestartsNavigation,
        Boots,
        /// Enters a state while it obeys a ballot of this term.
        Enters(State, u32),
        Commands(FlightCommand),
    }
    use Does::{
        Boots, Commands, Enters, IsToldToFly, IsToldToTakeOff, RestartsMission, RestartsNavigation,
    };

    const TAKES_OFF: Does = Enters(State::TakingOff, 1);
    const ARMS: Does = Commands(FlightCommand::Arm);

    /// At which step of a history the checker finds something.
    fn found(history: &[Does]) -> Option<usize> {
        let mut checker = ArmingChecker::new(2);
        let now = Timestamp::ZERO;
        history.iter().position(|does| {
            let found = match *does {
                IsToldToFly => {
                    checker.told(DRONE, &Envelope::Mission(Input::Fly));
                    None
                }
                IsToldToTakeOff(term) => {
                    let order = Notice::Order {
                        ballot: ballot(term),
                        sequence: 2,
                        order: wire::encode_order(&Order::TakeOff { wave: 0 }).into(),
                    };
                    checker.told(DRONE, &Envelope::Mission(Input::Routing(order)));
                    None
                }
                RestartsMission => {
                    checker.starting(DRONE, Address::Mission);
                    None
                }
                RestartsNavigation => {
                    checker.starting(DRONE, Address::Navigation);
                    None
                }
                Boots => {
                    checker.boots(DRONE);
                    None
                }
                Enters(state, term) => {
                    let event = Event::State(state);
                    checker.observe(now, DRONE, &event, Some(ballot(term)))
                }
                Commands(command) => checker.commands(now, DRONE, command),
            };
            found.is_some_and(|violation| violation.rule == 6)
        })
    }

    #[test]
    fn a_drone_that_is_told_to_may_take_off_and_arm() {
        let flight = [
            Enters(State::SetUp, 1),
            IsToldToTakeOff(1),
            TAKES_OFF,
            ARMS,
            RestartsNavigation,
            ARMS,
            Enters(State::HopUpdate, 1),
            RestartsMission,
            Enters(State::Landing, 2),
            Commands(FlightCommand::Land),
            Enters(State::Finished, 2),
        ];
        assert_eq!(found(&flight), None);
        assert_eq!(
            found(&[IsToldToFly, RestartsMission, TAKES_OFF, ARMS]),
            None
        );
    }

    #[test]
    fn a_drone_that_takes_off_or_arms_untold_is_found() {
        assert_eq!(found(&[TAKES_OFF]), Some(0));
        assert_eq!(found(&[ARMS]), Some(0));
        assert_eq!(found(&[IsToldToTakeOff(1), ARMS]), Some(1));
    }

    #[test]
    fn a_drone_that_takes_off_at_the_word_of_an_elected_master_is_found() {
        assert_eq!(found(&[IsToldToTakeOff(2), TAKES_OFF]), Some(1));
        let after_an_election = [IsToldToTakeOff(1), Enters(State::TakingOff, 2)];
        assert_eq!(found(&after_an_election), Some(1));
    }

    #[test]
    fn a_mission_restarted_on_the_ground_that_takes_off_is_found_unless_it_is_told_again() {
        let restarted = [IsToldToTakeOff(1), RestartsMission, TAKES_OFF];
        assert_eq!(found(&restarted), Some(2));
        let told_again = [
            IsToldToTakeOff(1),
            RestartsMission,
            IsToldToTakeOff(1),
            TAKES_OFF,
        ];
        assert_eq!(found(&told_again), None);
    }

    #[test]
    fn a_drone_that_arms_again_after_it_has_landed_is_found() {
        let flight = [
            IsToldToTakeOff(1),
            TAKES_OFF,
            ARMS,
            Commands(FlightCommand::Land),
        ];
        let again = [&flight[..], &[ARMS]].concat();
        assert_eq!(found(&again), Some(4));
    }

    #[test]
    fn a_drone_that_said_that_it_lands_and_flies_on_is_found() {
        let lands = [
            Enters(State::Landing, 1),
            Commands(FlightCommand::Land),
            TAKES_OFF,
        ];
        let flight = [&[IsToldToTakeOff(1), TAKES_OFF, ARMS][..], &lands].concat();
        assert_eq!(found(&flight), Some(5));
    }

    #[test]
    fn a_drone_whose_aircraft_came_down_while_its_process_was_away_may_take_a_while_to_find_out() {
        let away = [
            Commands(FlightCommand::Land),
            Boots,
            Enters(State::HopUpdate, 1),
        ];
        let finds_out = [Enters(State::Landing, 1), Enters(State::Finished, 1)];
        let flight = [
            &[IsToldToTakeOff(1), TAKES_OFF, ARMS][..],
            &away,
            &finds_out,
        ];
        assert_eq!(found(&flight.concat()), None);
        assert_eq!(found(&[&flight.concat()[..], &[ARMS]].concat()), Some(8));
    }

    #[test]
    fn a_drone_whose_process_starts_anew_flies_on_and_never_arms() {
        let flight = [IsToldToTakeOff(1), TAKES_OFF, ARMS, Boots, TAKES_OFF];
        assert_eq!(found(&flight), None);
        let again = [&flight[..], &[ARMS]].concat();
        assert_eq!(found(&again), Some(5));
        assert_eq!(found(&[IsToldToFly, Boots, TAKES_OFF]), Some(2));
        assert_eq!(found(&[Boots, IsToldToTakeOff(1), TAKES_OFF, ARMS]), None);
    }

    #[test]
    fn a_drone_killed_on_the_ground_must_be_told_again() {
        let killed = [IsToldToFly, Commands(FlightCommand::Land), TAKES_OFF];
        assert_eq!(found(&killed), Some(2));
    }
}
