//! Remarks of `muster check` on a scenario that can be flown.

use std::time::Duration;

use muster_runtime::text::figure;
use muster_transport::sim::Access;

use super::Scenario;

impl Scenario {
    /// What may surprise an operator: what the plan leaves out, and limits that the flight will meet.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let own = self.plan.notes.iter().cloned();
        own.chain(self.late_landing())
            .chain(self.slow_frames())
            .collect()
    }

    /// The limits that are shorter than the flight. How long an agent flies is not known.
    fn late_landing(&self) -> Vec<String> {
        if self.plan.agent.is_some() {
            return Vec::new();
        }
        let (limits, expected) = (&self.plan.limits, self.expected());
        let seconds = |time: Duration| figure(time.as_secs_f64(), 0);
        let limits = [
            (
                "limits.flight_time_s",
                limits.flight_time,
                "drones land early",
            ),
            ("limits.duration_s", limits.duration, "rule 5 is broken"),
        ];
        let exceeded = limits.into_iter().filter(|(_, limit, _)| expected > *limit);
        let note = |(field, limit, then): (&str, Duration, &str)| {
            format!(
                "the flight takes about {} s, and `{field}` is {} s: {then}; raise it, or shorten the mission",
                seconds(expected),
                seconds(limit),
            )
        };
        exceeded.map(note).collect()
    }

    /// A latency that makes all drones count as lost.
    fn slow_frames(&self) -> Option<String> {
        let Access::Ideal { latency, .. } = self.radio.access else {
            return None;
        };
        let time_to_live = self.plan.protocol.time_to_live;
        (latency > time_to_live).then(|| {
            format!(
                "`radio.latency_us` of {} ms is above the time to live of {} ms: drones count as lost before their frames arrive; \
                 lower it, or raise `protocol.time_to_live_ms`",
                latency.as_millis(),
                time_to_live.as_millis(),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scenario::load;

    fn notes(set: &[&str]) -> String {
        let set: Vec<_> = set.iter().map(|it| it.parse().unwrap()).collect();
        load(Path::new("thesis-1"), &set)
            .unwrap()
            .notes()
            .join("\n")
    }

    #[test]
    fn limits_and_latencies_that_the_flight_exceeds_are_noted() {
        assert_eq!(notes(&[]), "");
        let brief = notes(&["limits.flight_time_s=60"]);
        assert!(
            brief.contains("`limits.flight_time_s` is 60 s: drones land early"),
            "{brief}"
        );
        let brief = notes(&["limits.duration_s=60"]);
        assert!(
            brief.contains("`limits.duration_s` is 60 s: rule 5"),
            "{brief}"
        );
        let slow = notes(&["radio.latency_us=6000000"]);
        assert!(
            slow.contains("6000 ms is above the time to live of 5000 ms"),
            "{slow}"
        );
    }
}
