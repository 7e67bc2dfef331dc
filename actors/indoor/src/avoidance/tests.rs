use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

pub(super) const LIMITS: Limits = Limits {
    radius_m: 0.25,
    speed_max_mps: 0.5,
    turn_rate_max_rps: 1.5,
};
const CENTRE: (f64, f64) = (0.025, 0.025);

/// The grid with walls, each from one point to another, in metres from the drone.
fn grid(walls: &[[(f64, f64); 2]]) -> CertaintyGrid {
    let mut grid = CertaintyGrid::new(CENTRE);
    for [from, to] in walls {
        let steps = (libm::hypot(to.0 - from.0, to.1 - from.1) / CELL_M * 2.0)
            .ceil()
            .max(1.0);
        for step in 0..=steps as usize {
            let share = step as f64 / steps;
            grid.mark((
                CENTRE.0 + from.0 + (to.0 - from.0) * share,
                CENTRE.1 + from.1 + (to.1 - from.1) * share,
            ));
        }
    }
    grid
}

pub(super) fn situation(grid: &CertaintyGrid, goal_rad: f64) -> Situation<'_> {
    Situation {
        grid,
        goal_m: 3.0,
        goal_rad,
        course_rad: goal_rad,
        speed_mps: 0.0,
        turn_rate_rps: 0.0,
        blind: SectorSet::NONE,
    }
}

fn steered(method: Method, grid: &CertaintyGrid, goal_rad: f64) -> Option<Steering> {
    method.avoider(LIMITS).steer(&situation(grid, goal_rad))
}

#[test]
fn free_space_leads_straight_to_the_goal() {
    let grid = grid(&[]);
    for method in Method::ALL {
        for goal_rad in [0.0, 1.234, -2.9] {
            let steering = steered(method, &grid, goal_rad).unwrap();
            assert!((steering.course_rad - goal_rad).abs() < 0.05, "{method:?}");
            assert!(steering.speed_mps > 0.45, "{method:?}");
        }
    }
}

#[test]
fn a_wall_ahead_is_passed_on_one_side() {
    let grid = grid(&[[(0.8, -0.4), (0.8, 0.4)]]);
    for method in [Method::Vfh, Method::VfhPlus] {
        let steering = steered(method, &grid, 0.0).unwrap();
        let x = libm::cos(steering.course_rad);
        let y = libm::sin(steering.course_rad);
        // Where the course crosses the wall's line.
        let crosses_m = if x > 0.0 {
            (0.8 * y / x).abs()
        } else {
            f64::INFINITY
        };
        assert!(crosses_m > 0.4, "{method:?} {steering:?}");
    }
}

/// With the sectors that it can't turn to in motion, it had no way and waited for minutes.
#[test]
fn drone_at_rest_before_a_wall_that_it_looks_at_can_leave_it() {
    let grid = grid(&[[(0.2, -0.6), (0.2, 0.6)]]);
    let mut vfh_plus = Method::VfhPlus.avoider(LIMITS);
    let at_rest = Situation {
        course_rad: 0.0,
        ..situation(&grid, 0.8 * PI)
    };
    let steering = vfh_plus.steer(&at_rest).unwrap();
    assert!(libm::cos(steering.course_rad) < -0.5, "{steering:?}");
}

#[test]
fn vfh_plus_keeps_the_radius_where_vfh_does_not() {
    // A gap of 0.36 m: too narrow for a radius of 0.25 m.
    let grid = grid(&[[(1.0, 0.18), (1.0, 1.9)], [(1.0, -1.9), (1.0, -0.18)]]);
    let through = |steering: Option<Steering>| steering.is_some_and(|it| it.course_rad.abs() < 0.2);
    assert!(!through(steered(Method::VfhPlus, &grid, 0.0)));
    let wide = grid_with_gap(0.35);
    assert!(through(steered(Method::VfhPlus, &wide, 0.0)));
}

fn grid_with_gap(half_m: f64) -> CertaintyGrid {
    grid(&[[(1.0, half_m), (1.0, 1.9)], [(1.0, -1.9), (1.0, -half_m)]])
}

/// The trap of asin(r/d) for d < r: NaN would make the nearest obstacle the one that blocks nothing.
#[test]
fn an_obstacle_nearer_than_the_radius_blocks_its_half_circle() {
    for distance_m in [0.05, 0.1, 0.2, 0.25] {
        let grid = grid(&[[(distance_m, 0.0), (distance_m, 0.0)]]);
        let steering = steered(Method::VfhPlus, &grid, 0.0).expect("the other half is free");
        let away = steering.course_rad.abs();
        assert!(away > FRAC_PI_2 - 0.1, "{distance_m}: {away}");
    }
}

#[test]
fn surrounded_drones_have_no_direction_to_fly() {
    let walls = [
        (0.5, 0.5),
        (-0.5, 0.5),
        (-0.5, -0.5),
        (0.5, -0.5),
        (0.5, 0.5),
    ];
    let walls: Vec<_> = walls.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    let grid = grid(&walls);
    for method in [Method::Vfh, Method::VfhPlus] {
        assert_eq!(steered(method, &grid, 0.0), None, "{method:?}");
    }
}

#[test]
fn blind_sectors_are_never_chosen() {
    let blind: SectorSet = (0..SECTORS).filter(|it| !(30..40).contains(it)).collect();
    let grid = grid(&[]);
    for method in [Method::Vfh, Method::VfhPlus] {
        for goal in 0..12 {
            let situation = Situation {
                blind,
                ..situation(&grid, f64::from(goal) * 0.5)
            };
            let steering = method.avoider(LIMITS).steer(&situation).unwrap();
            let sector = sector_of(steering.course_rad);
            assert!((30..40).contains(&sector), "{method:?} {goal}: {sector}");
        }
        let situation = Situation {
            blind: SectorSet::ALL,
            ..situation(&grid, 0.0)
        };
        assert_eq!(method.avoider(LIMITS).steer(&situation), None);
    }
}

#[test]
fn hysteresis_keeps_a_sector_blocked_while_its_density_falls_a_little() {
    let mut vfh = VfhPlus::new(LIMITS);
    let mut grid = grid(&[]);
    let is_blocked = |vfh: &mut VfhPlus, grid: &CertaintyGrid| {
        let steering = vfh.steer(&situation(grid, 0.0)).unwrap();
        steering.course_rad.abs() > 0.01
    };
    let at = (CENTRE.0 + 1.5, CENTRE.1);
    let mut raised = 0;
    while !is_blocked(&mut vfh, &grid) {
        grid.raise(at);
        raised += 1;
    }
    assert!(raised > 1, "one echo blocks");
    let certainty = grid.certainty(at);
    grid.fade();
    grid.fade();
    assert!(grid.certainty(at) < certainty);
    assert!(is_blocked(&mut vfh, &grid));
    assert!(!is_blocked(&mut VfhPlus::new(LIMITS), &grid));
}

#[test]
fn a_drone_at_speed_does_not_turn_into_what_is_beside_it() {
    // A post to the left, the goal behind it, the drone flies straight on.
    let grid = grid(&[[(0.3, 0.42), (0.3, 0.42)]]);
    let mut situation = Situation {
        course_rad: 0.0,
        ..situation(&grid, 2.4)
    };
    let slow = Method::VfhPlus.avoider(LIMITS).steer(&situation).unwrap();
    assert!(slow.course_rad > 1.5, "{slow:?}");
    situation.speed_mps = 0.5;
    let fast = Method::VfhPlus.avoider(LIMITS).steer(&situation).unwrap();
    assert!(!(0.3..PI).contains(&fast.course_rad), "{fast:?}");
}

#[test]
fn speed_falls_with_density_and_with_the_turn_rate() {
    for method in [Method::Vfh, Method::VfhPlus] {
        let free = grid(&[]);
        let walls = grid(&[
            [(-1.0, 0.45), (1.0, 0.45)],
            [(-1.0, -0.45), (1.0, -0.45)],
            [(1.5, -0.2), (1.5, 0.2)],
        ]);
        let in_free = steered(method, &free, 0.0).unwrap().speed_mps;
        let between_walls = steered(method, &walls, 0.0).unwrap().speed_mps;
        assert!(between_walls < 0.8 * in_free, "{method:?}");
        let turning = Situation {
            turn_rate_rps: -0.75,
            ..situation(&free, 0.0)
        };
        let turning = method.avoider(LIMITS).steer(&turning).unwrap().speed_mps;
        assert!((turning / in_free - 0.5).abs() < 0.01, "{method:?}");
    }
}
