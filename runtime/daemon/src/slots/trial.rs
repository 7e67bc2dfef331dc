//! The trial of a slot, and the rollback. A service of its own runs it, so that nothing depends on who asked for it.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::Host;
use super::facts::SlotFacts;
use super::gate::{DroneHealth, Gate, Verdict};
use super::machine::{Goal, SlotId, SlotLink, Slots};
use super::observe::{self, Before};
use super::systemd::{BOOT, DRONES, TRIAL, service};

/// Time between two looks at the drones.
const PERIOD: Duration = Duration::from_millis(250);

/// Lock of a running trial.
const LOCK: &str = "trial.lock";

/// Starts the trial of a slot as a service. The good slot's program runs it and goes back if anything ends it, so that a
/// broken release judges itself only where there is no other.
///
/// # Errors
/// If systemd refuses, or a drone that only this slot has may be in flight.
pub(super) fn start(host: &Host, slot: &SlotId) -> io::Result<()> {
    look_at_new_drones(host, slot)?;
    let disk = &host.disk;
    let slots = disk.slots()?;
    let keeper = match slots.good {
        Some(_) => disk.link(SlotLink::Good),
        None => disk.slot(slot),
    };
    let keeper = keeper.join("musterd");
    let mut command = Command::new("systemd-run");
    command.args(["--quiet", "--collect", "--service-type=exec"]);
    command.arg(format!("--unit={TRIAL}"));
    command.arg(format!(
        "--property=ExecStopPost={} slot settle",
        keeper.display()
    ));
    command.arg(&keeper).args(["slot", "trial", slot]);
    let output = command.stdin(Stdio::null()).output()?;
    if output.status.success() {
        return Ok(());
    }
    let why = String::from_utf8_lossy(&output.stderr);
    Err(io::Error::other(format!("systemd-run: {}", why.trim())))
}

/// Looks at the drones that a slot has and the running one has not. They may have been started by hand.
///
/// # Errors
/// If one of them may be in flight.
fn look_at_new_drones(host: &Host, slot: &SlotId) -> io::Result<()> {
    let slots = host.disk.slots()?;
    if !slots.complete.contains(slot) {
        return Ok(());
    }
    let running = slots.current.map(|it| host.disk.facts(&it)).transpose()?;
    let mut drones = host.disk.facts(slot)?.drones;
    drones.retain(|id, _| {
        !running
            .as_ref()
            .is_some_and(|it| it.drones.contains_key(id))
    });
    for (id, address) in drones {
        if observe::is_in_flight(host, slot, (id, address))? {
            let why = format!(
                "drone {id} runs already and may be in flight; once it has landed, stop it on the host: systemctl stop {}",
                service(id)
            );
            return Err(io::Error::other(why));
        }
    }
    Ok(())
}

/// Tries a slot until it has proven itself. Otherwise notes why it has not; [`settle`] then goes back. While a drone takes part
/// in a flight, nothing is tried and nothing is noted.
///
/// # Errors
/// If the disk or systemd refuses, or a drone that only this slot has may be in flight.
pub(super) fn run(host: &Host, slot: &SlotId) -> io::Result<bool> {
    let disk = &host.disk;
    let Some(_lock) = disk.try_lock(LOCK)? else {
        return Ok(false);
    };
    disk.clear_failure_of(slot)?;
    let left = disk.slots()?.current;
    if let Some(left) = &left
        && observe::in_flight(host, left)?.is_some()
    {
        return Ok(false);
    }
    look_at_new_drones(host, slot)?;
    let slots = disk.reach(&Goal::Try(slot.clone()))?;
    if slots.current.as_ref() != Some(slot) {
        disk.set_failure(slot, "the slot is not there")?;
        return Ok(false);
    }
    let facts = disk.facts(slot)?;
    let before = observe::services(host, &facts)?;
    // The drones that are not the new slot's, as after a move to another host.
    let stopped = left.map_or(Ok(()), |left| stop_others(host, &left, Some(slot)));
    let judged = match stopped.and_then(|()| activate(host, &slots)) {
        Ok(()) => judge(host, slot, &facts, before)?,
        Err(error) => Err(error.to_string()),
    };
    match judged.and_then(|()| start_at_boot(host, slot, &facts).map_err(|it| it.to_string())) {
        Ok(()) => {
            disk.reach(&Goal::Keep)?;
            disk.clear_failure()?;
            Ok(true)
        }
        Err(why) => go_back(host, &why).map(|()| false),
    }
}

/// Watches the drones until the gate says whether they do well. `before`: their services before the slot was tried.
fn judge(
    host: &Host,
    slot: &str,
    facts: &SlotFacts,
    mut before: BTreeMap<u32, Before>,
) -> io::Result<Result<(), String>> {
    for (id, since) in observe::services(host, facts)? {
        // Starting a service by hand has set its count to 0.
        before
            .entry(id)
            .and_modify(|it| it.restarts = since.restarts);
    }
    let mut gate = Gate::new(facts.gate, facts.peers.clone());
    let start = Instant::now();
    loop {
        let drones = observe::drones(host, slot, facts, &before)?;
        let health = drones.into_iter().map(|(id, drone)| (id, drone.health));
        match gate.judge(
            start.elapsed(),
            &health.collect::<BTreeMap<u32, DroneHealth>>(),
        ) {
            Verdict::Pending => std::thread::sleep(PERIOD),
            Verdict::Passed => return Ok(Ok(())),
            Verdict::Failed(why) => return Ok(Err(why)),
        }
    }
}

/// Lets systemd start a slot's drones at boot, after the service that goes back.
fn start_at_boot(host: &Host, slot: &str, facts: &SlotFacts) -> io::Result<()> {
    if host.disk.set_unit(BOOT, Some(slot))? {
        host.systemd.order(&["daemon-reload"])?;
    }
    host.systemd.order(&["enable", BOOT])?;
    for id in facts.drones.keys() {
        host.systemd.order(&["enable", &service(*id)])?;
    }
    Ok(())
}

/// Goes back to the good slot, unless it runs already: after a trial, however it ended, and at boot. A trial that runs is left
/// alone.
///
/// # Errors
/// If the disk or systemd refuses.
pub(super) fn settle(host: &Host) -> io::Result<()> {
    let disk = &host.disk;
    if !disk.home().exists() {
        return Ok(());
    }
    let Some(_lock) = disk.try_lock(LOCK)? else {
        return Ok(());
    };
    if disk.slots()?.is_on_trial() {
        return go_back(host, "the trial ended before the release had proven itself");
    }
    let settled = disk.reach(&Goal::Settle)?;
    // What goes back may have been interrupted after its links were set.
    set_units(host, &settled)?;
    let activated = if is_running(host, &settled)? {
        Ok(())
    } else {
        activate(host, &settled)
    };
    activated.and(start_the_disabled(host, &settled))
}

/// Enables services of the good slot's drones that are not, and starts them.
fn start_the_disabled(host: &Host, slots: &Slots) -> io::Result<()> {
    let Some(slot) = &slots.good else {
        return Ok(());
    };
    let facts = host.disk.facts(slot)?;
    let mut disabled = Vec::new();
    for id in facts.drones.keys() {
        if !host.systemd.run(&["is-enabled", &service(*id)])? {
            disabled.push(service(*id));
        }
    }
    if disabled.is_empty() && host.systemd.run(&["is-enabled", BOOT])? {
        return Ok(());
    }
    start_at_boot(host, slot, &facts)?;
    for service in disabled {
        host.systemd.order(&["--no-block", "start", &service])?;
    }
    Ok(())
}

/// Takes a slot on trial back, and notes why. Nothing is written before its processes are killed and it is removed: they may
/// have filled the disk.
fn go_back(host: &Host, why: &str) -> io::Result<()> {
    let disk = &host.disk;
    let slots = disk.slots()?;
    let mut stopped = Ok(());
    if let Some(tried) = &slots.current {
        // A slot that is damaged is left, too.
        let drones = disk.facts(tried).map(|it| it.drones).unwrap_or_default();
        for (id, address) in drones {
            kill_unless_in_flight(host, tried, (id, address))?;
        }
        stopped = stop_others(host, tried, slots.good.as_ref());
    }
    let settled = disk.reach(&Goal::Settle)?;
    let tried = slots.current;
    let noted = tried.map_or(Ok(()), |tried| disk.set_failure(&tried, why));
    activate(host, &settled)?;
    start_the_disabled(host, &settled)?;
    stopped.and(noted)
}

/// Kills a drone's process. What flies lands with the program that it took off with; the next start is the running slot's.
/// Returns whether it was killed.
fn kill_unless_in_flight(host: &Host, slot: &str, drone: (u32, SocketAddr)) -> io::Result<bool> {
    if observe::is_in_flight(host, slot, drone)? {
        return Ok(false);
    }
    let service = service(drone.0);
    // One that has no process can't be killed.
    host.systemd.run(&["kill", "--signal=KILL", &service])?;
    Ok(true)
}

/// Runs the good slot before this one again.
///
/// # Errors
/// If a drone takes part in a flight, or the disk or systemd refuses.
pub(super) fn roll_back(host: &Host) -> io::Result<()> {
    let slots = host.disk.slots()?;
    let (Some(left), Some(back)) = (&slots.current, slots.rollback_slot()) else {
        return Ok(());
    };
    if let Some(drone) = observe::in_flight(host, left)? {
        let why = format!("drone {drone} takes part in a flight; roll back after it has landed");
        return Err(io::Error::other(why));
    }
    // First, so that a rollback that is interrupted and asked for again ends them, too.
    stop_others(host, left, Some(back))?;
    let slots = host.disk.reach(&Goal::RollBack)?;
    activate(host, &slots)?;
    start_the_disabled(host, &slots)
}

/// Ends the services of drones that a slot has and the next one has not. A drone in flight goes on until it has landed.
fn stop_others(host: &Host, left: &str, next: Option<&SlotId>) -> io::Result<()> {
    let next = next.map(|it| host.disk.facts(it)).transpose()?;
    let has = |id: &u32| next.as_ref().is_some_and(|it| it.drones.contains_key(id));
    for (id, address) in host.disk.facts(left)?.drones {
        if has(&id) {
            continue;
        }
        let service = service(id);
        // Without a unit there is nothing to disable.
        host.systemd.run(&["disable", &service])?;
        if kill_unless_in_flight(host, left, (id, address))? {
            host.systemd.run(&["stop", &service])?;
            if host.systemd.look(&service)?.is_running() {
                return Err(io::Error::other(format!("{service} does not end")));
            }
        }
    }
    Ok(())
}

/// Whether every process of the slots' drones runs the program of the running slot.
fn is_running(host: &Host, slots: &Slots) -> io::Result<bool> {
    let Some(current) = &slots.current else {
        return Ok(true);
    };
    let folder = host.disk.slot(current);
    for id in host.disk.facts(current)?.drones.keys() {
        // A drone that does not run starts from the running slot.
        if let Some(process) = host.systemd.look(&service(*id))?.process() {
            let program = std::fs::read_link(format!("/proc/{process}/exe"));
            if !program.is_ok_and(|it| it.starts_with(&folder)) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Gives systemd the drones' unit of the running slot, and of the good slot the one that goes back at boot: what is on trial
/// does not judge itself.
fn set_units(host: &Host, slots: &Slots) -> io::Result<()> {
    let drones = host.disk.set_unit(DRONES, slots.current.as_deref())?;
    let boot = host.disk.set_unit(BOOT, slots.good.as_deref())?;
    if drones || boot {
        host.systemd.order(&["daemon-reload"])?;
    }
    Ok(())
}

/// Lets systemd run what the running slot has. Drones are killed, not called down: none of them is in flight, and one that
/// is called down on the ground takes its flight for over.
fn activate(host: &Host, slots: &Slots) -> io::Result<()> {
    set_units(host, slots)?;
    let Some(current) = slots.current.as_deref() else {
        return Ok(());
    };
    let mut started = Ok(());
    for (id, address) in host.disk.facts(current)?.drones {
        if !kill_unless_in_flight(host, current, (id, address))? {
            continue;
        }
        let service = service(id);
        host.systemd.run(&["reset-failed", &service])?;
        let restarted = host.systemd.order(&["--no-block", "restart", &service]);
        started = started.and(restarted);
    }
    started
}

#[cfg(test)]
mod tests;
