//! Figures derived from a report, and the commands in it.

use std::cmp::Reverse;
use std::path::Path;

use muster_machines::mission::State;
use muster_runtime::agents::Agents;
use muster_runtime::text::figure;

use super::{Barrier, DroneReport, Engine, FormationChange, RelayReport, Report, Role};

impl DroneReport {
    /// Its numbers of frames sent and received, "≥ 1,234" if frames are missing in them.
    #[must_use]
    pub fn messages(&self) -> [String; 2] {
        messages(
            [self.messages_sent, self.messages_received],
            self.messages_at_least,
        )
    }

    /// Whether it flew the mission to its end.
    #[must_use]
    pub fn has_finished(&self) -> bool {
        self.state == State::Finished.to_string() && self.landed_because.is_none()
    }

    /// Whether it is on the ground as at the start, neither flown nor lost.
    #[must_use]
    pub fn stayed(&self) -> bool {
        [State::Start, State::SetUp]
            .iter()
            .any(|it| it.to_string() == self.state)
    }
}

impl RelayReport {
    /// As [`DroneReport::messages`].
    #[must_use]
    pub fn messages(&self) -> [String; 2] {
        messages(
            [self.messages_sent, self.messages_received],
            self.messages_at_least,
        )
    }
}

fn messages(counts: [u64; 2], at_least: bool) -> [String; 2] {
    let bound = if at_least { "≥\u{a0}" } else { "" };
    counts.map(|it| format!("{bound}{}", figure(count(it), 0)))
}

impl Barrier {
    /// Barrier wait: seconds from the last arrival to the last departure, without the hold.
    #[must_use]
    pub fn wait_s(&self) -> f64 {
        self.moving_s - self.arrived_s - self.hold_s
    }
}

impl FormationChange {
    /// Seconds from the first drone's start to the last drone's arrival; `None` if none arrived.
    #[must_use]
    pub fn took_s(&self) -> Option<f64> {
        self.done_s.map(|done_s| done_s - self.begun_s)
    }
}

impl Report {
    /// Whether all swarms of the run completed their missions, each in contact.
    #[must_use]
    pub fn are_missions_completed(&self) -> bool {
        self.swarms().all(|report| report.mission_completed)
    }

    /// Reports of all swarms of the run, the scenario's own first.
    pub fn swarms(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.others)
    }

    /// Number of formation changes that all drones completed.
    #[must_use]
    pub fn changes_made(&self) -> usize {
        let all = |change: &&FormationChange| change.drones as usize == self.drones.len();
        self.changes.iter().filter(all).count()
    }

    /// The master; of several, as after an election, the one that reached the most waypoints, then that with the lowest id.
    #[must_use]
    pub fn master(&self) -> Option<&DroneReport> {
        let masters = self.drones.iter().filter(|it| it.role == Role::Master);
        masters.max_by_key(|it| (it.waypoints, Reverse(it.id)))
    }

    /// Mean barrier wait; `None` without barriers.
    #[must_use]
    pub fn mean_wait_s(&self) -> Option<f64> {
        mean(self.barriers.iter().map(Barrier::wait_s))
    }

    /// Mean of a counter over the barriers; `None` without barriers.
    #[must_use]
    pub fn mean_of_barriers(&self, counter: impl Fn(&Barrier) -> u64) -> Option<f64> {
        mean(self.barriers.iter().map(|barrier| count(counter(barrier))))
    }

    /// Mean waypoint delay over the drones that have one.
    #[must_use]
    pub fn mean_waypoint_delay_s(&self) -> Option<f64> {
        mean(
            self.drones
                .iter()
                .filter_map(|drone| drone.waypoint_delay_s),
        )
    }

    /// Mean number of frames sent; `None` without drones.
    #[must_use]
    pub fn mean_messages_sent(&self) -> Option<f64> {
        mean(self.drones.iter().map(|drone| count(drone.messages_sent)))
    }

    /// Simulated seconds per wall-clock second; `None` if the run took no measurable time.
    #[must_use]
    pub fn speedup(&self) -> Option<f64> {
        (self.wall_s > 0.0).then(|| self.simulated_s / self.wall_s)
    }

    /// Says which program was the drones' flight controllers, in the command that repeats the run, too.
    pub fn set_firmware(&mut self, program: &Path) {
        let name = program.file_name().unwrap_or_default();
        self.firmware = Some(name.to_string_lossy().into_owned());
        let program = quoted(&program.to_string_lossy());
        self.command.push_str(&format!(" --firmware {program}"));
    }

    /// Says that the flight was ended before its drones had landed.
    pub const fn set_interrupted(&mut self) {
        self.interrupted = true;
        self.mission_completed = false;
    }

    /// File name of the scenario without folder and extension.
    #[must_use]
    pub fn name(&self) -> &str {
        let stem = Path::new(&self.scenario).file_stem();
        stem.and_then(|stem| stem.to_str())
            .unwrap_or(&self.scenario)
    }
}

/// The program in commands that repeat something: a program of one's own has agents that `muster` lacks.
#[must_use]
pub fn program() -> String {
    let has_agents = Agents::installed().names().next().is_some();
    let own = std::env::args_os().next().filter(|_| has_agents);
    let name = own.as_deref().and_then(|it| Path::new(it).file_name());
    name.map_or_else(|| "muster".to_owned(), |it| quoted(&it.to_string_lossy()))
}

/// Command that repeats a run, quoted for a POSIX shell.
#[must_use]
pub fn command(scenario: &str, seed: u64, engine: Option<Engine>, overrides: &[String]) -> String {
    let (program, scenario) = (program(), quoted(scenario));
    let mut command = match engine {
        Some(engine) => format!("{program} sim {scenario} --seed {seed} --engine {engine}"),
        None => format!("{program} swarm {scenario}"),
    };
    for change in overrides {
        command.push_str(" --set ");
        command.push_str(&quoted(change));
    }
    command
}

/// Quotes `text` as one word of a POSIX shell.
#[must_use]
pub fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(plain) {
        return text.to_owned();
    }
    let guard = if text.starts_with('-') { "./" } else { "" };
    format!("'{guard}{}'", text.replace('\'', r"'\''"))
}

/// The mean; `None` without values.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, number) = values.fold((0.0, 0_u32), |(sum, number), value| {
        (sum + value, number + 1)
    });
    (number > 0).then(|| sum / f64::from(number))
}

/// Converts a count to a float.
#[expect(
    clippy::cast_precision_loss,
    reason = "a run has far fewer than 2^52 frames"
)]
#[must_use]
pub fn count(number: u64) -> f64 {
    number as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine;
    use crate::scenario::load;

    fn flown() -> Report {
        let scenario = load(Path::new("thesis-1"), &[]).unwrap();
        engine::run(&scenario, Engine::Events, None).unwrap().0
    }

    #[test]
    fn counts_that_lack_frames_are_shown_as_lower_bounds() {
        let mut report = flown();
        let drone = &mut report.drones[0];
        (drone.messages_sent, drone.messages_received) = (1_234, 5);
        assert_eq!(drone.messages(), ["1,234", "5"]);
        drone.messages_at_least = true;
        assert_eq!(drone.messages(), ["≥\u{a0}1,234", "≥\u{a0}5"]);
    }

    #[test]
    fn command_is_quoted_for_the_shell() {
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
    fn command_of_a_flight_with_firmware_names_it() {
        let mut report = flown();
        report.set_firmware(Path::new("my build/betaflight_SITL"));
        assert_eq!(report.firmware.as_deref(), Some("betaflight_SITL"));
        assert!(
            report
                .command
                .ends_with(" --firmware 'my build/betaflight_SITL'")
        );
    }

    #[test]
    fn means_without_values_are_none() {
        let mut report = flown();
        report.barriers.clear();
        report.drones.clear();
        report.wall_s = 0.0;
        assert_eq!(report.mean_wait_s(), None);
        assert_eq!(report.mean_messages_sent(), None);
        assert_eq!(report.speedup(), None);
    }
}
