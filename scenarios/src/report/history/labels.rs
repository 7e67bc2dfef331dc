use std::fmt::Write as _;
use std::time::Duration;

use crate::scenario::{ControllerFault, DroneFault, Fault, FaultKind, LinkFault, Links};
use muster_runtime::text::figure;

/// Ids as ranges: `0–2, 4`.
pub(super) fn ids(ids: impl Iterator<Item = u32>) -> String {
    let mut ranges: Vec<(u32, u32)> = Vec::new();
    for id in ids {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == id => *last = id,
            _ => ranges.push((id, id)),
        }
    }
    let range = |(first, last): &(u32, u32)| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first}–{last}"),
    };
    ranges.iter().map(range).collect::<Vec<_>>().join(", ")
}

/// The masters after an election.
pub(super) fn masters(elected: impl Iterator<Item = u32>) -> String {
    let names = ids(elected);
    if names.is_empty() {
        return "no drone".to_owned();
    }
    let plural = if names.contains([',', '–']) {
        "s"
    } else {
        ""
    };
    format!("drone{plural} {names}")
}

/// A fault that was injected, in words; `target` is the drone that it found.
pub(super) fn fault(fault: &Fault, target: Option<u32>) -> String {
    let mut text = match &fault.kind {
        FaultKind::Drone(_, what) => match target {
            Some(id) => format!("fault: {}, drone {id}", of_drone(what, &fault.kind)),
            None => format!(
                "fault: {}, but there is no leader",
                of_drone(what, &fault.kind)
            ),
        },
        FaultKind::Links(links, what) => format!("fault: {}", of_links(links, *what)),
        FaultKind::Jam { centre, radius_m } => format!(
            "fault: jam {} m around {} m north, {} m east",
            figure(*radius_m, 0),
            figure(centre.north_m(), 0),
            figure(centre.east_m(), 0),
        ),
        FaultKind::Tamper(tampered) => {
            let senders = match tampered.from {
                Some(from) => format!("drone {}", from.0),
                None => "all".to_owned(),
            };
            let share = figure(tampered.share * 100.0, 0);
            format!(
                "fault: {}, {share} % of the frames of {senders}",
                fault.kind.name()
            )
        }
    };
    if let Some(lasts) = fault.duration.filter(|it| *it > Duration::ZERO) {
        write!(text, ", for {} s", lasts.as_secs_f64()).expect("writing to a string never fails");
    }
    text
}

fn of_drone(fault: &DroneFault, kind: &FaultKind) -> String {
    match fault {
        DroneFault::Drain(charge) => format!("drain to {} %", figure(charge * 100.0, 0)),
        DroneFault::Skew(ppm) => format!("skew by {ppm} ppm"),
        DroneFault::Controller(
            ControllerFault::LoseBytes(share) | ControllerFault::CorruptBytes(share),
        ) => {
            format!("{}, {} %", kind.name(), figure(share * 100.0, 1))
        }
        DroneFault::Controller(ControllerFault::WeakenMotor(motor, share)) => {
            let which = motor.map_or_else(|| "all".to_owned(), |it| it.to_string());
            format!("{} {which} by {} %", kind.name(), figure(share * 100.0, 0))
        }
        DroneFault::Controller(ControllerFault::Shake(dps)) => {
            format!("{} by {} °/s", kind.name(), figure(*dps, 0))
        }
        DroneFault::Controller(ControllerFault::DelayBytes(by)) => {
            format!("{} by {} ms", kind.name(), by.as_millis())
        }
        DroneFault::Controller(ControllerFault::SagBattery(volts)) => {
            format!("{} by {} V", kind.name(), figure(*volts, 1))
        }
        _ => kind.name(),
    }
}

fn of_links(links: &Links, fault: LinkFault) -> String {
    let group = |nodes: &[muster_machines::identity::NodeId]| ids(nodes.iter().map(|id| id.0));
    let (from, to) = (group(&links.from), group(&links.to));
    match fault {
        LinkFault::Cut => format!("links cut between {from} and {to}"),
        LinkFault::OneWay => format!("links cut from {to} to {from}"),
        LinkFault::Degraded(loss) => format!(
            "links between {from} and {to} lose {} % more",
            figure(loss * 100.0, 0)
        ),
        LinkFault::Healed => format!("links healed between {from} and {to}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_ids_are_a_range() {
        assert_eq!(ids([0, 1, 2, 4, 6, 7].into_iter()), "0–2, 4, 6, 7");
        assert_eq!(masters([2, 4].into_iter()), "drones 2, 4");
        assert_eq!(masters([3].into_iter()), "drone 3");
    }
}
