//! Gains of the flight by sticks from a hover test of the scenario's simulated aircraft.

mod flight;
mod gains;
mod response;
mod signal;

use muster_machines::msp::LandingCause;
use muster_machines::msp::controller::Gains;

use self::flight::Recording;
pub use self::gains::{Loop, Loops};
pub use self::response::Response;
use muster_scenarios::report::unplanned;
use muster_scenarios::scenario::Scenario;

/// Why a test gives no gains. Nothing is kept of it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TuneError {
    /// The controller refused to arm.
    #[error("the simulated flight controller did not arm within 30 s")]
    NotArmed,
    /// The link landed the aircraft.
    #[error("the aircraft landed by itself in the test{}", because(*.0))]
    Landed(Option<LandingCause>),
    /// It left the test's room.
    #[error("the aircraft strayed {strays_m:.1} m from where it hovered; the test ends at 6 m")]
    Strayed {
        /// Distance from the hover.
        strays_m: f64,
    },
    /// A rule was broken.
    #[error("the test broke a rule: {0}")]
    Broken(String),
    /// It did not come down.
    #[error("the aircraft was not down 30 s after it began to land")]
    NotDown,
    /// The measured positions do not show how the aircraft responds.
    #[error(
        "the step response can't be identified: the measured position has too large an error; use a more accurate \
         `[vehicle.pose]` or less wind"
    )]
    Unclear,
    /// It has too little thrust to be controlled.
    #[error(
        "the aircraft hovers at {:.0} % of its throttle, above {:.0} %: too heavy to be flown by sticks", 100.0 * .0,
        100.0 * gains::HOVER_THROTTLE_MAX
    )]
    Weak(f64),
}

fn because(cause: Option<LandingCause>) -> String {
    let why = cause.and_then(|it| unplanned(Some(it).into()));
    why.map_or_else(String::new, |why| format!(": {why}"))
}

/// Gains for an aircraft, and what they follow from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuned {
    /// How the aircraft responds.
    pub response: Response,
    /// Gains for it, to be put into the scenario.
    pub gains: Gains,
    /// The loops with the scenario's own gains.
    pub before: Loops,
    /// The loops with these gains.
    pub after: Loops,
}

/// How much more throttle is tried with an aircraft that did not leave the ground.
const MORE_THROTTLE: f64 = 1.2;

/// Flies the hover test with the scenario's own gains, and computes better ones. The scenario's vehicle is a flight
/// controller's; its seed draws the errors of its sensors.
///
/// # Errors
/// As [`TuneError`] says.
pub fn tune(scenario: &Scenario) -> Result<Tuned, TuneError> {
    let own = scenario.plan.gains;
    let recording = fly(scenario, own)?;
    let response = Response::of(&recording)?;
    let gains = gains::gains(own, &response)?;
    Ok(Tuned {
        response,
        gains,
        before: Loops::of(&own, &response),
        after: Loops::of(&gains, &response),
    })
}

/// Flies the test. With an aircraft that is too heavy to lift off at the hover throttle it begins anew with a higher one.
fn fly(scenario: &Scenario, own: Gains) -> Result<Recording, TuneError> {
    let mut gains = own;
    loop {
        match flight::fly(scenario, gains, scenario.seed) {
            Err(TuneError::Landed(Some(LandingCause::Thrust)))
                if gains.hover_throttle < gains::HOVER_THROTTLE_MAX =>
            {
                gains.hover_throttle *= MORE_THROTTLE;
            }
            result => return result,
        }
    }
}
