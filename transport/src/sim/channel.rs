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

/// The radio channel: positions, propagation, losses, and the random draws for them.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) rng: ChaCha8Rng,
    grid: Grid,
    curve: Curve,
    loss: f64,
    bursts: Option<BurstyLinks>,
    pub(super) disturbance: Disturbance,
}

impl Channel {
    pub(super) fn new(config: &Config, rng: ChaCha8Rng, positions: &[Ned]) -> Self {
        let curve = Curve::new(config.propagation);
        Self {
            grid: Grid::new(curve.reach_m(), positions),
            curve,
            loss: config.loss,
            bursts: config.bursts.map(BurstyLinks::new),
            disturbance: Disturbance::default(),
            rng,
        }
    }

    /// Moves a radio. Returns whether its position changed.
    pub(super) fn set_position(&mut self, id: NodeId, position: Ned) -> bool {
        self.grid.set_position(id, position)
    }

    pub(super) fn knows(&self, id: NodeId) -> bool {
        self.grid.position(id).is_some()
    }

    /// Overwrites `found` with the radios in reach of `from`, lowest first.
    pub(super) fn in_reach(
        &mut self,
        from: NodeId,
        found: &mut Vec<NodeId>,
    ) -> Result<(), SendError> {
        self.grid.sort();
        self.grid.in_range(from, found)
    }

    /// Visits each pair of radios in reach once, with the loss probabilities there and back.
    pub(super) fn each_link(&mut self, mut visit: impl FnMut(NodeId, NodeId, [f64; 2])) {
        self.grid.sort();
        self.grid.each_pair_in_range(|a, b, distance_m| {
            let delivery = self.undisturbed_delivery(distance_m);
            let loss = |from, to| 1.0 - delivery * (1.0 - self.disturbance_loss(from, to));
            visit(a, b, [loss(a, b), loss(b, a)]);
        });
    }

    /// The current loss probability from one radio to another, 0 to 1.
    pub(super) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        let (Some(sender), Some(receiver)) = (self.grid.position(from), self.grid.position(to))
        else {
            return 1.0;
        };
        let distance_m = sender.distance_m(receiver);
        if distance_m > self.curve.reach_m() {
            return 1.0;
        }
        1.0 - self.undisturbed_delivery(distance_m) * (1.0 - self.disturbance_loss(from, to))
    }

    fn undisturbed_delivery(&self, distance_m: f64) -> f64 {
        let in_bursts = self.bursts.as_ref().map_or(0.0, BurstyLinks::mean_loss);
        self.curve.delivery(distance_m) * (1.0 - self.loss) * (1.0 - in_bursts)
    }

    /// The loss probability from one radio to another due to jammers and link faults, 0 to 1.
    fn disturbance_loss(&self, from: NodeId, to: NodeId) -> f64 {
        if self.disturbance.is_empty() {
            return 0.0;
        }
        let receiver = self.grid.position(to);
        if receiver.is_some_and(|receiver| self.disturbance.is_jammed(receiver)) {
            return 1.0;
        }
        self.disturbance.loss(from, to)
    }

    /// Draws whether a frame reaches a radio in reach, so that it can sense it.
    pub(super) fn draw_reception(&mut self, now: Timestamp, from: NodeId, to: NodeId) -> bool {
        if self.disturbance.loss(from, to) >= 1.0 {
            return false;
        }
        if let Some(bursts) = &mut self.bursts
            && bursts.draw_loss(now, (from, to), &mut self.rng)
        {
            return false;
        }
        if self.curve.is_certain() {
            return true;
        }
        let (Some(sender), Some(receiver)) = (self.grid.position(from), self.grid.position(to))
        else {
            return false;
        };
        self.curve
            .draw_delivery(sender.distance_m(receiver), &mut self.rng)
    }

    /// Draws whether a frame that reached a radio is lost there.
    pub(super) fn draw_loss(&mut self, from: NodeId, to: NodeId) -> bool {
        let is_lost = self.loss > 0.0 && self.rng.random::<f64>() < self.loss;
        is_lost || (!self.disturbance.is_empty() && self.draw_disturbance(from, to))
    }

    fn draw_disturbance(&mut self, from: NodeId, to: NodeId) -> bool {
        let loss = self.disturbance_loss(from, to);
        loss >= 1.0 || (loss > 0.0 && self.rng.random::<f64>() < loss)
    }
}
