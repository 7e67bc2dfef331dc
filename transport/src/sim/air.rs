use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Config;
use super::bursts::BurstyLinks;
use super::disturbance::Disturbance;
use super::grid::Grid;
use super::propagation::Curve;
use crate::SendError;

/// What lies between the radios: where they are, how far they carry, and the lots that are drawn for it.
#[derive(Debug)]
pub(super) struct Air {
    pub(super) rng: ChaCha8Rng,
    grid: Grid,
    curve: Curve,
    loss: f64,
    bursts: Option<BurstyLinks>,
    pub(super) disturbance: Disturbance,
}

impl Air {
    pub(super) fn new(config: &Config, rng: ChaCha8Rng, places: &[Ned]) -> Self {
        let curve = Curve::new(config.propagation);
        Self {
            grid: Grid::new(curve.reach_m(), places),
            curve,
            loss: config.loss,
            bursts: config.bursts.map(BurstyLinks::new),
            disturbance: Disturbance::default(),
            rng,
        }
    }

    /// Puts a radio elsewhere; whether it was not there already.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) -> bool {
        self.grid.place(id, place)
    }

    pub(super) fn knows(&self, id: NodeId) -> bool {
        self.grid.place_of(id).is_some()
    }

    /// Overwrites `found` with the radios that may hear `from`, lowest first.
    pub(super) fn in_reach(
        &mut self,
        from: NodeId,
        found: &mut Vec<NodeId>,
    ) -> Result<(), SendError> {
        self.grid.put_in_order();
        self.grid.in_range(from, found)
    }

    /// Visits every two radios that may hear each other once, with the chances that a frame is lost on the way there and
    /// back.
    pub(super) fn each_link(&mut self, mut visit: impl FnMut(NodeId, NodeId, [f64; 2])) {
        self.grid.put_in_order();
        self.grid.each_pair_in_range(|a, b, distance_m| {
            let heard = self.heard_undisturbed(distance_m);
            let loss = |from, to| 1.0 - heard * (1.0 - self.spoilt(from, to));
            visit(a, b, [loss(a, b), loss(b, a)]);
        });
    }

    /// The chance that a frame from one radio is lost on its way to another, as things are now, 0 to 1.
    pub(super) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        let (Some(here), Some(there)) = (self.grid.place_of(from), self.grid.place_of(to)) else {
            return 1.0;
        };
        let distance_m = here.distance_m(there);
        if distance_m > self.curve.reach_m() {
            return 1.0;
        }
        1.0 - self.heard_undisturbed(distance_m) * (1.0 - self.spoilt(from, to))
    }

    fn heard_undisturbed(&self, distance_m: f64) -> f64 {
        let in_bursts = self.bursts.as_ref().map_or(0.0, BurstyLinks::mean_loss);
        self.curve.delivery(distance_m) * (1.0 - self.loss) * (1.0 - in_bursts)
    }

    /// The share of frames that is lost on the way from one radio to another because something disturbs it, 0 to 1.
    fn spoilt(&self, from: NodeId, to: NodeId) -> f64 {
        if self.disturbance.is_none() {
            return 0.0;
        }
        let place = self.grid.place_of(to);
        if place.is_some_and(|place| self.disturbance.is_jammed(place)) {
            return 1.0;
        }
        self.disturbance.loss(from, to)
    }

    /// Draws whether a frame gets from one radio to another that may hear it.
    pub(super) fn carries(&mut self, now: Timestamp, from: NodeId, to: NodeId) -> bool {
        if self.disturbance.loss(from, to) >= 1.0 {
            return false;
        }
        if let Some(bursts) = &mut self.bursts
            && bursts.is_lost(now, (from, to), &mut self.rng)
        {
            return false;
        }
        if self.curve.is_certain() {
            return true;
        }
        let (Some(here), Some(there)) = (self.grid.place_of(from), self.grid.place_of(to)) else {
            return false;
        };
        self.curve.is_heard(here.distance_m(there), &mut self.rng)
    }

    /// Draws whether a frame that got from one radio to another is lost all the same.
    pub(super) fn is_lost(&mut self, from: NodeId, to: NodeId) -> bool {
        let is_lost = self.loss > 0.0 && self.rng.random::<f64>() < self.loss;
        is_lost || (!self.disturbance.is_none() && self.is_spoilt(from, to))
    }

    fn is_spoilt(&mut self, from: NodeId, to: NodeId) -> bool {
        let loss = self.spoilt(from, to);
        loss >= 1.0 || (loss > 0.0 && self.rng.random::<f64>() < loss)
    }
}
