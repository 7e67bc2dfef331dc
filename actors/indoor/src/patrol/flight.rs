//! From where to fly to a velocity: what is near, the direction that avoids it, and the guard.

use std::f64::consts::{FRAC_PI_2, TAU};

use muster_machines::indoor::Velocity;
use muster_machines::time::Timestamp;

use super::config::{Config, PERIOD};
use super::guard::guarded;
use super::place::Place;
use super::route::Order;
use super::sonars::{Sonars, expected_m};
use crate::avoidance::{Avoider, CELL_M, CertaintyGrid, SIDE, SectorSet, Situation};
use crate::frames::{BodyXy, OdometryPose, OdometryXy, wrapped_rad};
use crate::map::State;
use crate::reading::{Echo, Reading};

/// Turn rate while the drone looks round, in rad/s: the camera turns 5° between two looks.
const LOOK_RPS: f64 = 0.9;
/// Turn rate per radian that the heading is off, in 1/s.
const TURN_GAIN: f64 = 2.5;
/// An echo from so much nearer than the map's wall is something else, in metres.
const UNKNOWN_M: f64 = 0.25;
/// Steps between two fadings: what gave two echoes and no more is forgotten in 3 s, what moves on leaves no trail.
const FADE_STEPS: u32 = 5;
/// The same while a sonar fails: what only it would hear is remembered longer.
const FADE_STEPS_BLIND: u32 = 15;
/// Speed below which a drone is at rest, in m/s.
const MOVING_MPS: f64 = 0.05;
/// Share of the braking that the approach to a stop uses.
const GENTLE: f64 = 0.5;

#[derive(Debug)]
pub(super) struct Flight {
    /// What the map doesn't know, from echoes.
    found: CertaintyGrid,
    avoider: Box<dyn Avoider>,
    course_rad: f64,
    speed_mps: f64,
    turn_rps: f64,
    steps: u32,
}

impl Flight {
    pub(super) fn new(config: &Config) -> Self {
        Self {
            found: CertaintyGrid::new((0.0, 0.0)),
            avoider: config.method.avoider(config.limits),
            course_rad: 0.0,
            speed_mps: 0.0,
            turn_rps: 0.0,
            steps: 0,
        }
    }

    /// Forgets what was found near: something that moved may have left its traces.
    pub(super) fn forget(&mut self) {
        self.found.clear();
    }

    /// Takes in readings and the motion since `before`.
    pub(super) fn sense(
        &mut self,
        config: &Config,
        place: &Place,
        sonars: &Sonars,
        (readings, before): (&[Reading], OdometryPose),
    ) {
        let now = place.odometry();
        let motion = before.motion_to(now);
        self.speed_mps = libm::hypot(motion.forward_m, motion.left_m) / PERIOD.as_secs_f64();
        self.turn_rps = motion.turn_rad / PERIOD.as_secs_f64();
        if self.speed_mps > MOVING_MPS {
            self.course_rad = before.at.bearing_rad(now.at);
        }
        self.found.move_to((now.at.x_m, now.at.y_m));
        self.steps += 1;
        let fade_steps = if sonars.has_fault() {
            FADE_STEPS_BLIND
        } else {
            FADE_STEPS
        };
        if self.steps.is_multiple_of(fade_steps) {
            self.found.fade();
        }
        for reading in readings {
            self.mark(config, place, reading);
        }
    }

    /// Raises the cell on the axis that an echo came from, unless it came from a wall of the map, and lowers those before it in its
    /// cone.
    fn mark(&mut self, config: &Config, place: &Place, reading: &Reading) {
        let mounting = &reading.mounting;
        let now = place.odometry();
        let axis_rad = now.heading_rad + mounting.bearing_rad;
        let range_m = match reading.echo {
            Echo::At(range_m) => range_m,
            Echo::Silence => mounting.range_max_m,
            Echo::Failed => return,
        };
        self.found
            .lower_cone((axis_rad, mounting.aperture_rad), range_m);
        let expected = expected_m(config.floor.map(), place.pose(), mounting);
        let is_known = expected.is_some_and(|wall_m| range_m > wall_m - UNKNOWN_M);
        if matches!(reading.echo, Echo::At(_)) && !is_known {
            let at = now.place(mounting.at).towards(axis_rad, range_m);
            self.found.raise((at.x_m, at.y_m));
        }
    }

    /// What was found, and the map's walls and keep-out zones where the pose has them. A drone that is in a zone may cross it: it
    /// leaves along its path.
    fn surroundings(&self, config: &Config, place: &Place) -> CertaintyGrid {
        let mut grid = self.found.clone();
        let (map, pose, odometry) = (config.floor.map(), place.pose(), place.odometry());
        let reach = SIDE as i64 / 2;
        let is_inside = map.cell(pose.at).is_some_and(|own| map.is_kept_out(own));
        let is_closed =
            |cell| map.state(cell) != State::Free || (map.is_kept_out(cell) && !is_inside);
        for row in -reach..=reach {
            for column in -reach..=reach {
                let offset = OdometryXy::new(
                    odometry.at.x_m + column as f64 * CELL_M,
                    odometry.at.y_m + row as f64 * CELL_M,
                );
                let cell = map.cell(pose.place(odometry.sight(offset)));
                if cell.is_none_or(is_closed) {
                    grid.mark((offset.x_m, offset.y_m));
                }
            }
        }
        grid
    }

    /// The velocity that follows an order.
    pub(super) fn velocity(
        &mut self,
        now: Timestamp,
        config: &Config,
        place: &Place,
        sonars: &Sonars,
        order: &Order,
    ) -> Velocity {
        let turn = |turn_rps: f64| Velocity {
            turn_rps,
            ..Velocity::default()
        };
        match order {
            Order::Search => turn(LOOK_RPS / 2.0),
            Order::Look => turn(LOOK_RPS),
            Order::Wait | Order::Done | Order::GiveUp(_) => turn(0.0),
            Order::Fly { to, left_m } => {
                let seen = place.pose().sight(*to);
                let watches = sonars.watches(now);
                let Some(leading_rad) = sonars.leading_rad(now) else {
                    return turn(LOOK_RPS);
                };
                let Some((direction_rad, speed_mps)) =
                    self.steer(config, place, (leading_rad, seen))
                else {
                    return turn(0.0);
                };
                let turn_max = config.limits.turn_rate_max_rps;
                let turn_to = |bearing_rad: f64| {
                    let off_rad = wrapped_rad(bearing_rad - leading_rad);
                    (TURN_GAIN * off_rad).clamp(-turn_max, turn_max)
                };
                // Away from where it leads is no way: the drone waits and looks along it; the route finds another.
                let bearing_rad = libm::atan2(seen.y_m, seen.x_m);
                if wrapped_rad(direction_rad - bearing_rad).abs() > FRAC_PI_2 {
                    return turn(turn_to(bearing_rad));
                }
                let gentle_mps =
                    libm::sqrt(2.0 * GENTLE * config.acceleration_mps2 * left_m.max(0.0));
                let speed_mps = speed_mps.min(gentle_mps);
                let wanted = Velocity {
                    forward_mps: speed_mps * libm::cos(direction_rad),
                    left_mps: speed_mps * libm::sin(direction_rad),
                    turn_rps: turn_to(direction_rad),
                };
                guarded(wanted, &watches, config.acceleration_mps2)
            }
        }
    }

    /// Direction in the body frame and speed towards a point of the body frame.
    fn steer(
        &mut self,
        config: &Config,
        place: &Place,
        (leading_rad, to): (f64, BodyXy),
    ) -> Option<(f64, f64)> {
        let grid = self.surroundings(config, place);
        let heading_rad = place.odometry().heading_rad;
        // A drone at rest may start into any direction; where it looks it can start at once.
        let (course_rad, speed_mps) = if self.speed_mps > MOVING_MPS {
            (self.course_rad, self.speed_mps)
        } else {
            (heading_rad + leading_rad, 0.0)
        };
        let bearing_rad = libm::atan2(to.y_m, to.x_m);
        let steering = self.avoider.steer(&Situation {
            grid: &grid,
            goal_m: libm::hypot(to.x_m, to.y_m),
            goal_rad: (heading_rad + bearing_rad).rem_euclid(TAU),
            course_rad,
            speed_mps,
            turn_rate_rps: self.turn_rps,
            // Sonars are turned to the course, so no direction is blind for good; the guard has the last word.
            blind: SectorSet::NONE,
        })?;
        Some((
            wrapped_rad(steering.course_rad - heading_rad),
            steering.speed_mps,
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::frames::{MapPose, Motion};
    use crate::map::Map;
    use crate::patrol::tests::config_of;

    #[test]
    fn zones_are_closed_to_a_drone_outside_and_open_to_one_inside() {
        let plan = [
            "#".repeat(60),
            format!("#{}{}#", ".".repeat(38), "x".repeat(20)),
            "#".repeat(60),
        ];
        let rows = [&plan[..1], &vec![plan[1].clone(); 38], &plan[2..]].concat();
        let map = Arc::new(Map::from_text(&rows.join("\n"), 0.05).unwrap());
        let config = config_of(&map, MapPose::new(1.0, 1.0, 0.0), 1.0);
        let mut place = Place::new(&config, 1, Timestamp::ZERO, None);
        let flight = Flight::new(&config);
        let marked = |flight: &Flight, place: &Place, x_m: f64| {
            let own = place.odometry().at;
            let mut grid = flight.surroundings(&config, place);
            grid.move_to((own.x_m, own.y_m));
            grid.certainty((own.x_m + x_m, own.y_m))
        };
        assert_eq!(marked(&flight, &place, 0.85), 0);
        assert_eq!(
            marked(&flight, &place, 1.0),
            crate::avoidance::CERTAINTY_MAX
        );
        place.moved(Motion {
            forward_m: 1.2,
            ..Motion::default()
        });
        let mut flight = flight;
        flight.found.move_to((1.2, 0.0));
        assert_eq!(marked(&flight, &place, 0.2), 0);
        assert_eq!(
            marked(&flight, &place, 0.85),
            crate::avoidance::CERTAINTY_MAX,
            "the wall"
        );
    }
}
