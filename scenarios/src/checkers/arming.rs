use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::{Event, Input, Order, State};
use muster_machines::msp::FlightCommand;
use muster_machines::node::{Address, Envelope};
use muster_machines::routing::Notice;
use muster_machines::time::Timestamp;
use muster_machines::wire;
use muster_msp::{Channel, SetRawRc};

use super::Violation;

/// Rule 6: no drone arms or takes off because something restarted.
///
/// What is checked:
/// - A drone takes off only if it is ordered to: the master by the operator, a member by the order of a master that the
///   operator chose. An elected master can't order a take-off.
/// - A mission that restarts on the ground forgets the order, and must receive it again from its routing. The operator's
///   command to the master outlives a restart.
/// - A vehicle is armed only while its drone takes off or flies, and not again once it has begun to land: once a flight.
/// - A drone whose process is restarted does not arm again in that flight. If it was ordered to fly and still on the ground,
///   it stays there.
/// - No high arm switch leaves for a flight controller that has not reported a simulation: [`ArmSwitch`].
#[derive(Debug)]
pub(crate) struct ArmingChecker {
    drones: Vec<Phase>,
}

/// The phase of a drone's flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Phase {
    /// On the ground, not ordered to take off.
    #[default]
    Grounded,
    /// A member, ordered to take off by a master that the operator chose.
    Ordered,
    /// The master, told to fly by the operator.
    Leads,
    /// It takes off or has done so.
    Up,
    /// Likewise, but its process has been restarted, or its flight controller lands it.
    MayNotArm,
    /// It lands, has landed, or will not take off.
    Down,
}

impl ArmingChecker {
    /// Drones on the ground.
    pub(crate) fn new(drones: usize) -> Self {
        Self {
            drones: vec![Phase::default(); drones],
        }
    }

    /// A drone's actor receives a message.
    pub(crate) fn receives(&mut self, drone: NodeId, envelope: &Envelope) {
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
                *phase = Phase::Ordered;
            }
            _ => {}
        }
    }

    /// In a mirror: a drone waits to take off under a ballot of a master that the operator chose.
    pub(crate) fn waits_for_take_off(&mut self, drone: NodeId, ballot: Ballot) {
        let phase = &mut self.drones[drone.0 as usize];
        if *phase == Phase::Grounded && ballot.master != drone {
            *phase = Phase::Ordered;
        }
    }

    /// An actor is built, at first or again.
    pub(crate) fn starting(&mut self, drone: NodeId, address: Address) {
        let phase = &mut self.drones[drone.0 as usize];
        if address == Address::Mission && *phase == Phase::Ordered {
            *phase = Phase::Grounded;
        }
    }

    /// A drone's process starts again.
    pub(crate) fn boots(&mut self, drone: NodeId) {
        let phase = &mut self.drones[drone.0 as usize];
        *phase = match phase {
            Phase::Grounded => Phase::Grounded,
            Phase::Up | Phase::MayNotArm => Phase::MayNotArm,
            Phase::Ordered | Phase::Leads | Phase::Down => Phase::Down,
        };
    }

    /// A drone's mission reports an event while it follows `leader`.
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
        if !state.is_on_mission() {
            if !matches!(state, State::Start | State::SetUp) {
                *phase = Phase::Down;
            }
            return None;
        }
        let what = match *phase {
            Phase::Up | Phase::MayNotArm => return None,
            Phase::Down => format!("drone {drone} flies although it must stay down"),
            Phase::Grounded => format!("drone {drone} takes off without an order"),
            Phase::Ordered | Phase::Leads => {
                *phase = Phase::Up;
                let elected = leader.filter(Ballot::is_elected)?;
                format!("drone {drone} takes off under {elected}, which was elected")
            }
        };
        Some(violation(now, drone, what))
    }

    /// A drone commands its vehicle.
    pub(crate) fn commands(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        command: FlightCommand,
    ) -> Option<Violation> {
        let phase = &mut self.drones[drone.0 as usize];
        match (command, *phase) {
            (FlightCommand::Land, _) => {
                // A mission that lands has reported so before. One that does not run may take a while to notice that its
                // aircraft came down, but must not fly again.
                *phase = match phase {
                    Phase::Up | Phase::MayNotArm => Phase::MayNotArm,
                    Phase::Down => Phase::Down,
                    Phase::Grounded | Phase::Ordered | Phase::Leads => Phase::Grounded,
                };
                None
            }
            (FlightCommand::Arm, Phase::MayNotArm) => {
                let what = format!("drone {drone} arms after its process was restarted");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Down) => {
                let what = format!("drone {drone} arms although it must stay down");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Grounded | Phase::Ordered | Phase::Leads) => {
                let what = format!("drone {drone} arms without taking off");
                Some(violation(now, drone, what))
            }
            (FlightCommand::Arm, Phase::Up)
            | (FlightCommand::Report | FlightCommand::Yield | FlightCommand::Fly(_), _) => None,
        }
    }
}

/// Whether the arm switch of what left for a flight controller was ever high before it had said, since its port was opened, that
/// it is a simulation. No other may be armed: scenarios fly in stage `sim`.
#[derive(Debug, Default)]
pub(crate) struct ArmSwitch {
    was_early: bool,
}

impl ArmSwitch {
    /// An RC frame leaves.
    pub(crate) fn sent(&mut self, rc: &SetRawRc, is_simulation: bool) {
        let is_low = rc.aux().first().is_none_or(|it| *it == Channel::LOW);
        self.was_early |= !is_low && !is_simulation;
    }

    /// Whether a drone's switch was high too early.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        self.was_early.then(|| {
            let what = format!(
                "drone {drone} has its arm switch high for a controller that has not reported a simulation"
            );
            violation(now, drone, what)
        })
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
    use muster_msp::Sticks;

    use super::*;

    const DRONE: NodeId = NodeId(1);

    const fn ballot(term: u32) -> Ballot {
        Ballot {
            term,
            rank: 0,
            master: NodeId(0),
        }
    }

    /// A step of a drone's history.
    #[derive(Clone, Copy)]
    enum Step {
        OperatorFlies,
        /// It receives an order to take off, under a ballot of this term.
        Ordered(u32),
        RestartsMission,
        RestartsNavigation,
        Boots,
        /// Enters a state while it follows a ballot of this term.
        Enters(State, u32),
        Commands(FlightCommand),
    }
    use Step::{
        Boots, Commands, Enters, OperatorFlies, Ordered, RestartsMission, RestartsNavigation,
    };

    const TAKES_OFF: Step = Enters(State::TakingOff, 1);
    const ARMS: Step = Commands(FlightCommand::Arm);

    /// The step of a history that breaks the rule.
    fn found(history: &[Step]) -> Option<usize> {
        let mut checker = ArmingChecker::new(2);
        let now = Timestamp::ZERO;
        history.iter().position(|step| {
            let found = match *step {
                OperatorFlies => {
                    checker.receives(DRONE, &Envelope::Mission(Input::Fly));
                    None
                }
                Ordered(term) => {
                    let order = Notice::Order {
                        ballot: ballot(term),
                        sequence: 2,
                        order: wire::encode_order(&Order::TakeOff { wave: 0 }).into(),
                    };
                    checker.receives(DRONE, &Envelope::Mission(Input::Routing(order)));
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
    fn an_ordered_drone_may_take_off_and_arm() {
        let flight = [
            Enters(State::SetUp, 1),
            Ordered(1),
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
            found(&[OperatorFlies, RestartsMission, TAKES_OFF, ARMS]),
            None
        );
    }

    #[test]
    fn take_off_or_arming_without_an_order_breaks_the_rule() {
        assert_eq!(found(&[TAKES_OFF]), Some(0));
        assert_eq!(found(&[ARMS]), Some(0));
        assert_eq!(found(&[Ordered(1), ARMS]), Some(1));
    }

    #[test]
    fn take_off_by_order_of_an_elected_master_breaks_the_rule() {
        assert_eq!(found(&[Ordered(2), TAKES_OFF]), Some(1));
        let after_an_election = [Ordered(1), Enters(State::TakingOff, 2)];
        assert_eq!(found(&after_an_election), Some(1));
    }

    #[test]
    fn mission_restarted_on_the_ground_needs_the_order_again() {
        let restarted = [Ordered(1), RestartsMission, TAKES_OFF];
        assert_eq!(found(&restarted), Some(2));
        let ordered_again = [Ordered(1), RestartsMission, Ordered(1), TAKES_OFF];
        assert_eq!(found(&ordered_again), None);
    }

    #[test]
    fn arming_again_after_landing_breaks_the_rule() {
        let flight = [Ordered(1), TAKES_OFF, ARMS, Commands(FlightCommand::Land)];
        let again = [&flight[..], &[ARMS]].concat();
        assert_eq!(found(&again), Some(4));
    }

    #[test]
    fn flying_on_after_reporting_a_landing_breaks_the_rule() {
        let lands = [
            Enters(State::Landing, 1),
            Commands(FlightCommand::Land),
            TAKES_OFF,
        ];
        let flight = [&[Ordered(1), TAKES_OFF, ARMS][..], &lands].concat();
        assert_eq!(found(&flight), Some(5));
    }

    #[test]
    fn a_restarted_process_may_notice_late_that_its_aircraft_landed() {
        let away = [
            Commands(FlightCommand::Land),
            Boots,
            Enters(State::HopUpdate, 1),
        ];
        let finds_out = [Enters(State::Landing, 1), Enters(State::Finished, 1)];
        let flight = [&[Ordered(1), TAKES_OFF, ARMS][..], &away, &finds_out];
        assert_eq!(found(&flight.concat()), None);
        assert_eq!(found(&[&flight.concat()[..], &[ARMS]].concat()), Some(8));
    }

    #[test]
    fn a_restarted_process_flies_on_and_does_not_arm() {
        let flight = [Ordered(1), TAKES_OFF, ARMS, Boots, TAKES_OFF];
        assert_eq!(found(&flight), None);
        let again = [&flight[..], &[ARMS]].concat();
        assert_eq!(found(&again), Some(5));
        assert_eq!(found(&[OperatorFlies, Boots, TAKES_OFF]), Some(2));
        assert_eq!(found(&[Boots, Ordered(1), TAKES_OFF, ARMS]), None);
    }

    #[test]
    fn a_drone_killed_on_the_ground_needs_the_order_again() {
        let killed = [OperatorFlies, Commands(FlightCommand::Land), TAKES_OFF];
        assert_eq!(found(&killed), Some(2));
    }

    #[test]
    fn high_arm_switch_before_the_controller_is_known_breaks_the_rule() {
        let rc = |arm| SetRawRc::new(Sticks::IDLE, &[arm, Channel::HIGH]).unwrap();
        let mut switch = ArmSwitch::default();
        switch.sent(&rc(Channel::LOW), false);
        switch.sent(&rc(Channel::HIGH), true);
        assert_eq!(switch.check(Timestamp::ZERO, DRONE), None);
        switch.sent(&rc(Channel::HIGH), false);
        switch.sent(&rc(Channel::LOW), true);
        let found = switch.check(Timestamp::ZERO, DRONE).unwrap();
        assert_eq!((found.rule, found.drones), (6, vec![DRONE]));
    }
}
