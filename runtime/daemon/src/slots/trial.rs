//! The trial of a slot, and the way back. A service of its own runs it, so that nothing depends on who asked for it.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::disk::Disk;
use super::facts::SlotFacts;
use super::gate::{DroneHealth, Gate, Verdict};
use super::machine::{Goal, Link, SlotId, Slots};
use super::observe;
use super::systemd::{BOOT, DRONES, TRIAL, Unit, service, systemctl};

/// Time between two looks at the drones.
const PERIOD: Duration = Duration::from_millis(250);

/// Lock of a running trial.
const LOCK: &str = "trial.lock";

/// Starts the trial of a slot as a service. The good slot's program runs it and goes back if anything ends it, so that a
/// broken release judges itself only where there is no other.
pub(super) fn start(disk: &Disk, slot: &SlotId) -> io::Result<()> {
    let slots = disk.slots()?;
    let keeper = match slots.good {
        Some(_) => disk.link(Link::Good),
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

/// Tries a slot until it has proven itself. Otherwise notes why it has not; [`settle`] then goes back.
///
/// # Errors
/// If the disk or systemd refuses.
pub(super) fn run(disk: &Disk, slot: &SlotId) -> io::Result<bool> {
    let Some(_lock) = disk.try_lock(LOCK)? else {
        return Ok(false);
    };
    if let Some(flying) = disk
        .slots()?
        .current
        .map(|it| disk.facts(&it))
        .transpose()?
        && let Some(drone) = observe::in_flight(&flying)
    {
        let why = format!("drone {drone} takes part in a flight");
        disk.set_failure(slot, &why)?;
        return Ok(false);
    }
    let slots = disk.reach(&Goal::Try(slot.clone()))?;
    if slots.current.as_ref() != Some(slot) {
        disk.set_failure(slot, "the slot is not there")?;
        return Ok(false);
    }
    let facts = disk.facts(slot)?;
    activate(disk, &slots)?;
    match judge(&facts)? {
        Ok(()) => keep(disk, &facts).map(|()| true),
        Err(why) => go_back(disk, &why).map(|()| false),
    }
}

/// Watches the drones until the gate says whether they do well.
fn judge(facts: &SlotFacts) -> io::Result<Result<(), String>> {
    let restarts = facts.drones.keys().map(|id| {
        let unit = Unit::look(&service(*id))?;
        Ok((*id, unit.restarts()))
    });
    let restarts = restarts.collect::<io::Result<BTreeMap<_, _>>>()?;
    let mut gate = Gate::new(facts.gate, facts.peers.clone());
    let start = Instant::now();
    loop {
        let drones = observe::drones(facts, &restarts)?;
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

/// Makes the running slot the good one, and starts its drones at boot from now on.
fn keep(disk: &Disk, facts: &SlotFacts) -> io::Result<()> {
    disk.reach(&Goal::Keep)?;
    disk.clear_failure()?;
    systemctl(&["enable", BOOT])?;
    for id in facts.drones.keys() {
        systemctl(&["enable", &service(*id)])?;
    }
    Ok(())
}

/// Goes back to the good slot, unless it runs already: after a trial, however it ended, and at boot.
///
/// # Errors
/// If the disk or systemd refuses.
pub(super) fn settle(disk: &Disk) -> io::Result<()> {
    let slots = disk.slots()?;
    if slots.is_on_trial() {
        return go_back(disk, "the trial ended before the release had proven itself");
    }
    let settled = disk.reach(&Goal::Settle)?;
    if !is_running(disk, &settled) {
        activate(disk, &settled)?;
    }
    Ok(())
}

/// Takes a slot on trial back, and notes why. Nothing is written before its processes are killed and it is removed: they may
/// have filled the disk.
fn go_back(disk: &Disk, why: &str) -> io::Result<()> {
    let tried = disk.slots()?.current;
    let facts = tried.as_ref().map(|it| disk.facts(it)).transpose()?;
    for (id, address) in facts.iter().flat_map(|it| &it.drones) {
        kill_unless_in_flight(*id, *address)?;
    }
    let slots = disk.reach(&Goal::Settle)?;
    let noted = tried.map_or(Ok(()), |tried| disk.set_failure(&tried, why));
    activate(disk, &slots)?;
    stop_others(disk, facts.as_ref(), &slots)?;
    noted
}

/// Kills a drone's process. What flies lands with the program that it took off with; the next start is the running slot's.
/// Returns whether it was killed.
fn kill_unless_in_flight(drone: u32, address: SocketAddr) -> io::Result<bool> {
    if observe::ask(address).is_some_and(|it| it.in_flight) {
        return Ok(false);
    }
    systemctl(&["kill", "--signal=KILL", &service(drone)])?;
    Ok(true)
}

/// Runs the good slot before this one again.
///
/// # Errors
/// If the disk or systemd refuses.
pub(super) fn roll_back(disk: &Disk) -> io::Result<()> {
    let before = disk.slots()?.current;
    let left = before.map(|it| disk.facts(&it)).transpose()?;
    let slots = disk.reach(&Goal::RollBack)?;
    activate(disk, &slots)?;
    stop_others(disk, left.as_ref(), &slots)
}

/// Ends the services of drones that a slot had and the running one has not.
fn stop_others(disk: &Disk, left: Option<&SlotFacts>, slots: &Slots) -> io::Result<()> {
    let now = slots
        .current
        .as_ref()
        .map(|it| disk.facts(it))
        .transpose()?;
    let has = |id| now.as_ref().is_some_and(|now| now.drones.contains_key(id));
    for id in left
        .iter()
        .flat_map(|it| it.drones.keys())
        .filter(|id| !has(id))
    {
        systemctl(&["disable", "--now", &service(*id)])?;
    }
    Ok(())
}

/// Whether every process of the slots' drones runs the program of the running slot.
fn is_running(disk: &Disk, slots: &Slots) -> bool {
    let Some(current) = &slots.current else {
        return true;
    };
    let folder = disk.slot(current);
    let Ok(facts) = disk.facts(current) else {
        return false;
    };
    facts.drones.keys().all(|id| {
        let output = Command::new("systemctl")
            .args(["show", "--value", "--property=MainPID"])
            .arg(service(*id))
            .output();
        let pid = output.map(|it| String::from_utf8_lossy(&it.stdout).trim().to_owned());
        let pid = pid.ok().filter(|pid| !pid.is_empty() && pid != "0");
        // A drone that does not run starts from the running slot.
        pid.is_none_or(|pid| {
            let program = std::fs::read_link(Path::new("/proc").join(pid).join("exe"));
            program.is_ok_and(|it| it.starts_with(&folder))
        })
    })
}

/// Lets systemd run what the running slot has. Drones are killed, not called down: none of them is in flight, and one that
/// is called down on the ground takes its flight for over.
fn activate(disk: &Disk, slots: &Slots) -> io::Result<()> {
    let current = slots.current.as_deref();
    let mut has_changed = false;
    for unit in [DRONES, BOOT] {
        has_changed |= disk.set_unit(unit, current)?;
    }
    if has_changed {
        systemctl(&["daemon-reload"])?;
    }
    let Some(current) = current else {
        return Ok(());
    };
    for (id, address) in &disk.facts(current)?.drones {
        if !kill_unless_in_flight(*id, *address)? {
            continue;
        }
        let service = service(*id);
        systemctl(&["reset-failed", &service])?;
        systemctl(&["--no-block", "restart", &service])?;
    }
    Ok(())
}
