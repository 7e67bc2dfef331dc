//! What follows from a report's figures, and how figures are written for a person.

use std::path::Path;

use muster_runtime::text::figure;

use super::{Barrier, DroneReport, Engine, FormationChange, Report, Role};

/// What a drone did for the swarm's radio, as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// It led.
    Master,
    /// It was led, and repeated orders for others.
    Relay,
    /// It was led, and repeated nothing.
    Leaf,
}

impl Kind {
    /// Every kind, in the order of a legend.
    pub(super) const ALL: [Self; 3] = [Self::Master, Self::Relay, Self::Leaf];

    /// Its name, as a person reads it and as the page's styles call it.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Master => "master",
            Self::Relay => "relay",
            Self::Leaf => "leaf",
        }
    }
}

impl DroneReport {
    /// What it did for the swarm's radio.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        match (self.role, self.relay) {
            (Role::Master, _) => Kind::Master,
            (Role::Slave, true) => Kind::Relay,
            (Role::Slave, false) => Kind::Leaf,
        }
    }
}

impl Barrier {
    /// Seconds from the last arrival to the last departure.
    #[must_use]
    pub fn wait_s(&self) -> f64 {
        self.moving_s - self.arrived_s
    }
}

impl FormationChange {
    /// Seconds from the first drone's start to the last one's arrival; nothing if none got there.
    #[must_use]
    pub fn took_s(&self) -> Option<f64> {
        self.done_s.map(|done_s| done_s - self.begun_s)
    }
}

impl Report {
    /// Whether every swarm of the run flew its mission to its end.
    #[must_use]
    pub fn are_missions_completed(&self) -> bool {
        self.swarms().all(|report| report.mission_completed)
    }

    /// What came of each swarm of the run, the scenario's own first.
    pub(crate) fn swarms(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.others)
    }

    /// How many changes of formation took all drones to their new slots.
    #[must_use]
    pub fn changes_made(&self) -> usize {
        let all = |change: &&FormationChange| change.drones as usize == self.drones.len();
        self.changes.iter().filter(all).count()
    }

    /// The drone that led, the one with the lowest id if several did in turn.
    #[must_use]
    pub fn master(&self) -> Option<&DroneReport> {
        self.drones.iter().find(|drone| drone.role == Role::Master)
    }

    /// The mean of the waits at the waypoints; nothing without a waypoint.
    #[must_use]
    pub fn mean_wait_s(&self) -> Option<f64> {
        mean(self.barriers.iter().map(Barrier::wait_s))
    }

    /// The mean of some count of each wait at a waypoint; nothing without a waypoint.
    #[must_use]
    pub fn mean_of_barriers(&self, what: impl Fn(&Barrier) -> u64) -> Option<f64> {
        mean(self.barriers.iter().map(|barrier| count(what(barrier))))
    }

    /// The mean of the waypoint delays that there are.
    #[must_use]
    pub fn mean_waypoint_delay_s(&self) -> Option<f64> {
        mean(
            self.drones
                .iter()
                .filter_map(|drone| drone.waypoint_delay_s),
        )
    }

    /// The mean of the frames sent.
    #[must_use]
    pub fn mean_messages_sent(&self) -> Option<f64> {
        mean(self.drones.iter().map(|drone| count(drone.messages_sent)))
    }

    /// Simulated seconds a second of the wall's clock; nothing if the run took no time that could be measured.
    #[must_use]
    pub fn speedup(&self) -> Option<f64> {
        (self.wall_s > 0.0).then(|| self.simulated_s / self.wall_s)
    }

    /// The scenario's name: its file's, without folder and extension.
    #[must_use]
    pub fn name(&self) -> &str {
        let stem = Path::new(&self.scenario).file_stem();
        stem.and_then(|stem| stem.to_str())
            .unwrap_or(&self.scenario)
    }
}

/// The command that makes a run, to be typed into a POSIX shell.
pub(crate) fn command(
    scenario: &str,
    seed: u64,
    engine: Option<Engine>,
    overrides: &[String],
) -> String {
    let scenario = quoted(scenario);
    let mut command = match engine {
        Some(engine) => format!("muster sim {scenario} --seed {seed} --engine {engine}"),
        None => format!("muster swarm {scenario}"),
    };
    for change in overrides {
        command.push_str(" --set ");
        command.push_str(&quoted(change));
    }
    command
}

/// `text` as one word of a POSIX shell.
pub(crate) fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(plain) {
        return text.to_owned();
    }
    let guard = if text.starts_with('-') { "./" } else { "" };
    format!("'{guard}{}'", text.replace('\'', r"'\''"))
}

pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, number) = values.fold((0.0, 0_u32), |(sum, number), value| {
        (sum + value, number + 1)
    });
    (number > 0).then(|| sum / f64::from(number))
}

/// A count as a number to reckon with.
#[expect(
    clippy::cast_precision_loss,
    reason = "a run has far fewer than 2^52 frames"
)]
pub(crate) fn count(number: u64) -> f64 {
    number as f64
}

/// How fast the run was, in words; nothing if it took no time that could be measured.
pub(super) fn pace(report: &Report) -> Option<String> {
    let speedup = report.speedup()?;
    Some(if speedup >= 10.0 {
        format!("{} times faster than real time", figure(speedup, 0))
    } else {
        format!("{} times real time", figure(speedup, 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_command_survives_a_shell() {
        let command =
            |scenario: &str| command(scenario, 7, Some(Engine::Actors), &["a=[1]".to_owned()]);
        assert_eq!(
            command("scenarios/thesis-2.toml"),
            "muster sim scenarios/thesis-2.toml --seed 7 --engine actors --set 'a=[1]'"
        );
        let hostile = command("it's $HOME.toml");
        assert!(hostile.starts_with(r"muster sim 'it'\''s $HOME.toml' --seed"));
        assert!(command("-x.toml").starts_with("muster sim './-x.toml' --seed"));
    }

    #[test]
    fn means_of_nothing_are_nothing() {
        let (mut report, _) = sample::swarm(2);
        report.barriers.clear();
        report.drones.clear();
        report.wall_s = 0.0;
        assert_eq!(report.mean_wait_s(), None);
        assert_eq!(report.mean_messages_sent(), None);
        assert_eq!(report.speedup(), None);
    }
}
