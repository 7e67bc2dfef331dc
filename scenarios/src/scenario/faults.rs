use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_runtime::diagnostic::BadInput;
use toml::Spanned;

use super::{
    Distortion, DroneFault, Fault, FaultKind, Link, Links, Tampered, Target, Trigger, When,
};
use muster_runtime::plan::file::Source;
use muster_runtime::plan::raw::{self, Office, Pair, ProtocolKind, Raw, Sender, Victim, Whole};

/// What goes wrong, and when.
pub(super) fn faults(source: &Source, raw: &Raw, waypoints: usize) -> Result<Vec<Fault>, BadInput> {
    let reader = Reader {
        source,
        drones: raw.formation.drones.get_ref().0 + raw.relays.len() as u64,
        last_waypoint: match raw.protocol.kind {
            // A swarm that follows its master is at waypoint 0 once it has taken off, and at none after that.
            ProtocolKind::Follow => 0,
            ProtocolKind::Muscop => waypoints - 1,
        },
    };
    raw.faults.iter().map(|fault| reader.fault(fault)).collect()
}

const ONE_THING: &str = "a fault is one thing that goes wrong, no more and no less";
const SHARE_ALONE: &str = "`share` goes with `corrupt`, `duplicate`, `delay` or `reorder`";
const BY_ALONE: &str = "`by_ms` goes with `delay` or `reorder`";

struct Reader<'a> {
    source: &'a Source,
    /// How many drones and relays there are.
    drones: u64,
    /// The number of the last waypoint that drones get to.
    last_waypoint: usize,
}

impl Reader<'_> {
    fn fault(&self, fault: &Spanned<raw::Fault>) -> Result<Fault, BadInput> {
        let (span, fault) = (fault.span(), fault.get_ref());
        let kind = self.kind(span.clone(), fault)?;
        let lasts = fault.for_s.as_ref();
        if let Some(lasts) = lasts
            && !kind.can_last()
        {
            let message = "nothing that lasts, so nothing that is over after a while";
            return Err(self.source.error(lasts.span(), message));
        }
        let (times, every) = self.repetition(fault)?;
        Ok(Fault {
            when: self.when(span, fault)?,
            kind,
            lasts: lasts.map(|lasts| Duration::from_secs_f64(lasts.get_ref().0)),
            times,
            every,
        })
    }

    fn when(&self, span: Range<usize>, fault: &raw::Fault) -> Result<When, BadInput> {
        let after = fault.after_s.as_ref();
        let later = after.map_or(Duration::ZERO, |it| Duration::from_secs_f64(it.get_ref().0));
        match (&fault.at_s, &fault.at_waypoint, &fault.when) {
            (Some(at), None, None) => match after {
                None => Ok(When::At(Timestamp::from_secs_f64(at.0))),
                Some(after) => {
                    let message = "`after_s` goes with `at_waypoint` or `when`, not with `at_s`";
                    Err(self.source.error(after.span(), message))
                }
            },
            (None, Some(waypoint), None) => {
                let (at, last) = (waypoint.get_ref().0, self.last_waypoint);
                if at > last as u64 {
                    let message = format!("the last waypoint that drones get to is {last}");
                    return Err(self.source.error(waypoint.span(), &message));
                }
                let waypoint = u16::try_from(at).unwrap_or(u16::MAX);
                Ok(When::After(Trigger::Waypoint(waypoint), later))
            }
            (None, None, Some(trigger)) => Ok(When::After((*trigger).into(), later)),
            _ => {
                let message = "a fault happens either `at_s`, `at_waypoint` or `when`";
                Err(self.source.error(span, message))
            }
        }
    }

    fn repetition(&self, fault: &raw::Fault) -> Result<(u32, Duration), BadInput> {
        match (&fault.times, &fault.every_s) {
            (None, None) => Ok((1, Duration::ZERO)),
            (Some(times), Some(every)) => Ok((
                u32::try_from(times.get_ref().0).unwrap_or(u32::MAX),
                Duration::from_secs_f64(every.get_ref().0),
            )),
            (Some(alone), None) => {
                let message = "`times` without `every_s`";
                Err(self.source.error(alone.span(), message))
            }
            (None, Some(alone)) => {
                let message = "`every_s` without `times`";
                Err(self.source.error(alone.span(), message))
            }
        }
    }

    fn kind(&self, span: Range<usize>, fault: &raw::Fault) -> Result<FaultKind, BadInput> {
        let mut kinds = Vec::new();
        if let Some(actor) = &fault.actor
            && fault.crash.is_none()
            && fault.hang.is_none()
        {
            let message = "`actor` goes with `crash` or `hang`";
            return Err(self.source.error(actor.span(), message));
        }
        let actor = fault.actor.as_ref().map(|actor| actor.get_ref().address());
        if let Some(victim) = &fault.crash {
            let Some(actor) = actor else {
                let message = "`crash` without the `actor` that panics";
                return Err(self.source.error(victim.span(), message));
            };
            kinds.push(self.affects(victim, DroneFault::CrashActor(actor))?);
        }
        for (victim, what) in [
            (&fault.hang, DroneFault::Hang(actor)),
            (&fault.restart, DroneFault::Restart),
            (&fault.kill, DroneFault::Kill),
            (&fault.crash_aircraft, DroneFault::CrashAircraft),
            (&fault.lose_gps, DroneFault::LoseGps),
            (&fault.replay, DroneFault::Replay),
            (&fault.forge, DroneFault::Forge),
        ] {
            if let Some(victim) = victim {
                kinds.push(self.affects(victim, what)?);
            }
        }
        kinds.extend(self.drained(fault)?);
        for (pair, link) in [
            (&fault.cut, Link::Cut),
            (&fault.one_way, Link::OneWay),
            (&fault.degrade, self.degraded(fault)?),
            (&fault.heal, Link::Healed),
        ] {
            if let Some(pair) = pair {
                kinds.push(FaultKind::Links(self.links(pair)?, link));
            }
        }
        if let Some(disc) = &fault.jam {
            kinds.push(FaultKind::Jam {
                centre: Ned::new(disc.north_m.0, disc.east_m.0, 0.0),
                radius_m: disc.radius_m.0,
            });
        }
        kinds.extend(self.tampered(fault)?.map(FaultKind::Tamper));
        match (&fault.skew, &fault.ppm) {
            (Some(victim), Some(ppm)) => {
                kinds.push(self.affects(victim, DroneFault::Skew(ppm.get_ref().0))?);
            }
            (Some(victim), None) => {
                let message = "`skew` without `ppm`, how much the clock gains";
                return Err(self.source.error(victim.span(), message));
            }
            (None, Some(ppm)) => {
                return Err(self.source.error(ppm.span(), "`ppm` goes with `skew`"));
            }
            (None, None) => {}
        }
        match (kinds.pop(), kinds.is_empty()) {
            (Some(kind), true) => Ok(kind),
            _ => Err(self.source.error(span, ONE_THING)),
        }
    }

    fn drained(&self, fault: &raw::Fault) -> Result<Option<FaultKind>, BadInput> {
        match (&fault.drain, &fault.to) {
            (None, None) => Ok(None),
            (Some(victim), Some(to)) => {
                let fault = DroneFault::Drain(to.get_ref().0);
                self.affects(victim, fault).map(Some)
            }
            (Some(alone), None) => {
                let message = "`drain` without the charge `to` which it goes";
                Err(self.source.error(alone.span(), message))
            }
            (None, Some(alone)) => Err(self.source.error(alone.span(), "`to` goes with `drain`")),
        }
    }

    /// What is done to frames on their way, if that is the fault.
    fn tampered(&self, fault: &raw::Fault) -> Result<Option<Tampered>, BadInput> {
        let by = fault.by_ms.as_ref();
        let late = by.map(|by| Duration::from_millis(by.get_ref().0));
        let kinds = [
            (&fault.corrupt, Some(Distortion::Corrupt), false),
            (&fault.duplicate, Some(Distortion::Duplicate), false),
            (&fault.delay, late.map(Distortion::Delay), true),
            (&fault.reorder, late.map(Distortion::Reorder), true),
        ];
        let mut named = kinds
            .iter()
            .filter_map(|(sender, how, is_late)| Some((sender.as_ref()?, how, *is_late)));
        let Some((sender, how, is_late)) = named.next() else {
            return match (&fault.share, by) {
                (Some(share), _) => Err(self.source.error(share.span(), SHARE_ALONE)),
                (None, Some(by)) => Err(self.source.error(by.span(), BY_ALONE)),
                (None, None) => Ok(None),
            };
        };
        if let Some((other, ..)) = named.next() {
            return Err(self.source.error(other.span(), ONE_THING));
        }
        let Some(how) = *how else {
            let message = "this fault needs `by_ms`, how much later frames arrive";
            return Err(self.source.error(sender.span(), message));
        };
        if let Some(by) = by.filter(|_| !is_late) {
            return Err(self.source.error(by.span(), BY_ALONE));
        }
        let from = match sender.get_ref() {
            Sender::All(_) => None,
            Sender::Drone(id) => Some(self.drone(id, sender.span())?),
        };
        let share = fault.share.as_ref().map_or(1.0, |it| it.get_ref().0);
        Ok(Some(Tampered { from, share, how }))
    }

    fn degraded(&self, fault: &raw::Fault) -> Result<Link, BadInput> {
        match (&fault.degrade, &fault.loss) {
            (_, None) if fault.degrade.is_none() => Ok(Link::Healed),
            (Some(_), Some(loss)) => Ok(Link::Degraded(loss.get_ref().0)),
            (Some(pair), None) => {
                let message = "`degrade` without the `loss` that it brings";
                Err(self.source.error(pair.span(), message))
            }
            (None, loss) => {
                let span = loss.as_ref().map(Spanned::span).unwrap_or_default();
                Err(self.source.error(span, "`loss` goes with `degrade`"))
            }
        }
    }

    fn affects(&self, victim: &Spanned<Victim>, fault: DroneFault) -> Result<FaultKind, BadInput> {
        let target = match victim.get_ref() {
            Victim::Office(Office::Master) => Target::Master,
            Victim::Drone(id) => Target::Drone(self.drone(id, victim.span())?),
        };
        Ok(FaultKind::Drone(target, fault))
    }

    fn links(&self, pair: &Spanned<Pair>) -> Result<Links, BadInput> {
        let group = |ids: &[Whole<0, 99_999>]| {
            let ids = ids.iter().map(|id| self.drone(id, pair.span()));
            ids.collect::<Result<Arc<[NodeId]>, BadInput>>()
        };
        let [from, to] = match pair.get_ref() {
            Pair::Drones(drones) => [group(&drones[..1])?, group(&drones[1..])?],
            Pair::Groups(groups) => [group(&groups[0])?, group(&groups[1])?],
        };
        if let Some(both) = from.iter().find(|id| to.contains(id)) {
            let message = format!("drone {both} is on both sides");
            return Err(self.source.error(pair.span(), &message));
        }
        Ok(Links { from, to })
    }

    fn drone(&self, id: &Whole<0, 99_999>, span: Range<usize>) -> Result<NodeId, BadInput> {
        let known = u32::try_from(id.0).ok().filter(|_| id.0 < self.drones);
        known.map(NodeId).ok_or_else(|| {
            let message = format!("there is no drone {} in a swarm of {}", id.0, self.drones);
            self.source.error(span, &message)
        })
    }
}
