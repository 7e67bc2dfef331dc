//! Promotions: a drone may do more once it was shown that it can. The hashes of what was shown go into its grant.

mod evidence;

use std::collections::BTreeMap;
use std::path::PathBuf;

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::identity::{
    CalendarTime, ControllerFacts, Evidence, EvidenceKind, Fleet, Grant, GrantedStage, KeysError,
};

pub use self::evidence::CHAOS_PLANS_MIN;

/// The search that counts as evidence, as its file `chaos.json` names it: this version's, of the scenario `chaos-controllers`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SearchFacts {
    /// The program and its version.
    pub program: String,
    /// Hash of the parsed scenario.
    pub content: String,
}

/// A promotion that is asked for.
#[derive(Debug)]
pub struct PromotionRequest {
    /// The drone.
    pub drone: NodeId,
    /// Its next stage, or the one that it has, for a longer time.
    pub stage: GrantedStage,
    /// Its flight controller, which was just found fit.
    pub controller: ControllerFacts,
    /// What a search must be of.
    pub search: SearchFacts,
    /// Now.
    pub issued: CalendarTime,
    /// When the grant ends.
    pub until: CalendarTime,
    /// The files of evidence.
    pub files: BTreeMap<EvidenceKind, PathBuf>,
}

/// Signs a grant for a drone's next stage. What its last grant was signed for counts again; what was seen of its flight
/// controller does so only if controller, firmware and settings are the same. Returns the grant and its path.
///
/// # Errors
/// If a stage is skipped, evidence is missing or weak, or the fleet's folder can't be used. Nothing is signed then.
pub fn promote(fleet: &Fleet, request: &PromotionRequest) -> Result<(Grant, PathBuf), KeysError> {
    let PromotionRequest { drone, stage, .. } = request;
    let grant_file = PathBuf::from(format!("drone-{drone}.grant"));
    let (last, mut evidence) = inherited(fleet, request)?;
    if let Some(before) = before(*stage).filter(|before| last < Some(*before)) {
        let message = format!(
            "the stage \"{stage}\" needs a grant for \"{before}\" with this flight controller first"
        );
        let help = format!("run muster deploy promote --to {before}");
        return Err(BadInput::without_excerpt(&grant_file, message, help).into());
    }
    for (kind, path) in &request.files {
        let text = read_text(path)?;
        let checked = evidence::check(*kind, &text, request);
        checked.map_err(|weakness| {
            let message = format!("this is no evidence of `{kind}`: {weakness}");
            BadInput::without_excerpt(path, message, source(*kind))
        })?;
        evidence.add(*kind, text.as_bytes());
    }
    if let Some(missing) = evidence.missing_for(*stage).first() {
        let message = format!("the stage \"{stage}\" needs `--{missing} FILE`");
        return Err(BadInput::without_excerpt(&grant_file, message, source(*missing)).into());
    }
    let grant = Grant {
        drone: *drone,
        stage: *stage,
        controller: request.controller.clone(),
        issued: request.issued,
        until: request.until,
        evidence,
    };
    let path = fleet.grant(&grant)?;
    Ok((grant, path))
}

/// The stage of a drone's last grant and what it was signed for, as far as it counts with this flight controller.
fn inherited(
    fleet: &Fleet,
    request: &PromotionRequest,
) -> Result<(Option<GrantedStage>, Evidence), BadInput> {
    let last = fleet.last_grant(request.drone)?;
    let Some(last) = last.filter(|it| it.is_for(request.drone, it.stage).is_ok()) else {
        return Ok((None, Evidence::default()));
    };
    if last.controller == request.controller {
        return Ok((Some(last.stage), last.evidence));
    }
    let mut evidence = last.evidence;
    evidence.retain(|kind| !kind.is_of_controller());
    Ok((Some(GrantedStage::Bench), evidence))
}

/// The stage below. `None` below the lowest.
const fn before(stage: GrantedStage) -> Option<GrantedStage> {
    match stage {
        GrantedStage::Bench => None,
        GrantedStage::Tethered => Some(GrantedStage::Bench),
        GrantedStage::Flight => Some(GrantedStage::Tethered),
    }
}

/// Where evidence comes from, for people.
const fn source(kind: EvidenceKind) -> &'static str {
    match kind {
        EvidenceKind::Chaos => {
            "the file chaos.json of `muster chaos chaos-controllers --seeds 0..1000`, by this version, in which no plan broke a \
             rule"
        }
        EvidenceKind::Simulated => {
            "the file report.json of a completed flight with `vehicle.kind` = \"msp\", by `muster sim` or `muster swarm`"
        }
        EvidenceKind::Betaflight => {
            "the file report.json of a completed flight by `muster swarm --firmware`, with Betaflight's software build"
        }
        EvidenceKind::Bench => {
            "what `muster fc check DEVICE --receiver override --cli --json` prints"
        }
        EvidenceKind::Tether => {
            "the log of the drone's process (`log = \"json\"`), from its start to its landing in the stage \"tethered\""
        }
    }
}

#[cfg(test)]
mod tests;
