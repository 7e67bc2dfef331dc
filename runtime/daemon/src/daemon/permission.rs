//! Whether the drone's grant allows its stage with the flight controller at its port.
//!
//! A disarmed controller is checked as it is. An armed one, met after a restart in flight, must have the chip and the firmware
//! of the last check on the ground, and what that check allowed then, it allows now: a grant that ends in flight ends no flight
//! of less than an hour, and an armed controller is not asked for its settings, which can't change in flight.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use muster_machines::msp::controller::Stage;
use muster_msp::Uid;
use muster_port::Found;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::file;
use muster_runtime::identity::{
    CalendarTime, ControllerFacts, GrantRefusal, GrantedStage, GroundCheck, hex,
};
use thiserror::Error;

use crate::config::Permission;
use crate::control::{GRANT_ALLOWS, STAGE_FALLS};

/// No flight goes on for longer after its grant has ended.
const FLIGHT_MAX: Duration = Duration::from_secs(3_600);

/// Why a stage is not allowed.
#[derive(Debug, Error)]
pub(super) enum Refusal {
    /// The grant doesn't allow it.
    #[error(transparent)]
    Grant(#[from] GrantRefusal),
    /// The controller can't be read.
    #[error("the flight controller's settings can't be read")]
    Unread,
    /// The controller reports no chip number.
    #[error("the flight controller reports no chip number (`MSP_UID`)")]
    NoChip,
    /// The controller is armed, and it is not the one that was checked.
    #[error(
        "the flight controller is armed, and is not the one that was checked last on the ground"
    )]
    Unchecked,
    /// The file of the last check can't be used: what time it is at least is not known.
    #[error("the last check on the ground, which has the newest known time, can't be read: {0}")]
    Kept(BadInput),
    /// The system's fault: the check can't be kept.
    #[error(
        "can't store the result of the last ground check (it holds the newest known time): {0}"
    )]
    NotKept(std::io::Error),
}

/// The newest refusal, for the status. `None` if there is none.
pub(super) type Refused = Arc<Mutex<Option<String>>>;

/// Checks each controller that is found.
pub(super) struct Checker {
    permission: Option<Permission>,
    /// What was checked last. A port that is opened again in flight does not look again.
    checked: Option<(Arc<Found>, Stage)>,
    refused: Refused,
}

impl Checker {
    /// `None`: for a stage that needs no grant.
    pub(super) fn new(permission: Option<Permission>) -> Self {
        Self {
            permission,
            checked: None,
            refused: Refused::default(),
        }
    }

    pub(super) fn refused(&self) -> Refused {
        self.refused.clone()
    }

    /// Checks a controller again that a port has found. The stage that is granted now, if it has fallen.
    pub(super) fn fallen(&mut self, found: Option<Arc<Found>>) -> Option<Stage> {
        let (_, before) = self.checked.take()?;
        let now = self.granted(found);
        (now < before).then_some(now)
    }

    /// The highest stage above `bench` that is granted with what a port has found; `Bench` if none is. Logs why.
    pub(super) fn granted(&mut self, found: Option<Arc<Found>>) -> Stage {
        let Some(permission) = &self.permission else {
            return Stage::Bench;
        };
        if let (Some(found), Some((checked, stage))) = (&found, &self.checked)
            && Arc::ptr_eq(found, checked)
        {
            return *stage;
        }
        let clock = CalendarTime::of_this_clock();
        let allowed = permission.check(found.as_deref(), clock);
        let (stage, refusal) = match allowed {
            Ok(()) => (stage_of(permission.stage), None),
            Err(refusal) => (Stage::Bench, Some(refusal.to_string())),
        };
        match &refusal {
            None => log_allowed(permission),
            Some(refusal) => tracing::warn!("{STAGE_FALLS}: {refusal}"),
        }
        *self.refused.lock().unwrap_or_else(PoisonError::into_inner) = refusal;
        self.checked = found.map(|found| (found, stage));
        stage
    }
}

/// The evidence of a tethered flight: `muster deploy promote` compares the controller with the one at hand.
fn log_allowed(permission: &Permission) {
    let ControllerFacts {
        chip,
        firmware,
        settings,
    } = &permission.grant.controller;
    let (stage, settings) = (permission.stage, hex(settings));
    tracing::info!(%stage, chip, firmware, settings, "{GRANT_ALLOWS}");
}

const fn stage_of(stage: GrantedStage) -> Stage {
    match stage {
        GrantedStage::Bench => Stage::Bench,
        GrantedStage::Tethered => Stage::Tethered,
        GrantedStage::Flight => Stage::Flight,
    }
}

impl Permission {
    /// Checks a controller, and keeps what was found on the ground, with the newest known time.
    fn check(&self, found: Option<&Found>, clock: CalendarTime) -> Result<(), Refusal> {
        let found = found.ok_or(Refusal::Unread)?;
        let uid = found.uid.as_ref().ok_or(Refusal::NoChip)?;
        let kept = GroundCheck::load(&self.kept).map_err(Refusal::Kept)?;
        let (controller, time) = match &found.configuration {
            Some(configuration) => {
                let controller = ControllerFacts::new(configuration, uid);
                let newest = kept.map_or(clock, |kept| kept.time.max(clock));
                self.keep(&controller, newest)?;
                (controller, newest)
            }
            None => {
                let (controller, time) = as_on_the_ground(found, uid, kept)?;
                let flown_out = self.grant.until.after(FLIGHT_MAX);
                let time = if clock > flown_out { clock } else { time };
                (controller, time)
            }
        };
        let drone = self.grant.drone;
        Ok(self.grant.allows(drone, self.stage, &controller, time)?)
    }

    fn keep(&self, controller: &ControllerFacts, time: CalendarTime) -> Result<(), Refusal> {
        let check = GroundCheck {
            time,
            controller: controller.clone(),
        };
        file::replace(&self.kept, check.to_toml().as_bytes()).map_err(Refusal::NotKept)
    }
}

/// An armed controller, with the settings and at the time of its last check on the ground.
fn as_on_the_ground(
    found: &Found,
    uid: &Uid,
    kept: Option<GroundCheck>,
) -> Result<(ControllerFacts, CalendarTime), Refusal> {
    let kept = kept.ok_or(Refusal::Unchecked)?;
    let now = ControllerFacts::of_armed(&found.identity, uid, kept.controller.settings);
    if now == kept.controller {
        Ok((now, kept.time))
    } else {
        Err(Refusal::Unchecked)
    }
}

/// Whether a controller was armed, over its statuses.
#[derive(Debug, Default)]
pub(super) struct Arming {
    was_armed: bool,
}

impl Arming {
    /// Takes in whether the controller is armed now, or disarmed for sure. Returns whether it is being armed.
    pub(super) const fn begins(&mut self, is_armed: bool, is_disarmed: bool) -> bool {
        let begins = is_armed && !self.was_armed;
        self.was_armed = (self.was_armed || is_armed) && !is_disarmed;
        begins
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::identity::NodeId;
    use muster_msp::Configuration;
    use muster_runtime::identity::{EvidenceKind, Grant};

    use super::*;

    const DAY: Duration = Duration::from_secs(86_400);

    fn at(text: &str) -> CalendarTime {
        CalendarTime::read(text).expect("a time")
    }

    fn noon() -> CalendarTime {
        at("2026-11-26T12:00:00Z")
    }

    fn disarmed(chip: u32, configuration: Configuration) -> Found {
        Found {
            identity: configuration.identity.clone(),
            uid: Some(Uid { uid: [chip, 2, 3] }),
            configuration: Some(configuration),
        }
    }

    fn armed(chip: u32) -> Found {
        Found {
            configuration: None,
            ..disarmed(chip, Configuration::default())
        }
    }

    fn fit() -> Found {
        disarmed(7, Configuration::default())
    }

    fn changed() -> Found {
        let mut configuration = Configuration::default();
        configuration.failsafe.delay_ds = 200;
        disarmed(7, configuration)
    }

    /// For the stage `tethered` with chip 7, for a day from noon.
    fn permission() -> (tempfile::TempDir, Permission) {
        let folder = tempfile::tempdir().expect("a folder");
        let uid = Uid { uid: [7, 2, 3] };
        let grant = Grant {
            drone: NodeId(1),
            stage: GrantedStage::Tethered,
            controller: ControllerFacts::new(&Configuration::default(), &uid),
            issued: noon(),
            until: noon().after(DAY),
            evidence: EvidenceKind::ALL
                .into_iter()
                .map(|kind| (kind, [3; 32]))
                .collect(),
        };
        let permission = Permission {
            grant,
            stage: GrantedStage::Tethered,
            kept: folder.path().join("kept.toml"),
        };
        (folder, permission)
    }

    fn refusal(permission: &Permission, found: &Found, clock: CalendarTime) -> Option<String> {
        let checked = permission.check(Some(found), clock);
        checked.err().map(|it| it.to_string())
    }

    #[test]
    fn a_clock_that_is_set_back_prolongs_no_grant() {
        let (_folder, permission) = permission();
        assert_eq!(refusal(&permission, &fit(), noon()), None);
        let ended = refusal(&permission, &fit(), noon().after(DAY));
        let text = "the grant ended at 2026-11-27T12:00:00Z; it is 2026-11-27T12:00:00Z or later";
        assert_eq!(ended.as_deref(), Some(text));
        let set_back = refusal(&permission, &fit(), noon());
        assert_eq!(set_back.as_deref(), Some(text));
        std::fs::write(&permission.kept, "time = 3").expect("a file");
        let unread = refusal(&permission, &fit(), noon()).expect("a refusal");
        assert!(unread.contains("can't be read"), "{unread}");
    }

    #[test]
    fn changed_settings_and_another_controller_are_refused_until_they_are_back() {
        let (_folder, permission) = permission();
        for other in [changed(), disarmed(8, Configuration::default())] {
            assert!(refusal(&permission, &other, noon()).is_some());
            assert_eq!(refusal(&permission, &fit(), noon()), None);
        }
        let silent = Found { uid: None, ..fit() };
        assert!(refusal(&permission, &silent, noon()).is_some());
        assert!(permission.check(None, noon()).is_err());
    }

    #[test]
    fn an_armed_controller_flies_on_if_its_last_check_on_the_ground_allowed_it() {
        let (_folder, permission) = permission();
        let unchecked = refusal(&permission, &armed(7), noon());
        assert!(unchecked.is_some(), "never checked");
        assert_eq!(refusal(&permission, &fit(), noon()), None);
        let in_flight = noon().after(DAY + FLIGHT_MAX);
        assert_eq!(refusal(&permission, &armed(7), in_flight), None);
        let later = in_flight.after(Duration::from_secs(1));
        assert!(refusal(&permission, &armed(7), later).is_some());
        assert!(refusal(&permission, &armed(8), noon()).is_some());
        assert!(refusal(&permission, &changed(), noon()).is_some());
        let after = refusal(&permission, &armed(7), noon());
        assert!(after.is_some(), "refused on the ground");
    }

    #[test]
    fn a_controller_that_is_not_looked_at_again_keeps_its_stage() {
        let (_folder, mut permission) = permission();
        permission.grant.issued = CalendarTime::of_this_clock();
        permission.grant.until = permission.grant.issued.after(DAY);
        let mut checker = Checker::new(Some(permission));
        let refused = checker.refused();
        let found = Arc::new(fit());
        assert_eq!(checker.granted(Some(found.clone())), Stage::Tethered);
        assert_eq!(checker.granted(Some(found.clone())), Stage::Tethered);
        assert_eq!(*refused.lock().expect("no panic"), None);
        assert_eq!(checker.fallen(Some(found.clone())), None);
        let grant = &mut checker.permission.as_mut().expect("a permission").grant;
        grant.until = grant.issued;
        assert_eq!(checker.granted(Some(found.clone())), Stage::Tethered);
        assert_eq!(checker.fallen(Some(found)), Some(Stage::Bench));
        let grant = &mut checker.permission.as_mut().expect("a permission").grant;
        grant.until = grant.issued.after(DAY);
        assert_eq!(checker.granted(Some(Arc::new(changed()))), Stage::Bench);
        let why = refused.lock().expect("no panic").clone();
        assert!(why.expect("a refusal").contains("settings have changed"));
    }

    #[test]
    fn each_arming_begins_once_whatever_a_single_false_status_says() {
        let mut arming = Arming::default();
        let statuses = [
            (false, true),
            (true, false),
            (true, false),
            (false, false),
            (true, false),
            (false, false),
            (false, true),
            (true, false),
        ];
        let begins = statuses.map(|(is_armed, is_disarmed)| arming.begins(is_armed, is_disarmed));
        let expected = [false, true, false, false, false, false, false, true];
        assert_eq!(begins, expected);
    }
}
