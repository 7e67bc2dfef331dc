//! Estimator, guidance and control of a vehicle: the sticks that it is given.

use std::time::Duration;

use muster_msp::Sticks;

use super::authority::Handover;
use super::checkpoint::Flight;
use super::config::{Config, Stage};
use super::control::{Control, Lean};
use super::estimator::{Estimate, Estimator, Tilt};
use super::guidance::Guidance;
use super::impairment::{Finding, Response, Watch};
use super::lift::Lift;
use super::tether;
use super::touchdown::{Descent, Touchdown};
use crate::geometry::{Ned, Velocity};
use crate::msp::{LandingCause, Setpoint};
use crate::time::Timestamp;

/// Longest time that one control step covers, in seconds.
const STEP_MAX_S: f64 = 0.1;

/// Time without a height after which a vehicle can't be flown. An estimate that is predicted for so long may be metres off.
pub const HEIGHT_LOST_AFTER: Duration = Duration::from_secs(3);

/// Above its start a vehicle is high from this height on, in metres: well above what a drifting barometer may show on the ground.
/// Ours, as the next two.
const HIGH_M: f64 = 3.0;
/// Below this height it is no longer.
const NOT_HIGH_M: f64 = 1.5;
/// A vehicle that was high and is found below this height after a restart was brought down meanwhile.
const LOW_M: f64 = 1.0;

/// What a vehicle flies that a pilot handed over in the air before it was told anything.
const fn hold(altitude_m: f64) -> Setpoint {
    Setpoint::Hold {
        altitude_m,
        vertical_mps: 1.0,
        acceleration_mps2: 1.0,
    }
}

/// Who has the sticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hands {
    /// The motors are off, or are to stop.
    None,
    /// A pilot or the controller's failsafe, who took them from the link.
    Others,
    /// A pilot, who may give them to the link.
    Pilot,
    /// The link.
    Link,
}

/// Estimator, guidance and control.
///
/// Invariant: the vehicle is kept level until it has left the ground, and never thrusts before its place is known.
#[derive(Debug)]
pub(super) struct ControlLoops {
    /// What was flown before a restart, until it is taken up.
    before: Option<Flight>,
    /// Where it was when it was first told to fly; of a tethered vehicle once its place is known.
    start: Option<Ned>,
    pub(super) estimator: Estimator,
    guidance: Guidance,
    control: Control,
    stepped_at: Timestamp,
    lift: Lift,
    /// Whether it is well above where it was first told to fly.
    is_high: bool,
    touchdown: Touchdown,
    pub(super) watch: Watch,
    /// Why it must land, if the aircraft does not do what it is told. The first reason counts.
    impaired: Option<LandingCause>,
}

impl ControlLoops {
    /// Of a vehicle that stands, or that flew this before a restart.
    pub(super) fn new(config: &Config, before: Option<Flight>, now: Timestamp) -> Self {
        let mut gains = match config.stage {
            Stage::Tethered => tether::gains(config.gains),
            Stage::Sim | Stage::Bench | Stage::Flight => config.gains,
        };
        if let Some(flight) = before {
            gains.hover_throttle = flight.hover_throttle;
        }
        let impaired = before.and_then(|it| it.impaired);
        let mut control = Control::new(gains);
        if impaired == Some(LandingCause::Thrust) {
            control.expect_little_thrust();
        }
        Self {
            before,
            start: before.and_then(|it| it.start),
            estimator: Estimator::new(config, now, before.and_then(|it| it.ground_m)),
            guidance: Guidance::new(config.landing),
            control,
            stepped_at: now,
            lift: match before.and_then(|it| it.setpoint) {
                Some(_) => Lift::Left,
                None => Lift::Ground,
            },
            is_high: before.is_some_and(|it| it.is_high),
            touchdown: Touchdown::default(),
            watch: Watch::default(),
            impaired,
        }
    }

    /// Where it was when it was first told to fly.
    pub(super) const fn start(&self) -> Option<Ned> {
        self.start
    }

    /// What it was told to fly, perhaps before a restart.
    pub(super) fn setpoint(&self) -> Option<Setpoint> {
        let before = self.before.and_then(|it| it.setpoint);
        self.guidance.setpoint().or(before)
    }

    /// Where it began to fly that.
    pub(super) fn from(&self) -> Option<Ned> {
        let before = self.before.and_then(|it| it.from);
        self.guidance.from().or(before)
    }

    /// The throttle at which the vehicle hovers, 0 to 1, as learnt so far.
    pub(super) fn hover_throttle(&self) -> f64 {
        self.control.hover_throttle()
    }

    /// Why it must land, if the aircraft does not do what it is told.
    pub(super) const fn impaired(&self) -> Option<LandingCause> {
        self.impaired
    }

    /// Whether it has begun to land.
    pub(super) const fn is_landing(&self) -> bool {
        self.guidance.is_landing()
    }

    /// End of the current leg.
    pub(super) const fn target(&self) -> Option<Ned> {
        self.guidance.target()
    }

    /// The vehicle was armed, by a pilot or by the link: it stands.
    pub(super) fn arm(&mut self, now: Timestamp) {
        self.lift = Lift::Ground;
        self.estimator.forget_height(now);
    }

    /// The vehicle was found armed: it may be in the air. Not if the link had the sticks on the ground before a restart.
    /// `was_disarmed`: it was when it was last heard.
    pub(super) fn meet(&mut self, now: Timestamp, was_disarmed: bool) {
        if was_disarmed {
            self.estimator.forget_height(now);
        }
        let stood = self
            .before
            .is_some_and(|it| it.taken.handover == Handover::Given && !it.is_landing);
        if self.lift == Lift::Ground && !stood {
            self.lift = Lift::Unknown;
        }
        self.estimator.set_ground_where_armed();
    }

    /// Flies an armed vehicle to a setpoint.
    pub(super) fn fly(&mut self, now: Timestamp, stage: Stage, setpoint: Setpoint) {
        self.estimator.set_ground();
        if let Some(estimate) = self.estimator.estimate() {
            self.before = None;
            if stage != Stage::Tethered || self.estimator.lost_for(now).is_none() {
                self.start.get_or_insert(estimate.position);
            }
            let setpoint = match stage {
                Stage::Tethered => tether::setpoint(self.start, setpoint),
                Stage::Sim | Stage::Bench | Stage::Flight => setpoint,
            };
            self.guidance.fly(now, setpoint, &estimate);
        }
    }

    /// Binds a tethered vehicle that was told to fly before its place was known to where it is found.
    fn bind(&mut self, now: Timestamp, stage: Stage, estimate: &Estimate) {
        let is_due = stage == Stage::Tethered
            && self.start.is_none()
            && self.estimator.lost_for(now).is_none();
        if let Some(setpoint) = self.guidance.setpoint().filter(|_| is_due) {
            self.guidance.begin_anew(now, estimate);
            self.fly(now, stage, setpoint);
        }
    }

    /// Begins to land an armed vehicle, once it is known where it is.
    pub(super) fn land(&mut self, now: Timestamp) {
        if let Some(estimate) = self.estimator.estimate() {
            self.guidance.land(now, &estimate);
        }
    }

    /// Goes on with what was flown before a restart, once it is known where the vehicle is. Returns whether it is not: the vehicle
    /// was high, and is found near the ground; somebody else has brought it down.
    pub(super) fn take_up(&mut self, now: Timestamp, is_armed: bool) -> bool {
        let Some(estimate) = self.estimator.estimate() else {
            return false;
        };
        let Some(before) = self.before.take().filter(|_| is_armed) else {
            return false;
        };
        let is_low = self.climbed_m(&estimate).is_some_and(|it| it < LOW_M);
        if before.is_high && is_low && !before.is_landing {
            return true;
        }
        if let Some(setpoint) = before.setpoint {
            self.guidance
                .take_up(now, (setpoint, before.from), &estimate);
        }
        false
    }

    /// Height above where it was first told to fly.
    fn climbed_m(&self, estimate: &Estimate) -> Option<f64> {
        let start = self.start?;
        Some(estimate.position.altitude_m() - start.altitude_m())
    }

    /// Whether it is well above where it was first told to fly.
    pub(super) const fn is_high(&self) -> bool {
        self.is_high
    }

    /// The newest sticks. `may_hold`: a vehicle that was handed over in the air, and told nothing, is to stay there.
    pub(super) fn sticks(
        &mut self,
        now: Timestamp,
        stage: Stage,
        hands: Hands,
        may_hold: bool,
    ) -> Sticks {
        let seconds = now.since(self.stepped_at).as_secs_f64().min(STEP_MAX_S);
        self.stepped_at = now;
        self.estimator.expect_up(0.0);
        let tilt = self.estimator.tilt();
        match hands {
            Hands::None => {
                self.lift = Lift::Ground;
                return Sticks::IDLE;
            }
            Hands::Others => return self.stand_by(tilt),
            Hands::Pilot | Hands::Link => {}
        }
        let had_setpoint = self.before.is_some_and(|it| it.setpoint.is_some());
        let was_flying = self.lift == Lift::Left || had_setpoint;
        let Some(estimate) = self.estimator.estimate() else {
            // Right after a restart in the air, or right after arming.
            return self.level_if(was_flying || self.lift == Lift::Unknown, tilt);
        };
        let altitude_m = estimate.position.altitude_m();
        if let Some(climbed_m) = self.climbed_m(&estimate).filter(|_| self.before.is_none()) {
            self.is_high = climbed_m > if self.is_high { NOT_HIGH_M } else { HIGH_M };
        }
        let is_in_air = self.lift.look(altitude_m, -estimate.velocity.0.z);
        if hands == Hands::Pilot {
            // What it gives is not heard, until the pilot hands the sticks over.
            self.estimator.set_ground_where_armed();
            self.guidance.begin_anew(now, &estimate);
            return self.level_if(is_in_air, tilt);
        }
        if is_in_air && may_hold && self.guidance.setpoint().is_none() {
            self.fly(now, stage, hold(altitude_m));
        }
        if self.watch.is_tilted() {
            return self.control.upright();
        }
        self.follow(now, stage, &estimate, seconds)
            // Right after a restart in the air; else on the ground, before the first setpoint.
            .unwrap_or_else(|| self.level_if(was_flying, tilt))
    }

    /// Sticks of a vehicle that others fly: not heard, unless the pilot gives the sticks back.
    fn stand_by(&mut self, tilt: Tilt) -> Sticks {
        self.estimator.set_ground_where_armed();
        let may_fly = match self.estimator.estimate() {
            Some(estimate) => {
                let climb_mps = -estimate.velocity.0.z;
                self.lift.look(estimate.position.altitude_m(), climb_mps);
                self.lift == Lift::Left
            }
            None => self.lift != Lift::Ground,
        };
        self.level_if(may_fly, tilt)
    }

    /// Sticks that follow the reference; `None` before the first setpoint.
    fn follow(
        &mut self,
        now: Timestamp,
        stage: Stage,
        estimate: &Estimate,
        seconds: f64,
    ) -> Option<Sticks> {
        self.bind(now, stage, estimate);
        let still_for = self.touchdown.still_for(now);
        let is_blind = self.estimator.is_blind(now);
        let reference = (self.guidance).reference(now, estimate, still_for, is_blind)?;
        let reference = match stage {
            Stage::Tethered => tether::reference(self.start, reference),
            Stage::Sim | Stage::Bench | Stage::Flight => reference,
        };
        let is_free = self.lift == Lift::Left && !self.touchdown.is_pressed();
        let lean = match self.estimator.lost_for(now) {
            _ if !is_free => Lean::Level,
            Some(_) => Lean::Steady,
            None => Lean::Free,
        };
        let tilt = self.estimator.tilt();
        let sticks = (self.control).step(seconds, &reference, estimate, tilt, (lean, is_blind));
        (self.estimator).expect_up(-self.control.expected_down_mps2());
        Some(sticks)
    }

    fn level_if(&mut self, flies: bool, tilt: Tilt) -> Sticks {
        if flies {
            self.control.level(tilt)
        } else {
            Sticks::IDLE
        }
    }

    /// Looks whether an aircraft that the link flies (`is_flown`) does what it is told.
    pub(super) fn detect_impairment(&mut self, now: Timestamp, is_flown: bool) -> Remedy {
        let estimate = self.estimator.estimate().filter(|_| is_flown);
        let response = estimate.map(|estimate| Response {
            tilt_rad: libm::acos(self.estimator.tilt().vertical_share()),
            up_mps2: -self.control.sure_down_mps2(),
            climb_mps: -estimate.velocity.0.z,
            is_in_air: self.lift == Lift::Left,
        });
        let Some(finding) = self.watch.look(now, response) else {
            return Remedy::default();
        };
        if let Finding::Impaired(cause) = finding {
            self.impaired.get_or_insert(cause);
            match estimate.filter(|_| cause == LandingCause::Thrust) {
                Some(_) if self.lift == Lift::Left => self.control.expect_little_thrust(),
                // Its reference has risen without it.
                Some(estimate) => self.guidance.begin_anew(now, &estimate),
                None => {}
            }
        }
        Remedy {
            must_land: finding != Finding::Tipped,
            must_stop_motors: finding == Finding::Tipped,
        }
    }

    /// Whether the height has been unknown for too long to fly on.
    pub(super) fn is_height_lost(&self, now: Timestamp) -> bool {
        self.estimator.height_age(now) > HEIGHT_LOST_AFTER
    }

    /// Whether a vehicle that the link (`is_links`) lands has come to the ground.
    pub(super) fn has_landed(&mut self, now: Timestamp, is_links: bool) -> bool {
        let estimate = self.estimator.estimate();
        let descent = estimate.filter(|_| is_links && self.guidance.is_landing());
        let descent = descent.map(|estimate| Descent {
            down_mps2: self.control.sure_down_mps2(),
            height_m: estimate.position.altitude_m(),
            height_age: self.estimator.height_age(now),
            is_expected: self.guidance.expects_ground(now),
            is_shaken: self.watch.is_shaken(),
        });
        self.touchdown.look(now, descent)
    }

    /// Where it is, in the drone's local frame, and how it moves; home at rest while that is not known.
    pub(super) fn estimate(&self) -> Estimate {
        self.estimator.estimate().unwrap_or(Estimate {
            position: Ned::HOME,
            velocity: Velocity::ZERO,
        })
    }

    /// Where the vehicle would come to rest if it braked now, and whether it has come to rest.
    pub(super) fn rest(&self, now: Timestamp, estimate: &Estimate) -> (Ned, bool) {
        let stop = self.guidance.stop(now, estimate);
        (stop, self.guidance.is_at_rest(now, estimate))
    }
}

/// What is to be done with an aircraft that does not do what it is told.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Remedy {
    /// It must land.
    pub(super) must_land: bool,
    /// It has not left the ground, or lies on its side.
    pub(super) must_stop_motors: bool,
}
