//! Five agents of the kind that people know. `docs/src/extend/examples` has a page for each.

mod auction;
mod flocking;
mod lanes;
mod mule;
mod pursuit;

use muster::agent::Context;
use muster::{AgentFactory, Agents, Ned};

/// The agents, by name.
pub(crate) fn agents() -> Agents {
    Agents::default()
        .with("auction", AgentFactory::new(auction::Auction::new))
        .with("flocking", AgentFactory::new(flocking::Flocking::new))
        .with("lanes", AgentFactory::new(lanes::Lanes::new))
        .with("mule", AgentFactory::new(mule::Mule::new))
        .with("pursuit", AgentFactory::new(pursuit::Pursuit::new))
}

/// A place at the altitude of this drone alone, 6 m above the drone before it, so that paths may cross.
fn at_own_altitude(place: Ned, context: &Context<'_>) -> Ned {
    place.at_altitude(context.slot().altitude_m() + 6.0 * f64::from(context.id().0))
}
